"""What a scene costs: the scenes of the table in MEASURED.md, and what is counted of them."""

import tomllib
from pathlib import Path
from typing import Any

import casadi as ca

from fmu_build.compile.library import compile_sources
from fmu_build.generate.model import generate
from fmu_build.generate.sources import source_file_names, source_files
from fmu_build.platforms import PLATFORMS
from supervessel import Scene
from supervessel.equations import equations
from support import ISS_DG, body, variant

EXAMPLES = Path(__file__).parents[2] / "examples"
(PLATFORM,) = (platform for platform in PLATFORMS if platform.name == "x86_64-linux")
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


def table_raw() -> dict[str, dict[str, Any]]:
    """Returns the raw scenes of the table by the names of its rows, carried over a step by `rk4`."""
    ship = {"outputs": None, "inputs": {"mass": ["DG"], "torque": True}}
    both = {"mass": ["ISS", "DG"], "pmi": ["ISS", "DG"], "pose": ["ISS.P2", "DG.nose"], "torque": True}
    stack = tomllib.loads((EXAMPLES / "launch_stack.toml").read_text(encoding="utf-8"))
    raw = {
        "a single body": variant(body(), {"outputs": None}),
        "ISS with a ship, mass of the ship": variant(ISS_DG, ship),
        "the same, masses, moments and poses of both": variant(ISS_DG, {"outputs": None, "inputs": both}),
        "launch stack of seven parts, masses of four": variant(stack, {"outputs": None}),
        "station of 1000 vessels, masses of two": station(1000, ["v300", "v701"]),
    }
    return {name: variant(tables, {"rotation.propagator": "rk4"}) for name, tables in raw.items()}


def operations(function: ca.Function) -> int:
    """Returns how many arithmetic operations a function of symbols takes."""
    kinds = (function.instruction_id(i) for i in range(function.n_instructions()))
    return sum(kind not in NO_ARITHMETIC for kind in kinds)


def library_size(scene: Scene) -> int:
    """Returns the bytes of the library that a scene's FMI 3.0 FMU has for x86_64 Linux, the whole file."""
    sources, _ = generate(scene, 3)
    packed = source_files(sources, 3, scene.name)
    names = source_file_names(sources, 3)
    binaries = compile_sources(packed, names, 3, [PLATFORM], scene.name)
    (library,) = binaries.values()
    return len(library)


def table_row(name: str, scene: Scene) -> str:
    """Returns the name, the operations and the size of a row, as MEASURED.md has them."""
    model = equations(scene)
    composite, everything = operations(model.composite), sum(map(operations, model.functions))
    return f"| {name} | {composite} | {everything} | {library_size(scene) / 1000:.0f} |"
