"""Flights of choices, see `choices.Choice`, through an experiment, each in a process of its own."""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmu_build.compile.compiler import NEEDED
from fmu_build.flight.choices import SHOWN, Choice
from fmu_build.flight.experiment import Course, course_of
from fmu_build.flight.results import LIBRARIES, are_numbers, keep, place_of, read
from fmu_build.flight.workshop import HERE, Built, Workshop, build_all, host_library, source_of
from supervessel.problems import TradeError
from supervessel.scene.schema import Scene
from supervessel.shell.processes import run

Array = NDArray[np.float64]

TIMING = 0.25
"""Time [s] that the timing of a flight may take in all; a longer flight is timed once."""

TIME_LIMIT = 300.0
"""Time [s] after which a flight is given up."""

OUT_OF_TIME = f"did not end within {TIME_LIMIT:g} s"


@dataclass(frozen=True)
class Flown:
    """The result of a choice's flight.

    refused     : why it could not be flown; all other fields are then 0 or empty. None: it was flown
    nanoseconds : time of a communication step [ns]: set moving inputs, step, get attitude and rate
    ratio       : that time over the time of a plain RK4 step, measured in turn with it
    sub_steps   : number of sub-steps of the whole flight
    size        : of the library [bytes]
    samples     : q_inertial_body and angular velocity [rad/s], body axes, (n, 7), at the course's samples
    """

    refused: str | None
    nanoseconds: float
    ratio: float
    sub_steps: int
    size: int
    samples: Array


def fly_all(
    scene: Scene, choices: Sequence[Choice], shop: Workshop, done: Callable[[str], None] = lambda _: None
) -> dict[Choice, Flown]:
    """Returns the results of choices; those not flown before are built, two at a time, then flown one by one.

    done : called with a text for each choice that is built or flown
    Each result is kept at once. Raises TradeError if a result cannot be kept or a process breaks down,
    BuildError if the compiler fails.
    """
    course = course_of(scene)
    places = {choice: place_of("trade", scene, asdict(choice)) for choice in choices}
    found: dict[Choice, Flown] = {}
    for choice, place in places.items():
        kept = _read(place, len(course.sampled))
        if kept is not None:
            found[choice] = kept
            done(str(choice))
    missing = [choice for choice in choices if choice not in found]
    build_all(scene, missing, shop, done)
    for choice in missing:
        found[choice] = _fly(shop.built[source_of(choice)], choice, course, shop)
        if found[choice].refused != OUT_OF_TIME:  # another time there may be more of it
            _keep(places[choice], found[choice])
        done(str(choice))
    return found


def _fly(built: Built, choice: Choice, course: Course, shop: Workshop) -> Flown:
    """Returns the result of a flight in a process of its own. Raises TradeError if the process fails."""
    moving = {name: v for name, v in course.numbers.items() if _is_input(built, choice, name)}
    inputs = InputCourses(
        np.arange(course.steps),
        np.column_stack([np.zeros((course.steps, 0)), *moving.values()]),
        np.column_stack([np.zeros((course.steps, 0)), *course.booleans.values()]),
    )
    job = job_of(choice, course, TIMING)
    names = list(moving), list(course.booleans)
    ended = run_host(built, shop.folder, job, names, [inputs.written(shop.folder / "inputs")])
    if ended is None:
        return _refused(OUT_OF_TIME)
    if isinstance(ended, str):
        raise TradeError(f"{choice}: {ended}")
    (answer,), raw = ended
    if answer["refused"] is not None:
        return _refused(answer["refused"])
    return Flown(
        None,
        answer["nanoseconds"],
        answer["ratio"],
        answer["sub_steps"],
        built.library.stat().st_size,
        np.frombuffer(raw).reshape(-1, 7),
    )


@dataclass(frozen=True)
class InputCourses:
    """Values of the moving inputs in a flight.

    rows     : (r,), numbers of the communication steps before which inputs are set, ascending, from 0
    numbers  : (r, n), values of the inputs that are numbers, each in its unit
    booleans : (r, m), values of docks, 0 and 1
    """

    rows: NDArray[np.int64]
    numbers: Array
    booleans: Array

    def written(self, file: Path, *, once: bool = False) -> dict[str, Any]:
        """Writes the values into three files and returns their paths as host.py takes them.

        file : path of the files without their suffixes
        once : whether existing files hold these values already
        """
        kinds = {"rows": np.int64, "numbers": np.float64, "booleans": np.bool_}
        places = {key: file.with_suffix(f".{key}") for key in kinds}
        for key, kind in () if once and places["booleans"].exists() else kinds.items():
            places[key].write_bytes(np.ascontiguousarray(getattr(self, key), dtype=kind).tobytes() or b"\0")
        return {key: str(place) for key, place in places.items()} | {"row_count": len(self.rows)}


def job_of(choice: Choice, course: Course, seconds: float) -> dict[str, Any]:
    """Returns the part of `run_host`'s job that describes an experiment.

    seconds : time that timing may take [s]; 0: no timing
    """
    return {
        "tolerance": choice.tolerance or 0.0,
        "size": course.size,
        "last_size": course.last_size,
        "steps": course.steps,
        "sampled": course.sampled.tolist(),
        "seconds": seconds,
        "field": course.field,
    }


def run_host(
    built: Built,
    folder: Path,
    job: Mapping[str, Any],
    names: tuple[Sequence[str], Sequence[str]],
    courses: Sequence[Mapping[str, Any]],
) -> tuple[list[dict[str, Any]], bytes] | str | None:
    """Returns the results of a job of host.py, run in a process of its own, and its samples as bytes.

    folder  : of the workshop
    job     : from `job_of`; without "field" the inputs of gravity keep the values of the start
    names   : of the inputs that move: those that are numbers, and docks
    courses : of each flight, the paths that `InputCourses.written` returns
    Returns None if the process does not end within TIME_LIMIT, a text if it breaks down.
    """
    shown = [f"{name}[{i}]" for name, n in zip(SHOWN, (4, 3), strict=True) for i in range(1, n + 1)]
    with tempfile.TemporaryDirectory(dir=folder, prefix="job-") as place:
        file, samples, fields = (Path(place, name) for name in ("job.json", "samples", "field"))
        field = {name: v for name, v in job.get("field", {}).items() if name in built.references}
        fields.write_bytes(np.column_stack([*field.values()]).tobytes() if field else b"\0")
        whole = {
            "judge": False,
            **job,
            "host": str(host_library(folder)),
            "library": str(built.library),
            "token": built.token,
            "field": str(fields),
            "field_references": [built.references[name] for name in field],
            "number_references": [built.references[name] for name in names[0]],
            "boolean_references": [built.references[name] for name in names[1]],
            "shown": [built.references[name] for name in shown],
            "courses": list(courses),
            "samples": str(samples),
        }
        file.write_text(json.dumps(whole))
        command = [sys.executable, "-I", str(HERE / "host.py"), str(file)]
        try:
            ended = run(command, TIME_LIMIT, environment=surroundings_of_python())
        except subprocess.TimeoutExpired:
            return None
        if ended.returncode != 0:
            last = (ended.stderr.strip().splitlines() or ["nothing was said"])[-1]
            return f"its flight ended with status {ended.returncode}: {last}"
        return json.loads(ended.stdout), samples.read_bytes()


def surroundings_of_python() -> dict[str, str]:
    """Returns the environment variables of a Python process: those by which it finds its own libraries."""
    return {name: os.environ[name] for name in (*NEEDED, *LIBRARIES) if name in os.environ}


def _is_input(built: Built, choice: Choice, name: str) -> bool:
    """Whether a choice's library has an input: it lacks inputs that the choice leaves at their start."""
    return name in built.references or not choice.model.frozen


def _refused(reason: str) -> Flown:
    return Flown(reason, 0.0, 0.0, 0, 0, np.zeros((0, 7)))


def _read(place: Path, samples: int) -> Flown | None:
    """Returns the flight that is kept in a file, None where there is no valid one with that many samples."""

    def is_flight(kept: Any) -> bool:
        refused, shape = kept["refused"], np.array(kept["samples"], dtype=np.float64).reshape(-1, 7).shape
        numbers = [kept[name] for name in ("nanoseconds", "ratio", "sub_steps", "size")]
        return (
            kept.keys() == {field.name for field in fields(Flown)}
            and isinstance(refused, str | None)
            and shape[0] == (samples if refused is None else 0)
            and all(type(row) is list and len(row) == 7 for row in kept["samples"])
            and are_numbers([*numbers, *(value for row in kept["samples"] for value in row)])
        )

    kept = read(place, is_flight)
    if kept is None:
        return None
    return Flown(**(kept | {"samples": np.array(kept["samples"], dtype=np.float64).reshape(-1, 7)}))


def _keep(place: Path, flown: Flown) -> None:
    keep(place, asdict(flown) | {"samples": flown.samples.tolist()})
