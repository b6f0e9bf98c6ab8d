"""From a scene to a packed FMU."""

import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from fmu_build.changes import change_tables
from fmu_build.codegen import digest, model_source, scene_header, scene_source
from fmu_build.compiler import compile_binaries, compiler_cache
from fmu_build.documentation import documentation
from fmu_build.errors import BuildError
from fmu_build.loop import loop_functions, loop_source, loop_steps, loop_tables
from fmu_build.model_description import model_description
from fmu_build.platforms import Platform, host_platform
from fmu_build.reference_result import reference_result
from fmu_build.sources import source_file_names, source_files
from fmu_build.table import Entry, variable_table
from fmu_build.terminals import terminals_and_icons
from supervessel.equations import Equations, equations
from supervessel.scene import Scene

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
    output    : the file to write; its folder must be there. An old one is replaced once the new is whole.
    fmi       : version of the FMI standard, 2 or 3
    platforms : to compile for, of `fmu_build.platforms.PLATFORMS`; none: this machine's
    Raises BuildError if the compiler fails or the file cannot be written, ValueError for another `fmi`.

    Example:
        >>> from fmu_build import build_fmu
        >>> build_fmu(scene, "iss_dg.fmu", fmi=2).name
        'iss_dg.fmu'
    """
    if fmi not in (2, 3):
        raise ValueError(f"fmi = {fmi}: must be 2 or 3")
    output = Path(output)
    _check_output(output)
    platforms = platforms or (host_platform(),)
    model = equations(scene)
    entries = variable_table(scene, model)
    sources, description = _generated(scene, model, entries, fmi)
    packed = source_files(sources, fmi, scene.name)
    with ThreadPoolExecutor(1) as aside:  # the compiler is a process of its own
        names = source_file_names(sources, fmi)
        binaries = aside.submit(compile_sources, packed, names, fmi, platforms, scene.name)
        beside = companions(scene, model, entries, fmi)
    content = {"modelDescription.xml": description, **packed, **binaries.result(), **beside}
    _write_archive(content, output)
    return output


def generate(scene: Scene, fmi: int) -> tuple[dict[str, str], bytes]:
    """Returns what is particular to a scene: its C files by name, and modelDescription.xml."""
    model = equations(scene)
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


def companions(scene: Scene, model: Equations, entries: Sequence[Entry], fmi: int) -> dict[str, bytes]:
    """Returns documentation, icons, terminals and reference result by their paths in the archive."""
    return {
        **documentation(scene, entries, fmi),
        "terminalsAndIcons/terminalsAndIcons.xml": terminals_and_icons(scene, entries, fmi),
        **reference_result(scene, model),
    }


def compile_sources(
    packed: Mapping[str, bytes],
    names: Sequence[str],
    fmi: int,
    platforms: Sequence[Platform],
    identifier: str,
) -> dict[str, bytes]:
    """Returns an FMU's libraries by archive path, compiled from its own sources/.

    packed     : the files of sources/ by archive path
    names      : of the C files among them
    identifier : the FMU's modelIdentifier
    Raises BuildError if the compiler fails, or if there is no room for what it makes.
    """
    whole = "".join(f'#include "sources/{name}"\n' for name in names)
    try:
        folder = _kept({**packed, WHOLE: whole.encode()})
        return compile_binaries([WHOLE], folder, platforms, fmi, identifier)
    except OSError as error:
        raise BuildError(f"{error.filename}: no room to compile in: {error.strerror}") from None


def _kept(files: Mapping[str, bytes]) -> Path:
    """Returns a folder in the compiler's cache with these files, by path.

    The same files are in the same folder again: only then does the compiler know what it has built.
    """
    kept = compiler_cache() / "sources"
    folder = kept / digest(*(part for path, text in sorted(files.items()) for part in (path, text))).strip(
        "{}"
    )
    if folder.is_dir():
        return folder
    kept.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory(dir=kept) as name:
        part = Path(name, "whole")
        for path, text in files.items():
            file = part / path
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(text)
        if not folder.is_dir():  # another process may have been faster
            part.replace(folder)
    return folder


def _check_output(output: Path) -> None:
    """Raises BuildError, before any work is done, where the archive could not be written."""
    try:
        if output.is_dir():
            raise BuildError(f"{output}: is a folder; the FMU needs a file name")
    except OSError as error:
        raise BuildError(f"{output}: cannot be written: {error.strerror}") from None
    try:
        with tempfile.TemporaryFile(dir=output.parent):
            pass
    except OSError as error:
        raise BuildError(f"{output}: cannot be written: {error.strerror}: {output.parent}") from None


def _write_archive(content: Mapping[str, bytes], output: Path) -> None:
    """Writes a zip archive with the same bytes for the same content; the file appears when it is whole."""
    part = None
    try:
        with tempfile.NamedTemporaryFile(dir=output.parent, prefix=".fmu-", delete=False) as stream:
            part = Path(stream.name)
            with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
                for name in sorted(content):
                    info = zipfile.ZipInfo(name, ARCHIVE_TIME)
                    info.compress_type = zipfile.ZIP_DEFLATED
                    info.external_attr = 0o644 << 16
                    archive.writestr(info, content[name])
        part.chmod(0o644)
        part.replace(output)
    except OSError as error:
        if part is not None:
            part.unlink(missing_ok=True)
        raise BuildError(f"{output}: cannot be written: {error.strerror}") from None
