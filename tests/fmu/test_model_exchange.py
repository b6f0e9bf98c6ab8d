"""Model exchange: the importer's solver holds time and states, the FMU gives rates and outputs."""

from collections.abc import Callable
from ctypes import byref, c_bool, c_double, c_int, c_void_p
from functools import cache
from typing import Any

import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.fmi2 import fmi2EventInfo
from scipy.integrate import solve_ivp

from supervessel import reference
from support import (
    DISCARD,
    EPS,
    ERROR,
    INF,
    ISS_DG,
    NAN,
    OK,
    Instance,
    built,
    draw_inputs,
    relative_error,
    scene,
    variant,
)
from support.marks import FMI

SEED = 20240611
MODE = pytest.mark.parametrize("mode", ["event", "continuous"])

RATES, ATTITUDE = [0.05, -0.08, 0.11], [0.5, -0.5, 0.7, 0.1]
RAW = variant(ISS_DG, {"name": "exchanged", "rotation": {"angular_velocity": RATES, "attitude": ATTITUDE}})
STATES = [
    *(f"state.attitude[{i}]" for i in (1, 2, 3, 4)),
    *(f"state.angular_velocity[{i}]" for i in (1, 2, 3)),
]

# Sums of 12 points with about 5 roundings each, no term larger than the largest element compared.
COMPOSITE_TOLERANCE = 64 * EPS
# A quotient by the root of a sum of four squares is off by at most 2 EPS relative in each component; taking
# the norm again rounds by up to EPS more.
UNIT_TOLERANCE = 4 * EPS


def start(raw: dict[str, Any] = RAW, fmi: int = 3, mode: str = "continuous") -> Instance:
    """Returns an instance of model exchange in a state of its life cycle."""
    instance = Instance(raw, fmi, exchange=True)
    if mode != "instantiated":
        assert instance.enter(stop=100.0) == OK
    if mode not in ("instantiated", "initialising"):
        assert instance.exit() == OK
    if mode in ("continuous", "terminated"):
        assert instance.run() == OK
    if mode == "terminated":
        assert instance._status(instance.fmu.terminate) == OK
    if mode == "after an error":
        assert instance.set({"mass": 1.0}) == ERROR
    instance.log.clear()
    return instance


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


def update(instance: Instance) -> Any:
    return (instance.fmu.updateDiscreteStates if instance.fmi == 3 else instance.fmu.newDiscreteStates)()


def draw(seed: int) -> tuple[dict[str, Any], np.ndarray]:
    """Returns usable inputs of the ISS with its ship, and states with an attitude of unit length."""
    generator = np.random.default_rng(seed)
    inputs = draw_inputs(generator)
    attitude = generator.normal(size=4)
    return inputs, np.concatenate([attitude / np.linalg.norm(attitude), 0.1 * generator.normal(size=3)])


def scalars(values: dict[str, Any]) -> dict[str, float]:
    """Returns values by group as values of scalars."""
    return {
        f"{name}[{i + 1}]" if np.ndim(value) else name: float(x)
        for name, value in values.items()
        for i, x in enumerate(np.ravel(value))
    }


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


# Life cycle.

MOMENTS = ("instantiated", "initialising", "event", "continuous", "terminated", "after an error")


def raw_call(name: str, *arguments: Any) -> Callable[[Instance], int]:
    return lambda i: i.fmu._functions[f"fmi{i.fmi}{name}"](i.fmu.component, *arguments)


def raw_update(instance: Instance) -> int:
    if instance.fmi == 2:
        return raw_call("NewDiscreteStates", byref(fmi2EventInfo()))(instance)
    return raw_call("UpdateDiscreteStates", *(byref(c_bool()) for _ in range(5)), byref(c_double()))(instance)


def completed(instance: Instance) -> int:
    kind = c_bool if instance.fmi == 3 else c_int
    return raw_call("CompletedIntegratorStep", True, byref(kind()), byref(kind()))(instance)


def get_rates(instance: Instance) -> int:
    name = "GetContinuousStateDerivatives" if instance.fmi == 3 else "GetDerivatives"
    return raw_call(name, (c_double * 7)(), 7)(instance)


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
    "set a state": ("EEOOEE", "EEOOEE", lambda i: i.set({"state.attitude[2]": 0.1})),
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


# Whole flights.

STOP, STEP = 20.0, 0.5  # s
EVENTS: list[tuple[float, dict[str, float]]] = [
    (4.0, {"torque[1]": 2e6, "torque[3]": -1e6}),
    (8.0, {"torque[1]": 0.0, "DG.mass": 15000.0}),
    (12.5, {"DG.nose.position[2]": -4.0, "torque[3]": 0.0}),
    (16.0, {"DG.nose.direction[2]": 0.5, "DG.nose.alignment[3]": 0.5}),
]
ROWS = [*(f"attitude[{i}]" for i in (1, 2, 3, 4)), *(f"angular_velocity[{i}]" for i in (1, 2, 3))]


def pieces() -> list[tuple[float, float, dict[str, float]]]:
    """Returns from, to and inputs of each span without a change."""
    port = ISS_DG["vessels"]["DG"]["ports"]["nose"]
    inputs = scalars({"DG.mass": 24500.0, "torque": [0.0] * 3} | {f"DG.nose.{k}": v for k, v in port.items()})
    spans, begin = [], 0.0
    for time, changes in [*EVENTS, (STOP, {})]:
        spans.append((begin, time, dict(inputs)))
        inputs |= changes
        begin = time
    return spans


@cache
def flight(fmi: int, kind: str, parts: int = 1, **settings: Any) -> np.ndarray:
    """Returns attitude and rate every STEP, recorded `parts` times as often; inputs jump."""
    rows = [(time, *inputs.values()) for begin, end, inputs in pieces() for time in (begin, end)]
    signals = np.array(rows, dtype=[("time", float), *((name, float) for name in pieces()[0][2])])
    result = simulate_fmu(
        str(built(RAW, fmi)),
        fmi_type=kind,
        stop_time=STOP,
        output_interval=STEP / parts,
        input=signals,
        output=ROWS,
        record_events=False,
        **settings,
    )
    return np.column_stack([result[name] for name in ROWS])[::parts]


@cache
def truth() -> np.ndarray:
    """Returns the same by SciPy on the numpy reference."""
    x, rows = np.array([*(np.array(ATTITUDE) / np.linalg.norm(ATTITUDE)), *RATES]), []
    rows.append(x)
    for begin, end, inputs in pieces():
        torque = [inputs[f"torque[{i}]"] for i in (1, 2, 3)]
        inertia = reference.composite(scene(RAW), inputs).inertia

        def rate(_: float, y: np.ndarray, J: Any = inertia, M: Any = torque) -> np.ndarray:
            return np.concatenate(
                [reference.attitude_dot(y[:4], y[4:]), reference.angular_acceleration("tensor", J, y[4:], M)]
            )

        times = [*np.arange(begin, end, STEP)[1:].tolist(), end]
        solution = solve_ivp(rate, (begin, end), x, "DOP853", times, rtol=1e-13, atol=1e-15)
        rows += list(solution.y.T)
        x = solution.y[:, -1]
    return np.array(rows)


def turned() -> float:
    """Returns the angle [rad] turned in the whole flight."""
    return float(np.linalg.norm(truth()[:, 4:], axis=1).sum()) * STEP


# CVode keeps the weighted root mean square of each step's error below 1: a component is off by at most
# sqrt(7) (relative + absolute) tolerance, both being TOLERANCE times magnitudes of about 1.
TOLERANCE = 1e-9
STEP_ERROR = 2 * np.sqrt(7.0) * TOLERANCE


@FMI
def test_cvode_on_the_fmu_agrees_with_scipy(fmi):
    calls: list[str] = []
    settings = {"solver": "CVode", "relative_tolerance": TOLERANCE, "fmi_call_logger": calls.append}
    found = flight(fmi, "ModelExchange", **settings)
    steps = sum("Derivatives(" in call for call in calls)  # each takes one evaluation at least
    # A wrong rate turns the attitude all the time that follows: a factor of the angle turned.
    assert np.abs(found - truth()).max() <= STEP_ERROR * steps * (1 + turned())


@FMI
def test_co_simulation_agrees_with_scipy(fmi):
    # RK4 errs by theta^5 101/2880 in each sub-step of theta = 0.05 rad: so its error coefficients sum up.
    bound = 101 / 2880 * 0.05**4 * turned() * (1 + turned())
    assert np.abs(flight(fmi, "CoSimulation") - truth()).max() <= bound


# FMPy's Euler method takes one step from each point that is recorded to the next.
PARTS = 100


def euler(fmi: int, parts: int = PARTS) -> np.ndarray:
    return flight(fmi, "ModelExchange", parts, solver="Euler", step_size=STEP / parts)


@FMI
def test_euler_on_the_fmu_errs_by_the_first_power_of_the_step_around_scipys_result(fmi):
    coarse, fine = (euler(fmi, parts)[-1] - truth()[-1] for parts in (PARTS, 2 * PARTS))
    angle = np.linalg.norm(truth()[:, 4:], axis=1).max() * STEP / PARTS
    # A step of x'' h^2 / 2: the attitude has |x''| = omega^2/4, the rate at most omega^3 where it changes by
    # its square a second.
    assert np.abs(coarse).max() <= 0.5 * angle * turned() * (1 + turned())
    # The next power of the step is smaller by a factor of the angle for each radian turned.
    assert np.abs(2.0 * fine - coarse).max() <= angle * turned() * np.abs(coarse).max()


@pytest.mark.parametrize("solver", ["CVode", "Euler"])
def test_both_versions_give_the_same_exchange_bit_for_bit(solver):
    settings = (
        {"relative_tolerance": TOLERANCE}
        if solver == "CVode"
        else {"parts": PARTS, "step_size": STEP / PARTS}
    )
    two, three = (flight(fmi, "ModelExchange", solver=solver, **settings) for fmi in (2, 3))
    assert two.tobytes() == three.tobytes()


@FMI
def test_the_attitude_output_stays_unit_under_an_integrator_that_lets_it_grow(fmi):
    assert np.abs(np.linalg.norm(euler(fmi)[:, :4], axis=1) - 1.0).max() <= UNIT_TOLERANCE
