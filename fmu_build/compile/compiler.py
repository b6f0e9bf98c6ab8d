"""C to shared libraries, with the compiler that comes in the `ziglang` wheel."""

import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from importlib.machinery import PathFinder
from importlib.metadata import version
from pathlib import Path

from fmu_build.compile.universal import universal_library
from fmu_build.errors import BuildError
from fmu_build.platforms import PLATFORMS, Platform, library_contents
from fmu_build.storage.cache import (
    cache_folder,
    count_compilation,
    in_use,
    keep_library,
    place_of_library,
    read_library,
    reason,
)
from supervessel.problems import printable
from supervessel.shell.processes import Workers, run

TIME_LIMIT = 1800.0  # s; a first build for Windows compiles its C runtime: minutes on two busy cores

AT_ONCE = 2
"""Platforms compiled at the same time; the compiler itself uses all cores for the files of one."""

FLAGS = ("-std=c99", "-O2", "-s", "-ffp-contract=off", "-fvisibility=hidden", "-fPIC", "-shared")
"""One set for all platforms. No fast-math and no contraction: platforms must agree to the last bit."""

TRIAL_FLAGS = (*(flag for flag in FLAGS if flag != "-O2"), "-O0", "-fno-sanitize=undefined")
"""For libraries that are flown a few times: compiled in a fifth of the time, the same numbers."""


NEEDED = ("SYSTEMROOT", "TEMP", "TMP") if os.name == "nt" else ()
"""Variables that compilers get from the user's surroundings: without them Windows starts no program."""


def fmi_headers() -> Path:
    """Returns the folder of the FMI standard's headers, as the fmpy package carries them."""
    return _package("fmpy") / "c-code"


def compile_binaries(  # noqa: PLR0913, PLR0917
    sources: Sequence[str],
    folder: Path,
    platforms: Sequence[Platform],
    fmi: int,
    model_identifier: str,
    flags: Sequence[str] = FLAGS,
    content: bytes = b"",
) -> dict[str, bytes]:
    """Compiles an FMU's library for each platform and returns the libraries by archive path, binaries/...

    sources : C files, relative to `folder`, their headers beside them
    folder  : where they lie
    content : stands for all that is in the folder: what has been made of the same content is kept and not
              compiled again; empty: nothing is kept
    Raises BuildError with the compiler's own words for each platform where it fails.
    """
    contents = library_contents(platforms, fmi)
    needed = [platform for platform in PLATFORMS if any(platform in parts for parts in contents.values())]
    thin = _thin_libraries(sources, folder, needed, model_identifier, flags, content)
    libraries = {}
    for name, parts in contents.items():
        path = f"binaries/{name}/{model_identifier}{parts[0].suffix}"
        slices = [thin[part] for part in parts]
        libraries[path] = slices[0] if len(slices) == 1 else universal_library(slices)
    return libraries


def _thin_libraries(  # noqa: PLR0913, PLR0917
    sources: Sequence[str],
    folder: Path,
    platforms: Sequence[Platform],
    model_identifier: str,
    flags: Sequence[str],
    content: bytes,
) -> dict[Platform, bytes]:
    """Returns the library of each platform; those that fail are all named in one BuildError."""

    def compiled(platform: Platform) -> bytes:
        name = f"{model_identifier}{platform.suffix}"
        place = _place_of_library(content, platform, name, flags) if content else None
        library = read_library(place) if place else None
        if library is None:
            library = _compiled([Path(source) for source in sources], platform, name, flags, folder)
            if place:
                keep_library(place, library)
        return library

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


def _place_of_library(content: bytes, platform: Platform, name: str, flags: Sequence[str]) -> Path:
    """Returns where a library is kept: under all that it depends on."""
    return place_of_library(
        repr([content, platform.target, name, *flags, version("ziglang"), compiler().stat().st_size]).encode()
    )


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
    Raises BuildError with the compiler's own words if it fails, or if it does not end in half an hour; or
    where the library cannot be written.
    """
    whole = [Path(folder or Path.cwd(), source) for source in sources]
    library = _compiled(whole, platform, output.name, flags, folder)
    try:
        output.write_bytes(library)
    except OSError as error:
        raise BuildError(f"{printable(str(output))}: cannot be written: {reason(error, 'for it')}") from None


def _compiled(
    sources: Sequence[Path], platform: Platform, name: str, flags: Sequence[str], folder: Path | None
) -> bytes:
    """Returns the library of that file name. It is made in the cache, whose path the linker can work with."""
    cache = cache_folder()
    for source in sources:
        if set("\n\r") & set(str(source)):
            raise BuildError(
                f"{printable(str(source))}: the compiler reads no file whose path holds a line break"
            )
    command = [str(compiler()), "cc", "-target", platform.target, *flags]
    if platform.suffix == ".dylib":
        command.append(f"-Wl,-install_name,@rpath/{name}")
    try:
        with in_use(cache), tempfile.TemporaryDirectory(dir=cache, prefix="made-") as made:
            output = Path(made, name)
            command += ["-isystem", str(fmi_headers()), "-o", str(output), *map(str, sources)]
            if platform.suffix == ".so":
                command.append("-lm")
            problem = _run(command, folder, cache, Path(made, "objects"))
            count_compilation(cache)
            if problem is not None:
                raise BuildError(f"compiler for {platform.name} {problem}")
            return output.read_bytes()
    except OSError as error:
        place = error.filename or cache
        raise BuildError(f"{printable(str(place))}: {reason(error, 'to compile in')}") from None


def _run(command: Sequence[str], folder: Path | None, cache: Path, objects: Path) -> str | None:
    """Runs the compiler and returns what it did instead of compiling, if so.

    objects : folder for what is compiled from our sources: always made anew, since the compiler believes
              whatever it finds there
    """
    kept_in = f"The compiler's cache is {printable(str(cache))}; `supervessel cache --clear` removes it"
    try:
        done = run(command, TIME_LIMIT, folder, environment(cache, objects))
    except subprocess.TimeoutExpired:
        return f"did not end within {TIME_LIMIT:g} s.\n{kept_in}"
    if done.returncode == 0:
        return None
    return f"failed:\n{(done.stderr or done.stdout).strip()}\n{kept_in}"


def environment(cache: Path, objects: Path) -> dict[str, str]:
    """Returns all the variables that a compiler gets: its result depends on no other."""
    kept = {"ZIG_GLOBAL_CACHE_DIR": str(cache), "ZIG_LOCAL_CACHE_DIR": str(objects)}
    return kept | {name: os.environ[name] for name in NEEDED if name in os.environ}


def compiler() -> Path:
    """Returns the compiler's program, of the installed package ziglang, never of the working folder."""
    program = _package("ziglang") / ("zig.exe" if os.name == "nt" else "zig")
    if not program.is_file():
        raise BuildError(
            f"{printable(str(program))}: there is no such file; package ziglang carries the compiler"
        )
    return program


def _package(name: str) -> Path:
    """Returns the folder of an installed package, never one in the working folder: that may be anybody's."""
    try:
        here = os.path.realpath(Path.cwd())
    except FileNotFoundError:  # it has been removed
        here = ""
    path = [place for place in sys.path if place and os.path.realpath(place) != here]
    spec = PathFinder.find_spec(name, path)
    if spec is None or spec.origin is None:
        raise BuildError(f"package {name} is not installed")
    return Path(spec.origin).parent.absolute()
