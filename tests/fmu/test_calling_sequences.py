"""Each function in each state of a real FMU, against the tables of the standard: calling_sequences.toml.

Where the FMU accepts what the standard does not list, or refuses what it lists, the documentation says so.
"""

import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from fmu.calls import Raw, step
from fmu.right_calls import DISCRETE_INPUT, RIGHT, VALUES, Saved
from support import DISCARD, ERROR, ISS_DG, OK, Instance, variant
from support.marks import FMI

TABLES: dict[str, Any] = tomllib.loads(
    Path(__file__).with_name("calling_sequences.toml").read_text(encoding="utf-8")
)
PAGE = Path(__file__).parents[2] / "fmu_build" / "docs" / "calling_sequences.md"

DOCKED = variant(
    ISS_DG,
    {
        "name": "docked",
        "docks": [{"ports": ["ISS.P2", "DG.nose"], "name": "berth"}],
        "inputs": {"docked": ["berth"], "mass": ["DG"], "torque": True},
        "rotation.angular_velocity": [0.01, 0.02, 0.03],
    },
)
"""It has event mode in co-simulation, and variables of every kind that an FMU can have."""

BY_A_VALUE = "error by a value"
"""The state `error` of FMI 2.0, reached by a value that cannot be used and has been mended."""
STATES = {
    (2, "cs"): [*TABLES["fmi2"]["cs"]["states"], BY_A_VALUE],
    (2, "me"): [*TABLES["fmi2"]["me"]["states"], BY_A_VALUE],
    (3, "cs"): ["instantiated", "initialising", "event", "stepping", "within a step", "terminated"],
    (3, "me"): ["instantiated", "initialising", "event", "continuous", "terminated"],
}
"""The states that this FMU can be in. FMI 3.0 knows no other one after an error than Terminated."""
WAY = pytest.mark.parametrize(("fmi", "interface"), STATES)


@dataclass(frozen=True)
class Cell:
    """A call, by function and the role of its variable, in a state of an instance."""

    fmi: int
    interface: str
    call: str
    state: str


# What the standard says.


def variable_of(fmi: int, call: str) -> Any:
    """Returns what the model description says of a call's variable."""
    role = call.partition(" of ")[2]
    name = VALUES[role][0] if role in VALUES else DISCRETE_INPUT
    return description(fmi)[name]


@cache
def description(fmi: int) -> dict[str, Any]:
    instance = Instance(DOCKED, fmi, optimised=False)
    found = {variable.name: variable for variable in instance.description.modelVariables}
    instance.free()
    return found


def is_state(variable: Any) -> bool:
    return variable.name.startswith("state.")


def holds(condition: str, variable: Any) -> bool:
    """Whether a condition of the tables holds for a variable, by what the model description says of it."""
    is_input = variable.causality == "input"
    start = variable.initial in ("exact", "approx") and variable.variability != "constant" and not is_input
    exact = variable.initial == "exact" and variable.variability != "constant"
    tunable = variable.causality == "parameter" and variable.variability == "tunable"
    continuous = is_input and variable.variability == "continuous"
    is_required = variable.name == VALUES["an output"][0]  # see answer_within_a_step
    # of this FMU InitialUnknowns are the outputs, the states and their rates (test_model_structure)
    unknown = variable.causality == "output" or is_state(variable) or variable.name.startswith("der(")
    return {
        "1": start,
        "2": unknown,
        "3": is_input or exact,
        "4": is_input or tunable,
        "5": continuous or is_state(variable),
        "6": is_input or tunable,
        "start": start,
        "exact": is_input or exact,
        "event": is_input or tunable or (is_state(variable) and not reinitialised(variable)),
        "continuous": continuous or is_state(variable),
        "step": is_input or tunable,
        "required": is_required,
        "required input": is_required and is_input,
    }[condition]


def reinitialised(variable: Any) -> bool:
    return bool(getattr(variable, "reinit", False))


def allowed_by_fmi_2(cell: Cell) -> bool:
    table = TABLES["fmi2"][cell.interface]
    row = table["functions"].get(cell.call.partition(" of ")[0])
    if row is None:
        return False
    state = "error" if cell.state == BY_A_VALUE else cell.state
    entry = row.split()[table["states"].index(state)]
    if entry in (".", "x", "always", "discrete"):
        return entry in ("x", "always")  # "discrete": this FMU has continuous time
    return holds(entry, variable_of(2, cell.call))


def allowed_by_fmi_3(cell: Cell) -> bool:
    function = cell.call.partition(" of ")[0].removeprefix("fmi3")
    accessor = re.fullmatch("(Get|Set)(Float64|Boolean)", function)
    for listed in TABLES["fmi3"]["lists"]:
        if cell.state not in listed["states"]:
            continue
        for entry in (*listed.get("both", ()), *listed.get(cell.interface, ())):
            name, _, condition = entry.partition(":")
            if name != (accessor[1] if accessor else function):
                continue
            if cell.interface == "cs" and condition == "event" and is_state(variable_of(3, cell.call)):
                continue
            if not condition or holds(condition, variable_of(3, cell.call)):
                return True
    return False


def is_allowed(cell: Cell) -> bool:
    return allowed_by_fmi_2(cell) if cell.fmi == 2 else allowed_by_fmi_3(cell)


# What the FMU does.


def bring(fmi: int, interface: str, state: str, **arguments: Any) -> Raw:
    """Returns an instance in a state, and what it was saved in before, as `saved`.

    An importer of FMI 3.0 co-simulation is one that uses event mode.
    """
    if (fmi, interface) == (3, "cs"):
        arguments["eventModeUsed"] = True
    raw = Raw(fmi, f"{interface}, instantiated", scene=DOCKED, optimised=False, **arguments)
    raw.saved = Saved(raw)
    if state == "instantiated":
        return raw
    it = raw.instance
    assert it.enter(stop=1e13) == OK
    if state == "initialising":
        return raw
    assert it.exit() == OK
    if interface == "me" and state not in ("event", "error", BY_A_VALUE):
        assert it.run() == OK
    if interface == "cs" and fmi == 3 and state != "event":
        assert raw("fmi3EnterStepMode") == OK
    if state == "step failed":
        assert step(raw, 0.0, 1e12) == DISCARD
    if state == "terminated":
        assert it._status(raw.fmu.terminate) == OK
    if state == "error":
        assert it.set({"mass": 1.0}) == ERROR
    if state == BY_A_VALUE:
        assert it.set({"DG.mass": -1.0}) == OK
        assert (step(raw, 0.0, 0.1) if interface == "cs" else it.update_discrete_states()) == ERROR
        assert it.set({"DG.mass": 2e4}) == OK
    it.log.clear()
    return raw


def dispose(raw: Raw) -> None:
    raw.saved.free(raw)
    raw.free()


def answer(cell: Cell) -> tuple[int, list[tuple[int, str]]]:
    """Returns a call's status, and status and function of the lines logged that are no information."""
    if cell.state == "within a step":
        return answer_within_a_step(cell)
    raw = bring(cell.fmi, cell.interface, cell.state)
    status = RIGHT[cell.fmi][cell.call](raw)
    lines = logged(raw)
    dispose(raw)
    return status, lines


def answer_within_a_step(cell: Cell) -> tuple[int, list[tuple[int, str]]]:
    found: list[tuple[int, list[tuple[int, str]]]] = []

    def update(*_: Any) -> None:
        if not found:
            raw.instance.log.clear()
            status = RIGHT[cell.fmi][cell.call](raw)
            found.append((status, logged(raw)))

    required = [description(3)[VALUES["an output"][0]].valueReference]
    raw = bring(
        3,
        "cs",
        "stepping",
        intermediateUpdate=update,
        requiredIntermediateVariables=required,
    )
    step(raw, 0.0, 0.1)
    dispose(raw)
    return found[0]


def logged(raw: Raw) -> list[tuple[int, str]]:
    return [(status, message.partition(":")[0]) for status, _, message in raw.instance.log if status != OK]


def cells(fmi: int, interface: str) -> Iterator[Cell]:
    for call in RIGHT[fmi]:
        for state in STATES[fmi, interface]:
            yield Cell(fmi, interface, call, state)


@cache
def answers(fmi: int, interface: str) -> dict[Cell, tuple[int, list[tuple[int, str]]]]:
    return {cell: answer(cell) for cell in cells(fmi, interface)}


# What the documentation says.


def departures(kind: str) -> set[Cell]:
    """Returns the cells of one of the page's tables: FMI, interface, call, states."""
    found = set()
    text = PAGE.read_text(encoding="utf-8").partition(f"## {kind}\n")[2].partition("\n## ")[0]
    for line in text.splitlines():
        if not re.match(r"\| [23]\.0 ", line):
            continue
        fmi, interface, call, states = (part.strip() for part in line.strip("|").split("|"))
        ways = {"both": ("cs", "me"), "co-simulation": ("cs",), "model exchange": ("me",)}[interface]
        for way in ways:
            for name in call.replace("`", "").split(", "):
                for state in states.split(", "):
                    found.add(Cell(int(fmi[0]), way, name, state))
    return found


@WAY
def test_the_fmu_accepts_what_the_standard_lists_but_for_what_the_page_names(fmi, interface):
    listed = {cell: status for cell, (status, _) in answers(fmi, interface).items() if is_allowed(cell)}
    assert len(listed) > 60
    refused = {cell for cell, status in listed.items() if status == ERROR}
    assert refused == {
        cell for cell in departures("Stricter") if (cell.fmi, cell.interface) == (fmi, interface)
    }


@WAY
def test_the_fmu_refuses_what_the_standard_does_not_list_but_for_what_the_page_names(fmi, interface):
    others = {cell: status for cell, (status, _) in answers(fmi, interface).items() if not is_allowed(cell)}
    assert len(others) > 60
    accepted = {cell for cell, status in others.items() if status != ERROR}
    assert accepted == {
        cell for cell in departures("More lenient") if (cell.fmi, cell.interface) == (fmi, interface)
    }


@WAY
def test_a_call_that_is_not_answered_ok_logs_one_line_that_names_the_function(fmi, interface):
    for cell, (status, lines) in answers(fmi, interface).items():
        assert lines == ([] if status == OK else [(status, cell.call.partition(" of ")[0])]), cell


@FMI
def test_each_function_that_is_called_is_one_of_the_tables_and_the_others_are_named(fmi):
    """The tables' own functions: what is left is of types or capabilities that the FMU does not have."""
    supported = {call.partition(" of ")[0] for call in RIGHT[fmi]}
    if fmi == 2:
        tables = {name for way in ("cs", "me") for name in TABLES["fmi2"][way]["functions"]}
        accessors = {f"fmi2{verb}{kind}" for verb in ("Get", "Set") for kind in ("Integer", "String")}
        assert tables - supported == accessors | {"fmi2SetRealInputDerivatives", "fmi2CancelStep"}
        assert supported <= tables
    else:
        listed = TABLES["fmi3"]["lists"]
        named = {
            f"fmi3{entry.partition(':')[0]}"
            for one in listed
            for way in ("both", "cs", "me")
            for entry in one.get(way, ())
        }
        assert {
            name for name in supported if not re.fullmatch("fmi3(Get|Set)(Float64|Boolean)", name)
        } == named - {"fmi3Get", "fmi3Set"}
