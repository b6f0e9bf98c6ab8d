"""What docks carry and points feel: closed forms, Newton's law by parts, sums over the whole, differences."""

import numpy as np
import pytest

from changes.histories import elements
from loads.scenes import drawn, dumbbell, shown, tree
from supervessel import reference
from supervessel.scene.outputs import DOCK_OUTPUTS, POINT_OUTPUTS
from support import OK, Array, Instance, U, hamilton, scene, variant
from support.orbits import EARTH

KINDS = (*DOCK_OUTPUTS, *POINT_OUTPUTS)
AGREEMENT = 256 * U
"""Of the largest number of a kind: poses go down a chain of up to seven vessels, dozens of roundings each."""


def largest(found: dict[str, Array], kind: str) -> float:
    return max((np.abs(v).max() for name, v in found.items() if name.endswith(f".{kind}")), default=0.0)


# Against Newton's law for the sample points of each vessel


@pytest.mark.parametrize("gravity", [False, True], ids=["free", "gravity"])
@pytest.mark.parametrize("wheels", [False, True], ids=["plain", "wheels"])
@pytest.mark.parametrize("law", ["decoupled", "principal", "tensor"])
def test_loads_and_points_of_random_trees_are_the_references(law, wheels, gravity):
    for seed in range(2):
        flown = scene(tree(seed, 2 + 5 * (seed % 2), wheels=wheels, gravity=gravity, held=3, law=law))
        x, values = drawn(flown, seed)
        found = shown(flown, x, values)
        true = reference.loads(flown, x, values) | reference.point_outputs(flown, x, values)
        for kind in KINDS:
            bound = AGREEMENT * largest(true, kind)
            assert all(np.abs(found[n] - true[n]).max() <= bound for n in found if n.endswith(f".{kind}"))


def test_a_dock_that_is_open_or_off_the_root_carries_nothing():
    flown = scene(tree(11, 7, wheels=True, gravity=True))
    x, values = drawn(flown, 11)
    for name in flown.inputs.docked:
        values[f"{name}.docked"] = 0.0
    found = shown(flown, x, values)
    loads = [found[f"{name}.{kind}"] for name in flown.inputs.docked for kind in DOCK_OUTPUTS]
    assert loads
    assert not np.any(loads)


def test_what_is_mounted_beyond_a_dock_hangs_on_it():
    raw = dumbbell((300.0, 500.0), (4.0, 2.5))
    boom = {"mass": 40.0, "pmi": [0.1, 2.0, 2.0]}
    mount = {"parent": "B", "child": "boom", "position": [0.5, 3.0, 0.0], "attitude": [0.9, 0.1, -0.3, 0.3]}
    other = {"parent": "dish", "child": "A", "position": [0.0, -1.0, 2.0]}
    vessels = raw["vessels"] | {"boom": boom, "dish": boom | {"mass": 70.0}}
    for root in vessels:
        flown = scene(variant(raw, {"vessels": vessels, "mounts": [mount, other], "root": root}))
        x = np.array([1.0, 0, 0, 0, 0.3, -0.2, 0.5])
        found, true = shown(flown, x, {}), reference.loads(flown, x)
        for kind in DOCK_OUTPUTS:
            assert np.abs(found[f"bar.{kind}"] - true[f"bar.{kind}"]).max() <= AGREEMENT * largest(true, kind)


# The sum over everything: a load from the vessels on one side of a dock is that from those on the other


@pytest.mark.parametrize("gravity", [False, True], ids=["free", "gravity"])
@pytest.mark.parametrize("wheels", [False, True], ids=["plain", "wheels"])
@pytest.mark.parametrize("seed", range(2))
def test_the_load_is_the_same_whatever_vessel_is_the_root_and_whichever_port_stands_first(
    seed, wheels, gravity
):
    raw = tree(seed, 4, wheels=wheels, gravity=gravity)
    docks = [dock | {"docked": True, "name": f"N{i}"} for i, dock in enumerate(raw["docks"][:3])]
    names = [f"{dock['name']}.{kind}" for dock in docks for kind in DOCK_OUTPUTS]
    inputs = raw["inputs"] | {
        "docked": [],
        "pose": [],
        "torque": False,
        "vessel_torque": list(raw["vessels"]),
    }
    raw = variant(raw, {"docks": docks, "inputs": inputs, "outputs.names": names})
    flown = scene(raw)
    x, values = drawn(flown, seed)
    poses = reference.poses(flown)
    R_root_other = poses["V3"][0]
    attitude = hamilton(x[:4], reference.quaternion(R_root_other))
    turned = np.array([*attitude, *(R_root_other.T @ x[4:7]), *x[7:]])
    reversed_docks = [dock | {"ports": dock["ports"][::-1]} for dock in docks]
    one = shown(flown, x, values)
    other = shown(scene(variant(raw, {"root": "V3"})), turned, values)
    back = shown(scene(variant(raw, {"docks": reversed_docks})), x, values)
    for dock in docks:
        first, second = (poses[port.partition(".")[0]][0] for port in dock["ports"])
        for kind in DOCK_OUTPUTS:
            name, bound = f"{dock['name']}.{kind}", AGREEMENT * largest(one, kind)
            assert np.abs(one[name] - other[name]).max() <= bound
            assert np.abs(first @ one[name] + second @ back[name]).max() <= bound


# Closed forms


def test_a_spinning_dumbbell_pulls_with_m_omega_squared_d():
    masses, arms, omega = (300.0, 500.0), (4.0, 2.5), 0.7
    flown = scene(dumbbell(masses, arms))
    distance = sum(arms) * masses[0] / sum(masses)
    found = shown(flown, np.array([1.0, 0, 0, 0, 0, 0, omega]), {})
    pull = masses[1] * omega**2 * distance
    assert found["bar.force"] == pytest.approx([-pull, 0.0, 0.0], abs=8 * U * pull)
    assert found["bar.moment"] == pytest.approx(np.zeros(3), abs=8 * U * pull * sum(arms))


def test_a_vertical_tether_on_a_circular_orbit_pulls_with_three_n_squared_m_d():
    # x along the radius, turning with the orbit about z: m (omega^2 + 2 n^2) d, omega = n.
    masses, arms, distance = (300.0, 500.0), (400.0, 250.0), 6.786e6
    rate = np.sqrt(EARTH / distance**3)
    place = {"mu": EARTH, "position": [distance, 0.0, 0.0], "velocity": [0.0, rate * distance, 0.0]}
    flown = scene(variant(dumbbell(masses, arms), {"gravity": place, "inputs.gravity": True}))
    found = shown(flown, np.array([1.0, 0, 0, 0, 0, 0, rate]), {})
    pull = 3.0 * rate**2 * masses[1] * sum(arms) * masses[0] / sum(masses)
    assert found["bar.force"] == pytest.approx([-pull, 0.0, 0.0], abs=16 * U * pull)
    assert found["bar.moment"] == pytest.approx(np.zeros(3), abs=16 * U * pull * sum(arms))


def test_a_push_behind_the_dock_is_carried_by_it_in_the_ratio_of_the_masses():
    # An engine on B pushes along x: A receives m_A/M of the thrust through the dock, B the opposite.
    masses, thrust = (300.0, 500.0), 40.0
    pushed = {"vessels.B.points": {"engine": {"position": [2.5, 0.0, 0.0]}}, "inputs.force": ["B.engine"]}
    flown = scene(variant(dumbbell(masses, (4.0, 2.5)), pushed))
    found = shown(flown, np.array([1.0, 0, 0, 0, 0, 0, 0]), {"B.engine.force[1]": -thrust})
    share = thrust * masses[0] / sum(masses)
    assert found["bar.force"] == pytest.approx([share, 0.0, 0.0], abs=8 * U * thrust)


@pytest.mark.parametrize("law", ["decoupled", "principal", "none"])
def test_under_a_law_that_leaves_products_out_the_load_is_that_of_the_motion_that_the_law_has(law):
    flown = scene(tree(3, 4, wheels=False, gravity=False, law=law))
    x, values = drawn(flown, 3)
    true, found = reference.loads(flown, x, values), shown(flown, x, values)
    assert all(
        np.abs(found[n] - true[n]).max() <= AGREEMENT * largest(true, n.rpartition(".")[2]) for n in true
    )


# Differences of a flown point


def test_the_specific_force_is_the_second_difference_of_a_flown_points_place():
    # Relative to the barycentre, whose own acceleration by forces is F/M. Differences of five places of a
    # flight of the FMU leave terms of the order of h^4, and rounding of places over h^2.
    raw = tree(5, 3, wheels=True, gravity=False, propagator="taylor", tolerance=1e-15)
    names = [
        "V1.rcs.position",
        "V1.rcs.velocity",
        "V1.rcs.acceleration",
        "V1.rcs.specific_force",
        "attitude",
        "net_force",
        "mass",
    ]
    raw = variant(raw, {"outputs.names": names})
    flown = scene(raw)
    x, values = drawn(flown, 5)
    values |= elements("angular_velocity_start", x[4:7])
    values |= {name: 1.0 for name in values if name.endswith(".docked") and name.startswith("D")}
    values |= {name: 0.0 for name in values if name.endswith(".docked") and name.startswith("E")}
    h, count = 0.02, 5
    instance = Instance(raw, optimised=False)
    assert instance.initialise(**values) == OK, instance.log
    rows = []
    for _ in range(count):
        rows.append({name: instance.get(name) for name in names})
        assert instance.step(h) == OK, instance.log
    instance.free()
    R = [reference.rotation_matrix(row["attitude"]) for row in rows]
    places = [turn @ row["V1.rcs.position"] for turn, row in zip(R, rows, strict=True)]
    first = (8 * (places[3] - places[1]) - (places[4] - places[0])) / (12 * h)
    second = (16 * (places[3] + places[1]) - (places[4] + places[0]) - 30 * places[2]) / (12 * h * h)
    row, turn = rows[2], R[2]
    size, rate = np.abs(places).max(), np.linalg.norm(x[4:7])
    of_order, of_rounding = (rate * h) ** 4, 64 * U / (rate * h)
    assert np.abs(turn @ row["V1.rcs.velocity"] - first).max() <= size * rate * (of_order + of_rounding)
    allowed = size * rate**2 * (of_order + of_rounding / (rate * h))
    assert np.abs(turn @ row["V1.rcs.acceleration"] - second).max() <= allowed
    felt = row["V1.rcs.acceleration"] + row["net_force"] / row["mass"]
    assert np.abs(row["V1.rcs.specific_force"] - felt).max() <= 4 * U * np.abs(felt).max()


@pytest.mark.parametrize("mass", [1.0, 1e-6, 1e-12, 0.0])
@pytest.mark.parametrize("root", ["A", "B"])
def test_a_light_vessel_at_a_heavy_one_loses_no_digits_whichever_is_the_root(root, mass):
    # The load is what moves the light one: m s, at its centre of mass, of the motion that the heavy one has.
    raw = dumbbell((4e5, mass), (20.0, 2.0))
    raw = variant(raw, {"root": root, "inputs": {"torque": True}})
    flown, x = scene(raw), np.array([1.0, 0, 0, 0, 0.01, 0.02, 0.03])
    values = {} if root == "B" else {"torque[1]": 1000.0}
    found = shown(flown, x, values)
    motion = reference.ode(flown, x, values=values)[4:7]
    place = np.array([22.0 * 4e5 / (4e5 + mass), 0.0, 0.0])
    felt = np.cross(motion, place) + np.cross(x[4:7], np.cross(x[4:7], place))
    assert np.abs(found["bar.force"] - mass * felt).max() <= 16 * U * mass * np.abs(felt).max()
