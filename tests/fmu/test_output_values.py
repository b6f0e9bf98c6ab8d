"""Outputs follow from inputs and state at any time; the attitude at the start is normalised."""

import math
from fractions import Fraction

import numpy as np
import pytest

from fmu.programmes import SEED, SPINNING, expected, outputs
from support import (
    COMPOSITE_TOLERANCE,
    DISCARD,
    ERROR,
    ISS_DG,
    OK,
    UNIT_TOLERANCE,
    Instance,
    body,
    draw_inputs,
    flying,
    relative_error,
    variant,
)
from support.marks import FMI


@pytest.mark.parametrize("read", ["initialising", "stepping"])
@pytest.mark.parametrize("set_", ["instantiated", "initialising"])
@pytest.mark.parametrize("seed", range(SEED, SEED + 3))
@FMI
def test_outputs_at_the_start_follow_from_what_was_set(fmi, seed, set_, read):
    generator = np.random.default_rng(seed)
    values = draw_inputs(generator) | {
        "angular_velocity_start": generator.normal(size=3),
        "attitude_start": generator.normal(size=4) * 10.0,
    }
    instance = Instance(ISS_DG, fmi)
    if set_ == "instantiated":
        assert instance.set(values) == OK
    instance.enter()
    if set_ == "initialising":
        outputs(instance)  # what has been computed by now must not stay
        assert instance.set(values) == OK
    if read == "stepping":
        assert instance.exit() == OK
    errors = {
        name: relative_error(instance.get(name), truth) for name, truth in expected(ISS_DG, values).items()
    }
    instance.free()
    assert max(errors.values()) <= COMPOSITE_TOLERANCE, errors


@FMI
def test_outputs_between_steps_follow_from_inputs_and_state(fmi):
    values = draw_inputs(np.random.default_rng(SEED))
    with flying(SPINNING, fmi) as instance:
        assert instance.step(10.0) == OK
        assert instance.set(values) == OK
        state = {f"{name}_start": instance.get(name) for name in ("angular_velocity", "attitude")}
        errors = {
            name: relative_error(instance.get(name), truth)
            for name, truth in expected(SPINNING, values | state).items()
        }
    assert max(errors.values()) <= COMPOSITE_TOLERANCE, errors


@pytest.mark.parametrize("first", ["attitude", "kinetic_energy", "mass"])
@FMI
def test_outputs_follow_from_inputs_whichever_is_read_first(fmi, first):
    with flying(SPINNING, fmi) as instance, flying(SPINNING, fmi) as other:
        for change in (20000.0, 15000.0):
            instance.set({"DG.mass": change})
            instance.get(first)
            other.set({"DG.mass": change})
            assert outputs(instance) == outputs(other)
        assert instance.get("mass") == 470000.0


@FMI
def test_a_change_of_mass_or_pose_keeps_angular_velocity_and_attitude(fmi):
    steady = variant(SPINNING, {"rotation.pose_change": "rate"})
    with flying(steady, fmi) as instance:
        instance.step(10.0)
        names = "angular_velocity", "attitude", "state.angular_velocity", "state.attitude"
        before = [x for name in names for x in instance.get(name)]
        instance.set(draw_inputs(np.random.default_rng(SEED)))
        assert [x for name in names for x in instance.get(name)] == before


@FMI
def test_the_rate_is_the_state_and_the_attitude_is_the_state_at_unit_length(fmi):
    with flying(SPINNING, fmi) as instance:
        for _ in range(100):
            instance.step(0.5)
            assert list(instance.get("angular_velocity")) == list(instance.get("state.angular_velocity"))
            # The state is at unit length within rounding: once more changes it by no more than that.
            assert np.abs(instance.get("attitude") - instance.get("state.attitude")).max() <= UNIT_TOLERANCE


@pytest.mark.parametrize(
    "attitude",
    [
        [1.0, 2.0, 3.0, 4.0],
        [-1e-3, 2e-3, 0.0, 5e-4],
        [1e300, -1e300, 1.7e308, 1e290],
        [3e-300, 1e-300, 0.0, -2e-300],
        [0.0, 5e-324, 0.0, 0.0],
        [1e-320, 3e-320, -2e-320, 7e-321],
        [1.0, 1e-300, 0.0, 0.0],
    ],
    ids=str,
)
@FMI
def test_an_attitude_at_the_start_of_any_length_is_normalised(fmi, attitude):
    exact = [Fraction(x) for x in attitude]
    scale = max(map(abs, exact))
    scaled = [x / scale for x in exact]
    square = sum(x * x for x in scaled)
    with flying(body(), fmi, attitude_start=attitude) as instance:
        found = instance.get("attitude")
    for q, x in zip(found, scaled, strict=True):
        # Compared by squares, whose relative error is twice as large.
        assert abs(Fraction(float(q)) ** 2 - x * x / square) <= Fraction(2 * UNIT_TOLERANCE) * x * x / square
        assert q * x >= 0


def test_an_attitude_of_length_zero_is_refused_at_the_end_of_initialisation_and_can_be_corrected():
    instance = Instance(body(), 3)
    instance.enter()
    assert instance.set({"attitude_start": [0.0, 0.0, 0.0, 0.0]}) == OK
    assert instance.exit() == DISCARD
    assert "attitude_start = (0, 0, 0, 0): must have a length greater than 0" in instance.messages()[-1]
    assert instance.set({"attitude_start[3]": -2.0}) == OK
    assert instance.exit() == OK
    assert list(instance.get("attitude")) == [0.0, 0.0, -1.0, 0.0]
    instance.free()


def test_an_attitude_of_length_zero_ends_an_instance_of_fmi_2_until_it_is_reset():
    instance = Instance(body(), 2)
    instance.enter()
    assert instance.set({"attitude_start": [0.0, 0.0, 0.0, 0.0]}) == OK
    assert instance.exit() == ERROR
    assert "attitude_start = (0, 0, 0, 0): must have a length greater than 0" in instance.messages()[-1]
    assert instance.reset() == OK
    assert instance.initialise() == OK
    instance.free()


@FMI
def test_the_attitude_stays_at_unit_length_over_a_hundred_thousand_steps(fmi):
    worst = 0.0
    with flying(body(), fmi, angular_velocity_start=[0.3, 0.2, -0.25]) as instance:
        for i in range(100_000):
            instance.step(0.1)
            if i % 10 == 0:
                for name in ("attitude", "state.attitude"):
                    worst = max(worst, abs(math.sqrt(math.fsum(q * q for q in instance.get(name))) - 1.0))
    assert worst <= UNIT_TOLERANCE


@FMI
def test_inputs_are_read_back_as_set(fmi):
    values = draw_inputs(np.random.default_rng(SEED))
    with flying(ISS_DG, fmi) as instance:
        instance.set(values)
        for _ in range(2):
            assert all(np.array_equal(instance.get(name), value) for name, value in values.items())
            instance.step(0.1)


@FMI
def test_reading_in_one_call_gives_what_single_calls_give_in_any_order(fmi):
    with flying(SPINNING, fmi) as instance:
        instance.step(1.0)
        references = list(instance.references.values())
        getter = instance.fmu.getFloat64 if fmi == 3 else instance.fmu.getReal
        single = {r: getter([r])[0] for r in references}
        shuffled = [int(r) for r in np.random.default_rng(SEED).permutation(references * 2)]
        assert getter(shuffled) == [single[r] for r in shuffled]


@FMI
def test_outputs_can_be_read_after_termination(fmi):
    with flying(SPINNING, fmi) as instance:
        instance.step(1.0)
        before = outputs(instance)
        assert instance._status(instance.fmu.terminate) == OK
        assert outputs(instance) == before
