"""CasADi functions as C: generated, compiled and loaded back."""

import hashlib
import tempfile
from collections.abc import Sequence
from pathlib import Path

import casadi as ca

DERIVATIVES = (0, 1, 2)


def generate(
    functions: Sequence[ca.Function], folder: Path, name: str, derivatives: int
) -> list[ca.Function]:
    """Returns functions compiled to machine code, `ca.external` each; NAME.c and the library are in folder.

    derivatives : of what order their derivatives are compiled too
    The library's name holds a digest of the source: what is there already is not compiled again, and what a
    running program has loaded is never overwritten.
    Raises BuildError if the compiler fails.
    """
    # The compiler is the FMU's, of a package that is built on this one: looked up only here.
    from fmu_build.compiler import FLAGS, compile_library  # noqa: PLC0415
    from fmu_build.platforms import host_platform  # noqa: PLC0415

    if derivatives not in DERIVATIVES:
        raise ValueError(f"generate: derivatives = {derivatives!r}: must be 0, 1 or 2")
    folder.mkdir(parents=True, exist_ok=True)
    platform = host_platform()
    source = _source(functions, f"{name}.c", derivatives)
    (folder / f"{name}.c").write_text(source)
    library = folder / f"{name}_{hashlib.sha256(source.encode()).hexdigest()[:16]}{platform.suffix}"
    if not library.exists():
        with tempfile.TemporaryDirectory(dir=folder) as made:
            part = Path(made, library.name)
            # CasADi hands 0 on for a pointer to nothing where an argument is empty.
            flags = (*FLAGS, "-fvisibility=default", "-Wno-int-conversion")
            compile_library([folder / f"{name}.c"], platform, part, flags)
            part.replace(library)
    return [ca.external(function.name(), str(library.resolve())) for function in functions]


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
    with tempfile.TemporaryDirectory() as folder:
        generator.generate(f"{folder}/")
        return (Path(folder) / file).read_text()
