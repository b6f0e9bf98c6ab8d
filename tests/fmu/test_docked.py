"""Docks that open and close: Boolean inputs, and the event mode of co-simulation that they bring along."""

from collections.abc import Sequence
from ctypes import c_bool, c_double
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu
from lxml import etree

from support import ERROR, ISS_DG, OK, Instance, built, variant
from support.marks import FMI

ISS, DG = 455000.0, 24500.0

DOCKING = variant(
    ISS_DG,
    {
        "name": "docking",
        "inputs": {"mass": ["DG"], "docked": ["berth"], "torque": True},
        "docks": [{"name": "berth", "ports": ["ISS.P2", "DG.nose"]}],
        "rotation": {"angular_velocity": [0.01, -0.02, 0.03]},
    },
)
OPEN = variant(DOCKING, {"docks": [{"name": "berth", "ports": ["ISS.P2", "DG.nose"], "docked": False}]})

# Interface, where in its life an instance is, whether it is co-simulation with event mode.
PLACES = (
    *(f"cs, {place}" for place in ("instantiated", "initialising", "stepping", "terminated")),
    *(f"events, {place}" for place in ("instantiated", "initialising", "event", "stepping", "terminated")),
    *(f"me, {place}" for place in ("instantiated", "initialising", "event", "continuous", "terminated")),
)
CASES = [(fmi, place) for fmi in (2, 3) for place in PLACES if fmi == 3 or not place.startswith("events")]
EVERYWHERE = pytest.mark.parametrize(("fmi", "place"), CASES)


def brought(fmi: int, place: str, raw: Any = DOCKING) -> Instance:
    """Returns an instance at a place of its life."""
    interface, state = place.split(", ")
    options = {"eventModeUsed": True} if interface == "events" else {}
    instance = Instance(raw, fmi, exchange=interface == "me", **options)
    if state != "instantiated":
        assert instance.enter() == OK
    if state not in ("instantiated", "initialising"):
        assert instance.exit() == OK
    if interface == "events" and state == "stepping":
        assert instance.update_discrete_states() == OK
        assert instance._status(instance.fmu.enterStepMode) == OK
    if interface == "me" and state == "continuous":
        assert instance.run() == OK
    if state == "terminated":
        assert instance._status(instance.fmu.terminate) == OK
    instance.log.clear()
    return instance


def set_boolean(instance: Instance, names: Sequence[str], values: Sequence[bool]) -> int:
    return instance._status(
        instance.fmu.setBoolean, [instance.references[n] for n in names], [bool(v) for v in values]
    )


def get_boolean(instance: Instance, names: Sequence[str]) -> int:
    return instance._status(instance.fmu.getBoolean, [instance.references[n] for n in names])


@FMI
@pytest.mark.parametrize("raw", [DOCKING, OPEN], ids=["closed", "open"])
def test_the_description_is_valid_and_says_that_the_input_is_discrete(fmi, raw):
    assert validate_fmu(str(built(raw, fmi))) == []
    instance = Instance(raw, fmi)
    [variable] = [v for v in instance.description.modelVariables if v.name == "berth.docked"]
    instance.free()
    assert (variable.type, variable.causality, variable.variability) == ("Boolean", "input", "discrete")
    assert variable.start == ("true" if raw is DOCKING else "false")
    assert (variable.unit, variable.declaredType) == (None, None)


@pytest.mark.parametrize(("raw", "claimed"), [(DOCKING, True), (ISS_DG, False)], ids=["docks", "none"])
def test_event_mode_of_co_simulation_is_there_where_docks_open_and_close(raw, claimed):
    folder = fmpy.extract(str(built(raw, 3)))
    root = etree.parse(f"{folder}/modelDescription.xml").getroot()
    assert root.find("CoSimulation").get("hasEventMode") == ("true" if claimed else None)


@FMI
def test_outputs_depend_on_whether_the_dock_is_closed_and_on_the_motion_at_contact(fmi):
    instance = Instance(DOCKING, fmi)
    structure = {u.variable.name: {v.name for v in u.dependencies} for u in instance.description.outputs}
    motion = {name for name in instance.references if name.startswith(("berth.velocity", "berth.rate"))}
    instance.free()
    assert "berth.docked" in structure["mass"] & structure["inertia[1,1]"] & structure["angular_velocity[1]"]
    assert motion <= structure["angular_velocity[1]"] & structure["angular_momentum[1]"]
    assert not motion & (structure["mass"] | structure["inertia[1,1]"] | structure["attitude[1]"])


@EVERYWHERE
def test_a_boolean_is_read_in_every_state_that_variables_are_read_in(fmi, place):
    instance = brought(fmi, place)
    readable = fmi == 3 or not place.endswith("instantiated")
    assert get_boolean(instance, ["berth.docked"]) == (OK if readable else ERROR)
    if readable:
        assert instance.get("berth.docked") is True
    instance.free()


@EVERYWHERE
def test_a_dock_opens_before_the_start_in_event_mode_and_between_steps_without_it(fmi, place):
    instance = brought(fmi, place)
    refused = ("events, stepping", "me, continuous")
    status = ERROR if place in refused or place.endswith("terminated") else OK
    assert set_boolean(instance, ["berth.docked"], [False]) == status
    if fmi == 3 or not place.endswith("instantiated"):
        assert instance.get("berth.docked") is (status == ERROR)
    if place in refused:
        assert instance.messages() == [
            f"fmi{fmi}SetBoolean: berth.docked is discrete: once initialisation is left, it can be changed "
            "in event mode only"
        ]
    instance.free()


@EVERYWHERE
def test_a_value_that_stays_can_be_set_wherever_inputs_are_set(fmi, place):
    instance = brought(fmi, place)
    status = ERROR if place.endswith("terminated") else OK
    assert set_boolean(instance, ["berth.docked"], [True]) == status
    instance.free()


@pytest.mark.parametrize("raw", [DOCKING, OPEN], ids=["closed", "open"])
@pytest.mark.parametrize(
    ("fmi", "place"), [(f, p) for f, p in CASES if not p.endswith(("instantiated", "terminated"))]
)
def test_the_mass_follows_the_dock(fmi, place, raw):
    instance = brought(fmi, place, raw)
    closed = raw is DOCKING
    assert instance.get("mass") == ISS + closed * DG
    if place not in ("events, stepping", "me, continuous"):
        for docked in (not closed, closed):
            assert instance.set({"berth.docked": docked}) == OK
            assert instance.get("berth.docked") is docked
            assert instance.get("mass") == ISS + docked * DG
    instance.free()


@FMI
def test_references_of_the_wrong_type_are_errors_that_name_the_variable(fmi):
    number = "Real" if fmi == 2 else "Float64"
    mistakes = (
        (
            lambda i: i._status(getattr(i.fmu, f"set{number}"), [i.references["berth.docked"]], [0.0]),
            f"fmi{fmi}Set{number}: berth.docked is a Boolean, not a number",
        ),
        (
            lambda i: i._status(getattr(i.fmu, f"get{number}"), [i.references["berth.docked"]]),
            f"fmi{fmi}Get{number}: berth.docked is a Boolean, not a number",
        ),
        (
            lambda i: set_boolean(i, ["berth.docked", "DG.mass"], [False, True]),
            f"fmi{fmi}SetBoolean: DG.mass is a number, not a Boolean",
        ),
        (
            lambda i: get_boolean(i, ["mass"]),
            f"fmi{fmi}GetBoolean: mass is a number, not a Boolean",
        ),
        (
            lambda i: i._status(i.fmu.getBoolean, [len(i.references)]),
            f"fmi{fmi}GetBoolean: value reference {{0}} is unknown; the largest is {{1}}",
        ),
    )
    for mistake, text in mistakes:
        instance = brought(fmi, "cs, stepping")
        assert mistake(instance) == ERROR
        count = len(instance.references)
        assert instance.messages() == [text.format(count, count - 1)]
        assert instance.get("berth.docked") is True  # nothing of that call was stored
        instance.free()


@FMI
def test_no_booleans_may_be_asked_for_and_arrays_may_not_be_null(fmi):
    function = f"fmi{fmi}SetBoolean"
    for count, status in ((0, OK), (1, ERROR)):
        instance = brought(fmi, "cs, stepping")
        arguments = [None, count, None, *([count] if fmi == 3 else [])]
        assert instance.fmu._functions[function](instance.fmu.component, *arguments) == status
        assert instance.messages() == ([] if status == OK else [f"{function}: an array is NULL"])
        instance.free()


@FMI
def test_a_boolean_is_no_known_of_a_derivative(fmi):
    instance = brought(fmi, "cs, stepping")
    with pytest.raises(FMICallException):
        instance.directional(["mass"], ["berth.docked"], [1.0])
    assert "berth.docked cannot be a known of a derivative: it is a Boolean" in instance.messages()[0]
    instance.free()


def test_co_simulation_goes_from_initialisation_through_event_mode_to_steps_and_back():
    instance = brought(3, "events, event")
    assert instance.update_discrete_states() == OK
    assert instance._status(instance.fmu.enterStepMode) == OK
    assert instance.step(0.5) == OK
    assert instance._status(instance.fmu.enterEventMode) == OK
    assert instance.set({"berth.docked": False}) == OK
    assert instance.update_discrete_states() == OK
    assert instance._status(instance.fmu.enterStepMode) == OK
    assert instance.fmu.doStep(0.5, 0.5) == (False, False, False, 1.0)
    assert instance.get("mass") == ISS
    assert instance._status(instance.fmu.terminate) == OK
    instance.free()


FORBIDDEN = (
    ("events, event", "DoStep", (0.0, 0.1, True, *(c_bool() for _ in range(3)), c_double()), "in event mode"),
    ("events, event", "EnterEventMode", (), "in event mode"),
    ("events, event", "EnterContinuousTimeMode", (), "in co-simulation"),
    ("events, event", "SetTime", (1.0,), "in co-simulation"),
    ("events, stepping", "EnterStepMode", (), "between steps"),
    (
        "events, stepping",
        "UpdateDiscreteStates",
        (*(c_bool() for _ in range(5)), c_double()),
        "between steps",
    ),
    ("events, initialising", "EnterEventMode", (), "during initialisation"),
    ("cs, stepping", "EnterStepMode", (), "between steps"),
    ("me, event", "EnterStepMode", (), "in model exchange"),
    ("me, continuous", "EnterStepMode", (), "in continuous-time mode"),
)


@pytest.mark.parametrize(("place", "name", "arguments", "words"), FORBIDDEN)
def test_calls_out_of_turn_are_errors(place, name, arguments, words):
    instance = brought(3, place)
    assert instance.fmu._functions[f"fmi3{name}"](instance.fmu.component, *arguments) == ERROR
    assert instance.messages() == [f"fmi3{name}: must not be called {words}"]
    instance.free()


def test_event_mode_is_not_entered_where_the_importer_has_said_that_it_does_not_use_it():
    instance = brought(3, "cs, stepping")
    assert instance._status(instance.fmu.enterEventMode) == ERROR
    assert instance.messages() == ["fmi3EnterEventMode: eventModeUsed was false when the instance was made"]
    instance.free()


@pytest.mark.parametrize("place", ["events, event", "events, stepping"])
def test_a_reset_instance_still_uses_event_mode(place):
    instance = brought(3, place)
    assert instance.reset() == OK
    assert instance.initialise() == OK
    assert instance._status(instance.fmu.enterStepMode) == OK
    assert instance.step(0.1) == OK
    instance.free()


@pytest.mark.parametrize(
    ("fmi", "kind", "events"),
    [
        (2, "CoSimulation", False),
        (2, "ModelExchange", False),
        (3, "CoSimulation", False),
        (3, "CoSimulation", True),
        (3, "ModelExchange", False),
    ],
)
def test_fmpy_flies_a_ship_that_leaves_and_comes_back(fmi, kind, events):
    instants = [(0.0, True), (0.5, True), (0.5, False), (1.0, False), (1.0, True), (2.0, True)]
    signal = np.array(instants, dtype=[("time", float), ("berth.docked", bool)])
    lines: list[bytes] = []
    result = fmpy.simulate_fmu(
        str(built(DOCKING, fmi)),
        fmi_type=kind,
        input=signal,
        stop_time=2.0,
        output_interval=0.125,
        output=["berth.docked", "mass"],
        use_event_mode=events,
        logger=lambda *arguments: lines.append(arguments[-1]),
    )
    assert lines == []
    assert set(result["mass"]) == {ISS, ISS + DG}
    # without event mode the values at a communication point are those of the step that ends there
    for time, docked, mass in zip(*(result[name] for name in ("time", "berth.docked", "mass")), strict=True):
        if not np.any(np.isclose(time, (0.5, 1.0), rtol=0.0, atol=1e-9)):
            assert (docked, mass) == ((not 0.5 < time < 1.0), ISS + (not 0.5 < time < 1.0) * DG), time


def test_a_state_cannot_be_set_in_event_mode_of_co_simulation():
    instance = brought(3, "events, event")
    assert instance.set({"state.angular_velocity[1]": 0.5}) == ERROR
    assert instance.messages() == [
        "fmi3SetFloat64: state.angular_velocity[1] is a state: it can be set in model exchange once it runs"
    ]
    instance.free()


def test_a_state_saved_in_event_mode_is_refused_where_there_is_none():
    instance, other = brought(3, "events, event"), brought(3, "cs, stepping")
    saved = instance.fmu.getFMUState()
    assert other._status(other.fmu.setFMUState, saved) == ERROR
    assert other.messages() == [
        "fmi3SetFMUState: the FMU state is one in event mode, and eventModeUsed was false when this "
        "instance was made"
    ]
    instance.fmu.freeFMUState(saved)
    instance.free()
    other.free()
