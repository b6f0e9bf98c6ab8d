"""Taylor series of gravity's gradient on a body that turns as it goes about the attracting centre."""

from collections.abc import Sequence
from operator import mul

import casadi as ca

from supervessel.rotation.attitude import to_body, to_inertial, unit
from supervessel.rotation.gravity import PRODUCTS, Field, strength
from supervessel.rotation.laws import RotationLaw

Coefficients = list[ca.SX]
"""Of s^0, s^1, and so on."""


class GradientSeries:
    """The series along a step, in s = (time since the start)/step, coefficient by coefficient.

    Position and velocity are followed in body axes, in units of the distance at the start: R^T r = d x and
    R^T v = d y, d = |r| at the start. With q = x . x, the square of the distance, and m = mu/d^3,
    x' = y - omega x x, y' = -m q^(-3/2) x - omega x y,
    and the acceleration is 3 m q^(-5/2) times a linear map of the products of two components of x.
    Powers of q by q (q^a)' = a q' q^a, so that
    k q_0 (q^a)_k = sum over j from 1 to k of (a j - (k - j)) q_j (q^a)_k-j.
    Source: [EQ] Gravity's gradient, eq. (15); [JZ] for the series of a power.
    """

    def __init__(self, field: Field, law: RotationLaw, numbers: ca.SX, state: ca.SX, step: ca.SX) -> None:
        """Begins the series.

        field, law, numbers : as in `StepSymbols`
        state               : attitude, of any length near 1, and angular velocity
        step                : [s]
        """
        position, velocity = field.start[:3], field.start[3:]
        self._distance = ca.sqrt(ca.sumsqr(position))
        per, attitude = 1.0 / self._distance, unit(state[:4])
        place, motion = (to_body(attitude, per * vector) for vector in (position, velocity))
        self._step, self._strength = step, strength(field.mu, position)
        self._map = self._strength * step * field.gradient_map(law, numbers)
        self._place, self._motion = [ca.vertsplit(place)], [ca.vertsplit(motion)]
        self._square: Coefficients = []
        self._pull: Coefficients = []  # q^(-3/2)
        self._twist: Coefficients = []  # q^(-5/2)
        self._products: list[ca.SX] = []

    def next(self, rates: Sequence[Sequence[ca.SX]]) -> ca.SX:
        """Returns coefficient k of step times the acceleration by the gradient, (3,), body axes.

        rates : coefficients 0 .. k of the angular velocity; each call is for one k more, from 0
        Position and velocity get their coefficients k + 1.
        """
        place, k = self._place, len(rates) - 1
        rows = list(zip(*place, strict=True))
        self._square.append(sum((_coefficient(row, row) for row in rows), ca.SX(0)))
        self._pull.append(_power(self._square, self._pull, -1.5))
        self._twist.append(_power(self._square, self._twist, -2.5))
        count = self._map.size2()
        self._products.append(ca.vertcat(*(_coefficient(rows[i], rows[j]) for i, j in PRODUCTS[:count])))
        turned = sum(map(mul, self._twist, reversed(self._products)), ca.SX.zeros(count))
        scale = self._step / (k + 1)
        pull = -self._strength / 3.0
        fall = ca.vertcat(*(pull * _coefficient(self._pull, row) for row in rows))
        omega, motion = list(zip(*rates, strict=True)), list(zip(*self._motion, strict=True))
        shifted = ca.vertcat(*(column[-1] for column in motion)) - _cross(omega, rows)
        self._place.append(ca.vertsplit(scale * shifted))
        self._motion.append(ca.vertsplit(scale * (fall - _cross(omega, motion))))
        return self._map @ turned

    def end(self, attitude: ca.SX) -> ca.SX:
        """Returns position [m] and velocity [m/s] at the step's end, (6,), inertial axes.

        attitude : q_inertial_body at the step's end, (4,), of unit length
        """
        both = (_total(series) for series in (self._place, self._motion))
        return ca.vertcat(*(self._distance * to_inertial(attitude, vector) for vector in both))


def _coefficient(one: Sequence[ca.SX], other: Sequence[ca.SX]) -> ca.SX:
    """Returns the latest coefficient of the product of two series that are known up to it."""
    return sum(map(mul, one, reversed(other)), ca.SX(0))


def _cross(omega: Sequence[Sequence[ca.SX]], vector: Sequence[Sequence[ca.SX]]) -> ca.SX:
    """Returns the latest coefficient of omega x vector, (3,), of three series each."""
    (p, q, r), (x, y, z) = omega, vector
    pairs = (((q, z), (r, y)), ((r, x), (p, z)), ((p, y), (q, x)))
    return ca.vertcat(*(_coefficient(*first) - _coefficient(*second) for first, second in pairs))


def _power(base: Coefficients, power: Coefficients, exponent: float) -> ca.SX:
    """Returns the next coefficient of base^exponent, an exponent of -3/2, -5/2 or the like.

    base, power : their coefficients, of the base one more
    """
    k = len(power)
    if k == 0:
        return 1.0 / (base[0] ** int(-exponent) * ca.sqrt(base[0]))
    terms = ((exponent * j - (k - j)) * base[j] * power[k - j] for j in range(1, k + 1))
    return sum(terms, ca.SX(0)) / (k * base[0])


def _total(series: Sequence[Sequence[ca.SX]]) -> ca.SX:
    """Returns the sum of a series, (3,), the smallest terms first."""
    return sum((ca.vertcat(*term) for term in reversed(series)), ca.SX.zeros(3))
