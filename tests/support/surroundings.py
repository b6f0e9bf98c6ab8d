"""Commands run as processes of their own in surroundings that are hostile, and what a user may then see."""

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from shutil import which

import pytest

from orbiter.files import Files
from support.processes import ROOT, begin_cache, kept_in
from support.scenes import ACCURACY_ASKED, BALL, EXPERIMENT
from support.signals import IMPORT

WATCHDOG = 300.0
"""Seconds after which a command counts as one that never ends."""

BUILD = ("fmu_build", "ball.toml")
CHOICE = ("fmu_build", "choice.toml", "-o", "choice.fmu")
TRADE = ("supervessel", "trade", "trade.toml", "--quick", "-o", "out")
CACHE = ("supervessel", "cache")

COMMANDS = {"build": BUILD, "choice": CHOICE, "trade": TRADE, "import": IMPORT, "cache": CACHE}

MADE = {
    BUILD: {"ball.fmu"},
    CHOICE: {"choice.fmu"},
    TRADE: {"out", "out/trade.json", "out/trade.md", "out/trade.png", "out/trade.svg"},
    IMPORT: {"side.toml"},
    CACHE: set(),
}
"""What a command leaves in the working folder."""

STRANGER = 54321
"""A user who is nobody here."""

needs_linux = pytest.mark.skipif(sys.platform != "linux", reason="surroundings are set as Linux has them")
needs_root = pytest.mark.skipif(
    getattr(os, "geteuid", lambda: 1)() != 0 or which("setpriv") is None,
    reason="only root, with setpriv, can run a command as another user",
)

AS_STRANGER = (
    *("setpriv", f"--reuid={STRANGER}", f"--regid={STRANGER}", "--clear-groups"),
    *(f"--{kind}=-all,+dac_read_search" for kind in ("inh-caps", "ambient-caps", "bounding-set")),
)
"""Runs a command as a user who owns nothing here and who can read everything, the tests' Python included."""


@dataclass(frozen=True)
class Place:
    """Folders of a command: to work in, for temporary files, for the cache."""

    work: Path
    temporary: Path
    cache: Path

    def files(self) -> dict[str, bytes]:
        """Returns what is in the working folder, by name."""
        return {
            str(path.relative_to(self.work)): path.read_bytes() if path.is_file() else b""
            for path in self.work.rglob("*")
        }


@dataclass(frozen=True)
class Done:
    """What came of a command: its exit status, what it has printed, what has appeared or changed."""

    status: int
    out: str
    error: str
    made: dict[str, bytes]


def place_in(folder: Path, *, linked: bool = True) -> Place:
    """Returns new folders of a command in one that exists, with what all commands read.

    linked : whether the cache begins with what has been compiled before, else with nothing
    """
    place = Place(folder / "work", folder / "temporary", folder / "cache")
    for new in (place.work, place.temporary, place.cache):
        new.mkdir()
    Files(place.work)
    texts = {"ball": (BALL,), "choice": (BALL, ACCURACY_ASKED), "trade": (BALL, EXPERIMENT)}
    for name, parts in texts.items():
        (place.work / f"{name}.toml").write_text("".join(parts))
    if linked:
        begin_cache(place.cache)
    return place


@pytest.fixture
def place(tmp_path: Path) -> Place:
    """Folders of a command, with what has been compiled before."""
    return place_in(tmp_path)


def environment(place: Place, changes: Mapping[str, str | None] | None = None) -> dict[str, str]:
    """Returns the variables of a command, with changes; None takes one away."""
    path = os.pathsep.join((str(ROOT), str(ROOT / "model")))
    given = {
        "PATH": os.environ["PATH"],
        "HOME": str(place.work),
        "PYTHONPATH": path,
        "PYTHONWARNINGS": "default",
        "PYTHONDONTWRITEBYTECODE": "1",
        "TMPDIR": str(place.temporary),
        "SUPERVESSEL_CACHE": str(place.cache),
    }
    return {name: value for name, value in (given | dict(changes or {})).items() if value is not None}


def run(
    words: Sequence[str],
    place: Place,
    changes: Mapping[str, str | None] | None = None,
    *,
    shell: str = "",
    before: Sequence[str] = (),
    options: Sequence[str] = (),
    fresh: bool = False,
) -> Done:
    """Returns what came of a command.

    words   : a module of Python's and its arguments
    changes : to its environment
    shell   : what a shell does first, in which "$@" is the command; none: nothing
    before  : a program, with its arguments, that runs the command
    options : of Python
    fresh   : whether a trade flies what has been flown in good surroundings
    """
    if words == TRADE and not fresh and kept_in(place.cache).is_dir():
        _give_flights(place)
    had = place.files()
    command = [*before, sys.executable, *options, "-m", *words]
    if shell:
        command = ["/bin/sh", "-c", shell, "sh", *command]
    done = subprocess.run(
        command,
        cwd=place.work,
        env=environment(place, changes),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        timeout=WATCHDOG,
        check=False,
    )
    made = {name: content for name, content in place.files().items() if had.get(name) != content}
    return Done(done.returncode, done.stdout.decode(), done.stderr.decode(), made)


_flights: dict[str, bytes] = {}
"""Files of a cache with what a trade in good surroundings has flown."""


def _give_flights(place: Place) -> None:
    """Has a cache keep what has been flown, unless it keeps something."""
    clean(TRADE)
    kept = kept_in(place.cache) / "trade"
    if not kept.exists():
        kept.mkdir()
        for name, content in _flights.items():
            (kept / name).write_bytes(content)


def assert_clean(done: Done, place: Place) -> None:
    """Asserts that nothing has been left and nobody sees what is meant for programmers."""
    assert "Traceback" not in done.error, done.error
    assert "Warning" not in done.error, done.error
    assert done.status in (0, 1, 2), done
    if place.temporary.is_dir():
        assert list(place.temporary.iterdir()) == []


def assert_right(done: Done, place: Place, words: Sequence[str] = BUILD, error: str = "") -> None:
    """Asserts that a command has done what it does in good surroundings, byte for byte."""
    assert_clean(done, place)
    assert (done.status, done.error) == (0, notes(tuple(words)) + error), done
    assert set(done.made) == MADE[tuple(words)]
    if words != TRADE:  # which tells times
        assert done.made == clean(tuple(words)).made
    if words not in (TRADE, CACHE):
        assert done.out == clean(tuple(words)).out


def notes(words: tuple[str, ...]) -> str:
    """Returns what a command says on stderr in good surroundings."""
    return clean(words).error if words == IMPORT else ""


def assert_refused(done: Done, place: Place, *parts: str) -> None:
    """Asserts that a command has said in one line why it did not do its work, and has made nothing."""
    assert_clean(done, place)
    assert (done.status, done.out, done.made) == (1, "", {}), done
    assert done.error.count("\n") == 1, done.error
    for part in parts:
        assert part in done.error, done.error


def right_or_refused(done: Done, place: Place, words: Sequence[str]) -> None:
    """Asserts that a command has done what it does in good surroundings, or has failed in words."""
    assert_clean(done, place)
    if done.status == 0:
        assert_right(done, place, words)
    else:
        assert (done.status, done.out, done.made) == (1, "", {}), done
        assert done.error.strip()


@pytest.fixture
def strangers() -> Iterator[Place]:
    """Folders of a command that another user runs, which belong to that user."""
    with tempfile.TemporaryDirectory(prefix="supervessel-test-") as name:
        Path(name).chmod(0o755)
        place = place_in(Path(name), linked=False)
        for path in (place.work, place.temporary, place.cache, *place.work.rglob("*")):
            os.chown(path, STRANGER, STRANGER)
        yield place


@cache
def clean(words: tuple[str, ...]) -> Done:
    """Returns what came of a command in good surroundings."""
    with tempfile.TemporaryDirectory(prefix="supervessel-test-") as name:
        place = place_in(Path(name))
        done = run(words, place, fresh=True)
        if words == TRADE:
            _flights.update({f.name: f.read_bytes() for f in (kept_in(place.cache) / "trade").iterdir()})
    assert done.status == 0, done.error
    return done
