"""Assemblies whose docks and points show what they carry and feel, and closed forms of two of them."""

from typing import Any

import numpy as np

from changes.histories import Values, assembly, elements, happening, start_values
from supervessel import Scene, Twin
from supervessel.scene.outputs import DOCK_OUTPUTS, POINT_OUTPUTS
from support import Array, variant

NEAR = {"mu": 5e5, "position": [80.0, 60.0, -50.0], "velocity": [30.0, -20.0, 10.0]}
"""A field whose gradient is as large as the other accelerations: strong, of a centre that is close."""


def tree(
    seed: int, count: int, *, wheels: bool, gravity: bool, held: int = 0, **rotation: Any
) -> dict[str, Any]:
    """Returns a random assembly whose docks and points have all outputs.

    held : how many docks are always closed and have ports that are constants, so that groups are rigid
    """
    raw = assembly(seed, count, wheels=wheels, pose_change="rate", **rotation)
    named = [f"{dock['name']}.{kind}" for dock in raw["docks"] if "name" in dock for kind in DOCK_OUTPUTS]
    points = [f"{vessel}.rcs.{kind}" for vessel in raw["vessels"] for kind in POINT_OUTPUTS]
    raw = variant(raw, {"outputs.names": [*named, *points]})
    inputs, ports = raw["inputs"], [port for dock in raw["docks"] for port in dock["ports"]]
    for dock in raw["docks"][:held]:
        if all(ports.count(port) == 1 for port in dock["ports"]) and dock.get("docked", True):
            inputs["docked"] = [name for name in inputs["docked"] if name != dock.get("name")]
            inputs["pose"] = [port for port in inputs["pose"] if port not in dock["ports"]]
    return variant(raw, {"inputs.gravity": True, "gravity": NEAR} if gravity else {})


def drawn(flown: Scene, seed: int) -> tuple[Array, Values]:
    """Returns a state, and inputs: docks, masses and poses have changed, and all acts that can."""
    rng, values = np.random.default_rng(seed), start_values(flown)
    possible = {
        "burn": True,
        "move": flown.inputs.pose,
        "undock": flown.inputs.docked,
        "dock": flown.inputs.docked,
    }
    for number, kind in enumerate(("burn", "move", "undock", "dock", "burn")):
        if possible[kind]:
            values |= happening(flown, values, [kind], seed + number)
    for owner in (*(f"{point}.force" for point in flown.inputs.force), "torque"):
        values |= elements(owner, rng.normal(size=3) * 10.0)
    for vessel in flown.inputs.vessel_torque:
        values |= elements(f"{vessel}.torque", rng.normal(size=3) * 10.0)
    values |= {f"{wheel}.torque": float(rng.normal()) for wheel in flown.inputs.wheel}
    attitude = rng.normal(size=4)
    momenta = 50.0 * rng.normal(size=len(flown.wheels))
    return np.array([*(attitude / np.linalg.norm(attitude)), *rng.normal(size=3), *momenta]), values


def shown(flown: Scene, x: Array, values: Values) -> dict[str, Array]:
    """Returns the twin's outputs by name, vectors whole."""
    twin = Twin(flown)
    u = [values.get(name, 0.0) for name in twin.u_names]
    known = {name: value for name, value in values.items() if name in twin.p_names}
    numbers = np.array(twin.outputs(x, u, twin.p_with(known))).ravel()
    found: dict[str, list[float]] = {}
    for name, number in zip(twin.y_names, numbers, strict=True):
        found.setdefault(name.partition("[")[0], []).append(number)
    return {name: np.array(vector) for name, vector in found.items()}


def dumbbell(masses: tuple[float, float], arms: tuple[float, float], **rotation: Any) -> dict[str, Any]:
    """Returns two mass points on massless arms along x that meet in a dock; the first one is the root."""
    first, second = (
        {
            "mass": mass,
            "pmi": [0.25, 0.25, 0.25],
            "ports": {
                "tip": {"position": [side * arm, 0, 0], "direction": [side, 0, 0], "alignment": [0, 1, 0]}
            },
        }
        for mass, arm, side in zip(masses, arms, (1.0, -1.0), strict=True)
    )
    return {
        "name": "dumbbell",
        "root": "A",
        "vessels": {"A": first, "B": second},
        "docks": [{"ports": ["A.tip", "B.tip"], "name": "bar"}],
        "rotation": rotation,
        "outputs": {"names": ["bar.force", "bar.moment", "attitude", "angular_velocity"]},
    }
