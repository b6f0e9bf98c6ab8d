"""Scenes that change, a tug with a tank on its arm and a ship at Mir, and inputs that change them."""

from typing import Any

import numpy as np

from changes.histories import Values, elements
from support import ISS_DG, OK, Instance, variant

# A tug with a tank on an arm that an importer may drive.
TUG: dict[str, Any] = {
    "name": "tug",
    "root": "tug",
    "vessels": {
        "tug": {
            "mass": 900.0,
            "pmi": [2.0, 3.0, 4.0],
            "ports": {
                "arm": {"position": [3.0, 0.5, 0.0], "direction": [1, 0, 0], "alignment": [0, 1, 0]},
                "top": {"position": [0.0, 0.0, 2.0], "direction": [0, 0, 1], "alignment": [0, 1, 0]},
            },
        },
        "tank": {
            "mass": 400.0,
            "pmi": [0.5, 0.75, 1.0],
            "ports": {
                "end": {"position": [1.0, 0.0, 0.2], "direction": [1, 0, 0], "alignment": [0, 1, 0]},
                "far": {"position": [-1.0, 0.0, 0.0], "direction": [-1, 0, 0], "alignment": [0, 1, 0]},
            },
        },
    },
    "docks": [
        {"ports": ["tug.arm", "tank.end"], "name": "held"},
        {"ports": ["tug.top", "tank.far"], "name": "stowed", "docked": False},
    ],
    "inputs": {"mass": ["tank"], "pose": ["tug.arm"], "docked": ["held", "stowed"], "torque": True},
    "rotation": {
        "propagator": "dop853",
        "tolerance": 1e-12,
        "mass_change": "momentum",
        "pose_change": "momentum",
        "angular_velocity": [0.2, -0.3, 0.1],
        "attitude": [3, 1, -2, 5],
    },
    "outputs": {"names": ["mass", "inertia", "angular_velocity", "attitude", "angular_momentum"]},
}
MIXED = variant(TUG, {"name": "mixed", "rotation.mass_change": "rate"})
STEADY = variant(TUG, {"name": "steady", "rotation.mass_change": "rate", "rotation.pose_change": "rate"})

TORQUE = elements("torque", (30.0, -20.0, 10.0))
DURATION = 4.0  # s


def drawn_in(time: float) -> Values:
    """Returns inputs that move all the time: the tank is drawn in, turned and filled."""
    share = time / DURATION
    pose = elements("tug.arm.position", (3.0 - share, 0.5 + share, 0.4 * np.sin(3.0 * share)))
    pose |= elements("tug.arm.direction", (1.0, 0.3 * share, 0.0))
    return pose | TORQUE | {"tank.mass": 400.0 + 200.0 * share**2}


TUG_EVENTS: list[Values] = [
    drawn_in(DURATION / 2),
    drawn_in(DURATION)
    | {"held.docked": 0.0, "stowed.docked": 1.0}
    | elements("stowed.velocity", (0.1, -0.2, 0.3))
    | elements("stowed.rate", (0.2, 0.1, -0.1)),
    {"stowed.docked": 0.0},
]

# The station and the ship of Orbiter, converted to right-handed axes.
MIR: dict[str, Any] = {
    "name": "mir_dg",
    "root": "Mir",
    "vessels": {
        "Mir": {
            "mass": 124340.0,
            "pmi": [86.1, 79.6, 37.0],
            "ports": {
                "side": {"position": [15.8, 0.12, -9.5], "direction": [1, 0, 0], "alignment": [0, 1, 0]},
                "fore": {"position": [0.0, 0.12, -10.74], "direction": [0, 0, -1], "alignment": [0, 1, 0]},
            },
        },
        "DG": ISS_DG["vessels"]["DG"],
    },
    "docks": [
        {"ports": ["Mir.side", "DG.nose"], "name": "berth", "docked": False},
        {"ports": ["DG.nose", "Mir.fore"], "name": "front", "docked": False},
    ],
    "inputs": {"docked": ["berth", "front"]},
    "rotation": {"propagator": "dop853", "angular_velocity": [0.01, -0.02, 0.03], "attitude": [3, 1, -2, 5]},
    "outputs": {"names": ["mass", "inertia", "angular_velocity", "attitude", "kinetic_energy"]},
}


def brought(place: str, fmi: int, raw: dict[str, Any]) -> Instance:
    """Returns an instance at a place of its life, on its way for a while."""
    interface, mode = place.split()
    options = {"eventModeUsed": True} if interface == "events" else {}
    return lead(Instance(raw, fmi, exchange=interface == "me", **options), interface, mode)


def lead(instance: Instance, interface: str, mode: str) -> Instance:
    assert instance.enter() == OK
    if mode != "initialising":
        assert instance.exit() == OK
    if mode == "stepping":
        assert instance.step(0.5) == OK
    if interface == "me" and mode != "initialising":
        assert instance.run() == OK
        if mode == "event":
            assert instance._status(instance.fmu.enterEventMode) == OK
    instance.log.clear()
    return instance
