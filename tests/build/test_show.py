"""`supervessel show`: what it prints of a scene, the drawing that it writes, that it needs no compiler."""

import os
import re
import subprocess
import sys
from math import radians

import numpy as np
import pytest
from matplotlib.image import imread

from supervessel import commands, load_scene, parse_scene, reference
from supervessel.drawing.drawing import drawing
from supervessel.drawing.figure import svg
from supervessel.drawing.geometry import assembly
from supervessel.show.overview import overview
from support import BALL, ISS_DG, body, variant
from support.pages import ROOT

SHOWN = 1e-5
"""Largest relative error of a number that is shown with six digits, of unit 5e-6 where it begins with 1."""


def ran(capsys, *words):
    """Returns status, standard output and standard error of `supervessel show` in this process."""
    status = commands.main(["show", *map(str, words)])
    return status, *capsys.readouterr()


def numbers(text):
    """Returns the numbers of a text."""
    return [float(word) for word in re.findall(r"-?\d+\.?\d*(?:e[+-]\d+)?", text)]


def shown(raw):
    """Returns the lines of an overview of a raw scene, by their first words; those without any in a list."""
    return overview(assembly(parse_scene(raw))).splitlines()


def line_of(lines, word):
    (place,) = (i for i, line in enumerate(lines) if line.startswith(f"{word} "))
    return place


def turned_about_x(vector, angle):
    """Returns a vector turned about x by an angle [rad]."""
    x, y, z = vector
    return [x, np.cos(angle) * y - np.sin(angle) * z, np.sin(angle) * y + np.cos(angle) * z]


def test_the_composite_is_that_of_the_reference():
    lines = shown(ISS_DG)
    whole = reference.composite(parse_scene(ISS_DG))
    assert numbers(lines[line_of(lines, "mass")]) == pytest.approx([whole.mass], rel=SHOWN)
    assert numbers(lines[line_of(lines, "barycentre")]) == pytest.approx(whole.barycentre, rel=SHOWN)
    place = line_of(lines, "inertia")
    rows = [numbers(line.replace("m2", ""))[:3] for line in lines[place : place + 3]]
    np.testing.assert_allclose(rows, whole.inertia, rtol=SHOWN)
    pmi = numbers(lines[line_of(lines, "moments")].replace("m2", ""))
    assert pmi == pytest.approx(np.diag(whole.inertia) / whole.mass, rel=SHOWN)


def test_principal_moments_and_axes_are_those_of_the_tensor():
    lines = shown(ISS_DG)
    place = line_of(lines, "principal")
    tensor = reference.composite(parse_scene(ISS_DG)).inertia
    moments = []
    for line in lines[place + 1 : place + 4]:
        moment, *axis = numbers(line)
        moments.append(moment)
        assert np.linalg.norm(axis) == pytest.approx(1.0, rel=SHOWN)
        np.testing.assert_allclose(tensor @ axis, moment * np.array(axis), atol=SHOWN * moment)
    assert moments == sorted(moments)


@pytest.mark.parametrize(
    ("pmi", "said"),
    [((1.0, 2.0, 2.0), "two are equal"), ((2.0, 2.0, 2.0), "all three are equal"), ((1.0, 2.0, 2.5), "")],
)
def test_equal_moments_have_no_axes_of_their_own(pmi, said):
    assert re.findall(r"(?:two|all three) are equal", "\n".join(shown(body(pmi=pmi)))) == [said][: bool(said)]


def test_the_box_of_a_cuboid_is_the_cuboid():
    """Of edges 2, 4 and 6 m: moments over mass are (b^2 + c^2)/12 and so on. Turned, it has products."""
    edges = np.array([2.0, 4.0, 6.0])
    squares = edges**2
    moments = (sum(squares) - squares) / 12.0
    lines = shown(body(pmi=moments.tolist()))
    assert "2 x 4 x 6 " in lines[line_of(lines, "B")]
    turn = np.array([turned_about_x(axis, radians(30.0)) for axis in np.eye(3)]).T
    tensor = 1000.0 * turn @ np.diag(moments) @ turn.T
    raw = variant(body(), {"vessels.B": {"mass": 1000.0, "inertia": ((tensor + tensor.T) / 2.0).tolist()}})
    lines = shown(raw)
    assert "6 x 4 x 2 *" in lines[line_of(lines, "B")]  # ascending moments, the longest edge first
    assert lines[-1].startswith("  *: along its principal axes")


def test_vessels_that_are_not_joined_or_have_no_mass_are_told():
    scene = load_scene(ROOT / "examples" / "berth.toml")
    dock = scene.docks[0].model_copy(update={"docked": False})
    lines = overview(assembly(scene.model_copy(update={"docks": (dock,)}))).splitlines()
    assert lines[line_of(lines, "ship")].endswith("not joined at the start")
    lines = shown(variant(ISS_DG, {"vessels.DG.mass": 0.0}))
    assert "none: no mass" in lines[line_of(lines, "DG")]


def test_no_line_is_wider_than_a_terminal():
    for path in (ROOT / "examples").glob("*.toml"):
        assert max(map(len, overview(assembly(load_scene(path))).splitlines())) <= 80, path


def test_long_names_are_cut_and_lines_stay_as_they_are():
    name = "a" * 60
    raw = variant(body(), {"root": name, "vessels": {name: body()["vessels"]["B"]}})
    assert max(map(len, shown(raw))) <= 80
    assert any(line.startswith("a" * 15 + "... ") for line in shown(raw))


def test_the_drawing_is_that_of_the_fmu(tmp_path, capsys):
    (tmp_path / "ball.toml").write_text(BALL)
    scene = load_scene(tmp_path / "ball.toml")
    before = overview(assembly(scene)) + "\n"
    for name in ("x.svg", "x.PNG", "x.svg"):  # the last one replaces the first
        assert ran(capsys, tmp_path / "ball.toml", "-o", tmp_path / name) == (0, before, "")
    figure = drawing(assembly(scene))
    assert (tmp_path / "x.svg").read_text() == svg(figure)
    assert imread(tmp_path / "x.PNG", format="png").shape == (figure.height, figure.width, 3)


@pytest.mark.parametrize("name", ["x.html", "x.glb", "x", "x.pdf", ".png"])
def test_other_endings_are_wrong_usage_and_named(tmp_path, capsys, name):
    with pytest.raises(SystemExit) as ended:
        ran(capsys, tmp_path / "none.toml", "-o", tmp_path / name)
    said = capsys.readouterr().err
    assert ended.value.code == 2
    ending = "." + name.partition(".")[2] if "." in name[1:] else ""
    assert f"a drawing is a file with the ending .svg or .png, not {ending!r}" in said


def test_what_is_no_picture_is_not_replaced(tmp_path, capsys):
    (tmp_path / "ball.toml").write_text(BALL)
    (tmp_path / "x.svg").write_text("notes")
    status, out, error = ran(capsys, tmp_path / "ball.toml", "-o", tmp_path / "x.svg")
    assert (status, out) == (1, "")
    assert error.endswith("is there already and is no .svg file; remove it or take another name\n")
    assert (tmp_path / "x.svg").read_text() == "notes"


def test_a_scene_that_is_refused_gives_its_problems_and_no_drawing(tmp_path, capsys):
    (tmp_path / "ball.toml").write_text(BALL.replace("mass = 2.0", "mass = -2.0"))
    status, out, error = ran(capsys, tmp_path / "ball.toml", "-o", tmp_path / "x.svg")
    assert (status, out) == (1, "")
    assert error == "ball.toml: vessels.B.mass = -2.0 kg: must be a finite number >= 0\n"
    assert not (tmp_path / "x.svg").exists()


ALONE = """\
import sys

def refuse(event, arguments):
    assert event not in ("subprocess.Popen", "os.fork", "os.posix_spawn", "os.system"), event

sys.addaudithook(refuse)
from supervessel import commands
status = commands.main(["show", "examples/launch_stack.toml", "-o", sys.argv[1]])
assert not {"ziglang", "fmpy", "fmu_build.build", "fmu_build.compile.compiler"} & sys.modules.keys()
sys.exit(status)
"""


def test_no_compiler_and_no_other_program_is_needed(tmp_path):
    path = os.pathsep.join((str(ROOT), str(ROOT / "model")))
    done = subprocess.run(
        [sys.executable, "-c", ALONE, tmp_path / "x.svg"],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": path, "PATH": ""},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("launch_stack: 7 vessels, at the start\n")
