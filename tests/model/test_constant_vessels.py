"""Vessels that are constant are one body: the same bits as symbols would give, and the cost of one vessel."""

import cProfile
import pstats

import casadi as ca
import numpy as np
import pytest

from supervessel import parse_scene, reference
from supervessel.composite.inertia import Body, combine, combine_numbers
from supervessel.equations import composite_at_start, equations
from support import EPS
from support.costs import operations, station


@pytest.mark.parametrize("count", [1, 2, 3, 40])
def test_numbers_are_combined_as_symbols_are_to_the_last_bit(count):
    generator = np.random.default_rng(count)
    masses = generator.uniform(1.0, 1e6, count)
    centres = generator.normal(size=(3, count)) * 1e3
    halves = generator.normal(size=(count, 3, 3))
    inertias = np.array([half @ half.T for half in halves])
    inertias = 0.5 * (inertias + inertias.transpose(0, 2, 1))
    bodies = [
        Body(*(ca.SX(ca.DM(part)) for part in (masses[i], centres[:, i], inertias[i]))) for i in range(count)
    ]
    whole = combine(bodies)
    mass, centre, inertia = combine_numbers(masses, centres, inertias.transpose(1, 2, 0))
    assert mass == float(whole.mass)
    np.testing.assert_array_equal(centre, np.array(ca.DM(whole.centre))[:, 0])
    np.testing.assert_array_equal(inertia, np.array(ca.DM(whole.inertia)))


def test_a_station_of_many_constant_vessels_agrees_with_the_sum_of_points():
    """Each of n terms brings a few roundings of their sum, and each pose on the way some 10."""
    count = 300
    scene = parse_scene(station(count, ["v41", "v200"]))
    of_points, c = reference.composite(scene), composite_at_start(scene)
    (xx, yy, zz, xy, xz, yz), bound = c["inertia"], 100 * count * EPS
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    assert np.abs(inertia - of_points.inertia).max() <= bound * np.abs(of_points.inertia).max()
    farthest = max(np.linalg.norm(origin) for _, origin in reference.poses(scene).values())
    assert np.abs(c["barycentre"] - of_points.barycentre).max() <= bound * farthest


def test_a_station_of_1000_vessels_of_which_two_vary_takes_the_operations_of_three_vessels():
    raw = station(1000, ["v300", "v701"])
    many = parse_scene(raw)
    rest = reference.composite(many, {"v300.mass": 0.0, "v701.mass": 0.0})
    poses = reference.poses(many)
    tensor = 0.5 * (rest.inertia + rest.inertia.T)
    vessels = {"rest": _ported(rest.mass, {"inertia": tensor.tolist()}, rest.barycentre, poses)}
    for name in ("v300", "v701"):
        vessels[name] = _ported(raw["vessels"][name]["mass"], {"pmi": [1.0, 1.2, 1.5]}, np.zeros(3), {})
    docks = [{"ports": [f"rest.{name}", f"{name}.origin"]} for name in ("v300", "v701")]
    three = parse_scene({**raw, "root": "rest", "vessels": vessels, "docks": docks})
    models = [equations(scene) for scene in (many, three)]
    for function in zip(*(model.functions for model in models), strict=True):
        assert operations(function[0]) == operations(function[1]), function[0].name()
    np.testing.assert_allclose(
        composite_at_start(many)["inertia"], composite_at_start(three)["inertia"], rtol=1e4 * EPS
    )


def _ported(mass, moments, centre, poses):
    """Returns a vessel with a port at its origin, and one each where the origins of v300 and v701 stand."""
    facing = {"direction": [1.0, 0.0, 0.0], "alignment": [0.0, 1.0, 0.0]}
    ports = {"origin": {"position": [0.0, 0.0, 0.0], **facing}}
    for name in ("v300", "v701"):
        if name in poses:
            rotation, origin = poses[name]
            axes = {"direction": (-rotation[:, 0]).tolist(), "alignment": rotation[:, 1].tolist()}
            ports[name] = {"position": origin.tolist(), **axes}
    return {"mass": mass, **moments, "centre_of_mass": centre.tolist(), "ports": ports}


def test_the_work_of_reading_a_scene_and_writing_its_equations_grows_as_its_vessels_do():
    """Counted in calls of functions. What grows as the square would double the second increment."""
    equations(parse_scene(station(3, ["v1", "v2"])))
    calls = [_calls(count) for count in (100, 200, 400)]
    first, second = np.diff(calls)
    assert second <= 1.05 * 2.0 * first, calls
    assert second / 200 <= 2000, calls


def _calls(count: int) -> int:
    """Returns the calls of Python's and built-in functions from the raw scene to its equations."""
    raw = station(count, ["v41", "v77"])
    with cProfile.Profile() as profile:
        equations(parse_scene(raw))
    return pstats.Stats(profile).total_calls
