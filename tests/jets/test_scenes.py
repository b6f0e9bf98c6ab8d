"""Scenes with flows of propellant that are refused, by name and value, and scenes that are read."""

from typing import Any

import pytest

from fmu_build.flight.choices import Choice, Model, models, variant_of
from jets.scenes import STACK, rocket
from supervessel import Twin, load_scene
from supervessel.scene.writing import scene_text
from support import scene, variant
from support.refusals import problems

FREE = (
    'must be "auto", "rk4", "dop853" or "taylor" where inputs.flow lists points: the torque of jet damping '
    "changes with the angular velocity"
)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        (
            {"inputs.mass": []},
            [
                f"inputs.flow: T.{point}: T is not listed in inputs.mass; what flows out is to make its "
                "mass fall"
                for point in ("main", "side")
            ],
        ),
        (
            {"rotation.mass_change": "momentum"},
            [
                'rotation.mass_change = "momentum": must be "rate" where inputs.flow lists points: '
                "propellant that leaves takes momentum along, which the flow reckons with a kept rate"
            ],
        ),
        (
            {"rotation.law": "none"},
            ['rotation.law = "none": knows no torque; a scene with inputs.flow needs any other law'],
        ),
        ({"rotation.propagator": "exact"}, [f'rotation.propagator = "exact": {FREE}']),
        ({"rotation.propagator": "split"}, [f'rotation.propagator = "split": {FREE}']),
        (
            {"inputs.pose": ["T.top"], "inputs.motion": ["T.top"]},
            ["inputs.motion: what a port's motion gives the flow is not known; leave it or inputs.flow out"],
        ),
        (
            {"outputs.names": ["error_bound"]},
            ["outputs.names: error_bound knows no flow; leave it out of a scene with inputs.flow"],
        ),
        (
            {"outputs.names": ["joint.force", "T.main.position"]},
            [
                "outputs.names: joint.force: where inputs.flow lists points, the momentum of the flow inside "
                "is not known; leave one of the two out"
            ],
        ),
        ({"inputs.flow": ["T.aft"]}, ['inputs.flow: unknown point of T "aft"; known: main, side']),
        ({"inputs.flow": ["T"]}, ['inputs.flow: "T" must be a point, written "vessel.point"']),
        (
            {"inputs.range": {"T.main.flow": [-1.0, 5.0]}},
            ['inputs.range."T.main.flow" = [-1.0, 5.0] kg/s: a flow must be >= 0 kg/s'],
        ),
        (
            {"experiment": {"duration": 1.0, "step": 0.1, "inputs": {"T.main.flow": [[0.0, -2.0]]}}},
            ['experiment.inputs."T.main.flow": -2.0 kg/s at 0.0 s: a flow must be >= 0 kg/s'],
        ),
    ],
    ids=lambda value: str(next(iter(value)))[:60] if isinstance(value, dict) else "",
)
def test_what_makes_no_sense_with_flows_is_refused(changes, expected):
    assert problems(variant(STACK, changes)) == expected


def test_accuracy_and_orbiters_convention_know_no_flows():
    asked: dict[str, Any] = {"attitude": 1e-6, "horizon": 1.0, "step": 0.1}
    raw = variant(rocket((2.0, 2.0, 3.0), 4.0), {"accuracy": asked, "convention": "orbiter"})
    raw["inputs"]["range"] = {"B.mass": [50.0, 100.0], "B.nozzle.flow": [0.0, 1.0]}
    assert problems(raw) == [
        'convention = "orbiter": knows no jet damping; leave it or inputs.flow out',
        "accuracy: the bounds by which it chooses know no flow; give law and propagator yourself",
    ]


def test_the_twin_bounds_no_error_with_flows():
    of = Twin(scene(STACK))
    with pytest.raises(ValueError, match=r"error_bound: .* has flows of propellant"):
        _ = of.error_bound


def test_a_scene_with_flows_is_written_as_it_is_read(tmp_path):
    path = tmp_path / "stack.toml"
    path.write_text(scene_text(scene(STACK)))
    assert load_scene(path) == scene(STACK)


def test_a_trade_that_freezes_the_mass_leaves_the_flows_out():
    courses = {"T.mass": [[0.0, 1000.0], [10.0, 900.0]], "T.main.flow": [[0.0, 10.0]]}
    raw = variant(STACK, {"experiment": {"duration": 10.0, "step": 1.0, "inputs": courses}})
    raw["inputs"]["range"] = {"T.main.flow": [0.0, 20.0]}
    tried = models(scene(raw), quick=False)
    assert {model.law for model in tried} == {"decoupled", "principal", "tensor"}
    frozen = variant_of(scene(raw), Choice(Model("tensor", "mass"), "taylor"))
    assert (frozen.inputs.mass, frozen.inputs.flow, dict(frozen.inputs.range)) == ((), (), {})
    assert frozen.experiment is not None
    assert not frozen.experiment.inputs
