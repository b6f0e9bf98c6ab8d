"""The examples and the blocks of the README and its pages run, and print what the pages say they print."""

import os
import re
import shlex
import subprocess
import sys
import tomllib
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from fmu_build import build_fmu
from supervessel import SceneError, Twin, load_scene, parse_scene
from support import ISS_DG, variant
from support.pages import PAGES, ROOT, blocks, text

sys.path.append(str(ROOT / "examples"))

import iss_dg

PYTHON_BLOCKS = [(page, number) for page in PAGES for number in range(len(blocks(page, "python")))]


def run(code: str, folder: Path) -> str:
    """Returns what a block of Python prints in a folder."""
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"MPLBACKEND": "Agg"},
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.fixture(scope="module")
def flown(tmp_path_factory) -> tuple[Path, str]:
    """The folder and the output of the docked-ISS example, run as `make run` does."""
    folder = tmp_path_factory.mktemp("run")
    build_fmu(load_scene(ROOT / "examples" / "iss_dg.toml"), folder / "iss_dg.fmu")
    done = subprocess.run(
        [sys.executable, str(ROOT / "examples" / "iss_dg.py"), str(folder)],
        capture_output=True,
        text=True,
        check=True,
    )
    return folder, done.stdout


def test_the_docked_iss_prints_the_pages_table(flown):
    table = re.search(r"^\| t \[s\].*?(?=\n\n)", text("examples/README.md"), re.DOTALL | re.MULTILINE)
    assert table is not None
    assert flown[1].strip() == table[0].strip()


def test_other_pages_give_the_tables_last_figures(flown):
    rows = [[cell.strip() for cell in line.split("|")] for line in flown[1].splitlines()]
    by_time = {row[1]: row[-3:-1] for row in rows[2:]}
    late = [f"{float(angle):.2f} deg" for angle in by_time["600"]]
    assert f"off by {late[0]}; {late[1]} |" in text("README.md")
    row = f"{float(by_time['60'][0]):.4f} deg after 60 s, {late[0]} after 600 s"
    assert row in text("model/docs/equations.md")


def test_the_pages_orbit_is_the_one_that_is_flown():
    """Circular, its normal the body's y, about which the station turns."""
    (lines,) = blocks("examples/README.md", "toml")
    given, raw = tomllib.loads(lines), tomllib.loads((ROOT / "examples" / "iss_dg.toml").read_text())
    scene = iss_dg.in_orbit(raw, "tensor")
    assert scene.gravity.model_dump() == {
        key: tuple(v) if isinstance(v, list) else v for key, v in given["gravity"].items()
    }
    assert scene.inputs.gravity == given["inputs"]["gravity"]
    position, velocity = map(np.array, scene.gravity_start)
    rate = np.cross(position, velocity) / (position @ position)
    assert velocity @ velocity == pytest.approx(scene.gravity.mu / np.linalg.norm(position), rel=1e-15)
    np.testing.assert_allclose(rate, scene.rotation.angular_velocity, rtol=0, atol=3e-5)


@pytest.mark.skipif(version("matplotlib") != "3.11.2", reason="the plot is drawn by matplotlib 3.11.2")
def test_the_plot_of_the_page_is_that_of_the_docked_iss(flown):
    """But for pixels along the curves, where processors round differently: a curve moved by one is 1e-3."""
    shown, drawn = imread(ROOT / "examples" / "iss_dg.png"), imread(flown[0] / "iss_dg_rotation.png")
    assert shown.shape == drawn.shape
    assert np.abs(shown - drawn).mean() < 1e-4


def test_the_docked_iss_leaves_csv_plots_and_report(flown):
    folder, table = flown
    names = {"iss_dg.csv", "iss_dg_inertia.png", "iss_dg_rotation.png", "iss_dg.md"}
    assert names <= {path.name for path in folder.iterdir()}
    assert table.strip() in (folder / "iss_dg.md").read_text(encoding="utf-8")
    header = (folder / "iss_dg.csv").read_text().splitlines()[0]
    assert header.startswith('"time","mass","barycentre[1]"')
    rows = np.loadtxt(folder / "iss_dg.csv", delimiter=",", skiprows=1)
    assert rows.shape == (6001, 1 + 23)


@pytest.fixture(scope="module")
def started(tmp_path_factory) -> Path:
    """A folder as the README leaves it: its scene, and the FMUs that blocks of Python read."""
    folder = tmp_path_factory.mktemp("started")
    (folder / "build").mkdir()
    build_fmu(load_scene(ROOT / "examples" / "iss_dg.toml"), folder / "build" / "iss_dg.fmu")
    (folder / "examples").symlink_to(ROOT / "examples", target_is_directory=True)
    (scene,) = blocks("README.md", "toml")
    (folder / "scene.toml").write_text(scene)
    program = ".venv/bin/supervessel"
    lines = [line for block in blocks("README.md", "sh") for line in block.splitlines() if program in line]
    for line in lines:
        first, *words = shlex.split(line, comments=True)
        assert first == program
        subprocess.run(
            [sys.executable, "-m", "supervessel", *words], cwd=folder, check=True, capture_output=True
        )
    assert (folder / "station.fmu").exists()
    return folder


@pytest.mark.parametrize(("page", "number"), PYTHON_BLOCKS)
def test_a_python_block_of_a_page_runs(started, page, number):
    assert run(blocks(page, "python")[number], started)


def test_the_readme_and_its_pages_have_the_blocks_that_they_had():
    assert {page for page, _ in PYTHON_BLOCKS} == {
        "README.md",
        "fmu_build/docs/fmu.md",
        "model/docs/error_bound.md",
        "model/docs/orbiter.md",
        "model/docs/twin.md",
    }


def test_the_readme_plots_its_scene_and_says_what_it_prints(started):
    flight, _ = blocks("README.md", "python")
    said = re.search(r"# ([\d.]+) m2$", flight, re.MULTILINE)
    assert said is not None
    assert f"{float(run(flight, started)):.3f}" == said[1]
    assert (started / "station.png").stat().st_size > 10_000


def test_the_twin_of_the_readme_ends_as_near_as_it_says(started):
    """Twenty time constants of a critically damped loop of 0.02 rad/s leave less than 1e-4 of 0.5 rad."""
    _, loop = blocks("README.md", "python")
    assert "# below 1e-4 rad" in loop
    error = np.array(re.findall(r"-?\d[\d.e-]*", run(loop, started)), dtype=float)
    assert error.shape == (6,)
    assert np.abs(error).max() < 1e-4


def test_the_flights_of_the_page_on_the_fmu_print_what_it_says(started):
    """The same flight by FMPy and by CasADi, and one along an orbit."""
    flight, orbit, imported = blocks("fmu_build/docs/fmu.md", "python")
    said = re.search(r"# ([\d.]+) m2, ([\d.]+) rad/s$", flight, re.MULTILINE)
    assert said is not None
    pmi, rate = map(float, run(flight, started).split())
    assert (f"{pmi:.3f}", f"{rate:.6f}") == said.groups()
    assert f"# {float(run(imported, started)):.6f} rad/s" in imported
    assert f"# {rate:.6f} rad/s" in imported
    assert f"# {float(run(orbit, started).splitlines()[-1]):.6f} rad/s" in orbit


def test_the_messages_of_the_page_on_scenes_are_the_real_ones():
    tug = {"vessels.tug": {"mass": 1.0, "pmi": [1.0, 1.0, 5.0], "ports": {"fore": {"directon": 1}}}}
    with pytest.raises(SceneError) as caught:
        parse_scene(variant(ISS_DG, tug), "docking.toml")
    shown = [line for line in text("model/docs/scene.md").splitlines() if line.startswith("docking.toml: ")]
    assert len(shown) == 2
    assert set(shown) <= set(str(caught.value).splitlines())


def test_a_users_own_model_py_beside_the_script_does_no_harm(tmp_path):
    (tmp_path / "model.py").write_text("raise RuntimeError('this is the user\\'s')\n")
    script = "import fmu_build, supervessel; print(supervessel.Twin.__name__)"
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout.strip()) == (0, Twin.__name__), done.stderr
