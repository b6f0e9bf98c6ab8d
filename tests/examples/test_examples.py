"""The examples and the README's blocks run, and print what the README says they print."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from fmu_build import build_fmu
from supervessel import SceneError, Twin, load_scene, parse_scene
from support import ISS_DG, variant

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


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


def test_the_docked_iss_prints_the_readmes_table(flown):
    table = re.search(r"^\| t \[s\].*?(?=\n\n)", README, re.DOTALL | re.MULTILINE)
    assert table is not None
    assert flown[1].strip() == table[0].strip()


def test_the_docked_iss_leaves_csv_plots_and_report(flown):
    folder, table = flown
    names = {"iss_dg.csv", "iss_dg_inertia.png", "iss_dg_rotation.png", "iss_dg.md"}
    assert names <= {path.name for path in folder.iterdir()}
    assert table.strip() in (folder / "iss_dg.md").read_text(encoding="utf-8")
    header = (folder / "iss_dg.csv").read_text().splitlines()[0]
    assert header.startswith('"time","mass","barycentre[1]"')
    rows = np.loadtxt(folder / "iss_dg.csv", delimiter=",", skiprows=1)
    assert rows.shape == (6001, 1 + 23)


@pytest.mark.parametrize("number", range(len(blocks("python"))))
def test_a_python_block_of_the_readme_runs(tmp_path, number):
    scene = load_scene(ROOT / "examples" / "iss_dg.toml")
    (tmp_path / "build").mkdir()
    build_fmu(scene, tmp_path / "build" / "iss_dg.fmu")
    (tmp_path / "examples").symlink_to(ROOT / "examples", target_is_directory=True)
    done = subprocess.run(
        [sys.executable, "-c", blocks("python")[number]],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"MPLBACKEND": "Agg"},
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()


def test_the_messages_of_the_readme_are_the_real_ones():
    tug = {"vessels.tug": {"mass": 1.0, "pmi": [1.0, 1.0, 5.0], "ports": {"fore": {"directon": 1}}}}
    with pytest.raises(SceneError) as caught:
        parse_scene(variant(ISS_DG, tug), "docking.toml")
    shown = [line for line in README.splitlines() if line.startswith("docking.toml: ")]
    assert len(shown) == 2
    assert set(shown) <= set(str(caught.value).splitlines())


def test_a_users_own_model_py_beside_the_script_does_no_harm(tmp_path):
    (tmp_path / "model.py").write_text("raise RuntimeError('this is the user\\'s')\n")
    script = "import fmu_build, supervessel; print(supervessel.Twin.__name__)"
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout.strip()) == (0, Twin.__name__), done.stderr
