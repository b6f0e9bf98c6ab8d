"""Unknown keys, unknown names and names that cannot be used, in the words that a scene's author needs."""

import pytest

from support import ISS_DG, body, variant
from support.refusals import DOCK, NO_POSE, NOSE, ONE_PORT, PORT, case, problems

IDENTIFIER = "must be a letter or underscore, then letters, digits, underscores"
MODEL_NAME = "must be a letter, then letters, digits and single underscores"

UNKNOWN_KEYS = [
    case("top", {"vesels": {}}, 'unknown key "vesels" (did you mean "vessels"?)'),
    case("case of a letter", {"Docks": []}, 'unknown key "Docks" (did you mean "docks"?)'),
    case("vessel", {"vessels.DG.mas": 1.0}, 'vessels.DG: unknown key "mas" (did you mean "mass"?)'),
    case(
        "vessel, none near",
        {"vessels.DG.com": [0.0, 0.0, 0.0]},
        'vessels.DG: unknown key "com"; known: mass, pmi, inertia, moments, products, inertia_about, '
        "mend, centre_of_mass, ports, points, wheels",
    ),
    case("port", {f"{NOSE}.directon": 1}, f'{NOSE}: unknown key "directon" (did you mean "direction"?)'),
    case(
        "dock",
        {"docks": [{**DOCK, "port": 1}]},
        'docks[1]: unknown key "port" (did you mean "ports"?)',
    ),
    case("inputs", {"inputs.masses": ["DG"]}, 'inputs: unknown key "masses" (did you mean "mass"?)'),
    case(
        "rotation",
        {"rotation.max_angle": 0.1},
        'rotation: unknown key "max_angle" (did you mean "max_angle_step"?)',
    ),
    case(
        "experiment",
        {"experiment": {"duration": 1.0, "step": 0.1, "stop": 1.0}},
        'experiment: unknown key "stop" (did you mean "step"?)',
    ),
    case("outputs", {"outputs.name": ["pmi"]}, 'outputs: unknown key "name" (did you mean "names"?)'),
]

UNKNOWN_NAMES = [
    case("root", {"root": "IS"}, 'root: unknown vessel "IS" (did you mean "ISS"?)'),
    case(
        "dock's vessel",
        {"docks": [{"ports": ["ISS.P2", "DGG.nose"]}]},
        'docks[1].ports: unknown vessel "DGG" (did you mean "DG"?)',
        base=NO_POSE,
    ),
    case(
        "dock's port",
        {"docks": [{"ports": ["ISS.P2", "DG.noze"]}]},
        'docks[1].ports: unknown port of DG "noze" (did you mean "nose"?)',
        base=NO_POSE,
    ),
    case(
        "dock's port, none near",
        {"docks": [{"ports": ["ISS.P2", "DG.hatch"]}]},
        'docks[1].ports: unknown port of DG "hatch"; known: nose',
        base=NO_POSE,
    ),
    case(
        "port of a vessel without ports",
        {"vessels.DG.ports": None},
        'docks[1].ports: unknown port of DG "nose"; there is none to name here',
        base=NO_POSE,
    ),
    case("mass input", {"inputs.mass": ["DGG"]}, 'inputs.mass: unknown vessel "DGG" (did you mean "DG"?)'),
    case(
        "mass input, none near",
        {"inputs.mass": ["shuttle"]},
        'inputs.mass: unknown vessel "shuttle"; known: ISS, DG',
    ),
    case("pmi input", {"inputs.pmi": ["Dg"]}, 'inputs.pmi: unknown vessel "Dg" (did you mean "DG"?)'),
    case(
        "pose input's vessel",
        {"inputs.pose": ["GD.nose"]},
        'inputs.pose: unknown vessel "GD" (did you mean "DG"?)',
    ),
    case(
        "pose input's port",
        {"inputs.pose": ["DG.noses"]},
        'inputs.pose: unknown port of DG "noses" (did you mean "nose"?)',
    ),
    case("pose input without port", {"inputs.pose": ["DG"]}, f'inputs.pose: "DG" {ONE_PORT}'),
    case(
        "output",
        {"outputs.names": ["pmis"]},
        'outputs.names: unknown output "pmis" (did you mean "pmi"?)',
    ),
    case(
        "output, an element",
        {"outputs.names": ["pmi[1]"]},
        'outputs.names: unknown output "pmi[1]" (did you mean "pmi"?)',
    ),
    case(
        "range",
        {"inputs.range": {"DG.masss": [0.0, 3e4]}},
        'inputs.range: unknown input "DG.masss" (did you mean "DG.mass"?)',
    ),
    case(
        "range of an element",
        {"inputs.range": {"DG.nose.position[4]": [0.0, 1.0]}},
        'inputs.range: unknown input "DG.nose.position[4]" (did you mean "DG.nose.position[3]"?)',
    ),
    case(
        "range of no input",
        {"inputs": {"range": {"DG.mass": [0.0, 3e4]}}},
        'inputs.range: unknown input "DG.mass"; there is none to name here',
    ),
]

WRITTEN_NAMES = [
    *(
        case(f"model name {name!r}", {"name": name}, f'name = "{shown}": {MODEL_NAME}')
        for name, shown in (
            ("iss__dg", "iss__dg"),
            ("1iss", "1iss"),
            ("", ""),
            ("_iss", "_iss"),
            ("iss dg", "iss dg"),
            ("iss-dg", "iss-dg"),
            ("müll", "müll"),
            ("iss\n", "iss\\n"),
        )
    ),
    *(
        case(
            f"vessel name {name!r}",
            {"root": name, "vessels": {name: {"mass": 1.0, "pmi": [1.0, 1.0, 1.0]}}},
            f'vessels: name "{name}" {IDENTIFIER}',
            base=body(),
        )
        for name in ("space-lab", "space lab", "space.lab", "2nd", "")
    ),
    *(
        case(
            f"vessel name {name!r}",
            {"root": name, "vessels": {name: {"mass": 1.0, "pmi": [1.0, 1.0, 1.0]}}},
            f'vessels: name "{name}" is reserved for a variable of the FMU',
            base=body(),
        )
        for name in (
            *("time", "state", "der", "mass", "pmi", "torque", "barycentre", "inertia", "attitude"),
            *("angular_velocity", "angular_velocity_start", "attitude_start", "principal_moments"),
            *("principal_axes", "kinetic_energy", "angular_momentum", "error_estimate"),
        )
    ),
    case(
        "port names",
        {"vessels.B.ports": {"mass": PORT, "1": PORT}},
        'vessels.B.ports: name "mass" is reserved for a variable of the FMU',
        f'vessels.B.ports: name "1" {IDENTIFIER}',
        base=body(),
    ),
]


@pytest.mark.parametrize(("base", "changes", "expected"), UNKNOWN_KEYS)
def test_an_unknown_key_is_named_with_its_table_and_the_nearest_key(base, changes, expected):
    assert problems(variant(base, changes)) == expected


@pytest.mark.parametrize(("base", "changes", "expected"), UNKNOWN_NAMES)
def test_an_unknown_name_is_named_with_its_place_and_the_nearest_name(base, changes, expected):
    assert problems(variant(base, changes)) == expected


@pytest.mark.parametrize(("base", "changes", "expected"), WRITTEN_NAMES)
def test_a_name_that_cannot_be_used_is_refused_with_the_rule(base, changes, expected):
    assert problems(variant(base, changes)) == expected


def test_a_range_whose_name_lacks_quotes_is_answered_with_the_quoted_name():
    lines = problems(variant(ISS_DG, {"inputs.range": {"DG": {"mass": [11000.0, 24500.0]}}}))
    assert any('"DG.mass"' in line for line in lines)
