"""Flies one flight, or checks one archive, in a process of its own; imports nothing that makes FMUs.

    python -m importers.fly MODULE FOLDER     (tests on the path)

FOLDER holds flight.json; answer.json, what was found or what was said instead, is written there.
"""

import json
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from importers.flight import Flight, InsteadError


def answer(module: Any, flight: Flight) -> dict[str, Any]:
    """Returns what an importer found, and which inputs it moved; nothing of one that only checks."""
    if not hasattr(module, "fly"):
        module.check(flight.fmu)
        return {"moved": [], "found": {}}
    found = module.fly(flight)
    moved = module.moved(flight) if hasattr(module, "moved") else set(flight.inputs)
    return {"moved": sorted(moved), "found": {name: values.tolist() for name, values in found.items()}}


def main(module: str, folder: Path) -> None:
    """Flies what a folder holds and leaves the answer there."""
    given = json.loads((folder / "flight.json").read_text(encoding="utf-8"))
    flight = Flight(
        fmu=Path(given["fmu"]),
        fmi=given["fmi"],
        exchange=given["exchange"],
        times=np.array(given["times"]),
        inputs={name: np.array(values) for name, values in given["inputs"].items()},
        booleans=frozenset(given["booleans"]),
        outputs=given["outputs"],
        folder=folder,
    )
    said: dict[str, Any] = {"instead": ""}
    try:
        said |= answer(import_module(f"importers.{module}"), flight)
    except InsteadError as error:
        said["instead"] = str(error)
    except Exception as error:
        said["instead"] = f"{type(error).__name__}: {error}"
    (folder / "answer.json").write_text(json.dumps(said), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))
