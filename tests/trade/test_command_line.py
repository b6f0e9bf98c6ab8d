"""`supervessel trade`: what it prints and leaves, what it refuses, and that an interrupt loses nothing."""

import json
import sys
from pathlib import Path

import pytest

from fmu_build.trade import table
from support import processes
from support.processes import kept_in, names_in, needs_posix, run
from support.scenes import BALL, EXPERIMENT
from support.signals import KEPT

SCENE = BALL + EXPERIMENT

FILES = ["trade.json", "trade.md", "trade.png", "trade.svg"]


def command(*arguments):
    return [sys.executable, "-m", "supervessel", "trade", *map(str, arguments)]


@pytest.fixture(scope="module")
def interrupted(tmp_path_factory, cache):
    """A trade interrupted when it has its first results: its end, what is there, and what it has kept."""
    folder = tmp_path_factory.mktemp("work")
    (folder / "ball.toml").write_text(SCENE)
    words = command("ball.toml", "--quick", "-o", "out")
    done, kept = processes.interrupted(words, folder, cache, "trade")
    return done, names_in(folder), kept


@pytest.fixture(scope="module")
def finished(tmp_path_factory, cache, interrupted):
    """The same trade from its beginning: its end and its folder."""
    folder = tmp_path_factory.mktemp("work")
    (folder / "ball.toml").write_text(SCENE)
    return run(command("ball.toml", "--quick", "-o", "out"), folder, cache), folder


@needs_posix
def test_an_interrupt_leaves_no_files_and_keeps_whole_results(interrupted):
    done, left, kept = interrupted
    assert (done.returncode, done.stdout, done.stderr) == (130, "", f"{KEPT}\n")
    assert left == ["ball.toml"]
    assert kept
    for path, content in kept.items():
        assert path.name.endswith(".json")
        assert len(json.loads(content)["kept"]["samples"]) == 10  # each of ten steps


@needs_posix
def test_the_same_command_goes_on_from_what_was_kept(interrupted, finished, cache):
    done, _ = finished
    assert done.returncode == 0, done.stderr
    for path, content in interrupted[2].items():
        assert path.read_bytes() == content
    assert len(list(kept_in(cache).glob("trade/*"))) > len(interrupted[2])


def test_tables_are_printed_and_all_is_in_the_folder(finished):
    done, folder = finished
    assert (done.returncode, done.stderr) == (0, "")
    assert names_in(folder / "out") == FILES
    found = json.loads((folder / "out" / "trade.json").read_text())
    assert done.stdout == f"{table(found)}\n\nout\n"
    assert (folder / "out" / "trade.md").read_text() == f"{table(found)}\n"
    assert found["experiment"] == {"duration": 10.0, "step": 1.0, "inputs": {}}
    divided = [(row["settings"], row["sub_steps"]) for row in found["choices"] if row["propagator"] == "rk4"]
    assert divided == 2 * [([0.05, 0.2], 10), ([0.01], 40)]  # 0.037 rad a step, under two laws


def test_a_second_call_gives_the_same_bytes(finished, cache):
    _, folder = finished
    before = {name: (folder / "out" / name).read_bytes() for name in FILES}
    again = run(command("ball.toml", "--quick", "-o", "again"), folder, cache)
    assert again.returncode == 0, again.stderr
    assert {name: (folder / "again" / name).read_bytes() for name in FILES} == before


@needs_posix
def test_a_full_disk_leaves_the_old_files_as_they_are(finished, cache):
    _, folder = finished
    before = {name: (folder / "out" / name).read_bytes() for name in FILES}
    limited = f"ulimit -f 8 && exec {' '.join(command('ball.toml', '--quick', '-o', 'out'))}"
    done = run(["sh", "-c", limited], folder, cache)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.splitlines()[0].startswith("no plot: ")
    assert done.stderr.splitlines()[1:] == [f"{Path('out/trade.json')}: cannot be written: File too large"]
    assert {path.name: path.read_bytes() for path in (folder / "out").iterdir()} == before


@needs_posix
def test_a_full_disk_leaves_no_new_folder(finished, cache):
    _, folder = finished
    limited = f"ulimit -f 8 && exec {' '.join(command('ball.toml', '--quick', '-o', 'new'))}"
    done = run(["sh", "-c", limited], folder, cache)
    assert done.stderr.splitlines()[1:] == [f"{Path('new/trade.json')}: cannot be written: File too large"]
    assert not (folder / "new").exists()


@pytest.mark.parametrize(
    ("change", "arguments", "status", "message"),
    [
        (
            ("[experiment]\nduration = 10.0\nstep = 1.0\n", ""),
            (),
            1,
            "ball.toml: experiment: missing; a trade needs [experiment] with duration and step [s]\n",
        ),
        (
            ("duration = 10.0", "duration = 0.0"),
            (),
            1,
            "ball.toml: experiment.duration = 0.0 s: must be a finite number > 0\n",
        ),
        (
            ("", ""),
            ("--duration", "0"),
            1,
            "--duration: experiment.duration = 0.0 s: must be a finite number > 0\n",
        ),
        (
            ("", ""),
            ("--duration", "1e9"),
            1,
            "ball.toml: experiment: duration = 1000000000.0 s in steps of 1.0 s are 1e+09 steps; "
            "at most 1000000\n",
        ),
        (("", ""), ("--duration", "long"), 2, "argument --duration: invalid float value: 'long'\n"),
        (
            ("", ""),
            ("-o", "ball.toml/out"),
            1,
            "ball.toml/out: cannot be written: Not a directory\n",
        ),
    ],
)
def test_what_cannot_be_done_is_said_before_any_work(tmp_path, change, arguments, status, message):
    (tmp_path / "ball.toml").write_text(SCENE.replace(*change))
    done = run(command("ball.toml", *arguments), tmp_path, tmp_path / "cache")
    assert names_in(tmp_path) == ["ball.toml"]
    assert (done.returncode, done.stdout) == (status, "")
    assert done.stderr.endswith(message)
    assert "Traceback" not in done.stderr
