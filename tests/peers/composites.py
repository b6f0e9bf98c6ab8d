"""What one vessel costs in a composite whose vessels' poses are given, beside MuJoCo's; and with ports.

MuJoCo: bodies without joints on a free one; mj_comPos takes their inertias, given their poses, to the common
centre, mj_crb sums them to the composite and, six numbers a scene, writes the free joint's part of the mass
matrix. Ours: the loop of the generated C on poses that stand, with the mass of every vessel an input. Calls
come from C, both in turn; what each finds is compared.
"""

import ctypes
import tempfile
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from run import build_host
from vessels import VISIBLE, poses, time_composite, written

from fmu_build.compile.compiler import compile_library
from fmu_build.platforms import host_platform
from peers import version
from supervessel import Scene, parse_scene, reference
from supervessel.equations import COMPOSITE_SIZES, composite_at_start, p_start

HERE = Path(__file__).resolve().parent
BENCH = HERE.parent / "bench"
COUNTS = (10, 100, 1000)
ROUNDS = 31
Timed = Callable[[], tuple[float, float]]
"""Returns nanoseconds of one evaluation, and plain RK4 steps."""
AGREEMENT = 1e-9  # of mass and inertia, relative: sums of a thousand terms in other orders


def library(scene: Scene, folder: Path) -> tuple[Any, dict[str, int]]:
    """Returns a scene's generated C with what times it, loaded, and the counts of its header."""
    counts = written(scene, folder)
    (folder / "given.c").write_text('#include "prelude.h"\n' + (HERE / "given.c").read_text())
    target = folder / f"given{host_platform().suffix}"
    sources = [Path(name) for name in ("given.c", "model.c", "scene.c")]
    flags = [*(f for f in VISIBLE if f != "-std=c99"), "-std=gnu99", f"-I{BENCH}"]
    compile_library(sources, host_platform(), target, flags, folder)
    loaded = ctypes.CDLL(str(target))
    loaded.time_given.restype = loaded.time_calls.restype = ctypes.c_double
    return loaded, counts


def ours(loaded: Any, counts: dict[str, int], scene: Scene, repeats: int) -> Timed:
    """Returns what times a composite on poses that stand; what it finds has been compared."""
    p = np.array(p_start(scene))
    c, w = np.empty(counts["COMPOSITE_COUNT"]), np.empty(counts["WORK_REAL"])
    at = [array.ctypes.data_as(ctypes.c_void_p) for array in (p, c, w)]

    def time(kept: Any = (p, c, w)) -> tuple[float, float]:
        plain = ctypes.c_double()
        taken = loaded.time_given(*at, ctypes.c_long(repeats), ctypes.byref(plain))
        return taken, taken / plain.value

    time()
    parts = composite_at_start(scene)
    expected = np.concatenate([parts[name] for name in COMPOSITE_SIZES])
    np.testing.assert_array_equal(c[: len(expected)], expected)
    return time


def welded(mj: Any, scene: Scene) -> Any:
    """Returns MuJoCo's model of a scene whose vessels are all fixed to the root."""
    bodies = []
    for vessel, (rotation, origin) in reference.poses(scene).items():
        mass = scene.vessels[vessel].mass
        moments = _words(mass * np.array(scene.vessels[vessel].pmi))
        inertial = f'<inertial pos="0 0 0" mass="{mass!r}" diaginertia="{moments}"/>'
        axes = _words(rotation[:, :2].T.ravel())
        bodies.append(
            inertial
            if vessel == scene.root
            else f'<body pos="{_words(origin)}" xyaxes="{axes}">{inertial}</body>'
        )
    return mj.MjModel.from_xml_string(
        '<mujoco><compiler balanceinertia="false"/><option gravity="0 0 0"/><worldbody><body><freejoint/>'
        + "".join(bodies)
        + "</body></worldbody></mujoco>"
    )


def _words(numbers: Any) -> str:
    return " ".join(repr(float(x)) for x in numbers)


def theirs(mj: Any, loaded: Any, scene: Scene, repeats: int) -> Timed:
    """Returns what times MuJoCo's two calls; what they find has been compared."""
    model = welded(mj, scene)
    data = mj.MjData(model)
    mj.mj_kinematics(model, data)
    (file,) = Path(mj.__file__).parent.glob("libmujoco*")
    engine = ctypes.CDLL(str(file))
    at = ctypes.c_void_p(model._address), ctypes.c_void_p(data._address)

    def time(kept: Any = (model, data)) -> tuple[float, float]:
        plain = ctypes.c_double()
        calls = engine.mj_comPos, engine.mj_crb
        taken = loaded.time_calls(*calls, *at, ctypes.c_long(repeats), ctypes.byref(plain))
        return taken, taken / plain.value

    time()
    expected = composite_at_start(scene)
    found = np.array([*data.crb[1][:6], data.crb[1][9]])
    wanted = np.array([*expected["inertia"], *expected["mass"]])
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=AGREEMENT * wanted[:3].max())
    return time


def row(mj: Any, host: Path, count: int, folder: Path) -> str:
    """Returns a row of the table."""
    scene = parse_scene(poses(count))
    given, mated = folder / f"given_{count}", folder / f"mated_{count}"
    given.mkdir()
    mated.mkdir()
    loaded, counts = library(scene, given)
    repeats = max(3, 20_000 // count)
    here = ours(loaded, counts, scene, repeats)
    there = theirs(mj, loaded, scene, repeats) if mj else None
    rounds = [(here(), there() if there else (np.nan, np.nan)) for _ in range(ROUNDS)]
    own, other = (median(r[side][0] for r in rounds) / count for side in (0, 1))
    factor = median(b[1] / a[1] for a, b in rounds)
    ports, _ = time_composite(host, scene, mated)
    return f"| {count} | {own:.1f} | {other:.1f} | {factor:.2f} | {ports / count:.1f} |"


def main() -> None:
    """Prints the table; without MuJoCo this project's part of it."""
    mj = import_module("mujoco") if version("mujoco") else None
    if mj is None:
        print("MuJoCo is not installed: left out\n")
    print("| vessels | ours, ns per vessel | MuJoCo | times ours | ours with ports to mate |")
    print("|---:|---:|---:|---:|---:|")
    with tempfile.TemporaryDirectory() as name:
        host = build_host("vessels", Path(name))
        for count in COUNTS:
            print(row(mj, host, count, Path(name)), flush=True)


if __name__ == "__main__":
    main()
