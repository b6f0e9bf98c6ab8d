"""Model exchange: the importer's solver holds time and states, the FMU gives rates and outputs."""

from ctypes import c_double
from typing import Any

import numpy as np
import pytest

from fmu.exchange import ATTITUDE, RATES, RAW, get_rates, raw_update, scalars, start
from supervessel import reference
from support import (
    COMPOSITE_TOLERANCE,
    DISCARD,
    EPS,
    ERROR,
    INF,
    NAN,
    OK,
    STATES,
    UNIT_TOLERANCE,
    Instance,
    draw_inputs,
    relative_error,
    scene,
)
from support.marks import FMI

SEED = 20240611
MODE = pytest.mark.parametrize("mode", ["event", "continuous"])


def outputs(instance: Instance) -> list[float]:
    names = [v.name for v in instance.description.modelVariables if v.causality == "output"]
    getter = instance.fmu.getFloat64 if instance.fmi == 3 else instance.fmu.getReal
    return list(getter([instance.references[name] for name in names]))


def states(instance: Instance) -> np.ndarray:
    array = (c_double * 7)()
    instance.fmu.getContinuousStates(array, 7)
    return np.array(array)


def rates(instance: Instance) -> np.ndarray:
    array, fmu = (c_double * 7)(), instance.fmu
    (fmu.getContinuousStateDerivatives if instance.fmi == 3 else fmu.getDerivatives)(array, 7)
    return np.array(array)


def set_states(instance: Instance, values: Any) -> int:
    return instance._status(instance.fmu.setContinuousStates, (c_double * 7)(*values), 7)


def draw(seed: int) -> tuple[dict[str, Any], np.ndarray]:
    """Returns usable inputs of the ISS with its ship, and states with an attitude of unit length."""
    generator = np.random.default_rng(seed)
    inputs = draw_inputs(generator)
    attitude = generator.normal(size=4)
    return inputs, np.concatenate([attitude / np.linalg.norm(attitude), 0.1 * generator.normal(size=3)])


def expected(inputs: dict[str, Any], x: np.ndarray) -> dict[str, Any]:
    """Returns all outputs by the numpy reference."""
    whole = reference.composite(scene(RAW), scalars(inputs))
    momentum = whole.inertia @ x[4:]
    attitude = x[:4] / np.linalg.norm(x[:4])
    return {
        "mass": whole.mass,
        "barycentre": whole.barycentre,
        "pmi": whole.pmi,
        "inertia": whole.inertia.ravel(),
        "angular_velocity": x[4:],
        "attitude": attitude,
        "kinetic_energy": x[4:] @ momentum / 2.0,
        "angular_momentum": reference.rotation_matrix(attitude) @ momentum,
    }


# Time.


@MODE
@FMI
def test_time_is_what_was_set_forwards_and_backwards(fmi, mode):
    instance, times = start(fmi=fmi, mode=mode), [0.0]
    for time in (0.5, 1e5, 1e5 - 1e-9, 0.0):
        assert instance._status(instance.fmu.setTime, time) == OK
        times.append(instance.get("time"))
    assert times == [0.0, 0.5, 1e5, 1e5 - 1e-9, 0.0]
    instance.free()


@pytest.mark.parametrize("time", [NAN, INF, -INF])
@FMI
def test_a_time_that_is_not_finite_is_refused_and_the_old_one_kept(fmi, time):
    instance = start(fmi=fmi)
    instance.fmu.setTime(2.5)
    assert instance._status(instance.fmu.setTime, time) == (DISCARD if fmi == 3 else ERROR)
    [message] = instance.messages()
    assert message == f"fmi{fmi}SetTime: time = {time:g} s: must be finite"
    assert instance.get("time") == 2.5
    instance.free()


@FMI
def test_nothing_but_time_itself_depends_on_time(fmi):
    instance = start(fmi=fmi)
    before = [*outputs(instance), *rates(instance), *states(instance)]
    instance.fmu.setTime(1234.5)
    assert [*outputs(instance), *rates(instance), *states(instance)] == before
    instance.free()


# States, rates and outputs.


@FMI
def test_states_at_the_start_are_the_scenes_with_the_attitude_at_unit_length(fmi):
    instance = start(fmi=fmi)
    truth = [*(np.array(ATTITUDE) / np.linalg.norm(ATTITUDE)), *RATES]
    assert relative_error(states(instance), truth) <= UNIT_TOLERANCE
    instance.free()


@FMI
def test_states_follow_start_parameters_while_initialising(fmi):
    instance = start(fmi=fmi, mode="initialising")
    instance.set({"attitude_start": [0.0, -3.0, 0.0, 4.0], "angular_velocity_start": [1.0, 2.0, 3.0]})
    assert list(states(instance)) == [0.0, -0.6, 0.0, 0.8, 1.0, 2.0, 3.0]
    instance.free()


@FMI
def test_states_by_array_and_by_reference_are_the_same_states(fmi):
    _, x = draw(SEED)
    one, other = start(fmi=fmi), start(fmi=fmi)
    assert set_states(one, x) == OK
    assert other.set({"state.attitude": x[:4], "state.angular_velocity": x[4:]}) == OK
    for instance in (one, other):
        assert list(states(instance)) == list(x)
        assert [instance.get(name) for name in STATES] == list(x)
    assert list(rates(one)) == list(rates(other))
    assert outputs(one) == outputs(other)
    one.free()
    other.free()


@FMI
def test_rates_by_array_and_by_reference_are_the_same_rates(fmi):
    instance = start(fmi=fmi)
    assert [instance.get(f"der({name})") for name in STATES] == list(rates(instance))
    instance.free()


@MODE
@pytest.mark.parametrize("seed", range(SEED, SEED + 3))
@FMI
def test_rates_follow_inputs_and_states_at_once(fmi, seed, mode):
    inputs, x = draw(seed)
    instance = start(fmi=fmi, mode=mode)
    rates(instance)  # what has been computed by now must not stay
    assert instance.set(inputs) == OK
    assert instance.set(dict(zip(STATES, x, strict=True))) == OK
    shaping = {k: v for k, v in scalars(inputs).items() if not k.startswith("torque")}
    truth = reference.ode(scene(RAW), x, inputs["torque"], shaping)
    inertia = reference.composite(scene(RAW), shaping).inertia
    # The torque that turns the body is a difference of products, each off by COMPOSITE_TOLERANCE of itself.
    magnitude = np.linalg.norm(inputs["torque"]) + np.linalg.norm(inertia, 2) * (x[4:] @ x[4:])
    bound = COMPOSITE_TOLERANCE * magnitude / np.linalg.eigvalsh(inertia)[0] * np.linalg.cond(inertia)
    error = np.abs(rates(instance) - truth)
    assert error[4:].max() <= bound
    assert error[:4].max() <= 8 * EPS * np.linalg.norm(x[4:])
    instance.free()


@MODE
@pytest.mark.parametrize("seed", range(SEED, SEED + 3))
@FMI
def test_outputs_follow_inputs_and_states_at_once(fmi, seed, mode):
    inputs, x = draw(seed)
    instance = start(fmi=fmi, mode=mode)
    outputs(instance)
    for name, value in inputs.items():
        assert instance.set({name: value}) == OK
        outputs(instance)
    assert instance.set(dict(zip(STATES, x, strict=True))) == OK
    truth = expected(inputs, x)
    errors = {name: relative_error(instance.get(name), value) for name, value in truth.items()}
    assert max(errors.values()) <= COMPOSITE_TOLERANCE, errors
    instance.free()


@pytest.mark.parametrize("power", [-330, -300, -20, -1, 1, 20, 300, 330])
@FMI
def test_the_attitude_output_is_unit_whatever_the_length_of_the_state(fmi, power):
    instance = start(fmi=fmi)
    x = np.array([1.0, -2.0, 3.0, 4.0]) / np.sqrt(30.0)
    assert instance.set({"state.attitude": np.ldexp(x, power)}) == OK
    assert relative_error(instance.get("attitude"), x) <= UNIT_TOLERANCE
    assert list(instance.get("state.attitude")) == list(np.ldexp(x, power))
    instance.free()


@FMI
def test_the_angular_momentum_does_not_depend_on_the_length_of_the_attitude(fmi):
    instance = start(fmi=fmi)
    before = instance.get("angular_momentum")
    instance.set({"state.attitude": 3.0 * instance.get("state.attitude")})
    assert relative_error(instance.get("angular_momentum"), before) <= COMPOSITE_TOLERANCE
    instance.free()


# Refusals.


@pytest.mark.parametrize("place", range(7))
@pytest.mark.parametrize("value", [NAN, INF, -INF])
@FMI
def test_a_state_that_is_not_finite_is_discarded_with_its_name_and_all_states_are_kept(fmi, value, place):
    instance = start(fmi=fmi)
    before, values = list(states(instance)), [1.0] * 7
    values[place] = value
    assert set_states(instance, values) == DISCARD
    [message] = instance.messages()
    assert f"{STATES[place]} = {value:g}" in message
    assert list(states(instance)) == before
    assert set_states(instance, [1.0] * 7) == OK
    instance.free()


@pytest.mark.parametrize("value", [NAN, INF])
@FMI
def test_a_state_set_by_reference_that_is_not_finite_is_discarded(fmi, value):
    instance = start(fmi=fmi)
    before = list(states(instance))
    assert instance.set({"state.angular_velocity[1]": 1.0, "state.attitude[3]": value}) == DISCARD
    assert f"state.attitude[3] = {value:g}" in instance.messages()[0]
    assert list(states(instance)) == before
    instance.free()


@pytest.mark.parametrize("length", [0.0, 1e-170, 1e170])
@FMI
def test_outputs_of_an_attitude_without_usable_length_are_discarded_until_it_is_corrected(fmi, length):
    instance = start(fmi=fmi)
    values = outputs(instance)
    attitude = instance.get("state.attitude")
    assert instance.set({"state.attitude": [0.0, 0.0, length, 0.0]}) == OK
    assert instance.get_status("attitude") == DISCARD
    assert "state.attitude = (0, 0, " in instance.messages()[0]
    assert instance.set({"state.attitude": attitude}) == OK
    assert outputs(instance) == values
    instance.free()


@pytest.mark.parametrize("name", ["kinetic_energy", "angular_momentum[1]", "der(state.angular_velocity[1])"])
@FMI
def test_a_result_beyond_the_range_of_numbers_is_discarded_and_others_are_given(fmi, name):
    instance = start(fmi=fmi)
    assert instance.set({"state.angular_velocity": [1e305, 1e305, 1e305]}) == OK
    assert instance.get_status(name) == DISCARD
    assert instance.messages() == [
        f"fmi{fmi}Get{'Float64' if fmi == 3 else 'Real'}: {name} leaves the range of finite numbers"
    ]
    assert instance.get_status("attitude") == OK
    assert list(instance.get("angular_velocity")) == [1e305] * 3
    instance.free()


@FMI
def test_an_event_update_judges_the_inputs(fmi):
    instance = start(fmi=fmi, mode="event")
    assert instance.set({"DG.nose.direction": [0.0, 0.0, 0.0]}) == OK
    assert raw_update(instance) == (DISCARD if fmi == 3 else ERROR)
    [message] = instance.messages()
    assert "DG.nose.direction = (0, 0, 0): must have a length greater than 0" in message
    instance.free()


def test_after_a_discarded_event_update_good_inputs_go_on():
    one, other = start(mode="event"), start(mode="event")
    assert one.set({"DG.mass": -1.0}) == OK
    assert raw_update(one) == DISCARD
    for instance in (one, other):
        assert instance.set({"DG.mass": 12000.0}) == OK
        assert instance.run() == OK
    assert outputs(one) == outputs(other)
    one.free()
    other.free()


@pytest.mark.parametrize("what", ["mass", "der(state.angular_velocity[1])", "rates"])
@FMI
def test_what_follows_from_unusable_inputs_is_discarded_until_they_are_corrected(fmi, what):
    instance = start(fmi=fmi)
    before = [*outputs(instance), *rates(instance)]
    assert instance.set({"DG.mass": -1.0}) == OK
    status = get_rates(instance) if what == "rates" else instance.get_status(what)
    assert status == DISCARD
    assert "DG.mass = -1 kg: must be >= 0" in instance.messages()[0]
    assert instance.set({"DG.mass": 24500.0}) == OK
    assert [*outputs(instance), *rates(instance)] == before
    instance.free()


@FMI
def test_states_and_what_follows_from_them_alone_do_not_need_usable_inputs(fmi):
    instance = start(fmi=fmi)
    assert instance.set({"DG.mass": -1.0}) == OK
    assert instance.get_status("state.attitude") == OK
    assert list(states(instance)[4:]) == RATES
    instance.free()
