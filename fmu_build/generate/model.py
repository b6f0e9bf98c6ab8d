"""The files of an FMU that depend on its scene: C files, and modelDescription.xml with their token."""

from collections.abc import Sequence

from fmu_build.generate.change_tables import change_tables
from fmu_build.generate.equations_source import model_source
from fmu_build.generate.lane_steps import loop_steps
from fmu_build.generate.picked_files import goes_by_changes, picked_files
from fmu_build.generate.scene_header import scene_header
from fmu_build.generate.scene_source import scene_source
from fmu_build.generate.sources import digest, layer_files_of, source_file_names, source_files
from fmu_build.generate.vessel_loop import loop_functions, loop_source, loop_tables
from fmu_build.generate.wheel_tables import wheel_tables
from fmu_build.interface.model_description import model_description
from fmu_build.interface.variable_table import TableEntry, variable_table
from fmu_build.versions import VERSIONS
from supervessel.equations import Equations, equations
from supervessel.scene.schema import Scene

TOKEN_IN_C = 'MODEL_TOKEN[] = "{}"'
"""The place of the token in scene.c; the token is a digest of everything else."""


def generate(scene: Scene, fmi: int, model: Equations | None = None) -> tuple[dict[str, str], bytes]:
    """Returns the files that depend on a scene: C and H files by name, and modelDescription.xml.

    The C and H files are those generated from the scene and those of the C layer that were picked for it.

    fmi   : number of the version, of VERSIONS
    model : the scene's equations, if they are known already
    Raises BuildError if C cannot be generated.
    """
    model = model or equations(scene)
    return generated(model, variable_table(model), fmi)


def generated(model: Equations, entries: Sequence[TableEntry], fmi: int) -> tuple[dict[str, str], bytes]:
    """Returns the same as `generate`, from a scene's equations and variable table."""
    scene, changing = model.resolved.scene, goes_by_changes(model)
    loop = loop_tables(model)
    functions = model.functions if loop is None else loop_functions(model)
    tables = change_tables(model) + wheel_tables(model) + loop_source(loop)
    sources = layer_files_of(picked_files(model, loop is not None)) | {
        "model.c": model_source(functions),
        "scene.h": scene_header(model, entries, functions, loop),
        "scene.c": scene_source(scene, entries, "", changing) + tables,
    }
    if loop is not None:
        sources["lane_kernels.h"] = loop_steps(scene)
    names = source_file_names(sources, fmi)
    without_token = model_description(scene, entries, "", fmi, names)
    token = digest(*source_files(sources, fmi, scene.name).values(), without_token)
    sources["scene.c"] = sources["scene.c"].replace(TOKEN_IN_C.format(""), TOKEN_IN_C.format(token))
    attribute = VERSIONS[fmi].token
    return sources, without_token.replace(f'{attribute}=""'.encode(), f'{attribute}="{token}"'.encode(), 1)
