"""What a station's turning under gravity's gradient costs by well-known engines, in plain RK4 steps of C.

Two works: one orbit, 5700 s, of a station in its ordinary attitude (turning with the orbit, z down, y against
the orbit's normal), and a day of a libration about the stable attitude, 0.1 rad off. Each engine integrates
orbit and attitude at its cheapest setting, tried from loose to tight, whose attitude ends within 1e-9 rad of
a motion known to 30 digits, or at the most accurate one tried, with that error. Time is the processor's; the
plain step is timed in the same process, in turn. What is not installed is left out.

    python tests/peers/orbit.py               (needs tests and tests/bench on the path)
    python tests/peers/orbit.py heyoka bsk    only these packages beside this project's own
"""

import math
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from engines import Array, basilisk_attitude
from fmpy import extract, read_model_description
from ladder import Flight, Judge, Ladder, Result, Settings
from own import Built
from run import build_host

from fmu_build import build_fmu
from peers import NAMES, version
from supervessel import parse_scene
from support.gyrostat import Course, Gyrostat, GyrostatState
from support.orbits import EARTH, HEIGHT, SPEED

ENOUGH = 1e-9  # rad
LADDER = Ladder(ENOUGH, 20.0, 60.0)
ORBIT_RATE = SPEED / HEIGHT


@dataclass(frozen=True)
class Work:
    """A body and its start in a circular orbit in the plane of x and y; it turns with the orbit.

    inertia  : (3, 3) [kg m2]
    attitude : q_inertial_body, (4,)
    duration : [s]
    """

    inertia: Array
    attitude: Array
    duration: float

    @property
    def rates(self) -> Array:
        """The orbit's rate, (3,) [rad/s], body axes."""
        return _matrix(self.attitude).T @ [0.0, 0.0, ORBIT_RATE]


POSITION, VELOCITY = (HEIGHT, 0.0, 0.0), (0.0, SPEED, 0.0)
STATION = np.array([[1.28e8, -2.1e6, 5.3e6], [-2.1e6, 1.07e8, 1.4e6], [5.3e6, 1.4e6, 2.01e8]])


def _matrix(q: Array) -> Array:
    """Returns R_inertial_body, (3, 3)."""
    w, v = q[0], np.asarray(q[1:])
    return np.eye(3) + 2.0 * w * _skew(v) + 2.0 * _skew(v) @ _skew(v)


def _skew(v: Any) -> Array:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def works() -> dict[str, Work]:
    """Returns the works by name."""
    # columns: body axes in inertial ones; z towards the centre, y against the normal, x along the flight
    down = np.array([0.5, 0.5, -0.5, -0.5])
    stable = np.array([math.cos(0.05), 0.0, 0.0, math.sin(0.05)])
    return {
        "one orbit": Work(STATION, down, 5700.0),
        "a day": Work(np.diag([1.07e8, 1.28e8, 2.01e8]), stable, 86_400.0),
    }


def rate(work: Work) -> Callable[[float, Array], Array]:
    """Returns the rate of (attitude, rates, position, velocity), (13,), in numpy and plain numbers."""
    inertia, inverse = work.inertia, np.linalg.inv(work.inertia)

    def ode(_: float, x: Array) -> Array:
        w0, x0, y0, z0, p, q, r = x[:7].tolist()
        place = x[7:10]
        distance = math.sqrt(place @ place)
        omega, direction = x[4:7], _matrix(x[:4] / math.sqrt(x[:4] @ x[:4])).T @ (place / distance)
        torque = 3.0 * EARTH / distance**3 * _cross(direction, inertia @ direction)
        return np.concatenate(
            [
                [
                    -0.5 * (x0 * p + y0 * q + z0 * r),
                    0.5 * (w0 * p + y0 * r - z0 * q),
                    0.5 * (w0 * q + z0 * p - x0 * r),
                    0.5 * (w0 * r + x0 * q - y0 * p),
                ],
                inverse @ (torque - _cross(omega, inertia @ omega)),
                x[10:],
                -EARTH / distance**3 * place,
            ]
        )

    return ode


def _cross(a: Array, b: Array) -> Array:
    """Returns a x b, (3,); numpy's own takes ten times as long."""
    (u, v, w), (x, y, z) = a.tolist(), b.tolist()
    return np.array([v * z - w * y, w * x - u * z, u * y - v * x])


def start(work: Work) -> Array:
    """Returns (attitude, rates, position, velocity), (13,)."""
    return np.array([*work.attitude, *work.rates, *POSITION, *VELOCITY])


def tolerances() -> Iterator[float]:
    """Yields tolerances from 1e-8 to 1e-15, two in a decade."""
    yield from (10.0 ** (-8.0 - 0.5 * i) for i in range(15))


def scipy(method: str) -> Callable[[Work], Settings]:
    """Returns the way of `solve_ivp`; positions are scaled, so that one tolerance does for all."""

    def ways(work: Work) -> Settings:
        solve_ivp = import_module("scipy.integrate").solve_ivp
        ode, scale = rate(work), np.array([1.0] * 4 + [ORBIT_RATE] * 3 + [HEIGHT] * 3 + [SPEED] * 3)

        def scaled(t: float, y: Array) -> Array:
            return ode(t, y * scale) / scale

        for tolerance in tolerances():
            rtol = max(tolerance, 2.3e-14)

            def fly(rtol: float = rtol, atol: float = tolerance) -> Array:
                done = solve_ivp(
                    scaled, (0.0, work.duration), start(work) / scale, method, rtol=rtol, atol=atol
                )
                return np.array(done.y[:4, -1])

            yield f"tolerance {tolerance:.0e}", lambda fly=fly: fly

    return ways


def heyoka(work: Work) -> Settings:
    """The way of heyoka's Taylor integrator, compiled for this very body.

    Its tolerance is relative to the largest number of the state: places are in units of the orbit's radius.
    """
    hy = import_module("heyoka")
    q0, q1, q2, q3, p, q, r, *rest = hy.make_vars(*(f"x{i}" for i in range(13)))
    place, velocity = rest[:3], rest[3:]
    J, inverse = work.inertia, np.linalg.inv(work.inertia)
    square = hy.sum([c * c for c in place])
    R = [
        [1.0 - 2.0 * (q2 * q2 + q3 * q3), 2.0 * (q1 * q2 - q0 * q3), 2.0 * (q1 * q3 + q0 * q2)],
        [2.0 * (q1 * q2 + q0 * q3), 1.0 - 2.0 * (q1 * q1 + q3 * q3), 2.0 * (q2 * q3 - q0 * q1)],
        [2.0 * (q1 * q3 - q0 * q2), 2.0 * (q2 * q3 + q0 * q1), 1.0 - 2.0 * (q1 * q1 + q2 * q2)],
    ]
    body = [sum(R[i][j] * place[i] for i in range(3)) for j in range(3)]
    mu = EARTH / HEIGHT**3
    strength = 3.0 * mu * square**-2.5

    def cross(a: Any, b: Any) -> list[Any]:
        return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]

    def times(matrix: Array, v: Any) -> list[Any]:
        return [sum(float(m) * c for m, c in zip(row, v, strict=True) if m) for row in matrix]

    omega = [p, q, r]
    gradient, gyroscopic = cross(body, times(J, body)), cross(omega, times(J, omega))
    torque = [strength * g - c for g, c in zip(gradient, gyroscopic, strict=True)]
    rates = [
        -0.5 * (q1 * p + q2 * q + q3 * r),
        0.5 * (q0 * p + q2 * r - q3 * q),
        0.5 * (q0 * q + q3 * p - q1 * r),
        0.5 * (q0 * r + q1 * q - q2 * p),
        *times(inverse, torque),
        *velocity,
        *(-mu * square**-1.5 * c for c in place),
    ]
    system = list(zip([q0, q1, q2, q3, p, q, r, *rest], rates, strict=True))
    begun = start(work) / np.array([1.0] * 7 + [HEIGHT] * 6)
    for tolerance in tolerances():
        made = hy.taylor_adaptive(system, begun, tol=tolerance)

        def ready(made: Any = made) -> Flight:
            made.time = 0.0
            made.state[:] = begun

            def fly() -> Array:
                made.propagate_until(work.duration)
                return np.array(made.state[:4])

            return fly

        yield f"tolerance {tolerance:.0e}", ready


def basilisk(integrator: str | None) -> Callable[[Work], Settings]:
    """Returns the way of Basilisk's Spacecraft with its gravity gradient effector."""

    def ways(work: Work) -> Settings:
        for step in (60.0, 30.0, 20.0, 10.0, 5.0, 4.0, 2.0, 1.0, 0.5, 0.25):
            yield f"steps of {step:g} s", lambda step=step: _basilisk(work, step, integrator)

    return ways


def _basilisk(work: Work, step: float, integrator: str | None) -> Flight:
    """Returns a flight that is ready."""
    base = import_module("Basilisk.utilities.SimulationBaseClass")
    craft = import_module("Basilisk.simulation.spacecraft").Spacecraft()
    effector = import_module("Basilisk.simulation.GravityGradientEffector").GravityGradientEffector()
    body = import_module("Basilisk.simulation.gravityEffector").GravBodyData()
    simulation = base.SimBaseClass()
    simulation.CreateNewProcess("process").addTask(simulation.CreateNewTask("task", round(step * 1e9)))
    if integrator:
        made = getattr(import_module("Basilisk.simulation.svIntegrators"), integrator)(craft)
        made.relTol, made.absTol = 1e-13, 1e-15
        craft.setIntegrator(made)
    body.planetName, body.mu, body.isCentralBody = "earth_planet_data", EARTH, True
    craft.gravField.gravBodies = import_module("Basilisk.simulation.spacecraft").GravBodyVector([body])
    craft.hub.mHub = 4.5e5
    craft.hub.r_BcB_B = [[0.0]] * 3
    craft.hub.IHubPntBc_B = work.inertia.tolist()
    craft.hub.r_CN_NInit = [[x] for x in POSITION]
    craft.hub.v_CN_NInit = [[x] for x in VELOCITY]
    craft.hub.sigma_BNInit = [[x / (1.0 + work.attitude[0])] for x in work.attitude[1:]]
    craft.hub.omega_BN_BInit = [[x] for x in work.rates]
    effector.addPlanetName(body.planetName)
    craft.addDynamicEffector(effector)
    simulation.AddModelToTask("task", craft)
    simulation.AddModelToTask("task", effector)
    simulation.InitializeSimulation()
    simulation.ConfigureStopTime(round(work.duration * 1e9))

    def fly() -> Array:
        simulation.ExecuteSimulation()
        return basilisk_attitude(craft)

    return fly


def built(folder: Path, work: Work, propagator: str, angle: float) -> Built:
    """Returns the FMU of a work's body by a propagator, rk4 in sub-steps of an angle [rad]."""
    scene = {
        "name": "body",
        "root": "B",
        "vessels": {"B": {"mass": 4.5e5, "inertia": work.inertia.tolist()}},
        "inputs": {"gravity": True},
        "gravity": {"mu": EARTH, "position": list(POSITION), "velocity": list(VELOCITY)},
        "rotation": {
            "propagator": propagator,
            "max_angle_step": angle,
            "attitude": work.attitude.tolist(),
            "angular_velocity": work.rates.tolist(),
        },
        "outputs": {"names": ["attitude"]},
    }
    place = Path(tempfile.mkdtemp(dir=folder))
    fmu = build_fmu(parse_scene(scene), place / "body.fmu")
    return Built(Path(extract(str(fmu), str(place / "unpacked"))), read_model_description(str(fmu)))


Measure = Callable[[Path, Work, Judge], Result | None]


def natively(propagator: str) -> Measure:
    """Returns the measurement of this project's FMU in one communication step, from native code."""

    def measure(folder: Path, work: Work, judge: Judge) -> Result | None:
        own = import_module("own")
        host, best = build_host("flight", folder), None
        loose = [(0.05, 10.0 ** (-7.0 - 0.5 * i)) for i in range(17)]
        rungs = [(0.05 * 2.0 ** (-i / 2.0), 0.0) for i in range(16)] if propagator == "rk4" else loose
        for angle, tolerance in rungs:
            fmu = built(folder, work, propagator, angle)
            flown = own.flown(host, fmu, (work.duration, 1, tolerance), [], ["attitude"])
            if flown is None:
                return None
            text = f"sub-steps of {angle:.2g} rad" if propagator == "rk4" else f"tolerance {tolerance:.0e}"
            result = Result(flown[0], judge(np.array(flown[1])), text)
            best = result if best is None or result.error < best.error else best
            if result.error <= ENOUGH:
                break
        return best

    return measure


def by_ladder(ways: Callable[[Work], Settings]) -> Measure:
    """Returns the measurement of a way in Python: its first setting that is accurate enough, or its best."""
    return lambda folder, work, judge: LADDER.climb(ways(work), folder, judge)


WAYS: list[tuple[str, str, Measure]] = [
    *((f"FMU, `{p}`", "supervessel", natively(p)) for p in ("taylor", "dop853", "rk4")),
    *((f"SciPy {m}", "scipy", by_ladder(scipy(m))) for m in ("DOP853", "LSODA")),
    ("Basilisk RK4", "bsk", by_ladder(basilisk(None))),
    ("Basilisk RKF78", "bsk", by_ladder(basilisk("svIntegratorRKF78"))),
    ("heyoka", "heyoka", by_ladder(heyoka)),
]


def end_of(work: Work) -> Array:
    """Returns the true attitude at a work's end, (4,)."""
    begun = GyrostatState(work.attitude.tolist(), work.rates.tolist(), POSITION, VELOCITY)
    course = Course(Gyrostat(work.inertia.tolist(), mu=EARTH), begun, work.duration)
    return np.array(course.at(work.duration).attitude, dtype=float)


def main(packages: list[str]) -> None:
    """Prints the table, then the settings."""
    chosen = [way for way in WAYS if not packages or way[1] in (*packages, "supervessel")]
    for package in dict.fromkeys(p for _, p, _ in chosen if version(p) is None):
        print(f"{NAMES[package]} is not installed: left out\n")
    flown = works()
    ends = {name: end_of(work) for name, work in flown.items()}
    print("| to 1e-9 rad: plain RK4 steps, times the FMU's | " + " | ".join(flown) + " |")
    print("|---|" + "---:|" * len(flown))
    units: dict[str, float] = {}
    settings = []
    for label, package, measure in chosen:
        if version(package) is None:
            continue
        cells, texts = [], []
        for name, work in flown.items():

            def judge(q: Array, end: Array = ends[name]) -> float:
                gap = min(float(np.linalg.norm(q - side * end)) for side in (1.0, -1.0))
                return 2.0 * gap if math.isfinite(gap) else math.inf

            with tempfile.TemporaryDirectory() as folder:
                result = measure(Path(folder), work, judge)
            if result is None:
                cells.append("-")
                continue
            units.setdefault(name, result.cost)
            note = "" if result.error <= ENOUGH else f" ({result.error:.0e} rad)"
            cells.append(f"{result.cost:.3g}, {result.cost / units[name]:.3g}{note}")
            texts.append(f"{result.text} ({result.error:.0e})")
        print(f"| {label} | " + " | ".join(cells) + " |", flush=True)
        settings.append(f"- {label}, {NAMES[package]} {version(package)}: " + "; ".join(texts))
    print("\nSettings and errors [rad], column by column:\n")
    print("\n".join(settings))


if __name__ == "__main__":
    main(sys.argv[1:])
