"""A bound of what a law that leaves terms out is off by, carried along its motion, in CasADi symbols.

omega : rate of the body, of tensor J, that torque M and the spin h of moving parts turn by the law "tensor"
w     : rate under the scene's law, with the same inputs
e     : w - omega, components each in its own body axes

Two numbers are carried: a bound of the angle [rad] between both attitudes, and one of |e|_J = sqrt(e . J e),
the energy norm [J^(1/2)], J = L L^T being the tensor at that time. Both hold for the exact motions; nothing
is linearised and no sample stands for a span of time. Steps of a method are in `step_remainder`. Derivation:
[EB].
"""

from dataclasses import dataclass

import casadi as ca

from supervessel.composite.inertia import ldl
from supervessel.rotation.laws import RotationLaw

COSINE_STEPS = 4
"""Even number of steps of [EB] eq. (10); they leave at most 1e-5 of the cosine."""

COSINE_SLACK = 2.0**-45
"""Added to the argument of [EB] eq. (10): more than its rounding, 100 u."""

INFLATION = 1.0 + 2.0**-44
"""What sums and products of fewer than 500 positive terms may lose to rounding."""


@dataclass(frozen=True)
class EnergyNorm:
    """The energy norm of a tensor J = L L^T.

    inertia : J, (3, 3) [kg m2]
    lower   : L, (3, 3)
    inverse : L^-1, (3, 3)
    """

    inertia: ca.SX
    lower: ca.SX
    inverse: ca.SX

    def of_torque(self, torque: ca.SX) -> ca.SX:
        """Returns |L^-1 torque|, the energy norm of J^-1 torque."""
        return ca.norm_2(self.inverse @ torque)

    @property
    def rate_share(self) -> ca.SX:
        """The least k with |e| <= k |e|_J: 1/sqrt(least moment), from above. [EB] eq. (6)."""
        return ca.sqrt(largest_eigenvalue(self.inverse.T @ self.inverse))


def norm_of(inertia: ca.SX) -> EnergyNorm:
    """Returns the energy norm of a positive definite tensor, (3, 3) [kg m2]."""
    lower, pivots = ldl(inertia)
    roots = ca.sqrt(pivots)
    L = ca.densify(_unit_lower(lower) @ ca.diag(roots))
    m21, m31, m32 = -lower[0], lower[0] * lower[2] - lower[1], -lower[2]
    inverse = ca.densify(ca.diag(1.0 / roots) @ _unit_lower(ca.vertcat(m21, m31, m32)))
    return EnergyNorm(inertia, L, inverse)


def _unit_lower(below: ca.SX) -> ca.SX:
    """Returns the unit lower triangular matrix, (3, 3), of its elements 21, 31, 32."""
    return ca.vertcat(
        ca.horzcat(1.0, 0.0, 0.0),
        ca.horzcat(below[0], 1.0, 0.0),
        ca.horzcat(below[1], below[2], 1.0),
    )


def growth(norm: EnergyNorm, rate: ca.SX) -> ca.SX:
    """Returns lambda(w) [rad/s]: |e|_J grows at most so fast, over itself, while the cheap rate is w.

    rate : w, (3,) [rad/s], body axes
    Source: [EB] eqs. (4), (9), (10).
    """
    return _largest_of_traceless(_symmetric_part(norm, rate))


def growth_in_box(norm: EnergyNorm, box: ca.SX) -> ca.SX:
    """Returns a bound of lambda(w) over all |w_i| <= box_i, (3,) [rad/s]. [EB] eq. (11)."""
    total = ca.SX.zeros(3, 3)
    for k in range(3):
        total += box[k] * ca.fabs(_symmetric_part(norm, ca.SX.eye(3)[:, k]))
    return ca.norm_fro(total)


def _symmetric_part(norm: EnergyNorm, rate: ca.SX) -> ca.SX:
    """Returns S(w), the symmetric part of -L^-1 [w x] L, (3, 3); its trace is zero. [EB] eq. (4)."""
    product = -(norm.inverse @ (ca.skew(rate) @ norm.lower))
    return ca.densify(0.5 * (product + product.T))


def largest_eigenvalue(matrix: ca.SX) -> ca.SX:
    """Returns the largest eigenvalue of a symmetric (3, 3) matrix, from above, within 1e-5 of its spread."""
    mean = ca.trace(matrix) / 3.0
    return mean + _largest_of_traceless(matrix - mean * ca.SX.eye(3))


def _largest_of_traceless(S: ca.SX) -> ca.SX:
    """Returns the largest eigenvalue of a symmetric (3, 3) matrix of trace zero, from above.

    Scaled by its largest element first: no power of it under- or overflows.
    """
    size = ca.norm_inf(ca.vec(S))
    unit = S / ca.if_else(size > 0.0, size, 1.0)
    square = ca.sumsqr(unit) / 6.0
    radius = ca.sqrt(square)
    cubed = ca.if_else(size > 0.0, square * radius, 1.0)
    argument = ca.fmin(ca.fmax(0.5 * ca.det(unit) / cubed, -1.0) + COSINE_SLACK, 1.0)
    return 2.0 * size * radius * _cosine_of_third(argument)


def _cosine_of_third(x: ca.SX) -> ca.SX:
    """Returns cos(arccos(x)/3) from above, x from -1 to 1. [EB] eq. (10)."""
    c = ca.fmin(0.5 + 0.5 * ca.sqrt((1.0 + x) / 1.5), 1.0)
    for _ in range(COSINE_STEPS):
        c = 0.5 + 0.5 * ca.sqrt((1.0 + x) / (1.0 + c))
    return c


@dataclass(frozen=True)
class TurnedBody:
    """What turns a body: tensor J, (3, 3) [kg m2], torque M, (3,) [N m], spin h, (3,) [N m s]; body axes."""

    inertia: ca.SX
    torque: ca.SX
    spin: ca.SX


@dataclass(frozen=True)
class MotionBounds:
    """Where the rate w of a law may be during a step h: w_0 + t w_0' within `curve`, and within `reach`.

    start, slope : w_0, (3,) [rad/s], and w_0', (3,) [rad/s2]
    step         : h [s]
    reach        : |w_i| <= reach_i, (3,) [rad/s]
    fastest      : |w_i'| <= fastest_i, (3,) [rad/s2]
    bend         : |w_i''| <= bend_i, (3,) [rad/s3]; zero for laws without a gyroscopic term
    """

    start: ca.SX
    slope: ca.SX
    step: ca.SX
    reach: ca.SX
    fastest: ca.SX
    bend: ca.SX

    @property
    def end(self) -> ca.SX:
        """w_0 + h w_0', (3,) [rad/s]."""
        return self.start + self.step * self.slope

    @property
    def curve(self) -> ca.SX:
        """What w is off that line by at most, element by element, (3,) [rad/s]."""
        return 0.5 * self.step * self.step * self.bend


def motion_bounds(
    law: RotationLaw, numbers: ca.SX, body: TurnedBody, rate: ca.SX, step: ca.SX
) -> MotionBounds:
    """Returns where a law's rate may be over a step, proven. [EB] eqs. (12) to (15).

    numbers : the law's own, of the body's tensor
    rate    : at the start of the step, (3,) [rad/s]
    step    : [s], any length
    """
    still = ca.SX.zeros(3)
    turned = body.torque - ca.cross(rate, body.spin) if law.gyroscopic_term else body.torque
    slope = law.acceleration(numbers, rate, turned)
    if not law.gyroscopic_term:
        reach = ca.fmax(ca.fabs(rate), ca.fabs(rate + step * slope))
        return MotionBounds(rate, slope, step, reach, ca.fabs(slope), still)
    push = ca.fabs(law.acceleration(numbers, still, body.torque))
    pull = ca.fabs(law.gyroscopic(numbers))
    spin = ca.fabs(by_spin(law, numbers, body.spin))
    norm = norm_of(law.turning(body.inertia))
    most = ca.norm_2(norm.lower.T @ rate) + step * norm.of_torque(body.torque)
    reach = most * ca.vertcat(*(ca.norm_2(norm.inverse[:, i]) for i in range(3)))
    for _ in range(2):  # the first fastest is by energy alone
        fastest = push + spin @ reach + pull @ _products(law, reach, reach)
        reach = ca.fmin(reach, ca.fabs(rate) + step * fastest)
    fastest = push + spin @ reach + pull @ _products(law, reach, reach)
    bend = spin @ fastest + 2.0 * (pull @ _products(law, reach, fastest))
    return MotionBounds(rate, slope, step, reach, fastest, bend)


def by_spin(law: RotationLaw, numbers: ca.SX, spin: ca.SX) -> ca.SX:
    """Returns B, (3, 3) [1/s], of the acceleration B w that the spin of moving parts adds."""
    if not law.gyroscopic_term:
        return ca.SX.zeros(3, 3)
    still = ca.SX.zeros(3)
    columns = (law.acceleration(numbers, still, ca.cross(spin, axis)) for axis in ca.horzsplit(ca.SX.eye(3)))
    return ca.densify(ca.horzcat(*columns))


def _products(law: RotationLaw, a: ca.SX, b: ca.SX) -> ca.SX:
    """Returns (a_i b_j + a_j b_i)/2 for the law's products of rates, (n,)."""
    return ca.vertcat(*(0.5 * (a[i] * b[j] + a[j] * b[i]) for i, j in law.products))


def largest_growth(norm: EnergyNorm, motion: MotionBounds) -> ca.SX:
    """Returns a bound of lambda(w) [rad/s] over a step. [EB] eq. (16)."""
    ends = ca.fmax(growth(norm, motion.start), growth(norm, motion.end))
    return ca.fmin(ends + growth_in_box(norm, motion.curve), growth_in_box(norm, motion.reach))


def largest_residual(norm: EnergyNorm, truth: TurnedBody, motion: MotionBounds) -> ca.SX:
    """Returns a bound of |L^-1 delta| [J^(1/2)/s] over a step. [EB] eqs. (3), (17) to (19).

    truth  : the body with the inputs as they are; the motion may be that of inputs frozen at other values
    motion : of the cheap law
    """
    J, M, h = truth.inertia, truth.torque, truth.spin
    start, end = motion.start, motion.end
    first, last = J @ start + h, J @ end + h
    thrust = J @ motion.slope - M
    middle = 0.5 * (ca.cross(start, last) + ca.cross(end, first))
    points = (thrust + ca.cross(start, first), thrust + middle, thrust + ca.cross(end, last))
    on_line = ca.mmax(ca.vertcat(*(norm.of_torque(point) for point in points)))
    heavy, inverse, curve = ca.fabs(J), ca.fabs(norm.inverse), motion.curve
    line = ca.fmax(ca.fabs(start), ca.fabs(end))
    aside = heavy @ (motion.step * motion.bend)
    aside += cross_of_sizes(line, heavy @ curve)
    aside += cross_of_sizes(curve, heavy @ (line + curve) + ca.fabs(h))
    whole = heavy @ motion.fastest + ca.fabs(M)
    whole += cross_of_sizes(motion.reach, heavy @ motion.reach + ca.fabs(h))
    return ca.fmin(on_line + ca.norm_2(inverse @ aside), ca.norm_2(inverse @ whole))


def cross_of_sizes(a: ca.SX, b: ca.SX) -> ca.SX:
    """Returns bounds of the elements of a cross product, (3,), of bounds of its factors' elements."""
    return ca.vertcat(a[1] * b[2] + a[2] * b[1], a[2] * b[0] + a[0] * b[2], a[0] * b[1] + a[1] * b[0])


def carried(bound: ca.SX, rate_share: ca.SX, growth: ca.SX, residual: ca.SX, step: ca.SX) -> ca.SX:
    """Returns the bound, (2,) [rad, J^(1/2)], a step later. [EB] eqs. (7), (8), (20).

    rate_share : k of |e| <= k |e|_J
    growth     : largest lambda over the step [rad/s], at least 0
    residual   : largest |L^-1 delta| over the step [J^(1/2)/s]
    """
    rise = ca.exp(growth * step)
    energy = _times(bound[1], rise) + _times(residual * step, 0.5 * (1.0 + rise))
    angle = bound[0] + rate_share * step * (0.5 * (bound[1] + energy))
    return INFLATION * ca.vertcat(angle, energy)


def _times(value: ca.SX, factor: ca.SX) -> ca.SX:
    """Returns value times factor; 0 where the value is 0, also where the factor is too large for a double."""
    return ca.if_else(value > 0.0, value * factor, 0.0)


def kept_rate(energy: ca.SX, before: ca.SX, after: ca.SX) -> ca.SX:
    """Returns the bound [J^(1/2)] of |e|_J after a change of the tensor under which both rates stay.

    before, after : tensors, (3, 3) [kg m2]
    Source: [EB] eq. (21).
    """
    return INFLATION * energy * _stretch(norm_of(before), norm_of(after).lower)


def kept_momentum(energy: ca.SX, before: ca.SX, after: ca.SX, excess: ca.SX) -> ca.SX:
    """Returns the bound [J^(1/2)] of |e|_J after a change under which the true momentum stays.

    before, after : tensors, (3, 3) [kg m2]
    excess        : d, (3,) [N m s], by which the change alters J w + h of the cheap rate
    Source: [EB] eq. (22).
    """
    after_norm, lower = norm_of(after), norm_of(before).lower
    return INFLATION * (energy * _stretch(after_norm, lower) + after_norm.of_torque(excess))


def _stretch(norm: EnergyNorm, lower: ca.SX) -> ca.SX:
    """Returns the largest singular value of L^-1 times another lower factor."""
    factor = norm.inverse @ lower
    return ca.sqrt(largest_eigenvalue(factor @ factor.T))
