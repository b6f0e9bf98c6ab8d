"""A tank whose centre of mass moves as it empties: as a part whose pose is an input, and as slices on mounts.

python examples/draining.py     prints a table; half a minute.
"""

import tomllib
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.integrate import quad
from stepping import elements, stepped

from fmu_build import build_fmu
from supervessel import Scene, Twin, load_scene, parse_scene

SCENE = Path(__file__).with_name("draining.toml")
FULL, EMPTY, RADIUS, HEIGHT, FOOT = 16000.0, 1.0, 1.2, 6.0, 1.0  # kg, kg, m, m, m
STAGE, MIDDLE, ACROSS, ENGINE = 5000.0, 3.0, 8.0, -0.5  # kg, m, m2, m: as in the scene
DURATION, STEP = 160.0, 0.5  # s
SIDE = 2.0  # N, across the stage, by a thrust that is a little askew
Inputs = Callable[[float], dict[str, float]]  # mass of the propellant [kg] -> inputs by name


def left(time: float) -> float:
    """Returns the propellant's mass [kg] at a time [s]; it burns evenly."""
    return FULL + (EMPTY - FULL) * time / DURATION


def column(mass: float) -> tuple[float, float]:
    """Returns the middle of the column [m], in the stage's axes, and its moment across over mass [m2]."""
    height = HEIGHT * mass / FULL
    return FOOT + height / 2.0, RADIUS**2 / 4.0 + height**2 / 12.0


def whole(mass: float) -> tuple[float, float]:
    """Returns the barycentre's place along the stage [m] and the moment across [kg m2], by hand."""
    place, own = column(mass)
    reduced = STAGE * mass / (STAGE + mass)
    barycentre = (STAGE * MIDDLE + mass * place) / (STAGE + mass)
    return barycentre, STAGE * ACROSS + mass * own + reduced * (place - MIDDLE) ** 2


def moved(mass: float) -> dict[str, float]:
    """Returns the inputs of the scene: the propellant's mass, moments and place."""
    place, own = column(mass)
    pmi = dict(zip(elements("propellant.pmi", 3), (own, own, RADIUS**2 / 2.0), strict=True))
    return {"propellant.mass": mass, "stage.column.position[3]": place, **pmi}


def sliced(count: int) -> tuple[Scene, Inputs]:
    """Returns the same stage with its propellant in slices, each mounted where it is, and their masses."""
    raw = tomllib.loads(SCENE.read_text(encoding="utf-8"))
    thick, full = HEIGHT / count, FULL / count
    names = [f"slice{i}" for i in range(count)]
    across = RADIUS**2 / 4.0 + thick**2 / 12.0
    stage = {key: value for key, value in raw["vessels"]["stage"].items() if key != "ports"}
    slices = {name: {"mass": full, "pmi": [across, across, RADIUS**2 / 2.0]} for name in names}
    raw["vessels"] = {"stage": stage, **slices}
    raw["mounts"] = [
        {"parent": "stage", "child": name, "position": [0.0, 0.0, FOOT + (i + 0.5) * thick]}
        for i, name in enumerate(names)
    ]
    raw["inputs"] = {"mass": names, "force": ["stage.engine"]}
    raw["rotation"] = {}
    del raw["docks"]

    def inputs(mass: float) -> dict[str, float]:
        return {f"{name}.mass": min(max(mass - i * full, 0.0), full) for i, name in enumerate(names)}

    return parse_scene(raw), inputs


def worst(scene: Scene, inputs: Inputs) -> tuple[float, float]:
    """Returns how far the barycentre [mm] and the moment across [%] are off at most during the burn."""
    twin, off = Twin(scene), []
    for time in np.linspace(0.0, DURATION, 200):
        mass = left(float(time))
        _, barycentre, inertia = (np.array(x) for x in twin.composite(twin.p_with(inputs(mass)))[:3])
        place, across = whole(mass)
        off.append([1e3 * abs(barycentre[2] - place).item(), 1e2 * abs(inertia[0, 0] / across - 1.0)])
    return tuple(np.max(off, axis=0))


def turned(scene: Scene, inputs: Inputs) -> tuple[float, float]:
    """Returns rate [deg/s] and angle [deg] about x at the end of the burn, flown by the FMU.

    Inputs hold over a step: they are those of its middle.
    """
    with TemporaryDirectory() as folder:
        path = build_fmu(scene, Path(folder, "draining.fmu"))
        with stepped(path, STEP, inputs(FULL)) as step:
            for time in np.arange(0.0, DURATION, STEP):
                values = inputs(left(float(time) + STEP / 2.0)) | {"stage.engine.force[2]": SIDE}
                outputs = [*elements("angular_velocity", 3), *elements("attitude", 4)]
                x = step(float(time), values, outputs)
    return float(np.degrees(x[0])), float(np.degrees(2.0 * np.arctan2(x[4], x[3])))


def by_quadrature() -> tuple[float, float]:
    """Returns the same by SciPy from the moments worked out by hand: the rate is the integral of M/J."""

    def acceleration(time: float) -> float:
        place, across = whole(left(time))
        return SIDE * (place - ENGINE) / across

    rate = quad(acceleration, 0.0, DURATION, epsrel=1e-12)[0]
    angle = quad(lambda time: acceleration(time) * (DURATION - time), 0.0, DURATION, epsrel=1e-12)[0]
    return float(np.degrees(rate)), float(np.degrees(angle))


def ways() -> dict[str, tuple[Scene, Inputs]]:
    """Returns the ways to model the tank by their names in the table."""
    masses = "slices on mounts, masses are inputs"
    return {
        "a part whose pose, mass and moments are inputs": (load_scene(SCENE), moved),
        "one part that keeps its centre": sliced(1),
        f"4 {masses}": sliced(4),
        f"16 {masses}": sliced(16),
    }


def row(what: str) -> str:
    """Returns the row of the table of one of the ways, off by what is worked out by hand."""
    place, across = worst(*ways()[what])
    rate, angle = turned(*ways()[what])
    off = 100.0 * (angle / by_quadrature()[1] - 1.0)
    return f"| {what} | {place:.1f} | {across:.2f} | {rate:.4f} | {angle:.3f} | {off:.3f} |"


def table() -> str:
    """Returns the table of the ways to model the tank, beside what is worked out by hand."""
    rate, angle = by_quadrature()
    head = "barycentre off by [mm] | moment off by [%] | rate [deg/s] | angle [deg] | angle off by [%]"
    lines = [f"| the propellant as | {head} |", "|---|---:|---:|---:|---:|---:|"]
    lines.append(f"| by hand, integrated by SciPy | 0 | 0 | {rate:.4f} | {angle:.3f} | 0 |")
    return "\n".join(lines + [row(what) for what in ways()])


if __name__ == "__main__":
    print(table())
