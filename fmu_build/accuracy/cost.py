"""What candidates cost, counted: operations of the functions that an FMU's C is made of, never timed.

What every candidate does alike, inputs set and outputs got, is left out.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from math import ceil, log2

import casadi as ca
import numpy as np

from fmu_build.accuracy.histories import Histories, History
from supervessel.equations import Equations
from supervessel.rotation.laws import LAWS
from supervessel.rotation.propagators.exact import free_functions, free_functions_of_start
from supervessel.rotation.propagators.free_motion import FIRST_ANGLE
from supervessel.rotation.propagators.taylor import taylor_order
from supervessel.scene.schema import Law
from supervessel.shell.interrupts import interrupt_afterwards

SLOW = dict.fromkeys((ca.OP_DIV, ca.OP_SQRT), 5) | dict.fromkeys((ca.OP_ATAN2, ca.OP_SIN, ca.OP_COS), 40)
"""What operations count that take longer than a product or a sum."""

MOVES = (ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST)
"""Instructions that count nothing."""

POWER = 100
"""What a power or a logarithm of the C layer counts."""

TURNS = 60
"""Products and sums of two vectors that are turned into the axes of a series and two that are turned back."""


@dataclass(frozen=True)
class FreeCosts:
    """Operations of free motion, the same in every scene.

    once     : without doublings
    doubling : of a doubling
    start    : of what is found once where a second step goes on from the start of a first
    again    : of every step from then on, where the nome lets it be taken so (all but near the separatrix)
    """

    once: int
    doubling: int
    start: int
    again: int


@dataclass(frozen=True)
class Costs:
    """Operations of one library at one tolerance.

    sub_step : of a sub-step that is no free motion
    begun    : of what comes before the sub-steps of a communication step
    changed  : of a change of inputs that shape the composite
    free     : of free motion
    """

    sub_step: int
    begun: int
    changed: int
    free: FreeCosts


def operations(function: ca.Function) -> int:
    """Returns how many products and sums a function takes; what takes longer counts as several."""
    codes = [function.instruction_id(k) for k in range(function.n_instructions())]
    return sum(SLOW.get(code, 1) for code in codes if code not in MOVES)


@cache
def free_operations() -> FreeCosts:
    """Returns the operations of free motion."""
    phase, start, double, finish = map(operations, free_functions(12, slice(0, 12)))
    constants, at = map(operations, free_functions_of_start(12, slice(0, 12)))
    return FreeCosts(phase + start + finish, double, constants, at)


def series_operations(order: int, *, gyroscopic: bool, turned: bool) -> int:
    """Returns what fmu_build/c/taylor_series.c takes for a sub-step (counted in tests/accuracy/test_cost.py).

    gyroscopic : whether the law has products of rates
    turned     : whether the series have axes of their own
    """
    width, alone, rest = (10, 90, 175) if gyroscopic else (7, 72, 163)
    products = width * (order - 1) * (order - 2)
    return products + alone * (order - 1) + 15 * order + rest + (TURNS if turned else 0)


def gradient_operations(order: int, *, mixed_alone: bool, turned: bool) -> int:
    """Returns what fmu_build/c/gradient_series.h adds to that (counted in tests/accuracy/test_cost.py).

    mixed_alone : whether the acceleration follows from three products, not from six
    """
    alone = 106 if mixed_alone else 139
    return 28 * order * order + alone * order + 170 + (TURNS if turned else 0)


@interrupt_afterwards()
def costs(model: Equations, law: Law, tolerance: float) -> Costs:
    """Returns the operations of a scene's library, flown at a tolerance."""
    count = {f.name(): operations(f) for f in (*model.steps.propagation, *model.changing)}
    changing = (f.name() for f in model.changing if not f.name().endswith(("_forward", "_reverse")))
    changed = operations(model.composite) + operations(model.axes) + sum(count[name] for name in changing)
    free = free_operations()
    control = model.plan.method.control if model.plan.method else ""
    sub_step = count.get("step", 0) + count.get("fastest_square", 0)
    begun = operations(model.ode) + POWER if control in ("error", "series") else 0
    if control == "error":
        sub_step += POWER
    if control == "series":
        begun += count["by_torque"] + POWER
        turned, gyroscopic = model.product_count > 3, LAWS[law].gyroscopic_term
        order = taylor_order(tolerance)
        sub_step = POWER + series_operations(order, gyroscopic=gyroscopic, turned=turned)
        if model.has_field:
            place = model.slices.axes["gradient"]
            sub_step += gradient_operations(order, mixed_alone=place.stop - place.start == 3, turned=turned)
    if model.plan.free == "between kicks":
        sub_step, begun = sub_step + count["step"] + free.once, 0
    return Costs(sub_step, begun, changed, free)


def per_step(  # noqa: PLR0913, PLR0917
    found: Costs, free: str, history: History, every: Histories, sub_steps: int, fastest: float
) -> float:
    """Returns the operations of a communication step, on an average over a history.

    free      : when the plan uses free motion, see `propagators.Plan`
    sub_steps : of the whole flight
    fastest   : a rate [rad/s] that the body does not exceed
    """
    course, inputs = every.course, history.inputs
    shape = np.column_stack([inputs.numbers[:, ~every.acting], inputs.booleans])
    jumps = inputs.rows[1:][np.any(np.diff(shape, axis=0) != 0.0, axis=1)]
    spans: list[int] = []
    if free in ("always", "while free"):
        still = (free == "always") | np.all(inputs.numbers[:, every.acting] == 0.0, axis=1)
        lengths = np.diff(np.append(inputs.rows, course.steps))
        spans = free_spans(lengths, still, np.isin(inputs.rows, jumps), in_jumps=free == "always")
    size = course.size if free != "never" else 0.0
    doublings = max(0, ceil(log2(max(fastest * size / FIRST_ANGLE, 1.0))))
    first = found.free.once + found.free.doubling * doublings
    by_steps = found.sub_step + (found.free.doubling * doublings if free == "between kicks" else 0)
    total = (
        by_steps * (sub_steps - sum(spans))
        + found.begun * (course.steps - sum(spans))
        + sum(first + (found.free.start + found.free.again * (n - 1) if n > 1 else 0) for n in spans)
        + found.changed * len(jumps)
    )
    return total / course.steps


def free_spans(
    lengths: Iterable[int], still: Iterable[bool], jumped: Iterable[bool], *, in_jumps: bool
) -> list[int]:
    """Returns how many steps in turn are free motion from one start, of each such start.

    lengths  : steps for which inputs stay as they are, of each such piece
    still    : whether nothing acts
    jumped   : whether the composite changes where it begins
    in_jumps : whether its first step is free then, too
    """
    spans = [0]
    for length, free, jump in zip(lengths, still, jumped, strict=True):
        if jump or not free:
            spans.append(0)
        if free:
            spans[-1] += int(length) - int(jump and not in_jumps)
    return [span for span in spans if span > 0]
