"""A captured vessel's masses and moments: found within the confidence that is stated, only with torque."""

import re

import identify
import numpy as np
import pytest
from identify import COUNT, EXAMPLES, NOISE, TRUTH, estimate, flown, model, pulses
from scipy.special import bdtr, chdtri

from fmu_build import build_fmu
from supervessel import Twin, load_scene
from support import body, scene
from support.pages import text

DRAWS = 40


@pytest.fixture(scope="module")
def twin() -> Twin:
    return Twin(load_scene(EXAMPLES / "capture.toml"))


@pytest.fixture(scope="module")
def rates(twin):
    return model(twin)


@pytest.fixture(scope="module")
def truth(twin) -> np.ndarray:
    return np.append(twin.p_with(TRUTH), twin.x_start[4:])


def test_the_example_prints_what_the_page_says(tmp_path, capsys):
    identify.main(tmp_path)
    printed = capsys.readouterr().out
    said = re.search(r"^\| \[`identify.py`\].*$", text("examples/README.md"), re.MULTILINE)
    assert said is not None
    table = {
        line.split("|")[1].strip(): line.split("|")[2:-1] for line in printed.splitlines() if "|" in line
    }
    for name in ("servicer.mass", "target.mass"):
        assumed, estimated, sigma = (float(table[name][i]) for i in (1, 2, 3))
        assert f"`{name}` {assumed:g} to {estimated:g} +- {sigma:g} kg" in said[0]
    assert "theta * [0.707 0.707 0.    0.    0.    0.    0.    0.   ]" in printed
    assert (tmp_path / "identify.png").stat().st_size > 10_000


@pytest.mark.thorough
def test_the_stated_covariance_covers_the_truth(twin, rates, truth, tmp_path):
    """Over draws of the noise the squared distance in the stated metric is chi-squared, 8 degrees each."""
    torque = pulses()
    clean = flown(build_fmu(twin.scene, tmp_path / "capture.fmu"), twin, torque)
    rng = np.random.default_rng(20)
    squares = []
    for _ in range(DRAWS):
        found, covariance = estimate(rates, truth, torque, clean + NOISE * rng.normal(size=clean.shape))
        off = found - truth
        squares.append(off @ np.linalg.solve(covariance, off))
    low, high = chdtri(len(truth) * DRAWS, [0.995, 0.005])
    assert low < sum(squares) < high
    inside = sum(np.array(squares) < chdtri(len(truth), 0.05))
    assert bdtr(inside, DRAWS, 0.95) >= 1e-4


def test_a_poor_first_guess_finds_the_truth_where_there_is_no_noise(twin, rates, truth, tmp_path):
    torque = pulses()
    clean = flown(build_fmu(twin.scene, tmp_path / "capture.fmu"), twin, torque)
    found, covariance = estimate(rates, np.append(twin.p_start, clean[:, 0]), torque, clean)
    # within what it stops at, 1e-3 of a standard deviation
    assert (found - truth) @ np.linalg.solve(covariance, found - truth) < 1e-6


def test_without_torque_all_masses_scale_together(twin, rates, truth, tmp_path):
    quiet = np.zeros((3, COUNT))
    data = flown(build_fmu(twin.scene, tmp_path / "capture.fmu"), twin, quiet)
    with pytest.raises(ValueError, match=re.escape("open along theta * [0.707 0.707 0. ")):
        estimate(rates, truth, quiet, data)
    doubled = truth * np.where(np.arange(len(truth)) < 2, 2.0, 1.0)
    same = np.array(rates(doubled, quiet)[0]).ravel() - data.ravel(order="F")
    # u of the rates in each of 600 steps, a few times over
    assert np.abs(same).max() < COUNT * 8 * 2.0**-53 * np.abs(data).max()


def test_a_scene_without_torque_is_refused():
    raw = body() | {"inputs": {}}
    with pytest.raises(ValueError, match='scene "body" has no torque input; put "torque = true" under'):
        model(Twin(scene(raw)))
