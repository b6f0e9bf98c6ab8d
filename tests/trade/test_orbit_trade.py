"""A trade along an orbit: what leaving gravity's gradient out costs, beside the laws."""

from functools import partial
from importlib import import_module

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fmu_build.flight.choices import BEST, Choice, Model
from fmu_build.flight.workshop import workshop
from fmu_build.trade import drift_table, study
from fmu_build.trade.plotting import figure
from supervessel import parse_scene, reference
from support import variant
from support.orbits import EARTH, ORBIT, orbiting
from trade.test_trade import BODY

STUDY = import_module("fmu_build.trade.study")
WITHOUT = Model("tensor", "gravity")

RATE = [2e-4, 1.1e-3, -3e-4]
RAW = variant(
    orbiting({"experiment.duration": 600.0, "experiment.step": 20.0}, base=BODY),
    {"inputs": {"gravity": True}, "rotation.angular_velocity": RATE},
)
"""A body that turns with its orbit, roughly; nothing but gravity acts."""


@pytest.fixture(scope="module")
def trade():
    """The trade of two models by what makes the references, one tolerance of taylor, and rk4."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(STUDY, "workshop", partial(workshop, trial=True))
        patch.setattr(STUDY, "models", lambda scene, quick: [WITHOUT, BEST])
        patch.setattr(
            STUDY, "by_tolerance", lambda scene, model, quick: [Choice(model, "taylor", None, 1e-9)]
        )
        return study(parse_scene(RAW), quick=True)


def by_scipy(*, gravity: bool) -> np.ndarray:
    """Returns attitude and rate, (30, 7), at the ends of the steps; body and centre as one motion."""
    J = np.array(BODY["vessels"]["B"]["inertia"])

    def ode(_: float, x: np.ndarray) -> np.ndarray:
        position, velocity = x[7:10], x[10:]
        torque = reference.gravity_torque(J, x[:4], position, EARTH) if gravity else np.zeros(3)
        fall = -EARTH / np.linalg.norm(position) ** 3 * position
        rate = reference.angular_acceleration("tensor", J, x[4:7], torque)
        return np.concatenate([reference.attitude_dot(x[:4], x[4:7]), rate, velocity, fall])

    start = [1.0, 0.0, 0.0, 0.0, *RATE, *ORBIT["position"], *ORBIT["velocity"]]
    times = 20.0 * np.arange(1, 31)
    scale = [1.0] * 4 + [1e-3] * 3 + [7e6] * 3 + [7e3] * 3
    found = solve_ivp(ode, (0.0, 600.0), start, "DOP853", times, rtol=1e-13, atol=1e-14 * np.array(scale))
    return found.y[:7].T


def test_the_gradient_left_out_is_the_distance_of_the_two_motions(trade):
    with_it, without = by_scipy(gravity=True), by_scipy(gravity=False)
    turn = 2.0 * np.arccos(np.abs(np.sum(with_it[:, :4] * without[:, :4], axis=1)))
    apart = np.linalg.norm(with_it[:, 4:] - without[:, 4:], axis=1)
    left, best = trade["models"]
    assert (left["law"], left["frozen"]) == ("tensor", "gravity")
    assert left["attitude"][-1] == pytest.approx(turn.max(), rel=1e-6)
    assert left["rate"][-1] == pytest.approx(apart.max(), rel=1e-6)
    assert turn.max() > 1e-3
    assert best["attitude"] == [0.0, 0.0, 0.0]


def test_without_the_gradient_the_motion_is_free(trade):
    assert [model["way"].split()[-2:] for model in trade["models"]] == [
        ["gradient,", "exact"],
        ["taylor", "1e-15"],
    ]


def test_it_is_named_in_table_and_plot(trade):
    assert "| tensor, no gradient |" in drift_table(trade)
    labels = [line["options"].get("label") for line in figure(trade)["halves"][0]["lines"]]
    assert {"tensor, no gradient", "tensor"} <= {*labels}
    assert trade["experiment"]["orbit"] == {key: list(value) for key, value in ORBIT.items()}
