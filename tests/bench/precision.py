"""What a simulated second costs to 1e-3, 1e-6, 1e-9 and 1e-12 rad, in plain RK4 steps: `make bench`.

A body of diag(1, 2, 3) kg m2 is flown natively for 100 s, free from (1, 2, 0.5) rad/s, state got every 0.1 s
or at the end alone, and 40 s under a constant torque; each propagator by its own tolerance, rk4 by its
sub-steps. For each error the loosest setting that keeps within it is shown. Errors are the attitude's at the
end, against a series to 25 digits.
"""

import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import extract, read_model_description
from run import build_host

from fmu_build import build_fmu
from fmu_build.platforms import host_platform
from supervessel import parse_scene
from support import series

GOALS = (1e-3, 1e-6, 1e-9, 1e-12)  # rad
MOMENTS, RATES = (1.0, 2.0, 3.0), (1.0, 2.0, 0.5)  # kg m2, rad/s
ANGLES = (0.4, 0.2, 0.1, 0.05, 0.025, 0.0125, 0.00625, 0.003, 0.0015)  # rad, of rk4's sub-steps
TOLERANCES = [10.0**-digits for digits in range(2, 16)]
SHOWN = ("attitude", "angular_velocity")
NO_RUNG = "-"


@dataclass(frozen=True)
class Motion:
    """A flight: torque (3,) [N m], body axes, duration [s], in so many communication steps."""

    label: str
    torque: tuple[float, float, float]
    duration: float
    count: int


MOTIONS = (
    Motion("free, state every 0.1 s", (0.0, 0.0, 0.0), 100.0, 1000),
    Motion("free, 100 s in one step", (0.0, 0.0, 0.0), 100.0, 1),
    Motion("torque, state every 0.1 s", (0.1, -0.2, 0.15), 40.0, 400),
    Motion("torque, 40 s in one step", (0.1, -0.2, 0.15), 40.0, 1),
)


@dataclass(frozen=True)
class Rung:
    """What a setting gave: error of the attitude [rad], nanoseconds and plain RK4 steps of the flight."""

    setting: str
    error: float
    nanoseconds: float
    steps: float


class Body:
    """The FMU of the body by a propagator, unpacked, and the program that flies it."""

    def __init__(self, host: Path, folder: Path, propagator: str, angle: float = 0.05) -> None:
        place = folder / f"{propagator}_{angle!r}"
        place.mkdir()
        fmu = build_fmu(parse_scene(scene(propagator, angle)), place / "body.fmu")
        unpacked, description = (
            Path(extract(str(fmu), str(place / "unpacked"))),
            read_model_description(str(fmu)),
        )
        library = unpacked / "binaries" / host_platform().name / f"body{host_platform().suffix}"
        self.command = [str(host), str(library), description.guid]
        self.references = {v.name: v.valueReference for v in description.modelVariables}

    def fly(self, motion: Motion, tolerance: float = 0.0) -> list[float] | None:
        """Returns nanoseconds, plain RK4 steps, then the attitude at the end; None if a step is refused."""
        torque = [w for i in range(3) for w in (self.references[f"torque[{i + 1}]"], motion.torque[i])]
        shown = [r for name, r in self.references.items() if name.partition("[")[0] in SHOWN]
        words = [motion.duration / motion.count, motion.count, tolerance, 3, *torque, len(shown), *shown]
        command = [*self.command, *map(str, words)]
        done = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        return None if done.startswith("discarded") else [float(word) for word in done.split()]


def scene(propagator: str, angle: float) -> dict[str, Any]:
    """Returns the raw scene of the body of 1 kg with torque inputs."""
    return {
        "name": "body",
        "root": "B",
        "vessels": {"B": {"mass": 1.0, "inertia": np.diag(MOMENTS).tolist()}},
        "inputs": {"torque": True},
        "rotation": {"propagator": propagator, "angular_velocity": list(RATES), "max_angle_step": angle},
        "outputs": {"names": list(SHOWN)},
    }


def rungs(bodies: dict[str, list[tuple[float, Body]]], propagator: str, motion: Motion) -> list[Rung]:
    """Returns what each setting of a propagator gives for a motion; none where the FMU refuses it."""
    state = [1.0, 0.0, 0.0, 0.0, *RATES]
    end = series.flight("tensor", np.diag(MOMENTS).tolist(), state, motion.torque, motion.duration)
    truth = np.array([float(x) for x in end[:4]])
    found = []
    for angle, body in bodies[propagator]:
        for tolerance in TOLERANCES if propagator not in ("rk4", "exact") else [0.0]:
            flown = body.fly(motion, tolerance)
            if flown is None:
                return []
            q = np.array(flown[2:6])
            off = 2.0 * min(np.linalg.norm(q - truth), np.linalg.norm(q + truth))
            words = {"rk4": f"sub-steps of {angle:g} rad", "exact": ""}
            setting = words.get(propagator, f"tolerance {tolerance:.0e}")
            found.append(Rung(setting, float(off), flown[0], flown[1]))
    return found


def cells(found: list[Rung], duration: float) -> list[str]:
    """Returns a cell for each goal: microseconds and plain steps of a second, and the setting."""
    made = []
    for goal in GOALS:
        best = next((rung for rung in found if rung.error <= goal), None)
        made.append(
            f"{best.nanoseconds / duration * 1e-3:.3g}; {best.steps / duration:.3g}"
            + (f"; {best.setting}" if best.setting else "")
            if best
            else NO_RUNG
        )
    return made


def main() -> None:
    """Prints the table."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        host = build_host("flight", folder)
        bodies = {p: [(0.05, Body(host, folder, p))] for p in ("auto", "exact", "taylor", "dop853")}
        bodies["rk4"] = [(angle, Body(host, folder, "rk4", angle)) for angle in ANGLES]
        print(
            "| us and plain RK4 steps for each second; setting | | "
            + " | ".join(f"{g:g} rad" for g in GOALS)
            + " |"
        )
        print("|---|---|" + "---|" * len(GOALS))
        for motion in MOTIONS:
            for propagator in bodies:
                found = rungs(bodies, propagator, motion)
                if found:
                    print(
                        f"| {motion.label} | `{propagator}` | "
                        + " | ".join(cells(found, motion.duration))
                        + " |"
                    )


if __name__ == "__main__":
    main()
