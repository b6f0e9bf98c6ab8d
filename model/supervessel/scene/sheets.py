"""Moments of a vessel as a mass-property sheet gives them, and the tensor about its centre of mass from them.

A sheet has one of three keys: `pmi`, moments over mass [m2]; `inertia`, a tensor or its diagonal [kg m2];
`moments` [kg m2] with `products`, the integrals of x y, y z and z x over mass [kg m2]. The last two are about
the vessel's centre of mass, or about the origin of its axes where `inertia_about` says so.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from supervessel.problems import quantity
from supervessel.scene.numbers import (
    Matrix,
    Vector,
    WrittenNumber,
    is_number,
    tensor_problem,
    triangle_problem,
)

MOMENT_KEYS = ("pmi", "inertia", "moments")
"""Keys of a vessel that give its moments; a vessel has one of them."""

CENTRE, ORIGIN = "centre_of_mass", "origin"
"""Points about which a vessel's `inertia_about` has its moments."""

PLACES = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))
"""Places in a tensor of its six elements: of `moments`, then of `products`."""


@dataclass(frozen=True)
class Sheet:
    """The numbers by which a vessel gives its moments.

    key      : "pmi", "inertia" or "moments"
    elements : (6,), of the tensor as given, about the point it is given about, at PLACES; [m2] for "pmi",
               else [kg m2]
    halves   : (6,), half a unit of the last digit of each as it is written; 0 for one that is not written
    shift    : (6,) [kg m2], what the tensor has more than about the centre of mass; 0 where that is the point
    """

    key: str
    elements: NDArray[np.float64]
    halves: NDArray[np.float64]
    shift: NDArray[np.float64]

    @property
    def unit(self) -> str:
        """Unit of the numbers."""
        return "m2" if self.key == "pmi" else "kg m2"


def sheet_of(vessel: Mapping[str, Any]) -> Sheet | None:
    """Returns the sheet of a vessel, given as its raw table.

    None where the table has none or two of them, or something else than numbers, which is reported elsewhere.
    """
    keys = [key for key in MOMENT_KEYS if key in vessel]
    if len(keys) != 1 or ("products" in vessel and keys != ["moments"]):
        return None
    written = _written(keys[0], vessel)
    if written is None or (keys[0] == "pmi" and min(value for value, _ in written) < 0.0):
        return None
    shift = np.zeros(6)
    if vessel.get("inertia_about") == ORIGIN:
        mass, centre = vessel.get("mass"), _numbers(vessel.get("centre_of_mass", (0.0, 0.0, 0.0)))
        if not is_number(mass) or centre is None or keys[0] == "pmi":
            return None
        with np.errstate(over="ignore", invalid="ignore"):  # what is beyond all numbers is reported
            shift = float(mass) * _elements(_offset(*map(float, centre)))  # type: ignore[arg-type]
    elements, halves = np.array(written).T
    return Sheet(keys[0], elements, halves, shift)


def sheet_problem(sheet: Sheet) -> str:
    """Returns why no rigid body has the moments of a sheet, or "" if one may have them."""
    with np.errstate(over="ignore", invalid="ignore"):
        about_centre = sheet.elements - sheet.shift
    if not np.all(np.isfinite(about_centre)):
        return "is beyond all numbers about the centre of mass"
    if sheet.key == "pmi":
        x, y, z = about_centre[:3].tolist()
        return triangle_problem((x, y, z))
    size = float(np.max(np.abs(sheet.shift)))
    where = "about the centre of mass " if np.any(sheet.shift) else ""
    problem = tensor_problem(tensor_of(about_centre), size)
    return f"{where}{problem}" if problem else ""


def sheet_text(vessel: Mapping[str, Any], sheet: Sheet) -> str:
    """Returns the keys and values of a sheet for a message, after the vessel's path: ".pmi = [...] m2"."""
    value = tuple(map(float, vessel["pmi"])) if sheet.key == "pmi" else vessel[sheet.key]
    beside = f", products = {quantity(vessel['products'], sheet.unit)}" if "products" in vessel else ""
    return f".{sheet.key} = {quantity(value, sheet.unit)}{beside}"


def as_published(value: Any) -> Any:
    """Returns numbers, or lists of them, as they are written: with their text, or as plain numbers."""
    if isinstance(value, list | tuple):
        return [as_published(one) for one in value]
    return value if isinstance(value, WrittenNumber | int) else float(value)


def tensor_of(elements: Sequence[float] | NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the symmetric tensor, (3, 3), that has six elements at PLACES."""
    tensor = np.empty((3, 3))
    for (i, j), element in zip(PLACES, elements, strict=True):
        tensor[i, j] = tensor[j, i] = element
    return tensor


def tensor_from_moments(moments: Vector, products: Vector | None) -> Matrix:
    """Returns the tensor, (3, 3) [kg m2], of moments and of products as the integrals P_xy, P_yz, P_zx.

    Off the diagonal it has minus the integrals. Source: [EQ] What an inertia is.
    """
    x, y, z = moments
    xy, yz, zx = (-product if product else 0.0 for product in products or (0.0, 0.0, 0.0))
    return ((x, xy, zx), (xy, y, yz), (zx, yz, z))


def about_centre(tensor: Matrix, mass: float, centre: Vector) -> Matrix:
    """Returns a tensor about the origin, (3, 3) [kg m2], as it is about the centre of mass, (3,) [m].

    J - m (|c|^2 E - c c^T), mass m [kg]. Source: [EQ] What an inertia is; Huygens-Steiner theorem.
    """
    moved = np.array(tensor) - mass * np.array(_offset(*centre))
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = moved.tolist()
    return ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))


def _offset(x: float, y: float, z: float) -> Matrix:
    """Returns |c|^2 E - c c^T, (3, 3) [m2], c = (x, y, z) [m], without subtracting squares."""
    xy, yz, zx = -x * y, -y * z, -z * x
    return ((y * y + z * z, xy, zx), (xy, z * z + x * x, yz), (zx, yz, x * x + y * y))


def _elements(tensor: Matrix) -> NDArray[np.float64]:
    return np.array([tensor[i][j] for i, j in PLACES])


NumberAsWritten = tuple[float, float]
"""A number and half a unit of its last digit; 0 for one that is not written."""


def as_written(number: float) -> NumberAsWritten:
    """Returns a number and half a unit of its last digit.

    The digits are those of the file; of a number that is from no file those of the shortest text that Python
    reads as the same number. The last digit of an integer is the one before the point.
    """
    text = (
        number.text
        if isinstance(number, WrittenNumber)
        else repr(number if isinstance(number, int) else float(number))
    )
    exponent = Decimal(text.replace("_", "")).as_tuple().exponent
    assert isinstance(exponent, int)  # the number is finite
    return float(number), float(Decimal(5).scaleb(exponent - 1))


def _written(key: str, vessel: Mapping[str, Any]) -> list[NumberAsWritten] | None:
    """Returns the six elements of the tensor, at PLACES, as they are written."""
    given = vessel[key]
    if key == "inertia" and _numbers(given) is None:
        return _of_rows(given)
    moments, products = _numbers(given), _numbers(vessel.get("products", (0, 0, 0)))
    if moments is None or products is None:
        return None
    off_diagonal = [(-value, half) for value, half in map(as_written, products)]
    return [*map(as_written, moments), *(off_diagonal if "products" in vessel else [(0.0, 0.0)] * 3)]


def _of_rows(rows: Any) -> list[NumberAsWritten] | None:
    """Returns the six elements of three rows; of two equal elements the one that is written more finely."""
    if not (isinstance(rows, list | tuple) and len(rows) == 3):
        return None
    numbers = [_numbers(row) for row in rows]
    found = []
    for i, j in PLACES:
        here, there = numbers[i], numbers[j]
        if here is None or there is None or here[j] != there[i]:
            return None
        found.append(min(as_written(here[j]), as_written(there[i]), key=itemgetter(1)))
    return found


def _numbers(value: Any) -> list[Any] | None:
    """Returns a list of three finite numbers as it is written, None for anything else."""
    if isinstance(value, list | tuple) and len(value) == 3 and all(map(is_number, value)):
        return list(value)
    return None
