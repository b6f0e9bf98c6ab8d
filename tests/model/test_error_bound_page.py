"""The numbered equations of model/docs/error_bound.md with mpmath at 30 digits, not by the library."""

import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest

from supervessel.rotation.error_bound import (
    carried,
    centre_motion,
    constants,
    functions,
    remainder,
)
from supervessel.rotation.error_bound import majorants as scalar_problems
from supervessel.rotation.error_bound.remainder import RK4_STAGES, RK4_WEIGHTS, remainder_of
from supervessel.rotation.propagators import dop853
from supervessel.twin import bounds

mp = mpmath.mp.clone()
mp.dps = 30
CLOSE = mp.mpf(10) ** -26  # of sums of some tens of products of numbers about 1

SEEDS = range(6)


def vector(random: np.random.Generator) -> Any:
    return mp.matrix([mp.mpf(float(x)) for x in random.normal(size=3)])


def tensor(random: np.random.Generator) -> Any:
    """Returns a positive definite matrix."""
    A = mp.matrix(3, 3)
    for i in range(3):
        A[:, i] = vector(random)
    return A.T * A + mp.eye(3) / 5


def cross(a: Any, b: Any) -> Any:
    return mp.matrix([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def skew(a: Any) -> Any:
    return mp.matrix([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def dot(a: Any, b: Any) -> Any:
    return (a.T * b)[0]


def symmetric_part(J: Any, w: Any) -> Any:
    L = mp.cholesky(J)
    product = -(L**-1) * skew(w) * L
    return (product + product.T) / 2


@pytest.mark.parametrize("seed", SEEDS)
def test_torque_and_all_but_a_symmetric_form_cancel_in_the_energy_of_the_error(seed: int) -> None:
    """[EB] eqs. (1) to (4): e . J e' of two motions, whatever the cheap acceleration is."""
    random = np.random.default_rng(seed)
    J, w, omega, M, h, a = tensor(random), *(vector(random) for _ in range(5))
    true = J**-1 * (M - cross(omega, J * omega + h))
    e, delta = w - omega, J * a - M + cross(w, J * w + h)
    L = mp.cholesky(J)
    v = L.T * e
    rate = dot(e, J * (a - true))
    assert abs(rate - dot(v, symmetric_part(J, w) * v) - dot(v, L**-1 * delta)) < CLOSE * 1000
    assert abs(dot(v, v) - dot(e, J * e)) < CLOSE * 100


@pytest.mark.parametrize("seed", SEEDS)
def test_form_by_principal_axes_and_its_sign(seed: int) -> None:
    """[EB] eqs. (5), (9), (11)."""
    random = np.random.default_rng(seed)
    J, w = tensor(random), vector(random)
    values, axes = mp.eigsy(J)
    if mp.det(axes) < 0:
        axes[:, 2] = -axes[:, 2]
    u = axes.T * w
    S = mp.matrix(3, 3)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        S[i, j] = S[j, i] = u[k] * (values[j] - values[i]) / (2 * mp.sqrt(values[i] * values[j]))
    here, there = (mp.eigsy(A, eigvals_only=True) for A in (S, symmetric_part(J, w)))
    assert all(abs(a - b) < CLOSE * 1000 for a, b in zip(here, there, strict=True))
    assert abs(max(here) + min(here)) > 1e-4  # with the other sign the largest one is another
    p = sum(S[i, j] ** 2 for i in range(3) for j in range(3)) / 6
    x = mp.det(S) / 2 / p ** mp.mpf("1.5")
    assert abs(2 * mp.sqrt(p) * mp.cos(mp.acos(x) / 3) - max(here)) < CLOSE * 1000
    box = [abs(c) for c in w]
    unit = [symmetric_part(J, mp.matrix([int(i == k) for i in range(3)])) for k in range(3)]
    sizes = [
        sum(b * abs(A[i, j]) for b, A in zip(box, unit, strict=True)) for i in range(3) for j in range(3)
    ]
    assert max(here) <= mp.sqrt(sum(size**2 for size in sizes))


def test_cosine_from_above_after_an_even_number_of_steps() -> None:
    """[EB] eq. (10): never below, at most 1e-5 above, and below after an odd number."""
    worst = mp.mpf(0)
    for i in range(2001):
        x = mp.mpf(i) / 1000 - 1
        right = mp.cos(mp.acos(x) / 3)
        c = min(mp.mpf(1), (1 + mp.sqrt((1 + x) * 2 / 3)) / 2)
        assert c >= right - CLOSE
        for n in range(1, constants.COSINE_STEPS + 1):
            c = (1 + mp.sqrt((1 + x) / (1 + c))) / 2
            assert (c - right) * (-1) ** n >= -CLOSE
        worst = max(worst, c - right)
    print(f"cosine at most {float(worst):.1e} too large")
    assert worst < 1e-5


@pytest.mark.parametrize("seed", SEEDS)
def test_control_points_are_those_of_the_residual_on_a_line(seed: int) -> None:
    """[EB] eq. (17): the polynomial of Bernstein's form is delta at any time."""
    random = np.random.default_rng(seed)
    J, w, slope, M, h = tensor(random), *(vector(random) for _ in range(4))
    step = mp.mpf("0.7")
    w1 = w + step * slope
    H0, H1, f = J * w + h, J * w1 + h, J * slope - M
    points = (f + cross(w, H0), f + (cross(w, H1) + cross(w1, H0)) / 2, f + cross(w1, H1))
    for s in (mp.mpf(0), mp.mpf("0.3"), mp.mpf("0.8"), mp.mpf(1)):
        at = w + s * step * slope
        right = J * slope - M + cross(at, J * at + h)
        mixed = (1 - s) ** 2 * points[0] + 2 * s * (1 - s) * points[1] + s**2 * points[2]
        assert mp.norm(right - mixed) < CLOSE * 1000


@pytest.mark.parametrize("seed", SEEDS)
def test_reach_by_energy(seed: int) -> None:
    """[EB] eq. (13): |w_i| <= sqrt((D^-1)_ii) |w|_D, met where D w is along e_i."""
    random = np.random.default_rng(seed)
    D = tensor(random)
    inverse = D**-1
    for i in range(3):
        w = vector(random)
        assert abs(w[i]) <= mp.sqrt(inverse[i, i]) * mp.sqrt(dot(w, D * w)) + CLOSE
        along = inverse[:, i]
        assert abs(abs(along[i]) - mp.sqrt(inverse[i, i]) * mp.sqrt(dot(along, D * along))) < CLOSE * 1000


@pytest.mark.parametrize("seed", SEEDS)
def test_factors_of_a_change(seed: int) -> None:
    """[EB] eqs. (6), (21), (22)."""
    random = np.random.default_rng(seed)
    before, after, e, d = tensor(random), tensor(random), vector(random), vector(random)
    size = mp.sqrt(dot(e, before * e))

    def largest(A: Any, B: Any) -> Any:
        """Returns the largest eigenvalue of A^-1 B."""
        inverse = mp.cholesky(A) ** -1
        return max(mp.eigsy(inverse * B * inverse.T, eigvals_only=True))

    assert mp.sqrt(dot(e, after * e)) <= mp.sqrt(largest(before, after)) * size
    jumped = after**-1 * (before * e + d)
    bound = mp.sqrt(largest(after, before)) * size + mp.sqrt(dot(d, after**-1 * d))
    assert mp.sqrt(dot(jumped, after * jumped)) <= bound
    assert mp.norm(e) <= mp.sqrt(largest(before, mp.eye(3))) * size


Series = list[Any]
TERMS = 80  # of the majorants of this check: what is left out is below 1e-30 at the limits of z


def times(a: Series, b: Series) -> Series:
    return [sum((a[i] * b[k - i] for i in range(k + 1)), mp.mpf(0)) for k in range(TERMS)]


def shifted(a: Series) -> Series:
    return [mp.mpf(1), *a[: TERMS - 1]]


def majorants(stages: Any, weights: Any) -> tuple[Series, Series]:
    """Returns the series of V and Q after a step with the weights' sizes. [EB] eq. (25)."""
    speeds: list[tuple[Series, Series]] = []

    def reached(stage: Any, part: int) -> Series:
        total = [mp.mpf(0)] * TERMS
        for j, weight in stage.items():
            total = [a + abs(mp.mpf(weight)) * b for a, b in zip(total, speeds[j][part], strict=True)]
        return shifted(total)

    for stage in stages:
        V, Q = reached(stage, 0), reached(stage, 1)
        speeds.append((times(V, V), [2 * c for c in times(Q, V)]))
    return reached(weights, 0), reached(weights, 1)


@pytest.mark.parametrize(("method", "order"), [("rk4", 4), ("dop853", 8), ("taylor", 6), ("taylor", 20)])
def test_constants_of_the_remainder_are_sums_of_tails(method: str, order: int) -> None:
    """[EB] eqs. (26), (27): term by term, against the library's constants, at the limit and below it."""
    constants = remainder_of(method, order)
    assert constants.power == order + 1
    V, Q = [mp.mpf(1)] * TERMS, [mp.mpf(k + 1) for k in range(TERMS)]
    if method != "taylor":
        table = (RK4_STAGES, RK4_WEIGHTS) if method == "rk4" else (dop853.STAGES, dop853.WEIGHTS)
        own = majorants(*table)
        V, Q = ([a + b for a, b in zip(*pair, strict=True)] for pair in zip((V, Q), own, strict=True))
    for z in (mp.mpf(constants.limit), mp.mpf(constants.limit) / 8):
        for series, found in ((V, constants.rate), (Q, constants.turn)):
            tail = sum(c * z**k for k, c in enumerate(series) if k > order) / z ** (order + 1)
            assert tail <= found
            if z == constants.limit and method != "dop853":
                assert found < 1.01 * tail


def test_majorant_of_the_law_is_the_square_of_a_shifted_one() -> None:
    """[EB] eq. (24)."""
    random = np.random.default_rng(1)
    for _ in range(100):
        alpha, beta, g, y = (mp.mpf(float(x)) for x in random.exponential(size=4))
        shift = max(mp.sqrt(alpha / g), beta / (2 * g))
        assert alpha + beta * y + g * y * y <= g * (y + shift) ** 2 + CLOSE


@pytest.mark.parametrize("seed", SEEDS)
def test_gradients_of_two_attitudes_and_what_a_law_leaves_out_of_one(seed: int) -> None:
    """[EB] eqs. (43) to (46): bounds by moments; the residual, and how far it goes with the direction."""
    random = np.random.default_rng(seed)
    J = tensor(random)
    D = mp.diag([J[i, i] for i in range(3)])
    L, moments = mp.cholesky(J), mp.eigsy(J, eigvals_only=True)
    a, b = (x / mp.norm(x) for x in (vector(random), vector(random)))
    if seed % 2:
        b = a + b / 1000
        b /= mp.norm(b)
    theta = 2 * mp.asin(mp.norm(a - b) / 2)

    def torque(K: Any, n: Any) -> Any:
        return cross(n, K * n)

    apart = L**-1 * (torque(J, a) - torque(J, b))
    assert mp.norm(apart) <= (moments[2] - moments[0]) / mp.sqrt(moments[0]) * theta
    least, largest = min(D[i, i] for i in range(3)), max(D[i, i] for i in range(3))
    assert mp.norm(mp.cholesky(D) ** -1 * torque(D, a)) <= (largest - least) / (2 * mp.sqrt(least))

    def left(x: Any, y: Any) -> Any:
        """P of (45), made symmetric."""
        sums = [(cross(x, K * y) + cross(y, K * x)) / 2 for K in (D, J)]
        return L**-1 * (J * D**-1 * sums[0] - sums[1])

    omega, M = vector(random), vector(random)
    w_dot = D**-1 * (M + torque(D, a) - cross(omega, D * omega))
    delta = J * w_dot - M - torque(J, a) + cross(omega, J * omega)
    without = J * D**-1 * (M - cross(omega, D * omega)) - M + cross(omega, J * omega)
    assert mp.norm(L**-1 * (delta - without) - left(a, a)) < CLOSE
    units = [mp.matrix([int(i == j) for j in range(3)]) for i in range(3)]
    rho = mp.sqrt(sum(mp.norm(left(x, y)) ** 2 for x in units for y in units))
    s0, s1 = mp.mpf("0.9"), mp.mpf("1.2")
    moved = mp.norm(s1 * left(b, b) - s0 * left(a, a))
    assert moved <= rho * (2 * s1 * min(theta, 1) + (s1 - s0))


def test_angle_and_energy_that_drive_each_other_are_bounded_from_above() -> None:
    """[EB] eq. (50), against the solution of the linear system as a series, close for short steps."""
    random = np.random.default_rng(4)
    for number in range(200):
        lam, gamma, k, r, h, e0, t0 = (mp.mpf(float(x)) for x in random.uniform(0, 1, size=7))
        h *= mp.mpf(10) ** -(number % 4)
        A = mp.matrix([[lam, gamma, r], [k, 0, 0], [0, 0, 0]])
        energy, angle, _ = mp.expm(A * h) * mp.matrix([e0, t0, 1])
        E = mp.exp(lam * h)
        B = h * (1 + E) / 2
        zeta = B * gamma * k * h / 4
        e1 = ((E + zeta) * e0 + B * (r + gamma * t0)) / (1 - zeta)
        t1 = t0 + k * h * (e0 + e1) / 2
        assert energy <= e1 <= energy + h**3 * (e0 + t0 + r) + CLOSE
        assert angle <= t1 <= angle + h**3 * (e0 + t0 + r) + CLOSE


def orbiting_series(count: int) -> list[list[Any]]:
    """Returns coefficients of V, Q, X and Y of [EB] eq. (48), found one after the other."""
    parts = [[mp.mpf(1)] for _ in range(4)]

    def last(*factors: list[Any]) -> Any:
        """Returns the last coefficient of a product."""
        product = factors[0]
        for factor in factors[1:]:
            product = [sum(product[j] * factor[i - j] for j in range(i + 1)) for i in range(len(product))]
        return product[-1]

    def raised(s: list[Any], a: Any) -> list[Any]:
        """Returns (2 - s)^a by the binomial series about s = 1."""
        small = [mp.mpf(0), *s[1:]]
        found, term = [mp.mpf(0)] * len(s), [mp.mpf(1)] + [mp.mpf(0)] * (len(s) - 1)
        for n in range(len(s)):
            found = [x + (-1) ** n * mp.binomial(a, n) * y for x, y in zip(found, term, strict=True)]
            term = [sum(term[j] * small[i - j] for j in range(i + 1)) for i in range(len(s))]
        return found

    def squared(s: list[Any]) -> list[Any]:
        return [sum(s[j] * s[i - j] for j in range(i + 1)) for i in range(len(s))]

    for k in range(1, count):
        V, Q, X, Y = parts
        q, x = squared(Q), squared(X)
        psi = last(q, q, x, raised(q, -2), raised(x, mp.mpf(-5) / 2)) - (k == 1)
        rates = (
            last(V, V) + psi / 2,
            last(Q, V) / 2,
            Y[-1] / 2,
            last(X, raised(x, mp.mpf(-3) / 2)) / 2,
        )
        for part, rate in zip(parts, rates, strict=True):
            part.append(rate / k)
    return parts


def test_constants_of_the_remainder_in_orbit_are_those_of_its_majorant() -> None:
    """[EB] eqs. (48), (49): the exact series found another way; values and tails at the limits."""
    V, Q, X, Y = parts = orbiting_series(22)
    known = scalar_problems.exact_series(scalar_problems.turning_in_orbit, 4)
    for part, found in zip(parts, known, strict=True):
        for one, other in zip(part, found, strict=False):
            assert abs(one - mp.mpf(str(other))) <= CLOSE * (1 + one)
        ratios = [float(b / a) for a, b in pairwise(found[4:])]
        assert max(ratios) <= 4.0  # what `exact_tails` asks of limits up to 1/8
    rho = mp.mpf("0.3")
    values = [sum(mp.mpf(str(c)) * rho**i for i, c in enumerate(part)) for part in known]
    limits = (values[0], values[1], values[1] ** 2 * values[3], values[3])
    for value, found in zip(limits, remainder.TAYLOR_VALUES, strict=True):
        assert 0.99 * found < value < found
    assert values[3] > values[2]
    for order in (6, 12, 20):
        constants = remainder_of("taylor", order, in_orbit=True)
        for part, limit in ((known[0], constants.rate), (known[1], constants.turn)):
            z = mp.mpf(constants.limit)
            tail = sum(mp.mpf(str(c)) * z**i for i, c in enumerate(part) if i > order) / z ** (order + 1)
            assert tail <= limit
    assert (len(V), len(Q), len(X), len(Y)) == (22,) * 4


def test_equations_are_numbered_in_order_and_the_code_cites_none_that_is_missing() -> None:
    model = Path(carried.__file__).parents[3]
    page = (model / "docs" / "error_bound.md").read_text(encoding="utf-8")
    tags = [int(number) for number in re.findall(r"\\tag\{(\d+)\}", page)]
    assert tags == list(range(1, len(tags) + 1))
    for module in (carried, centre_motion, constants, functions, scalar_problems, remainder, bounds):
        text = Path(module.__file__).read_text(encoding="utf-8")
        cited = re.findall(r"\[EB\]\s+eqs?\.((?:(?:\s|,|to|and)*\(\d+\))+)", text)
        numbers = {int(number) for group in cited for number in re.findall(r"\d+", group)}
        assert numbers
        assert numbers <= set(tags)
