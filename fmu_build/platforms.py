"""The platforms that an FMU can hold a library for, and the folders that FMI gives them."""

import platform
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from fmu_build.errors import BuildError
from fmu_build.versions import VERSIONS
from supervessel.problems import unknown


@dataclass(frozen=True)
class Platform:
    """A platform to compile for.

    name   : platform tuple of FMI 3.0, and its folder in binaries/
    target : the compiler's name for it, with the oldest system to run on
    fmi2   : folder in binaries/ of FMI 2.0
    suffix : of a shared library
    """

    name: str
    target: str
    fmi2: str
    suffix: str

    def folder(self, fmi: int) -> str:
        """Returns the folder in binaries/ of an FMI version."""
        return self.name if VERSIONS[fmi].platform_tuples else self.fmi2


MACOS_X86_64 = Platform("x86_64-darwin", "x86_64-macos.11.0", "darwin64", ".dylib")
MACOS_AARCH64 = Platform("aarch64-darwin", "aarch64-macos.11.0", "aarch64-darwin", ".dylib")

PLATFORMS = (
    Platform("x86_64-linux", "x86_64-linux-gnu.2.17", "linux64", ".so"),
    Platform("aarch64-linux", "aarch64-linux-gnu.2.17", "aarch64-linux", ".so"),
    Platform("x86_64-windows", "x86_64-windows-gnu", "win64", ".dll"),
    MACOS_X86_64,
    MACOS_AARCH64,
)
"""In FMI 2.0.4 and later "64" in a folder's name means 64-bit x86, and any other machine has the folder of
FMI 3.0. Before, Apple silicon had none, and importers look for it in darwin64: see `library_contents`."""


def host_platform() -> Platform:
    """Returns this machine's platform. Raises BuildError on a machine that FMUs are not built for."""
    machine = {"amd64": "x86_64", "x86_64": "x86_64", "arm64": "aarch64", "aarch64": "aarch64"}.get(
        platform.machine().lower(), platform.machine()
    )
    name = f"{machine}-{platform.system().lower()}"
    for candidate in PLATFORMS:
        if candidate.name == name:
            return candidate
    names = ", ".join(candidate.name for candidate in PLATFORMS)
    raise BuildError(f"this machine is {name}; name the platform to build for: {names}")


def platforms_named(names: Iterable[str]) -> tuple[Platform, ...]:
    """Returns the platforms of these names, in the order of PLATFORMS, each once; "all" stands for every one.

    Raises ValueError for names that are no platform, each with the nearest that is.
    """
    known = [platform.name for platform in PLATFORMS]
    wanted = set(names)
    problems = [unknown("platform", name, [*known, "all"]) for name in sorted(wanted - {*known, "all"})]
    if problems:
        raise ValueError("; ".join(problems))
    return tuple(platform for platform in PLATFORMS if wanted & {platform.name, "all"})


def library_contents(platforms: Sequence[Platform], fmi: int) -> dict[str, tuple[Platform, ...]]:
    """Returns the platforms whose code the library in each folder of binaries/ holds.

    One each in FMI 3.0. In FMI 2.0 Apple silicon's library is in its own folder, where importers look that
    follow FMI 2.0.4, and also in darwin64, where others look. That folder is for x86_64, so that the library
    there is a universal one, of both machines.
    """
    contents: dict[str, tuple[Platform, ...]] = {p.folder(fmi): (p,) for p in platforms}
    if not VERSIONS[fmi].platform_tuples and MACOS_AARCH64 in platforms:
        contents[MACOS_X86_64.fmi2] = (MACOS_X86_64, MACOS_AARCH64)
    return contents
