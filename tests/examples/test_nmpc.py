"""The NMPC example: limits kept on the FMU, derivatives, what solvers agree on, the table on the page."""

import re
import subprocess
import sys
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from fmu_build import build_fmu
from supervessel import Twin, load_scene
from support import U
from support.pages import text

ROOT = Path(__file__).parents[2]
sys.path += [str(ROOT / "examples"), str(ROOT / "tests" / "bench")]

import nmpc  # noqa: E402
import nmpc_slew as slew  # noqa: E402

OPERATIONS = 1e4
"""Of one stage's Hessian, at most: each adds a rounding."""
TOLERANCE = 1e-8
"""Of the solvers here, for what they find to be comparable."""
TORQUE_ERROR = np.sqrt(TOLERANCE / 0.04)
"""Of a torque over its limit: where a limit just acts, distance times multiplier is the tolerance, and the
multiplier is the distance times the curvature, that of the effort at least."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("nmpc")


@pytest.fixture(scope="module")
def twin():
    return Twin(load_scene(ROOT / "examples" / "servicer.toml"), propagator="rk4", fixed=True)


@pytest.fixture(scope="module")
def problem(twin):
    return slew.slew_problem(twin)


@pytest.fixture(scope="module")
def solvers(twin, problem, folder):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(slew, "TOLERANCE", TOLERANCE)
        return nmpc.solvers(twin, problem, folder)


@pytest.fixture(scope="module")
def printed(folder):
    """What the example prints."""
    command = [sys.executable, "-W", "error", str(ROOT / "examples" / "nmpc_slew.py"), str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.thorough
def test_the_slew_prints_the_pages_table_and_draws(folder, printed):
    assert printed in text("examples/README.md")
    assert (folder / "nmpc_slew.png").stat().st_size > 10_000


@pytest.mark.thorough
def test_the_slew_keeps_its_limits_also_with_wrong_masses(printed):
    rows = re.findall(r"\| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \|", printed)
    assert len(rows) == 3
    for settled, closest, rate, _ in np.array(rows, dtype=float):
        assert settled < slew.DURATION - 5.0
        assert closest > np.degrees(slew.CONE)
        assert rate < slew.RATE


def test_the_hessian_put_together_is_that_of_the_whole(problem):
    nlp, _, _, hessian = problem
    whole = ca.nlpsol("whole", "fatrop", nlp, slew.OPTIONS | {"fatrop": {"print_level": 0}})
    generator = np.random.default_rng(1)
    at = [generator.normal(size=hessian.size1_in(i)) for i in range(4)]
    automatic = whole.get_function("nlp_hess_l")(*at)
    for found, wanted in zip(map(np.array, hessian(*at)), map(np.array, automatic), strict=True):
        assert np.abs(found - wanted).max() <= OPERATIONS * U * np.abs(wanted).max()


def test_solvers_find_the_same_torques_from_random_starts_on_the_fmu(twin, problem, solvers, folder):
    fmu = build_fmu(twin.scene, folder / "random.fmu")
    for start in nmpc.random_starts(2, seed=3):
        for way in ("fatrop, compiled", "ipopt"):
            rows = nmpc.measured(fmu, solvers[way], problem[1], [start], 3)
            assert rows.shape == (3, 4)
            assert rows[:, 3].all()
        torques = [
            slew.controller(solvers[way], problem[1], start)(start) for way in ("fatrop, compiled", "ipopt")
        ]
        assert np.abs(torques[0] - torques[1]).max() <= TORQUE_ERROR * slew.TORQUE


def test_both_signs_of_the_attitude_give_the_same_torque(problem, solvers):
    for start in nmpc.random_starts(3, seed=4):
        other = start * ([-1.0] * 4 + [1.0] * 3)
        torques = [slew.controller(solvers["fatrop, compiled"], problem[1], x)(x) for x in (start, other)]
        assert np.abs(torques[0] - torques[1]).max() <= TORQUE_ERROR * slew.TORQUE


def test_a_rate_that_the_torque_cannot_take_back_is_refused(problem, solvers):
    start = np.array([*slew.START[:4], 0.0, 3.0 * slew.RATE, 0.0])
    with pytest.raises(RuntimeError, match=r"no torque found at .*rates above 0.1 rad/s"):
        slew.controller(solvers["fatrop, compiled"], problem[1], start)(start)
