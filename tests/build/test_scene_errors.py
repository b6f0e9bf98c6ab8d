"""Scenes that are refused: missing keys, values of another kind, every problem at once and in one order."""

import os
import subprocess
import sys

import pytest

from support import body, variant
from support.refusals import (
    BOUNDS,
    CUBE,
    DIRECTION,
    KNOWN_LAWS,
    MOMENTS,
    NO_BODY,
    NO_POSE,
    NOSE,
    NUMBER,
    THREE,
    UNREACHED,
    case,
    problems,
    shaped,
)

ROWS = "must be three finite numbers, the diagonal, or three rows of them"
NAMES = "must be a list of names in quotes"
NOT_DOCKED = "inputs.pose: DG.nose is not docked; its pose would change nothing"

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

LINE = "must be a line of 1 to 200 printable characters in quotes"

WRONG_TYPES = [
    case("version a number", {"version": 1.0}, f"version = 1.0: {LINE}"),
    case("author empty", {"author": ""}, f'author = "": {LINE}'),
    case("license of spaces", {"license": "  "}, f'license = "  ": {LINE}'),
    case("description of two lines", {"description": "a\nb"}, f'description = "a\\nb": {LINE}'),
    case("copyright a list", {"copyright": ["a"]}, f'copyright = ["a"]: {LINE}'),
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
    shaped("inertia of two numbers", [1.0, 1.0], f"vessels.B.inertia = [1.0, 1.0] kg m2: {ROWS}"),
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
    case("law an array", {"rotation.law": ["tensor"]}, f'rotation.law = ["tensor"]: {KNOWN_LAWS}'),
    case("range a number", {"inputs.range": {"DG.mass": 1.0}}, f'inputs.range."DG.mass" = 1.0: {BOUNDS}'),
    case(
        "range of three",
        {"inputs.range": {"DG.mass": [0, 1, 2]}},
        f'inputs.range."DG.mass" = [0, 1, 2]: {BOUNDS}',
    ),
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
        f'rotation.law = "full": {KNOWN_LAWS}',
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


@pytest.mark.parametrize(("base", "changes", "expected"), MISSING)
def test_a_missing_key_is_named(base, changes, expected):
    assert problems(variant(base, changes)) == expected


@pytest.mark.parametrize(("base", "changes", "expected"), WRONG_TYPES)
def test_a_value_of_another_kind_is_shown_with_what_is_allowed(base, changes, expected):
    assert problems(variant(base, changes)) == expected


@pytest.mark.parametrize(("base", "changes", "expected"), TOGETHER)
def test_problems_of_different_kinds_are_reported_at_once(base, changes, expected):
    assert sorted(problems(variant(base, changes))) == sorted(expected)


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
