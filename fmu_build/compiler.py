"""C to a shared library, with the compiler that comes in the `ziglang` wheel."""

import importlib.util
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fmu_build.errors import BuildError

TIME_LIMIT = 600.0  # s; a first build for Windows compiles its C runtime, about a minute

FLAGS = ("-std=c99", "-O2", "-s", "-ffp-contract=off", "-fvisibility=hidden", "-fPIC", "-shared")
"""One set for all platforms. No fast-math and no contraction: platforms must agree to the last bit."""


@dataclass(frozen=True)
class Platform:
    """A platform to compile for.

    target : the compiler's name for it, with the oldest system to run on
    fmi2   : folder in binaries/ of FMI 2.0
    fmi3   : folder in binaries/ of FMI 3.0
    suffix : of a shared library
    """

    target: str
    fmi2: str
    fmi3: str
    suffix: str

    def folder(self, fmi: int) -> str:
        """Returns the folder in binaries/ of an FMI version."""
        return self.fmi3 if fmi == 3 else self.fmi2


PLATFORMS = (
    Platform("x86_64-linux-gnu.2.17", "linux64", "x86_64-linux", ".so"),
    Platform("aarch64-linux-gnu.2.17", "aarch64-linux", "aarch64-linux", ".so"),
    Platform("x86_64-windows-gnu", "win64", "x86_64-windows", ".dll"),
    Platform("x86_64-macos.11.0", "darwin64", "x86_64-darwin", ".dylib"),
    Platform("aarch64-macos.11.0", "darwin64", "aarch64-darwin", ".dylib"),
)


def host_platform() -> Platform:
    """Returns this machine's platform. Raises BuildError on a machine that FMUs are not built for."""
    machine = {"amd64": "x86_64", "x86_64": "x86_64", "arm64": "aarch64", "aarch64": "aarch64"}.get(
        platform.machine().lower(), platform.machine()
    )
    system = platform.system().lower()
    for candidate in PLATFORMS:
        if candidate.fmi3 == f"{machine}-{system}":
            return candidate
    names = ", ".join(p.fmi3 for p in PLATFORMS)
    raise BuildError(f"this machine is {machine}-{system}; FMUs are built for {names}")


def fmi_headers() -> Path:
    """Returns the folder of the FMI standard's headers, as the fmpy package carries them."""
    spec = importlib.util.find_spec("fmpy")
    if spec is None or spec.origin is None:
        raise BuildError("package fmpy is not installed; it carries the headers of the FMI standard")
    return Path(spec.origin).parent / "c-code"


def compile_library(
    sources: Sequence[Path],
    include: Sequence[Path],
    platform: Platform,
    output: Path,
    flags: Sequence[str] = FLAGS,
) -> None:
    """Compiles C sources into the shared library `output`.

    sources : C files
    include : folders of their headers, beside the FMI standard's
    Raises BuildError with the compiler's own words if it fails, or if it does not end in ten minutes.
    """
    command = [sys.executable, "-m", "ziglang", "cc", "-target", platform.target, *flags]
    if platform.suffix == ".dylib":
        command.append(f"-Wl,-install_name,@rpath/{output.name}")
    command += [f"-I{folder}" for folder in include]
    command += ["-isystem", str(fmi_headers()), "-o", str(output), *map(str, sources)]
    if platform.suffix == ".so":
        command.append("-lm")
    cache = compiler_cache()
    environment = os.environ | {"ZIG_GLOBAL_CACHE_DIR": str(cache), "ZIG_LOCAL_CACHE_DIR": str(cache)}
    try:
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, timeout=TIME_LIMIT, check=False
        )
    except subprocess.TimeoutExpired:
        raise BuildError(
            f"compiler for {platform.target} did not end within {TIME_LIMIT:g} s; its cache is {cache}"
        ) from None
    if done.returncode != 0:
        raise BuildError(f"compiler for {platform.target} failed:\n{(done.stderr or done.stdout).strip()}")


def compiler_cache() -> Path:
    """Returns a folder where the compiler may keep what it has compiled.

    SUPERVESSEL_CACHE names it; else it is the user's cache folder, or a temporary one where that cannot
    be written (the compiler never ends without a cache that it can write).
    """
    if named := os.environ.get("SUPERVESSEL_CACHE"):
        folder = Path(named)
        if _can_write(folder):
            return folder.resolve()
        raise BuildError(f"SUPERVESSEL_CACHE = {named}: is no folder that can be written")
    if system := os.environ.get("XDG_CACHE_HOME" if os.name != "nt" else "LOCALAPPDATA"):
        folder = Path(system) / "supervessel"
    else:
        folder = Path.home() / ".cache" / "supervessel"
    if _can_write(folder):
        return folder
    return Path(tempfile.mkdtemp(prefix="supervessel-"))


def _can_write(folder: Path) -> bool:
    """Whether a folder is there, or can be made, and takes files."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False
