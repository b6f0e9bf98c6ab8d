"""The equations of jet damping: momentum that mass takes along, closed forms, SciPy, convergence."""

from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jets.scenes import FLOWS, MASS, STACK, rocket
from supervessel import Twin, reference
from support import OK, Array, Instance, U, scene, store, variant
from support.orbits import orbiting

LAW = pytest.mark.parametrize("law", ["decoupled", "principal", "tensor"])
ACTING = {"torque[1]": 3.0, "torque[3]": -2.0, "T.main.force[2]": 1.5, FLOWS[0]: 20.0, FLOWS[1]: 4.0}


@cache
def twin(law: str = "tensor", propagator: str = "dop853") -> Twin:
    return Twin(scene(variant(STACK, {"rotation.law": law, "rotation.propagator": propagator})))


def numbers(value: Any) -> Array:
    return np.array(value).ravel()


def u_of(of: Twin, values: dict[str, float]) -> Array:
    return np.array([values.get(name, 0.0) for name in of.u_names])


def off(d: Array) -> Array:
    return d @ d * np.eye(3) - np.outer(d, d)


# Against other equations


@LAW
def test_the_rate_of_the_state_is_the_references(law):
    of, x = twin(law), twin().x_start
    found = numbers(of.ode(x, u_of(of, ACTING), of.p_start))
    expected = reference.ode(of.scene, x, values=ACTING)
    assert np.abs(found - expected).max() <= 512 * U * np.abs(expected).max()
    still = numbers(of.ode(x, u_of(of, ACTING | dict.fromkeys(FLOWS, 0.0)), of.p_start))
    assert np.abs(found - still).max() >= 1e-3 * np.abs(expected).max()


def test_what_acts_is_what_the_loss_of_mass_and_the_exhaust_take_along():
    # J w' = -w x J w - (dJ/dt) w - f off(r) w, dJ/dt = -(sum of f) dJ/dm: the tensor's own derivative.
    of, omega = twin(), twin().x_start[4:7]
    J = of.composite(p=of.p)["inertia"]
    by_mass = ca.Function("by_mass", [of.p], [ca.jacobian(ca.vec(J), of.p[of.p_names.index(MASS)])])
    slope = numbers(by_mass(of.p_start)).reshape(3, 3)
    where, whole = reference.motions(of.scene)["T"], reference.composite(of.scene)
    flows = {point: ACTING[f"T.{point}.flow"] for point in ("main", "side")}
    lost = -sum(flows.values()) * slope @ omega
    for point, flow in flows.items():
        r = where.carry(np.array(of.scene.point(f"T.{point}").position))[0] - whole.barycentre
        lost = lost + flow * off(r) @ omega
    acting = {name: value for name, value in ACTING.items() if name in FLOWS}
    found = numbers(of.ode(of.x_start, u_of(of, acting), of.p_start))[4:7]
    expected = np.linalg.solve(whole.inertia, -np.cross(omega, whole.inertia @ omega) - lost)
    assert np.abs(found - expected).max() <= 512 * U * np.abs(expected).max()


def test_a_stage_that_has_left_damps_nothing():
    of = twin()
    gone = of.p_with({"joint.docked": 0.0})
    u, none = (u_of(of, ACTING | dict.fromkeys(FLOWS, flow)) for flow in (9.0, 0.0))
    assert numbers(of.ode(of.x_start, u, gone)).tolist() == numbers(of.ode(of.x_start, none, gone)).tolist()


def test_a_far_stage_loses_no_digits():
    # off(r) and off(rho) are 1e12 m2 each, and their difference is exact
    far = 2.0**20
    raw = rocket((2.0, 2.0, 3.0), 4.0)
    raw["vessels"]["A"] = {
        "mass": 100.0,
        "pmi": [1.0, 1.0, 1.0],
        "ports": {"p": {"position": [far, 0, 0], "direction": [1, 0, 0], "alignment": [0, 0, 1]}},
    }
    raw["vessels"]["B"]["ports"] = {
        "q": {"position": [-far, 0, 0], "direction": [-1, 0, 0], "alignment": [0, 0, 1]}
    }
    of = Twin(scene(variant(raw, {"root": "A", "docks": [{"ports": ["A.p", "B.q"]}]})))
    jets = of._model.slices.composite["jets"]
    K = numbers(of._model.composite(of.p_start))[jets]
    # e = (0, 0, -4), rho = (2^20, 0, 0): -(e s^T + s e^T)/2 has e_z rho_x across, and e . s = 16
    assert K.tolist() == [14.0, 14.0, -3.0, 0.0, 4.0 * far, 0.0]


# Closed forms


@pytest.mark.parametrize("propagator", ["rk4", "dop853", "taylor"])
def test_the_transverse_rate_of_a_symmetric_rocket_decays_while_it_turns(propagator):
    # Held mass: w_z = w_0 exp(-b t), b = -f S_z/J_z < 0, and the transverse rate exp(-a t) as long,
    # a = f (L^2 - S_t)/J_t, turned by the angle (J_z/J_t - 1) times the integral of w_z.
    S, L, flow, spin, time, steps = (2.0, 2.0, 3.0), 4.0, 0.25, 0.4, 40.0, 80
    raw = rocket(
        S, L, propagator=propagator, angular_velocity=[0.1, 0.0, spin], tolerance=1e-13, max_angle_step=0.01
    )
    of = Twin(scene(raw))
    a, b = flow * (L**2 - S[0]) / (100.0 * S[0]), -flow / 100.0
    angle = (S[2] / S[0] - 1.0) * spin * (1.0 - np.exp(-b * time)) / b
    expected = [
        *(0.1 * np.exp(-a * time) * np.array([np.cos(angle), np.sin(angle)])),
        spin * np.exp(-b * time),
    ]
    x = of.x_start
    fly = of.communication_step(store())
    for _ in range(steps):
        x = numbers(fly(x, [flow], of.p_start, time / steps))
    assert np.exp(-a * time) < 0.51
    assert np.abs(x[4:7] - expected).max() <= (1e-9 if propagator == "rk4" else 1e-12)


def test_a_cylinder_that_burns_evenly_keeps_its_spin_and_loses_its_coning_as_published():
    # Radius R, length 2 h, exhaust over its whole end: four points at R/sqrt(2) have the disc's mean square.
    # The spin stays, the transverse rate goes with (m/m_0)^(2 h^2/(3 k^2)), k^2 = R^2/4 + h^2/3, [NJ] (42)
    R, h, flow, spin, time = 1.0, 1.5, 2.0, 0.6, 30.0
    k_square = R**2 / 4.0 + h**2 / 3.0
    raw = rocket(
        (k_square, k_square, R**2 / 2.0), 0.0, angular_velocity=[0.2, 0.0, spin], propagator="dop853"
    )
    away = R / np.sqrt(2.0)
    places = {"a": (away, 0.0), "b": (0.0, away), "c": (-away, 0.0), "d": (0.0, -away)}
    raw["vessels"]["B"]["points"] = {name: {"position": [x, y, -h]} for name, (x, y) in places.items()}
    raw["inputs"]["flow"] = [f"B.{name}" for name in places]
    of = Twin(scene(raw))

    def rate(now: float, x: Array) -> Array:
        return numbers(of.ode(x, [flow / 4.0] * 4, [100.0 - flow * now]))

    end = solve_ivp(rate, (0.0, time), of.x_start, "DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
    left = (100.0 - flow * time) / 100.0
    coning = 0.2 * left ** (2.0 * h**2 / (3.0 * k_square))
    assert abs(end[6] - spin) <= 1e-13
    assert abs(np.hypot(end[4], end[5]) - coning) <= 1e-12


@cache
def varying() -> Array:
    """Returns the end of SciPy's flight of a stack whose mass falls: J w' = -w x J w - J' w - f off(r) w."""
    of, flow, mass = twin(), sum(DRAIN.values()), twin().p_start[0]

    where, payload = reference.motions(of.scene)["T"], of.scene.vessels["P"]
    S = where.rotation @ np.diag(STACK["vessels"]["T"]["pmi"]) @ where.rotation.T
    one = np.array(payload.centre_of_mass)
    apart = where.carry(np.array(of.scene.vessels["T"].centre_of_mass))[0] - one
    nozzles = {name: where.carry(np.array(of.scene.point(name[:-5]).position))[0] for name in FLOWS}

    def rate(time: float, x: Array) -> Array:
        # of two bodies J = J_P + m S + (M m/(M + m)) off(d), d from one centre to the other
        m, M, omega = mass - flow * time, payload.mass, x[4:]
        J = np.array(payload.inertia) + m * S + M * m / (M + m) * off(apart)
        slope = -flow * (S + (M / (M + m)) ** 2 * off(apart))
        barycentre = one + m / (M + m) * apart
        own = sum(DRAIN[name] * off(nozzle - barycentre) for name, nozzle in nozzles.items())
        turning = np.linalg.solve(J, -np.cross(omega, J @ omega) - (slope + own) @ omega)
        return np.concatenate([reference.attitude_dot(x[:4], omega), turning])

    done = solve_ivp(rate, (0.0, BURN), of.x_start, "DOP853", rtol=1e-13, atol=1e-15)
    return np.array(done.y[:, -1])


BURN, DRAIN = 32.0, {FLOWS[0]: 15.0, FLOWS[1]: 5.0}
"""s; kg/s: 640 of 1000 kg go."""


def flown(steps: int, share: float) -> Array:
    """Returns the end of the same burn in steps with the mass held as it is after that share of each."""
    of, h = twin(), BURN / steps
    times = h * (np.arange(steps) + share)
    p = np.tile(of.p_start[:, None], steps)
    p[of.p_names.index(MASS)] -= sum(DRAIN.values()) * times
    u = np.tile(u_of(of, DRAIN)[:, None], steps)
    h = min(h, 1.0)
    return numbers(of.step.mapaccum(steps)(of.x_start, u, p, h)[:, -1])


@pytest.mark.parametrize(
    ("share", "order"), [(0.0, 1), (0.5, 2)], ids=["mass at the start", "mass in the middle"]
)
def test_steps_that_hold_the_mass_converge_to_the_burn(share, order):
    errors = [np.abs(flown(steps, share) - varying()).max() for steps in (64, 128, 256)]
    ratios = np.array(errors[:-1]) / errors[1:]
    assert np.abs(ratios / 2.0**order - 1.0).max() <= 0.1
    assert errors[-1] <= (1e-3 if order == 1 else 1e-6)


def test_a_burn_in_model_exchange_is_scipys():
    of, instance, mass = twin(), Instance(STACK, exchange=True), twin().p_start[0]
    assert instance.initialise(**DRAIN) == OK, instance.log
    assert instance.run() == OK
    states = [f"state.attitude[{i}]" for i in range(1, 5)] + [
        f"state.angular_velocity[{i}]" for i in (1, 2, 3)
    ]

    def rate(time: float, x: Array) -> Array:
        values = dict(zip(states, x.tolist(), strict=True)) | {MASS: mass - sum(DRAIN.values()) * time}
        assert instance.set(values) == OK, instance.log
        return np.array([instance.get(f"der({name})") for name in states])

    done = solve_ivp(rate, (0.0, BURN), of.x_start, "DOP853", rtol=1e-13, atol=1e-15)
    assert np.abs(done.y[:, -1] - varying()).max() <= 1e-12
    instance.free()


def test_a_propagator_of_any_kind_flies_with_wheels_and_gravity_too():
    # Taylor's recurrences in C, by their own axes, against Runge-Kutta's stages, to the tolerance
    more = {
        "vessels.P.wheels.w": {"axis": [1, 2, -1], "inertia": 8.0, "momentum": 60.0},
        "inputs.wheel": ["P.w"],
    }
    ends = []
    for propagator, law in (
        ("dop853", "tensor"),
        ("taylor", "tensor"),
        ("dop853", "decoupled"),
        ("taylor", "decoupled"),
    ):
        raw = orbiting(more | {"rotation.propagator": propagator, "rotation.law": law}, STACK)
        of = Twin(scene(raw))
        u = u_of(of, ACTING | {"P.w.torque": 0.7})
        ends.append(numbers(of.communication_step(store())(of.x_start, u, of.p_start, 20.0)))
    for one, other in (ends[:2], ends[2:]):
        assert np.abs(one[:7] - other[:7]).max() <= 1e-12
    assert np.abs(ends[0] - ends[2]).max() > 1e-3


# Sub-steps


def test_rk4_is_as_fine_as_the_damping_asks_for():
    of = Twin(scene(rocket((2.0, 2.0, 3.0), 40.0, propagator="rk4", angular_velocity=[1e-9, 0.0, 0.0])))
    damped = 1000.0 * (40.0**2 - 2.0) / 200.0  # 1/s
    longest = float(of.longest_step(of.x_start, [1000.0], of.p_start))
    assert 0.3 * of.scene.rotation.max_angle_step <= longest * damped <= of.scene.rotation.max_angle_step
    x = numbers(of.communication_step(store())(of.x_start, [1000.0], of.p_start, 0.01))
    assert np.abs(x[4:7] - [1e-9 * np.exp(-damped * 0.01), 0.0, 0.0]).max() <= 1e-15


@pytest.mark.parametrize("angle", [0.05, 1.0])
def test_a_sub_step_of_rk4_turns_no_further_where_the_jet_drives_the_rate(angle):
    # A nozzle at the centre of mass takes nothing along: the rate grows as mass is lost.
    raw = rocket(
        (2.0, 2.0, 3.0), 0.0, propagator="rk4", angular_velocity=[0.1, 0.0, 0.0], max_angle_step=angle
    )
    of, growth = Twin(scene(raw)), 30.0 / 100.0
    h = float(of.longest_step(of.x_start, [30.0], of.p_start))
    turned = 0.1 * (np.exp(growth * h) - 1.0) / growth
    assert 0.01 * angle <= turned <= angle


@pytest.mark.parametrize("propagator", ["dop853", "taylor"])
def test_a_rate_that_decays_eight_hundred_times_in_a_step_stays_stable(propagator):
    raw = rocket((2.0, 2.0, 3.0), 40.0, propagator=propagator, angular_velocity=[1e-6, 2e-6, 0.0])
    of = Twin(scene(raw))
    x = numbers(of.communication_step(store())(of.x_start, [1e3], of.p_start, 0.1))
    assert np.linalg.norm(x[4:7]) <= 1e-12
