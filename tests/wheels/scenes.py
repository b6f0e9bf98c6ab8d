"""Scenes with wheels: a body alone, and one that carries another on an arm that moves."""

from typing import Any

import numpy as np

from support import TURNING, Array, variant

INERTIA = [[90.0, 6.0, -4.0], [6.0, 120.0, 8.0], [-4.0, 8.0, 150.0]]
WHEELS: dict[str, dict[str, Any]] = {
    "x": {"axis": [1, 0, 0], "inertia": 8.0, "momentum": 30.0},
    "tilted": {"axis": [1, 2, 2], "inertia": 5.0, "momentum": -12.0},
    "store": {"axis": [0, 0.3, -0.4], "momentum": 7.0},
}
"""The last one has no inertia: only its momentum counts."""

AXES = np.array([[1.0, 0.0, 0.0], [1 / 3, 2 / 3, 2 / 3], [0.0, 0.6, -0.8]])
INERTIAS = np.array([8.0, 5.0, 0.0])

GYROSTAT: dict[str, Any] = {
    "name": "gyrostat",
    "root": "B",
    "vessels": {"B": {"mass": 300.0, "inertia": INERTIA, "wheels": WHEELS}},
    "inputs": {"torque": True, "wheel": ["B.x", "B.store"]},
    "rotation": TURNING | {"propagator": "dop853", "tolerance": 1e-14},
    "outputs": {
        "names": [
            "angular_velocity",
            "attitude",
            "kinetic_energy",
            "angular_momentum",
            "inertia",
            *("B.x.momentum", "B.x.speed", "B.tilted.momentum", "B.tilted.speed", "B.store.momentum"),
        ]
    },
}
"""A body alone."""

CARRIER: dict[str, Any] = {
    "name": "carrier",
    "root": "A",
    "vessels": {
        "A": {
            "mass": 100.0,
            "pmi": [1.0, 1.2, 1.5],
            "centre_of_mass": [0.1, -0.2, 0.05],
            "wheels": {"x": {"axis": [1, 0, 0], "inertia": 3.0, "momentum": 20.0}},
            "ports": {"arm": {"position": [1, 0, 0], "direction": [1, 0, 0], "alignment": [0, 0, 1]}},
        },
        "B": {
            "mass": 30.0,
            "pmi": [0.3, 0.4, 0.5],
            "wheels": {
                "y": {"axis": [0, 1, 1], "inertia": 1.0, "momentum": 3.0},
                "store": {"axis": [2, -1, 0.5], "momentum": -2.0},
            },
            "ports": {"end": {"position": [-1, 0.2, 0], "direction": [-1, 0, 0], "alignment": [0, 0.5, 1]}},
        },
    },
    "docks": [{"name": "dock", "ports": ["A.arm", "B.end"]}],
    "inputs": {
        "mass": ["B"],
        "pose": ["B.end"],
        "motion": ["B.end"],
        "docked": ["dock"],
        "torque": True,
        "wheel": ["A.x", "B.y"],
    },
    "rotation": TURNING | {"propagator": "rk4", "mass_change": "momentum"},
    "outputs": {
        "names": [
            "angular_velocity",
            "attitude",
            "angular_momentum",
            "kinetic_energy",
            *("A.x.momentum", "A.x.speed", "B.y.momentum", "B.y.speed", "B.store.momentum"),
            *("A.angular_momentum", "B.angular_momentum"),
        ]
    },
}
"""A body that carries another, which an arm moves and a dock lets go. Every change keeps the momentum: it is
the state of model exchange."""

RATES = variant(CARRIER, {"name": "carrier_rates", "rotation.mass_change": "rate"})
"""The same where the angular velocity is that state."""

MOTION = {
    **{f"B.end.velocity[{i}]": x for i, x in enumerate((0.2, -0.1, 0.3), start=1)},
    **{f"B.end.rate[{i}]": x for i, x in enumerate((-0.3, 0.2, 0.4), start=1)},
}


def skew(v: Array) -> Array:
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
