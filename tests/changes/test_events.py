"""The order of calls around a change: nothing but what was set and where decides what follows."""

from typing import Any

import numpy as np
import pytest

from changes.histories import (
    ByEvents,
    ByExchange,
    ByFmu,
    assembly,
    elements,
    happening,
    legal,
    start_values,
)
from changes.scenes import DURATION, MIXED, STEADY, TUG, brought, drawn_in
from fmu.listeners import Listener
from fmu.saved_states import bytes_of, restore
from supervessel import reference
from support import DISCARD, EPS, OK, Instance, refusal, scene, variant
from support.marks import FMI

SCENES = pytest.mark.parametrize("raw", [TUG, MIXED, STEADY], ids=["momentum", "mixed", "rate"])
TURNED = variant(TUG, {"name": "turned", "rotation.pose_change": "rate"})
GONE = {"held.docked": 0.0}
MOVED = drawn_in(DURATION / 2)


@pytest.mark.parametrize("propagator", ["auto", "exact"])
def test_free_motion_after_an_event_is_that_of_the_new_composite(propagator):
    raw = variant(TUG, {"rotation.propagator": propagator, "inputs.torque": propagator == "auto"})
    flown = []
    for driver in (ByEvents(raw), ByFmu(raw)):
        driver.fly(0.5)
        driver.set(GONE)
        driver.fly(0.5)
        flown.append(np.concatenate([driver.angular_velocity, driver.attitude]))
        driver.instance.free()
    # Steps of at most a fifth of a radian in all, by closed forms or series.
    assert np.abs(flown[0] - flown[1]).max() <= 64 * EPS


@FMI
@SCENES
@pytest.mark.parametrize("read", [False, True])
def test_states_set_in_event_mode_go_with_the_inputs_set_before(raw, fmi, read):
    driver = ByExchange(raw, fmi)
    instance = driver.instance
    states = instance.names("state.angular_velocity" if raw is not TUG else "state.angular_momentum")
    wanted = dict(zip(states, (0.25, -0.5, 0.125), strict=True))
    assert instance._status(instance.fmu.enterEventMode) == OK
    assert instance.set(MOVED | GONE) == OK
    if read:
        instance.get("mass")
    assert instance.set(wanted) == OK
    assert [instance.get(n) for n in states] == list(wanted.values())
    assert instance.run() == OK
    assert driver.states[4:].tolist() == list(wanted.values())
    instance.free()


@SCENES
def test_states_set_to_what_they_are_begin_a_change_as_well(raw):
    found = []
    for again in (False, True):
        driver = ByExchange(raw)
        instance = driver.instance
        assert instance._status(instance.fmu.enterEventMode) == OK
        assert instance.set(MOVED | GONE) == OK
        states = instance.names("state.angular_velocity" if raw is not TUG else "state.angular_momentum")
        values = {n: instance.get(n) for n in states}
        if again:
            assert instance.set({n: 2.0 * x for n, x in values.items()}) == OK
        assert instance.set(values) == OK
        assert instance.set({"held.docked": 1.0} | drawn_in(0.0)) == OK
        found.append(driver.angular_velocity.tolist())
        instance.free()
    assert found[0] == found[1]


@FMI
@pytest.mark.parametrize("read", [False, True])
@pytest.mark.parametrize("raw", [TUG, TURNED], ids=["momentum", "turned"])
def test_what_moved_in_continuous_time_has_moved_before_the_event_read_or_not(raw, read, fmi):
    flown, start, moved = scene(raw), start_values(scene(raw)), dict(MOVED)
    if raw is TURNED:
        moved = {name: x for name, x in moved.items() if name.startswith("tug.arm")}
    happens = GONE | {"tank.mass": 900.0} if raw is TUG else {"tank.mass": 900.0}
    between = reference.change(flown, flown.rotation.angular_velocity, start, start | moved)
    expected = reference.change(flown, between, start | moved, start | moved | happens)
    driver = ByExchange(raw, fmi)
    instance = driver.instance
    assert instance.set(moved) == OK
    if read:
        instance.get("angular_velocity")
    driver.set(happens)
    # Sums of a few products of numbers up to ten times the result, at either side.
    assert np.abs(driver.angular_velocity - expected).max() <= 256 * EPS * np.abs(expected).max()
    instance.free()


@FMI
def test_an_event_is_not_entered_with_continuous_inputs_that_cannot_be_used(fmi):
    driver = ByExchange(TUG, fmi)
    instance = driver.instance
    assert instance.set({"tank.mass": -1.0}) == OK
    assert instance._status(instance.fmu.enterEventMode) == refusal(fmi)
    assert "tank.mass = -1 kg: must be >= 0" in instance.messages()[-1]
    assert instance.set({"tank.mass": 400.0}) == OK
    driver.set(GONE)
    assert driver.angular_velocity.tolist() == pytest.approx([0.2, -0.3, 0.1], rel=1e-14)
    instance.free()


@FMI
def test_a_discrete_input_that_was_set_in_continuous_time_waits_for_the_event(fmi):
    flown, start = scene(MIXED), start_values(scene(MIXED))
    pose = {name: x for name, x in MOVED.items() if name.startswith("tug.arm")}
    expected = reference.change(
        flown, flown.rotation.angular_velocity, start, start | pose | {"tank.mass": 900.0}
    )
    driver = ByExchange(MIXED, fmi)
    assert driver.instance.set(pose | {"tank.mass": 900.0}) == OK
    driver.set({})
    assert np.abs(driver.angular_velocity - expected).max() <= 256 * EPS * np.abs(expected).max()
    driver.instance.free()


@FMI
@SCENES
def test_event_mode_may_be_left_without_an_update(raw, fmi):
    found = []
    for update in (True, False):
        driver = ByExchange(raw, fmi)
        instance = driver.instance
        assert instance._status(instance.fmu.enterEventMode) == OK
        assert instance.set(MOVED | GONE) == OK
        if update:
            assert instance.run() == OK
        else:
            assert instance._status(instance.fmu.enterContinuousTimeMode) == OK
        rates = driver.states_dot(0.0, driver.states, {"tank.mass": 123.0})
        found.append([*driver.states, *rates, *driver.angular_velocity])
        instance.free()
    assert found[0] == found[1]


def test_the_momentum_read_within_a_step_is_that_of_the_sub_step():
    read = []

    def update(listener: Any, *_: Any) -> None:
        inertia = listener.get("inertia").reshape(3, 3)
        momentum = inertia @ listener.get("angular_velocity")
        read.append((momentum, listener.get("state.angular_momentum")))

    raw = variant(TUG, {"rotation.propagator": "rk4", "rotation.max_angle_step": 0.125, "name": "heard"})
    listener = Listener(raw, update)
    assert listener.fly(4.0)[0] == OK
    assert len({momentum.tobytes() for momentum, _ in read}) > 2
    for momentum, found in read:
        assert np.abs(found - momentum).max() <= 8 * EPS * np.abs(momentum).max()
    listener.free()


@SCENES
@pytest.mark.parametrize("place", ["cs initialising", "cs stepping", "me initialising", "me event"])
def test_states_that_are_read_first_follow_from_what_was_set(raw, place):
    found = []
    for first in (None, "inertia"):
        instance = brought(place, 3, raw)
        assert instance.set(MOVED | GONE) == OK
        if first:
            instance.get(first)
        found.append(instance.get("state.angular_velocity" if raw is not TUG else "state.angular_momentum"))
        instance.free()
    assert found[0].any()
    assert found[0].tolist() == found[1].tolist()


@FMI
@SCENES
def test_what_is_read_after_the_end_is_what_was_there(raw, fmi):
    driver = ByExchange(raw, fmi)
    instance = driver.instance
    driver.states_dot(1.0, 2.0 * driver.states)
    assert instance.set({"tank.mass": 123.0}) == OK
    states = driver.states.tolist()
    assert instance._status(instance.fmu.terminate) == OK
    assert driver.states.tolist() == states
    instance.free()


def test_what_was_refused_before_the_end_is_refused_after_it():
    driver = ByExchange(MIXED)
    instance = driver.instance
    assert instance.set(elements("tug.arm.position", (2.5, 0.5, 0.0))) == OK
    assert instance.get_status("mass") == DISCARD
    assert instance._status(instance.fmu.terminate) == OK
    assert instance.get_status("mass") == DISCARD
    instance.free()


def test_a_state_that_is_restored_at_the_start_gives_the_same_rate_to_the_last_bit():
    driver = ByExchange(variant(TUG, {"rotation.angular_velocity": [0.1, 0.3, 0.7]}))
    content = bytes_of(driver.instance)
    rate = driver.angular_velocity.tolist()
    assert restore(driver.instance, content) == OK
    assert driver.angular_velocity.tolist() == rate
    driver.instance.free()


# Sets and reads on the way.


def wander(instance: Instance, flown: Any, values: dict[str, float], rng: np.random.Generator) -> None:
    """Sets inputs there and back, some that cannot be, and reads in between."""
    for _ in range(int(rng.integers(1, 6))):
        for name in rng.permutation(list(values))[: int(rng.integers(1, 9))].tolist():
            other = values[name] * rng.uniform(-1.0, 2.0)
            assert instance.set({name: rng.uniform() < 0.5 if name in instance.booleans else other}) == OK
        if instance.fmi == 2 and not legal_now(instance, flown, values):
            continue
        reading = rng.integers(4)
        if reading == 0:
            instance.get_status("angular_velocity")
        elif reading == 1:
            instance.get_status("state.attitude[1]")
        elif reading == 2:
            instance.get_status("mass")
        elif instance.fmi == 3:
            known = next(name for name in values if name not in instance.booleans)
            instance._status(instance.directional, ["angular_velocity[1]"], [known], [1.0])


def legal_now(instance: Instance, flown: Any, values: dict[str, float]) -> bool:
    """Whether the inputs can be used; an FMI 2 read of others in co-simulation is an error."""
    now = {name: float(instance.get(name)) for name in values}
    masses = all(x >= 0.0 for name, x in now.items() if name.endswith(".mass"))
    return masses and legal(flown, now) and all(now[n] == x for n, x in values.items() if "pmi" in n)


@FMI
@pytest.mark.parametrize("kept", [("rate", "momentum"), ("momentum", "momentum")], ids=" ".join)
@pytest.mark.parametrize("driver", [ByFmu, ByExchange])
def test_sets_and_reads_on_the_way_change_nothing(driver, kept, fmi):
    raw = assembly(3, 3, mass_change=kept[0], pose_change=kept[1])
    flown = scene(raw)
    flights = [driver(raw, fmi) for _ in range(2)]
    values = start_values(flown)
    rng = np.random.default_rng(1)
    for _ in range(20):
        kinds = rng.choice(["burn", "transfer", "move", "dock", "undock"], 3).tolist()
        after = values | happening(flown, values, kinds, int(rng.integers(10**9)))
        assert after.keys() >= values.keys()
        for flight, wandering in zip(flights, (False, True), strict=True):
            instance = flight.instance
            if driver is ByExchange:
                assert instance._status(instance.fmu.enterEventMode) == OK
            if wandering:
                wander(
                    instance, flown, {n: x for n, x in values.items() if ".docked" in n or ".mass" in n}, rng
                )
            assert instance.set(after) == OK
            if driver is ByExchange:
                assert instance.run() == OK
            else:
                flight.fly(0.25)
        one, other = flights
        assert one.angular_velocity.tolist() == other.angular_velocity.tolist()
        assert one.attitude.tolist() == other.attitude.tolist()
        values = after
    for flight in flights:
        flight.instance.free()
