"""A slew past a keep-out cone: nonlinear model predictive control designed on the twin, flown on the FMU.

A servicer with a captured satellite turns by 140 degrees; torque and rates are limited and its boresight, the
z axis, must stay off the Sun. Ten times a second fatrop solves for the next 20 steps of 0.5 s, on compiled C.
Prints what the slew does, also with masses that the model has wrong by 20 %; draws nmpc_slew.png.
Argument: a folder (default: build).
"""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import casadi as ca
import matplotlib
import numpy as np
from stepping import elements, stepped

from fmu_build import build_fmu
from supervessel import Twin, load_scene

matplotlib.use("Agg")
import matplotlib.pyplot as plt

Array = np.ndarray
Control = Callable[[Array], Array]
Masses = dict[str, float] | None
Problem = tuple[dict[str, ca.MX], dict[str, ca.DM], list[bool], ca.Function]

EXAMPLES = Path(__file__).parent
STEPS, STEP, PERIOD, DURATION = 20, 0.5, 0.1, 45.0  # horizon, its step, the controller's period, flight [s]
TORQUE, RATE, CONE = 20.0, 0.1, np.radians(25.0)  # about each axis [N m, rad/s]; half the cone's angle
PLANNED_RATE, PLANNED_CONE = 0.98 * RATE, CONE + np.radians(1.0)  # what lies between steps, and model errors
SUN = np.array([0.95, 0.15, 0.27]) / np.linalg.norm([0.95, 0.15, 0.27])  # inertial axes
TARGET = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
START = np.array([np.cos(np.radians(70.0)), 0.0, np.sin(np.radians(70.0)), 0.0, 0.0, 0.0, 0.0])
WEIGHTS = np.array([1.0] * 3 + [4.0] * 3)  # of the error's six numbers; 10 fold at the horizon's end
MASSES = {"as modelled": 1.0, "20 % more": 1.2, "20 % less": 0.8}  # of the FMU over the model's
TOLERANCE, OPTIONS = 1e-3, {"print_time": False, "error_on_fail": False}
STATE, TORQUES = [*elements("attitude", 4), *elements("angular_velocity", 3)], elements("torque", 3)


def off_sun(x: Any) -> Any:
    """Returns the cosine of the angle between the boresight, the servicer's z axis, and the Sun."""
    w, i, j, k = x[0], x[1], x[2], x[3]
    return 2 * (i * k + w * j) * SUN[0] + 2 * (j * k - w * i) * SUN[1] + (1 - 2 * (i * i + j * j)) * SUN[2]


def slew_problem(twin: Twin) -> Problem:
    """Returns problem (p: the present state), bounds, which rows are equalities, Hessian, for `nlpsol`.

    Multiple shooting in fatrop's order: v_0, x_1, v_1, .. x_N; gap, gap, cone, gap, cone, .. v is the torque
    over its limit and how far the cone may be entered, which costs so much that it is 0 wherever it can be.
    The Hessian is put together from one stage's: a tenth of the work of differentiating the whole.
    """
    x, v, weight, lam = twin.x, ca.SX.sym("v", 4), ca.SX.sym("weight"), ca.SX.sym("lam", 8)
    end = twin.step(x, TORQUE * v[:3], twin.p, STEP)
    error = twin.error(x, TARGET) * WEIGHTS
    cost = 0.5 * ca.sumsqr(error) + 0.02 * ca.sumsqr(v[:3]) + 20 * v[3] + 100 * v[3] ** 2
    inside = off_sun(x) - np.cos(PLANNED_CONE) - v[3]
    stage = ca.Function("stage", [x, v], [end, inside, cost])
    second = ca.hessian(weight * cost - ca.dot(lam[:7], end) + lam[7] * inside, ca.vertcat(x, v))[0]
    curvature = ca.Function("curvature", [x, v, weight, lam], [ca.densify(second)])

    w, start, scale = ca.MX.sym("w", 11 * STEPS), ca.MX.sym("start", 7), ca.MX.sym("lam_f")
    V, X = ca.vertsplit(ca.reshape(w, 11, STEPS), [0, 4, 11])
    states, moves = ca.horzcat(start, X), ca.horzcat(V, ca.MX.zeros(4, 1))
    weights = ca.DM([[1.0] * STEPS + [10.0]])
    end, inside, cost = stage.map(STEPS + 1)(states, moves)
    kept = [*range(7), *range(8, 8 * STEPS)]  # all but the cone where the body is now
    f, g = ca.dot(weights, cost), ca.vec(ca.vertcat(X - end[:, :-1], inside[:-1]))[kept]
    lam = ca.MX.sym("lam_g", len(kept))
    lams = ca.horzcat(ca.reshape(ca.vertcat(lam[:7], 0, lam[7:]), 8, STEPS), ca.MX.zeros(8, 1))
    blocks = ca.diagcat(*ca.horzsplit(curvature.map(STEPS + 1)(states, moves, scale * weights, lams), 11))
    results = [ca.gradient(scale * f + ca.dot(lam, g), w), blocks[7:-4, 7:-4]]
    names = [["x", "p", "lam_f", "lam_g"], ["grad_gamma_x", "hess_gamma_x_x"]]
    hessian = ca.Function("nlp_hess_l", [w, start, scale, lam], results, *names)
    low = ([-1.0] * 3 + [0.0] + [-ca.inf] * 4 + [-PLANNED_RATE] * 3) * STEPS
    high = ([1.0] * 3 + [ca.inf] * 5 + [PLANNED_RATE] * 3) * STEPS
    below = np.array(([0.0] * 7 + [-ca.inf]) * STEPS)[kept]
    bounds = {"lbx": ca.DM(low), "ubx": ca.DM(high), "lbg": ca.DM(below), "ubg": ca.DM.zeros(len(kept))}
    return {"x": w, "p": start, "f": f, "g": g}, bounds, (below == 0.0).tolist(), hessian


def fatrop(twin: Twin, problem: Problem, folder: Path) -> ca.Function:
    """Returns the solver by fatrop, on the problem's functions as compiled C."""
    nlp, _, equality, hessian = problem
    options = OPTIONS | {"structure_detection": "auto", "equality": equality}
    options["fatrop"] = {"print_level": 0, "tol": TOLERANCE, "mu_init": 3e-2}
    plain = ca.nlpsol("plain", "fatrop", nlp, options)
    parts = [plain.get_function(f"nlp_{part}") for part in ("f", "g", "grad_f", "jac_g", "grad")]
    whole = ca.Function("nlp", [nlp["x"], nlp["p"]], [nlp["f"], nlp["g"]], ["x", "p"], ["f", "g"])
    # nlpsol takes what it needs from the library of "nlp", by name
    compiled = twin.generate(folder / "nmpc", [whole, *parts, hessian], derivatives=0)
    return ca.nlpsol("slew", "fatrop", compiled["nlp"], options)


def first_guess(start: Array) -> Array:
    """Returns the problem's unknowns for a body that stays where it is."""
    return np.tile(np.array([0.0] * 4 + [*start[:4]] + [0.0] * 3), STEPS)


def controller(solver: ca.Function, bounds: dict[str, ca.DM], start: Array) -> Control:
    """Returns the function from state to torque [N m] that starts each solve from the last solution.

    It raises RuntimeError where there is none: where a rate is so far beyond its limit that the torque cannot
    take it back in one step.
    """
    guess = first_guess(start)

    def control(x: Array) -> Array:
        guess[:] = np.array(solver(x0=guess, p=x, **bounds)["x"]).ravel()
        if not solver.stats()["success"]:
            status = solver.stats()["return_status"]
            raise RuntimeError(f"no torque found at {np.round(x, 4)} ({status}); rates above {RATE} rad/s?")
        return TORQUE * guess[:3]

    return control


def fly(
    fmu: Path, control: Control, start: Array, masses: Masses = None, duration: float = DURATION
) -> tuple[Array, Array]:
    """Returns states (n, 7) and the torques (n, 3) that `control` answers them with, each 0.1 s.

    masses : [kg], of vessels whose mass is not the FMU's, by the names of its inputs
    """
    states, torques = [start], [control(start)]
    values = {name.replace("[", "_start["): value for name, value in zip(STATE, start, strict=True)}
    with stepped(fmu, PERIOD, values | (masses or {})) as step:
        for time in PERIOD * np.arange(round(duration / PERIOD)):
            states.append(step(time, dict(zip(TORQUES, torques[-1], strict=True)), STATE))
            torques.append(control(states[-1]))
    return np.array(states), np.array(torques)


def main(folder: Path) -> None:
    """Flies the slew three times, draws it, prints the table."""
    scene = load_scene(EXAMPLES / "servicer.toml")
    fmu = build_fmu(scene, folder / "servicer.fmu")
    twin = Twin(scene, propagator="rk4", fixed=True)
    problem = slew_problem(twin)
    solver = fatrop(twin, problem, folder)
    figure, axes = plt.subplots(3, 1, figsize=(8.0, 7.0), sharex=True, layout="constrained")
    print("| masses | to 1 deg [s] | closest to the Sun [deg] | largest rate [rad/s] | torque used [N m s] |")
    print("|---|---:|---:|---:|---:|")
    for (label, share), style in zip(MASSES.items(), ("-", "--", ":"), strict=True):
        masses = {f"{name}.mass": share * vessel.mass for name, vessel in scene.vessels.items()}
        states, torques = fly(fmu, controller(solver, problem[1], START), START, masses)
        t, angle = PERIOD * np.arange(len(states)), np.degrees(np.arccos(off_sun(states.T)))
        errors = np.linalg.norm([np.array(twin.error(x, TARGET)).ravel()[:3] for x in states], axis=1)
        settled = t[np.flatnonzero(errors > np.radians(1.0))[-1]] + PERIOD
        rate, used = np.abs(states[:, 4:]).max(), PERIOD * np.abs(torques).sum()
        print(f"| {label} | {settled:.1f} | {angle.min():.1f} | {rate:.4f} | {used:.0f} |")
        for ax, curves in zip(axes, (angle[:, None], states[:, 4:], torques), strict=True):
            for i, curve in enumerate(curves.T):
                ax.plot(t, curve, f"C{i}{style}", label=label if i == 0 else None)
    for ax, name in zip(axes, ("off the Sun [deg]", "rates [rad/s]", "torques [N m]"), strict=True):
        ax.set(ylabel=name, xlabel="time [s]")
    axes[0].axhline(np.degrees(CONE), color="k", linewidth=0.8)
    axes[0].legend()
    figure.savefig(folder / "nmpc_slew.png", dpi=120)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else EXAMPLES.parent / "build")
