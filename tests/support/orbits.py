"""Scenes in a field of gravity, as raw ones; and numbers about the Earth."""

from collections.abc import Mapping
from math import sqrt
from typing import Any

from support.scenes import ISS_DG, variant

EARTH = 3.986004418e14
"""Gravitational parameter [m3/s2]."""

HEIGHT = 6.786e6
SPEED = sqrt(EARTH / HEIGHT)
"""Distance [m] and speed [m/s] of an orbit at some 408 km, circular to rounding."""

ORBIT = {
    "position": [0.8 * HEIGHT, 0.6 * HEIGHT, 0.0],
    "velocity": [-0.36 * SPEED, 0.48 * SPEED, 0.8 * SPEED],
}


def orbiting(changes: Mapping[str, Any], base: Mapping[str, Any] = ISS_DG) -> dict[str, Any]:
    """Returns a raw scene in an orbit that its experiment makes, of ten steps of a second, then changed."""
    gravity = {
        "inputs.gravity": True,
        "gravity": {"mu": EARTH},
        "experiment": {"duration": 10.0, "step": 1.0, "orbit": ORBIT},
    }
    return variant(variant(base, gravity), changes)
