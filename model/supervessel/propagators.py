"""One step of rotation in CasADi symbols, and how long a step may be."""

from collections.abc import Callable
from math import exp

import casadi as ca

from supervessel.attitude import unit


def rk4_step(ode: Callable[[ca.SX], ca.SX], state: ca.SX, step: ca.SX) -> ca.SX:
    """Returns the state (attitude, angular velocity), (7,), one step later, the attitude at unit length.

    ode   : state -> its rate
    step  : [s]
    Source: [HNW] section II.1, table 1.2: the classical method of order 4, for attitude and
    rate jointly.
    """
    half = 0.5 * step
    k1 = ode(state)
    k2 = ode(state + half * k1)
    k3 = ode(state + half * k2)
    k4 = ode(state + step * k3)
    end = state + step / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
    return ca.vertcat(unit(end[:4]), end[4:])


def fastest_square(angular_velocity: ca.SX, torque_acceleration: ca.SX, growth: float, angle: float) -> ca.SX:
    """Returns the square, [rad2/s2], of a rate that the body does not exceed while it turns by `angle`.

    angular_velocity    : (3,) [rad/s], now
    torque_acceleration : (3,) [rad/s2], what the torque alone gives, constant in body axes
    growth              : bound g of d|omega|/dt over |omega|^2 by the gyroscopic term
    angle               : [rad]

    With w = |omega| and a = |torque_acceleration|, dw/dt <= g w^2 + a. Over the angle s turned, ds = w dt,
    this reads d(w^2)/ds <= 2 g w^2 + 2 a, so that w^2 <= w_0^2 e + 2 a f at the end of the angle, with
    e = exp(2 g s), f = (e - 1)/(2 g), or s where g = 0. A step of angle/w at that rate cannot turn further.
    """
    e = exp(2.0 * growth * angle)
    f = (e - 1.0) / (2.0 * growth) if growth else angle
    return e * ca.sumsqr(angular_velocity) + 2.0 * f * ca.sqrt(ca.sumsqr(torque_acceleration))
