"""A CasADi function as an FMU for co-simulation: outputs that follow from inputs at once, without memory.

The C around the generated function is in function_fmu/; what no such FMU supports is taken from fmu_build/c/.
"""

import io
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree as ET

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from fmu_build.compile.compiler import compile_library
from fmu_build.generate.sources import LAYER, digest
from fmu_build.platforms import host_platform
from supervessel.problems import unknown
from supervessel.shell.files import write_file

OWN = Path(__file__).parent / "function_fmu"
Interface = tuple[dict[str, float], list[str]]  # start values of scalar inputs by name, names of outputs


def interface(function: ca.Function, starts: Mapping[str, ArrayLike]) -> Interface:
    """Returns the interface of a function; starts by names of its inputs, 0 for those that are not given."""
    sizes = {name: function.numel_in(name) for name in function.name_in()}
    for name in starts:
        if name not in sizes:
            raise ValueError(f"starts: {unknown('input', name, sizes)}")
    if function.nnz_in() + function.nnz_out() < function.numel_in() + function.numel_out():
        raise ValueError(f"{function.name()}: has sparse arguments or results; wrap it with ca.densify")
    start = [np.broadcast_to(np.ravel(starts.get(name, 0.0)), n) for name, n in sizes.items()]
    inputs = dict(zip(scalars(sizes), np.concatenate(start).tolist(), strict=True))
    return inputs, scalars({name: function.numel_out(name) for name in function.name_out()})


def scalars(sizes: Mapping[str, int]) -> list[str]:
    """Returns a name for each element of vectors by name."""
    return [name if n == 1 else f"{name}[{i + 1}]" for name, n in sizes.items() for i in range(n)]


def header(function: ca.Function, known: Interface, token: str) -> str:
    """Returns function.h: what the C around the function must know of it."""
    inputs, outputs = known
    sizes = [function.numel_in(i) for i in range(function.n_in())]
    sizes += [function.numel_out(i) for i in range(function.n_out())]
    places = 1 + np.cumsum([0, *sizes[:-1]])  # time stands before them
    quoted = [f'"{name}"' for name in ("time", *inputs, *outputs)]
    names, start, where = (", ".join(map(str, items)) for items in (quoted, inputs.values(), places))
    return f"""/* Generated: the function, its sizes, its variables by value reference. */
#define FUNCTION {function.name()}
#define TOKEN "{token}"
#define NAMES {{{names}}}
#define START {{{start}}}
#define PLACES {{{where}}} /* of the first element of each argument and result */
enum {{ INPUT_COUNT = {len(inputs)}, OUTPUT_COUNT = {len(outputs)} }};
enum {{ ARGUMENT_COUNT = {function.n_in()}, RESULT_COUNT = {function.n_out()} }};
enum {{ WORK_ARG = {function.sz_arg()}, WORK_RES = {function.sz_res()} }};
enum {{ WORK_INT = {function.sz_iw() + 1}, WORK_REAL = {function.sz_w() + 1} }};
"""


def description(name: str, known: Interface, token: str, fmi: int) -> bytes:
    """Returns modelDescription.xml. What an output depends on is not said: on every input."""
    inputs, outputs = known
    key = "instantiationToken" if fmi == 3 else "guid"
    root = ET.Element("fmiModelDescription", {"fmiVersion": f"{fmi}.0", "modelName": name, key: token})
    root.set("variableNamingConvention", "structured")
    ET.SubElement(root, "CoSimulation", modelIdentifier=name, canHandleVariableCommunicationStepSize="true")
    categories = ET.SubElement(root, "LogCategories")
    for category in ("logStatusDiscard", "logStatusError"):
        ET.SubElement(categories, "Category", name=category)
    variables = ET.SubElement(root, "ModelVariables")
    roles: list[dict[str, str]] = [{"causality": "independent"}]
    roles += [{"causality": "input", "start": repr(value)} for value in inputs.values()]
    roles += [{"causality": "output", "initial": "calculated"}] * len(outputs)
    for reference, variable in enumerate(("time", *inputs, *outputs)):
        attributes = {"name": variable, "valueReference": str(reference), "variability": "continuous"}
        attributes |= roles[reference]
        if fmi == 3:
            ET.SubElement(variables, "Float64", attributes)
        else:
            start = {"start": attributes.pop("start")} if "start" in attributes else {}
            ET.SubElement(ET.SubElement(variables, "ScalarVariable", attributes), "Real", start)
    structure = ET.SubElement(root, "ModelStructure")
    for kind in ("Output", "InitialUnknown"):
        group = structure if fmi == 3 else ET.SubElement(structure, f"{kind}s")
        for reference in range(1 + len(inputs), len(roles)):
            place = {"valueReference": str(reference)} if fmi == 3 else {"index": str(reference + 1)}
            ET.SubElement(group, kind if fmi == 3 else "Unknown", place)
    text: bytes = ET.tostring(root, encoding="UTF-8", xml_declaration=True)
    return text


def build_function_fmu(
    function: ca.Function, output: Path, fmi: int = 3, starts: Mapping[str, ArrayLike] | None = None
) -> Path:
    """Builds the FMU of a function for this machine and returns its path; the model has the function's name.

    fmi    : version of the FMI standard, 2 or 3
    starts : start values by names of inputs, 0 for those that are not given
    Raises BuildError if the compiler fails, ValueError for what cannot be an FMU so.
    """
    if fmi not in (2, 3):
        raise ValueError(f"fmi = {fmi}: must be 2 or 3")
    platform, name, known = host_platform(), function.name(), interface(function, starts or {})
    own = [OWN / "instance.h", OWN / "instance.c", OWN / f"fmi{fmi}.c", LAYER / f"fmi{fmi}_unsupported.c"]
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        generator = ca.CodeGenerator("function.c", {"with_export": False, "casadi_int": "int"})
        generator.add(function)
        generator.generate(f"{folder}/")
        for file in own:
            (folder / file.name).write_text(file.read_text())
        token = digest(str(known), *(file.read_bytes() for file in sorted(folder.iterdir())))
        (folder / "function.h").write_text(header(function, known, token))
        library = folder / f"{name}{platform.suffix}"
        compile_library([Path(file.name) for file in folder.glob("*.c")], platform, library, folder=folder)
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("modelDescription.xml", description(name, known, token, fmi))
            archive.write(library, f"binaries/{platform.folder(fmi)}/{library.name}")
    write_file(output, packed.getvalue())
    return output
