"""Free motion in the FMU is counted from its epoch: long flights, saved states, changes of inputs."""

import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from fmu.flights import FREE, TORQUE, angle, assembly, error, fly, state, tilted
from fmu.saved_states import bytes_of
from supervessel.equations import equations, p_start
from support import DISCARD, OK, Instance, U, flying, refusal, scene
from support.marks import FMI


@pytest.mark.parametrize("propagator", FREE)
def test_a_thousand_steps_are_as_right_as_one(propagator):
    with flying(assembly(propagator)) as many, flying(assembly(propagator)) as one:
        x, J = state(many), many.get("inertia")
        fly(many, 0.1, 1000)
        fly(one, 100.0)
        ends = state(many), state(one)
        # a thousand times the double next to 0.1 is half an ulp off 100
        spans = float(1000 * Fraction(0.1)), 100.0
        for end, span in zip(ends, spans, strict=True):
            assert error(end, ("tensor", J), x, (0.0, 0.0, 0.0), span).max() <= 8 * U * (1 + angle(x, 100.0))
        assert np.abs(ends[0] - ends[1]).max() <= 4 * U * (1 + angle(x, 100.0))


def test_steps_that_add_up_exactly_give_the_bits_of_two():
    """The first one goes by doublings, all others by theta functions, from the epoch each."""
    with flying(assembly("exact")) as many, flying(assembly("exact")) as two:
        fly(many, 0.125, 800)
        fly(two, 50.0, 2)
        assert state(many).tolist() == state(two).tolist()


TINY_STEP = 1e-9  # 69 ulps of 1e5: rounded, each would be 0.4 % off


def test_tiny_steps_late_in_a_flight_are_not_lost():
    with flying(tilted("exact", "none"), angular_velocity_start=[0.0, 0.0, 1.0]) as instance:
        x = state(instance)
        fly(instance, 1e5)
        before = state(instance)
        fly(instance, TINY_STEP, 1000)
        end = state(instance)
    # of the elapsed time as a double, and of the angle of 1e5 rad: before and after
    rounding = 2 * (np.spacing(1e5) + 2 * U * 1e5)
    advanced = 2.0 * np.linalg.norm(end[:4] - before[:4])
    assert rounding < 1e-4 * 1000 * TINY_STEP
    assert abs(advanced - 1000 * TINY_STEP) <= rounding
    span = float(100000 + 1000 * Fraction(TINY_STEP))
    half = 0.5 * span  # about the third axis: the truth needs no series
    q = [x[0] * math.cos(half) - x[3] * math.sin(half), x[3] * math.cos(half) + x[0] * math.sin(half)]
    assert abs(end[0] - q[0]) + abs(end[3] - q[1]) <= rounding


@pytest.mark.parametrize("count", [1, 2, 77])
@pytest.mark.parametrize("propagator", FREE)
@FMI
def test_the_epoch_is_part_of_a_saved_state(fmi, propagator, count):
    raw = assembly(propagator) if fmi == 3 else tilted("exact")
    with flying(raw, fmi) as instance:
        fly(instance, 0.1, count)
        saved = instance.fmu.getFMUState()
        content, time = bytes_of(instance), instance.time
        fly(instance, 0.1, 50)
        end = instance.bits()
        instance.fmu.setFMUState(saved)
        instance.fmu.freeFMUState(saved)
        instance.time = time
        fly(instance, 0.1, 50)
        assert instance.bits() == end
    other = Instance(raw, fmi)
    restored = other.fmu.deserializeFMUState(content)
    other.fmu.setFMUState(restored)
    other.fmu.freeFMUState(restored)
    other.time = time
    fly(other, 0.1, 50)
    assert other.bits() == end
    other.free()


def constants_of(instance: Instance, raw: dict[str, Any]) -> bytes:
    """Returns what theta functions need of a state as the epoch, by the functions that C is made of."""
    model, x = equations(scene(raw)), state(instance)
    [function] = [f for f in model.steps.propagation if f.name() == "free_constants"]
    a = np.array(model.axes(model.composite(p_start(scene(raw))))).ravel()
    where = model.slices.axes["free"].start
    a[where : where + 3] /= 2.0 ** math.frexp(a[where + 2])[1]
    unit = 2.0 ** math.frexp(np.abs(x[4:]).max())[1]
    return np.array(function(np.r_[x[:4], x[4:] / unit], a, unit)).tobytes()


def test_constants_of_an_epoch_are_found_by_the_second_step_from_it_alone():
    """A torque that changes at every step or every other pays for none."""
    raw = tilted("auto")
    with flying(raw) as instance:
        for torque in (0.0, 1e-5, 0.0, 2e-5, 3e-5, 0.0):
            assert instance.set({"torque": [torque, 0.0, 0.0]}) == OK
            found = constants_of(instance, raw)
            fly(instance, 0.1)
            assert found not in bytes_of(instance)
        fly(instance, 0.1)
        assert found in bytes_of(instance)


def test_a_flight_from_the_same_state_without_its_epoch_has_other_bits():
    """The control for what these tests compare: they can tell an epoch from none."""
    with flying(tilted("exact")) as instance:
        fly(instance, 0.1, 77)
        x = state(instance)
        fly(instance, 0.1, 50)
        end = state(instance)
    with flying(tilted("exact"), attitude_start=x[:4], angular_velocity_start=x[4:]) as other:
        fly(other, 0.1, 50)
        assert 0.0 < np.abs(state(other) - end).max() < 1e-13


@pytest.mark.parametrize("propagator", FREE)
def test_reset_forgets_the_epoch(propagator):
    turned = {"attitude_start": [0.0, 0.0, 1.0, 0.0], "angular_velocity_start": [0.2, 0.1, -0.1]}
    with flying(assembly(propagator)) as instance, flying(assembly(propagator), **turned) as new:
        fly(instance, 0.1, 30)
        assert instance.reset() == OK
        assert instance.initialise(**turned) == OK
        for it in (instance, new):
            fly(it, 0.1, 30)
        assert instance.bits() == new.bits()


def change_nothing(instance: Instance) -> None:
    """Sets values and takes them back, as an importer does that tries what it does not use."""
    torque, mass = instance.get("torque"), instance.get("DG.mass")
    assert instance.set({"torque": [5.0, 5.0, 5.0], "DG.mass": 0.5 * mass}) == OK
    assert instance.set({"torque": torque, "DG.mass": mass}) == OK
    assert instance.set({"torque[1]": -0.0}) == OK


@pytest.mark.parametrize("propagator", FREE)
def test_values_set_there_and_back_between_steps_leave_the_flight_as_it_was(propagator):
    with flying(assembly(propagator)) as straight, flying(assembly(propagator)) as restless:
        for _ in range(60):
            change_nothing(restless)
            for instance in (straight, restless):
                fly(instance, 0.1)
        restless.set({"torque[1]": 0.0})
        assert restless.bits() == straight.bits()


@pytest.mark.parametrize("propagator", FREE)
def test_values_read_while_they_were_other_leave_the_flight_as_it_was(propagator):
    with flying(assembly(propagator)) as straight, flying(assembly(propagator)) as read:
        mass = read.get("DG.mass")
        for _ in range(60):
            assert read.set({"DG.mass": 0.5 * mass}) == OK
            read.get("principal_moments")
            assert read.set({"DG.mass": mass}) == OK
            for instance in (straight, read):
                fly(instance, 0.1)
        assert read.bits() == straight.bits()


@pytest.mark.parametrize(
    ("propagator", "what"), [("exact", "DG.mass"), ("auto", "DG.mass"), ("auto", "torque")]
)
def test_free_motion_after_a_change_begins_a_new_epoch(propagator, what):
    """After a step under torque or with another mass, and back, further steps count from there."""
    with flying(assembly(propagator)) as instance:
        fly(instance, 0.25, 10)
        before = state(instance)
        assert instance.set({"torque": TORQUE} if what == "torque" else {"DG.mass": 11000.0}) == OK
        fly(instance, 0.25)
        if what == "torque":
            assert instance.set({"torque": [0.0, 0.0, 0.0]}) == OK
            assert np.linalg.norm(state(instance)[4:] - before[4:]) > 1e-4
        x, J = state(instance), instance.get("inertia")
        saved, time = instance.fmu.getFMUState(), instance.time
        ends = []
        for h, count in ((0.25, 64), (8.0, 2)):
            instance.fmu.setFMUState(saved)
            instance.time = time
            fly(instance, h, count)
            ends.append(state(instance))
        instance.fmu.freeFMUState(saved)
    for end in ends:
        assert error(end, ("tensor", J), x, (0.0, 0.0, 0.0), 16.0).max() <= 8 * U * (1 + angle(x, 16.0))
    # under another mass the epoch is one step older than x
    if what == "torque":
        assert ends[0].tolist() == ends[1].tolist()


@FMI
def test_exact_discards_torque_with_its_value_and_goes_on_without(fmi):
    raw = assembly("exact") if fmi == 3 else tilted("exact")
    with flying(raw, fmi) as instance, flying(raw, fmi) as straight:
        for it in (instance, straight):
            fly(it, 0.1, 5)
        assert instance.set({"torque": [0.0, -2.5, 1e-300]}) == OK
        before = instance.bits()
        assert instance.step(0.1) == refusal(fmi)
        [message] = instance.messages()
        assert "torque = (0, -2.5, 1e-300) N.m: must be 0 for the propagator exact" in message
        assert instance.bits() == before
        assert instance.set({"torque": [0.0, 0.0, 0.0]}) == OK
        for it in (instance, straight):
            fly(it, 0.1, 5)
        assert instance.bits() == straight.bits()


def test_a_step_under_torque_that_is_discarded_leaves_the_epoch():
    with flying(assembly("auto")) as instance, flying(assembly("auto")) as straight:
        for it in (instance, straight):
            fly(it, 0.1, 30)
        assert instance.set({"torque": [1e200, 0.0, 0.0]}) == OK
        assert instance.step(1.0) == DISCARD
        assert instance.set({"torque": [0.0, 0.0, 0.0]}) == OK
        for it in (instance, straight):
            fly(it, 0.1, 30)
        assert instance.bits() == straight.bits()
