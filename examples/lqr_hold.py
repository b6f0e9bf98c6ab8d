"""A docked stack holds its attitude while a tanker burns 24 t: LQR, gains scheduled on mass.

Designed on the twin of tanker.toml; flown on the twin and on the FMU, and once more with the gains of the
empty tanker. It starts 5 degrees off; at 480 s, by then light, it is kicked. Run with a folder as argument
(default: build); writes tanker.fmu and lqr_hold.png there, prints the table. Needs scipy.
"""

import sys
from pathlib import Path

import casadi as ca
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from scipy.linalg import solve_continuous_are
from tanker import EMPTY, FULL, REFERENCE, STEP, figures, fly, fmu_plant, off, table, twin_plant

from fmu_build import build_fmu
from supervessel import Twin, load_scene

EXAMPLES = Path(__file__).parent


def gains(twin: Twin, mass: float) -> np.ndarray:
    """Returns K, (3, 6), from the error state to torque, at rest and with that mass [kg] of the tanker."""
    twin.check_torque("lqr_hold")
    rest = [*REFERENCE, 0.0, 0.0, 0.0]
    A, B, _ = (np.array(part) for part in twin.linearise(rest, [0.0] * 3, twin.p_with({"tanker.mass": mass})))
    one_degree = np.radians(1.0)
    Q = np.diag([one_degree**-2] * 3 + [0.0] * 3)  # one degree is worth ...
    R = np.eye(3) / 1000.0**2  # ... 1000 N m
    return np.linalg.solve(R, B.T @ solve_continuous_are(A, B, Q, R))


def controller(twin: Twin, masses: np.ndarray) -> ca.Function:
    """Returns attitude, angular_velocity, mass, reference -> torque.

    masses : (n,) [kg], of the tanker, ascending; gains are interpolated between them, extrapolated beyond
    """
    table = np.array([gains(twin, mass).ravel() for mass in masses])
    scheduled = ca.interpolant("gains", "linear", [masses], table.ravel())
    attitude, rate, reference = (ca.MX.sym(*s) for s in (("attitude", 4), ("rate", 3), ("reference", 4)))
    mass = ca.MX.sym("mass")
    e = twin.error(ca.vertcat(attitude, rate), ca.vertcat(reference, 0.0, 0.0, 0.0))
    torque = -ca.reshape(scheduled(mass), 6, 3).T @ e  # the table is row by row, CasADi column by column
    names = ["attitude", "angular_velocity", "mass", "reference"]
    return ca.Function("controller", [attitude, rate, mass, reference], [torque], names, ["torque"])


def main(folder: Path) -> None:
    """Flies all, draws, prints the table."""
    scene = load_scene(EXAMPLES / "tanker.toml")
    twin = Twin(scene, error_form="vec")
    scheduled = controller(twin, np.linspace(EMPTY, FULL, 7))
    path = build_fmu(scene, folder / "tanker.fmu")
    flights = {"twin": fly(twin_plant(twin), scheduled, twin.x_start)}
    with fmu_plant(path) as plant:
        flights["FMU"] = fly(plant, scheduled, twin.x_start)
    with fmu_plant(path) as plant:
        flights["FMU, gains of the empty tanker"] = fly(
            plant,
            lambda attitude, rate, _, reference: scheduled(attitude, rate, EMPTY, reference),
            twin.x_start,
        )

    figure, axes = plt.subplots(2, 1, figsize=(8.0, 5.0), sharex=True)
    for (name, (states, torques)), style in zip(flights.items(), ("-", "--", ":"), strict=True):
        t = np.arange(len(states)) * STEP
        axes[0].semilogy(t, np.linalg.norm(off(states), axis=1), style, label=name)
        axes[1].plot(t[:-1], np.linalg.norm(torques, axis=1) / 1000.0, style)
    axes[0].set_ylim(1e-3, 10.0)
    axes[0].set_ylabel("off by [deg]")
    axes[0].legend()
    axes[1].set_ylabel("torque [kN m]")
    axes[1].set_xlabel("time [s]")
    figure.tight_layout()
    figure.savefig(folder / "lqr_hold.png", dpi=120)
    print(table({name: figures(*flight) for name, flight in flights.items()}))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else EXAMPLES.parent / "build")
