"""Mass distribution of rigid bodies and of their sum, in CasADi symbols.

An inertia tensor J is about a centre of mass, with J_xx = integral of y^2 + z^2 and J_xy = MINUS the integral
of x y over the mass, so that J omega is angular momentum: [EQ] What an inertia is, eq. (3).
Constants fold to numbers as expressions are built. The two triangles of a tensor share their symbols.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from supervessel.composite.templates import inlined

UPPER_TRIANGLE = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Row and column of xx, yy, zz, xy, xz, yz in a (3, 3) tensor: the order of every vector (6,) of a tensor."""


@dataclass(frozen=True)
class Body:
    """A body, all quantities in the same axes.

    mass      : [kg]
    centre    : (3,) [m], centre of mass, from the origin of the axes
    inertia   : (3, 3) [kg m2], about the centre of mass
    velocity  : (3,) [m/s], of the centre of mass relative to the axes; None: the whole body rests in them
    spin      : (3,) [N m s], angular momentum about the centre of mass of the motion relative to the axes;
                None: zero
    """

    mass: ca.SX
    centre: ca.SX
    inertia: ca.SX
    velocity: ca.SX | None = None
    spin: ca.SX | None = None

    def seen_from(
        self, R_outer_inner: ca.SX, origin: ca.SX, velocity: ca.SX | None = None, rate: ca.SX | None = None
    ) -> "Body":
        """Returns this body in outer axes; its own axes are the inner ones, in which it must be at rest.

        R_outer_inner : (3, 3)
        origin        : (3,) [m], of the inner axes, outer axes
        velocity      : (3,) [m/s], of that origin relative to the outer axes, outer axes
        rate          : (3,) [rad/s], of the inner axes relative to the outer axes, outer axes
        Where velocity or rate is None, the inner axes are at rest in the outer ones.
        With o, v, w for origin, velocity, rate and c, J of this value: centre o + R c, inertia R J R^T,
        velocity v + w x R c, spin R J R^T w.
        Source: [EQ] The assembly, eqs. (5), (6); When masses or poses change, eq. (11).
        """
        arm, inertia = R_outer_inner @ self.centre, congruence(R_outer_inner, self.inertia)
        if velocity is None or rate is None:
            return Body(self.mass, origin + arm, inertia)
        return Body(self.mass, origin + arm, inertia, velocity + ca.cross(rate, arm), inertia @ rate)

    def times(self, factor: ca.SX) -> "Body":
        """Returns the body with mass, inertia and spin times a factor; centre and velocity stay."""
        spin = None if self.spin is None else factor * self.spin
        return Body(factor * self.mass, self.centre, factor * self.inertia, self.velocity, spin)


def placed_body(
    mass: ca.SX, specific_inertia: ca.SX, centre: ca.SX, R_outer_vessel: ca.SX, origin: ca.SX
) -> Body:
    """Returns a vessel as a body in outer axes, in which the vessel is at rest.

    mass             : [kg]
    specific_inertia : (3, 3) [m2], tensor about the vessel's centre of mass over its mass, vessel axes
    centre           : (3,) [m], the vessel's centre of mass, vessel axes
    R_outer_vessel   : (3, 3)
    origin           : (3,) [m], of the vessel axes, outer axes
    Source: [EQ] The assembly, eqs. (5), (6).
    """
    specific = congruence(R_outer_vessel, specific_inertia)
    return Body(mass, origin + R_outer_vessel @ centre, mass * specific)


def symmetric(element: Callable[[int, int], ca.SX]) -> ca.SX:
    """Returns the symmetric (3, 3) matrix whose upper triangle is `element(i, j)`, i <= j."""
    matrix = ca.SX(3, 3)
    for i in range(3):
        for j in range(i, 3):
            matrix[i, j] = matrix[j, i] = element(i, j)
    return ca.densify(matrix)


@inlined((3, 3), (3, 3))
def congruence(R_outer_inner: ca.SX, inertia: ca.SX) -> ca.SX:
    """Returns a tensor in outer axes, R J R^T, (3, 3), exactly symmetric, in the unit of J.

    R_outer_inner : (3, 3)
    inertia       : J, (3, 3), symmetric, inner axes
    """
    half = R_outer_inner @ inertia
    return symmetric(lambda i, j: ca.dot(half[i, :], R_outer_inner[j, :]))


def orbiter_moments(pmi: ca.SX) -> ca.SX:
    """Returns the moments over mass, (3,) [m2], of the six points that Orbiter puts in a vessel's place.

    pmi : (3,) [m2], each >= 0
    Moments that a rigid body can have are returned as they are. Where one moment exceeds the sum of the other
    two by D, each of the other two is returned D larger.
    Source: [CV] eqs. (3-7), with the absolute value that Orbiter takes under the root.
    """
    k1, k2, k3 = ca.vertsplit(pmi)
    x, y, z = (0.5 * ca.fabs(square) for square in ((k2 + k3) - k1, (k3 + k1) - k2, (k1 + k2) - k3))
    return ca.vertcat(y + z, z + x, x + y)


def combine(bodies: Sequence[Body]) -> Body:
    """Returns several bodies as one, about their common centre of mass.

    bodies : all in the same axes, at least one with mass: the total mass divides
    m = sum m_j, c = sum m_j c_j/m, rho_j = c_j - c, J = sum J_j + m_j (|rho_j|^2 E - rho_j rho_j^T),
    h = sum h_j + m_j rho_j x rho_j', with c_j, J_j, h_j the centre, inertia and spin of body j.
    Each centre is taken from the first body's before anything is multiplied: a far origin costs no digits but
    those that the differences of the centres lose, and an error of c enters J by its square.
    Source: [CV] eqs. (10), (11) with products of inertia: [EQ] The assembly, eqs. (5), (6); When
    masses or poses change, eq. (11).
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
    """Returns mass [kg], centre (3,) [m] and inertia (3, 3) [kg m2] of n bodies at rest in the same axes.

    masses   : (n,) [kg]
    centres  : (3, n) [m]
    inertias : (3, 3, n) [kg m2], each about the body's centre of mass
    The numbers are those of `combine` to the last bit: cumulative sums add from the first body to the last.
    What overflows is inf or NaN, as in `combine`; the check of the whole scene refuses it.
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

    d : (3,) [m], or numbers (3, n) [m]: the element for each column, (n,) [m2]
    """
    if i != j:
        return -d[i] * d[j]
    one, other = (k for k in range(3) if k != i)
    return d[one] * d[one] + d[other] * d[other]


@inlined((3,))
def offset_tensor(d: ca.SX) -> ca.SX:
    """Returns |d|^2 E - d d^T, (3, 3) [m2]: the tensor, over its mass, of a point at d from the origin.

    d : (3,) [m]
    """
    return symmetric(lambda i, j: _offset_square(d, i, j))


def ldl(inertia: ca.SX, singular: bool = False) -> tuple[ca.SX, ca.SX]:
    """Returns (l21, l31, l32), (3,), of the unit lower triangular L, and the pivots, (3,) [kg m2], of D.

    inertia  : J = L D L^T, (3, 3) [kg m2], symmetric positive definite; its lower triangle is read
    singular : whether J may be positive semidefinite only; a pivot that is zero then divides as 1
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
    """Returns the solution x, (3,), of L D L^T x = right.

    lower, pivots : from `ldl`; no pivot may be zero
    right         : (3,); x is in its unit over [kg m2]
    """
    y1 = right[0]
    y2 = right[1] - lower[0] * y1
    y3 = right[2] - lower[1] * y1 - lower[2] * y2
    x3 = y3 / pivots[2]
    x2 = y2 / pivots[1] - lower[2] * x3
    x1 = y1 / pivots[0] - lower[0] * x2 - lower[1] * x3
    return ca.vertcat(x1, x2, x3)


def ldl_inverse(lower: ca.SX, pivots: ca.SX) -> ca.SX:
    """Returns the inverse of L D L^T, (3, 3) [1/(kg m2)], exactly symmetric.

    lower, pivots : from `ldl`; no pivot may be zero
    With M = L^-1, of elements m21, m31, m32, the inverse is M^T D^-1 M: each diagonal element is a sum of
    positive terms.
    """
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
    """Returns xx, yy, zz, xy, xz, yz of a symmetric tensor, (3, 3), as a vector (6,)."""
    return ca.vertcat(*(tensor[i, j] for i, j in UPPER_TRIANGLE))


def from_upper_triangle(elements: ca.SX) -> ca.SX:
    """Returns the symmetric tensor, (3, 3), whose xx, yy, zz, xy, xz, yz are `elements`, (6,)."""
    by_place = dict(zip(UPPER_TRIANGLE, ca.vertsplit(elements), strict=True))
    return symmetric(lambda i, j: by_place[i, j])
