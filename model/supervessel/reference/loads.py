"""What docks carry and what points feel, by Newton's law for each sample point of the vessels."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from supervessel.reference.assembly import Array, closed_docks, composite, joined, motions, points, vector
from supervessel.reference.attitude import rotation_matrix
from supervessel.reference.rotation import net_force, ode
from supervessel.reference.wheels import wheels_of
from supervessel.scene.outputs import POINT_OUTPUTS
from supervessel.scene.schema import ORIGIN, Scene


@dataclass(frozen=True)
class _Instant:
    """How the body moves at an instant, body axes: what any of its points is accelerated by.

    momenta : of wheels, (n,) [N m s]
    values  : the inputs
    """

    momenta: Array
    values: Mapping[str, float] | None
    omega: Array
    alpha: Array
    linear: Array
    tide: Array

    def acceleration(self, rho: Array) -> Array:
        """Returns what points at rho from the barycentre, (3,) or (n, 3) [m], are accelerated by, [m/s2]."""
        return np.cross(self.alpha, rho) + np.cross(self.omega, np.cross(self.omega, rho))

    def felt(self, rho: Array) -> Array:
        """Returns what an accelerometer reads, [m/s2], at points from the barycentre, (3,) or (n, 3) [m]."""
        return self.linear + self.acceleration(rho) - rho @ self.tide.T


def _instant(scene: Scene, state: Array, values: Mapping[str, float] | None) -> _Instant:
    alpha = ode(scene, state, values=values)[4:7]
    linear = net_force(scene, values) / composite(scene, values).mass
    tide = np.zeros((3, 3))
    if scene.gravity is not None:
        r = rotation_matrix(state[:4]).T @ vector("gravity.position", scene.gravity_start[0], values)
        distance = np.linalg.norm(r)
        n = r / distance
        tide = scene.gravity.mu / distance**3 * (3.0 * np.outer(n, n) - np.eye(3))
    return _Instant(state[7:], values, state[4:7], alpha, linear, tide)


def point_outputs(
    scene: Scene, state: ArrayLike, values: Mapping[str, float] | None = None
) -> dict[str, Array]:
    """Returns the outputs of each point, "vessel.point.output"; all zero where its vessel is not joined.

    state : (attitude, angular velocity, momenta of wheels), (7 + n,)
    Acceleration and specific force are those of a body whose ports are at rest.

    Example:
        >>> reference.point_outputs(scene, [1, 0, 0, 0, 0, 0.0011, 0])
        {}
    """
    state = np.asarray(state, dtype=float)
    found, whole = motions(scene, values), joined(points(scene, values).values())
    drift, now = whole.masses @ whole.velocities / whole.masses.sum(), _instant(scene, state, values)
    outputs: dict[str, Array] = {}
    for vessel, table in scene.vessels.items():
        for point, where in table.points.items():
            name = f"{vessel}.{point}"
            outputs |= {f"{name}.{output}": np.zeros(3) for output in POINT_OUTPUTS}
            if vessel not in found:
                continue
            position, velocity = found[vessel].carry(np.array(where.position))
            rho = position - whole.barycentre
            outputs |= {
                f"{name}.position": rho,
                f"{name}.velocity": np.cross(now.omega, rho) + velocity - drift,
                f"{name}.acceleration": now.acceleration(rho),
                f"{name}.specific_force": now.felt(rho),
            }
    return outputs


def loads(scene: Scene, state: ArrayLike, values: Mapping[str, float] | None = None) -> dict[str, Array]:
    """Returns force [N] and moment [N m] that each named dock's second port receives from its first, (3,).

    state : (attitude, angular velocity, momenta of wheels), (7 + n,)
    In the axes of the first port's vessel, the moment about the port; zero while the dock is open, or off the
    root. The ports are at rest. A torque about the barycentre is taken as one on the root vessel.

    Example:
        >>> reference.loads(scene, [1, 0, 0, 0, 0, 0.0011, 0])
        {}
    """
    state = np.asarray(state, dtype=float)
    closed, found, now = closed_docks(scene, values), motions(scene, values), _instant(scene, state, values)
    outputs: dict[str, Array] = {}
    for dock in scene.docks:
        if dock.name is None:
            continue
        force, moment = np.zeros(3), np.zeros(3)
        first = dock.ports[0].partition(".")[0]
        if dock in closed and first in found:
            pairs = [{port.partition(".")[0] for port in one.ports} for one in closed if one is not dock]
            near = _reached(scene.root, [*pairs, *({mount.parent, mount.child} for mount in scene.mounts)])
            position = vector(f"{dock.ports[0]}.position", scene.port(dock.ports[0]).position, values)
            port, _ = found[first].carry(position)
            force, moment = _load(scene, set(found) - near, port, now)
            side = 1.0 if first in near else -1.0
            force, moment = (side * found[first].rotation.T @ load for load in (force, moment))
        outputs |= {f"{dock.name}.force": force, f"{dock.name}.moment": moment}
    return outputs


def _reached(root: str, pairs: list[set[str]]) -> set[str]:
    """Returns the vessels that pairs of joined vessels join to the root."""
    reached, grown = {root}, True
    while grown:
        grown = False
        for pair in pairs:
            if len(pair & reached) == 1:
                reached, grown = reached | pair, True
    return reached


def _load(scene: Scene, beyond: set[str], port: Array, now: _Instant) -> tuple[Array, Array]:
    """Returns force and moment about the port that move the vessels beyond it as they move, body axes.

    port : (3,) [m], root vessel's axes
    Wheels are locked among the points; what they have of momentum besides, and its rate, comes on top.
    """
    values = now.values
    barycentre, found = composite(scene, values).barycentre, motions(scene, values)
    parts = points(scene, values)
    force, moment = np.zeros(3), np.zeros(3)
    for vessel in beyond:
        part, motion = parts[vessel], found[vessel]
        pushes = part.masses[:, None] * now.felt(part.positions - barycentre)
        force = force + pushes.sum(axis=0)
        moment = moment + np.cross(part.positions - port, pushes).sum(axis=0)
        moment = moment - motion.rotation @ vector(f"{vessel}.torque", ORIGIN, values)
        for point, where in scene.vessels[vessel].points.items():
            own = motion.rotation @ vector(f"{vessel}.{point}.force", ORIGIN, values)
            force = force - own
            moment = moment - np.cross(motion.carry(np.array(where.position))[0] - port, own)
    wheels = wheels_of(scene, now.momenta, values)
    for w, name in enumerate(scene.wheels):
        if name.partition(".")[0] in beyond:
            axis, inertia = wheels.axes[w], wheels.inertias[w]
            beside = wheels.momenta[w] - inertia * (axis @ now.omega)
            grows = wheels.torques[w] - inertia * (axis @ now.alpha)
            moment = moment + grows * axis + beside * np.cross(now.omega, axis)
    return force, moment
