"""Words of others, from files and command lines, are printed in a form that nobody can be misled by."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest

from fmu_build.errors import BuildError
from fmu_build.generate.model import generate
from fmu_build.trade import TradeError
from orbiter.files import Files
from supervessel import SceneError, load_scene, parse_scene
from supervessel.problems import LONGEST_PROBLEM, LONGEST_WORD, UNSEEN, printable
from support import BALL, ISS_DG, variant
from support.marks import some_at_once
from support.processes import ROOT

HOSTILE = {
    "a terminal sequence": ("\x1b[31mred", r"\x1b[31mred"),
    "a title of a terminal": ("\x1b]0;x\x07", r"\x1b]0;x\x07"),
    "C1": ("a\x9bb", r"a\x9bb"),
    "delete": ("a\x7fb", r"a\x7fb"),
    "line ends": ("a\nb\rc\td", r"a\nb\rc\td"),
    "separators": ("a\u2028b\u2029c\x85d", r"a\u2028b\u2029c\x85d"),
    "right to left": ("a\u202etxt.\u202c", r"a\u202etxt.\u202c"),
    "isolates": ("\u2066a\u2069", r"\u2066a\u2069"),
    "marks": ("\u200ea\u200f\u061c", r"\u200ea\u200f\u061c"),
    "no width": ("a\u200bb\u200c\u200d\u2060\ufeff", r"a\u200bb\u200c\u200d\u2060\ufeff"),
    "fillers": ("a\u3164b\ufe0f\U000e0101", r"a\u3164b\ufe0f\U000e0101"),
    "half a pair": ("a\udcffb", r"a\udcffb"),
}

hostile = pytest.mark.parametrize(("word", "shown"), HOSTILE.values(), ids=HOSTILE)


def assert_shown(text: str) -> None:
    """Asserts that a text is a line which can be printed anywhere."""
    assert text.isprintable(), text
    assert not UNSEEN.search(text)
    assert len(text) <= LONGEST_PROBLEM


@hostile
def test_what_moves_a_cursor_or_cannot_be_seen_is_escaped(word, shown):
    assert printable(word) == shown


def test_words_of_any_language_are_shown_as_they_are():
    assert printable("Müller, Σταθμός, станция, 空间站") == "Müller, Σταθμός, станция, 空间站"


@pytest.mark.parametrize("letter", ["x", "\x1b", "\u202e"])
def test_of_a_long_word_the_ends_are_shown_and_its_length(letter):
    shown = printable(f"begin{letter * 5000}end")
    assert len(shown) == LONGEST_WORD
    assert shown.startswith("begin")
    assert shown.endswith("end")
    assert "... (5008 characters) ..." in shown


def test_what_has_been_shown_once_stays_as_it_is():
    for word, shown in HOSTILE.values():
        assert printable(printable(word)) == shown


PLACES = {
    "key": lambda word: {word: 1},
    "key of a vessel": lambda word: {"vessels.DG": {**ISS_DG["vessels"]["DG"], word: 1}},
    "vessel": lambda word: {"vessels": {**ISS_DG["vessels"], word: {"mass": -1, "ports": {word: {}}}}},
    "broken vessel": lambda word: {"vessels": {**ISS_DG["vessels"], word: {"points": {word: 1}, "ports": 1}}},
    "value": lambda word: {"vessels.DG.mass": word},
    "values": lambda word: {"vessels.DG.mass": [{word: [word]}]},
    "name": lambda word: {"name": word},
    "root": lambda word: {"root": word},
    "law": lambda word: {"rotation.law": word},
    "dock": lambda word: {"docks": [{"ports": [word, f"{word}.{word}"], "name": word}] * 3},
    "inputs": lambda word: {
        "inputs": {key: [word, word] for key in ("mass", "pmi", "docked", "force", word)}
    },
    "pose": lambda word: {"inputs.pose": [f"DG.{word}", f"{word}.nose"], "inputs.motion": ["DG.nose", word]},
    "range": lambda word: {"inputs.range": {word: [0, 1], f"{word}.mass": [2, 1], f"{word}.": {word: 1}}},
    "course": lambda word: {
        "experiment": {"duration": 1, "step": 1, "inputs": {word: [[0, 1]], f"{word}.": {word: 1}}}
    },
    "outputs": lambda word: {"outputs.names": [word, word, f"DG.{word}", f"{word}.origin"]},
}


@hostile
@pytest.mark.parametrize("place", PLACES.values(), ids=PLACES)
def test_a_problem_is_a_line_that_can_be_printed_wherever_the_word_stands(place, word, shown):
    with pytest.raises(SceneError) as caught:
        parse_scene(variant(ISS_DG, place(word)), f"{word}.toml")
    for problem in caught.value.problems:
        assert_shown(problem)
    for line in str(caught.value).split("\n"):
        assert_shown(line)
        assert line.startswith(f"{shown}.toml: ")


@pytest.mark.parametrize("place", PLACES.values(), ids=PLACES)
def test_a_long_word_is_shown_shortened_wherever_it_stands(place):
    with pytest.raises(SceneError) as caught:
        parse_scene(variant(ISS_DG, place("w" * 50_000)))
    for problem in caught.value.problems:
        assert_shown(problem)
        assert "w" * (LONGEST_WORD + 1) not in problem


def test_a_file_that_is_no_toml_is_refused_in_a_line_that_can_be_printed(tmp_path):
    for text in ("\u202e = 1", "a = \u202e", 'a = "\x1b"', "[\u2066]", "a = 1\n'\ufeff' = 2\n'\ufeff' = 3"):
        (tmp_path / "a.toml").write_text(BALL + text)
        with pytest.raises(SceneError) as caught:
            load_scene(tmp_path / "a.toml")
        assert_shown(str(caught.value))


@hostile
@pytest.mark.parametrize("error", [BuildError, TradeError])
def test_other_errors_show_words_the_same_way(error, word, shown):
    for line in str(error(f"{word}: no")).split("\n"):
        assert_shown(line)


SHIPS = {
    "ship": ("GL-01", None),
    "class": ("Glider", None),
    "level": ("0:0.5 1:1.0", "1:{}"),
    "dock": ("0:1,Station", "0:1,{}"),
    "rates": ("0.10 0.20 -0.30", "{} 1"),
}


@hostile
@pytest.mark.parametrize("place", SHIPS)
def test_what_import_says_is_in_lines_that_can_be_printed(tmp_path, place, word, shown):
    files = Files(tmp_path)
    old, new = SHIPS[place]
    text = files.scenario.read_text().replace(old, (new or "{}").format(word + "X"))
    files.scenario.write_bytes(text.encode("utf-8", "surrogatepass"))
    try:
        made = files.made()
    except ValueError as error:
        for line in str(error).split("\n"):
            assert_shown(line)
        return
    for note in made.notes:
        assert_shown(note)
    assert_scene(made.text)


def assert_scene(text: str) -> None:
    """Asserts that an imported scene is read, and that each of its lines can be printed."""
    import tomllib  # noqa: PLC0415

    parse_scene(tomllib.loads(text))
    for line in text.rstrip("\n").split("\n"):
        assert_shown(line)


@pytest.mark.skipif(os.name != "posix", reason="needs file names of any bytes")
@pytest.mark.parametrize(
    "stem", ['a"""\n[x]\ny = 1\n#', "\x1b[31m", "\u202egnp", "a\udcff", "'''", "w" * 200]
)
def test_the_name_of_a_scenario_cannot_break_the_scene_made_of_it(tmp_path, stem):
    files = Files(tmp_path)
    files.scenario = files.scenario.rename(tmp_path / f"{stem}.scn")
    files.table = files.table.rename(tmp_path / f"{stem}.toml")
    made = files.made()
    assert_scene(made.text)
    made.text.encode()
    for note in made.notes:
        assert_shown(note)


def test_an_accepted_scene_brings_nothing_into_xml_that_does_not_belong_there():
    raw = variant(ISS_DG, {"inputs.range": {"DG.mass": [0.0, 3e4]}})
    for fmi in (2, 3):
        sources, description = generate(parse_scene(raw), fmi)
        ET.fromstring(description)
        assert description.isascii()
        assert all(text.isascii() for text in sources.values())


def run(module: str, folder: Path, *arguments: Any, **environment: str) -> subprocess.CompletedProcess[bytes]:
    path = os.pathsep.join((str(ROOT), str(ROOT / "model")))
    command = [sys.executable, "-m", module, *map(os.fspath, arguments)]
    variables = os.environ | {"PYTHONPATH": path} | environment
    return subprocess.run(command, cwd=folder, env=variables, capture_output=True, check=False)


ENVIRONMENTS = {
    "C": {"LC_ALL": "C"},
    "ASCII": {"PYTHONIOENCODING": "ascii"},
    "C, no UTF-8 mode": {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
}

needs_bytes = pytest.mark.skipif(sys.platform != "linux", reason="needs file names of any bytes")


@needs_bytes
@pytest.mark.parametrize("environment", ENVIRONMENTS.values(), ids=ENVIRONMENTS)
@pytest.mark.parametrize("module", some_at_once(["fmu_build", "supervessel"], "supervessel"))
def test_commands_name_any_file_in_any_locale_in_a_line(tmp_path, module, environment):
    name = b"\xff\x1b[31m\xe2\x80\xae\n\xc3\xbc"
    (tmp_path / os.fsdecode(name)).write_text(BALL.replace("2.0", "-2.0", 1) + '"\\u202eü" = 1\n')
    arguments = [name] if module == "fmu_build" else ["import", name, "-o", b"new" + name]
    for given in (arguments, [*arguments, b"more" + name]):
        done = run(module, tmp_path, *given, **environment)
        assert done.returncode == (1 if given is arguments else 2)
        assert done.stdout == b""
        lines = done.stderr.decode("utf-8").rstrip("\n").split("\n")
        assert not any("Traceback" in line for line in lines)
        for line in lines:
            assert_shown(line)


@needs_bytes
def test_a_script_is_given_the_path_as_it_is(tmp_path):
    files = Files(tmp_path)
    name = b"\xff\xe2\x80\xae.toml"
    arguments = ["import", files.scenario, "--config", files.config, "--table", files.table, "-o", name]
    done = run("supervessel", tmp_path, *arguments)
    assert (done.returncode, done.stdout) == (0, name + b"\n")
    assert (tmp_path / os.fsdecode(name)).is_file()


@needs_bytes
def test_a_terminal_is_given_a_path_that_it_does_not_obey(tmp_path):
    import pty  # noqa: PLC0415

    files = Files(tmp_path)
    master, slave = pty.openpty()
    command = [sys.executable, "-m", "supervessel", "import", files.scenario, "--config", files.config]
    command += ["--table", files.table, "-o", "\x1b[31m.toml"]
    path = os.pathsep.join((str(ROOT), str(ROOT / "model")))
    environment = os.environ | {"PYTHONPATH": path}
    done = subprocess.run(
        command, cwd=tmp_path, env=environment, stdout=slave, stderr=subprocess.PIPE, check=False
    )
    os.close(slave)
    assert os.read(master, 1000) == b"\\x1b[31m.toml\r\n"
    os.close(master)
    assert done.returncode == 0
