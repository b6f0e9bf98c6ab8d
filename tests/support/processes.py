"""Commands run as a user runs them, with a cache of the tests' own.

A program inherits that a signal is ignored, as SIGINT is in a background job: `heard_signals` sets what tests
need, for their own process and for programs that they start.
"""

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest

from fmu_build.compile.compiler import FLAGS, TRIAL_FLAGS, compile_library
from fmu_build.platforms import host_platform
from fmu_build.storage.cache import OURS, cache_folder
from fmu_build.storage.compiler_files import FOLDER, MANIFESTS, RECORD, compiler_folder
from support.pages import ROOT

WARM = "SUPERVESSEL_TESTS_COMPILER"
"""Variable for what `warm` returns, which workers of xdist inherit."""

needs_posix = pytest.mark.skipif(os.name != "posix", reason="needs signals and ulimit")


@contextmanager
def heard_signals() -> Iterator[None]:
    """Has signals interrupt or end this process, and programs that begin in the block, as by default."""
    handlers = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
    if sys.platform != "win32":
        handlers[signal.SIGHUP] = signal.SIG_DFL
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@pytest.fixture
def heard():
    """`heard_signals` for a test."""
    with heard_signals():
        yield


@pytest.fixture(scope="module", autouse=True)
def cache() -> Iterator[Path]:
    """A cache in which nothing has been flown before, and in which the compiler has its own files."""
    with (
        pytest.MonkeyPatch.context() as patch,
        tempfile.TemporaryDirectory(prefix="supervessel-test-") as name,
    ):
        begin_cache(Path(name))
        patch.setenv("SUPERVESSEL_CACHE", name)
        yield Path(name)


def begin_cache(cache: Path) -> None:
    """Begins a cache with what a compiler makes for itself before it compiles ours.

    Its files are linked, for it writes them once; its manifests are copied: what a test does to its own stays
    there.
    """
    made = Path(os.environ[WARM] if WARM in os.environ else warm())
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SUPERVESSEL_CACHE", str(cache))
        own = cache_folder()
    assert own == kept_in(cache)
    shutil.copy2(made.with_name(RECORD), own / RECORD)
    give = os.link if os.name == "posix" else shutil.copy2
    for kind in made.iterdir():
        copy = shutil.copy2 if kind.name == MANIFESTS else give
        shutil.copytree(kind, own / FOLDER / kind.name, copy_function=copy)


def warm() -> str:
    """Returns the folder of a compiler's own files that tests begin with, made once and then left alone.

    The first process of a session makes it, before there are others. It stays for the next session.
    """
    folder = ROOT / "build" / "tests"
    with (
        pytest.MonkeyPatch.context() as patch,
        tempfile.TemporaryDirectory(prefix="supervessel-test-") as name,
    ):
        patch.setenv("SUPERVESSEL_CACHE", str(folder))
        source = Path(name, "small.c")
        source.write_text("int answer(void) { return 42; }\n")
        for flags in (FLAGS, TRIAL_FLAGS):
            compile_library([source], host_platform(), Path(name, "small"), flags)
        os.environ[WARM] = str(compiler_folder())
    return os.environ[WARM]


def kept_in(cache: Path) -> Path:
    """Returns the folder that results and compiled code are in, of a cache that has just been begun."""
    return Path(os.path.realpath(cache), OURS, "generation-1")


def names_in(folder: Path) -> list[str]:
    """Returns the names of what lies in a folder, sorted."""
    return sorted(path.name for path in folder.iterdir())


def run(command: Sequence[str], folder: Path, cache: Path) -> subprocess.CompletedProcess[str]:
    """Returns what came of a command in a folder."""
    return subprocess.run(
        command, cwd=folder, env=_environment(cache), capture_output=True, text=True, check=False
    )


def interrupted(
    command: Sequence[str], folder: Path, cache: Path, kind: str
) -> tuple[subprocess.CompletedProcess[str], dict[Path, bytes]]:
    """Returns what came of a command, interrupted when it has its first results, and what it has kept.

    kind : folder of these results in the cache
    """
    generation = kept_in(cache)
    before = set(generation.glob(f"{kind}/*"))
    with heard_signals():
        running = subprocess.Popen(
            command,
            cwd=folder,
            env=_environment(cache),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
    while running.poll() is None and not set(generation.glob(f"{kind}/*.json")) - before:
        time.sleep(0.02)
    running.send_signal(signal.SIGINT)
    out, error = running.communicate()
    done = subprocess.CompletedProcess(running.args, running.returncode, out, error)
    return done, {path: path.read_bytes() for path in set(generation.glob(f"{kind}/*")) - before}


def _environment(cache: Path) -> dict[str, str]:
    path = os.pathsep.join((str(ROOT), str(ROOT / "model")))
    return os.environ | {"PYTHONPATH": path, "SUPERVESSEL_CACHE": str(cache)}
