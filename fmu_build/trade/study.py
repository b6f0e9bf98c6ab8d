"""The trade: every choice flown against a reference, models of the same motion merged, the Pareto front."""

import json
import platform
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmu_build.flight.choices import (
    BEST,
    Choice,
    Model,
    by_angle,
    by_tolerance,
    label,
    models,
    ways_to,
)
from fmu_build.flight.distance import HALF_ULP, attitude_apart
from fmu_build.flight.experiment import SLACK, Course, course_of, experiment_of
from fmu_build.flight.flying import Flown, fly_all
from fmu_build.flight.results import BUILT_WITH
from fmu_build.flight.workshop import Workshop, builds, workshop
from fmu_build.storage.cache import LARGEST_FILE
from fmu_build.trade.ranking import counted, ranks
from supervessel.problems import TradeError
from supervessel.scene.schema import Scene, without_accuracy

Array = NDArray[np.float64]
COSTS = ("ns_per_step", "rk4_steps_per_step", "us_per_second", "operations", "bytes")
"""What of a row costs."""

Progress = Callable[[int, int, str], None]
"""Told how many of how many parts are done, and the latest one."""


ABOUT = {
    "scene": "name of the scene",
    "machine": "system and processor on which times were taken",
    "versions": "of the packages that results depend on",
    "experiment": "flown: duration [s], communication step [s], orbit, inputs as rows of time [s] and value",
    "steps": "communication steps of the experiment",
    "horizons": "times [s] up to which errors in lists are the largest; single errors are over the whole",
    "doubt": "how far two ways to a model's motion are apart; first that of the best model. Smaller errors "
    "of integration against the former, smaller whole errors against the latter cannot be told",
    "models": "laws, and what each leaves out: its exact motion against the best model's, the last one",
    "choices": "models with a propagator and its settings: errors and costs",
    "refused": "choices that could not be flown",
    "law": "[rotation] law",
    "frozen": 'kind of inputs that keep their value at the start: "mass" or "pose"; "gravity", whose '
    'gradient is left out; "", nothing',
    "same": "models with the same motion to the last bit",
    "attitude": "error [rad]: angle between the attitude and that of the law tensor with all inputs moving",
    "rate": "error [rad/s]: length of the difference of the angular velocities, likewise",
    "integration_attitude": "error [rad] against the exact motion of the same model; 0 of the way to it",
    "integration_rate": "error [rad/s] against the exact motion of the same model",
    "way": "by which a model's exact motion is found: where it is free exact, else series or stages at 1e-15",
    "propagator": "[rotation] propagator",
    "setting": 'what its settings are: "max_angle_step" [rad], "tolerance" [1], "" where it has none',
    "settings": "values of that; all of them move the same to the last bit",
    "sub_steps": "sub-steps of the whole experiment",
    "ns_per_step": "time [ns] of a communication step: inputs set, step, attitude and rate got",
    "rk4_steps_per_step": "that over the time of a plain RK4 step, timed in turn",
    "us_per_second": "time [us] that a second of motion takes",
    "operations": "products and sums of a communication step, counted, on an average: they tell which of two "
    "choices is cheaper whose times are less than 10 % apart",
    "bytes": "size of the library",
    "pareto": "whether no other choice is as good in both error of the attitude and cost, and better in one",
    "choice": "model, propagator and setting",
    "reason": "in the FMU's words",
}
"""What the keys of a trade are."""


@dataclass(frozen=True)
class Errors:
    """Largest errors up to each horizon, (3,): of the attitude [rad], of the angular velocity [rad/s]."""

    attitude: Array
    rate: Array


@dataclass(frozen=True)
class _Reference:
    """A model's own motion.

    way     : the most exact one to it
    samples : (n, 7), by that way
    doubt   : how far a second way is apart
    stepped : samples by the way that every model has; none where it was refused
    """

    way: Choice
    samples: Array
    doubt: Errors
    stepped: Array


def study(scene: Scene, *, quick: bool = False, progress: Progress = lambda *_: None) -> dict[str, Any]:
    """Returns the trade of a scene, as trade.json lays it out: "about" says what each key is.

    scene    : with an experiment
    quick    : fewer laws, steps and tolerances
    progress : told what has been done
    Raises TradeError if the scene has no experiment or cannot run it, or if results cannot be kept,
    BuildError if the compiler fails.
    """
    scene = without_accuracy(scene)  # a trade tries every law itself
    course = course_of(scene)
    tried = models(scene, quick=quick)
    with workshop() as shop:
        count = _Count(progress, shop)
        references, refused = _references(scene, tried, course, count)
        same = _same([model for model in tried if model in references], references)
        kept = list(same)
        flown = _ladders(scene, kept, count, quick=quick)
    best, operations = references[BEST], counted(scene, course)
    rows = [
        _row(choice, result, course, references[choice.model].samples, best.samples)
        | {"operations": operations(choice, result)}
        for choice, result in flown.items()
        if result.refused is None
    ]
    rows = _merged(rows)
    angles = [choice.angle for choice in by_angle(BEST, quick=quick)]
    for row in rows:
        if row["propagator"] == "rk4" and row["sub_steps"] == course.steps and angles[0] in row["settings"]:
            row["settings"] = angles  # the finest divides no step: no other was flown
    order = [str(model) for model in kept]
    rows.sort(key=lambda row: (order.index(label(row)), row["propagator"], row["sub_steps"]))
    _mark_front(rows, float(best.doubt.attitude[-1]))
    return {
        "about": ABOUT,
        "scene": scene.name,
        "machine": f"{platform.system()} {platform.machine()}",
        "versions": {name: version(name) for name in ("supervessel", *BUILT_WITH)},
        "experiment": experiment_of(scene).model_dump(mode="json", exclude_none=True),
        "steps": course.steps,
        "horizons": course.horizons,
        "doubt": _lists(best.doubt),
        "models": [
            {
                "law": model.law,
                "frozen": model.frozen,
                "same": [str(other) for other in same[model]],
                "way": str(references[model].way),
                "doubt": _lists(references[model].doubt),
                **_lists(errors(references[model].samples, best.samples, course)),
            }
            for model in kept
        ],
        "choices": [{key: value for key, value in row.items() if not key.startswith("_")} for row in rows],
        "refused": [
            {"choice": str(choice), "reason": result.refused}
            for choice, result in [*refused.items(), *flown.items()]
            if result.refused is not None
        ],
    }


def is_trade(file: Path) -> bool:
    """Whether a file is a trade, as trade.json holds it."""
    try:
        if file.stat().st_size > LARGEST_FILE:
            return False
        found = json.loads(file.read_bytes())
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(found, dict) and {"about", "scene", "models", "choices"} <= found.keys()


class _Count:
    """How far the trade has come."""

    def __init__(self, progress: Progress, shop: Workshop) -> None:
        self.progress, self.shop, self.total, self.done = progress, shop, 0, 0

    def fly(self, scene: Scene, choices: Sequence[Choice]) -> dict[Choice, Flown]:
        """Returns what came of choices, and tells of each part of the work."""
        begun = self.done
        self.total = begun + len(choices) + builds(choices, self.shop)

        def done(what: str) -> None:
            self.done += 1
            self.progress(self.done, self.total, what)

        found = fly_all(scene, choices, self.shop, done)
        self.done = self.total
        return found


def _references(
    scene: Scene, tried: Sequence[Model], course: Course, count: _Count
) -> tuple[dict[Model, _Reference], dict[Choice, Flown]]:
    """Returns each model's own motion, and those without; the best model, flown first, must have one."""
    ways = {model: ways_to(scene, model) for model in tried}
    flown = count.fly(scene, ways[BEST])
    reasons = [result.refused for result in flown.values() if result.refused is not None]
    if len(reasons) > len(flown) - 2:
        raise TradeError(f"experiment: the scene cannot run it: {reasons[0]}")
    flown |= count.fly(scene, [choice for model in tried if model != BEST for choice in ways[model]])
    references: dict[Model, _Reference] = {}
    refused: dict[Choice, Flown] = {}
    for model, choices in ways.items():
        followed = [choice for choice in choices if flown[choice].refused is None]
        if len(followed) < 2:
            choice = next(choice for choice in choices if choice not in followed)
            refused[choice] = flown[choice]
            continue
        one, other = (flown[choice] for choice in followed[:2])
        doubt = _doubt(errors(other.samples, one.samples, course), one)
        references[model] = _Reference(followed[0], one.samples, doubt, flown[choices[-2]].samples)
    return references, refused


def _doubt(apart: Errors, flown: Flown) -> Errors:
    """Returns how well a reference is known: as two ways agree, not better than numbers are rounded."""
    fastest = float(np.linalg.norm(flown.samples[:, 4:], axis=1).max())
    return Errors(np.maximum(apart.attitude, HALF_ULP), np.maximum(apart.rate, HALF_ULP * fastest))


def _same(tried: Sequence[Model], references: dict[Model, _Reference]) -> dict[Model, list[Model]]:
    """Returns the models that move differently, each with those that move the same to the last bit.

    Of those that do the cheapest, which stands first, is kept; the best model always is.
    """
    kept: dict[Model, list[Model]] = {}
    for model in tried:
        samples = references[model].stepped
        alike = (k for k in kept if len(samples) and np.array_equal(references[k].stepped, samples))
        twin = next(alike, None)
        if twin is None or model == BEST:
            kept[model] = []
        else:
            kept[twin].append(model)
    return kept


def _ladders(scene: Scene, kept: Sequence[Model], count: _Count, *, quick: bool) -> dict[Choice, Flown]:
    """Returns what came of the models' choices; coarser steps of rk4 only where the finest took sub-steps."""
    steps = course_of(scene).steps
    finest = [by_angle(model, quick=quick)[0] for model in kept]
    others = [choice for model in kept for choice in by_tolerance(scene, model, quick=quick)]
    flown = count.fly(scene, [*finest, *others])
    coarser = [
        choice
        for first in finest
        if flown[first].refused is not None or flown[first].sub_steps > steps
        for choice in by_angle(first.model, quick=quick)[1:]
    ]
    flown |= count.fly(scene, coarser)
    return flown


def _row(choice: Choice, flown: Flown, course: Course, own: Array, best: Array) -> dict[str, Any]:
    """Returns a choice with its errors over the whole flight and what it costs."""
    total, integration = errors(flown.samples, best, course), errors(flown.samples, own, course)
    return {
        "law": choice.model.law,
        "frozen": choice.model.frozen,
        "propagator": choice.propagator,
        "setting": next(iter(choice.settings), ""),
        "settings": list(choice.settings.values()),
        "attitude": float(total.attitude[-1]),
        "rate": float(total.rate[-1]),
        "integration_attitude": float(integration.attitude[-1]),
        "integration_rate": float(integration.rate[-1]),
        "sub_steps": flown.sub_steps,
        "ns_per_step": flown.nanoseconds,
        "rk4_steps_per_step": flown.ratio,
        "us_per_second": 1e-3 * flown.nanoseconds * course.steps / course.duration,
        "bytes": flown.size,
        "pareto": False,
        "_samples": flown.samples.tobytes(),
    }


def _merged(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Returns rows, one for all settings of a propagator that move the same in as many sub-steps."""
    merged: dict[tuple[Any, ...], dict[str, Any]] = {}
    for row in rows:
        key = tuple(row[k] for k in ("law", "frozen", "propagator", "sub_steps", "_samples"))
        if key in merged:
            first = merged[key]
            settings = [*first["settings"], *row["settings"]]
            cheaper = min(first, row, key=lambda one: (one["operations"], one["rk4_steps_per_step"]))
            merged[key] = first | {
                "settings": settings,
                **{k: cheaper[k] for k in COSTS},
            }
        else:
            merged[key] = row
    return list(merged.values())


def _mark_front(rows: Sequence[dict[str, Any]], doubt: float) -> None:
    """Marks the rows that no other beats in error and cost; errors below the best model's doubt are equal."""
    points = [(max(row["attitude"], doubt), rank) for row, rank in zip(rows, ranks(rows), strict=True)]
    for row, (error, rank) in zip(rows, points, strict=True):
        row["pareto"] = not any(
            other != (error, rank) and other[0] <= error and other[1] <= rank for other in points
        )


def errors(samples: Array, truth: Array, course: Course) -> Errors:
    """Returns the largest errors of samples, (n, 7), up to each horizon."""
    turned = attitude_apart(samples[:, :4], truth[:, :4])
    off = np.linalg.norm(samples[:, 4:] - truth[:, 4:], axis=1)
    ends = [
        np.searchsorted(course.times, horizon + SLACK * course.size, "right") for horizon in course.horizons
    ]
    return Errors(*(np.array([x[: max(end, 1)].max() for end in ends]) for x in (turned, off)))


def _lists(found: Errors) -> dict[str, list[float]]:
    return {"attitude": found.attitude.tolist(), "rate": found.rate.tolist()}
