"""What inputs may do within their ranges: the histories by which an accuracy is judged.

They follow from the scene alone. In a corner every input is at one of its two ends; what is drawn from the
inside is uniform in the ranges.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import product
from math import ceil, pi
from random import Random

import numpy as np
from numpy.typing import NDArray

from fmu_build.accuracy.waves import Ends, waves_that_grow
from fmu_build.flight.experiment import Course, course_of
from fmu_build.flight.flying import InputCourses
from supervessel.composite.resolved import resolve
from supervessel.scene.schema import Accuracy, Experiment, Scene

Array = NDArray[np.float64]
Judge = Callable[[InputCourses], NDArray[np.bool_]]
"""Returns of rows of inputs whether an FMU starts with them."""

Body = Callable[[Array, Array], tuple[Array, Array]]
"""Returns of a row, numbers and docks, the tensor, (3, 3) [kg m2], and what each input that acts gives of
angular acceleration, (3, m)."""

SEED = "what inputs may do"

DRAWN = 2048
"""Rows that are drawn of a kind: corners, and from the inside."""

MOST_NUMBERS = 2_000_000
"""Numbers that are drawn of a kind, or that jump in a history."""

MOST_GROUPS = 12
"""Inputs, vectors as one, that are moved alone."""

HELD_CORNERS, HELD_INSIDE = 6, 3

PIECES = (3, 10, 30, 100)
"""Pieces of histories that jump at random times; one more jumps at every step."""

WALKS, WALKED = 3, 60
"""Histories in which one input jumps at a time, and how often."""

SPUN = 64
"""Corners among which the one is found that is easiest to spin up."""

SPUN_PIECES, SPUN_ANGLE = 200, 0.3
"""Pieces of a history that spins the body up, and the angle [rad] of steps by which it is foretold."""

PUSHED = SPUN_PIECES // 4
"""First pieces in which what acts does so at its larger ends, whatever the rate, in some of these."""

TELLING = ("all high", "corner 1 held", "corner 2 held", "corner, 30 pieces")
"""Histories that are flown first: a law that will not do mostly shows it in these."""

WAVES = 3
"""Histories in which what acts goes to and fro."""

TOGETHER = (3, 5, 12, 50, 200)
"""Communication steps after which everything jumps to the other end of its range, and back."""

SHAKEN, SHAKEN_CORNERS = 3, 12
"""Square waves that are flown because errors grow along them, and the corners among which they are found."""

MOST_COMBINATIONS = 64
"""Combinations of docks that are held one by one, at most."""

JUDGED, CLIMBED = 768, 200
"""Rows of those drawn that are judged by how fast small disturbances grow, and rows tried beside the best."""

MOST_SAMPLES = 1000
"""Communication points at which a flight is looked at, evenly spaced, the last one among them."""


@dataclass(frozen=True)
class History:
    """What inputs do, and how that is called."""

    name: str
    inputs: InputCourses


@dataclass(frozen=True)
class Histories:
    """All histories of a scene.

    course           : steps and samples
    telling          : how many of the histories are flown first
    numbers, docks   : names of the inputs, in the order of columns
    acting           : which of the numbers act, torque and forces, (n,)
    flown            : the histories
    senseless, drawn : how many rows of inputs make no sense in themselves, of how many
    """

    course: Course
    numbers: tuple[str, ...]
    docks: tuple[str, ...]
    acting: NDArray[np.bool_]
    flown: tuple[History, ...]
    senseless: int
    drawn: int

    @property
    def telling(self) -> int:
        return max(1, sum(history.name in TELLING for history in self.flown))


@dataclass(frozen=True)
class _Columns:
    """Inputs by column: numbers, then docks as 0 and 1; bounds and the scene's values, (n,) each."""

    numbers: tuple[str, ...]
    docks: tuple[str, ...]
    groups: tuple[str, ...]
    acting: NDArray[np.bool_]
    low: Array
    high: Array
    start: Array

    def inputs(self, rows: NDArray[np.int64], values: Array) -> InputCourses:
        """Returns values, (rows, n), as inputs set before steps."""
        split = len(self.numbers)
        return InputCourses(rows, values[:, :split], values[:, split:])


def _columns(scene: Scene) -> _Columns:
    """Returns the inputs that have ranges: all but those of gravity, which follow from the orbit."""
    ranged = [variable for variable in resolve(scene).inputs if variable.part != "field"]
    variables = sorted(ranged, key=lambda variable: variable.boolean)  # numbers come first
    bounds = [(0.0, 1.0) if v.boolean else (v.low, v.high) for v in variables]
    low, high = np.array(bounds, dtype=float).reshape(-1, 2).T
    return _Columns(
        tuple(v.name for v in variables if not v.boolean),
        tuple(v.name for v in variables if v.boolean),
        tuple(v.group for v in variables),
        np.array([v.part == "action" for v in variables], dtype=bool),
        low,
        high,
        np.array([v.start for v in variables], dtype=float),
    )


def course_up_to(scene: Scene, accuracy: Accuracy) -> Course:
    """Returns the steps of a flight up to the horizon, with orbit and inputs of the experiment, if any."""
    given = scene.experiment or Experiment(duration=accuracy.horizon, step=accuracy.step)
    lasting = given.model_copy(update={"duration": accuracy.horizon, "step": accuracy.step})
    course = course_of(scene.model_copy(update={"experiment": lasting}))
    count = min(course.steps, MOST_SAMPLES)
    sampled = np.unique(np.rint(np.linspace(1, course.steps, count)).astype(np.int64))
    return replace(course, sampled=sampled)


def histories(scene: Scene, accuracy: Accuracy, judge: Judge, body: Body) -> Histories:
    """Returns a scene's histories of inputs; without rows that no FMU starts with."""
    columns, course, random = _columns(scene), course_up_to(scene, accuracy), Random(SEED)
    fixed = dict(_fixed(columns, random))
    count = min(DRAWN, max(1, MOST_NUMBERS // max(1, len(columns.low))))
    corners = np.where(_drawn(random, count, columns) < 0.5, columns.low, columns.high)
    share = _drawn(random, count, columns)
    inside = columns.low + share * (columns.high - columns.low)
    split = len(columns.numbers)
    inside[:, split:] = np.round(share[:, split:])
    experiment, walks = _experiment(columns, course), _walks(columns, random)
    parts = [np.array(list(fixed.values())), corners, inside, walks, experiment]
    usable = judge(columns.inputs(np.arange(sum(map(len, parts))), np.concatenate(parts)))
    fits = np.split(usable, np.cumsum([len(part) for part in parts])[:-1])
    held = [(name, row) for (name, row), good in zip(fixed.items(), fits[0], strict=True) if good]
    flown = [History(name, columns.inputs(np.zeros(1, np.int64), row[None])) for name, row in held]
    if len(columns.low):
        corners = corners[fits[1]]
        flown += _moved(columns, course, random, corners, inside[fits[2]], scene)
        for i, part in enumerate(np.split(np.arange(len(walks)), WALKS), start=1):
            rows = walks[part[fits[3][part]]]
            times = np.unique([0, *(int(random.random() * course.steps) for _ in rows[1:])])
            if len(rows):
                flown.append(History(f"one input at a time {i}", columns.inputs(times, rows[: len(times)])))
        opposite = _opposite(columns, corners, judge)
        flown += _together(columns, course, opposite)
        flown += _shaken(columns, course, scene, opposite, body)
        flown += _growing(columns, scene, random, np.concatenate([corners, inside[fits[2]]]), judge, body)
        if columns.acting.any():
            starts = (columns.start, *_easiest(columns, corners[:SPUN], body))
            flown += [
                _spun_up(f"{what} {i}", columns, course, scene, row, body, pushed)
                for what, pushed in (("spun up", 0), ("pushed, then spun up", PUSHED))
                for i, row in enumerate(starts, 1)
            ]
    if experiment.size and fits[4].all():
        flown.append(History("as in the experiment", columns.inputs(np.arange(course.steps), experiment)))
    return Histories(
        course,
        columns.numbers,
        columns.docks,
        columns.acting[:split],
        _in_order(flown),
        int(np.sum(~usable)),
        len(usable),
    )


def _in_order(flown: Iterable[History]) -> tuple[History, ...]:
    """Returns histories without repetitions, those of TELLING first."""
    different: dict[tuple[bytes, ...], History] = {}
    for history in flown:
        inputs = history.inputs
        content = inputs.rows.tobytes(), inputs.numbers.tobytes(), inputs.booleans.tobytes()
        different.setdefault(content, history)
    return tuple(sorted(different.values(), key=lambda history: history.name not in TELLING))


def _drawn(random: Random, count: int, columns: _Columns) -> Array:
    """Returns shares from 0 to 1, (count, n); `Random.random` gives the same on every machine."""
    n = len(columns.low)
    return np.array([random.random() for _ in range(count * n)]).reshape(count, n)


def _fixed(columns: _Columns, random: Random) -> Iterator[tuple[str, Array]]:
    """Yields rows that are held: the scene's values, all at an end, one input after the other at its ends."""
    yield "as in the scene", columns.start
    if len(columns.low) == 0:
        return
    yield "all low", columns.low
    yield "all high", columns.high
    groups = list(dict.fromkeys(columns.groups))
    while len(groups) > MOST_GROUPS:
        del groups[int(random.random() * len(groups))]
    docks = range(len(columns.numbers), len(columns.low))
    for flags in product((0.0, 1.0), repeat=len(docks)) if 2 ** len(docks) <= MOST_COMBINATIONS else ():
        if docks:
            row = columns.start.copy()
            row[len(columns.numbers) :] = flags
            yield f"docks {''.join(str(int(flag)) for flag in flags)}", row
    for group in groups:
        moved = np.array([name == group for name in columns.groups])
        yield f"{group} low", np.where(moved, columns.low, columns.start)
        yield f"{group} high", np.where(moved, columns.high, columns.start)


def _experiment(columns: _Columns, course: Course) -> Array:
    """Returns the inputs of the experiment step by step, (steps, n); no rows where nothing moves."""
    moved = {**course.numbers, **course.booleans}
    if not moved:
        return np.zeros((0, len(columns.low)))
    names = (*columns.numbers, *columns.docks)
    held = dict(zip(names, columns.start, strict=True))
    return np.column_stack([moved.get(name, np.full(course.steps, held[name])) for name in names])


def _walks(columns: _Columns, random: Random) -> Array:
    """Returns corners each of which differs from the one before in one input, vectors as one; WALKS parts."""
    groups = list(dict.fromkeys(columns.groups))
    rows = []
    for _ in range(WALKS if groups else 0):
        row = np.where(_drawn(random, 1, columns)[0] < 0.5, columns.low, columns.high)
        for _ in range(WALKED):
            moved = np.array([name == groups[int(random.random() * len(groups))] for name in columns.groups])
            other = np.where(_drawn(random, 1, columns)[0] < 0.5, columns.low, columns.high)
            row = np.where(moved, other, row)
            rows.append(row)
    return np.array(rows).reshape(len(rows), len(columns.low))


def _easiest(columns: _Columns, corners: Array, body: Body) -> list[Array]:
    """Returns the corner, if there is any, in which what acts accelerates the body most."""
    split = len(columns.numbers)
    strength = [np.abs(body(row[:split], row[split:])[1]).sum() for row in corners]
    return [corners[int(np.argmax(strength))]] if strength else []


def _together(columns: _Columns, course: Course, opposite: tuple[Array, Array]) -> Iterator[History]:
    """Yields histories in which everything jumps to the opposite corner and back."""
    here, there = opposite
    stride = ceil(course.steps * len(columns.low) / MOST_NUMBERS)
    for i, half in enumerate(TOGETHER if len(here) else ()):
        rows = np.arange(0, course.steps, max(half, stride))
        if len(rows) > 1:
            ends = here[i % len(here)], there[i % len(here)]
            values = np.where((np.arange(len(rows)) % 2 == 0)[:, None], *ends)
            yield History(f"all to and fro every {half} steps", columns.inputs(rows, values))


def _opposite(columns: _Columns, corners: Array, judge: Judge) -> tuple[Array, Array]:
    """Returns corners and their opposite ones, where both make sense."""
    here = corners[:SPUN]
    there = np.where(here == columns.low, columns.high, columns.low)
    fits = judge(columns.inputs(np.arange(len(here)), there)) if len(here) else np.zeros(0, dtype=bool)
    return here[fits], there[fits]


def _shaken(
    columns: _Columns, course: Course, scene: Scene, opposite: tuple[Array, Array], body: Body
) -> Iterator[History]:
    """Yields the square waves of all inputs along which small errors grow most, each of other corners."""
    if course.steps * len(columns.low) > MOST_NUMBERS:
        return
    here, there = opposite
    ends = [_ends(columns, pair, body) for pair in zip(here[:SHAKEN_CORNERS], there, strict=False)]
    sound = [i for i, one in enumerate(ends) if one is not None]
    rate, momentum = np.array(scene.rotation.angular_velocity), "momentum" in scene.keeps.values()
    known = [one for one in ends if one is not None]
    waves = waves_that_grow(known, rate, course.size, course.steps, momentum=momentum)
    seen: set[int] = set()
    for wave in waves:
        if wave.ends in seen or len(seen) == SHAKEN:
            continue
        seen.add(wave.ends)
        first = wave.at_first(course.steps)
        rows = np.flatnonzero(np.diff(first, prepend=~first[0]))
        pair = here[sound[wave.ends]], there[sound[wave.ends]]
        values = np.where(first[rows][:, None], *pair)
        name = (
            f"to and fro every {wave.half} and {wave.other} steps from corner {wave.ends + 1}, as errors grow"
        )
        yield History(name, columns.inputs(rows, values))


def _ends(columns: _Columns, pair: tuple[Array, Array], body: Body) -> Ends | None:
    """Returns the body at both ends of a wave; None where it cannot be turned."""
    split = len(columns.numbers)
    found = [(*body(row[:split], row[split:]), row[columns.acting]) for row in pair]
    inertia = np.array([J for J, _, _ in found])
    if not np.all(np.isfinite(inertia)) or np.linalg.eigvalsh(inertia).min() <= 0.0:
        return None
    return Ends(inertia, np.array([gains @ acts if len(acts) else np.zeros(3) for _, gains, acts in found]))


def _growing(  # noqa: PLR0913, PLR0917
    columns: _Columns, scene: Scene, random: Random, rows: Array, judge: Judge, body: Body
) -> Iterator[History]:
    """Yields the history that holds the row in which small disturbances of the start's spin grow fastest.

    Of the rows drawn the best one is moved by steps that shrink, where that is better and makes sense.
    """
    split, rate = len(columns.numbers), np.array(scene.rotation.angular_velocity)

    def growth(row: Array) -> float:
        """Returns the largest growth [1/s] of d' = J^-1 (J w x d' - w x J d'), to six digits."""
        J = body(row[:split], row[split:])[0]
        if not np.all(np.isfinite(J)) or np.linalg.eigvalsh(J)[0] <= 0.0:
            return 0.0
        linear = np.column_stack([np.cross(J @ rate, d) - np.cross(rate, J @ d) for d in np.eye(3)])
        return float(f"{np.linalg.eigvals(np.linalg.solve(J, linear)).real.max():.6g}")

    rows = rows[np.sort(np.unique(np.where(columns.acting, 0.0, rows), axis=0, return_index=True)[1])]
    rows = rows[:: 1 + len(rows) // JUDGED]
    found = [growth(row) for row in rows]
    if not found or max(found) <= 0.0:
        return
    best = kept = rows[int(np.argmax(found))]
    most = max(found)
    moving = (columns.high > columns.low) & (np.arange(len(columns.low)) < split)
    for i in range(CLIMBED):
        size = 0.3 * 0.96**i * (columns.high - columns.low)
        tried = best + np.where(moving, size * (2.0 * _drawn(random, 1, columns)[0] - 1.0), 0.0)
        tried = np.clip(tried, columns.low, columns.high)
        now = growth(tried)
        if now > most:
            best, most = tried, now
    if not judge(columns.inputs(np.zeros(1, np.int64), best[None]))[0]:
        best = kept
    yield History("held where disturbances grow fastest", columns.inputs(np.zeros(1, np.int64), best[None]))


def _spun_up(  # noqa: PLR0913, PLR0917
    name: str, columns: _Columns, course: Course, scene: Scene, row: Array, body: Body, pushed: int
) -> History:
    """Returns a history in which what acts does so with the rate, as it is foretold by steps of rk4.

    pushed : so many pieces begin it in which each input is at its larger end; so it is at no rate at all
    """
    split = len(columns.numbers)
    low, high = columns.low[columns.acting], columns.high[columns.acting]
    larger = np.where(np.abs(low) > np.abs(high), low, high)
    inertia, gains = body(row[:split], row[split:])
    inverse = np.linalg.inv(inertia)
    omega = np.array(scene.rotation.angular_velocity)
    starts = np.unique(np.linspace(0, course.steps, SPUN_PIECES, endpoint=False).astype(np.int64))
    rows = np.tile(row, (len(starts), 1))
    for i, count in enumerate(np.diff(np.append(starts, course.steps))):
        along = np.zeros(len(low)) if i < pushed else omega @ gains
        acts = np.where(along == 0.0, larger, np.where(along > 0.0, high, low))
        rows[i, columns.acting] = acts
        push, span = gains @ acts, float(count) * course.size
        angle = float(np.linalg.norm(omega) + np.linalg.norm(push) * span) * span
        steps = min(max(1, ceil(angle / SPUN_ANGLE)), SPUN_PIECES)
        h = span / steps
        for _ in range(steps):
            k = np.zeros(3)
            mean = np.zeros(3)
            for part, weight in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
                w = omega + part * h * k
                with np.errstate(over="ignore", invalid="ignore"):  # looked at below
                    k = push - inverse @ np.cross(w, inertia @ w)
                mean += weight / 6.0 * k
            omega = omega + h * mean
        if not np.all(np.isfinite(omega)):
            rows, starts = rows[: i + 1], starts[: i + 1]
            break
    return History(name, columns.inputs(starts, rows))


def _moved(  # noqa: PLR0913, PLR0917
    columns: _Columns, course: Course, random: Random, corners: Array, inside: Array, scene: Scene
) -> Iterator[History]:
    """Yields histories of rows that were drawn: held, jumping at random times and at every step, waves."""
    steps = course.steps
    stride = ceil(steps * len(columns.low) / MOST_NUMBERS)
    for what, pool, held in (("corner", corners, HELD_CORNERS), ("inside", inside, HELD_INSIDE)):
        for i in range(min(held, len(pool))):
            yield History(f"{what} {i + 1} held", columns.inputs(np.zeros(1, np.int64), pool[i : i + 1]))
        for pieces in PIECES if len(pool) else ():
            times = {0, *(int(random.random() * steps) for _ in range(pieces - 1))}
            chosen = [int(random.random() * len(pool)) for _ in times]
            name = f"{what}, {pieces} pieces"
            yield History(name, columns.inputs(np.array(sorted(times)), pool[chosen]))
        if len(pool):
            rows = np.arange(0, steps, stride)
            chosen = [int(random.random() * len(pool)) for _ in rows]
            yield History(f"{what}, at every step", columns.inputs(rows, pool[chosen]))
    if not (columns.acting.any() and len(corners)):
        return
    turn = float(np.linalg.norm(scene.rotation.angular_velocity)) * course.size
    halves = {1, max(1, steps // 8), max(1, min(steps, round(pi / turn))) if turn * steps > pi else steps}
    for i, half in enumerate(sorted(halves)[:WAVES]):
        rows = np.arange(0, steps, max(half, stride))
        here = corners[i % len(corners)]
        there = np.where(columns.acting, columns.low + columns.high - here, here)
        values = np.where((np.arange(len(rows)) % 2 == 0)[:, None], here, there)
        yield History(
            f"corner {i + 1}, to and fro every {half * course.size:g} s", columns.inputs(rows, values)
        )
