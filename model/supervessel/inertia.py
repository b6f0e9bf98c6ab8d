"""Mass distribution of rigid bodies and of their sum, in CasADi symbols.

What is constant folds to numbers as it is built; a tensor's two triangles share their symbols.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca

UPPER_TRIANGLE = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Where xx, yy, zz, xy, xz, yz stand in a tensor."""


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


def combine(bodies: Sequence[Body]) -> Body:
    """Returns bodies, seen from the same axes, as one; at least one of them must have mass.

    J = sum J_j + m_j (|rho_j|^2 E - rho_j rho_j^T), rho_j from the common centre to body j's. Centres are
    taken from that of the first body before anything is multiplied, so that a far origin costs no digits
    beyond those of the centres' differences; an error of the common centre enters J squared only.
    Source: [CV] eqs. (10), (11); Huygens-Steiner theorem.
    """
    first, *others = bodies
    if not others:
        return first
    offsets = [body.centre - first.centre for body in bodies]
    mass = sum((body.mass for body in others), first.mass)
    centre = sum((b.mass * d for b, d in zip(others, offsets[1:], strict=True)), ca.SX.zeros(3)) / mass
    inertia = ca.SX.zeros(3, 3)
    for body, offset in zip(bodies, offsets, strict=True):
        rho = offset - centre
        inertia = inertia + body.inertia + body.mass * _offset_tensor(rho)
    return Body(mass, first.centre + centre, inertia)


def _offset_tensor(d: ca.SX) -> ca.SX:
    """Returns |d|^2 E - d d^T, (3, 3)."""
    return symmetric(lambda i, j: _offset_square(d, i, j))


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


def ldl_inverse(lower: ca.SX, pivots: ca.SX) -> ca.SX:
    """Returns the inverse of L D L^T, (3, 3), from `ldl`; its diagonal is a sum of positive terms."""
    m21, m31, m32 = -lower[0], lower[0] * lower[2] - lower[1], -lower[2]
    i1, i2, i3 = 1.0 / pivots[0], 1.0 / pivots[1], 1.0 / pivots[2]
    elements = {
        (0, 0): i1 + (m21 * m21) * i2 + (m31 * m31) * i3,
        (0, 1): m21 * i2 + m31 * m32 * i3,
        (0, 2): m31 * i3,
        (1, 1): i2 + (m32 * m32) * i3,
        (1, 2): m32 * i3,
        (2, 2): i3,
    }
    return symmetric(lambda i, j: elements[i, j])


def upper_triangle(tensor: ca.SX) -> ca.SX:
    """Returns xx, yy, zz, xy, xz, yz of a symmetric tensor, (6,)."""
    return ca.vertcat(*(tensor[i, j] for i, j in UPPER_TRIANGLE))


def from_upper_triangle(elements: ca.SX) -> ca.SX:
    """Returns the symmetric tensor, (3, 3), of its xx, yy, zz, xy, xz, yz."""
    by_place = dict(zip(UPPER_TRIANGLE, ca.vertsplit(elements), strict=True))
    return symmetric(lambda i, j: by_place[i, j])
