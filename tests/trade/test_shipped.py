"""The shipped trade of the ISS with a DeltaGlider: the page's table, and figures had another way."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fmu_build.flight.choices import label
from fmu_build.trade import drift_table
from supervessel import load_scene, reference
from support.pages import text

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def shipped():
    return json.loads((ROOT / "examples" / "iss_dg_trade.json").read_text())


def test_the_pages_table_is_that_of_the_shipped_figures(shipped):
    assert f"\n{drift_table(shipped)}\n" in text("fmu_build/docs/accuracy.md")


def test_the_shipped_figures_are_of_the_scene_as_it_is(shipped):
    scene = load_scene(ROOT / "examples" / "iss_dg.toml")
    assert scene.experiment is not None
    assert shipped["experiment"] == scene.experiment.model_dump(mode="json", exclude_none=True) | {
        "duration": 6000.0
    }
    rk4 = [row for row in shipped["choices"] if row["propagator"] == "rk4"]
    assert all(len(row["settings"]) == 8 and row["sub_steps"] == 60000 for row in rk4)  # 1e-4 rad a step
    assert shipped["horizons"] == [60.0, 600.0, 6000.0]


def test_a_steady_spin_leaves_the_tensors_motion_as_numpy_has_it(shipped):
    """The first minute, before the ship burns, by SciPy's DOP853 to 1e-12 of 2.4e-5 rad and 6e-7 rad/s."""
    scene = load_scene(ROOT / "examples" / "iss_dg.toml")
    start = np.array([1.0, 0.0, 0.0, 0.0, *scene.rotation.angular_velocity])
    times = np.linspace(0.0, 60.0, 61)
    J = reference.composite(scene).inertia

    def ode(_: float, x: np.ndarray) -> np.ndarray:
        rate = reference.angular_acceleration("tensor", J, x[4:], np.zeros(3))
        return np.concatenate([reference.attitude_dot(x[:4], x[4:]), rate])

    tumbling = solve_ivp(ode, (0.0, 60.0), start, method="DOP853", t_eval=times, rtol=1e-13, atol=1e-18).y.T
    half = 0.5 * 0.0011 * times
    steady = np.column_stack([np.cos(half), 0.0 * half, np.sin(half), 0.0 * half])
    vector = (
        tumbling[:, :1] * steady[:, 1:]
        - steady[:, :1] * tumbling[:, 1:4]
        - np.cross(tumbling[:, 1:4], steady[:, 1:])
    )
    [none] = [model for model in shipped["models"] if label(model) == "none"]
    assert "principal" in none["same"]
    assert none["attitude"][0] == pytest.approx(2.0 * np.linalg.norm(vector, axis=1).max(), rel=1e-6)
    off = np.linalg.norm(tumbling[:, 4:] - start[4:], axis=1)
    assert none["rate"][0] == pytest.approx(off.max(), rel=1e-6)


def test_the_burn_cannot_be_seen_before_it_begins(shipped):
    [frozen] = [model for model in shipped["models"] if label(model) == "tensor, mass frozen"]
    assert frozen["attitude"][0] <= shipped["doubt"]["attitude"][0] + frozen["doubt"]["attitude"][0]
    assert frozen["attitude"][1] > 1e-4
