"""An arm that goes round a closed path turns its base, which has no momentum; quasi-static it does not."""

from functools import cache
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from changes.histories import ByExchange, ByFmu, Values, elements
from support import Array, variant

BASE, ARM = 1000.0, 300.0  # kg
BASE_PMI, ARM_PMI = np.array([2.0, 3.0, 4.0]), np.array([1.0, 1.5, 2.0])  # m2
HOME, ELBOW = np.array([0.5, 0.0, 1.5]), np.array([0.0, 0.0, -1.0])  # m, ports in base and arm
REDUCED = BASE * ARM / (BASE + ARM)
DURATION = 10.0  # s
TURN, CIRCLE = 0.8, 0.6  # rad, m: how far the port turns and goes
AXIS = np.array([2.0, -1.0, 2.0]) / 3.0

ROBOT: dict[str, Any] = {
    "name": "robot",
    "root": "base",
    "vessels": {
        "base": {
            "mass": BASE,
            "pmi": BASE_PMI.tolist(),
            "ports": {
                "shoulder": {"position": HOME.tolist(), "direction": [0, 0, 1], "alignment": [1, 0, 0]}
            },
        },
        "arm": {
            "mass": ARM,
            "pmi": ARM_PMI.tolist(),
            "ports": {"own": {"position": ELBOW.tolist(), "direction": [0, 0, -1], "alignment": [1, 0, 0]}},
        },
    },
    "docks": [{"ports": ["base.shoulder", "arm.own"]}],
    "inputs": {"pose": ["base.shoulder"], "motion": ["base.shoulder"]},
    "rotation": {"propagator": "dop853", "tolerance": 1e-12},
    "outputs": {"names": ["angular_velocity", "attitude"]},
}


def port(time: float) -> tuple[Array, Array, Array, Array]:
    """Returns position, rotation from home, velocity and rate of the port; all closed after DURATION."""
    phase, speed = 2 * np.pi * time / DURATION, 2 * np.pi / DURATION
    circle = CIRCLE * np.array([1.0 - np.cos(phase), np.sin(phase), 0.0])
    velocity = CIRCLE * speed * np.array([np.sin(phase), np.cos(phase), 0.0])
    angle, angle_dot = TURN * np.sin(phase), TURN * speed * np.cos(phase)
    K = np.array([[0.0, -AXIS[2], AXIS[1]], [AXIS[2], 0.0, -AXIS[0]], [-AXIS[1], AXIS[0], 0.0]])
    R = np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K
    return HOME + circle, R, velocity, angle_dot * AXIS


def inputs(time: float) -> Values:
    position, R, velocity, rate = port(time)
    pose = elements("base.shoulder.position", position)
    pose |= elements("base.shoulder.direction", R[:, 2]) | elements("base.shoulder.alignment", R[:, 0])
    return pose | elements("base.shoulder.velocity", velocity) | elements("base.shoulder.rate", rate)


@cache
def two_bodies() -> tuple[float, ...]:
    """Returns the attitude of the base after DURATION: two bodies whose momenta cancel at every instant."""

    def rate(time: float, q: Array) -> Array:
        position, R, velocity, w = port(time)
        # At home the arm's axes are the base's; its centre is where the port is, less the turned elbow.
        d, d_dot = position - R @ ELBOW, velocity - np.cross(w, R @ ELBOW)
        J_arm = R @ np.diag(ARM * ARM_PMI) @ R.T
        J = np.diag(BASE * BASE_PMI) + J_arm + REDUCED * (d @ d * np.eye(3) - np.outer(d, d))
        omega = np.linalg.solve(J, -REDUCED * np.cross(d, d_dot) - J_arm @ w)
        return 0.5 * np.array([-q[1:] @ omega, *(q[0] * omega + np.cross(q[1:], omega))])

    done = solve_ivp(rate, (0.0, DURATION), [1.0, 0.0, 0.0, 0.0], "DOP853", rtol=1e-13, atol=1e-15)
    q = done.y[:, -1]
    return tuple((q / np.linalg.norm(q)).tolist())


def angle_between(one: Any, other: Any) -> float:
    """Returns the angle [rad] between two attitudes."""
    (w, *v), (s, *t) = np.asarray(one), np.asarray(other)
    return float(2.0 * np.linalg.norm(w * np.array(t) - s * np.array(v) - np.cross(v, t)))


def test_an_arm_on_a_closed_path_turns_the_base_as_two_bodies_do():
    driver = ByExchange(ROBOT)
    driver.fly(DURATION, inputs)
    assert angle_between(driver.attitude, two_bodies()) <= 1e-9
    # The path is worth following: the base ends turned by more than a degree.
    assert angle_between(driver.attitude, [1.0, 0.0, 0.0, 0.0]) > np.radians(1.0)


def test_without_inputs_of_motion_the_base_does_not_turn():
    still = variant(ROBOT, {"inputs.motion": [], "rotation.pose_change": "momentum"})
    driver = ByExchange(still)
    driver.fly(
        DURATION, lambda t: {k: v for k, v in inputs(t).items() if "velocity" not in k and "rate" not in k}
    )
    assert driver.attitude.tolist() == [1.0, 0.0, 0.0, 0.0]
    assert driver.angular_velocity.tolist() == [0.0, 0.0, 0.0]


def sampled(count: int, where: float) -> float:
    """Returns the error [rad] of co-simulation in `count` steps, inputs being those of a share of a step."""
    driver, h = ByFmu(ROBOT), DURATION / count
    for i in range(count):
        driver.set(inputs((i + where) * h))
        driver.fly(h)
    attitude = driver.attitude
    driver.instance.free()
    return angle_between(attitude, two_bodies())


COUNTS = (40, 80, 160, 320)


def order(where: float) -> float:
    errors = [sampled(count, where) for count in COUNTS]
    return float(-np.polyfit(np.log(COUNTS), np.log(errors), 1)[0])


def test_co_simulation_tends_to_model_exchange_by_the_square_of_the_step():
    # Inputs of the middle of a step: the next term is four powers of the step below, (0.16)^2 at most here.
    assert abs(order(0.5) - 2.0) <= 0.03
