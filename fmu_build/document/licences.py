"""The licence texts that an FMU carries: the project's own and those of what is compiled into the library."""

import re
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from textwrap import dedent

from fmu_build.compile.compiler import fmi_headers
from fmu_build.errors import BuildError

FOLDER = "documentation/licenses"
"""Spelt as the FMI standard spells it; license.txt is the file that it asks for."""

OVERVIEW = """\
Licences of what this FMU holds
===============================

The scene
  Names and numbers are those of the scene file and belong to its author.

The FMU's C code, compiled into the libraries and, where the FMU has a folder of sources, in there
  - supervessel's own code, hand-written and generated from supervessel's equations: MIT licence,
    supervessel.txt
  - What CasADi adds to the C code that it generates: by the words at the head of each generated file,
    content made by CasADi's runtime is not copyrighted, template code is under MIT-0, which asks for no
    notice. CasADi itself is not part of the FMU.
  - Declarations from the C headers of the FMI standard: 2-Clause BSD licence, fmi_standard.txt. The
    headers are not packed.

Libraries only
  - Helper routines of the compiler, where the machine code needs them: MIT licence, zig.txt
  - Windows: start-up code and functions of the mingw-w64 runtime: mingw_w64.txt
  - The C library of the system is not in them; it is found when they are loaded.

This documentation and the pictures
  As supervessel, supervessel.txt
"""


def licence_files(fmi: int) -> dict[str, bytes]:
    """Returns the files of documentation/licenses by their place in the archive.

    fmi : version of the FMI standard, of `versions.VERSIONS`: the notice of its headers is packed
    Raises BuildError if an installed package does not have its licence text where it should be.
    """
    texts = {
        "license.txt": OVERVIEW,
        "supervessel.txt": own_licence(),
        "fmi_standard.txt": header_notice((fmi_headers() / f"fmi{fmi}Functions.h").read_text()),
        "zig.txt": _packaged_text("ziglang", "ziglang/LICENSE"),
        "mingw_w64.txt": _packaged_text("ziglang", "ziglang/lib/libc/mingw/COPYING"),
    }
    return {f"{FOLDER}/{name}": text.encode() for name, text in texts.items()}


def own_licence() -> str:
    """Returns the project's licence, which a wheel and an editable installation keep with their metadata."""
    text = distribution("supervessel").read_text("licenses/LICENSE")
    if not text:
        raise BuildError("the installed package supervessel has no licence text; install it again")
    return text


def header_notice(header: str) -> str:
    """Returns copyright, licence and disclaimer from the head of one of the FMI standard's C headers."""
    found = re.search(r"Copyright \(C\).*?-{20,}.*?-{20,}", header, re.DOTALL)
    if not found:
        raise BuildError("the FMI headers of package fmpy have no licence text; install fmpy again")
    return dedent("   " + found.group()).strip() + "\n"


def _packaged_text(package: str, path: str) -> str:
    """Returns the text of a file that an installed package has."""
    try:
        return Path(str(distribution(package).locate_file(path))).read_text(encoding="utf-8")
    except (OSError, PackageNotFoundError):
        raise BuildError(
            f"licence text {path} of package {package} is missing; install {package} again"
        ) from None
