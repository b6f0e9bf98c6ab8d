"""An FMU's libraries, compiled from the files of its own sources/."""

from collections.abc import Mapping, Sequence

from fmu_build.compile.compiler import FLAGS, compile_binaries
from fmu_build.platforms import Platform

WHOLE = "whole.c"
"""All of an FMU's C in one translation unit, so that the compiler inlines across files; FMI's functions keep
their plain names, by which importers look them up in a shared library."""


def compile_sources(  # noqa: PLR0913, PLR0917
    packed: Mapping[str, bytes],
    names: Sequence[str],
    fmi: int,
    platforms: Sequence[Platform],
    identifier: str,
    flags: Sequence[str] = FLAGS,
) -> dict[str, bytes]:
    """Returns an FMU's libraries by archive path, compiled from its own sources/.

    packed     : the files of sources/ by archive path
    names      : of the C files among them
    identifier : the FMU's modelIdentifier
    flags      : of the compiler
    Raises BuildError if the compiler fails, or if what it reads and makes cannot be written.
    """
    plain_names = f"#define FMI{fmi}_OVERRIDE_FUNCTION_PREFIX\n"
    whole = plain_names + "".join(f'#include "sources/{name}"\n' for name in names)
    files = {**packed, WHOLE: whole.encode()}
    return compile_binaries(files, WHOLE, platforms, fmi, identifier, flags)
