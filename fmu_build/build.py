"""From a scene to a packed FMU."""

import io
import json
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from fmu_build.accuracy import choose
from fmu_build.compile.compiler import FLAGS, compile_binaries
from fmu_build.document.documentation import documentation
from fmu_build.document.reference_result import reference_result
from fmu_build.errors import BuildError
from fmu_build.generate.change_tables import change_tables
from fmu_build.generate.scene_files import digest, model_source, scene_header, scene_source
from fmu_build.generate.sources import source_file_names, source_files
from fmu_build.generate.vessel_loop import loop_functions, loop_source, loop_steps, loop_tables
from fmu_build.interface.model_description import model_description
from fmu_build.interface.terminals import terminals_and_icons
from fmu_build.interface.variable_table import Entry, variable_table
from fmu_build.platforms import Platform, host_platform
from fmu_build.storage.cache import cache_folder, kept_sources, reason
from fmu_build.trade import TradeError
from supervessel.equations import Equations, equations
from supervessel.problems import printable
from supervessel.scene.schema import Scene
from supervessel.shell.files import OutputError, check_output, write_file
from supervessel.shell.processes import Workers

ARCHIVE_TIME = (1980, 1, 1, 0, 0, 0)
"""Every file in an archive carries the same time, so that a scene gives the same bytes each time."""

TOKEN_IN_C = 'MODEL_TOKEN[] = "{}"'
TOKEN_IN_XML = {2: 'guid="{}"', 3: 'instantiationToken="{}"'}
"""Where the token stands that is made of everything else."""

WHOLE = "whole.c"
"""All of an FMU's C in one translation unit, so that the compiler inlines across files."""


def build_fmu(scene: Scene, output: str | Path, fmi: int = 3, platforms: Sequence[Platform] = ()) -> Path:
    """Builds the FMU of a scene and returns its path.

    scene     : from `load_scene`
    output    : the file to write; its folder must be there. An old FMU is replaced once the new is whole;
                anything else that is there, and is not empty, is refused (see `supervessel.shell.files`)
    fmi       : version of the FMI standard, 2 or 3
    platforms : to compile for, of `fmu_build.platforms.PLATFORMS`; none: this machine's
    A scene with `[accuracy]` is built as `supervessel.choose` finds it; the evidence is in the archive.
    Raises BuildError if the compiler fails, the file cannot be written, or nothing is as exact as the scene
    asks, ValueError for another `fmi`.

    Example:
        >>> from fmu_build import build_fmu
        >>> build_fmu(scene, "iss_dg.fmu", fmi=2).name
        'iss_dg.fmu'
    """
    if fmi not in (2, 3):
        raise ValueError(f"fmi = {fmi}: must be 2 or 3")
    output = Path(output)
    check_fmu_output(output)
    platforms = platforms or (host_platform(),)
    scene, evidence = _chosen(scene)
    model = equations(scene)
    entries = variable_table(scene, model)
    sources, description = _generated(scene, model, entries, fmi)
    packed = source_files(sources, fmi, scene.name)
    with Workers(1) as aside:  # the compiler is a process of its own
        names = source_file_names(sources, fmi)
        binaries = aside.submit(compile_sources, packed, names, fmi, platforms, scene.name)
        beside = companions(scene, model, entries, fmi, evidence)
    content = {"modelDescription.xml": description, **packed, **binaries.result(), **beside}
    write_archive(content, output)
    return output


def _chosen(scene: Scene) -> tuple[Scene, dict[str, Any] | None]:
    """Returns a scene with its law, and by what evidence that was chosen, if it was."""
    if scene.accuracy is None:
        return scene, None
    try:
        return choose(scene)
    except TradeError as error:
        raise BuildError(f"{scene.name}: {error}") from None


def generate(scene: Scene, fmi: int, model: Equations | None = None) -> tuple[dict[str, str], bytes]:
    """Returns what is particular to a scene: its C files by name, and modelDescription.xml.

    model : the scene's equations, if they are there already
    """
    model = model or equations(scene)
    return _generated(scene, model, variable_table(scene, model), fmi)


def _generated(
    scene: Scene, model: Equations, entries: Sequence[Entry], fmi: int
) -> tuple[dict[str, str], bytes]:
    """Returns what `generate` does, from a scene's equations and variable table."""
    changing = model.change is not None
    loop = loop_tables(scene, model)
    functions = model.functions if loop is None else loop_functions(scene, model)
    tables = change_tables(scene, model) + loop_source(loop)
    sources = {
        "model.c": model_source(functions),
        "scene.h": scene_header(scene, model, entries, functions, loop),
        "scene.c": scene_source(entries, "", changing) + tables,
        "lane_kernels.h": loop_steps(scene, loop),
    }
    names = source_file_names(sources, fmi)
    without_token = model_description(scene, entries, "", fmi, names)
    token = digest(*source_files(sources, fmi, scene.name).values(), without_token)
    sources["scene.c"] = sources["scene.c"].replace(TOKEN_IN_C.format(""), TOKEN_IN_C.format(token))
    attribute = TOKEN_IN_XML[fmi]
    with_token = attribute.format(token).encode()
    return sources, without_token.replace(attribute.format("").encode(), with_token, 1)


def companions(
    scene: Scene,
    model: Equations,
    entries: Sequence[Entry],
    fmi: int,
    evidence: Mapping[str, Any] | None = None,
) -> dict[str, bytes]:
    """Returns documentation, icons, terminals and reference result by their paths in the archive.

    evidence : of `supervessel.choose`, for a scene with `[accuracy]`
    """
    shown = {} if evidence is None else {"resources/accuracy.json": json.dumps(evidence, indent=1).encode()}
    return {
        **documentation(scene, entries, fmi, evidence),
        **shown,
        "terminalsAndIcons/terminalsAndIcons.xml": terminals_and_icons(scene, entries, fmi),
        **reference_result(scene, model),
    }


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
    whole = "".join(f'#include "sources/{name}"\n' for name in names)
    try:
        folder = kept_sources({**packed, WHOLE: whole.encode()})
    except OSError as error:
        place = error.filename or cache_folder()
        raise BuildError(f"{printable(str(place))}: {reason(error, 'to compile in')}") from None
    return compile_binaries([WHOLE], folder, platforms, fmi, identifier, flags)


def check_fmu_output(output: Path, inputs: Iterable[Path] = ()) -> None:
    """Raises BuildError, before any work is done, where an FMU cannot be written.

    A file that is there, holds something and is no FMU may be named by mistake: it is not replaced.
    inputs : files that are read for it
    """
    try:
        if check_output(output, inputs) and not _is_fmu(output):
            raise OutputError(output, "is there already and is no FMU; remove it or take another name")
    except OutputError as error:
        raise BuildError(str(error)) from None


def _is_fmu(file: Path) -> bool:
    """Whether a file is an archive with a model description."""
    try:
        with zipfile.ZipFile(file) as archive:
            return "modelDescription.xml" in archive.namelist()
    except (OSError, ValueError, NotImplementedError, zipfile.BadZipFile):
        return False


def write_archive(content: Mapping[str, bytes], output: Path) -> None:
    """Writes a zip archive with the same bytes for the same content. Raises BuildError if it cannot."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted(content):
            info = zipfile.ZipInfo(name, ARCHIVE_TIME)
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = 0o644 << 16
            archive.writestr(info, content[name])
    try:
        write_file(output, packed.getvalue())
    except OutputError as error:
        raise BuildError(str(error)) from None
