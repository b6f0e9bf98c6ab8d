"""Scenes out of which propellant flows: a stage below a payload, and a lone rocket."""

from typing import Any

from support import TURNING, body, variant

STACK: dict[str, Any] = {
    "name": "stack",
    "root": "P",
    "vessels": {
        "P": {
            "mass": 400.0,
            "inertia": [[900.0, 20.0, -10.0], [20.0, 1400.0, 30.0], [-10.0, 30.0, 1600.0]],
            "centre_of_mass": [0.1, -0.2, 0.3],
            "ports": {"aft": {"position": [0, 0, -1], "direction": [0, 0, -1], "alignment": [1, 0, 0]}},
        },
        "T": {
            "mass": 1000.0,
            "pmi": [0.9, 1.1, 0.5],
            "centre_of_mass": [0.05, 0.0, -0.1],
            "ports": {
                "top": {"position": [2, 0, 0.1], "direction": [1, 0, 0.1], "alignment": [-0.02, 1, 0.2]}
            },
            "points": {"main": {"position": [-3, 0.1, 0]}, "side": {"position": [0, 1.5, -0.5]}},
        },
    },
    "docks": [{"name": "joint", "ports": ["P.aft", "T.top"]}],
    "inputs": {
        "mass": ["T"],
        "docked": ["joint"],
        "torque": True,
        "force": ["T.main"],
        "flow": ["T.main", "T.side"],
    },
    "rotation": TURNING | {"propagator": "dop853", "tolerance": 1e-13},
    "outputs": {"names": ["mass", "angular_velocity", "attitude", "angular_momentum", "net_force"]},
}
"""A payload, the root, on a stage with a nozzle and a vent, which a dock lets go."""

MASS, FLOWS = "T.mass", ("T.main.flow", "T.side.flow")


def rocket(pmi: tuple[float, float, float], arm: float, **rotation: Any) -> dict[str, Any]:
    """Returns a rocket of 100 kg whose nozzle is `arm` [m] below its centre of mass, on its z axis."""
    at = {"vessels.B.points.nozzle": {"position": [0.0, 0.0, -arm]}}
    return variant(body(100.0, pmi, **rotation), at | {"inputs": {"mass": ["B"], "flow": ["B.nozzle"]}})
