"""The cells of the table: an importer, a version and an interface, a scene.

Each is flown in a process of its own, so that an importer that dies takes no other cell with it.
"""

import json
import os
import shutil
import subprocess
import sys
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path

import numpy as np

from fmu_build import build_fmu
from importers.scenes import COURSES, TIMES, booleans, inputs
from importers.table import ROWS, Row
from importers.tools import FOLDER, HERE, lacking
from importers.truth import Truth, compared, deviation, tolerance, truth
from supervessel.scene.variables import output_variables

SECONDS = 900.0
WORDS = 300
"""Characters of what an importer says that are kept."""


@dataclass(frozen=True)
class Cell:
    """What became of a cell.

    deviation : the largest from the reference; None where nothing was compared
    tolerance : what it may be
    instead   : what the importer did instead of flying
    lacking   : why it was not run
    """

    deviation: float | None = None
    tolerance: float | None = None
    instead: str = ""
    lacking: str = ""

    @property
    def passed(self) -> bool:
        """Whether it flew and came out right."""
        if self.instead or self.lacking:
            return False
        return self.deviation is None or (self.tolerance is not None and self.deviation <= self.tolerance)


def place(key: str, name: str) -> Path:
    """Returns where what became of a cell is kept."""
    return FOLDER / "cells" / f"{key}-{name}.json".replace(" ", "_")


@cache
def built(name: str, fmi: int) -> Path:
    """Returns the FMU of a scene, built once by a process."""
    parsed = COURSES[name].scene
    path = FOLDER / "fmus" / f"fmi{fmi}" / f"{parsed.name}.fmu"
    path.parent.mkdir(parents=True, exist_ok=True)
    return build_fmu(parsed, path, fmi)


@cache
def held_but(name: str, moved: frozenset[str], euler: bool = False) -> Truth:
    """Returns what a scene's flight must be if only these inputs move, the others staying at their start."""
    courses = inputs(COURSES[name])
    held = {known: np.full_like(values, values[0]) for known, values in courses.items()}
    return truth(COURSES[name], held | {known: courses[known] for known in moved}, euler)


def run(key: str, name: str) -> Cell:
    """Flies a cell and returns what became of it, which is also kept."""
    row = ROWS[key]
    cell = Cell(lacking=lacking(row.package)) if lacking(row.package) else _flown(row, key, name)
    file = place(key, name)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(asdict(cell)), encoding="utf-8")
    return cell


def _flown(row: Row, key: str, name: str) -> Cell:
    folder = FOLDER / "flights" / f"{key}-{name}".replace(" ", "_")
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    (folder / "flight.json").write_text(json.dumps(_asked(row, name)), encoding="utf-8")
    words = [sys.executable, "-m", "importers.fly", row.module, str(folder)]
    environment = os.environ | {"PYTHONPATH": str(HERE.parent)}
    try:
        done = subprocess.run(
            words, capture_output=True, text=True, timeout=SECONDS, check=False, env=environment
        )
    except subprocess.TimeoutExpired:
        return Cell(instead=f"did not end in {SECONDS:.0f} s")
    answer = folder / "answer.json"
    if not answer.exists():
        return Cell(instead=_short(f"died, status {done.returncode}: {_last(done.stderr)}"))
    said = json.loads(answer.read_text(encoding="utf-8"))
    if said["instead"]:
        return Cell(instead=_short(said["instead"]))
    if not row.flies:
        return Cell()
    found = {scalar: np.array(values) for scalar, values in said["found"].items()}
    right = held_but(name, frozenset(said["moved"]), row.euler)
    course, solver = COURSES[name], row.exchange
    allowed = tolerance(course, right.angle, euler=row.euler, solver=solver)
    side = right.after if row.after else right.before
    return Cell(deviation(_steps(found), _steps(side)), allowed)


def _asked(row: Row, name: str) -> dict[str, object]:
    """Returns what the process that flies has to know, see `flight.Flight`."""
    course = COURSES[name]
    outputs = compared(variable.name for variable in output_variables(course.scene))
    return {
        "fmu": str(built(name, row.fmi)),
        "fmi": row.fmi,
        "exchange": row.exchange,
        "times": TIMES.tolist(),
        "inputs": {known: values.tolist() for known, values in inputs(course).items()},
        "booleans": sorted(booleans(course)),
        "outputs": outputs,
    }


def _steps(series: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Returns what is read at the ends of steps: not every importer shows values before the first."""
    return {name: values[1:] for name, values in series.items()}


def _last(text: str) -> str:
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return lines[-1] if lines else "said nothing"


def _short(text: str) -> str:
    """Returns the beginning and the end of what was said: libraries in C++ tell the cause last."""
    plain = " ".join(text.split()).replace(str(FOLDER.parents[1]), "")
    return plain if len(plain) <= WORDS else f"{plain[: WORDS // 3]} ... {plain[-2 * WORDS // 3 :]}"
