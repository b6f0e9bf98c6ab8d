"""Compatibility information: what `python -m fmu_build.compatibility` makes, by the rules and by FMPy."""

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.util import read_csv
from fmpy.validation import validate_fmu

from fmu_build.compatibility.__main__ import main
from fmu_build.platforms import host_platform
from support import BALL

SCENE = """\
name = "pair"
root = "A"
[vessels.A]
mass = 900.0
pmi = [1.0, 1.3, 1.6]
[vessels.A.ports.fore]
position = [1.0, 0.2, 0.3]
direction = [1.0, 0.0, 0.0]
alignment = [0.0, 1.0, 0.0]
[vessels.B]
mass = 500.0
pmi = [0.4, 0.5, 0.6]
[vessels.B.ports.aft]
position = [-2.0, 0.3, 0.1]
direction = [-1.0, 0.0, 0.0]
alignment = [0.0, 0.6, 0.8]
[[docks]]
name = "berth"
ports = ["A.fore", "B.aft"]
[inputs]
mass = ["B"]
docked = ["berth"]
torque = true
[rotation]
propagator = "rk4"
angular_velocity = [0.1, -0.2, 0.3]
[outputs]
names = ["inertia", "mass", "angular_velocity", "attitude", "kinetic_energy", "barycentre"]
"""
NAMES = ["B.mass", "berth.docked", *(f"berth.{k}[{i}]" for k in ("velocity", "rate") for i in (1, 2, 3))]
NAMES += [f"torque[{i}]" for i in (1, 2, 3)]
NUMBER = r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?"
"""A floating-point literal of C without suffix."""

needs_proc = pytest.mark.skipif(sys.platform != "linux", reason="/proc is missing: it is Linux's")

INTERFACES = {"cs": "CoSimulation", "me": "ModelExchange"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """The folder of SCENE, for this machine."""
    place = tmp_path_factory.mktemp("compatibility")
    (place / "pair.toml").write_text(SCENE)
    assert main([str(place / "pair.toml"), "-o", str(place / "made")]) == 0
    return place / "made"


def models(folder: Path) -> Iterator[tuple[int, str, Path]]:
    """Yields FMI version, interface and folder of each FMU."""
    for fmi, version in ((2, "2.0"), (3, "3.0")):
        for kind in INTERFACES:
            yield fmi, kind, folder / version / kind / host_platform().folder(fmi) / "pair"


def test_there_is_what_the_rules_ask_for_and_nothing_else(folder):
    found = {path.relative_to(folder) for path in folder.rglob("*") if path.is_file()}
    names = ("pair.fmu", "pair_in.csv", "pair_ref.csv", "pair_ref.opt", "Readme.txt")
    assert found == {Path("Readme.txt")} | {
        place.relative_to(folder) / name for _, _, place in models(folder) for name in names
    }


def test_each_fmu_is_valid_of_its_version_and_has_its_interface(folder):
    for fmi, kind, place in models(folder):
        assert validate_fmu(str(place / "pair.fmu")) == []
        description = fmpy.read_model_description(str(place / "pair.fmu"))
        assert description.fmiVersion == f"{fmi}.0"
        assert {"cs": description.coSimulation, "me": description.modelExchange}[kind] is not None


@pytest.mark.parametrize("table", ["pair_in.csv", "pair_ref.csv"])
def test_tables_keep_to_the_rules_of_csv(folder, table):
    for _, _, place in models(folder):
        content = (place / table).read_text()
        head, *rows = content.splitlines()
        columns = re.findall('"([^"]*)"', head)
        assert head == ",".join(f'"{column}"' for column in columns)
        cells = [row.split(",") for row in rows]
        assert all(
            len(row) == len(columns) and all(re.fullmatch(NUMBER, cell) for cell in row) for row in cells
        )
        times = [float(row[0]) for row in cells]
        assert columns[0] == "time"
        assert times == sorted(times)
        known = {v.name for v in fmpy.read_model_description(str(place / "pair.fmu")).modelVariables}
        assert set(columns) <= known
        assert len(columns) == len(set(columns))
        assert len(content) < 1e6


def test_inputs_are_all_of_the_fmus_and_a_dock_switches_among_them(folder):
    for _, _, place in models(folder):
        read = read_csv(place / "pair_in.csv")
        assert read.dtype.names == ("time", *NAMES)
        assert set(read["berth.docked"]) == {0.0, 1.0}


def test_options_are_those_that_are_required_and_the_result_spans_them(folder):
    for _, kind, place in models(folder):
        lines = (place / "pair_ref.opt").read_text().splitlines()
        options = dict(line.split(", ") for line in lines)
        assert {"StartTime", "StopTime", "StepSize", "RelTol"} <= options.keys()
        read = read_csv(place / "pair_ref.csv")
        assert (read["time"][0], read["time"][-1]) == (
            float(options["StartTime"]),
            float(options["StopTime"]),
        )
        assert (float(options["StepSize"]) > 0.0) == (kind == "cs")
        assert options["SolverType"] == {"cs": "FixedStep", "me": "VariableStep"}[kind]
        assert len(read.dtype.names) <= 1 + 10


def off(place: Path, kind: str, finer: int) -> float:
    """Returns how far FMPy's flight is off the reference result, over a variable's largest value."""
    options = dict(line.split(", ") for line in (place / "pair_ref.opt").read_text().splitlines())
    expected = read_csv(place / "pair_ref.csv")
    found = fmpy.simulate_fmu(
        str(place / "pair.fmu"),
        fmi_type=INTERFACES[kind],
        stop_time=float(options["StopTime"]),
        output_interval=float(options["OutputIntervalLength"]) / finer,
        relative_tolerance=1e-10,
        input=read_csv(place / "pair_in.csv"),
        output=list(expected.dtype.names[1:]),
    )
    steady = [row for row in expected if np.sum(expected["time"] == row["time"]) == 1]
    if kind == "cs":
        steady = list(expected)
    nearest = [found[np.argmin(np.abs(found["time"] - row["time"]))] for row in steady]
    return max(
        abs(one[name] - other[name]) / np.abs(expected[name]).max()
        for one, other in zip(nearest, steady, strict=True)
        for name in expected.dtype.names[1:]
    )


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_fmpy_flies_co_simulation_as_the_result_says(folder, version):
    (place,) = (folder / version / "cs").glob("*/pair")
    # The same steps of RK4, whose roundings differ.
    assert off(place, "cs", 1) <= 1e-12


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_fmpy_flies_model_exchange_as_the_result_says_the_more_so_the_shorter_it_holds_inputs(
    folder, version
):
    """FMPy holds inputs over an output interval: what that costs goes with its length."""
    (place,) = (folder / version / "me").glob("*/pair")
    coarse, fine = off(place, "me", 5), off(place, "me", 50)
    assert fine <= 1e-3
    assert fine == pytest.approx(0.1 * coarse, rel=0.1)


def test_the_readme_says_how_each_was_checked(folder):
    for fmi, kind, place in models(folder):
        text = (place / "Readme.txt").read_text()
        assert text.startswith(f"pair.fmu, FMI {fmi}.0, {INTERFACES[kind]}\n")
        assert re.search(r"Checked by FMPy [\d.]+: nothing to complain of; flown, at most [\d.e-]+ of", text)
        assert "Boolean: 1" in text


def test_a_folder_that_holds_something_is_left_alone(folder, capsys):
    (folder.parent / "mine").mkdir(exist_ok=True)
    (folder.parent / "mine" / "note").write_text("x")
    place = folder.parent / "mine"
    assert main([str(folder.parent / "pair.toml"), "-o", str(place)]) == 1
    assert capsys.readouterr().err.endswith("mine: is there already; remove it or take another name\n")
    assert [path.name for path in place.iterdir()] == ["note"]


@pytest.mark.thorough
def test_a_link_to_an_empty_folder_is_followed(tmp_path):
    (tmp_path / "ball.toml").write_text(BALL)
    (tmp_path / "empty").mkdir()
    (tmp_path / "link").symlink_to("empty")
    (tmp_path / "ahead").symlink_to("new")
    for link, target in (("link", "empty"), ("ahead", "new")):
        assert main([str(tmp_path / "ball.toml"), "-o", str(tmp_path / link)]) == 0
        assert (tmp_path / link).is_symlink()
        assert (tmp_path / target / "Readme.txt").is_file()


@pytest.mark.parametrize(
    ("place", "reason"),
    [
        (".", "is the working folder, which cannot be replaced; name a folder in it"),
        pytest.param("/proc/made", "No such file or directory", marks=needs_proc),
    ],
)
def test_a_folder_that_cannot_be_made_is_refused_before_any_work(
    tmp_path, capsys, monkeypatch, place, reason
):
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path / "empty")
    assert main([str(tmp_path / "no_scene_is_read.toml"), "-o", place]) == 1
    assert capsys.readouterr().err == f"{place}: {reason}\n"
    assert [path.name for path in tmp_path.rglob("*")] == ["empty"]


def test_scenes_of_one_name_are_refused(tmp_path, capsys):
    for name in ("a", "b"):
        (tmp_path / f"{name}.toml").write_text(BALL)
    assert main([*(str(tmp_path / f"{name}.toml") for name in "ab"), "-o", str(tmp_path / "made")]) == 1
    assert f"b.toml: name = ball is that of {tmp_path / 'a.toml'}\n" in capsys.readouterr().err
    assert not (tmp_path / "made").exists()


def test_a_body_that_turns_too_fast_is_refused_and_leaves_nothing(tmp_path, capsys):
    (tmp_path / "fast.toml").write_text(BALL + "[rotation]\nangular_velocity = [1e30, 0.0, 1.0]\n")
    assert main([str(tmp_path / "fast.toml"), "-o", str(tmp_path / "made")]) == 1
    assert capsys.readouterr().err.endswith("ball: turns too fast for a reference result\n")
    assert [path.name for path in tmp_path.iterdir()] == ["fast.toml"]
