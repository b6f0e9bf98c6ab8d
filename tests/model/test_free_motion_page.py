"""The numbered equations of model/docs/free_motion.md, with mpmath, for bodies and spins of every kind.

Nothing of the page is taken for granted: Jacobi's functions are mpmath's, integrals are summed by quadrature,
and the whole step is compared with a Taylor integration of Euler's equations.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import casadi as ca
import mpmath as mp
import numpy as np
import pytest

from supervessel.rotation.propagators import free_motion, theta
from support import EPS, hamilton, series

Number = Any  # mpf or mpc
Triple = tuple[Number, Number, Number]

DIGITS = 55
TOLERANCE = mp.mpf(10) ** -40
"""Relative: closest to the separatrix two terms of E agree in 10 digits, rounding is left a margin of 10."""

SUMMED = mp.mpf(10) ** -17
"""The same for an integral that is summed to 20 digits."""

ROUNDING = 64 * EPS
"""Of a constant in double precision: some thirty products and quotients, no sum that cancels."""

THETA_LEFT_OUT = mp.mpf(2) ** -56
"""What the theta series leave out at the largest nome, [FM] eq. (45)."""


@pytest.fixture(autouse=True)
def _precision() -> Any:
    with mp.workdps(DIGITS):
        yield


@dataclass(frozen=True)
class Motion:
    """What [FM] eqs. (2), (3), (6), (22), (25) to (27) say of a motion, in the axes as named there."""

    J: tuple[Number, ...]
    w: tuple[Number, ...]
    exchanged: bool
    flipped: bool

    @cached_property
    def sign(self) -> int:
        return -1 if self.exchanged else 1

    @cached_property
    def P(self) -> Number:
        return self.J[0] * self.J[1] * self.J[2]

    @cached_property
    def L(self) -> tuple[Number, ...]:
        return tuple(a * b for a, b in zip(self.J, self.w, strict=True))

    @cached_property
    def length(self) -> Number:
        return mp.sqrt(sum(x * x for x in self.L))

    @cached_property
    def double_energy(self) -> Number:
        return sum(a * b for a, b in zip(self.L, self.w, strict=True))

    @cached_property
    def G(self) -> Number:
        (a, b, c), (x, y, _) = self.J, self.w
        return a * (c - a) * x**2 + b * (c - b) * y**2

    @cached_property
    def H(self) -> Number:
        (a, b, c), (_, y, z) = self.J, self.w
        return b * (b - a) * y**2 + c * (c - a) * z**2

    @cached_property
    def E(self) -> Number:
        (a, b, c), (x, _, z) = self.J, self.w
        return c * (c - b) * z**2 - a * (b - a) * x**2

    @cached_property
    def A(self) -> Number:
        return self.H * (self.J[2] - self.J[1]) / self.P

    @cached_property
    def B(self) -> Number:
        return self.G * (self.J[1] - self.J[0]) / self.P

    @cached_property
    def peak(self) -> Number:
        J0, J1, J2 = self.J
        return mp.sqrt(self.L[2] ** 2 + J1 * J2 * (J1 - J0) / (J2 - J0) * self.w[1] ** 2)

    @cached_property
    def mean(self) -> Number:
        return (self.double_energy + self.length * self.peak / self.J[2]) / (self.length + self.peak)

    @cached_property
    def lean(self) -> Number:
        return (self.J[2] - self.J[0]) / (self.J[0] * self.J[2])

    @cached_property
    def N(self) -> Number:
        return (self.J[1] - self.J[0]) * self.H / (self.J[0] ** 2 * self.J[1])

    @cached_property
    def c(self) -> Number:
        return self.length * self.lean * self.N

    @cached_property
    def r(self) -> Number:
        return self.peak * self.lean

    @cached_property
    def nome(self) -> Number:
        return mp.qfrom(m=self.B / self.A)

    def triple(self, t: Number) -> tuple[Number, Number, Number]:
        """Returns S, C, D by mpmath's Jacobi functions, [FM] eq. (9)."""
        root = mp.sqrt(self.A)
        sn, cn, dn = (mp.ellipfun(name, root * t, q=self.nome) for name in ("sn", "cn", "dn"))
        return sn / root, cn, dn

    def path(self, t: Number) -> Number:
        """Returns C + i r S."""
        S, C, _ = self.triple(t)
        return C + 1j * self.r * S

    def start_time(self) -> Number:
        """Returns the time from S = 0 to the start, from S and C there."""
        J0, J1, J2 = self.J
        x, y = self.w[0] * mp.sqrt(abs(J0 * (J2 - J0))), self.sign * self.w[1] * mp.sqrt(abs(J1 * (J2 - J1)))
        return mp.re(mp.ellipf(mp.atan2(y, x), self.B / self.A)) / mp.sqrt(self.A)


@cache
def motion(moments: Any, rates: Any) -> Motion:
    """Returns the motion in the axes as named by [FM] eqs. (4), (5)."""
    J0, J1, J2 = (mp.mpf(x) for x in moments)
    w0, w1, w2 = (mp.mpf(x) for x in rates)
    exchanged = bool(J2 * (J2 - J1) * w2**2 < J0 * (J1 - J0) * w0**2)
    if exchanged:
        J0, J2, w0, w1, w2 = J2, J0, w2, -w1, w0
    flipped = bool(w2 < 0)
    if flipped:
        w1, w2 = -w1, -w2
    return Motion((J0, J1, J2), (w0, w1, w2), exchanged, flipped)


GENERAL = ("0.3", "0.6", "0.7")
SEPARATRIX = mp.sqrt(mp.mpf("0.3") * mp.mpf("0.3") / (mp.mpf("0.7") * mp.mpf("0.1")))  # w2/w0 for GENERAL


def random_cases(count: int) -> dict[str, tuple[Any, Any]]:
    random = np.random.default_rng(15)
    found = {}
    for i in range(count):
        moments = np.sort(random.uniform(0.05, 1.0, 3))
        moments[2] = min(moments[2], 0.999 * (moments[0] + moments[1]))
        found[f"random {i}"] = (tuple(sorted(moments.tolist())), tuple(random.normal(size=3).tolist()))
    return found


CASES: dict[str, tuple[Any, Any]] = {
    "about axis 2": (GENERAL, ("0.1", "-0.2", "0.8")),
    "about axis 2, negative": (GENERAL, ("0.1", "0.2", "-0.8")),
    "about axis 0": (GENERAL, ("0.9", "-0.2", "-0.1")),
    "slender": (("1e-6", "0.7", "0.7000005"), ("0.9", "0.2", "0.3")),
    "about a light axis": (("1e-6", "0.7", "0.700001"), ("1", "0.5", "0.999")),
    "flat": (("0.25", "0.5", "0.75"), ("0.3", "0.7", "0.5")),
    "nearly oblate": (("0.3999999999", "0.4", "0.7"), ("0.3", "0.7", "0.5")),
    "nearly prolate": (("0.3", "0.6", "0.6000000001"), ("0.3", "0.7", "0.5")),
    "nearly steady about axis 2": (GENERAL, ("1e-5", "2e-5", "0.8")),
    "above the separatrix": (GENERAL, ("0.3", "0.7", 0.3 * float(SEPARATRIX) * (1 + 1e-10))),
    "below the separatrix": (GENERAL, ("-0.3", "0.7", 0.3 * float(SEPARATRIX) * (1 - 1e-10))),
    **random_cases(2),
}
TIMES = mp.mpf("0.37"), mp.mpf("-2.3")
SOME = ("about axis 0", "random 1")
every_case = pytest.mark.parametrize("name", CASES)


def close(a: Number, b: Number, scale: Number = 0, tolerance: Number = TOLERANCE) -> None:
    assert abs(a - b) <= tolerance * max(abs(a), abs(b), scale), mp.nstr(a - b, 5)


@every_case
def test_differences_of_moments_give_the_invariants(name: str) -> None:
    """[FM] eqs. (3), (6), (7)."""
    m = motion(*CASES[name])
    J0, J1, J2 = m.J
    square, energy = m.length**2, m.double_energy
    close(m.G, energy * J2 - square, square)
    close(m.H, square - energy * J0, square)
    close(m.E, square - energy * J1, square)
    close(m.A - m.B, m.E * (J2 - J0) / m.P, m.A)
    assert m.A >= m.B >= 0
    assert m.A > 0
    assert m.w[2] >= 0


@every_case
def test_jacobi_triple_solves_its_equations_and_euler_s(name: str) -> None:
    """[FM] eqs. (1), (7), (8), (9) and (18) with d of (17), from the start of the motion, at any time."""
    m = motion(*CASES[name])
    (J0, J1, J2), (w0, w1, w2) = m.J, m.w
    a0, a1, a2 = (
        mp.sqrt(x) for x in (m.G / (J0 * (J2 - J0)), m.G / (J1 * (J2 - J1)), m.H / (J2 * (J2 - J0)))
    )
    t0 = m.start_time()
    for t in TIMES:
        S, C, D = m.triple(t)
        close(C**2 + m.A * S**2, 1)
        close(D**2 + m.B * S**2, 1)
        S1, C1, D1 = m.triple(t0 + t)
        rates = a0 * C1, m.sign * a1 * mp.sqrt(m.A) * S1, a2 * D1
        d, v = rates_at(m, (S, C, D))
        for found, right in zip(v, rates, strict=True):
            close(found, right, mp.sqrt(w0**2 + w1**2 + w2**2))
        S0 = m.triple(t0)[0]
        close(d, 1 - m.A * m.B * S**2 * S0**2)


def rates_at(m: Motion, triple: Triple) -> tuple[Number, Triple]:
    """Returns d and the rates at the time of a triple, [FM] eqs. (17), (18)."""
    (J0, J1, J2), (w0, w1, w2), (S, C, D) = m.J, m.w, triple
    e0, e1, e2 = euler(m, m.w)
    d = C**2 + S**2 * w2**2 * (J2 - J0) * (J2 - J1) / (J0 * J1)
    return d, ((w0 * C + e0 * S * D) / d, (w1 * C * D + e1 * S) / d, (w2 * D + e2 * S * C) / d)


def euler(m: Motion, w: tuple[Number, ...]) -> tuple[Number, Number, Number]:
    """Returns the derivatives of the rates, [FM] eq. (1)."""
    J0, J1, J2 = m.J
    return (J1 - J2) / J0 * w[1] * w[2], (J2 - J0) / J1 * w[2] * w[0], (J0 - J1) / J2 * w[0] * w[1]


def coefficients(m: Motion, count: int) -> dict[int, Number]:
    """Returns h and c_2, c_3, ... of [FM] eqs. (11) to (13)."""
    h = (4 * m.A + m.B) / 12
    g2 = 12 * h**2 - 2 * m.A * m.B
    g3 = 8 * h**3 - 2 * h * m.A * m.B + m.A * m.B**2 / 4
    c = {1: h, 2: g2 / 20, 3: g3 / 28}
    for n in range(4, count):
        c[n] = 3 * sum(c[k] * c[n - k] for k in range(2, n - 1)) / mp.mpf((2 * n + 1) * (n - 3))
    return c


@every_case
def test_series_of_weierstrass_s_function_gives_the_triple(name: str) -> None:
    """[FM] eqs. (10) to (14), at a phase of a quarter."""
    m = motion(*CASES[name])
    t = mp.mpf(free_motion.FIRST_ANGLE) / mp.sqrt(m.A)
    S, C, D = m.triple(t)
    for found, right in zip(triple_by_series(m, t), (S, C, D), strict=True):
        close(found, right)
    v = (1 - D) / m.B
    slope = S * C
    close(slope**2, v * (2 - m.B * v) * (1 - 2 * m.A * v + m.A * m.B * v**2))


def triple_by_series(m: Motion, t: Number) -> Triple:
    """Returns S, C, D, [FM] eqs. (13), (14); 29 terms leave (1/4/pi)^60 = 1e-66."""
    v = t**2 / 2 / (1 + sum(x * t ** (2 * n) for n, x in coefficients(m, 30).items()))
    square = v * (2 - m.B * v)
    return mp.sign(t) * mp.sqrt(square), mp.sqrt(1 - m.A * square), 1 - m.B * v


@pytest.mark.parametrize("name", SOME)
def test_series_of_chi_is_its_integral(name: str) -> None:
    """[FM] eqs. (23), (24)."""
    m = motion(*CASES[name])
    t = mp.mpf(free_motion.FIRST_ANGLE) / mp.sqrt(m.A)
    close(chi_by_series(m, t), chi(m, t), abs(m.mean * t), SUMMED)


def chi_by_series(m: Motion, t: Number, highest: int = 39, terms: int = 39) -> Number:
    """Returns chi, [FM] eq. (24), at a phase of FIRST_ANGLE or less.

    The nearest pole is at a phase of pi/2 or beyond: 39 terms leave (1/2/pi)^78 = 1e-62 of it.

    highest : index of the last c_n that is used
    terms   : of the integrated series
    """
    c = coefficients(m, highest + 1)
    c[1] -= m.peak / (m.length + m.peak) * m.B / 2
    inverse = [mp.mpf(1)]
    for n in range(1, terms):
        inverse.append(-sum(c[k] * inverse[n - k] for k in range(1, min(n, highest) + 1)))
    integral = t**3 / 2 * sum(x * t ** (2 * n) / (2 * n + 3) for n, x in enumerate(inverse))
    return m.G * m.B * m.peak / (m.J[2] * (m.length + m.peak) ** 2) * integral


@every_case
def test_terms_that_the_code_leaves_out_are_below_rounding(name: str) -> None:
    """[FM] eqs. (13), (24): with as many terms as the code has."""
    m = motion(*CASES[name])
    t = mp.mpf(free_motion.FIRST_ANGLE) / mp.sqrt(m.A)
    c = coefficients(m, 30)
    left = sum(abs(x) * t ** (2 * n) for n, x in c.items() if n > free_motion.SERIES_TERMS)
    assert left <= EPS / 16
    short = chi_by_series(m, t, free_motion.SERIES_TERMS, free_motion.INTEGRAL_TERMS)
    whole = chi_by_series(m, t)
    assert abs(short - whole) <= EPS / 16 * abs(m.mean * t)
    # half the mean of 1 - sech over the phase, for J0 = J1 + J2 and a small J2 on the separatrix, is the most
    phase = mp.mpf(free_motion.FIRST_ANGLE)
    assert abs(whole) <= (1 - 2 * mp.atan(mp.tanh(phase / 2)) / phase) / 2 * abs(m.mean * t)


def chi_rate(m: Motion, t: Number) -> Number:
    """Returns the rate of chi, [FM] eq. (23)."""
    D = m.triple(t)[2]
    return m.G * m.peak / (m.J[2] * (m.length + m.peak)) * (1 - D) / (m.length + m.peak * D)


def summed(f: Callable[[Number], Number], a: Number, b: Number) -> Number:
    with mp.workdps(20):
        return mp.quad(f, [a, b])


def chi(m: Motion, t: Number) -> Number:
    return summed(lambda s: chi_rate(m, s), 0, t)


@every_case
def test_triple_of_twice_the_time(name: str) -> None:
    """[FM] eq. (15)."""
    m = motion(*CASES[name])
    for t in TIMES:
        (S, C, D), twice = m.triple(t), m.triple(2 * t)
        den = C**2 + m.A * S**2 * D**2
        p, q = C**2 * D**2, (m.A - m.B) * S**2
        close(2 * S * C * D / den, twice[0], 1 / mp.sqrt(m.A))
        close((p - q) / den, twice[1], 1)
        close((p + q) / den, twice[2])


@every_case
def test_rates_of_the_angles(name: str) -> None:
    """[FM] eqs. (21) to (23), (25), (28) to (30), at any state of the body."""
    m = motion(*CASES[name])
    J2, length, energy = m.J[2], m.length, m.double_energy
    L0, L1, L2 = m.L
    w2 = m.w[2]
    psi_rate = (energy + length * w2) / (length + L2)
    e0, e1, _ = euler(m, m.w)
    turning = (L0 * m.J[1] * e1 - L1 * m.J[0] * e0) / (L0**2 + L1**2)
    close(turning, (energy * L2 - length**2 * w2) / (length**2 - L2**2))
    precession = length * (energy - w2 * L2) / (length**2 - L2**2)
    close(precession - turning, psi_rate)
    close(m.peak**2, J2 * m.H / (J2 - m.J[0]))
    for t in TIMES:
        S, C, D = m.triple(t)
        reference = (energy + length * m.peak * D / J2) / (length + m.peak * D)
        close(m.mean + chi_rate(m, t), reference)
        close(C**2 + m.r**2 * S**2, 1 + m.N * S**2)
        arm = m.r * D / (1 + m.N * S**2)
        close(length / m.J[0] - m.c * S**2 / (1 + m.N * S**2) - arm, reference, length / m.J[0])


@every_case
def test_coefficient_of_the_third_kind(name: str) -> None:
    """[FM] eqs. (26), (27)."""
    m = motion(*CASES[name])
    J0, J1, J2 = m.J
    close(m.N + m.A, m.r**2)
    close(m.N + m.B, m.length**2 * (J1 - J0) * (J2 - J0) / (J0**2 * J1 * J2))
    close(m.c**2, m.N * (m.N + m.A) * (m.N + m.B))


def quotient(m: Motion, u: Number, v: Number) -> Number:
    """Returns Z of [FM] eq. (33)."""
    S, C, D = m.triple(u + v)
    s = m.triple(u)[0] * m.triple(v)[0]
    return 1 + m.N * (S**2 - s * C * D) - 1j * m.c * s * S


@every_case
def test_identities_that_prove_the_addition_theorem(name: str) -> None:
    """[FM] eqs. (32), (34), (35)."""
    m = motion(*CASES[name])
    for u in TIMES:
        v = mp.mpf("0.81")
        (Su, Cu, Du), (Sv, Cv, Dv), (Sw, Cw, Dw) = m.triple(u), m.triple(v), m.triple(u + v)
        scale = 1 / m.A
        close(Sw**2 - 2 * Su * Sv * Cw * Dw + m.A * m.B * (Su * Sv * Sw) ** 2, Su**2 + Sv**2, scale)
        close(Sw * (Sv * Cu * Du - Su * Cv * Dv), Sv**2 - Su**2, scale)
        Z = quotient(m, u, v)
        close(abs(Z) ** 2, (1 + m.N * Su**2) * (1 + m.N * Sv**2) * (1 + m.N * Sw**2))


@pytest.mark.parametrize("name", SOME)
def test_doubling_and_shift_take_one_argument_each(name: str) -> None:
    """[FM] eqs. (31), (36) to (38): principal arguments, against integrals of the rates."""
    m = motion(*CASES[name])
    t0 = m.start_time()
    for t in TIMES[1:]:
        once, twice = chi(m, t), chi(m, 2 * t)
        product = quotient(m, t, t) * m.path(t) ** 2 * mp.conj(m.path(2 * t))
        close(2 * once + mp.arg(product), twice, abs(m.mean * t), SUMMED)
        along = m.mean * t + summed(lambda s: chi_rate(m, s), t0, t0 + t)
        close(psi(m, t, m.triple(t), once), along, abs(m.mean * t), SUMMED)


def psi(m: Motion, t: Number, triple: Triple, chi_there: Number) -> Number:
    """Returns psi, [FM] eq. (38)."""
    J0, J1, J2 = m.J
    S, C, _ = triple
    v = rates_at(m, triple)[1]
    slope = euler(m, v)[1]
    f = (J1 - J0) * J1 / J0
    GZ = (
        m.G
        + f * J2 * (v[1] ** 2 - S * m.w[1] * slope)
        - 1j * m.length * f * (J2 - J0) / J0 * S * m.w[1] * v[1]
    )
    before, after = J0 * m.w[0] + 1j * J1 * m.w[1], J0 * v[0] + 1j * J1 * v[1]
    product = m.sign * GZ * (C + 1j * m.r * S) * mp.conj(after) * before
    return m.mean * t + chi_there + mp.arg(product)


def by_doublings(m: Motion, t: Number) -> tuple[Triple, Number]:
    """Returns S, C, D and chi by [FM] eqs. (13) to (15), (24), (37): no Jacobi function of mpmath's."""
    count = max(0, int(mp.ceil(mp.log(abs(t) * mp.sqrt(m.A) / free_motion.FIRST_ANGLE, 2))))
    share = t / 2**count
    (S, C, D), value = triple_by_series(m, share), chi_by_series(m, share)
    for _ in range(count):
        den = C**2 + m.A * S**2 * D**2
        p, q = C**2 * D**2, (m.A - m.B) * S**2
        S2, C2, D2 = 2 * S * C * D / den, (p - q) / den, (p + q) / den
        Z = 1 + m.N * (S2**2 - S**2 * C2 * D2) - 1j * m.c * S**2 * S2
        value = 2 * value + mp.arg(Z * (C + 1j * m.r * S) ** 2 * mp.conj(C2 + 1j * m.r * S2))
        S, C, D = S2, C2, D2
    return (S, C, D), value


def shortest(m: Motion, w: tuple[Number, ...]) -> list[Number]:
    """Returns p, not normalised, [FM] eq. (20)."""
    L0, L1, L2 = (a * b for a, b in zip(m.J, w, strict=True))
    return [m.length + L2, L1, -L0, mp.mpf(0)]


def turn_of(m: Motion, w: tuple[Number, ...], angle: Number) -> list[Number]:
    """Returns the turn in principal axes, [FM] eqs. (19), (20), with (4), (5) undone."""
    first, last = shortest(m, m.w), shortest(m, w)
    half = [mp.cos(angle / 2), mp.mpf(0), mp.mpf(0), mp.sin(angle / 2)]
    q = hamilton(hamilton([first[0], *(-x for x in first[1:])], half), last)
    size = mp.sqrt(sum(x * x for x in q))
    return [q[0] / size, *(x / size for x in undone(m, q[1:]))]


def undone(m: Motion, vector: Any) -> list[Number]:
    x, y, z = vector
    if m.flipped:
        y, z = -y, -z
    return [z, -y, x] if m.exchanged else [x, y, z]


@every_case
def test_whole_step_is_the_motion(name: str) -> None:
    """[FM] eqs. (15) to (24), (37), (38), signs included, against a Taylor integration."""
    m = motion(*CASES[name])
    t = mp.mpf(8)
    triple, along = by_doublings(m, t)
    rates = rates_at(m, triple)[1]
    found = [*turn_of(m, rates, psi(m, t, triple, along)), *undone(m, rates)]
    for a, b in zip(found, taylor(*CASES[name], t), strict=True):
        # 39 terms of the integral's series leave (1/2/pi)^80 = 1e-64
        close(a, b, 1, mp.mpf(10) ** -36)


def taylor(moments: Any, rates: Any, t: Number) -> list[Number]:
    inertia = [[series.mp.mpf(moments[i]) if i == j else series.mp.zero for j in range(3)] for i in range(3)]
    turn, end = series.taylor(
        inertia, [series.mp.mpf(x) for x in rates], [series.mp.zero] * 3, series.mp.mpf(t), 42
    )
    return [mp.mpf(x) for x in turn + end]


COUNT = 8


def test_both_arguments_stay_within_half_a_turn() -> None:
    """[FM] eqs. (37), (38), of random bodies, near the separatrix too; 1 stands for half a turn."""
    random = np.random.default_rng(4)
    worst = [0.0, 0.0]
    with mp.workdps(20):
        for i in range(COUNT):
            moments = np.sort(random.uniform(0.0, 1.0, 3) ** 3)
            moments[2] = min(moments[2], moments[0] + moments[1])
            rates = random.normal(size=3)
            if i % 2:
                a, b, c = moments
                rates[2] = rates[0] * np.sqrt(a * (b - a) / (c * (c - b))) * (1 + 1e-4 * random.normal())
            m = motion(tuple(moments.tolist()), tuple(rates.tolist()))
            for phase in random.uniform(0.0, 8.0, 4):
                t = phase / mp.sqrt(m.A)
                product = quotient(m, t, t) * m.path(t) ** 2 * mp.conj(m.path(2 * t))
                shift = psi(m, t, m.triple(t), mp.mpf(0)) - m.mean * t
                worst = [
                    max(a, float(abs(b) / mp.pi))
                    for a, b in zip(worst, (mp.arg(product), shift), strict=True)
                ]
    print(worst)  # in units of pi, of (37) and (38)
    assert max(worst) < 0.5


@every_case
def test_last_argument_is_small_near_a_spin_about_axis_2(name: str) -> None:
    """[FM] eq. (39)."""
    m = motion(*CASES[name])
    bound = mp.ellipk(m.B / m.A) / 2 * abs(m.G) * m.B / (m.J[2] * m.length * m.A ** mp.mpf("1.5"))
    for t in TIMES:
        assert abs(psi(m, t, m.triple(t), mp.mpf(0)) - m.mean * t) <= bound


@dataclass(frozen=True)
class Theta:
    """Constants of [FM] eqs. (40) to (43)."""

    nome: Number
    frequency: Number
    lag: Number
    b: Number


def theta_of(m: Motion) -> Theta:
    parameter = m.B / m.A
    K = mp.ellipk(parameter)
    nome = mp.exp(-mp.pi * mp.ellipk(1 - parameter) / K)
    frequency = mp.pi * mp.sqrt(m.A) / (2 * K)
    rise = mp.sqrt((m.length / m.peak) ** 2 - 1)
    # sn(i y, k) = i tan(am(y, k'))
    y = mp.ellipf(mp.atan(rise / mp.sqrt(parameter)), 1 - parameter)
    return Theta(nome, frequency, frequency * m.start_time(), mp.pi * y / (2 * K))


def argument(m: Motion, k: Theta, v: Number) -> Number:
    """Returns z, [FM] eq. (43)."""
    return mp.jtheta(4, v - 1j * m.sign * k.b, k.nome**2)


@every_case
def test_rates_are_quotients_of_theta_functions(name: str) -> None:
    """[FM] eqs. (40), (41), and the frequency as a mean."""
    m = motion(*CASES[name])
    J0, J1, J2 = m.J
    k = theta_of(m)
    close(k.frequency, mp.agm(mp.sqrt(m.A), mp.sqrt(m.A - m.B)), 0, mp.mpf(10) ** -38)
    nulls = [mp.mpf(0), *(mp.jtheta(n, 0, k.nome) for n in (2, 3, 4))]
    a0, a1 = mp.sqrt(m.G / (J0 * (J2 - J0))), m.sign * mp.sqrt(m.G / (J1 * (J2 - J1)))
    for t in TIMES:
        v = k.frequency * t + k.lag
        one, two, three, four = (mp.jtheta(n, v, k.nome) for n in (1, 2, 3, 4))
        found = (
            a0 * nulls[3] / nulls[1] * two / four,
            a1 * nulls[2] / nulls[1] * one / four,
            m.peak / J2 * nulls[3] / nulls[2] * three / four,
        )
        for a, b in zip(found, rates_at(m, m.triple(t))[1], strict=True):
            close(a, b, m.length / J0, mp.mpf(10) ** -36)


@every_case
def test_angle_is_the_argument_of_a_theta_function(name: str) -> None:
    """[FM] eqs. (42) to (44)."""
    m = motion(*CASES[name])
    k = theta_of(m)
    at_pole = mp.ellipfun("dn", 2j * mp.ellipk(m.B / m.A) * k.b / mp.pi, m=m.B / m.A)
    close(at_pole, m.length / m.peak, 0, mp.mpf(10) ** -36)
    step = mp.mpf(10) ** -25
    slope = mp.im(argument(m, k, step)) / step / mp.re(argument(m, k, mp.mpf(0)))
    half = m.mean / 2 - k.frequency * slope
    for t in TIMES:
        right = psi(m, t, *by_doublings(m, t)) / 2
        v = k.frequency * t + k.lag
        angle = half * t + mp.arg(argument(m, k, v)) - mp.arg(argument(m, k, k.lag))
        # the slope at v = 0 is a difference: its error is of the order of step^2
        close(mp.expj(angle), mp.expj(right), 1, mp.mpf(10) ** -32)


def test_series_kept_are_theta_functions_to_rounding() -> None:
    """[FM] eq. (45), at the largest nome, by the code's own polynomials."""
    q, x = ca.SX.sym("q"), ca.SX.sym("x")
    values = ca.Function("values", [q, x], [ca.vertcat(*theta._Series.of(q).values(ca.cos(2 * x)))])
    nome = theta.LARGEST_NOME
    for v in (0.1, 0.9, 2.0, 3.0):
        third, fourth, second, first = (mp.mpf(float(y)) for y in np.array(values(nome, v)).ravel())
        quarter = 2 * mp.mpf(nome) ** mp.mpf("0.25")
        rounding = 16 * mp.mpf(EPS)
        close(third, mp.jtheta(3, v, nome), 1, rounding)
        close(fourth, mp.jtheta(4, v, nome), 1, rounding)
        close(second, mp.jtheta(2, v, nome) / quarter / mp.cos(v), 1, rounding)
        close(first, mp.jtheta(1, v, nome) / quarter / mp.sin(v), 1, rounding)
    q30, q36, q28 = (mp.mpf(nome) ** n for n in (30, 36, 28))
    assert max(11 * q30, 2 * q36, q28) <= THETA_LEFT_OUT


@every_case
def test_landen_s_transformation_takes_amplitudes_to_v_and_b(name: str) -> None:
    """[FM] eqs. (46) to (48)."""
    m = motion(*CASES[name])
    k = theta_of(m)
    a, b = mp.sqrt(m.A), mp.sqrt(m.A - m.B)
    J0, J1, J2 = m.J
    x, y = m.w[0] * mp.sqrt(abs(J0 * (J2 - J0))), m.sign * m.w[1] * mp.sqrt(abs(J1 * (J2 - J1)))
    angle = amplitude = mp.atan2(y, x)
    parameter, square = m.B / m.A, (m.length / m.peak) ** 2 - 1
    low = square <= mp.sqrt(parameter)
    hyperbolic = mp.sqrt(square / parameter) if low else 1 / mp.sqrt(square)
    size = growth = mp.exp(-2 * mp.asinh(hyperbolic))
    for n in range(1, 10):
        cos, sin = mp.cos(amplitude), mp.sin(amplitude)
        delay = mp.atan2((a - b) * cos * sin, a * cos**2 + b * sin**2)
        amplitude = 2 * amplitude - delay
        angle -= delay / 2**n
        ratio = (a - b) / (a + b)
        growth *= ((1 + ratio / size) / (1 + ratio * size)) ** (mp.mpf(1) / 2**n)
        size = size * (size + ratio) / (1 + ratio * size)
        a, b = (a + b) / 2, mp.sqrt(a * b)
    close(angle, k.lag, 1, mp.mpf(10) ** -36)
    close(growth, mp.exp(-2 * k.b) if low else k.nome * mp.exp(2 * k.b), 0, mp.mpf(10) ** -36)


def test_nome_from_a_mean() -> None:
    """[FM] eq. (49): what is left out is below rounding up to the largest nome."""
    for nome in (mp.mpf(1) / 4, mp.mpf(1) / 100):
        k_dash = mp.sqrt(1 - mp.mfrom(q=nome**2))
        x = (1 - mp.sqrt(k_dash)) / (1 + mp.sqrt(k_dash)) / 2
        found = x + 2 * x**5 + 15 * x**9 + 150 * x**13 + 1707 * x**17
        close(found, nome**2, 0, mp.mpf(EPS) / 8)
    assert abs(mp.mfrom(q=mp.mpf(1) / 4) - mp.mpf("0.987")) < mp.mpf("0.0005")


def test_symmetric_and_steady_motions_have_no_chi() -> None:
    """[FM] eqs. (4), (6), (21), (22) at the motions that the page names."""
    oblate = motion(("0.4", "0.4", "0.7"), ("0.3", "0.7", "0.5"))
    assert oblate.B == 0
    assert oblate.N == 0
    steady = motion(GENERAL, (0, 0, "0.8"))
    close(steady.mean, steady.w[2])
    about_0 = motion(GENERAL, ("0.8", 0, 0))
    assert about_0.exchanged
    close(about_0.mean, mp.mpf("0.8"))
    middle = motion(GENERAL, (0, "0.8", 0))
    assert middle.E == 0
    assert middle.A == middle.B
    close(middle.double_energy / middle.length, mp.mpf("0.8"))


def test_start_of_the_code_holds_the_page_s_constants() -> None:
    """[FM] eqs. (6), (22), (26): S, C, D, chi, then A, B, A - B, N, c, r, length, c0, sign."""
    J, w, t, share = ca.SX.sym("J", 3), ca.SX.sym("w", 3), ca.SX.sym("t"), ca.SX.sym("s")
    start = ca.Function("start", [J, w, t, share], [free_motion.start(J, w, t, share)])
    for moments, rates in (((0.3, 0.6, 0.7), (0.1, -0.2, 0.8)), ((0.3, 0.6, 0.7), (0.9, -0.2, -0.1))):
        m = motion(moments, rates)
        found = [mp.mpf(float(x)) for x in np.array(start(moments, rates, 0.25, 1.0)).ravel()]
        right = [*m.triple(mp.mpf(0.25)), chi(m, mp.mpf(0.25)), m.A, m.B, m.A - m.B, m.N, m.c, m.r]
        right += [m.length, m.mean, mp.mpf(m.sign)]
        for a, b in zip(found, right, strict=True):
            close(a, b, 0, mp.mpf(ROUNDING))


def test_equations_are_numbered_in_order_and_the_code_cites_none_that_is_missing() -> None:
    model = Path(free_motion.__file__).parents[3]
    page = (model / "docs" / "free_motion.md").read_text(encoding="utf-8")
    tags = [int(number) for number in re.findall(r"\\tag\{(\d+)\}", page)]
    assert tags == list(range(1, len(tags) + 1))
    for module in (free_motion, theta):
        text = Path(module.__file__).read_text(encoding="utf-8")
        cited = re.findall(r"\[FM\]\s+eqs?\.((?:(?:\s|,|to|and)*\(\d+\))+)", text)
        numbers = {int(number) for group in cited for number in re.findall(r"\d+", group)}
        assert len(numbers) > 5
        assert numbers <= set(tags)
