"""A small trade: references against 25 digits, errors apart, order, front, and what is kept."""

import json
from collections.abc import Iterator
from functools import partial
from importlib import import_module
from itertools import pairwise
from math import isfinite
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fmu_build.compile.compiler import TRIAL_FLAGS
from fmu_build.flight.choices import BEST, Choice, Model, label
from fmu_build.flight.experiment import course_of
from fmu_build.flight.flying import fly_all
from fmu_build.flight.workshop import workshop
from fmu_build.trade import TradeError, drift_table, plot, study, table
from fmu_build.trade.ranking import SAME_TIME, ranks
from fmu_build.trade.study import errors
from supervessel import parse_scene, reference
from support import U, variant
from support.fmus import session_flags
from support.marks import some_at_once
from support.processes import kept_in
from support.series import flight, mp, norm

STUDY = import_module("fmu_build.trade.study")

BODY: dict[str, Any] = {
    "name": "traded",
    "root": "B",
    "vessels": {"B": {"mass": 2.0, "inertia": [[1.0, 0.02, 0.0], [0.02, 2.0, 0.03], [0.0, 0.03, 2.9]]}},
    "inputs": {"mass": ["B"], "torque": True},
    "rotation": {"angular_velocity": [0.3, 0.7, 0.5]},
    "experiment": {
        "duration": 8.0,
        "step": 0.5,
        "inputs": {
            "B.mass": [[2.0, 2.0], [6.0, 1.5]],
            "torque[1]": [[0.0, 0.0], [4.0, 0.02], [4.0, -0.01]],
        },
    },
    "outputs": {"names": ["pmi"]},
}
"""A body that loses mass while torque grows, then jumps; it turns by about 7 rad."""

STEADY = variant(
    BODY, {"inputs.mass": [], "experiment.inputs": {"torque[1]": BODY["experiment"]["inputs"]["torque[1]"]}}
)


TUMBLING = variant(
    BODY,
    {
        "vessels.B": {"mass": 2.0, "pmi": [1.0, 2.0, 2.9]},
        "inputs": {"pmi": ["B"]},
        "rotation": {"angular_velocity": [1e-6, 1.0, 0.0]},
        "experiment": {
            "duration": 90.0,
            "step": 0.5,
            "inputs": {"B.pmi[2]": [[0.0, 2.0], [10.0, 2.0], [11.0, 2.8]]},
        },
    },
)
"""A spin about the middle axis; with the moments left at their start it turns over again and again."""


@pytest.fixture(scope="module", autouse=True)
def quick_libraries() -> Iterator[None]:
    """Has a trade's libraries compiled as those of other tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(STUDY, "workshop", partial(workshop, trial=session_flags() == TRIAL_FLAGS))
        yield


@pytest.fixture(scope="module")
def tumbling() -> dict[str, Any]:
    """The quick trade of the body that tumbles."""
    return study(parse_scene(TUMBLING), quick=True)


@pytest.fixture(scope="module")
def trade() -> dict[str, Any]:
    """The quick trade of the body with steady mass."""
    return study(parse_scene(STEADY), quick=True)


@pytest.fixture(scope="module")
def drawn(trade) -> dict[str, bytes]:
    """The plot of that trade."""
    return plot(trade)


def inertia_and_torque() -> list[tuple[np.ndarray, np.ndarray]]:
    """The tensor and the torque of each step, straight from what BODY says."""
    J = np.array(BODY["vessels"]["B"]["inertia"])
    steps = []
    for time in 0.5 * np.arange(16):
        mass = np.interp(time, [2.0, 6.0], [2.0, 1.5])
        torque = 0.005 * time if time < 4.0 else -0.01
        steps.append((J * (mass / 2.0), np.array([torque, 0.0, 0.0])))
    return steps


@pytest.mark.parametrize("propagator", ["taylor", "dop853"])
def test_references_are_right_to_rounding(propagator, shop):
    """Tensors and torques of 16 steps are each rounded, and so are the steps, of 0.5 rad: 16 (u + u)."""
    scene = parse_scene(BODY)
    choice = Choice(BEST, propagator, None, 1e-15)
    flown = fly_all(scene, [choice], shop)[choice]
    state = [mp.mpf(x) for x in (1.0, 0.0, 0.0, 0.0, 0.3, 0.7, 0.5)]
    truth = []
    for J, torque in inertia_and_torque():
        state = flight("tensor", J, state, torque, 0.5)
        truth.append(state)
    assert course_of(scene).sampled.tolist() == list(range(1, 17))
    off = [
        float(norm([mp.mpf(float(a)) - b for a, b in zip(found, exact, strict=True)]))
        for found, exact in zip(flown.samples, truth, strict=True)
    ]
    assert max(off) <= 32.0 * U


def test_what_a_law_leaves_out_is_the_distance_of_the_two_motions(trade):
    """Against another integration of other equations: reference.angular_acceleration, to 1e-11."""

    def fly(law):
        x, samples = np.array([1.0, 0.0, 0.0, 0.0, 0.3, 0.7, 0.5]), []
        for _, torque in inertia_and_torque():

            def ode(_: float, x: np.ndarray, torque: np.ndarray = torque) -> np.ndarray:
                J = np.array(BODY["vessels"]["B"]["inertia"])
                rate = reference.angular_acceleration(law, J, x[4:], torque)
                return np.concatenate([reference.attitude_dot(x[:4], x[4:]), rate])

            x = solve_ivp(ode, (0.0, 0.5), x, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
            samples.append(x)
        return np.array(samples)

    tensor, principal = fly("tensor"), fly("principal")
    turn = 2.0 * np.arccos(np.abs(np.sum(tensor[:, :4] * principal[:, :4], axis=1)))
    apart = np.linalg.norm(tensor[:, 4:] - principal[:, 4:], axis=1)
    own, best = trade["models"]
    assert (own["law"], best["law"]) == ("principal", "tensor")
    assert own["attitude"][-1] == pytest.approx(turn.max(), rel=1e-9)
    assert own["rate"][-1] == pytest.approx(apart.max(), rel=1e-9)
    assert best["attitude"] == best["rate"] == [0.0, 0.0, 0.0]
    assert trade["doubt"]["attitude"][-1] <= 32.0 * U


def test_integration_errors_are_apart_from_those_of_the_model(trade):
    """Each row's whole error differs from its model's by no more than its own integration adds."""
    left_out = {label(model): model["attitude"][-1] for model in trade["models"]}
    for row in trade["choices"]:
        assert abs(row["attitude"] - left_out[label(row)]) <= row["integration_attitude"] + 8.0 * U, row


def test_the_integration_error_of_rk4_falls_with_the_fourth_power_of_its_steps(trade):
    for law in ("principal", "tensor"):
        rows = [r for r in trade["choices"] if (r["law"], r["propagator"]) == (law, "rk4")]
        assert [r["settings"] for r in rows] == [[0.2], [0.05], [0.01]]
        for coarse, fine in pairwise(rows):
            order = np.log(coarse["integration_attitude"] / fine["integration_attitude"]) / np.log(
                fine["sub_steps"] / coarse["sub_steps"]
            )
            assert 3.7 < order < 4.3, (law, coarse, fine)


def test_tolerances_are_kept_step_by_step(trade):
    """16 steps may add their tolerance each; any may be missed tenfold."""
    rows = [r for r in trade["choices"] if r["propagator"] in ("dop853", "taylor", "auto", "split")]
    assert {r["propagator"] for r in rows} == {"dop853", "taylor", "auto", "split"}
    for row in rows:
        tightest = min(row["settings"])
        assert row["integration_attitude"] <= 160.0 * tightest + 32.0 * U, row


@pytest.mark.parametrize("law", ["principal", "tensor"])
@pytest.mark.thorough
def test_an_unstable_motion_without_torque_is_found_in_closed_form(tumbling, law, shop):
    """Beside 60 digits: what steps leave grows with each turn-over, what starts once is off by 1e-12."""
    [model] = [m for m in tumbling["models"] if (m["law"], m["frozen"]) == (law, "mass")] or [None]
    if model is None:
        [first] = [m for m in tumbling["models"] if m["frozen"] == "mass"]
        assert f"{law}, mass frozen" in first["same"]
        return
    scene = parse_scene(TUMBLING)
    rows = [r for r in tumbling["choices"] if (r["law"], r["frozen"]) == (law, "mass")]
    state = [mp.mpf(x) for x in (1.0, 0.0, 0.0, 0.0, 1e-6, 1.0, 0.0)]
    truth = []
    for _ in range(180):
        state = flight("tensor", np.diag([2.0, 4.0, 5.8]), state, [0.0] * 3, 0.5, digits=60)
        truth.append([float(x) for x in state])
    course, taylor = course_of(scene), Choice(Model(law, "mass"), "taylor", None, 1e-15)
    samples = fly_all(scene, [taylor], shop)[taylor].samples
    sampled = np.array(truth)[course.sampled - 1]
    stepped = float(errors(samples, sampled, course).attitude[-1])
    assert stepped > 1e-9
    assert model["way"] == f"{law}, mass frozen, exact"
    assert model["doubt"]["attitude"][-1] == pytest.approx(stepped, rel=1e-2)
    exact = Choice(Model(law, "mass"), "exact")
    closed = errors(fly_all(scene, [exact], shop)[exact].samples, sampled, course)
    assert float(closed.attitude[-1]) <= 1e-11
    for row in rows:
        if row["propagator"] in ("exact", "auto"):
            assert row["integration_attitude"] <= 1e-11
    [line] = [x for x in drift_table(tumbling).splitlines() if x.startswith(f"| {model['law']}, mass frozen")]
    assert "`exact`" in line or "`auto`" in line
    assert f"| {stepped:.1e} |" in line
    assert f"< {stepped:.0e}" in table(tumbling)


@pytest.mark.thorough
def test_errors_of_integration_below_a_models_own_doubt_are_not_told(tumbling):
    text = table(tumbling).split("| model | propagator |")[1]
    for model in tumbling["models"]:
        doubt = model["doubt"]["attitude"][-1]
        own = [line for line in text.splitlines() if line.startswith(f"| {label(model)} |")]
        assert own
        for line in own:
            told = line.split("|")[4].strip()
            assert told.startswith("<") or float(told) >= 0.95 * doubt


def test_times_that_are_not_told_apart_are_ranked_by_operations():
    def row(time: float, operations: float) -> dict[str, float]:
        return {"rk4_steps_per_step": time, "operations": operations}

    rows = [
        row(1.05, 100.0),
        row(1.0, 200.0),
        row(1.04, 300.0),
        row(0.999 * SAME_TIME**2, 50.0),
        row(0.5, 900.0),
    ]
    order = sorted(range(5), key=ranks(rows).__getitem__)
    assert order == [4, 0, 1, 2, 3]
    assert ranks([]) == []


def test_operations_are_those_that_an_accuracy_is_chosen_by(trade):
    """The same equations, so a finer step of rk4 costs as much more as it has sub-steps."""
    for law in ("principal", "tensor"):
        rows = [r for r in trade["choices"] if (r["law"], r["propagator"]) == (law, "rk4")]
        assert len({round(r["operations"] / r["sub_steps"], 9) for r in rows}) == 1
    of = {r["law"]: r["operations"] for r in trade["choices"] if r["propagator"] == "rk4"}
    assert of["principal"] < of["tensor"]


def test_the_front_is_what_nothing_beats(trade):
    doubt = trade["doubt"]["attitude"][-1]
    points = [
        (max(r["attitude"], doubt), rank)
        for r, rank in zip(trade["choices"], ranks(trade["choices"]), strict=True)
    ]
    for row, (error, cost) in zip(trade["choices"], points, strict=True):
        beaten = any(e <= error and c <= cost and (e < error or c < cost) for e, c in points)
        assert row["pareto"] is not beaten
    assert {label(row) for row in trade["choices"] if row["pareto"]} >= {"tensor"}


def test_a_trade_says_what_its_keys_are(trade):
    parts = [trade, *trade["models"], *trade["choices"], {"choice": "", "reason": ""}]
    assert set().union(*parts) - {"about"} == set(trade["about"])
    kinds = {row["propagator"]: row["setting"] for row in trade["choices"]}
    tolerances = dict.fromkeys(("auto", "dop853", "split", "taylor"), "tolerance")
    assert kinds == {"rk4": "max_angle_step"} | tolerances


def test_costs_fit_together(trade):
    for row in trade["choices"]:
        assert row["us_per_second"] == pytest.approx(1e-3 * row["ns_per_step"] / 0.5)
        assert row["sub_steps"] >= trade["steps"] == 16
        assert row["bytes"] > 20_000
        assert isfinite(row["rk4_steps_per_step"])


def test_the_same_again_is_what_was_kept(trade):
    assert study(parse_scene(STEADY), quick=True) == trade  # timings and all
    assert json.loads(json.dumps(trade)) == trade


def test_another_start_is_flown_anew(trade, cache, shop):
    """The kept results are known by all of the scene."""
    scene = parse_scene(variant(STEADY, {"rotation.angular_velocity": [0.3, 0.7, 0.4]}))
    choice = Choice(BEST, "taylor", None, 1e-15)
    before = set((kept_in(cache) / "trade").iterdir())
    flown = fly_all(scene, [choice], shop)[choice]
    assert len(set((kept_in(cache) / "trade").iterdir()) - before) == 1
    assert flown.samples[0, 6] == pytest.approx(0.4, abs=0.1)


def test_a_propagator_that_knows_no_torque_is_told_as_refused(shop):
    choice = Choice(BEST, "exact")
    [flown] = fly_all(parse_scene(STEADY), [choice], shop).values()
    assert flown.refused is not None
    assert flown.refused.startswith("at 0.5 s: ")  # from where on the torque acts
    assert "torque = (0.0025, 0, 0)" in flown.refused


def test_an_experiment_that_the_scene_cannot_run_is_refused_with_the_fmus_words():
    raw = {
        "name": "grown",
        "root": "B",
        "vessels": {"B": {"mass": 1.0, "pmi": [1.0, 1.0, 1.0]}},
        "inputs": {"pmi": ["B"]},
        "experiment": {"duration": 4.0, "step": 1.0, "inputs": {"B.pmi[3]": [[0.0, 1.0], [4.0, 5.0]]}},
    }
    words = r"experiment: the scene cannot run it: at 2 s: .*B\.pmi = \(1, 1, 3\) m2: 3 exceeds 1 \+ 1 by 1"
    with pytest.raises(TradeError, match=words):
        study(parse_scene(raw), quick=True)


def test_without_an_experiment_there_is_no_trade():
    scene = parse_scene({key: value for key, value in STEADY.items() if key != "experiment"})
    with pytest.raises(TradeError, match="experiment: missing; a trade needs"):
        study(scene)


def test_tables_and_plots_show_every_choice(trade, drawn):
    text = table(trade)
    assert text.count("| tensor |") == 1 + sum(row["law"] == "tensor" for row in trade["choices"])
    assert drawn["png"].startswith(b"\x89PNG")
    assert drawn["svg"].decode().count("<use ") >= len(trade["choices"])
    assert plot(trade) == drawn


@pytest.mark.parametrize(
    "name",
    some_at_once(
        ["matplotlibrc", "matplotlib.py", "sitecustomize.py", "MPLBACKEND", "MATPLOTLIBRC"],
        "matplotlib.py",
    ),
)
def test_a_plot_is_drawn_whatever_lies_in_the_working_folder_and_the_surroundings(
    trade, drawn, tmp_path, monkeypatch, name
):
    """And nothing is left in the user's home."""
    monkeypatch.chdir(tmp_path)
    home = tmp_path / "home"
    home.mkdir()
    monkeypatch.setenv("HOME", str(home))
    if name.isupper():
        monkeypatch.setenv(name, str(tmp_path / "missing"))
    else:
        (tmp_path / name).write_text("axes.facecolor: red\nbackend: none\nraise SystemExit('planted')\n")
    assert plot(trade) == drawn
    assert list(home.iterdir()) == []


def test_a_plot_that_cannot_be_drawn_is_told_and_ends(trade):
    with pytest.raises(TradeError, match=r"^matplotlib ended with status 1: .*Unknown symbol: \\wrong"):
        plot(trade | {"scene": r"$\wrong$"})
