"""Masses and moments of a captured vessel, from rates measured while known torque pulses act.

The FMU of capture.toml, with other values than the scene's, is the truth; its rates and a gyro's noise are
the data. Gauss-Newton through the twin's derivatives finds masses, moments and the rate at the start, and how
sure they are. Run with a folder as argument (default: build); writes capture.fmu and identify.png there.
"""

import sys
from pathlib import Path

import casadi as ca
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from stepping import elements, stepped

from fmu_build import build_fmu
from supervessel import Twin, load_scene

EXAMPLES = Path(__file__).parent
STEP, COUNT = 0.1, 600  # s; 60 s
NOISE = 1e-4  # rad/s, standard deviation of each sample
TRUTH = {"servicer.mass": 1860.0, "target.mass": 1120.0, "target.pmi": [1.3, 0.9, 0.7]}


def pulses() -> np.ndarray:
    """Returns known torques, (3, COUNT) [N m]: one pulse about each axis, held over each step."""
    torque = np.zeros((3, COUNT))
    for axis, (start, height) in enumerate([(50, 60.0), (200, -60.0), (350, 40.0)]):
        torque[axis, start : start + 100] = height
    return torque


def flown(fmu: Path, twin: Twin, torque: np.ndarray) -> np.ndarray:
    """Returns the true rates, (3, COUNT) [rad/s], as the FMU has them after each step."""
    true = dict(zip(twin.p_names, twin.p_with(TRUTH), strict=True))
    forcing = [dict(zip(elements("torque", 3), column, strict=True)) for column in torque.T]
    with stepped(fmu, STEP) as step:
        rates = [step(STEP * k, true | u, elements("angular_velocity", 3)) for k, u in enumerate(forcing)]
    return np.array(rates).T


def model(twin: Twin) -> ca.Function:
    """Returns theta, torque -> rates (3 COUNT,) and their Jacobian; theta = p and the rate at the start."""
    twin.check_torque("identify")
    theta, torque = ca.MX.sym("theta", len(twin.p_names) + 3), ca.MX.sym("torque", 3, COUNT)
    x = ca.vertcat(1.0, 0.0, 0.0, 0.0, theta[-3:])
    states = twin.rollout(COUNT)(x, torque, theta[:-3], STEP)
    rates = ca.vec(states[4:, :])
    return ca.Function("model", [theta, torque], [rates, ca.jacobian(rates, theta)])


def estimate(
    model: ca.Function, theta: np.ndarray, torque: np.ndarray, data: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Returns theta that fits data, (3, COUNT) [rad/s], best, and its covariance, by Gauss-Newton steps.

    theta : first guess
    Raises ValueError where the data leave a direction of theta open: by more than theta itself.
    """
    scale = np.maximum(np.abs(theta), 1e-2)  # rates may be 0

    def fit(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        rates, jacobian = (np.array(part) for part in model(theta, torque))
        return (data.ravel(order="F") - rates.ravel()) / NOISE, jacobian * scale / NOISE

    residual, J = fit(theta)
    for _ in range(50):
        U, singular, directions = np.linalg.svd(J, full_matrices=False)
        if singular[-1] < 1.0:
            raise ValueError(f"the data leave theta open along theta * {np.round(directions[-1], 3) + 0.0}")
        inverse = directions.T / singular
        step = inverse @ (U.T @ residual)
        if np.linalg.norm(J @ step) < 1e-3:  # standard deviations of the estimate
            return theta, inverse @ inverse.T * np.outer(scale, scale)
        new = fit(theta + scale * step)
        while not new[0] @ new[0] < residual @ residual and np.linalg.norm(J @ step) >= 1e-3:
            step = step / 2.0
            new = fit(theta + scale * step)
        theta, (residual, J) = theta + scale * step, new
    raise ValueError("no convergence in 50 steps: begin nearer to the truth")


def main(folder: Path) -> None:
    """Flies, estimates with and without torque, draws, prints the table."""
    twin = Twin(load_scene(EXAMPLES / "capture.toml"))
    fmu, rates = build_fmu(twin.scene, folder / "capture.fmu"), model(twin)
    torque, noise = pulses(), NOISE * np.random.default_rng(1).normal(size=(3, COUNT))
    data = flown(fmu, twin, torque) + noise
    guess = np.append(twin.p_start, data[:, 0])
    theta, covariance = estimate(rates, guess, torque, data)
    truth = np.append(twin.p_with(TRUTH), twin.x_start[4:])
    sigma = np.sqrt(np.diag(covariance))

    figure, axes = plt.subplots(2, 1, figsize=(8.0, 5.0), sharex=True)
    for ax, name, values in zip(axes, ("assumed", "estimated"), (guess, theta), strict=True):
        residual = data - np.array(rates(values, torque)[0]).reshape(3, COUNT, order="F")
        ax.plot(STEP * np.arange(1, COUNT + 1), np.degrees(residual.T), label=["x", "y", "z"])
        ax.set_ylabel(f"measured - {name} [deg/s]")
    axes[0].legend()
    axes[1].set_xlabel("time [s]")
    figure.tight_layout()
    figure.savefig(folder / "identify.png", dpi=120)
    print("| | true | assumed | estimated | one sigma | off by [sigma] |\n|---|---:|---:|---:|---:|---:|")
    for row in zip((*twin.p_names, *elements("rate", 3)), truth, guess, theta, sigma, strict=True):
        off = (row[3] - row[1]) / row[4]
        print("| {} | {:.5g} | {:.5g} | {:.5g} | {:.2g} |".format(*row), f"{off:.1f} |")
    quiet = np.zeros_like(torque)
    try:
        estimate(rates, truth, quiet, flown(fmu, twin, quiet) + noise)
    except ValueError as error:
        print(f"\nWithout torque {error}: no scale, all masses together.")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else EXAMPLES.parent / "build")
