"""The adversary itself: its truth, its attacks and its judgement against closed forms; then what it finds."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from accuracy import summary
from accuracy.adversary import examine, judged, known_to, recorded, true_flights
from accuracy.attacks import Attack, Ranges, attacks, growing, periods
from accuracy.nasty_scenes import NASTY, scene_of
from accuracy.square_waves import FASTER, KNOWN, errors, growths, used, waved_scene
from accuracy.truth import after_a_step
from fmu_build.accuracy.search import MARGIN
from fmu_build.flight.choices import BEST, Choice
from supervessel import parse_scene

HANDFUL = (33,)
"""Scenes that the fast test examines: a body under torque, 11 s of one processor."""

SHARE_OF_SCENES = 4
"""Of the scenes of the other tests of `make accuracy` one in so many is as many as are examined here."""


def product(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Returns the Hamilton product of two quaternions, scalar first."""
    vector = p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])
    return np.append(p[0] * q[0] - p[1:] @ q[1:], vector)


def turn(vector: np.ndarray) -> np.ndarray:
    """Returns the quaternion of a rotation vector [rad]."""
    angle = np.linalg.norm(vector)
    return np.append(np.cos(angle / 2), np.sin(angle / 2) * vector / angle)


def test_the_truth_is_that_of_symmetric_bodies() -> None:
    """A turn about the momentum in inertial axes after one about the axis of symmetry in body axes.

    DOP853 at 1e-13 leaves some 1e-12 over these 3 rad.
    """
    span, across, along = 2.0, np.array([2.0, 5.0]), np.array([3.0, 0.1])
    rates = np.array([[0.5, 0.3, 1.2], [-0.2, 0.4, -1.0]])
    J = np.array([np.diag([a, a, b]) for a, b in zip(across, along, strict=True)])
    start = np.tile([1.0, 0.0, 0.0, 0.0], (2, 1))
    found = after_a_step(np.hstack([start, rates]), span, J, np.zeros((2, 3)))
    for end, inertia, omega, a, b in zip(found, J, rates, across, along, strict=True):
        own = np.array([0.0, 0.0, omega[2] * (1.0 - b / a) * span])
        expected = product(turn(inertia @ omega / a * span), turn(own))
        assert abs(abs(end[:4] @ expected) - 1.0) < 1e-12
        assert np.isclose(end[6], omega[2], atol=1e-12)


def test_the_truth_of_a_torque_about_a_principal_axis_is_a_parabola() -> None:
    J, M = np.diag([2.0, 3.0, 4.0])[None], np.array([[0.0, 0.6, 0.0]])
    start = np.array([[1.0, 0.0, 0.0, 0.0, 0.0, 0.1, 0.0]])
    end = after_a_step(start, 3.0, J, M)[0]
    assert np.allclose(end[4:], [0.0, 0.1 + 0.2 * 3.0, 0.0], atol=1e-12)
    angle = 0.1 * 3.0 + 0.5 * 0.2 * 9.0
    assert np.allclose(end[:4], [np.cos(angle / 2), 0.0, np.sin(angle / 2), 0.0], atol=1e-12)


@pytest.mark.parametrize("number", range(2 * len(NASTY)))
def test_scenes_are_read_and_attacks_stay_in_their_ranges(number: int) -> None:
    kind, raw = scene_of(number)
    scene = parse_scene(raw)
    assert (kind == "ordinary") == bool(number % 2)
    ranges, found = Ranges(scene), list(attacks(scene, number))
    assert len({attack.name for attack in found}) == len(found)
    assert len(found) <= 12
    assert len(found) >= 6 or not ranges.names
    for attack in found:
        for step in range(10):
            row = attack.at(step, np.array([0.1, -0.2, 0.3]))
            assert np.all((ranges.low <= row) & (row <= ranges.high))
            assert set(row[ranges.boolean]) <= {0.0, 1.0}


def first_of(kind: str) -> tuple[int, dict[str, Any]]:
    number = 2 * list(NASTY).index(kind)
    return number, scene_of(number)[1]


def test_a_search_finds_where_in_its_range_a_mass_makes_the_axis_the_middle_one() -> None:
    number, raw = first_of("middle axis by mass")
    scene = parse_scene(raw)
    ranges = Ranges(scene)
    held = next(attack for attack in attacks(scene, number) if attack.name == "held, most growing")
    spin = np.array(scene.rotation.angular_velocity)
    ends = (growing(ranges, row, spin) for row in (ranges.low, ranges.high))
    assert max(ends) <= 0.0 < growing(ranges, held.at(0, spin), spin)


def test_waves_have_the_period_of_the_nutation() -> None:
    """Of a symmetric body: |A - T|/T times the spin."""
    raw = {
        "name": "top",
        "root": "R",
        "vessels": {"R": {"mass": 2.0, "pmi": [2.0, 2.0, 3.0]}},
        "inputs": {"torque": True, "range": {"torque": [-1.0, 1.0]}},
        "rotation": {"angular_velocity": [0.0, 0.0, 0.5]},
        "accuracy": {"attitude": 0.1, "horizon": 100.0, "step": 1.0},
    }
    scene = parse_scene(raw)
    ranges = Ranges(scene)
    nutation, turned = periods(ranges, ranges.start, np.array([0.0, 0.0, 0.5]), 100.0)
    assert np.isclose(nutation, 2.0 * np.pi / (0.5 * 0.5))
    assert np.isclose(turned, 2.0 * np.pi / 0.5)
    wave = next(one for one in attacks(scene, 0) if one.name == "torque with the nutation")
    rows = np.array([wave.at(step, np.zeros(3))[0] for step in range(100)])
    lengths = np.diff(np.flatnonzero(np.diff(rows)))
    assert set(lengths) <= {12, 13}
    assert np.isclose(lengths.mean(), np.pi / 0.25, atol=0.5)


STEADY = {
    "name": "steady",
    "root": "R",
    "vessels": {"R": {"mass": 1.0, "pmi": [1.0, 1.5, 2.0]}},
    "rotation": {"angular_velocity": [0.0, 0.0, 0.1]},
    "accuracy": {"attitude": 1e-3, "horizon": 10.0, "step": 1.0},
}


def test_a_claim_a_bound_and_an_output_that_are_broken_are_named_and_others_are_not() -> None:
    """Against an FMU that lags by 2e-3 rad at its end in the second of two flights."""
    scene = parse_scene(STEADY)
    still = [Attack(name, lambda step, omega: np.zeros(0)) for name in ("one", "other")]
    flights = true_flights(scene, still)
    assert np.all(known_to(scene, flights) < 1e-9)
    truth = flights.truth.transpose(1, 0, 2)
    late = np.concatenate([truth, np.full((2, 10, 1), 1e-3)], axis=2)
    off = 2e-3 * np.array([0.0, 1.0])[:, None] * np.linspace(0.1, 1.0, 10)
    for i in range(2):
        for k in range(10):
            late[i, k, :4] = product(truth[i, k, :4], turn(np.array([0.0, 0.0, off[i, k] + 1e-15])))
    grade = {"name": "proven", "attitude": 1.5e-3, "law": 1.2e-3, "why": ""}
    evidence = {"asked": {"attitude": 1e-3, "rate": None}, "grade": grade, "choice": {"law": "none"}}
    found = judged(scene, evidence, flights, late, truth)
    assert found["broken"] == found["bound_broken"] == ["other"]
    assert found["law_broken"] == []  # a steady spin is exact without any law
    assert np.isclose(found["used"]["other"], 2.0, rtol=1e-6)
    assert found["used"]["one"] < 1e-6
    assert found["output"]["broken"] == ["other"]
    assert found["output"]["beyond"] == 0
    wide = evidence | {"asked": {"attitude": 0.1, "rate": None}, "grade": grade | {"attitude": 3e-3}}
    kept = judged(scene, wide | {"choice": {"law": "tensor"}}, flights, late, truth)
    assert (kept["broken"], kept["bound_broken"], kept["law_broken"]) == ([], [], [])


def test_a_motion_that_is_not_known_breaks_nothing() -> None:
    """What is beyond a bound by less than the doubt about the truth is not counted."""
    flights = true_flights(parse_scene(STEADY), [Attack("one", lambda step, omega: np.zeros(0))])
    truth = flights.truth.transpose(1, 0, 2)
    states = np.concatenate([truth, np.full((1, 10, 1), np.nan)], axis=2)
    grade = {"name": "proven", "attitude": 1e-300, "law": None, "why": ""}
    evidence = {"asked": {"attitude": 1e-3, "rate": None}, "grade": grade, "choice": {"law": "tensor"}}
    found = judged(parse_scene(STEADY), evidence, flights, states, truth)
    assert found["bound_broken"] == []
    assert found["output"] is None


def test_the_limit_of_a_share_none_of_which_was_seen() -> None:
    """1 - 0.05^(1/n): 599 of nothing broken say less than 1 in 200."""
    assert np.isclose(summary.upper(0, 598), 1.0 - 0.05 ** (1.0 / 598.0))
    assert summary.upper(0, 599) < 1.0 / 200.0 < summary.upper(0, 596)
    assert summary.upper(3, 3) == 1.0


def test_claims_of_random_scenes_hold(tmp_path: Path) -> None:
    file = tmp_path / "found.jsonl"
    found = examine(HANDFUL, file)
    print(summary.report(found))
    assert [one["number"] for one in found] == list(HANDFUL)
    assert summary.failures(found) == []
    assert all(one["refused"] is None and not one["broken"] for one in found)
    before = file.read_bytes()
    assert examine(HANDFUL, file) == found  # nothing is examined twice
    assert file.read_bytes() == before
    assert recorded(file) == [json.loads(json.dumps(one)) for one in found]


@pytest.mark.accuracy
def test_claims_of_many_nasty_scenes_hold(
    scene_count: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A part of what `python -m accuracy.adversary` examines: as asserted there, so here."""
    with capsys.disabled():
        print()
        found = examine(range(max(4, scene_count // SHARE_OF_SCENES)), tmp_path / "found.jsonl")
        print(summary.report(found))
    assert summary.failures(found) == []
    built = [one for one in found if one["refused"] is None]
    flown = [one for one in built if summary.grade(one) == summary.FLOWN]
    assert sum(bool(one["broken"]) for one in flown) <= 1 + len(flown) * summary.BROKEN_FLOWN
    slow = summary.slow_scenes(built)
    assert len(slow) >= 0.4 * len(built)
    proven = [one for one in slow if summary.grade(one) != summary.FLOWN]
    assert len(proven) >= summary.PROVEN_OF_SLOW * len(slow) - 1


def asked_in_the_known_case() -> dict[str, Any]:
    raw = waved_scene(KNOWN)
    raw["accuracy"]["attitude"] = 8.3e-6
    return raw


def test_square_waves_of_five_steps_show_what_no_other_history_of_a_choice_does() -> None:
    """The known case: `dop853` at 1e-9 keeps 8.3e-6 rad with the margin of 5, but in waves of all inputs."""
    scene = parse_scene(asked_in_the_known_case())
    assert scene.accuracy is not None
    found = errors(scene, Choice(BEST, "dop853", None, 1e-9))
    waves = {name: error for name, error in found.items() if name.startswith("all to and fro")}
    rest = {name: error for name, error in found.items() if "to and fro" not in name}
    print(max(rest.items(), key=lambda one: one[1]), waves)
    assert MARGIN * max(rest.values()) <= scene.accuracy.attitude
    assert waves["all to and fro every 5 steps"] > 2.0 * scene.accuracy.attitude


def test_errors_grow_along_square_waves_as_along_no_other_history() -> None:
    """Where masses keep the momentum."""
    other, waves = growths(parse_scene(waved_scene(1)), 1)
    assert waves > FASTER * other


@pytest.mark.accuracy
def test_a_choice_without_square_waves_is_broken_by_them(capsys: pytest.CaptureFixture[str]) -> None:
    """The known case, chosen with the choice's own square waves and without."""
    results = {waves: used(asked_in_the_known_case(), KNOWN, waves=waves) for waves in (False, True)}
    with capsys.disabled():
        print(f"\nwithout square waves {results[False]}; with them {results[True]}")
    assert results[True][1] <= 1.0
