"""What an FMU file says of itself, and the scene in it that it was built from: `supervessel info`."""

import argparse
import io
import zipfile
import zlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

from fmu_build.document.reference_result import SCENE
from fmu_build.interface.model_description import TOOL
from fmu_build.platforms import PLATFORMS
from fmu_build.versions import VERSIONS
from supervessel.loading import scene_from_text
from supervessel.problems import SceneError, printable
from supervessel.scene.schema import Scene
from supervessel.shell.console import print_problem, print_results
from supervessel.shell.reading import LARGEST_TOML, ReadingError, check_kind, text_of

DESCRIPTION = "modelDescription.xml"

LARGEST_DESCRIPTION = 100_000_000
"""Bytes of modelDescription.xml that are read: a hundred times those of a hundred vessels, all inputs."""

KINDS = {
    "CoSimulation": "co-simulation",
    "ModelExchange": "model exchange",
    "ScheduledExecution": "scheduled execution",
}
"""What an FMU can be used for, by the element that tells it."""


@dataclass(frozen=True)
class Contents:
    """What stands in an FMU that this project has built.

    header    : attributes of the model description
    kinds     : what it can be used for, in words
    variables : how many there are of each causality
    folders   : names of the folders in binaries/
    text      : of the scene file that it was built from
    scene     : the same, read
    """

    header: Mapping[str, str]
    kinds: Sequence[str]
    variables: Mapping[str, int]
    folders: Sequence[str]
    text: str
    scene: Scene


def contents(path: Path) -> Contents:
    """Returns what stands in an FMU.

    Raises ReadingError for a file that cannot be read, is no FMU or one of another tool, SceneError where
    the scene in it cannot be used.
    """
    try:
        check_kind(path, path.stat().st_mode)
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
            if DESCRIPTION not in names:
                raise ReadingError(f"is no FMU: the archive has no {DESCRIPTION}")
            header, kinds, variables = _described(_member(archive, DESCRIPTION, LARGEST_DESCRIPTION))
            _check_ours(header, names)
            text = text_of(_member(archive, SCENE, LARGEST_TOML), LARGEST_TOML)
    except OSError as error:
        raise ReadingError(f"cannot be read: {error.strerror or error}") from None
    except zipfile.BadZipFile:
        raise ReadingError("is no FMU, which is a zip archive; or it is cut off") from None
    folders = sorted({name.split("/")[1] for name in names if name.startswith("binaries/")} - {""})
    scene = scene_from_text(text, f"{path.name}: {SCENE}")
    return Contents(header, kinds, variables, folders, text, scene)


def _member(archive: zipfile.ZipFile, name: str, most: int) -> bytes:
    """Returns what a file in an archive holds. Raises ReadingError."""
    try:
        with archive.open(name) as stream:
            content = stream.read(most + 1)
    except (RuntimeError, NotImplementedError, EOFError, zlib.error, zipfile.BadZipFile) as error:
        raise ReadingError(f"{name} in it cannot be read: {printable(str(error))}") from None
    if len(content) > most:
        raise ReadingError(f"{name} in it is longer than {most} bytes; at most that many are read")
    return content


def _described(text: bytes) -> tuple[dict[str, str], list[str], Counter[str]]:
    """Returns header, kinds and counts of variables of a model description. Raises ReadingError."""
    header: dict[str, str] = {}
    kinds: list[str] = []
    variables: Counter[str] = Counter()
    try:
        for event, element in ET.iterparse(io.BytesIO(text), ("start", "end")):
            if event == "start":
                header = header or {"": element.tag, **element.attrib}
                continue
            if element.tag in KINDS:
                kinds.append(KINDS[element.tag])
            if "causality" in element.attrib:
                variables[element.attrib["causality"]] += 1
            element.clear()
    except (ET.ParseError, ValueError, LookupError) as error:
        raise ReadingError(f"{DESCRIPTION} in it is no XML: {printable(str(error))}") from None
    if header.pop("") != "fmiModelDescription":
        raise ReadingError(f"is no FMU: {DESCRIPTION} in it describes something else")
    return header, kinds, variables


def _check_ours(header: Mapping[str, str], names: Sequence[str]) -> None:
    """Raises ReadingError for an FMU that another tool has made, or that has no scene."""
    tool = header.get("generationTool", "")
    if tool.split(" ")[0] != TOOL:
        maker = f'"{printable(tool)}"' if tool else "a tool that does not say its name"
        version = printable(header.get("fmiVersion", "?"))
        raise ReadingError(
            f"is an FMU (FMI {version}) that {maker} has made, and has no scene of {TOOL}'s in it"
        )
    if SCENE not in names:
        raise ReadingError(f"was made by {printable(tool)}, but has no {SCENE} in it any more")


def info(options: argparse.Namespace) -> int:
    """Runs the command: fmu and scene; returns its exit status."""
    path: Path = options.fmu
    try:
        found = contents(path)
    except ReadingError as error:
        print_problem(f"{printable(str(path))}: {error}")
        return 1
    except SceneError as error:
        print_problem(error)
        return 1
    if options.scene:
        return print_results(found.text.rstrip("\n"), "the scene")
    return print_results("\n".join(f"{key:<11}{said}" for key, said in _lines(found)), "the FMU's contents")


def _lines(found: Contents) -> list[tuple[str, str]]:
    """Returns what is shown of an FMU: of each line its key and what it says."""
    header, scene, counts = found.header, found.scene, found.variables
    count = len(scene.vessels)
    law = f"law {scene.rotation.law}, propagator {scene.rotation.propagator}"
    if scene.accuracy is not None:
        law = f"law and propagator chosen for {scene.accuracy.attitude:g} rad"
    lines = [
        ("model", printable(header.get("modelName", "?"))),
        ("", printable(header.get("description", ""))),
        ("made by", printable(header["generationTool"])),
        ("FMI", f"{printable(header.get('fmiVersion', '?'))}, {', '.join(found.kinds)}"),
        ("platforms", ", ".join(_platforms(found)) or "none; the sources are in it"),
        ("variables", ", ".join(f"{counts[key]} {key}s" for key in ("input", "parameter", "output"))),
        ("scene", f"{count} vessel{'s' if count > 1 else ''}, root {scene.root}; {law}"),
    ]
    flown = scene.experiment
    if flown is not None:
        lines.append(("experiment", f"{flown.duration:g} s in steps of {flown.step:g} s"))
    return [(key, said) for key, said in lines if said]


def _platforms(found: Contents) -> list[str]:
    """Returns the platforms that the FMU has libraries for; the folder's name where that is of none."""
    numbers = [n for n, version in VERSIONS.items() if version.name == found.header.get("fmiVersion")]
    known = {platform.folder(n): platform.name for n in numbers for platform in PLATFORMS}
    return [known.get(folder, printable(folder)) for folder in found.folders]
