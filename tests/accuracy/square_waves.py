"""The known case: square waves of mass and torque together break a claim that rests on other histories.

Once a method was chosen for 8.3e-6 rad under the law tensor, and square waves of mass and all torques
together, five steps each, gave 1.29e-4 rad. Here is a search for scenes of that kind:

    PYTHONPATH=tests .venv/bin/python -m accuracy.square_waves --scenes 0:100

In the first place small errors are followed along all histories of a choice, and along square waves; where
the waves let errors grow much more the choice is made, and its FMU flown, with the choice's own square waves
and without them.
"""

import argparse
import json
import os
import sys
import tempfile
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import product
from pathlib import Path
from unittest import mock

import numpy as np
from numpy.typing import NDArray

from accuracy.adversary import Flights, judged, true_flights
from accuracy.attacks import Attack, Ranges
from accuracy.confirm import flown_each
from accuracy.growth import grown
from accuracy.nasty_scenes import Raw, chain, plain, spin_about
from fmu_build import BuildError, build_fmu
from fmu_build.accuracy import histories
from fmu_build.accuracy.flights import apart, body_of, followed
from fmu_build.accuracy.flights import judged as judged_rows
from fmu_build.flight.choices import FINEST, Choice
from fmu_build.flight.workshop import build_all, source_of, workshop
from supervessel import Scene, parse_scene, reference
from support.processes import begin_cache

Array = NDArray[np.float64]

HALVES = (2, 3, 4, 5, 6, 7, 8, 10, 12, 15)
"""Communication steps after which everything jumps to the other corner, and back."""

CORNERS = 4
"""Pairs of opposite corners, drawn at random, of each such wave."""

MOST = 1e6
"""Growth along other histories beyond which hardly anything that is asked can be had."""

FASTER = 10.0
"""How much more errors grow along square waves than along other histories in scenes that are flown: a choice
has a margin of 5, and shall be broken by a factor of 2."""


def waved_scene(seed: int) -> Raw:
    """Returns two vessels whose masses and torque vary widely, spinning about or near a principal axis."""
    draw = np.random.default_rng([seed, 17])
    horizon, steps = 100.0, int(draw.integers(40, 121))
    turn = float(10.0 ** draw.uniform(1.0, 2.0))
    raw: Raw = {"name": f"waved{seed}", "root": "R"} | chain(draw, 2)
    root, other = raw["vessels"]["R"], raw["vessels"]["V1"]
    other["mass"] = root["mass"] * float(10.0 ** draw.uniform(-1.5, 0.5))
    tilt = float(10.0 ** draw.uniform(-3.0, 0.0))
    raw["rotation"] = spin_about(draw, 0, turn / horizon, tilt)
    raw["rotation"]["mass_change"] = str(draw.choice(["rate", "momentum"]))
    moments, axes = np.linalg.eigh(reference.composite(parse_scene(plain(raw))).inertia)
    axis = axes[:, int(draw.integers(3))] + tilt * draw.normal(size=3)
    raw["rotation"]["angular_velocity"] = (turn / horizon * axis / np.linalg.norm(axis)).tolist()
    torque = float(np.mean(moments) * turn / horizon**2 * 10.0 ** draw.uniform(-3.0, 0.0))
    share = float(10.0 ** draw.uniform(-1.5, -0.1))
    ranges = {
        f"{name}.mass": [share * raw["vessels"][name]["mass"], raw["vessels"][name]["mass"]]
        for name in ("R", "V1")
    }
    raw["inputs"] = {"mass": ["R", "V1"], "torque": True, "range": {"torque": [-torque, torque], **ranges}}
    raw["accuracy"] = {"attitude": 1e-3, "horizon": horizon, "step": horizon / steps}
    return raw


def square_waves(scene: Scene, seed: int) -> list[Attack]:
    """Returns square waves of all inputs together."""
    ranges, draw = Ranges(scene), np.random.default_rng([seed, 19])
    found = []
    for half, i in product(HALVES, range(CORNERS)):
        here = np.round(draw.random(len(ranges.names)))
        ends = ranges.row(here), ranges.row(1.0 - here)
        found.append(
            Attack(
                f"all to and fro every {half} steps, corner {i}",
                lambda step, omega, ends=ends, half=half: ends[step // half % 2],
            )
        )
    return found


@contextmanager
def no_waves() -> Iterator[None]:
    """Has a choice fly no square waves, of all inputs or of what acts."""
    with mock.patch.multiple(histories, TOGETHER=(), WAVES=0, SHAKEN=0):
        yield


def growths(scene: Scene, seed: int) -> tuple[float, float]:
    """Returns how much errors grow along a choice's histories but square waves, and along square waves.

    Of rows drawn by the choice fewer are taken: it is to tell which scenes are worth a choice. Infinite where
    a history spins the body up beyond what sub-steps of a step can follow.
    """
    assert scene.accuracy is not None
    ranges = Ranges(scene)
    steps = round(scene.accuracy.horizon / scene.accuracy.step)
    few = {"DRAWN": 48, "CLIMBED": 30, "SPUN": 8}

    def body(row: Array, _docks: Array) -> tuple[Array, Array]:
        inertia = ranges.inertia(_ordered(row))
        return inertia, np.linalg.inv(inertia)

    numbers = sorted(range(len(ranges.names)), key=lambda i: bool(ranges.boolean[i]))

    def _ordered(row: Array) -> Array:
        whole = np.zeros(len(ranges.names))
        whole[numbers] = row
        return whole

    with mock.patch.multiple(histories, **few), no_waves(), np.errstate(all="ignore"):
        every = histories.histories(
            scene, scene.accuracy, lambda inputs: np.ones(len(inputs.rows), bool), body
        )
    courses = []
    for history in every.flown:
        at = np.searchsorted(history.inputs.rows, np.arange(steps), side="right") - 1
        courses.append([_ordered(row) for row in history.inputs.numbers[at]])
    count = len(courses)
    courses += [[wave.at(k, np.zeros(3)) for k in range(steps)] for wave in square_waves(scene, seed)]
    inertias = np.array([[ranges.inertia(row) for row in course] for course in courses])
    torques = np.array([[ranges.torque(row) for row in course] for course in courses])
    found = grown(scene, inertias, torques)
    return float(np.max(np.where(found[:count] > 0.0, found[:count], np.inf))), float(found[count:].max())


KNOWN = 4
"""Scene in which `dop853` at 1e-9 is off by some 1e-6 rad but for waves of five steps."""


def errors(scene: Scene, choice: Choice) -> dict[str, float]:
    """Returns the largest errors of the attitude [rad] of a choice in the histories of `[accuracy]`, by name.

    choice : with a tolerance; the truth is the same method at 1e-15
    """
    accuracy = scene.accuracy
    assert accuracy is not None
    exact = replace(choice, tolerance=FINEST)
    with workshop(trial=True) as shop:
        build_all(scene, [exact], shop, lambda _: None)
        body = body_of(scene, shop.built[source_of(exact)].model)
        every = histories.histories(
            scene, accuracy, lambda inputs: judged_rows(scene, shop, exact, inputs), body
        )
        one, other = (followed(scene, shop, every, way)[0] for way in (exact, choice))
    return dict(zip((history.name for history in every.flown), apart(other, one)[0].tolist(), strict=True))


def used(raw: Raw, seed: int, *, waves: bool) -> tuple[str, float, str]:
    """Returns what is chosen, the largest share of what is asked in square waves, and the wave of it.

    waves : whether the choice flies its own square waves
    The cache is a new one: other histories give other choices for one scene.
    """
    scene = parse_scene(raw)
    with tempfile.TemporaryDirectory(prefix="waves-") as folder, _cache(folder):
        place = Path(folder, f"{scene.name}.fmu")
        if waves:
            build_fmu(scene, place)
        else:
            with no_waves():
                build_fmu(scene, place)
        with zipfile.ZipFile(place) as archive:
            evidence = json.loads(archive.read("resources/accuracy.json"))
        flights: Flights = true_flights(scene, square_waves(scene, seed))
        states = np.array(flown_each(place, scene, flights.rows, ("error_bound",)))
    found = judged(scene, evidence, flights, states, flights.truth.transpose(1, 0, 2))
    shares = found["used"]
    name = max(shares, key=lambda one: float(shares[one]))
    choice = " ".join(str(value) for value in evidence["choice"].values())
    share = shares[name] - found["doubt"] / scene.accuracy.attitude if scene.accuracy else 0.0
    return f"{choice}, {evidence['grade']['name']}", float(share), name


@contextmanager
def _cache(folder: str) -> Iterator[None]:
    with mock.patch.dict(os.environ, {"SUPERVESSEL_CACHE": str(Path(folder, "cache"))}):
        Path(folder, "cache").mkdir(mode=0o700)
        begin_cache(Path(folder, "cache"))
        yield


def main(arguments: Sequence[str] | None = None) -> int:
    """Prints what comes of scenes by number."""
    parser = argparse.ArgumentParser(prog="accuracy.square_waves", description=__doc__)
    parser.add_argument("--scenes", default="0:100", help="A:B, numbers of scenes")
    parser.add_argument("--look", action="store_true", help="choose and fly nothing")
    given = parser.parse_args(arguments)
    low, _, high = given.scenes.partition(":")
    looked, worth, broken = 0, 0, []
    for seed in range(int(low), int(high)):
        raw = waved_scene(seed)
        other, waves = growths(parse_scene(raw), seed)
        looked += 1
        if not (waves >= FASTER * other and other < MOST):
            continue
        worth += 1
        print(
            f"scene {seed}: errors grow {other:.3g} times, along square waves {waves:.3g} times", flush=True
        )
        if given.look:
            continue
        try:
            results = {kind: used(raw, seed, waves=kind == "with") for kind in ("without", "with")}
        except BuildError as error:
            print(f"  refused: {error}", flush=True)
            continue
        for kind, (choice, share, name) in results.items():
            print(f'  {kind} its own waves: {choice}: {share:.3g} of what is asked, "{name}"', flush=True)
        if results["without"][1] > 2.0:
            broken.append((seed, results["with"][1]))
    print(
        f"{looked} scenes, errors grow {FASTER:g} times faster along square waves in {worth}; broken more "
        f"than twofold without the choice's own waves: {broken}"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
