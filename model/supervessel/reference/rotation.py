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
from supervessel.reference.laws import angular_acceleration, law_tensor
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
    """Returns the rate of the state (attitude, angular velocity), (7,), of a scene under its own law.

    torque : (3,) [N m], all that acts from outside, about the barycentre; by default what `values` say and
             gravity's gradient
    Inputs are steady: between changes.

    Example:
        >>> reference.ode(scene, [1, 0, 0, 0, 0, 0.002, 0])[:4].tolist()
        [0.0, 0.0, 0.001, 0.0]
    """
    state = np.asarray(state, dtype=float)
    acceleration = angular_acceleration(
        scene.rotation.law,
        composite(scene, values).inertia,
        state[4:],
        external_torque(scene, values) + gradient_torque(scene, state[:4], values)
        if torque is None
        else torque,
        internal_momentum(scene, values),
    )
    return np.concatenate([attitude_dot(state[:4], state[4:]), acceleration])


def angular_momentum(
    scene: Scene, angular_velocity: ArrayLike, values: Mapping[str, float] | None = None
) -> Array:
    """Returns H = J omega + h, (3,) [N m s], about the barycentre, body axes, J being the law's tensor.

    angular_velocity : (3,) [rad/s], body axes

    Example:
        >>> round(float(reference.angular_momentum(scene, [0, 0.0011, 0])[1]) / 1e3)  # kN m s
        360
    """
    J = law_tensor(scene.rotation.law, composite(scene, values).inertia)
    momentum: Array = J @ np.asarray(angular_velocity, dtype=float) + internal_momentum(scene, values)
    return momentum


def angular_velocity(scene: Scene, momentum: ArrayLike, values: Mapping[str, float] | None = None) -> Array:
    """Returns omega = J^-1 (H - h), (3,) [rad/s], body axes, of a momentum H, (3,) [N m s], body axes.

    Example:
        >>> momentum = reference.angular_momentum(scene, [0, 0.0011, 0])
        >>> round(float(reference.angular_velocity(scene, momentum)[1]), 9)
        0.0011
    """
    J = law_tensor(scene.rotation.law, composite(scene, values).inertia)
    excess: Array = np.asarray(momentum, dtype=float) - internal_momentum(scene, values)
    return np.asarray(np.linalg.solve(J, excess), dtype=float)


def momentum_ode(scene: Scene, state: ArrayLike, values: Mapping[str, float] | None = None) -> Array:
    """Returns the rate of the state (attitude, angular momentum in body axes), (7,), under the scene's law.

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
        momentum_dot = momentum_dot - np.cross(omega, state[4:])
    return np.concatenate([attitude_dot(state[:4], omega), momentum_dot])


def vessel_outputs(
    scene: Scene, state: ArrayLike, values: Mapping[str, float] | None = None
) -> dict[str, Array]:
    """Returns the outputs of each vessel, "vessel.output"; all zero for one that is not joined to the root.

    state : (attitude, angular velocity), (7,)

    Example:
        >>> outputs = reference.vessel_outputs(scene, [1, 0, 0, 0, 0, 0.0011, 0])
        >>> outputs["DG.origin"].round(2).tolist()
        [0.09, -26.55, 3.14]
    """
    state = np.asarray(state, dtype=float)
    omega, R_inertial_body = state[4:], rotation_matrix(state[:4])
    found, own = motions(scene, values), points(scene, values)
    whole = joined(own.values())
    drift = whole.masses @ whole.velocities / whole.masses.sum()
    outputs: dict[str, Array] = {}
    for vessel, table in scene.vessels.items():
        outputs |= {f"{vessel}.{name}": np.zeros(4 if name == "attitude" else 3) for name in VESSEL_OUTPUTS}
        if vessel not in found:
            continue
        motion, part = found[vessel], own[vessel]
        rho = part.positions - whole.barycentre
        v = np.cross(omega, rho) + part.velocities - drift
        outputs |= {
            f"{vessel}.origin": motion.origin - whole.barycentre,
            f"{vessel}.centre_of_mass": motion.carry(np.array(table.centre_of_mass))[0] - whole.barycentre,
            f"{vessel}.attitude": quaternion(motion.rotation),
            f"{vessel}.angular_velocity": motion.rotation.T @ (omega + motion.rate),
            f"{vessel}.angular_momentum": R_inertial_body @ (part.masses @ np.cross(rho, v)),
        }
    return outputs
