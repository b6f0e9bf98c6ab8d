"""What is joined to the root, point by point: where vessels are and move, mass, inertia, internal momentum.

The composite is summed as the technical note does, six points a vessel, products included.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from supervessel.reference.attitude import rotation_matrix
from supervessel.scene.schema import ORIGIN, Dock, Mount, Scene

Array = NDArray[np.float64]

FOLLOWING, LAST = np.array([1, 2, 0]), np.array([2, 0, 1])
"""Of each axis the next one, and the one after that."""


@dataclass(frozen=True)
class Motion:
    """Where a vessel is relative to the root and how it moves there, all in the root vessel's axes.

    rotation : R_root_vessel, (3, 3)
    origin   : (3,) [m], of the vessel's axes
    rate     : (3,) [rad/s], angular velocity relative to the root
    velocity : (3,) [m/s], of the origin relative to the root

    Example:
        >>> reference.motions(scene)["ISS"].rate.tolist()
        [0.0, 0.0, 0.0]
    """

    rotation: Array
    origin: Array
    rate: Array
    velocity: Array

    def carry(self, positions_vessel: Array) -> tuple[Array, Array]:
        """Returns positions [m] and velocities [m/s], root axes, of points of the vessel, (3,) or (n, 3).

        Example:
            >>> positions, velocities = reference.motions(scene)["DG"].carry(np.zeros(3))
            >>> positions.round(3).tolist()
            [0.09, -27.976, 3.31]
        """
        arms = positions_vessel @ self.rotation.T
        return self.origin + arms, self.velocity + _cross(self.rate, arms)


@dataclass(frozen=True)
class Points:
    """Point masses: masses (n,) [kg], positions (n, 3) [m], velocities (n, 3) [m/s], root vessel's axes.

    Example:
        >>> reference.points(scene)["DG"].positions.shape
        (6, 3)
    """

    masses: Array
    positions: Array
    velocities: Array

    @property
    def barycentre(self) -> Array:
        """Their barycentre, (3,) [m].

        Example:
            >>> reference.points(scene)["DG"].barycentre.round(3).tolist()
            [0.09, -27.976, 3.31]
        """
        m, r = self.masses, self.positions
        barycentre: Array = r[0] + m @ (r - r[0]) / m.sum()
        return barycentre

    @property
    def drift(self) -> Array:
        """Velocity of their barycentre, (3,) [m/s].

        Example:
            >>> reference.points(scene)["DG"].drift.tolist()
            [0.0, 0.0, 0.0]
        """
        drift: Array = self.masses @ self.velocities / self.masses.sum()
        return drift

    @property
    def momentum(self) -> Array:
        """Their angular momentum about their barycentre, (3,) [N m s].

        Example:
            >>> reference.points(scene)["DG"].momentum.tolist()
            [0.0, 0.0, 0.0]
        """
        m, v = self.masses, self.velocities
        v_rho = v - self.drift
        momentum: Array = m @ _cross(self.positions - self.barycentre, v_rho)
        return momentum


@dataclass(frozen=True)
class Composite:
    """Mass distribution of an assembly.

    mass       : [kg]
    barycentre : (3,) [m], root vessel's axes, from its origin
    inertia    : (3, 3) [kg m2], about the barycentre, root vessel's axes

    Example:
        >>> round(reference.composite(scene).mass, 3)
        479500.0
    """

    mass: float
    barycentre: Array
    inertia: Array

    @property
    def pmi(self) -> Array:
        """Mass-normalised moments, (3,) [m2]: the diagonal of the inertia tensor over mass.

        Example:
            >>> reference.composite(scene).pmi.round(1).tolist()
            [404.6, 683.2, 521.1]
        """
        return np.diag(self.inertia) / self.mass


def sample_points(pmi: ArrayLike, convention: str = "rigid_body") -> Array:
    """Returns the six points, (6, 3) [m], whose equal masses have the given moments.

    pmi : (3,) [m2], mass-normalised moments along the axes
    A square that is negative within rounding (a rod or a plate on the triangle's edge) counts as zero; by the
    convention "orbiter" the absolute value of any square is taken.
    Source: [CV] eqs. (3-7), (12).

    Example:
        >>> reference.sample_points([1.0, 1.0, 1.0])[0].round(6).tolist()
        [1.224745, 0.0, 0.0]
    """
    k1, k2, k3 = 0.25 * np.asarray(pmi, dtype=float)  # the sum of two moments may be too large for a float
    squares = 1.5 * np.array([k2 + k3 - k1, k3 + k1 - k2, k1 + k2 - k3])
    half = 2.0 * np.diag(np.sqrt(np.abs(squares) if convention == "orbiter" else np.maximum(squares, 0.0)))
    return np.vstack([half, -half])


def port_axes(direction: ArrayLike, alignment: ArrayLike) -> Array:
    """Returns the orthonormal columns (d, a, d x a), (3, 3), of a port, vessel axes.

    direction : (3,), kept but for its length
    alignment : (3,), projected onto the plane across direction
    Both of any length > 0, not parallel (not checked).

    Example:
        >>> reference.port_axes([0, 0, 2], [0.5, 0, 3])[:, 1].tolist()
        [1.0, 0.0, 0.0]
    """
    d = np.asarray(direction, dtype=float)
    a = np.asarray(alignment, dtype=float)
    d, a = d / np.abs(d).max(), a / np.abs(a).max()
    d = d / np.linalg.norm(d)
    b = _cross(d, a)
    b = b / np.linalg.norm(b)
    return np.column_stack([d, _cross(b, d), b])


def _cross(a: Array, b: Array) -> Array:
    """Returns a x b along the last axis; numpy's own takes ten times as long for a single vector."""
    product: Array = a[..., FOLLOWING] * b[..., LAST] - a[..., LAST] * b[..., FOLLOWING]
    return product


def closed_docks(scene: Scene, values: Mapping[str, float] | None = None) -> list[Dock]:
    """Returns the docks that are closed: for ever, or as their inputs say.

    Raises ValueError if two of them share a port, or if they join two vessels that docks or mounts join
    already.

    Example:
        >>> [dock.ports for dock in reference.closed_docks(scene)]
        [('ISS.P2', 'DG.nose')]
    """
    closed: list[Dock] = []
    occupied: set[str] = set()
    part = {vessel: {vessel} for vessel in scene.vessels}
    for mount in scene.mounts:
        joined_vessels = part[mount.parent] | part[mount.child]
        part |= dict.fromkeys(joined_vessels, joined_vessels)
    for dock in scene.docks:
        if dock.name in scene.inputs.docked and not (values or {}).get(f"{dock.name}.docked", dock.docked):
            continue
        name = " - ".join(dock.ports)
        for port in dock.ports:
            if port in occupied:
                raise ValueError(f"{name}: port {port} is docked already")
        small, large = sorted((part[port.partition(".")[0]] for port in dock.ports), key=len)
        if small is large:
            raise ValueError(f"{name}: its vessels are joined already")
        large |= small
        part |= dict.fromkeys(small, large)
        occupied.update(dock.ports)
        closed.append(dock)
    return closed


def motions(scene: Scene, values: Mapping[str, float] | None = None) -> dict[str, Motion]:
    """Returns how each vessel that mounts and closed docks join to the root stands and moves; the root first.

    Ports are mated face to face with their alignments together: R d_B = -d_A, R a_B = a_A. A port that moves
    takes its mate along.
    Source: [CV] eqs. (8), (9).

    Example:
        >>> list(reference.motions(scene))
        ['ISS', 'DG']
    """
    at_rest = np.zeros(3)
    placed = {scene.root: Motion(np.eye(3), at_rest, at_rest, at_rest)}
    waiting: list[tuple[str, str, _MovingPort, _MovingPort]] = []
    for dock in closed_docks(scene, values):
        here, there = (_port(scene, name, values) for name in dock.ports)
        waiting.append((*(name.partition(".")[0] for name in dock.ports), here, there))  # type: ignore[arg-type]
    waiting += [(mount.parent, mount.child, *_mount_points(mount)) for mount in scene.mounts]
    left = -1
    while len(waiting) != left:
        pairs, waiting, left = waiting, [], len(waiting)
        for one, other, here, there in pairs:
            if one in placed:
                placed[other] = _mated(placed[one], here, there)
            elif other in placed:
                placed[one] = _mated(placed[other], there, here)
            else:
                waiting.append((one, other, here, there))
    return placed


def poses(scene: Scene, values: Mapping[str, float] | None = None) -> dict[str, tuple[Array, Array]]:
    """Returns R_root_vessel, (3, 3), and origin, (3,) [m], root axes, of each vessel joined to the root.

    Example:
        >>> R_root_vessel, origin = reference.poses(scene)["DG"]
        >>> origin.round(3).tolist()
        [0.09, -27.976, 3.31]
    """
    return {vessel: (motion.rotation, motion.origin) for vessel, motion in motions(scene, values).items()}


@dataclass(frozen=True)
class _MovingPort:
    """A port in its vessel's axes: position (3,) [m], axes (3, 3), velocity (3,) [m/s], rate (3,) [rad/s]."""

    position: Array
    axes: Array
    velocity: Array
    rate: Array


def _port(scene: Scene, name: str, values: Mapping[str, float] | None) -> _MovingPort:
    port = scene.port(name)
    direction = vector(f"{name}.direction", port.direction, values)
    return _MovingPort(
        vector(f"{name}.position", port.position, values),
        port_axes(direction, vector(f"{name}.alignment", port.alignment, values)),
        vector(f"{name}.velocity", ORIGIN, values),
        vector(f"{name}.rate", ORIGIN, values),
    )


def _mount_points(mount: Mount) -> tuple[_MovingPort, _MovingPort]:
    """Returns a mount as two ports at rest: at its position in the parent, at the origin of the child."""
    at_rest, facing = np.zeros(3), np.array([-1.0, 1.0, -1.0])
    here = _MovingPort(np.array(mount.position), rotation_matrix(mount.attitude) * facing, at_rest, at_rest)
    return here, _MovingPort(at_rest, np.eye(3), at_rest, at_rest)


def _mated(parent: Motion, here: _MovingPort, there: _MovingPort) -> Motion:
    """Returns the motion of the vessel whose port `there` is mated with the port `here` of a parent.

    The child turns at w_here - R w_there relative to the parent: R = F A^T, F being the axes of `here` turned
    to face, A those of `there`.
    """
    facing = here.axes * [-1.0, 1.0, -1.0]
    R_root_child = parent.rotation @ facing @ there.axes.T
    face, face_velocity = parent.carry(here.position)
    face_velocity = face_velocity + parent.rotation @ here.velocity - R_root_child @ there.velocity
    rate = parent.rate + parent.rotation @ here.rate - R_root_child @ there.rate
    arm = R_root_child @ there.position
    return Motion(R_root_child, face - arm, rate, face_velocity - _cross(rate, arm))


def vector(group: str, start: ArrayLike, values: Mapping[str, float] | None) -> Array:
    """Returns the three elements of an input, (3,), from `values` or, where it lacks them, from `start`."""
    numbers = np.array(start, dtype=float)
    if values:
        for i in range(3):
            numbers[i] = values.get(f"{group}[{i + 1}]", numbers[i])
    return numbers


def points(scene: Scene, values: Mapping[str, float] | None = None) -> dict[str, Points]:
    """Returns the six points of each vessel joined to the root, the root's first.

    A vessel given by a full tensor has its points on its own principal axes.

    Example:
        >>> {name: part.positions.shape for name, part in reference.points(scene).items()}
        {'ISS': (6, 3), 'DG': (6, 3)}
    """
    found = {}
    for name, motion in motions(scene, values).items():
        vessel = scene.vessels[name]
        if vessel.pmi is not None:
            own = sample_points(vector(f"{name}.pmi", vessel.pmi, values), scene.convention)
        else:
            moments, axes = np.linalg.eigh(np.array(vessel.specific_inertia))
            own = sample_points(moments) @ axes.T
        positions, velocities = motion.carry(np.array(vessel.centre_of_mass) + own)
        masses = np.full(6, (values or {}).get(f"{name}.mass", vessel.mass) / 6.0)
        found[name] = Points(masses, positions, velocities)
    return found


def joined(parts: Iterable[Points]) -> Points:
    """Returns the points of several vessels as one set.

    Example:
        >>> reference.joined(reference.points(scene).values()).masses.shape
        (12,)
    """
    lists = [(part.masses, part.positions, part.velocities) for part in parts]
    masses, positions, velocities = (np.concatenate(arrays) for arrays in zip(*lists, strict=True))
    return Points(masses, positions, velocities)


def composite(scene: Scene, values: Mapping[str, float] | None = None) -> Composite:
    """Returns the mass distribution of what is joined to the root, summed over six points a vessel.

    values : inputs by the FMU's structured names that differ from the scene's, `{"DG.mass": 12000.0}`
    Source: [CV] eqs. (10), (11), with the products of inertia that the note leaves out; by the convention
    "orbiter" without, and the moments of a root that nothing is joined to are as they are given.

    Example:
        >>> round(reference.composite(scene, {"DG.mass": 12000.0}).mass, 3)
        467000.0
    """
    whole = joined(points(scene, values).values())
    m, rho = whole.masses, whole.positions - whole.barycentre
    second_moments = (m[:, None] * rho).T @ rho
    inertia = np.trace(second_moments) * np.eye(3) - second_moments
    if scene.convention == "orbiter":
        inertia = np.diag(np.diag(inertia))
        own = scene.vessels[scene.root].pmi
        if own is not None and len(motions(scene, values)) == 1:
            inertia = m.sum() * np.diag(vector(f"{scene.root}.pmi", own, values))
    return Composite(float(m.sum()), whole.barycentre, inertia)


def internal_momentum(scene: Scene, values: Mapping[str, float] | None = None) -> Array:
    """Returns the angular momentum of parts that move relative to the root, (3,) [N m s].

    About the barycentre, root vessel's axes, which count as at rest: h = sum m rho x rho'.

    Example:
        >>> reference.internal_momentum(scene).tolist()
        [0.0, 0.0, 0.0]
    """
    return joined(points(scene, values).values()).momentum


def barycentre_velocity(scene: Scene, values: Mapping[str, float] | None = None) -> Array:
    """Returns the velocity of the barycentre relative to the root vessel, (3,) [m/s], root axes, by ports
    that move.

    Example:
        >>> reference.barycentre_velocity(scene).tolist()
        [0.0, 0.0, 0.0]
    """
    return joined(points(scene, values).values()).drift
