"""The command `supervessel`: help, `build`, `info`."""

import shlex
import zipfile
from importlib.metadata import version

import pytest

from fmu_build.contents import contents
from supervessel import commands, load_scene, parse_scene
from support import BALL, ISS_DG, body, built, variant
from support.marks import FMI
from support.pages import ROOT
from support.processes import cache, names_in, needs_posix

__all__ = ["cache"]

COLUMNS = 80
"""Of the narrowest terminal that nothing wraps on."""


def helped(capsys, monkeypatch, *words):
    """Returns the lines of a help on a terminal of COLUMNS."""
    monkeypatch.setenv("COLUMNS", str(COLUMNS))
    with pytest.raises(SystemExit) as ended:
        commands.main([*words, "--help"])
    assert ended.value.code == 0
    return capsys.readouterr().out.splitlines()


def ran(capsys, *words):
    """Returns status, standard output and standard error of a command run in this process."""
    status = commands.main([str(word) for word in words])
    return status, *capsys.readouterr()


def test_the_help_lists_every_command_in_a_line(capsys, monkeypatch):
    lines = helped(capsys, monkeypatch)
    listed = [line.split(maxsplit=1) for line in lines if line.startswith("    ")]
    assert [line for line in listed if line[0] != "COMMAND"] == [
        [name, command.line] for name, command in commands.COMMANDS.items()
    ]
    assert set(commands.COMMANDS) >= {"build", "info", "trade", "import", "cache"}


@pytest.mark.parametrize("name", commands.COMMANDS)
def test_help_of_a_command_has_one_line_and_one_example(capsys, monkeypatch, name):
    lines = helped(capsys, monkeypatch, name)
    place = lines.index("")
    assert lines[place + 1].lower() == f"{commands.COMMANDS[name].line.lower()}."
    assert lines[place + 2] == ""
    assert [line for line in lines if line.startswith("example: ")] == [lines[-1]]
    assert max(map(len, lines)) < COLUMNS
    program, *words = shlex.split(lines[-1].removeprefix("example: "))
    assert (program, words[0]) == ("supervessel", name)
    assert callable(commands.parser().parse_args(words).run)
    assert all((ROOT / word).exists() for word in words if word.startswith("examples"))


def test_a_build_is_named_after_the_file(tmp_path, monkeypatch, capsys):
    (tmp_path / "my.first.toml").write_text(BALL)
    monkeypatch.chdir(tmp_path)
    assert ran(capsys, "build", "my.first.toml", "--fmi", 2) == (0, "my.first.fmu\n", "")
    assert names_in(tmp_path) == ["my.first.fmu", "my.first.toml"]
    found = contents(tmp_path / "my.first.fmu")
    assert (found.header["modelName"], found.header["fmiVersion"]) == ("ball", "2.0")


@needs_posix
def test_a_build_of_what_was_handed_over_is_named_after_the_scene(tmp_path, monkeypatch, capsys):
    (tmp_path / "scene.toml").write_text(BALL)
    monkeypatch.chdir(tmp_path)
    with (tmp_path / "scene.toml").open() as file:
        assert ran(capsys, "build", f"/dev/fd/{file.fileno()}") == (0, "ball.fmu\n", "")


def test_an_unknown_platform_of_a_build_is_wrong_usage(tmp_path, capsys):
    with pytest.raises(SystemExit) as ended:
        commands.main(["build", str(tmp_path / "none.toml"), "--platform", "x86_64-linus"])
    assert ended.value.code == 2
    assert 'error: --platform: unknown platform "x86_64-linus"' in capsys.readouterr().err


@FMI
def test_info_tells_scene_versions_and_platforms(capsys, fmi):
    file = built(ISS_DG, fmi)
    status, out, error = ran(capsys, "info", file)
    assert (status, error) == (0, "")
    lines = {line[:11].strip(): line[11:] for line in out.splitlines()}
    assert lines["model"] == "iss_dg"
    assert lines["made by"] == f"supervessel {version('supervessel')}"
    assert lines["FMI"].startswith(f"{fmi}.0, ")
    assert set(lines["FMI"].split(", ")[1:]) == {"co-simulation", "model exchange"}
    assert lines["scene"] == "2 vessels, root ISS; law tensor, propagator rk4"
    with zipfile.ZipFile(file) as archive:
        (folder,) = {name.split("/")[1] for name in archive.namelist() if name.startswith("binaries/")}
        text = archive.read("modelDescription.xml").decode()
    assert lines["platforms"] in (folder, f"x86_64-{folder.removesuffix('64')}")
    counts = [text.count(f'causality="{key}"') for key in ("input", "parameter", "output")]
    assert lines["variables"] == "{} inputs, {} parameters, {} outputs".format(*counts)


def test_the_scene_that_info_prints_is_that_of_the_fmu(tmp_path, capsys):
    rotation = {"propagator": "rk4", "attitude": [1, 2, 3, 4]}
    raw = variant(body(), {"experiment": {"duration": 10.0, "step": 0.5}, "rotation": rotation})
    status, out, _ = ran(capsys, "info", built(raw), "--scene")
    assert status == 0
    (tmp_path / "again.toml").write_text(out)
    assert load_scene(tmp_path / "again.toml") == parse_scene(raw) == contents(built(raw)).scene
    assert ran(capsys, "info", built(raw))[1].endswith("experiment 10 s in steps of 0.5 s\n")


def changed(file, folder, **members):
    """Returns a copy of an FMU, some of its members changed by functions of bytes, or left out (None)."""
    copy = folder / "x.fmu"
    places = {"description": "modelDescription.xml", "scene": "resources/scene.toml"}
    change = {places[key]: value for key, value in members.items()}
    with zipfile.ZipFile(file) as old, zipfile.ZipFile(copy, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            if change.get(name, bytes) is not None:
                new.writestr(name, change.get(name, bytes)(old.read(name)))
    return copy


OTHER = {
    "another tool": (
        {"description": lambda text: text.replace(b'generationTool="supervessel', b'generationTool="Dymola')},
        'is an FMU (FMI 3.0) that "Dymola {version}" has made, and has no scene of supervessel\'s in it',
    ),
    "a tool without name": (
        {"description": lambda text: text.replace(b"generationTool=", b"copyright=")},
        "is an FMU (FMI 3.0) that a tool that does not say its name has made, "
        "and has no scene of supervessel's in it",
    ),
    "no scene": (
        {"scene": None},
        "was made by supervessel {version}, but has no resources/scene.toml in it any more",
    ),
    "no description": ({"description": None}, "is no FMU: the archive has no modelDescription.xml"),
    "other XML": (
        {"description": lambda _: b"<html/>"},
        "is no FMU: modelDescription.xml in it describes something else",
    ),
    "no XML": (
        {"description": lambda _: b"<a>"},
        "modelDescription.xml in it is no XML: no element found: line 1, column 3",
    ),
    "bad scene": ({"scene": lambda text: text + b"colour = 3\n"}, None),
}


@pytest.mark.parametrize("case", OTHER)
def test_info_refuses_what_holds_no_scene_in_a_line(tmp_path, capsys, case):
    members, problem = OTHER[case]
    file = changed(built(body()), tmp_path, **members)
    status, out, error = ran(capsys, "info", file)
    if problem is None:
        assert error.startswith("x.fmu: resources/scene.toml: ")
    else:
        assert error == f"{file}: {problem.format(version=version('supervessel'))}\n"
    assert (status, out, error.count("\n")) == (1, "", 1)


def test_info_reads_no_description_without_end(monkeypatch, capsys):
    monkeypatch.setattr("fmu_build.contents.LARGEST_DESCRIPTION", 1000)
    file = built(body())
    problem = "modelDescription.xml in it is longer than 1000 bytes; at most that many are read"
    assert ran(capsys, "info", file) == (1, "", f"{file}: {problem}\n")


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"", "is no FMU, which is a zip archive; or it is cut off"),
        (None, "cannot be read: No such file or directory"),
        ("folder", "cannot be read: Is a directory"),
        ("damaged", "modelDescription.xml in it cannot be read: "),
    ],
    ids=["empty", "not there", "a folder", "damaged"],
)
def test_info_names_a_file_that_cannot_be_read(tmp_path, capsys, content, problem):
    file = tmp_path / "x.fmu"
    if content == "folder":
        file.mkdir()
    elif content == "damaged":
        whole = bytearray(changed(built(body()), tmp_path).read_bytes())
        place = whole.index(b"modelDescription.xml") + 60
        whole[place : place + 40] = bytes(40)
        file.write_bytes(whole)
    elif content is not None:
        file.write_bytes(content)
    status, out, error = ran(capsys, "info", file)
    assert error.startswith(f"{file}: {problem}")
    assert (status, out, error.count("\n")) == (1, "", 1)
