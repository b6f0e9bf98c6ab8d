"""scene.c: the variable table with start values and checks, and the token."""

from collections.abc import Mapping, Sequence

from fmu_build.interface.variable_table import TableEntry
from supervessel.scene.inputs import MASS
from supervessel.scene.schema import Scene
from supervessel.scene.variables import InputVariable, OutputVariable, Variable


def scene_source(scene: Scene, entries: Sequence[TableEntry], token: str, changing: bool) -> str:
    """Returns scene.c.

    token    : instantiation token
    changing : whether a change of inputs changes the states
    """
    needs = {entry.reference: _needs(entry, changing) for entry in entries}
    rows = "\n".join(f"    {_row(entry, needs)}," for entry in entries)
    checks = [
        (entry.reference, check) for entry in entries if (check := _check(scene, entry)) != "CHECK_NONE"
    ]
    judged = "\n".join(f"    {{{reference}, {check}}}," for reference, check in [*checks, (0, "CHECK_NONE")])
    return (
        "/* Generated: the scene's variables, by value reference. */\n"
        '#include "docks.h"\n\n'
        f"const Variable VARIABLES[VARIABLE_COUNT] = {{\n{rows}\n}};\n\n"
        f"const Judged JUDGED[] = {{\n{judged}\n}};\n\n"
        f'const char MODEL_TOKEN[] = "{token}";\n'
    )


def _needs(entry: TableEntry, changing: bool) -> frozenset[str]:
    """Returns the quantities that must be current before an unknown that depends on a variable can be read.

    They are names of flags of fmu_build/c/variable_table.h, without FOLLOWS_.
    """
    if entry.role == "state" and "attitude" in entry.variable.name:
        return frozenset({"STATES", "ATTITUDE"})
    if entry.role == "state" and entry.variable.group.endswith(".momentum"):  # of a wheel
        return frozenset({"STATES"})
    if entry.role == "state":
        return frozenset({"STATES", "COMPOSITE"} if changing else {"STATES"})
    if isinstance(entry.variable, InputVariable) and entry.variable.part == "shape":
        return frozenset({"COMPOSITE"})
    if isinstance(entry.variable, InputVariable) and entry.variable.part == "field":
        return frozenset({"COMPOSITE", "FIELD"})  # it is judged beside the composite's size
    return frozenset()


def _shows_axes(variable: Variable) -> bool:
    """Whether a variable shows principal moments or axes."""
    return isinstance(variable, OutputVariable) and variable.kind.axes


def _row(entry: TableEntry, needs: Mapping[int, frozenset[str]]) -> str:
    """Returns a row of VARIABLES.

    needs : by value reference, the result of `_needs` for each variable
    """
    variable = entry.variable
    own = {
        "output": frozenset({"OUTPUTS", "AXES"} if _shows_axes(variable) else {"OUTPUTS"}),
        "derivative": frozenset({"RATES"}),
        "state": needs[entry.reference],
    }
    flags = sorted(own.get(entry.role, frozenset()).union(*(needs[d.reference] for d in entry.dependencies)))
    fields = [
        f'"{entry.name}"',
        f'"{variable.unit}"',
        repr(variable.start or 0.0),
        repr(entry.nominal),
        f"ROLE_{entry.role.upper()}",
        " | ".join(f"FOLLOWS_{flag}" for flag in flags) or "0",
        "TYPE_BOOLEAN" if variable.boolean else "TYPE_NUMBER",
    ]
    return "{" + ", ".join(fields) + "}"


def _check(scene: Scene, entry: TableEntry) -> str:
    """Returns the check of a variable's value; where elements are judged together, the first one has it."""
    variable = entry.variable
    if isinstance(variable, InputVariable) and variable.kind is MASS and scene.vessels[variable.owner].wheels:
        return "CHECK_MASS_OF_WHEELS"
    if isinstance(variable, InputVariable) and variable.element == 0 and variable.kind.judge:
        return f"CHECK_{variable.kind.judge}"
    return "CHECK_NONE"
