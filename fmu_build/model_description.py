"""modelDescription.xml for FMI 2.0 and FMI 3.0, written from the variable table."""

from collections.abc import Sequence
from importlib.metadata import version
from xml.etree import ElementTree as ET

from fmu_build.table import Entry
from supervessel.scene import Scene

BASE_UNITS: dict[str, dict[str, int]] = {
    "s": {"s": 1},
    "kg": {"kg": 1},
    "m": {"m": 1},
    "m2": {"m": 2},
    "rad/s": {"rad": 1, "s": -1},
    "N.m": {"kg": 1, "m": 2, "s": -2},
    "kg.m2": {"kg": 1, "m": 2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "N.m.s": {"kg": 1, "m": 2, "s": -1},
}
"""Exponents of the SI base units, in the order in which FMI lists them."""

LOG_CATEGORIES = {
    "logStatusDiscard": "a value or a step was refused; the instance is as it was before the call",
    "logStatusError": "a rule of the standard was broken; the instance is terminated",
    "logComposite": "the composite was computed because one of its inputs changed",
    "logAll": "all of these",
}


def model_description(scene: Scene, entries: Sequence[Entry], token: str, fmi: int) -> bytes:
    """Returns the text of modelDescription.xml.

    entries : the variable table
    token   : instantiation token, the same that is compiled into the library
    fmi     : 2 or 3
    """
    root = _fmi3(scene, entries, token) if fmi == 3 else _fmi2(scene, entries, token)
    ET.indent(root, "  ")
    text: bytes = ET.tostring(root, encoding="UTF-8", xml_declaration=True)
    return text + b"\n"


def _header(scene: Scene, fmi_version: str, token_attribute: str, token: str) -> ET.Element:
    """Returns the root element."""
    attributes = {
        "fmiVersion": fmi_version,
        "modelName": scene.name,
        token_attribute: token,
        "description": _description(scene),
        "generationTool": f"supervessel {version('supervessel')}",
        "variableNamingConvention": "structured",
    }
    return ET.Element("fmiModelDescription", attributes)


def _description(scene: Scene) -> str:
    others = [name for name in scene.vessels if name != scene.root]
    docked = (
        f" with {', '.join(others[:8])}{' and others' if len(others) > 8 else ''} docked" if others else ""
    )
    return f"Rotation of {scene.root}{docked}, law {scene.rotation.law}"


def _fmi3(scene: Scene, entries: Sequence[Entry], token: str) -> ET.Element:
    root = _header(scene, "3.0", "instantiationToken", token)
    ET.SubElement(
        root, "CoSimulation", modelIdentifier=scene.name, canHandleVariableCommunicationStepSize="true"
    )
    _units(root, entries)
    _log_categories(root)
    _experiment(root, scene)
    variables = ET.SubElement(root, "ModelVariables")
    for entry in entries:
        _variable(variables, entry, "Float64")
    structure = ET.SubElement(root, "ModelStructure")
    outputs = [entry for entry in entries if entry.causality == "output"]
    for entry in outputs:
        attributes = {"valueReference": str(entry.reference), "dependencies": _joined(entry.dependencies)}
        ET.SubElement(structure, "Output", attributes)
    for entry in outputs:
        attributes = {
            "valueReference": str(entry.reference),
            "dependencies": _joined(entry.initial_dependencies),
        }
        ET.SubElement(structure, "InitialUnknown", attributes)
    return root


def _fmi2(scene: Scene, entries: Sequence[Entry], token: str) -> ET.Element:
    root = _header(scene, "2.0", "guid", token)
    ET.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=scene.name,
        canHandleVariableCommunicationStepSize="true",
        canNotUseMemoryManagementFunctions="true",
    )
    _units(root, entries)
    _log_categories(root)
    _experiment(root, scene)
    variables = ET.SubElement(root, "ModelVariables")
    for entry in entries:
        _scalar_variable(variables, entry)
    structure = ET.SubElement(root, "ModelStructure")
    outputs = [entry for entry in entries if entry.causality == "output"]
    now, start = ET.SubElement(structure, "Outputs"), ET.SubElement(structure, "InitialUnknowns")
    for entry in outputs:  # FMI 2.0 counts variables from 1
        attributes = {"index": str(entry.reference + 1)}
        ET.SubElement(now, "Unknown", attributes | {"dependencies": _joined(entry.dependencies, 1)})
        ET.SubElement(start, "Unknown", attributes | {"dependencies": _joined(entry.initial_dependencies, 1)})
    return root


def _joined(references: Sequence[int], offset: int = 0) -> str:
    return " ".join(str(reference + offset) for reference in references)


def _units(root: ET.Element, entries: Sequence[Entry]) -> None:
    used = {entry.variable.unit for entry in entries}
    definitions = ET.SubElement(root, "UnitDefinitions")
    for unit, exponents in BASE_UNITS.items():
        if unit in used:
            element = ET.SubElement(definitions, "Unit", name=unit)
            ET.SubElement(element, "BaseUnit", {base: str(power) for base, power in exponents.items()})


def _log_categories(root: ET.Element) -> None:
    categories = ET.SubElement(root, "LogCategories")
    for name, description in LOG_CATEGORIES.items():
        ET.SubElement(categories, "Category", name=name, description=description)


def _experiment(root: ET.Element, scene: Scene) -> None:
    if scene.experiment is not None:
        ET.SubElement(
            root,
            "DefaultExperiment",
            startTime="0.0",
            stopTime=repr(scene.experiment.duration),
            stepSize=repr(scene.experiment.step),
        )


def _type_attributes(entry: Entry) -> dict[str, str]:
    """Returns unit, range and start of a variable, as both versions of FMI write them."""
    variable = entry.variable
    attributes = {"unit": variable.unit} if variable.unit else {}
    if variable.low is not None and variable.high is not None:
        attributes |= {"min": repr(variable.low), "max": repr(variable.high)}
    if variable.start is not None:
        attributes["start"] = repr(variable.start)
    return attributes


def _roles(entry: Entry) -> dict[str, str]:
    """Returns causality, variability and initial of a variable."""
    roles = {"causality": entry.causality, "variability": "continuous"}
    if entry.causality == "parameter":
        roles |= {"variability": "fixed", "initial": "exact"}
    if entry.causality == "output":
        roles["initial"] = "calculated"
    return roles


def _variable(parent: ET.Element, entry: Entry, kind: str) -> None:
    attributes = {
        "name": entry.variable.name,
        "valueReference": str(entry.reference),
        "description": entry.variable.description,
    }
    ET.SubElement(parent, kind, attributes | _roles(entry) | _type_attributes(entry))


def _scalar_variable(parent: ET.Element, entry: Entry) -> None:
    attributes = {
        "name": entry.variable.name,
        "valueReference": str(entry.reference),
        "description": entry.variable.description,
    }
    element = ET.SubElement(parent, "ScalarVariable", attributes | _roles(entry))
    ET.SubElement(element, "Real", _type_attributes(entry))
