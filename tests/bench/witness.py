"""Digests of the FMUs of a dozen scenes: what a change of the code's structure must leave as it is.

python tests/bench/witness.py > before.json; change; python tests/bench/witness.py --against before.json

Of each scene and FMI version: the archive, model.c, the model description without its token, and the outputs
of the FMU flown for some steps. Exit status 1 where something differs, each named on stderr.
"""

import argparse
import hashlib
import json
import re
import sys
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import simulate_fmu

from fmu_build import build_fmu
from supervessel import load_scene, parse_scene
from support import ISS_DG, body, variant
from support.costs import station

EXAMPLES = Path(__file__).parents[2] / "examples"
TOKEN = re.compile(rb"\{[0-9a-f]{64}\}")


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


def scenes() -> dict[str, Any]:
    """Returns scenes by name: the examples, all inputs, every law and propagator, docks, many vessels."""
    found = {path.stem: load_scene(path) for path in sorted(EXAMPLES.glob("*.toml"))}
    many = [f"v{i}" for i in range(80)]
    raw = {
        "everything": ISS_DG,
        "momentum": variant(ISS_DG, {"rotation": {"mass_change": "momentum"}}),
        "motion": variant(ISS_DG, {"inputs.motion": ["DG.nose"], "rotation": {"propagator": "dop853"}}),
        "orbiter": variant(ISS_DG, {"convention": "orbiter"}),
        "forces": variant(ISS_DG, FORCES),
        "docks": variant(ISS_DG, FORCES | DOCKS),
        "rest": variant(body(), {"inputs": {"torque": False}}),
        "many_masses": station(80, many),
    }
    raw |= {f"law_{law}": body(law=law) for law in ("none", "decoupled", "principal")}
    raw |= {name: body(propagator=name) for name in ("rk4", "dop853", "taylor", "exact", "split")}
    poses = station(60, [f"v{i}" for i in range(60)])
    poses["inputs"]["pose"] = [port for dock in poses["docks"] for port in dock["ports"]]
    raw["many_poses"] = poses
    return found | {name: parse_scene(scene) for name, scene in raw.items()}


def digests() -> dict[str, str]:
    """Returns what there is to compare, by scene, FMI version and kind."""
    found: dict[str, str] = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, scene in scenes().items():
            for fmi in (2, 3):
                print(name, fmi, file=sys.stderr)
                path = build_fmu(scene, Path(folder, f"{name}_{fmi}.fmu"), fmi)
                for kind, content in _contents(path).items():
                    found[f"{name} FMI {fmi} {kind}"] = hashlib.sha256(content).hexdigest()
    return found


def _contents(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        description, model = archive.read("modelDescription.xml"), archive.read("sources/model.c")
    flown = simulate_fmu(str(path), stop_time=2.0, output_interval=0.1, fmi_type="CoSimulation")
    values = np.ascontiguousarray(flown.tolist())
    return {
        "archive": path.read_bytes(),
        "model.c": model,
        "description": TOKEN.sub(b"", description),
        "results": values.tobytes(),
    }


def main() -> int:
    """Prints digests, or compares them with those of a file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--against", type=Path, metavar="BEFORE.json")
    options = parser.parse_args()
    found = digests()
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
