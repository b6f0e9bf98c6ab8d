"""Two docked vessels whose masses differ by a factor 1e12."""

from functools import cache
from typing import Any

import numpy as np

from stability import truth
from stability.flights import TEMPLATE, single
from stability.truth import Case, Problem, mp
from supervessel.equations import composite_at_start
from support import Array, scene, variant

NEAR, FAR = [0.0, 0.0, 5.0], [1.5, -2.5, -3.0]
"""Ports [m]: the second vessel stands at NEAR - FAR and is not turned."""

MASSES = 4.2e5, 4.2e-7  # kg


def pair(propagator: str, masses: tuple[float, float]) -> dict[str, Any]:
    """Returns the raw scene; tensors of 12 to 20 m2 times mass."""
    first, second = (
        {
            "mass": mass,
            "inertia": (mass * 4.0 * np.array(TEMPLATE)).tolist(),
            "ports": {
                "p": {"position": position, "direction": [0.0, 0.0, out], "alignment": [0.0, 1.0, 0.0]}
            },
        }
        for mass, position, out in ((masses[0], NEAR, 1.0), (masses[1], FAR, -1.0))
    )
    changes = {"name": "pair", "vessels": {"B": first, "C": second}, "docks": [{"ports": ["B.p", "C.p"]}]}
    return variant(single({}, propagator), changes)


def pair_truth(raw: dict[str, Any]) -> Any:
    """Returns the tensor by Steiner's theorem with the reduced mass, (3, 3), numbers of mpmath."""
    vessels = raw["vessels"].values()
    first, second = (mp.mpf(vessel["mass"]) for vessel in vessels)
    own = sum(np.array([[mp.mpf(x) for x in row] for row in vessel["inertia"]]) for vessel in vessels)
    d = np.array([mp.mpf(n) - mp.mpf(f) for n, f in zip(NEAR, FAR, strict=True)])
    return own + first * second / (first + second) * (np.dot(d, d) * np.eye(3, dtype=int) - np.outer(d, d))


def pair_inertia(raw: dict[str, Any]) -> Array:
    """Returns the tensor that the FMU has, (3, 3) [kg m2]."""
    xx, yy, zz, xy, xz, yz = composite_at_start(scene(raw))["inertia"]
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


@cache
def pair_case() -> Case:
    """Returns 20 s of the pair's motion, of the tensor that the FMU has, as truth.py solves it."""
    inertia = pair_inertia(pair("exact", MASSES))
    start = [0.5, -0.5, 0.5, 0.5], [0.3, 0.7, 0.5], [0.0, 0.0, 0.0], 20.0
    raw, _ = truth._solved("mass ratio", Problem("pair", inertia.tolist(), *start))
    return Case(
        **{name: raw[name] for name in ("name", "category")},
        inertia=inertia,
        attitude=np.array(start[0]),
        omega=np.array(start[1]),
        torque=np.array(start[2]),
        time=start[3],
        attitude_end=tuple(mp.mpf(x) for x in raw["attitude_end"]),
        omega_end=tuple(mp.mpf(x) for x in raw["omega_end"]),
        **{
            name: float(raw[name])
            for name in ("cond_attitude", "cond_rate", "motion_attitude", "motion_rate")
        },
    )
