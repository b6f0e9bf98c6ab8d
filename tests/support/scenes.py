"""Scenes that many tests share: raw ones, as dictionaries, and texts of scene files."""

import copy
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from supervessel import Scene, parse_scene
from supervessel.scene.schema import Accuracy

LAWS = ("none", "decoupled", "principal", "tensor")
PROPAGATORS = ("rk4", "dop853", "taylor", "exact", "split", "auto")

TURNING = {"angular_velocity": [0.05, -0.08, 0.11], "attitude": [0.5, -0.5, 0.7, 0.1]}
"""A start about no axis in particular, of a table [rotation]."""

STEADY = {"pose_change": "rate"}
"""Of a table [rotation]: poses keep the angular velocity, as masses do, and are continuous in model exchange;
for tests that are not about what changes keep."""

ISS_DG: dict[str, Any] = {
    "name": "iss_dg",
    "root": "ISS",
    "vessels": {
        "ISS": {
            "mass": 455000.0,
            "pmi": [385.0, 719.0, 508.0],
            "ports": {
                "P2": {
                    "position": [0.09, -17.9, 3.8],
                    "direction": [0.0, -1.0, 0.0],
                    "alignment": [0.0, 0.0, -1.0],
                }
            },
        },
        "DG": {
            "mass": 24500.0,
            "pmi": [15.5, 22.1, 7.7],
            "ports": {
                "nose": {
                    "position": [0.0, -0.49, -10.076],
                    "direction": [0.0, 0.0, -1.0],
                    "alignment": [0.0, 1.0, 0.0],
                }
            },
        },
    },
    "docks": [{"ports": ["ISS.P2", "DG.nose"]}],
    "inputs": {"mass": ["DG"], "pmi": ["DG"], "pose": ["DG.nose"], "torque": True},
    "outputs": {
        "names": [
            "mass",
            "barycentre",
            "pmi",
            "inertia",
            "angular_velocity",
            "attitude",
            "kinetic_energy",
            "angular_momentum",
        ]
    },
}
"""The ISS with a DeltaGlider, everything of the ship an input, every output."""


def variant(raw: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Returns a deep copy of a raw scene with values put at dotted paths; a value of None removes the key."""
    new: dict[str, Any] = copy.deepcopy(dict(raw))
    for path, value in changes.items():
        table = new
        *tables, key = path.split(".")
        for name in tables:
            table = table.setdefault(name, {})
        if value is None:
            del table[key]
        else:
            table[key] = _tables(value)
    return new


def _tables(value: Any) -> Any:
    """Returns a value whose tables are its own, so that later changes leave the given one as it is."""
    return {key: _tables(part) for key, part in value.items()} if isinstance(value, dict) else value


def draw_inputs(generator: np.random.Generator) -> dict[str, Any]:
    """Returns usable values for all inputs of ISS_DG."""
    return {
        "DG.mass": generator.uniform(11e3, 24.5e3),
        "DG.pmi": np.array([15.5, 22.1, 20.0]) * generator.uniform(0.8, 1.2),
        "DG.nose.position": generator.normal([0.0, -0.49, -10.0], 0.5),
        "DG.nose.direction": generator.normal([0.0, 0.0, -1.0], 0.2),
        "DG.nose.alignment": generator.normal([0.0, 2.0, 0.0], 0.2),
        "torque": generator.normal(size=3) * 1e4,
    }


def body(mass: float = 1000.0, pmi: Sequence[float] = (1.0, 2.0, 2.5), **rotation: Any) -> dict[str, Any]:
    """Returns the raw scene of a single body with torque inputs and every output."""
    return {
        "name": "body",
        "root": "B",
        "vessels": {"B": {"mass": mass, "pmi": list(pmi)}},
        "inputs": {"torque": True},
        "rotation": rotation,
        "outputs": copy.deepcopy(ISS_DG["outputs"]),
    }


def scene(raw: Mapping[str, Any]) -> Scene:
    """Returns the scene of a raw one; where it does not say otherwise propagated by RK4, whose steps can be
    foretold.

    A raw scene with [accuracy] has its law and propagator by the test: the scene is as `choose`
    would leave it.
    """
    if "accuracy" in raw:
        asked = Accuracy.model_validate(raw["accuracy"])
        return scene(variant(raw, {"accuracy": None})).model_copy(update={"accuracy": asked})
    propagator = raw.get("rotation", {}).get("propagator", "rk4")
    return parse_scene(variant(raw, {"rotation.propagator": propagator}))


BALL = """\
name = "ball"
root = "B"
[vessels.B]
mass = 2.0
pmi = [1.0, 1.5, 2.0]
"""
"""The file of a single body."""

EXPERIMENT = """\
[rotation]
angular_velocity = [0.01, 0.02, 0.03]
[experiment]
duration = 10.0
step = 1.0
"""
"""What a trade needs beside BALL."""

ACCURACY_ASKED = """\
[inputs]
torque = true
[inputs.range]
torque = [-0.1, 0.1]
[accuracy]
attitude = 1e-6
horizon = 5.0
step = 0.1
"""
"""What has law and propagator chosen for BALL."""
