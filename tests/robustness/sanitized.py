"""A pytest plugin: FMUs get a library with sanitizers, compiled from the sources that are packed into them.

A violation ends the test process with the sanitizer's report. The process must have been started with the
address sanitizer's runtime preloaded. The name of each library is added to the file SANITIZED_LIBRARIES.
"""

import os
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import fmu_build.compile.library
from fmu_build.compile.compiler import fmi_headers, lay_out
from fmu_build.platforms import Platform

FLAGS = ("-std=c99", "-O1", "-g", "-w", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden")
SANITIZERS = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-fno-omit-frame-pointer")


def compile_binaries(  # noqa: PLR0917
    files: Mapping[str, bytes],
    main: str,
    platforms: Sequence[Platform],
    fmi: int,
    model_identifier: str,
    flags: Sequence[str] = (),
) -> dict[str, bytes]:
    """Returns the library by archive path, as `compile_binaries` does for this machine.

    flags : of the other compiler, for naught
    """
    [platform] = platforms
    name = f"{model_identifier}{platform.suffix}"
    command = [os.environ["SANITIZING_COMPILER"], *FLAGS, *SANITIZERS, "-isystem", str(fmi_headers())]
    environment = {key: value for key, value in os.environ.items() if key != "LD_PRELOAD"}
    with tempfile.TemporaryDirectory(prefix="supervessel-sanitized-") as folder:
        lay_out(files, Path(folder))
        subprocess.run([*command, "-o", name, main, "-lm"], cwd=folder, env=environment, check=True)
        with Path(os.environ["SANITIZED_LIBRARIES"]).open("a", encoding="utf-8") as made:
            made.write(f"{name}\n")
        return {f"binaries/{platform.folder(fmi)}/{name}": Path(folder, name).read_bytes()}


fmu_build.compile.library.compile_binaries = compile_binaries
