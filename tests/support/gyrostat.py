"""The motion of a body with wheels in its orbit to as many digits as asked for: Taylor series in integers.

    K w' = M + M_g - w x L - sum u b,  L = K w + sum h b,  K = J - sum I b b^T,  h' = u,  q' = q (0, w)/2
    M_g = 3 mu |r|^-5 r_b x J r_b,  r_b = R(q)^T r,  r' = v,  v' = -mu |r|^-3 r

Nothing here is shared with what is tested. `model/test_gyrostat.py` compares it with `support.series`, which
knows neither wheels nor gravity, with extrapolation and with closed forms. Numbers are mpf of that module's
context.
"""

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from operator import mul
from typing import Any, Self

import numpy as np
from numpy.polynomial.polynomial import polyval

from support.numbers import Array, cross, hamilton
from support.series import Matrix, Number, Vector, apply, mp, norm

Integers = list[int]


@dataclass(frozen=True)
class Gyrostat:
    """A body, its wheels and what acts on it; every number is taken as exact.

    inertia : (3, 3) [kg m2], about the barycentre, body axes, wheels locked
    law     : decoupled, principal or tensor; the diagonal laws keep the diagonals of J and of K
    torque  : (3,) [N m], body axes, constant
    mu      : [m3/s2], 0 without gravity
    axes, inertias, motors : of each wheel, unit (3,) in body axes, [kg m2], [N m], constant
    """

    inertia: Sequence[Sequence[Any]]
    law: str = "tensor"
    torque: Sequence[Any] = (0, 0, 0)
    mu: Any = 0
    axes: Sequence[Sequence[Any]] = ()
    inertias: Sequence[Any] = ()
    motors: Sequence[Any] = ()

    def tensors(self) -> tuple[Matrix, Matrix]:
        """Returns J and K as the law keeps them."""
        J = [[mp.mpf(x) for x in row] for row in self.inertia]
        K = [list(row) for row in J]
        for axis, inertia in zip(self.axes, self.inertias, strict=True):
            for i in range(3):
                for j in range(3):
                    K[i][j] -= mp.mpf(inertia) * mp.mpf(axis[i]) * mp.mpf(axis[j])
        if self.law == "tensor":
            return J, K
        diagonal = [
            [[x if i == j else mp.zero for j, x in enumerate(r)] for i, r in enumerate(t)] for t in (J, K)
        ]
        return diagonal[0], diagonal[1]


@dataclass(frozen=True)
class GyrostatState:
    """The state: attitude (4,), rates (3,), position, velocity in inertial axes (3,), momenta of wheels."""

    attitude: Sequence[Any]
    rates: Sequence[Any]
    position: Sequence[Any] = (1, 0, 0)
    velocity: Sequence[Any] = (0, 0, 0)
    momenta: Sequence[Any] = field(default=())


class Series(list[int]):
    """The first coefficients of a power series, multiples of 2^-B."""

    def __mul__(self, other: Self) -> int:  # type: ignore[override]
        """Returns the last coefficient of the product of two series of equal length, a multiple of 2^-2B."""
        return sum(map(mul, self, reversed(other)))

    def at(self, time: int, bits: int) -> int:
        """Returns the value at a time, a multiple of 2^-B too."""
        value = 0
        for coefficient in reversed(self):
            value = (value * time >> bits) + coefficient
        return value


@dataclass(frozen=True)
class _Units:
    """Those of a step: time [s] and length [m], powers of two, and inertia [kg m2]; 1 is 2^bits."""

    time: Number
    length: Number
    inertia: Number
    bits: int

    def fixed(self, x: Number) -> int:
        return int(mp.nint(mp.ldexp(x, self.bits)))

    def series(self, values: Sequence[Any], unit: Number) -> list[Series]:
        return [Series([self.fixed(mp.mpf(x) / unit)]) for x in values]

    def matrix(self, rows: Matrix) -> list[Integers]:
        return [[self.fixed(x) for x in row] for row in rows]


class Course:
    """A motion from its start to a given time: states to about 30 digits, and the orbit as doubles."""

    def __init__(self, body: Gyrostat, start: GyrostatState, duration: Any, *, digits: int = 30) -> None:
        """The attitude starts at unit length. duration : [s], not negative."""
        self._began: list[Number] = []
        self._steps: list[_Step] = []
        self._digits, left = digits, mp.mpf(duration)
        with mp.workdps(digits + 30):
            size = norm([mp.mpf(x) for x in start.attitude])
            others = (start.rates, start.position, start.velocity, start.momenta)
            state = GyrostatState(
                [mp.mpf(x) / size for x in start.attitude], *([mp.mpf(x) for x in each] for each in others)
            )
            while left >= 0:
                step = _Step(body, state, _units(body, state, digits), order=int(1.2 * digits))
                length = step.length(digits)
                self._began.append(mp.mpf(duration) - left)
                self._steps.append(step)
                state, left = step.state(length), left - length

    def at(self, time: Any) -> GyrostatState:
        """Returns the state at a time [s]."""
        with mp.workdps(self._digits + 30):
            i = bisect_right(self._began, time) - 1
            return self._steps[i].state(mp.mpf(time) - self._began[i])

    def orbit(self, times: Array) -> Array:
        """Returns position and velocity at times [s], (n,): (n, 6), rounded to an ulp or two."""
        began = np.array([float(x) for x in self._began])
        which = np.searchsorted(began, times, side="right") - 1
        found = np.empty((len(times), 6))
        for i in np.unique(which):
            found[which == i] = self._steps[i].orbit(times[which == i] - began[i])
        return found


def _units(body: Gyrostat, state: GyrostatState, digits: int) -> _Units:
    """Returns units in which rates are 1 at most, positions about 1, moments 1 at most."""
    J, K = body.tensors()
    inverse = mp.inverse(mp.matrix(K)).tolist()
    scale = max(abs(x) for row in J for x in row)
    stored = apply(_columns(body.axes), list(state.momenta)) if body.axes else [mp.zero] * 3
    motors = apply(_columns(body.axes), [mp.mpf(x) for x in body.motors]) if body.axes else [mp.zero] * 3
    distance = norm(state.position)
    rates = [
        norm(state.rates),
        norm(apply(inverse, stored)),
        mp.sqrt(norm(apply(inverse, [mp.mpf(x) for x in body.torque]))),
        mp.sqrt(norm(apply(inverse, motors))),
        mp.sqrt(mp.mpf(body.mu) / distance**3),
    ]
    stiff = max(abs(x) for row in inverse for x in row) * scale
    time = mp.ldexp(mp.one, -int(mp.ceil(mp.log(max(rates), 2)))) if any(rates) else mp.one
    length = mp.ldexp(mp.one, int(mp.floor(mp.log(distance, 2))))
    return _Units(time, length, scale, int(digits * 3.322 + mp.log(stiff, 2)) + 64)


def _columns(axes: Sequence[Sequence[Any]]) -> Matrix:
    return [[mp.mpf(axis[i]) for axis in axes] for i in range(3)]


class _Step:
    """The series of a state about one instant, in units in which their coefficients fall."""

    def __init__(self, body: Gyrostat, state: GyrostatState, units: _Units, order: int) -> None:
        self.units, self.gyroscopic = units, body.law != "decoupled"
        T, D, S = units.time, units.length, units.inertia
        self.q = units.series(state.attitude, mp.one)
        self.w = units.series(state.rates, 1 / T)
        self.r = units.series(state.position, D)
        self.v = units.series(state.velocity, D / T)
        self.h = units.series(state.momenta, S / T)
        J, K = body.tensors()
        self.J = units.matrix([[x / S for x in row] for row in J])
        self.K = units.matrix([[x / S for x in row] for row in K])
        self.inverse = units.matrix(mp.inverse(mp.matrix(K) / S).tolist())
        self.axes = units.matrix(_columns(body.axes))
        self.motors = [units.fixed(mp.mpf(x) * T**2 / S) for x in body.motors]
        self.torque = [
            units.fixed(mp.mpf(x) * T**2 / S) - (sum(map(mul, row, self.motors)) >> units.bits)
            for x, row in zip(body.torque, self.axes, strict=True)
        ]
        self.gravity = units.fixed(mp.mpf(body.mu) * T**2 / D**3)
        self.zero, self.square, self.third, self.fifth = (Series() for _ in range(4))
        self.conjugate, self.half_turned = ([Series() for _ in range(4)] for _ in range(2))
        self.body_r, self.Jr, self.moment_r, self.L = ([Series() for _ in range(3)] for _ in range(4))
        self.unknowns = [*self.q, *self.w, *self.r, *self.v, *self.h]
        for j in range(order):
            for series, rate in zip(self.unknowns, self._rates(j), strict=True):
                series.append(rate // (j + 1))

    def _rates(self, j: int) -> list[int]:
        """Returns coefficient j of the rate of each unknown, all of which are known up to there."""
        bits, q, w, r, v = self.units.bits, self.q, self.w, self.r, self.v
        self.zero.append(0)
        turn = [x >> bits + 1 for x in hamilton(q, [self.zero, *w])]
        stored = [sum(a * h[j] for a, h in zip(row, self.h, strict=True)) for row in self.axes]
        for i in range(3):
            self.L[i].append(sum(self.K[i][k] * w[k][j] for k in range(3)) + stored[i] >> bits)
        torque = list(self.torque) if j == 0 else [0, 0, 0]
        if self.gyroscopic:
            torque = [x - (y >> bits) for x, y in zip(torque, cross(w, self.L), strict=True)]
        pull = [0, 0, 0]
        if self.gravity:
            torque = [x + y for x, y in zip(torque, self._gradient(j), strict=True)]
            pull = [-(self.gravity * (self.third * x >> bits) >> bits) for x in r]
        acceleration = [sum(map(mul, row, torque)) >> bits for row in self.inverse]
        return [*turn, *acceleration, *(x[j] for x in v), *pull, *(u if j == 0 else 0 for u in self.motors)]

    def _gradient(self, j: int) -> list[int]:
        """Returns coefficient j of the torque of gravity's gradient, and finds those that lead there."""
        bits, q = self.units.bits, self.q
        for i in range(4):
            self.conjugate[i].append(q[i][j] if i == 0 else -q[i][j])
        self.square.append(sum(x * x for x in self.r) >> bits)
        self.third.append(_power(self.square, self.third, 3, bits))
        self.fifth.append(_power(self.square, self.fifth, 5, bits))
        for series, x in zip(self.half_turned, hamilton(self.conjugate, [self.zero, *self.r]), strict=True):
            series.append(x >> bits)
        for series, x in zip(self.body_r, hamilton(self.half_turned, q)[1:], strict=True):
            series.append(x >> bits)
        for series, row in zip(self.Jr, self.J, strict=True):
            series.append(sum(a * x[j] for a, x in zip(row, self.body_r, strict=True)) >> bits)
        for series, x in zip(self.moment_r, cross(self.body_r, self.Jr), strict=True):
            series.append(x >> bits)
        return [3 * self.gravity * (self.fifth * x >> bits) >> bits for x in self.moment_r]

    def length(self, digits: int) -> Number:
        """Returns for what time [s] the last two coefficients are below the precision, 1 unit at most.

        It is a multiple of 2^-20 units, so that sums of lengths are doubles.
        """
        floor, part = self.units.bits - digits * 3.322, 1.0
        for series in self.unknowns[:13]:
            for n in (len(series) - 2, len(series) - 1):
                if series[n]:
                    part = min(part, 2.0 ** ((floor - math.log2(abs(series[n]))) / n))
        return mp.ldexp(int(math.ldexp(part, 20)), -20) * self.units.time

    def state(self, time: Number) -> GyrostatState:
        """Returns the state at a time [s] from the instant of the series."""
        at, bits = self.units.fixed(time / self.units.time), self.units.bits
        T, D, S = self.units.time, self.units.length, self.units.inertia

        def values(series: Sequence[Series], unit: Number) -> Vector:
            return [mp.ldexp(mp.mpf(x.at(at, bits)), -bits) * unit for x in series]

        return GyrostatState(
            values(self.q, mp.one),
            values(self.w, 1 / T),
            values(self.r, D),
            values(self.v, D / T),
            values(self.h, S / T),
        )

    def orbit(self, times: Array) -> Array:
        """Returns position and velocity at times [s] from the instant of the series, (n, 6)."""
        D, T = float(self.units.length), float(self.units.time)
        coefficients = np.array(
            [[x / (1 << self.units.bits) for x in series] for series in (*self.r, *self.v)]
        )
        return polyval(times / T, coefficients.T).T * ([D] * 3 + [D / T] * 3)


def _power(square: Series, power: Series, exponent: int, bits: int) -> int:
    """Returns the next coefficient of s^(-exponent/2), s being known to the same one.

    From p' s = a p s', a = -exponent/2: j s_0 p_j = sum over k < j of (a (j - k) - k) p_k s_(j-k).
    """
    j = len(power)
    if j == 0:
        root = math.isqrt(square[0] << bits)
        return (1 << bits * (exponent + 1)) // root**exponent
    terms = (-(exponent * (j - k) + 2 * k) * power[k] * square[j - k] for k in range(j))
    return sum(terms) // (2 * j * square[0])
