"""A bound of what a law that leaves terms out is off by, carried along its motion, in CasADi symbols.

omega : rate of the body, of tensor J, that torque M and the spin h of moving parts turn by the law "tensor"
w     : rate under the scene's law, with the same inputs
e     : w - omega, components each in its own body axes

Two numbers are carried: a bound of the angle [rad] between both attitudes, and one of |e|_J = sqrt(e . J e),
the energy norm [J^(1/2)], J = L L^T being the tensor at that time. Both hold for the exact motions; nothing
is linearised and no sample stands for a span of time. Steps of a method are in `remainder`. Derivation:
[EB].
"""

from dataclasses import dataclass

import casadi as ca

from supervessel.composite.inertia import symmetric
from supervessel.rotation.error_bound.constants import (
    BoundConstants,
    EnergyNorm,
    largest_eigenvalue,
    largest_of_traceless,
    norm_of,
)
from supervessel.rotation.laws import RotationLaw

INFLATION = 1.0 + 2.0**-44
"""What sums and products of fewer than 500 positive terms may lose to rounding."""


def growth(norm: EnergyNorm, rate: ca.SX) -> ca.SX:
    """Returns lambda(w) [rad/s]: |e|_J grows at most so fast, over itself, while the cheap rate is w.

    rate : w, (3,) [rad/s], body axes
    Source: [EB] eqs. (4), (9), (10).
    """
    x, y, z = norm.turned
    return largest_of_traceless(
        symmetric(lambda i, j: rate[0] * x[i, j] + rate[1] * y[i, j] + rate[2] * z[i, j])
    )


def growth_in_box(norm: EnergyNorm, box: ca.SX) -> ca.SX:
    """Returns a bound of lambda(w) over all |w_i| <= box_i, (3,) [rad/s]. [EB] eq. (11)."""
    return ca.sqrt(ca.dot(box, norm.in_box @ box))


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


def motion_bounds(constants: BoundConstants, body: TurnedBody, rate: ca.SX, step: ca.SX) -> MotionBounds:
    """Returns where a law's rate may be over a step, proven. [EB] eqs. (12) to (15).

    rate : at the start of the step, (3,) [rad/s]
    step : [s], any length
    """
    law, numbers = constants.law, constants.numbers
    still = ca.SX.zeros(3)
    turned = body.torque - ca.cross(rate, body.spin) if law.gyroscopic_term else body.torque
    slope = law.acceleration(numbers, rate, turned)
    if not law.gyroscopic_term:
        reach = ca.fmax(ca.fabs(rate), ca.fabs(rate + step * slope))
        return MotionBounds(rate, slope, step, reach, ca.fabs(slope), still)
    by_torque = law.acceleration(numbers, still, body.torque)
    push, pull = ca.fabs(by_torque), constants.pull
    spin = ca.fabs(by_spin(law, numbers, body.spin))
    lower = constants.own_lower.T  # |M| in the norm of D^-1 is |D^-1 M| in that of D
    most = ca.norm_2(lower @ rate) + step * ca.norm_2(lower @ by_torque)
    reach = most * constants.own_shares
    fastest = push + spin @ reach + pull @ _products(law, reach, reach)  # by energy alone
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
    near = growth(norm, motion.start) + growth_in_box(norm, motion.step * motion.fastest)
    return ca.fmin(near, growth_in_box(norm, motion.reach))


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
