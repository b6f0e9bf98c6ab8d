"""A signal ends every command at once, from its first line on: one line, its status, and nothing left."""

import signal
import subprocess
import sys
import time

import pytest

from orbiter.files import Files
from support.marks import some_at_once
from support.processes import ROOT, cache, heard
from support.signals import CASES, WATCHDOG, begin, catches, end, needs_linux, programs, wait_for

__all__ = ["cache", "heard"]

pytestmark = needs_linux

MOMENTS = [
    ("build", signal.SIGINT, 0.0),
    ("build", signal.SIGTERM, 0.2),
    ("build", signal.SIGHUP, 0.8),
    ("build", signal.SIGINT, 1.6),
    ("trade", signal.SIGTERM, 0.1),
    ("trade", signal.SIGINT, 1.2),
    ("trade", signal.SIGTERM, 2.4),
    ("import", signal.SIGINT, 0.05),
    ("import", signal.SIGTERM, 0.3),
    ("choice", signal.SIGTERM, 0.4),
    ("choice", signal.SIGINT, 1.5),
    ("choice", signal.SIGINT, 3.0),
]
"""Seconds after a command's first line; make surroundings has every tenth of one."""


@pytest.mark.parametrize(("name", "number", "delay"), MOMENTS)
def test_a_signal_ends_a_command_with_one_line_and_nothing_left(tmp_path, cache, name, number, delay):
    assert_ended(CASES[name], number, end(CASES[name], tmp_path, number, delay, cache))


def assert_ended(case, number, ended):
    """Asserts that a command has ended as it should, whether the signal came in time or not."""
    assert ended.programs == []
    lines = [line for line in ended.error.splitlines() if not line.startswith("note: ")]
    if ended.status == 0:  # it was done when the signal came
        assert lines == []
        assert ended.out
        return
    assert ended.status == 128 + number, ended.error
    assert len(lines) == 1, ended.error
    assert lines[0] in case.lines
    whole = {f"work/{name}" for name in case.made}
    assert [name for name in ended.left if name not in whole and not name.startswith("work/out/trade.")] == []
    if not ended.left:
        assert ended.out == ""


def test_signals_that_follow_do_not_disturb_the_end(tmp_path):
    (tmp_path / "ball.toml").write_text("".join(CASES["build"].texts).format(mass=1.5))
    running = begin(("fmu_build", "ball.toml", "--platform", "all"), tmp_path)
    wait_for(lambda: any("zig" in name for name in programs(running.pid)))
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGINT, signal.SIGTERM):
        running.send_signal(number)
    out, error = running.communicate(timeout=WATCHDOG)
    assert running.returncode in (130, 143)  # Python hears the lower number first of two at once
    assert (out, error) == ("", "interrupted\n")
    assert wait_for(lambda: not programs(running.pid), 5.0)


def test_a_signal_that_is_ignored_at_the_start_stays_ignored(tmp_path, heard):
    """As SIGINT is in a background job; the others end it."""
    Files(tmp_path)
    command = ["sh", "-c", f'trap "" INT; exec {sys.executable} -m {" ".join(CASES["import"].words)}']
    for number, status in ((signal.SIGTERM, 143), (signal.SIGINT, 0)):
        running = subprocess.Popen(
            command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        wait_for(lambda running=running: catches(running.pid, signal.SIGHUP))
        assert not catches(running.pid, signal.SIGINT)
        running.send_signal(number)
        _, error = running.communicate(timeout=WATCHDOG)
        assert (running.returncode, error) == (status, "interrupted\n" if status else "")


@pytest.mark.parametrize("closed", some_at_once(["2>&-", ">&-", "<&- >&- 2>&-"], "<&- >&- 2>&-"))
def test_closed_streams_change_nothing_of_the_end(tmp_path, heard, closed):
    (tmp_path / "ball.toml").write_text("".join(CASES["build"].texts).format(mass=1.75))
    command = f"exec {sys.executable} -m fmu_build ball.toml --platform all {closed}"
    running = subprocess.Popen(
        ["sh", "-c", command],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    wait_for(lambda: any("zig" in name for name in programs(running.pid)))
    running.send_signal(signal.SIGTERM)
    out, error = running.communicate(timeout=WATCHDOG)
    assert (running.returncode, out, error) == (143, "", "" if "2>" in closed else "interrupted\n")
    assert wait_for(lambda: not programs(running.pid), 5.0)
    assert [path.name for path in tmp_path.iterdir()] == ["ball.toml"]


def test_problems_are_not_taken_for_results_where_standard_error_is_closed(tmp_path):
    command = f"exec {sys.executable} -m fmu_build none.toml 2>&-"
    done = subprocess.run(["sh", "-c", command], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (1, "")


LIGHT = """\
import signal, sys
import {module}
heavy = {{"argparse", "casadi", "fmpy", "numpy", "pydantic", "subprocess", "threading"}} & sys.modules.keys()
assert not heavy, heavy
assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
"""

WHOLE = """\
import signal
import fmu_build.__main__, fmu_build.build, fmu_build.command, supervessel.__main__, supervessel.commands
assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
"""


@pytest.mark.parametrize("module", ["supervessel", "fmu_build", "supervessel.__main__", "fmu_build.__main__"])
def test_nothing_that_takes_time_is_imported_before_a_handler_is_there(heard, module):
    assert said_by(LIGHT.format(module=module)) == (0, "")


def test_an_import_sets_no_handlers(heard):
    assert said_by(WHOLE) == (0, "")


@pytest.mark.parametrize("module", ["supervessel", "fmu_build"])
def test_public_names_are_there_when_they_are_asked_for(module):
    program = (
        f"import {module} as m\n"
        "assert set(m.__all__) <= set(dir(m))\n"
        "assert all(getattr(m, name).__name__.endswith(name) for name in m.__all__)\n"
        f"from {module} import *\n"
        "assert not hasattr(m, 'colour')\n"
    )
    assert said_by(program) == (0, "")


def said_by(program):
    """Returns the status of a program and what it says on standard error."""
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=False
    )
    return done.returncode, done.stderr


LATE = """\
import os, signal, sys, tempfile, threading, time
from supervessel.shell import ending

folder, about_to, never = sys.argv[1], threading.Event(), threading.Event()

def makes_late(event, arguments):
    # comes after the hook of `ending`: the thread waits in the call that makes the file
    if event == "open" and str(arguments[0]).startswith(folder):
        about_to.set()
        never.wait(0.2)

def interrupts():
    about_to.wait()
    os.kill(os.getpid(), signal.SIGTERM)

def main():
    sys.addaudithook(makes_late)
    os.set_blocking(2, False)  # nobody reads: what the command says at its end has to wait
    try:
        while True:
            os.write(2, b"." * 4096)
    except BlockingIOError:
        os.set_blocking(2, True)
    threading.Thread(target=interrupts, daemon=True).start()
    threading.Thread(target=tempfile.mkstemp, kwargs={"dir": folder}, daemon=True).start()
    time.sleep(10.0)

ending.run_as_process(main)
"""


def test_a_file_that_a_thread_is_just_making_when_the_command_ends_does_not_stay(tmp_path):
    (tmp_path / "made").mkdir()
    running = subprocess.Popen([sys.executable, "-c", LATE, tmp_path / "made"], stderr=subprocess.PIPE)
    time.sleep(1.5)
    _, said = running.communicate(timeout=30)
    assert (running.returncode, said.splitlines()[-1].endswith(b"interrupted")) == (143, True)
    assert list((tmp_path / "made").iterdir()) == []
