"""A pytest plugin: FMUs get a library with sanitizers, compiled from the sources that are packed into them.

A violation ends the test process with the sanitizer's report. The process must have been started with the
address sanitizer's runtime preloaded.
"""

import os
import subprocess
from collections.abc import Sequence
from pathlib import Path

import fmu_build.build
from fmu_build.compile.compiler import fmi_headers
from fmu_build.platforms import Platform

FLAGS = ("-std=c99", "-O1", "-g", "-w", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden")
SANITIZERS = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-fno-omit-frame-pointer")


def compile_binaries(  # noqa: PLR0917
    sources: Sequence[str],
    folder: Path,
    platforms: Sequence[Platform],
    fmi: int,
    model_identifier: str,
    flags: Sequence[str] = (),
) -> dict[str, bytes]:
    """Returns the library by archive path, as `compile_binaries` does for this machine.

    flags : of the other compiler, for naught
    """
    [platform] = platforms
    library = folder / f"{model_identifier}{platform.suffix}"
    command = [os.environ["SANITIZING_COMPILER"], *FLAGS, *SANITIZERS, "-isystem", str(fmi_headers())]
    environment = {key: value for key, value in os.environ.items() if key != "LD_PRELOAD"}
    subprocess.run([*command, "-o", str(library), *sources, "-lm"], cwd=folder, env=environment, check=True)
    return {f"binaries/{platform.folder(fmi)}/{library.name}": library.read_bytes()}


fmu_build.build.compile_binaries = compile_binaries
