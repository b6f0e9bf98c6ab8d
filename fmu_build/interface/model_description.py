"""modelDescription.xml for FMI 2.0 and FMI 3.0, written from the variable table."""

from collections.abc import Callable, Sequence
from importlib.metadata import version
from xml.etree import ElementTree as ET

from fmu_build.interface.names import Naming
from fmu_build.interface.units import UNITS, add_types, add_units
from fmu_build.interface.variable_table import Dependency, Role, TableEntry
from fmu_build.interface.xml_text import xml_text
from fmu_build.versions import VERSIONS, Version
from supervessel.scene.schema import SAID, Scene

TOOL = "supervessel"
"""What generationTool begins with; the version follows."""

LOG_ACCURACY = "logAccuracy"

LOG_CATEGORIES = {
    "logStatusDiscard": "a value or a step was refused; the instance is as it was before the call",
    "logStatusError": "a rule of the standard was broken, and the instance is terminated; or a value was "
    "refused where FMI 2.0 has no Discard",
    "logComposite": "the composite was computed because one of its inputs changed",
    "logTolerance": "the importer's tolerance is none that steps can keep to, and the nearest is taken",
    LOG_ACCURACY: "the bound of the error has passed what the scene asks for; told once",
    "logAll": "all of these",
}
"""Names of the categories of log messages, and what each tells."""

ROLES: dict[Role, dict[str, str]] = {
    "time": {"causality": "independent", "variability": "continuous"},
    "input": {"causality": "input", "variability": "continuous"},
    "parameter": {"causality": "parameter", "variability": "fixed", "initial": "exact"},
    "output": {"causality": "output", "variability": "continuous", "initial": "calculated"},
    "state": {"causality": "local", "variability": "continuous", "initial": "approx"},
    "derivative": {"causality": "local", "variability": "continuous", "initial": "calculated"},
}

COMMON_CAPABILITIES_2 = {
    "canNotUseMemoryManagementFunctions": "true",
    "canGetAndSetFMUstate": "true",
    "canSerializeFMUstate": "true",
    "providesDirectionalDerivative": "true",
}

COMMON_CAPABILITIES_3 = {
    "canGetAndSetFMUState": "true",
    "canSerializeFMUState": "true",
    "providesDirectionalDerivatives": "true",
    "providesAdjointDerivatives": "true",
}


STRUCTURE_2: dict[str, tuple[Role, ...]] = {
    "Outputs": ("output",),
    "Derivatives": ("derivative",),
    "InitialUnknowns": ("output", "state", "derivative"),
}
"""The lists of FMI 2.0's ModelStructure, and the roles of the variables in each."""


def model_description(
    scene: Scene, entries: Sequence[TableEntry], token: str, fmi: int, sources: Sequence[str] = ()
) -> bytes:
    """Returns the text of modelDescription.xml.

    entries : the variable table
    token   : instantiation token, the same that is compiled into the library
    fmi     : number of the version, of VERSIONS
    sources : names of the C files in sources/, which FMI 2.0 lists here
    """
    version_of_fmi = VERSIONS[fmi]
    root = _header(scene, version_of_fmi, token, entries[0].naming)
    WRITERS[fmi](root, scene, entries, sources if version_of_fmi.lists_sources else ())
    return xml_text(root)


def _header(scene: Scene, fmi: Version, token: str, naming: Naming) -> ET.Element:
    """Returns the root element."""
    attributes = {
        "fmiVersion": fmi.name,
        "modelName": scene.name,
        fmi.token: token,
        "description": scene.description or _description(scene),
        **{key: said for key in SAID if key != "description" and (said := getattr(scene, key)) is not None},
        "generationTool": f"{TOOL} {version('supervessel')}",
        "variableNamingConvention": naming,
    }
    return ET.Element("fmiModelDescription", attributes)


def _description(scene: Scene) -> str:
    """Returns a line that says which vessels turn, and by which law."""
    others = [name for name in scene.vessels if name != scene.root]
    how = "docked (docks open and close)" if scene.inputs.docked else "docked"
    docked = (
        f" with {', '.join(others[:8])}{' and others' if len(others) > 8 else ''} {how}" if others else ""
    )
    return f"Rotation of {scene.root}{docked}, law {scene.rotation.law}"


def _fmi3(root: ET.Element, scene: Scene, entries: Sequence[TableEntry], _: Sequence[str]) -> None:
    """Writes the model description of FMI 3.0."""
    _interfaces3(root, scene)
    _definitions(root, scene, entries, "Float64Type")
    _variables3(root, entries)
    _structure3(root, entries)


def _interfaces3(root: ET.Element, scene: Scene) -> None:
    """Writes the interfaces with their capabilities; a scene whose docks open has event mode."""
    identifier = {"modelIdentifier": scene.name}
    ET.SubElement(root, "ModelExchange", identifier | COMMON_CAPABILITIES_3)
    stepping = {
        "canHandleVariableCommunicationStepSize": "true",
        "maxOutputDerivativeOrder": "1",
        "providesIntermediateUpdate": "true",
        "canReturnEarlyAfterIntermediateUpdate": "true",
    }
    if scene.inputs.docked:
        stepping["hasEventMode"] = "true"
    ET.SubElement(root, "CoSimulation", identifier | COMMON_CAPABILITIES_3 | stepping)


def _variables3(root: ET.Element, entries: Sequence[TableEntry]) -> None:
    """Writes the variables; a derivative names its state by value reference."""
    variables = ET.SubElement(root, "ModelVariables")
    for entry in entries:
        attributes = _identity(entry) | role_attributes(entry)
        if entry.role == "output":
            attributes["intermediateUpdate"] = "true"
        if entry.role == "derivative":
            attributes["derivative"] = str(_state_of(entry, entries).reference)
        kind = "Boolean" if entry.variable.boolean else "Float64"
        ET.SubElement(variables, kind, attributes | _type_attributes(entry))


def _structure3(root: ET.Element, entries: Sequence[TableEntry]) -> None:
    """Writes what outputs and derivatives depend on, by value reference."""
    structure = ET.SubElement(root, "ModelStructure")
    for entry in _of(entries, "output"):
        _unknown3(structure, "Output", entry, entry.dependencies)
    for entry in _of(entries, "derivative"):
        _unknown3(structure, "ContinuousStateDerivative", entry, entry.dependencies)
    for entry in _of(entries, "output", "state", "derivative"):
        _unknown3(structure, "InitialUnknown", entry, entry.initial)


def _unknown3(
    structure: ET.Element, name: str, entry: TableEntry, dependencies: Sequence[Dependency]
) -> None:
    attributes = {"valueReference": str(entry.reference)} | _dependencies(dependencies)
    ET.SubElement(structure, name, attributes)


def _fmi2(root: ET.Element, scene: Scene, entries: Sequence[TableEntry], sources: Sequence[str]) -> None:
    """Writes the model description of FMI 2.0, which counts variables from 1."""
    root.set("numberOfEventIndicators", "0")
    _interfaces2(root, scene, sources)
    _definitions(root, scene, entries, "SimpleType")
    _variables2(root, entries)
    _structure2(root, entries)


def _interfaces2(root: ET.Element, scene: Scene, sources: Sequence[str]) -> None:
    """Writes the interfaces with their capabilities and the names of the C files."""
    exchange = {"completedIntegratorStepNotNeeded": "true"}
    stepping = {"canHandleVariableCommunicationStepSize": "true", "maxOutputDerivativeOrder": "1"}
    for name, capabilities in (("ModelExchange", exchange), ("CoSimulation", stepping)):
        attributes = {"modelIdentifier": scene.name} | capabilities | COMMON_CAPABILITIES_2
        interface = ET.SubElement(root, name, attributes)
        if sources:
            files = ET.SubElement(interface, "SourceFiles")
            for source in sources:
                ET.SubElement(files, "File", name=source)


def _variables2(root: ET.Element, entries: Sequence[TableEntry]) -> None:
    """Writes the variables; a derivative names its state by index."""
    variables = ET.SubElement(root, "ModelVariables")
    for entry in entries:
        element = ET.SubElement(variables, "ScalarVariable", _identity(entry) | role_attributes(entry))
        attributes = _type_attributes(entry)
        if entry.role == "derivative":
            attributes["derivative"] = str(_state_of(entry, entries).reference + 1)
        ET.SubElement(element, "Boolean" if entry.variable.boolean else "Real", attributes)


def _structure2(root: ET.Element, entries: Sequence[TableEntry]) -> None:
    """Writes what outputs and derivatives depend on, by index."""
    structure = ET.SubElement(root, "ModelStructure")
    for name, roles in STRUCTURE_2.items():
        element = ET.SubElement(structure, name)
        for entry in _of(entries, *roles):
            dependencies = entry.initial if name == "InitialUnknowns" else entry.dependencies
            attributes = {"index": str(entry.reference + 1)} | _dependencies(dependencies, 1)
            ET.SubElement(element, "Unknown", attributes)


def _definitions(root: ET.Element, scene: Scene, entries: Sequence[TableEntry], type_tag: str) -> None:
    """Writes what stands between the interfaces and the variables in both versions of FMI."""
    add_units(root, entries)
    add_types(root, entries, type_tag)
    _log_categories(root, scene)
    _experiment(root, scene)


def _of(entries: Sequence[TableEntry], *roles: Role) -> list[TableEntry]:
    return [entry for entry in entries if entry.role in roles]


def _state_of(derivative: TableEntry, entries: Sequence[TableEntry]) -> TableEntry:
    """Returns the state that a derivative is the rate of."""
    return next(entry for entry in entries if f"der({entry.variable.name})" == derivative.variable.name)


def _dependencies(dependencies: Sequence[Dependency], offset: int = 0) -> dict[str, str]:
    """Returns what an unknown depends on, and how.

    offset : of the numbers that name variables from their value references
    """
    return {
        "dependencies": " ".join([str(d.reference + offset) for d in dependencies]),
        "dependenciesKind": " ".join([d.kind for d in dependencies]),
    }


def tells_accuracy(scene: Scene) -> bool:
    """Whether the FMU logs that the bound of its error has passed what the scene asks for."""
    return scene.accuracy is not None and "error_bound" in scene.outputs.names


def _log_categories(root: ET.Element, scene: Scene) -> None:
    categories = ET.SubElement(root, "LogCategories")
    for name, description in LOG_CATEGORIES.items():
        if name != LOG_ACCURACY or tells_accuracy(scene):
            ET.SubElement(categories, "Category", name=name, description=description)


def _experiment(root: ET.Element, scene: Scene) -> None:
    if scene.experiment is not None:
        ET.SubElement(
            root,
            "DefaultExperiment",
            startTime="0.0",
            stopTime=repr(scene.experiment.duration),
            tolerance=repr(scene.rotation.tolerance),
            stepSize=repr(scene.experiment.step),
        )


def _identity(entry: TableEntry) -> dict[str, str]:
    return {
        "name": entry.name,
        "valueReference": str(entry.reference),
        "description": entry.variable.description,
    }


def role_attributes(entry: TableEntry) -> dict[str, str]:
    """Returns causality, variability and initial of a variable."""
    return ROLES[entry.role] | ({"variability": "discrete"} if entry.variable.discrete else {})


def _type_attributes(entry: TableEntry) -> dict[str, str]:
    """Returns type, range and start of a variable, as both versions of FMI write them.

    Its unit and the unit for showing it are those of its type.
    """
    variable = entry.variable
    if variable.boolean:
        return {"start": "true" if variable.start else "false"}
    attributes = {"declaredType": UNITS[variable.unit].type_name}
    numbers = {"min": variable.low, "max": variable.high, "start": variable.start}
    if entry.nominal != 1.0:
        numbers["nominal"] = entry.nominal
    if variable.jumps:
        attributes["reinit"] = "true"
    return attributes | {name: repr(number) for name, number in numbers.items() if number is not None}


WRITERS: dict[int, Callable[[ET.Element, Scene, Sequence[TableEntry], Sequence[str]], None]] = {
    2: _fmi2,
    3: _fmi3,
}
"""By number of the version: writes what stands in the root element. The last argument: C files to list."""
