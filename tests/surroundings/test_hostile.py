"""Commands in hostile surroundings: environment, planted modules, locales, clocks, streams, resources.

Each does what it does in good surroundings, byte for byte, or says in one line why not.
"""

import itertools
import os
import sys
from pathlib import Path

import pytest

from support.locales import german
from support.surroundings import (
    AS_STRANGER,
    BUILD,
    CACHE,
    CHOICE,
    COMMANDS,
    IMPORT,
    MADE,
    TRADE,
    assert_clean,
    assert_refused,
    assert_right,
    needs_linux,
    needs_root,
    place,
    right_or_refused,
    run,
    strangers,
)

__all__ = ["place", "strangers"]

pytestmark = [pytest.mark.surroundings, needs_linux]


# Environment.

DOCTORED = "doctored"
"""A folder in the working folder, with headers and programs that are not what their names say."""

PRELOAD = "ERROR: ld.so: object '/missing/lib.so' from LD_PRELOAD cannot be preloaded"

VARIABLES = {
    "CPATH": DOCTORED,
    "C_INCLUDE_PATH": DOCTORED,
    "LIBRARY_PATH": DOCTORED,
    "CCC_OVERRIDE_OPTIONS": "+-Dsqrt(x)=7.0",
    "ZIG_LIB_DIR": DOCTORED,
    "ZIG_LIBC": DOCTORED,
    "ZIG_GLOBAL_CACHE_DIR": "/missing",
    "ZIG_LOCAL_CACHE_DIR": "/missing",
    "ZIG_BUILD_ERROR_STYLE": "nonsense",
    "CC": "/bin/false",
    "CFLAGS": "-ffast-math",
    "LDFLAGS": "-nonsense",
    "SOURCE_DATE_EPOCH": "nonsense",
    "TZ": ":/etc/passwd",
    "PYTHONHASHSEED": "1",
    "PYTHONOPTIMIZE": "2",
    "PYTHONINSPECT": "",
    "PYTHONUNBUFFERED": "1",
    "PYTHONDEVMODE": "1",
    "PYTHONSTARTUP": "/missing",
    "PYTHONWARNINGS": "error",
    "PYTHONUTF8": "0",
    "PYTHONIOENCODING": "ascii",
    "PYTHONINTMAXSTRDIGITS": "640",
    "LC_ALL": "C",
    "LANG": "nonsense",
    "HOME": "/missing",
    "PATH": "",
    "COLUMNS": "0",
    "LINES": "-1",
    "NO_COLOR": "1",
    "FORCE_COLOR": "1",
    "TERM": "dumb",
    "XDG_CACHE_HOME": "\n",
    "OMP_NUM_THREADS": "nonsense",
    "OPENBLAS_NUM_THREADS": "-1",
    "MPLBACKEND": "nonsense",
    "MPLCONFIGDIR": "/dev/null/x",
    "MATPLOTLIBRC": "/missing",
    "CASADIPATH": DOCTORED,
    "FMPY_X": "\udcff",
}


def doctored(folder: Path) -> None:
    """Makes headers and programs that would show in the FMU's bytes, or fail."""
    folder.mkdir()
    (folder / "math.h").write_text("#error a doctored header\n")
    for name in ("zig", "cc", "ld", "libm.so", "libm.a", "fmi3Functions.h"):
        (folder / name).write_text("#!/bin/sh\nexit 1\n")
        (folder / name).chmod(0o755)


@pytest.mark.parametrize("name", VARIABLES)
def test_no_variable_of_the_environment_reaches_an_fmu(place, name):
    doctored(place.work / DOCTORED)
    value = VARIABLES[name]
    assert_right(run(BUILD, place, {name: str(place.work / value) if value == DOCTORED else value}), place)


@pytest.mark.parametrize("words", COMMANDS.values(), ids=COMMANDS)
def test_all_variables_at_once_reach_no_command(place, words):
    doctored(place.work / DOCTORED)
    changes = {name: str(place.work / DOCTORED) if v == DOCTORED else v for name, v in VARIABLES.items()}
    assert_right(run(words, place, changes, fresh=True), place, words)


@pytest.mark.parametrize("words", COMMANDS.values(), ids=COMMANDS)
def test_no_command_warns_where_warnings_are_errors_without_asserts_and_docstrings(place, words):
    assert_right(run(words, place, options=["-OO", "-W", "error"]), place, words)


def test_a_library_to_preload_that_is_missing_is_the_systems_to_tell(place):
    done = run(BUILD, place, {"LD_PRELOAD": "/missing/lib.so"})
    lines = [line for line in done.error.splitlines(keepends=True) if not line.startswith(PRELOAD)]
    assert lines == []
    assert_right(done, place, error=done.error)


@pytest.mark.parametrize("name", ["HOME", "PATH", "TMPDIR", "SUPERVESSEL_CACHE", "PYTHONWARNINGS"])
def test_a_variable_may_be_missing(place, name):
    changes = {name: None} | ({"XDG_CACHE_HOME": str(place.cache)} if name == "SUPERVESSEL_CACHE" else {})
    assert_right(run(BUILD, place, changes), place)


@pytest.mark.parametrize("home", ["/dev/null", "/proc/missing", "relative"])
def test_without_a_home_that_can_be_written_nothing_is_kept(place, home):
    assert_right(run(BUILD, place, {"HOME": home, "SUPERVESSEL_CACHE": None}), place)


TEMPORARY = ("per%cent", "new\nline", "bell\a", "ütf", os.fsdecode(b"\xff"), "with space", "-dash", "'\"$(")


@pytest.mark.parametrize(
    ("name", "words"),
    [*((name, BUILD) for name in TEMPORARY), *((name, CHOICE) for name in TEMPORARY[:2])],
    ids=ascii,
)
def test_a_folder_for_temporary_files_may_have_any_name(place, name, words):
    odd = place.temporary / name
    odd.mkdir()
    done = run(words, place, {"TMPDIR": str(odd)})
    assert list(odd.iterdir()) == []
    odd.rmdir()
    if done.status == 1:
        assert_refused(done, place, ascii(name)[1:-1])
    else:
        assert_right(done, place, words)


@pytest.mark.parametrize("name", ["missing", "file"])
@pytest.mark.parametrize("words", [BUILD, CHOICE], ids=["build", "choice"])
def test_another_folder_is_taken_for_temporary_files_where_that_one_is_none(place, name, words):
    odd = place.temporary.parent / name
    if name == "file":
        odd.touch()
    assert_right(run(words, place, {"TMPDIR": str(odd)}), place, words)


# Modules in the working folder.

MODULES = ("casadi", "numpy", "subprocess", "json", "sitecustomize", "usercustomize", "fmu_build", "model")
PACKAGES = ("ziglang", "fmpy", "supervessel", "pydantic")


def planted(place, modules=MODULES, packages=PACKAGES):
    """Plants modules and packages; returns the file that appears when one is run."""
    trace = place.temporary.parent / "run"
    code = f"open({str(trace)!r}, 'a').write(__name__)\n"
    for name in modules:
        (place.work / f"{name}.py").write_text(code)
    for name in packages:
        (place.work / name).mkdir()
        for file in ("__init__.py", "__main__.py"):
            (place.work / name / file).write_text(code)
        program = place.work / name / "zig"
        program.write_text(f"#!/bin/sh\necho zig > '{trace}'; exit 1\n")
        program.chmod(0o755)
    return trace


@pytest.mark.parametrize("words", COMMANDS.values(), ids=COMMANDS)
def test_no_module_of_the_working_folder_is_run(place, words):
    """With -P Python itself imports nothing from there, as in the command `supervessel`."""
    trace = planted(place)
    done = run(words, place, options=["-P"])
    assert not trace.exists()
    assert_right(done, place, words)


SCRIPT = Path(sys.executable).with_name("supervessel")


@pytest.mark.skipif(not SCRIPT.exists(), reason="the command supervessel is not installed")
@pytest.mark.parametrize("words", [IMPORT, CACHE, TRADE], ids=["import", "cache", "trade"])
def test_the_command_supervessel_runs_no_module_of_the_working_folder(place, words):
    trace = planted(place)
    done = run(words, place, {"PYTHONPATH": None}, shell=f"shift 3; exec '{SCRIPT}' \"$@\"")
    assert not trace.exists()
    assert_right(done, place, words)


def test_python_m_runs_modules_of_the_working_folder_by_itself_and_the_compiler_is_not_one(place):
    """What `python -m` finds in the working folder is run before our first line: `-P` keeps it from that."""
    trace = planted(place, ["casadi"], ["ziglang"])
    done = run(BUILD, place)
    assert trace.read_text() == "casadi"
    assert done.status != 0
    (place.work / "casadi.py").unlink()
    trace.unlink()
    assert_right(run(BUILD, place), place)
    assert not trace.exists()


# Locales.


@pytest.fixture(scope="module", name="german")
def with_comma(tmp_path_factory):
    """The variables of a locale with a decimal comma."""
    return german(tmp_path_factory.mktemp("locales"))


@pytest.mark.parametrize("words", COMMANDS.values(), ids=COMMANDS)
def test_numbers_have_points_where_the_locale_has_a_comma(place, german, words):
    assert_right(run(words, place, german), place, words)


HOST = """\
import locale, sys
from pathlib import Path
locale.setlocale(locale.LC_ALL, "")
assert (locale.localeconv()["decimal_point"] == ",") == (sys.argv[1] == "comma")
from fmpy import simulate_fmu
from fmu_build import build_fmu
from supervessel import Twin, load_scene
scene = load_scene("trade.toml")
build_fmu(scene, "host.fmu")
Twin(scene)
for start in (2.5, 0.5):
    simulate_fmu("host.fmu", start_time=start, stop_time=start + 1, debug_logging=True,
                 logger=lambda *words: print(words[-1].decode()))
"""


def test_a_host_with_a_decimal_comma_builds_and_flies_the_same_fmu(place, german):
    """Python's own setlocale changes what printf and strtod do in every library of the process."""
    script = place.temporary.parent / "host.py"
    script.write_text(HOST)
    fmus = []
    for changes, argument in ((german, "comma"), ({}, "point")):
        done = run((), place, changes, shell=f"shift 2; exec '{sys.executable}' '{script}' {argument}")
        assert_clean(done, place)
        assert done.status == 0, done
        assert done.out.count("computed at 2.5 s") == done.out.count("computed at 0.5 s") == 1, done.out
        fmus.append((place.work / "host.fmu").read_bytes())
    assert fmus[0] == fmus[1]


# Clocks.


@pytest.mark.parametrize("when", [0, 2**31 + 10, 2**34 - 1])
@pytest.mark.parametrize("zone", ["Pacific/Kiritimati", "XXX+24:59:59YYY"])
def test_dates_of_files_change_nothing(place, when, zone):
    first = run(BUILD, place)
    assert_right(first, place)
    for path in (*place.work.rglob("*"), *place.cache.rglob("*")):
        os.utime(path, (when, when), follow_symlinks=False)
    for changes in ({"TZ": zone}, {"TZ": zone, "SOURCE_DATE_EPOCH": str(when)}):
        (place.work / "ball.fmu").unlink()
        assert_right(run(BUILD, place, changes), place)
    assert_right(run(CACHE, place, {"TZ": zone}), place, CACHE)


# Streams.

CLOSED = [some for count in range(4) for some in itertools.combinations(range(3), count)]


@pytest.mark.parametrize("closed", CLOSED, ids=str)
@pytest.mark.parametrize("words", [BUILD, IMPORT, CACHE], ids=["build", "import", "cache"])
def test_streams_that_are_closed_are_in_nobodys_way(place, closed, words):
    ends = " ".join(f"{number}{'<' if number == 0 else '>'}&-" for number in closed)
    done = run(words, place, shell=f'exec "$@" {ends}')
    assert_clean(done, place)
    assert (done.status, set(done.made)) == (0, MADE[words])


@pytest.mark.parametrize("words", [BUILD, IMPORT, CACHE, CHOICE], ids=["build", "import", "cache", "choice"])
def test_results_that_cannot_be_printed_are_told_in_a_line(place, words):
    done = run(words, place, shell='exec "$@" > /dev/full')
    assert_clean(done, place)
    assert done.status == 1
    assert "cannot be printed: [Errno 28] No space left on device\n" in done.error
    assert set(done.made) == MADE[words]
    for name in MADE[words]:
        (place.work / name).unlink()
    left = run(words, place, shell='{ sleep 0.1; "$@"; echo "status $?" >&2; } | true')
    assert_clean(left, place)
    assert left.error.endswith("status 1\n")
    assert "cannot be printed: [Errno 32] Broken pipe\n" in left.error


@pytest.mark.parametrize(
    "words",
    [BUILD, IMPORT, CACHE, ("fmu_build", "missing.toml"), ("supervessel",), ("supervessel", "--help")],
    ids=" ".join,
)
@pytest.mark.parametrize("streams", ["2>", ">/dev/full 2>"])
def test_a_full_device_for_errors_changes_no_status_but_for_results_that_are_lost(place, words, streams):
    usual = run(words, place).status
    for name in MADE.get(words, ()):
        (place.work / name).unlink()
    done = run(words, place, shell=f'exec "$@" {streams}/dev/full')
    assert_clean(done, place)
    assert done.status == (usual if streams == "2>" else usual or 1), done


@pytest.mark.parametrize(
    "words", [("supervessel", "--help"), ("supervessel", "trade", "-h"), ("fmu_build", "--version")]
)
def test_help_that_cannot_be_printed_is_told_in_a_line(place, words):
    done = run(words, place, shell='exec "$@" > /dev/full')
    assert_clean(done, place)
    assert done.status == 1
    assert done.error.count("\n") == 1


# Resources.


@pytest.mark.parametrize("limit", [5, 6, 8, 12, 16, 32])
@pytest.mark.parametrize("words", [BUILD])
def test_few_open_files_are_enough_or_told_in_a_line(place, limit, words):
    """With four Python itself does not start."""
    done = run(words, place, shell=f'ulimit -n {limit}; exec "$@"')
    right_or_refused(done, place, words)


@pytest.mark.parametrize("megabytes", [60, 100, 200, 300, 400, 800])
def test_little_memory_is_enough_or_told_in_a_line(place, megabytes):
    done = run(BUILD, place, shell=f'ulimit -v {megabytes * 1024}; exec "$@"')
    right_or_refused(done, place, BUILD)


@needs_root
@pytest.mark.parametrize("limit", [2, 3, 5, 8])
def test_few_processes_are_enough_or_told_in_a_line(strangers, limit):
    """The threads of numpy's own library end the process by SIGINT where there are too few."""
    alone = {"OPENBLAS_NUM_THREADS": "1"}
    done = run(BUILD, strangers, alone, before=["prlimit", f"--nproc={limit}", *AS_STRANGER])
    if done.status == 126:
        pytest.skip("the system starts no program: those of other tests count too")
    right_or_refused(done, strangers, BUILD)
