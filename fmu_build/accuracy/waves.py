"""Square waves of inputs along which small errors of the rate grow most.

A body that is made now heavier and now lighter in time with its own motion, or pushed to and fro so, is
shaken like a swing: what a method is off by grows from one round to the next, though no input held does that.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

HALVES = (1, 2, 3, 4, 5, 6, 8, 10, 13, 16, 20, 25, 32, 40, 50, 80, 125, 200)
"""Communication steps for which a wave stays at one end."""

LONGER = (1, 2)
"""How many times as long it stays at the other end."""

FOLLOWED = 400
"""Communication steps along which a wave is followed, at most."""

SMALL = 1e-10
"""Error of the rate that each communication step adds, relative, as a method does."""

ANGLE, MOST_SUB_STEPS = 0.4, 6000
"""Angle [rad] of a sub-step of rk4, and after how many in all waves are not followed any more."""


@dataclass(frozen=True)
class Ends:
    """The body at both ends of a wave.

    inertia : tensors, (2, 3, 3) [kg m2]
    push    : accelerations by what acts, (2, 3) [rad/s2]
    """

    inertia: Array
    push: Array


@dataclass(frozen=True)
class Wave:
    """A square wave: which ends, steps at the first one and at the other, growth of errors along it [rad]."""

    ends: int
    half: int
    other: int
    growth: float

    def at_first(self, steps: int) -> NDArray[np.bool_]:
        """Returns of each step whether the wave is at its first end, (steps,)."""
        return np.asarray(np.arange(steps) % (self.half + self.other) < self.half)


def waves_that_grow(
    ends: Sequence[Ends], rate: Array, step: float, steps: int, *, momentum: bool
) -> list[Wave]:
    """Returns all waves between given ends, those first along which errors of the rate grow most.

    rate     : at the start, (3,) [rad/s]
    step     : communication step [s]
    steps    : of the flight
    momentum : whether a change of the tensor keeps the momentum, else the rate
    Where errors grow alike, to two digits, the first wave counts.
    """
    shapes = [
        (i, half, half * longer)
        for i in range(len(ends))
        for half in HALVES
        for longer in LONGER
        if half < steps
    ]
    if not shapes:
        return []
    waves = [Wave(*shape, 0.0) for shape in shapes]
    at = np.array([wave.at_first(min(steps, FOLLOWED)) for wave in waves])
    inertia = np.array([ends[wave.ends].inertia for wave in waves])
    push = np.array([ends[wave.ends].push for wave in waves])
    growth = _grown(inertia, push, at, np.append(rate, step), momentum=momentum)
    found = [Wave(*shape, float(f"{g:.2g}")) for shape, g in zip(shapes, growth, strict=True)]
    return sorted(found, key=lambda wave: -wave.growth)


def _grown(inertia: Array, push: Array, at: NDArray[np.bool_], start: Array, *, momentum: bool) -> Array:
    """Returns the integral of the error of the rate [rad/s] over the share that a step adds, (n,) [rad].

    inertia, push : of both ends of each wave, (n, 2, 3, 3) and (n, 2, 3)
    at            : of each step whether it is at the first end, (n, steps)
    start         : rate [rad/s] and step [s], (4,)
    It is 0 where a motion leaves all bounds. Motion and disturbed motion are followed together by rk4.
    """
    n, every = len(at), np.arange(len(at))
    inverse: Array = np.array(np.linalg.inv(inertia), dtype=np.float64)
    rates, step = np.tile(start[:3], (2, n, 1)), float(start[3])
    total, before, left = np.zeros(n), np.where(at[:, 0], 0, 1), MOST_SUB_STEPS
    kicks = _kicks(at.shape[1])
    with np.errstate(all="ignore"):
        for k in range(at.shape[1]):
            now = np.where(at[:, k], 0, 1)
            J, M = inertia[every, now], push[every, now]
            if momentum:
                turning = np.einsum("nij,snj->sni", inertia[every, before], rates)
                rates = np.einsum("nij,snj->sni", inverse[every, now], turning)
            count = _sub_steps(rates, step)
            left -= count
            if left < 0:
                break
            rates = _after(rates, step, count, (J, inverse[every, now], M))
            rates[1] += SMALL * np.linalg.norm(rates[0], axis=1)[:, None] * kicks[k]
            total, before = total + np.linalg.norm(rates[1] - rates[0], axis=1) * step / SMALL, now
    return np.where(np.isfinite(total), total, 0.0)


def _sub_steps(rates: Array, step: float) -> int:
    """Returns how many sub-steps the fastest motion that is still finite asks for in a step [s]."""
    speeds = np.linalg.norm(rates, axis=2)
    fastest = float(speeds[np.isfinite(speeds)].max(initial=0.0))
    return max(1, ceil(min(fastest * step / ANGLE, float(MOST_SUB_STEPS))))


def _kicks(steps: int) -> Array:
    """Returns directions of unit length, (steps, 3), turned on by the golden angle: no motion keeps time."""
    k = np.arange(steps)
    height = 1.0 - 2.0 * ((0.618033988749895 * k) % 1.0)
    angle = 2.399963229728653 * k
    across = np.sqrt(1.0 - height**2)
    return np.column_stack([across * np.cos(angle), across * np.sin(angle), height])


def _after(rates: Array, span: float, count: int, still: tuple[Array, Array, Array]) -> Array:
    """Returns rates, (2, n, 3), after a communication step [s] of so many of rk4's sub-steps."""
    h = span / count
    for _ in range(count):
        one = _acceleration(rates, still)
        two = _acceleration(rates + 0.5 * h * one, still)
        three = _acceleration(rates + 0.5 * h * two, still)
        four = _acceleration(rates + h * three, still)
        rates = rates + h / 6.0 * (one + 2.0 * two + 2.0 * three + four)
    return rates


def _acceleration(rates: Array, still: tuple[Array, Array, Array]) -> Array:
    inertia, inverse, push = still
    turning = np.cross(rates, np.einsum("nij,snj->sni", inertia, rates))
    return np.asarray(push - np.einsum("nij,snj->sni", inverse, turning))
