"""What each propagator is asked to do with the reference cases, and what it must answer."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from stability import truth
from stability.flights import Craft, End, craft, errors
from stability.truth import Case
from support import U

ANGLE_STEP = 0.05  # rad, what a scene has by default

DIAGONAL_UNITS, FULL_UNITS = 8.0, 16.0
"""Bounds of `exact` in u (1 + cond)."""

LONG = 1e4
"""Angle [rad] beyond which stepping is left to `make stability`."""

DISTURBANCE = 1e-5
"""Of the spins about the middle axis of which the reference cases go through a tumble and come back to one.

There cond, of the start, says little: a rounding underway, when no rate is small, is 1e5 roundings of the
rates that are small again later.
"""


@dataclass(frozen=True)
class Run:
    """A propagator and the tolerance that the importer asks for, if any."""

    propagator: str
    tolerance: float | None = None

    @property
    def steps(self) -> bool:
        """Whether it also divides free motion."""
        return self.propagator in ("rk4", "dop853", "taylor")

    def __str__(self) -> str:
        return self.propagator + (f" {self.tolerance:g}" if self.tolerance else "")


RUNS = (
    Run("rk4"),
    Run("dop853", 1e-9),
    Run("taylor", 1e-9),
    Run("taylor", 1e-15),
    Run("exact"),
    Run("split", 1e-9),
    Run("auto", 1e-9),
)


def applies(run: Run, case: Case) -> bool:
    """Returns whether the propagator knows the torque."""
    return run.propagator != "exact" or not np.any(case.torque)


def is_long(run: Run, case: Case) -> bool:
    """Returns whether a flight takes long: many turns by steps, or by kicks of a strong torque."""
    if run.propagator == "split":
        return bool(np.abs(case.torque).max() > 1e-6)
    return run.steps and turned(case) > LONG


def turned(case: Case) -> float:
    """Returns about how far the body turns [rad]: the greater rate at the ends, half of a spin-up added."""
    with np.errstate(under="ignore"):
        largest = case.inertia.max()
        push = np.linalg.solve(case.inertia / largest, case.torque / largest)
        rates = (case.omega, np.array([float(x) for x in case.omega_end]))
        speed = max(float(np.abs(w).max()) for w in rates) + float(np.abs(push).max()) * abs(case.time) / 2.0
    return math.sqrt(3.0) * speed * abs(case.time)


def problem(run: Run, case: Case, end: End) -> str | None:
    """Returns what is wrong with an answer, or None."""
    if end.refused is not None:
        return refusal_problem(run, case, end)
    numbers = (*end.attitude, *end.omega, *end.state, end.estimate)
    if not all(math.isfinite(x) for x in numbers):
        return f"not finite: {end}"
    for name, q in (("attitude", end.attitude), ("state", end.state[:4])):
        if not abs(_square(q) - 1.0) <= 2.0 * 4.0 * U * (1.0 + U):
            return f"{name} has length 1 + {0.5 * (_square(q) - 1.0) / U:.3g} u"
    for name, error, bound in zip(
        ("attitude", "rate"), errors(case, end), bounds(run, case, end), strict=True
    ):
        if not error <= bound:
            return f"{name} is off by {error:.3g}, allowed {bound:.3g}, estimated {end.estimate:.3g}"
    return None


def _square(q: np.ndarray) -> float:
    return float(sum(truth.mp.mpf(float(x)) ** 2 for x in q))


def bounds(run: Run, case: Case, end: End) -> tuple[float, float]:
    """Returns bounds of the errors of attitude [rad] and rate (relative), as `bound` says."""
    return bound(run, case, end, case.cond_attitude), bound(run, case, end, case.cond_rate)


def bound(run: Run, case: Case, end: End, cond: float) -> float:
    """Returns the bound of an error for a condition number.

    Exact motion, which `auto` and `split` use too where there is no torque, is rounding only; so are Taylor
    series at the least tolerance under torque. Any other tolerance may be missed tenfold. Where steps go on
    for many turns, rounding adds up to more, which the FMU's own estimate must tell within a factor of 4.

    RK4's step of the angle a is off by a^5/1920 at a steady spin; 16 times that covers every motion here.
    """
    free = not np.any(case.torque)
    if free and not run.steps:
        return (FULL_UNITS if case.full else DIAGONAL_UNITS) * U * (1.0 + cond)
    rounding = FULL_UNITS * U * (1.0 + cond)
    if run.propagator == "rk4":
        angle = turned(case)
        theory = angle * min(ANGLE_STEP, angle) ** 4 / 120.0 * (1.0 + cond)
        return min(theory, 4.0 * end.estimate) + rounding
    assert run.tolerance is not None
    tight = run.tolerance == 1e-15
    if free and case.category.startswith("spin disturbed"):
        rounding /= DISTURBANCE
    return (
        (0.0 if tight else 10.0 * run.tolerance)
        + (0.0 if tight and not free else 4.0 * end.estimate)
        + rounding
    )


def motion_problem(case: Case, end: End) -> str | None:
    """Returns what is wrong with exact motion of a diagonal body, by what the motion alone allows."""
    parts = case.motion_attitude, case.motion_rate
    for name, error, part in zip(("attitude", "rate"), errors(case, end), parts, strict=True):
        if not error <= DIAGONAL_UNITS * U * (1.0 + part):
            return f"{name} is off by {error:.3g}, {error / (U * (1.0 + part)):.3g} u (1 + motion)"
    return None


def refusal_problem(run: Run, case: Case, end: End) -> str | None:
    """Returns what is wrong with a refusal: it keeps the state, names step, rates and what it needs."""
    assert end.refused is not None
    if run.propagator in ("exact", "auto"):
        return f"refused: {end.refused}"
    if not end.kept:
        return f"the state is not kept: {end.refused}"
    named = (f"= {abs(case.time):.10g} s needs ", "angular_velocity = (")
    if "inf" in end.refused or "nan" in end.refused or not all(part in end.refused for part in named):
        return f"does not give its numbers: {end.refused}"
    return None


def flights(run: Run, category: str, *, long: bool, parts: int = 1) -> Iterator[tuple[Case, End, Craft]]:
    """Yields the cases of a category with their ends, those that take long or the others.

    parts : communication steps of a case
    """
    for case in truth.cases(category):
        if applies(run, case) and is_long(run, case) == long:
            flown = craft(run.propagator, case.full)
            yield case, flown.fly(case, run.tolerance, parts), flown
