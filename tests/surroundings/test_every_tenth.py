"""Signals at every tenth of a second of each command, until it is done before the signal comes."""

import os
import signal
import tempfile
from itertools import count
from pathlib import Path

import pytest

from model.test_commands_end import assert_ended
from support.signals import CASES, end, needs_linux

pytestmark = [pytest.mark.surroundings, needs_linux]

PARTS = ("b", "h", "o", "tmp", "z")
"""Folders of a cache that are the compiler's own."""


@pytest.fixture(scope="module")
def cache():
    """A cache with what the compiler links, and no results."""
    with tempfile.TemporaryDirectory(prefix="supervessel-test-") as name:
        folder = Path(name)
        ended = end(CASES["build"], folder / "warm", signal.SIGTERM, 600.0, folder / "cache")
        assert ended.status == 0, ended.error
        yield folder / "cache"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("name", CASES)
def test_a_signal_at_every_tenth_of_a_second_leaves_nothing(tmp_path, cache, name, number):
    case = CASES[name]
    for tenth in count():
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
        folders[:] = [name for name in folders if name not in PARTS]
        found += [Path(folder, name) for name in (*files, *folders) if name.startswith((".", "tmp"))]
    return found


VESSELS = 300


def wide_scene():
    """Returns a row of vessels as a scene file, every mass and pose an input."""
    lines = ['name = "row"', 'root = "V0"']
    for i in range(VESSELS):
        lines += [f"[vessels.V{i}]", "mass = 1000.0", "pmi = [1.0, 2.0, 2.5]"]
        for port, x in (("a", 1.0), ("b", -1.0)):
            lines += [f"[vessels.V{i}.ports.{port}]", f"position = [{x}, 0.0, 0.0]"]
            lines += [f"direction = [{x}, 0.0, 0.0]", "alignment = [0.0, 1.0, 0.0]"]
    lines += [f'[[docks]]\nports = ["V{i}.a", "V{i + 1}.b"]' for i in range(VESSELS - 1)]
    masses = [f"V{i}" for i in range(VESSELS)]
    lines += ["[inputs]", f"mass = {masses}", f"pose = {[f'{name}.b' for name in masses[1:]]}"]
    return "\n".join([*lines, "torque = true", ""])
