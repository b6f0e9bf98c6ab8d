"""Taylor series of attitude and angular velocity, unrolled to a fixed order."""

from collections.abc import Sequence
from math import ceil, log

import casadi as ca

from supervessel.attitude import unit
from supervessel.propagators.method import Motion, Propagator, Step
from supervessel.rotation import RotationLaw

LEAST_ORDER, MOST_ORDER = 8, 16

Coefficients = Sequence[Sequence[ca.SX]]
"""Of s^0, s^1, and so on, the components of each."""


def taylor_order(tolerance: float) -> int:
    """Returns the order that meets a tolerance [rad] for about the least work: even, from 8 to 16.

    Work grows with the square of the order P, the step shrinks with tolerance^(1/P): the two together are
    least near P = 1 - ln(tolerance)/2. Above 16 nothing is gained before rounding sets in (measured).
    Source: [JZ].
    """
    order = 2 * ceil((1.0 - 0.5 * log(tolerance)) / 2.0)
    return min(max(order, LEAST_ORDER), MOST_ORDER)


def taylor_step(  # noqa: PLR0913, PLR0917
    law: RotationLaw, numbers: ca.SX, torque: ca.SX, state: ca.SX, step: ca.SX, order: int
) -> tuple[ca.SX, ca.SX]:
    """Returns the state (attitude, angular velocity), (7,), one step later, and the estimated error, (2,).

    law, numbers : the rotation law and its own numbers
    torque       : (3,) [N m], constant in body axes
    state        : (7,), attitude of any length near 1; it is at unit length afterwards
    step         : [s]
    order        : P, of the highest power kept, at least 4
    error        : of the attitude [rad] and of the angular velocity [rad/s], in this step; like step^(P + 1)

    Series in s = (time since the start)/step, so that no power of the step occurs. For the rates w and the
    turn since the start p, a quaternion with p_0 = 1,
    (k + 1) w_k+1 = step (acceleration by the coefficients k of the products, and where k = 0 by torque),
    (k + 1) p_k+1 = sum over j of p_j (0, step/2 w_k-j).
    Source: [JZ].
    """
    half = 0.5 * step
    push = step * law.acceleration(numbers, ca.SX.zeros(3), torque)
    pull = step * law.gyroscopic(numbers)
    rates = [ca.vertsplit(state[4:])]
    halves = [[half * rate for rate in rates[0]]]
    turns: list[list[ca.SX]] = []  # from p_1 on
    for k in range(order):
        products = ca.vertcat(*(_product(rates, i, j) for i, j in law.products))
        change = pull @ products if law.products else ca.SX.zeros(3)
        change = change + push if k == 0 else change
        scale = 1.0 / (k + 1)
        turns.append([scale * x for x in _turn(turns, halves)])
        rates.append(ca.vertsplit(scale * ca.densify(change)))
        halves.append([half * rate for rate in rates[-1]])
    error = ca.vertcat(2.0 * _remainder(turns[-4:]), _remainder(rates[-4:]))
    attitude = state[:4] + _times(state[:4], _sum(turns))
    return ca.vertcat(unit(attitude), state[4:] + _sum(rates[1:])), error


def _turn(turns: Coefficients, halves: Coefficients) -> list[ca.SX]:
    """Returns the sum over j of p_j (0, a_k-j), (4,), from p_1 .. p_k and a_0 .. a_k.

    Each of the three rates has a sum of its own, which a loop can run side by side.
    """
    zero = ca.SX(0)
    by_x, by_y, by_z = [zero] * 4, [zero] * 4, [zero] * 4
    *earlier, (p, q, r) = halves
    for (a, b, c, d), (x, y, z) in zip(turns, reversed(earlier), strict=True):
        by_x = [s + t for s, t in zip(by_x, (-b * x, a * x, d * x, -c * x), strict=True)]
        by_y = [s + t for s, t in zip(by_y, (-c * y, -d * y, a * y, b * y), strict=True)]
        by_z = [s + t for s, t in zip(by_z, (-d * z, c * z, -b * z, a * z), strict=True)]
    return [(x + y) + z + w for x, y, z, w in zip(by_x, by_y, by_z, (zero, p, q, r), strict=True)]


def _product(rates: Coefficients, first: int, second: int) -> ca.SX:
    """Returns coefficient k of the product of two rates, from their coefficients 0 .. k.

    Even and odd terms have a sum of their own; a square's terms are added once and doubled.
    """
    k = len(rates) - 1
    terms = [rates[j][first] * rates[k - j][second] for j in range(k + 1)]
    if first != second:
        return sum(terms[::2], ca.SX(0)) + sum(terms[1::2], ca.SX(0))
    middle = (k + 1) // 2
    twice = 2.0 * (sum(terms[:middle:2], ca.SX(0)) + sum(terms[1:middle:2], ca.SX(0)))
    return twice if k % 2 else twice + terms[middle]


def _sum(terms: Coefficients) -> ca.SX:
    """Returns the sum of a series, from its last coefficient on: the smallest are added first."""
    return sum((ca.vertcat(*term) for term in reversed(terms)), ca.SX.zeros(len(terms[0])))


def _times(one: ca.SX, other: ca.SX) -> ca.SX:
    """Returns the Hamilton product of two quaternions, (4,)."""
    w, x, y, z = ca.vertsplit(one)
    a, b, c, d = ca.vertsplit(other)
    return ca.vertcat(
        w * a - (x * b + y * c + z * d),
        w * b + x * a + (y * d - z * c),
        w * c + y * a + (z * b - x * d),
        w * d + z * a + (x * c - y * b),
    )


def _remainder(last: Coefficients) -> ca.SX:
    """Returns the size of the first two terms left out of a series, from its last four coefficients.

    Sizes of pairs of neighbours go on falling as the last two pairs do; pairs, because every other
    coefficient may vanish.
    """
    before = ca.sumsqr(ca.vertcat(*last[0], *last[1]))
    after = ca.sumsqr(ca.vertcat(*last[2], *last[3]))
    return after / ca.sqrt(ca.if_else(before > 0.0, before, 1.0))


def build(motion: Motion) -> Step:
    """Returns one step with its estimate, of the order that suits the scene's tolerance."""
    order = taylor_order(motion.tolerance)
    step = taylor_step(motion.law, motion.numbers, motion.torque, motion.state, motion.step, order)
    return Step(*step, order + 1)


PROPAGATOR = Propagator(
    build,
    "series",
    "never",
    "Taylor series of attitude and angular velocity ([JZ]), of an order from 8 to 16 that suits the "
    "tolerance. A communication step is divided so that the estimated error of the attitude at its end stays "
    "below <code>tolerance</code>.",
    safety=2.5,
)
