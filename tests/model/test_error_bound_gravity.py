"""The bound of what a law is off by in a field of gravity: never exceeded, against SciPy and 30 digits."""

from collections.abc import Callable
from functools import cache

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from model.test_error_bound import (
    angle_between,
    called,
    energy_norm,
    longest_path,
    random_tensor,
    six_of,
)
from supervessel import reference
from supervessel.composite.inertia import from_upper_triangle
from supervessel.orbit import two_body
from supervessel.rotation.attitude import attitude_dot
from supervessel.rotation.error_bound.carried import TurnedBody, largest_residual, motion_bounds
from supervessel.rotation.error_bound.centre_motion import centre_motion, place_after
from supervessel.rotation.error_bound.constants import bound_constants
from supervessel.rotation.error_bound.functions import bound_after_step
from supervessel.rotation.error_bound.remainder import (
    GUESSES,
    ORBIT_DEPTH,
    place_error,
    remainder_of,
    step_error,
)
from supervessel.rotation.gravity import Field
from supervessel.rotation.laws import LAWS
from supervessel.rotation.propagators import dop853
from supervessel.rotation.propagators.method import StepSymbols
from supervessel.rotation.propagators.rk4 import rk4_step
from supervessel.rotation.propagators.taylor import taylor_step

Array = NDArray[np.float64]

ORDER = 12
TRUTH = 1e-9  # of SciPy at rtol 1e-12 over turns of some radians, which grow an error by exp(3) at most


@cache
def flown_function(law: str, method: str) -> ca.Function:
    """Returns x and place, bound, J, M, step -> those a step later, bound_next, what the step adds, place's.

    bound : (3,), angle, energy norm, error of the place; the last one's end is the last result
    mu is 1: a circular orbit of radius 1 has the rate 1.
    """
    rules = LAWS[law]
    x, bound, six, M, h = (ca.SX.sym(*s) for s in (("x", 13), ("b", 3), ("J", 6), ("M", 3), ("h",)))
    J = from_upper_triangle(six)
    numbers, field = rules.prepare(J), Field(1.0, rules.keeping(J), x[7:])

    def rate(state: ca.SX) -> ca.SX:
        torque = M + field.torque(state[:4], state[7:10])
        turning = rules.acceleration(numbers, state[4:7], torque)
        return ca.vertcat(attitude_dot(state[:4], state[4:7]), turning, field.rate(state[7:]))

    motion = StepSymbols(x, rate, rules, numbers, M, h, 1e-9, True, field)
    stepped: dict[str, Callable[[], ca.SX]] = {
        "rk4": lambda: rk4_step(rate, x, h),
        "dop853": lambda: dop853.dop853_step(rate, x, h)[0],
        "taylor": lambda: taylor_step(motion, ORDER)[0],
    }
    body = TurnedBody(J, M, ca.SX.zeros(3), field)
    constants = bound_constants(rules, numbers, J, None, field)
    found = bound_after_step(constants, body, x[:7], h, bound)
    remainder = remainder_of(method, ORDER, in_orbit=True)
    off = step_error(remainder, constants, body, found.motion)
    centre = found.motion.centre
    assert centre is not None
    place = place_after(centre, found.place, place_error(remainder, found.motion, None))
    results = [stepped[method](), found.bound + off, off, place]
    return ca.Function("flown", [x, bound, six, M, h], results)


def rate_of(law: str, J: Array, torque: Array, mu: float = 1.0) -> Callable[[float, Array], Array]:
    """Returns the rate of x and place, (13,), under a law, by numpy."""
    kept = J if law == "tensor" else np.diag(np.diag(J))

    def rate(t: float, state: Array) -> Array:
        q, w, r, v = state[:4], state[4:7], state[7:10], state[10:]
        d = np.linalg.norm(r)
        n = reference.rotation_matrix(q / np.linalg.norm(q)).T @ r / d
        acting = torque + 3.0 * mu / d**3 * np.cross(n, kept @ n)
        turning = reference.angular_acceleration(law, J, w, acting)
        return np.concatenate([reference.attitude_dot(q, w), turning, v, -mu / d**3 * r])

    return rate


def followed(law: str, J: Array, x: Array, torque: Array, span: float) -> Array:
    """Returns x and place after a span, (13,), by SciPy."""
    rate = rate_of(law, J, torque)
    found = solve_ivp(rate, (0.0, span), x, "DOP853", rtol=1e-12, atol=1e-13)
    return np.asarray(found.y[:, -1])


@cache
def suprema_function(law: str) -> ca.Function:
    """Returns x and place, J, M, step -> largest residual, reach, fastest and away."""
    rules = LAWS[law]
    x, six, M, h = (ca.SX.sym(*s) for s in (("x", 13), ("J", 6), ("M", 3), ("h",)))
    J = from_upper_triangle(six)
    field, numbers = Field(1.0, rules.keeping(J), x[7:]), rules.prepare(J)
    constants = bound_constants(rules, numbers, J, None, field)
    body = TurnedBody(J, M, ca.SX.zeros(3), field)
    motion = motion_bounds(constants, body, x[4:7], h, centre_motion(field, x[:4], h))
    results = [largest_residual(constants, body, motion), motion.reach, motion.fastest, motion.away]
    return ca.Function("suprema", [x, six, M, h], results)


@pytest.mark.parametrize("span", [0.02, 0.3])
@pytest.mark.parametrize("law", ["decoupled", "principal", "tensor"])
def test_suprema_hold_at_every_moment_of_a_step(law: str, span: float) -> None:
    """[EB] eqs. (44) to (46), (51) to (53): samples of the law's motion, half of them from rest."""
    random = np.random.default_rng(11)
    tight = 0.0
    for number in range(12):
        J = random_tensor(random, "general")
        w = random.normal(size=3) * (number % 2)
        x = np.array([*random.normal(size=4), *w, *random_orbit(random)])
        x[:4] /= np.linalg.norm(x[:4])
        torque = J @ (0.3 * random.normal(size=3)) * (number % 3 == 0)
        bounds = np.ravel(called(suprema_function(law), x, six_of(J), torque, span))
        times, inverse = np.linspace(0.0, span, 12), np.linalg.inv(np.linalg.cholesky(J))
        rate, true = rate_of(law, J, torque), rate_of("tensor", J, torque)
        flown = solve_ivp(rate, (0.0, span), x, "DOP853", times, rtol=1e-11, atol=1e-12).y.T
        for each in flown:
            a = rate(0.0, each)[4:7]
            unbalanced = J @ (a - true(0.0, each)[4:7])
            found = [np.linalg.norm(v) for v in (inverse @ unbalanced, each[4:7], a, each[4:7] - x[4:7])]
            if law == "tensor":
                found[0] = 0.0
            assert np.all(np.array(found) <= bounds + 1e-8)
            tight = max(tight, found[3] / bounds[3])
    print(law, span, tight)
    assert tight > 0.3


def test_a_place_that_is_off_is_followed() -> None:
    """[EB] eq. (54): under the law "tensor", whose only error comes from a place that is not the true one."""
    random, share = np.random.default_rng(12), 0.0
    for _ in range(12):
        J = random_tensor(random, "general")
        true = np.array([1.0, 0.0, 0.0, 0.0, *(0.5 * random.normal(size=3)), *random_orbit(random)])
        x = true.copy()
        d = np.linalg.norm(x[7:10])
        size = 10.0 ** random.uniform(-6.0, -3.0)
        aside = random.normal(size=6)
        x[7:] += size * aside * np.repeat([d, d**-0.5], 3)
        d = np.linalg.norm(x[7:10])
        off = x[7:] - true[7:]
        bound = np.array([0.0, 0.0, max(np.linalg.norm(off[:3]) / d, np.linalg.norm(off[3:]) * d**0.5)])
        for _ in range(30):
            x, found, _, place = called(
                flown_function("tensor", "rk4"), x, bound, six_of(J), np.zeros(3), 0.01
            )
            bound = np.append(found, place)
        right = followed("tensor", J, true, np.zeros(3), 0.3)
        d = np.linalg.norm(x[7:10])
        off = x[7:] - right[7:]
        error = max(np.linalg.norm(off[:3]) / d, np.linalg.norm(off[3:]) * d**0.5)
        angle, energy = angle_between(x[:4], right[:4]), energy_norm(J, x[4:7] - right[4:7])
        assert error <= bound[2]
        assert angle <= bound[0]
        assert energy <= bound[1]
        share = max(share, energy / bound[1], error / bound[2])
    assert share > 0.1


@pytest.mark.parametrize("law", ["principal", "tensor"])
@pytest.mark.parametrize(("method", "size"), [("rk4", 0.02), ("taylor", 0.01), ("dop853", 0.0003)])
def test_remainder_is_never_exceeded_by_a_step(law: str, method: str, size: float) -> None:
    """[EB] eqs. (47) to (49): one step of the library's own, against the law's motion by SciPy."""
    random = np.random.default_rng(8)
    within, largest = 0, 0.0
    for _ in range(12):
        J = random_tensor(random, "general")
        x = np.array([*random.normal(size=4), *random.normal(size=3), *random_orbit(random)])
        x[:4] /= np.linalg.norm(x[:4])
        end, _, parts, _ = called(flown_function(law, method), x, np.zeros(3), six_of(J), np.zeros(3), size)
        right = followed(law, J, x, np.zeros(3), size)
        angle, rate = angle_between(end[:4], right[:4]), energy_norm(J, end[4:7] - right[4:7])
        within += bool(np.isfinite(parts[0]))
        assert angle <= parts[0] + 1e-11
        assert rate <= parts[1] + 1e-11
        largest = max(largest, angle / parts[0], rate / parts[1]) if angle > 1e-11 else largest
    print(law, method, size, within, largest)
    assert within >= 9


def test_the_centre_stays_where_it_may_be() -> None:
    """[EB] eqs. (51) to (53), against two-body motion in closed form; some steps are too long to be known."""
    r, h = ca.SX.sym("r", 6), ca.SX.sym("h")
    centre = centre_motion(Field(1.0, ca.SX.eye(3), r), ca.SX([1, 0, 0, 0]), h)
    results = [centre.known, centre.strength, centre.strongest, centre.change, centre.turn, centre.nearest]
    function = ca.Function("centre", [r, h], [*results, centre.scaled])
    random, known, tightest = np.random.default_rng(5), 0, 0.0
    for _ in range(200):
        start, span = random_orbit(random), 10.0 ** random.uniform(-3.0, 0.0)
        told, at_start, strongest, change, turn, nearest, scaled = np.ravel(called(function, start, span))
        known += bool(told)
        if not told:
            continue
        places, _ = two_body(start[:3], start[3:], 1.0, np.linspace(0.0, span, 33))
        distance = np.linalg.norm(places, axis=1)
        sigma, first = 3.0 / distance**3, np.linalg.norm(start[:3])
        along = np.clip(places @ start[:3] / (distance * first), -1.0, 1.0)
        assert at_start == pytest.approx(sigma[0], rel=1e-14)
        assert sigma.max() <= strongest * (1 + 1e-13)
        assert np.abs(sigma - sigma[0]).max() <= change + 1e-12
        assert np.arccos(along).max() <= turn + 1e-7
        assert distance.min() / first >= nearest * (1 - 1e-13)
        assert max((distance / first).max(), (first / distance).max()) <= scaled * (1 + 1e-13)
        tightest = max(tightest, np.abs(sigma - sigma[0]).max() / change)
    assert 100 < known < 200
    assert tightest > 0.9


def test_errors_of_the_place_are_within_what_is_guessed() -> None:
    """[EB] eq. (55), which is measured: one step of each method about the centre, from fall to escape."""
    r, h = ca.SX.sym("r", 6), ca.SX.sym("h")
    field = Field(1.0, ca.SX.eye(3), r)
    ends = [rk4_end(field.rate, r, h), dop853.runge_kutta_end(field.rate, r, h)]
    function = ca.Function("moved", [r, h], ends)
    random, largest = np.random.default_rng(6), np.zeros(2)
    for _ in range(300):
        start, angle = random_orbit(random), random.uniform(0.1, 0.5)
        speed, d = np.linalg.norm(start[3:]), np.linalg.norm(start[:3])
        span = angle / max(speed / d, d**-1.5)
        if max(-start[:3] @ start[3:], 0.0) * span / d**2 + 2.0 * span**2 / d**3 > 0.5:
            continue
        position, velocity = (x[0] for x in two_body(start[:3], start[3:], 1.0, np.array([span])))
        d = np.linalg.norm(position)
        for k, (end, order) in enumerate(zip(called(function, start, span), (4, 8), strict=True)):
            off = max(np.linalg.norm(end[:3] - position) / d, np.linalg.norm(end[3:] - velocity) * d**0.5)
            largest[k] = max(largest[k], (off - 1e-14) / (GUESSES[order] * angle ** (order + 1)))
    print(largest)
    assert largest.max() <= 1.0
    assert largest.min() > 0.1


def rk4_end(ode: Callable[[ca.SX], ca.SX], state: ca.SX, step: ca.SX) -> ca.SX:
    """Returns place and velocity, (6,), a step of rk4 later; the quaternion before them rests."""
    whole = ca.vertcat(1.0, 0.0, 0.0, 0.0, state)
    return rk4_step(lambda x: ca.vertcat(ca.SX.zeros(4), ode(x[4:])), whole, step)[4:]


@pytest.mark.parametrize("method", ["rk4", "dop853", "taylor"])
def test_roundings_that_follow_on_each_other_are_fewer_than_allowed(method: str) -> None:
    """[EB] eq. (28): the longest path through a step's operations in a field of gravity."""
    x, six, M, h = (ca.SX.sym(*s) for s in (("x", 13), ("J", 6), ("M", 3), ("h",)))
    end = flown_function("tensor", method).call([x, ca.SX.zeros(3), six, M, h])[0]
    deepest = longest_path(ca.Function("step", [x, six, M, h], [end]))
    print(method, deepest)
    assert 3 * deepest <= ORBIT_DEPTH


def random_orbit(random: np.random.Generator) -> Array:
    """Returns a place, (6,), on an orbit about a centre of mu = 1, between circular and unbound."""
    r, v = random.normal(size=(2, 3))
    r = r / np.linalg.norm(r) * random.uniform(0.8, 1.25)
    return np.concatenate([r, v / np.linalg.norm(v) * random.uniform(0.2, 1.5) / np.sqrt(np.linalg.norm(r))])


@pytest.mark.parametrize("law", ["decoupled", "principal", "tensor"])
def test_bound_is_never_exceeded_along_random_flights(law: str) -> None:
    """[EB] eqs. (43) to (54), against DOP853; every second body starts with an error that is not zero."""
    random = np.random.default_rng(18)
    ratios = []
    for number in range(15):
        J = random_tensor(random, ("general", "symmetric", "general")[number % 3])
        true = np.array([*random.normal(size=4), *(random.uniform(0.0, 2.0) * random.normal(size=3))])
        true[:4] /= np.linalg.norm(true[:4])
        true = np.concatenate([true, random_orbit(random)])
        x = true.copy()
        if number % 2:
            x[:4] += 0.02 * random.normal(size=4)
            x[:4] /= np.linalg.norm(x[:4])
            x[4:7] += 0.02 * random.normal(size=3)
        bound = np.array([angle_between(x[:4], true[:4]), energy_norm(J, x[4:7] - true[4:7]), 0.0])
        torque = J @ (0.1 * random.normal(size=3) * (number % 3 == 0))
        for _ in range(4):
            for _ in range(20):
                x, bound, *_ = called(flown_function(law, "rk4"), x, bound, six_of(J), torque, 0.01)
                bound = np.append(bound, 0.0)
            true = followed("tensor", J, true, torque, 0.2)
            angle, energy = angle_between(x[:4], true[:4]), energy_norm(J, x[4:7] - true[4:7])
            assert angle <= bound[0] + TRUTH
            assert energy <= bound[1] + TRUTH
        ratios.append((bound[0] + TRUTH) / (angle + TRUTH))
    print(law, f"median {np.median(ratios):.2f}, largest {max(ratios):.1f}")
    if law != "tensor":
        assert np.median(ratios) < 10.0  # a bound that says nothing holds too
