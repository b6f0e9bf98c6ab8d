"""Intermediate update of FMI 3.0: the importer is called at the end of each sub-step and may end the step."""

from collections.abc import Callable
from ctypes import c_double, c_size_t, c_uint, c_void_p
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from fmpy.fmi3 import fmi3IntermediateUpdateCallback, fmi3LogMessageCallback

from fmu.listeners import Listener, Update, output_names, outputs
from support import DISCARD, EPS, ERROR, INF, ISS_DG, NAN, OK, Instance, body, variant

# Quarters of a radian and of a second: times and sub-steps are exact in binary.
STEADY = body(law="none", max_angle_step=0.25, angular_velocity=[0.0, 0.0, 1.0])
QUARTERS = [0.25, 0.5, 0.75, 1.0]
ANGLE = 0.1  # rad
RATES = [0.05, -0.08, 0.11]
TUMBLING = variant(
    ISS_DG, {"name": "tumbling", "rotation": {"angular_velocity": RATES, "max_angle_step": ANGLE}}
)


def ending(at: float, when: float = 0.0) -> Update:
    """Returns an update that asks, from time `when` on, for an end of the step at time `at`."""

    def update(listener: Listener, time: float, flags: list[bool], wanted: Any, return_time: Any) -> None:
        if time >= when:
            wanted[0], return_time[0] = True, at

    return update


def stopped(times: list[float], raw: dict[str, Any] = STEADY) -> list[list[float]]:
    """Returns time and outputs of an instance that steps from each of these times to the next."""
    instance = Instance(raw)
    assert instance.initialise() == OK
    rows = []
    for time in times:
        assert instance.step(time - instance.time) == OK
        instance.time = time
        rows.append([instance.get("time"), *outputs(instance)])
    instance.free()
    return rows


# The calls.


def test_the_importer_is_called_at_the_end_of_each_sub_step():
    listener = Listener(STEADY)
    assert listener.fly(1.0) == (OK, False, 1.0)
    assert listener.times == QUARTERS
    listener.free()


@pytest.mark.parametrize("early", [True, False])
def test_the_flags_allow_reading_but_not_setting_and_early_return_as_agreed(early):
    listener = Listener(STEADY, early=early)
    listener.fly(1.0)
    # set requested, get allowed, sub-step finished, early return possible
    assert listener.flags == [[False, True, True, early]] * 4
    listener.free()


def test_a_step_of_one_sub_step_calls_once():
    listener = Listener(STEADY)
    for end in (0.25, 0.5, 0.6):
        listener.times.clear()
        listener.fly(end - listener.time)
        assert listener.times == [listener.time]
    listener.free()


def test_times_increase_to_the_end_of_the_step_by_no_more_than_the_largest_angle():
    listener = Listener(TUMBLING)
    listener.set({"torque": [2e6, -1e6, 3e6]})
    assert listener.fly(40.0) == (OK, False, 40.0)
    sizes = np.diff([0.0, *listener.times])
    fastest = [np.linalg.norm(RATES), *(np.linalg.norm(row) for row in omegas(listener))]
    angles = [size * max(ends) for size, ends in zip(sizes, pairwise(fastest), strict=True)]
    assert sizes.min() > 0.0
    # The angle is exceeded by rounding at most where the rate is steady.
    assert max(angles) <= ANGLE * (1 + 4 * EPS)
    assert listener.times[-1] == 40.0
    listener.free()


def omegas(listener: Listener) -> list[list[float]]:
    """Returns the angular velocities read."""
    first = 1 + output_names(listener).index("angular_velocity[1]")
    return [row[first : first + 3] for row in listener.read]


def test_outputs_read_are_bit_for_bit_those_of_a_run_stopped_there():
    listener = Listener(STEADY)
    listener.fly(1.0)
    assert listener.read == stopped(QUARTERS)
    listener.free()


# A sub-step's size and the difference of its ends differ by a rounding of the time, 40 s, in which the body
# turns at about 0.15 rad/s; each of about 80 sub-steps rounds by some 30 EPS. A wrong rate turns the attitude
# by a factor of the angle, 6 rad.
STOPPED_TOLERANCE = (40 * 0.15 + 80 * 30) * (1 + 6) * EPS


def test_output_derivatives_read_within_a_step_are_the_rates_there():
    found: list[tuple[list[float], list[float]]] = []
    names = [f"angular_velocity[{i}]" for i in (1, 2, 3)]

    def update(listener: Listener, *_: Any) -> None:
        references = [listener.references[name] for name in names]
        rates = [listener.get(f"der(state.{name})") for name in names]
        found.append((list(listener.fmu.getOutputDerivatives(references, [1] * 3)), rates))

    listener = Listener(TUMBLING, update)
    assert listener.fly(1.0)[0] == OK
    assert len({tuple(derivatives) for derivatives, _ in found}) > 1
    for derivatives, rates in found:
        assert derivatives == rates
    listener.free()


def test_outputs_read_in_a_tumbling_flight_are_those_of_a_run_stopped_there():
    listener = Listener(TUMBLING)
    listener.fly(40.0)
    found, right = np.array(listener.read).T, np.array(stopped(listener.times, TUMBLING)).T
    groups = ["time", *(name.partition("[")[0] for name in output_names(listener))]
    sizes = [np.abs(right[[g == group for g in groups]]).max() for group in groups]
    assert (np.abs(found - right).max(axis=1) / sizes).max() <= STOPPED_TOLERANCE
    listener.free()


def test_listening_does_not_change_the_flight():
    rows = []
    for raw in (TUMBLING, STEADY):
        listener, deaf = Listener(raw), Instance(raw)
        deaf.initialise()
        for h in (0.5, 20.0, 3.7):
            listener.fly(h)
            deaf.step(h)
            rows.append(outputs(listener) == outputs(deaf))
        listener.free()
        deaf.free()
    assert all(rows)


# Early return.


@pytest.mark.parametrize("time", QUARTERS[:3])
def test_a_step_ends_now_when_asked(time):
    listener = Listener(STEADY, ending(at=time, when=time))
    assert listener.fly(1.0) == (OK, True, time)
    assert listener.times[-1] == time
    assert [time, *outputs(listener)] == listener.read[-1]
    listener.free()


@pytest.mark.parametrize("time", [0.3, 0.625, 0.7500000001, 0.9, 1.0 - 1e-9])
def test_a_step_ends_later_when_asked(time):
    listener = Listener(STEADY, ending(at=time))
    assert listener.fly(1.0) == (OK, True, time)
    assert listener.times[-1] == time
    assert [time, *outputs(listener)] == listener.read[-1]
    listener.free()


def test_the_end_asked_for_is_that_of_a_run_stopped_there():
    listener = Listener(STEADY, ending(at=0.4))
    listener.fly(1.0)
    assert listener.read == stopped([0.25, 0.4])
    listener.free()


def test_of_several_ends_asked_for_the_last_one_counts():
    def update(listener: Listener, time: float, flags: list[bool], wanted: Any, return_time: Any) -> None:
        wanted[0], return_time[0] = True, 0.75 if time < 0.5 else 0.625

    listener = Listener(STEADY, update)
    assert listener.fly(1.0) == (OK, True, 0.625)
    listener.free()


@pytest.mark.parametrize("at", [0.0, 0.1, -5.0, -INF])
def test_a_step_asked_to_end_in_the_past_ends_now(at):
    listener = Listener(STEADY, ending(at))
    assert listener.fly(1.0) == (OK, True, 0.25)
    listener.free()


@pytest.mark.parametrize("at", [1.0, 1.5, INF, NAN])
def test_an_end_that_is_not_before_the_steps_own_changes_nothing(at):
    listener = Listener(STEADY, ending(at))
    assert listener.fly(1.0) == (OK, False, 1.0)
    assert listener.times == QUARTERS
    listener.free()


def test_a_request_at_the_end_of_the_step_is_no_early_return():
    listener = Listener(STEADY, ending(at=1.0, when=1.0))
    assert listener.fly(1.0) == (OK, False, 1.0)
    listener.free()


def test_an_early_return_time_without_a_request_changes_nothing():
    def update(listener: Listener, time: float, flags: list[bool], wanted: Any, return_time: Any) -> None:
        return_time[0] = 0.3

    listener = Listener(STEADY, update)
    assert listener.fly(1.0) == (OK, False, 1.0)
    listener.free()


def test_a_step_asked_to_end_without_a_time_ends_now():
    def update(listener: Listener, time: float, flags: list[bool], wanted: Any, return_time: Any) -> None:
        wanted[0] = True

    listener = Listener(STEADY, update)
    assert listener.fly(1.0) == (OK, True, 0.25)
    listener.free()


def test_a_step_does_not_return_early_for_an_importer_that_cannot_handle_it():
    listener = Listener(STEADY, ending(at=0.5), early=False)
    assert listener.fly(1.0) == (OK, False, 1.0)
    assert listener.times == QUARTERS
    listener.free()


def test_flight_goes_on_from_an_early_return():
    listener = Listener(STEADY, ending(at=0.5, when=0.5))
    listener.fly(1.0)
    listener.update = None
    assert listener.fly(0.5) == (OK, False, 1.0)
    assert listener.read == stopped(QUARTERS)
    listener.free()


def test_after_an_early_return_a_step_from_the_end_that_was_not_reached_is_an_error():
    listener = Listener(STEADY, ending(at=0.5))
    listener.fly(1.0)
    listener.time = 1.0
    assert listener.fly(1.0)[0] == ERROR
    assert "currentCommunicationPoint = 1 s: must be the instance's time 0.5 s" in listener.messages()[0]
    listener.free()


# What is refused within a step.


REFUSED: dict[str, Callable[[Listener], int]] = {
    "fmi3SetFloat64": lambda i: i.set({"torque[1]": 1.0}),
    "fmi3DoStep": lambda i: i._status(i.fmu.doStep, i.times[-1], 0.1),
    "fmi3Reset": lambda i: i._status(i.fmu.reset),
    "fmi3Terminate": lambda i: i._status(i.fmu.terminate),
    "fmi3EnterInitializationMode": lambda i: i._status(i.fmu.enterInitializationMode),
    "fmi3ExitInitializationMode": lambda i: i._status(i.fmu.exitInitializationMode),
    "fmi3GetFMUState": lambda i: i._status(i.fmu.getFMUState),
    "fmi3SetFMUState": lambda i: i._status(i.fmu.setFMUState, c_void_p()),
    "fmi3GetDirectionalDerivative": lambda i: i._status(i.fmu.getDirectionalDerivative, [], [], []),
    "fmi3GetAdjointDerivative": lambda i: i._status(i.fmu.getAdjointDerivative, [], [], []),
    "fmi3EnterEventMode": lambda i: i._status(i.fmu.enterEventMode),
    "fmi3EnterStepMode": lambda i: i._status(i.fmu.enterStepMode),
    "fmi3UpdateDiscreteStates": lambda i: i._status(i.fmu.updateDiscreteStates),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_not_allowed_within_a_step_ends_it_as_an_error_with_one_line(name):
    answers = []

    def update(listener: Listener, *_: Any) -> None:
        answers.append(REFUSED[name](listener))

    listener = Listener(STEADY, update)
    assert listener.fly(1.0)[0] == ERROR
    assert answers == [ERROR]  # and no further call after it
    [message] = listener.messages()
    assert message.startswith(f"{name}: ")
    listener.free()


@pytest.mark.parametrize("name", REFUSED)
def test_reset_after_an_error_within_a_step_makes_an_instance_fly_like_a_new_one(name):
    listener = Listener(STEADY, lambda i, *_: REFUSED[name](i) and None)
    listener.fly(1.0)
    assert listener.fly(0.5)[0] == ERROR
    assert listener.reset() == OK
    listener.update = None
    listener.read.clear()
    assert listener.initialise() == OK
    listener.fly(1.0)
    assert listener.read == stopped(QUARTERS)
    listener.free()


def test_an_unknown_reference_read_within_a_step_ends_it_as_an_error():
    def update(listener: Listener, *_: Any) -> None:
        array, value = (c_uint * 1)(4000), (c_double * 1)()
        listener.fmu._functions["fmi3GetFloat64"](listener.fmu.component, array, 1, value, 1)

    listener = Listener(STEADY, update)
    assert listener.fly(1.0)[0] == ERROR
    [message] = listener.messages()
    assert message.startswith("fmi3GetFloat64: value reference 4000 is unknown")
    listener.free()


@pytest.mark.parametrize("then", ["fmi3Reset", "fmi3SetFMUState"])
def test_an_instance_is_not_revived_within_the_step_that_an_error_ended(then):
    saved: list[Any] = []

    def update(listener: Listener, *_: Any) -> None:
        assert listener.set({"torque[1]": 1.0}) == ERROR
        if then == "fmi3Reset":
            listener._status(listener.fmu.reset)
        else:
            listener._status(listener.fmu.setFMUState, saved[0])

    listener = Listener(STEADY, update)
    saved.append(listener.fmu.getFMUState())
    assert listener.fly(1.0)[0] == ERROR
    assert len(listener.times) == 1
    listener.fmu.freeFMUState(saved[0])
    listener.free()


def test_messages_after_an_update_name_the_step():
    # From rest the torque needs more sub-steps than are taken, which shows after some of them.
    listener = Listener(body(max_angle_step=0.5))
    listener.set({"torque": [0.0, 0.0, 2.5e6]})
    assert listener.fly(4e3)[0] == DISCARD
    assert len(listener.times) > 1
    [message] = listener.messages()
    assert message.startswith("fmi3DoStep: communicationStepSize = 4000 s")
    listener.free()


def test_a_step_discarded_after_updates_leaves_everything_as_it_was():
    listener = Listener(body(max_angle_step=0.5))
    listener.set({"torque": [0.0, 0.0, 2.5e6]})
    before = [listener.get("time"), *outputs(listener)]
    assert listener.fly(4e3) == (DISCARD, False, 0.0)
    assert [listener.get("time"), *outputs(listener)] == before
    listener.free()


# Instantiation.


def instantiate(instance: Instance, references: list[int] | None, count: int) -> tuple[int | None, list[str]]:
    """Instantiates with required intermediate variables; returns the instance, freed, and the log."""
    log: list[str] = []
    logger = fmi3LogMessageCallback(lambda _, status, category, text: log.append(text.decode()))
    update = fmi3IntermediateUpdateCallback(lambda *_: None)
    array = None if references is None else (c_uint * max(len(references), 1))(*references)
    functions = instance.fmu._functions
    component = functions["fmi3InstantiateCoSimulation"](
        b"it",
        instance.fmu.guid.encode(),
        None,
        False,
        True,
        False,
        True,
        array,
        c_size_t(count),
        None,
        logger,
        update,
    )
    if component:
        functions["fmi3FreeInstance"](component)
    return component, log


def test_required_intermediate_variables_may_be_any_outputs():
    instance = Instance(STEADY)
    references = [instance.references[name] for name in output_names(instance)]
    component, log = instantiate(instance, references, len(references))
    assert component
    assert log == []
    instance.free()


@pytest.mark.parametrize(
    "name", ["time", "torque[1]", "attitude_start[1]", "state.attitude[1]", "der(state.attitude[1])", None]
)
def test_a_required_intermediate_variable_that_is_no_output_gives_no_instance_and_one_line(name):
    instance = Instance(STEADY)
    reference = 4000 if name is None else instance.references[name]
    component, log = instantiate(instance, [instance.references["mass"], reference], 2)
    assert component is None
    [message] = log
    assert "requiredIntermediateVariables" in message
    instance.free()


def test_required_intermediate_variables_that_are_null_give_no_instance_and_one_line():
    instance = Instance(STEADY)
    component, log = instantiate(instance, None, 1)
    assert component is None
    [message] = log
    assert "requiredIntermediateVariables is NULL" in message
    instance.free()


def test_the_model_description_marks_exactly_the_outputs_for_intermediate_update():
    instance = Instance(STEADY)
    root = ElementTree.parse(Path(instance.fmu.unzipDirectory) / "modelDescription.xml").getroot()
    marked = [v.get("name") for v in root.iter("Float64") if v.get("intermediateUpdate") == "true"]
    assert marked == output_names(instance)
    assert instance.description.coSimulation.providesIntermediateUpdate
    assert instance.description.coSimulation.canReturnEarlyAfterIntermediateUpdate
    instance.free()
