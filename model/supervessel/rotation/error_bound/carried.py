"""A bound of what a law that leaves terms out is off by, carried along its motion, in CasADi symbols.

omega : rate of the body, of tensor J, that torque M and the spin h of moving parts turn by the law "tensor"
w     : rate under the scene's law, with the same inputs
e     : w - omega, components each in its own body axes

Two numbers are carried: a bound of the angle [rad] between both attitudes, and one of |e|_J = sqrt(e . J e),
the energy norm [J^(1/2)], J = L L^T being the tensor at that time. Both hold for the exact motions; nothing
is linearised and no sample stands for a span of time. Steps of a method are in `remainder`. Derivation:
[EB].
"""

from dataclasses import dataclass, field, replace

import casadi as ca

from supervessel.composite.inertia import symmetric
from supervessel.rotation.error_bound.centre_motion import CentreMotion
from supervessel.rotation.error_bound.constants import (
    BoundConstants,
    EnergyNorm,
    largest_eigenvalue,
    largest_of_traceless,
    norm_of,
)
from supervessel.rotation.gravity import Field, products_of
from supervessel.rotation.laws import MIXED_PRODUCTS, SQUARES, RotationLaw

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


@dataclass(frozen=True)
class TurnedBody:
    """What turns a body: tensor J, (3, 3) [kg m2], torque M, (3,) [N m], spin h, (3,) [N m s]; body axes.

    field : the field of gravity whose gradient does so too; None where there is none
    """

    inertia: ca.SX
    torque: ca.SX
    spin: ca.SX
    field: Field | None = None


@dataclass(frozen=True)
class MotionBounds:
    """Where the rate w of a law may be during a step h, by lengths of vectors.

    start        : w_0, (3,) [rad/s]
    step         : h [s]
    speed        : |w_0| [rad/s]
    reach        : |w| <= reach [rad/s]
    fastest      : |w'| <= fastest [rad/s2]
    scale, share : v [rad/s] and z of [EB] eq. (24), in a field of gravity of (47)
    centre       : how the attracting centre moves meanwhile; None where there is none
    pace         : nu [rad/s] of [EB] eq. (47); 0 where there is no centre
    """

    start: ca.SX
    step: ca.SX
    speed: ca.SX
    reach: ca.SX
    fastest: ca.SX
    scale: ca.SX
    share: ca.SX
    centre: CentreMotion | None = None
    pace: ca.SX = field(default_factory=lambda: ca.SX(0.0))

    @property
    def away(self) -> ca.SX:
        """|w - w_0| is at most that [rad/s]. [EB] eq. (15)."""
        return ca.fmin(self.step * self.fastest, self.speed + self.reach)


def motion_bounds(
    constants: BoundConstants,
    body: TurnedBody,
    rate: ca.SX,
    step: ca.SX,
    centre: CentreMotion | None = None,
) -> MotionBounds:
    """Returns where a law's rate may be over a step, proven. [EB] eqs. (12) to (15), (24), (44), (47).

    rate   : at the start of the step, (3,) [rad/s]
    step   : [s], any length
    centre : how the attracting centre moves meanwhile; None where gravity's gradient does not turn the body
    """
    law, numbers, g = constants.law, constants.numbers, constants.coupling
    by_torque = law.acceleration(numbers, ca.SX.zeros(3), body.torque)
    push, speed = ca.norm_2(by_torque), ca.norm_2(rate)
    by_gradient, lift = ca.SX(0.0), ca.SX(0.0)
    if centre is not None and constants.gradient is not None:
        by_gradient = centre.strongest * constants.gradient.push
        lift = centre.strongest * constants.gradient.lift
    push += by_gradient
    if not law.gyroscopic_term:
        v = speed + ca.sqrt(push / g)
        reach = speed + step * push
        found = MotionBounds(rate, step, speed, reach, push, v, g * v * step)
    else:
        spin = ca.norm_fro(by_spin(law, numbers, body.spin))
        v = speed + ca.fmax(ca.sqrt(push / g), 0.5 * spin / g)
        z = g * v * step
        near = speed + v * z / (1.0 - ca.fmin(z, 0.5))
        energy = ca.sqrt(ca.dot(rate, law.turning(body.inertia) @ rate))
        energy += step * (ca.sqrt(ca.fmax(ca.dot(body.torque, by_torque), 0.0)) + lift)
        reach = ca.fmin(ca.if_else(z <= 0.5, near, ca.inf), constants.own_share * energy)
        fastest = push + reach * (spin + g * reach)
        found = MotionBounds(rate, step, speed, reach, fastest, v, z)
    return found if centre is None else _in_orbit(found, g, by_gradient, centre)


def _in_orbit(motion: MotionBounds, g: ca.SX, by_gradient: ca.SX, centre: CentreMotion) -> MotionBounds:
    """Returns the motion with v and z as they count in a field of gravity. [EB] eq. (47).

    by_gradient : bound of the acceleration by the gradient [rad/s2]
    """
    v = ca.fmax(motion.scale, ca.sqrt(2.0 * by_gradient / g))
    pace = ca.fmax(ca.fmax(g, 1.0) * v, 2.0 * centre.pace)
    return replace(motion, scale=v, share=pace * motion.step, centre=centre, pace=pace)


def by_spin(law: RotationLaw, numbers: ca.SX, spin: ca.SX) -> ca.SX:
    """Returns B, (3, 3) [1/s], of the acceleration B w that the spin of moving parts adds."""
    still = ca.SX.zeros(3)
    columns = (law.acceleration(numbers, still, ca.cross(spin, axis)) for axis in ca.horzsplit(ca.SX.eye(3)))
    return ca.densify(ca.horzcat(*columns))


CANCELLED = 2.0**-47
"""Share of the largest growth's square that rounding may leave where its terms cancel: 32 u."""


def largest_growth(constants: BoundConstants, motion: MotionBounds) -> ca.SX:
    """Returns a bound of lambda(w) [rad/s] over a step. [EB] eq. (16).

    Under the exact law, which leaves nothing out, lambda(w_0) is bounded with fewer operations.
    """
    norm, start = constants.norm, motion.start
    if constants.left_out is None:
        cancelled = CANCELLED * (norm.steepest * motion.speed) ** 2
        first = ca.sqrt(ca.fmax(2.0 / 3.0 * ca.dot(start, norm.squares @ start), 0.0) + cancelled)
    else:
        first = growth(norm, start)
    return ca.fmin(first + norm.steepest * motion.away, norm.steepest * motion.reach)


def largest_residual(constants: BoundConstants, body: TurnedBody, motion: MotionBounds) -> ca.SX:
    """Returns a bound of |L^-1 delta| [J^(1/2)/s] over a step, 0 for the exact law.

    [EB] eqs. (17) to (19), (45), (46).
    motion : of the cheap law
    """
    left_out, w, away = constants.left_out, motion.start, motion.away
    if left_out is None:
        return ca.SX(0.0)
    products = ca.vertcat(*(w[i] * w[j] for i, j in (*MIXED_PRODUCTS, *SQUARES)))
    first = left_out.by_torque @ body.torque + left_out.by_rates @ products
    slope = left_out.bend * (2.0 * motion.speed + away)
    if left_out.by_rate is not None:
        first += left_out.by_rate @ w
        slope += ca.norm_fro(left_out.by_rate)
    gradient, centre = constants.gradient, motion.centre
    if gradient is None or gradient.left_out is None or centre is None:
        return ca.norm_2(first) + slope * away
    first += centre.strength * (gradient.left_out @ products_of(centre.direction))
    turned = ca.fmin(motion.step * motion.reach + centre.turn, 1.0)
    by_place = gradient.bend * (centre.change + 2.0 * (centre.strongest * turned))
    return ca.norm_2(first) + slope * away + by_place


STEEPEST = 64.0
"""Exponent of growth over a step beyond which the bound is infinite: e^64 leaves nothing to know."""


def carried(bound: ca.SX, rate_share: ca.SX, growth: ca.SX, residual: ca.SX, step: ca.SX) -> ca.SX:
    """Returns the bound, (2,) [rad, J^(1/2)], a step later. [EB] eqs. (7), (8), (20).

    rate_share : k of |e| <= k |e|_J
    growth     : largest lambda over the step [rad/s], at least 0
    residual   : largest |L^-1 delta| over the step [J^(1/2)/s]
    """
    exponent = growth * step
    rise = ca.exp(ca.fmin(exponent, STEEPEST))
    energy = bound[1] * rise + residual * step * (0.5 * (1.0 + rise))
    angle = bound[0] + rate_share * step * (0.5 * (bound[1] + energy))
    return INFLATION * ca.vertcat(angle, energy) + ca.if_else(exponent > STEEPEST, ca.inf, 0.0)


STIFFEST = 0.5
"""Largest share of itself that an angle grows by over a step whose bound is finite. [EB] eq. (50)."""


@dataclass(frozen=True)
class Drive:
    """What makes the norm of the rate's error grow, at most, over a step in a field of gravity.

    growth   : lambda [rad/s], times the norm
    residual : [J^(1/2)/s]
    coupling : [J^(1/2)/s], times the angle
    """

    growth: ca.SX
    residual: ca.SX
    coupling: ca.SX


def carried_in_orbit(bound: ca.SX, rate_share: ca.SX, drive: Drive, step: ca.SX) -> ca.SX:
    """Returns the bound, (2,) [rad, J^(1/2)], a step later, where an angle grows a rate too. [EB] eq. (50).

    rate_share : k of |e| <= k |e|_J
    """
    angle, energy = bound[0], bound[1]
    exponent = drive.growth * step
    rise = ca.exp(ca.fmin(exponent, STEEPEST))
    span, half = step * (0.5 * (1.0 + rise)), 0.5 * rate_share * step
    pull = 0.5 * span * drive.coupling
    stiff = pull * half
    known = ca.logic_and(stiff <= STIFFEST, exponent <= STEEPEST)
    grown = (rise + stiff) * energy + drive.residual * span + 2.0 * pull * angle
    after = grown / (1.0 - ca.fmin(stiff, STIFFEST))
    turned = angle + half * (energy + after)
    return INFLATION * ca.vertcat(turned, after) + ca.if_else(known, 0.0, ca.inf)


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
