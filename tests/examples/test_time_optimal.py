"""Time-optimal turns: the published gain, arcs that end at the target, the rows in examples/README.md."""

import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from supervessel import Twin, parse_scene
from support.pages import text

ROOT = Path(__file__).parents[2]
sys.path.append(str(ROOT / "examples"))

import time_optimal as example  # noqa: E402

PUBLISHED_GAIN = 8.5
"""Per cent, [BW]: of a body with equal moments turned by 180 degrees, over the turn about a fixed axis."""
FMU_ERROR = 1e-7
"""rad: 200 communication steps and as many sub-steps more, each to the scenes' tolerance of 1e-9 at most."""
INTEGRATION_ERROR = 1e-7
"""Of the state in units of the turn: SUBSTEPS steps of RK4 in an arc turn the body by up to 0.03 rad each, an
error of 0.03^5/120 = 2e-10 a step over 240 steps."""


def rate(x, torque, J):
    """Returns the rate of attitude and angular velocity, written down here independently."""
    q, w = x[:4], x[4:]
    q_dot = 0.5 * np.append(-q[1:] @ w, q[0] * w + np.cross(q[1:], w))
    return np.append(q_dot, np.linalg.solve(J, torque - np.cross(w, J @ w)))


def ends(J, lengths, torques):
    """Returns the state after the arcs."""
    x = example.REST
    for length, torque in zip(lengths, torques, strict=True):
        x = solve_ivp(lambda _, x, u=torque: rate(x, u, J), (0.0, length), x, rtol=1e-11, atol=1e-13).y[:, -1]
    return x


@pytest.fixture(scope="module")
def turns(tmp_path_factory):
    """Scene, limit, axis and the example's result, of the sphere and of the ISS about y."""
    folder = tmp_path_factory.mktemp("turns")
    iss = tomllib.loads((ROOT / "examples" / "iss_dg.toml").read_text())
    del iss["experiment"]
    cases = []
    for raw, limit, axis in ((example.SPHERE, 1.0, 2), (iss, 3000.0, 1)):
        scene = parse_scene(raw | {"inputs": {"torque": True}})
        cases.append((scene, limit, axis, example.turn(scene, limit, axis, folder)))
    return cases


def test_a_sphere_turns_faster_by_what_is_published(turns):
    _, limit, _, (slow, lengths, torques, *_) = turns[0]
    assert slow == pytest.approx(2.0 * np.sqrt(np.pi), rel=1e-15)
    assert 100.0 * (1.0 - lengths.sum() / slow) == pytest.approx(PUBLISHED_GAIN, abs=0.05)
    assert np.abs(torques).max() == limit


@pytest.mark.parametrize("which", [0, 1])
def test_arcs_end_at_the_target_by_an_independent_integration(turns, which):
    scene, _, axis, (slow, lengths, torques, *_) = turns[which]
    J = np.array(Twin(scene).composite([])[2])
    x = ends(J, lengths, torques) * ([1.0] * 4 + [slow] * 3)
    target = np.insert(np.zeros(6), 1 + axis, 1.0)
    assert np.minimum(np.abs(x - target).max(), np.abs(x + target).max()) < INTEGRATION_ERROR


@pytest.mark.parametrize("which", [0, 1])
def test_the_fmu_ends_at_the_target(turns, which):
    *_, states, miss = turns[which][3]
    assert miss < FMU_ERROR
    assert len(states) > 200


def test_the_page_gives_these_times(turns):
    for _, _, axis, (slow, lengths, *_) in turns:
        gain = 100.0 * (1.0 - lengths.sum() / slow)
        row = f", {'xyz'[axis]} | {slow:.5g} | {lengths.sum():.5g} | {gain:.1f} % | {len(lengths) - 1} |"
        assert row in text("examples/README.md")


def test_a_turn_that_the_other_axes_cannot_hold_is_refused():
    inertia = [[1.0, 0.0, 0.5], [0.0, 1.0, 0.0], [0.5, 0.0, 1.0]]
    vessels = {"body": {"mass": 1.0, "inertia": inertia}}
    twin = Twin(parse_scene(example.SPHERE | {"vessels": vessels, "inputs": {"torque": True}}))
    with pytest.raises(ValueError, match="products of inertia too large for a turn about z"):
        example.about_axis(twin, 1.0, 2)
