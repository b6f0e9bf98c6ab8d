"""Ten minutes of the ISS with a DeltaGlider docked: the ship burns fuel, its port is moved, torque acts.

Run by `make run`, or with a folder as argument (default: build). Flies three FMUs of the same scene with
FMPy: iss_dg_orbit.fmu, the station in its orbit, on which gravity's gradient acts;
iss_dg_orbit_principal.fmu, which leaves the products of inertia out; and iss_dg.fmu, which has to be in that
folder, without gravity.
Writes iss_dg.csv (every output at every step), iss_dg_inertia.png, iss_dg_rotation.png and iss_dg.md there;
prints the table.
"""

import io
import math
import sys
import tomllib
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from fmpy import simulate_fmu

from fmu_build import build_fmu
from supervessel import Scene, parse_scene
from supervessel.orbit import two_body
from supervessel.shell.files import write_files

EXAMPLES = Path(__file__).parent
DURATION, STEP = 600.0, 0.1  # s
MU, RADIUS = 3.986004418e14, 6786137.0  # m3/s2, of the Earth; m, 408 km above its equator
PLACE = (
    (0.0, 0.0, RADIUS),
    (math.sqrt(MU / RADIUS), 0.0, 0.0),
)  # m, m/s: z up, the turn about y that of the orbit


def in_orbit(raw: dict, law: str) -> Scene:
    """Returns a scene on a circular orbit, under a rotation law.

    raw : the tables of a scene file without gravity
    """
    position, velocity = PLACE
    given = {
        "inputs": raw["inputs"] | {"gravity": True},
        "gravity": {"mu": MU, "position": position, "velocity": velocity},
        "rotation": raw["rotation"] | {"law": law},
    }
    return parse_scene(raw | given, "iss_dg.toml in orbit")


def flight_plan(*, with_gravity: bool) -> np.ndarray:
    """Returns the inputs over time as FMPy takes them: one column for each input that moves."""
    t = np.arange(0.0, DURATION + STEP / 2, STEP)
    burn = np.interp(t, [60.0, 360.0], [24500.0, 11600.0])  # kg
    moved = np.interp(t, [400.0, 460.0], [0.0, 1.0])
    tilt = np.radians(12.0) * moved
    zero = np.zeros_like(t)
    columns = {
        "time": t,
        "DG.mass": burn,
        "DG.nose.position[1]": zero,
        "DG.nose.position[2]": -0.49 + 0.8 * moved,  # m
        "DG.nose.position[3]": -10.076 + 1.5 * moved,
        "DG.nose.direction[1]": zero,
        "DG.nose.direction[2]": np.sin(tilt),
        "DG.nose.direction[3]": -np.cos(tilt),
        "DG.nose.alignment[1]": zero,
        "DG.nose.alignment[2]": np.cos(tilt),
        "DG.nose.alignment[3]": np.sin(tilt),
        "torque[1]": pulse(t, 30.0, 50.0, 6000.0) + pulse(t, 200.0, 220.0, -4000.0),  # N.m
        "torque[2]": zero,
        "torque[3]": pulse(t, 100.0, 120.0, 5000.0) + pulse(t, 500.0, 520.0, -9000.0),
    }
    if with_gravity:
        for name, path in zip(("position", "velocity"), two_body(*PLACE, MU, t), strict=True):
            columns |= {f"gravity.{name}[{i}]": path[:, i - 1] for i in (1, 2, 3)}
    return np.rec.fromarrays(list(columns.values()), names=list(columns))


def pulse(t: np.ndarray, start: float, end: float, height: float) -> np.ndarray:
    """Returns a torque that is `height` from `start` to `end` and zero elsewhere."""
    return np.where((t >= start) & (t < end), height, 0.0)


def fly(fmu: Path, plan: np.ndarray) -> np.ndarray:
    """Returns every output of the FMU at every communication step."""
    return simulate_fmu(
        str(fmu), stop_time=DURATION, output_interval=STEP, input=plan, fmi_type="CoSimulation"
    )


def group(result: np.ndarray, name: str, size: int) -> np.ndarray:
    """Returns the elements of a vector output, (n, size)."""
    return np.column_stack([result[f"{name}[{i}]"] for i in range(1, size + 1)])


def tensors(result: np.ndarray) -> np.ndarray:
    """Returns the inertia tensor at each step, (n, 3, 3) [kg m2]."""
    rows = [result[f"inertia[{i},{j}]"] for i in (1, 2, 3) for j in (1, 2, 3)]
    return np.column_stack(rows).reshape(-1, 3, 3)


def axis_tilt(tensor: np.ndarray) -> float:
    """Returns the largest angle [deg] between a body axis and the principal axis nearest to it."""
    _, axes = np.linalg.eigh(tensor)
    nearest = np.abs(axes).max(axis=1)
    return float(np.degrees(np.arccos(np.minimum(nearest, 1.0)).max()))


def turned_apart(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Returns the angle [deg] between attitudes, (n, 4) each, step by step."""
    scalar = np.abs(np.sum(one * other, axis=1))
    cross = one[:, :1] * other[:, 1:] - other[:, :1] * one[:, 1:] - np.cross(one[:, 1:], other[:, 1:])
    return np.degrees(2.0 * np.arctan2(np.linalg.norm(cross, axis=1), scalar))


def table(full: np.ndarray, apart: np.ndarray) -> str:
    """Returns the results as a Markdown table.

    full  : the flight in orbit under the law `tensor`
    apart : (n, 2) [deg], how far the flights without products and without the gradient have turned away
    """
    times = [0.0, 60.0, 360.0, 400.0, 460.0, 600.0]
    J, mass, pmi = tensors(full), full["mass"], group(full, "pmi", 3)
    lines = [
        "| t [s] | mass [kg] | PMI x, y, z [m2] | principal moments / mass [m2] | axis tilt [deg] "
        "| off without products [deg] | without gradient [deg] |",
        "|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for t in times:
        k = int(np.argmin(np.abs(full["time"] - t)))
        moments = np.linalg.eigvalsh(J[k]) / mass[k]
        three = [", ".join(f"{x:.3f}" for x in row) for row in (pmi[k], moments)]
        off = " | ".join(f"{angle:.4f}" for angle in apart[k])
        lines.append(f"| {t:.0f} | {mass[k]:.0f} | {three[0]} | {three[1]} | {axis_tilt(J[k]):.3f} | {off} |")
    return "\n".join(lines)


def plot(panels: list[tuple[str, np.ndarray, list[str]]], t: np.ndarray) -> bytes:
    """Returns a PNG of panels below each other: axis label, curves (n, k), names of the curves."""
    figure, axes = plt.subplots(len(panels), 1, figsize=(8.0, 2.4 * len(panels)), sharex=True)
    for ax, (label, curves, names) in zip(axes, panels, strict=True):
        ax.plot(t, curves, label=names)
        ax.set_ylabel(label)
        ax.grid(alpha=0.3)
        ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize="small")
    axes[-1].set_xlabel("time [s]")
    figure.tight_layout()
    drawn = io.BytesIO()
    figure.savefig(drawn, dpi=120)
    plt.close(figure)
    return drawn.getvalue()


def main(folder: Path) -> None:
    """Flies both FMUs, writes the files into `folder`, prints the table."""
    raw = tomllib.loads((EXAMPLES / "iss_dg.toml").read_text())
    orbit = build_fmu(in_orbit(raw, "tensor"), folder / "iss_dg_orbit.fmu")
    diagonal = build_fmu(in_orbit(raw, "principal"), folder / "iss_dg_orbit_principal.fmu")
    plan = flight_plan(with_gravity=True)
    full, others = fly(orbit, plan), [fly(diagonal, plan)]
    others.append(fly(folder / "iss_dg.fmu", flight_plan(with_gravity=False)))
    attitudes = [group(flight, "attitude", 4) for flight in (full, *others)]
    apart = np.column_stack([turned_apart(attitudes[0], other) for other in attitudes[1:]])

    names = full.dtype.names
    rows = io.BytesIO()
    np.savetxt(
        rows,
        np.column_stack([full[name] for name in names]),
        delimiter=",",
        header=",".join(f'"{name}"' for name in names),
        comments="",
        fmt="%.17g",
    )
    t, xyz = full["time"], ["x", "y", "z"]
    pmi = group(full, "pmi", 3)
    inertia = plot(
        [
            ("PMI, change [m2]", pmi - pmi[0], xyz),
            ("barycentre [m]", group(full, "barycentre", 3), xyz),
            ("mass [t]", full["mass"][:, None] / 1000.0, ["ISS + DG"]),
        ],
        t,
    )
    rotation = plot(
        [
            ("rate [deg/s]", np.degrees(group(full, "angular_velocity", 3)), xyz),
            ("attitude", group(full, "attitude", 4), ["w", *xyz]),
            ("off [deg]", apart, ["without\nproducts", "without\ngradient"]),
        ],
        t,
    )
    results = table(full, apart)
    report = (
        "# ISS with a DeltaGlider, ten minutes\n\n"
        "On a circular orbit, 408 km up, z up. Fuel burns from 60 to 360 s, the docking port of the ship is\n"
        "moved from 400 to 460 s, torque pulses act about x (30-50, 200-220 s) and z (100-120, 500-520 s).\n"
        "Law `tensor`, with gravity's gradient; the last columns are how far the law `principal`, which\n"
        "leaves the products of inertia out, and a flight without the gradient have turned away from it.\n\n"
        f"{results}\n\n"
        "![PMI, barycentre, mass](iss_dg_inertia.png)\n\n![rates, attitude, drift](iss_dg_rotation.png)\n\n"
        "Every output at every step: `iss_dg.csv`.\n"
    )
    write_files(
        {
            folder / "iss_dg.csv": rows.getvalue(),
            folder / "iss_dg_inertia.png": inertia,
            folder / "iss_dg_rotation.png": rotation,
            folder / "iss_dg.md": report.encode(),
        }
    )
    print(results)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else EXAMPLES.parent / "build")
