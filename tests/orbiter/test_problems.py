"""What cannot be imported: each thing by name, with file and line, all at once, never with a traceback."""

import errno
import os
import subprocess
import sys
import tomllib

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from orbiter.files import HUB, SCENARIO, TABLE
from supervessel import parse_scene
from supervessel.orbiter import ScenarioError
from support.processes import ROOT

HUB_FILE = "Config/Vessels/Hub.cfg"
DOCKED = "; docked are Station + GL-01"

SCENARIO_PROBLEMS = {
    "no ships": ([("BEGIN_SHIPS", "BEGIN_SHOPS")], ["side.scn: has no BEGIN_SHIPS"]),
    "ships without end": ([("END_SHIPS", "")], ["side.scn:13: BEGIN_SHIPS without END_SHIPS"]),
    "the last ship without END": (
        [("AROT 0 0 0\nEND", "AROT 0 0 0")],
        ['side.scn:27: "Satellite" without END'],
    ),
    "a ship without END": (
        [("1:0,GL-01\nEND", "1:0,GL-01")],
        [
            'side.scn:21: STATUS of "Station" is there already, in line 15; is an END missing?',
            'side.scn:22: PRPLEVEL of "Station" is there already, in line 18; is an END missing?',
            'side.scn:23: DOCKINFO of "Station" is there already, in line 19; is an END missing?',
        ],
    ),
    "a name twice": (
        [("Satellite", "Station:Hub")],
        ['side.scn:27: "Station" is there already, in line 14'],
    ),
    "a ship without a name": (
        [("Satellite", ":Hub")],
        ['side.scn:27: ":Hub": must be NAME or NAME:CLASS of a vessel'],
    ),
    "a line where a ship should begin": (
        [("Satellite", "AROT 1 2 3")],
        ['side.scn:27: "AROT 1 2 3": must be NAME or NAME:CLASS of a vessel'],
    ),
    "an unknown focus": (
        [("Ship GL-01", "Ship GL-1")],
        [f'side.scn: unknown focus vessel "GL-1" (did you mean "GL-01"?){DOCKED}'],
    ),
    "no focus": (
        [("BEGIN_FOCUS", "BEGIN_FUCUS")],
        [f"side.scn: names no focus vessel; give one by --vessel{DOCKED}"],
    ),
    "a focus that is free": (
        [("Ship GL-01", "Ship Satellite")],
        [f'side.scn: the focus vessel "Satellite" is not docked; give one by --vessel{DOCKED}'],
    ),
    "a vessel that is not there": (
        [("0:1,Station", "0:1,Statoin")],
        [
            'side.scn:24: "GL-01": DOCKINFO 0:1,Statoin: unknown vessel "Statoin" (did you mean "Station"?)',
            'side.scn:19: "Station": DOCKINFO 1:0,GL-01: "GL-01" does not agree: it says 0:1,Statoin (line 24)',
        ],
    ),
    "one side only": (
        [("  DOCKINFO 0:1,Station\n", "")],
        ['side.scn:19: "Station": DOCKINFO 1:0,GL-01: "GL-01" does not agree: it has no DOCKINFO'],
    ),
    "another port on the other side": (
        [("0:1,Station", "0:0,Station")],
        [
            'side.scn:24: "GL-01": DOCKINFO 0:0,Station: "Station" does not agree: it says 1:0,GL-01 (line 19)',
            'side.scn:19: "Station": DOCKINFO 1:0,GL-01: "GL-01" does not agree: it says 0:0,Station (line 24)',
        ],
    ),
    "a dock that cannot be read": (
        [("DOCKINFO 1:0,GL-01", "DOCKINFO 1-0,GL-01 1:0;GL-01")],
        [
            'side.scn:19: "Station": DOCKINFO "1-0,GL-01": must be PORT:PORT,NAME',
            'side.scn:19: "Station": DOCKINFO "1:0": must be PORT:PORT,NAME',
            'side.scn:24: "GL-01": DOCKINFO 0:1,Station: "Station" does not agree: it has no DOCKINFO',
        ],
    ),
    "docked to itself": (
        [("DOCKINFO 1:0,GL-01", "DOCKINFO 1:0,GL-01 0:1,Station")],
        ['side.scn:19: "Station": DOCKINFO 0:1,Station: a vessel cannot be docked to itself'],
    ),
    "a port twice": (
        [("DOCKINFO 1:0,GL-01", "DOCKINFO 1:0,GL-01 1:0,GL-01")],
        ['side.scn:19: "Station": DOCKINFO 1:0,GL-01: port 1 is docked already, by 1:0,GL-01'],
    ),
    "ports that do not exist": (
        [("1:0,GL-01", "7:3,GL-01"), ("0:1,Station", "3:7,Station")],
        [
            'side.scn:19: "Station": DOCKINFO 7:3,GL-01: "GL-01" has no port 3; class "Glider" has port 0 only',
            'side.scn:19: "Station": DOCKINFO 7:3,GL-01: "Station" has no port 7; class "Hub" has ports 0 to 1',
        ],
    ),
    "a class without data": (
        [("GL-01:Glider", "GL-01:Gilder")],
        [
            'side.scn:21: "GL-01": class "Gilder" is not in code.toml or the .cfg files below Config/Vessels',
        ],
    ),
    "levels": (
        [("0:0.5 1:1.0", "0:1.5 1 2:0.5 1:x 1:0.5"), ("0:0.25", "0:nan")],
        [
            "side.scn:23: PRPLEVEL 1.5: a level must be a number from 0 to 1",
            'side.scn:23: PRPLEVEL "1": must be TANK:LEVEL',
            "side.scn:23: PRPLEVEL x: a level must be a number from 0 to 1",
            "side.scn:23: PRPLEVEL 1:0.5: tank 1 has a level already",
            "side.scn:18: PRPLEVEL nan: a level must be a number from 0 to 1",
        ],
    ),
    "fuel": ([("PRPLEVEL 0:0.25", "FUEL")], ["side.scn:18: FUEL : a level must be a number from 0 to 1"]),
    "attitude and rates": (
        [("30.00 -20.00 70.00", "30.00 -20.00"), ("0.10 0.20 -0.30", "0.10 0.20 inf")],
        [
            'side.scn:16: "Station": AROT 30.00 -20.00: must be AROT and three numbers',
            'side.scn:17: "Station": VROT 0.10 0.20 inf: must be VROT and three numbers',
        ],
    ),
}

CLASS_PROBLEMS = {
    "no mass": ([("Mass = 20e3", "")], [f"{HUB_FILE}: no Mass; give the class by --table"]),
    "mass in code": (
        [("Mass = 20e3", "Module = Hub")],
        [f'{HUB_FILE}: no Mass, its module "Hub" has it; give the class by --table'],
    ),
    "numbers": (
        [("20e3", "-20"), ("40 30 20", "40 30"), ("= 500", "= much"), ("Size = 6", "Size = 1e999")],
        [
            f'{HUB_FILE}:2: Mass = "-20": must be a number >= 0 (kg)',
            f'{HUB_FILE}:4: Inertia = "40 30": must be three numbers >= 0 (m2)',
            f'{HUB_FILE}:3: Size = "1e999": must be a number >= 0 (m)',
            f'{HUB_FILE}:5: MaxFuel = "much": must be a number >= 0 (kg)',
        ],
    ),
    "nothing to guess moments from": (
        [("Size", "Sise"), ("Inertia", "Inerta")],
        [f"{HUB_FILE}: neither Inertia nor Size, from which Orbiter would guess it"],
    ),
    "another class to follow": (
        [("Size = 6", "BaseClass = Vessels\\Base.cfg\nSize = 6")],
        [f'{HUB_FILE}:3: BaseClass = "Vessels\\\\Base.cfg" is not followed; give the class by --table'],
    ),
    "a port of eight numbers": (
        [("1 0 0   0 1 0", "1 0 0   0 1")],
        [f'{HUB_FILE}:8: "3 0 -1  1 0 0   0 1": must begin with nine numbers: position, direction, rotation'],
    ),
    "docks without end": ([("END_DOCKLIST", "")], [f"{HUB_FILE}: BEGIN_DOCKLIST without END_DOCKLIST"]),
    "a docked port with no direction": (
        [("1 0 0   0 1 0", "0 0 0   0 1 0")],
        [f"{HUB_FILE}:8: port 1.direction = [0.0, 0.0, 0.0]: must have a length greater than 0"],
    ),
    "a docked port whose alignment leans": (
        [("1 0 0   0 1 0", "1 0 0   1 1 0")],
        [
            f"{HUB_FILE}:8: port 1.alignment = [1.0, 1.0, 0.0]: must be perpendicular to direction = [1.0, 0.0, "
            "0.0], but is 0.785398163 rad off; at most 0.001 rad",
        ],
    ),
    "a port at the end of the world": (
        [("3 0 -1", "3e200 0 -1")],
        [
            "side.scn: the scene made of it: vessels: masses, positions or moments are too large: the composite's "
            "inertia is not finite"
        ],
    ),
}

TABLE_PROBLEMS = {
    "no TOML": ([("[Glider]", "[Glider")], "code.toml: is not TOML: Expected ']'"),
    "keys and numbers": (
        [
            ("empty_mass = 11000.0", 'empty_mas = "1"'),
            ("12000.0, 600.0", "true"),
            ("15.5, ", ""),
            ("0.5, 10", "0.5"),
        ],
        [
            'code.toml: [Glider]: unknown key "empty_mas" (did you mean "empty_mass"?)',
            "code.toml: [Glider] propellant = [true]: must be a list of numbers >= 0 (kg)",
            "code.toml: [Glider] pmi = [22.1, 7.7]: must be three numbers >= 0 (m2)",
            "code.toml: [Glider]: empty_mass is missing",
            "code.toml: [Glider] dock, port 0 = [0, -0.5, 0, 0, 1, 0, 1, 0]: must be nine numbers: position, "
            "direction, rotation",
        ],
    ),
    "no moments": ([("pmi = [15.5, 22.1, 7.7]", "")], ["code.toml: [Glider]: neither pmi nor size"]),
    "no table": ([("[Glider]", "Glider = 3\n[Other]")], ["code.toml: [Glider]: must be a table"]),
    "no ports": (
        [("dock = [[0, -0.5, 10, 0, 0, 1, 0, 1, 0]]", "")],
        ['side.scn:19: "Station": DOCKINFO 1:0,GL-01: "GL-01" has no port 0; class "Glider" has no ports'],
    ),
}


@pytest.mark.parametrize(("changes", "expected"), SCENARIO_PROBLEMS.values(), ids=SCENARIO_PROBLEMS)
def test_a_scenario_that_cannot_be_used_is_refused_by_line(files, changes, expected):
    files.replace(files.scenario, *changes)
    assert sorted(files.problems()) == sorted(expected)


@pytest.mark.parametrize(("changes", "expected"), CLASS_PROBLEMS.values(), ids=CLASS_PROBLEMS)
def test_a_class_that_cannot_be_used_is_refused_by_line(files, changes, expected):
    files.replace(files.hub, *changes)
    assert sorted(files.problems()) == sorted(expected)


@pytest.mark.parametrize(("changes", "expected"), TABLE_PROBLEMS.values(), ids=TABLE_PROBLEMS)
def test_a_table_that_cannot_be_used_is_refused_by_key(files, changes, expected):
    files.replace(files.table, *changes)
    if isinstance(expected, str):  # the parser's own words differ between versions
        assert files.problems()[0].startswith(expected[: expected.index("TOML: ")])
    else:
        assert sorted(files.problems()) == sorted(expected)


def test_docks_that_close_a_loop_are_refused_with_the_way_round(files):
    files.replace(files.hub, ("END_DOCKLIST", "0 9 0  0 1 0  1 0 0\nEND_DOCKLIST"))
    files.replace(
        files.scenario,
        ("DOCKINFO 1:0,GL-01", "DOCKINFO 1:0,GL-01 0:0,B 2:1,C"),
        (
            "Satellite",
            "B:Hub\nPRPLEVEL 0:1\nDOCKINFO 0:0,Station 1:0,C\nEND\n"
            "C:Hub\nPRPLEVEL 0:1\nDOCKINFO 0:1,B 1:2,Station\nEND\nSatellite",
        ),
    )
    assert files.problems() == [
        'side.scn:29: "B": DOCKINFO 1:0,C: closes a loop; B - Station - C are joined already'
    ]


def test_two_docks_between_the_same_vessels_close_a_loop(files):
    files.replace(files.table, ("dock = [", "dock = [[0, 0, -5, 0, 0, -1, 0, 1, 0], "))
    files.replace(
        files.scenario, ("1:0,GL-01", "1:0,GL-01 0:1,GL-01"), ("0:1,Station", "0:1,Station 1:0,Station")
    )
    assert files.problems() == [
        'side.scn:19: "Station": DOCKINFO 0:1,GL-01: closes a loop; Station - GL-01 are joined already'
    ]


def test_problems_of_all_files_come_at_once(files):
    files.replace(files.hub, ("20e3", "heavy"))
    files.replace(files.table, ("empty_mass", "mass"))
    files.replace(files.scenario, ("0:0.25", "0:25"), ("30.00", "thirty"))
    assert len(files.problems()) == 5


def test_a_problem_of_another_assembly_does_not_matter(files):
    files.replace(files.scenario, ("AROT 0 0 0", "AROT 0\nPRPLEVEL 0:7\nDOCKINFO 0:0,Nobody"))
    assert list(files.raw()["vessels"]) == ["GL_01", "Station"]


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (SCENARIO.replace("Hub", "Hüb").encode("latin-1"), "side.scn:14: is not UTF-8 text (byte 0xfc)"),
        (SCENARIO.encode("utf-16"), "side.scn:1: is not UTF-8 text (byte 0xff)"),
        (SCENARIO.replace("END_DESC", "\0").encode(), "side.scn:3: is not UTF-8 text (byte 0x00)"),
        (b"", "side.scn: has no BEGIN_SHIPS"),
    ],
    ids=["latin-1", "UTF-16", "a null", "empty"],
)
def test_another_encoding_is_refused_with_line_and_byte(files, content, expected):
    files.scenario.write_bytes(content)
    assert files.problems() == [expected]


def test_line_ends_of_windows_and_a_byte_order_mark_change_nothing(files):
    before = files.made().text
    for file in (files.scenario, files.hub, files.table):
        file.write_bytes(b"\xef\xbb\xbf" + file.read_text().replace("\n", "\r\n").encode())
    assert files.made().text == before


def test_files_that_are_not_there_are_named_together(files):
    files.scenario.unlink()
    files.table.unlink()
    files.hub.unlink()
    files.config.rmdir()
    assert files.problems() == [
        f"side.scn: cannot be read: {os.strerror(errno.ENOENT)}",
        f"code.toml: cannot be read: {os.strerror(errno.ENOENT)}",
        "Config/Vessels: is no folder that can be read",
    ]


def test_a_class_in_two_files_is_refused_with_both(files):
    for folder in ("A", "B"):
        (files.config / folder).mkdir()
        (files.config / folder / "Hub.cfg").write_text(HUB)
    files.hub.unlink()
    assert files.problems() == [
        'side.scn:14: "Station": class "Hub" is in Config/Vessels/A/Hub.cfg and in Config/Vessels/B/Hub.cfg'
    ]


MANGLED = st.lists(
    st.tuples(
        st.integers(0, 2),
        st.sampled_from(["cut", "copy", "put"]),
        st.floats(0.0, 1.0),
        st.floats(0.0, 0.2),
        st.text(max_size=6)
        | st.sampled_from(["\n", "END\n", ":", "1:0,", "nan", "1e999", "-", "DOCKINFO", "["]),
    ),
    min_size=1,
    max_size=6,
)


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(MANGLED)
def test_mangled_files_give_a_scene_or_problems_and_never_a_traceback(files, steps):
    texts = [SCENARIO, HUB, TABLE]
    for which, kind, at, length, text in steps:
        old = texts[which]
        start = round(at * len(old))
        end = start + round(length * len(old))
        new = {"cut": "", "copy": old[start:end] * 2, "put": text}[kind]
        texts[which] = old[:start] + new + old[start if kind == "put" else end :]
    for file, text in zip((files.scenario, files.hub, files.table), texts, strict=True):
        file.write_bytes(text.encode("utf-8", "surrogatepass"))
    try:
        made = files.made()
    except ScenarioError as error:
        bad = [problem for problem in error.problems if not problem.startswith(str(files.folder))]
        if bad or not error.problems:
            raise AssertionError(f"refused without a place: {bad}") from None
    else:
        parse_scene(tomllib.loads(made.text))


def run(files, *arguments):
    """Runs the command in the folder of the files."""
    return subprocess.run(
        [sys.executable, "-m", "supervessel", "import", *map(str, arguments)],
        cwd=files.folder,
        env=os.environ | {"PYTHONPATH": os.pathsep.join((str(ROOT), str(ROOT / "model")))},
        capture_output=True,
        text=True,
        check=False,
    )


GIVEN = ("side.scn", "--config", "Config", "--table", "code.toml", "-o", "side.toml")


def test_the_command_writes_the_scene_and_prints_its_path(files):
    done = run(files, *GIVEN)
    assert (done.returncode, done.stdout, done.stderr) == (0, "side.toml\n", "")
    text = (files.folder / "side.toml").read_text()
    assert parse_scene(tomllib.loads(text)).root == "GL_01"


def test_the_command_says_on_stderr_what_was_missing(files):
    files.replace(files.scenario, ("  PRPLEVEL 0:0.25\n", ""))
    done = run(files, *GIVEN, "--vessel", "Station", "--convention", "orbiter")
    assert (done.returncode, done.stdout) == (0, "side.toml\n")
    assert done.stderr == 'note: side.scn:14: "Station" has neither PRPLEVEL nor FUEL: taken as full\n'
    raw = tomllib.loads((files.folder / "side.toml").read_text())
    assert (raw["root"], raw["convention"]) == ("Station", "orbiter")


def test_a_failure_names_every_problem_and_leaves_an_old_scene_alone(files):
    (files.folder / "side.toml").write_text("old")
    files.replace(files.scenario, ("0:0.25", "0:25"), ("30.00", "thirty"))
    done = run(files, *GIVEN, "--force")
    assert (done.returncode, done.stdout) == (1, "")
    assert [line.partition(" ")[0] for line in done.stderr.splitlines()] == ["side.scn:18:", "side.scn:16:"]
    assert (files.folder / "side.toml").read_text() == "old"
    assert sorted(path.name for path in files.folder.iterdir()) == [
        "Config",
        "code.toml",
        "side.scn",
        "side.toml",
    ]


@pytest.mark.parametrize(
    ("output", "message"),
    [
        ("side.scn", "side.scn: cannot be written: is a file that is read for it: side.scn"),
        ("code.toml", "code.toml: cannot be written: is a file that is read for it: code.toml"),
        (
            "Config/../Config/Vessels/Hub.cfg",
            "Config/../Config/Vessels/Hub.cfg: cannot be written: is there already; --force replaces it",
        ),
        ("none/side.toml", f"none/side.toml: cannot be written: {os.strerror(errno.ENOENT)}: none"),
        (".", ".: cannot be written: is a folder, not a regular file"),
    ],
)
def test_an_output_that_cannot_be_is_refused(files, output, message):
    done = run(files, *GIVEN[:-1], output)
    assert (done.returncode, done.stdout, done.stderr) == (1, "", f"{message}\n")
    assert files.made().text  # what was read is as it was


@pytest.mark.parametrize(
    "arguments",
    [(), ("side.scn",), (*GIVEN, "--convention", "rigid"), (*GIVEN, "more.scn"), ("-o", "x.toml")],
    ids=["nothing", "no output", "another convention", "two scenarios", "no scenario"],
)
def test_wrong_usage_ends_with_status_2(files, arguments):
    done = run(files, *arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert "usage: supervessel" in done.stderr
