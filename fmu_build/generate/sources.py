"""The C that an FMU is compiled from, as it lies in the archive: any C99 compiler can build the FMU again.

FMI's functions have the model's name before their own, as the standard asks for sources (FMI 2.0: 2.1.1, FMI
3.0: 2.2.1), so that several FMUs can be linked into one program. Who compiles a shared library, which exports
the plain names, defines FMI2_OVERRIDE_FUNCTION_PREFIX or FMI3_OVERRIDE_FUNCTION_PREFIX (FMI 2.0.4: 2.1.1).
The FMI standard's headers are the importer's own.
"""

import hashlib
import re
from collections.abc import Container, Iterable, Mapping
from pathlib import Path
from xml.etree import ElementTree as ET

from fmu_build.generate.picked_files import is_picked
from fmu_build.versions import VERSIONS

LAYER = Path(__file__).parents[1] / "c"
"""The C layer: files whose text is the same for every scene."""

NEEDS_LIBM = ("aarch64-linux", "x86_64-linux")
"""Platforms where sqrt, ceil and the like are in a library of their own."""

EXTERNAL = re.compile(r"^(?!static\b|typedef\b)(?:[A-Za-z_]\w*[ *]+)+(\w+)(?:\(|\[\w*\] =)", re.MULTILINE)
"""The definition, from a line's beginning, of a function or an array that other files can see."""

PRELUDE = """\
/* Generated: comes first in each C file. */
#ifndef PRELUDE_H
#define PRELUDE_H

/* Products and sums are rounded one by one, never fused: platforms agree to the last bit. */
#if defined(_MSC_VER)
#pragma fp_contract(off)
#elif defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("fp-contract=off")
#else
#pragma STDC FP_CONTRACT OFF
#endif

/* Stands first in functions that divide: nothing is divided that the C does not divide. Otherwise clang fills
   a vector of two with one quotient and a zero by zero, and a host that traps exceptions dies of it. */
#if defined(__clang__)
#define DIVIDES_ONLY_AS_WRITTEN _Pragma("clang fp exceptions(maytrap)")
#else
#define DIVIDES_ONLY_AS_WRITTEN
#endif

/* Several FMUs can be linked into one program, and no name is taken for one of the system's. A shared library
   exports FMI's plain names: who compiles one defines the first of these, or another prefix. */
"""

FUNCTION_PREFIX = """\
#if !defined({version}_OVERRIDE_FUNCTION_PREFIX) && !defined({version}_FUNCTION_PREFIX)
#define {version}_FUNCTION_PREFIX {identifier}_
#endif

"""

PLAIN_NAMES = {
    "name": "FMI3_OVERRIDE_FUNCTION_PREFIX",
    "value": "1",
    "optional": "true",
    "description": "for a shared library: FMI's functions have their plain names",
}
"""A definition of buildDescription.xml: who links FMUs into a program leaves it out."""

CASADI_NAME = re.compile(r"^#define (casadi_\w+) CASADI_PREFIX\((\w+)\)$", re.MULTILINE)
"""A name in generated C that stands for another one, model_..."""


def layer_files(fmi: int) -> dict[str, str]:
    """Returns the C and H files of the layer that every FMU of an FMI version has, by name."""
    others = tuple(f"fmi{number}" for number in VERSIONS if number != fmi)
    return {
        path.name: path.read_text(encoding="utf-8")
        for path in sorted(LAYER.glob("*.[ch]"))
        if not (is_picked(path.name) or path.name.startswith(others))
    }


def layer_files_of(names: Container[str]) -> dict[str, str]:
    """Returns the C and H files of the layer that an FMU has beside those of `layer_files`, by name.

    names : without .c and .h, see `picked_files`
    """
    return {
        path.name: path.read_text(encoding="utf-8")
        for path in sorted(LAYER.glob("*.[ch]"))
        if path.stem in names and is_picked(path.name)
    }


def source_file_names(scene_sources: Iterable[str], fmi: int) -> list[str]:
    """Returns the names of the C files to compile, in the folder sources/.

    scene_sources : names of the scene's own C and H files, and of those of the layer that were picked for it
    """
    return sorted(name for name in {*scene_sources, *layer_files(fmi)} if name.endswith(".c"))


def source_files(scene_sources: Mapping[str, str], fmi: int, model_identifier: str) -> dict[str, bytes]:
    """Returns the content of the archive's folder sources/, by archive path.

    scene_sources    : by name, the scene's own C and H files and those of the layer that were picked for it
    fmi              : version of the FMI standard; FMI 3.0 has a buildDescription.xml among the files,
                       FMI 2.0 lists `source_file_names` in modelDescription.xml
    model_identifier : the FMU's modelIdentifier
    """
    texts = layer_files(fmi) | dict(scene_sources)
    names = source_file_names(scene_sources, fmi)
    external = _external_names(texts[name] for name in names)
    for name in names:
        texts[name] = '#include "prelude.h"\n' + texts[name]
    texts["prelude.h"] = _prelude(external, model_identifier, fmi)
    if not VERSIONS[fmi].lists_sources:
        texts["buildDescription.xml"] = _build_description(model_identifier, names)
    return {f"sources/{name}": texts[name].encode() for name in sorted(texts)}


def _external_names(texts: Iterable[str]) -> set[str]:
    """Returns the names, other than FMI's, that the C files define with external linkage."""
    names: set[str] = set()
    for text in texts:
        aliases = dict(CASADI_NAME.findall(text))
        names |= {f"model_{name}" for name in aliases.values()}
        names |= {name for name in EXTERNAL.findall(text) if name not in aliases}
    return {name for name in names if not name.startswith("fmi")}


def _prelude(names: Iterable[str], model_identifier: str, fmi: int) -> str:
    """Returns prelude.h: the prefix of FMI's functions, and another name for each external name."""
    prefix = FUNCTION_PREFIX.format(version=f"FMI{fmi}", identifier=model_identifier)
    lines = "\n".join(f"#define {name} {model_identifier}_fmi{fmi}_{name}" for name in sorted(names))
    return PRELUDE + prefix + lines + "\n\n#endif\n"


def _build_description(model_identifier: str, names: Iterable[str]) -> str:
    """Returns buildDescription.xml: how to compile for any platform, and for those that need libm."""
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    for platform in ("", *NEEDS_LIBM):
        configuration = ET.SubElement(root, "BuildConfiguration", modelIdentifier=model_identifier)
        file_set = ET.SubElement(configuration, "SourceFileSet", language="C99")
        for name in names:
            ET.SubElement(file_set, "SourceFile", name=name)
        ET.SubElement(file_set, "PreprocessorDefinition", PLAIN_NAMES)
        ET.SubElement(file_set, "IncludeDirectory", name=".")
        if platform:
            configuration.set("platform", platform)
            ET.SubElement(configuration, "Library", name="m", external="true", description="C mathematics")
    ET.indent(root, "  ")
    text: bytes = ET.tostring(root, encoding="UTF-8", xml_declaration=True)
    return text.decode() + "\n"


def digest(*texts: str | bytes) -> str:
    """Returns the token of an FMU that is made of these texts: another one as soon as any text differs."""
    together = hashlib.sha256()
    for text in texts:
        raw = text.encode() if isinstance(text, str) else text
        together.update(len(raw).to_bytes(8, "little") + raw)
    return "{" + together.hexdigest() + "}"
