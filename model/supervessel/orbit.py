"""Two-body motion: where a body is in the field of an attracting centre, at any times, in closed form."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from supervessel.problems import quantity
from supervessel.scene.inputs import by_name
from supervessel.scene.numbers import EPSILON

if TYPE_CHECKING:
    from supervessel.scene.schema import Scene

Array = NDArray[np.float64]

SERIES = 1.0
"""Largest |x| at which Stumpff's functions are summed as series; beyond it closed forms lose no digits."""
TERMS = 9
"""Terms of these series: the next one is at most 1/21!, less than half an ulp of 1/3!."""

MOST_ITERATIONS = 200
"""More than bisection alone needs to bring a bracket of doubles down to two neighbours, at two a bit."""


def gravity_inputs(scene: "Scene", times: ArrayLike) -> dict[str, Array]:
    """Returns, by name, the inputs of gravity at some times, (n,) each [m, m/s].

    times : (n,) [s], 0 at the start
    The barycentre moves by two-body motion from where the scene starts.
    Empty for a scene without `inputs.gravity`. Raises ValueError as `two_body` does.

    Example:
        >>> gravity_inputs(scene, [0.0])  # of a scene without gravity
        {}
    """
    names = [name for name, kind in by_name(dict(scene.inputs)).items() if kind.part == "field"]
    if not names or scene.gravity is None:
        return {}
    motion = np.hstack(two_body(*scene.gravity_start, scene.gravity.mu, times))
    return {name: np.ascontiguousarray(column) for name, column in zip(names, motion.T, strict=True)}


def two_body(position: ArrayLike, velocity: ArrayLike, mu: float, times: ArrayLike) -> tuple[Array, Array]:
    """Returns positions, (n, 3) [m], and velocities, (n, 3) [m/s], in the field of an attracting centre.

    position : from the centre at time 0, (3,) [m], axes that do not turn
    velocity : relative to the centre at time 0, (3,) [m/s], same axes
    mu       : gravitational parameter of the centre [m3/s2]
    times    : (n,) [s], of any sign and in any order

    Ellipses, parabolas and hyperbolas alike; at time 0 exactly position and velocity. The result is as exact
    as if each of position, velocity, mu and time had been off by some u = 2^-53 (tests/model/test_orbit.py):
    an ellipse is then off along its path by some u of the whole way. A hyperbola that came in from far, at
    r0, and has passed its periapsis, at r, is off by r0/r times that. Raises ValueError, with the reason,
    where `orbit_problem` has one or where doubles do not hold the result.

    Source: [DB] section 6.9: with ds/dt = r0/r, beta = 2 - v^2, eta = r . v, zeta = v^2 - 1 and Stumpff's
    functions, G_k = s^k c_k(beta s^2), Kepler's equation is t = s + eta G_2 + zeta G_3. Units are here
    r0 = |position| and the time sqrt(r0^3/mu).

    Example:
        >>> positions, velocities = two_body([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], 1.0, [0.0, np.pi / 2])
        >>> positions.round(12).tolist()
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    """
    r0, v0 = np.array(position, dtype=np.float64), np.array(velocity, dtype=np.float64)
    when: Array = np.atleast_1d(np.array(times, dtype=np.float64))
    problem = orbit_problem(r0.tolist(), v0.tolist(), mu)
    if problem:
        raise ValueError(problem)
    if not np.all(np.isfinite(when)):
        raise ValueError("times must be finite")
    distance, speed, rate = _units(r0.tolist(), mu)
    direction, relative = r0 / distance, v0 / speed
    square, eta = float(relative @ relative), float(direction @ relative)
    beta, zeta = 2.0 - square, square - 1.0
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # looked at below
        tau = _within_a_period(when * rate, beta)
        s = np.copysign(_anomaly(np.abs(tau), beta, np.copysign(1.0, tau) * eta, zeta), tau)
        G1, G2, _ = _functions(s, beta)
        r = 1.0 + eta * G1 + zeta * G2
        positions = np.outer(1.0 - G2, r0) + np.outer((G1 + eta * G2) / rate, v0)
        velocities = np.outer(-G1 / r * rate, r0) + np.outer(1.0 - G2 / r, v0)
    if not (np.all(np.isfinite(positions)) and np.all(np.isfinite(velocities))):
        raise ValueError("position or velocity at some of the times is beyond all doubles")
    return positions, velocities


def orbit_problem(position: Sequence[float], velocity: Sequence[float], mu: float) -> str:
    """Returns why there is no orbit from this position and velocity, or "" if there is one.

    position, velocity, mu : as in `two_body`
    A motion straight to or from the centre, within rounding, is none: it is not defined beyond the centre.
    """
    for name, numbers in (("position", position), ("velocity", velocity)):
        if not all(map(math.isfinite, numbers)):
            return f"{name} = {quantity(tuple(numbers))}: must be finite"
    if not (mu > 0.0 and math.isfinite(mu)):
        return f"position: mu = {mu} m3/s2 must be finite and > 0"
    if not any(position):
        return f"position = {quantity(tuple(position), 'm')}: must have a length greater than 0"
    where = f"velocity = {quantity(tuple(velocity), 'm/s')}"
    distance, speed, rate = _units(position, mu)
    relative = [x / speed if speed else math.inf for x in velocity]
    if not (all(0.0 < unit < math.inf for unit in (distance, speed, rate)) and _is_finite_square(relative)):
        return f"{where}: with position and mu there is no orbit that doubles hold"
    across = math.hypot(*np.cross([x / distance for x in position], relative).tolist())
    if across <= 4.0 * EPSILON * math.hypot(*relative):
        return f"{where}: must not be zero or along the position: the path goes through the attracting centre"
    return ""


def _is_finite_square(vector: Sequence[float]) -> bool:
    return math.isfinite(sum(x * x for x in vector))


def _units(position: Sequence[float], mu: float) -> tuple[float, float, float]:
    """Returns distance [m], speed [m/s] and rate [1/s] of a circular orbit through a position."""
    distance = math.hypot(*position)
    speed = math.sqrt(mu / distance)
    return distance, speed, speed / distance


def _within_a_period(tau: Array, beta: float) -> Array:
    """Returns times, (n,), less whole periods, at most half of one from 0; those of no ellipse unchanged."""
    size = beta * math.sqrt(beta) if beta > 0.0 else 0.0
    if size == 0.0:
        return tau
    period = 2.0 * math.pi / size
    rest = np.fmod(tau, period)  # exact, and so are the sums below
    return np.where(np.abs(rest) > 0.5 * period, rest - np.copysign(period, rest), rest)


def _anomaly(tau: Array, beta: float, eta: Array, zeta: float) -> Array:
    """Returns the solutions s >= 0, (n,), of Kepler's equation s + eta G_2 + zeta G_3 = tau.

    tau : (n,), >= 0; for an ellipse at most half a period
    eta : (n,)
    The left side grows with s, by r: Newton's method within a bracket, which is halved where a step of that
    does not halve the one before.
    """
    low, high = np.zeros_like(tau), _upper(tau, beta, eta, zeta)
    s = np.minimum(tau, high)
    before = high - low
    for _ in range(MOST_ITERATIONS):
        G1, G2, G3 = _functions(s, beta)
        parts = s, eta * G2, zeta * G3
        residual = sum(parts) - tau
        noise = 2.0 * EPSILON * (sum(np.abs(part) for part in parts) + tau)
        low, high = np.where(residual <= 0.0, s, low), np.where(residual >= 0.0, s, high)
        done = (np.abs(residual) <= noise) | (high - low <= EPSILON * s)
        r = 1.0 + eta * G1 + zeta * G2
        step = -residual / np.where(r > 0.0, r, 1.0)
        slow = (r <= 0.0) | (np.abs(step) > 0.5 * before) | (s + step < low) | (s + step > high)
        step = np.where(slow & ~done, 0.5 * (low + high) - s, step)
        s, before = np.clip(s + step, low, high), np.abs(step)
        if np.all(done):
            return np.asarray(s)
    raise ValueError("Kepler's equation has no solution that doubles hold at some of the times")


def _upper(tau: Array, beta: float, eta: Array, zeta: float) -> Array:
    """Returns numbers, (n,), that the solutions of `_anomaly` do not exceed, and not by far."""
    scale = 1.0 / math.sqrt(abs(beta)) if beta else math.inf
    most = 2.0 * math.pi * scale if beta > 0.0 else math.inf  # a whole period
    high = np.minimum(tau, scale)
    while True:
        _, G2, G3 = _functions(high, beta)
        short = (high + eta * G2 + zeta * G3 < tau) & (high < most)
        if not np.any(short):
            return high
        high = np.where(short, np.minimum(2.0 * high, most), high)


def _functions(s: Array, beta: float) -> tuple[Array, Array, Array]:
    """Returns G_1, G_2, G_3, (n,) each: s^k times the sum over j of (-beta s^2)^j/(k + 2 j)!."""
    x = beta * s * s
    near = np.abs(x) <= SERIES
    small, large = np.where(near, x, 0.0), np.where(near, 4.0, np.abs(x))
    y = np.sqrt(large)
    if beta > 0.0:
        sine, half = np.sin(y), np.sin(0.5 * y)
        closed = sine / y, 2.0 * half * half / large, (y - sine) / (large * y)
    else:
        sine, half = np.sinh(y), np.sinh(0.5 * y)
        closed = sine / y, 2.0 * half * half / large, (sine - y) / (large * y)
    c1, c2, c3 = (np.where(near, _series(small, k), far) for k, far in enumerate(closed, start=1))
    return s * c1, s * s * c2, s * s * s * c3


def _series(x: Array, k: int) -> Array:
    """Returns Stumpff's function c_k at |x| <= SERIES, (n,)."""
    total = np.full_like(x, 1.0 / math.factorial(k + 2 * (TERMS - 1)))
    for j in reversed(range(TERMS - 1)):
        total = 1.0 / math.factorial(k + 2 * j) - x * total
    return total
