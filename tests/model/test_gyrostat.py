"""Wheels and gravity's gradient: the truth of 30 digits and the numpy reference, against other ways."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from supervessel import Twin, reference
from supervessel.reference import Wheels
from support import ISS_DG, Array, U, random_rotation, scene, variant
from support.extrapolation import midpoint_rule
from support.gyrostat import Course, Gyrostat, GyrostatState
from support.numbers import cross, hamilton
from support.series import Vector, apply, flight, mp, norm

INERTIA = [[1000.0, 60.0, -40.0], [60.0, 2000.0, 50.0], [-40.0, 50.0, 2500.0]]  # kg m2
AXES = [[0.6, 0.0, 0.8], [0.0, 1.0, 0.0], [0.0, 0.28, -0.96]]
WHEELS = {"axes": AXES, "inertias": [2.5, 0.0, 4.0], "motors": [0.3, -0.2, 0.1]}  # kg m2, N m
TORQUE = (1.5, -3.0, 2.0)  # N m
MU = 3.986004415e14  # m3/s2
START = GyrostatState(
    attitude=(0.5, -0.1, 0.7, 0.3),
    rates=(0.02, -0.05, 0.04),  # rad/s
    position=(-4.3e6, 1.9e6, 5.1e6),  # m, perigee or apogee of nothing in particular
    velocity=(1.1e3, -8.5e3, 1.5e3),  # m/s
    momenta=(40.0, -25.0, 60.0),  # N m s
)
LAWS = ("decoupled", "principal", "tensor")

BODIES = {
    "gravity": Gyrostat(INERTIA, mu=MU),
    "gravity, wheels": Gyrostat(INERTIA, torque=TORQUE, mu=MU, **WHEELS),
    "gravity, wheels, principal": Gyrostat(INERTIA, law="principal", torque=TORQUE, mu=MU, **WHEELS),
    "gravity, wheels, decoupled": Gyrostat(INERTIA, law="decoupled", torque=TORQUE, mu=MU, **WHEELS),
}


def flat(state: GyrostatState) -> Vector:
    """Returns attitude, rates, position, velocity and momenta of wheels in one list."""
    return [
        mp.mpf(x)
        for part in (state.attitude, state.rates, state.position, state.velocity, state.momenta)
        for x in part
    ]


def unit_start() -> Vector:
    start = flat(START)
    return [x / norm(start[:4]) for x in start[:4]] + start[4:]


# The truth


def equations(body: Gyrostat, x: Vector) -> Vector:
    """Returns the rates of the truth's state in 60 digits, written without its recurrences."""
    J, K = body.tensors()
    q, w, r, v, h = x[:4], x[4:7], x[7:10], x[10:13], x[13:]
    conjugate = [q[0], -q[1], -q[2], -q[3]]
    direction = [y / norm(r) for y in hamilton(hamilton(conjugate, [mp.zero, *r]), q)[1:]]
    field = body.mu / norm(r) ** 3
    stored = [sum(a * mp.mpf(axis[i]) for a, axis in zip(h, body.axes, strict=True)) for i in range(3)]
    reaction = [
        sum(mp.mpf(u) * mp.mpf(b[i]) for u, b in zip(body.motors, body.axes, strict=True)) for i in range(3)
    ]
    gyroscopic = cross(w, [a + b for a, b in zip(apply(K, w), stored, strict=True)])
    gradient = cross(direction, apply(J, direction))
    torque = [
        mp.mpf(body.torque[i])
        + 3 * field * gradient[i]
        - reaction[i]
        - (body.law != "decoupled") * gyroscopic[i]
        for i in range(3)
    ]
    acceleration = list(mp.lu_solve(mp.matrix(K), mp.matrix(torque)))
    turn = [y / 2 for y in hamilton(q, [mp.zero, *w])]
    return [*turn, *acceleration, *v, *(-field * y for y in r), *map(mp.mpf, body.motors)]


@pytest.mark.parametrize("name", BODIES)
def test_the_truth_is_that_of_extrapolation(name: str) -> None:
    # The body turns by 0.6 rad; they differ by 6e-35 at most.
    body = BODIES[name]
    start = unit_start() if body.axes else unit_start()[:13]
    end = midpoint_rule(lambda x: equations(body, x), start, mp.mpf(8), parts=4, columns=10)
    own = Course(body, replace(START, momenta=START.momenta if body.axes else ()), 8).at(8)
    assert max(abs(a - b) / max(1, abs(b)) for a, b in zip(flat(own), end, strict=True)) <= 1e-32


@pytest.mark.parametrize("law", LAWS)
def test_the_truth_without_wheels_and_gravity_is_that_of_the_other_series(law: str) -> None:
    body, start = Gyrostat(INERTIA, law=law, torque=TORQUE), GyrostatState(START.attitude, START.rates)
    own = Course(body, start, 200).at(200)
    other = flight(law, INERTIA, unit_start()[:7], TORQUE, 200, digits=40)
    assert max(abs(a - b) for a, b in zip(flat(own)[:7], other, strict=True)) <= 1e-29


def test_the_orbit_is_keplers() -> None:
    # One revolution later the barycentre is where it was: a = 1/(2/|r| - v^2/mu), T = 2 pi sqrt(a^3/mu).
    r, v = unit_start()[7:10], unit_start()[10:13]
    axis = 1 / (2 / norm(r) - norm(v) ** 2 / MU)
    period = 2 * mp.pi * mp.sqrt(axis**3 / MU)
    sphere = Gyrostat(np.eye(3), mu=MU)
    end = Course(sphere, GyrostatState((1, 0, 0, 0), (0, 0, 0), r, v), period).at(period)
    assert norm([a - b for a, b in zip(end.position, r, strict=True)]) <= 1e-28 * norm(r)


# The reference


def snapshot(state: Array, motors: Any = WHEELS["motors"]) -> Wheels:
    """Returns the wheels of a state (attitude, rates, position, velocity, momenta)."""
    return Wheels(np.array(AXES), np.array(WHEELS["inertias"]), state[13:], np.array(motors))


def reference_ode(law: str, x: Array) -> Array:
    """Returns the rate of (attitude, rates, position, velocity, momenta), (16,), by the reference."""
    q, omega, r, v = x[:4], x[4:7], x[7:10], x[10:13]
    wheels, J = snapshot(x), np.array(INERTIA)
    gradient = reference.gravity_torque(reference.law_tensor(law, J), q, r, MU)
    acceleration = reference.angular_acceleration(
        law, J - wheels.inertia, omega, gradient + TORQUE + wheels.reaction, wheels.momentum
    )
    return np.concatenate(
        [reference.attitude_dot(q, omega), acceleration, reference.orbit_dot(r, v, MU), wheels.torques]
    )


@pytest.mark.parametrize("law", LAWS)
def test_rates_of_the_reference_are_those_of_the_truth(law: str) -> None:
    # Of all sums the longest, torque over the tensor, has some 30 roundings of terms as large as the largest.
    body = Gyrostat(INERTIA, law=law, torque=TORQUE, mu=MU, **WHEELS)
    own, exact = reference_ode(law, np.array(unit_start(), dtype=float)), equations(body, unit_start())
    for part in (slice(4), slice(4, 7), slice(7, 10), slice(10, 13), slice(13, 16)):
        scale = max(map(abs, exact[part]))
        assert max(abs(a - b) for a, b in zip(own[part], exact[part], strict=True)) <= 32 * U * scale


@pytest.mark.parametrize("law", LAWS)
def test_the_reference_integrated_by_scipy_flies_as_the_truth_does(law: str) -> None:
    # 200 s, some 14 rad: SciPy is off by 1.4e-13 at most.
    body = Gyrostat(INERTIA, law=law, torque=TORQUE, mu=MU, **WHEELS)
    start = np.array(unit_start(), dtype=float)
    scale = np.concatenate([np.ones(7), np.full(3, 7e6), np.full(3, 7e3), np.full(3, 60.0)])
    done = solve_ivp(
        lambda _, x: reference_ode(law, x),
        (0.0, 200.0),
        start,
        method="DOP853",
        rtol=1e-13,
        atol=1e-16 * scale,
    )
    exact = flat(Course(body, START, 200).at(200))
    assert max(abs(a - b) / s for a, b, s in zip(done.y[:, -1], exact, scale, strict=True)) <= 5e-13


def test_the_torque_of_the_gradient_is_what_newtons_law_adds_up_to() -> None:
    # The attraction of every point, about the barycentre. The third moments are left out: here they make
    # 6e-5, 10 m over 500 km and a factor.
    rng = np.random.default_rng(5)
    masses, points = rng.uniform(1.0, 5.0, 8), rng.normal(size=(8, 3)) * 5.0
    points -= masses @ points / masses.sum()
    second = (masses[:, None] * points).T @ points
    J = np.trace(second) * np.eye(3) - second
    R, r = random_rotation(5), np.array([3e5, -2e5, 3.5e5])
    places = r + points @ R.T
    pulls = -MU * places / np.linalg.norm(places, axis=1)[:, None] ** 3
    exact = R.T @ (masses @ np.cross(points @ R.T, pulls))
    torque = reference.gravity_torque(J, reference.quaternion(R), r, MU)
    assert np.abs(torque - exact).max() <= 1e-4 * np.abs(exact).max()
    assert np.abs(torque).max() > 1e-3  # N m


@pytest.mark.parametrize("law", LAWS)
def test_rates_of_a_docked_scene_in_orbit_are_the_twins(law: str) -> None:
    # The composite is good to 64 U of its largest moment, moments differ by a factor below 2.
    gravity = {"mu": MU, "position": [-4.3e6, 1.9e6, 5.1e6], "velocity": [1.1e3, -7.5e3, 1.5e3]}
    raw = variant(ISS_DG, {"gravity": gravity, "inputs.gravity": True, "rotation.law": law})
    flown = scene(raw)
    twin, values = Twin(flown), {"DG.mass": 12e3, "gravity.position[1]": -5.2e6}
    x = np.array([0.5, -0.1, 0.7, 0.5, 1e-3, -2e-3, 5e-4])
    p = list((dict(zip(twin.p_names, twin.p_start, strict=True)) | values).values())
    own, other = reference.ode(flown, x, None, values), np.array(twin.ode(x, np.zeros(3), p)).ravel()
    assert np.abs(own[4:] - other[4:]).max() <= 256 * U * np.abs(other[4:]).max()
    assert np.abs(own - reference.ode(flown, x, np.zeros(3), values)).max() > 1e-7


def test_a_wheel_on_the_axis_of_a_symmetric_body_changes_the_rate_of_precession() -> None:
    # Moments a, a, c: the transverse rate turns at ((c - I_w - a) omega_z + h_w)/a.
    a, c, wheel, momentum, time = 2.0, 1.2, 0.05, 3.0, 40
    body = Gyrostat(np.diag([a, a, c]), axes=[[0, 0, 1]], inertias=[wheel], motors=[0])
    rates = [mp.mpf(x) for x in (0.3, 0.7, 0.5)]
    end = Course(body, GyrostatState((1, 0, 0, 0), rates, momenta=[momentum]), time).at(time)
    angle = ((mp.mpf(c) - mp.mpf(wheel) - mp.mpf(a)) * rates[2] + momentum) / mp.mpf(a) * time
    x, y = (
        mp.cos(angle) * rates[0] - mp.sin(angle) * rates[1],
        mp.sin(angle) * rates[0] + mp.cos(angle) * rates[1],
    )
    assert max(abs(p - q) for p, q in zip(end.rates, (x, y, rates[2]), strict=True)) <= 1e-28


@cache
def moving() -> tuple[Array, Array, Wheels]:
    """Returns a state, its acceleration by the reference, and its wheels, none of inertia 0."""
    x = np.array(unit_start(), dtype=float)
    wheels = Wheels(np.array(AXES), np.array([2.5, 0.1, 4.0]), x[13:], np.array(WHEELS["motors"]))
    acceleration = reference.angular_acceleration(
        "tensor", INERTIA - wheels.inertia, x[4:7], wheels.reaction + TORQUE, wheels.momentum
    )
    return x, acceleration, wheels


def test_energy_grows_by_the_work_of_torque_and_motors() -> None:
    # E = 1/2 omega.(J - A) omega + sum h_w^2/(2 I_w), E' = M.omega + sum u Omega; sums of some 30 roundings.
    x, acceleration, wheels = moving()
    growth = x[4:7] @ (INERTIA - wheels.inertia) @ acceleration + wheels.torques @ (
        wheels.momenta / wheels.inertias
    )
    work = np.dot(TORQUE, x[4:7]) + wheels.torques @ wheels.speeds(x[4:7])
    assert abs(growth - work) <= 64 * U * np.abs(wheels.torques * wheels.momenta / wheels.inertias).sum()


def test_momentum_with_that_of_wheels_changes_by_the_torque_from_outside_alone() -> None:
    # L' + omega x L = M in body axes, the motors only move momentum.
    x, acceleration, wheels = moving()
    momentum = (INERTIA - wheels.inertia) @ x[4:7] + wheels.momentum
    change = (
        (INERTIA - wheels.inertia) @ acceleration + wheels.torques @ wheels.axes + np.cross(x[4:7], momentum)
    )
    assert np.abs(change - TORQUE).max() <= 64 * U * np.abs(momentum).max()


def test_a_wheel_of_no_inertia_has_no_speed() -> None:
    speeds = snapshot(np.array(unit_start(), dtype=float)).speeds([0.0, 0.0, 0.0])
    assert np.isnan(speeds).tolist() == [False, True, False]
    assert speeds[0] == 40.0 / 2.5
