"""How much larger than the true error the output error_bound is: `make accuracy`, or by itself

PYTHONPATH=tests python -m accuracy.tightness

Every case is flown from random directions of spin, under each law that leaves terms out, by rk4; the truth is
the law tensor's flight by taylor at 1e-15.
"""

import sys
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmu_build.flight.distance import attitude_apart
from support import ISS_DG, variant
from support.fmus import Instance
from support.scenes import body

EXAMPLES = Path(__file__).parents[2] / "examples"


def example(name: str) -> dict[str, Any]:
    return tomllib.loads((EXAMPLES / f"{name}.toml").read_text())


LAWS = ("none", "decoupled", "principal")
FLIGHTS = 20
TUMBLER = [[1.3, 0.2, 0.1], [0.2, 1.6, 0.15], [0.1, 0.15, 2.1]]


@dataclass(frozen=True)
class Case:
    """Flights of a scene: its raw form, speed [rad/s], duration and step [s]."""

    raw: Mapping[str, Any]
    speed: float
    duration: float
    step: float


CASES = {
    "ISS with a ship, one turn in an orbit, 600 s": Case(ISS_DG, 0.0011, 600.0, 1.0),
    "the same, 6000 s": Case(ISS_DG, 0.0011, 6000.0, 1.0),
    "launch stack, 0.5 degrees/s, 120 s": Case(example("launch_stack"), 0.0087, 120.0, 0.5),
    "servicer, 1 degree/s, 60 s": Case(example("servicer"), 0.0175, 60.0, 0.1),
    "servicer, 10 degrees/s, 60 s": Case(example("servicer"), 0.175, 60.0, 0.1),
    "tumbler, moments 1.2 : 1.6 : 2.2 tilted, 1 rad/s, 30 s": Case(
        variant(body(), {"vessels.B": {"mass": 1.0, "inertia": TUMBLER}}), 1.0, 30.0, 0.02
    ),
}


def flown(case: Case, law: str, direction: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Returns the attitude at the end, (4,), and the bound there [rad]; of the law "tensor" by taylor."""
    rotation = {"law": law, "propagator": "rk4", "max_angle_step": 0.05}
    if law == "tensor":
        rotation = {"law": law, "propagator": "taylor", "tolerance": 1e-15}
    names = ["attitude", *(["error_bound"] if law != "tensor" else [])]
    instance = Instance(variant(case.raw, {"rotation": rotation, "outputs": {"names": names}}))
    instance.initialise(angular_velocity_start=case.speed * direction)
    for _ in range(round(case.duration / case.step)):
        instance.step(case.step)
    attitude = np.array([instance.get(f"attitude[{i}]") for i in (1, 2, 3, 4)])
    bound = 0.0 if law == "tensor" else instance.get("error_bound")
    instance.free()
    return attitude, bound


def row(case: Case, law: str) -> tuple[float, float, int, float]:
    """Returns bound over true error, median and largest of those known; how many are; median error [rad]."""
    draw = np.random.default_rng(2)
    ratios, errors = [], []
    for _ in range(FLIGHTS):
        direction = draw.normal(size=3)
        direction /= np.linalg.norm(direction)
        true, _ = flown(case, "tensor", direction)
        attitude, bound = flown(case, law, direction)
        error = float(attitude_apart(attitude[None], true[None])[0])
        assert error <= bound, (law, direction)
        errors.append(error)
        if bound < pi:
            ratios.append(bound / error)
    known = ratios or [float("nan")]
    return float(np.median(known)), max(known), len(ratios), float(np.median(errors))


def main() -> int:
    """Prints the table."""
    print("| flights | law | off by, median [rad] | bound over error, median | worst | bound below pi |")
    print("|---|---|---:|---:|---:|---:|")
    for name, case in CASES.items():
        for law in LAWS:
            median, worst, known, error = row(case, law)
            ratios = f"{median:.2f} | {worst:.1f}" if known else "- | -"
            print(f"| {name} | `{law}` | {error:.1e} | {ratios} | {known} of {FLIGHTS} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
