"""Units of variables, and the types that are declared for them in modelDescription.xml."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees
from xml.etree import ElementTree as ET

from fmu_build.interface.variable_table import TableEntry


@dataclass(frozen=True)
class Unit:
    """A unit and the declared type of what is measured in it.

    exponents : by SI base unit, its exponent, in FMI's order
    type_name : name of the declared type
    quantity  : name of the physical quantity
    display   : a unit for showing values, and the factor from this unit to that one
    """

    exponents: dict[str, int]
    type_name: str
    quantity: str
    display: tuple[str, float] | None = None


UNITS = {
    "": Unit({}, "Ratio", "Ratio"),
    "s": Unit({"s": 1}, "Time", "Time"),
    "1/s": Unit({"s": -1}, "QuaternionRate", "Frequency"),
    "kg": Unit({"kg": 1}, "Mass", "Mass"),
    "kg/s": Unit({"kg": 1, "s": -1}, "MassFlow", "MassFlowRate"),
    "m": Unit({"m": 1}, "Length", "Length"),
    "m/s": Unit({"m": 1, "s": -1}, "Velocity", "Velocity"),
    "m/s2": Unit({"m": 1, "s": -2}, "Acceleration", "Acceleration"),
    "m2": Unit({"m": 2}, "SpecificMoment", "MassNormalisedMomentOfInertia"),
    "rad": Unit({"rad": 1}, "Angle", "Angle", ("deg", degrees(1.0))),
    "rad/s": Unit({"s": -1, "rad": 1}, "AngularVelocity", "AngularVelocity", ("deg/s", degrees(1.0))),
    "rad/s2": Unit(
        {"s": -2, "rad": 1}, "AngularAcceleration", "AngularAcceleration", ("deg/s2", degrees(1.0))
    ),
    "N": Unit({"kg": 1, "m": 1, "s": -2}, "Force", "Force"),
    "N.m": Unit({"kg": 1, "m": 2, "s": -2}, "Torque", "Torque"),
    "kg.m2": Unit({"kg": 1, "m": 2}, "MomentOfInertia", "MomentOfInertia"),
    "J": Unit({"kg": 1, "m": 2, "s": -2}, "Energy", "Energy"),
    "N.m.s": Unit({"kg": 1, "m": 2, "s": -1}, "AngularMomentum", "AngularMomentum"),
}


PURE = "1"
"""The name in FMI of the unit of a pure number, which has none in the model."""


def add_units(root: ET.Element, entries: Sequence[TableEntry]) -> None:
    """Writes the units that variables have; a pure number has one without any exponent."""
    used = _used(entries)
    definitions = ET.SubElement(root, "UnitDefinitions")
    for name, unit in UNITS.items():
        if name in used:
            element = ET.SubElement(definitions, "Unit", name=name or PURE)
            ET.SubElement(element, "BaseUnit", {base: str(power) for base, power in unit.exponents.items()})
            if unit.display:
                display, factor = unit.display
                ET.SubElement(element, "DisplayUnit", name=display, factor=repr(factor))


def add_types(root: ET.Element, entries: Sequence[TableEntry], tag: str) -> None:
    """Writes the declared types that variables have.

    tag : name of a type's element; "SimpleType" of FMI 2.0 nests the attributes in an element of their own
    """
    used = _used(entries)
    definitions = ET.SubElement(root, "TypeDefinitions")
    for name, unit in UNITS.items():
        if name not in used:
            continue
        attributes = {"quantity": unit.quantity, "unit": name or PURE}
        if unit.display:
            attributes["displayUnit"] = unit.display[0]
        if tag == "SimpleType":
            ET.SubElement(ET.SubElement(definitions, tag, name=unit.type_name), "Real", attributes)
        else:
            ET.SubElement(definitions, tag, {"name": unit.type_name} | attributes)


def _used(entries: Sequence[TableEntry]) -> set[str]:
    """Returns the units of the variables that are numbers."""
    return {entry.variable.unit for entry in entries if not entry.variable.boolean}
