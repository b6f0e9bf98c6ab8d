"""Signals at every tenth of a second of each command.

A trade takes a minute, most of it the same over and over: its first seconds are tried, and
all of another one that finds every flight kept, which comes to the tables, the plot and the files.
"""

import os
import signal
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import pytest

from fmu_build.storage.compiler_files import FOLDER
from model.test_commands_end import assert_ended
from support.processes import ROOT
from support.signals import CASES, ROW, end, needs_linux

pytestmark = [pytest.mark.surroundings, needs_linux]

LAST = 60
"""Moments that are tried, if a command takes that long."""


@pytest.fixture(scope="module")
def cache():
    """A cache with what the compiler links, and no results."""
    with tempfile.TemporaryDirectory(prefix="supervessel-test-") as name:
        folder = Path(name)
        ended = end(CASES["build"], folder / "warm", signal.SIGTERM, 600.0, folder / "cache")
        assert ended.status == 0, ended.error
        yield folder / "cache"


EVERY = CASES | {"kept trade": replace(CASES["trade"], mass=1.0)}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("name", EVERY)
def test_a_signal_at_every_tenth_of_a_second_leaves_nothing(tmp_path, cache, name, number):
    case = EVERY[name]
    if case.mass is not None:
        assert end(case, tmp_path / "kept", number, 600.0, cache).status == 0
    for tenth in range(LAST):
        ended = end(case, tmp_path / str(tenth), number, 0.1 * tenth, cache)
        assert_ended(case, number, ended)
        assert half_written(cache) == []
        if not ended.told:
            break
    print(f"{name}, {signal.Signals(number).name}: {tenth + 1} moments")


def half_written(cache):
    """Returns what a cache holds that is neither whole nor the compiler's."""
    found = []
    for folder, folders, files in os.walk(cache):
        folders[:] = [name for name in folders if name != FOLDER]
        found += [Path(folder, name) for name in (*files, *folders) if name.startswith((".", "tmp"))]
    return found


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("delay", [0.5 * i for i in range(1, 9)])
def test_equations_of_many_vessels_do_not_swallow_a_signal(tmp_path, cache, number, delay):
    """Seconds in CasADi, which swallows exceptions."""
    case = replace(CASES["build"], texts=(ROW,))
    assert_ended(case, number, end(case, tmp_path, number, delay, cache))


MODULES = """\
import os, sys
import casadi, fmpy, numpy, pydantic
for name in sys.argv[1:]:
    child = os.fork()
    if child == 0:
        try:
            __import__(name)
            os._exit(0)
        finally:
            os._exit(1)
    if os.waitpid(child, 0)[1]:
        print(name)
"""


def test_every_module_can_be_imported_first():
    """Packages import nothing by themselves that would be there before."""
    names = []
    for folder, package in ((ROOT / "model", "supervessel"), (ROOT, "fmu_build")):
        files = [file.relative_to(folder).with_suffix("") for file in (folder / package).rglob("*.py")]
        names += [".".join(file.parts).removesuffix(".__init__") for file in files]
    assert len(names) > 90
    done = subprocess.run(
        [sys.executable, "-c", MODULES, *names], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
