"""How far a body may turn in a step, bounded without taking it."""

from math import exp

import casadi as ca


def fastest_square(
    angular_velocity: ca.SX,
    by_torque: ca.SX,
    growth: float,
    angle: float,
    spin_square: ca.SX | None = None,
) -> ca.SX:
    """Returns the square, [rad2/s2], of a rate that the body does not exceed while it turns by `angle`.

    angular_velocity : (3,) [rad/s], now
    by_torque        : length a of the acceleration [rad/s2] by the torque alone, constant in body axes
    growth           : bound g of d|omega|/dt over |omega|^2 by the gyroscopic term
    angle            : [rad]
    spin_square      : square of a bound b, [rad2/s2], of what the spin of moving parts, and jet damping, add
                       to the acceleration, over |omega|; None: there are none

    With w = |omega|, dw/dt <= g w^2 + a. Over the angle s turned, ds = w dt, this reads
    d(w^2)/ds <= 2 g w^2 + 2 a, so that w^2 <= w_0^2 e + 2 a f at the end of the angle, with e = exp(2 g s),
    f = (e - 1)/(2 g), or s where g = 0. A step of angle/w at that rate cannot turn further.
    """
    if spin_square is not None:
        e = exp((2.0 * growth + 1.0) * angle)
        f = (e - 1.0) / (2.0 * growth + 1.0)
        return e * ca.sumsqr(angular_velocity) + f * (2.0 * by_torque + spin_square) + spin_square
    e = exp(2.0 * growth * angle)
    f = (e - 1.0) / (2.0 * growth) if growth else angle
    return e * ca.sumsqr(angular_velocity) + 2.0 * f * by_torque


def stretched(excess: ca.SX, angle: float) -> ca.SX:
    """Returns by what `fastest_square` is to be multiplied where g is larger than `growth`.

    excess : by how much, at least 0
    angle  : s, [rad]
    With a spin, d(w^2)/ds <= (2 g + 1) w^2 + b^2 + 2 a; without one, 2 g takes the place of 2 g + 1, and b is
    0. With an excess d let the bound be the rate at the end
    of the angle s/m alone, m = 1 + 2 d s, and m times that: so the step stays as short. Since 2 d s/m is at
    most log m, and at most 1, e is then at most m times, and at most exp(1) times, what it is at s without
    the excess, and f is no larger.
    """
    m = 1.0 + 2.0 * angle * excess
    return m * m * ca.fmin(m, exp(1.0))


def longest_step(rate_square: ca.SX, angle: float) -> ca.SX:
    """Returns angle over a rate [s], given by its square: infinite, with derivatives 0, where it is 0."""
    moves = rate_square > 0.0
    return ca.if_else(moves, angle / ca.sqrt(ca.if_else(moves, rate_square, 1.0)), ca.inf)
