"""Claims of `[accuracy]`, attacked: nasty random scenes, histories made against them, an independent truth.

    PYTHONPATH=tests .venv/bin/python -m accuracy.adversary --scenes 0:500

examines scenes by number, appends what came of each to a file of JSON lines, and prints a summary of it.
Scenes that are in it, of the same code, are left out: parts add up.
"""

import argparse
import hashlib
import json
import os
import sys
import tempfile
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from numpy.typing import NDArray

import fmu_build
import supervessel
from accuracy import summary
from accuracy.attacks import Attack, Ranges, attacks
from accuracy.confirm import flown_each
from accuracy.nasty_scenes import Raw, scene_of
from accuracy.truth import RTOL, after_a_step, turned
from fmu_build import BuildError, build_fmu
from fmu_build.accuracy.search import Search
from fmu_build.compile.compiler import TRIAL_FLAGS
from fmu_build.compile.library import compile_sources
from fmu_build.flight.choices import Model, laws_of
from fmu_build.flight.distance import attitude_apart
from supervessel import Scene, parse_scene, reference
from supervessel.scene.schema import changes_rate

Array = NDArray[np.float64]
Record = dict[str, Any]

FILE = Path(__file__).parents[2] / "build" / "adversary.jsonl"
SCENES = 500

NEAR = 0.5
"""Share of what is asked, or of a bound, from which on the truth is computed again at a coarser tolerance."""

COARSER = 100.0 * RTOL

ROUNDING = 1e-12
"""What two ways to the same exact motion may differ by [rad]; the law's bound is of exact motions."""


@dataclass(frozen=True)
class Flights:
    """The flights of a scene in its attacks.

    names  : of the attacks, n
    rows   : inputs of each step, of each flight
    truth  : (steps, n, 7), attitude and rate [rad/s] after each step
    """

    names: list[str]
    rows: list[list[dict[str, float]]]
    truth: Array


def true_flights(scene: Scene, against: Sequence[Attack], law: str = "tensor", rtol: float = RTOL) -> Flights:
    """Returns the exact motion under a law in attacks, and the inputs that these then are.

    rtol : of DOP853. Changes are those of the law tensor
    """
    accuracy = scene.accuracy
    assert accuracy is not None
    ranges, steps = Ranges(scene), round(accuracy.horizon / accuracy.step)
    start = np.append(scene.rotation.attitude, scene.rotation.angular_velocity)
    states = np.tile(start, (len(against), 1))
    changing = changes_rate(scene)
    before: list[Array | None] = [None] * len(against)
    courses: list[list[dict[str, float]]] = [[] for _ in against]
    found = []
    for step in range(steps):
        bodies = []
        for i, attack in enumerate(against):
            row, old = attack.at(step, states[i, 4:]), before[i]
            if not ranges.fits(row):
                row = ranges.start if old is None else old
            if changing and old is not None and not np.array_equal(row, old):
                states[i, 4:] = reference.change(scene, states[i, 4:], ranges.values(old), ranges.values(row))
            before[i] = row
            courses[i].append(ranges.values(row))
            bodies.append((ranges.inertia(row), ranges.torque(row)))
        J, M = (np.array(part) for part in zip(*bodies, strict=True))
        if law in ("decoupled", "principal"):
            J = J * np.eye(3)
        if law == "none":
            M = 0.0 * M
        turning = float(law in ("tensor", "principal"))
        states = after_a_step(states, accuracy.step, J, M, rtol, turning)
        found.append(states.copy())  # states change in place with the inputs
    return Flights([attack.name for attack in against], courses, np.array(found))


def known_to(scene: Scene, flights: Flights) -> Array:
    """Returns how far the truth is from that of a coarser tolerance, (n,) [rad]: much more than it is off."""
    coarse = true_flights(scene, again(flights), rtol=COARSER)
    return _angles(coarse.truth, flights.truth).max(axis=0)


def again(flights: Flights) -> list[Attack]:
    """Returns attacks with the inputs of flights, whatever the motion."""
    return [
        Attack(name, lambda step, omega, rows=rows: np.array(list(rows[step].values())))
        for name, rows in zip(flights.names, flights.rows, strict=True)
    ]


def _angles(one: Array, other: Array) -> Array:
    """Returns the angles between attitudes, (steps, n) [rad]."""
    shape = one.shape[:2]
    flat = attitude_apart(one[..., :4].reshape(-1, 4), other[..., :4].reshape(-1, 4))
    return np.asarray(flat).reshape(shape)


@contextmanager
def both_rules() -> Iterator[dict[str, Any]]:
    """Yields a dictionary that gets, of the searches in the block, what the old rule would have chosen.

    The old rule: the cheapest candidate that flights find to be enough, whether its law is proven or not. The
    laws that were refused as not proven are flown in the same workshop, after the choice.
    """
    seen: dict[str, Any] = {}
    run = Search.run

    def both(search: Search) -> None:
        run(search)
        refused = {one.choice.model for one in search.tried.values() if (one.refused or "").startswith("not")}
        kept = {key: one for key, one in search.tried.items() if one.choice.model not in refused}
        freely = replace(search, tried=kept, left={})
        with mock.patch("fmu_build.accuracy.search.law_is_off", return_value=""):
            for law in laws_of(search.scene):
                if Model(law) in refused:
                    freely._law(Model(law))
        best = freely.best
        seen["refused laws"] = sorted(model.law for model in refused)
        if best is not None:
            seen["old"] = {"choice": str(best.choice), "operations": best.operations}

    anew = mock.patch("fmu_build.accuracy.choice.read", return_value=None)
    with anew, mock.patch.object(Search, "run", both):  # a choice that is kept would not be searched for
        yield seen


quickly = partial(compile_sources, flags=TRIAL_FLAGS)
"""What compiles an FMU's library in a fifth of the time; it gives the same numbers to the last bit."""


def examined(number: int, *, rules: bool = True) -> Record:
    """Returns what came of a scene: the choice, its grade, and how near each attack came to breaking it.

    rules : whether the old rule's choice is found too
    """
    kind, raw = scene_of(number)
    with tempfile.TemporaryDirectory(prefix="adversary-") as folder:
        return {"number": number, "kind": kind, **attacked(raw, number, Path(folder), rules=rules)}


def attacked(raw: Raw, seed: int, folder: Path, *, rules: bool = True) -> Record:
    """Returns what came of a raw scene, see `examined`. All numbers are SI, angles [rad].

    A scene is refused where nothing that is as exact as it asks can be had; any other BuildError goes on.
    """
    begun, scene = _seconds(), parse_scene(raw)
    with both_rules() if rules else _nothing() as seen:
        try:
            with mock.patch("fmu_build.build.compile_sources", quickly):
                fmu = build_fmu(scene, folder / f"{scene.name}.fmu")
        except BuildError as error:
            if not str(error).startswith(f"{scene.name}: accuracy"):
                raise
            return {"code": code(), "refused": str(error), "seconds": _seconds() - begun}
    with zipfile.ZipFile(fmu) as archive:
        evidence = json.loads(archive.read("resources/accuracy.json"))
    chosen_in = _seconds() - begun
    flights = true_flights(scene, list(attacks(scene, seed)))
    truth = flights.truth.transpose(1, 0, 2)
    states = np.array(flown_each(fmu, scene, flights.rows, ("error_bound",)))
    return {
        "code": code(),
        "refused": None,
        **_of_evidence(evidence),
        "rules": seen,
        "turned": float(turned(flights.truth, scene.accuracy.step).max()),  # type: ignore[union-attr]
        **judged(scene, evidence, flights, states, truth),
        "chosen_in": chosen_in,
        "seconds": _seconds() - begun,
    }


def judged(
    scene: Scene, evidence: Mapping[str, Any], flights: Flights, states: Array, truth: Array
) -> Record:
    """Returns how near the flights of an FMU, (n, steps, 8), came to what is asked and to its bounds.

    truth : (n, steps, 7)
    The keys `broken`, `bound_broken` and `law_broken` name the attacks that did. Against a bound or what is
    asked counts what is beyond the doubt about the truth. The bound of the law alone is held against the
    law's own exact motion, which no method is part of.
    """
    asked, grade = evidence["asked"], evidence["grade"]
    angles = _angles(states, truth)
    attitude = angles.max(axis=1)
    rate = np.linalg.norm(states[..., 4:7] - truth[..., 4:], axis=2).max(axis=1)
    share = np.maximum(attitude / asked["attitude"], rate / asked["rate"] if asked["rate"] else 0.0)
    output, bound = states[..., 7], grade["attitude"] or np.inf
    close = max(share.max(), attitude.max() / bound)
    has_output = bool(np.isfinite(output).any())
    doubt = np.zeros(len(attitude))
    if close > NEAR or (has_output and np.any(angles > NEAR * output)):
        doubt = known_to(scene, flights)
    sure = attitude - doubt
    law = evidence["choice"]["law"]
    by_law = np.zeros(len(attitude))
    if law != "tensor" and grade["law"] is not None:
        by_law = _angles(true_flights(scene, again(flights), law).truth, flights.truth).max(axis=0)
        if by_law.max() > NEAR * grade["law"] and not doubt.any():
            doubt = known_to(scene, flights)
    rates_off = bool(asked["rate"]) & (rate > (asked["rate"] or 0.0))

    def named(which: Array) -> list[str]:
        return [name for name, wrong in zip(flights.names, which, strict=True) if wrong]

    return {
        "used": dict(zip(flights.names, share.tolist(), strict=True)),
        "largest": float(attitude.max()),
        "doubt": float(doubt.max()),
        "broken": named((sure > asked["attitude"]) | rates_off),
        "bound_broken": named(sure > grade["attitude"]) if grade["name"] == "proven" else [],
        "law_broken": named(by_law - doubt - ROUNDING > (np.inf if grade["law"] is None else grade["law"])),
        "by_law": float(by_law.max()),
        "output": _of_output(output, angles, doubt, asked["attitude"], flights.names) if has_output else None,
    }


def _of_output(output: Array, angles: Array, doubt: Array, asked: float, names: list[str]) -> Record:
    """Returns what came of the FMU's own `error_bound`, (n, steps) [rad], at most pi.

    broken : attacks in which it was below the error at any step, or NaN
    beyond : flights at whose end it exceeds what is asked though the error never did
    """
    below = ~(angles - doubt[:, None] <= output)
    beyond = (output[:, -1] > asked) & (angles.max(axis=1) <= asked)
    return {
        "end": dict(zip(names, output[:, -1].tolist(), strict=True)),
        "broken": [name for name, wrong in zip(names, below.any(axis=1), strict=True) if wrong],
        "beyond": int(beyond.sum()),
        "flights": len(names),
    }


def _of_evidence(evidence: Mapping[str, Any]) -> Record:
    """Returns what a record keeps of the evidence."""
    kept = ("asked", "choice", "grade", "attitude", "rate", "worst", "operations", "steps", "doubt")
    enough = [one for one in evidence["candidates"] if one["enough"]]
    return {
        **{key: evidence[key] for key in kept},
        "flown": len(evidence["histories"]),
        "enough": len(enough),
        "truth": [str(choice) for choice in evidence["truth"]],
    }


@contextmanager
def _nothing() -> Iterator[dict[str, Any]]:
    yield {}


def _seconds() -> float:
    """Returns the processor time [s] of this process and of those it has waited for."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


@cache
def code() -> str:
    """Returns a digest of what builds, chooses and flies: figures of different code do not add up."""
    files = hashlib.sha256()
    for package in (Path(supervessel.__path__[0]), Path(fmu_build.__path__[0])):
        for file in sorted(package.rglob("*")):
            if file.suffix in (".py", ".c", ".h"):
                files.update(file.read_bytes())
    return files.hexdigest()[:12]


def recorded(file: Path) -> list[Record]:
    """Returns the records of a file of JSON lines, none where there is no file."""
    if not file.exists():
        return []
    return [json.loads(line) for line in file.read_text().splitlines()]


def examine(numbers: Sequence[int], file: Path, *, rules: bool = True) -> list[Record]:
    """Appends the records of scenes that a file lacks; returns those of the present code in the file."""
    known = {one["number"] for one in recorded(file) if one["code"] == code()}
    file.parent.mkdir(parents=True, exist_ok=True)
    for number in numbers:
        if number in known:
            continue
        record = examined(number, rules=rules)
        with file.open("a") as lines:
            lines.write(json.dumps(record) + "\n")
        for said in summary.breaches(record):
            print(said, flush=True)
    return [one for one in recorded(file) if one["code"] == code()]


def _numbers(text: str) -> range:
    low, _, high = text.partition(":")
    return range(int(low), int(high) if high else int(low) + 1)


def main(arguments: Sequence[str] | None = None) -> int:
    """Returns 1 where a claim or bound is broken that must not be."""
    parser = argparse.ArgumentParser(prog="accuracy.adversary", description=__doc__)
    parser.add_argument("--scenes", type=_numbers, default=range(SCENES), help="A:B, numbers of scenes")
    parser.add_argument("--file", type=Path, default=FILE, help="JSON lines, appended to")
    parser.add_argument("--summary", action="store_true", help="examine nothing, summarise the file")
    given = parser.parse_args(arguments)
    found = recorded(given.file) if given.summary else examine(given.scenes, given.file)
    print(summary.report(found))
    return int(bool(summary.failures(found)))


if __name__ == "__main__":
    sys.exit(main())
