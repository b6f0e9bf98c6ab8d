"""What a drawing shows of a scene: vessels as boxes that have their moments, and docking ports, placed."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import fsum, sqrt

import numpy as np
from numpy.typing import NDArray

from supervessel.composite.constants import port_frame
from supervessel.composite.docks import switchable
from supervessel.composite.start import composite_at_start, poses_at_start
from supervessel.scene.inputs import vessel_of
from supervessel.scene.schema import Scene, Vessel

Array = NDArray[np.float64]

VESSEL_LIMIT = 30
"""Vessels that a drawing shows at most, the root and the heaviest ones; more cannot be told apart."""
PORT_LIMIT = 80
"""Docking ports that a drawing shows at most, docked ones first."""
FARTHEST = 1e100
"""Coordinates [m] from which on a drawing shows nothing; their squares must not overflow."""


@dataclass(frozen=True)
class DrawnVessel:
    """A vessel as drawn.

    number    : from 1, the root's, then in the scene's order
    centre    : (3,) [m], centre of mass, root axes
    axes      : R_root_box, (3, 3), columns are the box's axes, root axes
    semi_axes : (3,) [m], half of the box's edges along those axes
    massless  : whether the vessel has no mass, so that its moments shape nothing
    """

    name: str
    number: int
    centre: Array
    axes: Array
    semi_axes: Array
    massless: bool

    @property
    def corners(self) -> Array:
        """The box's corners, (2, 2, 2, 3) [m], root axes; the indices are the sides along each axis."""
        signs = np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1], indexing="ij"), axis=-1)
        corners: Array = self.centre + signs * self.semi_axes @ self.axes.T
        return corners


@dataclass(frozen=True)
class DrawnPort:
    """A docking port as drawn: position (3,) [m], direction (3,) and alignment (3,), unit, root axes.

    switchable : whether it belongs to a dock that an input opens and closes
    """

    name: str
    vessel: DrawnVessel
    position: Array
    direction: Array
    alignment: Array
    docked: bool
    switchable: bool


@dataclass(frozen=True)
class DrawnPoint:
    """A point where a force acts, as drawn: position (3,) [m], root axes."""

    name: str
    vessel: DrawnVessel
    position: Array


@dataclass(frozen=True)
class Assembly:
    """A scene placed at its start values, and what of it can be drawn.

    poses           : R_root_vessel, (3, 3), and origin, (3,) [m], of the root, which is the first,
                      and of every vessel that docks closed at the start join to it
    detached        : the other vessels
    whole           : the composite: parts of c by name, see `composite.parts.COMPOSITE_SIZES`
    barycentre      : (3,) [m], root axes, None where it is too far away to be drawn
    points          : where forces act on `vessels`
    vessels_omitted : vessels with a pose that are not among `vessels`
    ports_omitted   : ports of those vessels that are not among `ports`
    """

    scene: Scene
    poses: Mapping[str, tuple[Array, Array]]
    detached: Sequence[str]
    whole: Mapping[str, Array]
    vessels: Sequence[DrawnVessel]
    ports: Sequence[DrawnPort]
    points: Sequence[DrawnPoint]
    barycentre: Array | None
    vessels_omitted: int
    ports_omitted: int


def assembly(scene: Scene) -> Assembly:
    """Returns a scene placed at its start values, with as many vessels and ports as a drawing can hold."""
    with np.errstate(all="ignore"):  # what overflows is not drawn
        poses = poses_at_start(scene)
        whole = composite_at_start(scene)
        heaviest = sorted(poses, key=lambda name: (name != scene.root, -scene.vessels[name].mass))
        shown = frozenset(heaviest[:VESSEL_LIMIT])
        vessels = [
            vessel
            for number, (name, pose) in enumerate(poses.items(), start=1)
            if name in shown and _near((vessel := _vessel(scene, name, number, *pose)).corners)
        ]
        ports = [port for vessel in vessels for port in _ports(scene, vessel, *poses[vessel.name])]
        points = [point for vessel in vessels for point in _force_points(scene, vessel, *poses[vessel.name])]
    ports.sort(key=lambda port: not port.docked)
    return Assembly(
        scene=scene,
        poses=poses,
        detached=[name for name in scene.vessels if name not in poses],
        whole=whole,
        vessels=vessels,
        ports=ports[:PORT_LIMIT],
        points=points,
        barycentre=whole["barycentre"] if _near(whole["barycentre"]) else None,
        vessels_omitted=len(poses) - len(vessels),
        ports_omitted=max(0, len(ports) - PORT_LIMIT),
    )


def semi_axes(moments: Sequence[float]) -> Array:
    """Returns half the edges, (3,) [m], of the uniform cuboid with given mass-normalised moments.

    moments : (3,) [m2], about the cuboid's axes, k_x = (b^2 + c^2)/3 and so on
    Hence a^2 = 3/2 (k_y + k_z - k_x): the sum is rounded once, so that a thin plate or rod keeps all the
    digits that its moments leave it. A square that is negative within rounding counts as zero.
    Source: the sample points of [CV] eqs. (3-7) stand at the same distances.
    """
    scale = max(moments)
    if scale == 0.0:
        return np.zeros(3)
    x, y, z = (moment / scale for moment in moments)
    squares = (fsum(terms) for terms in ((y, z, -x), (z, x, -y), (x, y, -z)))
    return sqrt(scale) * np.array([sqrt(1.5 * max(square, 0.0)) for square in squares])


def equivalent_box(vessel: Vessel) -> tuple[Array, Array]:
    """Returns R_vessel_box, (3, 3), and semi-axes, (3,) [m], of a vessel's box."""
    if vessel.pmi is not None:
        return np.eye(3), semi_axes(vessel.pmi)
    tensor = np.array(vessel.specific_inertia)
    if np.count_nonzero(tensor - np.diag(np.diag(tensor))) == 0:
        return np.eye(3), semi_axes(np.diag(tensor).tolist())
    moments, axes = np.linalg.eigh(tensor)
    return axes, semi_axes(np.maximum(moments, 0.0).tolist())


def _vessel(scene: Scene, name: str, number: int, R_root_vessel: Array, origin: Array) -> DrawnVessel:
    vessel = scene.vessels[name]
    axes, semi = equivalent_box(vessel)
    centre = origin + R_root_vessel @ np.array(vessel.centre_of_mass)
    return DrawnVessel(name, number, centre, R_root_vessel @ axes, semi, vessel.mass == 0.0)


def _ports(scene: Scene, vessel: DrawnVessel, R_root_vessel: Array, origin: Array) -> Iterator[DrawnPort]:
    """Yields the ports of a vessel that are near enough to be drawn."""
    docked = {name for dock in scene.docks if dock.docked for name in dock.ports}
    switchables = {name for dock in scene.docks if switchable(scene, dock) for name in dock.ports}
    for port_name, port in scene.vessels[vessel.name].ports.items():
        name = f"{vessel.name}.{port_name}"
        direction, alignment, _ = (R_root_vessel @ port_frame(port)).T
        position = origin + R_root_vessel @ np.array(port.position)
        if _near(position):
            yield DrawnPort(name, vessel, position, direction, alignment, name in docked, name in switchables)


def _force_points(
    scene: Scene, vessel: DrawnVessel, R_root_vessel: Array, origin: Array
) -> Iterator[DrawnPoint]:
    """Yields the points of a vessel where forces act or propellant leaves, if near enough to be drawn."""
    for name in dict.fromkeys((*scene.inputs.force, *scene.inputs.flow)):
        position = origin + R_root_vessel @ np.array(scene.point(name).position)
        if vessel_of(name) == vessel.name and _near(position):
            yield DrawnPoint(name, vessel, position)


def _near(positions: Array) -> bool:
    return bool(np.all(np.abs(positions) < FARTHEST))
