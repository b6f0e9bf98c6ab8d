"""What scenes of many moving vessels cost: composite per vessel, build, import: `make bench`.

The composite is timed natively, beside a plain RK4 step; vessels stand as in `support.costs.station`.
"""

import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import casadi as ca
from fmpy import extract, read_model_description
from run import build_host

from fmu_build.build import build_fmu
from fmu_build.compile.compiler import FLAGS, compile_library
from fmu_build.generate.model import generate
from fmu_build.generate.sources import source_files
from fmu_build.platforms import host_platform
from supervessel import Scene, parse_scene
from supervessel.equations import p_start
from support.costs import station

COUNTS = (1, 3, 10, 30, 100, 300, 1000)
MOST_INPUTS = 2000
"""For CasADi's importer, whose time and memory grow with their square and more."""

VISIBLE = [flag for flag in FLAGS if flag not in ("-fvisibility=hidden", "-s")]


def masses(count: int) -> dict[str, Any]:
    """Returns the raw scene of a station with the mass of every vessel an input."""
    return station(count, [f"v{i}" for i in range(count)])


def poses(count: int) -> dict[str, Any]:
    """Returns the same with the pose of every docked port an input as well."""
    raw = masses(count)
    raw["inputs"]["pose"] = [port for dock in raw["docks"] for port in dock["ports"]]
    return raw


def written(scene: Scene, folder: Path) -> dict[str, int]:
    """Writes a scene's C to a folder and returns the counts of its header."""
    for path, text in source_files(generate(scene, 3)[0], 3, scene.name).items():
        (folder / Path(path).name).write_bytes(text)
    found = re.findall(r"^ +(\w+) = (\d+),$", (folder / "scene.h").read_text(), re.MULTILINE)
    return {name: int(number) for name, number in found}


def compiled(scene: Scene, folder: Path) -> tuple[Path, dict[str, int]]:
    """Returns the library of a scene's generated C, its functions visible, and the counts of its header."""
    counts = written(scene, folder)
    library = folder / f"scene{host_platform().suffix}"
    sources = [Path(name) for name in ("vessel_loop.c", "model.c", "scene.c")]
    compile_library(sources, host_platform(), library, VISIBLE, folder)
    return library, counts


def command(host: Path, scene: Scene, folder: Path, repeats: int) -> tuple[list[str], str]:
    """Returns the words that time a scene's composite, and its inputs."""
    library, counts = compiled(scene, folder)
    inputs = p_start(scene)
    words = [host, library, f"{scene.name}_fmi3_composite", len(inputs), counts["COMPOSITE_COUNT"]]
    return [*map(str, words), str(counts["WORK_REAL"]), str(repeats)], " ".join(map(repr, map(float, inputs)))


def time_composite(host: Path, scene: Scene, folder: Path) -> tuple[float, float]:
    """Returns nanoseconds and plain RK4 steps of one evaluation of a scene's composite."""
    words, inputs = command(host, scene, folder, max(5, 5000 // len(scene.vessels)))
    done = subprocess.run(words, input=inputs, check=True, capture_output=True, text=True)
    nanoseconds, ratio, *_ = map(float, done.stdout.split())
    return nanoseconds, ratio


def main(counts: list[int]) -> None:
    """Prints the table, a row for each number of vessels."""
    print(
        "| vessels | masses: ns per vessel | plain RK4 steps | and poses: ns per vessel | plain RK4 steps |"
    )
    print("|---:|---:|---:|---:|---:|")
    with tempfile.TemporaryDirectory() as name:
        host = build_host("vessels", Path(name))
        for count in counts:
            cells = []
            for make in (masses, poses):
                folder = Path(name, f"{make.__name__}_{count}")
                folder.mkdir()
                nanoseconds, ratio = time_composite(host, parse_scene(make(count)), folder)
                cells += [f"{nanoseconds / count:.1f}", f"{ratio / count:.3f}"]
            print(f"| {count} | " + " | ".join(cells) + " |", flush=True)


def print_importers(counts: Sequence[int]) -> None:
    """Prints how long the build takes, from the raw scene, and two importers, a row for each scene."""
    print(
        "\n| vessels | inputs | build [s] | of processors [s] | FMPy reads [s] | CasADi: torque alone [s] "
        "| all inputs [s] |"
    )
    print("|---:|---:|---:|---:|---:|---:|---:|")
    with tempfile.TemporaryDirectory() as name:
        os.environ["SUPERVESSEL_CACHE"] = name
        for make, count in ((masses, 1), *((make, count) for make in (masses, poses) for count in counts)):
            begun, before = time.perf_counter(), sum(os.times()[:4])
            fmu = build_fmu(parse_scene(make(count)), Path(name, f"{make.__name__}_{count}.fmu"))
            taken = [time.perf_counter() - begun, sum(os.times()[:4]) - before]
            if count == 1:  # the compiler now has what it needs for any scene
                continue
            begun = time.perf_counter()
            read_model_description(str(fmu))
            taken.append(time.perf_counter() - begun)
            unpacked = str(extract(str(fmu), str(Path(name, fmu.stem))))
            inputs = len(ca.DaeBuilder("it", unpacked, {"debug": False}).u())
            taken.append(casadi_create(unpacked, True))
            cells = [f"{seconds:.1f}" for seconds in taken]
            cells.append(f"{casadi_create(unpacked, False):.1f}" if inputs <= MOST_INPUTS else "-")
            print(f"| {count} | {inputs} | " + " | ".join(cells) + " |", flush=True)


def casadi_create(unpacked: str, torque_alone: bool) -> float:
    """Returns how many seconds CasADi's importer takes to make the rate of the states a function."""
    begun = time.perf_counter()
    builder = ca.DaeBuilder("it", unpacked, {"debug": False})
    for name in builder.u() if torque_alone else ():
        if not name.startswith("torque"):
            builder.set_category(name, "p")
    builder.create("rate", ["x", "u"], ["ode"], {"enable_reverse": False})
    return time.perf_counter() - begun


if __name__ == "__main__":
    main([int(word) for word in sys.argv[1:]] or list(COUNTS))
    print_importers([count for count in COUNTS if count >= 100])
