"""`[experiment.inputs]` and `[experiment.orbit]`: what is read and refused, and what holds over each step."""

import numpy as np
import pytest

from fmu_build.flight.choices import Choice, Model, by_tolerance, models, variant_of, ways_to
from fmu_build.flight.experiment import course_of, values
from fmu_build.trade import TradeError
from supervessel import SceneError, parse_scene
from supervessel.orbit import two_body
from support import ISS_DG, variant
from support.orbits import EARTH, HEIGHT, ORBIT, orbiting

RANGE = {"DG.mass": [11000.0, 24500.0]}


def moved(inputs, **changes):
    return variant(
        ISS_DG,
        {"experiment": {"duration": 10.0, "step": 1.0, "inputs": inputs}, "inputs.range": RANGE, **changes},
    )


@pytest.mark.parametrize(
    ("inputs", "problem"),
    [
        ({"DG.mas": [[0, 1]]}, 'experiment.inputs: unknown input "DG.mas" (did you mean "DG.mass"?)'),
        *(
            (
                {"torque": rows},
                'experiment.inputs."torque": the elements of a vector are given one by one: '
                '"torque[1]", "torque[2]", "torque[3]"',
            )
            for rows in ([[0, 1]], [[0, 1, 0, 0]], {"1": [[0, 1]]})
        ),
        (
            {"DG": {"mass": [[0, 1]]}},
            'experiment.inputs.DG: the name of an input stands in quotes here: "DG.mass" = [[time, value]]',
        ),
        (
            {"DG.mass": [[0, 24500], [5, True]]},
            'experiment.inputs."DG.mass": true at 5.0 s: must be a finite number',
        ),
        (
            {"DG.mass": []},
            'experiment.inputs."DG.mass" = []: must be rows [time in s, value] of finite numbers, '
            "at least one",
        ),
        (
            {"DG.mass": [[0, float("nan")]]},
            'experiment.inputs."DG.mass" = [[0, nan]]: must be rows [time in s, value] of finite numbers, '
            "at least one",
        ),
        (
            {"torque[1]": [[-1, 2]]},
            'experiment.inputs."torque[1]" = [[-1, 2]]: must be from time 0 s on, but begins at -1.0 s',
        ),
        (
            {"torque[1]": [[0, 1], [3, 2], [2, 2]]},
            'experiment.inputs."torque[1]" = [[0, 1], [3, 2], [2, 2]]: must be in the order of time, but '
            "row 3, at 2.0 s, follows 3.0 s",
        ),
        (
            {"torque[1]": [[1, 1], [1, 2], [1, 3]]},
            'experiment.inputs."torque[1]" = [[1, 1], [1, 2], [1, 3]]: must be at most two values at one '
            "time, but has three at 1.0 s",
        ),
        (
            {"DG.mass": [[0, 24500], [5, 1000]]},
            'experiment.inputs."DG.mass": 1000.0 kg at 5.0 s: outside inputs.range = [11000.0, 24500.0] kg',
        ),
        (
            {"DG.pmi[2]": [[5, -1]]},
            'experiment.inputs."DG.pmi[2]": -1.0 m2 at 5.0 s: a moment must be >= 0 m2',
        ),
    ],
)
def test_a_course_that_cannot_be_is_refused_by_place_and_value(inputs, problem):
    with pytest.raises(SceneError) as caught:
        parse_scene(moved(inputs))
    assert caught.value.problems == (problem,)


def test_a_dock_opens_and_closes_as_true_and_false_say():
    docks = [{"name": "berth", "ports": ["ISS.P2", "DG.nose"]}]
    raw = moved({"berth.docked": [[0, True], [2, False], [4, True]]}, docks=docks)
    raw["inputs"] |= {"docked": ["berth"], "pose": []}
    course = course_of(parse_scene(raw))
    assert course.booleans["berth.docked"].tolist() == [1, 1, 0, 0, 1, 1, 1, 1, 1, 1]
    for value in (0, 1, 0.5):
        raw["experiment"]["inputs"]["berth.docked"] = [[0, value]]
        with pytest.raises(SceneError, match=rf"{float(value)} at 0\.0 s: must be true or false"):
            parse_scene(raw)


def test_a_scene_whose_docks_move_is_the_same_when_it_is_read_from_its_own_tables():
    docks = [{"name": "berth", "ports": ["ISS.P2", "DG.nose"]}]
    raw = moved({"berth.docked": [[0, True], [2, False]], "torque[1]": [[0, 1], [1, 0]]}, docks=docks)
    raw["inputs"] |= {"docked": ["berth"], "pose": []}
    scene = parse_scene(raw)
    assert parse_scene(scene.model_dump(exclude_none=True)) == scene


def test_an_input_is_linear_between_rows_and_holds_its_ends():
    found = values([(2.0, 10.0), (4.0, 20.0)], np.array([0.0, 2.0, 2.5, 4.0, 9.0]))
    assert found.tolist() == [10.0, 10.0, 12.5, 20.0, 20.0]


def test_an_input_jumps_at_the_step_that_begins_there_though_its_time_is_rounded():
    assert 3 * 0.7 < 2.1  # the communication point that the jump belongs to
    experiment = {"duration": 4.2, "step": 0.7, "inputs": {"torque[1]": [[0, 1], [2.1, 1], [2.1, 5]]}}
    course = course_of(parse_scene(variant(ISS_DG, {"experiment": experiment})))
    assert course.numbers["torque[1]"].tolist() == [1, 1, 1, 5, 5, 5]


@pytest.mark.parametrize(
    ("duration", "step", "steps", "last"),
    [(1.0, 0.1, 10, 0.1), (1.0, 0.3, 4, 0.1), (1.0, 1.0, 1, 1.0), (0.7, 0.1, 7, 0.1)],
)
def test_the_last_step_ends_with_the_experiment(duration, step, steps, last):
    scene = parse_scene(variant(ISS_DG, {"experiment": {"duration": duration, "step": step}}))
    course = course_of(scene)
    assert course.steps == steps
    assert course.last_size == pytest.approx(last, rel=1e-12)
    assert (course.sampled[-1], course.times[-1]) == (steps, duration)


def test_too_many_steps_are_refused_with_their_number():
    scene = parse_scene(variant(ISS_DG, {"experiment": {"duration": 1e6, "step": 0.1}}))
    with pytest.raises(TradeError, match=r"in steps of 0\.1 s are 1e\+07 steps; at most 1000000"):
        course_of(scene)


def test_what_is_frozen_keeps_its_value_at_the_start_and_is_no_input():
    courses = {
        "DG.mass": [[0, 20000], [5, 12000]],
        "DG.nose.position[2]": [[0, -0.5], [5, 0.5]],
        "torque[1]": [[0, 1]],
    }
    scene = parse_scene(moved(courses))
    assert [str(m) for m in models(scene, quick=True)] == [
        f"{law}{frozen}"
        for law in ("principal", "tensor")
        for frozen in (", mass frozen", ", pose frozen", "")
    ]
    light = variant_of(scene, Choice(Model("principal", "mass"), "rk4", 0.1))
    assert light.vessels["DG"].mass == 20000.0
    assert (light.inputs.mass, light.inputs.pmi, light.inputs.pose) == ((), (), ("DG.nose",))
    assert (light.rotation.law, light.rotation.max_angle_step) == ("principal", 0.1)
    still = variant_of(scene, Choice(Model("tensor", "pose"), "taylor"))
    assert still.port("DG.nose").position == (0.0, -0.5, -10.076)
    assert (still.inputs.mass, still.inputs.pose) == (("DG",), ())


def test_an_orbit_moves_the_inputs_of_gravity_at_each_communication_point():
    scene = parse_scene(orbiting({"experiment.duration": 3.2}))
    course = course_of(scene)
    assert course.steps == 4
    found = np.column_stack(list(course.field.values()))
    expected = np.hstack(two_body(ORBIT["position"], ORBIT["velocity"], EARTH, [0.0, 1.0, 2.0, 3.0]))
    assert list(course.field) == [
        f"gravity.{what}[{i}]" for what in ("position", "velocity") for i in (1, 2, 3)
    ]
    assert np.array_equal(found, expected)
    assert course.numbers == {}


def test_without_an_orbit_all_inputs_of_gravity_have_courses_of_their_own():
    here = {"gravity": {"mu": EARTH, "position": [HEIGHT, 0.0, 0.0], "velocity": [0.0, 0.0, 0.0]}}
    courses = {f"gravity.{what}[{i}]": [[0, 1e7]] for what in ("position", "velocity") for i in (1, 2, 3)}
    told = orbiting({**here, "experiment": {"duration": 2.0, "step": 1.0, "inputs": courses}})
    assert course_of(parse_scene(told)).numbers.keys() == courses.keys()
    del courses["gravity.velocity[2]"]
    silent = orbiting({**here, "experiment": {"duration": 2.0, "step": 1.0, "inputs": courses}})
    words = (
        r'experiment\.orbit: missing, and experiment\.inputs has no "gravity\.velocity\[2\]": nothing tells'
    )
    with pytest.raises(TradeError, match=words):
        course_of(parse_scene(silent))


def test_a_model_without_gradient_is_a_scene_without_gravity():
    scene = parse_scene(orbiting({"inputs.range": {"gravity.position": [-7e6, 7e6]}}))
    assert [str(m) for m in models(scene, quick=True)] == [
        "principal, no gradient",
        "principal",
        "tensor, no gradient",
        "tensor",
    ]
    left = variant_of(scene, Choice(Model("tensor", "gravity"), "taylor"))
    assert (left.gravity, left.inputs.gravity, left.inputs.range) == (None, False, {})
    assert (left.experiment.orbit, left.experiment.duration) == (None, 10.0)
    assert variant_of(scene, Choice(Model("tensor"), "taylor")).gravity == scene.gravity


@pytest.mark.parametrize("gravity", [True, False])
def test_every_way_of_a_body_with_wheels_is_a_scene(gravity):
    """Wheels know no free motion, with the gradient or without."""
    raw = orbiting({"vessels.ISS.wheels": {"yaw": {"axis": [0.0, 0.0, 1.0]}}, "inputs": {"gravity": True}})
    if not gravity:
        raw = variant(raw, {"inputs": {}, "gravity": None, "experiment.orbit": None})
    scene = parse_scene(raw)
    for model in models(scene, quick=True):
        ways = [*by_tolerance(scene, model, quick=True), *ways_to(scene, model)]
        assert {way.propagator for way in ways} == {"taylor", "dop853"}
        for way in ways:
            variant_of(scene, way)


def test_errors_are_given_at_communication_points():
    """A hundredth of one second is before the first step of 0.1 s: no error can be told there."""
    raw = variant(moved({}), {"experiment.duration": 1.0, "experiment.step": 0.1})
    course = course_of(parse_scene(raw))
    assert course.horizons == pytest.approx([0.1, 1.0])
    assert {1, 10} <= set(course.sampled.tolist())
