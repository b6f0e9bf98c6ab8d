"""Functions of model exchange: the states that allow them, their arrays."""

from collections.abc import Callable
from ctypes import byref, c_bool, c_double, c_int, c_void_p
from typing import Any

import numpy as np
import pytest

from fmu.exchange import RATES, RAW, get_rates, raw_call, raw_update, start
from support import DISCARD, ERROR, OK, STATES, Instance
from support.marks import FMI


def update(instance: Instance) -> Any:
    return (instance.fmu.updateDiscreteStates if instance.fmi == 3 else instance.fmu.newDiscreteStates)()


MOMENTS = ("instantiated", "initialising", "event", "continuous", "terminated", "after an error")


def completed(instance: Instance) -> int:
    kind = c_bool if instance.fmi == 3 else c_int
    return raw_call("CompletedIntegratorStep", True, byref(kind()), byref(kind()))(instance)


# O: ok, E: error, in the order of MOMENTS; FMI 2, FMI 3; what is called.
CALLS: dict[str, tuple[str, str, Callable[[Instance], int]]] = {
    "EnterEventMode": ("EEOOEE", "EEEOEE", raw_call("EnterEventMode")),
    "discrete states": ("EEOEEE", "EEOEEE", raw_update),
    "EnterContinuousTimeMode": ("EEOEEE", "EEOEEE", raw_call("EnterContinuousTimeMode")),
    "CompletedIntegratorStep": ("EEEOEE", "EEEOEE", completed),
    "SetTime": ("EEOOEE", "EEOOEE", raw_call("SetTime", 1.5)),
    "SetContinuousStates": (
        "EEEOEE",
        "EEEOEE",
        raw_call("SetContinuousStates", (c_double * 7)(1, 0, 0, 0, 1, 2, 3), 7),
    ),
    "GetContinuousStates": ("EOOOOO", "EOOOOO", raw_call("GetContinuousStates", (c_double * 7)(), 7)),
    "derivatives": ("EOOOOO", "EOOOOO", get_rates),
    "GetEventIndicators": ("EOOOOO", "EOOOOO", raw_call("GetEventIndicators", None, 0)),
    "nominals": (
        "OOOOOO",
        "OOOOOO",
        raw_call("GetNominalsOfContinuousStates", (c_double * 7)(), 7),
    ),
    "get an output": ("EOOOOO", "OOOOOO", lambda i: i.get_status("mass")),
    "get a state": ("EOOOOO", "OOOOOO", lambda i: i.get_status("state.attitude[1]")),
    "set an input": ("OOOOEE", "OOOOEE", lambda i: i.set({"DG.mass": 2e4})),
    "set a parameter": ("OOEEEE", "OOEEEE", lambda i: i.set({"attitude_start[2]": 0.1})),
    "set a state": ("OEOOEE", "OEOOEE", lambda i: i.set({"state.attitude[2]": 0.1})),
    "set a rate": ("EEEEEE", "EEEEEE", lambda i: i.set({"der(state.attitude[2])": 0.1})),
    "ExitInitializationMode": ("EOEEEE", "EOEEEE", raw_call("ExitInitializationMode")),
    "Terminate": ("EEOOEE", "EEOOEE", raw_call("Terminate")),
    "Reset": ("OOOOOO", "OOOOOO", raw_call("Reset")),
}
CALL = pytest.mark.parametrize("name", CALLS)


@CALL
@FMI
def test_each_call_is_answered_in_the_states_that_allow_it_and_else_logs_one_line(fmi, name):
    two, three, call = CALLS[name]
    found = ""
    for moment in MOMENTS:
        instance = start(fmi=fmi, mode=moment)
        status = call(instance)
        found += {OK: "O", DISCARD: "D", ERROR: "E"}[status]
        assert len(instance.messages()) == (status != OK), (moment, instance.messages())
        instance.free()
    assert found == (two if fmi == 2 else three)


@pytest.mark.parametrize(
    ("fmi", "function", "arguments"),
    [
        (2, "fmi2DoStep", (0.0, 0.1, 1)),
        (3, "fmi3DoStep", (0.0, 0.1, True, c_bool(), c_bool(), c_bool(), c_double())),
        (3, "fmi3GetOutputDerivatives", (None, 0, None, None, 0)),
    ],
)
def test_functions_of_co_simulation_are_refused(fmi, function, arguments):
    instance = start(fmi=fmi)
    call = instance.fmu.dll[function]  # FMPy does not keep these for model exchange
    if fmi == 2:
        call.argtypes = [c_void_p, c_double, c_double, c_int]
    else:
        call.argtypes = instance.fmu._functions[function].argtypes
    assert call(instance.fmu.component, *arguments) == ERROR
    assert instance.messages() == [f"{function}: must not be called in continuous-time mode"]
    instance.free()


@pytest.mark.parametrize("name", list(CALLS)[:10])
def test_functions_of_model_exchange_are_refused_in_co_simulation(name):
    instance = Instance(RAW)
    assert instance.initialise() == OK
    assert CALLS[name][2](instance) == ERROR
    assert instance.messages()[0].endswith("must not be called between steps")
    instance.free()


@FMI
def test_no_event_is_asked_for(fmi):
    instance = start(fmi=fmi, mode="event")
    assert not any(update(instance))
    instance.fmu.enterContinuousTimeMode()
    assert not any(instance.fmu.completedIntegratorStep())
    instance.free()


def test_numbers_of_states_and_event_indicators_are_told():
    instance = start()
    assert instance.fmu.getNumberOfContinuousStates() == 7
    assert instance.fmu.getNumberOfEventIndicators() == 0
    instance.free()


@FMI
def test_nominals_are_those_of_the_model_description(fmi):
    instance, found = start(fmi=fmi), (c_double * 7)()
    instance.fmu.getNominalsOfContinuousStates(found, 7)
    variables = {v.name: v for v in instance.description.modelVariables}
    assert list(found) == [float(variables[name].nominal or 1.0) for name in STATES]
    assert found[4] == pytest.approx(np.linalg.norm(RATES), rel=5e-3)  # three digits
    instance.free()


@pytest.mark.parametrize(
    ("function", "arguments", "text"),
    [
        ("GetContinuousStates", (None, 7), "NULL"),
        ("GetContinuousStates", ((c_double * 8)(), 8), "the array has 8 elements: must be 7"),
        ("SetContinuousStates", (None, 7), "NULL"),
        ("SetContinuousStates", ((c_double * 6)(), 6), "the array has 6 elements: must be 7"),
        ("GetNominalsOfContinuousStates", ((c_double * 7)(), 0), "the array has 0 elements: must be 7"),
        ("GetEventIndicators", ((c_double * 1)(), 1), "must be 0"),
        ("CompletedIntegratorStep", (True, None, None), "NULL"),
    ],
)
@FMI
def test_wrong_arrays_are_errors_with_one_line(fmi, function, arguments, text):
    instance = start(fmi=fmi)
    assert raw_call(function, *arguments)(instance) == ERROR
    [message] = instance.messages()
    assert message.startswith(f"fmi{fmi}{function}: ")
    assert text in message
    instance.free()


@pytest.mark.parametrize("missing", range(6))
def test_an_event_update_without_a_place_for_a_result_is_an_error(missing):
    instance = start(mode="event")
    results = [byref(c_bool()) if i < 5 else byref(c_double()) for i in range(6)]
    results[missing] = None
    assert raw_call("UpdateDiscreteStates", *results)(instance) == ERROR
    assert instance.messages() == ["fmi3UpdateDiscreteStates: an argument for a result is NULL"]
    instance.free()
