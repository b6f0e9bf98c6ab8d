"""What a scene costs: the scenes of the README's table, and what is counted of them."""

from pathlib import Path
from typing import Any

import casadi as ca

from supervessel import Scene, load_scene, parse_scene
from supervessel.equations import Equations
from support import ISS_DG, body, variant

EXAMPLES = Path(__file__).parents[2] / "examples"
NO_ARITHMETIC = (ca.OP_CONST, ca.OP_INPUT, ca.OP_OUTPUT)


def station(count: int, varying: list[str]) -> dict[str, Any]:
    """Returns the raw scene of a station of vessels v0, v1, ..., each docked to that of half its number."""
    vessels = {f"v{i}": _module(i) for i in range(count)}
    docks = [{"ports": [f"v{i // 2}.{'fore' if i % 2 else 'aft'}", f"v{i}.root"]} for i in range(1, count)]
    return {
        "name": "station",
        "root": "v0",
        "vessels": vessels,
        "docks": docks,
        "inputs": {"mass": varying, "torque": True},
    }


def _module(number: int) -> dict[str, Any]:
    ports = {
        "root": {"position": [1.0, 0.1, 0.2], "direction": [1.0, 0.0, 0.0], "alignment": [0.0, 1.0, 0.0]},
        "fore": {"position": [0.3, 0.0, 4.0], "direction": [0.0, 0.0, 1.0], "alignment": [0.6, 0.8, 0.0]},
        "aft": {"position": [0.0, -0.2, -3.0], "direction": [0.0, 0.0, -1.0], "alignment": [0.0, 1.0, 0.0]},
    }
    return {"mass": 1000.0 + number, "pmi": [1.0, 1.2, 1.5], "ports": ports}


def table_scenes() -> dict[str, Scene]:
    """Returns the scenes of the table by the names of its rows; `rk4` carries each over its steps."""
    by_rk4 = {"rotation.propagator": "rk4"}
    ship = {"outputs": None, "inputs": {"mass": ["DG"], "torque": True}}
    everything = {
        "inputs.mass": ["ISS", "DG"],
        "inputs.pmi": ["ISS", "DG"],
        "inputs.pose": ["ISS.P2", "DG.nose"],
    }
    raw = {
        "a single body": variant(body(), {"outputs": None}),
        "ISS with a ship, its mass an input": variant(ISS_DG, ship),
        "ISS with a ship, all masses, moments and poses inputs": variant(
            ISS_DG, {"outputs": None, **everything}
        ),
        "a launch stack of seven parts, four masses inputs": None,
        "a station of 1000 vessels, two masses inputs": station(1000, ["v300", "v701"]),
    }
    scenes = {}
    for name, tables in raw.items():
        if tables is None:
            scene = load_scene(EXAMPLES / "launch_stack.toml")
            rotation = scene.rotation.model_copy(update={"propagator": "rk4"})
            scenes[name] = scene.model_copy(update={"rotation": rotation})
        else:
            scenes[name] = parse_scene(variant(tables, by_rk4))
    return scenes


def operations(function: ca.Function) -> int:
    """Returns how many arithmetic operations a function of symbols takes."""
    kinds = (function.instruction_id(i) for i in range(function.n_instructions()))
    return sum(kind not in NO_ARITHMETIC for kind in kinds)


def all_operations(model: Equations) -> int:
    """Returns the operations of everything that is generated for a scene."""
    return sum(operations(function) for function in model.functions)
