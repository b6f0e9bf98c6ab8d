"""Reference solutions of the rotation of a rigid body, kept in truth.json, and the script that makes them.

    python -m stability.truth     (in tests; ten minutes, the same bytes each time)

    I w' + w x (I w) = M,  q' = q (0, w)/2,  q body to inertial, w and constant M in body axes

The inputs of a case are doubles and taken as exact; the results are right to the 34 digits kept. Two ways
lead to them. Without torque: Jacobi's functions by theta functions, and Euler angles about the momentum with
the integral of the third kind in Carlson's form, in principal axes found at 120 digits (`free`). With torque:
a Taylor series in integer arithmetic on the tensor as it stands, 60 digits (`support.series`). Every case
without torque that turns by 20 rad or less is solved both ways, and of the longer ones those whose period is
short enough: the Taylor series over one period, raised to the number of periods, and over what remains
(`by_periods`).
"""

import json
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from operator import mul
from pathlib import Path
from random import Random
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from support.numbers import cross as _cross
from support.numbers import hamilton as _hamilton
from support.series import Matrix, Number, Vector, mp, taylor
from support.series import apply as _apply
from support.series import norm as _norm

FILE = Path(__file__).with_name("truth.json")
DIGITS = 34  # kept of each result

PERTURBATION = mp.mpf(10) ** -25
STEADY = (
    mp.mpf(10) ** -90
)  # a rate that changes by less than this, relatively, within a radian does not change
AGREEMENT = mp.mpf(10) ** -40  # of the two ways
HALF_DENORMAL = mp.mpf(2) ** -1075


# What the tests use


@dataclass(frozen=True)
class Case:
    """One start and its exact end.

    inertia        : (3, 3) [kg m2], body axes
    attitude       : (4,), unit to rounding; its length is taken as 1
    omega, torque  : (3,) [rad/s], [N m], body axes
    time           : span [s], of either sign
    attitude_end   : (4,), of unit length, its sign continuous in time, 34 digits
    omega_end      : (3,) [rad/s], 34 digits
    cond_attitude  : sum over the inputs (elements of inertia, omega, torque, and time) of the angle [rad] by
                     which the attitude moves for a small relative change of that input, over the change
    cond_rate      : the same for the change of omega_end over |omega_end|
    motion_attitude, motion_rate   : the parts of those sums that omega, torque and time make: far smaller
                     where moments are nearly equal or hugely different
    """

    name: str
    category: str
    inertia: NDArray[np.float64]
    attitude: NDArray[np.float64]
    omega: NDArray[np.float64]
    torque: NDArray[np.float64]
    time: float
    attitude_end: tuple[Number, ...]
    omega_end: tuple[Number, ...]
    cond_attitude: float
    cond_rate: float
    motion_attitude: float
    motion_rate: float

    @property
    def full(self) -> bool:
        """Whether the tensor has products of inertia."""
        return bool(np.any(self.inertia != np.diag(np.diag(self.inertia))))


def cases(category: str | None = None) -> list[Case]:
    """Returns the cases of a category, or all."""
    found = [case for case in _read() if category in (None, case.category)]
    if not found:
        raise KeyError(category)
    return found


def categories() -> list[str]:
    """Returns the names of the categories, in the order of the file."""
    return list(dict.fromkeys(case.category for case in _read()))


def attitude_error(case: Case, q: Sequence[float] | NDArray[np.float64]) -> float:
    """Returns the angle between a quaternion (4,) and the case's end [rad]: 2 pi if only the sign is wrong.

    Not finite: inf. The length of q is not looked at.
    """
    if not np.all(np.isfinite(q)) or not np.any(q):
        return math.inf
    return float(_angle(list(case.attitude_end), [mp.mpf(float(x)) for x in q]))


def rate_error(case: Case, omega: Sequence[float] | NDArray[np.float64]) -> float:
    """Returns the error of a rate (3,) relative to |omega_end|; half a denormal in each component is free.

    Not finite: inf.
    """
    if not np.all(np.isfinite(omega)):
        return math.inf
    excess = [
        max(abs(mp.mpf(float(x)) - exact) - HALF_DENORMAL, mp.zero)
        for x, exact in zip(omega, case.omega_end, strict=True)
    ]
    if not any(excess):
        return 0.0
    size = _norm(case.omega_end)
    return float(_norm(excess) / size) if size else math.inf


@cache
def _read() -> tuple[Case, ...]:
    def doubles(raw: list[str]) -> NDArray[np.float64]:
        return np.array([float.fromhex(x) for x in raw])

    return tuple(
        Case(
            name=raw["name"],
            category=raw["category"],
            inertia=np.array([doubles(row) for row in raw["inertia"]]),
            attitude=doubles(raw["attitude"]),
            omega=doubles(raw["omega"]),
            torque=doubles(raw["torque"]),
            time=float.fromhex(raw["time"]),
            attitude_end=tuple(mp.mpf(x) for x in raw["attitude_end"]),
            omega_end=tuple(mp.mpf(x) for x in raw["omega_end"]),
            cond_attitude=float(raw["cond_attitude"]),
            cond_rate=float(raw["cond_rate"]),
            motion_attitude=float(raw["motion_attitude"]),
            motion_rate=float(raw["motion_rate"]),
        )
        for raw in json.loads(FILE.read_text(encoding="utf-8"))
    )


# Vectors and quaternions (scalar first, Hamilton product)


def _transposed(matrix: Matrix) -> Matrix:
    return [list(column) for column in zip(*matrix, strict=True)]


def _conjugate(q: Vector) -> Vector:
    return [q[0], -q[1], -q[2], -q[3]]


def _unit(q: Vector) -> Vector:
    size = _norm(q)
    return [x / size for x in q]


def _about(axis: int, angle: Number) -> Vector:
    """Returns the quaternion of a turn about a coordinate axis."""
    q = [mp.cos(angle / 2), mp.zero, mp.zero, mp.zero]
    q[1 + axis] = mp.sin(angle / 2)
    return q


def _angle(a: Vector, b: Vector) -> Number:
    """Returns the angle from one attitude to another, 0 to 2 pi [rad]."""
    d = _hamilton(_conjugate(a), b)
    return 2 * mp.atan2(_norm(d[1:]), d[0])


def _power(q: Vector, count: int) -> Vector:
    result = [mp.one, mp.zero, mp.zero, mp.zero]
    while count:
        if count & 1:
            result = _hamilton(result, q)
        q, count = _hamilton(q, q), count >> 1
    return result


# Free motion by elliptic functions and integrals


def principal(inertia: Matrix) -> tuple[Vector, Matrix]:
    """Returns the moments, ascending, and the matrix whose columns are their axes, of determinant 1."""
    if all(inertia[i][j] == 0 for i in range(3) for j in range(3) if i != j):
        order = sorted(range(3), key=lambda i: inertia[i][i])
        moments = [inertia[i][i] for i in order]
        axes = [[mp.one if i == j else mp.zero for j in order] for i in range(3)]
    else:
        size = max(abs(x) for row in inertia for x in row)
        values, vectors = mp.eigsy(mp.matrix(inertia) / size)
        order = sorted(range(3), key=lambda i: values[i])
        moments = [values[i] * size for i in order]
        axes = [[vectors[i, j] for j in order] for i in range(3)]
    columns = _transposed(axes)
    if sum(map(mul, _cross(columns[0], columns[1]), columns[2])) < 0:
        axes = [[-x for x in row] for row in axes]
    return moments, axes


@dataclass(frozen=True)
class _Circulation:
    """Free motion in axes of which the momentum circulates about the last, (J2 - J0)(l^2 - 2 T J1) >= 0.

    w0 = W0 cn, w1 = s W1 sn, w2 = W2 dn of u = u0 + k t, w0 >= 0 at first; m is the parameter, K the quarter
    period.
    Source: Landau & Lifshitz, Mechanics, section 37.
    """

    J: Vector
    W: Vector
    s: int
    k: Number
    m: Number
    u0: Number
    K: Number
    l: Number  # noqa: E741

    @classmethod
    def of(cls, J: Vector, w: Vector) -> "_Circulation":
        J0, J1, J2 = J
        G = J0 * (J2 - J0) * w[0] ** 2 + J1 * (J2 - J1) * w[1] ** 2  # 2 T J2 - l^2
        H = J1 * (J1 - J0) * w[1] ** 2 + J2 * (J2 - J0) * w[2] ** 2  # l^2 - 2 T J0
        W0, W1 = mp.sqrt(G / (J0 * (J2 - J0))), mp.sqrt(G / (J1 * (J2 - J1)))
        W2 = mp.sqrt(H / (J2 * (J2 - J0))) * (1 if w[2] >= 0 else -1)
        s = 1 if (J2 - J0) * W2 > 0 else -1
        m = G * (J1 - J0) / (H * (J2 - J1))
        sn, cn, dn = s * w[1] / W1, w[0] / W0, w[2] / W2
        K = mp.inf if m == 1 else mp.ellipk(m)
        u0 = sn * mp.elliprf(cn**2, dn**2, 1)
        k = mp.sqrt((J2 - J1) * H / (J0 * J1 * J2))
        return cls(J, [W0, W1, W2], s, k, m, u0, K, _norm([a * b for a, b in zip(J, w, strict=True)]))

    def state(self, t: Number) -> tuple[Number, Vector, Vector]:
        """Returns at time t: a precession angle, the attitude with regard to the momentum, and the rate."""
        J0, J1, J2 = self.J
        u = self.u0 + self.k * t
        half_turns = 0 if self.m == 1 else int(mp.nint(u / (2 * self.K)))
        if self.m == 1:
            sn, cn = mp.tanh(u), mp.sech(u)
            dn = cn
        else:
            v = u - 2 * half_turns * self.K
            sn, cn, dn = (mp.ellipfun(name, v, m=self.m) for name in ("sn", "cn", "dn"))
        amplitude = half_turns * mp.pi + mp.atan2(sn, cn)

        # Precession: phi' = l/J2 + l (J2 - J0)/(J0 J2)/(1 + n sn^2)
        n = J2 * (J1 - J0) / (J0 * (J2 - J1))

        def third(x: Number, y: Number, z: Number) -> Number:
            return x * mp.elliprf(y, z, 1) - n / 3 * x**3 * mp.elliprj(y, z, 1, 1 + n * x**2)

        integral = third(sn, cn**2, dn**2)
        if half_turns:
            integral += 2 * half_turns * third(mp.one, mp.zero, 1 - self.m)
        phi = self.l * (t / J2 + (J2 - J0) / (J0 * J2) * integral / self.k)

        # Nutation and spin; the angle of (L0, L1) and the amplitude are less than a quarter turn apart.
        sign = -1 if half_turns % 2 else 1
        w = [self.W[0] * sign * cn, self.s * self.W[1] * sign * sn, self.W[2] * dn]
        x, y = J0 * self.W[0] * cn, J1 * self.W[1] * sn
        lead = mp.atan2(y * cn - x * sn, x * cn + y * sn)
        spin = mp.pi / 2 - self.s * (amplitude + lead)
        nutation = mp.atan2(_norm([x, y]), J2 * w[2])
        return phi, _hamilton(_about(0, nutation), _about(2, spin)), w


def _circulation(inertia: Matrix, omega: Vector) -> tuple[_Circulation, Matrix] | None:
    """Returns the motion and the matrix of its axes (columns), or None for a steady rate."""
    J, axes = principal(inertia)
    w = _apply(_transposed(axes), omega)
    change = [(J[i - 2] - J[i - 1]) / J[i] * w[i - 2] * w[i - 1] for i in range(3)]
    if _norm(change) <= STEADY * _norm(w) ** 2:
        return None
    if J[2] * (J[2] - J[1]) * w[2] ** 2 < J[0] * (J[1] - J[0]) * w[0] ** 2:
        J, w = J[::-1], [w[2], -w[1], w[0]]
        axes = [[row[2], -row[1], row[0]] for row in axes]
    if w[0] < 0:
        w = [-w[0], -w[1], w[2]]
        axes = [[-row[0], -row[1], row[2]] for row in axes]
    return _Circulation.of(J, w), axes


def free(inertia: Matrix, omega: Vector, time: Number) -> tuple[Vector, Vector]:
    """Returns the turn q0* q(time), (4,), its sign continuous in time, and the rate (3,); body axes."""
    motion = _circulation(inertia, omega)
    if motion is None:
        size = _norm(omega)
        half = size * time / 2
        return [mp.cos(half), *(x / size * mp.sin(half) if size else mp.zero for x in omega)], omega
    circulation, axes = motion
    (start, q_start, _), (end, q_end, w) = circulation.state(mp.zero), circulation.state(time)
    turn = _hamilton(_conjugate(q_start), _hamilton(_about(2, end - start), q_end))
    return [turn[0], *_apply(axes, turn[1:])], _apply(axes, w)


# A problem, its answer and its condition


@dataclass(frozen=True)
class Problem:
    """The inputs of a case, all doubles; see Case."""

    name: str
    inertia: list[list[float]]
    attitude: list[float]
    omega: list[float]
    torque: list[float]
    time: float


Inputs = tuple[Matrix, Vector, Vector, Number]  # inertia, omega, torque, time


def _inputs(problem: Problem) -> Inputs:
    return (
        [[mp.mpf(x) for x in row] for row in problem.inertia],
        [mp.mpf(x) for x in problem.omega],
        [mp.mpf(x) for x in problem.torque],
        mp.mpf(problem.time),
    )


def _perturbed(inputs: Inputs) -> Iterator[Inputs]:
    """Yields the inputs with each that is not zero changed in turn; the tensor stays symmetric."""
    inertia, omega, torque, time = inputs
    factor = 1 + PERTURBATION
    for i in range(3):
        for j in range(i, 3):
            if inertia[i][j]:
                changed = [list(row) for row in inertia]
                changed[i][j] = changed[j][i] = inertia[i][j] * factor
                yield changed, omega, torque, time
    for i in range(3):
        if omega[i]:
            yield inertia, [x * factor if n == i else x for n, x in enumerate(omega)], torque, time
    for i in range(3):
        if torque[i]:
            yield inertia, omega, [x * factor if n == i else x for n, x in enumerate(torque)], time
    if time:
        yield inertia, omega, torque, time * factor


def solve(inputs: Inputs, digits: int = 60) -> tuple[Vector, Vector]:
    """Returns the turn (4,) and the rate (3,), body axes, the way fit for the case."""
    inertia, omega, torque, time = inputs
    return taylor(inertia, omega, torque, time, digits) if any(torque) else free(inertia, omega, time)


def by_periods(inputs: Inputs, longest: float, digits: int = 60) -> tuple[Vector, Vector] | None:
    """Returns the turn and the rate after free motion by Taylor series over a period and what remains.

    None where a period turns the body by more than `longest` [rad]. Only the length of the period comes from
    an elliptic integral.
    """
    inertia, omega, torque, time = inputs
    motion = _circulation(inertia, omega)
    if motion is None or motion[0].m == 1:
        return None
    period = 4 * motion[0].K / motion[0].k * mp.sign(time)
    count = int(time / period)
    rest = time - count * period
    if _norm(omega) * abs(period if count else rest) > longest:
        return None
    turn, w = taylor(inertia, omega, torque, rest, digits)
    if count:
        once, back = taylor(inertia, omega, torque, period, digits)
        if _norm([a - b for a, b in zip(back, omega, strict=True)]) > AGREEMENT * _norm(omega):
            raise ArithmeticError("the rate is not back after a period")
        turn = _hamilton(_power(once, count), turn)
    return turn, w


def differences(one: tuple[Vector, Vector], other: tuple[Vector, Vector]) -> tuple[Number, Number]:
    """Returns how far two solutions (turn, rate) are apart: angle [rad], and rate relative to the first's."""
    size, gap = _norm(one[1]), _norm([a - b for a, b in zip(one[1], other[1], strict=True)])
    return _angle(one[0], other[0]), gap / size if size else gap


def _solved(category: str, problem: Problem) -> tuple[dict[str, Any], str]:
    """Returns a case as it stands in the file, and how it was checked."""
    inputs = _inputs(problem)
    inertia, omega, torque, time = inputs
    turn, w = solve(inputs)
    checked = ""
    if not any(torque):
        angle = _norm(omega) * abs(time)
        other = taylor(*inputs) if angle <= 20 else by_periods(inputs, 60.0)
        if other is not None:
            gap = max(differences((turn, w), other))
            if not gap <= AGREEMENT:
                raise ArithmeticError(f"{category}, {problem.name}: the two ways differ by {mp.nstr(gap, 3)}")
            checked = f"{'series' if angle <= 20 else 'periods'} {mp.nstr(gap, 2)}"
    moved = [differences((turn, w), solve(changed, 45)) for changed in _perturbed(inputs)]
    terms = [[float(pair[i] / PERTURBATION) for pair in moved] for i in range(2)]
    moments = 6 - sum(x == 0 for i in range(3) for x in inertia[i][i:])  # of the terms, the first
    end = _hamilton(_unit([mp.mpf(x) for x in problem.attitude]), _unit(turn))
    return {
        "name": problem.name,
        "category": category,
        "inertia": [[x.hex() for x in row] for row in problem.inertia],
        "attitude": [x.hex() for x in problem.attitude],
        "omega": [x.hex() for x in problem.omega],
        "torque": [x.hex() for x in problem.torque],
        "time": problem.time.hex(),
        "attitude_end": [mp.nstr(x, DIGITS) for x in end],
        "omega_end": [mp.nstr(x, DIGITS) for x in w],
        "cond_attitude": f"{sum(terms[0]):.4g}",
        "cond_rate": f"{sum(terms[1]):.4g}",
        "motion_attitude": f"{sum(terms[0][moments:]):.4g}",
        "motion_rate": f"{sum(terms[1][moments:]):.4g}",
    }, checked


# The problems. Only + - * / and sqrt of doubles, so that they come out the same everywhere.

ULP = 2.0**-52
NONE = [0.0, 0.0, 0.0]
TRIPLES = (  # moments J0 < J1 < J2 and rates w0, w2 with J2 (J2 - J1) w2^2 = J0 (J1 - J0) w0^2
    ((4.0, 8.0, 9.0), (3.0, 4.0)),
    ((9.0, 10.0, 18.0), (4.0, 1.0)),
    ((3.0, 6.0, 8.0), (4.0, 3.0)),
    ((5.0, 13.0, 18.0), (3.0, 2.0)),
    ((9.0, 15.0, 18.0), (1.0, 1.0)),
)


def _point(rng: Random, size: int) -> list[float]:
    """Returns a point of the unit sphere, evenly distributed."""
    while True:
        v = [2.0 * rng.random() - 1.0 for _ in range(size)]
        square = sum(x * x for x in v)
        if 0.01 < square < 1.0:
            return [x / math.sqrt(square) for x in v]


def _spin(rng: Random, size: float) -> list[float]:
    return [size * x for x in _point(rng, 3)]


def _moments(rng: Random) -> list[float]:
    x, y, z = (0.1 + rng.random() for _ in range(3))
    return [y + z, x + z, x + y]


def _diagonal(moments: Sequence[float]) -> list[list[float]]:
    return [[moments[i] if i == j else 0.0 for j in range(3)] for i in range(3)]


def _rotation(rng: Random) -> list[list[float]]:
    w, x, y, z = _point(rng, 4)
    return [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]


def _turned(R: list[list[float]], moments: Sequence[float]) -> list[list[float]]:
    J = [[0.0] * 3 for _ in range(3)]
    for i in range(3):
        for j in range(i, 3):
            J[i][j] = J[j][i] = sum(R[i][n] * moments[n] * R[j][n] for n in range(3))
    return J


def _carried(R: list[list[float]], v: Sequence[float]) -> list[float]:
    return [sum(R[i][n] * v[n] for n in range(3)) for i in range(3)]


def _mixed(rng: Random, moments: Sequence[float], omega: Sequence[float]) -> tuple[list[float], list[float]]:
    """Returns moments and rates with their axes in another order."""
    order = [0, 1, 2]
    rng.shuffle(order)
    return [moments[i] for i in order], [omega[i] for i in order]


def _free(
    rng: Random,
    name: str,
    moments: Sequence[float],
    omega: Sequence[float],
    time: float,
    *,
    full: bool = False,
) -> Problem:
    """Returns a problem without torque from rates about principal axes, which it puts in another order."""
    if full:
        R = _rotation(rng)
        return Problem(name, _turned(R, moments), _point(rng, 4), _carried(R, omega), NONE, time)
    J, w = _mixed(rng, moments, omega)
    return Problem(name, _diagonal(J), _point(rng, 4), w, NONE, time)


def _general(rng: Random, full: bool) -> Iterator[Problem]:
    for time in (1e-9, 1e-6, 1e-3, 0.1, 1.0, 3.7, 10.0, 20.0, 100.0, 1e3, 1e4, 1e5):
        yield _free(rng, f"{time:g} s", _moments(rng), _spin(rng, 1.0), time, full=full)


def _many_turns(rng: Random, full: bool) -> Iterator[Problem]:
    for time, size in (
        (1e5, 1e-3),
        (1e5, 0.3),
        (1e4, 10.0),
        (1e5, 100.0),
        (1e3, 1e4),
        (1e5, 1e4),
        (10.0, 1e8),
    ):
        name = f"{size:g} rad/s, {time:g} s"
        yield _free(rng, name, _moments(rng), _spin(rng, size), time, full=full)
    yield _free(rng, "flat, 1e9 rad", [1.0, 1.5, 2.5], _spin(rng, 1e4), 1e5, full=full)


def _rates(rng: Random, full: bool) -> Iterator[Problem]:
    for size, time in (
        (1e-310, 1.0),
        (3e-323, 10.0),
        (1e-308, 1e5),
        (1e-200, 1e5),
        (1e-100, 1e5),
        (1e100, 1e-100),
        (1e150, 1e-150),
        (1e150, 1e-149),
        (1e150, 1e-147),
        (1e150, 1e-141),
    ):
        yield _free(rng, f"{size:g} rad/s, {time:g} s", _moments(rng), _spin(rng, size), time, full=full)


def _sizes(rng: Random, full: bool) -> Iterator[Problem]:
    for size, rate, time in (
        (1e-300, 1.0, 0.01),
        (1e-300, 1.0, 10.0),
        (1e-300, 1e-9, 1e5),
        (1e-300, 1e4, 1e5),
        (1e-150, 1.0, 100.0),
        (1e150, 1.0, 100.0),
        (1e300, 1.0, 0.01),
        (1e300, 1.0, 10.0),
        (1e300, 1e4, 1e5),
        (1e300, 1e-310, 1e5),
    ):
        moments = [size * x for x in _moments(rng)]
        yield _free(
            rng, f"{size:g} kg m2, {rate:g} rad/s, {time:g} s", moments, _spin(rng, rate), time, full=full
        )


def _slender(rng: Random, full: bool) -> Iterator[Problem]:
    for ratio, time in (
        (1e-12, 1e-3),
        (1e-12, 1.0),
        (1e-12, 10.0),
        (1e-12, 1e3),
        (1e-12, 1e5),
        (1e-9, 10.0),
        (1e-9, 1e4),
        (1e-6, 10.0),
        (1e-6, 1e4),
        (1e-3, 1e3),
    ):
        moments = [ratio, 1.0, 1.0 + 0.8 * rng.random() * ratio]
        yield _free(rng, f"{ratio:g}, {time:g} s", moments, _spin(rng, 1.0), time, full=full)
    yield _free(rng, "1e-12, spinning", [1e-12, 1.0, 1.0 + 5e-13], [1.0, 1e-3, 1e-3], 1e3, full=full)
    yield _free(rng, "1e-12, two alike", [1e-12, 1.0, 1.0], [1e3, 0.5, 0.3], 1e3, full=full)


def _flat(rng: Random, full: bool) -> Iterator[Problem]:
    for time in (1e-3, 1.0, 5.0, 10.0, 20.0, 1e3, 1e5):
        a, b = (1.0 + rng.randrange(2**40) / 2.0**40 for _ in range(2))  # a + b is exact
        yield _free(rng, f"{time:g} s", [a, b, a + b], _spin(rng, 1.0), time, full=full)
    yield _free(rng, "disc", [1.0, 1.0, 2.0], _spin(rng, 1.0), 50.0, full=full)
    yield _free(rng, "thin strip", [2.0**-40, 1.0, 1.0 + 2.0**-40], _spin(rng, 1.0), 50.0, full=full)


def _symmetric(rng: Random, full: bool) -> Iterator[Problem]:
    for ratio in (0.01, 0.5, 0.9, 1.1, 1.5, 2.0):  # moment about the axis over the other two
        for time in (3.0, 1e4):
            yield _free(
                rng, f"{ratio:g}, {time:g} s", [1.3, 1.3, 1.3 * ratio], _spin(rng, 1.0), time, full=full
            )


def _symmetric_to_an_ulp(rng: Random, full: bool) -> Iterator[Problem]:
    for ratio in (0.01, 0.7, 1.4, 1.9):
        for ulps in (1, -1, 3):
            a = 1.0 + rng.random() / 2.0
            time = (1.0, 20.0, 1e5)[abs(ulps) % 3]
            moments = [a, a + ulps * ULP, a * ratio]
            yield _free(rng, f"{ratio:g}, {ulps} ulp, {time:g} s", moments, _spin(rng, 1.0), time, full=full)


def _spherical(rng: Random, full: bool) -> Iterator[Problem]:
    for size in (1.0, 0.7, 1e-12, 1e12):
        for time in (2.0, 1e5):
            yield _free(rng, f"{size:g} kg m2, {time:g} s", [size] * 3, _spin(rng, 1.0), time, full=full)


def _spherical_to_an_ulp(rng: Random) -> Iterator[Problem]:
    for steps in ((0, 0, 1), (0, 1, 1), (0, 1, 2), (0, 1, 3)):
        for time in (2.0, 1e5):
            moments = [1.25 + n * ULP for n in steps]
            yield _free(rng, f"{steps}, {time:g} s", moments, _spin(rng, 1.0), time)


def _nearly_spherical(rng: Random, full: bool) -> Iterator[Problem]:
    for off in (1e-4, 1e-8, 1e-12):
        for time in (1.0, 20.0, 1e5):
            moments = [2.0 * (1.0 + off * rng.random()) for _ in range(3)]
            yield _free(rng, f"{off:g}, {time:g} s", moments, _spin(rng, 1.0), time, full=full)


def _on_separatrix(rng: Random) -> Iterator[tuple[str, list[float], list[float], float]]:
    """Yields name, moments, rates and time; the rates are products of few bits with a number of 40 bits."""
    for n, (moments, ratio) in enumerate(TRIPLES):
        for time in (1.0, 6.0, 12.0):
            unit = (1 + rng.randrange(2**40)) / 2.0**42
            middle = (1.0, -0.3, 0.01)[n % 3] * rng.random()
            signs = [rng.choice((-1.0, 1.0)) for _ in range(2)]
            w = [signs[0] * ratio[0] * unit, middle, signs[1] * ratio[1] * unit]
            yield f"{moments}, {time:g} s", list(moments), w, time / (1.0 + unit)


def _separatrix(rng: Random) -> Iterator[Problem]:
    for name, moments, w, time in _on_separatrix(rng):
        J, a, c = [mp.mpf(x) for x in moments], mp.mpf(w[0]), mp.mpf(w[2])
        if J[2] * (J[2] - J[1]) * c**2 != J[0] * (J[1] - J[0]) * a**2:
            raise ArithmeticError(f"{name} is not on the separatrix")
        yield _free(rng, name, moments, w, time)


def _near_separatrix(rng: Random, full: bool) -> Iterator[Problem]:
    for n, (name, moments, w, time) in enumerate(_on_separatrix(rng)):
        off = (1e-15, -1e-15, 1e-12, -1e-8)[n % 4]
        w[0] *= 1.0 + off
        yield _free(rng, f"{off:g}, {name}", moments, w, time * (1.0 if n % 5 else 4.0), full=full)


def _steady(rng: Random) -> Iterator[Problem]:
    for axis in range(3):
        for rate, time in ((1.0, 0.5), (-0.7, 20.0), (1e4, 1e5)):
            w = [rate if i == axis else 0.0 for i in range(3)]
            yield _free(rng, f"axis {axis}, {rate:g} rad/s, {time:g} s", [1.0, 2.0, 2.5], w, time)
    yield _free(rng, "across a prolate body", [1.0, 2.0, 2.0], [0.0, 0.3, 0.4], 30.0)
    yield _free(rng, "across an oblate body", [1.5, 1.5, 2.0], [0.3, 0.4, 0.0], 30.0)


def _disturbed(rng: Random, full: bool) -> Iterator[Problem]:
    for axis, rate in ((0, 1.0), (1, 1.0), (1, -1.0), (2, -1.0)):
        for off, time in ((1e-10, 10.0), (1e-10, 60.0), (1e-5, 60.0)):
            w = [rate if i == axis else off * (2.0 * rng.random() - 1.0) for i in range(3)]
            yield _free(
                rng, f"axis {axis}, {rate:g} rad/s, {off:g}, {time:g} s", [1.0, 2.0, 2.5], w, time, full=full
            )


def _rest(rng: Random) -> Iterator[Problem]:
    for time in (0.0, 1e-9, 1.0, 1e5):
        yield _free(rng, f"diagonal, {time:g} s", _moments(rng), NONE, time)
        yield _free(rng, f"full, {time:g} s", _moments(rng), NONE, time, full=True)
    yield _free(rng, "no time", _moments(rng), _spin(rng, 1.0), 0.0)


def _backwards(rng: Random, full: bool) -> Iterator[Problem]:
    for time in (-1e-9, -0.1, -1.0, -5.0, -20.0, -1e3, -1e5):
        yield _free(rng, f"{time:g} s", _moments(rng), _spin(rng, 1.0), time, full=full)
    yield _free(rng, "slender, -100 s", [1e-12, 1.0, 1.0 + 3e-13], _spin(rng, 1.0), -100.0, full=full)


def _turn_in_a_step(rng: Random, full: bool) -> Iterator[Problem]:
    for turn in (1.0, 10.0, 1000.0):
        for rate in (1e-3, 1.0, 50.0):
            name = f"{turn:g} rad, {rate:g} rad/s"
            yield _free(rng, name, _moments(rng), _spin(rng, rate), turn / rate, full=full)


def _forced(
    rng: Random,
    name: str,
    moments: Sequence[float],
    omega: Sequence[float],
    *,
    torque: Sequence[float],
    time: float,
    full: bool,
) -> Problem:
    if full:
        R = _rotation(rng)
        w, M = _carried(R, omega), _carried(R, torque)
        return Problem(name, _turned(R, moments), _point(rng, 4), w, M, time)
    return Problem(name, _diagonal(moments), _point(rng, 4), list(omega), list(torque), time)


def _weak(rng: Random, full: bool) -> Iterator[Problem]:
    for size, time in ((1e-12, 0.1), (1e-12, 1.0), (1e-12, 10.0), (1e-12, 40.0), (1e-9, 40.0), (1e-6, 40.0)):
        name = f"{size:g} N m, {time:g} s"
        yield _forced(
            rng, name, _moments(rng), _spin(rng, 0.9), torque=_spin(rng, size), time=time, full=full
        )


def _moderate(rng: Random, full: bool) -> Iterator[Problem]:
    for time in (0.1, 1.0, 4.0, 10.0, 20.0, -20.0, 40.0):
        name = f"0.03 N m, {time:g} s"
        yield _forced(
            rng, name, _moments(rng), _spin(rng, 0.6), torque=_spin(rng, 0.03), time=time, full=full
        )
    moments, omega, torque = [1.0, 2.0, 3.0], [0.3, 0.7, 0.5], [0.01, -0.02, 0.015]
    yield _forced(rng, "about 36 rad", moments, omega, torque=torque, time=40.0, full=full)


def _strong(rng: Random, full: bool) -> Iterator[Problem]:
    for start in (0.0, 1e-3):
        words = f"{start:g} rad/s, 1000 N m"
        for size, time in ((1.0, 0.1), (1.0, 0.25), (1e3, 4.0), (2e4, 40.0)):
            moments = [size * x for x in _moments(rng)]
            name = f"{words}, {size:g} kg m2, {time:g} s"
            yield _forced(rng, name, moments, _spin(rng, start), torque=_spin(rng, 1e3), time=time, full=full)
    yield _forced(rng, "about one axis", [1.0, 2.0, 2.5], NONE, torque=[0.0, 1e3, 0.0], time=0.2, full=full)


def _forced_turns(rng: Random, full: bool) -> Iterator[Problem]:
    for turn in (1.0, 10.0):
        for rate, size in ((1e-2, 1e-6), (1.0, 1e-3), (1.0, 0.3), (50.0, 100.0)):
            name = f"{turn:g} rad, {rate:g} rad/s, {size:g} N m"
            moments, omega, torque = _moments(rng), _spin(rng, rate), _spin(rng, size)
            yield _forced(rng, name, moments, omega, torque=torque, time=turn / rate, full=full)


def _forced_shapes(rng: Random, full: bool) -> Iterator[Problem]:
    needle = [1e-12, 1.0, 1.0 + 5e-13]
    for name, moments, torque in (
        ("slender, across", needle, [0.0, 0.02, -0.03]),
        ("slender, about the needle too", needle, [1e-14, 0.02, -0.03]),
        ("slender, 1e-6", [1e-6, 1.0, 1.0 + 5e-7], [1e-8, 0.02, -0.03]),
        ("flat", [1.0, 1.5, 2.5], [0.02, 0.01, -0.03]),
        ("symmetric", [1.3, 1.3, 0.7], [0.02, 0.01, -0.03]),
        ("symmetric to an ulp", [1.3, 1.3 + ULP, 2.0], [0.02, 0.01, -0.03]),
        ("spherical", [2.0, 2.0, 2.0], [0.02, 0.01, -0.03]),
        ("spherical, spin along the torque", [2.0, 2.0, 2.0], None),
        ("1e300 kg m2", [1e300, 2e300, 2.5e300], [2e298, 1e298, -3e298]),
        ("1e-300 kg m2", [1e-300, 2e-300, 2.5e-300], [2e-302, 1e-302, -3e-302]),
    ):
        omega = _spin(rng, 0.6)
        push = torque or [0.125 * x for x in omega]
        yield _forced(rng, name, moments, omega, torque=push, time=15.0, full=full)


DIAGONAL_AND_FULL: dict[str, Callable[[Random, bool], Iterator[Problem]]] = {
    "general": _general,
    "many turns": _many_turns,
    "tiny and huge rates": _rates,
    "tiny and huge moments": _sizes,
    "slender": _slender,
    "flat": _flat,
    "symmetric": _symmetric,
    "symmetric to an ulp": _symmetric_to_an_ulp,
    "spherical": _spherical,
    "nearly spherical": _nearly_spherical,
    "near the separatrix": _near_separatrix,
    "spin disturbed": _disturbed,
    "backwards": _backwards,
    "omega h of 1, 10, 1000": _turn_in_a_step,
    "torque, weak": _weak,
    "torque, moderate": _moderate,
    "torque that dwarfs momentum": _strong,
    "torque, omega h of 1, 10": _forced_turns,
    "torque, odd bodies": _forced_shapes,
}
ONE_KIND: dict[str, Callable[[Random], Iterator[Problem]]] = {
    "spherical to an ulp": _spherical_to_an_ulp,
    "separatrix": _separatrix,
    "steady spin": _steady,
    "at rest": _rest,
}


def problems() -> Iterator[tuple[str, Problem]]:
    """Yields category and problem, each category from a seed of its own."""
    seed = 0
    for name, make in DIAGONAL_AND_FULL.items():
        for full in (False, True):
            seed += 1
            for problem in make(Random(seed), full):
                yield name + ", full tensor" * full, problem
    for name, make_one in ONE_KIND.items():
        seed += 1
        for problem in make_one(Random(seed)):
            yield name, problem


def main() -> None:
    """Solves all problems and writes the file."""
    lines, began = [], perf_counter()
    for category, problem in problems():
        case, checked = _solved(category, problem)
        lines.append(json.dumps(case, separators=(",", ":")))
        words = f"cond {case['cond_attitude']}, {case['cond_rate']}  {checked}"
        print(f"{perf_counter() - began:6.0f} s  {category}: {problem.name}  {words}", flush=True)
    FILE.write_text("[\n" + ",\n".join(lines) + "\n]\n", encoding="utf-8")


if __name__ == "__main__":
    main()
