"""What a choice rests on: a law that leaves terms out is chosen only where it is proven."""

from contextlib import suppress
from typing import Any

import numpy as np
import pytest

from fmu_build.accuracy import said
from fmu_build.accuracy.flights import body_of
from fmu_build.accuracy.grades import FLOWN, GRADES, PROVEN, law_is_off
from fmu_build.accuracy.histories import Histories, histories
from fmu_build.flight.choices import Choice, Model
from supervessel import choose, parse_scene
from supervessel.equations import equations
from supervessel.problems import AccuracyError
from supervessel.scene.schema import without_accuracy

CENTRE = {"position": [0.0, 0.0, 0.0], "direction": [1.0, 0.0, 0.0], "alignment": [0.0, 1.0, 0.0]}
BACK = CENTRE | {"direction": [-1.0, 0.0, 0.0]}
ROOT_MOMENTS = [150.0, 200.0, 149.0]
ROD = [100.0, 0.0, 100.0]


def spinning(vessels: dict[str, Any], docks: list[Any], inputs: dict[str, Any]) -> dict[str, Any]:
    """Returns a scene whose spin axis is the middle one in a small part of its ranges only."""
    return {
        "name": "middle",
        "root": "R",
        "vessels": vessels,
        "docks": docks,
        "inputs": inputs,
        "rotation": {"angular_velocity": [2e-6, 2.0, 0.0]},
        "accuracy": {"attitude": 0.01, "horizon": 3000.0, "step": 1.0},
    }


def by_mass() -> dict[str, Any]:
    """(a) The middle axis between 500 and 510 kg of a tank of 0 to 1000 kg: off by 1.72 rad at 505 kg."""
    vessels = {
        "R": {"mass": 1000.0, "pmi": ROOT_MOMENTS, "ports": {"a": CENTRE}},
        "T": {"mass": 100.0, "pmi": ROD, "ports": {"a": BACK}},
    }
    return spinning(vessels, [{"ports": ["R.a", "T.a"]}], {"mass": ["T"], "range": {"T.mass": [0.0, 1000.0]}})


def by_position() -> dict[str, Any]:
    """(b) The same by the place of a port, 0 to 20 m from the centre: off by 1.72 rad at 10.05 m."""
    along = CENTRE | {"direction": [0.0, 1.0, 0.0], "alignment": [0.0, 0.0, 1.0]}
    vessels = {
        "R": {"mass": 1000.0, "pmi": ROOT_MOMENTS, "ports": {"a": along}},
        "T": {"mass": 1000.0, "pmi": [0.0, 0.0, 0.0], "ports": {"a": BACK}},
    }
    ranges = {
        "R.a.position[1]": [0.0, 0.0],
        "R.a.position[2]": [0.0, 20.0],
        "R.a.position[3]": [0.0, 0.0],
        "R.a.direction[1]": [0.0, 0.0],
        "R.a.direction[2]": [1.0, 1.0],
        "R.a.direction[3]": [0.0, 0.0],
        "R.a.alignment[1]": [0.0, 0.0],
        "R.a.alignment[2]": [0.0, 0.0],
        "R.a.alignment[3]": [1.0, 1.0],
    }
    return spinning(vessels, [{"ports": ["R.a", "T.a"]}], {"pose": ["R.a"], "range": ranges})


def by_docks() -> dict[str, Any]:
    """(c) The same by one of 32 combinations of five docks: tanks of 33.67 kg times 1, 2, 4, 8."""
    names = [f"T{i}" for i in range(5)]
    root: dict[str, Any] = {"mass": 1000.0, "pmi": ROOT_MOMENTS, "ports": dict.fromkeys(names, CENTRE)}
    vessels: dict[str, Any] = {"R": root} | {
        name: {"mass": 505.0 / 15.0 * 2.0**i, "pmi": ROD, "ports": {"a": BACK}}
        for i, name in enumerate(names)
    }
    docks = [{"ports": [f"R.{name}", f"{name}.a"], "name": f"to{name}", "docked": False} for name in names]
    ranges = {f"to{name}.{key}": [0.0, 0.0] for name in names for key in ("velocity", "rate")}
    return spinning(vessels, docks, {"docked": [f"to{name}" for name in names], "range": ranges})


DOCKS = tuple(f"toT{i}.docked" for i in range(5))


@pytest.mark.parametrize("case", [by_mass, by_position, by_docks])
def test_a_law_that_fails_in_a_small_part_of_the_ranges_is_not_proven(case: Any) -> None:
    scene = parse_scene(case())
    accuracy = scene.accuracy
    assert accuracy is not None
    for law in ("none", "decoupled", "principal"):
        assert law_is_off(scene, accuracy, Choice(Model(law), "rk4", 0.01)).startswith("not proven: growth")


@pytest.mark.parametrize(
    ("case", "moved"),
    [
        pytest.param(by_mass, ("T.mass",), marks=pytest.mark.accuracy),
        pytest.param(by_position, ("R.a.position", ""), marks=pytest.mark.accuracy),
        pytest.param(by_docks, DOCKS, marks=pytest.mark.accuracy),
    ],
)
def test_where_no_other_law_is_proven_the_whole_one_is_chosen_or_none(case: Any, moved: Any) -> None:
    with suppress(AccuracyError):  # there may be no law that will do
        chosen, evidence = choose(parse_scene(case()))
        print(said(evidence))
        assert chosen.rotation.law == "tensor"
        assert evidence["grade"]["name"] == FLOWN
        assert evidence["grade"]["narrow"] in moved
        name = "docks 11110" if case is by_docks else "held where disturbances grow fastest"
        assert name in evidence["histories"]


def asked(attitude: float) -> dict[str, Any]:
    """Returns a slow station with a tank that empties, and little torque."""
    vessels = {
        "R": {"mass": 1000.0, "pmi": ROOT_MOMENTS, "ports": {"a": CENTRE | {"position": [3.0, 1.0, 0.0]}}},
        "T": {"mass": 100.0, "pmi": ROD, "ports": {"a": BACK}},
    }
    inputs = {"mass": ["T"], "torque": True, "range": {"T.mass": [50.0, 100.0], "torque": [-1e-2, 1e-2]}}
    return {
        "name": "slow",
        "root": "R",
        "vessels": vessels,
        "docks": [{"ports": ["R.a", "T.a"]}],
        "inputs": inputs,
        "rotation": {"angular_velocity": [0.0, 0.001, 0.0]},
        "accuracy": {"attitude": attitude, "horizon": 60.0, "step": 1.0},
    }


@pytest.mark.accuracy
def test_slow_flight_is_proven_and_says_so() -> None:
    """A cheap law where little is asked, the full one where more is; each bounded within what is asked."""
    cheap, exact = (choose(parse_scene(asked(attitude)))[1] for attitude in (0.1, 1e-8))
    assert (cheap["choice"]["law"], exact["choice"]["law"]) == ("none", "tensor")
    for evidence, attitude in ((cheap, 0.1), (exact, 1e-8)):
        grade = evidence["grade"]
        assert grade["name"] == PROVEN
        assert evidence["attitude"] <= grade["attitude"] <= attitude
        assert f"proven within {grade['attitude']:.2g} rad" in said(evidence)
        assert evidence["claim"].endswith(GRADES[PROVEN])


def flown_names(raw: dict[str, Any]) -> Histories:
    scene = parse_scene(raw)
    assert scene.accuracy is not None
    built = equations(without_accuracy(scene))
    return histories(
        scene, scene.accuracy, lambda inputs: np.ones(len(inputs.rows), bool), body_of(scene, built)
    )


def test_flights_hold_the_row_that_grows_fastest() -> None:
    """In case (a) that is inside the one part in a hundred of the range that is unstable."""
    every = flown_names(by_mass())
    held = next(h for h in every.flown if h.name == "held where disturbances grow fastest")
    assert 500.0 < held.inputs.numbers[0, 0] < 510.0
    assert np.isclose(held.inputs.numbers[0, 0], 505.0, atol=0.5)


def test_masses_and_torques_jump_together_every_three_to_two_hundred_steps() -> None:
    raw = asked(0.1)
    raw["accuracy"]["horizon"] = 1000.0
    every = flown_names(raw)
    for half in (3, 5, 12, 50, 200):
        inputs = next(h.inputs for h in every.flown if h.name == f"all to and fro every {half} steps")
        assert set(np.diff(inputs.rows)) == {half}
        assert np.all(np.diff(inputs.numbers, axis=0) != 0.0)  # each input at each jump
