"""From a scene to a packed FMU."""

import io
import json
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from fmu_build.accuracy import choose
from fmu_build.compile.library import compile_sources
from fmu_build.document.documentation import documentation
from fmu_build.document.reference_result import EVIDENCE, SCENE, manifest, reference_result
from fmu_build.errors import BuildError
from fmu_build.generate.model import generated
from fmu_build.generate.sources import source_file_names, source_files
from fmu_build.interface.names import Naming, check_names, check_naming
from fmu_build.interface.terminals import terminals_and_icons
from fmu_build.interface.variable_table import TableEntry, variable_table
from fmu_build.platforms import Platform, host_platform
from fmu_build.versions import NEWEST, check_version
from supervessel.composite.resolved import resolve
from supervessel.equations import Equations, equations
from supervessel.problems import TradeError
from supervessel.scene.schema import Scene
from supervessel.scene.writing import scene_text
from supervessel.shell.files import OutputError, check_output, write_file
from supervessel.shell.processes import Workers

ARCHIVE_TIME = (1980, 1, 1, 0, 0, 0)
"""Every file in an archive carries the same time, so that a scene gives the same bytes each time."""


def build_fmu(
    scene: Scene,
    output: str | Path,
    fmi: int = NEWEST,
    platforms: Sequence[Platform] = (),
    names: Naming = "structured",
) -> Path:
    """Builds the FMU of a scene and returns its path.

    scene     : from `load_scene`
    output    : the file to write; its folder must be there. An old FMU is replaced once the new is whole;
                anything else that is there, and is not empty, is refused (see `supervessel.shell.files`)
    fmi       : version of the FMI standard, of `fmu_build.versions.VERSIONS`
    platforms : to compile for, of `fmu_build.platforms.PLATFORMS`; none: this machine's
    names     : of the FMU's variables, "structured" as in scene and twin, or "flat": DG_nose_position_1
    A scene with `[accuracy]` is built as `supervessel.choose` finds it; the evidence is in the archive.
    Raises BuildError if the compiler fails, the file cannot be written, nothing is as exact as the scene
    asks, or two variables would have one flat name; ValueError for another `fmi` or another naming.

    Example:
        >>> from fmu_build import build_fmu
        >>> build_fmu(scene, "iss_dg.fmu", fmi=2).name
        'iss_dg.fmu'
    """
    check_version(fmi)
    check_naming(names)
    output = Path(output)
    check_fmu_output(output)
    check_names(resolve(scene), names)  # before anything is chosen, which takes time
    platforms = platforms or (host_platform(),)
    given = scene
    scene, evidence = _chosen(scene)
    model = equations(scene)
    entries = variable_table(model, names)
    sources, description = generated(model, entries, fmi)
    packed = source_files(sources, fmi, scene.name)
    with Workers(1) as aside:  # the compiler is a process of its own
        compiled = source_file_names(sources, fmi)
        binaries = aside.submit(compile_sources, packed, compiled, fmi, platforms, scene.name)
        beside = companions(model, entries, fmi, evidence, given)
    check_fmu_output(output)  # something else may have come there in the meantime
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


def companions(
    model: Equations,
    entries: Sequence[TableEntry],
    fmi: int,
    evidence: Mapping[str, Any] | None = None,
    given: Scene | None = None,
) -> dict[str, bytes]:
    """Returns documentation, icons, terminals, scene and reference result by their paths in the archive.

    evidence : of `supervessel.choose`, for a scene with `[accuracy]`
    given    : the scene as it is given, with `[accuracy]` unanswered; None: that of the model
    """
    scene = model.resolved.scene
    shown = {} if evidence is None else {EVIDENCE: json.dumps(evidence, indent=1).encode()}
    files = {
        **documentation(scene, entries, fmi, evidence),
        **shown,
        SCENE: scene_text(given or scene).encode(),
        "terminalsAndIcons/terminalsAndIcons.xml": terminals_and_icons(scene, entries, fmi),
        **reference_result(model, entries),
    }
    return files | manifest(files)


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
