"""What the twin costs from Python, beside CasADi's integrator, SciPy and MuJoCo (if installed): `make bench`.

Each time is a median of rounds, of the processor's time, each beside a plain RK4 step of C. Quote the ratios:
the speed of machines drifts.
"""

import ctypes
import tempfile
import time
from collections.abc import Callable, Iterator
from importlib import import_module
from importlib.util import find_spec
from itertools import count
from pathlib import Path
from statistics import median
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from propagators import DIAGONAL, RATES, TORQUE, error, scene
from run import SCENE, by_rk4
from scipy.integrate import solve_ivp

from fmu_build.compile.compiler import FLAGS, compile_library
from fmu_build.platforms import host_platform
from supervessel import Twin, load_scene, parse_scene
from supervessel.twin.functions import TwinFunction

Plain = Callable[[], float]

HERE = Path(__file__).parent
ROUNDS = 21
STEPS = 1000
DURATION = 40.0  # s, 36 rad
LARGEST_ERROR = 1e-8  # rad, and of the rate relatively


def plain_step(folder: Path) -> Plain:
    """Returns a function that returns the nanoseconds of a plain RK4 step."""
    (folder / "plain.c").write_text(
        '#include "plain.h"\ndouble plain(void) { static volatile double kept; double sink = 0.0;\n'
        "const double taken = time_plain(2000, &sink); kept = sink; return taken; }\n"
    )
    library = folder / "plain.so"
    flags = (*FLAGS, "-std=gnu99", "-fvisibility=default", f"-I{HERE}")
    compile_library([folder / "plain.c"], host_platform(), library, flags)
    function = ctypes.CDLL(str(library)).plain
    function.restype = ctypes.c_double
    return function  # type: ignore[no-any-return]


def timed(run: Callable[[], object], plain: Plain, steps: int) -> tuple[float, float]:
    """Returns nanoseconds of one of `steps` steps that a call takes, and plain RK4 steps, medians."""
    taken, ratios = [], []
    run()
    for _ in range(ROUNDS):
        unit = plain()
        begun = time.process_time()
        run()
        taken.append(1e9 * (time.process_time() - begun) / steps)
        ratios.append(taken[-1] / unit)
    return median(taken), median(ratios)


def in_place(step: TwinFunction, twin: Twin) -> Callable[[], object]:
    """Returns STEPS steps from a Python loop over the function's own arrays that sets a torque at each."""
    run, at = step.in_place()
    x, u, x_next = at["x"], at["u"], at["x_next"]
    x[:], at["h"][:] = twin.x_start, 1e-3

    def loop() -> object:
        for i in range(STEPS):
            u[2] = i
            run()
            x[:] = x_next
        return x

    return loop


def called(step: ca.Function, twin: Twin) -> Callable[[], object]:
    """Returns STEPS / 10 steps by calls with arrays."""

    def run() -> object:
        x = twin.x_start
        for i in range(STEPS // 10):
            x = np.array(step(x, [0.0, 0.0, i], twin.p_start, 1e-3))
        return x

    return run


def print_steps(folder: Path, plain: Plain) -> None:
    """Prints what one step of RK4 costs by each way to it."""
    at_all = by_rk4(load_scene(SCENE))
    print("| one step of `rk4`, ISS with a DeltaGlider | ns | plain RK4 steps |\n|---|---:|---:|")
    for label, twin in (("10 inputs in p", Twin(at_all)), ("fixed=True", Twin(at_all, fixed=True))):
        every = [twin.step, twin.rollout(STEPS), twin.step.fold(STEPS)]
        step, rollout, fold = twin.generate(folder / label.replace(" ", "_"), every, derivatives=0).values()
        columns = [ca.DM(twin.x_start), ca.DM.zeros(3, STEPS), ca.DM(twin.p_start.reshape(-1, 1))]
        repeated = [*columns[:2], ca.repmat(columns[2], 1, STEPS), ca.DM.ones(1, STEPS) * 1e-3]
        ways: dict[str, tuple[Callable[[], object], int]] = {
            "called with arrays": (called(twin.step, twin), STEPS // 10),
            "`in_place`": (in_place(twin.step, twin), STEPS),
            "generated C, `in_place`": (in_place(step, twin), STEPS),
            "generated C, `fold`": (lambda f=fold, a=repeated: ca.Function.__call__(f, *a), STEPS),
            "generated C, `rollout`": (lambda f=rollout, a=columns: ca.Function.__call__(f, *a, 1e-3), STEPS),
        }
        for way, (run, steps) in ways.items():
            nanoseconds, ratio = timed(run, plain, steps)
            print(f"| {label}: {way} | {nanoseconds:.0f} | {ratio:.1f} |")


Flight = tuple[Callable[[], Any], str]


def rollouts(folder: Path, propagator: Any) -> Iterator[Flight]:
    """Yields flights by the twin's steps, generated C, twice as many each time."""
    twin = Twin(parse_scene(scene(DIAGONAL)), propagator=propagator)
    for doubling in count(4):
        steps = 2**doubling
        (flown,) = twin.generate(folder / propagator, [twin.rollout(steps)], derivatives=0).values()
        at = [ca.DM(twin.x_start), ca.repmat(ca.DM(TORQUE), 1, steps), ca.DM(0, 1), ca.DM(DURATION / steps)]
        yield lambda f=flown, a=at: ca.Function.__call__(f, *a)[:, -1], f"{steps} steps"


def integrators(folder: Path, name: str) -> Iterator[Flight]:
    """Yields flights by CasADi's integrators on the twin's ode, tighter each time."""
    twin = Twin(parse_scene(scene(DIAGONAL)))
    for digits in count(6):
        options: dict[str, Any] = {"number_of_finite_elements": 2**digits}
        text = f"{2**digits} elements"
        if name == "cvodes":
            options = {"reltol": 10.0**-digits, "abstol": 10.0 ** -(digits + 2), "max_num_steps": 10**6}
            text = f"reltol 1e-{digits}"
        flow = ca.integrator("flow", name, twin.to_dae(), 0.0, DURATION, options)
        yield lambda f=flow: f(x0=twin.x_start, u=TORQUE)["xf"], text


def by_scipy(folder: Path, _: str) -> Iterator[Flight]:
    """Yields flights by SciPy's DOP853 on the twin's ode, compiled, tighter each time."""
    twin = Twin(parse_scene(scene(DIAGONAL)))
    run, at = twin.generate(folder / "scipy", ["ode"], derivatives=0)["ode"].in_place()
    at["u"][:] = TORQUE

    def rate(_: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
        at["x"][:] = x
        run()
        return at["x_dot"].copy()

    for digits in count(6):
        yield (
            lambda d=digits: solve_ivp(
                rate, (0.0, DURATION), twin.x_start, method="DOP853", rtol=10.0**-d, atol=10.0 ** -(d + 2)
            ).y[:, -1],
            f"rtol 1e-{digits}",
        )


def by_mujoco(folder: Path, _: str) -> Iterator[Flight]:
    """Yields flights by MuJoCo's RK4, twice as many steps each time."""
    mujoco = import_module("mujoco")
    moments = " ".join(str(moment) for moment in np.diag(DIAGONAL))
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><compiler balanceinertia="false"/><option gravity="0 0 0" integrator="RK4"/><worldbody>'
        f'<body><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="{moments}"/></body></worldbody>'
        "</mujoco>"
    )

    def fly(steps: int) -> NDArray[np.float64]:
        model.opt.timestep = DURATION / steps
        body = mujoco.MjData(model)
        body.qvel[3:] = RATES
        body.qfrc_applied[3:] = TORQUE
        mujoco.mj_step(model, body, steps)
        return np.concatenate([body.qpos[3:], body.qvel[3:]])

    for doubling in count(6):
        yield lambda n=2**doubling: fly(n), f"{2**doubling} steps"


WAYS: dict[str, tuple[Callable[[Path, str], Iterator[Flight]], str]] = {
    "twin, `rollout` of `rk4`, generated C": (rollouts, "rk4"),
    "twin, `rollout` of `dop853`, generated C": (rollouts, "dop853"),
    "twin, `rollout` of `taylor`, generated C": (rollouts, "taylor"),
    "CasADi's `cvodes` on the twin's ode": (integrators, "cvodes"),
    "CasADi's `rk` on the twin's ode": (integrators, "rk"),
    "SciPy's DOP853 on the twin's ode, generated C": (by_scipy, ""),
    "MuJoCo's RK4": (by_mujoco, ""),
}


def print_flights(folder: Path, plain: Plain) -> None:
    """Prints what a flight to the same error costs by each way."""
    raw = scene(DIAGONAL)
    print(f"\nConstant torque, {DURATION:g} s, 36 rad, to {LARGEST_ERROR:g} rad\n")
    print("| way | | error | us | plain RK4 steps |\n|---|---|---:|---:|---:|")
    for label, (ways, which) in WAYS.items():
        if ways is by_mujoco and find_spec("mujoco") is None:
            print("MuJoCo is not installed: left out")
            continue
        for fly, text in ways(folder, which):
            off = error(raw, np.array(fly()).ravel(), TORQUE, DURATION)
            if off <= LARGEST_ERROR:
                nanoseconds, ratio = timed(fly, plain, 1)
                print(f"| {label} | {text} | {off:.1e} | {1e-3 * nanoseconds:.0f} | {ratio:.0f} |")
                break


def main() -> None:
    """Prints both tables."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        plain = plain_step(folder)
        print_steps(folder, plain)
        print_flights(folder, plain)


if __name__ == "__main__":
    main()
