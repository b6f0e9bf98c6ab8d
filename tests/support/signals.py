"""Commands that a signal tells to end: run in a session of their own, and looked at afterwards.

Sessions are looked up in /proc: Linux only.
"""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import pytest

from orbiter.files import Files
from support.processes import ROOT, heard_signals
from support.scenes import ACCURACY_ASKED, BALL, EXPERIMENT

WATCHDOG = 120.0
"""Seconds within which anything must end that a test waits for."""

needs_linux = pytest.mark.skipif(sys.platform != "linux", reason="processes are looked up in /proc")

ANY_BALL = BALL.replace("mass = 2.0", "mass = {mass}")
"""BALL of any mass: each run takes another one, of which nothing is in a cache."""

IMPORT = (
    "supervessel",
    "import",
    "side.scn",
    "--config",
    "Config",
    "--table",
    "code.toml",
    "-o",
    "side.toml",
)

VESSELS = 300


def _row() -> str:
    lines = ['name = "row"', 'root = "V0"']
    for i in range(VESSELS):
        lines += [f"[vessels.V{i}]", "mass = {mass}", "pmi = [1.0, 2.0, 2.5]"]
        for port, x in (("a", 1.0), ("b", -1.0)):
            lines += [f"[vessels.V{i}.ports.{port}]", f"position = [{x}, 0.0, 0.0]"]
            lines += [f"direction = [{x}, 0.0, 0.0]", "alignment = [0.0, 1.0, 0.0]"]
    lines += [f'[[docks]]\nports = ["V{i}.a", "V{i + 1}.b"]' for i in range(VESSELS - 1)]
    masses = [f"V{i}" for i in range(VESSELS)]
    lines += ["[inputs]", f"mass = {masses}", f"pose = {[f'{name}.b' for name in masses[1:]]}"]
    return "\n".join([*lines, "torque = true", ""])


ROW = _row()
"""Vessels in a row, every mass and pose an input."""

KEPT = "interrupted; what has been flown is kept, the same command goes on from there"

_masses = count(2001)


@dataclass(frozen=True)
class Case:
    """A command to end.

    words  : after the interpreter's -m
    texts  : of a scene, one after the other; none: the small scenario of Orbiter
    made   : what the command leaves in the working folder when it is not told to end
    lines  : with which it may end
    mass   : of the scene's vessel [kg]; None: another one in each run, of which nothing is in a cache
    """

    words: tuple[str, ...]
    texts: tuple[str, ...]
    made: tuple[str, ...]
    lines: tuple[str, ...] = ("interrupted",)
    mass: float | None = None


CASES = {
    "build": Case(("fmu_build", "ball.toml"), (ANY_BALL,), ("ball.fmu",)),
    "trade": Case(
        ("supervessel", "trade", "ball.toml", "--quick", "-o", "out"),
        (ANY_BALL, EXPERIMENT),
        ("out",),
        ("interrupted", KEPT),
    ),
    "import": Case(
        IMPORT,
        (),
        ("side.toml",),
    ),
    "choice": Case(
        ("fmu_build", "ball.toml"), (ANY_BALL, ACCURACY_ASKED), ("ball.fmu",), ("interrupted", KEPT)
    ),
}


@dataclass(frozen=True)
class Ended:
    """What came of a command that was told to end, or had ended before.

    seconds  : from the signal to its end
    programs : names of those left running in its session
    left     : files and folders that it has left: in the working folder, and of temporary ones
    """

    told: bool
    seconds: float
    status: int
    out: str
    error: str
    programs: list[str]
    left: list[str]


def begin(words: tuple[str, ...], folder: Path, **environment: object) -> "subprocess.Popen[str]":
    """Begins a command in a session of its own, with changes to the environment."""
    path = os.pathsep.join((str(ROOT), str(ROOT / "model")))
    with heard_signals():
        return subprocess.Popen(
            [sys.executable, "-m", *words],
            cwd=folder,
            env=os.environ | {"PYTHONPATH": path} | {key: str(value) for key, value in environment.items()},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )


def wait_for(what: Callable[[], object], seconds: float = WATCHDOG) -> bool:
    """Returns whether something has come to be so in time."""
    late = time.monotonic() + seconds
    while not what():
        if time.monotonic() > late:
            return False
        time.sleep(0.002)
    return True


def catches(process: int, number: int) -> bool:
    """Whether a process has a handler for a signal: for SIGINT Python has one; ours for SIGHUP is last."""
    try:
        status = Path(f"/proc/{process}/status").read_text()
    except OSError:
        return False
    [mask] = [line.split()[1] for line in status.splitlines() if line.startswith("SigCgt")] or ["0"]
    return bool(int(mask, 16) >> (number - 1) & 1)


def programs(session: int) -> list[str]:
    """Returns the names of the programs that run in a session."""
    return list(session_of(session).values())


def session_of(session: int) -> dict[int, str]:
    """Returns the processes that run in a session, with their names."""
    names = {}
    for place in Path("/proc").glob("[0-9]*/stat"):
        try:
            name, _, rest = place.read_text().partition("(")[2].rpartition(")")
        except OSError:  # it has just ended
            continue
        state, _, _, its_session = rest.split()[:4]
        if int(its_session) == session and state not in "ZX":
            names[int(place.parent.name)] = name
    return names


def end(case: Case, folder: Path, number: int, delay: float, cache: Path | None = None) -> Ended:
    """Returns what came of a command to which a signal was sent a while [s] after its handler was there.

    folder : a new one
    cache  : of the command; None: that of the tests
    """
    work, temporary = folder / "work", folder / "temporary"
    work.mkdir(parents=True)
    temporary.mkdir()
    if case.texts:
        (work / "ball.toml").write_text("".join(case.texts).format(mass=case.mass or next(_masses) / 1e3))
    else:
        Files(work)
    given = set(work.rglob("*"))
    places = {"TMPDIR": temporary} | ({} if cache is None else {"SUPERVESSEL_CACHE": cache})
    running = begin(case.words, work, **places)
    wait_for(lambda: running.poll() is not None or catches(running.pid, signal.SIGHUP), 30.0)
    told = not wait_for(lambda: running.poll() is not None, delay)
    start = time.perf_counter()
    running.send_signal(number)
    try:
        out, error = running.communicate(timeout=WATCHDOG)
    except subprocess.TimeoutExpired:
        for process in session_of(running.pid):
            os.kill(process, signal.SIGKILL)
        out, error = running.communicate()
    seconds = time.perf_counter() - start
    wait_for(lambda: not programs(running.pid), 5.0)
    left = [*(set(work.rglob("*")) - given), *temporary.iterdir()]
    names = sorted(str(path.relative_to(folder)) for path in left)
    return Ended(told, seconds, running.returncode, out, error, programs(running.pid), names)
