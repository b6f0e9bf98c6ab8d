"""Steps with an error estimate: coefficients, order, estimates, and how well a controller meets a tolerance.

Truth is a Taylor series in integers, with nothing in common with the steps but Euler's equations.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import casadi as ca
import numpy as np
import pytest
from scipy.integrate._ivp import dop853_coefficients as scipy_dop853

from supervessel.rotation.attitude import attitude_dot
from supervessel.rotation.laws import LAWS
from supervessel.rotation.propagators import dop853
from supervessel.rotation.propagators.dop853 import dop853_step
from supervessel.rotation.propagators.method import StepSymbols
from supervessel.rotation.propagators.taylor import taylor_order, taylor_step
from support import Array, U, random_rotation
from support.series import Number, Vector, flight, mp, norm

NUMBERS = {"none": 0, "decoupled": 3, "principal": 7, "tensor": 13}
METHODS = ("dop853", "taylor")
TILTED = np.array([[1.0, 0.06, -0.04], [0.06, 2.0, 0.05], [-0.04, 0.05, 2.5]])
RATES = np.array([0.3, 0.7, 0.5])  # rad/s
ATTITUDE = np.array([0.5, -0.1, 0.7, 0.3]) / np.sqrt(0.84)
START = np.concatenate([ATTITUDE, RATES])
TORQUE = np.array([0.15, -0.3, 0.2])  # N m


# Truth


def by_series(law: str, J: Array, torque: Array, start: Array, duration: float) -> Vector:
    """Returns the state after the duration, (7,), its attitude at unit length."""
    end = flight(law, J, start, torque, duration)
    length = norm(end[:4])
    return [*(x / length for x in end[:4]), *end[4:]]


def deviation(state: Array, true: Sequence[Number]) -> tuple[float, float]:
    """Returns the errors of attitude [rad], its sign included, and of angular velocity [rad/s]."""
    off = [float(x - t) for x, t in zip(state.tolist(), true, strict=True)]
    return 2.0 * float(np.linalg.norm(off[:4])), float(np.linalg.norm(off[4:]))


def test_truth_follows_a_symmetric_top() -> None:
    # Moments (a, a, c): precession about the momentum after a spin about the body's own axis.
    a, c, duration = 2.0, 1.25, 16.0
    with mp.workdps(60):
        w = [mp.mpf(x) for x in RATES.tolist()]
        phase = (1 - mp.mpf(c) / a) * w[2] * duration
        momentum = [a * w[0], a * w[1], c * w[2]]
        size = norm(momentum)
        angle = size / a * duration / 2
        p = [mp.cos(angle), *(mp.sin(angle) * x / size for x in momentum)]
        r, s = mp.cos(phase / 2), mp.sin(phase / 2)
        spun = [p[0] * r - p[3] * s, p[1] * r + p[2] * s, p[2] * r - p[1] * s, p[3] * r + p[0] * s]
        rate = [
            mp.cos(phase) * w[0] + mp.sin(phase) * w[1],
            mp.cos(phase) * w[1] - mp.sin(phase) * w[0],
            w[2],
        ]
        start = np.array([1.0, 0.0, 0.0, 0.0, *RATES])
        for law in ("principal", "tensor"):
            true = by_series(law, np.diag([a, a, c]), np.zeros(3), start, duration)
            off = [t - x for t, x in zip(true, [*spun, *rate], strict=True)]
            assert max(map(abs, off)) < 1e-24


# Steps


@dataclass(frozen=True)
class Step:
    """A step and what a controller must know of it.

    function     : state, torque, the law's numbers, step -> state, errors
    acceleration : state, torque, the law's numbers -> angular acceleration
    prepare      : tensor -> the law's numbers
    power        : exponent of the step in the errors
    series       : whether it can be summed up anywhere
    """

    function: ca.Function
    acceleration: ca.Function
    prepare: ca.Function
    power: int
    series: bool

    def numbers(self, J: Array) -> Array:
        return np.array(self.prepare(J)).ravel()

    def __call__(self, state: Array, torque: Array, numbers: Array, h: float) -> tuple[Array, Array]:
        end, error = self.function(state, torque, numbers, h)
        return np.array(end).ravel(), np.array(error).ravel()


@cache
def step(law: str, method: str, order: int = 0) -> Step:
    x, u, h, c = (ca.SX.sym(*s) for s in (("x", 7), ("u", 3), ("h", 1), ("c", NUMBERS[law])))
    rotation = LAWS[law]

    def rate(state: ca.SX) -> ca.SX:
        return ca.vertcat(attitude_dot(state[:4], state[4:]), rotation.acceleration(c, state[4:], u))

    if method == "dop853":
        results, power = dop853_step(rate, x, h), dop853.ORDER
    else:
        results, power = taylor_step(StepSymbols(x, rate, rotation, c, u, h, 1e-9, True), order), order + 1
    J = ca.SX.sym("J", 3, 3)
    return Step(
        ca.Function("step", [x, u, c, h], list(results)),
        ca.Function("acceleration", [x, u, c], [rotation.acceleration(c, x[4:], u)]),
        ca.Function("prepare", [J], [rotation.prepare(J)]),
        power,
        method == "taylor",
    )


def for_tolerance(law: str, method: str, tolerance: float) -> Step:
    return step(law, method, taylor_order(tolerance) if method == "taylor" else 0)


# The controller

SAFETY = {"dop853": 5.0, "taylor": 2.5}
"""Estimated errors allowed over the tolerance: they add up to a tenth or so of their sum (measured)."""


TURNED_ON, TURNED_ON_SHARE = 3.0, 0.1
"""Of a Taylor step's error of the rate: it counts for this angle [rad] and this share of the rest at most."""

AIM, LONGEST_SHARE = 0.8, 1.2
"""Of the error allowed, and of the span that a series was made for, in a Taylor step."""


def controlled(
    one: Step, J: Array, torque: Array, state: Array, duration: float, *, tolerance: float, safety: float
) -> tuple[Array, int]:
    """Returns the state after the duration, and the steps evaluated, refused ones included.

    The error at the end is to be `tolerance`: radians of attitude, and of angular velocity relative to it.
    An error of the rate turns the body on for what is left of the duration, the reach, but counts no less
    than relative to the rate; that of a series for less, TURNED_ON. Each step may use up its share of the
    tolerance by time; where that is less than what a rounding of the state amounts to by the end,
    u (1 + rate reach), the latter. A series is summed up where it uses that up; others step again.
    """
    numbers = one.numbers(J)
    speed = float(np.linalg.norm(state[4:]))
    push = np.sqrt(np.linalg.norm(np.array(one.acceleration(state, torque, numbers))))
    # Series converge over a radian or two; the step that the tolerance allows is that times its root.
    h = min(duration, 2.0 * tolerance ** (1.0 / one.power) / (speed + push)) if speed + push else duration
    left, count = duration, 0
    while left > 0.0:
        if h >= left:
            h = left
        elif 2.0 * h > left:
            h = 0.5 * left
        end, error = one(state, torque, numbers, h)
        count += 1
        speed = max(float(np.linalg.norm(state[4:])), float(np.linalg.norm(end[4:])))
        reach = max(left, 1.0 / speed) if speed else left
        if one.series and speed:
            reach = min(reach, TURNED_ON / speed + TURNED_ON_SHARE * reach)
        allowed = max(safety * tolerance * h / duration, U * (1.0 + speed * reach))
        measure = float(error[0] + error[1] * reach)
        change = (allowed / measure) ** (1.0 / (one.power - 1)) if measure > 0.0 else 6.0
        change *= AIM ** (1.0 / (one.power - 1)) if one.series else 0.9
        change = min(max(change, 0.2), 5.0) if np.isfinite(measure) else 0.2
        if one.series and np.isfinite(measure):
            grown = max(1.0, min(change, LONGEST_SHARE)) if 2.0 * LONGEST_SHARE * h < left else 1.0
            share = grown if measure <= allowed else change
            state, left = one(state, torque, numbers, share * h)[0], left - share * h
        elif measure <= allowed:
            state, left = end, left - h
        h *= change
    return state, count


def random_body(rng: np.random.Generator, *, tilt: bool) -> Array:
    """Returns a tensor of moments up to 1 whose points lie at distances that differ by up to thirty times."""
    squares = 10.0 ** rng.uniform(-3.0, 0.0, size=3)
    moments = (squares.sum() - squares) / (squares.sum() - squares.min())
    R = random_rotation(int(rng.integers(10**6))) if tilt else np.eye(3)
    J = R @ np.diag(moments) @ R.T
    return 0.5 * (J + J.T)


# The laws' linear maps of products


@pytest.mark.parametrize("law", LAWS)
def test_products_and_their_map_give_the_gyroscopic_acceleration(law: str) -> None:
    one, rotation = step(law, "dop853"), LAWS[law]
    c = ca.SX.sym("c", NUMBERS[law])
    gyroscopic = ca.Function("gyroscopic", [c], [rotation.gyroscopic(c)])
    rng = np.random.default_rng(1)
    for _ in range(50):
        J, omega = random_body(rng, tilt=True), rng.normal(size=3)
        numbers = one.numbers(J)
        products = np.array([omega[i] * omega[j] for i, j in rotation.products])
        value = np.array(gyroscopic(numbers)) @ products if rotation.products else np.zeros(3)
        expected = one.acceleration([*ATTITUDE, *omega], np.zeros(3), numbers)
        moments = np.linalg.eigvalsh(J)
        # Each is a sum of some twenty products, rounded each, of J^-1 and J omega^2.
        bound = 40 * U * moments[2] / moments[0] * (omega @ omega)
        assert np.abs(value - np.array(expected).ravel()).max() <= bound


@pytest.mark.parametrize("law", ["principal", "tensor"])
@pytest.mark.parametrize(
    ("exponent", "rate", "torque"),
    [(-1000, 1e-9, 0.0), (-900, 1e-9, 1e-18), (900, 1e3, 1e6), (1020, 1e3, 0.0)],
)
def test_acceleration_goes_by_ratios_of_moments_and_torque_to_the_last_bit(
    law: str, exponent: int, rate: float, torque: float
) -> None:
    # Powers of two are exact; momentum or torque itself would be no double, or none of full precision.
    one, omega = step(law, "dop853"), rate * RATES
    expected = one.acceleration([*ATTITUDE, *omega], torque * TORQUE, one.numbers(TILTED))
    numbers = one.numbers(np.ldexp(TILTED, exponent))
    found = one.acceleration([*ATTITUDE, *omega], np.ldexp(torque * TORQUE, exponent), numbers)
    assert np.array(found).tolist() == np.array(expected).tolist()


# Coefficients


def as_vector(weights: dict[int, float]) -> Array:
    return np.array([weights.get(j, 0.0) for j in range(12)])


def test_coefficients_are_those_of_scipy() -> None:
    weights = as_vector(dict(dop853.WEIGHTS))
    for i, stage in enumerate(dop853.STAGES):
        assert (as_vector(dict(stage)) == scipy_dop853.A[i, :12]).all()
    assert (weights == scipy_dop853.B).all()
    assert (as_vector(dict(dop853.FIFTH_ORDER)) == scipy_dop853.E5[:12]).all()
    assert (weights - as_vector(dict(dop853.THIRD_ORDER)) == scipy_dop853.E3[:12]).all()


def test_coefficients_fulfil_the_order_conditions_of_quadrature() -> None:
    nodes = np.array([sum(stage.values()) for stage in dop853.STAGES])
    weights, third = as_vector(dict(dop853.WEIGHTS)), as_vector(dict(dop853.THIRD_ORDER))
    fifth = weights - as_vector(dict(dop853.FIFTH_ORDER))
    for of, order in ((weights, 8), (fifth, 5), (third, 3)):
        # The weights add up to 20 in size; each is rounded, and each node is a sum of up to 200 in size.
        off = [abs(of @ nodes**k - 1.0 / (k + 1)) for k in range(order + 1)]
        assert max(off[:order]) <= 20 * 200 * U
        assert off[order] > 1e-5 or of is weights


# Order of convergence and error estimates

DURATION = 8.0  # s, about 10 rad
# Steps within which the error is neither that of too long a step nor of rounding; twice as many as well.
COUNTS = {("dop853", 0): 8, ("taylor", 8): 12, ("taylor", 12): 5}
# The only law with a torque that nothing bends spins the body up, to 3 rad/s.
COUNTS_SPUN_UP = {("dop853", 0): 16, ("taylor", 8): 16, ("taylor", 12): 8}


@cache
def true_end(law: str, duration: float) -> tuple[Number, ...]:
    return tuple(by_series(law, TILTED, TORQUE, START, duration))


def after(one: Step, count: int) -> Array:
    state, numbers = START, one.numbers(TILTED)
    for _ in range(count):
        state, _ = one(state, TORQUE, numbers, DURATION / count)
    return state


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("method", "order"), COUNTS)
def test_order_of_convergence(method: str, order: int, law: str) -> None:
    one = step(law, method, order)
    count = (COUNTS_SPUN_UP if law == "decoupled" else COUNTS)[method, order]
    coarse, fine = (deviation(after(one, n), true_end(law, DURATION)) for n in (count, 2 * count))
    # The error is C h^p (1 + c h + ...): at these steps, 0.3 to 2 rad long, the slope is off by up to 0.5.
    assert abs(np.log2(coarse[0] / fine[0]) - (order or 8)) <= 0.6
    if law in ("principal", "tensor"):
        assert abs(np.log2(coarse[1] / fine[1]) - (order or 8)) <= 0.6
    else:  # a polynomial of degree one: 2 rad/s at most, the gain and the sum of each step rounded
        assert max(coarse[1], fine[1]) <= 2 * count * 2 * U * 2.0


def estimated_and_true(one: Step, law: str, h: float) -> tuple[Array, Array]:
    """Returns the errors, attitude and rate, of one step, where the law has any."""
    end, estimate = one(START, TORQUE, one.numbers(TILTED), h)
    kept = slice(2) if law in ("principal", "tensor") else slice(1)
    return estimate[kept], np.array(deviation(end, true_end(law, h)))[kept]


@pytest.mark.parametrize("law", ["decoupled", "principal", "tensor"])
@pytest.mark.parametrize(("order", "h"), [(8, 0.8), (8, 0.4), (12, 0.9), (12, 0.75), (16, 1.6), (16, 1.4)])
def test_estimate_of_taylor_is_the_true_error_of_a_step(order: int, h: float, law: str) -> None:
    # The estimate is the size of two terms together, at their latest ratio, which still falls.
    estimate, true = estimated_and_true(step(law, "taylor", order), law, h)
    assert (true <= estimate).all()
    assert (estimate <= 4.0 * true).all()


@pytest.mark.parametrize("law", LAWS)
def test_estimate_of_dop853_bounds_the_error_of_a_step_and_goes_with_its_order(law: str) -> None:
    one = step(law, "dop853")
    (coarse, true), (fine, true_fine) = (estimated_and_true(one, law, h) for h in (0.8, 0.4))
    assert (true <= coarse).all()
    assert (true_fine <= fine).all()
    assert (np.abs(np.log2(coarse / fine) - one.power) <= 0.2).all()


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("method", METHODS)
def test_without_rates_or_torque_the_estimates_vanish(method: str, law: str) -> None:
    one = step(law, method, 8)
    start = np.concatenate([ATTITUDE, np.zeros(3)])
    end, error = one(start, np.zeros(3), one.numbers(TILTED), 10.0)
    assert (error == 0.0).all()
    assert np.abs(end - start).max() <= 4 * U  # made a unit quaternion


# Tolerances


def random_case(seed: int) -> tuple[str, Array, Array, Array, float]:
    """Returns law, tensor, torque, start and duration: 0.1 to 40 s at 1 rad/s, torque none to strong."""
    rng = np.random.default_rng(seed)
    tilt = bool(rng.integers(2))
    J = random_body(rng, tilt=tilt)
    omega, attitude, axis = rng.normal(size=3), rng.normal(size=4), rng.normal(size=3)
    duration = 10.0 ** rng.uniform(-1.0, np.log10(40.0))
    strength = min(10.0 ** rng.uniform(-6.0, 0.5) / duration, 1.0) if rng.uniform() < 0.8 else 0.0
    torque = strength * J @ axis / np.linalg.norm(axis)
    start = np.concatenate([attitude / np.linalg.norm(attitude), omega / np.linalg.norm(omega)])
    return ("tensor" if tilt else "principal"), J, torque, start, duration


@cache
def random_end(seed: int) -> tuple[Number, ...]:
    return tuple(by_series(*random_case(seed)))


def relative(state: Array, true: tuple[Number, ...]) -> float:
    """Returns the larger error: of attitude [rad], of angular velocity over its size."""
    attitude, rate = deviation(state, true)
    return max(attitude, rate / float(np.linalg.norm(state[4:])))


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("method", METHODS)
def test_controller_meets_the_tolerance(method: str, tolerance: float) -> None:
    shares = []
    for seed in range(60):
        law, J, torque, start, duration = random_case(seed)
        one = for_tolerance(law, method, tolerance)
        end, _ = controlled(one, J, torque, start, duration, tolerance=tolerance, safety=SAFETY[method])
        shares.append(relative(end, random_end(seed)) / tolerance)
    assert sum(share > 1.0 for share in shares) <= 1  # of 60
    assert max(shares) < 10.0


def condition(one: Step, J: Array, torque: Array, start: Array, duration: float) -> float:
    """Returns the sum over the inputs of how far each, changed by a share, moves the end, over that share."""
    share = 1e-6

    def end(J: Array, torque: Array, start: Array, duration: float) -> Array:
        return controlled(one, J, torque, start, duration, tolerance=1e-14, safety=SAFETY["taylor"])[0]

    middle, ends = end(J, torque, start, duration), [end(J, torque, start, duration * (1 + share))]
    for i in range(3):
        factor = np.ones(3)
        factor[i] += share
        ends.append(end(J, factor * torque, start, duration))
        ends.append(end(J, torque, np.concatenate([start[:4], factor * start[4:]]), duration))
        for j in range(i, 3):
            changed = J.copy()
            changed[i, j] = changed[j, i] = J[i, j] * (1 + share)
            ends.append(end(changed, torque, start, duration))
    moved = [x - middle for x in ends]
    speed = np.linalg.norm(middle[4:])
    return sum(max(2 * np.linalg.norm(x[:4]), np.linalg.norm(x[4:]) / speed) for x in moved) / share


@pytest.mark.parametrize(("method", "most"), [("dop853", 25), ("taylor", 5)])
def test_tightest_tolerance_neither_stalls_nor_misses_what_rounding_allows(method: str, most: int) -> None:
    for seed in range(12):
        law, J, torque, start, duration = random_case(seed)
        end, count = controlled(
            for_tolerance(law, method, U),
            *(J, torque, start, duration),
            tolerance=U,
            safety=SAFETY[method],
        )
        bound = 16 * U * (1.0 + condition(step(law, "taylor", 20), J, torque, start, duration))
        assert relative(end, random_end(seed)) <= bound
        assert count <= most * (1.0 + duration)


SPIN_UP = (
    np.diag([1.0, 2.0, 3.0]),
    np.array([0.01, -0.02, 0.015]),
    np.array([1.0, 0.0, 0.0, 0.0, *RATES]),
)


@cache
def spin_up_end() -> tuple[Number, ...]:
    return tuple(by_series("principal", *SPIN_UP, 40.0))


@pytest.mark.parametrize(
    ("tolerance", "method", "most"), [(1e-6, "dop853", 82), (1e-9, "taylor", 128), (1e-12, "taylor", 116)]
)
def test_constant_torque_takes_few_steps(tolerance: float, method: str, most: int) -> None:
    # 36 rad in 40 s. The numbers of steps are those measured, and a few more.
    J, torque, start = SPIN_UP
    one = for_tolerance("principal", method, tolerance)
    end, count = controlled(one, J, torque, start, 40.0, tolerance=tolerance, safety=SAFETY[method])
    assert relative(end, spin_up_end()) <= tolerance
    assert count <= most


TOLERANCES = (0.1, 1e-3, 1e-4, 1e-6, 1e-9, 1e-12, 1e-15, 1e-300)


def test_order_grows_with_the_digits_asked_for() -> None:
    assert [taylor_order(t) for t in TOLERANCES] == [6, 8, 10, 12, 16, 20, 20, 20]


# Where something vanishes

SPINS = {
    "rest": np.zeros(3),
    "about x": np.array([0.5, 0.0, 0.0]),
    "about y": np.array([0.0, 0.5, 0.0]),
    "about z": np.array([0.0, 0.0, 0.5]),
    "slow": np.full(3, 1e-200),
    "any": RATES,
}
BODIES = {"spherical": (1.0, 1.0, 1.0), "symmetric": (1.0, 1.0, 2.0), "flat": (1.0, 2.0, 3.0)}


@cache
def differentiated(law: str, method: str) -> tuple[ca.Function, ca.Function]:
    function = step(law, method, 8).function
    return function.forward(1), function.reverse(1)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("spin", SPINS)
def test_values_and_derivatives_are_finite(spin: str, method: str, law: str) -> None:
    one = step(law, method, 8)
    forward, reverse = differentiated(law, method)
    for moments in BODIES.values():
        numbers = one.numbers(np.diag(moments))
        for torque in (np.zeros(3), np.array([0.1, 0.0, 0.0]), TORQUE):
            for h in (0.0, 0.3, -0.3):
                given = [np.concatenate([ATTITUDE, SPINS[spin]]), torque, numbers, h]
                end, error = one.function(*given)
                assert np.isfinite(np.array(end)).all()
                assert np.isfinite(np.array(error)).all()
                seeds = [np.ones(np.shape(x)) for x in given]
                tangent = forward(*given, end, error, *seeds)
                adjoint = reverse(*given, end, error, np.ones(7), np.ones(2))
                for value in (*tangent, *adjoint):
                    assert np.isfinite(np.array(value)).all()


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("method", METHODS)
def test_step_back_returns_to_the_start(method: str, law: str) -> None:
    # Either way the error is no more than estimated; it all cancels but for a share of the angle.
    one = step(law, method, 8)
    numbers = one.numbers(TILTED)
    there, error = one(START, TORQUE, numbers, 0.2)
    back, error_back = one(there, TORQUE, numbers, -0.2)
    most = 2.0 * (error + error_back)
    assert 2.0 * np.linalg.norm(back[:4] - START[:4]) <= most[0] + 0.2 * most[1] + 40 * U
    assert np.linalg.norm(back[4:] - START[4:]) <= most[1] + 10 * U
