"""Digests of what the FMUs of some thirty scenes are made of, which a change of structure must keep.

python tests/bench/witness.py > before.json; change; python tests/bench/witness.py --against before.json

Of each scene and FMI version: the sources with model.c and token, the model description, and, but for the
library, all the rest of the archive. With --fly the whole archive and the outputs of the FMU flown for 2 s
too. Exit status 1 where something differs, each named on stderr.
"""

import argparse
import hashlib
import json
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import simulate_fmu

from fmu_build import build_fmu
from fmu_build.build import companions
from fmu_build.generate.model import generate
from fmu_build.interface.variable_table import variable_table
from supervessel import Scene, load_scene, parse_scene
from supervessel.equations import equations
from support import ISS_DG, body, variant
from support.costs import EXAMPLES, station

FORCES = {
    "vessels.DG.points": {"thruster": {"position": [1.0, 2.0, 3.0]}},
    "inputs.force": ["DG.thruster"],
    "inputs.vessel_torque": ["ISS", "DG"],
    "outputs.names": ["net_force", "principal_axes", "DG.attitude", "DG.angular_momentum", "ISS.origin"],
}
DOCKS = {
    "docks": [{"ports": ["ISS.P2", "DG.nose"], "name": "berth", "docked": False}],
    "inputs.docked": ["berth"],
}


def scenes() -> dict[str, Scene]:
    """Returns scenes by name: the examples, all inputs, every law and propagator, docks, many vessels."""
    found = {path.stem: load_scene(path) for path in sorted(EXAMPLES.glob("*.toml"))}
    raw: dict[str, Any] = {
        "everything": ISS_DG,
        "momentum": variant(ISS_DG, {"rotation": {"mass_change": "momentum"}}),
        "motion": variant(ISS_DG, {"inputs.motion": ["DG.nose"], "rotation": {"propagator": "dop853"}}),
        "orbiter": variant(ISS_DG, {"convention": "orbiter"}),
        "forces": variant(ISS_DG, FORCES),
        "docks": variant(ISS_DG, FORCES | DOCKS),
        "rest": variant(body(), {"inputs": {"torque": False}}),
        "many_masses": station(80, [f"v{i}" for i in range(80)]),
        "many_poses": station(60, [f"v{i}" for i in range(60)]),
    }
    docks = raw["many_poses"]["docks"]
    raw["many_poses"]["inputs"]["pose"] = [port for dock in docks for port in dock["ports"]]
    raw |= {f"law_{law}": body(law=law) for law in ("none", "decoupled", "principal")}
    raw |= {name: body(propagator=name) for name in ("rk4", "dop853", "taylor", "exact", "split")}
    return found | {name: parse_scene(scene) for name, scene in raw.items()}


def contents(scene: Scene) -> Iterator[tuple[str, bytes]]:
    """Yields what goes into a scene's FMUs, without compiling."""
    model = equations(scene)
    for fmi in (2, 3):
        sources, description = generate(scene, fmi, model)
        for name, text in sources.items():
            yield f"FMI {fmi} {name}", text.encode()
        yield f"FMI {fmi} modelDescription.xml", description
        for path, content in companions(model, variable_table(model), fmi).items():
            yield f"FMI {fmi} {path}", content


def flown(scene: Scene) -> Iterator[tuple[str, bytes]]:
    """Yields a scene's archives, and the outputs of their flights."""
    with tempfile.TemporaryDirectory() as folder:
        for fmi in (2, 3):
            path = build_fmu(scene, Path(folder, f"{fmi}.fmu"), fmi)
            yield f"FMI {fmi} archive", path.read_bytes()
            rows = simulate_fmu(str(path), stop_time=2.0, output_interval=0.1, fmi_type="CoSimulation")
            yield f"FMI {fmi} results", np.ascontiguousarray(rows.tolist()).tobytes()


def digests(fly: bool) -> dict[str, str]:
    """Returns what there is to compare, by scene, FMI version and part."""
    found: dict[str, str] = {}
    for name, scene in scenes().items():
        parts = dict(contents(scene)) | (dict(flown(scene)) if fly else {})
        found |= {f"{name} {part}": hashlib.sha256(text).hexdigest() for part, text in parts.items()}
    return found


def main() -> int:
    """Prints digests, or compares them with those of a file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--against", type=Path, metavar="BEFORE.json")
    parser.add_argument("--fly", action="store_true", help="build and fly the FMUs too, some minutes")
    options = parser.parse_args()
    found = digests(options.fly)
    if options.against is None:
        print(json.dumps(found, indent=1))
        return 0
    before = json.loads(options.against.read_text())
    different = [name for name in sorted(before.keys() | found.keys()) if before.get(name) != found.get(name)]
    for name in different:
        print(f"differs: {name}", file=sys.stderr)
    print(f"{len(found) - len(different)} of {len(found)} digests are equal")
    return int(bool(different))


if __name__ == "__main__":
    sys.exit(main())
