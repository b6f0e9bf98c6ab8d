"""`[gravity]` and `[experiment.orbit]`: where a flight starts, and what contradicts itself."""

import tomllib

import pytest

from supervessel import SceneError, parse_scene
from supervessel.scene.variables import input_variables
from supervessel.scene.writing import scene_text
from support import variant
from support.orbits import EARTH, HEIGHT, ORBIT, orbiting

STARTS = "the inputs gravity.position and gravity.velocity start from it"
NONE = "without effect; put gravity = true under [inputs]"
HERE = {"mu": EARTH, "position": [HEIGHT, 0.0, 0.0], "velocity": [0.0, 7000.0, 0.0]}


def test_the_inputs_start_where_the_orbit_does():
    scene = parse_scene(orbiting({}))
    starts = {v.name: v.start for v in input_variables(scene) if v.part == "field"}
    assert list(starts) == [f"gravity.{key}[{i}]" for key in ("position", "velocity") for i in (1, 2, 3)]
    assert list(starts.values()) == [*ORBIT["position"], *ORBIT["velocity"]]


def test_a_scene_without_orbit_says_where_they_start():
    scene = parse_scene(orbiting({"gravity": HERE, "experiment": None}))
    assert scene.gravity_start == (tuple(HERE["position"]), tuple(HERE["velocity"]))


def test_an_orbit_is_written_as_it_is_read():
    scene = parse_scene(orbiting({}))
    assert parse_scene(tomllib.loads(scene_text(scene))) == scene


def test_where_nothing_flies_by_the_scene_a_course_may_move_the_inputs():
    moved = {"experiment": {"duration": 1.0, "step": 1.0, "inputs": {"gravity.position[1]": [[0.0, 7e6]]}}}
    assert parse_scene(orbiting({"gravity": HERE, **moved})).experiment.orbit is None


@pytest.mark.parametrize(
    ("changes", "problems"),
    [
        (
            {"experiment.orbit": None},
            [f"gravity.{key}: missing, and no [experiment.orbit]; {STARTS}" for key in ORBIT],
        ),
        (
            {"gravity": HERE},
            [
                f"gravity.{key}: given beside [experiment.orbit], where the flight starts; leave it out"
                for key in ORBIT
            ],
        ),
        ({"inputs.gravity": False}, [f"gravity: {NONE}", f"experiment.orbit: {NONE}"]),
        ({"inputs.gravity": False, "gravity": None}, [f"experiment.orbit: {NONE}"]),
        (
            {"gravity": None},
            ["gravity.mu: missing; inputs.gravity = true needs the centre's gravitational parameter [m3/s2]"],
        ),
        (
            {"experiment.inputs": {"gravity.velocity[3]": [[0.0, 1.0]]}},
            [
                'experiment.inputs."gravity.velocity[3]": given beside [experiment.orbit], which moves it; '
                "leave it out"
            ],
        ),
        (
            {"experiment.orbit": ORBIT | {"velocity": [0.0, 1.0]}},
            ["experiment.orbit.velocity = [0.0, 1.0] m/s: must be three finite numbers"],
        ),
        ({"experiment.orbit": {"position": ORBIT["position"]}}, ["experiment.orbit.velocity: missing"]),
        (
            {"experiment.orbit": ORBIT | {"mu": 1.0}},
            ['experiment.orbit: unknown key "mu"; known: position, velocity'],
        ),
        ({"experiment.orbit": 6.8e6}, ["experiment.orbit = 6800000.0: must be a table"]),
        (
            {"experiment.orbit": ORBIT | {"position": [0, 0, 0]}},
            ["experiment.orbit.position = [0.0, 0.0, 0.0] m: must have a length greater than 0"],
        ),
        (
            {"experiment.orbit": {"position": [7e6, 0.0, 0.0], "velocity": [-10.0, 0.0, 0.0]}},
            [
                "experiment.orbit.velocity = [-10.0, 0.0, 0.0] m/s: must not be zero or along the position: "
                "the path goes through the attracting centre"
            ],
        ),
    ],
)
def test_what_contradicts_itself_is_refused(changes, problems):
    with pytest.raises(SceneError) as caught:
        parse_scene(orbiting(changes))
    assert list(caught.value.problems) == problems


def test_a_place_that_has_no_meaning_at_the_start_is_refused():
    ball = {
        "name": "ball",
        "root": "B",
        "vessels": {"B": {"mass": 1000.0, "pmi": [1.0, 1.0, 1.0]}},
        "inputs": {"gravity": True},
        "gravity": {"mu": EARTH, "position": [3.4, 0.7, 0.0], "velocity": [0.0, 7000.0, 0.0]},
    }
    near = "m: must be longer than 3.4641 m, twice the assembly's size"
    for changes, expected in (
        ({"gravity.position": [3.4, 0.0, 0.0]}, [f"gravity.position = [3.4, 0.0, 0.0] {near}"]),
        ({"gravity.position": [0.0, 0.0, 0.0]}, [f"gravity.position = [0.0, 0.0, 0.0] {near}"]),
        (
            {"gravity.velocity": [0.0, -1e101, 0.0]},
            ["gravity.velocity = [0.0, -1e+101, 0.0] m/s: must be at most 1e+100 m/s long"],
        ),
        (
            {"gravity.position": [0.0, 0.0, 1e200]},
            ["gravity.position = [0.0, 0.0, 1e+200] m: must be at most 1e+100 m long"],
        ),
        (
            {
                "gravity": {"mu": 1.0},
                "experiment": {
                    "duration": 1.0,
                    "step": 1.0,
                    "orbit": {"position": [1.0, 0.0, 0.0], "velocity": [0.0, 1.0, 0.0]},
                },
            },
            [f"experiment.orbit.position = [1.0, 0.0, 0.0] {near}"],
        ),
    ):
        with pytest.raises(SceneError) as caught:
            parse_scene(variant(ball, changes))
        assert list(caught.value.problems) == expected
    assert parse_scene(ball).gravity


def test_an_accuracy_needs_the_orbit():
    accuracy = {"attitude": 1e-3, "horizon": 10.0, "step": 1.0}
    raw = orbiting({"gravity": HERE, "experiment": None, "accuracy": accuracy})
    ranges = {"torque": [-1.0, 1.0], "DG.mass": [1e4, 2.45e4], "DG.pmi": [7.0, 23.0]}
    raw = variant(raw, {"inputs.range": ranges, "inputs.pose": []})
    with pytest.raises(SceneError) as caught:
        parse_scene(raw)
    needed = "experiment.orbit: missing; [accuracy] flies along it where inputs.gravity is true"
    assert list(caught.value.problems) == [needed]
