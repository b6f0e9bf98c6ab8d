"""The motion of a rigid body to as many digits as asked for: Taylor series in integer arithmetic.

    I w' + w x (I w) = M,  q' = q (0, w)/2,  q body to inertial, w and constant M in body axes

Nothing here is shared with what is tested; `stability/test_truth.py` compares it with elliptic integrals and
with extrapolation. Numbers are mpf of a context of its own, so that the precision of others stays as it is.
"""

import math
from collections.abc import Sequence
from operator import mul
from typing import Any

import mpmath

from support.numbers import hamilton

mp = mpmath.MPContext()
mp.dps = 120
Number = Any  # mpf of this context
Vector = list[Number]
Matrix = list[list[Number]]


def norm(v: Sequence[Number]) -> Number:
    return mp.sqrt(sum(x * x for x in v))


def apply(matrix: Matrix, v: Vector) -> Vector:
    return [sum(map(mul, row, v)) for row in matrix]


def flight(law: str, inertia: Any, state: Any, torque: Any, time: Any, *, digits: int = 25) -> Vector:
    """Returns the state (attitude, angular velocity), (7,), after a time, to about `digits` digits.

    law     : none, decoupled, principal or tensor
    inertia : (3, 3) [kg m2]
    state   : (7,), inputs are taken as exact
    torque  : (3,) [N m], body axes
    """
    J = [[mp.mpf(x) for x in row] for row in inertia]
    M = [mp.mpf(x) for x in torque]
    q, w = [mp.mpf(x) for x in state[:4]], [mp.mpf(x) for x in state[4:]]
    if law != "tensor":
        J = [[J[i][j] if i == j else mp.zero for j in range(3)] for i in range(3)]
    if law in ("none", "decoupled"):  # a sphere of 1 kg m2: nothing turns its momentum in the body
        M = [mp.zero if law == "none" else M[i] / J[i][i] for i in range(3)]
        J = [[mp.mpf(i == j) for j in range(3)] for i in range(3)]
    turn, rate = taylor(J, w, M, mp.mpf(time), digits)
    return [*hamilton(q, turn), *rate]


def _conv(a: list[int], b: list[int]) -> int:
    """Returns the last coefficient of a product of two series of equal length."""
    return sum(map(mul, a, reversed(b)))


def taylor(
    inertia: Matrix, omega: Vector, torque: Vector, time: Number, digits: int = 60
) -> tuple[Vector, Vector]:
    """Returns the turn q0* q(time), (4,), and the rate (3,), in body axes, to about `digits` digits.

    The span is the unit of time, numbers are multiples of 2^-B. Each step takes a unit 2^-k of its own that
    makes the rate 1 or less, and as much of it as leaves the last two coefficients below the precision.
    """
    size = norm(omega) * abs(time)
    scale = max(abs(x) for row in inertia for x in row)
    scaled = mp.matrix(inertia) / scale
    inverse = mp.inverse(scaled)
    push = apply([[inverse[i, j] for j in range(3)] for i in range(3)], [x / scale * time**2 for x in torque])
    fastest = max(size, mp.sqrt(norm(push)))
    if not fastest:
        return [mp.one, mp.zero, mp.zero, mp.zero], omega
    small = min(fastest, mp.one) if not size else min(size, mp.one)
    stiff = max(abs(x) for x in inverse)
    B = int(digits * 3.322 - mp.log(small, 2) + mp.log(stiff, 2)) + 64
    one, order = 1 << B, int(1.15 * digits)
    floor = B - digits * 3.322 + float(mp.log(small, 2))  # log2 of the largest term to be left out

    def fixed(x: Number) -> int:
        return int(mp.nint(mp.ldexp(x, B)))

    with mp.workprec(max(mp.prec, 2 * B)):
        tensor = [[fixed(scaled[i, j]) for j in range(3)] for i in range(3)]
        inverse = mp.inverse(scaled)
        reciprocal = [[fixed(inverse[i, j]) for j in range(3)] for i in range(3)]
        W, T = [fixed(x * time) for x in omega], [fixed(x) for x in push]
    q = [one, 0, 0, 0]
    left, whole = 1 << 64, 64
    while left:
        rate = max(max(map(abs, W)) / one, math.sqrt(max(map(abs, T)) / one))
        k = max(0, math.ceil(math.log2(rate)) if rate > 0 else 0)
        w, p = [[x >> k] for x in W], [[x] for x in q]
        L: list[list[int]] = [[], [], []]
        for j in range(order):
            for i in range(3):
                L[i].append(sum(tensor[i][n] * w[n][j] for n in range(3)) >> B)
            gyro = [
                _conv(w[1], L[2]) - _conv(w[2], L[1]),
                _conv(w[2], L[0]) - _conv(w[0], L[2]),
                _conv(w[0], L[1]) - _conv(w[1], L[0]),
            ]
            a, b, c, d = p
            x, y, z = w
            turn = [
                -_conv(b, x) - _conv(c, y) - _conv(d, z),
                _conv(a, x) + _conv(c, z) - _conv(d, y),
                _conv(a, y) + _conv(d, x) - _conv(b, z),
                _conv(a, z) + _conv(b, y) - _conv(c, x),
            ]
            for i in range(3):
                change = -(sum(reciprocal[i][n] * (gyro[n] >> B) for n in range(3)) >> B)
                w[i].append((change + (T[i] >> 2 * k if j == 0 else 0)) // (j + 1))
            for i in range(4):
                p[i].append((turn[i] >> B + 1) // (j + 1))
        part = 1.0
        for n in (order - 1, order):
            last = max(abs(series[n]) for series in (*w, *p))
            if last:
                part = min(part, 2.0 ** ((floor - _log2(last)) / n))
        step = max(1, int(part * 2**20)) << (whole - k - 20)
        step = min(step, left)
        left -= step
        s = step << (B - whole + k)

        def at(series: list[int], s: int = s) -> int:
            value = 0
            for coefficient in reversed(series):
                value = (value * s >> B) + coefficient
            return value

        W, q = [at(series) << k for series in w], [at(series) for series in p]
    with mp.workprec(max(mp.prec, B)):
        return [mp.ldexp(mp.mpf(x), -B) for x in q], [mp.ldexp(mp.mpf(x), -B) / time for x in W]


def _log2(n: int) -> float:
    shift = max(0, n.bit_length() - 64)
    return math.log2(n >> shift) + shift
