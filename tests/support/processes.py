"""Commands run as a user runs them, with a cache of the tests' own."""

import os
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from fmu_build.cache import OURS, cache_folder

ROOT = Path(__file__).parents[2]

needs_posix = pytest.mark.skipif(os.name != "posix", reason="needs signals and ulimit")


COMPILERS = ("b", "h", "o", "tmp", "z", "sources")
"""Folders of a cache that are the compiler's."""


@pytest.fixture(scope="module", autouse=True)
def cache() -> Iterator[Path]:
    """A cache in which nothing has been flown before; what has been compiled before is in it, where the
    system lets folders be linked. What is removed is never reached by these links."""
    common = cache_folder()
    with (
        pytest.MonkeyPatch.context() as patch,
        tempfile.TemporaryDirectory(prefix="supervessel-test-") as name,
    ):
        patch.setenv("SUPERVESSEL_CACHE", name)
        assert cache_folder() == kept_in(Path(name))
        if os.name == "posix":
            for kind in COMPILERS:
                (common / kind).mkdir(exist_ok=True)
                (cache_folder() / kind).symlink_to(common / kind)
        yield Path(name)


def kept_in(cache: Path) -> Path:
    """Returns the folder that results and compiled code are in, of a cache that has just been begun."""
    return Path(os.path.realpath(cache), OURS, "generation-1")


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
