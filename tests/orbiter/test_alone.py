"""A vessel that nothing is docked to, by Orbiter's convention: its moments are as given.

Docked to anything it counts as its six points: `SuperVessel::CalcPMI`, which Orbiter calls where vessels are
docked and nowhere else.
"""

import numpy as np
import pytest

from orbiter.points import scene_pmi
from supervessel import SceneError, Twin, parse_scene, reference
from supervessel.composite.docks import alone_as_given
from support import OK, Array, flying, relative_error, scene, variant

ROUNDING = 1e-15
"""Moments times and over a mass: two roundings."""
AGREEMENT = 1e-13
"""Twelve points of some ten operations each, every one good to 1.1e-16 of the largest sum: 900 roundings."""
KEPT = 1e-14
"""What is kept in free motion in closed form, of itself: 40 roundings of turn and rates, 1.1e-16 each."""

FLOWN = 1e-7
"""Of moments of a rigid body, (1000, 1500, 2490) m2, the same flight loses 1.3e-8 by its tolerance."""

WHEEL = [26000.0, 26000.0, 52800.0]
"""m2, of Orbiter's Wheel."""
PORT = {"direction": [0.0, 0.0, 1.0], "alignment": [0.0, 1.0, 0.0]}
ALONE = {
    "name": "wheel",
    "root": "W",
    "convention": "orbiter",
    "vessels": {"W": {"mass": 1e6, "pmi": WHEEL, "ports": {"hub": PORT | {"position": [0.0, 0.0, 1.6]}}}},
}
SHIP = {"mass": 24500.0, "pmi": [15.5, 22.1, 7.7], "ports": {"nose": PORT | {"position": [3.0, 0.0, 10.0]}}}
VISITED = variant(
    ALONE,
    {
        "vessels": ALONE["vessels"] | {"S": SHIP},
        "docks": [{"name": "berth", "ports": ["W.hub", "S.nose"], "docked": False}],
        "inputs": {"docked": ["berth"], "pmi": ["W"], "torque": True},
        "outputs.names": [
            "pmi",
            "inertia",
            "angular_velocity",
            "attitude",
            "angular_momentum",
            "W.angular_momentum",
        ],
    },
)
NOBODYS = [1000.0, 1500.0, 20000.0]
"""m2: the factors of Euler's equations are 18.5, 12.7 and 0.025; a rigid body's are 1 at the most."""
REFERENCE_STATE = [0.6, 0.0, 0.8, 0.0, 0.2, -0.3, 0.1]


def docked_pmi(pmi: list[float]) -> Array:
    """Returns the moments of wheel and ship by their points."""
    return scene_pmi(variant(VISITED, {"vessels.W.pmi": pmi, "docks": [{"ports": ["W.hub", "S.nose"]}]}))


def twin_pmi(twin: Twin, values: dict[str, float]) -> Array:
    p = np.array(twin.p_start)
    for name, value in values.items():
        p[list(twin.p_names).index(name)] = value
    return np.array(twin.composite(p=p)["pmi"]).ravel()


@pytest.mark.parametrize("pmi", [WHEEL, NOBODYS, [40.0, 30.0, 20.0]], ids=["wheel", "nobody's", "rigid"])
def test_a_lone_vessel_has_its_moments_as_they_are_given(pmi):
    alone = scene(variant(ALONE, {"vessels.W.pmi": pmi}))
    assert relative_error(reference.composite(alone).pmi, pmi) < ROUNDING
    twin = Twin(alone)
    assert relative_error(twin_pmi(twin, {}), pmi) < ROUNDING


def test_while_all_its_docks_are_open_the_root_is_alone_and_else_its_points_count():
    flown = scene(VISITED)
    twin = Twin(flown)
    for docked, expected in ((0.0, WHEEL), (1.0, docked_pmi(WHEEL))):
        values = {"berth.docked": docked}
        assert relative_error(reference.composite(flown, values).pmi, expected) < AGREEMENT
        assert relative_error(twin_pmi(twin, values), expected) < AGREEMENT
    assert docked_pmi(WHEEL)[0] > 26100.0


def test_an_fmu_goes_from_given_moments_to_points_and_back_as_docks_close_and_open():
    with flying(VISITED) as fmu:
        assert relative_error(fmu.get("pmi"), WHEEL) < ROUNDING
        assert relative_error(fmu.get("inertia"), np.diag(WHEEL).ravel() * 1e6) < ROUNDING
        for docked, expected in ((1.0, docked_pmi(WHEEL)), (0.0, np.array(WHEEL)), (1.0, docked_pmi(WHEEL))):
            assert fmu.set({"berth.docked": docked}) == OK
            assert relative_error(fmu.get("pmi"), expected) < AGREEMENT
            assert fmu.step(0.1) == OK
            assert relative_error(fmu.get("pmi"), expected) < AGREEMENT
        assert fmu.set({"berth.docked": 0.0, "W.pmi": NOBODYS}) == OK
        assert relative_error(fmu.get("pmi"), NOBODYS) < ROUNDING
        assert fmu.set({"W.pmi": [1.0, 1.0, 0.0]}) == OK
        assert fmu.get_status("pmi") != OK


def test_docking_changes_the_rate_as_the_rules_for_docks_have_it_with_the_moments_of_points():
    raw, rate = variant(VISITED, {"rotation.angular_velocity": [0.02, -0.03, 0.01]}), [0.02, -0.03, 0.01]
    closed = {"berth.docked": 1.0, "berth.velocity[1]": 0.5, "berth.rate[3]": -0.1}
    flown = scene(raw)
    truth = reference.change(flown, rate, {}, closed)
    assert relative_error(truth, rate) > 1e-6
    still = reference.change(flown, rate, {}, {"berth.docked": 1.0})
    assert relative_error(still, rate) < ROUNDING
    with flying(raw) as fmu:
        assert fmu.set(closed) == OK
        assert relative_error(fmu.get("angular_velocity"), truth) < AGREEMENT
        assert fmu.set({"berth.docked": 0.0}) == OK
        assert relative_error(fmu.get("pmi"), WHEEL) < ROUNDING
        assert relative_error(fmu.get("angular_velocity"), rate) < ROUNDING  # as if it had never docked


def test_an_fmu_turns_with_the_moments_that_are_given():
    """What is kept without torque: momentum along inertial axes, and energy."""
    raw = variant(VISITED, {"vessels.W.pmi": NOBODYS, "rotation.angular_velocity": [0.02, -0.03, 0.01]})
    with flying(raw) as fmu:
        before = fmu.get("angular_momentum")
        assert relative_error(before, 1e6 * np.array(NOBODYS) * [0.02, -0.03, 0.01]) < ROUNDING
        energy = NOBODYS @ np.square(fmu.get("angular_velocity"))
        assert fmu.set({"torque": [1e-9, 0.0, 0.0]}) == OK  # so that steps are taken
        assert fmu.step(60.0) == OK
        assert relative_error(fmu.get("angular_momentum"), before) < FLOWN
        assert relative_error(fmu.get("W.angular_momentum"), fmu.get("angular_momentum")) < KEPT
        assert NOBODYS @ np.square(fmu.get("angular_velocity")) == pytest.approx(energy, rel=FLOWN)


@pytest.mark.parametrize("angle", [1e-3, 2.0**-5.5, 2.0**-4.9, 0.7, 8.0])
@pytest.mark.parametrize("pmi", [WHEEL, NOBODYS, [1.0, 2.0, 200.0]], ids=["wheel", "nobody's", "very flat"])
def test_free_motion_keeps_momentum_and_energy_of_moments_that_nobody_has(pmi, angle):
    """Below 2^-5 rad the twin's step is a series, whose terms grow with the factors of Euler's equations."""
    twin = Twin(scene(variant(ALONE, {"vessels.W.pmi": pmi})), propagator="exact", doublings=14)
    x = np.array(REFERENCE_STATE)
    x[4:] *= 1.0 / np.linalg.norm(x[4:])
    end = np.array(twin.step(x=x, p=twin.p_start, h=angle)["x_next"]).ravel()
    momenta = [reference.rotation_matrix(s[:4]) @ (pmi * s[4:]) for s in (x, end)]
    assert np.abs(momenta[1] - momenta[0]).max() < KEPT * np.linalg.norm(momenta[0])
    assert pmi @ np.square(end[4:]) == pytest.approx(pmi @ np.square(x[4:]), rel=KEPT)


def test_a_vessels_own_momentum_is_the_whole_of_it_while_it_is_alone():
    flown = scene(VISITED)
    outputs = reference.vessel_outputs(flown, REFERENCE_STATE)
    whole = reference.angular_momentum(flown, REFERENCE_STATE[4:])
    R = reference.rotation_matrix(REFERENCE_STATE[:4])
    assert relative_error(outputs["W.angular_momentum"], R @ whole) < ROUNDING


@pytest.mark.parametrize("docked", [0.0, 1.0])
def test_the_energy_of_the_whole_is_by_the_tensor_of_the_convention(docked):
    flown = scene(variant(VISITED, {"outputs.names": ["total_kinetic_energy", "kinetic_energy"]}))
    twin = Twin(flown)
    p = np.array(twin.p_start)
    p[list(twin.p_names).index("berth.docked")] = docked
    found = np.array(twin.outputs(x=REFERENCE_STATE, u=[0.0, 0.0, 0.0], p=p)["y"]).ravel()
    true = reference.total_kinetic_energy(flown, REFERENCE_STATE, {"berth.docked": docked})
    assert found == pytest.approx([true, true], rel=AGREEMENT)


@pytest.mark.parametrize(
    "changes",
    [
        {"docks": [{"ports": ["W.hub", "S.nose"]}], "inputs.docked": None},
        {"docks": [{"ports": ["W.hub", "S.nose"]}], "inputs.docked": None, "inputs.pose": ["W.hub"]},
        {
            "docks": [],
            "inputs.docked": None,
            "mounts": [{"parent": "W", "child": "S", "position": [0, 0, 9]}],
        },
    ],
    ids=["a dock for ever", "a dock whose port moves", "a mount"],
)
def test_a_root_that_is_never_alone_has_its_points_for_ever(changes):
    raw = variant(VISITED, changes | {"outputs.names": ["pmi"]})
    flown = scene(raw)
    assert not alone_as_given(flown)
    assert reference.composite(flown).pmi[0] > 26100.0
    assert relative_error(twin_pmi(Twin(flown), {}), reference.composite(flown).pmi) < AGREEMENT


def test_moments_of_a_rigid_body_need_no_second_way():
    assert not alone_as_given(parse_scene(variant(ALONE, {"vessels.W.pmi": [40.0, 30.0, 20.0]})))
    assert not alone_as_given(
        parse_scene(variant(ALONE, {"vessels.W.pmi": [4.0, 3.0, 2.0], "convention": "rigid_body"}))
    )


@pytest.mark.parametrize(
    ("changes", "place"),
    [
        ({"outputs.names": ["pmi", "error_bound"]}, "outputs.names: error_bound"),
        ({"accuracy": {"attitude": 1e-6, "horizon": 60.0, "step": 1.0}}, "accuracy"),
    ],
    ids=["error_bound", "accuracy"],
)
def test_no_error_is_bounded_with_moments_that_nobody_has(changes, place):
    with pytest.raises(SceneError) as caught:
        parse_scene(variant(ALONE, changes))
    assert caught.value.problems == (
        f'{place}: by convention = "orbiter" W alone turns with its moments as given, which may be those of '
        "no rigid body: no error is bounded",
    )
    parse_scene(variant(ALONE, changes | {"vessels.W.pmi": [40.0, 30.0, 20.0]}))


def test_a_lone_vessel_that_cannot_turn_is_refused():
    with pytest.raises(SceneError, match="has principal moments 0, 1000000, 1000000 kg m2: must be positive"):
        parse_scene(variant(ALONE, {"vessels.W.pmi": [0.0, 1.0, 1.0]}))
