"""A scene at its start as a table of text, and as a picture: `supervessel show`."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from supervessel.drawing.drawing import drawing
from supervessel.drawing.figure import svg
from supervessel.drawing.geometry import Assembly, equivalent_box
from supervessel.drawing.raster import png
from supervessel.scene.numbers import EPSILON

Array = NDArray[np.float64]

PICTURES = {".svg": b"<?xml", ".png": b"\x89PNG\r\n\x1a\n"}
"""Endings of the files that a picture can be written to, and what such files begin with."""

NAME_WIDTH = 18
"""Letters of a vessel's name in the table; a longer one keeps its beginning and is cut."""

EQUAL_MOMENTS = 64.0 * EPSILON
"""Difference of two principal moments, over the largest, below which rounding alone may have made it: each
element of the tensor is off by a few u of the sum of its terms, and the eigenvalues by as much. The axes
across are then any two."""


def picture(parts: Assembly, ending: str) -> bytes:
    """Returns the drawing of an assembly as the content of a file with an ending of PICTURES."""
    figure = drawing(parts)
    return png(figure) if ending == ".png" else svg(figure).encode()


def overview(parts: Assembly) -> str:
    """Returns composite and vessels of a scene at its start values, in lines.

    No line is longer than 80 characters where places and edges take six each.
    """
    return "\n".join([*_composite(parts), "", *_vessels(parts)])


def _composite(parts: Assembly) -> Iterator[str]:
    """Yields mass, barycentre, tensor, principal moments and axes."""
    scene, whole = parts.scene, parts.whole
    xx, yy, zz, xy, xz, yz = whole["inertia"]
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    yield f"{_cut(scene.name, 50)}: {_counted(len(scene.vessels), 'vessel')}, at the start"
    yield f"axes: those of {_cut(scene.root, 30)}, the root, which are the body axes"
    yield ""
    yield f"mass             {_number(whole['mass'][0])} kg"
    yield f"barycentre       {_vector(whole['barycentre'])} m"
    yield f"moments / mass   {_vector(whole['pmi'])} m2 (output pmi)"
    yield f"inertia          {_vector(tensor[0])} kg m2"
    yield from (f"                 {_vector(row)}" for row in tensor[1:])
    yield "principal        moment [kg m2]    axis"
    moments, axes = np.linalg.eigh(tensor)
    for moment, axis in zip(moments, axes.T, strict=True):
        yield f"                 {_number(moment):<14}    {_vector(_pointing(axis))}"
    equal = [i for i in (0, 1) if moments[i + 1] - moments[i] <= EQUAL_MOMENTS * moments[2]]
    if equal:
        which = "all three are" if len(equal) == 2 else "two are"
        yield f"                 {which} equal: their axes are any at right angles"


def _vessels(parts: Assembly) -> Iterator[str]:
    """Yields a line for each vessel: mass, equivalent box, centre of mass."""
    scene = parts.scene
    yield f"{'vessel':<{NAME_WIDTH}} {'mass [kg]':>9}  {'box [m]':<20}  centre of mass [m]"
    turned = False
    for name, vessel in scene.vessels.items():
        axes, semi = equivalent_box(vessel)
        tilt = np.array_equal(axes, np.eye(3))
        turned = turned or not tilt
        box = " x ".join(_short_number(2.0 * edge) for edge in semi) + ("" if tilt else " *")
        if vessel.mass == 0.0:
            box = "none: no mass"
        centre = "not joined at the start"
        if name in parts.poses:
            R_root_vessel, origin = parts.poses[name]
            place = origin + R_root_vessel @ np.array(vessel.centre_of_mass)
            centre = "  ".join(map(_short_number, place))
        yield f"{_cut(name, NAME_WIDTH):<{NAME_WIDTH}} {_short_number(vessel.mass):>9}  {box:<20}  {centre}"
    yield ""
    yield "box: the uniform cuboid with the vessel's mass and moments, edges along its axes"
    if turned:
        yield "  *: along its principal axes, ascending moments, for its tensor has products"


def _pointing(axis: Array) -> Array:
    """Returns an axis, or its opposite, whose largest component is positive; rounding's remains are zero."""
    axis = np.where(np.abs(axis) < EPSILON, 0.0, axis)
    signed: Array = axis if axis[np.argmax(np.abs(axis))] > 0.0 else 0.0 - axis
    return signed


def _vector(values: Sequence[float] | Array) -> str:
    return f"[{', '.join(map(_number, values))}]"


def _number(value: float) -> str:
    """Returns a number of six digits; a negative zero has no sign."""
    return f"{value + 0.0:.6g}"


def _short_number(value: float) -> str:
    """Returns a number of three digits, more where that makes it no longer than six characters."""
    value = float(value) + 0.0
    return f"{value:.0f}" if 1e3 <= abs(value) < 1e6 else f"{value:.3g}"


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}{'s' if count > 1 else ''}"


def _cut(name: str, length: int) -> str:
    return name if len(name) <= length else name[: length - 3] + "..."
