"""Plant and controller as two FMUs that step together: the flight of lqr_hold.py, in FMI 3 and FMI 2.

Run with a folder as argument (default: build); writes tanker_FMI.fmu and controller_FMI.fmu for both versions
and two_fmus.png there, prints the table. Needs scipy.
"""

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from function_fmu import build_function_fmu
from lqr_hold import EXAMPLES, controller
from tanker import EMPTY, FULL, STEP, Flight, figures, fly, fmu_controller, fmu_plant, off, table, twin_plant

from fmu_build import build_fmu
from supervessel import Twin, load_scene


def fly_two(plant: Path, control: Path, x: np.ndarray) -> Flight:
    """Returns the flight of one FMU under the other, from the state x."""
    with fmu_plant(plant) as advance, fmu_controller(control) as steer:
        return fly(advance, steer, x)


def main(folder: Path) -> None:
    """Builds the FMUs, flies all, draws, prints the table."""
    scene = load_scene(EXAMPLES / "tanker.toml")
    twin = Twin(scene, error_form="vec")
    scheduled = controller(twin, np.linspace(EMPTY, FULL, 7))
    starts = {"attitude": [1, 0, 0, 0], "mass": FULL, "reference": [1, 0, 0, 0]}
    flights = {"twin, controller in CasADi": fly(twin_plant(twin), scheduled, twin.x_start)}
    for fmi in (3, 2):
        plant = build_fmu(scene, folder / f"tanker_{fmi}.fmu", fmi)
        control = build_function_fmu(scheduled, folder / f"controller_{fmi}.fmu", fmi, starts)
        flights[f"two FMUs, FMI {fmi}"] = fly_two(plant, control, twin.x_start)

    figure, axes = plt.subplots(figsize=(8.0, 3.0))
    for (name, (states, _)), style in zip(flights.items(), ("-", "--", ":"), strict=True):
        axes.semilogy(np.arange(len(states)) * STEP, np.linalg.norm(off(states), axis=1), style, label=name)
    axes.set(xlabel="time [s]", ylabel="off by [deg]", ylim=(1e-3, 10.0))
    axes.legend()
    figure.tight_layout()
    figure.savefig(folder / "two_fmus.png", dpi=120)
    print(table({name: figures(*flight) for name, flight in flights.items()}))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else EXAMPLES.parent / "build")
