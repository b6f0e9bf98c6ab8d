"""Scenes that are refused: every problem, in the words and with the place that its author needs."""

import errno
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from supervessel import SceneError, load_scene, parse_scene
from support import BALL, ISS_DG, body, random_rotation, variant

NOSE = "vessels.DG.ports.nose"
PORT = {"position": [0.0, 0.0, 0.0], "direction": [1.0, 0.0, 0.0], "alignment": [0.0, 1.0, 0.0]}
TUG = {"mass": 10.0, "pmi": [1.0, 1.0, 1.0], "ports": {"fore": PORT, "aft": PORT}}
WITH_TUG = variant(ISS_DG, {"vessels.TUG": TUG, "vessels.ISS.ports.P3": PORT, "vessels.DG.ports.tail": PORT})
NO_POSE = variant(ISS_DG, {"inputs.pose": []})
CUBE = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
DOCK = {"ports": ["ISS.P2", "DG.nose"]}

IDENTIFIER = "must be a letter or underscore, then letters, digits, underscores"
MODEL_NAME = "must be a letter, then letters, digits and single underscores"
HUGE = "an integer of 333 hexadecimal digits"
NUMBER = "must be a finite number >= 0"
TOLERANCES = "must be a number from 1e-15 to 0.1"
POSITIVE = "must be a finite number > 0"
THREE = "must be three finite numbers"
MOMENTS = "must be three finite numbers >= 0"
DIRECTION = "must be three finite numbers, a direction of any length > 0"
ROWS = "must be three rows of three finite numbers"
NAMES = "must be a list of names in quotes"
BOUNDS = "must be two finite numbers [low, high]"
LAWS = "must be one of none, decoupled, principal, tensor"
NO_BODY = "no rigid body has these moments"
ONE_PORT = 'must be a port, written "vessel.port"'
TWO_PORTS = 'must be two ports, written "vessel.port"'
NOT_DOCKED = "inputs.pose: DG.nose is not docked; its pose would change nothing"
UNREACHED = "is not reached from the root ISS by docks"


def problems(raw: Any) -> list[str]:
    """Returns the problems that a scene is refused with."""
    with pytest.raises(SceneError) as caught:
        parse_scene(raw)
    return list(caught.value.problems)


def case(label: str, changes: dict[str, Any], *expected: str, base: dict[str, Any] = ISS_DG) -> Any:
    return pytest.param(base, changes, list(expected), id=label)


def shaped(label: str, inertia: Any, *expected: str, mass: float = 1000.0) -> Any:
    """A case of a single body given by a tensor."""
    changes = {"vessels.B.pmi": None, "vessels.B.inertia": inertia, "vessels.B.mass": mass}
    return case(label, changes, *expected, base=body())


UNKNOWN_KEYS = [
    case("top", {"vesels": {}}, 'unknown key "vesels" (did you mean "vessels"?)'),
    case("case of a letter", {"Docks": []}, 'unknown key "Docks" (did you mean "docks"?)'),
    case("vessel", {"vessels.DG.mas": 1.0}, 'vessels.DG: unknown key "mas" (did you mean "mass"?)'),
    case(
        "vessel, none near",
        {"vessels.DG.com": [0.0, 0.0, 0.0]},
        'vessels.DG: unknown key "com"; known: mass, pmi, inertia, centre_of_mass, ports, points',
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

MISSING = [
    case("name", {"name": None}, "name: missing"),
    case("root", {"root": None}, "root: missing"),
    case("mass", {"vessels.DG.mass": None}, "vessels.DG.mass: missing"),
    case(
        "moments",
        {"vessels.DG.pmi": None},
        "vessels.DG.pmi: missing; a vessel needs pmi [m2] or inertia [kg m2]",
    ),
    case("position", {f"{NOSE}.position": None}, f"{NOSE}.position: missing"),
    case("direction", {f"{NOSE}.direction": None}, f"{NOSE}.direction: missing"),
    case("alignment", {f"{NOSE}.alignment": None}, f"{NOSE}.alignment: missing"),
    case("ports of a dock", {"docks": [{}]}, "docks[1].ports: missing", base=NO_POSE),
    case("duration", {"experiment": {"step": 0.1}}, "experiment.duration: missing"),
    case("step", {"experiment": {"duration": 1.0}}, "experiment.step: missing"),
    case("vessels, name and root", {}, "name: missing", "root: missing", "vessels: missing", base={}),
    case(
        "vessels, none",
        {},
        "vessels: at least one vessel is needed",
        'root: unknown vessel "A"; there is none to name here',
        base={"name": "a", "root": "A", "vessels": {}},
    ),
]

WRONG_TYPES = [
    case("root a number", {"root": 3}, "root = 3: must be a name in quotes"),
    case("name a Boolean", {"name": True}, "name = true: must be a name in quotes"),
    case("vessel a number", {"vessels": {"B": 3.0}}, "vessels.B = 3.0: must be a table", base=body()),
    case(
        "vessel an array of tables",
        {"vessels.B": [{"mass": 1.0, "solid": True, "pmi": [1, 1, 1]}]},
        "vessels.B = [{mass = 1.0, solid = true, pmi = [1, 1, 1]}]: must be a table",
        base=body(),
    ),
    case(
        "ports an array", {"vessels.B.ports": ["a"]}, 'vessels.B.ports = ["a"]: must be a table', base=body()
    ),
    case(
        "port an array",
        {"vessels.B.ports": {"a": [1]}},
        "vessels.B.ports.a = [1]: must be a table",
        base=body(),
    ),
    case("inputs an array", {"inputs": ["DG"]}, 'inputs = ["DG"]: must be a table'),
    case("rotation an array", {"rotation": []}, "rotation = []: must be a table"),
    case("outputs an array", {"outputs": ["mass"]}, 'outputs = ["mass"]: must be a table'),
    case("experiment a number", {"experiment": 60}, "experiment = 60: must be a table"),
    case("range an array", {"inputs.range": ["DG"]}, 'inputs.range = ["DG"]: must be a table'),
    case("docks of numbers", {"docks": [3]}, "docks[1] = 3: must be a table", base=body()),
    case(
        "docks a string",
        {"docks": "A.a B.b"},
        'docks = "A.a B.b": must be an array of tables, written [[docks]]',
        base=body(),
    ),
    case(
        "dock a string",
        {"docks": [{"ports": "A.a B.b"}]},
        f'docks[1].ports = "A.a B.b": {NAMES}',
        base=body(),
    ),
    case("dock of numbers", {"docks": [{"ports": [1, 2]}]}, f"docks[1].ports = [1, 2]: {NAMES}", base=body()),
    case(
        "dock of arrays",
        {"docks": [{"ports": [["A.a"], ["B.b"]]}]},
        f'docks[1].ports = [["A.a"], ["B.b"]]: {NAMES}',
        base=body(),
    ),
    case("mass a string", {"vessels.DG.mass": "24500"}, f'vessels.DG.mass = "24500" kg: {NUMBER}'),
    case("mass a Boolean", {"vessels.DG.mass": True}, f"vessels.DG.mass = true kg: {NUMBER}"),
    case("mass an array", {"vessels.DG.mass": [1.0]}, f"vessels.DG.mass = [1.0] kg: {NUMBER}"),
    case("mass a table", {"vessels.DG.mass": {"dry": 1.0}}, f"vessels.DG.mass = {{dry = 1.0}} kg: {NUMBER}"),
    case("pmi a number", {"vessels.DG.pmi": 1.0}, f"vessels.DG.pmi = 1.0 m2: {MOMENTS}"),
    case("pmi of two", {"vessels.DG.pmi": [1.0, 1.0]}, f"vessels.DG.pmi = [1.0, 1.0] m2: {MOMENTS}"),
    case("pmi nested", {"vessels.DG.pmi": [[1, 1, 1]]}, f"vessels.DG.pmi = [[1, 1, 1]] m2: {MOMENTS}"),
    case(
        "pmi with a Boolean", {"vessels.DG.pmi": [1, True, 1]}, f"vessels.DG.pmi = [1, true, 1] m2: {MOMENTS}"
    ),
    case("direction a string", {f"{NOSE}.direction": "up"}, f'{NOSE}.direction = "up": {DIRECTION}'),
    case("position of two", {f"{NOSE}.position": [1, 0]}, f"{NOSE}.position = [1, 0] m: {THREE}"),
    case(
        "centre of mass of one",
        {"vessels.DG.centre_of_mass": [0.5]},
        f"vessels.DG.centre_of_mass = [0.5] m: {THREE}",
    ),
    shaped("inertia of two rows", CUBE[:2], f"vessels.B.inertia = {CUBE[:2]} kg m2: {ROWS}"),
    shaped("inertia a vector", [1.0, 1.0, 1.0], f"vessels.B.inertia = [1.0, 1.0, 1.0] kg m2: {ROWS}"),
    case(
        "angular velocity of four",
        {"rotation.angular_velocity": [0, 0, 0, 1]},
        f"rotation.angular_velocity = [0, 0, 0, 1] rad/s: {THREE}",
    ),
    case(
        "attitude of three",
        {"rotation.attitude": [1, 0, 0]},
        "rotation.attitude = [1, 0, 0]: must be four finite numbers [w, x, y, z]",
    ),
    case("inputs a string", {"inputs.mass": "DG"}, f'inputs.mass = "DG": {NAMES}'),
    case("inputs of numbers", {"inputs.mass": [1]}, f"inputs.mass = [1]: {NAMES}"),
    case("outputs a string", {"outputs.names": "pmi"}, f'outputs.names = "pmi": {NAMES}'),
    case("torque a number", {"inputs.torque": 1}, "inputs.torque = 1: must be true or false"),
    case("law an array", {"rotation.law": ["tensor"]}, f'rotation.law = ["tensor"]: {LAWS}'),
    case("range a number", {"inputs.range": {"DG.mass": 1.0}}, f'inputs.range."DG.mass" = 1.0: {BOUNDS}'),
    case(
        "range of three",
        {"inputs.range": {"DG.mass": [0, 1, 2]}},
        f'inputs.range."DG.mass" = [0, 1, 2]: {BOUNDS}',
    ),
]

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
    case("law", {"rotation.law": "tensors"}, f'rotation.law = "tensors": {LAWS}'),
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

DOCKS = [
    case(
        "loop",
        {"docks": [DOCK, {"ports": ["ISS.P3", "TUG.fore"]}, {"ports": ["TUG.aft", "DG.tail"]}]},
        "docks[3].ports: TUG.aft - DG.tail closes a loop; TUG and DG are joined already",
        base=WITH_TUG,
    ),
    case(
        "port docked twice",
        {"docks": [DOCK, {"ports": ["ISS.P2", "TUG.fore"]}]},
        "docks[2].ports: port ISS.P2 is docked already, in docks[1]",
        base=WITH_TUG,
    ),
    case(
        "vessel docked to itself",
        {"docks": [DOCK, {"ports": ["ISS.P3", "DG.tail"]}, {"ports": ["TUG.fore", "TUG.aft"]}]},
        "docks[2].ports: ISS.P3 - DG.tail closes a loop; ISS and DG are joined already",
        "docks[3].ports: both ports belong to TUG; a dock joins two vessels",
        f"vessels.TUG: {UNREACHED}",
        base=WITH_TUG,
    ),
    case(
        "port docked to itself",
        {"docks": [{"ports": ["DG.nose", "DG.nose"]}]},
        "docks[1].ports: both ports belong to DG; a dock joins two vessels",
        f"vessels.DG: {UNREACHED}",
        base=NO_POSE,
    ),
    case("no docks", {"docks": []}, f"vessels.DG: {UNREACHED}", base=NO_POSE),
    case(
        "vessels docked away from the root",
        {"docks": [{"ports": ["TUG.fore", "DG.nose"]}]},
        f"vessels.DG: {UNREACHED}",
        f"vessels.TUG: {UNREACHED}",
        base=WITH_TUG,
    ),
    case("dock of a vessel", {"docks": [{"ports": ["ISS", "DG.nose"]}]}, f'docks[1].ports: "ISS" {ONE_PORT}'),
    case(
        "dock of a dotted name too many",
        {"docks": [{"ports": ["ISS.P2.x", "DG.nose"]}]},
        f'docks[1].ports: "ISS.P2.x" {ONE_PORT}',
    ),
    case("dock of one", {"docks": [{"ports": ["DG.nose"]}]}, f'docks[1].ports = ["DG.nose"]: {TWO_PORTS}'),
    case(
        "dock of three",
        {"docks": [{"ports": ["ISS.P2", "DG.nose", "DG.tail"]}]},
        f'docks[1].ports = ["ISS.P2", "DG.nose", "DG.tail"]: {TWO_PORTS}',
    ),
    case(
        "[docks] for [[docks]]",
        {"docks": DOCK},
        'docks = {ports = ["ISS.P2", "DG.nose"]}: must be an array of tables, written [[docks]]',
        base=variant(NO_POSE, {"vessels.DG": None, "inputs": {}}),
    ),
]

INPUTS = [
    case(
        "pose of an undocked port",
        {"inputs.pose": ["DG.tail"], "docks": [DOCK, {"ports": ["ISS.P3", "TUG.fore"]}]},
        "inputs.pose: DG.tail is not docked; its pose would change nothing",
        base=WITH_TUG,
    ),
    case(
        "pmi of a vessel given by inertia",
        {"vessels.DG.pmi": None, "vessels.DG.inertia": CUBE},
        "inputs.pmi: DG is given by inertia; only a vessel given by pmi has this input",
    ),
    case("mass twice", {"inputs.mass": ["DG", "DG"]}, "inputs.mass: DG is listed 2 times"),
    case("pmi twice", {"inputs.pmi": ["DG", "ISS", "DG"]}, "inputs.pmi: DG is listed 2 times"),
    case("pose three times", {"inputs.pose": ["DG.nose"] * 3}, "inputs.pose: DG.nose is listed 3 times"),
    case("output twice", {"outputs.names": ["pmi", "mass", "pmi"]}, "outputs.names: pmi is listed 2 times"),
]

TOGETHER = [
    case(
        "a number beside names",
        {"vessels.DG.mass": -1.0, "root": "IS", "inputs.mass": ["GD"], "outputs.names": ["pm"]},
        f"vessels.DG.mass = -1.0 kg: {NUMBER}",
        'root: unknown vessel "IS" (did you mean "ISS"?)',
        'inputs.mass: unknown vessel "GD" (did you mean "DG"?)',
        'outputs.names: unknown output "pm" (did you mean "pmi"?)',
    ),
    case(
        "keys, numbers and docks",
        {"vesel": 1, "vessels.DG.pmi": [1, 1, 5], "rotation.law": "full", "docks": []},
        f"vessels.DG.pmi = [1.0, 1.0, 5.0] m2: 5.0 exceeds 1.0 + 1.0 by 3; {NO_BODY}",
        f'rotation.law = "full": {LAWS}',
        'unknown key "vesel" (did you mean "vessels"?)',
        f"vessels.DG: {UNREACHED}",
        NOT_DOCKED,
    ),
    case(
        "both keys of a vessel missing",
        {"vessels.DG.mass": None, "vessels.DG.pmi": None},
        "vessels.DG.mass: missing",
        "vessels.DG.pmi: missing; a vessel needs pmi [m2] or inertia [kg m2]",
    ),
    case(
        "a mass beside two kinds of moments",
        {"vessels.ISS.mass": -1.0, "vessels.ISS.inertia": CUBE},
        f"vessels.ISS.mass = -1.0 kg: {NUMBER}",
        "vessels.ISS.inertia: given beside pmi; a vessel takes one of the two",
    ),
    case(
        "a position beside a zero direction",
        {f"{NOSE}.position": [1], f"{NOSE}.direction": [0, 0, 0]},
        f"{NOSE}.position = [1] m: {THREE}",
        f"{NOSE}.direction = [0.0, 0.0, 0.0]: must have a length greater than 0",
    ),
    case(
        "a key beside a range",
        {"vesel": 1, "inputs.range": {"DG.mass": [2, 1]}},
        'unknown key "vesel" (did you mean "vessels"?)',
        'inputs.range."DG.mass" = [2.0, 1.0] kg: low must not exceed high',
    ),
    case(
        "a name beside masses all zero",
        {"vessels.DG.mass": 0, "vessels.ISS.mass": 0, "outputs.names": ["pm"]},
        'outputs.names: unknown output "pm" (did you mean "pmi"?)',
        "vessels: total mass = 0.0 kg: must be a finite number > 0",
    ),
]

parametrised = pytest.mark.parametrize


@parametrised(("base", "changes", "expected"), UNKNOWN_KEYS)
def test_an_unknown_key_is_named_with_its_table_and_the_nearest_key(base, changes, expected):
    assert problems(variant(base, changes)) == expected


@parametrised(("base", "changes", "expected"), UNKNOWN_NAMES)
def test_an_unknown_name_is_named_with_its_place_and_the_nearest_name(base, changes, expected):
    assert problems(variant(base, changes)) == expected


@parametrised(("base", "changes", "expected"), MISSING)
def test_a_missing_key_is_named(base, changes, expected):
    assert problems(variant(base, changes)) == expected


@parametrised(("base", "changes", "expected"), WRONG_TYPES)
def test_a_value_of_another_kind_is_shown_with_what_is_allowed(base, changes, expected):
    assert problems(variant(base, changes)) == expected


@parametrised(("base", "changes", "expected"), IMPOSSIBLE_NUMBERS)
def test_an_impossible_number_is_shown_with_its_unit_and_what_is_allowed(base, changes, expected):
    assert problems(variant(base, changes)) == expected


@parametrised(("base", "changes", "expected"), WRITTEN_NAMES)
def test_a_name_that_cannot_be_used_is_refused_with_the_rule(base, changes, expected):
    assert problems(variant(base, changes)) == expected


@parametrised(("base", "changes", "expected"), DOCKS)
def test_docks_that_make_no_tree_are_named(base, changes, expected):
    assert problems(variant(base, changes)) == expected


@parametrised(("base", "changes", "expected"), INPUTS)
def test_an_input_that_cannot_be_is_named(base, changes, expected):
    assert problems(variant(base, changes)) == expected


@parametrised(("base", "changes", "expected"), TOGETHER)
def test_problems_of_different_kinds_are_reported_at_once(base, changes, expected):
    assert sorted(problems(variant(base, changes))) == sorted(expected)


@parametrised("law", ["none", "tensor"])
@parametrised(
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


def test_a_range_whose_name_lacks_quotes_is_answered_with_the_quoted_name():
    lines = problems(variant(ISS_DG, {"inputs.range": {"DG": {"mass": [11000.0, 24500.0]}}}))
    assert any('"DG.mass"' in line for line in lines)


SCRIPT = """
from supervessel import SceneError, parse_scene
vessel = {"mass": 1.0, "pmi": [1.0, 1.0, 1.0]}
dock = {"ports": ["A.a", "B.b"]}
port = {"position": [0, 0, 0], "direction": [1, 0, 0], "alignment": [0, 1, 0]}
vessels = {"A": {**vessel, "ports": {"a": port}}, "B": {**vessel, "ports": {"b": port}}}
try:
    parse_scene({"name": "n", "root": "A", "vessels": vessels, "docks": [dock, dock]})
except SceneError as error:
    print(error)
"""


def test_problems_come_in_the_same_order_every_time():
    outputs = {
        subprocess.run(
            [sys.executable, "-c", SCRIPT],
            env=os.environ | {"PYTHONHASHSEED": str(seed)},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in range(4)
    }
    assert outputs == {
        "scene: docks[2].ports: port A.a is docked already, in docks[1]\n"
        "scene: docks[2].ports: port B.b is docked already, in docks[1]\n"
        "scene: docks[2].ports: A.a - B.b closes a loop; A and B are joined already\n"
    }


def refusal(path: Path, text: str | bytes | None = None) -> str:
    """Returns what a scene file is refused with, after writing it if there is a text."""
    if text is not None:
        path.write_bytes(text.encode() if isinstance(text, str) else text)
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    return str(caught.value)


def test_every_line_of_the_message_begins_with_the_file_name(tmp_path):
    text = BALL.replace("mass = 2.0", "mass = -1.0").replace('root = "B"', 'root = "C"')
    assert refusal(tmp_path / "ball.toml", text) == (
        f'ball.toml: vessels.B.mass = -1.0 kg: {NUMBER}\nball.toml: root: unknown vessel "C"; known: B'
    )


def test_the_problems_of_an_error_are_its_lines_without_the_file_name(tmp_path):
    path = tmp_path / "ball.toml"
    path.write_text(BALL.replace("pmi", "pmii"))
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    assert str(caught.value) == "\n".join(f"ball.toml: {problem}" for problem in caught.value.problems)


@parametrised(
    ("text", "expected"),
    [
        (
            BALL.replace("mass =", "mass"),
            "Expected '=' after a key in a key/value pair (at line 4, column 6)",
        ),
        (BALL + "mass = 2.0\n", "Cannot overwrite a value (at line 6, column 11)"),
        (BALL.replace("1.0,", "1.0;", 1), "Unclosed array (at line 5, column 11)"),
        (BALL + "[vessels.B]\n", "Cannot declare ('vessels', 'B') twice (at line 6, column 11)"),
    ],
    ids=["no equals sign", "key twice", "semicolon", "table twice"],
)
def test_text_that_is_not_toml_is_named_with_line_and_column(tmp_path, text, expected):
    path = tmp_path / "ball.toml"
    assert refusal(path, text) == f"{path}: is not TOML: {expected}"


def test_a_file_that_is_not_there_is_named(tmp_path):
    path = tmp_path / "ball.toml"
    assert refusal(path) == f"{path}: cannot be read: {os.strerror(errno.ENOENT)}"


@pytest.mark.skipif(os.name == "nt", reason="Windows answers with another system message")
def test_a_folder_in_the_place_of_a_file_is_named(tmp_path):
    assert refusal(tmp_path) == f"{tmp_path}: cannot be read: {os.strerror(errno.EISDIR)}"


def test_a_file_that_is_not_utf8_is_named_with_the_byte(tmp_path):
    path = tmp_path / "ball.toml"
    assert refusal(path, b"# M\xfcller\n") == f"{path}: line 1: is not UTF-8 text (byte 0xfc)"


@parametrised("value", ["9" * 5000, "[" * 5000 + "]" * 5000], ids=["5000 digits", "arrays 5000 deep"])
def test_a_value_that_the_toml_reader_gives_up_on_is_refused(tmp_path, value):
    path = tmp_path / "ball.toml"
    text = BALL.replace("mass = 2.0", f"mass = {value}")
    assert "ball.toml: " in refusal(path, text)


def test_an_integer_too_long_to_print_is_refused_with_its_place(tmp_path):
    message = refusal(tmp_path / "ball.toml", BALL.replace("mass = 2.0", f"mass = 0x{'f' * 5000}"))
    assert message.startswith("ball.toml: vessels.B.mass = ")
    assert "kg: must be" in message
