"""Whole flights through FMPy's simulator, inputs moving in steps, against SciPy on the numpy reference."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from fmpy import simulate_fmu
from scipy.integrate import solve_ivp

from supervessel import reference
from support import COMPOSITE_TOLERANCE, EPS, ISS_DG, LAWS, STEADY, relative_error, scene, unpacked, variant
from support.marks import FMI

LAW = pytest.mark.parametrize("law", LAWS)

STOP, STEP = 60.0, 0.5  # s
ANGLE = 0.05  # rad, max_angle_step
STATE = [*(f"attitude[{i}]" for i in (1, 2, 3, 4)), *(f"angular_velocity[{i}]" for i in (1, 2, 3))]
LOCAL = [f"state.{name}" for name in STATE]

# At a steady rate RK4 turns a quaternion by x = theta/2 with an error of x^5/120, theta being the angle of
# the sub-step.
STEADY_ERROR = 1 / (120 * 2**5)
# In general the error of a sub-step is theta^5 times RK4's error coefficients for the nine trees of order 5,
# whose magnitudes add up to 101/2880, times elementary differentials, in units of the rate. Those are below 1
# where the rate changes by less than its square a second.
GENERAL_ERROR = 101 / 2880
# Beside the error's term of order 4 stand terms smaller by the square of the angle turned in a step of STEP,
# 0.1 rad at most.
ORDER_TOLERANCE = 0.1**2

# Inputs from a time on. The ship burns fuel, its port is turned and moved, torque pulses act.
EVENTS: list[tuple[float, dict[str, float]]] = [
    (5.0, {"torque[1]": 2e6, "torque[3]": -1e6}),
    (10.0, {"torque[1]": 0.0, "torque[3]": 0.0, "DG.mass": 15000.0}),
    (20.0, {"DG.nose.position[2]": -4.0, "DG.nose.position[3]": -9.0}),
    (25.5, {"DG.nose.direction[2]": 0.5, "DG.nose.alignment[3]": 0.5}),
    (30.0, {"torque[2]": -3e6, "DG.pmi[1]": 20.0, "DG.mass": 11000.0}),
    (40.0, {"torque[2]": 0.0}),
    (52.5, {"DG.mass": 24500.0, "torque[3]": 4e6}),
]
RATES = [0.05, -0.08, 0.11]
ATTITUDE = [0.5, -0.5, 0.7, 0.1]


def raw_scene(law: str, **rotation: Any) -> dict[str, Any]:
    rotation = STEADY | {"max_angle_step": ANGLE, "angular_velocity": RATES, "attitude": ATTITUDE} | rotation
    return variant(ISS_DG, {"name": f"flight_{law}", "rotation": {"law": law, **rotation}})


def start_inputs() -> dict[str, float]:
    """Returns the scene's values of all inputs that the events change."""
    port = ISS_DG["vessels"]["DG"]["ports"]["nose"]
    inputs = {"DG.mass": 24500.0} | {f"torque[{i}]": 0.0 for i in (1, 2, 3)}
    inputs |= {f"DG.pmi[{i + 1}]": x for i, x in enumerate(ISS_DG["vessels"]["DG"]["pmi"])}
    for part, vector in port.items():
        inputs |= {f"DG.nose.{part}[{i + 1}]": x for i, x in enumerate(vector)}
    return inputs


def pieces() -> list[tuple[float, float, dict[str, float]]]:
    """Returns from, to and inputs of each span without a change."""
    spans, inputs, begin = [], start_inputs(), 0.0
    for time, changes in [*EVENTS, (STOP, {})]:
        spans.append((begin, time, dict(inputs)))
        inputs |= changes
        begin = time
    return spans


def signals() -> np.ndarray:
    """Returns the inputs as FMPy takes them: two rows at each jump."""
    rows = [(time, *inputs.values()) for begin, end, inputs in pieces() for time in (begin, end)]
    return np.array(rows, dtype=[("time", float), *((name, float) for name in start_inputs())])


@cache
def flight(law: str, fmi: int, step: float = STEP, angle: float = ANGLE) -> np.ndarray:
    path = unpacked(raw_scene(law, max_angle_step=angle), fmi)
    return simulate_fmu(
        str(path), fmi_type="CoSimulation", stop_time=STOP, output_interval=step, input=signals()
    )


@cache
def by_scipy(law: str) -> np.ndarray:
    """Returns the states at multiples of STEP, (n, 7), by a method of order 8 with all its digits."""
    flown = scene(raw_scene(law))
    state = np.array([*flown.rotation.attitude, *RATES])
    states = [state]
    for begin, end, inputs in pieces():
        whole = reference.composite(flown, {k: v for k, v in inputs.items() if not k.startswith("torque")})
        torque = [inputs[f"torque[{i}]"] for i in (1, 2, 3)]

        def rate(time, x, inertia=whole.inertia, torque=torque):
            acceleration = reference.angular_acceleration(law, inertia, x[4:], torque)
            return np.concatenate([reference.attitude_dot(x[:4], x[4:]), acceleration])

        assert np.array_equal(rate(0.0, state), reference.ode(flown, state, torque, inputs))
        times = np.arange(round(begin / STEP) + 1, round(end / STEP) + 1) * STEP
        solution = solve_ivp(rate, (begin, end), state, "DOP853", times, rtol=1e-13, atol=1e-16)
        states += list(solution.y.T)
        state = solution.y[:, -1]
    return np.array(states)


def states(result: np.ndarray) -> np.ndarray:
    return np.column_stack([result[name] for name in STATE])


def turned(law: str) -> float:
    """Returns the angle of the whole flight, [rad]."""
    return float(np.trapezoid(np.linalg.norm(by_scipy(law)[:, 4:], axis=1), dx=STEP))


@LAW
def test_the_flight_is_one_that_the_tolerances_hold_for(law):
    for begin, end, inputs in pieces():
        torque = [inputs[f"torque[{i}]"] for i in (1, 2, 3)]
        for state in by_scipy(law)[round(begin / STEP) : round(end / STEP) + 1]:
            change = reference.ode(scene(raw_scene(law)), state, torque, inputs)[4:]
            assert np.linalg.norm(change) <= np.linalg.norm(state[4:]) ** 2


@FMI
def test_attitude_at_a_given_rate_follows_the_differential_equation(fmi):
    error = np.abs(states(flight("none", fmi)) - by_scipy("none"))
    assert error[:, :4].max() <= STEADY_ERROR * ANGLE**4 * turned("none")


@FMI
@pytest.mark.parametrize("law", LAWS[1:])
def test_rate_follows_the_differential_equation(fmi, law):
    fastest = np.linalg.norm(by_scipy(law)[:, 4:], axis=1).max()
    error = np.abs(states(flight(law, fmi)) - by_scipy(law))
    assert error[:, 4:].max() <= GENERAL_ERROR * ANGLE**4 * turned(law) * fastest


@FMI
@pytest.mark.parametrize("law", LAWS[1:])
def test_attitude_follows_the_differential_equation(fmi, law):
    error = np.abs(states(flight(law, fmi)) - by_scipy(law))
    # Errors of its own, and half the angle by which the rate's error, growing all the time, turns it.
    assert error[:, :4].max() <= GENERAL_ERROR * ANGLE**4 * turned(law) * (1 + turned(law) / 4)


@pytest.mark.parametrize("law", ["none", "tensor"])
def test_the_error_falls_with_the_fourth_power_of_the_step(law):
    end = by_scipy(law)[-1]
    coarse, fine = (
        np.abs(states(flight(law, 3, step, angle=1.0))[-1] - end).max() for step in (STEP, STEP / 2)
    )
    assert coarse / fine == pytest.approx(2**4, rel=ORDER_TOLERANCE)


@LAW
def test_both_versions_give_the_same_flight_bit_for_bit(law):
    two, three = flight(law, 2), flight(law, 3)
    assert two.dtype == three.dtype
    assert two.tobytes() == three.tobytes()


@FMI
def test_the_states_can_be_recorded_and_are_those_of_the_outputs(fmi):
    result = simulate_fmu(
        str(unpacked(raw_scene("tensor"), fmi)),
        stop_time=STOP,
        output_interval=STEP,
        input=signals(),
        output=[*STATE, *LOCAL],
    )
    recorded = np.column_stack([result[name] for name in LOCAL])
    assert states(result).tobytes() == states(flight("tensor", fmi)).tobytes()
    assert recorded[:, 4:].tobytes() == states(result)[:, 4:].tobytes()
    # Outputs bring the attitude to unit length once more: a quotient by the root of a sum of four squares is
    # off by at most 2 EPS, and so is the length that the state already has.
    assert np.abs(recorded[:, :4] - states(result)[:, :4]).max() <= 4 * EPS


@FMI
def test_outputs_are_those_of_the_end_of_the_step_under_the_inputs_of_the_step(fmi):
    result = flight("tensor", fmi)
    for begin, end, inputs in pieces():
        shaping = {k: v for k, v in inputs.items() if not k.startswith("torque")}
        whole = reference.composite(scene(raw_scene("tensor")), shaping)
        rows = result[(result["time"] > begin) & (result["time"] <= end)]
        J = np.array([rows[f"inertia[{i},{j}]"] for i in (1, 2, 3) for j in (1, 2, 3)]).T
        assert len(rows) == round((end - begin) / STEP)
        assert relative_error(J, np.tile(whole.inertia.ravel(), (len(rows), 1))) <= COMPOSITE_TOLERANCE
        assert relative_error(rows["mass"], np.full(len(rows), whole.mass)) <= COMPOSITE_TOLERANCE


@FMI
def test_inputs_may_jump_between_the_points_of_output(fmi):
    end = states(flight("tensor", fmi, step=0.7))[-1]
    error = np.abs(end - by_scipy("tensor")[-1])
    assert error.max() <= GENERAL_ERROR * ANGLE**4 * turned("tensor") * (1 + turned("tensor") / 4)


@FMI
def test_rates_stay_exactly_as_they_are_without_a_law(fmi):
    result = flight("none", fmi)
    assert [set(result[f"angular_velocity[{i}]"]) for i in (1, 2, 3)] == [{rate} for rate in RATES]


@FMI
def test_start_values_of_inputs_and_parameters_give_the_flight_of_a_scene_that_has_them(fmi):
    changes = {"DG.mass": 13000.0, "DG.pmi[3]": 9.0, "DG.nose.position[1]": 0.75}
    rates, attitude = [0.02, 0.03, -0.04], [0.5, -0.5, 0.5, 0.5]
    start_values = changes | {f"angular_velocity_start[{i + 1}]": x for i, x in enumerate(rates)}
    start_values |= {f"attitude_start[{i + 1}]": x for i, x in enumerate(attitude)}
    ship = "vessels.DG"
    with_them = variant(
        raw_scene("tensor", angular_velocity=rates, attitude=attitude),
        {
            f"{ship}.mass": 13000.0,
            f"{ship}.pmi": [15.5, 22.1, 9.0],
            f"{ship}.ports.nose.position": [0.75, -0.49, -10.076],
        },
    )
    flights = [
        simulate_fmu(str(unpacked(raw, fmi)), stop_time=10.0, output_interval=STEP, start_values=values)
        for raw, values in ((raw_scene("tensor"), start_values), (with_them, {}))
    ]
    assert flights[0].tobytes() == flights[1].tobytes()


@pytest.mark.parametrize("start", [1e5, -3.0, -60.0])
@FMI
def test_fmpy_flies_from_any_start_time(fmi, start):
    path = str(unpacked(raw_scene("none"), fmi))
    flown = simulate_fmu(path, start_time=start, stop_time=start + STOP, output_interval=STEP)
    assert len(flown) == round(STOP / STEP) + 1
    # STEP and all times are exact in binary, the steps are the same.
    later = simulate_fmu(path, stop_time=STOP, output_interval=STEP)
    assert states(flown).tobytes() == states(later).tobytes()


@pytest.mark.parametrize("start", [0.0, 1e5, -3.0, -6.0])
@FMI
def test_fmpy_flies_to_its_stop_time_by_steps_that_are_not_exact(fmi, start):
    path = str(unpacked(raw_scene("none"), fmi))
    flown = simulate_fmu(path, start_time=start, stop_time=start + 6.0, output_interval=0.1)
    assert len(flown) == 61
    # Times are sums and products of the start and 0.1, off by a few roundings of the largest.
    assert np.abs(flown["time"] - (start + 0.1 * np.arange(61))).max() <= 4 * EPS * max(abs(start), 6.0)
