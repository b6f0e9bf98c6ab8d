"""Taylor series of attitude and angular velocity, unrolled to a fixed order."""

from collections.abc import Mapping, Sequence
from math import floor, log
from operator import mul
from typing import TYPE_CHECKING, Any

import casadi as ca

from supervessel.rotation.attitude import unit
from supervessel.rotation.propagators.gradient_series import GradientSeries
from supervessel.rotation.propagators.method import STILL_PARTS, Propagator, Step, StepSymbols

if TYPE_CHECKING:
    from supervessel.rotation.dynamics import SpunWheels

LEAST_ORDER, MOST_ORDER = 6, 20
HALF_ORDER_AT_1, HALF_ORDER_SLOPE = 2.75, 0.29
"""Half the order at a tolerance of 1 rad, before it is rounded down, and what it gains per factor e less."""

Coefficients = Sequence[Sequence[ca.SX]]
"""Of s^0, s^1, and so on, the components of each."""


def taylor_order(tolerance: float) -> int:
    """Returns the order that meets a tolerance [rad] for about the least work: even, from 6 to 20.

    Work that grows with the square of the order P, and steps that shrink with tolerance^(1/P), together are
    least near P = 1 - ln(tolerance)/2 ([JZ]). What each coefficient costs besides puts it higher: measured
    (`make bench`), to the nearest even number, P = 4.5 - 0.58 ln(tolerance).
    """
    order = 2 * floor(HALF_ORDER_AT_1 - HALF_ORDER_SLOPE * log(tolerance))
    return min(max(order, LEAST_ORDER), MOST_ORDER)


def taylor_step(motion: StepSymbols, order: int) -> tuple[ca.SX, ca.SX]:
    """Returns the state one step later, the attitude at unit length, and the estimated error, (2,).

    motion : what the step is made of, its attitude of any length near 1
    order  : P, of the highest power kept, at least 4
    error  : of the attitude [rad] and of the angular velocity [rad/s], in this step; like step^(P + 1)

    Series in s = (time since the start)/step, so that no power of the step occurs. For the rates w and the
    turn since the start p, a quaternion with p_0 = 1,
    (k + 1) w_k+1 = step (acceleration by the coefficients k of the products, and where k = 0 by torque),
    (k + 1) p_k+1 = sum over j of p_j (0, step/2 w_k-j).
    In a field of gravity the series of `gradient_series` add to the acceleration. With wheels the torque
    -w x S does, S = S_0 + s S_1 being their momentum: motors have a constant torque. Jet damping adds a
    constant matrix times w.
    The terms that hold a coefficient 0, or k, stand by themselves: nothing else waits for the latest ones.
    Source: [JZ].
    """
    law, numbers, state, step = motion.law, motion.numbers, motion.state, motion.step
    half = 0.5 * step
    push = step * motion.acceleration_by_torque
    pull = step * law.gyroscopic(numbers)
    rates = [ca.vertsplit(state[4:7])]
    held = None if motion.wheels is None else _Held(motion, motion.wheels)
    gradient = None if motion.field is None else GradientSeries(motion.field, law, numbers, state, step)
    start = [half * rate for rate in rates[0]]
    turns: list[list[ca.SX]] = []  # from p_1 on
    for k in range(order):
        scale = 1.0 / (k + 1)
        products = ca.vertcat(*(_product(rates, i, j) for i, j in law.products))
        change = (scale * pull) @ products if law.products else ca.SX.zeros(3)
        turns.append([scale * x for x in _turn(turns, rates, step)] if k else [ca.SX(0), *start])
        if held is not None and law.products:
            change = change + scale * held.next(rates)
        if motion.slowing is not None:
            change = change - (scale * step) * (motion.slowing @ ca.vertcat(*rates[-1]))
        if gradient is not None:
            change = change + scale * gradient.next(rates)
        rates.append(ca.vertsplit(ca.densify(change + push if k == 0 else change)))
    error = ca.vertcat(2.0 * _remainder(turns[-4:]), _remainder(rates[-4:]))
    attitude = state[:4] + _times(state[:4], _sum(turns))
    end = ca.vertcat(unit(attitude), state[4:7] + _sum(rates[1:]))
    if held is not None:
        end = ca.vertcat(end, held.end)
    if gradient is not None:
        end = ca.vertcat(end, gradient.end(end[:4]))
    return end, error


class _Held:
    """The momentum S of wheels along a step: linear in time."""

    def __init__(self, motion: StepSymbols, wheels: "SpunWheels") -> None:
        stored = motion.state[7 : 7 + wheels.rate.numel()]
        self._motion = motion
        self._first, self._second = wheels.momentum(stored), motion.step * wheels.reaction
        self.end = stored + motion.step * wheels.rate

    def next(self, rates: Coefficients) -> ca.SX:
        """Returns coefficient k of step times the acceleration by -w x S, (3,).

        rates : coefficients 0 .. k of the angular velocity
        """
        turning = ca.cross(ca.vertcat(*rates[-1]), self._first)
        if len(rates) > 1:
            turning = turning + ca.cross(ca.vertcat(*rates[-2]), self._second)
        motion = self._motion
        return motion.step * motion.law.acceleration(motion.numbers, ca.SX.zeros(3), -turning)


def _turn(turns: Coefficients, rates: Coefficients, step: ca.SX) -> list[ca.SX]:
    """Returns the sum over j of p_j (0, step/2 w_k-j), (4,), from p_1 .. p_k and w_0 .. w_k.

    For 0 < j < k a product takes seven multiplications: four of signed sums, whose signed sums are those of a
    product without minus signs, and three to set the signs right. Source: [HL].
    """
    half = 0.5 * step
    *middle, (a, b, c, d) = turns
    (x, y, z), *later = rates
    latest = later.pop()
    sums = [ca.SX(0)] * 7
    for turn, rate in zip(middle, reversed(later), strict=True):
        terms = map(mul, _spread_turn(turn), _spread_rate(rate, step))
        sums = [s + term for s, term in zip(sums, terms, strict=True)]
    f, g, h, i, *signs = sums
    even, odd, p, q = f + h, g + i, f - h, g - i
    x, y, z = half * x, half * y, half * z
    return [
        -(even + odd) - ((b * x + c * y) + d * z),
        (((even - odd) + signs[0]) + half * latest[0]) + ((a * x + c * z) - d * y),
        (((p + q) + signs[1]) + half * latest[1]) + ((a * y + d * x) - b * z),
        (((p - q) + signs[2]) + half * latest[2]) + ((a * z + b * y) - c * x),
    ]


def _spread_turn(turn: Sequence[ca.SX]) -> list[ca.SX]:
    """Returns what the seven multiplications take of a coefficient of the turn."""
    a, b, c, d = turn
    even, odd, p, q = a + c, b + d, a - c, b - d
    return [even + odd, even - odd, p + q, p - q, d, b, c]


def _spread_rate(rate: Sequence[ca.SX], step: ca.SX) -> list[ca.SX]:
    """Returns what they take of one of the rates."""
    eighth = 0.125 * step
    x, y, z = (eighth * w for w in rate)
    plus, minus = x + z, x - z
    return [plus + y, y - plus, minus - y, -y - minus, *(-step * w for w in (rate[1], rate[2], rate[0]))]


def _product(rates: Coefficients, first: int, second: int) -> ca.SX:
    """Returns coefficient k of the product of two rates, from their coefficients 0 .. k."""
    one, other = ([rate[i] for rate in rates] for i in (first, second))
    if len(rates) == 1:
        return one[0] * other[0]
    middle = sum(map(mul, one[1:-1], reversed(other[1:-1])), ca.SX(0))
    return middle + (one[0] * other[-1] + one[-1] * other[0])


def _sum(terms: Coefficients) -> ca.SX:
    """Returns the sum of a series of s^1, s^2, and so on: even and odd powers apart, the smallest first."""
    columns = [ca.vertcat(*term) for term in terms]
    odd, even = (sum(reversed(columns[i::2]), ca.SX.zeros(len(terms[0]))) for i in (0, 1))
    return even + odd


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


def build(motion: StepSymbols) -> Step:
    """Returns one step with its estimate, of the order that suits the scene's tolerance."""
    order = taylor_order(motion.tolerance)
    return Step(*taylor_step(motion, order), order + 1)


def _suits(law: str, inputs: Mapping[str, Any]) -> str:
    """Returns why series make no sense: they know no momentum of parts that move."""
    return STILL_PARTS if inputs.get("motion") else ""


PROPAGATOR = Propagator(
    build,
    "series",
    "never",
    f"Taylor series of attitude and angular velocity ([JZ]), of an order from {LEAST_ORDER} to {MOST_ORDER} "
    "that suits the tolerance. A communication step is divided so that the estimated error of the attitude "
    "at its end stays below <code>tolerance</code>.",
    c_files=("taylor", "taylor_series", "estimated_steps"),
    marker="D",
    suits=_suits,
    safety=2.5,
)
