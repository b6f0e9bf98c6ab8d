"""The equations of wheels: closed forms, digits, SciPy, energy and momentum."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from supervessel import Twin, reference
from support import OK, Array, Instance, U, body, scene, store, variant
from support.gyrostat import Course, Gyrostat, GyrostatState
from support.orbits import orbiting
from wheels.scenes import AXES, CARRIER, GYROSTAT, INERTIA, INERTIAS, MOTION, WHEELS

LAW = pytest.mark.parametrize("law", ["decoupled", "principal", "tensor"])
TORQUE, MOTORS = (2.0, -1.0, 0.5), (0.7, 0.0, -0.4)
"""N m; the second wheel has no motor."""
U_GIVEN = [*TORQUE, MOTORS[0], MOTORS[2]]


@cache
def twin(law: str = "tensor", **rotation: Any) -> Twin:
    return Twin(
        scene(variant(GYROSTAT, {"rotation.law": law, **{f"rotation.{k}": v for k, v in rotation.items()}}))
    )


def numbers(value: Any) -> Array:
    return np.array(value).ravel()


def outputs(of: Twin, x: Any, u: Any, p: Any) -> dict[str, Array]:
    """Returns the outputs by name, vectors together."""
    y = dict(zip(of.y_names, numbers(of.outputs(x, u, p)), strict=True))
    groups = {name.partition("[")[0] for name in y}
    return {g: np.array([v for n, v in y.items() if n.partition("[")[0] == g]) for g in groups}


# Against other equations


@LAW
def test_the_rate_of_the_state_is_that_of_the_written_equations(law):
    # K w' = M - sum u b - w x (K w + sum h b), h' = u, with K = J - A; the law keeps what it keeps of K.
    x = np.concatenate([twin().x_start[:4], [0.3, -0.2, 0.5], [30.0, -12.0, 7.0]])
    omega, momenta, motors = x[4:7], x[7:], np.array(MOTORS)
    K = np.array(INERTIA) - (AXES.T * INERTIAS) @ AXES
    K = K if law == "tensor" else np.diag(np.diag(K))
    gyroscopic = np.cross(omega, K @ omega + momenta @ AXES) if law != "decoupled" else 0.0
    expected = np.linalg.solve(K, np.array(TORQUE) - motors @ AXES - gyroscopic)
    found = numbers(twin(law).ode(x, U_GIVEN, []))
    assert np.abs(found[4:7] - expected).max() <= 64 * U * np.abs(expected).max()
    assert found[7:].tolist() == motors.tolist()


@cache
def known(law: str, gravity: bool) -> GyrostatState:
    """Returns the state after TIME under torque and motors, to thirty digits."""
    wheels = {"axes": AXES.tolist(), "inertias": INERTIAS.tolist(), "motors": MOTORS}
    of = Gyrostat(INERTIA, law, torque=TORQUE, mu=FIELD["mu"] if gravity else 0, **wheels)
    at = twin(law).x_start
    start = GyrostatState(at[:4], at[4:7], FIELD["position"], FIELD["velocity"], momenta=at[7:])
    return Course(of, start, TIME).at(TIME)


@LAW
@pytest.mark.parametrize("gravity", [False, True], ids=["without gravity", "gravity"])
@pytest.mark.parametrize("propagator", ["dop853", "taylor"])
def test_a_flight_is_the_motion_known_to_thirty_digits(law, propagator, gravity):
    field = {"gravity": FIELD, "inputs.gravity": True} if gravity else {}
    raw = variant(GYROSTAT, {"rotation.law": law, "rotation.propagator": propagator} | field)
    instance, end = Instance(raw, optimised=False), known(law, gravity)
    assert instance.initialise(**dict(zip(twin().u_names, U_GIVEN, strict=True))) == OK, instance.log
    assert instance.step(TIME) == OK, instance.log
    for name, digits in (("attitude", end.attitude), ("angular_velocity", end.rates)):
        assert np.abs(instance.get(name) - np.array(digits, dtype=float)).max() <= FLIGHT
    for wheel, momentum in zip(WHEELS, end.momenta, strict=True):
        assert abs(instance.get(f"B.{wheel}.momentum") - float(momentum)) <= 64 * U * 30.0
    instance.free()


FLIGHT = 3e-13
"""Some 5 rad at a tolerance of 1e-14."""

TIME = 20.0
"""s"""

FIELD: dict[str, Any] = {"mu": 3.986e14, "position": [4e6, 5e6, 2e6], "velocity": [-5e3, 4e3, 3e3]}
"""The gradient turns the body by 4e-4 rad in that time."""


def test_free_motion_with_wheels_is_scipys():
    of, time = twin(), 10.0

    def rate(_: float, y: Array) -> Array:
        wheels = reference.Wheels(AXES, INERTIAS, of.x_start[7:], np.zeros(3))
        K = np.array(INERTIA) - wheels.inertia
        acceleration = reference.angular_acceleration("tensor", K, y[4:], np.zeros(3), wheels.momentum)
        return np.concatenate([reference.attitude_dot(y[:4], y[4:]), acceleration])

    done = solve_ivp(rate, (0.0, time), of.x_start[:7], "DOP853", rtol=3e-14, atol=1e-17)
    found = numbers(of.communication_step(store())(of.x_start, [0.0] * 5, [], time))
    assert np.abs(found[:7] - done.y[:, -1]).max() <= 1e-13


# Closed forms


def symmetric(momentum: float, inertia: float, **rotation: Any) -> Twin:
    """Returns the twin of a body of moments 6, 6, 9 kg m2 with a wheel on its axis."""
    wheel = {"axis": [0, 0, 2.0], "inertia": inertia, "momentum": momentum}
    raw = variant(
        body(3.0, (2.0, 2.0, 3.0), propagator="dop853", **rotation),
        {"vessels.B.wheels.w": wheel, "inputs.wheel": ["B.w"]},
    )
    return Twin(scene(raw))


def test_a_wheel_on_the_axis_of_a_symmetric_body_turns_the_transverse_rate():
    a, c, inertia, momentum, spin, time = 6.0, 9.0, 1.25, 4.0, 0.5, 12.0
    of = symmetric(momentum, inertia, angular_velocity=[0.1, 0.0, spin])
    states = of.rollout(600)(x=of.x_start, h=time / 600)["x_next"].full()
    angle = ((c - inertia - a) * spin + momentum) / a * time
    assert np.abs(states[4:7, -1] - [0.1 * np.cos(angle), 0.1 * np.sin(angle), spin]).max() <= 1e-13


def test_a_wheel_that_spins_up_and_down_turns_the_body_by_a_known_angle():
    c, inertia, torque, time = 9.0, 1.25, 0.3, 4.0
    of = symmetric(0.0, inertia)
    u = np.zeros((4, 80))
    u[3] = torque * np.where(np.arange(80) < 40, 1.0, -1.0)
    end = of.rollout(80)(x=of.x_start, u=u, h=time / 40)["x_next"].full()[:, -1]
    angle = -torque * time**2 / (c - inertia)
    assert np.abs(end - [np.cos(angle / 2), 0, 0, np.sin(angle / 2), 0, 0, 0, 0]).max() <= 1e-13


@pytest.mark.parametrize("of", [twin(), Twin(scene(CARRIER))], ids=["a body alone", "a carrier"])
def test_the_angular_momentum_stays_where_only_motors_act(of):
    u = [1.0 if name.count(".") == 2 else 0.0 for name in of.u_names]
    states = of.rollout(500)(x=of.x_start, u=u, h=0.01)["x_next"].full()
    before, after = (outputs(of, x, u, of.p_start)["angular_momentum"] for x in (of.x_start, states[:, -1]))
    assert np.abs(after - before).max() <= 1e-12 * np.abs(before).max()
    assert np.abs(states[4:7, -1] - of.x_start[4:7]).max() > 0.01  # rad/s


def test_energy_grows_by_the_work_of_torques_and_motors():
    # 1/2 w.(J - A) w + sum h^2/(2 I): M.w does work, and each motor u times its speed; one without inertia
    # -u b.w. Work is added up by the Gauss-Legendre rule of 6 nodes in each interval.
    of, h, count = twin(), 0.1, 60
    nodes, weights = np.polynomial.legendre.leggauss(6)

    def power(x: Array) -> float:
        y = outputs(of, x, U_GIVEN, [])
        store = -U_GIVEN[4] * float(AXES[2] @ x[4:7])
        return float(np.dot(TORQUE, x[4:7]) + U_GIVEN[3] * y["B.x.speed"][0] + store)

    def energy(x: Array) -> float:
        stored = x[7:9] ** 2 / (2.0 * INERTIAS[:2])
        return float(outputs(of, x, U_GIVEN, [])["kinetic_energy"][0] + stored.sum())

    x, work = of.x_start, 0.0
    for _ in range(count):
        at = [numbers(of.step(x, U_GIVEN, [], 0.5 * h * (1.0 + node))) for node in nodes]
        work += 0.5 * h * float(np.dot(weights, [power(y) for y in at]))
        x = numbers(of.step(x, U_GIVEN, [], h))
    assert abs(energy(x) - energy(of.x_start) - work) <= 1e-12 * energy(x)
    assert abs(work) > 1.0  # J


# Vessels that move and leave


def moving(of: Twin) -> tuple[Array, Array]:
    """Returns p with the arm in motion, and a state."""
    p = of.p_start.copy()
    for name, value in MOTION.items():
        p[of.p_names.index(name)] = value
    return p, of.x_start


def test_the_shares_of_vessels_add_up_to_the_angular_momentum_of_the_whole():
    of = Twin(scene(CARRIER))
    y = outputs(of, of.x_start, [0.0] * 5, moving(of)[0])
    size = np.abs(y["A.angular_momentum"]).max()
    assert (
        np.abs(y["A.angular_momentum"] + y["B.angular_momentum"] - y["angular_momentum"]).max()
        <= 64 * U * size
    )


def test_the_speed_of_a_wheel_is_relative_to_its_vessel():
    of = Twin(scene(CARRIER))
    p, x = moving(of)
    values = dict(zip(of.p_names, p, strict=True))
    there = reference.motions(of.scene, values)["B"]
    axis = there.rotation @ np.array([0.0, 1.0, 1.0]) / np.sqrt(2.0)
    y = outputs(of, x, [0.0] * 5, p)
    assert abs(y["B.y.speed"][0] - (3.0 / 1.0 - axis @ (x[4:7] + there.rate))) <= 64 * U * 3.0
    assert y["A.x.speed"][0] == 20.0 / 3.0 - x[4]


def test_a_wheel_of_a_vessel_that_has_left_keeps_its_momentum_and_has_no_effect():
    of, alone = (
        Twin(scene(CARRIER)),
        Twin(
            scene(
                variant(
                    CARRIER, {"vessels.B.wheels": None, "inputs.wheel": ["A.x"], "outputs.names": ["mass"]}
                )
            )
        ),
    )
    p = of.p_with({"dock.docked": 0.0})
    x_dot = numbers(of.ode(of.x_start, [0.1, 0.2, 0.3, 0.4, 0.5], p))
    assert x_dot[8:].tolist() == [0.0, 0.0]
    same = alone.ode(alone.x_start, [0.1, 0.2, 0.3, 0.4], alone.p_with({"dock.docked": 0.0}))
    assert x_dot[:8].tolist() == numbers(same).tolist()
    y = outputs(of, of.x_start, [0.0] * 5, p)
    assert [y["B.y.momentum"][0], y["B.y.speed"][0]] == [3.0, 0.0]


def test_rk4_is_as_fine_as_the_momentum_of_wheels_asks_for():
    # All but at rest, the body nutates as fast as its wheel makes it, not as fast as it turns.
    of = symmetric(400.0, 1.25, angular_velocity=[1e-6, 0.0, 0.0])
    longest = float(of.longest_step(of.x_start, [0.0] * 4, []))
    assert longest * 400.0 / 6.0 <= of.scene.rotation.max_angle_step
    pushed = float(of.longest_step(of.x_start * [1, 1, 1, 1, 1, 1, 1, 0], [0.0, 0, 0, 50.0], []))
    assert 50.0 * pushed / 6.0 * pushed <= of.scene.rotation.max_angle_step


@pytest.mark.parametrize("angle", [0.05, 1.0])
@pytest.mark.parametrize(
    ("law", "turn"), [("tensor", [[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1]]), ("principal", np.eye(3))]
)
def test_a_sub_step_of_rk4_turns_no_further_where_a_wheel_leaves_little_about_an_axis(angle, law, turn):
    # Less its wheel the body has moments that no rigid body has: its rate grows 80 times as fast by them.
    K, turn = np.diag([0.1, 12.0, 20.0]), np.array(turn)
    raw = variant(
        GYROSTAT,
        {
            "vessels.B.inertia": (turn @ (K + np.diag([9.9, 0.0, 0.0])) @ turn.T).tolist(),
            "vessels.B.wheels": {"x": {"axis": turn[:, 0].tolist(), "inertia": 9.9}},
            "inputs": {"wheel": ["B.x"]},
            "rotation": {"law": law, "propagator": "rk4", "max_angle_step": angle},
            "rotation.angular_velocity": (turn @ [-0.1, 0.1, 0.1]).tolist(),
            "outputs.names": ["attitude"],
        },
    )
    of = Twin(scene(raw))
    h = float(of.longest_step(of.x_start, [0.0], []))

    def rate(_: float, state: Array) -> Array:
        omega = state[:3]
        return np.append(np.linalg.solve(K, -np.cross(omega, K @ omega)), np.linalg.norm(omega))

    turned = solve_ivp(rate, (0.0, h), [-0.1, 0.1, 0.1, 0.0], rtol=1e-10, atol=1e-13).y[3, -1]
    assert 0.005 * angle <= turned <= angle


def test_principal_axes_are_those_of_the_tensor_without_wheels():
    K = np.array(INERTIA) - (AXES.T * INERTIAS) @ AXES
    moments, axes = (np.array(part) for part in twin().principal([]))
    assert np.abs(axes @ np.diag(moments.ravel()) @ axes.T - K).max() <= 64 * U * np.abs(K).max()
    J = outputs(twin(), twin().x_start, [0.0] * 5, [])["inertia"]
    assert J.tolist() == np.ravel(INERTIA).tolist()


# Motors that hold a spin


@LAW
def test_motors_hold_a_spin_in_orbit_by_the_least_torques(law):
    changes = {
        "rotation.law": law,
        "vessels.B.wheels.more": {"axis": [0, 1, 0]},
        "inputs.wheel": ["B.x", "B.tilted", "B.store", "B.more"],
    }
    of = Twin(scene(orbiting(changes, GYROSTAT)))
    u = numbers(of.trim_by_wheels(of.x_start, of.p_start))
    assert of.u_names[3:] == tuple(f"{wheel}.torque" for wheel in changes["inputs.wheel"])
    assert u[:3].tolist() == [0.0] * 3
    axes = np.vstack([AXES, [0.0, 1.0, 0.0]]).T
    least = -np.linalg.pinv(axes) @ numbers(of.trim(of.x_start, of.p_start))[:3]
    assert np.abs(u[3:] - least).max() <= 64 * U * np.abs(least).max()
    moved = numbers(of.ode(of.x_start, np.zeros(len(u)), of.p_start))[4:7]
    assert np.abs(numbers(of.ode(of.x_start, u, of.p_start))[4:7]).max() <= 64 * U * np.abs(moved).max()


@pytest.mark.parametrize("wheels", [["B.x", "B.store"], []])
def test_motors_that_cannot_hold_every_spin_are_refused(wheels):
    of = Twin(scene(variant(GYROSTAT, {"inputs.wheel": wheels, "inputs.torque": False})))
    with pytest.raises(ValueError, match='trim_by_wheels: scene "gyrostat" needs motors of wheels'):
        assert of.trim_by_wheels
    with pytest.raises(ValueError, match="under .inputs." + ("; .* take trim_by_wheels" if wheels else "$")):
        assert of.trim


def test_motors_in_one_plane_are_refused():
    in_a_plane = {"x": [1, 0, 0], "tilted": [0, 1, 0], "store": [1, 1, 0]}
    axes = {f"vessels.B.wheels.{name}.axis": axis for name, axis in in_a_plane.items()}
    of = Twin(scene(variant(GYROSTAT, axes | {"inputs.wheel": [f"B.{name}" for name in in_a_plane]})))
    with pytest.raises(ValueError, match="whose axes lie in no common plane"):
        assert of.trim_by_wheels
