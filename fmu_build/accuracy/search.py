"""Flights of candidates through a scene's histories of inputs, and the cheapest that is exact enough."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, fields
from math import ceil, floor, log10
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmu_build.accuracy.cost import Costs, costs, free_operations, per_step
from fmu_build.accuracy.flights import apart, body_of, fly, followed, judged
from fmu_build.accuracy.grades import law_is_off
from fmu_build.accuracy.histories import Histories, histories
from fmu_build.flight.choices import (
    BEST,
    FINEST,
    Choice,
    Model,
    always_free,
    kicked,
    laws_of,
    reference_choices,
    variant_of,
    while_free,
)
from fmu_build.flight.distance import HALF_ULP
from fmu_build.flight.results import are_numbers, keep, place_of, read
from fmu_build.flight.workshop import Workshop, build_all, source_of
from supervessel.equations import Equations, equations
from supervessel.problems import AccuracyError
from supervessel.scene.schema import Accuracy, Scene

Array = NDArray[np.float64]
Progress = Callable[[str], None]

MARGIN = 5.0
"""What is asked over the largest error found, at least: others were up to 3.6 times as large, see
docs/accuracy.md."""

TOLERANCES = tuple(float(f"1e-{k}") for k in range(1, 16))

COARSEST, FINEST_ANGLE = 1.0, 1e-6
"""Angles [rad] of rk4 that a scene may have."""

MOST_ANGLES = 6
"""Angles of rk4 that are tried of a law."""


@dataclass(frozen=True)
class FlightErrors:
    """Largest errors in each history, attitude [rad] and rate [rad/s]; the sub-steps of each.

    refused : the history that was not flown to its end, and why; then the others are empty
    """

    attitude: list[float]
    rate: list[float]
    sub_steps: list[int]
    refused: str | None = None


def _are_errors(kept: Any, histories: int) -> bool:
    """Whether what JSON has given is `Errors` of so many histories."""
    columns = [kept[name] for name in ("attitude", "rate", "sub_steps")]
    refused, lengths = kept["refused"], {len(column) for column in columns}
    return (
        kept.keys() == {one.name for one in fields(FlightErrors)}
        and isinstance(refused, str | None)
        and lengths == {histories if refused is None else 0}
        and all(type(column) is list and are_numbers(column) for column in columns)
    )


@dataclass(frozen=True)
class Tried:
    """A candidate and what came of it.

    operations     : of a communication step, on an average over the flight in which it costs most
    attitude, rate : largest errors [rad], [rad/s], what is not known of the truth included
    worst          : history of the largest error of the attitude
    flights        : how many histories were flown; not all where the first ones were enough to tell
    """

    choice: Choice
    operations: float
    attitude: float
    rate: float
    worst: str
    flights: int
    refused: str | None = None

    def excess(self, accuracy: Accuracy) -> float:
        """Returns the error, with its margin, over what is asked: at most 1 where that is met."""
        asked = accuracy.rate
        return MARGIN * max(self.attitude / accuracy.attitude, self.rate / asked if asked else 0.0)


def begun(scene: Scene, accuracy: Accuracy, shop: Workshop, progress: Progress) -> "Search":
    """Returns the search in a scene, its histories flown in two ways that share nothing but the equations.

    Raises AccuracyError where these do not agree well enough, or cannot be flown.
    """
    one, other = reference_choices(scene, BEST)
    progress("two ways to the truth")
    others = [finest(scene, Model(law)) for law in laws_of(scene)]
    build_all(scene, [one, other, *others], shop, lambda _: None)
    body = body_of(scene, shop.built[source_of(one)].model)
    every = histories(scene, accuracy, lambda inputs: judged(scene, shop, one, inputs), body)
    (truth, sub_steps), (second, _) = (followed(scene, shop, every, choice) for choice in (one, other))
    fastest = np.linalg.norm(truth[:, :, 4:], axis=2).max(1)
    attitude, rate = apart(second, truth)
    doubt = np.maximum(attitude, HALF_ULP), np.maximum(rate, HALF_ULP * fastest)
    for key, unit, known in zip(("attitude", "rate"), ("rad", "rad/s"), doubt, strict=True):
        asked, off = getattr(accuracy, key), float(known.max())
        least = MARGIN * off
        if asked is not None and asked < least:
            raise AccuracyError(
                f"accuracy.{key} = {asked} {unit}: two ways to the exact motion are up to {off:.2g} "
                f"{unit} apart within {accuracy.horizon:g} s; with a margin of {MARGIN:g}, the best that can "
                f"be had is {_up(least):g} {unit}"
            )
    return Search(scene, accuracy, shop, progress, every, truth, doubt, sub_steps)


def finest(scene: Scene, model: Model) -> Choice:
    """Returns the choice by which a model shows itself; the first way to the truth for the best one."""
    return reference_choices(scene, model)[0]


def _up(value: float) -> float:
    """Returns a number of two digits that is not smaller."""
    unit = 10.0 ** (floor(log10(value)) - 1)
    return float(f"{ceil(value / unit * (1.0 - 1e-12)) * unit:.2g}")


def _two_digits(angle: float) -> float:
    """Returns the number of two digits that is not larger; 0 for 0."""
    if not angle > 0.0:
        return 0.0
    unit = 10.0 ** (floor(log10(angle)) - 1)
    return float(f"{floor(angle / unit * (1.0 + 1e-12)) * unit:.2g}")


def _coarser(one: Choice, other: Choice) -> bool:
    """Returns whether of two settings of a way the first is the coarser one."""
    return (one.angle or 0.0, one.tolerance or 0.0) > (other.angle or 0.0, other.tolerance or 0.0)


@dataclass
class Search:
    """The candidates of a scene, tried one after the other.

    truth     : samples of each history, (n, samples, 7)
    doubt     : how far two ways to them are apart, (n,) each: attitude [rad], rate [rad/s]
    sub_steps : of the first of these ways, in each history
    left      : by way to propagate a model the coarsest setting that is dearer than the best whatever comes
                of it, and finer ones with it; and its least operations
    """

    scene: Scene
    accuracy: Accuracy
    shop: Workshop
    progress: Progress
    every: Histories
    truth: Array
    doubt: tuple[Array, Array]
    sub_steps: list[int]
    tried: dict[Choice, Tried] = field(default_factory=dict)
    left: dict[Choice, tuple[Choice, float]] = field(default_factory=dict)
    models: dict[Choice, Equations] = field(default_factory=dict)
    costs: dict[tuple[Choice, float | None], Costs] = field(default_factory=dict)

    @property
    def best(self) -> Tried | None:
        """The cheapest that is exact enough; of equal ones the simplest law, tried first."""
        enough = [one for one in self.tried.values() if one.excess(self.accuracy) <= 1.0]
        return min(enough, key=lambda one: one.operations, default=None)

    @property
    def limit(self) -> float:
        """Operations from which on a candidate is of no use."""
        return self.best.operations if self.best else np.inf

    def run(self) -> None:
        """Tries all candidates that may be cheaper than the best so far, cheap laws first."""
        for law in laws_of(self.scene):
            self._law(Model(law))

    def _law(self, model: Model) -> None:
        most_exact = finest(self.scene, model)
        series = most_exact.propagator
        off = law_is_off(self.scene, self.accuracy, most_exact)
        if off:
            self.tried[most_exact] = Tried(most_exact, self.least(most_exact), np.inf, np.inf, "", 0, off)
            return
        if self.try_one(most_exact).excess(self.accuracy) > 1.0:
            return
        first = self._angle(model)
        self._is_tried(first)
        self._by_tolerance(model, series)
        self._divided(first)
        if series != "dop853":
            self._by_tolerance(model, "dop853")
        self._free(model)

    def _free(self, model: Model) -> None:
        """Tries what follows free motion, as far as it suits the scene."""
        acts = self.scene.inputs.gravity or any(low or high for low, high in self._acting_ranges())
        moves = bool(self.scene.inputs.motion)
        names = [] if acts or moves else always_free()
        names += while_free(self.scene, model) + (kicked(self.scene, model) if acts else [])
        for name in names:
            at_least = float(free_operations().again)
            if at_least >= self.limit:
                self._leave(Choice(model, name), at_least)
            elif name in always_free():
                self._is_tried(Choice(model, name))
            else:
                self._by_tolerance(model, name)

    def _acting_ranges(self) -> Iterator[tuple[float, float]]:
        for history in self.every.flown:
            acting = history.inputs.numbers[:, self.every.acting]
            yield from zip(acting.min(0), acting.max(0), strict=True)

    def _is_tried(self, choice: Choice) -> bool:
        """Tries a choice if it may be cheaper than the best; returns whether it has been tried."""
        if choice not in self.tried:
            at_least = self.least(choice)
            if at_least >= self.limit:
                self._leave(choice, at_least)
            else:
                self.try_one(choice)
        return choice in self.tried

    def _leave(self, choice: Choice, at_least: float) -> None:
        """Notes that a way to propagate a model, at this setting or finer, is dearer than the best."""
        way = Choice(choice.model, choice.propagator)
        if way not in self.left or _coarser(choice, self.left[way][0]):
            self.left[way] = choice, at_least

    def _by_tolerance(self, model: Model, name: str) -> None:
        """Finds the largest tolerance that will do, then smaller ones while they are cheaper.

        By halves, but for split: its small tolerances take sub-steps by the million.
        """
        rungs = [Choice(model, name, None, tolerance) for tolerance in TOLERANCES]
        low, high = 0, len(rungs)
        while low < high:
            middle = low if name in kicked(self.scene, model) else (low + high) // 2
            limit = self.limit
            found = self.tried[rungs[middle]] if self._is_tried(rungs[middle]) else None
            if found is not None and found.operations < limit and found.excess(self.accuracy) > 1.0:
                low = middle + 1
            else:
                high = middle  # it will do, or it is too dear, and smaller tolerances are dearer
        for rung in rungs[high + 1 :]:
            limit = self.limit
            if not self._is_tried(rung) or self.tried[rung].operations >= limit:
                return

    def _angle(self, model: Model) -> Choice:
        """Returns rk4 with the angle, of two digits, that hardly divides a communication step."""
        fastest = float(np.linalg.norm(self.truth[:, :, 4:], axis=2).max())
        angle = 1.1 * fastest * self.accuracy.step
        return Choice(model, "rk4", min(max(_two_digits(angle), FINEST_ANGLE), COARSEST))

    def _divided(self, choice: Choice) -> None:
        """Tries finer angles, each as its forerunner's error lets expect, while they may be cheaper."""
        for _ in range(MOST_ANGLES):
            before = self.tried.get(choice)
            if before is None or before.refused or before.excess(self.accuracy) <= 1.0:
                return
            if before.operations >= self.limit:
                return
            assert choice.angle is not None
            angle = _two_digits(choice.angle / max(1.05 * before.excess(self.accuracy) ** 0.25, 1.2))
            choice = Choice(choice.model, "rk4", angle)
            if angle < FINEST_ANGLE or not self._is_tried(choice):
                return

    def least(self, choice: Choice) -> float:
        """Returns the fewest operations that a choice can take: no step divided but by the angle turned."""
        steps = self.every.course.steps
        turned = np.sum(np.linalg.norm(self.truth[:, :, 4:], axis=2), axis=1) * (
            self.every.course.duration / self.truth.shape[1]
        )
        counts = [max(steps, int(0.5 * angle / choice.angle)) if choice.angle else steps for angle in turned]
        return self._operations(choice, counts)

    def _operations(self, choice: Choice, sub_steps: Sequence[int]) -> float:
        source = source_of(choice)
        if source not in self.models:
            built = self.shop.built.get(source)
            self.models[source] = built.model if built else equations(variant_of(self.scene, source))
        model, key = self.models[source], (source, choice.tolerance)
        if key not in self.costs:
            self.costs[key] = costs(model, choice.model.law, choice.tolerance or FINEST)
        fastest = np.linalg.norm(self.truth[:, :, 4:], axis=2).max(1)
        return max(
            per_step(self.costs[key], model.plan.free, history, self.every, count, float(rate))
            for history, count, rate in zip(self.every.flown, sub_steps, fastest, strict=False)
        )

    def try_one(self, choice: Choice) -> Tried:
        """Flies a candidate, unless that has been done; returns what came of it."""
        if choice not in self.tried:
            self.progress(str(choice))
            self.tried[choice] = self._tried(choice)
        return self.tried[choice]

    def _tried(self, choice: Choice) -> Tried:
        """Returns what comes of a candidate: of all histories, unless the telling ones say enough."""
        parts = range(self.every.telling), range(self.every.telling, len(self.every.flown))
        found = FlightErrors([], [], [])
        for part in parts:
            more = self._errors(choice, part)
            if more.refused is not None:
                return Tried(choice, self.least(choice), np.inf, np.inf, "", part.stop, more.refused)
            found = FlightErrors(
                found.attitude + more.attitude, found.rate + more.rate, found.sub_steps + more.sub_steps
            )
            so_far = self._summed(choice, found)
            if so_far.excess(self.accuracy) > 1.0:
                break
        return so_far

    def _summed(self, choice: Choice, found: FlightErrors) -> Tried:
        """Returns a candidate by its flights through the first histories."""
        count = len(found.attitude)
        attitude, rate = (
            np.array(errors) + doubt[:count]
            for errors, doubt in zip((found.attitude, found.rate), self.doubt, strict=True)
        )
        worst = self.every.flown[int(np.argmax(attitude))].name
        operations = self._operations(choice, found.sub_steps)
        return Tried(choice, operations, float(attitude.max()), float(rate.max()), worst, count)

    def _errors(self, choice: Choice, part: range) -> FlightErrors:
        """Returns the errors of a choice in some of the histories, kept by content."""
        if choice == reference_choices(self.scene, BEST)[0]:
            return FlightErrors([0.0] * len(part), [0.0] * len(part), self.sub_steps[part.start : part.stop])
        if not part:
            return FlightErrors([], [], [])
        anything = self.accuracy.model_copy(update={"attitude": 1.0, "rate": None})
        flown_in = self.scene.model_copy(update={"accuracy": anything})  # whatever is asked of the flights
        place = place_of("accuracy", flown_in, ["errors", asdict(choice), part.start, part.stop])
        kept = read(place, lambda kept: _are_errors(kept, len(part)))
        if kept is not None:
            return FlightErrors(**kept)
        flown = fly(self.scene, self.shop, self.every, choice, part)
        if isinstance(flown, str):
            found = FlightErrors([], [], [], flown)
        else:
            samples, sub_steps = flown
            attitude, rate = apart(samples, self.truth[part.start : part.stop])
            found = FlightErrors(attitude.tolist(), rate.tolist(), sub_steps)
        keep(place, asdict(found))
        return found
