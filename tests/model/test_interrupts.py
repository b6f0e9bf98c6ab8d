"""Interrupts of programs: none is lost while equations are made, and what they end leaves nothing behind."""

import os
import signal
import sys
from collections import deque
from contextlib import contextmanager
from threading import Thread, Timer

import pytest

from supervessel.equations import equations
from supervessel.shell.interrupts import uninterrupted
from supervessel.shell.processes import Workers, run
from support import ISS_DG, scene
from support.processes import heard, needs_posix
from support.signals import ANY_BALL, WATCHDOG, begin, needs_linux, programs, wait_for

__all__ = ["heard"]

pytestmark = pytest.mark.usefixtures("heard")


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
def test_signals_wait_for_the_end_of_an_uninterrupted_block():
    done = []

    def interrupted():
        with uninterrupted(), uninterrupted():
            os.kill(os.getpid(), signal.SIGINT)
            done.append("whole")

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert done == ["whole"]


@pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError])
def test_an_exception_ends_programs_and_none_begins_after_it(tmp_path, error):
    """CasADi makes other exceptions of KeyboardInterrupt."""
    started = []

    def interrupted():
        with Workers(1) as pool:
            started.extend(pool.submit(sleeping, tmp_path / "begun") for _ in range(2))
            wait_for((tmp_path / "begun").exists)
            raise error

    with pytest.raises(error):
        interrupted()
    first, second = started
    assert first.result().returncode != 0
    assert second.cancelled()
    assert run([sys.executable, "-c", "print('on')"], 60.0).stdout == "on\n"


@needs_posix
def test_an_interrupt_while_a_block_waits_for_its_threads_ends_its_programs(tmp_path):
    """Most come there: a block has nothing else to do while the compiler runs."""
    started = []

    def interrupted():
        with Workers(1) as pool:
            started.append(pool.submit(sleeping, tmp_path / "begun"))

    with interrupting((tmp_path / "begun").exists), pytest.raises(KeyboardInterrupt):
        interrupted()
    assert started[0].result().returncode != 0


@needs_posix
def test_an_interrupt_ends_a_program_that_the_main_thread_waits_for(tmp_path):
    begun = tmp_path / "begun"
    with interrupting(lambda: begun.exists() and begun.read_text()), pytest.raises(KeyboardInterrupt):
        sleeping(begun)
    with pytest.raises(ProcessLookupError):
        os.kill(int(begun.read_text()), 0)


def test_an_exception_ends_no_programs_of_other_blocks(tmp_path):
    """Those of blocks within its own it does end."""
    within, over = [], tmp_path / "over"
    waiting = (
        "import pathlib, time\n"
        f"while not pathlib.Path({str(over)!r}).exists(): time.sleep(0.01)\n"
        "print('whole')\n"
    )

    def nested():
        with Workers(1) as inner:
            within.append(inner.submit(sleeping, tmp_path / "within"))

    def failed():
        with Workers(1) as pool:
            pool.submit(nested)
            wait_for((tmp_path / "within").exists)
            raise RuntimeError

    with Workers(1) as other:
        apart = other.submit(run, [sys.executable, "-c", waiting], WATCHDOG)
        with pytest.raises(RuntimeError):
            failed()
        assert within[0].result().returncode != 0
        over.touch()
        assert apart.result().stdout == "whole\n"


LIBRARY = """\
from fmu_build import build_fmu
from fmu_build.platforms import PLATFORMS
from supervessel import load_scene
try:
    build_fmu(load_scene("ball.toml"), "ball.fmu", platforms=PLATFORMS)
except KeyboardInterrupt:
    print("heard")
"""


@needs_linux
def test_a_program_that_builds_gets_the_keyboards_interrupt_and_no_compiler_is_left(tmp_path):
    work, temporary = tmp_path / "work", tmp_path / "temporary"
    work.mkdir()
    temporary.mkdir()
    (work / "ball.toml").write_text(ANY_BALL.format(mass=1.25))
    (work / "program.py").write_text(LIBRARY)
    running = begin(("program",), work, TMPDIR=temporary)
    wait_for(lambda: running.poll() is not None or any("zig" in name for name in programs(running.pid)))
    running.send_signal(signal.SIGINT)
    out, error = running.communicate(timeout=WATCHDOG)
    assert (running.returncode, out, error) == (0, "heard\n", "")
    assert wait_for(lambda: not programs(running.pid), 5.0)
    assert list(temporary.iterdir()) == []
    assert not list(work.glob("*.fmu"))


SLEEP = 600.0


@contextmanager
def interrupting(moment):
    """Interrupts this process when something has come to be so."""
    clock = Thread(target=lambda: wait_for(moment) and os.kill(os.getpid(), signal.SIGINT))
    clock.start()
    try:
        yield
    finally:
        clock.join()


def sleeping(begun):
    """Runs a program that takes long and leaves its number in a file when it has begun."""
    note = f"pathlib.Path({str(begun)!r}).write_text(str(os.getpid()))"
    program = f"import os, pathlib, time; {note}; time.sleep({SLEEP})"
    return run([sys.executable, "-c", program], SLEEP)
