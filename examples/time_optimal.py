"""The fastest half turn from rest to rest, torque about each axis limited: not one about a fixed axis [BW].

First a sphere, then the ISS with a DeltaGlider docked. ipopt finds which torques switch when, on a grid, then
the lengths of the arcs between switches; the FMU flies them. Prints times beside those of the turn about the
body's axis; draws time_optimal.png. Argument: a folder (default: build).
"""

import sys
import tomllib
from pathlib import Path

import casadi as ca
import matplotlib
import numpy as np
from fmpy import simulate_fmu
from stepping import elements

from fmu_build import build_fmu
from supervessel import Scene, Twin, parse_scene

matplotlib.use("Agg")
import matplotlib.pyplot as plt

Array = np.ndarray

EXAMPLES = Path(__file__).parent
SPHERE = {"name": "sphere", "root": "body", "vessels": {"body": {"mass": 1.0, "pmi": [1.0, 1.0, 1.0]}}}
GRID, SUBSTEPS, SEEDS = 60, 40, 3
STATE = [*elements("attitude", 4), *elements("angular_velocity", 3)]
REST = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])


def about_axis(twin: Twin, limit: float, axis: int) -> float:
    """Returns the time [s] of the turn about a body axis, full torque one way, then the other.

    limit : torque about each axis [N m]
    Raises ValueError where as much torque about the other axes does not hold this one: with theta'' = a the
    turn takes J e a + e x J e theta'^2, theta'^2 up to pi a.
    """
    J, e = np.array(twin.composite(twin.p_start)[2]), np.eye(3)[axis]
    across = np.abs(J @ e) + np.pi * np.abs(np.cross(e, J @ e))
    if np.delete(across, axis).max() > J[axis, axis]:
        about = f"a turn about {'xyz'[axis]}: {across.tolist()} kg m2"
        raise ValueError(f"products of inertia too large for {about}")
    return 2.0 * np.sqrt(np.pi * J[axis, axis] / limit)


def off_target(axis: int) -> list[int]:
    """Returns which numbers of the state vanish at the target: half a turn about the axis, at rest."""
    return [i for i in range(7) if i != 1 + axis]


def on_grid(twin: Twin, limit: float, axis: int, slow: float, seed: int) -> tuple[float, Array]:
    """Returns the least time [s] with torque held over each of GRID intervals, torque over limit (3, GRID).

    slow : time [s] of the turn about the axis: the first guess, with random torque about the other two axes
    """
    opti, scale = ca.Opti(), ca.DM([1.0] * 4 + [1.0 / slow] * 3)
    X, V, T = opti.variable(7, GRID + 1), opti.variable(3, GRID), opti.variable()
    opti.minimize(T)
    end = twin.step.map(GRID)(X[:, :-1] * scale, limit * V, ca.MX(0, 1), ca.repmat(T * slow / GRID, 1, GRID))
    opti.subject_to(X[:, 1:] == end / scale)
    opti.subject_to(opti.bounded(-1, V, 1))
    opti.subject_to(opti.bounded(0.1, T, 1.5))
    opti.subject_to(X[:, 0] == REST)
    opti.subject_to(X[off_target(axis), -1] == 0)
    s = np.linspace(0.0, 1.0, GRID + 1)
    half = np.pi * np.where(s < 0.5, s * s, 0.5 - (1.0 - s) ** 2)
    path = np.outer(REST, np.cos(half))
    path[1 + axis], path[4 + axis] = np.sin(half), 4.0 * np.pi * np.minimum(s, 1.0 - s)
    torque = np.random.default_rng(seed).uniform(-1.0, 1.0, (3, GRID))
    torque[axis] = np.sign(0.5 - s[1:] + 0.5 / GRID)
    for variable, guess in ((X, path), (V, torque), (T, 1.0)):
        opti.set_initial(variable, guess)
    opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes"})
    solution = opti.solve()
    return solution.value(T) * slow, solution.value(V)


def arcs(twin: Twin, limit: float, axis: int, time: float, torques: Array) -> tuple[Array, Array]:
    """Returns lengths [s] (n,) and torques [N m] (n, 3) of arcs of full torque that reach the target.

    time, torques : the solution on the grid, whose signs say what switches in which order
    """
    signs = np.sign(torques).T
    k, switching = np.nonzero(np.diff(signs, axis=0))
    full = limit * np.vstack([signs[0], 1.0 - 2.0 * np.eye(3)[switching]]).cumprod(axis=0)
    lengths, x = ca.MX.sym("lengths", len(full)), ca.MX(REST)
    for i, torque in enumerate(full):
        h = ca.repmat(lengths[i] * time / SUBSTEPS, 1, SUBSTEPS)
        x = twin.step.fold(SUBSTEPS)(x, ca.repmat(ca.DM(torque), 1, SUBSTEPS), ca.MX(0, SUBSTEPS), h)
    miss = (x * ca.DM([1.0] * 4 + [time] * 3))[off_target(axis)]
    quiet = {"print_time": False, "error_on_fail": True}
    options = quiet | {"ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-12}}
    solver = ca.nlpsol("arcs", "ipopt", {"x": lengths, "f": ca.sum1(lengths), "g": miss}, options)
    solution = solver(x0=np.diff([0.0, *((k + 1) / GRID), 1.0]), lbx=0.0, lbg=0.0, ubg=0.0)
    return np.array(solution["x"]).ravel() * time, full


def fly(fmu: Path, lengths: Array, torques: Array) -> tuple[Array, Array]:
    """Returns times [s] (n,) and states (n, 7) of the FMU from rest under the arcs."""
    ends = np.cumsum(lengths)
    times = np.append(0.0, np.repeat(ends, 2)[:-1])  # a switch twice, with the torque before and after it
    columns = [times, *np.repeat(torques, 2, axis=0).T]
    held = np.rec.fromarrays(columns, names=["time", *elements("torque", 3)])
    rest = {name.replace("[", "_start["): value for name, value in zip(STATE, REST, strict=True)}
    times = {"stop_time": ends[-1], "output_interval": ends[-1] / 200}
    flown = simulate_fmu(fmu, **times, start_values=rest, input=held, output=STATE)
    return flown["time"], np.array([flown[name] for name in STATE]).T


def turn(scene: Scene, limit: float, axis: int, folder: Path) -> tuple:
    """Returns the time about the axis [s], the arcs, the flight, its miss [rad]."""
    twin = Twin(scene, propagator="rk4")
    slow = about_axis(twin, limit, axis)
    found = min((on_grid(twin, limit, axis, slow, seed) for seed in range(SEEDS)), key=lambda each: each[0])
    lengths, torques = arcs(twin, limit, axis, *found)
    t, states = fly(build_fmu(scene, folder / f"{scene.name}_turn.fmu"), lengths, torques)
    miss = twin.error(states[-1], np.insert(np.zeros(6), 1 + axis, 1.0))[:3]
    return slow, lengths, torques, t, states, float(ca.norm_2(miss))


def main(folder: Path) -> None:
    """Solves and flies four turns, draws those about z, prints the table."""
    iss = tomllib.loads((EXAMPLES / "iss_dg.toml").read_text())
    del iss["experiment"]  # in which the ship's mass moves
    sphere, iss = (parse_scene(raw | {"inputs": {"torque": True}}) for raw in (SPHERE, iss))
    figure, panels = plt.subplots(2, 2, figsize=(9.0, 5.0), sharex="col", layout="constrained")
    print("| body, torque, axis | about the axis [s] | fastest [s] | gain | switches | FMU off by [rad] |")
    print("|---|---:|---:|---:|---:|---:|")
    cases = [(sphere, "sphere of 1 kg m2, 1 N m", 1.0, 2)]
    cases += [(iss, "ISS with a DeltaGlider, 3000 N m", 3000.0, axis) for axis in range(3)]
    for scene, label, limit, axis in cases:
        slow, lengths, torques, t, states, miss = turn(scene, limit, axis, folder)
        times = f"{slow:.5g} | {lengths.sum():.5g} | {100.0 * (1.0 - lengths.sum() / slow):.1f} %"
        print(f"| {label}, {'xyz'[axis]} | {times} | {len(lengths) - 1} | {miss:.0e} |")
        if axis == 2:
            rates, switches = panels[:, 0 if scene is sphere else 1]
            rates.plot(t, states[:, 4:], label=list("xyz"))
            for i, torque in enumerate(torques.T):
                edges = np.append(0.0, np.cumsum(lengths))
                switches.stairs(0.4 * torque / limit - i, edges, baseline=-i)
            rates.set(title=label, ylabel="rate [rad/s]")
            switches.set(ylabel="torque", yticks=[0, -1, -2], yticklabels=list("xyz"), xlabel="time [s]")
    panels[0, 0].legend()
    figure.savefig(folder / "time_optimal.png", dpi=120)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else EXAMPLES.parent / "build")
