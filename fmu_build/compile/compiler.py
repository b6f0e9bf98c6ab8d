"""C to shared libraries, with the compiler that comes in the `ziglang` wheel."""

import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from hashlib import sha256
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
    keep_bytes,
    place_of_library,
    read_bytes,
    reason,
)
from fmu_build.storage.compiler_files import compiler_folder, is_changed, record, renewed
from supervessel.problems import printable
from supervessel.shell.processes import Workers, run

TIME_LIMIT = 1800.0  # s; a first build for Windows compiles its C runtime: minutes on two busy cores

AT_ONCE = 2
"""Platforms compiled at the same time; the compiler itself uses all cores for the files of one."""

FLAGS = ("-std=c99", "-O2", "-s", "-ffp-contract=off", "-fvisibility=hidden", "-fPIC", "-shared")
"""One set for all platforms. No fast-math and no contraction: platforms must agree to the last bit."""

TRIAL_FLAGS = (*(flag for flag in FLAGS if flag != "-O2"), "-O0", "-fno-sanitize=undefined")
"""For libraries that are flown a few times: compiled in a fifth of the time, the same numbers."""


TOO_LONG = "did not end within"

NEEDED = ("SYSTEMROOT", "TEMP", "TMP") if os.name == "nt" else ()
"""Variables that compilers get from the user's surroundings: without them Windows starts no program."""


def fmi_headers() -> Path:
    """Returns the folder of the FMI standard's headers, as the fmpy package carries them."""
    return _package("fmpy") / "c-code"


def compile_binaries(  # noqa: PLR0913, PLR0917
    files: Mapping[str, bytes],
    main: str,
    platforms: Sequence[Platform],
    fmi: int,
    model_identifier: str,
    flags: Sequence[str] = FLAGS,
) -> dict[str, bytes]:
    """Compiles an FMU's library for each platform and returns the libraries by archive path, binaries/...

    files : all that the compiler may read of ours, by relative path
    main  : the one that is compiled
    What has been made of the same files is kept, and not compiled again. Raises BuildError with the
    compiler's own words for each platform where it fails, or if what it reads and makes cannot be written.
    """
    contents = library_contents(platforms, fmi)
    needed = [platform for platform in PLATFORMS if any(platform in parts for parts in contents.values())]
    thin = _thin_libraries(files, main, needed, model_identifier, flags)
    libraries = {}
    for name, parts in contents.items():
        path = f"binaries/{name}/{model_identifier}{parts[0].suffix}"
        slices = [thin[part] for part in parts]
        libraries[path] = slices[0] if len(slices) == 1 else universal_library(slices)
    return libraries


def _thin_libraries(
    files: Mapping[str, bytes],
    main: str,
    platforms: Sequence[Platform],
    model_identifier: str,
    flags: Sequence[str],
) -> dict[Platform, bytes]:
    """Returns the library of each platform; those that fail are all named in one BuildError."""
    content = digest_of(files)

    def compiled(platform: Platform) -> bytes:
        name = f"{model_identifier}{platform.suffix}"
        place = _place_of_library([content, main, platform.target, name, *flags])
        library = read_bytes(place)
        if library is None:
            library = _compiled([Path(main)], platform, name, flags, files)
            keep_bytes(place, library)
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


def lay_out(files: Mapping[str, bytes], folder: Path) -> None:
    """Writes files, by relative path, into a new folder, for a compiler to read."""
    for path, content in files.items():
        file = folder / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content)


def digest_of(files: Mapping[str, bytes]) -> str:
    """Returns what stands for files, by path, and their contents."""
    digest = sha256()
    for path, text in sorted(files.items()):
        digest.update(f"{path} {len(text)} ".encode() + text)
    return digest.hexdigest()


def _place_of_library(question: Sequence[str]) -> Path:
    """Returns where a library is kept that answers a question, and comes of this compiler."""
    said = repr([*question, version("ziglang"), compiler().stat().st_size])
    try:
        return place_of_library(said.encode())
    except OSError as error:
        place = error.filename or cache_folder()
        raise BuildError(f"{printable(str(place))}: {reason(error, 'to compile in')}") from None


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
    library = _compiled(whole, platform, output.name, flags)
    try:
        output.write_bytes(library)
    except OSError as error:
        raise BuildError(f"{printable(str(output))}: cannot be written: {reason(error, 'for it')}") from None


def _compiled(
    sources: Sequence[Path],
    platform: Platform,
    name: str,
    flags: Sequence[str],
    files: Mapping[str, bytes] | None = None,
) -> bytes:
    """Returns the library of that file name. It is made in the cache, whose path the linker can work with.

    files : by relative path, are there for the compiler, which reads relative sources among them
    A compiler that fails where its own files have changed, or with a problem that is not in our sources, is
    started again, with new files of its own.
    """
    for source in sources:
        if set("\n\r") & set(str(source)):
            raise BuildError(
                f"{printable(str(source))}: the compiler reads no file whose path holds a line break"
            )
    command = [str(compiler()), "cc", "-target", platform.target, *flags]
    if platform.suffix == ".dylib":
        command.append(f"-Wl,-install_name,@rpath/{name}")
    command += ["-isystem", str(fmi_headers()), "-o", name, *map(str, sources)]
    if platform.suffix == ".so":
        command.append("-lm")
    cache = cache_folder()
    try:
        kept = compiler_folder()
        made, problem = _made(command, name, kept, files or {})
        if made is None and (is_changed(kept) or not _is_of_ours(problem, sources)):
            made, problem = _made(command, name, renewed(kept), files or {})
    except OSError as error:
        place = error.filename or cache
        raise BuildError(f"{printable(str(place))}: {reason(error, 'to compile in')}") from None
    if made is None:
        raise BuildError(f"compiler for {platform.name} {problem}")
    return made


def _is_of_ours(problem: str, sources: Sequence[Path]) -> bool:
    """Whether a compiler's words are about our sources, or about its having taken too long."""
    return problem.startswith(TOO_LONG) or any(f"{source}:" in problem for source in sources)


def _made(
    command: Sequence[str], name: str, kept: Path, files: Mapping[str, bytes]
) -> tuple[bytes | None, str]:
    """Returns the file of that name that a compiler has made, or None and what it did instead.

    kept  : folder of the compiler's own files
    files : by relative path, beside which it works
    """
    generation = kept.parent
    with in_use(generation), tempfile.TemporaryDirectory(dir=generation, prefix="made-") as folder:
        lay_out(files, Path(folder))
        problem = _run(command, Path(folder), kept)
        count_compilation(generation)
        made = Path(folder, name).read_bytes() if problem is None else None
    if made is not None:
        record(kept)
    return made, problem or ""


def _run(command: Sequence[str], folder: Path, kept: Path) -> str | None:
    """Runs the compiler in a folder and returns what it did instead of compiling, if so.

    What it makes of our sources is always made anew, in that folder, since it believes whatever it finds.
    """
    kept_in = f"The compiler's cache is {printable(str(kept))}; `supervessel cache --clear` removes it"
    try:
        done = run(command, TIME_LIMIT, folder, environment(kept, folder / "objects"))
    except subprocess.TimeoutExpired:
        return f"{TOO_LONG} {TIME_LIMIT:g} s.\n{kept_in}"
    if done.returncode == 0:
        return None
    return f"failed:\n{(done.stderr or done.stdout).strip()}\n{kept_in}"


def environment(kept: Path, objects: Path) -> dict[str, str]:
    """Returns all the variables that a compiler gets: its result depends on no other."""
    folders = {"ZIG_GLOBAL_CACHE_DIR": str(kept), "ZIG_LOCAL_CACHE_DIR": str(objects)}
    return folders | {name: os.environ[name] for name in NEEDED if name in os.environ}


def compiler() -> Path:
    """Returns the compiler's program, of the installed package ziglang, never of the working folder."""
    program = _package("ziglang") / ("zig.exe" if os.name == "nt" else "zig")
    if not program.is_file():
        raise BuildError(
            f"{printable(str(program))}: there is no such file; package ziglang carries the compiler"
        )
    return program


def _package(name: str) -> Path:
    """Returns the folder of an installed package, never one in the working folder."""
    spec = PathFinder.find_spec(name, package_places())
    if spec is None or spec.origin is None:
        raise BuildError(f"package {name} is not installed")
    return Path(spec.origin).parent.absolute()


def package_places() -> list[str]:
    """Returns where Python looks for packages, but for the working folder: what is there may be anybody's."""
    try:
        here = os.path.realpath(Path.cwd())
    except FileNotFoundError:  # it has been removed
        here = ""
    return [place for place in sys.path if place and os.path.realpath(place) != here]
