"""Numbers of a scene that no body can have, with their units and what is allowed."""

import math

import pytest

from supervessel import SceneError, parse_scene
from support import ISS_DG, body, random_rotation, variant
from support.refusals import (
    BOUNDS,
    CUBE,
    DIRECTION,
    KNOWN_LAWS,
    MOMENTS,
    NO_BODY,
    NOSE,
    NUMBER,
    THREE,
    case,
    problems,
    shaped,
)

HUGE = "an integer of 333 hexadecimal digits"
TOLERANCES = "must be a number from 1e-15 to 0.1"
POSITIVE = "must be a finite number > 0"

IMPOSSIBLE_NUMBERS = [
    case("mass nan", {"vessels.DG.mass": math.nan}, f"vessels.DG.mass = nan kg: {NUMBER}"),
    case("mass infinite", {"vessels.DG.mass": math.inf}, f"vessels.DG.mass = inf kg: {NUMBER}"),
    case("mass negative", {"vessels.DG.mass": -1.0}, f"vessels.DG.mass = -1.0 kg: {NUMBER}"),
    case("mass beyond a double", {"vessels.DG.mass": 10**400}, f"vessels.DG.mass = {HUGE} kg: {NUMBER}"),
    case(
        "masses all zero",
        {"vessels.DG.mass": 0.0, "vessels.ISS.mass": 0},
        "vessels: total mass = 0.0 kg: must be a finite number > 0",
    ),
    case(
        "masses whose sum is beyond a double",
        {"vessels.DG.mass": 1e308, "vessels.ISS.mass": 1e308},
        "vessels: total mass = inf kg: must be a finite number > 0",
    ),
    case(
        "pmi nan", {"vessels.DG.pmi": [1.0, math.nan, 1.0]}, f"vessels.DG.pmi = [1.0, nan, 1.0] m2: {MOMENTS}"
    ),
    case(
        "pmi negative",
        {"vessels.DG.pmi": [1.0, -1.0, 1.0]},
        f"vessels.DG.pmi = [1.0, -1.0, 1.0] m2: {MOMENTS}",
    ),
    case(
        "position infinite",
        {f"{NOSE}.position": [0, 0, -math.inf]},
        f"{NOSE}.position = [0, 0, -inf] m: {THREE}",
    ),
    case(
        "direction nan",
        {f"{NOSE}.direction": [0, 0, math.nan]},
        f"{NOSE}.direction = [0, 0, nan]: {DIRECTION}",
    ),
    case(
        "Orbiter's Wheel",
        {"vessels.DG.pmi": [26000, 26000, 52800]},
        "vessels.DG.pmi = [26000.0, 26000.0, 52800.0] m2: 52800.0 exceeds 26000.0 + 26000.0 by 800; "
        f"{NO_BODY}",
    ),
    case(
        "triangle, the first moment",
        {"vessels.DG.pmi": [5.0, 1.0, 1.5]},
        f"vessels.DG.pmi = [5.0, 1.0, 1.5] m2: 5.0 exceeds 1.0 + 1.5 by 2.5; {NO_BODY}",
    ),
    shaped(
        "inertia asymmetric",
        [[2.0, 0.5, 0.0], [0.25, 2.0, 0.0], [0.0, 0.0, 2.0]],
        "vessels.B.inertia = [[2.0, 0.5, 0.0], [0.25, 2.0, 0.0], [0.0, 0.0, 2.0]] kg m2: "
        "must be symmetric, but [1,2] = 0.5 and [2,1] = 0.25",
    ),
    shaped(
        "inertia indefinite",
        [[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 2.0]],
        "vessels.B.inertia = [[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 2.0]] kg m2: "
        "must be positive semidefinite, but its principal moments are -1, 2, 3 kg m2",
    ),
    shaped(
        "inertia beyond the triangle",
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 3.0]],
        "vessels.B.inertia = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 3.0]] kg m2: "
        f"its principal moments are 1, 1, 3 kg m2: 3 exceeds 1 + 1 by 1; {NO_BODY}",
    ),
    shaped(
        "inertia without mass",
        CUBE,
        "vessels.B.mass = 0.0 kg: must be > 0 for a vessel given by inertia; inertia/mass is kept",
        mass=0.0,
    ),
    case(
        "inertia beside pmi",
        {"vessels.ISS.inertia": CUBE},
        "vessels.ISS.inertia: given beside pmi; a vessel takes one of the two",
    ),
    case(
        "direction and alignment zero",
        {f"{NOSE}.direction": [0, 0, 0], f"{NOSE}.alignment": [0, 0, 0]},
        f"{NOSE}.direction = [0.0, 0.0, 0.0]: must have a length greater than 0",
        f"{NOSE}.alignment = [0.0, 0.0, 0.0]: must have a length greater than 0",
    ),
    case(
        "alignment parallel",
        {f"{NOSE}.alignment": [0, 9e-7, 2]},
        f"{NOSE}.alignment = [0.0, 9e-07, 2.0]: must be perpendicular to direction = [0.0, 0.0, -1.0], "
        "but is parallel to it within 1e-06 rad",
    ),
    case(
        "alignment off, forwards",
        {f"{NOSE}.alignment": [0, 1, -0.002]},
        f"{NOSE}.alignment = [0.0, 1.0, -0.002]: must be perpendicular to direction = [0.0, 0.0, -1.0], "
        "but is 0.00199999733 rad off; at most 0.001 rad",
    ),
    case(
        "alignment off, backwards",
        {f"{NOSE}.alignment": [0, 1, 0.002]},
        f"{NOSE}.alignment = [0.0, 1.0, 0.002]: must be perpendicular to direction = [0.0, 0.0, -1.0], "
        "but is 0.00199999733 rad off; at most 0.001 rad",
    ),
    case(
        "attitude zero",
        {"rotation.attitude": [0, 0, 0, 0]},
        "rotation.attitude = [0.0, 0.0, 0.0, 0.0]: must have a length greater than 0",
    ),
    case("law", {"rotation.law": "tensors"}, f'rotation.law = "tensors": {KNOWN_LAWS}'),
    case(
        "propagator",
        {"rotation.propagator": "euler"},
        'rotation.propagator = "euler": must be one of auto, rk4, dop853, taylor, exact, split',
    ),
    case("tolerance", {"rotation.tolerance": 0}, f"rotation.tolerance = 0: {TOLERANCES}"),
    case(
        "angle",
        {"rotation.max_angle_step": -0.05},
        "rotation.max_angle_step = -0.05 rad: must be a number from 1e-6 to 1",
    ),
    case(
        "duration and step",
        {"experiment": {"duration": 0, "step": -1.0}},
        f"experiment.duration = 0 s: {POSITIVE}",
        f"experiment.step = -1.0 s: {POSITIVE}",
    ),
    case(
        "step longer than duration",
        {"experiment": {"duration": 1, "step": 2}},
        "experiment.step = 2.0 s: must not exceed duration = 1.0 s",
    ),
    case(
        "range reversed",
        {"inputs.range": {"DG.mass": [24500, 11000]}},
        'inputs.range."DG.mass" = [24500.0, 11000.0] kg: low must not exceed high',
    ),
    case(
        "range of a negative mass",
        {"inputs.range": {"DG.mass": [-1, 30000]}},
        'inputs.range."DG.mass" = [-1.0, 30000.0] kg: a mass must be >= 0 kg',
    ),
    case(
        "start outside the range",
        {"inputs.range": {"DG.mass": [0, 1000]}},
        'inputs.range."DG.mass" = [0.0, 1000.0] kg: the start value DG.mass = 24500.0 kg lies outside',
    ),
    case(
        "starts outside a vector's range",
        {"inputs.range": {"DG.pmi": [0, 20], "DG.pmi[1]": [0, 10]}},
        'inputs.range."DG.pmi" = [0.0, 20.0] m2: the start value DG.pmi[2] = 22.1 m2 lies outside',
        'inputs.range."DG.pmi[1]" = [0.0, 10.0] m2: the start value DG.pmi[1] = 15.5 m2 lies outside',
    ),
    case(
        "range infinite",
        {"inputs.range": {"DG.mass": [0, math.inf]}},
        f'inputs.range."DG.mass" = [0, inf]: {BOUNDS}',
    ),
    *(
        case(
            f"rod under {law}",
            {"rotation.law": law},
            "vessels: the composite has principal moments 0, 1000, 1000 kg m2: must be positive beyond "
            f'rounding for rotation.law = "{law}"',
            base=body(pmi=(0.0, 1.0, 1.0)),
        )
        for law in ("decoupled", "principal", "tensor")
    ),
]


@pytest.mark.parametrize(("base", "changes", "expected"), IMPOSSIBLE_NUMBERS)
def test_an_impossible_number_is_shown_with_its_unit_and_what_is_allowed(base, changes, expected):
    assert problems(variant(base, changes)) == expected


@pytest.mark.parametrize("law", ["none", "tensor"])
@pytest.mark.parametrize(
    "changes",
    [
        {"vessels.DG.pmi": [1e308, 1e308, 1e308]},
        {f"{NOSE}.position": [1e200, 0.0, 0.0]},
        {"vessels.DG.mass": 1e307, "vessels.ISS.mass": 1e307},
    ],
    ids=["pmi", "position", "masses"],
)
def test_a_composite_beyond_a_double_is_refused_under_every_law(changes, law):
    (line,) = problems(variant(ISS_DG, {**changes, "rotation.law": law}))
    assert line.startswith("vessels")
    assert "finite" in line


ROD_ROTATIONS = 64


def test_a_rod_at_any_angle_is_refused_under_the_law_tensor():
    accepted = []
    for seed in range(ROD_ROTATIONS):
        rotation = random_rotation(seed)
        inertia = rotation @ [[0.0, 0.0, 0.0], [0.0, 1e3, 0.0], [0.0, 0.0, 1e3]] @ rotation.T
        changes = {"vessels.B.pmi": None, "vessels.B.inertia": ((inertia + inertia.T) / 2).tolist()}
        try:
            parse_scene(variant(body(), changes))
            accepted.append(seed)
        except SceneError:
            pass
    assert accepted == []


def test_the_triangle_message_repeats_the_numbers_as_they_were_written():
    (line,) = problems(body(pmi=(0.1, 0.1, 0.3)))
    assert "0.3 exceeds 0.1 + 0.1 by 0.1" in line
