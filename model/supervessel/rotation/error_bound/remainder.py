"""How far one step of a method is from the law's exact motion at most: a remainder bound, in CasADi symbols.

The rate obeys w' = c + B w + G(w, w). The power series in the step, of a Runge-Kutta or Taylor step as of the
exact motion, are majorised by those of one scalar problem, whose coefficients are known: [EB] eqs. (23) to
(28).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from math import pi
from typing import Any

import casadi as ca

from supervessel.rotation.error_bound.carried import MotionBounds, TurnedBody
from supervessel.rotation.error_bound.constants import BoundConstants
from supervessel.rotation.error_bound.majorants import (
    MARGIN,
    Weights,
    exact_tails,
    method_tails,
    turning,
    turning_in_orbit,
)
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

SURE_ANGLE_IN_ORBIT = 0.003
"""The same for z up to 1/8 where gravity's gradient turns the body too.

The size keeps (h |w|)^2 + 2 a h^2 c <= a^2 with c the length of both accelerations, and h times the orbit's
pace below a/3. v is at most |w| + sqrt(c/g), or sqrt(2 c/g), and z at most h v max(g, 1) or 2 a/3: with
1/4 <= g <= sqrt(3/2) z <= sqrt(1.5 a^2 + 4 a), which is 0.11.
"""

RK4_STAGES: tuple[Weights, ...] = ({}, {0: 0.5}, {1: 0.5}, {2: 1.0})
RK4_WEIGHTS: Weights = {0: 1.0 / 6.0, 1: 1.0 / 3.0, 2: 1.0 / 3.0, 3: 1.0 / 6.0}
"""Of the method in `propagators.rk4`, as `propagators.dop853` has its own."""


ORBIT_DEPTH = 768
"""The same in a field of gravity (counted in tests/model/test_error_bound_gravity.py)."""


@dataclass(frozen=True)
class Remainder:
    """Constants of what a step is off by at most: v C_w z^n in the rate, C_q z^n in the quaternion.

    [EB] eqs. (27), (49).
    power : n, one more than the order; an expression where the order is chosen in flight
    limit : largest z for which that is shown
    rate  : C_w
    turn  : C_q
    place : C_p of the centre's place in a field of gravity, of [EB] eq. (49)
    guess : where z is larger, the place is off by at most that times y^n, y being the angle that the centre
            goes on by (measured in tests/model/test_error_bound_gravity.py, not proven)
    turns : whether the place is followed in body axes, so that an error of the attitude is one of the place
    """

    power: int | ca.SX
    limit: float
    rate: float | ca.SX
    turn: float | ca.SX
    place: float | ca.SX = 0.0
    guess: float = 0.0
    turns: bool = False


UNKNOWN = Remainder(1, -1.0, 0.0, 0.0)
"""Of a method whose steps have no bound."""

GUESSES = {4: 1.0, 8: 2.0**-4}
"""`Remainder.guess` of the Runge-Kutta methods, by their order."""

UNKNOWN_IN_ORBIT = Remainder(9, -1.0, 0.0, 0.0, 0.0, GUESSES[8])
"""The same in a field of gravity: between kicks the centre moves by the method of order 8."""


def has_sure_remainder(rotation: Rotation, *, in_orbit: bool = False) -> bool:
    """Whether a method's steps are always short enough for their remainder: no estimate is asked for then.

    in_orbit : whether gravity's gradient turns the body
    """
    angle = SURE_ANGLE_IN_ORBIT if in_orbit else SURE_ANGLE
    return rotation.propagator == "rk4" and rotation.max_angle_step <= angle


@cache
def remainder_of(method: str, order: int = 0, *, in_orbit: bool = False) -> Remainder:
    """Returns the constants of a method, "rk4", "dop853" or "taylor".

    order    : of "taylor"
    in_orbit : whether gravity's gradient turns the body
    """
    if method == "rk4":
        return _of_runge_kutta((RK4_STAGES, RK4_WEIGHTS), 4, 2.0**-3 if in_orbit else 0.25, in_orbit)
    if method == "dop853":
        stages = (dop853.STAGES, dop853.WEIGHTS)
        return _of_runge_kutta(stages, 8, 2.0**-9 if in_orbit else 2.0**-6, in_orbit)
    return remainder_of_taylor(order, in_orbit=in_orbit)


def remainder_of_taylor(order: int | ca.SX, *, in_orbit: bool = False) -> Remainder:
    """Returns the constants of a Taylor step, whose order may be an expression. [EB] eqs. (26), (49)."""
    if not in_orbit:
        return Remainder(order + 1, 0.5, *_exact_tails(order, 0.5))
    tail = TAYLOR_RADIUS ** -(order + 1.0) / (1.0 - TAYLOR_LIMIT / TAYLOR_RADIUS)
    rate, turn, turned_place, place = (x * tail for x in TAYLOR_VALUES)
    return Remainder(order + 1, TAYLOR_LIMIT, rate, turn, turned_place + pi * place * turn, 1.0, turns=True)


TAYLOR_RADIUS, TAYLOR_LIMIT = 0.3, 2.0**-4
"""Where the majorant's values are taken that bound its coefficients, and the largest z. [EB] eq. (49)."""

TAYLOR_VALUES = (2.62, 1.24, 1.87, 1.23)
"""Of V, Q, Q^2 Y and Y at TAYLOR_RADIUS, from above; Y is larger than X."""


def _exact_tails(order: Any, z: float) -> tuple[float, Any]:
    """Returns the series of 1/(1 - z) and 1/(1 - z)^2 beyond an order, over z^(order + 1). [EB] eq. (26)."""
    return 1.0 / (1.0 - z), (order + 2.0) / (1.0 - z) + z / (1.0 - z) ** 2


def _of_runge_kutta(
    method: tuple[Sequence[Weights], Weights], order: int, limit: float, in_orbit: bool
) -> Remainder:
    """Returns the constants of an explicit Runge-Kutta method. [EB] eqs. (27), (49)."""
    if not in_orbit:
        own = method_tails(turning, 2, method, order, limit)
        exact: Sequence[float] = _exact_tails(order, limit)
    else:
        own = method_tails(turning_in_orbit, 4, method, order, limit)
        exact = exact_tails(turning_in_orbit, 4, order, limit)
    rate, turn, *place = (MARGIN * (a + b) for a, b in zip(own, exact, strict=True))
    return Remainder(order + 1, limit, rate, turn, max(place, default=0.0), GUESSES[order])


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
    [EB] eqs. (24), (27), (28); in a field of gravity (47) to (49).
    """
    rounding, quaternion = _rounding(constants, body, motion)
    root = ca.sqrt(constants.heaviest)  # at least the norm of L
    energy = root * rounding
    if remainder is None:
        return ca.vertcat(pi * quaternion, energy)
    known, power = _known_power(remainder, motion, estimate is None)
    if constants.law.gyroscopic_term or motion.centre is not None:
        energy += root * (remainder.rate * motion.scale * power)
    angle = pi * (quaternion + remainder.turn * power)
    if estimate is not None:
        angle += ca.if_else(known, 0.0, CAUTION * estimate[0])
        energy += ca.if_else(known, 0.0, CAUTION * (root * estimate[1]))
    return ca.vertcat(angle, energy)


def place_error(remainder: Remainder | None, motion: MotionBounds, estimate: ca.SX | None) -> ca.SX:
    """Returns what a step adds at most to the error of the centre's place, see `centre_motion.place_after`.

    remainder, estimate : see `step_error`
    motion              : in a field of gravity
    The estimates know attitude and rate alone. Where they are taken, the place's error is measured, not
    proven, see `Remainder.guess`; of a series in body axes the estimate of the attitude counts too, over the
    square of the angle that the centre goes on by: so much less does an error of the place turn the body in
    such a step. [EB] eq. (55).
    """
    centre = motion.centre
    assert centre is not None
    relative = motion.pace / centre.fall_rate
    rounding = 0.5 * EPSILON * (8.0 + ORBIT_DEPTH * (motion.pace * motion.step))
    if remainder is None:
        return relative * rounding
    known, power = _known_power(remainder, motion, estimate is None)
    error = relative * (rounding + remainder.place * power)
    if estimate is None:
        return error
    off = remainder.guess * _power(ca.fmin(centre.gone, 1.0), remainder.power)
    if remainder.turns:
        gone = ca.fmax(centre.gone, SHORTEST)
        off += CAUTION * (estimate[0] / ca.fmin(gone * gone, 1.0))
    return error + ca.if_else(known, 0.0, off)


SHORTEST = 2.0**-100
"""The least angle whose square is divided by."""


def _known_power(remainder: Remainder, motion: MotionBounds, infinite: bool) -> tuple[ca.SX, ca.SX]:
    """Returns whether a remainder is known of a step, and z^n.

    infinite : whether that is infinite where the remainder is not known, else 0
    """
    known = motion.share <= remainder.limit
    power = _power(ca.fmin(motion.share, remainder.limit), remainder.power)
    return known, ca.if_else(known, power, ca.inf if infinite else 0.0)


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
    u, h, reach, depth = 0.5 * EPSILON, motion.step, motion.reach, DEPTH
    force = ca.norm_2(body.torque)
    if constants.law.gyroscopic_term:
        force += reach * (constants.heaviest * reach + ca.norm_2(body.spin))
    if motion.centre is not None:
        force += motion.centre.strongest * constants.heaviest
        depth = ORBIT_DEPTH
    rate = u * (4.0 * reach + (depth * h) * (constants.lightness * force))
    return rate, u * (8.0 + (depth * h) * reach) + 0.5 * h * rate
