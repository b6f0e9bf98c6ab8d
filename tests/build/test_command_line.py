"""The command `python -m fmu_build`: what it prints where, its exit status, and the folders it may use."""

import errno
import hashlib
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from fmpy import read_model_description

from supervessel.problems import printable
from support import BALL
from support.compilers import fake_compiler
from support.marks import some_at_once
from support.processes import ROOT, cache, names_in, needs_posix

__all__ = ["cache"]

BROKEN = BALL.replace("mass = 2.0", "mass = -2.0").replace('root = "B"', 'root = "C"') + "colour = 3\n"

BROKEN_PROBLEMS = [
    "ball.toml: vessels.B.mass = -2.0 kg: must be a finite number >= 0",
    'ball.toml: vessels.B: unknown key "colour"; '
    "known: mass, pmi, inertia, moments, products, inertia_about, mend, "
    "centre_of_mass, ports, points, wheels",
    'ball.toml: root: unknown vessel "C"; known: B',
]

needs_linux = pytest.mark.skipif(sys.platform != "linux", reason="needs Linux")
needs_root = pytest.mark.skipif(
    getattr(os, "geteuid", lambda: 1)() != 0, reason="only root can take an unknown user's identity"
)


@pytest.fixture
def folder(tmp_path):
    """A folder to run in, with a scene."""
    (tmp_path / "ball.toml").write_text(BALL)
    return tmp_path


def run(folder, *arguments, **environment):
    """Runs the command in a folder with changes to the environment; a value of None removes a variable."""
    variables = os.environ | {"PYTHONPATH": os.pathsep.join((str(ROOT), str(ROOT / "model")))} | environment
    return subprocess.run(
        [sys.executable, "-m", "fmu_build", *map(str, arguments)],
        cwd=folder,
        env={name: str(value) for name, value in variables.items() if value is not None},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture
def spent(tmp_path_factory):
    """A cache for a compiler that fails: the next one begins anew there, with no files of its own."""
    return tmp_path_factory.mktemp("spent")


def assert_failed(done, *lines):
    """Asserts that a run ended with status 1, these lines on stderr and nothing on stdout."""
    assert done.stderr.splitlines() == list(lines)
    assert (done.returncode, done.stdout) == (1, "")


def test_success_prints_the_path_and_nothing_else(folder):
    (folder / "out").mkdir()
    done = run(folder, "ball.toml", "-o", "out/my.fmu")
    assert (done.returncode, done.stdout, done.stderr) == (0, f"{Path('out/my.fmu')}\n", "")
    assert names_in(folder / "out") == ["my.fmu"]


def test_the_default_output_is_the_scene_name_in_the_current_folder(folder):
    elsewhere = folder / "elsewhere"
    elsewhere.mkdir()
    done = run(elsewhere, "../ball.toml")
    assert (done.stdout, names_in(elsewhere)) == ("ball.fmu\n", ["ball.fmu"])


@pytest.mark.parametrize(("options", "version"), [((), "3.0"), (("--fmi", "2"), "2.0")])
def test_the_fmi_version_is_3_unless_told(folder, options, version):
    assert run(folder, "ball.toml", *options).returncode == 0
    assert read_model_description(str(folder / "ball.fmu")).fmiVersion == version


def test_names_are_structured_unless_told(folder):
    for options, rate in ([], "angular_velocity[1]"), (["--names", "flat"], "angular_velocity_1"):
        assert run(folder, "ball.toml", *options).returncode == 0
        assert rate in [v.name for v in read_model_description(str(folder / "ball.fmu")).modelVariables]


def test_names_that_would_be_one_are_a_failure_that_tells_both(folder):
    ports = "".join(
        f"[vessels.B.ports.{p}]\nposition = [0, 0, 0]\ndirection = [1, 0, 0]\nalignment = [0, 1, 0]\n"
        for p in ("C_d", "e")
    )
    other = "[vessels.B_C]\nmass = 1.0\npmi = [1.0, 1.0, 1.0]\n" + ports.replace("C_d", "d").replace(
        "B.", "B_C."
    )
    docks = "".join(f'[[docks]]\nports = ["B.{one}", "B_C.{two}"]\n' for one, two in [("C_d", "d")])
    text = BALL + ports + other + docks + '[inputs]\npose = ["B.C_d", "B_C.d"]\n'
    (folder / "pair.toml").write_text(text)
    done = run(folder, "pair.toml", "--names", "flat")
    assert_failed(
        done,
        *(
            f"ball: flat names: B.C_d.{key}[{i}] and B_C.d.{key}[{i}] would both be B_C_d_{key}_{i}; "
            "rename a part of one of them"
            for key in ("position", "direction", "alignment")
            for i in (1, 2, 3)
        ),
    )


def test_help_is_a_result_on_stdout(folder):
    done = run(folder, "--help")
    assert (done.returncode, done.stderr) == (0, "")
    assert "SCENE.toml" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ((), "the following arguments are required: SCENE.toml"),
        (("ball.toml", "other.toml"), "unrecognized arguments: other.toml"),
        (("ball.toml", "--colour"), "unrecognized arguments: --colour"),
        (("ball.toml", "--fmi", "4"), "argument --fmi: invalid choice: "),
        (("ball.toml", "--fmi", "two"), "argument --fmi: invalid int value: 'two'"),
        (("ball.toml", "-o"), "argument -o/--output: expected one argument"),
    ],
    ids=["no scene", "two scenes", "unknown option", "FMI 4", "FMI two", "no output"],
)
def test_wrong_usage_ends_with_status_2_and_builds_nothing(folder, arguments, complaint):
    done = run(folder, *arguments)
    assert complaint in done.stderr
    assert (done.returncode, done.stdout, names_in(folder)) == (2, "", ["ball.toml"])


def test_every_problem_of_a_scene_is_a_line_on_stderr(folder):
    (folder / "ball.toml").write_text(BROKEN)
    done = run(folder, "ball.toml")
    assert sorted(done.stderr.splitlines()) == sorted(BROKEN_PROBLEMS)
    assert (done.returncode, done.stdout) == (1, "")


@pytest.mark.parametrize(
    ("arguments", "error"),
    [(("none.toml",), errno.ENOENT), ((".",), errno.EISDIR), (("ball.toml/none.toml",), errno.ENOTDIR)],
    ids=["not there", "a folder", "below a file"],
)
def test_a_scene_that_cannot_be_read_is_named(folder, arguments, error):
    assert_failed(run(folder, *arguments), f"{arguments[0]}: cannot be read: {os.strerror(error)}")


LONG = "x" * 249 + ".fmu"
"""A name that a file system takes (255 bytes), but not with five more."""


@pytest.mark.parametrize(
    ("output", "message"),
    [
        ("none/my.fmu", f"none/my.fmu: cannot be written: {os.strerror(errno.ENOENT)}: none"),
        (
            "ball.toml/my.fmu",
            f"ball.toml/my.fmu: cannot be written: {os.strerror(errno.ENOTDIR)}: ball.toml",
        ),
        (".", ".: cannot be written: is a folder, not a regular file"),
        (LONG + "xxxx", f"{printable(LONG + 'xxxx')}: cannot be written: {os.strerror(errno.ENAMETOOLONG)}"),
    ],
    ids=["no folder", "below a file", "a folder", "name too long"],
)
def test_an_output_that_cannot_be_written_is_named(folder, output, message):
    assert_failed(run(folder, "ball.toml", "-o", output), message)


def test_the_longest_name_that_the_file_system_takes_gives_no_traceback(folder):
    done = run(folder, "ball.toml", "-o", LONG)
    assert "Traceback" not in done.stderr
    assert done.returncode == (0 if (folder / LONG).exists() else 1)


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="there is no /proc")
def test_a_folder_that_takes_no_files_is_named(folder):
    done = run(folder, "ball.toml", "-o", "/proc/my.fmu")
    assert done.stderr.startswith("/proc/my.fmu: cannot be written: ")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (1, "", 1)


TOO_LONG = BALL.replace("2.0", "9" * 5000, 1)
TOO_DEEP = BALL.replace("2.0", "[" * 5000 + "]" * 5000, 1)
NO_NAMES = BALL.replace("[vessels.B]", 'docks = [{ports = [["B.p"], ["B.q"]]}]\n[vessels.B]')
OVERFLOWING = BALL.replace("2.0", "1e308", 1).replace("1.0, 1.5, 2.0", "10.0, 10.0, 10.0")


@pytest.mark.parametrize(
    "text",
    some_at_once(
        {
            "no TOML": BALL.replace("=", ":", 1),
            "no UTF-8": b"# \xff\n",
            "5000 digits": TOO_LONG,
            "arrays 5000 deep": TOO_DEEP,
            "docks of arrays": NO_NAMES,
            "overflowing": OVERFLOWING,
        },
        "no TOML",
        "arrays 5000 deep",
    ),
)
def test_a_scene_that_is_refused_gives_one_line_and_no_traceback(folder, text):
    (folder / "ball.toml").write_bytes(text if isinstance(text, bytes) else text.encode())
    done = run(folder, "ball.toml")
    assert [line.partition(": ")[0] for line in done.stderr.splitlines()] == ["ball.toml"]
    assert (done.returncode, done.stdout) == (1, "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
def test_a_path_that_cannot_be_printed_is_a_failure_without_traceback(folder):
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "fmu_build", "ball.toml"],
            cwd=folder,
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert "Traceback" not in done.stderr
    assert done.returncode == 1


@needs_linux
def test_a_full_temporary_folder_is_a_failure_without_traceback(folder, spent, monkeypatch):
    monkeypatch.setenv("SUPERVESSEL_CACHE", str(spent))
    command = f"ulimit -f 1 && exec {sys.executable} -m fmu_build ball.toml"
    done = subprocess.run(["sh", "-c", command], cwd=folder, capture_output=True, text=True, check=False)
    assert "Traceback" not in done.stderr
    assert (done.returncode, done.stdout, names_in(folder)) == (1, "", ["ball.toml"])


@needs_posix
def test_a_compiler_that_fails_is_quoted_on_stderr(folder, spent, tmp_path_factory):
    done = run(folder, "ball.toml", PYTHONPATH=failing(tmp_path_factory), SUPERVESSEL_CACHE=spent)
    assert done.stderr.startswith("compiler for ")
    assert "error: no disk, no ink" in done.stderr
    assert done.stderr.splitlines()[-1].startswith("The compiler's cache is ")
    assert "Traceback" not in done.stderr
    assert (done.returncode, done.stdout, names_in(folder)) == (1, "", ["ball.toml"])


def an_fmu(file):
    """Writes an archive that is taken for an old FMU; returns its bytes."""
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("modelDescription.xml", "<fmiModelDescription/>")
    return file.read_bytes()


def failing(tmp_path_factory):
    """Returns a PYTHONPATH by which the compiler is one that fails."""
    folder = fake_compiler(tmp_path_factory.mktemp("failing"), "echo 'error: no disk, no ink' >&2; exit 1")
    return os.pathsep.join((str(folder), str(ROOT), str(ROOT / "model")))


@needs_posix
@pytest.mark.parametrize("reason", ["the scene", "the compiler", "the compiler's cache"])
def test_an_old_fmu_survives_a_build_that_fails(folder, reason, spent, tmp_path_factory):
    output = folder / "ball.fmu"
    old = an_fmu(output)
    environment = {}
    if reason == "the scene":
        (folder / "ball.toml").write_text(BROKEN)
    elif reason == "the compiler":
        environment |= {"PYTHONPATH": failing(tmp_path_factory), "SUPERVESSEL_CACHE": spent}
    else:
        environment["SUPERVESSEL_CACHE"] = folder / "ball.toml"
    before = names_in(folder)
    done = run(folder, "ball.toml", **environment)
    assert "Traceback" not in done.stderr
    assert (done.returncode, output.read_bytes(), names_in(folder)) == (1, old, before)


def test_a_build_replaces_an_old_fmu(folder):
    an_fmu(folder / "ball.fmu")
    assert run(folder, "ball.toml").returncode == 0
    assert names_in(folder) == ["ball.fmu", "ball.toml"]
    assert read_model_description(str(folder / "ball.fmu")).modelName == "ball"


def test_a_cache_that_cannot_be_written_is_named(folder):
    cache = folder / "ball.toml" / "cache"
    assert_failed(
        run(folder, "ball.toml", SUPERVESSEL_CACHE=cache),
        f"SUPERVESSEL_CACHE = {cache}: is no folder that can be written: {os.strerror(errno.ENOTDIR)}",
    )


@pytest.fixture(scope="module")
def homeless(tmp_path_factory):
    """A build with a HOME that cannot be written: the run, its folder and its temporary folder."""
    folder, temporary = tmp_path_factory.mktemp("work"), tmp_path_factory.mktemp("temporary")
    (folder / "ball.toml").write_text(BALL)
    home = folder / "ball.toml" / "home"
    cleared = dict.fromkeys(
        ("XDG_CACHE_HOME", "SUPERVESSEL_CACHE", "ZIG_GLOBAL_CACHE_DIR", "ZIG_LOCAL_CACHE_DIR")
    )
    return run(folder, "ball.toml", HOME=home, TMPDIR=temporary, **cleared), folder, temporary


@needs_linux
def test_a_build_works_with_a_home_that_cannot_be_written(homeless):
    done, folder, _ = homeless
    assert (done.returncode, done.stdout, done.stderr) == (0, "ball.fmu\n", "")
    assert names_in(folder) == ["ball.fmu", "ball.toml"]


@needs_linux
def test_a_build_leaves_nothing_in_the_temporary_folder(homeless):
    _, _, temporary = homeless
    assert names_in(temporary) == []


@needs_linux
def test_a_cold_cache_gives_the_same_bytes_as_a_warm_one(homeless, folder):
    assert run(folder, "ball.toml").returncode == 0
    cold, warm = (hashlib.sha256((place / "ball.fmu").read_bytes()) for place in (homeless[1], folder))
    assert cold.hexdigest() == warm.hexdigest()


@needs_linux
@needs_root
def test_a_user_without_a_home_has_a_cache_that_can_be_written():
    script = (
        "import os; from fmu_build.storage.cache import cache_folder; os.setuid(54321); "
        "folder = cache_folder(); print(os.access(folder, os.W_OK))"
    )
    variables = {
        k: v for k, v in os.environ.items() if k not in ("HOME", "XDG_CACHE_HOME", "SUPERVESSEL_CACHE")
    }
    done = subprocess.run(
        [sys.executable, "-c", script], env=variables, capture_output=True, text=True, check=False
    )
    assert (done.stdout, done.stderr) == ("True\n", "")


def test_the_scene_file_is_never_overwritten_by_its_fmu(folder):
    scene = folder / "ball.toml"
    before = scene.read_bytes()
    done = run(folder, "ball.toml", "-o", "../" + folder.name + "/ball.toml")
    assert (done.returncode, scene.read_bytes()) == (1, before)
    assert "cannot be written: is a file that is read for it: ball.toml" in done.stderr
