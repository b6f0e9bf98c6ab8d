"""Mass distribution of rigid bodies and of their sum, in CasADi symbols.

What is constant folds to numbers as it is built; a tensor's two triangles share their symbols.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from supervessel.composite.templates import inlined

UPPER_TRIANGLE = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Where xx, yy, zz, xy, xz, yz stand in a tensor."""


@dataclass(frozen=True)
class Body:
    """A body seen from some axes.

    mass      : [kg]
    centre    : (3,) [m], its centre of mass
    inertia   : (3, 3) [kg m2], about the centre of mass
    velocity  : (3,) [m/s], of the centre, relative to the axes; None: at rest in them, and so is all of it
    spin      : (3,) [N m s], angular momentum of the motion relative to the axes, about the centre; or None
    """

    mass: ca.SX
    centre: ca.SX
    inertia: ca.SX
    velocity: ca.SX | None = None
    spin: ca.SX | None = None

    def seen_from(
        self, rotation: ca.SX, origin: ca.SX, velocity: ca.SX | None = None, rate: ca.SX | None = None
    ) -> "Body":
        """Returns the body, at rest in these axes, in other ones.

        rotation : (3, 3), takes components in these axes to components in the other ones
        origin   : (3,) [m], origin of these axes in the other ones
        velocity : (3,) [m/s], of that origin relative to the other axes; None: these axes are at rest there
        rate     : (3,) [rad/s], of these axes relative to the other ones, in the other ones; or None
        """
        arm, inertia = rotation @ self.centre, congruence(rotation, self.inertia)
        if velocity is None or rate is None:
            return Body(self.mass, origin + arm, inertia)
        return Body(self.mass, origin + arm, inertia, velocity + ca.cross(rate, arm), inertia @ rate)

    def times(self, factor: ca.SX) -> "Body":
        """Returns the body with its mass, and so all that follows from it, times a factor."""
        spin = None if self.spin is None else factor * self.spin
        return Body(factor * self.mass, self.centre, factor * self.inertia, self.velocity, spin)


def placed_body(mass: ca.SX, specific_inertia: ca.SX, centre: ca.SX, rotation: ca.SX, origin: ca.SX) -> Body:
    """Returns a vessel as a body seen from other axes, in which it is at rest.

    mass             : [kg]
    specific_inertia : (3, 3) [m2], tensor about its centre of mass over its mass, vessel axes
    centre           : (3,) [m], its centre of mass, vessel axes
    rotation, origin : (3, 3), (3,) [m], of the vessel's axes in the other ones
    """
    specific = congruence(rotation, specific_inertia)
    return Body(mass, origin + rotation @ centre, mass * specific)


def symmetric(element: Callable[[int, int], ca.SX]) -> ca.SX:
    """Returns the symmetric (3, 3) matrix whose upper triangle is `element(i, j)`, i <= j."""
    matrix = ca.SX(3, 3)
    for i in range(3):
        for j in range(i, 3):
            matrix[i, j] = matrix[j, i] = element(i, j)
    return ca.densify(matrix)


@inlined((3, 3), (3, 3))
def congruence(rotation: ca.SX, inertia: ca.SX) -> ca.SX:
    """Returns R J R^T, (3, 3), exactly symmetric, for a symmetric J."""
    half = rotation @ inertia
    return symmetric(lambda i, j: ca.dot(half[i, :], rotation[j, :]))


def orbiter_moments(pmi: ca.SX) -> ca.SX:
    """Returns the moments over mass, (3,) [m2], of the six points that Orbiter puts in a vessel's place.

    pmi : (3,) [m2], any moments >= 0. Those of a rigid body come back; where one exceeds the sum of the other
          two by D, these two are D larger.
    Source: [CV] eqs. (3-7), with the absolute value that Orbiter takes under the root.
    """
    k1, k2, k3 = ca.vertsplit(pmi)
    x, y, z = (0.5 * ca.fabs(square) for square in ((k2 + k3) - k1, (k3 + k1) - k2, (k1 + k2) - k3))
    return ca.vertcat(y + z, z + x, x + y)


def combine(bodies: Sequence[Body]) -> Body:
    """Returns bodies, seen from the same axes, as one; at least one of them must have mass.

    J = sum J_j + m_j (|rho_j|^2 E - rho_j rho_j^T), rho_j from the common centre to body j's. Centres are
    taken from that of the first body before anything is multiplied, so that a far origin costs no digits
    beyond those of the centres' differences; an error of the common centre enters J squared only.
    The spin, h = sum h_j + m_j rho_j x rho_j', is taken about the common centre as well.
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
        inertia = inertia + (body.inertia + body.mass * offset_tensor(rho))
    if all(body.velocity is None for body in bodies):
        return Body(mass, first.centre + centre, inertia)
    moving = [
        (b, b.velocity, offset - centre)
        for b, offset in zip(bodies, offsets, strict=True)
        if b.velocity is not None
    ]
    velocity = sum((body.mass * v for body, v, _ in moving), ca.SX.zeros(3)) / mass
    # sum m_j rho_j = 0: the common velocity need not be taken off
    spin = sum((body.mass * ca.cross(rho, v) for body, v, rho in moving), ca.SX.zeros(3))
    spin = sum((body.spin for body, _, _ in moving if body.spin is not None), spin)
    return Body(mass, first.centre + centre, inertia, velocity, spin)


def combine_numbers(
    masses: NDArray[np.float64], centres: NDArray[np.float64], inertias: NDArray[np.float64]
) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """Returns mass, centre (3,) and inertia (3, 3) of n bodies at rest as `combine` does, to the last bit.

    masses   : (n,) [kg]
    centres  : (3, n) [m]
    inertias : (3, 3, n) [kg m2]
    Sums are cumulative ones, which add from the first to the last. What overflows is inf or NaN, as in
    `combine`: the check of the whole scene refuses it.
    """
    if len(masses) == 1:
        return float(masses[0]), centres[:, 0], inertias[:, :, 0]
    with np.errstate(over="ignore", invalid="ignore"):
        return _combined_numbers(masses, centres, inertias)


def _combined_numbers(
    masses: NDArray[np.float64], centres: NDArray[np.float64], inertias: NDArray[np.float64]
) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """Returns what `combine_numbers` does for two bodies or more."""
    offsets = centres - centres[:, :1]
    mass = np.cumsum(masses)[-1]
    centre = np.cumsum(masses[1:] * offsets[:, 1:], axis=1)[:, -1] / mass
    rho = offsets - centre[:, None]
    inertia = np.empty((3, 3))
    for i, j in UPPER_TRIANGLE:
        terms = inertias[i, j] + masses * _offset_square(rho, i, j)
        inertia[i, j] = inertia[j, i] = np.cumsum(terms)[-1]
    return float(mass), centres[:, 0] + centre, inertia


def _offset_square(d: Any, i: int, j: int) -> Any:
    """Returns element (i, j) of |d|^2 E - d d^T without subtracting squares.

    d : (3,), or numbers (3, n): the element for each column
    """
    if i != j:
        return -d[i] * d[j]
    one, other = (k for k in range(3) if k != i)
    return d[one] * d[one] + d[other] * d[other]


@inlined((3,))
def offset_tensor(d: ca.SX) -> ca.SX:
    """Returns |d|^2 E - d d^T, (3, 3)."""
    return symmetric(lambda i, j: _offset_square(d, i, j))


def ldl(inertia: ca.SX, singular: bool = False) -> tuple[ca.SX, ca.SX]:
    """Returns the unit lower factor's (l21, l31, l32), (3,), and the pivots, (3,), of J = L D L^T.

    singular : whether pivots may be zero; a quotient by such a pivot is one by 1
    """

    def divisor(pivot: ca.SX) -> ca.SX:
        return ca.if_else(pivot == 0.0, 1.0, pivot) if singular else pivot

    d1 = divisor(inertia[0, 0])
    l21, l31 = inertia[1, 0] / d1, inertia[2, 0] / d1
    d2 = inertia[1, 1] - l21 * inertia[1, 0]
    below = inertia[2, 1] - l31 * inertia[1, 0]
    l32 = below / divisor(d2)
    d3 = inertia[2, 2] - l31 * inertia[2, 0] - l32 * below
    return ca.vertcat(l21, l31, l32), ca.vertcat(inertia[0, 0], d2, d3)


def ldl_solve(lower: ca.SX, pivots: ca.SX, right: ca.SX) -> ca.SX:
    """Returns the solution of L D L^T x = right, (3,), from `ldl`."""
    y1 = right[0]
    y2 = right[1] - lower[0] * y1
    y3 = right[2] - lower[1] * y1 - lower[2] * y2
    x3 = y3 / pivots[2]
    x2 = y2 / pivots[1] - lower[2] * x3
    x1 = y1 / pivots[0] - lower[0] * x2 - lower[1] * x3
    return ca.vertcat(x1, x2, x3)


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
