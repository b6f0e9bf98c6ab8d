"""`error_bound` is never below the true error: flights against the numpy reference by SciPy's DOP853.

The truth is the motion of the law "tensor" with the same inputs. What the methods add is proven where their
sub-steps are short enough, which those of `rk4` and `taylor` here are but for long turns; of `dop853` mostly,
and of `split` always, it is the method's own estimate: for these the tests are a measurement.
"""

from collections.abc import Iterator
from math import pi
from typing import Any

import numpy as np
import pytest

from changes.histories import ByReference, Values, elements
from changes.scenes import drawn_in
from fmu.bounds import CONTACT, apart, showing, truth_of, tug
from support import OK, Array, Instance, unpacked, variant
from support.costs import station

TRUTH = 1e-9
"""rad: SciPy at rtol 1e-13 over a dozen flights of some radians (changes.histories.FLIGHT_ERROR each), grown
by exp(2) at most, as a flight's own error is."""

LENGTH, STEPS = 0.6, (6, 1)
"""s, and into how many communication steps a span with steady inputs is divided."""


def without_motion(law: str, propagator: str, **rotation: Any) -> dict[str, Any]:
    raw = variant(tug(law, propagator, **rotation), {"inputs.motion": []})
    if propagator == "exact":
        raw["inputs"]["torque"] = False
    return raw


FLOWN = {
    "none, rk4": tug("none"),
    "none, rk4, masses keep momentum": tug("none", mass="momentum", pose="rate"),
    "principal, rk4": tug("principal", mass="momentum"),
    "decoupled, taylor": without_motion("decoupled", "taylor"),
    "principal, dop853": tug("principal", "dop853"),
    "principal, split": without_motion("principal", "split"),
    "principal, auto": without_motion("principal", "auto", pose="rate"),
    "principal, exact": without_motion("principal", "exact"),
}


def happenings(raw: dict[str, Any], seed: int) -> Iterator[Values]:
    """Yields inputs that jump: torque, mass, moments, pose, and docks that open and close."""
    random = np.random.default_rng(seed)
    tied = True
    for _ in range(4):
        push = elements("torque", random.normal(size=3) * 40.0) if raw["inputs"]["torque"] else {}
        changed = drawn_in(random.uniform(0.0, 4.0)) if random.random() < 0.6 else {}
        changed = {name: value for name, value in changed.items() if not name.startswith("torque")}
        if random.random() < 0.5:
            changed["tank.mass"] = 400.0 * random.uniform(0.5, 1.5)
        if random.random() < 0.5:
            squares = random.uniform(0.1, 0.5, size=3)
            changed |= elements("tank.pmi", squares.sum() - squares)
        if random.random() < 0.5:
            tied = not tied
            changed["held.docked"] = float(tied)
        yield push | changed


def set_off(raw: dict[str, Any], instance: Instance, seed: int) -> ByReference:
    """Starts both flights with a rate of their own; returns the true one."""
    rate: Array = np.random.default_rng(seed).normal(size=3) * 0.15
    assert instance.reset() == OK
    assert instance.initialise(angular_velocity_start=rate) == OK, instance.log
    truth = truth_of(raw)
    truth.angular_velocity = rate
    return truth


@pytest.mark.parametrize("raw", FLOWN.values(), ids=FLOWN)
def test_the_true_motion_is_within_it_through_jumps(raw):
    instance, told = Instance(raw, optimised=False), []
    for seed, steps in ((1, STEPS[0]), (2, STEPS[1]), (3, STEPS[0])):
        truth = set_off(raw, instance, seed)
        for inputs in happenings(raw, seed):
            assert instance.set(inputs) == OK
            truth.set(inputs)
            for _ in range(steps):
                assert instance.step(LENGTH / steps) == OK, instance.log
            truth.fly(LENGTH)
            bound = instance.get("error_bound")
            assert apart(instance.get("attitude"), truth.attitude) <= bound + TRUTH
            told.append(bound)
    instance.free()
    assert sum(bound < pi for bound in told) > len(told) / 2  # where it is pi nothing was tested
    assert max(told) > TRUTH


def test_a_bound_a_tenth_as_large_would_not_hold():
    """The flights above tell a bound from less than one."""
    raw = FLOWN["principal, rk4"]
    instance = Instance(raw, optimised=False)
    truth = set_off(raw, instance, 1)
    for _ in range(10):
        assert instance.step(0.1) == OK
    truth.fly(1.0)
    found, bound = apart(instance.get("attitude"), truth.attitude), instance.get("error_bound")
    instance.free()
    assert 0.1 * bound < found <= bound


def test_docks_that_close_in_motion_are_followed():
    raw = FLOWN["principal, rk4"]
    instance = Instance(raw, optimised=False)
    truth = set_off(raw, instance, 4)
    for inputs in ({"held.docked": 0.0}, {"stowed.docked": 1.0} | CONTACT, {"stowed.docked": 0.0}):
        assert instance.set(inputs) == OK
        truth.set(inputs)
        for _ in range(4):
            assert instance.step(0.05) == OK
        truth.fly(0.2)
        assert apart(instance.get("attitude"), truth.attitude) <= instance.get("error_bound") + TRUTH
    assert TRUTH < instance.get("error_bound") < pi
    instance.free()


@pytest.mark.parametrize("inputs", [{"stowed.docked": 1.0} | CONTACT], ids=["closing in motion"])
def test_under_none_what_an_event_brings_counts_though_the_motion_is_taken_back_before_the_step(inputs):
    """The dock closes in event mode; what is set of its motion afterwards changes nothing of that."""
    raw = FLOWN["none, rk4"]
    instance = Instance(raw, optimised=False, eventModeUsed=True)
    assert instance.initialise() == OK
    for values in ({"held.docked": 0.0}, inputs, dict.fromkeys(CONTACT, 0.0)):
        assert instance.set(values) == OK
        assert instance.update_discrete_states() == OK
    assert instance._status(instance.fmu.enterStepMode) == OK
    assert instance.step(0.1) == OK
    assert instance.get("error_bound") == pi
    instance.free()


@pytest.mark.parametrize("name", FLOWN)
def test_one_huge_step_holds_or_says_nothing(name):
    instance = Instance(FLOWN[name], optimised=False)
    truth = set_off(FLOWN[name], instance, 5)
    assert instance.step(40.0) == OK
    truth.fly(40.0)
    bound = instance.get("error_bound")
    assert apart(instance.get("attitude"), truth.attitude) <= bound + TRUTH
    assert bound <= pi
    instance.free()


ROUGH = [("dop853", 1e-4), ("split", 1e-4), ("split", 1e-7), ("taylor", 1e-5)]


@pytest.mark.parametrize(("propagator", "tolerance"), ROUGH)
def test_estimates_of_a_rough_method_are_not_exceeded(propagator, tolerance):
    """Measured, not proven, but for taylor: the law is right, so that all of the error is the method's."""
    raw = without_motion("tensor", propagator, pose="rate")
    raw["rotation"]["tolerance"] = tolerance
    instance, largest = Instance(raw, optimised=False), 0.0
    for seed in range(5):
        truth = set_off(raw, instance, seed)
        push = elements("torque", np.random.default_rng(seed).normal(size=3) * 200.0)
        assert instance.set(push) == OK
        truth.set(push)
        for span in (1.0, 5.0):
            assert instance.step(span) == OK
            truth.fly(span)
            found = apart(instance.get("attitude"), truth.attitude)
            assert found <= instance.get("error_bound") + TRUTH
            largest = max(largest, found)
    instance.free()
    assert largest > 1e-12


def test_many_vessels_put_together_by_a_loop():
    every = station(16, [f"v{i}" for i in range(16)])
    raw = showing(every, law="principal", propagator="rk4", max_angle_step=0.2)
    raw["inputs"]["pose"] = [port for dock in raw["docks"] for port in dock["ports"]]
    raw = variant(raw, {"rotation.angular_velocity": [0.02, 0.05, -0.03], "rotation.pose_change": "momentum"})
    instance, truth = Instance(raw, optimised=False), truth_of(raw)
    assert "vessel_loop.c" in sources_of(raw)
    assert instance.initialise() == OK
    for inputs in ({"v6.mass": 500.0}, elements("v3.root.position", (2.0, 1.0, 0.0)) | {"v1.mass": 900.0}):
        assert instance.set(inputs) == OK
        truth.set(inputs)
        for _ in range(5):
            assert instance.step(0.2) == OK
        truth.fly(1.0)
        bound = instance.get("error_bound")
        assert TRUTH < apart(instance.get("attitude"), truth.attitude) <= bound < pi
    instance.free()


def sources_of(raw: dict[str, Any]) -> set[str]:
    """Returns the names of the files of C in a scene's FMU."""
    return {path.name for path in (unpacked(raw, optimised=False) / "sources").iterdir()}
