"""Scalar problems whose power series majorise those of a body's motion, in decimal numbers of 60 digits.

Coefficients of all series are positive, so that what a series has beyond an order, over the power after that
order, grows with the argument: found at the largest one, it holds below. Derivation: [EB] sections 6, 8.
"""

from collections.abc import Callable, Mapping, Sequence
from decimal import Decimal, localcontext
from functools import cache

Weights = Mapping[int, float]
Series = list[Decimal]
State = tuple[Series, ...]
Problem = Callable[[State], State]
"""The rates of all unknowns, each of which starts at 1."""

DIGITS = 60

MARGIN = 1.001
"""For rounding of what is found to doubles, and for what `exact_tails` does not sum up."""

TERMS = 48
"""Coefficients of an exact motion's series that are summed up."""


def turning(state: State) -> State:
    """V' = V^2, Q' = 2 Q V: the rate and the quaternion of a body without gravity. [EB] eq. (25)."""
    V, Q = state
    return times(V, V), [2 * x for x in times(Q, V)]


PULL = PACE = Decimal("0.5")
"""Largest shares of [EB] eq. (47): of the gradient in the rate's change, of the orbit's pace."""


def turning_in_orbit(state: State) -> State:
    """The rate V, the quaternion Q, position X and velocity Y about an attracting centre. [EB] eq. (48)."""
    V, Q, X, Y = state
    squares, distance = times(Q, Q), [-x for x in times(X, X)]
    length = [-x for x in squares]
    length[0] += 2
    distance[0] += 2
    turned = times(times(squares, squares), times(X, X))
    gradient = times(turned, times(power(length, -2), power(distance, Decimal("-2.5"))))
    change = [square + PULL * x for square, x in zip(times(V, V), gradient, strict=True)]
    change[0] -= PULL
    fall = times(X, power(distance, Decimal("-1.5")))
    return change, [x / 2 for x in times(Q, V)], [PACE * x for x in Y], [PACE * x for x in fall]


def times(a: Series, b: Series) -> Series:
    """Returns the product of two series of the same number of coefficients, with as many."""
    product = [Decimal(0)] * len(a)
    for i, x in enumerate(a):
        for j, y in enumerate(b[: len(a) - i]):
            product[i + j] += x * y
    return product


def power(s: Series, exponent: Decimal | int) -> Series:
    """Returns a power of a series that starts above 0: p' s = a p s'."""
    p = [s[0] ** exponent]
    for k in range(1, len(s)):
        p.append(sum((exponent * (k - j) - j) * p[j] * s[k - j] for j in range(k)) / (k * s[0]))
    return p


def stepped(problem: Problem, count: int, method: tuple[Sequence[Weights], Weights], step: Series) -> State:
    """Returns the unknowns after a step of a Runge-Kutta method, its weights by their sizes.

    count  : number of unknowns
    method : weights of the stages, and of the step
    step   : series of the step; the results have as many coefficients
    """
    rates: list[State] = []

    def reached(weights: Weights) -> State:
        ends = []
        for part in range(count):
            total = [Decimal(0)] * len(step)
            for j, weight in weights.items():
                total = [a + abs(Decimal(weight)) * b for a, b in zip(total, rates[j][part], strict=True)]
            end = times(step, total)
            ends.append([end[0] + 1, *end[1:]])
        return tuple(ends)

    stages, last = method
    for stage in stages:
        rates.append(problem(reached(stage)))
    return reached(last)


def method_tails(
    problem: Problem, count: int, method: tuple[Sequence[Weights], Weights], order: int, limit: float
) -> list[float]:
    """Returns for each unknown what the method's step has beyond an order, over limit^(order + 1)."""
    with localcontext(prec=DIGITS):
        z = Decimal(limit)
        value = stepped(problem, count, method, [z])
        first = stepped(problem, count, method, [Decimal(0), Decimal(1), *[Decimal(0)] * (order - 1)])
        kept = [sum(c * z**k for k, c in enumerate(part)) for part in first]
        return [float((whole[0] - part) / z ** (order + 1)) for whole, part in zip(value, kept, strict=True)]


def exact_tails(problem: Problem, count: int, order: int, limit: float) -> list[float]:
    """Returns for each unknown what the exact solution has beyond an order, over limit^(order + 1).

    Of TERMS coefficients: with neighbours in a ratio of at most 1/(2 limit) the rest is 2^-TERMS of the sum.
    """
    with localcontext(prec=DIGITS):
        z = Decimal(limit)
        series = exact_series(problem, count)
        return [
            float(sum(x * z ** (i - order - 1) for i, x in enumerate(part) if i > order)) for part in series
        ]


@cache
def exact_series(problem: Problem, count: int) -> State:
    """Returns the first TERMS coefficients of each unknown of a problem's exact solution."""
    with localcontext(prec=DIGITS):
        state: list[Series] = [[Decimal(1)] for _ in range(count)]
        for k in range(1, TERMS):
            for part, rate in zip(state, problem(tuple(state)), strict=True):
                part.append(rate[-1] / k)
        return tuple(state)
