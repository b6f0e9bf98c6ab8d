"""What instants of change hand over to the orbit's owner: jumps of the barycentre, vessels that leave."""

from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import Phase, given, settings

from changes.histories import (
    ByEvents,
    ByExchange,
    ByFmu,
    Driver,
    Values,
    assembly,
    elements,
    happening,
    start_values,
)
from changes.scenes import MIR
from fmu_build.interface.model_description import role_attributes
from fmu_build.interface.variable_table import variable_table
from supervessel import Scene, Twin, reference
from supervessel.equations import equations
from supervessel.scene.outputs import VESSEL_OUTPUTS
from support import EPS, ISS_DG, OK, Array, Instance, scene, variant
from support.marks import FMI, FMI_3_AT_ONCE, some_at_once

AGREEMENT = 1000 * EPS
"""Of the largest numbers that go in: poses go down a chain of vessels, each of a few dozen roundings."""

JUMPS = ("barycentre_jump", "barycentre_velocity_jump")


def handing(raw: dict[str, Any], *vessels: str, **changes: Any) -> dict[str, Any]:
    """Returns a scene with jumps and all outputs of some vessels shown."""
    names = [*JUMPS, "mass", "barycentre", "barycentre_velocity", "angular_velocity", "attitude"]
    names += ["angular_momentum", *(f"{vessel}.{name}" for vessel in vessels for name in VESSEL_OUTPUTS)]
    return variant(raw, {"outputs.names": names, **changes})


def drawn(seed: int, count: int, **rotation: Any) -> dict[str, Any]:
    raw = assembly(seed, count, **rotation)
    return handing(raw, *raw["vessels"])


def read(instance: Instance, *names: str) -> list[list[float]]:
    """Returns values of outputs, lists to be compared to the last bit."""
    return [np.ravel(instance.get(name)).tolist() for name in names]


def sizes(flown: Scene, state: Array, *values: Values) -> tuple[float, float]:
    """Returns the largest distance [m] of a vessel and its largest speed [m/s] for several inputs."""
    found = [reference.vessel_outputs(flown, state, each) for each in values]
    place, speed = (
        max(float(np.abs(of[f"{v}.{name}"]).max()) for of in found for v in flown.vessels)
        for name in ("origin", "velocity")
    )
    return place + 1.0, speed + (place + 1.0) * float(np.abs(state[4:7]).max()) + 1.0


def check(flown: Scene, instance: Instance, state: Array, before: Values, after: Values) -> None:
    """Asserts that what is handed over by a change of inputs is what the reference says."""
    size = sizes(flown, state, before, after)
    truth = reference.barycentre_jumps(flown, state, before, after)
    for name, right, scale in zip(JUMPS, truth, size, strict=True):
        assert np.abs(np.array(instance.get(name)) - right).max() <= AGREEMENT * scale, name
    whole = sum(flown.vessels[v].mass for v in flown.vessels)
    scales = {"attitude": 1.0, "angular_velocity": 1.0, "angular_momentum": whole * size[0] * size[1]}
    scales |= {"origin": size[0], "centre_of_mass": size[0], "velocity": size[1]}
    for name, right in reference.leaving_vessels(flown, state, before, after).items():
        value, kind = np.array(instance.get(name)), name.rpartition(".")[2]
        if kind == "attitude" and value @ right < 0.0:  # at half a turn either sign is right
            value = -value
        assert np.abs(value - right).max() <= AGREEMENT * scales[kind], name


def shapes(flown: Scene, name: str) -> bool:
    """Whether an input shapes the composite: it is no force or torque, nor a motion at contact."""
    owner, _, quantity = name.partition("[")[0].rpartition(".")
    return quantity not in ("force", "torque") and (quantity == "docked" or owner not in flown.inputs.docked)


def follow(raw: dict[str, Any], driver: Driver, instance: Instance, history: list[Any]) -> int:
    """Flies a history; checks each change and what is left of it a step later. Returns how many left."""
    flown, left = scene(raw), 0
    values = start_values(flown)
    for kinds, seed in history:
        after = values | happening(flown, values, kinds, seed)
        state = np.concatenate([driver.attitude, driver.rates])
        changed = {name: x for name, x in after.items() if values.get(name) != x}
        driver.set(changed)
        if any(shapes(flown, name) for name in changed):
            check(flown, instance, state, values, after)
        gone = reference.leaving_vessels(flown, state, values, after)
        left += len(gone) // len(VESSEL_OUTPUTS)
        jumps = read(instance, *JUMPS)
        driver.fly(0.25)
        assert read(instance, *JUMPS) == jumps
        assert all(not np.any(instance.get(name)) for name in gone)
        values = after
    return left


def histories(*more: str) -> st.SearchStrategy[list[tuple[list[str], int]]]:
    kinds = st.lists(
        st.sampled_from(["burn", "dock", "move", "transfer", "undock", *more]), min_size=1, max_size=4
    )
    return st.lists(st.tuples(kinds, st.integers(0, 2**32 - 1)), min_size=6, max_size=10)


FLYING = [
    (ByFmu, 3, "rate momentum"),
    (ByFmu, 2, "rate momentum"),
    (ByEvents, 3, "rate momentum"),
    (ByExchange, 3, "rate momentum"),
    (ByFmu, 3, "momentum momentum"),
    (ByExchange, 3, "momentum momentum"),
    (ByFmu, 3, "momentum rate"),
    (ByFmu, 3, "rate rate"),
]
"""Who flies, the version of FMI, and what changes of masses and poses keep."""

FEW = settings(deadline=None, derandomize=True, max_examples=3, phases=(Phase.explicit, Phase.generate))


@pytest.mark.parametrize(("driver", "fmi", "kept"), some_at_once(FLYING, *FLYING[2:4], FLYING[7]))
@FEW
@given(history=histories())
def test_jumps_and_vessels_that_leave_are_the_references_over_random_histories(driver, fmi, kept, history):
    masses, poses = kept.split()
    raw = drawn(3, 4, mass_change=masses, pose_change=poses)
    flying = driver(raw, fmi)
    follow(raw, flying, flying.instance, history)
    flying.instance.free()


def test_vessels_do_leave_in_such_histories():
    raw = drawn(3, 4, mass_change="rate", pose_change="momentum")
    flying = ByFmu(raw)
    history = [(["undock"], 1), (["dock", "move"], 2), (["undock", "burn"], 3), (["undock", "move"], 4)]
    assert follow(raw, flying, flying.instance, history) >= 3
    flying.instance.free()


@FEW
@given(history=histories("spin"))
def test_a_vessel_that_leaves_takes_its_wheels_along(history):
    raw = assembly(4, 4, wheels=True, mass_change="rate", pose_change="momentum")
    raw = handing(raw, *raw["vessels"])
    flying = ByFmu(raw)
    follow(raw, flying, flying.instance, history)
    flying.instance.free()


@pytest.mark.parametrize("driver", [ByFmu, ByExchange])
def test_under_the_law_none_the_barycentre_jumps_all_the_same(driver):
    raw = drawn(3, 4, law="none", pose_change="rate")
    flying = driver(raw)
    follow(raw, flying, flying.instance, [(["burn"], 1), (["undock", "move"], 2), (["dock", "move"], 3)])
    flying.instance.free()


# Closed forms: the station and the ship, whose books are those of two mass points.

BERTH = handing(
    ISS_DG, "DG", **{"docks": [{**ISS_DG["docks"][0], "name": "berth"}], "inputs.docked": ["berth"]}
)
SPIN = {"rotation.angular_velocity": [0.002, -0.003, 0.001], "rotation.attitude": [3, 1, -2, 5]}


def flying(raw: dict[str, Any], fmi: int = 3, **options: Any) -> Instance:
    instance = Instance(raw, fmi, **options)
    assert instance.initialise() == OK, instance.log
    return instance


def inertial(instance: Instance, vector: Any) -> Array:
    """Returns a vector in body axes in inertial ones."""
    return reference.rotation_matrix(np.array(instance.get("attitude"))) @ np.array(vector)


@FMI_3_AT_ONCE
def test_a_docking_closes_linear_momentum(fmi):
    """(m_A V_A + m_B V_B)/M, and the place of the whole is the mean of those of both."""
    raw = variant(
        MIR, {"outputs.names": [*JUMPS, "barycentre", "attitude", "angular_velocity", "DG.centre_of_mass"]}
    )
    instance = flying(raw, fmi)
    omega, alone = np.array(instance.get("angular_velocity")), np.array(instance.get("barycentre"))
    velocity, rate = np.array([0.1, -0.2, 0.05]), np.array([0.01, 0.02, -0.03])
    contact = elements("berth.velocity", velocity) | elements("berth.rate", rate)
    assert instance.set({"berth.docked": 1.0, **contact}) == OK
    masses = [raw["vessels"][name]["mass"] for name in ("Mir", "DG")]
    share = masses[1] / sum(masses)
    ship = np.array(instance.get("barycentre")) + np.array(instance.get("DG.centre_of_mass"))
    arm = ship - np.array(raw["vessels"]["Mir"]["ports"]["side"]["position"])
    relative = np.cross(omega, ship - alone) + velocity + np.cross(rate, arm)
    moved = np.array(instance.get("barycentre_jump")), np.array(instance.get("barycentre_velocity_jump"))
    assert np.abs(moved[0] - share * inertial(instance, ship - alone)).max() <= 64 * EPS * 20.0
    assert np.abs(moved[1] - share * inertial(instance, relative)).max() <= 64 * EPS
    instance.free()


@FMI_3_AT_ONCE
def test_an_undocking_closes_linear_and_angular_momentum(fmi):
    """M V = m_A V_A + m_B V_B, with the velocity at which the ship leaves; H about the common barycentre is
    what both have about their own and about that."""
    instance = flying(variant(BERTH, SPIN), fmi)
    mass, spin = instance.get("mass"), np.array(instance.get("angular_momentum"))
    assert instance.set({"berth.docked": 0.0}) == OK
    station, ship = instance.get("mass"), mass - instance.get("mass")
    jump, velocity_jump = (np.array(instance.get(name)) for name in JUMPS)
    place = jump + inertial(instance, instance.get("DG.centre_of_mass"))
    velocity = velocity_jump + np.array(instance.get("DG.velocity"))
    assert np.abs(station * velocity_jump + ship * velocity).max() <= 16 * EPS * ship * np.abs(velocity).max()
    assert np.abs(station * jump + ship * place).max() <= 16 * EPS * ship * np.abs(place).max()
    own = np.array(instance.get("DG.angular_momentum")) - ship * np.cross(
        place - jump, velocity - velocity_jump
    )
    both = np.array(instance.get("angular_momentum")) + own
    both += station * np.cross(jump, velocity_jump) + ship * np.cross(place, velocity)
    assert np.abs(both - spin).max() <= 64 * EPS * np.abs(spin).max()
    instance.free()


def test_a_burn_takes_along_what_the_mass_had():
    instance = flying(variant(BERTH, SPIN))
    mass, omega = instance.get("mass"), np.array(instance.get("angular_velocity"))
    rho = np.array(instance.get("DG.centre_of_mass"))
    assert instance.set({"DG.mass": 20000.0}) == OK
    lost = mass - instance.get("mass")
    taken = lost * inertial(instance, np.cross(omega, rho))
    kept = instance.get("mass") * np.array(instance.get("barycentre_velocity_jump"))
    assert np.abs(kept + taken).max() <= 64 * EPS * np.abs(taken).max() * mass / lost
    instance.free()


@pytest.mark.parametrize("law", ["tensor", "principal"])
def test_what_keeps_momentum_leaves_the_barycentre_alone(law):
    raw = handing(ISS_DG, "DG", **{"inputs.pose": ["DG.nose"], "inputs.mass": ["DG", "ISS"], **SPIN})
    raw = variant(raw, {"rotation.mass_change": "momentum", "rotation.law": law})
    instance = flying(raw)
    assert instance.set({"DG.mass": 20000.0, "ISS.mass": 459500.0, "DG.nose.position[1]": 4.0}) == OK
    assert not np.any(read(instance, *JUMPS))
    instance.free()


# When it is there to be read, and for how long.


def test_the_jump_is_that_of_the_whole_instant_however_often_inputs_are_set():
    raw = variant(BERTH, SPIN | {"inputs.mass": ["DG", "ISS"]})
    one, other = flying(raw), flying(raw)
    assert one.set({"DG.mass": 20000.0}) == OK
    first = read(one, *JUMPS)
    assert one.set({"DG.mass": 15000.0, "ISS.mass": 460000.0}) == OK
    assert read(one, *JUMPS) != first
    assert one.set({"DG.mass": 20000.0, "ISS.mass": 455000.0}) == OK
    assert read(one, *JUMPS) == first
    assert one.set({"DG.mass": 24500.0}) == OK  # changed there and back
    assert not np.any(one.get(JUMPS[0]))
    assert one.set({"berth.docked": 0.0}) == OK
    assert np.any(read(one, *JUMPS, "DG.velocity"))
    assert one.set({"DG.mass": 20000.0}) == OK
    assert other.set({"berth.docked": 0.0, "DG.mass": 20000.0}) == OK
    names = (*JUMPS, "DG.origin", "DG.velocity", "DG.angular_momentum")
    assert read(one, *names) == read(other, *names)
    one.free()
    other.free()


def test_a_vessel_that_leaves_is_as_it_was_just_before():
    instance = flying(variant(BERTH, SPIN))
    before = {name: read(instance, f"DG.{name}") for name in VESSEL_OUTPUTS}
    assert np.any(before["angular_momentum"])
    assert instance.set({"berth.docked": 0.0}) == OK
    assert read(instance, "DG.attitude", "DG.angular_velocity") == [
        *before["attitude"],
        *before["angular_velocity"],
    ]
    assert np.abs(instance.get("DG.origin")).max() > np.abs(before["origin"]).max()
    assert instance.step(0.5) == OK
    assert all(not np.any(instance.get(f"DG.{name}")) for name in VESSEL_OUTPUTS)
    assert np.any(instance.get(JUMPS[0]))
    instance.free()


def test_all_changes_at_one_time_are_one_instant_in_event_mode():
    raw = variant(BERTH, SPIN)
    whole = flying(raw)
    assert whole.set({"DG.mass": 20000.0, "berth.docked": 0.0}) == OK
    instance = flying(raw, eventModeUsed=True)
    assert instance.set({"DG.mass": 20000.0}) == OK
    assert instance.update_discrete_states() == OK
    assert instance.set({"berth.docked": 0.0}) == OK
    for _ in range(3):
        assert np.any(instance.get("DG.velocity"))
        for name in JUMPS:
            assert np.abs(np.array(instance.get(name)) - np.array(whole.get(name))).max() <= 1e-15
        assert instance.update_discrete_states() == OK
    assert instance._status(instance.fmu.enterStepMode) == OK
    assert np.any(instance.get("DG.velocity"))
    assert instance.step(0.5) == OK
    assert not np.any(instance.get("DG.velocity"))
    instance.free()
    whole.free()


@FMI
def test_in_model_exchange_a_vessel_is_there_until_time_goes_on(fmi):
    instance = flying(variant(BERTH, SPIN), fmi, exchange=True)
    assert instance.run() == OK
    assert instance._status(instance.fmu.enterEventMode) == OK
    assert instance.set({"berth.docked": 0.0}) == OK
    pending = read(instance, "DG.velocity")
    assert np.any(pending)
    assert instance.run() == OK
    assert read(instance, "DG.velocity") == pending
    instance.fmu.setTime(0.25)
    assert not np.any(instance.get("DG.velocity"))
    assert np.any(instance.get(JUMPS[1]))
    instance.free()


@FMI
def test_a_saved_state_holds_it_and_a_reset_clears_it(fmi):
    instance = flying(variant(BERTH, SPIN), fmi)
    names = (*JUMPS, "DG.velocity", "DG.angular_momentum")
    assert instance.set({"berth.docked": 0.0}) == OK
    pending = read(instance, *names)
    fmu = instance.fmu
    saved = fmu.getFMUState() if fmi == 3 else fmu.getFMUstate()
    assert instance.step(0.5) == OK
    assert instance.set({"DG.mass": 12000.0, "berth.docked": 1.0}) == OK
    assert read(instance, *names) != pending
    (fmu.setFMUState if fmi == 3 else fmu.setFMUstate)(saved)
    instance.time = 0.0
    assert read(instance, *names) == pending
    assert instance.step(0.5) == OK
    assert read(instance, *JUMPS) == pending[:2]
    (fmu.freeFMUState if fmi == 3 else fmu.freeFMUstate)(saved)
    fmu.reset()
    instance.time = 0.0
    assert instance.initialise() == OK
    assert not np.any(read(instance, *JUMPS))
    instance.free()


def test_jumps_are_there_where_the_rate_never_changes():
    raw = handing(ISS_DG, "DG", **{"inputs": {"mass": ["DG"], "torque": True}, **SPIN})
    flown, instance = scene(raw), flying(raw)
    state = np.array([*instance.get("attitude"), *SPIN["rotation.angular_velocity"]])
    assert instance.set({"DG.mass": 12000.0}) == OK
    check(flown, instance, state, {}, {"DG.mass": 12000.0})
    assert np.any(instance.get(JUMPS[1]))
    assert read(instance, "angular_velocity") == [SPIN["rotation.angular_velocity"]]
    instance.free()


def test_what_can_make_no_jump_is_zero():
    names = [*JUMPS, "barycentre_velocity"]
    for inputs in ({"torque": True}, {"pose": ["DG.nose"]}):
        instance = flying(variant(ISS_DG, {"outputs.names": names, "inputs": inputs}))
        if "pose" in inputs:
            assert instance.set({"DG.nose.position[1]": 4.0}) == OK
        assert not np.any(read(instance, *names))
        instance.free()


def test_jumps_are_discrete_where_nothing_makes_them_between_events():
    """Masses, which are continuous, may be set in step mode by an importer that uses event mode for docks."""
    docked, masses = variant(BERTH, {"inputs": {"docked": ["berth"]}}), {"mass": ["DG"]}
    for raw, variability in (
        (docked, "discrete"),
        (BERTH, "continuous"),
        (handing(ISS_DG, "DG", inputs=masses), "discrete"),
    ):
        entries = variable_table(equations(scene(raw)))
        declared = {entry.name: role_attributes(entry)["variability"] for entry in entries}
        assert {declared[f"{name}[{i}]"] for name in JUMPS for i in (1, 2, 3)} == {variability}
        assert declared["DG.velocity[1]"] == "continuous"


def test_the_twin_leaves_jumps_out():
    names = Twin(scene(BERTH)).y_names
    assert not any(name.partition("[")[0] in JUMPS for name in names)
    assert "DG.velocity[1]" in names


def test_no_body_between_two_changes_of_one_instant_is_refused_where_poses_move():
    raw = variant(
        MIR,
        {
            "vessels.Mir.mass": 0.0,
            "docks": [
                {"ports": ["Mir.side", "DG.nose"], "name": "berth"},
                {"ports": ["Mir.fore", "DG.nose"], "name": "front", "docked": False},
            ],
            "inputs.pose": ["Mir.side"],
            "rotation.pose_change": "rate",
            "outputs.names": [*JUMPS, "mass"],
        },
    )
    instance = flying(raw)
    swap = {"berth.docked": 0.0, "front.docked": 1.0}
    assert instance.set(swap) == OK
    assert np.all(np.isfinite(instance.get(JUMPS[1])))
    assert instance.set({"Mir.side.position[1]": 16.0}) == OK
    with pytest.raises(Exception, match="fmi3GetFloat64"):
        instance.get(JUMPS[0])
    assert "nothing is left that has a mass" in instance.messages()[-1]
    instance.free()


@pytest.mark.parametrize("distance", some_at_once([0.0, 2.0**20, 2.0**30, 2.0**40], 2.0**40))
def test_a_jump_loses_no_digits_where_axes_begin_far_away(distance):
    # Two vessels 36 m apart, their axes far from them; what undocks takes its share of the distance along.
    masses = (4e5, 2e4)
    port = {"direction": [1, 0, 0], "alignment": [0, 1, 0]}
    ports = (
        {"p": port | {"position": [distance + 20.0, 0, 0]}},
        {"p": port | {"position": [distance + 16.0, 0, 0]}},
    )
    vessels = {
        name: {"mass": mass, "pmi": [1.0, 2.0, 2.0], "centre_of_mass": [distance, 0, 0], "ports": own}
        for name, mass, own in zip("ST", masses, ports, strict=True)
    }
    raw = {
        "name": "far",
        "root": "S",
        "vessels": vessels,
        "docks": [{"name": "d", "ports": ["S.p", "T.p"]}],
        "inputs": {"docked": ["d"]},
        "rotation": {"angular_velocity": [0.0, 0.0, 0.02]},
        "outputs": {
            "names": ["barycentre_jump", "barycentre_velocity_jump", "T.centre_of_mass", "T.velocity"]
        },
    }
    instance = Instance(raw)
    assert instance.initialise() == OK
    assert instance.set({"d.docked": False}) == OK
    jump, velocity, place, moves = (instance.get(name) for name in raw["outputs"]["names"])
    instance.free()
    share = 36.0 * masses[1] / sum(masses)
    assert np.abs(jump - [-share, 0, 0]).max() <= 16 * EPS * 36.0
    assert np.abs(velocity - [0, -0.02 * share, 0]).max() <= 16 * EPS * 0.72
    assert np.abs(masses[0] * velocity + masses[1] * (velocity + moves)).max() <= 64 * EPS * masses[1] * 0.72
    assert np.abs(masses[0] * jump + masses[1] * (jump + place)).max() <= 64 * EPS * masses[1] * 36.0


def test_a_bound_of_the_error_is_carried_beside():
    raw = variant(MIR, {"rotation.law": "principal", "outputs.names": ["error_bound", *JUMPS, "attitude"]})
    instance = Instance(raw)
    assert instance.initialise() == OK
    assert instance.step(1.0) == OK
    assert 0.0 < instance.get("error_bound") < 1.0
    instance.free()
