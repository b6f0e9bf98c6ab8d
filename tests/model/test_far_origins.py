"""Vessels whose axes begin far from all that is in them: the tensor loses no digits by it."""

from collections.abc import Sequence
from typing import Any

import mpmath
import numpy as np
import pytest

from supervessel import Twin, parse_scene
from support import OK, flying, variant

mp = mpmath.MPContext()
mp.dps = 60
U = 2.0**-53
# Turned tensors and offsets: three rotations of a dozen roundings each, twice in an offset.
J_ULPS = 64

SCENE: dict[str, Any] = {
    "name": "far",
    "root": "A",
    "vessels": {
        "A": {
            "mass": 1000.0,
            "pmi": [1.0, 2.0, 2.5],
            "ports": {
                "p": {
                    "position": [3.0, 1.0, 2.0],
                    "direction": [1.0, 2.0, 3.0],
                    "alignment": [3.0, 0.0, -1.0],
                },
                "q": {
                    "position": [-4.0, 1.0, 2.0],
                    "direction": [-1.0, 0.2, 0.3],
                    "alignment": [0.0, 0.3, -0.2],
                },
            },
            "points": {"jet": {"position": [0.5, -2.0, 1.0]}},
        },
        "B": {
            "mass": 700.0,
            "pmi": [1.0, 1.5, 2.0],
            "ports": {
                "p": {
                    "position": [1.0, -2.0, 1.0],
                    "direction": [1.0, -1.0, 2.0],
                    "alignment": [1.0, 1.0, 0.0],
                }
            },
            "points": {"jet": {"position": [1.0, 1.0, -1.0]}},
        },
        "C": {
            "mass": 300.0,
            "pmi": [1.0, 1.5, 2.0],
            "ports": {
                "p": {
                    "position": [1.0, -2.0, 1.5],
                    "direction": [1.0, -1.0, 0.2],
                    "alignment": [1.0, 1.0, 0.0],
                }
            },
        },
    },
    "docks": [{"ports": ["A.p", "B.p"], "name": "berth"}, {"ports": ["A.q", "C.p"]}],
    "outputs": {"names": ["inertia", "barycentre"]},
}

FAR = {"A": np.array([0.6, -0.7, 0.4]), "B": np.array([-0.3, 0.5, 0.8]), "C": np.array([0.9, 0.1, -0.2])}


def moved(raw: dict[str, Any], distance: float) -> dict[str, Any]:
    """The scene with the origins of all axes moved: what is in them, rounded, is at that distance."""
    changes: dict[str, Any] = {}
    for name, where in FAR.items():
        vessel, place = raw["vessels"][name], f"vessels.{name}"
        centre = np.array([0.1, 0.2, -0.3])
        changes[f"{place}.centre_of_mass"] = (distance * where + centre).tolist()
        for kind in ("ports", "points"):
            for key, point in vessel.get(kind, {}).items():
                changes[f"{place}.{kind}.{key}.position"] = (distance * where + point["position"]).tolist()
    return variant(raw, changes)


def matrix(v: Sequence[float]) -> Any:
    return mp.matrix([mp.mpf(float(x)) for x in v])


def cross(a: Any, b: Any) -> Any:
    return mp.matrix([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def axes(port: dict[str, Any]) -> Any:
    d, a = matrix(port["direction"]), matrix(port["alignment"])
    d = d / mp.norm(d)
    a = cross(cross(d, a), d)
    a = a / mp.norm(a)
    c = cross(d, a)
    return mp.matrix([[d[i], a[i], c[i]] for i in range(3)])


def truth(raw: dict[str, Any]) -> tuple[Any, Any, dict[str, tuple[Any, Any]]]:
    """Tensor and barycentre of the scene's numbers, which are taken as exact, and the vessels' poses."""
    vessels, poses = raw["vessels"], {"A": (mp.eye(3), mp.zeros(3, 1))}
    for dock in raw["docks"]:
        (a, p), (b, q) = (name.split(".") for name in dock["ports"])
        one, other = vessels[a]["ports"][p], vessels[b]["ports"][q]
        R = axes(one) * mp.diag([-1, 1, -1]) * axes(other).T
        poses[b] = R, matrix(one["position"]) - R * matrix(other["position"])
    masses = {name: mp.mpf(vessel["mass"]) for name, vessel in vessels.items()}
    centres = {name: o + R * matrix(vessels[name]["centre_of_mass"]) for name, (R, o) in poses.items()}
    middle = sum((masses[n] * centres[n] for n in poses), mp.zeros(3, 1)) / sum(masses.values())
    J = mp.zeros(3)
    for name, (R, _) in poses.items():
        r = centres[name] - middle
        own = R * mp.diag([masses[name] * mp.mpf(k) for k in vessels[name]["pmi"]]) * R.T
        J += own + masses[name] * ((r.T * r)[0] * mp.eye(3) - r * r.T)
    return J, middle, poses


def off(found: Any, right: Any) -> float:
    flat = np.ravel(np.array(found), order="F")
    exact = [right[i, j] for j in range(right.cols) for i in range(right.rows)]
    return max(abs(float(mp.mpf(float(a)) - b)) for a, b in zip(flat, exact, strict=True))


INPUTS: dict[str, dict[str, Any]] = {
    "nothing": {},
    "a mass": {"mass": ["B"]},
    "masses": {"mass": ["A", "B", "C"]},
    "moments": {"pmi": ["A", "B", "C"]},
    "a dock": {"docked": ["berth"]},
}


@pytest.mark.parametrize("inputs", INPUTS.values(), ids=INPUTS)
@pytest.mark.parametrize("distance", [0.0, 1e6, 1e9])
def test_origins_far_away_cost_the_tensor_nothing(inputs, distance):
    raw = moved(variant(SCENE, {"inputs": inputs, "rotation": {"propagator": "dop853"}}), distance)
    J, middle, _ = truth(raw)
    twin = Twin(parse_scene(raw))
    found = twin.composite(p=twin.p_start)
    size = float(max(abs(x) for x in J))
    assert off(found["inertia"], J) <= J_ULPS * U * size
    assert (
        off(found["barycentre"], middle) <= J_ULPS * U * 20.0 + 2 * U * distance
    )  # a position itself is so far


def test_ports_with_pose_inputs_cost_digits_by_their_own_numbers():
    """A keeps its origin, 1e6 m away: half an ulp of that four times, twice in an offset of 5 m."""
    raw = moved(variant(SCENE, {"inputs": {"pose": ["A.p"]}, "rotation": {"propagator": "dop853"}}), 1e6)
    J, _, _ = truth(raw)
    twin = Twin(parse_scene(raw))
    error = off(twin.composite(p=twin.p_start)["inertia"], J) / float(max(abs(x) for x in J))
    assert 1e-13 < error <= 8 * U * 1e6


@pytest.mark.parametrize("distance", [0.0, 1e6])
def test_outputs_and_forces_of_vessels_are_where_they_are(distance):
    """Origins are as far as they are; a force turns about the barycentre by its own arm."""
    changes = {
        "inputs": {"mass": ["B"], "force": ["A.jet", "B.jet"]},
        "outputs.names": [
            "angular_velocity",
            *(f"{v}.{k}" for v in "AB" for k in ("origin", "centre_of_mass")),
        ],
        "rotation": {"propagator": "dop853"},
    }
    raw = moved(variant(SCENE, changes), distance)
    J, middle, poses = truth(raw)
    with flying(raw) as fmu:
        for name in "AB":
            R, origin = poses[name]
            centre = origin + R * matrix(raw["vessels"][name]["centre_of_mass"])
            assert off(fmu.get(f"{name}.origin"), origin - middle) <= 4 * J_ULPS * U * (distance + 10.0)
            assert off(fmu.get(f"{name}.centre_of_mass"), centre - middle) <= J_ULPS * U * 10.0
        force = [3.0, -2.0, 5.0]
        assert fmu.set({f"B.jet.force[{i + 1}]": force[i] for i in range(3)}) == OK
        assert fmu.step(1e-3) == OK
        rate = fmu.get("angular_velocity")
    R, origin = poses["B"]
    arm = origin + R * matrix(raw["vessels"]["B"]["points"]["jet"]["position"]) - middle
    expected = mp.lu_solve(J, cross(arm, R * matrix(force))) * mp.mpf(1e-3)
    assert off(rate, expected) <= 1e-6 * float(mp.norm(expected))
