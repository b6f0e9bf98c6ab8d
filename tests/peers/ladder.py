"""Ways of other engines tried from loose settings to tight ones, and what the first accurate one costs."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from engines import Array
from from_python import plain_step

Flight = Callable[[], Array]
Settings = Iterator[tuple[str, Callable[[], Flight]]]
Judge = Callable[[Any], float]

ROUNDS = 3


@dataclass(frozen=True)
class Result:
    """A cost in plain RK4 steps, the error of the attitude at the end [rad], and the setting in words."""

    cost: float
    error: float
    text: str


@dataclass(frozen=True)
class Ladder:
    """How far a way is taken.

    enough         : error that does [rad]
    longest_flight : time of the processor [s] after which no tighter setting is tried
    longest        : time of the processor [s] of all settings together after which none is tried
    """

    enough: float
    longest_flight: float
    longest: float

    def climb(self, settings: Settings, folder: Path, judge: Judge) -> Result | None:
        """Returns the first setting that is accurate enough, or else the most accurate one, if any."""
        begun, best = time.process_time(), None
        for text, ready in settings:
            fly = ready()
            start = time.process_time()
            off = judge(fly())
            taken = time.process_time() - start
            if best is None or off < best[0]:
                best = off, text, ready
            late = taken > self.longest_flight or time.process_time() - begun > self.longest
            if off <= self.enough or late:
                break
        if best is None:
            return None
        off, text, ready = best
        return Result(cost(ready, folder), off, text)


def cost(ready: Callable[[], Flight], folder: Path) -> float:
    """Returns the median cost of a flight in plain RK4 steps."""
    plain, ratios = plain_step(folder), []
    for _ in range(ROUNDS):
        fly = ready()
        unit, begun = plain(), time.process_time()
        fly()
        ratios.append(1e9 * (time.process_time() - begun) / unit)
    return median(ratios)
