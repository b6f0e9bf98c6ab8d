"""What the propagators cost, in plain RK4 steps, and how far off they end: `make bench`.

Each row is one communication step of an FMU, loaded natively, from the scene's start; the principal axes have
been found before. Quote the ratios: the speed of machines drifts. Each is the least of 3000 tries.
"""

import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import extract, read_model_description
from run import build_host
from scipy.integrate import solve_ivp

from fmu_build import build_fmu
from fmu_build.platforms import host_platform
from supervessel import parse_scene, reference

RATES = (0.3, 0.7, 0.5)  # rad/s
SPEED = float(np.linalg.norm(RATES))
TORQUE = (0.01, -0.02, 0.015)  # N m
DIAGONAL = np.diag([1.0, 2.0, 3.0])  # kg m2
TILTED = np.array([[1.0, 0.1, -0.05], [0.1, 2.0, 0.15], [-0.05, 0.15, 2.8]])
SHOWN = ("attitude", "angular_velocity", "error_estimate", "principal_moments")


def scene(inertia: np.ndarray, **rotation: Any) -> dict[str, Any]:
    """Returns the raw scene of a single body of 1 kg."""
    return {
        "name": "body",
        "root": "B",
        "vessels": {"B": {"mass": 1.0, "inertia": inertia.tolist()}},
        "inputs": {"torque": True},
        "rotation": {"angular_velocity": list(RATES), **rotation},
        "outputs": {"names": list(SHOWN)},
    }


class Body:
    """An FMU of a body, unpacked, and the program that times its steps."""

    def __init__(self, folder: Path, raw: dict[str, Any]) -> None:
        self.raw = raw
        fmu = build_fmu(parse_scene(raw), folder / "body.fmu")
        unpacked = Path(extract(str(fmu), str(folder / "unpacked")))
        description = read_model_description(str(fmu))
        self.library = unpacked / "binaries" / host_platform().name / f"body{host_platform().suffix}"
        self.token = description.guid
        self.references = {v.name: v.valueReference for v in description.modelVariables}

    def time(
        self, steps: Path, size: float, repeats: int, torque: Any, tolerance: float = 0.0
    ) -> list[float]:
        """Returns nanoseconds and plain steps of one communication step, then attitude, rate and estimate."""
        inputs = [
            x for i, v in enumerate(torque) for x in (self.references[f"torque[{i + 1}]"], repr(float(v)))
        ]
        shown = [r for name, r in self.references.items() if name.partition("[")[0] in SHOWN]
        words = [size, repeats, tolerance, 3, *inputs, len(shown), *shown]
        done = subprocess.run(
            [str(steps), str(self.library), self.token, *map(str, words)],
            check=True,
            capture_output=True,
            text=True,
        )
        return [float(word) for word in done.stdout.split()]


def error(raw: dict[str, Any], end: Any, torque: Any, size: float) -> float:
    """Returns how far attitude [rad] and rate (relative) are off, the larger, from a tight integration."""
    inertia = np.array(raw["vessels"]["B"]["inertia"])

    def ode(_: float, x: np.ndarray) -> np.ndarray:
        acceleration = reference.angular_acceleration("tensor", inertia, x[4:], torque)
        return np.concatenate([reference.attitude_dot(x[:4], x[4:]), acceleration])

    start = np.array([1.0, 0.0, 0.0, 0.0, *RATES])
    truth = solve_ivp(ode, (0.0, size), start, method="DOP853", rtol=3e-14, atol=1e-17).y[:, -1]
    attitude = 2.0 * np.linalg.norm(np.array(end[:4]) - truth[:4] / np.linalg.norm(truth[:4]))
    return float(max(attitude, np.linalg.norm(np.array(end[4:7]) - truth[4:]) / np.linalg.norm(truth[4:])))


def main() -> None:
    """Prints both tables."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        steps = build_host("steps", folder)

        def body(label: str, raw: dict[str, Any]) -> Body:
            place = folder / label
            place.mkdir()
            return Body(place, raw)

        print("Free motion, one step of `exact`\n")
        print("| body | turn [rad] | ns | plain RK4 steps |\n|---|---:|---:|---:|")
        for label, inertia in (("diagonal", DIAGONAL), ("tilted", TILTED)):
            exact = body(f"exact_{label}", scene(inertia, propagator="exact"))
            for turn in (0.02, 2.0, 1e3, 1e5):
                taken, ratio, *_ = exact.time(steps, turn / SPEED, 500, (0.0, 0.0, 0.0))
                print(f"| {label} | {turn:g} | {taken:.0f} | {ratio:.1f} |")
        print("\nConstant torque, one communication step of 40 s (36 rad), diagonal body\n")
        print("| propagator | tolerance | error | plain RK4 steps |\n|---|---:|---:|---:|")
        for propagator in ("dop853", "taylor", "auto"):
            for tolerance in (1e-3, 1e-5, 1e-6, 1e-8, 1e-9, 1e-11, 1e-12, 1e-15):
                raw = scene(DIAGONAL, propagator=propagator, tolerance=tolerance)
                flown = body(f"{propagator}_{tolerance}", raw)
                _, ratio, *end = flown.time(steps, 40.0, 3, TORQUE)
                off = error(raw, end, TORQUE, 40.0)
                print(f"| {propagator} | {tolerance:g} | {off:.1e} | {ratio:.0f} |")


if __name__ == "__main__":
    main()
