"""From a scene to a packed FMU."""

import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path

from fmu_build.codegen import digest, model_source, scene_header, scene_source
from fmu_build.compiler import Platform, compile_library, host_platform
from fmu_build.errors import BuildError
from fmu_build.model_description import model_description
from fmu_build.table import variable_table
from supervessel.equations import equations
from supervessel.scene import Scene

LAYER = Path(__file__).parent / "c"
"""The scene-independent C."""

COMMON_SOURCES = ("instance.c", "variables.c", "composite.c", "solver.c")

ARCHIVE_TIME = (1980, 1, 1, 0, 0, 0)
"""Every file in an archive carries the same time, so that a scene gives the same bytes each time."""


def build_fmu(scene: Scene, output: str | Path, fmi: int = 3, platform: Platform | None = None) -> Path:
    """Builds the FMU of a scene and returns its path.

    scene    : from `load_scene`
    output   : the file to write; its folder must be there. An old file is replaced when the new one is whole.
    fmi      : version of the FMI standard, 2 or 3
    platform : to compile for, by default this machine's
    Raises BuildError if the compiler fails or the file cannot be written, ValueError for another `fmi`.
    """
    if fmi not in (2, 3):
        raise ValueError(f"fmi = {fmi}: must be 2 or 3")
    output = Path(output)
    _check_output(output)
    platform = platform or host_platform()
    sources, description = generate(scene, fmi)
    with tempfile.TemporaryDirectory(prefix="supervessel-") as name:
        folder = Path(name)
        library = folder / f"{scene.name}{platform.suffix}"
        compile_sources(sources, folder, fmi, platform, library)
        content = {
            "modelDescription.xml": description,
            f"binaries/{platform.folder(fmi)}/{library.name}": library.read_bytes(),
        }
        _write_archive(content, output)
    return output


def generate(scene: Scene, fmi: int) -> tuple[dict[str, str], bytes]:
    """Returns what is particular to a scene: its C files by name, and modelDescription.xml."""
    model = equations(scene)
    entries = variable_table(scene, model)
    shaping = frozenset(range(1, 1 + len(model.p_names)))
    sources = {
        "model.c": model_source(model),
        "scene.h": scene_header(scene, model, entries),
    }
    layer = [path.read_bytes() for path in sorted(LAYER.glob("*.[ch]"))]
    token = digest(
        *sources.values(),
        scene_source(entries, shaping, ""),
        model_description(scene, entries, "", fmi),
        *layer,
    )
    sources["scene.c"] = scene_source(entries, shaping, token)
    return sources, model_description(scene, entries, token, fmi)


def compile_sources(
    sources: Mapping[str, str], folder: Path, fmi: int, platform: Platform, library: Path
) -> None:
    """Compiles a scene's C with the scene-independent C layer into a shared library.

    sources : C files by name, written into `folder`
    """
    for name, text in sources.items():
        (folder / name).write_text(text)
    layer = (*COMMON_SOURCES, f"fmi{fmi}.c", f"fmi{fmi}_unsupported.c")
    files = [folder / name for name in sources if name.endswith(".c")] + [LAYER / name for name in layer]
    compile_library(files, [folder, LAYER], platform, library)


def _check_output(output: Path) -> None:
    """Raises BuildError, before any work is done, where the archive could not be written."""
    if output.is_dir():
        raise BuildError(f"{output}: is a folder; the FMU needs a file name")
    try:
        with tempfile.TemporaryFile(dir=output.parent):
            pass
    except OSError as error:
        raise BuildError(f"{output}: cannot be written: {error.strerror}: {output.parent}") from None


def _write_archive(content: Mapping[str, bytes], output: Path) -> None:
    """Writes a zip archive with the same bytes for the same content; the file appears when it is whole."""
    part = output.with_name(f"{output.name}.part")
    try:
        with zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as archive:
            for name in sorted(content):
                info = zipfile.ZipInfo(name, ARCHIVE_TIME)
                info.compress_type = zipfile.ZIP_DEFLATED
                info.external_attr = 0o644 << 16
                archive.writestr(info, content[name])
        part.replace(output)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise BuildError(f"{output}: cannot be written: {error.strerror}") from None
