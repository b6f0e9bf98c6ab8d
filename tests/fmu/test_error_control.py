"""The tolerance of the scene and of the importer, and the error estimate as an output."""

from ctypes import c_double

import numpy as np
import pytest

from fmu.flights import (
    ASSEMBLY_2,
    EVERY,
    FREE,
    MUCH,
    SPAN,
    TORQUE,
    WEAK_TORQUE,
    assembly,
    enter,
    error,
    fly,
    slender,
    slender_tensor,
    state,
    tilted,
    tolerant,
)
from supervessel.rotation.propagators import plan_of
from support import ERROR, INF, NAN, OK, Instance, U, flying, scene, variant
from support.marks import FMI, some_at_once
from support.series import flight, norm


@pytest.mark.parametrize(
    ("propagator", "tolerance"),
    [(p, t) for p in ("dop853", "taylor", "auto", "split") for t in (1e-3, 1e-6, 1e-12)],
)
def test_the_tolerance_asked_for_is_met_and_the_estimate_is_honest(propagator, tolerance):
    torque = (MUCH if propagator != "split" else 1.0) * np.array(WEAK_TORQUE)
    span = SPAN if propagator != "split" or tolerance > 1e-9 else 1.0
    with tolerant(assembly(propagator), tolerance) as instance:
        assert instance.set({"torque": torque}) == OK
        x, J = state(instance), instance.get("inertia")
        fly(instance, span)
        off = error(state(instance), ("tensor", J), x, torque, span)
        # what rounding adds, in the hundred sub-steps that 1e-12 takes at most
        rounding = 100 * 8 * U
        assert off.max() <= tolerance + rounding
        estimate = instance.get("error_estimate")
        assert off[0] <= 3.0 * estimate + rounding
        # estimates are too large, by a factor that the method states: their sum may exceed the tolerance
        method = plan_of(scene(assembly(propagator))).method
        assert method is not None
        assert 0.0 < estimate <= method.safety * tolerance + rounding


# A tolerance of the importer's.


@FMI
def test_the_importers_tolerance_overrides_the_scenes(fmi):
    raw = tilted("dop853")
    errors = []
    for tolerance in (None, 1e-3, 1e-13):
        with flying(raw, fmi) if tolerance is None else tolerant(raw, tolerance, fmi) as instance:
            x, J = state(instance), instance.get("inertia")
            fly(instance, SPAN)
            errors.append(error(state(instance), ("tensor", J), x, (0.0, 0.0, 0.0), SPAN)[0])
    of_scene, loose, tight = errors
    assert tight < of_scene < loose
    assert loose > 1e-9  # the scene's, so that it was not in force
    assert tight <= 1e-13 + 100 * 8 * U


@pytest.mark.parametrize("tolerance", [-1e-6, NAN, INF])
@FMI
def test_a_tolerance_that_is_none_is_an_error(fmi, tolerance):
    instance = Instance(tilted("dop853"), fmi)
    assert enter(instance, tolerance) == ERROR
    [message] = instance.messages()
    assert f"tolerance = {tolerance:.10g}: must be finite and >= 0" in message
    assert instance.reset() == OK
    assert enter(instance, 1e-15) == OK
    instance.free()


@pytest.mark.parametrize(
    ("tolerance", "taken"), [(0.0, 1e-15), (1e-20, 1e-15), (1.0, 0.1), (1e-15, 1e-15), (0.1, 0.1)]
)
@FMI
def test_of_a_tolerance_that_steps_cannot_keep_to_the_nearest_is_taken_and_told(fmi, tolerance, taken):
    ends = []
    for asked in (tolerance, taken):
        with tolerant(tilted("dop853"), asked, fmi) as instance:
            fly(instance, SPAN)
            ends.append(instance.bits())
            told = [
                (status, message) for status, category, message in instance.log if category == "logTolerance"
            ]
            function = "fmi3EnterInitializationMode" if fmi == 3 else "fmi2SetupExperiment"
            line = (
                f"{function}: tolerance = {asked:.10g}: {taken:g} is taken, since steps keep to 1e-15 to 0.1"
            )
            assert told == ([] if asked == taken else [(OK, line)])
    assert ends[0] == ends[1]


def test_a_tolerance_that_nothing_here_keeps_to_is_left_unread():
    """FMI 2.0, 2.1.6: co-simulation might ignore it; in model exchange the solver is the importer's."""
    for raw, exchange in ((tilted("dop853"), True), (tilted("rk4"), False)):
        instance = Instance(raw, 3, exchange=exchange)
        assert enter(instance, -1.0) == OK
        assert instance.log == []
        instance.free()


@FMI
def test_reset_forgets_the_importers_tolerance(fmi):
    ends = []
    instance = Instance(tilted("dop853"), fmi)
    for tolerance in (None, 1e-3, None):
        assert (instance.enter() if tolerance is None else enter(instance, tolerance)) == OK
        assert instance.exit() == OK
        instance.time = 0.0
        fly(instance, SPAN)
        ends.append(instance.bits())
        assert instance.reset() == OK
    instance.free()
    assert ends[0] == ends[2] != ends[1]


# The error estimate as an output.


@EVERY
def test_the_estimate_is_zero_at_first_positive_after_a_step_and_part_of_a_state(propagator):
    with flying(assembly(propagator)) as instance:
        assert instance.get("error_estimate") == 0.0
        if propagator not in FREE:
            assert instance.set({"torque": WEAK_TORQUE}) == OK
        fly(instance, 10.0)
        estimate = instance.get("error_estimate")
        assert 0.0 < estimate < 1e-9
        saved = instance.fmu.getFMUState()
        fly(instance, 0.3)
        assert instance.get("error_estimate") != estimate
        instance.fmu.setFMUState(saved)
        instance.fmu.freeFMUState(saved)
        assert instance.get("error_estimate") == estimate
        assert instance.reset() == OK
        assert instance.initialise() == OK
        assert instance.get("error_estimate") == 0.0


@FMI
def test_the_estimate_is_zero_in_model_exchange(fmi):
    instance = Instance(assembly("exact") if fmi == 3 else ASSEMBLY_2, fmi, exchange=True)
    assert instance.initialise() == OK
    assert instance.run() == OK
    states = (c_double * 7)(1.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0)
    assert instance._status(instance.fmu.setContinuousStates, states, 7) == OK
    assert instance.get("error_estimate") == 0.0
    instance.free()


@pytest.mark.parametrize("propagator", ["rk4", "taylor", "exact", "auto"])
@pytest.mark.parametrize("thin", some_at_once([1e-3, 1e-6, 1e-9, 1e-12], 1e-9))
def test_the_estimate_knows_what_rounding_of_the_tensor_comes_to(propagator, thin):
    """A slender vessel docked askew: its least moment drowns in the rounding of the largest."""
    with flying(slender(thin, propagator)) as instance:
        x = state(instance)
        fly(instance, 1.0)
        end = flight("tensor", slender_tensor(thin), x, [0.0] * 3, 1.0, digits=40)
        off = float(2 * norm([float(a) - b for a, b in zip(state(instance), end, strict=True)][:4]))
        assert off <= instance.get("error_estimate") <= 1e3 * (off + 8 * U)


@pytest.mark.parametrize("h", [0.5, 0.25, 0.125, 0.0625])
def test_the_estimate_of_a_runge_kutta_step_is_its_error(h):
    """One sub-step: the half step being the small number, further terms are some tenths of the first."""
    raw = variant(assembly("rk4"), {"rotation.max_angle_step": 1.0})
    with flying(raw) as instance:
        assert instance.set({"torque": TORQUE}) == OK
        x, J = state(instance), instance.get("inertia")
        fly(instance, h)
        off = error(state(instance), ("tensor", J), x, TORQUE, h)[0]
        assert off > 20 * U
        assert 0.8 * off - 8 * U <= instance.get("error_estimate") <= 1.25 * off + 8 * U
