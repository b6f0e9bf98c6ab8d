"""CasADi functions as C: generated, compiled and loaded back; and the FMU's own C as a CasADi function."""

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import casadi as ca

from fmu_build.compile.compiler import FLAGS, compile_library, digest_of, lay_out
from fmu_build.errors import BuildError
from fmu_build.generate.equations_source import generated_c
from fmu_build.generate.model import generate as scene_sources
from fmu_build.generate.sources import source_files
from fmu_build.platforms import host_platform
from supervessel.scene.schema import Scene
from supervessel.shell.files import OutputError, check_output, write_file

DERIVATIVES = (0, 1, 2)

GENERATED = b"CASADI_CODEGEN_PREFIX"
"""A word that stands in all C that CasADi generates."""

COMMUNICATION_STEP = "communication_step"
"""The CasADi function in the C file of that name, here, which joins an FMU's C."""


def generate(
    functions: Sequence[ca.Function], folder: Path, name: str, derivatives: int
) -> list[ca.Function]:
    """Returns functions compiled to machine code, `ca.external` each; NAME.c and the library are in folder.

    derivatives : of what order their derivatives are compiled too
    What calls another library, such as `communication_step`, cannot be compiled: BuildError names that call.
    The library's name holds a digest of the source: what is there already is not compiled again, and what a
    running program has loaded is never overwritten.
    Raises BuildError if the compiler fails, NAME.c cannot be written, or is there and not CasADi's.
    """
    if derivatives not in DERIVATIVES:
        raise ValueError(f"generate: derivatives = {derivatives!r}: must be 0, 1 or 2")
    source = _source(functions, f"{name}.c", derivatives)
    _write_source(source, folder / f"{name}.c")
    # CasADi hands 0 on for a pointer to nothing where an argument is empty.
    flags = ("-fvisibility=default", "-Wno-int-conversion")
    library = _compiled({f"{name}.c": source.encode()}, f"{name}.c", folder, name, flags)
    return [ca.external(function.name(), library) for function in functions]


def _write_source(source: str, file: Path) -> None:
    """Writes generated C. Raises BuildError if it cannot be written or would replace what is none."""
    file.parent.mkdir(parents=True, exist_ok=True)
    try:
        if check_output(file) and GENERATED not in file.read_bytes():
            raise OutputError(file, "is there already and is not CasADi's; remove it or take another folder")
        write_file(file, source.encode())
    except OutputError as error:
        raise BuildError(str(error)) from None


def communication_step(scene: Scene, folder: Path) -> ca.Function:
    """Returns x, u, p, h -> x_next by the C of the scene's FMU, `ca.external`; p are all of its inputs.

    The library is in folder. Raises BuildError if the compiler fails.
    """
    packed = source_files(scene_sources(scene, 3)[0], 3, scene.name)
    # The FMI functions are one version's entry points to what the step is made of here.
    files = {path: text for path, text in packed.items() if not path.startswith("sources/fmi")}
    wrapper = Path(__file__).parent / f"{COMMUNICATION_STEP}.c"
    files[f"sources/{wrapper.name}"] = wrapper.read_bytes()
    parts = [path for path in files if path.endswith(".c") and not path.endswith(wrapper.name)]
    whole = "".join(f'#include "{path}"\n' for path in (*parts, f"sources/{wrapper.name}"))
    files["whole.c"] = whole.encode()
    library = _compiled(files, "whole.c", folder, f"{scene.name}_{COMMUNICATION_STEP}")
    return ca.external(COMMUNICATION_STEP, library)


def _compiled(
    files: Mapping[str, bytes], main: str, folder: Path, name: str, flags: Sequence[str] = ()
) -> str:
    """Returns the path of the library, NAME_digest in folder, that a C file among others makes.

    files : by relative path; `main` is the one that is compiled
    flags : beside those of FMUs
    """
    folder.mkdir(parents=True, exist_ok=True)
    platform = host_platform()
    library = folder / f"{name}_{digest_of(files)[:16]}{platform.suffix}"
    if platform.suffix == ".so":  # elsewhere the linker asks by itself that every function is there
        flags = (*flags, "-Wl,-z,defs")
    if not library.exists():
        with tempfile.TemporaryDirectory(dir=folder) as made:
            lay_out(files, Path(made))
            part = Path(made, library.name)
            compile_library([Path(made, main)], platform, part, (*FLAGS, *flags))
            part.replace(library)
    return str(library.resolve())


def _source(functions: Sequence[ca.Function], file: str, derivatives: int) -> str:
    """Returns the C of functions and of what CasADi looks for when it differentiates an external one."""
    generator = ca.CodeGenerator(file, {"verbose": False})
    for function in functions:
        generator.add(function, derivatives > 0)  # with the sparsity of its Jacobian
        if derivatives > 0:
            generator.add(function.forward(1))
            generator.add(function.reverse(1))
        if derivatives > 1:
            generator.add(function.forward(1).forward(1))
            generator.add(function.reverse(1).forward(1))
    return generated_c(generator, file)
