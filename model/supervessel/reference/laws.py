"""Rotation laws: the part of an inertia tensor that each uses, and the angular acceleration that it gives."""

import numpy as np
from numpy.typing import ArrayLike

from supervessel.reference.assembly import Array
from supervessel.scene.schema import ORIGIN


def law_tensor(law: str, inertia: ArrayLike) -> Array:
    """Returns the part of an inertia tensor that a rotation law uses, (3, 3): all of it or its diagonal.

    Example:
        >>> reference.law_tensor("principal", [[2, 1, 0], [1, 3, 0], [0, 0, 4]]).tolist()
        [[2.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 4.0]]
    """
    J = np.asarray(inertia, dtype=float)
    return np.diag(np.diag(J)) if law in ("principal", "decoupled") else J


def angular_acceleration(
    law: str,
    inertia: ArrayLike,
    angular_velocity: ArrayLike,
    torque: ArrayLike,
    internal_momentum: ArrayLike = ORIGIN,
) -> Array:
    """Returns the angular acceleration, (3,) [rad/s2], body axes, under a rotation law.

    law               : "none", "decoupled", "principal" or "tensor"
    inertia           : (3, 3) [kg m2], about the barycentre, body axes
    angular_velocity  : (3,) [rad/s], body axes
    torque            : (3,) [N m], about the barycentre, body axes
    internal_momentum : (3,) [N m s], about the barycentre, body axes, of parts that move at steady rates
    Source: [CV] eq. (1) for "tensor", eq. (2) for "principal"; "decoupled" leaves out the gyroscopic
    term, "none" keeps the angular velocity.

    Example:
        >>> reference.angular_acceleration("tensor", np.diag([1, 2, 4]), [1, 2, 0.5], [0, 0, 0]).tolist()
        [-2.0, 0.75, -0.5]
    """
    J = law_tensor(law, inertia)
    omega, torque = np.asarray(angular_velocity, dtype=float), np.asarray(torque, dtype=float)
    if law == "none":
        return np.zeros(3)
    if law == "decoupled":
        return torque / np.diag(J)
    if law not in ("principal", "tensor"):
        raise ValueError(f'law = "{law}": must be one of none, decoupled, principal, tensor')
    momentum = J @ omega + np.asarray(internal_momentum, dtype=float)
    acceleration: Array = np.linalg.solve(J, torque - np.cross(omega, momentum))
    return acceleration
