"""A ship docks at the side of a station: rates after it, energy, and what it must not be."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from changes.histories import ByExchange, ByFmu, ByTwin, Driver, Values, elements
from changes.scenes import MIR
from supervessel import reference
from support import EPS, OK, Instance, refusal, scene
from support.examples import examples
from support.marks import FMI

MIR_RATE = np.array(MIR["rotation"]["angular_velocity"])
FREE = {"berth.docked": 0.0, "front.docked": 0.0}

VECTORS = st.tuples(*[st.floats(-0.5, 0.5)] * 3)


@st.composite
def approaches(draw: st.DrawFn) -> Values:
    """Draws which dock closes, and how the ship moves as it does."""
    dock = draw(st.sampled_from(["berth", "front"]))
    velocity, rate = draw(VECTORS), draw(VECTORS)
    return {f"{dock}.docked": 1.0} | elements(f"{dock}.velocity", velocity) | elements(f"{dock}.rate", rate)


RATE_ERROR = 1e-12
"""Of the rates: a hundred roundings, and the condition of a tensor with moments 3 times apart, is 1e-13."""


@pytest.mark.parametrize("driver", [ByFmu, ByExchange, ByTwin])
@examples(15, 40)
@given(approach=approaches())
def test_a_ship_docks_with_the_right_rates(driver, approach):
    flown: Driver = driver(MIR)
    flown.set(approach)
    truth = reference.change(scene(MIR), MIR_RATE, FREE, FREE | approach)
    scale = np.abs(truth).max() + np.abs(MIR_RATE).max()
    assert np.abs(flown.angular_velocity - truth).max() <= RATE_ERROR * scale


@examples(15, 40)
@given(approach=approaches())
def test_docking_never_raises_the_kinetic_energy(approach):
    flown = scene(MIR)
    points = reference.joined(reference.at_contact(flown, MIR_RATE, FREE, FREE | approach).values())
    m, v = points.masses, points.velocities - points.masses @ points.velocities / points.masses.sum()
    before = 0.5 * float(m @ (v * v).sum(axis=1))
    instance = Instance(MIR)
    assert instance.initialise() == OK
    assert instance.set(approach) == OK
    after = instance.get("kinetic_energy")
    instance.free()
    # What is lost is the energy of the motion at contact, some of it always but where that is none.
    assert after <= before * (1.0 + 64 * EPS)


def test_the_diagonal_alone_would_turn_the_axis_by_a_degree_and_a_half():
    # The ship comes along z across the station at rest.
    contact = {"berth.docked": 1.0} | elements("berth.velocity", (0.0, 0.0, 0.1))
    flown = scene(MIR)
    J = reference.composite(flown, FREE | contact).inertia
    rate = reference.change(flown, np.zeros(3), FREE, FREE | contact)
    diagonal = J @ rate / np.diag(J)
    angle = np.arccos(rate @ diagonal / np.linalg.norm(rate) / np.linalg.norm(diagonal))
    assert np.degrees(angle) == pytest.approx(1.455, abs=5e-4)


@FMI
def test_an_occupied_port_is_refused_by_name(fmi):
    instance = Instance(MIR, fmi)
    assert instance.initialise() == OK
    assert instance.set({"berth.docked": 1.0}) == OK
    assert instance.step(0.1) == OK
    rate, attitude = (instance.get(name).tolist() for name in ("angular_velocity", "attitude"))
    assert instance.set({"front.docked": 1.0}) == OK
    assert instance.step(0.1) == refusal(fmi)
    assert "front.docked = true: port DG.nose is docked already" in instance.messages()[-1]
    assert instance.set({"front.docked": 0.0}) == OK
    assert instance.get("angular_velocity").tolist() == rate
    assert instance.get("attitude").tolist() == attitude
    assert instance.step(0.1) == OK
    instance.free()


def test_a_ship_goes_from_one_port_to_another_at_one_instant():
    driver = ByFmu(MIR)
    driver.set({"berth.docked": 1.0})
    rate = driver.angular_velocity
    contact = elements("front.velocity", (0.1, 0.2, -0.1))
    driver.set({"berth.docked": 0.0, "front.docked": 1.0} | contact)
    # Nothing was stepped in between: what counts is the way from the start to here.
    truth = reference.change(scene(MIR), MIR_RATE, FREE, FREE | {"front.docked": 1.0} | contact)
    assert np.abs(driver.angular_velocity - truth).max() <= RATE_ERROR * np.abs(truth).max()
    assert rate.tolist() == MIR_RATE.tolist()


def test_reads_and_sets_on_the_way_leave_no_trace():
    ways: list[list[Values]] = [
        [{"berth.docked": 1.0} | elements("berth.velocity", (0.1, 0.2, 0.3))],
        [
            elements("berth.velocity", (9.0, 9.0, 9.0)),
            {"front.docked": 1.0},
            {"front.docked": 0.0, "berth.docked": 1.0},
            elements("berth.velocity", (0.1, 0.2, 0.3)),
        ],
    ]
    found = []
    for way in ways:
        driver = ByFmu(MIR)
        for inputs in way:
            driver.set(inputs)
            assert driver.angular_velocity.shape == (3,)
        driver.fly(1.0)
        found.append([*driver.angular_velocity, *driver.attitude])
    assert found[0] == found[1]


@FMI
def test_a_saved_state_goes_back_over_a_docking(fmi):
    instance = Instance(MIR, fmi)
    assert instance.initialise() == OK
    assert instance.step(0.5) == OK
    apart = instance.fmu.getFMUState()
    contact = {"berth.docked": 1.0} | elements("berth.velocity", (0.1, 0.2, 0.3))
    assert instance.set(contact) == OK
    waiting = instance.fmu.getFMUState()  # the ship has docked, no step has been taken since
    ends = []
    for state in (None, waiting, apart):
        if state is not None:
            assert instance._status(instance.fmu.setFMUState, state) == OK
            instance.time = 0.5
        if state is apart:
            assert instance.get("mass") == MIR["vessels"]["Mir"]["mass"]
            assert instance.set(contact) == OK
        assert instance.step(0.5) == OK
        ends.append([*instance.get("angular_velocity"), *instance.get("attitude"), instance.get("mass")])
    assert ends[0] == ends[1] == ends[2]
    assert ends[0][-1] == sum(vessel["mass"] for vessel in MIR["vessels"].values())
    for state in (apart, waiting):
        instance.fmu.freeFMUState(state)
    instance.free()
