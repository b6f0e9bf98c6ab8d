"""How the body of a scene turns: what acts on it, rates of its state; how its vessels turn with it."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from supervessel.reference.assembly import (
    Array,
    composite,
    internal_momentum,
    joined,
    motions,
    points,
    vector,
)
from supervessel.reference.attitude import attitude_dot, quaternion, rotation_matrix
from supervessel.reference.gravity import gravity_torque
from supervessel.reference.jets import jet_torque
from supervessel.reference.laws import angular_acceleration, law_tensor
from supervessel.reference.wheels import Wheels, wheels_of
from supervessel.scene.outputs import VESSEL_OUTPUTS
from supervessel.scene.schema import ORIGIN, Scene


def external_torque(scene: Scene, values: Mapping[str, float] | None = None) -> Array:
    """Returns the torque on what is joined to the root, (3,) [N m], about its barycentre, body axes.

    The torque input, the moments of forces at their points, and torques on vessels; without that of gravity's
    gradient, which depends on the attitude: `gradient_torque`.

    Example:
        >>> reference.external_torque(scene, {"torque[3]": 100.0}).tolist()
        [0.0, 0.0, 100.0]
    """
    torque, barycentre = vector("torque", ORIGIN, values), composite(scene, values).barycentre
    for vessel, motion in motions(scene, values).items():
        torque = torque + motion.rotation @ vector(f"{vessel}.torque", ORIGIN, values)
        for point, where in scene.vessels[vessel].points.items():
            position, _ = motion.carry(np.array(where.position))
            force = motion.rotation @ vector(f"{vessel}.{point}.force", ORIGIN, values)
            torque = torque + np.cross(position - barycentre, force)
    return torque


def gradient_torque(scene: Scene, attitude: ArrayLike, values: Mapping[str, float] | None = None) -> Array:
    """Returns the torque of gravity's gradient by the law's tensor, (3,) [N m], body axes; 0 without gravity.

    attitude : (4,), unit, scalar first, body to inertial
    The inputs' position counts, their velocity does not: the torque is that of one instant.

    Example:
        >>> reference.gradient_torque(scene, [1, 0, 0, 0]).tolist()
        [0.0, 0.0, 0.0]
    """
    if scene.gravity is None:
        return np.zeros(3)
    position = vector("gravity.position", scene.gravity_start[0], values)
    inertia = law_tensor(scene.rotation.law, composite(scene, values).inertia)
    return gravity_torque(inertia, attitude, position, scene.gravity.mu)


def net_force(scene: Scene, values: Mapping[str, float] | None = None) -> Array:
    """Returns the sum of the forces on what is joined to the root, (3,) [N], body axes.

    Example:
        >>> reference.net_force(scene).tolist()
        [0.0, 0.0, 0.0]
    """
    force = np.zeros(3)
    for vessel, motion in motions(scene, values).items():
        for point in scene.vessels[vessel].points:
            force = force + motion.rotation @ vector(f"{vessel}.{point}.force", ORIGIN, values)
    return force


def ode(
    scene: Scene,
    state: ArrayLike,
    torque: ArrayLike | None = None,
    values: Mapping[str, float] | None = None,
) -> Array:
    """Returns the rate of a scene's state (attitude, angular velocity, momenta of wheels), (7 + n,).

    torque : (3,) [N m], all that acts from outside, about the barycentre; by default what `values` say and
             gravity's gradient. The motors of wheels, and flows of propellant, are within.
    Inputs are steady, but for masses: they fall by the flows.

    Example:
        >>> reference.ode(scene, [1, 0, 0, 0, 0, 0.002, 0])[:4].tolist()
        [0.0, 0.0, 0.001, 0.0]
    """
    state = np.asarray(state, dtype=float)
    attitude, omega, own = state[:4], state[4:7], wheels_of(scene, state[7:], values)
    if torque is None:
        torque = external_torque(scene, values) + gradient_torque(scene, attitude, values)
    acceleration = angular_acceleration(
        scene.rotation.law,
        composite(scene, values).inertia - own.inertia,
        omega,
        np.asarray(torque, dtype=float) + own.reaction + jet_torque(scene, omega, values),
        inner_momentum(scene, own, values),
    )
    return np.concatenate([attitude_dot(attitude, omega), acceleration, own.torques])


def inner_momentum(scene: Scene, own: Wheels, values: Mapping[str, float] | None = None) -> Array:
    """Returns the momentum of parts that move and of wheels, h + sum h_w b, (3,) [N m s], body axes.

    own : the scene's wheels; h is that of `internal_momentum` less what locked wheels would have

    Example:
        >>> reference.inner_momentum(scene, reference.wheels_of(scene, [])).tolist()
        [0.0, 0.0, 0.0]
    """
    return internal_momentum(scene, values) - own.carried + own.momentum


def turning_tensor(scene: Scene, values: Mapping[str, float] | None = None) -> Array:
    """Returns the law's part of J - A, (3, 3) [kg m2], A being the inertia of wheels about their axes.

    Example:
        >>> bool(np.all(reference.turning_tensor(scene) == reference.composite(scene).inertia))
        True
    """
    own = wheels_of(scene, np.zeros(len(scene.wheels)), values)
    return law_tensor(scene.rotation.law, composite(scene, values).inertia - own.inertia)


def angular_momentum(scene: Scene, rates: ArrayLike, values: Mapping[str, float] | None = None) -> Array:
    """Returns H = (J - A) omega + h + sum h_w b, (3,) [N m s], about the barycentre, body axes, by the law.

    rates : angular velocity [rad/s], body axes, and momenta of wheels [N m s], (3 + n,)

    Example:
        >>> round(float(reference.angular_momentum(scene, [0, 0.0011, 0])[1]) / 1e3)  # kN m s
        360
    """
    rates = np.asarray(rates, dtype=float)
    inner = inner_momentum(scene, wheels_of(scene, rates[3:], values), values)
    momentum: Array = turning_tensor(scene, values) @ rates[:3] + inner
    return momentum


def angular_velocity(scene: Scene, momenta: ArrayLike, values: Mapping[str, float] | None = None) -> Array:
    """Returns omega, (3,) [rad/s], body axes, that the momentum H makes: the inverse of `angular_momentum`.

    momenta : H, body axes, and momenta of wheels, (3 + n,) [N m s]

    Example:
        >>> momentum = reference.angular_momentum(scene, [0, 0.0011, 0])
        >>> round(float(reference.angular_velocity(scene, momentum)[1]), 9)
        0.0011
    """
    momenta = np.asarray(momenta, dtype=float)
    inner = inner_momentum(scene, wheels_of(scene, momenta[3:], values), values)
    return np.asarray(np.linalg.solve(turning_tensor(scene, values), momenta[:3] - inner), dtype=float)


def momentum_ode(scene: Scene, state: ArrayLike, values: Mapping[str, float] | None = None) -> Array:
    """Returns the rate of a scene's state (attitude, H in body axes, momenta of wheels), (7 + n,).

    H' = M - omega x H; without the gyroscopic term under "decoupled". Right however the inputs move.

    Example:
        >>> rate = reference.momentum_ode(scene, [1, 0, 0, 0, 0, 0, 0], {"torque[3]": 10.0})
        >>> rate[4:].tolist()
        [0.0, 0.0, 10.0]
    """
    state = np.asarray(state, dtype=float)
    omega = angular_velocity(scene, state[4:], values)
    momentum_dot = external_torque(scene, values) + gradient_torque(scene, state[:4], values)
    if scene.rotation.law != "decoupled":
        momentum_dot = momentum_dot - np.cross(omega, state[4:7])
    motors = wheels_of(scene, state[7:], values).torques
    return np.concatenate([attitude_dot(state[:4], omega), momentum_dot, motors])


def total_kinetic_energy(scene: Scene, state: ArrayLike, values: Mapping[str, float] | None = None) -> float:
    """Returns the kinetic energy relative to the barycentre, [J]: of all sample points, and of wheels.

    state : (attitude, angular velocity, momenta of wheels), (7 + n,)
    A wheel turns with its vessel among the points. That part is replaced by h^2/(2 I), or 0 where I is 0. By
    the convention "orbiter" that of the whole, turning, is by the composite's tensor, not that of its points.

    Example:
        >>> round(reference.total_kinetic_energy(scene, [1, 0, 0, 0, 0, 0.0011, 0]))
        198
    """
    state = np.asarray(state, dtype=float)
    whole, own = joined(points(scene, values).values()), wheels_of(scene, state[7:], values)
    drift = whole.masses @ whole.velocities / whole.masses.sum()
    v = np.cross(state[4:7], whole.positions - whole.barycentre) + whole.velocities - drift
    energy = 0.5 * whole.masses @ (v * v).sum(axis=1)
    rates = own.axes @ state[4:7] + own.rates
    heavy = (own.inertias > 0.0) & np.any(own.axes != 0.0, axis=1)
    if scene.convention == "orbiter":
        turning = np.cross(state[4:7], whole.positions - whole.barycentre)
        by_points = whole.masses @ (turning * turning).sum(axis=1)
        energy += 0.5 * (state[4:7] @ composite(scene, values).inertia @ state[4:7] - by_points)
    energy += 0.5 * (own.momenta[heavy] ** 2 / own.inertias[heavy]).sum() - 0.5 * own.inertias @ rates**2
    return float(energy)


def vessel_outputs(
    scene: Scene, state: ArrayLike, values: Mapping[str, float] | None = None
) -> dict[str, Array]:
    """Returns the outputs of each vessel, "vessel.output"; all zero for one that is not joined to the root.

    state : (attitude, angular velocity, momenta of wheels), (7 + n,)

    Example:
        >>> outputs = reference.vessel_outputs(scene, [1, 0, 0, 0, 0, 0.0011, 0])
        >>> outputs["DG.origin"].round(2).tolist()
        [0.09, -26.55, 3.14]
    """
    return vessel_outputs_after(scene, state, values, (np.zeros(3), np.zeros(3)))


def vessel_outputs_after(
    scene: Scene, state: ArrayLike, values: Mapping[str, float] | None, jumps: tuple[Array, Array]
) -> dict[str, Array]:
    """Returns the outputs of each vessel about a barycentre that has jumped since, see `vessel_outputs`.

    jumps : of its place (3,) [m] and its velocity (3,) [m/s], body axes

    Example:
        >>> jumps = np.array([0.0, 1.0, 0.0]), np.zeros(3)
        >>> outputs = reference.vessel_outputs_after(scene, [1, 0, 0, 0, 0, 0.0011, 0], None, jumps)
        >>> outputs["DG.origin"].round(2).tolist()
        [0.09, -27.55, 3.14]
    """
    state = np.asarray(state, dtype=float)
    omega, R_inertial_body = state[4:7], rotation_matrix(state[:4])
    own_wheels = wheels_of(scene, state[7:], values)
    found, own = motions(scene, values), points(scene, values)
    whole = joined(own.values())
    barycentre, drift = whole.barycentre + jumps[0], whole.drift - np.cross(omega, jumps[0]) + jumps[1]
    outputs: dict[str, Array] = {}
    for vessel, table in scene.vessels.items():
        outputs |= {f"{vessel}.{name}": np.zeros(4 if name == "attitude" else 3) for name in VESSEL_OUTPUTS}
        if vessel not in found:
            continue
        motion, part = found[vessel], own[vessel]
        rho = part.positions - barycentre
        v = np.cross(omega, rho) + part.velocities - drift
        momentum = part.masses @ np.cross(rho, v) + _stored_beside(scene, vessel, own_wheels, omega)
        if scene.convention == "orbiter" and len(found) == 1:  # its own moments, not those of its points
            momentum = composite(scene, values).inertia @ omega
        outputs |= {
            f"{vessel}.origin": motion.origin - barycentre,
            f"{vessel}.centre_of_mass": motion.carry(np.array(table.centre_of_mass))[0] - barycentre,
            f"{vessel}.attitude": quaternion(motion.rotation),
            f"{vessel}.angular_velocity": motion.rotation.T @ (omega + motion.rate),
            f"{vessel}.angular_momentum": R_inertial_body @ momentum,
            f"{vessel}.velocity": R_inertial_body @ (part.masses @ v / part.masses.sum()),
        }
    return outputs


def _stored_beside(scene: Scene, vessel: str, own: Wheels, omega: Array) -> Array:
    """Returns what a vessel's wheels have of momentum beside locked ones, (3,) [N m s], body axes.

    omega : (3,) [rad/s], of the body, body axes
    """
    of_vessel = np.array([name.partition(".")[0] == vessel for name in scene.wheels], dtype=bool)
    locked = own.inertias * (own.axes @ omega + own.rates)
    beside: Array = (of_vessel * (own.momenta - locked)) @ own.axes
    return beside
