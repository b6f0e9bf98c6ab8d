"""Scenes and Orbiter's files, spoilt at random: refused in lines that can be printed, or good to be built.

A few hundred with the other tests, thousands with the marker; a case is known by its number.
"""

import os
import random
import subprocess
import sys
import tempfile
import tomllib
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from fmu_build.generate.model import generate
from orbiter.files import HUB, SCENARIO, TABLE
from supervessel import SceneError, load_scene, parse_scene
from supervessel.orbiter import ScenarioError, import_scenario
from supervessel.problems import LONGEST_PROBLEM
from surroundings.mutations import mutated

ROOT = Path(__file__).parents[2]
ORBITER = ROOT.parent / "shared" / "data" / "orbiter"

SECONDS = 10
"""Of a processor, at most, for a case."""
BATCH = 50
FEW, MANY = 6, 80
"""Batches with the other tests, and with the marker."""
SAMPLE = 25
"""Of the scenes that are accepted one in so many goes on to C and XML."""
COMMANDS = 30

SPINNING = """\
name = "spinning"
root = "hub"
[vessels.hub]
mass = 4000.0
inertia = [[9000.0, 200.0, 0.0], [200.0, 8000.0, 0.0], [0.0, 0.0, 5000.0]]
centre_of_mass = [0.0, 0.1, -0.4]
ports.side = { position = [1, 0, 0], direction = [1, 0, 0], alignment = [0, 1, 0] }
points.jet = { position = [0.0, 2.0, 0.0] }
[vessels.pod]
mass = 300.0
pmi = [1.0, 1.5, 2.0]
ports.a = { position = [0, 0, 1], direction = [0, 0, 1], alignment = [0, 1, 0] }
[[docks]]
name = "berth"
ports = ["hub.side", "pod.a"]
docked = false
[inputs]
mass = ["pod"]
docked = ["berth"]
force = ["hub.jet"]
vessel_torque = ["pod"]
torque = true
[inputs.range]
"pod.mass" = [100.0, 300.0]
[rotation]
law = "tensor"
propagator = "dop853"
tolerance = 1e-9
angular_velocity = [0.01, 0.0, 0.1]
attitude = [1.0, 0.0, 0.0, 0.0]
[experiment]
duration = 60.0
step = 0.5
[experiment.inputs]
"torque[1]" = [[0.0, 1.0], [10.0, 0.0]]
"berth.docked" = [[0.0, false], [30.0, true]]
[outputs]
names = ["mass", "inertia", "principal_moments", "error_estimate", "pod.origin"]
"""


def scenes() -> list[str]:
    """Returns the texts of scenes to start from."""
    return [SPINNING, *(path.read_text() for path in sorted((ROOT / "examples").glob("*.toml")))]


@contextmanager
def _bounded() -> Iterator[None]:
    """Raises TimeoutError within it after SECONDS of this processor's work, where there are such timers."""
    if not hasattr(os, "fork"):
        yield
        return
    import signal  # noqa: PLC0415

    def ring(*_: object) -> None:
        raise TimeoutError(f"more than {SECONDS} s")

    before = signal.signal(signal.SIGPROF, ring)
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def told(problems: tuple[str, ...]) -> None:
    """Asserts that there are problems, each a line that can be printed."""
    assert problems
    for problem in problems:
        assert problem.strip()
        assert problem.isprintable()
        assert len(problem) <= LONGEST_PROBLEM


def outcome(case: int, read: Callable[[], object]) -> str:
    """Returns what came of a case: "accepted", "refused", or what must never be."""
    try:
        with _bounded(), warnings.catch_warnings():
            warnings.simplefilter("error")
            read()
    except (SceneError, ScenarioError) as error:
        told(error.problems)
        return "refused"
    except Exception as error:  # whatever it is: it is told with the case
        return f"case {case}: {type(error).__name__}: {str(error)[:200]}"
    return "accepted"


def scene_case(case: int, folder: Path) -> str:
    rng = random.Random(case)
    path = folder / "scene.toml"
    path.write_bytes(mutated(rng.choice(scenes()), rng))

    def read() -> None:
        scene = load_scene(path)
        if case % SAMPLE == 0 and scene.is_chosen:
            generate(scene, rng.choice((2, 3)))

    return outcome(case, read)


def originals() -> list[tuple[str, dict[str, str], str]]:
    """Returns scenario, classes by file and table, to start from: ours, and Orbiter's own where they are."""
    found = [(SCENARIO, {"Hub.cfg": HUB}, TABLE)]
    if ORBITER.is_dir():
        classes = {path.name: path.read_text() for path in ORBITER.rglob("*.cfg")}
        table = (ORBITER / "cpp_vessels.toml").read_text()
        found += [(path.read_text(), classes, table) for path in sorted(ORBITER.rglob("*.scn"))]
    return found


def orbiter_case(case: int, folder: Path, start: list[tuple[str, dict[str, str], str]]) -> str:
    rng = random.Random(case)
    text, classes, table = rng.choice(start) if rng.random() < 0.5 else start[0]
    which = rng.randrange(3)
    scenario, code, config = folder / "s.scn", folder / "code.toml", folder / "Vessels"
    config.mkdir(exist_ok=True)
    spoilt = rng.choice(sorted(classes))
    contents = {config / name: content.encode() for name, content in classes.items()}
    contents |= {scenario: text.encode(), code: table.encode()}
    target = (scenario, code, config / spoilt)[which]
    contents[target] = mutated(contents[target].decode(), rng)
    for path, content in contents.items():
        path.write_bytes(content)

    def read() -> None:
        made = import_scenario(scenario, config=[config], table=code)
        told((*made.notes, *made.text.rstrip("\n").replace("\n\n", "\n").split("\n")))
        scene = parse_scene(tomllib.loads(made.text))
        if case % SAMPLE == 0:
            generate(scene, 3)

    try:
        return outcome(case, read)
    finally:
        for path in contents:
            path.unlink()
        config.rmdir()


def assert_well_ended(outcomes: Counter[str]) -> None:
    print(dict(outcomes.most_common(2)))
    assert [text for text in outcomes if text.startswith("case")] == []


def spoilt_scenes(batch: int, folder: Path) -> None:
    cases = range(BATCH * batch, BATCH * (batch + 1))
    assert_well_ended(Counter(scene_case(case, folder) for case in cases))
    assert [path.name for path in folder.iterdir()] == ["scene.toml"]


def spoilt_scenarios(batch: int, folder: Path) -> None:
    start = originals()
    cases = range(BATCH * batch, BATCH * (batch + 1))
    assert_well_ended(Counter(orbiter_case(case, folder, start) for case in cases))
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize("batch", range(FEW))
def test_a_few_spoilt_scenes_are_refused_in_words_or_can_be_built(batch, tmp_path):
    spoilt_scenes(batch, tmp_path)


@pytest.mark.parametrize("batch", range(FEW // 2))
def test_a_few_spoilt_files_of_orbiter_are_refused_in_words_or_make_a_scene(batch, tmp_path):
    spoilt_scenarios(batch, tmp_path)


@pytest.mark.surroundings
@pytest.mark.parametrize("batch", range(FEW, MANY))
def test_thousands_of_spoilt_scenes_are_refused_in_words_or_can_be_built(batch, tmp_path):
    spoilt_scenes(batch, tmp_path)


@pytest.mark.surroundings
@pytest.mark.parametrize("batch", range(FEW // 2, MANY // 2))
def test_thousands_of_spoilt_files_of_orbiter_are_refused_in_words_or_make_a_scene(batch, tmp_path):
    spoilt_scenarios(batch, tmp_path)


@pytest.mark.skipif(not ORBITER.is_dir(), reason="Orbiter's own files are not here: ../shared/data/orbiter")
def test_orbiters_own_files_are_among_those_that_are_spoilt():
    assert len(originals()) > 1


@pytest.mark.surroundings
@pytest.mark.parametrize("case", range(COMMANDS))
def test_a_command_given_a_spoilt_file_ends_in_words_and_leaves_nothing(case, tmp_path):
    rng = random.Random(case)
    path, work = tmp_path / "file", tmp_path / "work"
    work.mkdir()
    if case % 2:
        path.write_bytes(mutated(rng.choice(scenes()), rng))
        command = ["fmu_build", path, "-o", work / "missing" / "x.fmu"]
    else:
        path.write_bytes(mutated(SCENARIO, rng))
        command = ["supervessel", "import", path, "-o", work / "missing" / "x.toml"]
    with tempfile.TemporaryDirectory() as scratch:
        done = subprocess.run(
            [sys.executable, "-W", "error", "-m", *map(str, command)],
            cwd=work,
            env=os.environ
            | {"PYTHONPATH": os.pathsep.join((str(ROOT), str(ROOT / "model"))), "TMPDIR": scratch},
            capture_output=True,
            check=False,
        )
        assert list(Path(scratch).iterdir()) == []
    lines = done.stderr.decode("utf-8").rstrip("\n").split("\n")
    assert done.returncode == 1, lines
    assert done.stdout == b""
    told(tuple(lines))
    assert not any("Traceback" in line for line in lines)
    assert list(work.iterdir()) == []
