"""This project's ways to fly the work of fliers.py, from native code, through FMPy, and by the twin."""

import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from fliers import DURATION, MOMENTS, RATES, Work
from fmpy import extract, read_model_description
from fmpy.fmi3 import FMU3Slave
from fmpy.model_description import ModelDescription
from ladder import Flight, Settings

from fmu_build import build_fmu
from fmu_build.platforms import host_platform
from supervessel import Twin, parse_scene

SHOWN = ("attitude", "angular_velocity")


def scene(propagator: str, **rotation: Any) -> dict[str, Any]:
    """Returns the raw scene of the body of 1 kg with torque inputs."""
    return {
        "name": "body",
        "root": "B",
        "vessels": {"B": {"mass": 1.0, "inertia": np.diag(MOMENTS).tolist()}},
        "inputs": {"torque": True},
        "rotation": {"propagator": propagator, "angular_velocity": list(RATES), **rotation},
        "outputs": {"names": list(SHOWN)},
    }


@dataclass(frozen=True)
class Built:
    """An FMU, unpacked."""

    folder: Path
    description: ModelDescription

    @property
    def library(self) -> Path:
        return self.folder / "binaries" / host_platform().name / f"body{host_platform().suffix}"

    def references(self, *groups: str) -> list[int]:
        """Returns the value references of all elements of variables."""
        variables = self.description.modelVariables
        return [v.valueReference for group in groups for v in variables if v.name.partition("[")[0] == group]


@cache
def built(folder: Path, propagator: str, angle: float = 0.05) -> Built:
    """Returns the FMU of the body by a propagator, rk4 in sub-steps of an angle [rad]."""
    place = folder / f"{propagator}_{angle!r}"
    place.mkdir()
    fmu = build_fmu(parse_scene(scene(propagator, max_angle_step=angle)), place / "body.fmu")
    return Built(Path(extract(str(fmu), str(place / "unpacked"))), read_model_description(str(fmu)))


def native(host: Path, fmu: Built, work: Work, tolerance: float) -> tuple[float, list[float]] | None:
    """Returns plain RK4 steps of a flight and the attitude at its end; None if the FMU discards a step."""
    torque = [w for pair in zip(fmu.references("torque"), work.torque, strict=True) for w in pair]
    found = flown(host, fmu, (work.span, work.spans, tolerance), torque, SHOWN)
    return None if found is None else (found[0], found[1][:4])


def flown(
    host: Path, fmu: Built, steps: tuple[float, int, float], given: Sequence[Any], shown: Sequence[str]
) -> tuple[float, list[float]] | None:
    """Returns plain RK4 steps of a flight and outputs at its end; None if the FMU discards a step.

    steps : size of a step [s], number of steps, tolerance
    given : references and values of inputs, in turn
    """
    got = fmu.references(*shown)
    words = [*steps, len(given) // 2, *given, len(got), *got]
    command = [host, fmu.library, fmu.description.guid, *words]
    done = subprocess.run([str(w) for w in command], check=True, capture_output=True, text=True)
    if done.stdout.startswith("discarded"):
        return None
    _, ratio, *values = map(float, done.stdout.split())
    return ratio, values


def through_fmpy(folder: Path, propagator: str) -> Callable[[Work], Settings]:
    """Returns the way through FMPy's own calls, doStep and getFloat64 for each output."""

    def ways(work: Work) -> Settings:
        fmu = built(folder, propagator)
        shown = fmu.references(*SHOWN)
        for digits in range(6, 13):

            def ready(tolerance: float = 10.0**-digits) -> Flight:
                body = FMU3Slave(
                    guid=fmu.description.guid,
                    unzipDirectory=str(fmu.folder),
                    modelIdentifier="body",
                    instanceName="body",
                )
                body.instantiate()
                body.enterInitializationMode(tolerance=tolerance)
                body.exitInitializationMode()
                body.setFloat64(fmu.references("torque"), work.torque)

                def fly() -> Any:
                    for i in range(work.spans):
                        body.doStep(i * work.span, work.span)
                        x = body.getFloat64(shown)
                    return np.array(x[:4])

                return fly

            yield f"tolerance 1e-{digits}", ready

    return ways


def twin(folder: Path, propagator: str) -> Callable[[Work], Settings]:
    """Returns the way of the twin's rollout, generated C, one call from Python."""

    def ways(work: Work) -> Settings:
        model = Twin(parse_scene(scene("rk4")), propagator=propagator, doublings=14)
        run = import_module("casadi").Function.__call__
        if propagator == "exact" and any(work.torque):
            return
        fewest = 1 if propagator == "exact" else 128
        for steps in [max(work.spans, fewest) * 2**doubling for doubling in range(6)]:
            flown = model.rollout(steps)
            (flown,) = model.generate(folder / f"{propagator}_{steps}", [flown], derivatives=0).values()
            at = [ca.DM(model.x_start), ca.repmat(ca.DM(work.torque), 1, steps), ca.DM(0, 1)]

            def fly(flown: Any = flown, at: Any = at, steps: int = steps) -> Any:
                return np.array(run(flown, *at, DURATION / steps))[:4, -1]

            yield f"{steps} steps", lambda fly=fly: fly

    return ways
