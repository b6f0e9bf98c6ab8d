"""What choices of a trade cost: operations counted, and their order where times do not tell them apart."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from fmu_build.accuracy.cost import Costs, costs, per_step
from fmu_build.accuracy.histories import Histories, History
from fmu_build.flight.choices import ANGLES, FINEST, Choice, Model, variant_of
from fmu_build.flight.experiment import Course
from fmu_build.flight.flying import Flown, InputCourses
from supervessel.equations import Equations, equations
from supervessel.scene.inputs import by_name
from supervessel.scene.schema import Scene

SAME_TIME = 1.1
"""Times whose ratio is less are not told apart: those of one library differ so on a busy machine."""

Rank = tuple[int, float]
"""Place among times that are told apart, then operations."""


def counted(scene: Scene, course: Course) -> Callable[[Choice, Flown], float]:
    """Returns the function that counts operations, of a communication step on an average over the flight."""

    @cache
    def model_of(model: Model, propagator: str) -> Equations:
        angle = ANGLES[0] if propagator == "rk4" else None  # no angle changes what a sub-step takes
        return equations(variant_of(scene, Choice(model, propagator, angle)))

    @cache
    def costs_of(choice: Choice) -> Costs:
        return costs(model_of(choice.model, choice.propagator), choice.model.law, choice.tolerance or FINEST)

    def operations(choice: Choice, flown: Flown) -> float:
        every = _course_of_inputs(scene, choice.model, course)
        fastest = float(np.linalg.norm(flown.samples[:, 4:], axis=1).max())
        free = model_of(choice.model, choice.propagator).plan.free
        found = costs_of(replace(choice, angle=None))
        return per_step(found, free, every.flown[0], every, flown.sub_steps, fastest)

    return operations


def _course_of_inputs(scene: Scene, model: Model, course: Course) -> Histories:
    """Returns what a model's inputs do over the experiment, as the one history of all."""
    known = by_name(dict(scene.inputs))
    numbers = [
        name
        for name in course.numbers
        if known[name].part != "field" and not _is_frozen(known[name].change, model)
    ]
    docks = tuple(course.booleans)
    inputs = InputCourses(
        np.arange(course.steps),
        np.column_stack([np.zeros((course.steps, 0)), *(course.numbers[name] for name in numbers)]),
        np.column_stack([np.zeros((course.steps, 0)), *course.booleans.values()]),
    )
    acting = np.array([known[name].part == "action" for name in numbers], dtype=np.bool_)
    return Histories(course, tuple(numbers), docks, acting, (History("experiment", inputs),), 0, 0)


def _is_frozen(change: str, model: Model) -> bool:
    return bool(model.frozen) and change == model.frozen


def ranks(choices: Sequence[Mapping[str, Any]]) -> list[Rank]:
    """Returns the ranks of a trade's choices, the cheapest least.

    Choices whose times are within SAME_TIME of the least among them share a place: there operations decide.
    """
    times = [float(row["rk4_steps_per_step"]) for row in choices]
    found: list[Rank] = [(0, 0.0)] * len(times)
    place, least = 0, min(times, default=0.0)
    for i in sorted(range(len(times)), key=times.__getitem__):
        if times[i] >= SAME_TIME * least:
            place, least = place + 1, times[i]
        found[i] = place, float(choices[i]["operations"])
    return found
