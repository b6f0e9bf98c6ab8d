"""Free rotation of a rigid body from one start to many times, by theta functions.

Names of axes and symbols are those of `free_motion`. Jacobi's functions of u are quotients of theta
functions of v = pi u/(2 K), [FM] eqs. (40), (41). l + L2 has the period 4 i K', and where it is 0,
exp(i psi) has a simple zero or pole: it is exp(i W t) z/conj(z) with z = theta_4(v + i b) of the square
of the nome, [FM] eqs. (42), (43), and half of psi needs no arctangent. A time costs two pairs of sine and
cosine and short polynomials of cos(2 v): all series fall as the nome to the power of n^2. What depends on
the start alone is found once, by arithmetic-geometric means and square roots.
Source: [FM] section 9, the derivation, from Jacobi's theta functions and Landen's transformation; [VS] sum
the integral of the third kind as such an argument.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from supervessel.rotation.attitude import product, unit
from supervessel.rotation.propagators.free_motion import Pair, complex_product, invariants, named, separation

LARGEST_NOME = 0.25
"""Above it `constants` are NaN; what the series leave out there is below 2^-53/8, [FM] eq. (45).

The nome is larger for m = B/A above 0.987, near the separatrix alone.
"""

MEANS = 6
"""Steps of the arithmetic-geometric mean: the nome to the power of 2^(MEANS - 1) is below 2^-63."""

CONSTANTS = 58
"""How many numbers `at` needs of a start."""

TINY = 2.0**-1000
"""Added to what may underflow where nothing depends on it any more."""


@dataclass(frozen=True)
class _Series:
    """Theta functions of real v as polynomials of e = cos(2 v), the nome's powers in them, [FM] eq. (45).

    even, odd : theta_3, at e; theta_4 at -e
    slow_even, slow_odd : theta_2/(2 nome^(1/4) cos v), at e; theta_1/(... sin v) at -e
    """

    even: tuple[ca.SX, ...]
    odd: tuple[ca.SX, ...]
    slow_even: tuple[ca.SX, ...]
    slow_odd: tuple[ca.SX, ...]

    @classmethod
    def of(cls, q: ca.SX) -> "_Series":
        q2 = q * q
        q4, q8 = q2 * q2, _square(q2 * q2)
        q6, q9, q12, q16, q20, q25 = q4 * q2, q8 * q, q8 * q4, q8 * q8, q8 * q8 * q4, q8 * q8 * q8 * q
        return cls(
            even=(1.0 - 2.0 * q4 + 2.0 * q16, 4.0 * q4 - 16.0 * q16, 16.0 * q16),
            odd=(2.0 * q - 6.0 * q9 + 10.0 * q25, 8.0 * q9 - 40.0 * q25, 32.0 * q25),
            slow_even=(1.0 - q2 - q6 + q12 + q20, 4.0 * q6 - 4.0 * q12 - 12.0 * q20, 16.0 * q20),
            slow_odd=(2.0 * q2 - 2.0 * q6 - 4.0 * q12 + 4.0 * q20, 8.0 * q12 - 8.0 * q20),
        )

    @classmethod
    def read(cls, k: ca.SX) -> "_Series":
        parts = ca.vertsplit(k)
        return cls(tuple(parts[:3]), tuple(parts[3:6]), tuple(parts[6:9]), tuple(parts[9:11]))

    def values(self, e: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
        """Returns theta_3, theta_4, then those of theta_2 and theta_1."""
        square = e * e
        even, odd = _polynomial(self.even, square), e * _polynomial(self.odd, square)
        slow_even, slow_odd = _polynomial(self.slow_even, square), e * _polynomial(self.slow_odd, square)
        return even + odd, even - odd, slow_even + slow_odd, slow_even - slow_odd


@dataclass(frozen=True)
class _Motion:
    """What a motion has for constants, in the axes as `named`.

    frequency  : of v, not finite where the nome is too large
    half       : of psi/2, but for the argument of z
    phase      : cosine and sine of v at the start
    amplitudes : of the rates, over their quotients of theta functions
    momenta    : the same of the angular momentum, over its length
    axes       : the rotation from these axes to the principal ones, (3, 3)
    """

    frequency: ca.SX
    half: ca.SX
    phase: Pair
    series: _Series
    turning: tuple[ca.SX, ...]
    amplitudes: tuple[ca.SX, ...]
    momenta: tuple[ca.SX, ...]
    axes: ca.SX


def constants(state: ca.SX, moments: ca.SX, to_body: ca.SX, scale: ca.SX) -> ca.SX:
    """Returns what `at` needs of a start, (CONSTANTS,): not all finite where the nome is too large.

    state   : attitude and angular velocity, (7,), not at rest, its rates over scale
    moments : principal, (3,), ascending, the largest in [0.5, 1)
    to_body : R_body_principal, (3, 3)
    scale   : a power of two, such that the largest rate is about 1 over it

    A rate below 2^-400 of the greatest is the caller's to keep away: squares of such underflow.
    """
    motion = _motion(moments, to_body.T @ state[4:])
    axes = to_body @ motion.axes
    attitude = state[:4]
    to_attitude = ca.horzcat(attitude, *(product(attitude, ca.vertcat(0.0, axes[:, i])) for i in range(3)))
    none = ca.SX(1.0), ca.SX(0.0)
    begun, _ = _quaternion(motion.series, motion.turning, motion.momenta, motion.phase, none)
    back = ca.vertcat(begun[0], -begun[1:]) / ca.sumsqr(begun)
    from_start = ca.horzcat(*(product(back, ca.SX(ca.DM.eye(4)[:, i])) for i in range(4)))
    return ca.vertcat(
        motion.frequency * scale,
        motion.half * scale,
        *motion.phase,
        *motion.series.even,
        *motion.series.odd,
        *motion.series.slow_even,
        *motion.series.slow_odd,
        *motion.turning,
        *motion.momenta,
        ca.vec(to_attitude @ from_start),
        attitude,
        begun,
        *(axes[:, i] * (motion.amplitudes[i] * scale) for i in range(3)),
    )


def at(k: ca.SX, time: ca.SX) -> ca.SX:
    """Returns attitude and angular velocity, (7,), a time [s] after the start that k, (CONSTANTS,), is of.

    Source: [FM] eqs. (41), (42), (50).
    """
    frequency, half, *phase = ca.vertsplit(k[:4])
    series, turning, momenta = _Series.read(k[4:15]), tuple(ca.vertsplit(k[15:22])), ca.vertsplit(k[22:25])
    to_attitude, attitude, begun = ca.reshape(k[25:41], 4, 4), k[41:45], k[45:49]
    to_rate = ca.reshape(k[49:58], 3, 3)
    v, spin = frequency * time, half * time
    now = complex_product((ca.cos(v), ca.sin(v)), (phase[0], phase[1]))
    turn, (over, *parts) = _quaternion(series, turning, momenta, now, (ca.cos(spin), ca.sin(spin)))
    # by how far it has turned: what is rounded in to_attitude is small soon after the start
    return ca.vertcat(unit(attitude + to_attitude @ (turn - begun)), to_rate @ ca.vertcat(*parts) / over)


def _motion(moments: ca.SX, omega: ca.SX) -> _Motion:
    """Returns the constants of a motion, principal axes, [FM] eqs. (40) to (44)."""
    E = separation(moments, omega)
    exchanged = E < 0.0
    J, w, flip = named(moments, omega, exchanged)
    (J0, J1, J2), (w0, w1, w2) = J, w
    G, H = invariants(J, w)
    width, lower, upper = J2 - J0, J1 - J0, J2 - J1
    per_product = 1.0 / (J0 * J1 * J2)
    sign = ca.if_else(exchanged, -1.0, 1.0)
    A = H * upper * per_product
    steady = A == 0.0  # every rate stays: any phase will do, with the rates for amplitudes
    A = ca.if_else(steady, 1.0, A)
    B = ca.if_else(steady, 0.0, G * lower * per_product)
    A_less_B = ca.if_else(steady, 1.0, ca.fabs(E) * ca.fabs(width) * per_product)

    # greatest rates, and the angular momentum about axis 2 where that is greatest
    root0, root1 = ca.sqrt(J0 * ca.fabs(width)), sign * ca.sqrt(J1 * ca.fabs(upper))
    x, y = w0 * root0, w1 * root1
    size = ca.sqrt(x * x + y * y)
    none = ca.logic_or(size == 0.0, steady)
    W0, W1 = ca.if_else(none, w0, size / _divisor(root0)), ca.if_else(none, w1, size / _divisor(root1))
    start: Pair = ca.if_else(none, 1.0, x / _divisor(size)), ca.if_else(none, 0.0, y / _divisor(size))
    L0, L1, L2 = J0 * w0, J1 * w1, J2 * w2
    length = ca.sqrt(L0 * L0 + L1 * L1 + L2 * L2)
    peak = ca.if_else(none, L2, ca.sqrt(L2 * L2 + J1 * J2 * lower / _divisor(width) * (w1 * w1)))
    rise = ca.if_else(none, 0.0, J0 * W0 / _divisor(peak))

    frequency, (cos, sin), nome, sides = _means(A, B, A_less_B, start, rise)
    series, turning = _Series.of(nome), _turning(nome, sides, -sign)
    third, fourth, slow, _ = series.values(ca.SX(1.0))
    amplitudes = W0 * (fourth / slow), W1 * (third / slow), peak / J2 * (fourth / third)

    # psi' where L2 is greatest, v = 0, is its mean and twice what the argument of z adds there
    fastest = (L0 * w0 + L1 * w1 + L2 * w2 + length * peak / J2) / (length + peak)
    real, imaginary = _turn(turning, ca.SX(1.0), ca.SX(1.0))
    return _Motion(
        frequency=ca.if_else(steady, 0.0, frequency),
        half=0.5 * fastest - 2.0 * frequency * (imaginary / real),
        phase=(ca.if_else(steady, 1.0, cos), ca.if_else(steady, 1.0, sin)),
        series=series,
        turning=turning,
        amplitudes=amplitudes,
        momenta=tuple(Ji * Ai / length for Ji, Ai in zip(J, amplitudes, strict=True)),
        axes=_axes(exchanged, flip),
    )


def _means(A: ca.SX, B: ca.SX, A_less_B: ca.SX, start: Pair, rise: ca.SX) -> tuple[ca.SX, Pair, ca.SX, Pair]:
    """Returns v/t, (cos v, sin v) at the start, the nome, and nome^2 times exp(2 b) and exp(-2 b).

    v/t is NaN where the nome is too large.

    start : (cn, sn) at the start
    rise  : sqrt(m) times -i sn(i b 2 K/pi), dn there being l/L2 as L2 is greatest, m = B/A

    Landen's transformation takes an amplitude f to twice its size, but for an angle d that falls as the
    nome: v = f - d_0/2 - d_1/4 - ..., nested square roots of unit complex numbers. It takes i b the same
    way, or, if that is nearer to i K' than to 0, the distance from there. Source: [FM] eqs. (46) to (48).
    """
    a, b = ca.sqrt(A), ca.sqrt(A_less_B)
    difference, m = B / (a + b), B / A
    nome_square = _nome_square(a, b, difference)
    serves = ca.sqrt(nome_square) <= LARGEST_NOME
    # where it does not, quotients below would be 0/0 or overflow: a spin that is steady takes their place
    b, difference = ca.if_else(serves, b, a), ca.if_else(serves, difference, 0.0)
    nome_square, m = ca.if_else(serves, nome_square, 0.0), ca.if_else(serves, m, 0.0)
    square = rise * rise
    low = square <= ca.sqrt(m)
    size = ca.if_else(
        low, m / _divisor(_square(rise + ca.sqrt(m + square))), square / _square(1.0 + ca.sqrt(1.0 + square))
    )
    size = ca.if_else(rise == 0.0, 1.0, size)  # exp of minus twice that distance, at first of its amplitude
    reached, delays, growths = size, [], []
    cos, sin = start
    for _ in range(MEANS):
        ratio = difference / (a + b)
        delays.append(_unit((a * cos * cos + b * sin * sin, -difference * cos * sin)))
        cos, sin = _unit(complex_product((cos, sin), (a * cos, b * sin)))
        growths.append((1.0 + ratio / (reached + TINY)) / (1.0 + ratio * reached))
        reached = reached * (reached + ratio) / (1.0 + ratio * reached)
        a, b, difference = _mean(a, b, difference)
    behind: Pair = (ca.SX(1.0), ca.SX(0.0))
    growth = ca.SX(1.0)
    for delay, factor in zip(reversed(delays), reversed(growths), strict=True):
        re, im = complex_product(delay, behind)
        behind, growth = _unit((1.0 + re, im)), ca.sqrt(factor * growth)
    nome, size = ca.sqrt(nome_square), size * growth
    sides = (
        ca.if_else(low, nome_square / size, nome * size),
        ca.if_else(low, nome_square * size, nome_square * nome / size),
    )
    return ca.if_else(serves, a, ca.SX.nan()), _unit(complex_product(start, behind)), nome, sides


def _mean(a: ca.SX, b: ca.SX, difference: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Returns the arithmetic and the geometric mean of a and b, and their difference, from a - b."""
    mean, other = 0.5 * (a + b), ca.sqrt(a * b)
    return mean, other, _square(0.5 * difference) / (mean + other)


def _nome_square(a: ca.SX, b: ca.SX, difference: ca.SX) -> ca.SX:
    """Returns the nome's square for sqrt(A), sqrt(A - B) and what they differ by."""
    a, b, difference = _mean(a, b, difference)
    return _nome(0.5 * difference / (a + b + 2.0 * ca.sqrt(a * b)))


def _nome(share: ca.SX) -> ca.SX:
    """Returns a nome from (1 - sqrt(k'))/(1 + sqrt(k'))/2, to rounding where it is below LARGEST_NOME^2.

    Source: [FM] eq. (49).
    """
    x = _square(_square(share))
    return share * (1.0 + x * (2.0 + x * (15.0 + x * (150.0 + x * 1707.0))))


def _turning(nome: ca.SX, sides: Pair, sign: ca.SX) -> tuple[ca.SX, ...]:
    """Returns what `_turn` needs: the series of theta_4(v + i b), of the square of the nome, [FM] eq. (45).

    sides : nome^2 exp(2 b), nome^2 exp(-2 b)
    """
    near, far = sides
    low = _square(_square(nome))
    n1, f1 = 0.5 * near, 0.5 * far
    n2, f2 = 0.5 * near * near * low, 0.5 * far * far * low
    n3, f3 = 0.5 * near * near * near * low * low * low, 0.5 * far * far * far * low * low * low
    C1, C2, C3 = n1 + f1, n2 + f2, n3 + f3
    S1, S2, S3 = sign * (n1 - f1), sign * (n2 - f2), sign * (n3 - f3)
    real = (1.0 - 2.0 * C2, 6.0 * C3 - 2.0 * C1, 4.0 * C2, -8.0 * C3)
    return *real, 2.0 * (S1 - S3), -4.0 * S2, 8.0 * S3


def _turn(turning: tuple[ca.SX, ...], e: ca.SX, f: ca.SX) -> Pair:
    """Returns theta_4(v + i b) at e = cos(2 v), f = sin(2 v)."""
    return _polynomial(turning[:4], e), f * _polynomial(turning[4:], e)


def _quaternion(
    series: _Series, turning: tuple[ca.SX, ...], momenta: Sequence[ca.SX], phase: Pair, spin: Pair
) -> tuple[ca.SX, tuple[ca.SX, ca.SX, ca.SX, ca.SX]]:
    """Returns a multiple of R p, (4,), and the theta functions of the rates, the one below their line first.

    phase, spin : cosines and sines of v and of what psi/2 has but for the argument of z
    """
    cos, sin = phase
    e, f = (cos - sin) * (cos + sin), 2.0 * cos * sin
    third, fourth, second, first = series.values(e)
    x, y, z = cos * second, sin * first, third
    re, im = complex_product(_turn(turning, e, f), spin)
    Lx, Ly, Lz = momenta[0] * x, momenta[1] * y, fourth + momenta[2] * z
    turn = ca.vertcat(Lz * re, Ly * re + Lx * im, Ly * im - Lx * re, Lz * im)
    return turn, (fourth, x, y, z)


def _axes(exchanged: ca.SX, flip: ca.SX) -> ca.SX:
    """Returns the rotation from the axes as named to the principal ones, (3, 3)."""
    zero, one = ca.SX(0.0), ca.SX(1.0)
    other = ca.blockcat([[zero, zero, flip], [zero, -flip, zero], [one, zero, zero]])
    return ca.if_else(exchanged, other, ca.diag(ca.vertcat(one, flip, flip)))


def _polynomial(coefficients: Sequence[ca.SX], x: ca.SX) -> ca.SX:
    total = coefficients[-1]
    for coefficient in reversed(coefficients[:-1]):
        total = total * x + coefficient
    return total


def _unit(a: Pair) -> Pair:
    size = ca.sqrt(a[0] * a[0] + a[1] * a[1])
    return a[0] / size, a[1] / size


def _divisor(x: ca.SX) -> ca.SX:
    """Returns x, or 1 for 0, where a quotient is not used."""
    return ca.if_else(x == 0.0, 1.0, x)


def _square(x: ca.SX) -> ca.SX:
    return x * x
