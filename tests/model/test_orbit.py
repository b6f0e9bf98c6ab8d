"""Two-body motion: against Kepler's equation in its classical forms, at 100 digits, and an integration.

The measure is the condition: what a change by u of each component of position and velocity, of mu and of time
does to the result, found from the truth itself.
"""

from math import cos, inf, nan, pi, sin, sqrt

import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from supervessel.orbit import orbit_problem, two_body
from support import Array, U

DIGITS = 100
BOUND = 2.0  # u cond; found: at most 0.7
STEP = mp.mpf(10) ** -20  # of the differences by which the condition is found

EARTH = 3.986004418e14
FAR = 6.778e6


def start(
    eccentricity: float, angle: float, periapsis: float = FAR, mu: float = EARTH
) -> tuple[Array, Array]:
    """Returns position and velocity at a true anomaly [rad], in a plane that is no plane of the axes."""
    p = FAR * (1.0 + eccentricity)
    r, speed = p / (1.0 + eccentricity * cos(angle)), sqrt(EARTH / p)
    plane = np.array([[0.8, 0.36, 0.48], [-0.6, 0.48, 0.64]])
    position = r * np.array([cos(angle), sin(angle)])
    velocity = speed * np.array([-sin(angle), eccentricity + cos(angle)])
    return position @ plane, velocity @ plane


def truth(values: list[mp.mpf]) -> list[mp.mpf]:
    """Returns position and velocity, at `DIGITS` digits, by eccentricity vector and anomaly.

    values : position (3), velocity (3), mu, time
    """
    r, v, mu, time = mp.matrix(values[:3]), mp.matrix(values[3:6]), values[6], values[7]
    distance = mp.norm(r)
    h = cross(r, v)
    towards = cross(v, h) / mu - r / distance
    e, p, inverse = mp.norm(towards), mp.fdot(h, h) / mu, 2 / distance - mp.fdot(v, v) / mu
    P = towards / e if e > 0 else r / distance
    Q = cross(h, P) / mp.norm(h)
    x, y = mp.fdot(r, P), mp.fdot(r, Q)
    if inverse == 0:
        D = y / mp.sqrt(p)  # Barker's equation
        passed = D * (p + D * D / 3) / (2 * mp.sqrt(mu)) + time
        third = 3 * mp.sqrt(mu) * passed
        root = mp.cbrt(abs(third) + mp.sqrt(third * third + p**3))
        D = mp.sign(third) * (root - p / root)
        x, y = (p - D * D) / 2, mp.sqrt(p) * D
        radius = (p + D * D) / 2
    else:
        a = 1 / inverse
        n = mp.sqrt(mu / abs(a) ** 3)
        side = mp.sqrt(abs(1 - e * e)) * abs(a)
        if a > 0:
            E = mp.atan2(y / side, x / a + e)
            M = E - e * mp.sin(E) + n * time
            M -= 2 * mp.pi * mp.nint(M / (2 * mp.pi))
            E = root_of(lambda E: E - e * mp.sin(E) - M, lambda E: 1 - e * mp.cos(E), -mp.pi, mp.pi)
            x, y = a * (mp.cos(E) - e), side * mp.sin(E)
        else:
            H = mp.asinh(y / side)
            M = e * mp.sinh(H) - H + n * time
            most = 1 + mp.asinh(abs(M) / (e - 1))
            H = root_of(lambda H: e * mp.sinh(H) - H - M, lambda H: e * mp.cosh(H) - 1, -most, most)
            x, y = a * (mp.cosh(H) - e), side * mp.sinh(H)
        radius = mp.hypot(x, y)
    speed = mp.sqrt(mu / p)
    return [*(x * P + y * Q), *(speed * (-y / radius * P + (e + x / radius) * Q))]


def cross(a: mp.matrix, b: mp.matrix) -> mp.matrix:
    return mp.matrix([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def root_of(function, slope, low, high):
    """Returns the root of a growing function, by Newton's method within a bracket."""
    x = (low + high) / 2
    for _ in range(20 * DIGITS):
        value = function(x)
        low, high = (x, high) if value < 0 else (low, x)
        step = -value / slope(x)
        if abs(step) <= mp.mpf(10) ** (20 - DIGITS) * (1 + abs(x)):
            return x + step
        x = x + step if low < x + step < high else (low + high) / 2
    raise AssertionError("no root")


def off(position: Array, velocity: Array, mu: float, time: float) -> tuple[float, float]:
    """Returns the errors of position and velocity at a time [s], each over u times its condition."""
    with mp.workdps(DIGITS):
        values = [mp.mpf(float(one)) for one in (*position, *velocity, mu, time)]
        sizes = 3 * [mp.norm(values[:3])] + 3 * [mp.norm(values[3:6])] + [values[6], abs(values[7])]
        exact = truth(values)
        condition = [mp.norm(exact[:3]), mp.norm(exact[3:])]
        for i, size in enumerate(sizes):
            moved = [*values]
            moved[i] += STEP * size
            change = [(a - b) / STEP for a, b in zip(truth(moved), exact, strict=True)]
            condition = [condition[0] + mp.norm(change[:3]), condition[1] + mp.norm(change[3:])]
        found = [float(x) for part in two_body(position, velocity, mu, [time]) for x in part[0]]
        apart = [mp.mpf(a) - b for a, b in zip(found, exact, strict=True)]
        return float(mp.norm(apart[:3]) / condition[0] / U), float(mp.norm(apart[3:]) / condition[1] / U)


def case(name: str, eccentricity: float, angle: float, *times: float) -> object:
    return pytest.param(*start(eccentricity, angle), EARTH, times, id=name)


PERIOD = 2.0 * pi * sqrt(FAR**3 / EARTH)
LONG = PERIOD / (1.0 - 0.9) ** 1.5


@pytest.mark.parametrize(
    ("position", "velocity", "mu", "times"),
    [
        case("circular", 0.0, 0.3, 1e-3, 60.0, -600.0, 0.5 * PERIOD, PERIOD, 10.3 * PERIOD),
        case("almost circular", 8e-4, 2.0, 1.0, 28800.0, -28800.0, 86400.0),
        case("from periapsis", 0.9, 0.0, 10.0, 0.3 * LONG, 0.5 * LONG, LONG, -2.01 * LONG),
        case("from apoapsis", 0.9, pi, 10.0, 0.45 * LONG, 0.5 * LONG, -0.501 * LONG),
        case("inward", 0.9, -2.5, 10.0, 0.1 * LONG, 0.6 * LONG, -LONG),
        case("for long", 0.1, 1.0, 1e5 * PERIOD, -1e8 * PERIOD),
        case("almost parabolic", 1.0 - 1e-9, 1.0, 1.0, 1e4, -1e5, 1e9),
        case("just beyond", 1.0 + 1e-9, -1.0, 1.0, 1e4, -1e5, 1e9),
        case("hyperbola outward", 1.5, 0.5, 1.0, 1e4, -1e4, 1e9),
        pytest.param([2.0, 0.0, 0.0], [0.0, 1.0, 0.0], 1.0, (0.1, -3.0, 40.0, 1e12), id="parabola"),
        pytest.param([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], 1.0, (0.1, -3.0, 40.0), id="circle to the bit"),
        pytest.param([0.0, 5e-150, 0.0], [3e-26, 1e-26, 2e-26], 1e-200, (1e-125, 1e-120), id="small"),
    ],
)
def test_a_position_is_as_exact_as_if_what_it_follows_from_had_been_rounded(position, velocity, mu, times):
    worst = max(max(off(np.array(position), np.array(velocity), mu, time)) for time in times)
    print(f"{worst:.2f} u cond")
    assert worst <= BOUND


@pytest.mark.parametrize("angle", [-1.0, -1.8, -1.9])
def test_a_hyperbola_from_far_loses_its_distance_over_that_of_the_periapsis(angle):
    position, velocity = start(3.0, angle)
    nearer = np.linalg.norm(position) / FAR
    worst = max(max(off(position, velocity, EARTH, time)) for time in (1.0, 1e3, 1e4, 1e9, -1e9))
    print(f"{worst:.2f} u cond, from {nearer:.1f} periapsis distances")
    assert worst <= BOUND * nearer


def test_truth_itself_is_the_motion_by_the_inverse_square():
    position, velocity = start(0.5, 2.0)

    def rate(_: float, x: Array) -> Array:
        return np.concatenate([x[3:], -EARTH / np.linalg.norm(x[:3]) ** 3 * x[:3]])

    end = solve_ivp(rate, (0.0, 9000.0), [*position, *velocity], "DOP853", rtol=1e-13, atol=1e-6).y[:, -1]
    with mp.workdps(DIGITS):
        exact = [float(x) for x in truth([mp.mpf(float(x)) for x in (*position, *velocity, EARTH, 9000.0)])]
    assert np.abs(end[:3] - exact[:3]).max() <= 1e-10 * FAR
    assert np.abs(end[3:] - exact[3:]).max() <= 1e-10 * np.linalg.norm(velocity)


def test_at_the_start_nothing_is_rounded():
    position, velocity = start(0.3, 1.0)
    positions, velocities = two_body(position, velocity, EARTH, [0.0, 1.0, -0.0])
    assert positions.shape == velocities.shape == (3, 3)
    assert np.array_equal(positions[[0, 2]], [position, position])
    assert np.array_equal(velocities[[0, 2]], [velocity, velocity])


def test_times_do_not_know_of_each_other():
    position, velocity = start(0.9, 1.0)
    times = np.array([-1e4, 3e5, 12.0, 0.0])
    together = np.hstack(two_body(position, velocity, EARTH, times))
    alone = [np.hstack(two_body(position, velocity, EARTH, [time]))[0] for time in times]
    scale = np.abs(together).max(axis=0)
    assert np.all(np.abs(together - alone) <= 64.0 * U * scale)


@pytest.mark.parametrize(
    ("position", "velocity", "mu", "words"),
    [
        ([1.0, 0.0, 0.0], [0.0, 0.0, 0.0], 1.0, "must not be zero or along the position"),
        ([1.0, 2.0, 3.0], [0.1, 0.2, 0.3], 1.0, "must not be zero or along the position"),
        ([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 1.0, "must have a length greater than 0"),
        ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], 0.0, "mu = 0.0 m3/s2 must be finite and > 0"),
        ([1.0, 0.0, 0.0], [0.0, nan, 0.0], 1.0, "must be finite"),
        ([1e200, 0.0, 0.0], [0.0, 1e300, 0.0], 1e-300, "there is no orbit that doubles hold"),
        ([1e300, 0.0, 0.0], [0.0, 1.0, 0.0], 5e-324, "there is no orbit that doubles hold"),
    ],
)
def test_what_is_no_orbit_is_refused(position, velocity, mu, words):
    assert words in orbit_problem(position, velocity, mu)
    with pytest.raises(ValueError, match=words):
        two_body(position, velocity, mu, [0.0])


@pytest.mark.parametrize("time", [nan, inf])
def test_a_time_that_is_none_is_refused(time):
    with pytest.raises(ValueError, match="times must be finite"):
        two_body(*start(0.0, 0.0), EARTH, [time])


def test_a_time_by_which_the_body_is_beyond_all_doubles_is_refused():
    position, velocity = start(2.0, 0.0)
    with pytest.raises(ValueError, match="doubles"):
        two_body(position, velocity, EARTH, [1e305])
