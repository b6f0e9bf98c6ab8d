"""Steps that a propagator cannot take, and motions at the ends of the range of doubles."""

import math

import numpy as np
import pytest

from fmu.flights import EVERY, FREE, angle, assembly, error, fly, state
from support import DISCARD, INF, OK, Instance, U, body, flying
from support.marks import FMI


def refused(instance: Instance, h: float, *texts: str) -> None:
    """Checks that a step is discarded with one line that holds some texts, everything being kept."""
    instance.log.clear()
    before = instance.get("time"), *state(instance)
    assert instance.step(h) == DISCARD
    [message] = instance.messages()
    for text in texts:
        assert text in message, message
    assert (instance.get("time"), *state(instance)) == before


def test_split_discards_a_step_that_needs_too_many_and_takes_a_shorter_one():
    with flying(assembly("split")) as instance, flying(assembly("split")) as straight:
        for it in (instance, straight):
            assert it.set({"torque": [1e9, 0.0, 0.0]}) == OK
        refused(
            instance,
            1e4,
            "communicationStepSize = 10000 s needs",
            "sub-steps",
            "angular_velocity = (0.05, -0.08, 0.11)",
        )
        for it in (instance, straight):
            fly(it, 1e-4)
        assert instance.bits() == straight.bits()


REFUSED = "turns the body by {} rad; it is followed for 2e+09 rad in a step"


@pytest.mark.parametrize("propagator", [*FREE, "split"])
def test_free_motion_beyond_its_reach_is_discarded_with_the_numbers(propagator):
    rates = {"angular_velocity_start": [1e6, 2e5, -3e5]}
    with flying(assembly(propagator), **rates) as instance, flying(assembly(propagator), **rates) as straight:
        refused(
            instance,
            1e5,
            "free motion over 100000 s with angular_velocity = (1000000, 200000, -300000) rad/s",
            REFUSED.format("1.06e+11"),
        )
        for it in (instance, straight):
            fly(it, 1e-3, 7)
        refused(instance, 1e5, "rad/s")
        for it in (instance, straight):  # from the same epoch
            fly(it, 1e-3, 7)
        assert instance.bits() == straight.bits()


@FMI
@pytest.mark.parametrize("propagator", [*FREE, "split"])
def test_a_steady_spin_has_the_same_reach(propagator, fmi):
    """It needs no doublings: digits are all that is lost."""
    raw = body(pmi=(2.0, 2.0, 2.0), propagator=propagator, angular_velocity=[0.0, 0.0, 1e6])
    reach, turned = 2000.0, 0.0
    with flying(raw, fmi) as instance:
        for h in (1500.0, 1500.0, reach):  # each begins a new epoch
            refused(instance, math.nextafter(reach, INF), "2000 s", REFUSED.format("2e+09"))
            fly(instance, h)
            turned += 1e6 * h
            # of q and -q the one with the sign of the truth: half the angle is a double
            end = math.cos(turned / 2), 0.0, 0.0, math.sin(turned / 2)
            assert np.abs(instance.get("attitude") - end).max() <= 8 * U * turned
        refused(instance, 1e300, REFUSED.format("1e+306"))


@pytest.mark.parametrize("propagator", ["rk4", "dop853", "taylor"])
@pytest.mark.parametrize("rate", [1e150, 1e300])
def test_stepping_methods_discard_absurd_rates(propagator, rate):
    with flying(assembly(propagator), angular_velocity_start=[rate, -rate, rate]) as instance:
        refused(instance, 1.0, f"{rate:g}")


@pytest.mark.parametrize("propagator", FREE)
def test_free_motion_scales_to_the_ends_of_doubles(propagator):
    with flying(assembly(propagator), angular_velocity_start=[1e150, -2e150, 5e149]) as instance:
        x, J = state(instance), instance.get("inertia")
        fly(instance, 1e-150)
        off = error(state(instance), ("tensor", J), x, (0.0, 0.0, 0.0), 1e-150)
        assert off.max() <= 8 * U * (1 + angle(x, 1e-150))


@EVERY
@pytest.mark.parametrize("rate", [0.0, 5e-324, 1e-310, 1e-160])
def test_rest_and_denormal_rates_fly(propagator, rate):
    rates = [rate, -2 * rate, 3 * rate]
    with flying(assembly(propagator), angular_velocity_start=rates) as instance:
        attitude = instance.get("attitude")
        fly(instance, 0.1, 3)
        fly(instance, 1e3)
        x = state(instance)
        # steady but for half an ulp and half a denormal each; no turn that shows
        assert np.abs(x[4:] - rates).max() <= 16 * U * 3 * rate + 8 * 5e-324
        assert np.abs(x[:4] - attitude).max() <= 8 * U
        if propagator != "exact":
            assert instance.set({"torque": [1e-300, 0.0, 0.0]}) == OK
            fly(instance, 1.0)
        assert np.isfinite(state(instance)).all()
