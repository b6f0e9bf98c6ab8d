"""CasADi functions over boxes of their argument: interval arithmetic rounded outwards, many boxes at once.

An interval is a pair of arrays, lower and upper ends, one element a box. Every operation of IEEE 754 that is
used is rounded correctly, so that the next double outwards is a bound; comparisons that are not decided give
[0, 1].
"""

from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Interval = tuple[Array, Array]


def outward(low: Array, high: Array) -> Interval:
    """Returns an interval that holds what the exact results rounded to these ends."""
    return np.nextafter(low, -np.inf), np.nextafter(high, np.inf)


def added(a: Interval, b: Interval) -> Interval:
    """Returns a + b."""
    return outward(a[0] + b[0], a[1] + b[1])


def negated(a: Interval) -> Interval:
    """Returns -a."""
    return -a[1], -a[0]


def times(a: Interval, b: Interval) -> Interval:
    """Returns a b. An end that is no number, 0 times infinity, makes the interval infinite."""
    ends = np.stack([a[0] * b[0], a[0] * b[1], a[1] * b[0], a[1] * b[1]])
    unknown = np.isnan(ends).any(axis=0)
    low, high = outward(ends.min(axis=0), ends.max(axis=0))
    return np.where(unknown, -np.inf, low), np.where(unknown, np.inf, high)


def squared(a: Interval) -> Interval:
    """Returns a^2, at least 0."""
    low, high = outward(np.minimum(a[0] ** 2, a[1] ** 2), np.maximum(a[0] ** 2, a[1] ** 2))
    return np.where((a[0] <= 0.0) & (a[1] >= 0.0), 0.0, np.maximum(low, 0.0)), high


def inverse(a: Interval) -> Interval:
    """Returns 1/a, infinite where a holds 0."""
    holds = ~((a[0] > 0.0) | (a[1] < 0.0))
    low, high = outward(1.0 / np.where(holds, 1.0, a[1]), 1.0 / np.where(holds, 1.0, a[0]))
    return np.where(holds, -np.inf, low), np.where(holds, np.inf, high)


def quotient(a: Interval, b: Interval) -> Interval:
    """Returns a/b, infinite where b holds 0."""
    holds = ~((b[0] > 0.0) | (b[1] < 0.0))
    low, high = (np.where(holds, 1.0, end) for end in b)
    ends = np.stack([a[0] / low, a[0] / high, a[1] / low, a[1] / high])
    least, most = outward(ends.min(axis=0), ends.max(axis=0))
    return np.where(holds, -np.inf, least), np.where(holds, np.inf, most)


def _root(a: Interval) -> Interval:
    low, high = outward(np.sqrt(np.maximum(a[0], 0.0)), np.sqrt(np.maximum(a[1], 0.0)))
    return np.where(a[0] < 0.0, np.where(a[1] < 0.0, np.nan, 0.0), np.maximum(low, 0.0)), high


def _size(a: Interval) -> Interval:
    low = np.where((a[0] <= 0.0) & (a[1] >= 0.0), 0.0, np.minimum(np.abs(a[0]), np.abs(a[1])))
    return low, np.maximum(np.abs(a[0]), np.abs(a[1]))


def _truth(sure: Array, possible: Array) -> Interval:
    return sure.astype(float), possible.astype(float)


def _if_else_zero(a: Interval, b: Interval) -> Interval:
    """Returns b where a is true, 0 where it is not, both where that is open."""
    never = (a[0] == 0.0) & (a[1] == 0.0)
    always = (a[0] > 0.0) | (a[1] < 0.0)
    low = np.where(never, 0.0, np.where(always, b[0], np.minimum(b[0], 0.0)))
    return low, np.where(never, 0.0, np.where(always, b[1], np.maximum(b[1], 0.0)))


OPERATIONS: dict[int, Callable[..., Interval]] = {
    ca.OP_ADD: added,
    ca.OP_SUB: lambda a, b: added(a, negated(b)),
    ca.OP_MUL: times,
    ca.OP_DIV: quotient,
    ca.OP_INV: inverse,
    ca.OP_NEG: negated,
    ca.OP_SQ: squared,
    ca.OP_TWICE: lambda a: (2.0 * a[0], 2.0 * a[1]),
    ca.OP_SQRT: _root,
    ca.OP_FABS: _size,
    ca.OP_FMIN: lambda a, b: (np.minimum(a[0], b[0]), np.minimum(a[1], b[1])),
    ca.OP_FMAX: lambda a, b: (np.maximum(a[0], b[0]), np.maximum(a[1], b[1])),
    ca.OP_LT: lambda a, b: _truth(a[1] < b[0], a[0] < b[1]),
    ca.OP_LE: lambda a, b: _truth(a[1] <= b[0], a[0] <= b[1]),
    ca.OP_EQ: lambda a, b: _truth(
        (a[0] == a[1]) & (b[0] == b[1]) & (a[0] == b[0]), (a[0] <= b[1]) & (b[0] <= a[1])
    ),
    ca.OP_NE: lambda a, b: _truth(
        (a[1] < b[0]) | (b[1] < a[0]), ~((a[0] == a[1]) & (b[0] == b[1]) & (a[0] == b[0]))
    ),
    ca.OP_NOT: lambda a: _truth((a[0] == 0.0) & (a[1] == 0.0), (a[0] <= 0.0) & (a[1] >= 0.0)),
    ca.OP_AND: lambda a, b: _truth((a[0] > 0.0) & (b[0] > 0.0), (a[1] > 0.0) & (b[1] > 0.0)),
    ca.OP_OR: lambda a, b: _truth((a[0] > 0.0) | (b[0] > 0.0), (a[1] > 0.0) | (b[1] > 0.0)),
    ca.OP_IF_ELSE_ZERO: _if_else_zero,
    ca.OP_ASSIGN: lambda a: a,
}
"""Each operation of CasADi that functions of the composite have."""


def over_boxes(function: ca.Function, low: Array, high: Array) -> list[Interval]:
    """Returns the results of a function over boxes of its one argument: each a pair of (boxes, elements).

    function  : of SX symbols, with one argument and dense results
    low, high : ends of the boxes, (boxes, n)
    Raises ValueError for an operation that has no interval.
    """
    boxes = len(low)
    found: list[tuple[Array, Array]] = [
        (np.zeros((boxes, function.numel_out(i))), np.zeros((boxes, function.numel_out(i))))
        for i in range(function.n_out())
    ]
    registers: dict[int, Interval] = {}
    with np.errstate(all="ignore"):
        for k in range(function.n_instructions()):
            code = function.instruction_id(k)
            out, into = function.instruction_output(k), function.instruction_input(k)
            if code == ca.OP_INPUT:
                registers[out[0]] = low[:, into[1]], high[:, into[1]]
            elif code == ca.OP_OUTPUT:
                for end, value in zip(found[out[0]], registers[into[0]], strict=True):
                    end[:, out[1]] = value
            elif code == ca.OP_CONST:
                value = np.full(boxes, function.instruction_constant(k))
                registers[out[0]] = value, value
            elif code == ca.OP_MUL and into[0] == into[1]:
                registers[out[0]] = squared(registers[into[0]])
            elif code in OPERATIONS:
                registers[out[0]] = OPERATIONS[code](*(registers[i] for i in into))
            else:
                raise ValueError(f"operation {code} of {function.name()} has no interval")
    return list(found)


def boxes_of(low: Sequence[float], high: Sequence[float], most: int) -> tuple[Array, Array]:
    """Returns a box cut into equal ones, at most so many: lower and upper ends, (boxes, n).

    Every side that has a length is cut into the same number of pieces.
    """
    ends = np.array([low, high], dtype=float)
    sides = np.flatnonzero(ends[1] > ends[0])
    pieces = int(most ** (1.0 / max(len(sides), 1)) + 1e-9) if len(sides) else 1
    cuts = [
        np.linspace(ends[0, i], ends[1, i], pieces + 1) if i in sides else ends[[0, 1], i]
        for i in range(ends.shape[1])
    ]
    lows = np.meshgrid(*(cut[:-1] for cut in cuts), indexing="ij") if cuts else []
    highs = np.meshgrid(*(cut[1:] for cut in cuts), indexing="ij") if cuts else []
    if not cuts:
        return np.zeros((1, 0)), np.zeros((1, 0))
    return np.stack([a.ravel() for a in lows], axis=1), np.stack([a.ravel() for a in highs], axis=1)
