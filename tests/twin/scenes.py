"""Random scenes of docked vessels, and random values for their inputs."""

from typing import Any

import casadi as ca
import numpy as np

from supervessel import Twin
from support import ISS_DG, LAWS, STEADY, Array


def random_pmi(rng: np.random.Generator) -> list[float]:
    """Returns moments of six points at random distances: they obey the triangle inequality."""
    x, y, z = rng.uniform(0.05, 1.0, size=3) * 10.0 ** rng.uniform(-1.0, 3.0)
    return [float(y + z), float(z + x), float(x + y)]


def random_port(rng: np.random.Generator) -> dict[str, list[float]]:
    direction = rng.normal(size=3)
    alignment = np.cross(direction, rng.normal(size=3))
    return {
        "position": (10.0 * rng.normal(size=3)).tolist(),
        "direction": direction.tolist(),
        "alignment": alignment.tolist(),
    }


def random_vessel(rng: np.random.Generator) -> dict[str, Any]:
    vessel: dict[str, Any] = {"mass": float(10.0 ** rng.uniform(1.0, 6.0)), "ports": {}}
    if rng.random() < 0.6:
        vessel["pmi"] = random_pmi(rng)
    else:
        axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        inertia = vessel["mass"] * axes @ np.diag(random_pmi(rng)) @ axes.T
        vessel["inertia"] = (0.5 * (inertia + inertia.T)).tolist()
    if rng.random() < 0.5:
        vessel["centre_of_mass"] = rng.normal(size=3).tolist()
    return vessel


def random_scene(seed: int) -> dict[str, Any]:
    """Returns the raw scene of two to five vessels docked at random, with a random choice of inputs."""
    rng = np.random.default_rng(seed)
    names = [f"V{i}" for i in range(2 + seed % 4)]
    vessels = {name: random_vessel(rng) for name in names}
    docks = []
    for i in range(1, len(names)):
        parent = names[rng.integers(i)]
        vessels[parent]["ports"][f"to{i}"] = random_port(rng)
        vessels[names[i]]["ports"]["own"] = random_port(rng)
        docks.append({"ports": rng.permutation([f"{parent}.to{i}", f"{names[i]}.own"]).tolist()})
    ports = [port for dock in docks for port in dock["ports"]]

    law = LAWS[seed // 3 % 4]

    def some(of: list[str]) -> list[str]:
        return [name for name in of if rng.random() < 0.4]

    return {
        "name": f"scene{seed}",
        "root": str(rng.choice(names)),
        "vessels": vessels,
        "docks": docks,
        "inputs": {
            "mass": some(names),
            "pmi": some([name for name in names if "pmi" in vessels[name]]),
            "pose": some(ports),
            "torque": seed % 3 != 2,
        },
        "rotation": {
            **({} if law == "none" else STEADY),
            "law": law,
            "angular_velocity": (0.1 * rng.normal(size=3)).tolist(),
            "attitude": rng.normal(size=4).tolist(),
        },
        "outputs": {"names": rng.permutation(ISS_DG["outputs"]["names"]).tolist()},
    }


def random_inputs(twin: Twin, rng: np.random.Generator) -> tuple[Array, Array]:
    """Returns p and u that the FMU accepts; some masses are zero."""
    p = twin.p_start.copy()
    for i, name in enumerate(twin.p_names):
        if name.endswith(".mass"):
            root = name == f"{twin.scene.root}.mass"
            p[i] *= 0.0 if rng.random() < 0.15 and not root else rng.uniform(0.5, 1.5)
        elif name.endswith(".pmi[1]"):
            p[i : i + 3] = random_pmi(rng)
        elif ".pmi[" not in name:
            p[i] = 5.0 * rng.normal()
    size = np.diag(np.array(twin.composite(p)[2])).mean()
    return p, 0.01 * size * rng.normal(size=len(twin.u_names))


def numbers(value: Any) -> Array:
    """Returns what a CasADi function returned as a flat array."""
    return np.array(ca.DM(value)).ravel(order="F")
