"""A scene's experiment as an importer flies it: communication steps, and inputs held over each of them."""

from collections.abc import Iterable
from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import NDArray

from supervessel.orbit import gravity_inputs
from supervessel.problems import TradeError
from supervessel.scene.inputs import by_name
from supervessel.scene.schema import MOST_STEPS, Experiment, Scene

Array = NDArray[np.float64]

SLACK = 1e-9
"""Fraction of a step within which a time counts as a communication point, because `k * step` is rounded."""

SAMPLES = 100
"""Number of communication points up to each horizon at which the state of a flight is recorded."""

HORIZONS = (100.0, 10.0, 1.0)
"""Divisors of the duration that give the times up to which errors are given, each at the end of a step."""


@dataclass(frozen=True)
class Course:
    """An experiment step by step.

    duration  : of the experiment [s]
    size      : of a communication step [s]
    last_size : of the last communication step, which may be shorter [s]
    steps     : number of communication steps, n
    numbers   : by the name of a moving input, its values over each step, (n,), in the input's unit
    booleans  : by the name of a moving dock input, its values over each step, (n,), 0 and 1
    field     : by the name of an input of gravity, where the orbit has the body as each step begins, (n,) [m,
                m/s]; empty without an orbit
    sampled   : numbers of steps after which the state is recorded, ascending, n last
    """

    duration: float
    size: float
    last_size: float
    steps: int
    numbers: dict[str, Array]
    booleans: dict[str, Array]
    field: dict[str, Array]
    sampled: NDArray[np.int64]

    @property
    def times(self) -> Array:
        """Times [s] of the samples."""
        return np.where(self.sampled == self.steps, self.duration, self.sampled * self.size)

    @property
    def horizons(self) -> list[float]:
        """Times [s] up to which errors are given: communication points."""
        return [self.duration if end == self.steps else end * self.size for end in _ends(self.steps)]


def _ends(steps: int) -> list[int]:
    """Returns the numbers of the steps at whose ends the horizons are, ascending."""
    return sorted({ceil(steps / part - SLACK) for part in HORIZONS})


def experiment_of(scene: Scene) -> Experiment:
    """Returns the scene's experiment. Raises TradeError where it has none."""
    if scene.experiment is None:
        raise TradeError("experiment: missing; a trade needs [experiment] with duration and step [s]")
    return scene.experiment


def course_of(scene: Scene) -> Course:
    """Returns the scene's experiment step by step.

    Raises TradeError if there is none, if it has too many steps, or if it does not tell where the body is in
    a field of gravity.
    """
    experiment = experiment_of(scene)
    count = experiment.duration / experiment.step
    if not count <= MOST_STEPS:
        raise TradeError(
            f"experiment: duration = {experiment.duration} s in steps of {experiment.step} s are {count:.6g} "
            f"steps; at most {MOST_STEPS}"
        )
    steps = max(1, ceil(count - SLACK))
    times: Array = experiment.step * np.arange(steps, dtype=np.float64)
    slack = SLACK * experiment.step
    last_size = experiment.duration - (steps - 1) * experiment.step
    if abs(last_size - experiment.step) <= SLACK * experiment.step:
        last_size = experiment.step
    docks = {name for name, kind in by_name(dict(scene.inputs)).items() if kind.boolean}
    moving = {name: rows for name, rows in experiment.inputs.items() if name not in docks}
    switched = {name: rows for name, rows in experiment.inputs.items() if name in docks}
    sampled = set(_ends(steps))
    for part in HORIZONS:
        sampled.update(np.rint(np.linspace(0.0, steps / part, SAMPLES + 1)).astype(int).tolist())
    return Course(
        experiment.duration,
        experiment.step,
        last_size,
        steps,
        {name: values(rows, times, slack) for name, rows in moving.items()},
        {name: held(rows, times, slack) for name, rows in switched.items()},
        _field(scene, times),
        np.array(sorted(sampled - {0})),
    )


def _field(scene: Scene, times: Array) -> dict[str, Array]:
    """Returns the inputs of gravity at times [s] by the experiment's orbit; none where it has none.

    Raises TradeError where it has none and its inputs do not say either where the body is.
    """
    experiment, known = experiment_of(scene), by_name(dict(scene.inputs))
    if experiment.orbit is None:
        told = experiment.inputs
        missing = [name for name, kind in known.items() if kind.part == "field" and name not in told]
        if missing:
            raise TradeError(
                f'experiment.orbit: missing, and experiment.inputs has no "{missing[0]}": nothing tells '
                "where the body is in the field of gravity"
            )
        return {}
    try:
        return gravity_inputs(scene, times)
    except ValueError as error:
        raise TradeError(f"experiment.orbit: {error}") from None


def held(rows: Iterable[tuple[float, float]], times: Array, slack: float = 0.0) -> Array:
    """Returns the values at times [s], each held from its row to the next; the first one also before it.

    rows, slack : as in `values`
    """
    when, what = np.array(list(rows)).T
    place = np.searchsorted(when, times + slack, side="right") - 1
    return np.asarray(what[np.maximum(place, 0)], dtype=float)


def values(rows: Iterable[tuple[float, float]], times: Array, slack: float = 0.0) -> Array:
    """Returns the values at times [s], linear between rows and held before the first and after the last.

    rows  : pairs of time [s] and value, in the order of time; of two at one time the second holds from it on
    slack : [s], by which a time may be early and still count as the time of a row
    """
    when, what = np.array(list(rows)).T
    place = np.searchsorted(when, times + slack, side="right") - 1
    one, other = np.maximum(place, 0), np.minimum(place + 1, len(when) - 1)
    span = when[other] - when[one]
    past = np.maximum(times - when[one], 0.0)
    share = np.where(span > 0.0, past / np.where(span > 0.0, span, 1.0), 0.0)
    return np.asarray(what[one] + share * (what[other] - what[one]), dtype=float)


def at_start(scene: Scene) -> dict[str, float]:
    """Returns the values at time 0 of the inputs that the experiment names."""
    return {name: rows_at_start(rows) for name, rows in experiment_of(scene).inputs.items()}


def rows_at_start(rows: Iterable[tuple[float, float]]) -> float:
    """Returns the value at time 0."""
    return float(values(rows, np.zeros(1))[0])


def acts(scene: Scene) -> bool:
    """Whether a torque or force other than 0 acts at some time; gravity's gradient is none of these."""
    known = by_name(dict(scene.inputs))
    return any(
        value != 0.0
        for name, rows in experiment_of(scene).inputs.items()
        if known[name].part == "action"
        for _, value in rows
    )
