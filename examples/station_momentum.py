"""A space station empties its gyroscopes without thrusters, by the torque of gravity's gradient [BT].

The station of station_momentum.toml takes half an hour to give away all momentum that its gyroscopes hold and
to end in a torque equilibrium, which it keeps by itself. ipopt finds the motor torques of least square on the
twin, by collocation; the FMU flies them. Prints the least cost beside the published one and where the FMU
ends; draws station_momentum.png. Argument: a folder (default: build).
"""

import sys
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import casadi as ca
import matplotlib
import numpy as np
from fmpy import simulate_fmu
from stepping import elements

from fmu_build import build_fmu
from supervessel import Scene, Twin, load_scene
from supervessel.orbit import two_body

matplotlib.use("Agg")
import matplotlib.pyplot as plt

Array = np.ndarray

EXAMPLES = Path(__file__).parent
PUBLISHED = 3.586751
"""Least cost by three other programs; from the numbers as printed, in the scene, follows 3.58688."""
COST, MOST_MOMENTUM = 1e-6, 10000.0  # 1/(N m)^2 s; N m s
TORQUE = 100.0  # N m, by which torques are scaled
INTERVALS, DEGREE = 60, 3
WHEELS = ["station.x", "station.y", "station.z"]
STATE = [*elements("attitude", 4), *elements("angular_velocity", 3), *(f"{w}.momentum" for w in WHEELS)]


@dataclass(frozen=True)
class Plan:
    """What the optimiser found, and what it took.

    cost, seconds, iterations : the least cost; of the optimiser
    times, torques            : points of collocation [s], (N,), motor torques there [N m], (N, 3)
    end                       : the state after them, (10,)
    """

    cost: float
    seconds: float
    iterations: int
    times: Array
    torques: Array
    end: Array


def places(scene: Scene, times: Array) -> Array:
    """Returns the inputs of gravity, (6, N): position [m], velocity [m/s] on the scene's orbit, inertial."""
    return np.hstack(two_body(*scene.gravity_start, scene.gravity.mu, times)).T


def orbital_rate(scene: Scene) -> Array:
    """Returns the angular velocity of the scene's circular orbit, (3,) [rad/s], inertial axes."""
    position, velocity = map(np.array, scene.gravity_start)
    return np.cross(position, velocity) / (position @ position)


def in_inertial_axes(attitudes: Array, orbital: Array, times: Array) -> Array:
    """Returns attitudes (4, N) that are given (4, N) in axes that turn with the orbit, at times [s] (N,).

    orbital : angular velocity of the orbit, (3,) [rad/s], inertial axes, which these axes are at time 0
    """
    rate = np.linalg.norm(orbital)
    normal, w, v = orbital / rate, attitudes[0], attitudes[1:]
    across = np.vstack([-normal @ v, np.outer(normal, w) + np.cross(normal, v.T).T])  # (0, normal) q
    return attitudes * np.cos(rate * times / 2.0) + across * np.sin(rate * times / 2.0)


def collocation(duration: float, intervals: int) -> tuple[Array, ca.DM, ca.DM]:
    """Returns how states and torques at Radau's points stand for their course.

    times   : of the points [s], (N,), DEGREE in each interval; the last one is its end
    rates   : (1 + N, N), takes the states at time 0 and at the points to their rates there, per interval
    weights : of the points in an integral over time, (N,), in intervals
    Between the points of an interval states are polynomials of degree DEGREE.
    """
    points = ca.collocation_points(DEGREE, "radau")
    inside, _, weights = ca.collocation_coeff(points)
    rates = ca.DM(1 + intervals * DEGREE, intervals * DEGREE)
    for k in range(0, intervals * DEGREE, DEGREE):
        rates[k : k + DEGREE + 1, k : k + DEGREE] = inside
    times = (np.arange(intervals)[:, None] + np.array(points)).ravel() * duration / intervals
    return times, rates, ca.repmat(weights, intervals, 1)


def in_body_axes(attitude: ca.MX, vector: Array) -> ca.MX:
    """Returns an inertial vector, (3,), in the axes of a body of that attitude, (4,)."""
    across = 2.0 * ca.cross(attitude[1:], vector)
    return vector - attitude[0] * across + ca.cross(attitude[1:], across)


def optimise(scene: Scene) -> Plan:
    """Returns the motor torques that take the station to an equilibrium with empty gyroscopes at least cost.

    The cost is COST times the integral of the square of the torques. In the equilibrium the station turns
    with the orbit, and neither momentum nor motors are needed to keep it so. All unknowns are scaled to about
    1, time to an interval.
    """
    twin, orbital, interval = Twin(scene), orbital_rate(scene), scene.experiment.duration / INTERVALS
    times, rates, weights = collocation(scene.experiment.duration, INTERVALS)
    rate, p = float(np.linalg.norm(orbital)), places(scene, times)
    scale = np.array([1.0] * 4 + [rate] * 3 + [MOST_MOMENTUM] * 3)
    opti = ca.Opti()
    X, U = opti.variable(10, 1 + len(times)), opti.variable(3, len(times))
    cost = COST * TORQUE**2 * interval * ca.dot(weights, ca.sum1(U**2).T)
    opti.minimize(cost)
    x_dot = twin.ode.map(len(times))(X[:, 1:] * scale, TORQUE * U, p)
    opti.subject_to(X @ rates == interval * x_dot / scale)
    opti.subject_to(X[:, 0] == twin.x_start / scale)
    opti.subject_to(ca.sum1(X[7:, 1:] ** 2) <= 1.0)
    end = X[:, -1] * scale
    opti.subject_to(X[7:, -1] == 0)
    opti.subject_to((end[4:7] - in_body_axes(end[:4], orbital)) / rate == 0)
    opti.subject_to(twin.ode(end, ca.MX(3, 1), p[:, -1])[4:7] / rate**2 == 0)
    passed = np.append(0.0, times)
    guess = np.outer(twin.x_start, np.ones(len(passed)))
    guess[:4] = in_inertial_axes(guess[:4], orbital, passed)
    guess[7:] *= 1.0 - passed / scene.experiment.duration
    opti.set_initial(X, guess / scale[:, None])
    opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes", "tol": 1e-10})
    begun = perf_counter()
    solution = opti.solve()
    taken, torques = perf_counter() - begun, TORQUE * solution.value(U).T
    return Plan(solution.value(cost), taken, opti.stats()["iter_count"], times, torques, solution.value(end))


def torques_at(plan: Plan, times: Array) -> Array:
    """Returns the plan's torques at times [s] (n,), (n, 3) [N m]: of an interval the polynomial through its
    points."""
    ends = plan.times.reshape(-1, DEGREE)
    which = np.minimum((times / ends[0, -1]).astype(int), len(ends) - 1)
    points, torques = ends[which], plan.torques.reshape(-1, DEGREE, 3)[which]
    result = np.zeros((len(times), 3))
    for j in range(DEGREE):
        others = np.delete(points, j, axis=1)
        weights = (times[:, None] - others) / (points[:, [j]] - others)
        result += weights.prod(axis=1)[:, None] * torques[:, j]
    return result


def fly(fmu: Path, scene: Scene, plan: Plan) -> tuple[Array, Array, Array]:
    """Returns times [s] (n,), torques [N m] (n, 3) and states (n, 10) of the FMU.

    Over each step its mean torque is held: by Gauss's two points, exact for polynomials of degree 3. Errors
    grow a thousandfold in an hour where gravity overturns a station.
    """
    step = scene.experiment.step
    times = np.arange(0.0, scene.experiment.duration + step / 2.0, step)
    torques = sum(torques_at(plan, times + step * share) for share in (0.5 - 12**-0.5, 0.5 + 12**-0.5)) / 2.0
    inputs = [f"{wheel}.torque" for wheel in WHEELS]
    inputs += [*elements("gravity.position", 3), *elements("gravity.velocity", 3)]
    course = np.rec.fromarrays([times, *torques.T, *places(scene, times)], names=["time", *inputs])
    flown = simulate_fmu(fmu, stop_time=times[-1], output_interval=step, input=course, output=STATE)
    return flown["time"], torques, np.array([flown[name] for name in STATE]).T


def draw(path: Path, t: Array, torques: Array, states: Array) -> None:
    """Draws momenta, torques and rates of a flight."""
    figure, panels = plt.subplots(3, 1, figsize=(8.0, 6.0), sharex=True, layout="constrained")
    for panel, label, curves in (
        (panels[0], "momentum [N m s]", states[:, 7:]),
        (panels[1], "motor torque [N m]", torques),
        (panels[2], "rate [deg/s]", np.degrees(states[:, 4:7])),
    ):
        panel.plot(t, curves, label=list("xyz"))
        panel.set(ylabel=label)
        panel.grid(alpha=0.3)
    panels[0].legend()
    panels[2].set(xlabel="time [s]")
    figure.savefig(path, dpi=120)
    plt.close(figure)


def main(folder: Path) -> None:
    """Solves the problem, flies the solution, draws it, prints the table."""
    scene = load_scene(EXAMPLES / "station_momentum.toml")
    plan = optimise(scene)
    t, torques, states = fly(build_fmu(scene, folder / "station_momentum.fmu"), scene, plan)
    rate = Twin(scene).ode(states[-1], np.zeros(3), places(scene, t[-1:]))
    left = np.abs(states[-1, 7:]).max(), np.abs(np.array(rate)[4:7]).max()
    draw(folder / "station_momentum.png", t, torques, states)
    print(
        "| least cost | published | iterations | time [s] | left: momentum [N m s] | acceleration [rad/s2] |"
    )
    print("|---:|---:|---:|---:|---:|---:|")
    solved = f"{plan.cost:.5f} | {PUBLISHED} | {plan.iterations} | {plan.seconds:.1f}"
    print(f"| {solved} | {left[0]:.0e} | {left[1]:.0e} |")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else EXAMPLES.parent / "build")
