"""Each function of the standard's headers in each state of an instance: its status, its line in the log."""

import re
from collections.abc import Callable
from ctypes import byref, c_bool, c_char_p, c_double, c_int, c_size_t, c_ubyte, c_void_p, create_string_buffer
from functools import cache
from pathlib import Path
from typing import Any

import fmpy
import pytest
from fmpy.fmi2 import fmi2DoStepStatus, fmi2LastSuccessfulTime, fmi2Terminated

from fmu.calls import (
    CONTINUOUS,
    STEPPING,
    Raw,
    discrete_states,
    enter,
    get,
    nothing,
    reals,
    reference,
    set_one,
    states,
    step,
)
from support import DISCARD, ERROR, OK
from support.marks import FMI

LETTERS = {"O": OK, "D": DISCARD, "E": ERROR}

# Interface (co-simulation, model exchange) and where in its life an instance is.
CO_SIMULATION = tuple(
    f"cs, {state}" for state in ("instantiated", "initialising", "stepping", "terminated", "after an error")
)
MODEL_EXCHANGE = tuple(
    f"me, {state}"
    for state in ("instantiated", "initialising", "event", "continuous", "terminated", "after an error")
)
STATES = CO_SIMULATION + MODEL_EXCHANGE


@cache
def header(fmi: int) -> tuple[str, ...]:
    """Returns the names of the functions that the standard's header declares."""
    text = (Path(fmpy.__file__).parent / "c-code" / f"fmi{fmi}Functions.h").read_text()
    return tuple(re.findall(rf"FMI{fmi}_Export\s+\w+TYPE\s+(\w+);", text))


def get_one(name: str) -> Callable[[Raw], int]:
    return lambda raw: get(raw, reference(raw, name), 1, reals(0.0))


def output_derivatives(raw: Raw) -> int:
    arguments = reference(raw, "attitude[1]"), 1, (c_int * 1)(1), reals(0.0)
    if raw.fmi == 2:
        return raw("fmi2GetRealOutputDerivatives", *arguments)
    return raw("fmi3GetOutputDerivatives", *arguments, 1)


def sensitivity(function: str) -> Callable[[Raw], int]:
    """Returns a call for the derivative of an output by an input."""

    def call(raw: Raw) -> int:
        unknown, known, seed, result = (
            reference(raw, "mass"),
            reference(raw, "DG.mass"),
            reals(1.0),
            reals(0.0),
        )
        if raw.fmi == 2:
            return raw(function, unknown, 1, known, 1, seed, result)
        return raw(function, unknown, 1, known, 1, seed, 1, result, 1)

    return call


def saved(raw: Raw) -> Any:
    """Returns what the instance's values are saved in; `forget` frees it."""
    pointer = c_void_p()
    assert raw(f"fmi{raw.fmi}GetFMU{'S' if raw.fmi == 3 else 's'}tate", byref(pointer)) == OK
    return pointer


def forget(raw: Raw, pointer: Any, status: int) -> int:
    """Frees what was saved, whatever has become of the instance; returns the status."""
    assert raw(f"fmi{raw.fmi}FreeFMU{'S' if raw.fmi == 3 else 's'}tate", byref(pointer)) == OK
    return status


def get_state(raw: Raw) -> int:
    return forget(raw, saved(raw), OK)


def set_state(raw: Raw) -> int:
    pointer = saved(raw)
    return forget(raw, pointer, raw(f"fmi{raw.fmi}SetFMU{'S' if raw.fmi == 3 else 's'}tate", pointer))


def serialized_size(raw: Raw) -> int:
    pointer = saved(raw)
    function = "fmi2SerializedFMUstateSize" if raw.fmi == 2 else "fmi3SerializedFMUStateSize"
    return forget(raw, pointer, raw(function, pointer, byref(c_size_t())))


def through_bytes(raw: Raw, back: bool) -> int:
    """Serialises a saved state and, if wanted, makes one of the bytes again; returns the last status."""
    pointer, size = saved(raw), c_size_t()
    names = {
        2: ("fmi2SerializedFMUstateSize", "fmi2SerializeFMUstate", "fmi2DeSerializeFMUstate"),
        3: ("fmi3SerializedFMUStateSize", "fmi3SerializeFMUState", "fmi3DeserializeFMUState"),
    }[raw.fmi]
    assert raw(names[0], pointer, byref(size)) == OK
    room = create_string_buffer(size.value) if raw.fmi == 2 else (c_ubyte * size.value)()
    status = raw(names[1], pointer, room, size.value)
    if back and status == OK:
        copy = c_void_p()
        status = forget(raw, copy, raw(names[2], room, size.value, byref(copy)))
    return forget(raw, pointer, status)


def completed_step(raw: Raw) -> int:
    results = [c_int(), c_int()] if raw.fmi == 2 else [c_bool(), c_bool()]
    return raw(f"fmi{raw.fmi}CompletedIntegratorStep", True, *map(byref, results))


def plain(function: str, *arguments: Any) -> Callable[[Raw], int]:
    return lambda raw: raw(function, *arguments)


# In the order of CO_SIMULATION and of MODEL_EXCHANGE, for calls that are right in everything but the state.
ANYWHERE = "OOOOO OOOOOO"
NOWHERE = "EEEEE EEEEEE"
ANSWERS: dict[int, dict[str, tuple[str, Callable[[Raw], int]]]] = {
    2: {
        "fmi2SetDebugLogging": (ANYWHERE, plain("fmi2SetDebugLogging", True, 0, None)),
        "fmi2SetupExperiment": ("OEEEE OEEEEE", lambda raw: enter(raw, 0.0)),
        "fmi2EnterInitializationMode": ("OEEEE OEEEEE", plain("fmi2EnterInitializationMode")),
        "fmi2ExitInitializationMode": ("EOEEE EOEEEE", plain("fmi2ExitInitializationMode")),
        "fmi2Terminate": ("EEOEE EEOOEE", plain("fmi2Terminate")),
        "fmi2Reset": (ANYWHERE, plain("fmi2Reset")),
        "fmi2GetReal": ("EOOOO EOOOOO", get_one("mass")),
        "fmi2GetReal, state": ("EOOOO EOOOOO", get_one("state.attitude[1]")),
        "fmi2GetReal, rate": ("EOOOO EOOOOO", get_one("der(state.angular_velocity[1])")),
        "fmi2SetReal": ("OOOEE OOOOEE", set_one("DG.mass", 2e4)),
        "fmi2SetReal, parameter": ("OOEEE OOEEEE", set_one("angular_velocity_start[1]", 0.1)),
        "fmi2SetReal, state": ("EEEEE EEOOEE", set_one("state.angular_velocity[1]", 0.1)),
        "fmi2SetReal, rate": (NOWHERE, set_one("der(state.angular_velocity[1])", 0.1)),
        "fmi2DoStep": ("EEOEE EEEEEE", lambda raw: step(raw, 0.0, 0.1)),
        "fmi2GetRealStatus": (
            "EEOOO EEEEEE",
            lambda raw: raw("fmi2GetRealStatus", fmi2LastSuccessfulTime, c_double()),
        ),
        "fmi2GetBooleanStatus": (
            "EEOOO EEEEEE",
            lambda raw: raw("fmi2GetBooleanStatus", fmi2Terminated, c_int()),
        ),
        "fmi2GetStatus": ("EEDDD EEEEEE", lambda raw: raw("fmi2GetStatus", fmi2DoStepStatus, c_int())),
        "fmi2GetIntegerStatus": (
            "EEDDD EEEEEE",
            lambda raw: raw("fmi2GetIntegerStatus", fmi2DoStepStatus, c_int()),
        ),
        "fmi2GetStringStatus": ("EEDDD EEEEEE", lambda raw: raw("fmi2GetStringStatus", 1, c_char_p())),
        "fmi2GetRealOutputDerivatives": ("EEOOO EEEEEE", output_derivatives),
        "fmi2GetDirectionalDerivative": ("EOOOO EOOOOO", sensitivity("fmi2GetDirectionalDerivative")),
        "fmi2GetFMUstate": (ANYWHERE, get_state),
        "fmi2SetFMUstate": (ANYWHERE, set_state),
        "fmi2FreeFMUstate": (ANYWHERE, get_state),
        "fmi2SerializedFMUstateSize": (ANYWHERE, serialized_size),
        "fmi2SerializeFMUstate": (ANYWHERE, lambda raw: through_bytes(raw, back=False)),
        "fmi2DeSerializeFMUstate": (ANYWHERE, lambda raw: through_bytes(raw, back=True)),
        "fmi2EnterEventMode": ("EEEEE EEOOEE", plain("fmi2EnterEventMode")),
        "fmi2NewDiscreteStates": ("EEEEE EEOEEE", discrete_states),
        "fmi2EnterContinuousTimeMode": ("EEEEE EEOEEE", plain("fmi2EnterContinuousTimeMode")),
        "fmi2CompletedIntegratorStep": ("EEEEE EEEOEE", completed_step),
        "fmi2SetTime": ("EEEEE EEOOEE", plain("fmi2SetTime", 1.5)),
        "fmi2SetContinuousStates": ("EEEEE EEEOEE", plain("fmi2SetContinuousStates", states(), 7)),
        "fmi2GetContinuousStates": ("EEEEE EOOOOO", plain("fmi2GetContinuousStates", states(), 7)),
        "fmi2GetDerivatives": ("EEEEE EOOOOO", plain("fmi2GetDerivatives", states(), 7)),
        "fmi2GetNominalsOfContinuousStates": (
            "EEEEE OOOOOO",
            plain("fmi2GetNominalsOfContinuousStates", states(), 7),
        ),
        "fmi2GetEventIndicators": ("EEEEE EOOOOO", plain("fmi2GetEventIndicators", None, 0)),
    },
    3: {
        "fmi3SetDebugLogging": (ANYWHERE, plain("fmi3SetDebugLogging", True, 0, None)),
        "fmi3EnterInitializationMode": ("OEEEE OEEEEE", lambda raw: enter(raw, 0.0)),
        "fmi3ExitInitializationMode": ("EOEEE EOEEEE", plain("fmi3ExitInitializationMode")),
        "fmi3Terminate": ("EEOEE EEOOEE", plain("fmi3Terminate")),
        "fmi3Reset": (ANYWHERE, plain("fmi3Reset")),
        "fmi3GetFloat64": (ANYWHERE, get_one("mass")),
        "fmi3GetFloat64, state": (ANYWHERE, get_one("state.attitude[1]")),
        "fmi3GetFloat64, rate": (ANYWHERE, get_one("der(state.angular_velocity[1])")),
        "fmi3SetFloat64": ("OOOEE OOOOEE", set_one("DG.mass", 2e4)),
        "fmi3SetFloat64, parameter": ("OOEEE OOEEEE", set_one("angular_velocity_start[1]", 0.1)),
        "fmi3SetFloat64, state": ("EEEEE EEOOEE", set_one("state.angular_velocity[1]", 0.1)),
        "fmi3SetFloat64, rate": (NOWHERE, set_one("der(state.angular_velocity[1])", 0.1)),
        "fmi3DoStep": ("EEOEE EEEEEE", lambda raw: step(raw, 0.0, 0.1)),
        "fmi3GetOutputDerivatives": ("EEOOO EEEEEE", output_derivatives),
        "fmi3GetDirectionalDerivative": ("EOOOO EOOOOO", sensitivity("fmi3GetDirectionalDerivative")),
        "fmi3GetAdjointDerivative": ("EOOOO EOOOOO", sensitivity("fmi3GetAdjointDerivative")),
        "fmi3GetFMUState": (ANYWHERE, get_state),
        "fmi3SetFMUState": (ANYWHERE, set_state),
        "fmi3FreeFMUState": (ANYWHERE, get_state),
        "fmi3SerializedFMUStateSize": (ANYWHERE, serialized_size),
        "fmi3SerializeFMUState": (ANYWHERE, lambda raw: through_bytes(raw, back=False)),
        "fmi3DeserializeFMUState": (ANYWHERE, lambda raw: through_bytes(raw, back=True)),
        "fmi3EnterEventMode": ("EEEEE EEEOEE", plain("fmi3EnterEventMode")),
        "fmi3UpdateDiscreteStates": ("EEEEE EEOEEE", discrete_states),
        "fmi3EnterContinuousTimeMode": ("EEEEE EEOEEE", plain("fmi3EnterContinuousTimeMode")),
        "fmi3CompletedIntegratorStep": ("EEEEE EEEOEE", completed_step),
        "fmi3SetTime": ("EEEEE EEOOEE", plain("fmi3SetTime", 1.5)),
        "fmi3SetContinuousStates": ("EEEEE EEEOEE", plain("fmi3SetContinuousStates", states(), 7)),
        "fmi3GetContinuousStates": ("EEEEE EOOOOO", plain("fmi3GetContinuousStates", states(), 7)),
        "fmi3GetContinuousStateDerivatives": (
            "EEEEE EOOOOO",
            plain("fmi3GetContinuousStateDerivatives", states(), 7),
        ),
        "fmi3GetNominalsOfContinuousStates": (
            "EEEEE OOOOOO",
            plain("fmi3GetNominalsOfContinuousStates", states(), 7),
        ),
        "fmi3GetEventIndicators": ("EEEEE EOOOOO", plain("fmi3GetEventIndicators", None, 0)),
        "fmi3GetNumberOfContinuousStates": (
            "EEEEE OOOOOO",
            lambda raw: raw("fmi3GetNumberOfContinuousStates", c_size_t()),
        ),
        "fmi3GetNumberOfEventIndicators": (
            "EEEEE OOOOOO",
            lambda raw: raw("fmi3GetNumberOfEventIndicators", c_size_t()),
        ),
    },
}


def answer(fmi: int, name: str, state: str) -> int:
    """Returns the status that a right call gets in a state."""
    return LETTERS[ANSWERS[fmi][name][0].replace(" ", "")[STATES.index(state)]]


WITHOUT_INSTANCE = {
    2: {"fmi2GetTypesPlatform", "fmi2GetVersion", "fmi2Instantiate", "fmi2FreeInstance"},
    3: {
        "fmi3GetVersion",
        "fmi3FreeInstance",
        *(f"fmi3Instantiate{kind}" for kind in ("ModelExchange", "CoSimulation", "ScheduledExecution")),
    },
}
OTHER_TYPES = {
    2: ("Integer", "Boolean", "String"),
    3: (
        *("Float32", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64"),
        *("Boolean", "String", "Binary", "Clock"),
    ),
}
OF_OTHER_TYPES = [
    (fmi, f"fmi{fmi}{verb}{kind}") for fmi in (2, 3) for kind in OTHER_TYPES[fmi] for verb in ("Get", "Set")
]
UNSUPPORTED = [
    *OF_OTHER_TYPES,
    *((2, f"fmi2{name}") for name in ("SetRealInputDerivatives", "CancelStep")),
    *(
        (3, f"fmi3{name}")
        for name in (
            *("GetNumberOfVariableDependencies", "GetVariableDependencies"),
            *("EnterConfigurationMode", "ExitConfigurationMode"),
            *(f"{verb}Interval{kind}" for verb in ("Get", "Set") for kind in ("Decimal", "Fraction")),
            *(f"{verb}Shift{kind}" for verb in ("Get", "Set") for kind in ("Decimal", "Fraction")),
            *("EvaluateDiscreteStates", "EnterStepMode", "ActivateModelPartition"),
        )
    ),
]
ANSWERED = [(fmi, name) for fmi, answers in ANSWERS.items() for name in answers]
OF_AN_INSTANCE = [(fmi, name) for fmi in (2, 3) for name in header(fmi) if name not in WITHOUT_INSTANCE[fmi]]


@FMI
def test_each_function_of_the_header_is_either_supported_or_not(fmi):
    supported = {name.partition(",")[0] for name in ANSWERS[fmi]}
    unsupported = {name for version, name in UNSUPPORTED if version == fmi}
    groups = supported, unsupported, WITHOUT_INSTANCE[fmi]
    assert sum(map(len, groups)) == len(header(fmi))
    assert set().union(*groups) == set(header(fmi))


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize(("fmi", "name"), ANSWERED)
def test_each_supported_function_is_answered_in_the_states_that_allow_it(fmi, name, state):
    raw = Raw(fmi, state)
    assert ANSWERS[fmi][name][1](raw) == answer(fmi, name, state)
    raw.free()


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize(("fmi", "name"), ANSWERED)
def test_a_call_that_is_not_answered_ok_logs_one_line_that_names_the_function(fmi, name, state):
    raw = Raw(fmi, state)
    status = answer(fmi, name, state)
    ANSWERS[fmi][name][1](raw)
    lines = [(s, m.partition(":")[0]) for s, _, m in raw.instance.log if s != OK]
    assert lines == ([] if status == OK else [(status, name.partition(",")[0])])
    raw.free()


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize(("fmi", "name"), UNSUPPORTED)
def test_an_unsupported_function_returns_an_error_and_logs_one_line(fmi, name, state):
    raw = Raw(fmi, state)
    assert raw(name, *nothing(raw.functions[name])) == ERROR
    [message] = raw.instance.messages()
    assert message.startswith(f"{name}: ")
    raw.free()


@pytest.mark.parametrize(("fmi", "name"), OF_OTHER_TYPES)
def test_no_variables_of_another_type_may_be_asked_for(fmi, name):
    raw = Raw(fmi, STEPPING)
    arguments = [0 if kind is c_size_t else None for kind in raw.functions[name].argtypes[1:]]
    assert raw(name, *arguments) == OK
    assert step(raw, 0.0, 0.1) == OK
    raw.free()


@pytest.mark.parametrize(
    ("state", "name", "words"),
    [
        ("cs, initialising", "GetContinuousStates", "in co-simulation"),
        ("cs, terminated", "GetContinuousStates", "in co-simulation"),
        (STEPPING, "GetContinuousStates", "between steps"),
        ("me, terminated", "GetStatus", "in model exchange"),
        (CONTINUOUS, "GetStatus", "in continuous-time mode"),
        ("me, event", "DoStep", "in event mode"),
        ("cs, instantiated", "DoStep", "before initialisation"),
        ("cs, initialising", "DoStep", "during initialisation"),
        ("cs, terminated", "DoStep", "after termination or an error"),
    ],
)
def test_a_call_at_the_wrong_time_is_told_when_it_was(state, name, words):
    raw = Raw(2, state)
    assert ANSWERS[2][f"fmi2{name}"][1](raw) == ERROR
    assert raw.instance.messages() == [f"fmi2{name}: must not be called {words}"]
    raw.free()


@pytest.mark.parametrize(("fmi", "name"), OF_AN_INSTANCE)
def test_no_instance_is_answered_with_an_error(fmi, name):
    raw = Raw(fmi)
    function = raw.functions[name]
    assert function(None, *nothing(function)) == ERROR
    raw.free()


@FMI
def test_freeing_no_instance_does_nothing(fmi):
    raw = Raw(fmi)
    raw.functions[f"fmi{fmi}FreeInstance"](None)
    raw.free()


@FMI
def test_every_function_of_the_header_is_exported(fmi):
    raw = Raw(fmi)
    assert [name for name in header(fmi) if not hasattr(raw.fmu.dll, name)] == []
    raw.free()


def test_versions_are_those_of_the_standard():
    two, three = Raw(2), Raw(3)
    assert two.functions["fmi2GetVersion"]() == b"2.0"
    assert two.functions["fmi2GetTypesPlatform"]() == b"default"
    assert three.functions["fmi3GetVersion"]() == b"3.0"
    two.free()
    three.free()
