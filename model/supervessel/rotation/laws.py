"""Rotation laws in CasADi symbols: angular acceleration from rates and torque, cheapest law first.

A law is one entry in LAWS. Its `prepare` turns an inertia tensor into the numbers that the law needs, once
for each change of inertia; its `acceleration` uses them at every stage of a step. Power series need the same
acceleration as a sum: that by the torque, plus a linear map of products of two rates, which `products` and
`gyroscopic` give.
All vectors and tensors are in body axes. Source: [EQ] Rotation: the four laws, eqs. (7) to (10).
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt
from typing import TYPE_CHECKING

import casadi as ca

from supervessel.composite.inertia import from_upper_triangle, ldl, ldl_inverse, upper_triangle
from supervessel.rotation.lengths import smooth_length

if TYPE_CHECKING:
    from supervessel.scene.schema import Law

GYROSCOPIC_GROWTH = 1.0 / (3.0 * sqrt(3.0))
"""Largest growth rate of |omega| by the gyroscopic term, over |omega|^2.

In principal axes d|omega|/dt = (a_1 + a_2 + a_3) w_1 w_2 w_3 / |omega| with a_i = (J_j - J_k)/J_i. For a
rigid body |a_i| <= 1 and a_1 + a_2 + a_3 = -a_1 a_2 a_3, and |w_1 w_2 w_3| <= |omega|^3 / (3 sqrt 3).
"""


@dataclass(frozen=True)
class RotationLaw:
    """How the angular velocity changes.

    prepare      : inertia (3, 3) [kg m2] -> the law's own numbers, (n,)
    acceleration : the law's numbers, angular velocity (3,) [rad/s], torque about the barycentre (3,) [N m]
                   -> angular acceleration (3,) [rad/s2]
    growth       : bound of d|omega|/dt over |omega|^2 without torque
    products     : n pairs (i, j): without torque the acceleration is linear in the products omega_i omega_j
    gyroscopic   : the law's numbers -> the linear map of these products to the acceleration, (3, n)
    turning      : inertia (3, 3) [kg m2] -> the tensor whose free motion is the law's motion without torque,
                   (3, 3) [kg m2]; the unit tensor where that is a steady rate
    keeping      : inertia (3, 3) [kg m2] -> J in the momentum J omega + h that a change of masses or poses
                   keeps, (3, 3) [kg m2]
    """

    prepare: Callable[[ca.SX], ca.SX]
    acceleration: Callable[[ca.SX, ca.SX, ca.SX], ca.SX]
    growth: float
    products: tuple[tuple[int, int], ...]
    gyroscopic: Callable[[ca.SX], ca.SX]
    turning: Callable[[ca.SX], ca.SX]
    keeping: Callable[[ca.SX], ca.SX]

    @property
    def gyroscopic_term(self) -> bool:
        """Whether the law has the torque -omega x J omega."""
        return bool(self.products)


MIXED_PRODUCTS = ((1, 2), (2, 0), (0, 1))
SQUARES = ((0, 0), (1, 1), (2, 2))


def _nothing(inertia: ca.SX) -> ca.SX:
    """Returns no numbers, (0,)."""
    return ca.SX(0, 1)


def _keep(numbers: ca.SX, omega: ca.SX, torque: ca.SX) -> ca.SX:
    """omega' = 0."""
    return ca.SX.zeros(3)


def _spherical(inertia: ca.SX) -> ca.SX:
    """Returns the unit tensor: its free motion is a steady rate."""
    return ca.SX.eye(3)


def _diagonal(inertia: ca.SX) -> ca.SX:
    return ca.diag(ca.diag(inertia))


def _whole(inertia: ca.SX) -> ca.SX:
    return inertia


def _no_products(numbers: ca.SX) -> ca.SX:
    return ca.SX(3, 0)


def _reciprocal_moments(inertia: ca.SX) -> ca.SX:
    return 1.0 / ca.diag(inertia)


def _decoupled(numbers: ca.SX, omega: ca.SX, torque: ca.SX) -> ca.SX:
    """J_ii omega_i' = M_i."""
    return torque * numbers


def _scale(inertia: ca.SX) -> ca.SX:
    """Returns a power of two whose product with the largest moment is between 3/4 and 3.

    With moments scaled by it, moments times rates neither over- nor underflow before the rates do, and no
    other bit changes. The mean of two moments is at least half of the third, and always a double. Less 2^-52
    of itself it is one or two units in its last place smaller: by `unit`, a power of two. Rounding down by
    `floor` changes no power of two from 1 on; it makes the scale a constant in derivatives.
    """
    mean = 0.5 * inertia[0, 0] + 0.5 * inertia[1, 1]
    unit = mean - (1.0 - 2.0**-52) * mean
    up, down = ca.floor(2.0**-52 / unit), ca.floor(2.0**52 * unit)
    return ca.fmax(up, 1.0) / ca.fmax(down, 1.0)


def _moments(inertia: ca.SX) -> ca.SX:
    scale = _scale(inertia)
    moments = scale * ca.diag(inertia)
    return ca.vertcat(moments, 1.0 / moments, scale)


def _principal(numbers: ca.SX, omega: ca.SX, torque: ca.SX) -> ca.SX:
    """J_11 omega_1' = M_1 - (J_33 - J_22) omega_2 omega_3 and cyclically: [CV] eq. (2)."""
    J, reciprocal, torque = numbers[:3], numbers[3:6], numbers[6] * torque
    return ca.vertcat(
        (torque[0] - (J[2] - J[1]) * omega[1] * omega[2]) * reciprocal[0],
        (torque[1] - (J[0] - J[2]) * omega[2] * omega[0]) * reciprocal[1],
        (torque[2] - (J[1] - J[0]) * omega[0] * omega[1]) * reciprocal[2],
    )


def _principal_products(numbers: ca.SX) -> ca.SX:
    """Returns the diagonal of (J_j - J_k)/J_i, (3, 3)."""
    J, reciprocal = numbers[:3], numbers[3:6]
    return ca.diag(ca.vertcat(J[1] - J[2], J[2] - J[0], J[0] - J[1]) * reciprocal)


def _tensor_and_inverse(inertia: ca.SX) -> ca.SX:
    scale = _scale(inertia)
    scaled = scale * inertia
    return ca.vertcat(upper_triangle(scaled), upper_triangle(ldl_inverse(*ldl(scaled))), scale)


def _tensor(numbers: ca.SX, omega: ca.SX, torque: ca.SX) -> ca.SX:
    """J omega' = M - omega x J omega: [CV] eq. (1).

    Multiplying by the inverse takes as many operations as solving with the factors, but they do not wait for
    each other: half the time of a step.
    """
    J, inverse = from_upper_triangle(numbers[:6]), from_upper_triangle(numbers[6:12])
    return inverse @ (numbers[12] * torque - ca.cross(omega, J @ omega))


def _tensor_products(numbers: ca.SX) -> ca.SX:
    """Returns J^-1 times -(omega x J omega) as a linear map of the products, (3, 6)."""
    J, inverse = from_upper_triangle(numbers[:6]), from_upper_triangle(numbers[6:12])
    return inverse @ gyroscopic_torque(J)


def gyroscopic_torque(J: ca.SX) -> ca.SX:
    """Returns -(omega x J omega) as a linear map, (3, 6), of MIXED_PRODUCTS and SQUARES.

    J : (3, 3)
    Written out, the moments occur as differences only: a nearly spherical body loses no digits.
    """
    xy, xz, yz = J[0, 1], J[0, 2], J[1, 2]
    rows = (
        (J[1, 1] - J[2, 2], xy, -xz, 0.0, -yz, yz),
        (-xy, J[2, 2] - J[0, 0], yz, xz, 0.0, -xz),
        (xz, -yz, J[0, 0] - J[1, 1], -xy, xy, 0.0),
    )
    return ca.SX(ca.vertcat(*(ca.horzcat(*row) for row in rows)))


def principal_products(moments: ca.SX) -> ca.SX:
    """Returns (J_j - J_k)/J_i, (3,), (i, j, k) cyclic: without torque omega_i' is this times omega_j omega_k.

    moments : principal moments J_i, (3,) [kg m2]; omega and omega' are in principal axes
    This is the map of the law "tensor" in principal axes. In body axes the inverse of the tensor enlarges
    rounding by its condition number, where moments are 1e12 apart even that of a steady spin about the
    lightest axis. Here nothing is inverted.
    """
    return ca.vertcat(*((moments[i - 2] - moments[i - 1]) / moments[i] for i in range(3)))


def growth_excess(law: RotationLaw, inertia: ca.SX) -> ca.SX:
    """Returns by how much d|omega|/dt over |omega|^2 may exceed a law's `growth` without torque, >= 0.

    inertia : (3, 3) [kg m2], positive definite; its moments may break the triangle inequality, as those of a
              body less its wheels' inertia about their axes can
    As for GYROSCOPIC_GROWTH, but with |a_1 a_2 a_3| = |(J_1 - J_2)(J_2 - J_3)(J_3 - J_1)|/det J, whose
    numerator is the root of 4 s^3 - 27 det(S)^2: S is J less its mean moment, s half the sum of the squares
    of its elements. Left out is the second term.
    """
    if not law.gyroscopic_term:
        return ca.SX(0.0)
    kept = ca.densify(law.keeping(inertia))
    mean, (_, pivots) = ca.trace(kept) / 3.0, ldl(kept)
    unlike = smooth_length(ca.vec(kept / mean - ca.SX.eye(3))) * (mean / sqrt(2.0))
    growth = 2.0 * GYROSCOPIC_GROWTH * (unlike / pivots[0]) * (unlike / pivots[1]) * (unlike / pivots[2])
    return ca.fmax(growth - law.growth, 0.0)


LAWS: "dict[Law, RotationLaw]" = {
    "none": RotationLaw(_nothing, _keep, 0.0, (), _no_products, _spherical, _whole),
    "decoupled": RotationLaw(_reciprocal_moments, _decoupled, 0.0, (), _no_products, _spherical, _diagonal),
    "principal": RotationLaw(
        _moments, _principal, GYROSCOPIC_GROWTH, MIXED_PRODUCTS, _principal_products, _diagonal, _diagonal
    ),
    "tensor": RotationLaw(
        _tensor_and_inverse,
        _tensor,
        GYROSCOPIC_GROWTH,
        MIXED_PRODUCTS + SQUARES,
        _tensor_products,
        _whole,
        _whole,
    ),
}
