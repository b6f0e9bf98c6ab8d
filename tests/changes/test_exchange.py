"""Model exchange while inputs change: in steps, all the time, and what is refused."""

from typing import Any

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from lxml import etree
from scipy.integrate import solve_ivp

from changes.histories import ByEvents, ByExchange, ByFmu, Values, elements, start_values
from changes.scenes import DURATION, MIXED, STEADY, TORQUE, TUG, TUG_EVENTS, drawn_in
from fmu_build.generate.model import generate
from supervessel import reference
from support import EPS, ERROR, OK, Instance, refusal, scene, variant
from support.marks import FMI

FLIGHT_ERROR = 1e-10
"""Of DOP853 at rtol = 1e-13 on both sides, over a radian."""


def by_scipy(raw: dict[str, Any], by_momentum: bool) -> np.ndarray:
    """Returns attitude and angular velocity after DURATION by SciPy on the reference, (7,)."""
    flown = scene(raw)
    start, omega = np.array(flown.rotation.attitude), np.array(flown.rotation.angular_velocity)
    kept = reference.angular_momentum(flown, omega, drawn_in(0.0)) if by_momentum else omega

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        if by_momentum:
            return reference.momentum_ode(flown, y, drawn_in(t))
        return reference.ode(flown, y, None, drawn_in(t))

    y0 = np.concatenate([start, kept])
    settings = {"rtol": 1e-13, "atol": 1e-15 * np.abs(y0).max()}
    y = solve_ivp(rate, (0.0, DURATION), y0, "DOP853", **settings).y[:, -1]
    omega = reference.angular_velocity(flown, y[4:], drawn_in(DURATION)) if by_momentum else y[4:]
    return np.concatenate([y[:4] / np.linalg.norm(y[:4]), omega])


@FMI
@pytest.mark.parametrize(("raw", "by_momentum"), [(TUG, True), (STEADY, False)], ids=["momentum", "rate"])
def test_inputs_that_move_all_the_time_need_no_rates(raw, by_momentum, fmi):
    driver = ByExchange(raw, fmi)
    driver.fly(DURATION, drawn_in)
    found = np.concatenate([driver.attitude, driver.angular_velocity])
    assert np.abs(found - by_scipy(raw, by_momentum)).max() <= FLIGHT_ERROR


@FMI
def test_momentum_is_a_state_where_every_change_keeps_it(fmi):
    names = [v.name for v in Instance(TUG, fmi).description.modelVariables if v.name.startswith("state.")]
    assert names[4:] == [f"state.angular_momentum[{i}]" for i in (1, 2, 3)]
    names = [v.name for v in Instance(MIXED, fmi).description.modelVariables if v.name.startswith("state.")]
    assert names[4:] == [f"state.angular_velocity[{i}]" for i in (1, 2, 3)]


DOCKS = {"held.docked", "stowed.docked"}
CONTACT = {f"{dock}.{what}" for dock in ("held", "stowed") for what in ("velocity", "rate")}
POSES = {f"tug.arm.{what}" for what in ("position", "direction", "alignment")}
MOMENTUM, RATE = "state.angular_momentum", "state.angular_velocity"
FIXED = {"docks": [{"ports": ["tug.arm", "tank.end"]}], "inputs.docked": []}
AT_EVENTS: dict[str, tuple[dict[str, Any], set[str], str]] = {
    "momentum": (TUG, DOCKS | CONTACT, MOMENTUM),
    "mixed": (MIXED, DOCKS | CONTACT | POSES, RATE),
    "rate": (STEADY, DOCKS | CONTACT, RATE),
    "no law": (variant(STEADY, {"rotation.law": "none"}), DOCKS | CONTACT, ""),
    "momentum, no docks": (variant(TUG, FIXED), set(), ""),
    "mixed, no docks": (variant(MIXED, FIXED), POSES, RATE),
    "mixed the other way, no docks": (
        variant(TUG, FIXED | {"rotation.pose_change": "rate"}),
        {"tank.mass"},
        RATE,
    ),
    "rate, no docks": (variant(STEADY, FIXED), set(), ""),
    "poses, no docks": (variant(MIXED, FIXED | {"inputs.mass": []}), set(), ""),
}
"""Scenes, their discrete inputs, and the state that an event can change."""


@FMI
@pytest.mark.parametrize("kind", AT_EVENTS)
def test_the_description_says_what_changes_at_events_alone_and_which_states_do(kind, fmi):
    raw, discrete, state = AT_EVENTS[kind]
    found = etree.fromstring(generate(scene(raw), fmi)[1]).find("ModelVariables")
    attributes = [dict(e.attrib) if fmi == 3 else {**e.attrib, **e[0].attrib} for e in found]
    groups = {v["name"].partition("[")[0] for v in attributes if v["variability"] == "discrete"}
    assert groups == discrete
    assert [v["name"] for v in attributes if v.get("reinit") == "true"] == [
        f"{state}[{i}]" for i in (1, 2, 3) if state
    ]


# A dozen points, ten roundings each, and the condition of a tensor with moments 20 times apart.
CHANGE_ERROR = 256 * EPS


@FMI
def test_inputs_that_step_in_continuous_time_change_the_rate_at_once(fmi):
    driver = ByExchange(TUG, fmi)
    driver.states_dot(0.0, driver.states, drawn_in(DURATION))
    omega = np.array(TUG["rotation"]["angular_velocity"])
    expected = reference.change(scene(TUG), omega, {}, drawn_in(DURATION))
    assert np.abs(driver.angular_velocity - expected).max() <= CHANGE_ERROR * np.abs(expected).max()
    driver.states_dot(0.0, driver.states, drawn_in(0.0))
    assert np.abs(driver.angular_velocity - omega).max() <= CHANGE_ERROR * np.abs(omega).max()


@pytest.mark.parametrize(("driver", "fmi"), [(ByExchange, 2), (ByExchange, 3), (ByEvents, 3)])
@pytest.mark.parametrize("raw", [TUG, MIXED, STEADY], ids=["momentum", "mixed", "rate"])
def test_events_at_one_instant_follow_each_other(raw, driver, fmi):
    flying, flown = driver(raw, fmi), scene(raw)
    values, omega = start_values(flown), np.array(flown.rotation.angular_velocity)
    for inputs in TUG_EVENTS:
        flying.set(inputs)
        omega = reference.change(flown, omega, values, values | inputs)
        values |= inputs
        # Three changes, each with its own rounding.
        assert np.abs(flying.angular_velocity - omega).max() <= 3 * CHANGE_ERROR * np.abs(omega).max()


def test_changes_between_two_steps_are_one_change():
    driver, flown = ByFmu(MIXED), scene(MIXED)
    start = start_values(flown)
    values = dict(start)
    for inputs in TUG_EVENTS:
        driver.set(inputs)
        values |= inputs
        omega = reference.change(flown, flown.rotation.angular_velocity, start, values)
        assert np.abs(driver.angular_velocity - omega).max() <= CHANGE_ERROR * np.abs(omega).max()


@FMI
@pytest.mark.parametrize("raw", [TUG, MIXED], ids=["momentum", "rate"])
def test_an_event_says_whether_it_changed_the_states(raw, fmi):
    driver = ByExchange(raw, fmi)
    fmu = driver.instance.fmu
    for inputs, changed in (({"held.docked": 0.0}, raw is TUG), (TORQUE, False)):
        before = driver.states
        assert driver.instance._status(fmu.enterEventMode) == OK
        assert driver.instance.set(inputs) == OK
        info = (fmu.updateDiscreteStates if fmi == 3 else fmu.newDiscreteStates)()
        assert bool(info[3]) is changed
        assert driver.instance._status(fmu.enterContinuousTimeMode) == OK
        assert (driver.states.tolist() != before.tolist()) is changed


@FMI
def test_a_mixture_refuses_moving_poses_in_continuous_time_and_keeps_its_state(fmi):
    driver = ByExchange(MIXED, fmi)
    states = driver.states.tolist()
    moved = elements("tug.arm.position", (2.5, 0.5, 0.0))
    assert driver.instance.set(moved) == OK
    with pytest.raises(FMICallException):
        driver.states_dot(0.0, driver.states)
    assert (
        "tug.arm.position[1] = 2.5 m: changed from 3 in continuous-time mode"
        in driver.instance.messages()[-1]
    )
    assert driver.states.tolist() == states
    assert driver.instance.set(elements("tug.arm.position", (3.0, 0.5, 0.0))) == OK
    assert np.isfinite(driver.states_dot(0.0, driver.states)).all()


@FMI
def test_a_mixture_takes_moving_masses_in_continuous_time(fmi):
    driver = ByExchange(MIXED, fmi)
    driver.fly(DURATION, lambda t: {"tank.mass": 400.0 + 10.0 * t})
    flown = scene(MIXED)
    start = np.array([*flown.rotation.attitude, *flown.rotation.angular_velocity])

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        return reference.ode(flown, y, None, {"tank.mass": 400.0 + 10.0 * t})

    end = solve_ivp(rate, (0.0, DURATION), start, "DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
    assert np.abs(driver.angular_velocity - end[4:]).max() <= FLIGHT_ERROR


def test_docks_cannot_move_in_continuous_time():
    driver = ByExchange(TUG)
    assert driver.instance.set({"held.docked": 0.0}) == ERROR
    assert "held.docked" in driver.instance.messages()[-1]


# What co-simulation refuses


REFUSALS: dict[str, tuple[Values, str]] = {
    "occupied": ({"grip.docked": 1.0}, "grip.docked = true: port tug.arm is docked already"),
    "loop": ({"stowed.docked": 1.0}, "stowed.docked = true: tug.top - tank.far closes a loop"),
    "negative mass": ({"tank.mass": -1.0}, "tank.mass = -1 kg: must be >= 0"),
    "parallel": (elements("tug.arm.direction", (0.0, 1.0, 0.0)), "tug.arm.direction"),
}
WITH_GRIP = variant(
    TUG,
    {
        "docks": [*TUG["docks"], {"ports": ["tug.arm", "tank.far"], "name": "grip", "docked": False}],
        "inputs.docked": ["held", "stowed", "grip"],
    },
)


@FMI
@pytest.mark.parametrize("kind", REFUSALS)
def test_a_change_that_cannot_be_is_refused_by_name_and_leaves_the_state(kind, fmi):
    wrong, message = REFUSALS[kind]
    driver = ByFmu(WITH_GRIP, fmi)
    instance = driver.instance
    driver.fly(0.5)
    kept = [*driver.angular_velocity, *driver.attitude]
    back = {name: instance.get(name) for name in wrong}
    assert instance.set(wrong) == OK
    assert instance.step(0.5) == refusal(fmi)
    assert message in instance.messages()[-1]
    assert instance.set(back) == OK
    assert [*driver.angular_velocity, *driver.attitude] == kept
    driver.fly(0.5)
    other = ByFmu(WITH_GRIP, fmi)
    for _ in range(2):
        other.fly(0.5)
    assert driver.angular_velocity.tolist() == other.angular_velocity.tolist()
    for flown in (driver, other):
        flown.instance.free()


def test_a_detached_ship_changes_nothing():
    found = []
    for inputs in ({}, {"tank.mass": 900.0}, elements("tug.arm.position", (9.0, 9.0, 9.0))):
        driver = ByFmu(TUG)
        driver.set({"held.docked": 0.0})
        driver.fly(1.0)
        driver.set(inputs | TORQUE)
        driver.fly(1.0)
        found.append([*driver.angular_velocity, *driver.attitude, *driver.instance.get("inertia")])
    assert found[0] == found[1] == found[2]
