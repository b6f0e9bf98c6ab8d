"""The space station turns by 104 degrees without propellant, by its gyroscopes and gravity's gradient [BH].

In two hours the station of zero_propellant.toml goes from one attitude that turns with the orbit to another,
and its gyroscopes from one momentum to another. ipopt finds motor torques on the twin, by collocation; the
FMU flies them. Prints least cost and largest momentum beside those of another program [VB], where it ends;
draws zero_propellant.png. Argument: a folder (default: build).
"""

import sys
from pathlib import Path
from time import perf_counter

import casadi as ca
import numpy as np
from station_momentum import (
    TORQUE,
    Plan,
    collocation,
    draw,
    fly,
    in_body_axes,
    in_inertial_axes,
    orbital_rate,
    places,
)

from fmu_build import build_fmu
from supervessel import Scene, Twin, load_scene

Array = np.ndarray

EXAMPLES = Path(__file__).parent
PUBLISHED, PUBLISHED_MOMENTUM = 6.680216e6, 7235.3
"""Least cost, and largest momentum [N m s], by pseudospectral collocation on 70 points [VB]."""
TARGET, TARGET_MOMENTUM = np.array([0.70531, -0.06201, -0.03518, -0.70531]), np.array([-9.0, -3557.0, -135.0])
"""Attitude at the end, from local-vertical axes, of length 1 to five digits; momentum at the end [N m s]."""
WEIGHT, MOST_TORQUE, MOST_MOMENTUM, MOST_ALONG = 0.1, 200.0, 10800.0, 8000.0
INTERVALS = 120
MOMENTUM, COST = 10000.0, 1e6  # by which momenta and the cost are scaled


def across(rates: ca.MX, momenta: ca.MX) -> ca.MX:
    """Returns the cross products of vectors, column by column, (3, N)."""
    return ca.vertcat(
        rates[1, :] * momenta[2, :] - rates[2, :] * momenta[1, :],
        rates[2, :] * momenta[0, :] - rates[0, :] * momenta[2, :],
        rates[0, :] * momenta[1, :] - rates[1, :] * momenta[0, :],
    )


def off_attitude(attitude: Array) -> Array:
    """Returns what of an attitude is half its error about another one, small, to first order: (3, 4)."""
    w, (x, y, z) = attitude[0], attitude[1:]
    return np.array([[-x, w, z, -y], [-y, -z, w, x], [-z, y, -x, w]])


def target(scene: Scene) -> Array:
    """Returns the state at the end, (10,): it turns with the orbit."""
    orbital, end = orbital_rate(scene), np.array([scene.experiment.duration])
    unit = TARGET / np.linalg.norm(TARGET)
    rate = np.array(in_body_axes(ca.DM(unit), orbital)).ravel()
    return np.concatenate([in_inertial_axes(unit[:, None], orbital, end).ravel(), rate, TARGET_MOMENTUM])


def first_guess(scene: Scene, start: Array, end: Array, times: Array) -> Array:
    """Returns states (10, N) on the straight way from one to the other, seen from the orbit."""
    share, orbital = times / times[-1], orbital_rate(scene)
    guess = np.outer(start, 1.0 - share) + np.outer(end, share)
    way = np.outer(start[:4], 1.0 - share) + np.outer(TARGET, share)
    guess[:4] = in_inertial_axes(way / np.linalg.norm(way, axis=0), orbital, times)
    return guess


def optimise(scene: Scene) -> tuple[Plan, float]:
    """Returns the motor torques of least cost, and the largest momentum [N m s].

    The cost is WEIGHT times the square of the largest momentum, and the integral of the square of the torque
    that the gyroscopes exert on the station, u + omega x h.
    """
    twin, interval = Twin(scene), scene.experiment.duration / INTERVALS
    times, rates, weights = collocation(scene.experiment.duration, INTERVALS)
    end, rate, p = target(scene), float(np.linalg.norm(orbital_rate(scene))), places(scene, times)
    scale = np.array([1.0] * 4 + [rate] * 3 + [MOMENTUM] * 3)
    opti = ca.Opti()
    X, U, most = opti.variable(10, 1 + len(times)), opti.variable(3, len(times)), opti.variable()
    states, torques = X[:, 1:] * scale, TORQUE * U
    exerted = torques + across(states[4:7, :], states[7:, :])
    cost = WEIGHT * MOMENTUM**2 * most + interval * ca.dot(weights, ca.sum1(exerted**2).T)
    opti.minimize(cost / COST)
    x_dot = twin.ode.map(len(times))(states, torques, p)
    opti.subject_to(X @ rates == interval * x_dot / scale)
    opti.subject_to(X[:, 0] == twin.x_start / scale)
    opti.subject_to(off_attitude(end[:4]) @ X[:4, -1] == 0)
    opti.subject_to(X[4:, -1] == end[4:] / scale[4:])
    opti.subject_to(ca.sum1(X[7:, 1:] ** 2) <= most)
    opti.subject_to(opti.bounded(0.0, most, (MOST_MOMENTUM / MOMENTUM) ** 2))
    opti.subject_to(opti.bounded(-1.0, ca.vec(states[7:, :]) / MOST_ALONG, 1.0))
    opti.subject_to(ca.sum1(torques**2) / MOST_TORQUE**2 <= 1.0)
    guess = first_guess(scene, twin.x_start, end, np.append(0.0, times))
    opti.set_initial(X, guess / scale[:, None])
    opti.set_initial(most, 1.0)
    opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes", "tol": 1e-9})
    begun = perf_counter()
    solution = opti.solve()
    found = perf_counter() - begun, opti.stats()["iter_count"], times, solution.value(torques).T
    plan = Plan(solution.value(cost), *found, solution.value(states[:, -1]))
    return plan, MOMENTUM * float(np.sqrt(solution.value(most)))


def main(folder: Path) -> None:
    """Solves the problem, flies the solution, draws it, prints the table."""
    scene = load_scene(EXAMPLES / "zero_propellant.toml")
    plan, most = optimise(scene)
    t, torques, states = fly(build_fmu(scene, folder / "zero_propellant.fmu"), scene, plan)
    off = np.array(Twin(scene).error(states[-1], target(scene))).ravel()
    draw(folder / "zero_propellant.png", t, torques, states)
    print("| least cost | published | largest momentum | published | iterations | time [s] | FMU off by |")
    print("|---:|---:|---:|---:|---:|---:|---:|")
    found = f"{plan.cost:.4e} | {PUBLISHED:.4e} | {most:.0f} | {PUBLISHED_MOMENTUM:.0f}"
    missed = f"{np.linalg.norm(off[:3]):.0e} rad, {np.abs(off[6:]).max():.0e} N m s"
    print(f"| {found} | {plan.iterations} | {plan.seconds:.1f} | {missed} |")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else EXAMPLES.parent / "build")
