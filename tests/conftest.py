"""What a session of tests shares among its processes: what they build, and what the compiler keeps."""

import os
import tempfile
from pathlib import Path

import pytest

from fmu_build.compile import native
from fmu_build.storage.compiler_files import compiler_folder
from support.fmus import session_flags
from support.processes import warm


def pytest_configure(config):
    """Makes the folder of `support.fmus`; workers of xdist take the one of the process they come from.

    A compiler that a test runs by itself has the cache of the others: cold, it builds what it links first.
    """
    if not hasattr(config, "workerinput"):
        folder = tempfile.TemporaryDirectory(prefix="supervessel-test-", ignore_cleanup_errors=True)
        os.environ["SUPERVESSEL_TESTS"] = folder.name
        config.add_cleanup(folder.cleanup)
        warm()
        os.environ["ZIG_GLOBAL_CACHE_DIR"] = str(compiler_folder())
        os.environ["ZIG_LOCAL_CACHE_DIR"] = str(Path(folder.name, "zig"))


@pytest.fixture(scope="session", autouse=True)
def quickly_compiled():
    """Has a twin's C compiled as tests' FMUs are: see `support.fmus.THOROUGH`."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(native, "FLAGS", session_flags())
        yield
