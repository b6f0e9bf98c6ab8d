"""A law's motion beside that of the law "tensor", in symbols of the inputs: what is compared, in which norm.

What is compared is y: the rate, where every change of inputs keeps the rate, [EB] eqs. (29) to (32);
the momentum, where every change keeps that, [EB] eqs. (35) to (41). Either stays at a change of inputs.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import sqrt

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from supervessel.composite.actions import torque_about_barycentre
from supervessel.composite.inertia import from_upper_triangle, ldl, ldl_inverse, upper_triangle
from supervessel.composite.resolved import ResolvedScene
from supervessel.rotation.changes import spin_of
from supervessel.rotation.laws import LAWS, MIXED_PRODUCTS, SQUARES
from supervessel.scene.schema import Law

Array = NDArray[np.float64]

PAIRS = (*MIXED_PRODUCTS, *SQUARES)
"""Products of two components, in the order of columns."""


@dataclass(frozen=True)
class Quadratic:
    """y' = acting u + products PAIRS(y) + linear y + constant; of shapes (3, m), (3, 6), (3, 3), (3,)."""

    acting: ca.SX
    products: ca.SX
    linear: ca.SX
    constant: ca.SX

    def less(self, other: "Quadratic") -> "Quadratic":
        """Returns the difference to another one."""
        return Quadratic(
            self.acting - other.acting,
            self.products - other.products,
            self.linear - other.linear,
            self.constant - other.constant,
        )

    def seen(self, into: ca.SX) -> "Quadratic":
        """Returns `into` times y', into : (3, 3)."""
        return Quadratic(into @ self.acting, into @ self.products, into @ self.linear, into @ self.constant)

    def slope(self, y: ca.SX) -> ca.SX:
        """Returns the matrix, (3, 3), of twice the symmetric bilinear form of the products, one factor y."""
        return ca.horzcat(*(2.0 * (self.products @ pairs_of(y, axis)) for axis in ca.horzsplit(ca.SX.eye(3))))

    def about(self, shift: ca.SX) -> "Quadratic":
        """Returns y' at y + shift, as a quadratic of y."""
        constant = self.products @ pairs_of(shift, shift) + self.linear @ shift + self.constant
        return Quadratic(self.acting, self.products, self.linear + self.slope(shift), constant)


@dataclass(frozen=True)
class Compared:
    """What is compared of a law and the law "tensor", as expressions of the inputs p.

    The error e is what is compared of the law, with a constant c added, less what is compared of "tensor".

    cheap           : y' under the law
    law             : w' under the law
    truth           : y' under the law "tensor"
    left            : what the law leaves out, in the norm of K: its y' less that of "tensor" at y + c
    into, back      : v = into e is the error in the norm of K, e = back v, (3, 3) each
    shift           : c, (3,)
    apart, turned   : (3, 3) and (3, 6), whose Frobenius norms multiply to kappa, [EB] eqs. (31), (39)
    own             : (3, 3), the law's own motion is bounded by the length of own^T y
    own_cubic       : the same two of the law's own motion in that norm
    own_pushed      : (3, m), what acts in that norm
    by_error        : (3, 3), difference of rates by v
    off             : difference of rates beside it: linear in y, (3, 3), and constant, (3,)
    rate            : the law's rate w: linear in y, (3, 3), and constant, (3,)
    by_rate         : (3, 3), v by an error of the law's rate
    start, begun    : y and v at the start, (3,) each
    spin_rate       : |h| trace(J^-1) [rad/s], bounds |J^-1 (w x h)|/|w|
    kept            : the law's tensor and spin, whose momentum a change keeps, and the tensor's inverse,
                      (3, 3), (3,), (3, 3); zero where a change keeps the rate
    rounded         : what rounding of a step depends on, [EB] eq. (28): D^-1, J and h, (3, 3), (3, 3), (3,),
                      zero where the law has no such term, and the torque by u, (3, m)
    """

    cheap: Quadratic
    law: Quadratic
    truth: Quadratic
    left: Quadratic
    into: ca.SX
    back: ca.SX
    shift: Array
    apart: ca.SX
    turned: ca.SX
    own: Array
    own_cubic: tuple[ca.SX, ca.SX]
    own_pushed: ca.SX
    by_error: ca.SX
    off: tuple[ca.SX, ca.SX]
    rate: tuple[ca.SX, ca.SX]
    by_rate: ca.SX
    start: ca.SX
    begun: ca.SX
    spin_rate: ca.SX
    kept: tuple[ca.SX, ca.SX, ca.SX]
    rounded: tuple[ca.SX, ca.SX, ca.SX, ca.SX]

    @property
    def forms(self) -> list[ca.SX]:
        """Symmetric matrices, (3, 3): growth by each component of y + c, and without any. [EB] eq. (30)."""
        slopes = [self.truth.slope(axis) for axis in ca.horzsplit(ca.SX.eye(3))]
        return [_symmetric(self.into @ form @ self.back) for form in (*slopes, self.truth.linear)]


@dataclass(frozen=True)
class ActedOn:
    """A composite that is acted on, of p: J and J^-1, (3, 3), h, (3,), and the torque by u, (3, m)."""

    inertia: ca.SX
    inverse: ca.SX
    spin: ca.SX
    arm: ca.SX

    @property
    def spin_rate(self) -> ca.SX:
        """|h| trace(J^-1) [rad/s]."""
        return ca.norm_2(self.spin) * ca.trace(self.inverse)


def acted_on(resolved: ResolvedScene, parts: Mapping[str, ca.SX]) -> ActedOn:
    """Returns the composite of which these are parts."""
    J = from_upper_triangle(parts["inertia"])
    u = ca.SX.sym("u", len(resolved.acting))
    arm = ca.jacobian(torque_about_barycentre(resolved, parts, u), u) if u.numel() else ca.SX.zeros(3, 0)
    return ActedOn(J, ldl_inverse(*ldl(J)), spin_of(parts), arm)


def rates_compared(law: Law, body: ActedOn, middle: Array, start: Array) -> Compared:
    """Returns the comparison of rates. [EB] eqs. (29) to (32).

    middle : K, (3, 3)
    start  : rate at the start, (3,) [rad/s]
    No part moves: changes of the motion of ports keep the momentum in every scene.
    """
    factor = _lower_factor(middle)
    own = _lower_factor(np.diag(np.diag(middle)) if law == "principal" else middle)
    D, inverse = _turned_tensor(law, body)
    cheap, truth = (_rate_motion(one, body) for one in (law, "tensor"))
    into, back = ca.SX(factor.T), ca.SX(np.linalg.inv(factor.T))
    own_into, own_back = ca.SX(own.T), ca.SX(np.linalg.inv(own.T))
    zeros, unit = ca.SX.zeros(3), ca.SX.eye(3)
    return Compared(
        cheap,
        cheap,
        truth,
        cheap.less(truth).seen(into),
        into,
        back,
        np.zeros(3),
        _apart(body.inverse, factor),
        _turned(factor, back, body.inertia @ back),
        own,
        (_apart(inverse, own), _turned(own, own_back, D @ own_back)),
        own_into @ cheap.acting,
        by_error=back,
        off=(ca.SX(3, 3), zeros),
        rate=(unit, zeros),
        by_rate=into,
        start=ca.SX(start),
        begun=zeros,
        spin_rate=body.spin_rate,
        kept=(ca.SX(3, 3), zeros, ca.SX(3, 3)),
        rounded=_rounded(law, body),
    )


def momenta_compared(law: Law, body: ActedOn, middle: Array, start: Array, shift: Array) -> Compared:
    """Returns the comparison of momenta. [EB] eqs. (35) to (41).

    shift : c, (3,) [N m s]
    Under the law "none", whose rate stays at a change, y is the momentum at the start.
    """
    factor = _lower_factor(middle)
    into, back, c = ca.SX(np.linalg.inv(factor)), ca.SX(factor), ca.SX(shift)
    steady, exact, zeros = law == "none", law == "tensor", ca.SX.zeros(3)
    D, inverse = _kept_tensor(law, body)
    nothing = ca.SX(3, 3)
    J, h, w = body.inertia, body.spin, ca.SX(start)
    truth = _momentum_motion("tensor", body)
    cheap = truth if exact else _momentum_motion(law, body)
    less = nothing if exact else (nothing if steady else inverse) - body.inverse
    off = less, (w if steady else zeros) - less @ h - body.inverse @ c
    return Compared(
        cheap,
        _rate_motion(law, body),
        truth,
        Quadratic(0 * body.arm, ca.SX(3, 6), nothing, zeros)
        if exact
        else cheap.less(truth.about(c)).seen(into),
        into,
        back,
        shift,
        _apart(body.inverse, factor),
        _turned(factor, body.inverse @ back, back),
        np.eye(3),
        (nothing, ca.SX(3, 6)),  # the momentum's length grows by torque alone
        cheap.acting,
        by_error=body.inverse @ back,
        off=off,
        rate=(nothing, w) if steady else (inverse, -inverse @ h),
        by_rate=nothing if steady else into @ D,
        start=D @ w + h,
        begun=into @ (c - (J - D) @ w),
        spin_rate=body.spin_rate,
        kept=(nothing, zeros, nothing) if steady else (D, h, inverse),
        rounded=_rounded(law, body),
    )


def shift_of(law: Law, inertia: ca.SX, start: Array) -> ca.SX:
    """Returns (J - D) w at the start, (3,): with that as c the comparison of momenta begins without error."""
    return (inertia - LAWS[law].keeping(inertia)) @ ca.SX(start)


def pairs_of(a: ca.SX, b: ca.SX) -> ca.SX:
    """Returns the symmetric products, (6,), of two vectors, (3,), in the order of PAIRS."""
    return ca.vertcat(*(0.5 * (a[m] * b[n] + a[n] * b[m]) for m, n in PAIRS))


def _lower_factor(tensor: Array) -> Array:
    return np.array(np.linalg.cholesky(tensor), dtype=np.float64)


def _symmetric(matrix: ca.SX) -> ca.SX:
    return 0.5 * (matrix + matrix.T)


def _turned_tensor(law: Law, body: ActedOn) -> tuple[ca.SX, ca.SX]:
    """Returns the tensor whose energy bounds the law's own rates, and its inverse."""
    D = ca.diag(ca.diag(body.inertia)) if law == "principal" else body.inertia
    return D, ldl_inverse(*ldl(D))


def _kept_tensor(law: Law, body: ActedOn) -> tuple[ca.SX, ca.SX]:
    """Returns the tensor D of the momentum D w + h that a change keeps under a law, and its inverse."""
    if law in ("none", "tensor"):
        return body.inertia, body.inverse
    D = LAWS[law].keeping(body.inertia)
    return D, ca.diag(1.0 / ca.diag(D))


def _rounded(law: Law, body: ActedOn) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """Returns what rounding of a step under a law depends on, see `Compared`. [EB] eq. (28)."""
    nothing = ca.SX(3, 3)
    if law == "none":
        return nothing, nothing, ca.SX.zeros(3), 0 * body.arm
    _, inverse = _kept_tensor(law, body)
    if not LAWS[law].gyroscopic_term:
        return inverse, nothing, ca.SX.zeros(3), body.arm
    return inverse, body.inertia, body.spin, body.arm


def _rate_motion(law: Law, body: ActedOn) -> Quadratic:
    """Returns w' under a law, without the law's scale. [EB] eq. (12)."""
    J = body.inertia
    numbers = {
        "none": ca.SX(0, 1),
        "decoupled": 1.0 / ca.diag(J),
        "principal": ca.vertcat(ca.diag(J), 1.0 / ca.diag(J), 1.0),
        "tensor": ca.vertcat(upper_triangle(J), upper_triangle(body.inverse), 1.0),
    }[law]
    rules, still = LAWS[law], ca.SX.zeros(3)
    by_torque = ca.horzcat(*(rules.acceleration(numbers, still, axis) for axis in ca.horzsplit(ca.SX.eye(3))))
    pull = rules.gyroscopic(numbers)
    return Quadratic(
        by_torque @ body.arm,
        ca.horzcat(pull, ca.SX.zeros(3, len(PAIRS) - pull.size2())),
        by_torque @ ca.skew(body.spin) if rules.gyroscopic_term else ca.SX(3, 3),
        still,
    )


def _momentum_motion(law: Law, body: ActedOn) -> Quadratic:
    """Returns P' under a law, P = D w + h; zero under "none". [EB] eq. (35)."""
    zeros = ca.SX.zeros(3)
    if not LAWS[law].gyroscopic_term:
        acting = 0 * body.arm if law == "none" else body.arm
        return Quadratic(acting, ca.SX(3, len(PAIRS)), ca.SX(3, 3), zeros)
    _, inverse = _kept_tensor(law, body)
    axes = ca.horzsplit(ca.SX.eye(3))
    columns = []
    for i, j in PAIRS:
        product = -ca.cross(inverse[:, i], axes[j])
        columns.append(product if i == j else product - ca.cross(inverse[:, j], axes[i]))
    return Quadratic(body.arm, ca.horzcat(*columns), ca.skew(inverse @ body.spin), zeros)


def _apart(inverse: ca.SX, factor: Array) -> ca.SX:
    """Returns F, (3, 3): Lambda^T J^-1 Lambda - 1. [EB] eq. (31)."""
    return ca.SX(factor.T) @ inverse @ ca.SX(factor) - ca.SX.eye(3)


def _turned(factor: Array, first: ca.SX, second: ca.SX) -> ca.SX:
    """Returns the forms, (3, 6), of products of v that Lambda^-1 (first v) x (second v) has, weighed so that
    their Frobenius norm bounds it over |v|^2. [EB] eqs. (31), (39)."""
    lower = ca.SX(np.linalg.inv(factor))
    columns = []
    for j, k in PAIRS:
        form = 0.5 * (ca.cross(first[:, j], second[:, k]) + ca.cross(first[:, k], second[:, j]))
        columns.append(lower @ form * (1.0 if j == k else sqrt(2.0)))
    return ca.horzcat(*columns)
