"""Interrupts: none is lost while equations are made, and what they end leaves nothing behind."""

import os
import signal
import subprocess
import sys
import time
from collections import deque
from pathlib import Path
from threading import Timer

import pytest

from supervessel.equations import equations
from supervessel.interrupts import interrupt_afterwards, interrupted_once
from supervessel.processes import Workers, run
from support import ISS_DG, scene

ROOT = Path(__file__).parents[2]

SCENE = """\
name = "ball"
root = "B"
[vessels.B]
mass = 2.0
pmi = [1.0, 1.5, 2.0]
[experiment]
duration = 10.0
step = 1.0
"""

needs_posix = pytest.mark.skipif(sys.platform == "win32", reason="signals are sent as POSIX does")
needs_linux = pytest.mark.skipif(sys.platform != "linux", reason="processes are looked up in /proc")


@needs_posix
@pytest.mark.parametrize("delay", [0.01 * i for i in range(1, 13)])
def test_an_interrupt_while_equations_are_made_is_not_lost(delay):
    """CasADi swallows it in about a third of the tries, if it may."""
    iss = scene(ISS_DG)
    clock = Timer(delay, os.kill, (os.getpid(), signal.SIGINT))
    clock.start()
    with pytest.raises(KeyboardInterrupt):
        deque((equations(iss) for _ in range(100)), maxlen=0)
    clock.join()


@needs_posix
def test_the_first_signal_interrupts_and_later_ones_do_not_disturb_the_end():
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    heard = []

    def terminated():
        with interrupted_once(), interrupt_afterwards():
            os.kill(os.getpid(), signal.SIGTERM)
            heard.append("waited")

    try:
        with pytest.raises(KeyboardInterrupt):
            terminated()
        assert heard == ["waited"]
        for number in before:
            os.kill(os.getpid(), number)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@needs_posix
def test_without_a_signal_all_is_as_it_was():
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    with interrupted_once():
        assert signal.getsignal(signal.SIGTERM) is not before[signal.SIGTERM]
    assert {number: signal.getsignal(number) for number in before} == before


def test_an_interrupt_ends_programs_and_none_begins_after_it(tmp_path):
    begun = tmp_path / "begun"
    program = f"import pathlib, time; pathlib.Path({str(begun)!r}).touch(); time.sleep(600)"
    started = []

    def interrupted():
        with Workers(1) as pool:
            started.extend(pool.submit(run, [sys.executable, "-c", program], 600.0) for _ in range(2))
            while not begun.exists():
                time.sleep(0.01)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    first, second = started
    assert first.result().returncode != 0
    assert second.cancelled()
    assert run([sys.executable, "-c", "print('on')"], 60.0).stdout == "on\n"


@needs_linux
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ["supervessel", "trade", "ball.toml"],
            "interrupted; what has been flown is kept, the same command goes on from there",
        ),
        (["fmu_build", "ball.toml"], "interrupted; no FMU was written"),
    ],
    ids=["trade", "build"],
)
def test_a_command_that_is_terminated_leaves_nothing_behind(tmp_path, words, message):
    """While the compiler runs; Ctrl-C twice right after it changes nothing."""
    work, temporary = tmp_path / "work", tmp_path / "temporary"
    work.mkdir()
    temporary.mkdir()
    (work / "ball.toml").write_text(SCENE)
    folders = {"SUPERVESSEL_CACHE": str(tmp_path / "cache"), "TMPDIR": str(temporary)}
    running = subprocess.Popen(
        [sys.executable, "-m", *words],
        cwd=work,
        env=os.environ | folders | {"PYTHONPATH": os.pathsep.join((str(ROOT), str(ROOT / "model")))},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    while running.poll() is None and not any("zig" in name for name in programs(running.pid)):
        time.sleep(0.01)
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGINT):
        running.send_signal(number)
        time.sleep(0.01)
    out, error = running.communicate()
    assert (running.returncode, out, error.strip()) == (1, "", message)
    assert programs(running.pid) == []
    assert list(temporary.iterdir()) == []
    assert [path.name for path in work.iterdir()] == ["ball.toml"]


def programs(session):
    """Returns the names of the programs that run in a session."""
    names = []
    for place in Path("/proc").glob("[0-9]*/stat"):
        try:
            name, _, rest = place.read_text().partition("(")[2].rpartition(")")
        except OSError:  # it has just ended
            continue
        state, _, _, its_session = rest.split()[:4]
        if int(its_session) == session and state != "Z":
            names.append(name)
    return names
