"""C to shared libraries, with the compiler that comes in the `ziglang` wheel."""

import atexit
import functools
import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from fmu_build.errors import BuildError
from fmu_build.platforms import PLATFORMS, Platform, library_contents
from fmu_build.universal import universal_library
from supervessel.processes import Workers, run

TIME_LIMIT = 1800.0  # s; a first build for Windows compiles its C runtime: minutes on two busy cores

AT_ONCE = 2
"""Platforms compiled at the same time; the compiler itself uses all cores for the files of one."""

FLAGS = ("-std=c99", "-O2", "-s", "-ffp-contract=off", "-fvisibility=hidden", "-fPIC", "-shared")
"""One set for all platforms. No fast-math and no contraction: platforms must agree to the last bit."""

TRIAL_FLAGS = (*(flag for flag in FLAGS if flag != "-O2"), "-O0", "-fno-sanitize=undefined")
"""For libraries that are flown a few times: compiled in a fifth of the time, the same numbers."""


def fmi_headers() -> Path:
    """Returns the folder of the FMI standard's headers, as the fmpy package carries them."""
    spec = importlib.util.find_spec("fmpy")
    if spec is None or spec.origin is None:
        raise BuildError("package fmpy is not installed; it carries the headers of the FMI standard")
    return Path(spec.origin).parent / "c-code"


def compile_binaries(  # noqa: PLR0913, PLR0917
    sources: Sequence[str],
    folder: Path,
    platforms: Sequence[Platform],
    fmi: int,
    model_identifier: str,
    flags: Sequence[str] = FLAGS,
) -> dict[str, bytes]:
    """Compiles an FMU's library for each platform and returns the libraries by archive path, binaries/...

    sources : C files, relative to `folder`, their headers beside them
    folder  : where they lie
    Raises BuildError with the compiler's own words for each platform where it fails.
    """
    contents = library_contents(platforms, fmi)
    needed = [platform for platform in PLATFORMS if any(platform in parts for parts in contents.values())]
    thin = _thin_libraries(sources, folder, needed, model_identifier, flags)
    libraries = {}
    for name, parts in contents.items():
        path = f"binaries/{name}/{model_identifier}{parts[0].suffix}"
        slices = [thin[part] for part in parts]
        libraries[path] = slices[0] if len(slices) == 1 else universal_library(slices)
    return libraries


def _thin_libraries(
    sources: Sequence[str],
    folder: Path,
    platforms: Sequence[Platform],
    model_identifier: str,
    flags: Sequence[str],
) -> dict[Platform, bytes]:
    """Returns the library of each platform; those that fail are all named in one BuildError."""

    def compiled(platform: Platform) -> bytes:
        with tempfile.TemporaryDirectory(prefix="supervessel-") as made:
            library = Path(made, f"{model_identifier}{platform.suffix}")
            compile_library([Path(name) for name in sources], platform, library, flags, folder)
            return library.read_bytes()

    libraries, problems = {}, []
    with Workers(AT_ONCE) as pool:
        for platform, result in [(platform, pool.submit(compiled, platform)) for platform in platforms]:
            try:
                libraries[platform] = result.result()
            except BuildError as error:
                problems.append(str(error))
    if problems:
        raise BuildError("\n".join(problems))
    return libraries


def compile_library(
    sources: Sequence[Path],
    platform: Platform,
    output: Path,
    flags: Sequence[str] = FLAGS,
    folder: Path | None = None,
) -> None:
    """Compiles C sources into the shared library `output`.

    sources : C files, their headers beside them
    folder  : what relative paths are relative to, by default the working folder
    Raises BuildError with the compiler's own words if it fails, or if it does not end in half an hour.
    """
    command = [sys.executable, "-m", "ziglang", "cc", "-target", platform.target, *flags]
    if platform.suffix == ".dylib":
        command.append(f"-Wl,-install_name,@rpath/{output.name}")
    command += ["-isystem", str(fmi_headers()), "-o", str(output), *map(str, sources)]
    if platform.suffix == ".so":
        command.append("-lm")
    problem = _run(command, folder)
    if problem is not None:
        raise BuildError(f"compiler for {platform.name} {problem}")


@functools.cache
def _sweep(cache: Path) -> None:
    """Removes what compilers that were ended have left in their cache; those that run are younger."""
    for left in (cache / "tmp").glob("*"):
        try:
            old = time.time() - left.stat().st_mtime > 2.0 * TIME_LIMIT
        except FileNotFoundError:  # another program was faster
            continue
        if old and left.is_dir():
            shutil.rmtree(left, ignore_errors=True)
        elif old:
            left.unlink(missing_ok=True)


def _run(command: Sequence[str], folder: Path | None) -> str | None:
    """Runs the compiler and returns what it did instead of compiling, if so."""
    cache = compiler_cache()
    _sweep(cache)
    kept_in = {"ZIG_GLOBAL_CACHE_DIR": str(cache), "ZIG_LOCAL_CACHE_DIR": str(cache)}
    try:
        done = run(command, TIME_LIMIT, folder, os.environ | kept_in)
    except subprocess.TimeoutExpired:
        return f"did not end within {TIME_LIMIT:g} s; its cache is {cache}"
    if done.returncode == 0:
        return None
    return f"failed:\n{(done.stderr or done.stdout).strip()}\nThe compiler's cache is {cache}"


def compiler_cache() -> Path:
    """Returns a folder where the compiler may keep what it has compiled.

    SUPERVESSEL_CACHE names it; else it is the user's cache folder, or where that cannot be written a
    temporary one until the program ends (the compiler never ends without a cache that it can write).
    """
    if named := os.environ.get("SUPERVESSEL_CACHE"):
        folder = Path(named).absolute()
        if _can_write(folder):
            return folder
        raise BuildError(f"SUPERVESSEL_CACHE = {named}: is no folder that can be written")
    try:
        system = os.environ.get("XDG_CACHE_HOME" if os.name != "nt" else "LOCALAPPDATA")
        folder = (Path(system) if system else Path.home() / ".cache").absolute() / "supervessel"
    except RuntimeError:  # a user without a home
        return _temporary_cache()
    return folder if _can_write(folder) else _temporary_cache()


@functools.cache
def _temporary_cache() -> Path:
    """Returns a folder that all builds of this program share; it is removed at the end."""
    folder = tempfile.mkdtemp(prefix="supervessel-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


def _can_write(folder: Path) -> bool:
    """Whether a folder is there, or can be made, and takes files."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False
