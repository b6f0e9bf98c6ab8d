"""Calls that break the standard's rules, made through the C interface: each is answered, none crashes."""

import re
from collections.abc import Callable
from ctypes import (
    byref,
    c_bool,
    c_char_p,
    c_double,
    c_int,
    c_size_t,
    c_ubyte,
    c_uint,
    c_void_p,
    create_string_buffer,
)
from functools import cache
from pathlib import Path
from typing import Any

import fmpy
import pytest
from fmpy import read_model_description
from fmpy.fmi2 import (
    FMU2Model,
    FMU2Slave,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    fmi2DoStepStatus,
    fmi2EventInfo,
    fmi2LastSuccessfulTime,
    fmi2Terminated,
)
from fmpy.fmi3 import fmi3LogMessageCallback

from support import DISCARD, ERROR, INF, ISS_DG, NAN, OK, Instance, body, built
from support.marks import FMI

RAW = ISS_DG
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
STEPPING, CONTINUOUS = "cs, stepping", "me, continuous"


class Raw:
    """An instance whose C functions are called by name with the instance as first argument.

    The functions of both interfaces are there, whichever the instance is of.
    """

    def __init__(self, fmi: int, state: str = "cs, instantiated", **arguments: Any) -> None:
        interface, state = state.split(", ")
        self.exchange = interface == "me"
        self.instance = Instance(RAW, fmi, exchange=self.exchange, **arguments)
        self.fmi, self.fmu = fmi, self.instance.fmu
        self.functions = dict(self.fmu._functions)
        if fmi == 2:  # FMPy keeps the functions of the two interfaces apart
            self.other = (FMU2Slave if self.exchange else FMU2Model)(
                guid=self.fmu.guid,
                modelIdentifier=self.fmu.modelIdentifier,
                unzipDirectory=self.fmu.unzipDirectory,
            )
            self.functions = self.other._functions | self.functions
        if state != "instantiated":
            assert self.instance.enter(stop=100.0) == OK
        if state not in ("instantiated", "initialising"):
            assert self.instance.exit() == OK
        if self.exchange and state in ("continuous", "terminated"):
            assert self.instance.run() == OK
        if state == "terminated":
            assert self.instance._status(self.fmu.terminate) == OK
        if state == "after an error":
            assert self.instance.set({"mass": 1.0}) == ERROR
        self.instance.log.clear()

    def __call__(self, function: str, *arguments: Any) -> int:
        return self.functions[function](self.fmu.component, *arguments)

    def free(self) -> None:
        if self.fmi == 2:
            self.other.freeLibrary()
        self.instance.free()

    def read(self) -> list[float]:
        """Returns every variable, which is allowed after an error as well."""
        getter = self.fmu.getFloat64 if self.fmi == 3 else self.fmu.getReal
        return list(getter(list(self.instance.references.values())))

    def fly(self) -> list[float]:
        """Initialises, takes a step or goes on to continuous-time mode; returns every variable."""
        assert self.instance.initialise() == OK
        if self.exchange:
            assert self.instance.run() == OK
            assert set_(self, reference(self, "torque[2]", "state.attitude[2]"), 2, reals(5.0, 0.1)) == OK
        else:
            assert step(self, 0.0, 0.1) == OK
        return self.read()


@cache
def header(fmi: int) -> tuple[str, ...]:
    """Returns the names of the functions that the standard's header declares."""
    text = (Path(fmpy.__file__).parent / "c-code" / f"fmi{fmi}Functions.h").read_text()
    return tuple(re.findall(rf"FMI{fmi}_Export\s+\w+TYPE\s+(\w+);", text))


def nothing(function: Any, *, first: int = 1) -> list[Any]:
    """Returns arguments of a function from the first-th on: NULL, false, and a count of 2 for each array."""
    values: dict[Any, Any] = {c_double: 0.0, c_bool: False, c_int: 0, c_uint: 0, c_size_t: 2}
    return [values.get(kind) for kind in function.argtypes[first:]]


def reference(raw: Raw, *names: str) -> Any:
    """Returns an array of value references."""
    return (c_uint * len(names))(*(raw.instance.references[name] for name in names))


def reals(*numbers: float) -> Any:
    return (c_double * len(numbers))(*numbers)


def get(raw: Raw, references: Any, count: int, values: Any, value_count: int | None = None) -> int:
    if raw.fmi == 2:
        return raw("fmi2GetReal", references, count, values)
    return raw("fmi3GetFloat64", references, count, values, count if value_count is None else value_count)


def set_(raw: Raw, references: Any, count: int, values: Any, value_count: int | None = None) -> int:
    if raw.fmi == 2:
        return raw("fmi2SetReal", references, count, values)
    return raw("fmi3SetFloat64", references, count, values, count if value_count is None else value_count)


def set_one(name: str, number: float) -> Callable[[Raw], int]:
    return lambda raw: set_(raw, reference(raw, name), 1, reals(number))


def get_one(name: str) -> Callable[[Raw], int]:
    return lambda raw: get(raw, reference(raw, name), 1, reals(0.0))


def step(raw: Raw, time: float, h: float) -> int:
    if raw.fmi == 2:
        return raw("fmi2DoStep", time, h, True)
    return raw("fmi3DoStep", time, h, True, c_bool(), c_bool(), c_bool(), c_double())


def enter(raw: Raw, start: float, stop: float | None = None) -> int:
    arguments = (False, 0.0, start, stop is not None, stop or 0.0)
    return raw("fmi2SetupExperiment" if raw.fmi == 2 else "fmi3EnterInitializationMode", *arguments)


# Every function in every state of both interfaces.


def states(count: int = 7) -> Any:
    return (c_double * count)(1.0, *[0.0] * (count - 1))


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


def discrete_states(raw: Raw) -> int:
    if raw.fmi == 2:
        return raw("fmi2NewDiscreteStates", byref(fmi2EventInfo()))
    return raw("fmi3UpdateDiscreteStates", *(c_bool() for _ in range(5)), c_double())


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


# Right state, wrong arguments. Each entry: versions, state, call, part of the log line.


def step_without_result(raw: Raw, missing: int) -> int:
    """Steps with NULL for one of the four results."""
    kinds = (c_bool, c_bool, c_bool, c_double)
    results = [None if i == missing else kind() for i, kind in enumerate(kinds)]
    return raw("fmi3DoStep", 0.0, 0.1, True, *results)


def numbered(raw: Raw, *numbers: int) -> Any:
    """Returns an array of value references by number, -1 being one more than the largest."""
    return (c_uint * len(numbers))(*(len(raw.instance.references) if n == -1 else n for n in numbers))


def logging(raw: Raw, count: int, *names: bytes | None) -> int:
    function = f"fmi{raw.fmi}SetDebugLogging"
    return raw(function, True, count, (c_char_p * len(names))(*names) if names else None)


def state_array(raw: Raw, verb: str, array: Any, count: int) -> int:
    return raw(f"fmi{raw.fmi}{verb}ContinuousStates", array, count)


Mistake = tuple[tuple[int, ...], str, Callable[[Raw], int], str]
BOTH, UNKNOWN, NO_ARRAY = (2, 3), "is unknown", "an array is NULL"


def flying(call: Callable[[Raw], int], text: str, versions: tuple[int, ...] = BOTH) -> Mistake:
    """Returns a mistake made between steps."""
    return versions, STEPPING, call, text


def exchanging(call: Callable[[Raw], int], text: str, versions: tuple[int, ...] = BOTH) -> Mistake:
    """Returns a mistake made in continuous-time mode."""
    return versions, CONTINUOUS, call, text


MISTAKES: dict[str, Mistake] = {
    "get, one reference too far": flying(lambda r: get(r, numbered(r, -1), 1, reals(0)), UNKNOWN),
    "get, largest reference": flying(lambda r: get(r, numbered(r, 2**32 - 1), 1, reals(0)), "4294967295"),
    "get, bad after good": flying(lambda r: get(r, numbered(r, 0, -1), 2, reals(0, 0)), UNKNOWN),
    "get, no references": flying(lambda r: get(r, None, 1, reals(0.0)), NO_ARRAY),
    "get, no values": flying(lambda r: get(r, numbered(r, 0), 1, None), NO_ARRAY),
    "get, more values": flying(lambda r: get(r, numbered(r, 0), 1, reals(0, 0), 2), "nValues = 2", (3,)),
    "get, fewer values": flying(lambda r: get(r, numbered(r, 0), 1, reals(0), 0), "nValues = 0", (3,)),
    "get, values for nothing": flying(lambda r: get(r, None, 0, reals(0), 1), "nValues = 1", (3,)),
    "set, one reference too far": flying(lambda r: set_(r, numbered(r, -1), 1, reals(0)), UNKNOWN),
    "set, bad after good": flying(lambda r: set_(r, numbered(r, 1, -1), 2, reals(2e4, 0)), UNKNOWN),
    "set, no references": flying(lambda r: set_(r, None, 1, reals(0.0)), NO_ARRAY),
    "set, no values": flying(lambda r: set_(r, numbered(r, 1), 1, None), NO_ARRAY),
    "set, more values": flying(lambda r: set_(r, numbered(r, 1), 1, reals(1, 2), 2), "nValues = 2", (3,)),
    "set, fewer values": flying(lambda r: set_(r, numbered(r, 1), 1, reals(1), 0), "nValues = 0", (3,)),
    "set, output": flying(set_one("pmi[2]", 1.0), "pmi[2] is an output and cannot be set"),
    "set, output after input": flying(
        lambda r: set_(r, reference(r, "DG.mass", "mass"), 2, reals(2e4, 2e4)), "mass is an output"
    ),
    "set, time": flying(set_one("time", 1.0), "time is the independent variable and cannot be set"),
    "set, parameter after initialisation": flying(
        set_one("attitude_start[2]", 1.0),
        "attitude_start[2] is a fixed parameter and cannot be set after initialisation",
    ),
    "set, state between steps": flying(
        set_one("state.attitude[2]", 1.0),
        "state.attitude[2] is a state: it can be set in model exchange once it runs",
    ),
    "set, state after input": flying(
        lambda r: set_(r, reference(r, "DG.mass", "state.attitude[1]"), 2, reals(2e4, 1.0)),
        "state.attitude[1] is a state",
    ),
    "set, state while initialising": (
        BOTH,
        "me, initialising",
        set_one("state.angular_velocity[2]", 1.0),
        "state.angular_velocity[2] is a state: it can be set in model exchange once it runs",
    ),
    "set, rate": flying(
        set_one("der(state.attitude[2])", 1.0), "der(state.attitude[2]) is a local variable and cannot be set"
    ),
    "set, output while initialising": (BOTH, "cs, initialising", set_one("mass", 1.0), "mass is an output"),
    "set, output at once": (BOTH, "cs, instantiated", set_one("mass", 1.0), "mass is an output"),
    "set, time at once": (BOTH, "cs, instantiated", set_one("time", 1.0), "time is the independent variable"),
    "step of nothing": flying(lambda r: step(r, 0.0, 0.0), "communicationStepSize = 0 s: must be"),
    "step backwards": flying(lambda r: step(r, 0.0, -0.1), "communicationStepSize = -0.1 s: must be"),
    "step of nan": flying(lambda r: step(r, 0.0, NAN), "communicationStepSize = nan s: must be"),
    "step without end": flying(lambda r: step(r, 0.0, INF), "communicationStepSize = inf s: must be"),
    "step from later": flying(lambda r: step(r, 1e-3, 0.1), "currentCommunicationPoint = 0.001"),
    "step from before": flying(lambda r: step(r, -1e-3, 0.1), "currentCommunicationPoint = -0.001"),
    "step from nan": flying(lambda r: step(r, NAN, 0.1), "currentCommunicationPoint = nan s"),
    "step past the end": flying(lambda r: step(r, 0.0, 100.1), "passes stopTime = 100 s"),
    "step just past the end": flying(lambda r: step(r, 0.0, 100.0 + 1e-9), "passes stopTime = 100 s"),
    "step, no event flag": flying(lambda r: step_without_result(r, 0), "NULL", (3,)),
    "step, no termination flag": flying(lambda r: step_without_result(r, 1), "NULL", (3,)),
    "step, no early return flag": flying(lambda r: step_without_result(r, 2), "NULL", (3,)),
    "step, no time": flying(lambda r: step_without_result(r, 3), "NULL", (3,)),
    "start at nan": (BOTH, "cs, instantiated", lambda r: enter(r, NAN), "startTime = nan s: must be finite"),
    "start at no time": (BOTH, "cs, instantiated", lambda r: enter(r, -INF), "startTime = -inf s: must be"),
    "stop before start": (
        BOTH,
        "cs, instantiated",
        lambda r: enter(r, 1.0, 0.5),
        "stopTime = 0.5 s: must not",
    ),
    "stop at nan": (BOTH, "cs, instantiated", lambda r: enter(r, 0.0, NAN), "stopTime = nan s"),
    "no categories": flying(lambda r: logging(r, 2), "categories is NULL"),
    "unknown category": flying(lambda r: logging(r, 2, b"logAll", b"logNone"), "category 2"),
    "category NULL": flying(lambda r: logging(r, 1, None), "category 1"),
    "exchange: get, one reference too far": exchanging(
        lambda r: get(r, numbered(r, -1), 1, reals(0)), UNKNOWN
    ),
    "exchange: get, no references": exchanging(lambda r: get(r, None, 1, reals(0.0)), NO_ARRAY),
    "exchange: get, no values": exchanging(lambda r: get(r, numbered(r, 0), 1, None), NO_ARRAY),
    "exchange: set, one reference too far": exchanging(
        lambda r: set_(r, numbered(r, -1), 1, reals(0)), UNKNOWN
    ),
    "exchange: set, bad after good": exchanging(
        lambda r: set_(r, numbered(r, 1, -1), 2, reals(2e4, 0)), UNKNOWN
    ),
    "exchange: set, no references": exchanging(lambda r: set_(r, None, 1, reals(0.0)), NO_ARRAY),
    "exchange: set, no values": exchanging(lambda r: set_(r, numbered(r, 1), 1, None), NO_ARRAY),
    "exchange: set, output after state": exchanging(
        lambda r: set_(r, reference(r, "state.attitude[2]", "mass"), 2, reals(0.1, 2e4)), "mass is an output"
    ),
    "exchange: set, rate": exchanging(
        set_one("der(state.attitude[2])", 1.0), "der(state.attitude[2]) is a local variable and cannot be set"
    ),
    "exchange: set, time": exchanging(
        set_one("time", 1.0), "time is the independent variable and cannot be set"
    ),
    "exchange: set, parameter": exchanging(
        set_one("attitude_start[2]", 1.0), "attitude_start[2] is a fixed parameter"
    ),
    "exchange: no states to set": exchanging(lambda r: state_array(r, "Set", None, 7), "the array is NULL"),
    "exchange: no states to get": exchanging(lambda r: state_array(r, "Get", None, 7), "the array is NULL"),
    "exchange: six states": exchanging(
        lambda r: state_array(r, "Set", states(6), 6), "6 elements: must be 7"
    ),
    "exchange: eight states": exchanging(
        lambda r: state_array(r, "Get", states(8), 8), "8 elements: must be 7"
    ),
    "exchange: unknown category": exchanging(lambda r: logging(r, 1, b"logNone"), "category 1"),
    "exchange: start at nan": (
        BOTH,
        "me, instantiated",
        lambda r: enter(r, NAN),
        "startTime = nan s: must be",
    ),
    "exchange: stop before start": (
        BOTH,
        "me, instantiated",
        lambda r: enter(r, 1.0, 0.5),
        "stopTime = 0.5 s",
    ),
    "no place for the time": flying(
        lambda r: r("fmi2GetRealStatus", fmi2LastSuccessfulTime, None), "value is NULL", (2,)
    ),
    "no place for the answer": flying(
        lambda r: r("fmi2GetBooleanStatus", fmi2Terminated, None), "value is NULL", (2,)
    ),
}
CASES = [pytest.param(v, *rest, id=f"{v}-{name}") for name, (vs, *rest) in MISTAKES.items() for v in vs]
MISTAKE = pytest.mark.parametrize(("fmi", "state", "call", "text"), CASES)
MISTAKE_IN_FLIGHT = pytest.mark.parametrize(
    ("fmi", "state", "call", "text"), [case for case in CASES if case.values[1] in (STEPPING, CONTINUOUS)]
)


@MISTAKE
def test_a_wrong_argument_is_an_error_and_one_line_says_which(fmi, state, call, text):
    raw = Raw(fmi, state)
    assert call(raw) == ERROR
    [(status, category, message)] = [line for line in raw.instance.log if line[0] != OK]
    assert (status, category) == (ERROR, "logStatusError")
    assert re.match(rf"fmi{fmi}\w+: ", message)
    assert text in message
    raw.free()


@MISTAKE_IN_FLIGHT
def test_a_wrong_argument_leaves_all_values_as_they_were(fmi, state, call, text):
    raw = Raw(fmi, state)
    before = raw.read()
    call(raw)
    assert raw.read() == before
    raw.free()


@MISTAKE
def test_after_an_error_an_instance_does_not_go_on(fmi, state, call, text):
    raw = Raw(fmi, state)
    call(raw)
    for again in (
        lambda: step(raw, 0.0, 0.1),
        lambda: set_one("DG.mass", 2e4)(raw),
        lambda: discrete_states(raw),
        lambda: state_array(raw, "Set", states(), 7),
        lambda: raw(
            f"fmi{fmi}EnterInitializationMode", *nothing(raw.functions[f"fmi{fmi}EnterInitializationMode"])
        ),
        lambda: raw(f"fmi{fmi}ExitInitializationMode"),
        lambda: raw(f"fmi{fmi}Terminate"),
    ):
        assert again() == ERROR
    raw.free()


@MISTAKE
def test_after_an_error_reset_makes_an_instance_fly_like_a_new_one(fmi, state, call, text):
    runs = []
    for broken in (False, True):
        raw = Raw(fmi, state)
        if broken:
            call(raw)
        assert raw.instance.reset() == OK
        runs.append(raw.fly())
        raw.free()
    assert runs[0] == runs[1]


@FMI
def test_an_error_of_one_instance_leaves_another_alone(fmi):
    broken, other = Raw(fmi, STEPPING), Raw(fmi, STEPPING)
    assert step(broken, 0.0, -1.0) == ERROR
    assert step(other, 0.0, 0.1) == OK
    assert other.instance.messages() == []
    broken.free()
    other.free()


@FMI
@pytest.mark.parametrize("state", [STEPPING, CONTINUOUS])
def test_arrays_of_no_elements_may_be_null(fmi, state):
    raw = Raw(fmi, state)
    assert [get(raw, None, 0, None), set_(raw, None, 0, None)] == [OK, OK]
    raw.free()


@FMI
def test_a_step_may_end_at_the_stop_time_within_a_few_roundings(fmi):
    raw = Raw(fmi, STEPPING)
    assert step(raw, 0.0, 100.0 * (1 + 2.0**-52)) == OK
    raw.free()


@pytest.mark.parametrize("kind", [0, 1, 2, 3, 17, -1])
@pytest.mark.parametrize(
    ("name", "value", "known"),
    [
        ("fmi2GetStatus", c_int(), None),
        ("fmi2GetRealStatus", c_double(), fmi2LastSuccessfulTime),
        ("fmi2GetIntegerStatus", c_int(), None),
        ("fmi2GetBooleanStatus", c_int(), fmi2Terminated),
        ("fmi2GetStringStatus", c_char_p(), None),
    ],
)
def test_a_status_that_there_is_not_is_discarded_and_flight_goes_on(name, value, known, kind):
    raw = Raw(2, STEPPING)
    assert raw(name, kind, value) == (OK if kind == known else DISCARD)
    assert step(raw, 0.0, 0.1) == OK
    raw.free()


# Instances that are refused.

ENVIRONMENT = 4711
Lines = list[tuple[int, str, str]]


def instantiate(
    fmi: int,
    *,
    exchange: bool = False,
    name: bytes | None = b"it",
    kind: int | None = None,
    event_mode: bool = False,
    intermediate: tuple[int, ...] | None = (),
    callbacks: bool = True,
    logger: bool = True,
    **token: bytes | None,
) -> tuple[int | None, Lines, set[Any]]:
    """Instantiates for an interface; returns the instance, what it logs till it is freed, and to whom.

    An instance that is made is initialised, makes an error that it may log, and is freed. `kind` is FMI 2.0's
    number of the interface if it is not the right one; `intermediate` None stands for an array of one element
    that is NULL.
    """
    raw, lines, addressees = Raw(fmi), [], set()

    def log(*arguments: Any) -> None:
        *addressee, status, category, text = arguments
        lines.append((status, category.decode(), text.decode()))
        addressees.add(tuple(addressee))

    secret = token.get("token", raw.fmu.guid.encode())
    if fmi == 2:
        structure = fmi2CallbackFunctions(componentEnvironment=ENVIRONMENT)
        if logger:
            structure.logger = fmi2CallbackLoggerTYPE(log)
        pointer = structure if callbacks else None
        kind = (0 if exchange else 1) if kind is None else kind
        component = raw.functions["fmi2Instantiate"](name, kind, secret, None, pointer, False, True)
    else:
        callback = fmi3LogMessageCallback(log) if logger else fmi3LogMessageCallback()
        common = name, secret, None, False, True
        if exchange:
            component = raw.functions["fmi3InstantiateModelExchange"](*common, ENVIRONMENT, callback)
        else:
            variables = (None, 1) if intermediate is None else ((c_uint * len(intermediate))(*intermediate),)
            component = raw.functions["fmi3InstantiateCoSimulation"](
                *common,
                event_mode,
                False,
                *(variables if intermediate is None else (*variables, len(intermediate))),
                ENVIRONMENT,
                callback,
                raw.fmu.intermediateUpdate,
            )
    if component:
        enter_, exit_ = (f"fmi{fmi}{verb}InitializationMode" for verb in ("Enter", "Exit"))
        assert raw.functions[enter_](component, *nothing(raw.functions[enter_])) == OK
        assert [raw.functions[exit_](component) for _ in range(2)] == [OK, ERROR]
        raw.functions[f"fmi{fmi}FreeInstance"](component)
    raw.free()
    return component, lines, addressees


NAMELESS, TOKENLESS = "instanceName must hold a character", "is not that of this library"
REFUSED_INSTANCES = [
    pytest.param(fmi, changes, text, id=f"{fmi}-{name}{' (exchange)' if changes.get('exchange') else ''}")
    for fmi, name, changes, text in [
        *(
            (fmi, name, changes | {"exchange": exchange}, text)
            for fmi in (2, 3)
            for exchange in (False, True)
            for name, changes, text in [
                ("no name", {"name": None}, NAMELESS),
                ("empty name", {"name": b""}, NAMELESS),
                ("blank name", {"name": b" \t\r\n"}, NAMELESS),
                ("no token", {"token": None}, TOKENLESS),
                ("empty token", {"token": b""}, TOKENLESS),
                ("wrong token", {"token": b"{00000000-0000-0000-0000-000000000000}"}, TOKENLESS),
            ]
        ),
        (2, "unknown kind", {"kind": 7}, "fmuType must be fmi2ModelExchange or fmi2CoSimulation"),
        (2, "negative kind", {"kind": -1}, "fmuType must be fmi2ModelExchange or fmi2CoSimulation"),
        (3, "event mode", {"event_mode": True}, "eventModeUsed is true, but this FMU has no event mode"),
        (3, "an input within steps", {"intermediate": (1,)}, "holds a reference that is no output"),
        (3, "time within steps", {"intermediate": (0,)}, "holds a reference that is no output"),
        (
            3,
            "what is not there within steps",
            {"intermediate": (2**32 - 1,)},
            "a reference that is no output",
        ),
        (3, "NULL within steps", {"intermediate": None}, "requiredIntermediateVariables is NULL"),
    ]
]


@pytest.mark.parametrize(("fmi", "changes", "text"), REFUSED_INSTANCES)
def test_wrong_arguments_give_no_instance_and_one_line_that_says_why(fmi, changes, text):
    component, log, _ = instantiate(fmi, **changes)
    assert component is None
    [(status, category, message)] = log
    assert (status, category) == (ERROR, "logStatusError")
    interface = "ModelExchange" if changes.get("exchange") else "CoSimulation"
    assert message.startswith("fmi2Instantiate: " if fmi == 2 else f"fmi3Instantiate{interface}: ")
    assert text in message


@pytest.mark.parametrize(("fmi", "changes", "text"), REFUSED_INSTANCES)
def test_wrong_arguments_and_no_logger_give_no_instance(fmi, changes, text):
    assert instantiate(fmi, logger=False, **changes) == (None, [], set())


@pytest.mark.parametrize("exchange", [False, True])
@pytest.mark.parametrize(
    ("fmi", "changes"), [(2, {"callbacks": False}), (2, {"logger": False}), (3, {"logger": False})], ids=str
)
def test_an_instance_without_a_logger_flies(fmi, changes, exchange):
    component, log, _ = instantiate(fmi, exchange=exchange, **changes)
    assert component
    assert log == []


@pytest.mark.parametrize("token", [{}, {"token": b"wrong"}], ids=["in flight", "when refused"])
@pytest.mark.parametrize("exchange", [False, True])
@FMI
def test_lines_are_logged_to_the_importers_environment(fmi, exchange, token):
    _, log, addressees = instantiate(fmi, exchange=exchange, **token)
    assert log
    assert addressees == {(ENVIRONMENT, b"it") if fmi == 2 else (ENVIRONMENT,)}


@pytest.mark.parametrize("logger", [True, False])
def test_scheduled_execution_gives_no_instance_and_one_line(logger):
    raw, log = Raw(3), []
    name = "fmi3InstantiateScheduledExecution"
    function = raw.functions[name]
    callback = fmi3LogMessageCallback(
        lambda _, status, category, text: log.append((status, category.decode(), text.decode()))
    )
    arguments = [
        (callback if logger else kind())
        if kind is fmi3LogMessageCallback
        else {c_bool: True, c_char_p: raw.fmu.guid.encode()}.get(kind, kind())
        for kind in function.argtypes
    ]
    assert function(*arguments) is None
    line = (ERROR, "logStatusError", f"{name}: this FMU has no scheduled execution")
    assert log == ([line] if logger else [])
    raw.free()


@pytest.mark.parametrize("exchange", [False, True])
@pytest.mark.parametrize("other", [(body(), 3), (RAW, 2)], ids=["of another scene", "of the other version"])
def test_a_token_of_another_fmu_is_refused(other, exchange):
    token = read_model_description(str(built(*other))).guid.encode()
    assert instantiate(3, exchange=exchange, token=token)[0] is None
