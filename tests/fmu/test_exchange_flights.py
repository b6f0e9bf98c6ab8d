"""Whole flights in model exchange by CVode and Euler's method, against SciPy and co-simulation."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from fmpy import simulate_fmu
from scipy.integrate import solve_ivp

from fmu.exchange import ATTITUDE, RATES, RAW, scalars
from supervessel import reference
from support import ISS_DG, UNIT_TOLERANCE, built, scene
from support.marks import FMI

STOP, STEP = 20.0, 0.5  # s
EVENTS: list[tuple[float, dict[str, float]]] = [
    (4.0, {"torque[1]": 2e6, "torque[3]": -1e6}),
    (8.0, {"torque[1]": 0.0, "DG.mass": 15000.0}),
    (12.5, {"DG.nose.position[2]": -4.0, "torque[3]": 0.0}),
    (16.0, {"DG.nose.direction[2]": 0.5, "DG.nose.alignment[3]": 0.5}),
]
ROWS = [*(f"attitude[{i}]" for i in (1, 2, 3, 4)), *(f"angular_velocity[{i}]" for i in (1, 2, 3))]


def pieces() -> list[tuple[float, float, dict[str, float]]]:
    """Returns from, to and inputs of each span without a change."""
    port = ISS_DG["vessels"]["DG"]["ports"]["nose"]
    inputs = scalars({"DG.mass": 24500.0, "torque": [0.0] * 3} | {f"DG.nose.{k}": v for k, v in port.items()})
    spans, begin = [], 0.0
    for time, changes in [*EVENTS, (STOP, {})]:
        spans.append((begin, time, dict(inputs)))
        inputs |= changes
        begin = time
    return spans


@cache
def flight(fmi: int, kind: str, parts: int = 1, **settings: Any) -> np.ndarray:
    """Returns attitude and rate every STEP, recorded `parts` times as often; inputs jump."""
    rows = [(time, *inputs.values()) for begin, end, inputs in pieces() for time in (begin, end)]
    signals = np.array(rows, dtype=[("time", float), *((name, float) for name in pieces()[0][2])])
    result = simulate_fmu(
        str(built(RAW, fmi)),
        fmi_type=kind,
        stop_time=STOP,
        output_interval=STEP / parts,
        input=signals,
        output=ROWS,
        record_events=False,
        **settings,
    )
    return np.column_stack([result[name] for name in ROWS])[::parts]


@cache
def by_scipy() -> np.ndarray:
    """Returns attitude and rate every STEP by SciPy on the numpy reference."""
    x, rows = np.array([*(np.array(ATTITUDE) / np.linalg.norm(ATTITUDE)), *RATES]), []
    rows.append(x)
    for begin, end, inputs in pieces():
        torque = [inputs[f"torque[{i}]"] for i in (1, 2, 3)]
        inertia = reference.composite(scene(RAW), inputs).inertia

        def rate(_: float, y: np.ndarray, J: Any = inertia, M: Any = torque) -> np.ndarray:
            return np.concatenate(
                [reference.attitude_dot(y[:4], y[4:]), reference.angular_acceleration("tensor", J, y[4:], M)]
            )

        times = [*np.arange(begin, end, STEP)[1:].tolist(), end]
        solution = solve_ivp(rate, (begin, end), x, "DOP853", times, rtol=1e-13, atol=1e-15)
        rows += list(solution.y.T)
        x = solution.y[:, -1]
    return np.array(rows)


def turned() -> float:
    """Returns the angle [rad] turned in the whole flight."""
    return float(np.linalg.norm(by_scipy()[:, 4:], axis=1).sum()) * STEP


# CVode keeps the weighted root mean square of each step's error below 1: a component is off by at most
# sqrt(7) (relative + absolute) tolerance, both being TOLERANCE times magnitudes of about 1.
TOLERANCE = 1e-9
STEP_ERROR = 2 * np.sqrt(7.0) * TOLERANCE


@FMI
def test_cvode_on_the_fmu_agrees_with_scipy(fmi):
    calls: list[str] = []
    settings = {"solver": "CVode", "relative_tolerance": TOLERANCE, "fmi_call_logger": calls.append}
    found = flight(fmi, "ModelExchange", **settings)
    steps = sum("Derivatives(" in call for call in calls)  # each takes one evaluation at least
    # A wrong rate turns the attitude all the time that follows: a factor of the angle turned.
    assert np.abs(found - by_scipy()).max() <= STEP_ERROR * steps * (1 + turned())


@FMI
def test_co_simulation_agrees_with_scipy(fmi):
    # RK4 errs by theta^5 101/2880 in each sub-step of theta = 0.05 rad: so its error coefficients sum up.
    bound = 101 / 2880 * 0.05**4 * turned() * (1 + turned())
    assert np.abs(flight(fmi, "CoSimulation") - by_scipy()).max() <= bound


# FMPy's Euler method takes one step from each point that is recorded to the next.
PARTS = 100


def euler(fmi: int, parts: int = PARTS) -> np.ndarray:
    return flight(fmi, "ModelExchange", parts, solver="Euler", step_size=STEP / parts)


@FMI
def test_euler_on_the_fmu_errs_by_the_first_power_of_the_step_around_scipys_result(fmi):
    coarse, fine = (euler(fmi, parts)[-1] - by_scipy()[-1] for parts in (PARTS, 2 * PARTS))
    angle = np.linalg.norm(by_scipy()[:, 4:], axis=1).max() * STEP / PARTS
    # A step of x'' h^2 / 2: the attitude has |x''| = omega^2/4, the rate at most omega^3 where it changes by
    # its square a second.
    assert np.abs(coarse).max() <= 0.5 * angle * turned() * (1 + turned())
    # The next power of the step is smaller by a factor of the angle for each radian turned.
    assert np.abs(2.0 * fine - coarse).max() <= angle * turned() * np.abs(coarse).max()


@pytest.mark.parametrize("solver", ["CVode", "Euler"])
def test_both_versions_give_the_same_exchange_bit_for_bit(solver):
    settings = (
        {"relative_tolerance": TOLERANCE}
        if solver == "CVode"
        else {"parts": PARTS, "step_size": STEP / PARTS}
    )
    two, three = (flight(fmi, "ModelExchange", solver=solver, **settings) for fmi in (2, 3))
    assert two.tobytes() == three.tobytes()


@FMI
def test_the_attitude_output_stays_unit_under_an_integrator_that_lets_it_grow(fmi):
    assert np.abs(np.linalg.norm(euler(fmi)[:, :4], axis=1) - 1.0).max() <= UNIT_TOLERANCE
