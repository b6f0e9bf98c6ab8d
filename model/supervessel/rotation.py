"""Rotation laws in CasADi symbols: angular acceleration from rates and torque, cheapest law first.

A law is two functions. `prepare` turns an inertia tensor into the numbers that the law needs, once for
each change of inertia; `acceleration` uses them at every stage of a step. A new law is one entry in LAWS.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt

import casadi as ca

from supervessel.inertia import from_upper_triangle, ldl, ldl_inverse, upper_triangle
from supervessel.scene import Law

GYROSCOPIC_GROWTH = 1.0 / (3.0 * sqrt(3.0))
"""Largest growth rate of |omega| by the gyroscopic term, over |omega|^2.

In principal axes d|omega|/dt = (a_1 + a_2 + a_3) w_1 w_2 w_3 / |omega| with a_i = (J_j - J_k)/J_i. For a
rigid body |a_i| <= 1 and a_1 + a_2 + a_3 = -a_1 a_2 a_3, and |w_1 w_2 w_3| <= |omega|^3 / (3 sqrt 3).
"""


@dataclass(frozen=True)
class RotationLaw:
    """How the angular velocity changes.

    prepare      : inertia (3, 3) [kg m2] -> the law's own numbers, (n,)
    acceleration : those, angular velocity (3,) [rad/s], torque (3,) [N m] -> (3,) [rad/s2]; body axes
    growth       : bound of d|omega|/dt over |omega|^2 without torque
    """

    prepare: Callable[[ca.SX], ca.SX]
    acceleration: Callable[[ca.SX, ca.SX, ca.SX], ca.SX]
    growth: float


def _nothing(inertia: ca.SX) -> ca.SX:
    return ca.SX(0, 1)


def _keep(numbers: ca.SX, omega: ca.SX, torque: ca.SX) -> ca.SX:
    return ca.SX.zeros(3)


def _reciprocal_moments(inertia: ca.SX) -> ca.SX:
    return 1.0 / ca.diag(inertia)


def _decoupled(numbers: ca.SX, omega: ca.SX, torque: ca.SX) -> ca.SX:
    return torque * numbers


def _moments(inertia: ca.SX) -> ca.SX:
    return ca.vertcat(ca.diag(inertia), 1.0 / ca.diag(inertia))


def _principal(numbers: ca.SX, omega: ca.SX, torque: ca.SX) -> ca.SX:
    """[CV] eq. (2): Euler's equations with the diagonal of the tensor only."""
    J, reciprocal = numbers[:3], numbers[3:]
    return ca.vertcat(
        (torque[0] - (J[2] - J[1]) * omega[1] * omega[2]) * reciprocal[0],
        (torque[1] - (J[0] - J[2]) * omega[2] * omega[0]) * reciprocal[1],
        (torque[2] - (J[1] - J[0]) * omega[0] * omega[1]) * reciprocal[2],
    )


def _tensor_and_inverse(inertia: ca.SX) -> ca.SX:
    return ca.vertcat(upper_triangle(inertia), upper_triangle(ldl_inverse(*ldl(inertia))))


def _tensor(numbers: ca.SX, omega: ca.SX, torque: ca.SX) -> ca.SX:
    """[CV] eq. (1): J omega' = M - omega x J omega with the full tensor.

    Multiplying by the inverse takes as many operations as solving with the factors, but none of them
    waits for another: half the time of a step.
    """
    J, inverse = from_upper_triangle(numbers[:6]), from_upper_triangle(numbers[6:])
    return inverse @ (torque - ca.cross(omega, J @ omega))


LAWS: dict[Law, RotationLaw] = {
    "none": RotationLaw(_nothing, _keep, 0.0),
    "decoupled": RotationLaw(_reciprocal_moments, _decoupled, 0.0),
    "principal": RotationLaw(_moments, _principal, GYROSCOPIC_GROWTH),
    "tensor": RotationLaw(_tensor_and_inverse, _tensor, GYROSCOPIC_GROWTH),
}
