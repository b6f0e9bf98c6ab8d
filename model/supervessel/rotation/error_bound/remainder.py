"""How far one step of a method is from the law's exact motion at most: a remainder bound, in CasADi symbols.

The rate obeys w' = c + B w + G(w, w). The power series in the step, of a Runge-Kutta or Taylor step as of the
exact motion, are majorised by those of one scalar problem, whose coefficients are known: [EB] eqs. (23) to
(28).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal, localcontext
from functools import cache
from math import pi
from typing import Any

import casadi as ca

from supervessel.rotation.error_bound.carried import MotionBounds, TurnedBody
from supervessel.rotation.error_bound.constants import BoundConstants
from supervessel.rotation.propagators import dop853
from supervessel.scene.numbers import EPSILON
from supervessel.scene.schema import Rotation

DEPTH = 512
"""Roundings that follow on each other in one step, at most (counted in tests/model/test_error_bound.py)."""

CAUTION = 10.0
"""Times that a method's own estimate is taken where its steps have no bound: some steps are off by more."""

SURE_ANGLE = 0.05
"""Angle a of a sub-step of rk4 [rad] up to which a rigid body's z stays below 1/4.

Its size h keeps (h |w|)^2 + 2 a h^2 |c| <= a^2, `propagators.bound`, and g^2 <= 3/2 as each (J_j - J_k)/J_i
is at most 1: so z <= sqrt(1.5 a^2 + 1.23 a/2), which is 0.19.
"""

Weights = Mapping[int, float]
Series = list[Decimal]

RK4_STAGES: tuple[Weights, ...] = ({}, {0: 0.5}, {1: 0.5}, {2: 1.0})
RK4_WEIGHTS: Weights = {0: 1.0 / 6.0, 1: 1.0 / 3.0, 2: 1.0 / 3.0, 3: 1.0 / 6.0}
"""Of the method in `propagators.rk4`, as `propagators.dop853` has its own."""


@dataclass(frozen=True)
class Remainder:
    """Constants of [EB] eq. (27): a step is off by at most v C_w z^n in the rate, C_q z^n in the quaternion.

    power : n, one more than the order; an expression where the order is chosen in flight
    limit : largest z for which that is shown
    rate  : C_w
    turn  : C_q
    """

    power: int | ca.SX
    limit: float
    rate: float
    turn: float | ca.SX


UNKNOWN = Remainder(1, -1.0, 0.0, 0.0)
"""Of a method whose steps have no bound."""


def has_sure_remainder(rotation: Rotation) -> bool:
    """Whether a method's steps are always short enough for their remainder: no estimate is asked for then."""
    return rotation.propagator == "rk4" and rotation.max_angle_step <= SURE_ANGLE


@cache
def remainder_of(method: str, order: int = 0) -> Remainder:
    """Returns the constants of a method, "rk4", "dop853" or "taylor"; order : of "taylor"."""
    if method == "rk4":
        return _of_runge_kutta(RK4_STAGES, RK4_WEIGHTS, 4, 0.25)
    if method == "dop853":
        return _of_runge_kutta(dop853.STAGES, dop853.WEIGHTS, 8, 2.0**-6)
    return remainder_of_taylor(order)


def remainder_of_taylor(order: int | ca.SX) -> Remainder:
    """Returns the constants of a Taylor step, whose order may be an expression. [EB] eq. (26)."""
    limit = 0.5
    return Remainder(order + 1, limit, *_exact_tails(order, limit))


def _exact_tails(order: Any, z: float) -> tuple[float, Any]:
    """Returns the series of 1/(1 - z) and 1/(1 - z)^2 beyond an order, over z^(order + 1). [EB] eq. (26)."""
    return 1.0 / (1.0 - z), (order + 2.0) / (1.0 - z) + z / (1.0 - z) ** 2


def _of_runge_kutta(stages: Sequence[Weights], weights: Weights, order: int, limit: float) -> Remainder:
    """Returns the constants of an explicit Runge-Kutta method. [EB] eq. (27).

    What the method's own majorant has beyond its order is its value less its first coefficients, with 60
    digits; one in a thousand is added for rounding to doubles.
    """
    with localcontext(prec=60):
        z = Decimal(limit)
        value = _majorant(stages, weights, [z], 1)
        first = _majorant(stages, weights, [Decimal(0), Decimal(1)], order + 1)
        kept = [sum(c * z**k for k, c in enumerate(part)) for part in first]
        own = [float((sum(whole) - part) / z ** (order + 1)) for whole, part in zip(value, kept, strict=True)]
    exact = _exact_tails(order, limit)
    return Remainder(order + 1, limit, *(1.001 * (a + b) for a, b in zip(own, exact, strict=True)))


def _majorant(stages: Sequence[Weights], weights: Weights, step: Series, size: int) -> tuple[Series, Series]:
    """Returns V and Q after a step of V' = V^2, Q' = 2 Q V from 1, the method's weights taken by their sizes.

    step : series of the step; of the results as many coefficients as `size`
    """
    speeds: list[tuple[Series, Series]] = []

    def reached(stage: Weights) -> tuple[Series, Series]:
        ends = []
        for part in (0, 1):
            total = [Decimal(0)] * size
            for j, weight in stage.items():
                total = [a + abs(Decimal(weight)) * b for a, b in zip(total, speeds[j][part], strict=True)]
            end = _times(step, total, size)
            ends.append([end[0] + 1, *end[1:]])
        return ends[0], ends[1]

    for stage in stages:
        V, Q = reached(stage)
        speeds.append((_times(V, V, size), [2 * c for c in _times(Q, V, size)]))
    return reached(weights)


def _times(a: Series, b: Series, size: int) -> Series:
    product = [Decimal(0)] * size
    for i, x in enumerate(a):
        for j, y in enumerate(b[: max(size - i, 0)]):
            product[i + j] += x * y
    return product


def step_error(
    remainder: Remainder | None,
    constants: BoundConstants,
    body: TurnedBody,
    motion: MotionBounds,
    estimate: ca.SX | None = None,
) -> ca.SX:
    """Returns what a step adds at most to the bound, (2,): attitude [rad], energy norm [J^(1/2)].

    remainder : of the method; None for exact free motion, of which rounding alone is counted
    motion    : of the law over the step
    estimate  : (2,) [rad, rad/s], the method's own estimate of its error, taken instead where the step is too
                long for the bound; None: infinite there
    [EB] eqs. (24), (27), (28).
    """
    rounding, quaternion = _rounding(constants, body, motion)
    root = ca.sqrt(constants.heaviest)  # at least the norm of L
    energy = root * rounding
    if remainder is None:
        return ca.vertcat(pi * quaternion, energy)
    known = motion.share <= remainder.limit
    power = _power(ca.fmin(motion.share, remainder.limit), remainder.power)
    power = ca.if_else(known, power, ca.inf if estimate is None else 0.0)
    if constants.law.gyroscopic_term:
        energy += root * (remainder.rate * motion.scale * power)
    angle = pi * (quaternion + remainder.turn * power)
    if estimate is not None:
        angle += ca.if_else(known, 0.0, CAUTION * estimate[0])
        energy += ca.if_else(known, 0.0, CAUTION * (root * estimate[1]))
    return ca.vertcat(angle, energy)


def _power(z: ca.SX, exponent: int | ca.SX) -> ca.SX:
    """Returns a power by products where the exponent is a number: C's pow costs more."""
    if isinstance(exponent, ca.SX):
        return z**exponent
    if exponent == 1:
        return z
    half = _power(z, exponent // 2)
    return half * half * z if exponent % 2 else half * half


def _rounding(constants: BoundConstants, body: TurnedBody, motion: MotionBounds) -> tuple[ca.SX, ca.SX]:
    """Returns what rounding of a step leaves, rate [rad/s] and quaternion. [EB] eq. (28)."""
    u, h, reach = 0.5 * EPSILON, motion.step, motion.reach
    force = ca.norm_2(body.torque)
    if constants.law.gyroscopic_term:
        force += reach * (constants.heaviest * reach + ca.norm_2(body.spin))
    rate = u * (4.0 * reach + (DEPTH * h) * (constants.lightness * force))
    return rate, u * (8.0 + (DEPTH * h) * reach) + 0.5 * h * rate
