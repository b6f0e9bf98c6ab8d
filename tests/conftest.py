"""What a session of tests shares among its processes: what they build, and what the compiler keeps."""

import os
import tempfile
from pathlib import Path

from fmu_build.storage.compiler_files import compiler_folder
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
