"""What the FMU starts with, the scene's own values of the inputs: the composite, and where vessels stand."""

from collections.abc import Mapping, Sequence
from math import frexp, ldexp

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from supervessel.composite.constants import places
from supervessel.composite.docks import groups, joints
from supervessel.composite.inertia import UPPER_TRIANGLE
from supervessel.composite.parts import composite_graph
from supervessel.composite.poses import anchor
from supervessel.composite.resolved import resolve
from supervessel.scene.inputs import vessel_of
from supervessel.scene.schema import Inputs, Scene
from supervessel.shell.interrupts import interrupt_afterwards
from supervessel.simplification import simplification

LONGEST_EXPONENT = 200
"""Largest size of the binary exponent of a direction that p_start leaves as it is: the fourth power of its
length neither under- nor overflows."""


def p_start(scene: Scene) -> NDArray[np.float64]:
    """Returns the scene's values of p, (n,), each in the unit of its input.

    A direction beyond LONGEST_EXPONENT is scaled by a power of two, as the FMU does: its length has no
    meaning.
    """
    values = []
    for variable in resolve(scene).shaping:
        start = variable.start
        if variable.kind.directed:
            _, exponent = frexp(max(map(abs, variable.kind.start(scene, variable.owner))))
            start = ldexp(start, -exponent) if abs(exponent) > LONGEST_EXPONENT else start
        values.append(start)
    return np.array(values)


@interrupt_afterwards()
@simplification(True)
def composite_at_start(scene: Scene) -> dict[str, NDArray[np.float64]]:
    """Returns the parts of c by name, (n,) each, for the scene's own values of the inputs.

    Units and axes are those of `parts.composite_parts`.
    """
    graph = composite_graph(resolve(scene))
    values = np.array(ca.Function("composite", [graph.p], [graph.c])(p_start(scene))).ravel()
    return {name: values[place] for name, place in graph.slices.items()}


def turning_at_start(scene: Scene, c: Mapping[str, NDArray[np.float64]]) -> NDArray[np.float64]:
    """Returns J - A, (6,) [kg m2], xx, yy, zz, xy, xz, yz; c : from `composite_at_start`."""
    elements = c["inertia"].copy()
    for number, name in enumerate(scene.wheels):
        axis = c["wheels"][3 * number : 3 * number + 3]
        own = scene.wheel(name).inertia
        elements -= [own * axis[i] * axis[j] for i, j in UPPER_TRIANGLE]
    return elements


def principal_moments(elements: Sequence[float] | NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the eigenvalues, (3,) [kg m2], ascending, of a tensor given by its elements.

    elements : (6,) [kg m2], xx, yy, zz, xy, xz, yz, as in the part "inertia" of c; finite
    """
    xx, yy, zz, xy, xz, yz = elements
    return np.asarray(np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), dtype=float)


@interrupt_afterwards()
@simplification(True)
def poses_at_start(scene: Scene) -> dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Returns R_root_vessel, (3, 3), and origin, (3,) [m], root axes, of vessels as they stand at the start.

    Of the root, which is the first, and of every vessel that mounts and docks closed at the start join to it,
    in the scene's order. Source: [EQ] The assembly, eq. (4).
    """
    still = _attached(scene)
    (group,) = groups(still)
    (inside,) = places(still, [group])
    found = {}
    for name in (scene.root, *(name for name in still.vessels if name != scene.root)):
        R_root_vessel, place = (np.array(ca.evalf(x)) for x in (inside[name].rotation, inside[name].origin))
        origin = anchor(still, scene.root) + place.ravel() - R_root_vessel @ anchor(still, name)
        found[name] = R_root_vessel, origin
    return found


def _attached(scene: Scene) -> Scene:
    """Returns what mounts and docks closed at the start join to the root as a scene without inputs."""
    names = {scene.root, *(joint.child for joint in joints(scene))}
    closed = tuple(dock for dock in scene.docks if dock.docked and vessel_of(dock.ports[0]) in names)
    vessels = {name: vessel for name, vessel in scene.vessels.items() if name in names}
    mounts = tuple(mount for mount in scene.mounts if mount.parent in names)
    changed = {"vessels": vessels, "docks": closed, "mounts": mounts, "inputs": Inputs()}
    return scene.model_copy(update=changed)
