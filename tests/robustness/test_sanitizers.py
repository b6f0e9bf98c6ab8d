"""The FMU's own sources under address and undefined-behaviour sanitizers.

A million random calls of its functions (fuzz.c says what holds whatever is called), and the whole FMU test
suite on libraries that are built with sanitizers (sanitized.py).
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from fmu_build.compile.compiler import fmi_headers
from support import ISS_DG, built, variant
from support.fmus import THOROUGH

pytestmark = pytest.mark.robustness

CALLS = 1_200_000
TIME_LIMIT = 600.0  # s; the runs take about ten seconds each
SUITE_TIME_LIMIT = 3600.0  # s; about ten minutes on two cores
LIBRARIES = 100
"""The suite flies more of them; fewer would say that it flies others, without sanitizers."""
PROPAGATORS = [(2, "rk4"), (3, "rk4"), (2, "auto"), (3, "auto"), (3, "split")]
NAMES = ("moving", "mixed", "docks", "capture", "bounded", "orbiting", "gradient", "spinning", "laden")
SCENES = [(fmi, scene) for scene in NAMES for fmi in (2, 3)]
BUILDS = pytest.mark.parametrize(("fmi", "propagator"), [*PROPAGATORS, *SCENES])
"""FMI version, and propagator of RAW or one of CHANGING."""
SANITIZED = (
    "-O1",
    "-g",
    "-fsanitize=address,undefined",
    "-fno-sanitize-recover=all",
    "-fno-omit-frame-pointer",
)
OPTIMISED = ("-O2",)
STRICT = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Wstrict-prototypes", "-Werror")

RAW: dict[str, Any] = {
    "name": "fuzzed",
    "root": "A",
    "vessels": {
        "A": {
            "mass": 9000.0,
            "pmi": [3.0, 4.0, 5.0],
            "ports": {
                "fore": {
                    "position": [1.0, 0.5, -0.2],
                    "direction": [1.0, 0.0, 0.0],
                    "alignment": [0.0, 1.0, 0.0],
                }
            },
        },
        "B": {
            "mass": 3000.0,
            "pmi": [1.0, 1.5, 2.0],
            "ports": {
                "aft": {
                    "position": [0.0, 0.0, 1.5],
                    "direction": [0.0, 0.0, 1.0],
                    "alignment": [0.0, 1.0, 0.0],
                },
                "fore": {
                    "position": [0.0, 0.2, -1.5],
                    "direction": [0.0, 0.0, -1.0],
                    "alignment": [0.0, 1.0, 0.0],
                },
            },
        },
        "C": {
            "mass": 500.0,
            "pmi": [0.3, 0.4, 0.5],
            "ports": {
                "aft": {
                    "position": [0.0, 0.0, 0.5],
                    "direction": [0.0, 0.0, 1.0],
                    "alignment": [0.0, 1.0, 0.0],
                }
            },
        },
    },
    "docks": [{"ports": ["A.fore", "B.aft"]}, {"ports": ["B.fore", "C.aft"]}],
    "inputs": {"mass": ["B", "C"], "pmi": ["B"], "pose": ["B.aft"], "torque": True},
    "rotation": {"max_angle_step": 0.5, "angular_velocity": [0.1, -0.2, 0.3]},
    "outputs": {
        "names": [*ISS_DG["outputs"]["names"], "principal_moments", "principal_axes", "error_estimate"]
    },
}
"""A scene with inputs of each kind, light enough that extreme values meet ordinary ones."""

MOVING = variant(
    RAW,
    {
        "vessels.B.points": {"rcs": {"position": [0.5, -1.0, 0.25]}},
        "inputs.motion": ["B.aft"],
        "inputs.force": ["B.rcs"],
        "inputs.vessel_torque": ["C"],
        "rotation.mass_change": "momentum",
        "rotation.pose_change": "momentum",
        "outputs.names": [
            *RAW["outputs"]["names"],
            "net_force",
            "C.origin",
            "C.attitude",
            "C.angular_momentum",
        ],
    },
)
JUMPS = ("barycentre_velocity", "barycentre_jump", "barycentre_velocity_jump")
DOCKS = [{"name": "berth", "ports": ["A.fore", "B.aft"]}, {"name": "tail", "ports": ["B.fore", "C.aft"]}]
RIVAL = {"name": "rival", "ports": ["A.fore", "C.aft"], "docked": False}
ORBIT = {
    "inputs.gravity": True,
    "gravity": {"mu": 4e14, "position": [6e6, 3e6, -1e6], "velocity": [-2e3, 6e3, 4e3]},
}
CHANGING = {
    "moving": MOVING,
    "mixed": variant(
        MOVING,
        {"rotation.mass_change": "rate", "outputs.names": [*MOVING["outputs"]["names"], *JUMPS]},
    ),
    "docks": variant(
        MOVING,
        {
            "docks": DOCKS,
            "inputs.docked": ["berth", "tail"],
            "outputs.names": [*MOVING["outputs"]["names"], "C.velocity", *JUMPS],
        },
    ),
    "capture": variant(
        MOVING,
        {
            "docks": [*DOCKS, RIVAL],
            "inputs": {**MOVING["inputs"], "pose": [], "motion": [], "docked": ["berth", "tail", "rival"]},
            "rotation.propagator": "taylor",
        },
    ),
    "bounded": variant(
        MOVING,
        {
            "docks": DOCKS,
            "inputs.docked": ["berth", "tail"],
            "rotation.law": "principal",
            "rotation.mass_change": "rate",
            "outputs.names": [*MOVING["outputs"]["names"], "error_bound"],
        },
    ),
    "orbiting": variant(
        MOVING,
        ORBIT
        | {
            "docks": DOCKS,
            "inputs.docked": ["berth", "tail"],
            "vessels.A.wheels": {"w": {"axis": [0.0, 1.0, 2.0], "inertia": 30.0, "momentum": 400.0}},
            "vessels.C.wheels": {"w": {"axis": [1.0, 0.0, 0.0], "momentum": -50.0}},
            "inputs.wheel": ["C.w"],
            "outputs.names": [*MOVING["outputs"]["names"], "A.w.momentum", "A.w.speed"],
        },
    ),
    "laden": variant(
        MOVING,
        ORBIT
        | {
            "docks": [*DOCKS, RIVAL],
            "inputs": {
                **MOVING["inputs"],
                "motion": [],
                "docked": ["berth", "tail", "rival"],
                "gravity": True,
            },
            "vessels.C.wheels": {"w": {"axis": [1.0, 0.0, 0.0], "inertia": 9.0, "momentum": -50.0}},
            "inputs.wheel": ["C.w"],
            "rotation.pose_change": "rate",
            "outputs.names": [
                *RAW["outputs"]["names"],
                *(f"{dock}.{load}" for dock in ("berth", "tail", "rival") for load in ("force", "moment")),
                *(f"B.rcs.{kind}" for kind in ("position", "velocity", "acceleration", "specific_force")),
            ],
        },
    ),
    "gradient": variant(RAW, ORBIT | {"rotation.propagator": "taylor", "rotation.tolerance": 1e-3}),
    "spinning": variant(
        RAW,
        {
            "vessels.A.wheels": {"w": {"axis": [0.0, 1.0, 2.0], "inertia": 30.0, "momentum": 400.0}},
            "inputs.wheel": ["A.w"],
            "rotation.propagator": "taylor",
            "rotation.tolerance": 1e-3,
        },
    ),
}
"""Scenes with forces: a port moves and all changes keep momentum, or poses alone do; docks open and close
beside, or two of them at one port by turns; the bound of a cheap law's error is carried along all that;
wheels and gravity's gradient besides, or loads and points too; the gradient, and a wheel, without these, by
Taylor series."""


@cache
def compiler() -> str:
    """Returns gcc, if its sanitizers are there; skips where they are not."""
    if not shutil.which("gcc"):
        pytest.skip("gcc is missing")
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder, "empty.c")
        source.write_text("int main(void) { return 0; }\n")
        command = ["gcc", *SANITIZED, str(source), "-o", str(source.with_suffix(""))]
        if subprocess.run(command, capture_output=True, check=False).returncode != 0:
            pytest.skip("gcc's sanitizers are missing: libasan and libubsan")
    return "gcc"


@cache
def fuzzer(fmi: int, propagator: str, flags: tuple[str, ...]) -> Path:
    """Returns the fuzzer linked with the sources that lie in an FMU."""
    folder = Path(tempfile.mkdtemp(prefix="supervessel-fuzz-"))
    raw = CHANGING.get(propagator) or variant(RAW, {"rotation.propagator": propagator})
    with zipfile.ZipFile(built(raw, fmi)) as archive:
        archive.extractall(folder)
    sources = folder / "sources"
    common = [
        compiler(),
        "-std=c99",
        "-ffp-contract=off",
        *flags,
        f"-DFMI={fmi}",
        f"-DFMI{fmi}_OVERRIDE_FUNCTION_PREFIX",
    ]
    common += ["-I", str(sources), "-isystem", str(fmi_headers())]
    own, program = folder / "fuzz.o", folder / "fuzz"
    run([*common, *STRICT, "-c", str(Path(__file__).with_name("fuzz.c")), "-o", str(own)])
    run([*common, "-w", str(own), *map(str, sorted(sources.glob("*.c"))), "-lm", "-o", str(program)])
    return program


def run(command: list[str]) -> str:
    """Returns what a command writes; fails with what it complains of."""
    done = subprocess.run(command, capture_output=True, text=True, timeout=TIME_LIMIT, check=False)
    assert done.returncode == 0, f"exit status {done.returncode}\n{done.stderr[-4000:]}"
    return done.stdout


@cache
def fuzz(fmi: int, propagator: str, flags: tuple[str, ...], seed: int, calls: int) -> str:
    line = run([str(fuzzer(fmi, propagator, flags)), str(seed), str(calls)])
    print(f"FMI {fmi}, {propagator}, seed {seed}: {line.strip()}")
    return line


def number(line: str, what: str) -> int:
    """Returns the number that stands before a word in the fuzzer's line."""
    found = re.search(rf"(\d+) {what}", line)
    assert found, line
    return int(found[1])


@BUILDS
def test_a_million_random_calls_break_no_rule_and_no_memory(fmi, propagator, capsys):
    with capsys.disabled():
        print()
        line = fuzz(fmi, propagator, SANITIZED, 1, CALLS)
    assert number(line, "calls") == CALLS


@BUILDS
def test_random_calls_reach_every_kind_of_answer(fmi, propagator):
    line = fuzz(fmi, propagator, SANITIZED, 1, CALLS)
    # Shares of about half of what was counted when the mixture of calls was chosen.
    assert number(line, "ok") > 0.8 * CALLS
    assert number(line, "discarded") > 0.004 * CALLS
    assert number(line, "errors") > 0.03 * CALLS
    assert number(line, "steps") > 0.05 * CALLS


@BUILDS
def test_random_calls_are_answered_alike_bit_for_bit_by_an_optimised_build(fmi, propagator):
    sanitized, optimised = (
        fuzz(fmi, propagator, flags, 1, CALLS).partition("digest ")[2] for flags in (SANITIZED, OPTIMISED)
    )
    assert sanitized == optimised


@pytest.mark.parametrize("seed", range(2, 4))
@BUILDS
def test_other_random_calls_break_no_rule(fmi, propagator, seed):
    fuzz(fmi, propagator, OPTIMISED, seed, CALLS)


def preloaded(folder: Path) -> str:
    """Returns what LD_PRELOAD must name: the sanitizer's runtime, what it needs of C++, and what tames it."""
    shim = folder / "preload.so"
    run([compiler(), "-shared", "-fPIC", str(Path(__file__).with_name("preload.c")), "-o", str(shim), "-ldl"])
    names = ("libasan.so", "libstdc++.so.6")
    return " ".join([str(shim), *(run([compiler(), f"-print-file-name={name}"]).strip() for name in names)])


@pytest.mark.skipif(sys.platform != "linux", reason="LD_PRELOAD is missing: it is Linux's")
def test_the_fmu_test_suite_runs_clean_on_libraries_with_sanitizers(tmp_path):
    here = Path(__file__).parent
    # Python keeps memory to its end: leaks are the fuzzer's part.
    options = "detect_leaks=0:verify_asan_link_order=0"
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join([str(here), os.environ.get("PYTHONPATH", "")]),
        "SANITIZING_COMPILER": compiler(),
        "SANITIZED_LIBRARIES": str(tmp_path / "libraries"),
        "LD_PRELOAD": preloaded(tmp_path),
        THOROUGH: "yes",
        "ASAN_OPTIONS": f"{options}:log_path={tmp_path / 'address'}",
        "UBSAN_OPTIONS": f"print_stacktrace=1:log_path={tmp_path / 'undefined'}",
    }
    command = [sys.executable, "-m", "pytest", "-q", "-n", "auto", "-p", "sanitized"]
    command += ["-m", "not (stability or surroundings)"]  # all others that are thorough
    # The fuzzer looks at memory; names that a debugger is told are in these binaries.
    without = "not leave_no_memory_behind and not nothing_of_it_is_in_the_binary"
    command += ["-k", without, *(str(here.parent / name) for name in ("fmu", "changes", "wheels"))]
    done = subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=SUITE_TIME_LIMIT, check=False
    )
    reports = [path.read_text()[:4000] for path in sorted(tmp_path.glob("*.[0-9]*"))]
    assert reports == []
    assert done.returncode == 0, done.stdout[-4000:]
    assert len((tmp_path / "libraries").read_text().splitlines()) > LIBRARIES
