"""Scenes with wheels that are refused, by name and value, and scenes that are read."""

from typing import Any

import pytest

from supervessel import load_scene
from supervessel.scene.names import MOST_WHEELS
from supervessel.scene.writing import scene_text
from support import scene, variant
from support.refusals import problems
from wheels.scenes import CARRIER, GYROSTAT

WHEEL = "vessels.B.wheels.x"


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({f"{WHEEL}.axis": [0, 0, 0]}, f"{WHEEL}.axis = [0.0, 0.0, 0.0]: must have a length greater than 0"),
        ({f"{WHEEL}.axis": None}, f"{WHEEL}.axis: missing"),
        ({f"{WHEEL}.inertia": -1.0}, f"{WHEEL}.inertia = -1.0 kg m2: must be a finite number >= 0"),
        (
            {f"{WHEEL}.momentum": float("nan")},
            f"{WHEEL}.momentum = nan N m s: must be a number up to 1e+100 either way",
        ),
        (
            {f"{WHEEL}.momentum": 1e999},
            f"{WHEEL}.momentum = inf N m s: must be a number up to 1e+100 either way",
        ),
        (
            {f"{WHEEL}.momentum": -1e101},
            f"{WHEEL}.momentum = -1e+101 N m s: must be a number up to 1e+100 either way",
        ),
        ({f"{WHEEL}.speed": 3.0}, f'{WHEEL}: unknown key "speed"; known: axis, inertia, momentum'),
        (
            {f"{WHEEL}.inertia": 90.0},
            "vessels: the composite without what its wheels have about their axes has principal moments "
            "-0.9496111205, 116.9826135, 148.9669976 kg m2: must be positive beyond rounding for "
            'rotation.law = "tensor"; a vessel\'s moments include those of its wheels',
        ),
        (
            {"rotation.law": "none"},
            'rotation.law = "none": knows no momentum; a scene with wheels needs any other law',
        ),
        (
            {"rotation.propagator": "exact", "inputs": {}},
            'rotation.propagator = "exact": must be "auto", "rk4", "dop853" or "taylor" in a scene with '
            "wheels: "
            "the momentum that they hold turns the body otherwise than free motion",
        ),
        (
            {"rotation.propagator": "split"},
            'rotation.propagator = "split": must be "auto", "rk4", "dop853" or "taylor" in a scene with '
            "wheels: "
            "between kicks the momentum that they hold turns the body otherwise than free motion",
        ),
        (
            {"outputs.names": ["error_bound"]},
            "outputs.names: error_bound knows no wheels; leave it out of a scene that has them",
        ),
        (
            {"outputs.names": ["B.store.speed"]},
            "outputs.names: B.store.speed: B.store has inertia 0, a momentum without a speed; take "
            "B.store.momentum",
        ),
        (
            {"outputs.names": ["B.stor.momentum"]},
            'outputs.names: unknown wheel of B "stor" (did you mean "store"?)',
        ),
        (
            {"outputs.names": ["B.x.moment"]},
            'outputs.names: unknown output of B.x "moment" (did you mean "momentum"?)',
        ),
        ({"inputs.wheel": ["B.y"]}, 'inputs.wheel: unknown wheel of B "y"; known: x, tilted, store'),
        ({"inputs.wheel": ["x"]}, 'inputs.wheel: "x" must be a wheel, written "vessel.wheel"'),
        ({"inputs.wheel": ["B.x", "B.x"]}, "inputs.wheel: B.x is listed 2 times"),
    ],
    ids=lambda value: "" if isinstance(value, str) else str(next(iter(value.items())))[:60],
)
def test_what_makes_no_sense_with_wheels_is_refused(changes, expected):
    assert problems(variant(GYROSTAT, changes)) == [expected]


def test_a_vessel_without_mass_cannot_have_wheels():
    raw = variant(CARRIER, {"vessels.B.mass": 0.0})
    assert problems(raw) == ["vessels.B.mass = 0.0 kg: must be > 0 for a vessel with wheels"]


def test_accuracy_and_orbiters_convention_know_no_wheels():
    asked: dict[str, Any] = {"accuracy": {"attitude": 1e-6, "horizon": 1.0, "step": 0.1}, "inputs": {}}
    raw = variant(GYROSTAT, asked | {"rotation": {}, "convention": "orbiter"})
    assert problems(raw) == [
        'vessels.B.inertia: convention = "orbiter" knows no products of inertia; give pmi [m2]',
        'convention = "orbiter": knows no wheels; take them away, or the convention',
        "accuracy: the bounds by which it chooses know no wheels; give law and propagator yourself",
    ]


@pytest.mark.parametrize(
    ("part", "table", "message"),
    [
        ("ports", {"position": [1, 0, 0], "direction": [1, 0, 0], "alignment": [0, 0, 1]}, "port"),
        ("points", {"position": [1, 0, 0]}, "point"),
    ],
)
def test_the_parts_of_a_vessel_never_share_a_name(part, table, message):
    raw = variant(GYROSTAT, {f"vessels.B.{part}": {"x": table}})
    assert problems(raw) == [f'vessels.B.wheels: name "x" is that of a {message} of B']


def test_a_scene_of_more_wheels_than_can_be_read_in_seconds_is_refused():
    many = {f"w{i}": {"axis": [1, 0, 0]} for i in range(MOST_WHEELS + 1)}
    raw = variant(GYROSTAT, {"vessels.B.wheels": many})
    assert problems(raw) == [
        f"wheels of all vessels: {len(many)} of them; at most {MOST_WHEELS} are possible"
    ]


@pytest.mark.parametrize("name", ["torque", "state", "gravity"])
def test_a_wheel_has_no_name_of_the_fmus_own(name):
    raw = variant(GYROSTAT, {"vessels.B.wheels": {name: {"axis": [1, 0, 0]}}, "inputs.wheel": []})
    raw["outputs"] = {"names": ["mass"]}
    assert problems(raw) == [f'vessels.B.wheels: name "{name}" is reserved for a variable of the FMU']


def test_a_scene_with_wheels_is_written_as_it_is_read(tmp_path):
    path = tmp_path / "carrier.toml"
    path.write_text(scene_text(scene(CARRIER)))
    assert load_scene(path) == scene(CARRIER)
