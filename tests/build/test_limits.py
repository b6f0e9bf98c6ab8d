"""Input of any size, depth and length is read in seconds or refused by what is too much of it."""

import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from supervessel import Scene, SceneError, load_scene, parse_scene
from supervessel.orbiter import ScenarioError, import_scenario
from supervessel.problems import MOST_PROBLEMS, MOST_SUGGESTIONS
from supervessel.scene.names import LONGEST_NAME, MOST_MOVING, MOST_VESSELS
from supervessel.shell.reading import DEEPEST, LARGEST_TEXT, LARGEST_TOML, LONGEST_LINE, MOST_PARTS
from support import BALL, ISS_DG, body, variant

WATCHDOG = 300
"""Seconds: what is quadratic in the size of its input takes many times that, everything else a few."""

PORT = "position = [0, 0, 0]\ndirection = [1, 0, 0]\nalignment = [0, 1, 0]\n"

needs_posix = pytest.mark.skipif(os.name != "posix", reason="needs alarms, FIFOs and device files")


@pytest.fixture(autouse=True)
def watchdog() -> Iterator[None]:
    """Ends a test that takes too long; where there are no alarms it may take as long as it likes."""
    if os.name != "posix":
        yield
        return
    with _alarm(WATCHDOG):
        yield


@contextmanager
def _alarm(seconds: int) -> Iterator[None]:
    import signal  # noqa: PLC0415

    def ring(*_: object) -> None:
        raise TimeoutError(f"more than {seconds} s")

    before = signal.signal(signal.SIGALRM, ring)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def refused(folder: Path, text: str | bytes) -> list[str]:
    """Returns the problems of a scene file with this text."""
    path = folder / "ball.toml"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    return list(caught.value.problems)


def loaded(folder: Path, text: str) -> Scene:
    path = folder / "ball.toml"
    path.write_text(text)
    return load_scene(path)


def dotted(parts: int) -> str:
    return ".".join("a" * parts)


TOO_MUCH = {
    "a key of 400 parts": (f"{BALL}{dotted(400)} = 1\n", "line 6: a key of 400 parts"),
    "a key of 20000 parts": (f"{BALL}{dotted(20000)} = 1\n", "line 6: a key of 20000 parts"),
    "a key of one part too many": (
        f"{BALL}\n{dotted(MOST_PARTS + 1)} = 1\n",
        f"line 7: a key of {MOST_PARTS + 1} parts; at most {MOST_PARTS} are possible",
    ),
    "a table of 400 parts": (f"{BALL}[ {dotted(400)} ]\n", "line 6: a key of 400 parts"),
    "a key of 400 quoted parts": (
        BALL + " . ".join(['"a.b"', "'c'"] * 200) + " = 1\n",
        "line 6: a key of 400 parts",
    ),
    "a key after a string with quotes": (
        f'{BALL}x = """ "" \\""" # [ """\n{dotted(400)} = 1\n',
        "line 7: a key of 400 parts",
    ),
    "480 brackets": (
        BALL.replace("mass = 2.0", f"mass = {'[' * 480}{']' * 480}"),
        f"line 4: brackets 480 deep; at most {DEEPEST} are possible",
    ),
    "one bracket too many": (
        f"{BALL}x = {'[' * (DEEPEST + 1)}{']' * (DEEPEST + 1)}\n",
        f"line 6: brackets {DEEPEST + 1} deep; at most {DEEPEST} are possible",
    ),
    "brackets over lines, with comments and strings between": (
        BALL + "x = " + '[ # ]\n"]", \'"\', """]""",\n' * 100 + "]" * 100,
        "line 38: brackets 100 deep",
    ),
    "brackets closed in strings alone": (BALL + "x = " + '["]",\n' * 100, "line 22: brackets 100 deep"),
    "braces": (f"{BALL}x = {'{a = ' * 480}1{'}' * 480}\n", "line 6: brackets 480 deep"),
    "brackets never closed": (f"{BALL}x = {'[' * 5000}\n", "line 6: brackets 5000 deep"),
    "a long line": (
        f"{BALL}# {'x' * LONGEST_LINE}\n",
        f"line 6: {LONGEST_LINE + 2} characters; a line has at most {LONGEST_LINE}",
    ),
    "a large file": (
        BALL + "#\n" * (LARGEST_TOML // 2),
        f"is longer than {LARGEST_TOML} bytes; at most that many are read",
    ),
}


@pytest.mark.parametrize(("text", "expected"), TOO_MUCH.values(), ids=TOO_MUCH)
def test_what_is_too_much_of_a_file_is_refused_with_its_line_and_what_is_possible(tmp_path, text, expected):
    (line,) = refused(tmp_path, text)
    assert line.startswith(expected)


@pytest.mark.parametrize(("text", "expected"), TOO_MUCH.values(), ids=TOO_MUCH)
def test_a_table_of_classes_has_the_same_limits(tmp_path, text, expected):
    (tmp_path / "s.scn").write_text("BEGIN_SHIPS\nA\nEND\nEND_SHIPS\n")
    table = tmp_path / "code.toml"
    table.write_text(text)
    with pytest.raises(ScenarioError) as caught:
        import_scenario(tmp_path / "s.scn", "A", table=table)
    (line,) = caught.value.problems
    place, _, rest = expected.partition(": ")
    number = place.removeprefix("line ")
    assert line.startswith(
        f"{table}:{number}: {rest}" if place.startswith("line ") else f"{table}: {expected}"
    )


HARMLESS = {
    "dots and brackets in comments": f"# {dotted(400)}\n{BALL}# {'[' * 99}\n[rotation] # {'{' * 99}\n",
    "many numbers in a line": f"{BALL}[experiment]\nduration = 1\nstep = 1\n[experiment.inputs]\n"
    f'"torque[1]" = [{", ".join(f"[{i}.0, 1.5]" for i in range(500))}]\n[inputs]\ntorque = true\n',
    "a byte order mark": f"\ufeff{BALL}",
    "line ends of Windows": BALL.replace("\n", "\r\n"),
}


@pytest.mark.parametrize("text", HARMLESS.values(), ids=HARMLESS)
def test_what_only_looks_like_too_much_is_read(tmp_path, text):
    assert loaded(tmp_path, text).root == "B"


def test_brackets_in_strings_neither_open_nor_close(tmp_path):
    strings = "\n".join((f'"""{"[" * 40}""",', "'''\n[[[[' '' ]]]]''',", '"\\"]", \'[\',')) * 20
    problems = refused(tmp_path, f"{BALL}x = [\n{strings}]\n")
    assert len(problems) == 1
    assert 'vessels.B: unknown key "x"' in problems[0]


def many(count: int, ports: int = 4) -> str:
    """Returns a scene of so many vessels in a row, constant."""
    vessels = [
        f"[vessels.V{i}]\nmass = 1000.0\npmi = [1.0, 2.0, 2.5]\n"
        + "".join(f"[vessels.V{i}.ports.P{j}]\n{PORT}" for j in range(ports))
        for i in range(count)
    ]
    docks = [f'[[docks]]\nports = ["V{i - 1}.P1", "V{i}.P0"]\n' for i in range(1, count)]
    return 'name = "many"\nroot = "V0"\n' + "".join(vessels + docks)


def test_a_thousand_vessels_with_four_ports_each_are_read(tmp_path):
    assert len(loaded(tmp_path, many(1000)).vessels) == 1000


def test_too_many_vessels_are_refused_with_their_count(tmp_path):
    count = MOST_VESSELS + 1
    text = 'name = "a"\nroot = "v1"\n' + "".join(f"[vessels.v{i}]\n" for i in range(count))
    assert refused(tmp_path, text) == [f"vessels: {count} of them; at most {MOST_VESSELS} are possible"]


def test_too_many_moving_ports_are_refused_with_their_count():
    raw = variant(ISS_DG, {"inputs.pose": [f"A.p{i}" for i in range(MOST_MOVING)], "inputs.docked": ["d"]})
    with pytest.raises(
        SceneError, match=f"inputs.pose and inputs.docked: {MOST_MOVING + 1} of them; at most"
    ):
        parse_scene(raw)


def chain(count: int) -> dict[str, Any]:
    """Returns a chain of vessels whose docks all open and close."""
    port = {"position": [0, 0, 0], "direction": [1, 0, 0], "alignment": [0, 1, 0]}
    vessel = {"mass": 1.0, "pmi": [1.0, 1.0, 1.0], "ports": {"a": port, "b": port}}
    docks = [{"name": f"d{i}", "ports": [f"v{i}.a", f"v{i + 1}.b"]} for i in range(count - 1)]
    vessels = {f"v{i}": vessel for i in range(count)}
    inputs = {"docked": [dock["name"] for dock in docks], "torque": True}
    return {"name": "chain", "root": "v0", "vessels": vessels, "docks": docks, "inputs": inputs}


def test_a_long_chain_of_docks_that_open_is_refused():
    with pytest.raises(SceneError, match="ways over more than 50000 docks; at most that many are possible"):
        parse_scene(chain(900))


def word(number: int) -> str:
    """Returns a name that differs from all others and is like them all."""
    return f"{number:020b}".replace("0", "a").replace("1", "b")


QUADRATIC = {
    "names of inputs": {"inputs.mass": [word(i) for i in range(2000)]},
    "names of outputs": {"outputs.names": [word(i) for i in range(20000)]},
    "names of ranges": {"inputs.range": {word(i): [0.0, 1.0] for i in range(20000)}},
    "names of courses": {
        "experiment": {"duration": 1.0, "step": 1.0, "inputs": {word(i): [[0, 1]] for i in range(20000)}}
    },
    "keys": {word(i): 1 for i in range(20000)},
    "ports of docks": {
        "vessels.DG.ports": {word(i): {} for i in range(20000)},
        "docks": [{"ports": [f"DG.{word(i)}x", "ISS.P2"]} for i in range(20000)],
    },
    "names of docks": {
        "docks": [{"ports": ["ISS.P2", "DG.nose"], "name": word(i)} for i in range(20000)],
        "inputs.docked": [f"{word(i)}x" for i in range(990)],
    },
}


@pytest.mark.parametrize("changes", QUADRATIC.values(), ids=QUADRATIC)
def test_thousands_of_wrong_names_are_told_in_seconds_and_suggestions_for_the_first(changes):
    with pytest.raises(SceneError) as caught:
        parse_scene(variant(ISS_DG, changes))
    problems = caught.value.problems
    assert len(problems) > 500
    assert sum("did you mean" in problem or "known:" in problem for problem in problems) <= MOST_SUGGESTIONS
    shown = str(caught.value).split("\n")
    assert len(shown) == MOST_PROBLEMS + 1
    assert shown[-1] == f"scene: ... and {len(problems) - MOST_PROBLEMS} more problems"


def test_a_thousand_ranges_of_a_thousand_inputs_are_checked_in_seconds():
    raw = variant(ISS_DG, {"inputs": {"mass": [f"v{i}" for i in range(1900)]}})
    raw["vessels"] |= {f"v{i}": {"mass": 1.0, "pmi": [1, 1, 1], "ports": {}} for i in range(1900)}
    ports = raw["vessels"]["ISS"]["ports"]
    for i in range(1900):
        ports[f"q{i}"] = ports["P2"]
        raw["vessels"][f"v{i}"]["ports"]["p"] = ports["P2"]
        raw["docks"].append({"ports": [f"ISS.q{i}", f"v{i}.p"]})
    raw["inputs"]["range"] = {f"v{i}.mass": [2.0, 3.0] for i in range(1900)}
    with pytest.raises(SceneError) as caught:
        parse_scene(raw)
    assert len(caught.value.problems) == 1900


def test_values_of_any_depth_and_size_are_shown_shortened():
    deep: Any = 1
    for _ in range(5000):
        deep = [deep]
    problems = []
    for value in (deep, [1] * 10**6, "x" * 10**6, {"a": deep}):
        with pytest.raises(SceneError) as caught:
            parse_scene(variant(ISS_DG, {"vessels.DG.mass": value}))
        problems += caught.value.problems
    assert len(problems) == 4
    assert max(map(len, problems)) < 300


NAMES = {
    "name": {"name": "n" * 300},
    "vessel": {f"vessels.{'v' * 300}": {"mass": 1.0, "pmi": [1.0, 1.0, 1.0]}},
    "port": {f"vessels.DG.ports.{'p' * 300}": ISS_DG["vessels"]["DG"]["ports"]["nose"]},
    "point": {f"vessels.DG.points.{'p' * 300}": {"position": [0, 0, 0]}},
    "dock": {"docks": [{"ports": ["ISS.P2", "DG.nose"], "name": "d" * 300}]},
}


@pytest.mark.parametrize("changes", NAMES.values(), ids=NAMES)
def test_a_name_of_300_letters_is_refused_with_its_place(changes):
    with pytest.raises(SceneError) as caught:
        parse_scene(variant(ISS_DG, changes))
    rule = f"has 300 characters; a name has at most {LONGEST_NAME}"
    assert any(rule in problem for problem in caught.value.problems)


def test_a_name_as_long_as_possible_is_accepted():
    assert len(parse_scene(variant(body(), {"name": "n" * LONGEST_NAME})).name) == LONGEST_NAME


@pytest.mark.parametrize("name", ["NUL", "con", "Aux", "prn", "com1", "COM0", "lpt9", "LPT3"])
def test_a_scene_cannot_have_the_name_of_a_device(name):
    with pytest.raises(SceneError, match=f'name = "{name}": must be another'):
        parse_scene(variant(body(), {"name": name}))


@pytest.mark.parametrize("name", ["nul_", "con1", "com", "com10", "auxiliary"])
def test_a_name_that_only_begins_like_a_device_is_accepted(name):
    assert parse_scene(variant(body(), {"name": name})).name == name


@needs_posix
@pytest.mark.parametrize("path", ["/dev/zero", "/dev/null", "/dev/random"])
def test_a_device_is_refused_as_a_scene(path):
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    assert caught.value.problems == (
        "is no regular file; only those are read, and pipes as /dev/stdin or /dev/fd/N",
    )


@needs_posix
def test_a_fifo_without_a_writer_is_refused_wherever_a_file_is_read(tmp_path):
    fifo, scenario = tmp_path / "fifo", tmp_path / "s.scn"
    os.mkfifo(fifo)
    scenario.write_text("BEGIN_SHIPS\nA\nEND\nEND_SHIPS\n")
    with pytest.raises(SceneError, match="is no regular file"):
        load_scene(fifo)
    for arguments in ({"scenario": fifo}, {"scenario": scenario, "table": fifo}):
        with pytest.raises(ScenarioError, match="is no regular file"):
            import_scenario(**arguments)
    (tmp_path / "A.cfg").symlink_to(fifo)
    with pytest.raises(ScenarioError, match="is no regular file"):
        import_scenario(scenario, "A", config=[tmp_path])


@needs_posix
def test_a_scene_is_read_through_a_pipe_on_standard_input():
    script = "from supervessel import load_scene; print(load_scene('/dev/stdin').root)"
    done = subprocess.run(
        [sys.executable, "-c", script], input=BALL, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "B\n", "")


@needs_posix
def test_a_pipe_that_never_ends_is_refused_at_the_limit(tmp_path):
    read, write = os.pipe()

    def fill() -> None:
        try:
            while True:
                os.write(write, b"#" * 4096)
        except BrokenPipeError:
            os.close(write)

    writer = threading.Thread(target=fill)
    writer.start()
    with pytest.raises(SceneError, match=f"is longer than {LARGEST_TOML} bytes"):
        load_scene(f"/dev/fd/{read}")
    os.close(read)
    writer.join()


def test_a_name_that_no_file_can_have_is_refused():
    with pytest.raises(SceneError, match="cannot be read: no file has such a name"):
        load_scene("a\0b.toml")


def scenario(ships: str, focus: str = "S0") -> str:
    return f"BEGIN_FOCUS\nShip {focus}\nEND_FOCUS\nBEGIN_SHIPS\n{ships}END_SHIPS\n"


HUB = "Mass = 1\nInertia = 1 1 1\nBEGIN_DOCKLIST\n0 0 1 0 0 1 0 1 0\n0 0 -1 0 0 -1 0 1 0\nEND_DOCKLIST\n"


def imported(folder: Path, text: str, hub: str = HUB) -> tuple[str, ...]:
    """Returns the problems of a scenario of ships of class Hub, () where it is imported."""
    (folder / "Hub.cfg").write_text(hub)
    path = folder / "s.scn"
    path.write_text(text)
    try:
        import_scenario(path, config=[folder])
    except ScenarioError as error:
        shown = str(error).split("\n")
        assert len(shown) <= MOST_PROBLEMS + 1
        return error.problems
    return ()


def row(count: int) -> str:
    """Returns so many ships in a row, the last docked to the one before it twice, for a loop."""
    ships = []
    for i in range(count):
        mates = ([f"0:1,S{i - 1}"] if i else []) + ([f"1:0,S{i + 1}"] if i < count - 1 else [])
        ships.append(f"S{i}:Hub\nDOCKINFO {' '.join(mates)}\nEND\n")
    return "".join(ships)


def test_a_row_of_a_thousand_ships_is_imported(tmp_path):
    assert imported(tmp_path, scenario(row(1000))) == ()


def test_too_many_docked_ships_are_refused_with_their_count(tmp_path):
    problems = imported(tmp_path, scenario(row(20000)))
    assert [p.removeprefix(f"{tmp_path}/") for p in problems] == [
        f"s.scn: 20000 vessels are docked; at most {MOST_VESSELS} are possible"
    ]


def test_thousands_of_docks_that_close_loops_are_told_in_seconds(tmp_path):
    count = 1500
    ships = [
        f"S{i}:Hub\nDOCKINFO "
        + " ".join(f"{k}:{k},S{(i + 1 - 2 * (i % 2)) % count} {k + 9}:{k + 9},S{i - 1}" for k in range(9))
        + "\nEND\n"
        for i in range(count)
    ]
    problems = imported(tmp_path, scenario("".join(ships)))
    assert len(problems) > count


def test_thousands_of_unknown_mates_are_told_in_seconds_and_suggestions_for_the_first(tmp_path):
    mates = "".join(f"DOCKINFO {' '.join(f'{k}:0,{word(9 * i + k)}' for k in range(9))}\n" for i in range(1))
    ships = "".join(f"{word(i)}x:Hub\n{mates}END\n" for i in range(5000))
    problems = imported(tmp_path, scenario(ships, f"{word(1)}x"))
    assert sum("did you mean" in problem for problem in problems) <= MOST_SUGGESTIONS


def test_names_of_ships_that_make_the_same_identifier_are_numbered_in_seconds(tmp_path):
    marks = [chr(0x4E00 + i) for i in range(1800)]
    ships = "".join(
        f"S{mark}:Hub\nDOCKINFO "
        + (f"0:1,S{marks[i - 1]} " if i else "")
        + (f"1:0,S{marks[i + 1]}" if i < len(marks) - 1 else "")
        + "\nEND\n"
        for i, mark in enumerate(marks)
    )
    assert imported(tmp_path, scenario(ships, f"S{marks[0]}")) == ()


def test_a_ship_with_a_name_of_300_letters_is_imported_under_a_shorter_one(tmp_path):
    name = "N" * 300
    text = scenario(f"{name}:Hub\nDOCKINFO 0:0,B\nEND\nB:Hub\nDOCKINFO 0:0,{name}\nEND\n", "B")
    assert imported(tmp_path, text) == ()


def test_a_scenario_with_the_name_of_a_device_makes_a_scene_with_another(tmp_path):
    (tmp_path / "Hub.cfg").write_text(HUB)
    path = tmp_path / "CON.scn"
    path.write_text(scenario(row(2)))
    assert 'name = "scene_con"' in import_scenario(path, config=[tmp_path]).text


@pytest.mark.parametrize(
    ("hub", "expected"),
    [
        (
            HUB.replace("0 0 1 0", "0 0 1 0 0 1 0 1 0\n" * 5000 + "0 0 1 0"),
            "docking ports; a class has at most",
        ),
        (
            HUB + "".join(f"PropellantResource{i + 1} = 1\n" for i in range(5000)),
            "tanks; a class has at most",
        ),
        (HUB + "x" * (LONGEST_LINE + 1), f"a line has at most {LONGEST_LINE}"),
        (HUB + ";\n" * (LARGEST_TEXT // 2), f"is longer than {LARGEST_TEXT} bytes"),
    ],
    ids=["ports", "tanks", "a line", "the file"],
)
def test_a_class_with_too_much_of_something_is_refused_once(tmp_path, hub, expected):
    (problem,) = imported(tmp_path, scenario(row(50)), hub)
    assert expected in problem
