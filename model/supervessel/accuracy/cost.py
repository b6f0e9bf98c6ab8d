"""What candidates cost, counted: operations of the functions that an FMU's C is made of, never timed.

What every candidate does alike, inputs set and outputs got, is left out.
"""

from dataclasses import dataclass
from functools import cache
from math import ceil, log2

import casadi as ca
import numpy as np

from supervessel.accuracy.histories import Histories, History
from supervessel.equations import Equations
from supervessel.interrupts import interrupt_afterwards
from supervessel.propagators.exact import free_functions
from supervessel.propagators.free_motion import FIRST_ANGLE
from supervessel.propagators.taylor import taylor_order
from supervessel.rotation import LAWS
from supervessel.scene import Law

SLOW = dict.fromkeys((ca.OP_DIV, ca.OP_SQRT), 5) | dict.fromkeys((ca.OP_ATAN2, ca.OP_SIN, ca.OP_COS), 40)
"""What operations count that take longer than a product or a sum."""

MOVES = (ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST)
"""Instructions that count nothing."""

POWER = 100
"""What a power or a logarithm of the C layer counts."""

TURNS = 60
"""Products and sums of two vectors that are turned into the axes of a series and two that are turned back."""


@dataclass(frozen=True)
class Costs:
    """Operations of one library at one tolerance.

    sub_step : of a sub-step that is no free motion
    begun    : of what comes before the sub-steps of a communication step
    changed  : of a change of inputs that shape the composite
    free     : of free motion, without doublings
    doubling : of a doubling
    """

    sub_step: int
    begun: int
    changed: int
    free: int
    doubling: int


def operations(function: ca.Function) -> int:
    """Returns how many products and sums a function takes; what takes longer counts as several."""
    codes = [function.instruction_id(k) for k in range(function.n_instructions())]
    return sum(SLOW.get(code, 1) for code in codes if code not in MOVES)


@cache
def free_operations() -> tuple[int, int]:
    """Returns the operations of free motion without doublings, and of a doubling; the same in every scene."""
    phase, start, double, finish = map(operations, free_functions(12, slice(0, 12)))
    return phase + start + finish, double


def series_operations(order: int, *, gyroscopic: bool, turned: bool) -> int:
    """Returns what fmu_build/c/taylor.c takes for a sub-step (counted in tests/accuracy/test_cost.py).

    gyroscopic : whether the law has products of rates
    turned     : whether the series have axes of their own
    """
    width, alone, rest = (10, 90, 175) if gyroscopic else (7, 72, 163)
    products = width * (order - 1) * (order - 2)
    return products + alone * (order - 1) + 15 * order + rest + (TURNS if turned else 0)


@interrupt_afterwards()
def costs(model: Equations, law: Law, tolerance: float) -> Costs:
    """Returns the operations of a scene's library, flown at a tolerance."""
    count = {f.name(): operations(f) for f in (*model.propagation, *model.changing)}
    changing = (f.name() for f in model.changing if not f.name().endswith(("_forward", "_reverse")))
    changed = operations(model.composite) + operations(model.axes) + sum(count[name] for name in changing)
    free, doubling = free_operations()
    control = model.plan.method.control if model.plan.method else ""
    sub_step = count.get("step", 0) + count.get("fastest_square", 0)
    begun = operations(model.ode) + POWER if control in ("error", "series") else 0
    if control == "error":
        sub_step += POWER
    if control == "series":
        begun += count["by_torque"] + POWER
        turned, gyroscopic = model.product_count > 3, LAWS[law].gyroscopic_term
        sub_step = POWER + series_operations(taylor_order(tolerance), gyroscopic=gyroscopic, turned=turned)
    if model.plan.free == "between kicks":
        sub_step, begun = sub_step + count["step"] + free, 0
    return Costs(sub_step, begun, changed, free, doubling)


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
    free_steps, span = 0, course.duration
    if free == "always":
        free_steps = course.steps
    elif free == "while free":
        still = np.all(inputs.numbers[:, every.acting] == 0.0, axis=1)
        lengths = np.diff(np.append(inputs.rows, course.steps))
        jumped = np.isin(inputs.rows, jumps)
        free_steps = int(np.sum((lengths - jumped)[still]))
    elif free == "between kicks":
        span = course.size
    doublings = max(0, ceil(log2(max(fastest * span / FIRST_ANGLE, 1.0))))
    by_steps = found.sub_step + (found.doubling * doublings if free == "between kicks" else 0)
    total = (
        by_steps * (sub_steps - free_steps)
        + found.begun * (course.steps - free_steps)
        + (found.free + found.doubling * doublings) * free_steps
        + found.changed * len(jumps)
    )
    return total / course.steps
