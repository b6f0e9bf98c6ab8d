"""Functions of model exchange: what they tell, their arrays (when: test_calling_sequences.py)."""

from ctypes import byref, c_bool, c_double
from typing import Any

import numpy as np
import pytest

from fmu.exchange import RATES, raw_call, start
from support import ERROR, STATES, Instance
from support.marks import FMI


def update(instance: Instance) -> Any:
    return (instance.fmu.updateDiscreteStates if instance.fmi == 3 else instance.fmu.newDiscreteStates)()


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
