"""Orbiter's composite from the definition: six points a vessel, the diagonal about the common barycentre.

Nothing of the model is used: vessels are placed in the axes that their numbers are given in, whatever
their handedness, because a sum of squares knows none.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from support import Array


def port_frame(port: Sequence[float]) -> tuple[Array, Array]:
    """Returns position, (3,), and columns direction, alignment, their product, (3, 3), of nine numbers."""
    position, d, a = np.array(port, dtype=float).reshape(3, 3)
    d = d / np.linalg.norm(d)
    a = a - d * (a @ d)
    a = a / np.linalg.norm(a)
    return position, np.column_stack([d, a, np.cross(d, a)])


def placed(
    ports: Mapping[str, Sequence[float]], docks: Sequence[tuple[str, str]], root: str
) -> dict[str, tuple[Array, Array]]:
    """Returns rotation and origin of each vessel in the root's axes; docks in any order, "vessel.port"."""
    poses = {root: (np.eye(3), np.zeros(3))}
    waiting = [pair for one, other in docks for pair in ((one, other), (other, one))]
    while missing := [(a, b) for a, b in waiting if b.split(".")[0] not in poses]:
        for here, there in missing:
            parent, child = here.split(".")[0], there.split(".")[0]
            if parent in poses and child not in poses:
                R, origin = poses[parent]
                (p, A), (q, B) = port_frame(ports[here]), port_frame(ports[there])
                turned = R @ np.column_stack([-A[:, 0], A[:, 1], -A[:, 2]]) @ B.T
                poses[child] = turned, origin + R @ p - turned @ q
    return poses


def six_point_pmi(
    vessels: Mapping[str, tuple[float, Sequence[float]]], poses: Mapping[str, tuple[Array, Array]]
) -> Array:
    """Returns the composite's moments over mass, (3,) [m2], along the root's axes.

    vessels : mass [kg] and three moments over mass [m2] of each
    """
    masses, points = [], []
    for name, (mass, (k1, k2, k3)) in vessels.items():
        R, origin = poses[name]
        for axis, square in enumerate((k2 + k3 - k1, k3 + k1 - k2, k1 + k2 - k3)):
            for sign in (1.0, -1.0):
                point = np.zeros(3)
                point[axis] = sign * np.sqrt(1.5 * abs(square))
                masses.append(mass / 6.0)
                points.append(origin + R @ point)
    m, r = np.array(masses), np.array(points)
    x, y, z = (r - m @ r / m.sum()).T
    return np.array([m @ (y * y + z * z), m @ (z * z + x * x), m @ (x * x + y * y)]) / m.sum()


def scene_pmi(raw: Mapping[str, Any]) -> Array:
    """Returns the same for a raw scene whose vessels are given by pmi."""
    vessels = {name: (v["mass"], v["pmi"]) for name, v in raw["vessels"].items()}
    ports = {
        f"{name}.{port}": [*p["position"], *p["direction"], *p["alignment"]]
        for name, v in raw["vessels"].items()
        for port, p in v.get("ports", {}).items()
    }
    docks = [tuple(dock["ports"]) for dock in raw.get("docks", ())]
    return six_point_pmi(vessels, placed(ports, docks, raw["root"]))
