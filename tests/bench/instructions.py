"""Counts the instructions of a step and of a composite, with valgrind's callgrind: `make bench`.

PYTHONPATH=tests python tests/bench/instructions.py

Unlike times these are the same on a machine that has other work to do, so that two versions of the C layer
can be compared to a thousandth. What is counted is what a flight of twice as many steps takes more, the
driver's own instructions included (some ten for each input set).
"""

import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fmpy.model_description import ModelDescription
from run import SCENE, build_host, names_of, unpack

from supervessel import Scene, load_scene, parse_scene
from support import ISS_DG, variant
from support.costs import station

SET, STEP, GET = 1, 2, 4
CHANGE = 1e-9
PROPAGATORS = ("auto", "rk4", "dop853", "taylor", "split")


def collected(host: Path, words: Sequence[str], steps: int, file: Path) -> int:
    """Returns the instructions of a flight of so many steps."""
    library, token, parts, change, *references = words
    command = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={file}", str(host)]
    command += [library, token, parts, change, str(steps), *references]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    found = re.search(r"Collected : (\d+)", done.stderr)
    assert found, done.stderr
    return int(found[1])


def per_step(host: Path, words: Sequence[str], steps: int, folder: Path) -> float:
    """Returns the instructions of a step: of twice as many steps less those of so many, over their number."""
    one, two = (collected(host, words, n, folder / "callgrind.out") for n in (steps, 2 * steps))
    return (two - one) / steps


def words_of(
    library: Path, description: ModelDescription, parts: int, inputs: Sequence[str], outputs: Sequence[str]
) -> list[str]:
    """Returns the words that tell the driver what to do with a library."""
    references = {v.name: v.valueReference for v in description.modelVariables}
    numbers = [str(n) for names in (inputs, outputs) for n in (len(names), *(references[x] for x in names))]
    return [str(library), description.guid, str(parts), repr(CHANGE), *numbers]


def scenes() -> dict[str, Scene]:
    """Returns the scenes that are flown, by name."""
    raw: dict[str, Any] = {
        name: variant(ISS_DG, {"rotation": {"propagator": name, "angular_velocity": [0.01, -0.02, 0.03]}})
        for name in PROPAGATORS
    }
    many = station(100, [f"v{i}" for i in range(100)])
    many["inputs"]["pose"] = [port for dock in many["docks"] for port in dock["ports"]]
    many["outputs"] = {"names": ["mass"]}
    names = ("mass", "attitude", "error_bound")
    watched = {
        f"{law}, {name}, error_bound": variant(scene, {"rotation.law": law, "outputs": {"names": [*names]}})
        for law, name in (("none", "rk4"), ("principal", "rk4"), ("tensor", "rk4"), ("tensor", "taylor"))
        for scene in [raw[name]]
    }
    watched |= {
        f"{law}, rk4": variant(raw["rk4"], {"rotation.law": law, "outputs": {"names": ["mass", "attitude"]}})
        for law in ("none", "principal", "tensor")
    }
    found = {f"ISS with a ship, {name}": parse_scene(scene) for name, scene in (raw | watched).items()}
    return {"examples/iss_dg.toml": load_scene(SCENE)} | found | {"100 vessels": parse_scene(many)}


def main() -> int:
    """Prints the table, a row for each scene."""
    if shutil.which("valgrind") is None:
        print("valgrind is not installed: no instructions are counted", file=sys.stderr)
        return 0
    print("| scene | step alone | all inputs changed, step, all outputs | composite |\n|---|---:|---:|---:|")
    with tempfile.TemporaryDirectory() as name:
        host = build_host("instructions", Path(name))
        for number, (scene_name, scene) in enumerate(scenes().items()):
            folder = Path(name, str(number))
            folder.mkdir()
            library, description = unpack(scene, folder)
            inputs, outputs = (names_of(description, causality) for causality in ("input", "output"))
            cases = {
                "step alone": words_of(library, description, STEP, [], []),
                "all": words_of(library, description, SET + STEP + GET, inputs, outputs),
                "composite": words_of(library, description, SET + GET, inputs, ["mass"]),
            }
            steps = 100 if scene_name == "100 vessels" else 1000
            cells = [f"{per_step(host, words, steps, folder):.1f}" for words in cases.values()]
            print(f"| {scene_name} | " + " | ".join(cells) + " |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
