"""Mass distribution of rigid bodies and of their sum, in CasADi symbols.

What is constant folds to numbers as it is built; a tensor's two triangles share their symbols.
"""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca


@dataclass(frozen=True)
class Body:
    """A rigid body seen from some axes.

    mass      : [kg]
    centre    : (3,) [m], its centre of mass
    inertia   : (3, 3) [kg m2], about the centre of mass
    """

    mass: ca.SX
    centre: ca.SX
    inertia: ca.SX

    def seen_from(self, rotation: ca.SX, origin: ca.SX) -> "Body":
        """Returns the body in other axes.

        rotation : (3, 3), takes components in these axes to components in the other ones
        origin   : (3,) [m], origin of these axes in the other ones
        """
        return Body(self.mass, origin + rotation @ self.centre, congruence(rotation, self.inertia))


def congruence(rotation: ca.SX, inertia: ca.SX) -> ca.SX:
    """Returns R J R^T, (3, 3), exactly symmetric, for a symmetric J."""
    half = rotation @ inertia
    return symmetric(lambda i, j: ca.dot(half[i, :], rotation[j, :]))


def symmetric(element: Callable[[int, int], ca.SX]) -> ca.SX:
    """Returns the symmetric (3, 3) matrix whose upper triangle is `element(i, j)`, i <= j."""
    matrix = ca.SX(3, 3)
    for i in range(3):
        for j in range(i, 3):
            matrix[i, j] = matrix[j, i] = element(i, j)
    return ca.densify(matrix)


def join(one: Body, other: Body) -> Body:
    """Returns two bodies, seen from the same axes, as one.

    J = J_1 + J_2 + m_1 m_2 / (m_1 + m_2) (|d|^2 E - d d^T), d from one centre to the other: every term
    is positive or a difference of centres, so nothing cancels at any ratio of masses, wherever the
    origin is. Two massless bodies together have the first one's centre.
    Source: [CV] eqs. (10), (11); Huygens-Steiner theorem for both parts about the common centre.
    """
    if one.mass.is_zero():
        return other
    if other.mass.is_zero():
        return one
    mass = one.mass + other.mass
    share = other.mass / (mass if _is_positive(one.mass) or _is_positive(other.mass) else _nonzero(mass))
    reduced = one.mass * share
    d = other.centre - one.centre
    return Body(
        mass,
        one.centre + share * d,
        one.inertia + other.inertia + reduced * symmetric(lambda i, j: _offset_square(d, i, j)),
    )


def _is_positive(mass: ca.SX) -> bool:
    """Whether a mass is a number above zero; a symbol may become zero."""
    return bool(mass.is_constant()) and float(mass) > 0.0


def _nonzero(mass: ca.SX) -> ca.SX:
    """Returns the mass where it is above zero, else 1: the numerator over it is zero then."""
    return ca.if_else(mass > 0.0, mass, 1.0)


def _offset_square(d: ca.SX, i: int, j: int) -> ca.SX:
    """Returns element (i, j) of |d|^2 E - d d^T without subtracting squares."""
    if i != j:
        return -d[i] * d[j]
    one, other = (k for k in range(3) if k != i)
    return d[one] * d[one] + d[other] * d[other]


def ldl(inertia: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Returns the unit lower factor's (l21, l31, l32), (3,), and the pivots, (3,), of J = L D L^T."""
    l21, l31 = inertia[1, 0] / inertia[0, 0], inertia[2, 0] / inertia[0, 0]
    d2 = inertia[1, 1] - l21 * inertia[1, 0]
    below = inertia[2, 1] - l31 * inertia[1, 0]
    l32 = below / d2
    d3 = inertia[2, 2] - l31 * inertia[2, 0] - l32 * below
    return ca.vertcat(l21, l31, l32), ca.vertcat(inertia[0, 0], d2, d3)


def ldl_solve(lower: ca.SX, inverse_pivots: ca.SX, right: ca.SX) -> ca.SX:
    """Returns x of L D L^T x = right, (3,), from `ldl` and the reciprocals of its pivots."""
    y1 = right[0]
    y2 = right[1] - lower[0] * y1
    y3 = right[2] - lower[1] * y1 - lower[2] * y2
    x3 = y3 * inverse_pivots[2]
    x2 = y2 * inverse_pivots[1] - lower[2] * x3
    x1 = y1 * inverse_pivots[0] - lower[0] * x2 - lower[1] * x3
    return ca.vertcat(x1, x2, x3)
