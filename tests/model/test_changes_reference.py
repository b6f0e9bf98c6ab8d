"""What changes of inputs do, by the numpy reference, against closed forms worked by hand."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from supervessel import reference
from support import EPS, Array, random_rotation, scene, variant

# Two bodies on a common x axis, ports towards each other: the ship is turned half a turn about y.
BASE, SHIP = 800.0, 200.0  # kg
BASE_PMI, SHIP_PMI = (2.0, 3.0, 4.0), (0.5, 0.75, 1.0)  # m2
REACH, NOSE = 4.0, 1.0  # m, from the centre of mass of base and of ship to the port
APART = REACH + NOSE
REDUCED = BASE * SHIP / (BASE + SHIP)
TURNED = np.diag([-1.0, 1.0, -1.0])  # R_base_ship

# A dozen points, ten roundings each, and the condition of a tensor whose moments are 20 times apart.
TOLERANCE = 256 * EPS
ATTITUDE = (0.5, -0.5, 0.7, 0.1)

PAIR: dict[str, Any] = {
    "name": "pair",
    "root": "base",
    "vessels": {
        "base": {
            "mass": BASE,
            "pmi": list(BASE_PMI),
            "ports": {
                "fore": {"position": [REACH, 0.0, 0.0], "direction": [1, 0, 0], "alignment": [0, 1, 0]}
            },
            "points": {"rcs": {"position": [-2.0, 0.0, 0.0]}},
        },
        "ship": {
            "mass": SHIP,
            "pmi": list(SHIP_PMI),
            "ports": {"nose": {"position": [NOSE, 0.0, 0.0], "direction": [1, 0, 0], "alignment": [0, 1, 0]}},
            "points": {"rcs": {"position": [-1.0, 0.0, 0.0]}},
        },
    },
    "docks": [{"ports": ["base.fore", "ship.nose"], "name": "berth"}],
    "inputs": {
        "mass": ["ship"],
        "pmi": ["ship"],
        "pose": ["base.fore", "ship.nose"],
        "motion": ["base.fore", "ship.nose"],
        "docked": ["berth"],
        "torque": True,
        "force": ["base.rcs", "ship.rcs"],
        "vessel_torque": ["ship"],
    },
}
FREE, JOINED = {"berth.docked": 0.0}, {"berth.docked": 1.0}


def elements(name: str, vector: Sequence[float]) -> dict[str, float]:
    return {f"{name}[{i + 1}]": float(x) for i, x in enumerate(vector)}


def moments(mass: float = SHIP, apart: float = APART) -> Array:
    """Returns the principal moments of the pair, (3,) [kg m2]."""
    reduced = BASE * mass / (BASE + mass)
    own = BASE * np.array(BASE_PMI) + mass * np.array(SHIP_PMI)
    return own + reduced * apart**2 * np.array([0.0, 1.0, 1.0])


def close(value: Any, truth: Any) -> bool:
    return bool(np.abs(np.asarray(value) - truth).max() <= TOLERANCE * np.abs(truth).max())


# Docking


def docked(contact: dict[str, float], raw: dict[str, Any] = PAIR, omega: Any = (0.0, 0.0, 0.0)) -> Array:
    return reference.change(scene(raw), omega, FREE, JOINED | contact)


def test_a_ship_that_arrives_across_the_axis_turns_the_pair() -> None:
    rate = docked(elements("berth.velocity", (0.0, 0.3, 0.0)))
    assert close(rate, [0.0, 0.0, REDUCED * APART * 0.3 / moments()[2]])


def test_a_ship_that_arrives_along_the_axis_turns_nothing() -> None:
    assert docked(elements("berth.velocity", (-0.3, 0.0, 0.0))).tolist() == [0.0, 0.0, 0.0]


def test_a_ship_that_arrives_spinning_about_the_axis_shares_its_momentum() -> None:
    rate = docked(elements("berth.rate", (0.2, 0.0, 0.0)))
    assert close(rate, [SHIP * SHIP_PMI[0] * 0.2 / moments()[0], 0.0, 0.0])


def test_a_ship_that_turns_about_the_common_point_brings_its_spin_and_its_way() -> None:
    rate = docked(elements("berth.rate", (0.0, 0.0, 0.2)))
    brought = (SHIP * SHIP_PMI[2] + REDUCED * APART * NOSE) * 0.2
    assert close(rate, [0.0, 0.0, brought / moments()[2]])


def test_the_motion_at_contact_is_that_of_the_second_port_relative_to_the_first() -> None:
    raw = variant(PAIR, {"docks": [{"ports": ["ship.nose", "base.fore"], "name": "berth"}]})
    v, w = np.array([0.1, 0.3, -0.2]), np.array([0.2, -0.1, 0.3])
    one = docked(elements("berth.velocity", v) | elements("berth.rate", w))
    opposite = elements("berth.velocity", -TURNED @ v) | elements("berth.rate", -TURNED @ w)
    assert close(docked(opposite, raw), one)


def test_a_matched_ship_leaves_the_rate_as_it_is() -> None:
    assert docked({}, omega=(0.1, -0.2, 0.3)).tolist() == [0.1, -0.2, 0.3]


def test_a_dock_that_is_closed_already_adds_nothing() -> None:
    contact = elements("berth.velocity", (0.0, 0.3, 0.0))
    rate = reference.change(scene(PAIR), (0.1, -0.2, 0.3), JOINED, JOINED | contact)
    assert rate.tolist() == [0.1, -0.2, 0.3]


def test_docking_uses_the_new_masses() -> None:
    rate = docked(elements("berth.velocity", (0.0, 0.3, 0.0)) | {"ship.mass": 400.0})
    assert close(rate, [0.0, 0.0, BASE / 3.0 * APART * 0.3 / moments(400.0)[2]])


def test_an_undocked_part_takes_its_own_momentum_along() -> None:
    rate = reference.change(scene(PAIR), (0.1, -0.2, 0.3), JOINED, FREE | {"ship.mass": 400.0})
    assert rate.tolist() == [0.1, -0.2, 0.3]


@pytest.mark.parametrize("law", ["principal", "decoupled"])
def test_docking_uses_the_full_tensor_under_every_law(law: str) -> None:
    # The port stands askew, so that the pair has products of inertia.
    raw = variant(PAIR, {"vessels.base.ports.fore.position": [4.0, 2.0, 1.0]})
    contact = elements("berth.velocity", (0.1, 0.3, 0.2))
    tensor, diagonal = (
        docked(contact, variant(raw, {"rotation": {"law": name}})) for name in ("tensor", law)
    )
    assert tensor.tolist() == diagonal.tolist()
    J = reference.composite(scene(raw)).inertia
    assert close(J @ tensor, REDUCED * np.cross((4.0 + NOSE, 2.0, 1.0), (0.1, 0.3, 0.2)))


# Masses


MASSES = {"rotation": {"mass_change": "momentum"}}


@pytest.mark.parametrize("law", ["tensor", "principal", "decoupled"])
def test_mass_that_arrives_without_momentum_slows_the_pair(law: str) -> None:
    flown = scene(variant(PAIR, {"rotation": MASSES["rotation"] | {"law": law}}))
    omega = np.array([0.1, -0.2, 0.3])
    rate = reference.change(flown, omega, {}, {"ship.mass": 400.0})
    assert close(rate, omega * moments() / moments(400.0))


def test_mass_that_leaves_moving_with_the_body_leaves_the_rate() -> None:
    rate = reference.change(scene(PAIR), (0.1, -0.2, 0.3), {}, {"ship.mass": 50.0})
    assert rate.tolist() == [0.1, -0.2, 0.3]


def test_the_law_none_keeps_the_rate_through_everything() -> None:
    raw = variant(PAIR, {"rotation": {"law": "none"}, "inputs.motion": []})
    after = elements("berth.velocity", (0.0, 0.3, 0.0)) | elements("base.fore.position", (9.0, 0.0, 0.0))
    rate = reference.change(scene(raw), (0.1, -0.2, 0.3), FREE, JOINED | after | {"ship.mass": 50.0})
    assert rate.tolist() == [0.1, -0.2, 0.3]


# Poses


DRAWN_IN = elements("base.fore.position", (1.0, 0.0, 0.0))


def test_a_skater_who_draws_in_the_arms_turns_faster() -> None:
    rate = reference.change(scene(PAIR), (0.1, -0.2, 0.3), {}, DRAWN_IN)
    assert close(rate, np.array([0.1, -0.2, 0.3]) * moments() / moments(apart=1.0 + NOSE))


def test_a_pose_that_shall_keep_the_rate_does() -> None:
    raw = variant(PAIR, {"inputs.motion": [], "rotation": {"pose_change": "rate"}})
    assert reference.change(scene(raw), (0.1, -0.2, 0.3), {}, DRAWN_IN).tolist() == [0.1, -0.2, 0.3]


def test_masses_change_before_poses() -> None:
    omega = np.array([0.1, -0.2, 0.3])
    rate = reference.change(scene(PAIR), omega, {}, DRAWN_IN | {"ship.mass": 400.0})
    assert close(rate, omega * moments(400.0) / moments(400.0, 1.0 + NOSE))


def test_poses_change_before_a_ship_docks() -> None:
    # Drawn in without the ship: nothing but the base is there to keep its momentum.
    contact = elements("berth.velocity", (0.0, 0.3, 0.0))
    rate = reference.change(scene(PAIR), (0.0, 0.0, 0.0), FREE, JOINED | DRAWN_IN | contact)
    apart = 1.0 + NOSE
    assert close(rate, [0.0, 0.0, REDUCED * apart * 0.3 / moments(apart=apart)[2]])


def test_a_ship_leaves_before_masses_and_poses_change() -> None:
    flown, omega = scene(variant(PAIR, {"rotation": MASSES["rotation"]})), (0.1, -0.2, 0.3)
    after = FREE | DRAWN_IN | {"ship.mass": 400.0}
    assert reference.change(flown, omega, JOINED, after).tolist() == list(omega)


# Moving ports


ROTOR = elements("base.fore.rate", (0.2, 0.0, 0.0))
SLIDE = elements("base.fore.velocity", (0.0, 0.3, 0.0))


def test_a_rotor_that_spins_up_turns_the_base_back() -> None:
    rate = reference.change(scene(PAIR), (0.0, 0.0, 0.0), {}, ROTOR)
    assert close(rate, [-SHIP * SHIP_PMI[0] * 0.2 / moments()[0], 0.0, 0.0])


def test_a_port_that_moves_in_the_ship_moves_the_ship_the_other_way() -> None:
    v, w = np.array([0.1, 0.3, -0.2]), np.array([0.2, -0.1, 0.3])
    by_base = elements("base.fore.velocity", v) | elements("base.fore.rate", w)
    by_ship = elements("ship.nose.velocity", -TURNED @ v) | elements("ship.nose.rate", -TURNED @ w)
    one, other = (reference.internal_momentum(scene(PAIR), values) for values in (by_base, by_ship))
    assert close(one, other)


def test_a_sliding_part_turns_the_base_back() -> None:
    rate = reference.change(scene(PAIR), (0.0, 0.0, 0.0), {}, SLIDE)
    assert close(rate, [0.0, 0.0, -REDUCED * APART * 0.3 / moments()[2]])


def test_a_part_that_stops_gives_the_rate_back() -> None:
    omega = np.array([0.1, -0.2, 0.3])
    moving = reference.change(scene(PAIR), omega, {}, ROTOR | SLIDE)
    assert close(reference.change(scene(PAIR), moving, ROTOR | SLIDE, {}), omega)


def test_a_gyrostat_turns_across_its_rotor() -> None:
    # J omega' = -omega x h with omega along z and h along x.
    rate = reference.ode(scene(PAIR), [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.3], None, ROTOR)[4:]
    assert close(rate, [0.0, -0.3 * SHIP * SHIP_PMI[0] * 0.2 / moments()[1], 0.0])


@pytest.mark.parametrize("law", ["tensor", "principal", "decoupled"])
def test_rates_of_momentum_and_of_angular_velocity_agree_between_changes(law: str) -> None:
    flown = scene(variant(PAIR, {"rotation": {"law": law}}))
    values = ROTOR | SLIDE | elements("base.fore.position", (4.0, 2.0, 1.0)) | elements("torque", (5, -7, 3))
    omega = np.array([0.1, -0.2, 0.3])
    momentum = reference.angular_momentum(flown, omega, values)
    assert close(reference.angular_velocity(flown, momentum, values), omega)
    by_momentum = reference.momentum_ode(flown, [1.0, 0.0, 0.0, 0.0, *momentum], values)
    by_rate = reference.ode(flown, [1.0, 0.0, 0.0, 0.0, *omega], None, values)
    J = reference.law_tensor(law, reference.composite(flown, values).inertia)
    assert close(J @ by_rate[4:], by_momentum[4:])
    assert close(by_momentum[:4], by_rate[:4])


# Forces


def test_a_force_acts_about_the_barycentre_of_what_is_docked() -> None:
    flown, force = scene(PAIR), elements("base.rcs.force", (0.0, 10.0, 0.0))
    from_base = SHIP / (BASE + SHIP) * APART
    assert close(reference.external_torque(flown, force), [0.0, 0.0, -(2.0 + from_base) * 10.0])
    assert close(reference.external_torque(flown, force | FREE), [0.0, 0.0, -20.0])


def test_a_force_on_a_ship_acts_in_its_axes() -> None:
    flown = scene(PAIR)
    values = elements("ship.rcs.force", (3.0, 10.0, 5.0)) | elements("ship.torque", (1.0, 2.0, 4.0))
    assert close(reference.net_force(flown, values), [-3.0, 10.0, -5.0])
    # The point is a metre behind the ship's centre of mass, four fifths of APART away from the barycentre.
    arm = BASE / (BASE + SHIP) * APART + 1.0
    assert close(reference.external_torque(flown, values), [-1.0, 2.0 + 5.0 * arm, -4.0 + 10.0 * arm])


def test_forces_on_a_ship_that_is_not_there_count_for_nothing() -> None:
    values = elements("ship.rcs.force", (3.0, 10.0, 5.0)) | elements("ship.torque", (1.0, 2.0, 4.0)) | FREE
    assert reference.external_torque(scene(PAIR), values).tolist() == [0.0, 0.0, 0.0]
    assert reference.net_force(scene(PAIR), values).tolist() == [0.0, 0.0, 0.0]


# Vessels


def test_outputs_of_a_vessel() -> None:
    q = np.array(ATTITUDE) / np.linalg.norm(ATTITUDE)
    omega = np.array([0.1, -0.2, 0.3])
    outputs = reference.vessel_outputs(scene(PAIR), [*q, *omega], ROTOR)
    ship = BASE / (BASE + SHIP) * APART
    assert close(outputs["ship.origin"], [ship, 0.0, 0.0])
    assert close(outputs["base.centre_of_mass"], [ship - APART, 0.0, 0.0])
    assert close(reference.rotation_matrix(outputs["ship.attitude"]), TURNED)
    assert close(outputs["ship.angular_velocity"], [-0.3, -0.2, -0.3])
    share = SHIP * (np.array(SHIP_PMI) * [0.3, -0.2, 0.3] + ship**2 * np.array([0.0, -0.2, 0.3]))
    R_inertial_body = reference.rotation_matrix(q)
    assert close(outputs["ship.angular_momentum"], R_inertial_body @ share)


def test_shares_of_momentum_add_up() -> None:
    state = [1.0, 0.0, 0.0, 0.0, 0.1, -0.2, 0.3]
    outputs = reference.vessel_outputs(scene(PAIR), state, ROTOR | SLIDE)
    total = outputs["base.angular_momentum"] + outputs["ship.angular_momentum"]
    assert close(total, reference.angular_momentum(scene(PAIR), state[4:], ROTOR | SLIDE))


def test_outputs_of_a_vessel_that_is_not_there_are_zero() -> None:
    outputs = reference.vessel_outputs(scene(PAIR), [1.0, 0.0, 0.0, 0.0, 0.1, -0.2, 0.3], FREE)
    assert not any(x for name, value in outputs.items() if name.startswith("ship.") for x in value)
    assert outputs["ship.attitude"].shape == (4,)


@pytest.mark.parametrize("seed", range(20))
def test_a_quaternion_gives_its_rotation_back(seed: int) -> None:
    rotation = random_rotation(seed)
    assert np.abs(reference.rotation_matrix(reference.quaternion(rotation)) - rotation).max() <= 32 * EPS


@pytest.mark.parametrize("axis", range(3))
def test_a_quaternion_of_half_a_turn_gives_its_rotation_back(axis: int) -> None:
    rotation = -np.eye(3)
    rotation[axis, axis] = 1.0
    assert np.abs(reference.rotation_matrix(reference.quaternion(rotation)) - rotation).max() <= 32 * EPS


# The graph


def triple(*docks: dict[str, Any]) -> dict[str, Any]:
    """Returns a scene of a hub and two ships, each with two ports."""
    port = {"direction": [1, 0, 0], "alignment": [0, 1, 0]}
    vessels = {
        name: {
            "mass": 1.0,
            "pmi": [1.0, 1.0, 1.0],
            "ports": {"a": port | {"position": [1, 0, 0]}, "b": port | {"position": [0, 1, 0]}},
        }
        for name in ("hub", "one", "two")
    }
    names = [dock["name"] for dock in docks]
    return {
        "name": "triple",
        "root": "hub",
        "vessels": vessels,
        "docks": list(docks),
        "inputs": {"docked": names},
    }


TRIPLE = triple(
    {"ports": ["hub.a", "one.a"], "name": "first"},
    {"ports": ["two.a", "one.b"], "name": "second"},
    {"ports": ["hub.b", "two.b"], "name": "third", "docked": False},
    {"ports": ["hub.a", "two.b"], "name": "fourth", "docked": False},
)


def test_an_occupied_port_is_refused_by_name() -> None:
    with pytest.raises(ValueError, match=r"hub.a - two.b: port hub.a is docked already"):
        reference.change(scene(TRIPLE), np.zeros(3), {}, {"second.docked": 0.0, "fourth.docked": 1.0})


def test_a_loop_is_refused_by_name() -> None:
    with pytest.raises(ValueError, match=r"hub.b - two.b: its vessels are joined already"):
        reference.change(scene(TRIPLE), np.zeros(3), {}, {"third.docked": 1.0})


def test_ships_change_places_at_one_instant() -> None:
    flown, after = scene(TRIPLE), {"first.docked": 0.0, "fourth.docked": 1.0}
    assert list(reference.poses(flown, after)) == ["hub", "two", "one"]
    assert reference.change(flown, (0.1, -0.2, 0.3), {}, after).tolist() == [0.1, -0.2, 0.3]


def test_what_hangs_on_a_ship_that_leaves_leaves_too() -> None:
    assert list(reference.poses(scene(TRIPLE), {"first.docked": 0.0})) == ["hub"]
    assert reference.composite(scene(TRIPLE), {"first.docked": 0.0}).mass == pytest.approx(1.0, rel=6 * EPS)


def test_what_hangs_on_a_ship_that_arrives_moves_with_it() -> None:
    # Both ships arrive as one body: as if the far one had been held by a dock that is always closed.
    whole = variant(
        TRIPLE,
        {"docks": [TRIPLE["docks"][0], {"ports": ["two.a", "one.b"]}], "inputs": {"docked": ["first"]}},
    )
    contact = elements("first.velocity", (0.1, 0.3, -0.2)) | elements("first.rate", (0.2, -0.1, 0.3))
    before, after = {"first.docked": 0.0}, {"first.docked": 1.0} | contact
    one, other = (reference.change(scene(raw), (0.1, -0.2, 0.3), before, after) for raw in (TRIPLE, whole))
    assert one.tolist() == other.tolist()


def test_two_docks_that_close_at_one_instant_add_their_motion() -> None:
    # The first ship touches the hub as the second touches the first one, of which it is the first port.
    before = {"first.docked": 0.0, "second.docked": 0.0}
    contacts = [
        elements("first.velocity", (0.1, 0.3, -0.2)) | elements("first.rate", (0.2, -0.1, 0.3)),
        elements("second.velocity", (0.2, -0.4, 0.1)) | elements("second.rate", (-0.3, 0.2, 0.4)),
    ]
    one, other, both = (
        reference.change(scene(TRIPLE), np.zeros(3), before, contact)
        for contact in (*contacts, contacts[0] | contacts[1])
    )
    assert close(both, one + other)
    assert not close(one, 0.5 * both)


# The motion of chains


def chain(count: int, seed: int) -> tuple[dict[str, Any], dict[str, Array]]:
    """Returns a scene of vessels one behind the other, every port moving, and the motion of its ports."""
    rng = np.random.default_rng(seed)
    vessels: dict[str, Any] = {}
    for i in range(count):
        ports = {
            port: {
                "position": (3.0 * rng.normal(size=3)).tolist(),
                "direction": axes[0].tolist(),
                "alignment": axes[1].tolist(),
            }
            for port, axes in (("a", random_rotation(2 * i)), ("b", random_rotation(2 * i + 1)))
        }
        pmi = (1.0 + rng.uniform(size=3)).tolist()
        vessels[f"V{i}"] = {"mass": rng.uniform(1.0, 10.0), "pmi": pmi, "ports": ports}
    docks = [{"ports": [f"V{i}.b", f"V{i + 1}.a"]} for i in range(count - 1)]
    moving = [port for dock in docks for port in dock["ports"]]
    raw = {"name": "chain", "root": "V0", "vessels": vessels, "docks": docks}
    motion = {f"{port}.{key}": rng.normal(size=3) for port in moving for key in ("velocity", "rate")}
    return raw | {"inputs": {"pose": moving, "motion": moving}}, motion


def moved(raw: dict[str, Any], motion: dict[str, Array], time: float) -> dict[str, float]:
    """Returns poses of ports after they have moved at steady velocity and rate for a time."""
    values: dict[str, float] = {}
    for name in raw["inputs"]["pose"]:
        port, w = scene(raw).port(name), motion[f"{name}.rate"]
        angle = time * np.linalg.norm(w)
        half = np.sin(angle / 2) * w / np.linalg.norm(w)
        R = reference.rotation_matrix([np.cos(angle / 2), *half])
        values |= elements(f"{name}.position", np.array(port.position) + time * motion[f"{name}.velocity"])
        values |= elements(f"{name}.direction", R @ port.direction)
        values |= elements(f"{name}.alignment", R @ port.alignment)
    return values


# Central differences over 2e-4 s: third derivatives of a chain of five at rates of some rad/s are about
# rate^3 size = 1e4 times h^2 / 6, rounding about 1e-16 size / h.
DIFFERENCE, DIFFERENCE_ERROR = 1e-4, 1e-4


@pytest.mark.parametrize("seed", range(5))
def test_motion_along_a_chain_is_the_rate_of_its_poses(seed: int) -> None:
    raw, motion = chain(5, seed)
    flown = scene(raw)
    values = {k: v for name, vector in motion.items() for k, v in elements(name, vector).items()}
    later, sooner = (reference.poses(flown, moved(raw, motion, t)) for t in (DIFFERENCE, -DIFFERENCE))
    for vessel, m in reference.motions(flown, values).items():
        R_dot, velocity = (
            (a - b) / (2 * DIFFERENCE) for a, b in zip(later[vessel], sooner[vessel], strict=True)
        )
        spin = R_dot @ m.rotation.T
        rate = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
        assert np.abs(rate - m.rate).max() <= DIFFERENCE_ERROR
        assert np.abs(velocity - m.velocity).max() <= DIFFERENCE_ERROR


@pytest.mark.parametrize("seed", range(5))
def test_internal_momentum_is_that_of_the_parts(seed: int) -> None:
    raw, motion = chain(5, seed)
    flown = scene(raw)
    values = {k: v for name, vector in motion.items() for k, v in elements(name, vector).items()}
    placed, mass = reference.motions(flown, values), {v: t.mass for v, t in flown.vessels.items()}
    total = sum(mass.values())
    c, c_dot = (sum(mass[v] * x for v, x in places.items()) / total for places in ways(placed))
    parts = [
        mass[v] * np.cross(m.origin - c, m.velocity - c_dot)
        + m.rotation @ (mass[v] * np.array(flown.vessels[v].pmi) * (m.rotation.T @ m.rate))
        for v, m in placed.items()
    ]
    scale = np.abs(parts).sum()
    assert (
        np.abs(reference.internal_momentum(flown, values) - np.sum(parts, axis=0)).max() <= 64 * EPS * scale
    )


def ways(placed: dict[str, reference.Motion]) -> tuple[dict[str, Array], dict[str, Array]]:
    return {v: m.origin for v, m in placed.items()}, {v: m.velocity for v, m in placed.items()}
