"""Attitude held while fuel burns: the design, its flight on twin and FMU, by a controller that is an FMU."""

import re

import lqr_hold
import numpy as np
import pytest
import two_fmus
from lqr_hold import EXAMPLES, controller, gains
from tanker import EMPTY, FULL, fly, fmu_plant, twin_plant

from fmu_build import build_fmu
from supervessel import Twin, load_scene
from support import EPS, scene, variant
from support.pages import text

ROUNDING = 1200 * 4 * EPS
"""An attitude read as an output is normalised once more, off by a few u in each of 1200 steps; the loop is
stable and lets nothing of it grow."""


@pytest.fixture(scope="module")
def twin() -> Twin:
    return Twin(load_scene(EXAMPLES / "tanker.toml"), error_form="vec")


def rows(table: str) -> dict[str, list[str]]:
    """Returns the cells of a Markdown table's rows by their first."""
    cells = [[cell.strip() for cell in line.split("|")[1:-1]] for line in table.strip().splitlines()]
    return {row[0]: row[1:] for row in cells[2:]}


def on_the_page(example: str) -> str:
    found = re.search(rf"^\| \[`{example}`\].*$", text("examples/README.md"), re.MULTILINE)
    assert found is not None
    return found[0]


@pytest.mark.parametrize("mass", [EMPTY, 19000.0, FULL])
def test_gains_are_those_of_the_closed_form(twin, mass):
    """Without weight on rates K = (k I, K2) with K2^T K2 = 2 k J solves the Riccati equation at rest."""
    K, J = gains(twin, mass), np.array(twin.composite(twin.p_with({"tanker.mass": mass}))[2])
    k = 1000.0 / np.radians(1.0)
    # SciPy's solver balances nothing: A, B are about 1 and 1e-7 apart; residuals of 1e-10 are its usual
    np.testing.assert_allclose(K[:, :3], k * np.eye(3), atol=1e-7 * k)
    np.testing.assert_allclose(K[:, 3:].T @ K[:, 3:], 2.0 * k * J, atol=1e-7 * k * np.abs(J).max())


def test_the_flight_prints_what_the_page_says(tmp_path, capsys):
    lqr_hold.main(tmp_path)
    table = rows(capsys.readouterr().out)
    assert table["twin"] == table["FMU"]
    (settles, overshoot, *_, used), late = table["FMU"], table["FMU, gains of the empty tanker"]
    said = on_the_page("lqr_hold.py")
    assert f"{settles} s, overshoot {overshoot} %, {used} N m s" in said
    assert f"{late[0]} s, {late[1]} %, {late[-1]} N m s" in said
    assert (tmp_path / "lqr_hold.png").stat().st_size > 10_000


def test_the_fmu_flies_as_the_twin_does(twin, tmp_path):
    control = controller(twin, np.linspace(EMPTY, FULL, 7))
    states, torques = fly(twin_plant(twin), control, twin.x_start)
    with fmu_plant(build_fmu(twin.scene, tmp_path / "tanker.fmu")) as plant:
        flown, spent = fly(plant, control, twin.x_start)
    np.testing.assert_allclose(flown, states, rtol=0.0, atol=ROUNDING)
    np.testing.assert_allclose(spent, torques, rtol=0.0, atol=ROUNDING * np.abs(gains(twin, FULL)).max())


def test_two_fmus_fly_as_the_twin_does_and_as_the_page_says(tmp_path, capsys):
    two_fmus.main(tmp_path)
    table = rows(capsys.readouterr().out)
    names = ["twin, controller in CasADi", "two FMUs, FMI 3", "two FMUs, FMI 2"]
    assert [*table] == names
    assert table[names[1]] == table[names[2]] == table[names[0]]
    assert f"{table[names[1]][0]} s, overshoot {table[names[1]][1]} %" in on_the_page("two_fmus.py")
    assert {path.name for path in tmp_path.iterdir()} == {
        "tanker_2.fmu",
        "tanker_3.fmu",
        "controller_2.fmu",
        "controller_3.fmu",
        "two_fmus.png",
    }


def test_a_scene_without_torque_is_refused():
    raw = variant(
        {"name": "a", "root": "tanker", "vessels": {"tanker": {"mass": 9.0, "pmi": [1.0, 1.0, 1.0]}}},
        {"inputs.mass": ["tanker"]},
    )
    with pytest.raises(ValueError, match='scene "a" has no torque input; put "torque = true" under'):
        gains(Twin(scene(raw)), 9.0)
