"""Scenes, and the modelDescription.xml of their FMUs, laid out alike for both versions."""

import zipfile
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from lxml import etree

from support import ISS_DG, STATES, body, built, variant

RATES = [f"der({state})" for state in STATES]
SIZES = {"mass": 0, "kinetic_energy": 0, "attitude": 4}  # elements of an output; 3 if not listed
NINE = [f"inertia[{i},{j}]" for i in (1, 2, 3) for j in (1, 2, 3)]

# Three vessels in a row, ports at odd angles: the root's tensor is full and its mass an input, the middle one
# has all its figures as inputs, both docks can be moved, one of them by the root's own port.
CHAIN: dict[str, Any] = {
    "name": "chain",
    "root": "A",
    "vessels": {
        "A": {
            "mass": 900.0,
            "inertia": [[800.0, 50.0, -30.0], [50.0, 900.0, 40.0], [-30.0, 40.0, 700.0]],
            "centre_of_mass": [0.1, -0.2, 0.3],
            "ports": {"fore": {"position": [1.0, 2.0, 3.0], "direction": [3, 0, 4], "alignment": [-4, 5, 3]}},
        },
        "B": {
            "mass": 500.0,
            "pmi": [1.0, 1.3, 1.6],
            "ports": {
                "aft": {"position": [-2.0, 0.3, 0.1], "direction": [-1, 1, 0], "alignment": [1, 1, 1]},
                "fore": {"position": [2.0, 0.1, 0.2], "direction": [1, 2, 0], "alignment": [-2, 1, 1]},
            },
        },
        "C": {
            "mass": 70.0,
            "pmi": [0.4, 0.5, 0.6],
            "ports": {"aft": {"position": [-1.0, 0.2, 0.4], "direction": [-2, 1, 0], "alignment": [0, 0, 3]}},
        },
    },
    "docks": [{"ports": ["B.aft", "A.fore"]}, {"ports": ["B.fore", "C.aft"]}],
    "inputs": {
        "mass": ["B", "A"],
        "pmi": ["B"],
        "pose": ["C.aft", "A.fore"],
        "range": {"B.mass": [0.0, 500.0], "B.pmi": [0.5, 2.0], "C.aft.position[2]": [-0.5, 0.5]},
    },
    "rotation": {
        "law": "principal",
        "angular_velocity": [0.01, -0.02, 0.03],
        "attitude": [2.0, 0.0, 0.0, -2.0],
    },
    "experiment": {"duration": 60.0, "step": 0.25},
    "outputs": {"names": ["attitude", "inertia", "mass", "pmi", "angular_momentum", "kinetic_energy"]},
}
SINGLE = variant(
    body(1000.0, (1.0, 2.0, 2.5), law="none"), {"inputs": {"mass": ["B"], "pmi": ["B"], "torque": True}}
)

# A port adapter without mass: its moments are an input that nothing follows from.
ADAPTER = variant(
    ISS_DG,
    {"name": "adapter", "vessels.DG.mass": 0.0, "inputs": {"pmi": ["DG"], "pose": ["DG.nose", "ISS.P2"]}},
)
SCENES = {
    "everything": ISS_DG,
    "chain": CHAIN,
    "single": SINGLE,
    "adapter": ADAPTER,
    "no inputs": variant(body(law="decoupled"), {"name": "plain", "inputs": None, "outputs": None}),
}
SCENE = pytest.mark.parametrize("raw", SCENES.values(), ids=SCENES.keys())


@cache
def _xml(path: Path) -> etree._Element:
    with zipfile.ZipFile(path) as archive:
        return etree.fromstring(archive.read("modelDescription.xml"))


def xml(raw: Mapping[str, Any], fmi: int) -> etree._Element:
    """Returns the root element of a scene's model description."""
    return _xml(built(raw, fmi))


def variables(raw: Mapping[str, Any], fmi: int) -> dict[str, dict[str, str]]:
    """Returns the attributes of each variable by name, laid out alike for both versions, in order."""
    elements = xml(raw, fmi).find("ModelVariables")
    if fmi == 3:
        return {e.get("name"): dict(e.attrib) for e in elements}
    return {e.get("name"): {**e.attrib, **e[0].attrib} for e in elements}


def groups(raw: Mapping[str, Any]) -> Iterator[tuple[str, int]]:
    """Yields the scene's inputs as name without index and number of elements, 0 for a scalar."""
    inputs = raw.get("inputs", {})
    yield from ((f"{vessel}.mass", 0) for vessel in inputs.get("mass", []))
    yield from ((f"{vessel}.pmi", 3) for vessel in inputs.get("pmi", []))
    for port in inputs.get("pose", []):
        yield from ((f"{port}.{part}", 3) for part in ("position", "direction", "alignment"))
    if inputs.get("torque"):
        yield "torque", 3


def scalars(name: str, size: int) -> list[str]:
    return [f"{name}[{i}]" for i in range(1, size + 1)] if size else [name]


def input_names(raw: Mapping[str, Any]) -> list[str]:
    return [scalar for name, size in groups(raw) for scalar in scalars(name, size)]


def output_names(raw: Mapping[str, Any]) -> list[str]:
    default = ["mass", "barycentre", "pmi", "angular_velocity", "attitude"]
    names = raw.get("outputs", {}).get("names", default)
    return [s for name in names for s in (NINE if name == "inertia" else scalars(name, SIZES.get(name, 3)))]


def start_of(raw: Mapping[str, Any], name: str) -> float:
    """Returns what the raw scene says of an input."""
    group, _, index = name.rstrip("]").partition("[")
    if group == "torque":
        return 0.0
    vessel, *port, key = group.split(".")
    table = raw["vessels"][vessel]
    value = (table["ports"][port[0]] if port else table)[key]
    return float(value[int(index) - 1] if index else value)


def types(raw: Mapping[str, Any], fmi: int) -> dict[str, dict[str, str]]:
    """Returns the attributes of each declared type by name, laid out alike for both versions."""
    elements = xml(raw, fmi).find("TypeDefinitions")
    return {e.get("name"): dict((e[0] if fmi == 2 else e).attrib) for e in elements}


def measured_in(raw: Mapping[str, Any], fmi: int, attribute: str = "unit") -> dict[str, str | None]:
    """Returns the unit, or the displayUnit, of each variable by name: its own, else that of its type."""
    declared = types(raw, fmi)
    return {
        name: v.get(attribute, declared.get(v.get("declaredType"), {}).get(attribute))
        for name, v in variables(raw, fmi).items()
    }
