"""Derivatives of the FMU's outputs with respect to time."""

from ctypes import c_double, c_int, c_uint

import numpy as np
import pytest

from fmu.jacobians import (
    DIFFERENCE,
    DIFFERENCE_TOLERANCE,
    normalised,
    standing,
    time_derivatives,
    twin,
    values,
)
from support import ERROR, OK
from support.marks import FMI


@pytest.mark.parametrize("name", ["tensor", "chain", "principal"])
def test_output_derivatives_are_limits_of_differences_over_time(name):
    at = normalised(values(name, "drawn"))
    instance, names = standing(name, at, exchange=False), twin(name).y_names
    h = DIFFERENCE  # s, an angle of less than DIFFERENCE rad: rates are below 1 rad/s

    def read() -> np.ndarray:
        return np.array([instance.get(output) for output in names])

    before = read()
    assert instance.step(h) == OK
    middle, found = read(), time_derivatives(instance, names)
    assert instance.step(h) == OK
    after = read()
    groups = [output.partition("[")[0] for output in names]
    size = {g: max(abs(v) for v, other in zip(middle, groups, strict=True) if other == g) for g in groups}
    bound = DIFFERENCE_TOLERANCE * np.array([size[g] for g in groups])
    assert (np.abs(found - (after - before) / (2 * h)) <= bound).all()
    instance.free()


@FMI
def test_output_derivatives_are_the_rates_of_the_states(fmi):
    at = normalised(values("tensor", "drawn"))
    instance = standing("tensor", at, fmi, exchange=False)
    names = [f"angular_velocity[{i}]" for i in (1, 2, 3)]
    assert list(time_derivatives(instance, names)) == [instance.get(f"der(state.{name})") for name in names]
    assert not time_derivatives(instance, ["mass", "pmi[1]", "inertia[1,2]", "barycentre[3]"]).any()
    instance.free()


@FMI
def test_output_derivatives_follow_inputs_at_once(fmi):
    at = normalised(values("tensor", "start"))
    instance = standing("tensor", at, fmi, exchange=False)
    time_derivatives(instance, ["angular_velocity[1]"])
    instance.set({"DG.mass": 12000.0, "torque[1]": 1e6})
    found = time_derivatives(instance, ["angular_velocity[1]"])
    assert found[0] == instance.get("der(state.angular_velocity[1])")
    instance.free()


TIME_MISUSES = {
    "second order": (["mass"], [2], "order 2 of mass"),
    "order zero": (["mass"], [0], "order 0 of mass"),
    "an input": (["DG.mass"], [1], "DG.mass cannot be differentiated: only outputs"),
    "a state": (["state.attitude[1]"], [1], "only outputs"),
    "no values": (["mass"], None, "NULL"),
}


@pytest.mark.parametrize("misuse", TIME_MISUSES)
@FMI
def test_wrongly_asked_output_derivatives_are_errors_with_one_line(fmi, misuse):
    names, orders, text = TIME_MISUSES[misuse]
    instance = standing("tensor", normalised(values("tensor", "start")), fmi, exchange=False)
    references = (c_uint * len(names))(*(instance.references[name] for name in names))
    given = None if orders is None else (c_int * len(orders))(*orders)
    result = (c_double * len(names))()
    sizes = (len(names),) if fmi == 3 else ()
    function = "fmi3GetOutputDerivatives" if fmi == 3 else "fmi2GetRealOutputDerivatives"
    call = instance.fmu._functions[function]
    assert call(instance.fmu.component, references, len(names), given, result, *sizes) == ERROR
    [message] = instance.messages()
    assert message.startswith(f"{function}: ")
    assert text in message
    instance.free()
