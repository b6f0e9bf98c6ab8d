"""The functions of the standard's headers: all there, also those of types and capabilities that are not.

Which call is answered in which state: test_calling_sequences.py.
"""

import re
from ctypes import c_size_t
from functools import cache
from pathlib import Path

import fmpy
import pytest

from fmu.calls import CONTINUOUS, STEPPING, Raw, nothing, step
from fmu.right_calls import RIGHT
from support import ERROR, OK
from support.marks import FMI

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
OF_AN_INSTANCE = [(fmi, name) for fmi in (2, 3) for name in header(fmi) if name not in WITHOUT_INSTANCE[fmi]]


@FMI
def test_each_function_of_the_header_is_either_supported_or_not(fmi):
    # where docks are inputs
    docked = {f"fmi{fmi}{verb}Boolean" for verb in ("Get", "Set")} | {"fmi3EnterStepMode"}
    supported = {name.partition(" of ")[0] for name in RIGHT[fmi]} - docked
    unsupported = {name for version, name in UNSUPPORTED if version == fmi}
    groups = supported, unsupported, WITHOUT_INSTANCE[fmi]
    assert sum(map(len, groups)) == len(header(fmi))
    assert set().union(*groups) == set(header(fmi))


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
    assert RIGHT[2][f"fmi2{name}"](raw) == ERROR
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
