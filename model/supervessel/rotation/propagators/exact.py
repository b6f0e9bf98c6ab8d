"""Exact free motion seen from the body axes, as functions for C and for the twin."""

from collections.abc import Mapping, Sequence
from functools import reduce
from operator import add
from typing import Any

import casadi as ca

from supervessel.rotation.attitude import product, unit
from supervessel.rotation.laws import principal_products
from supervessel.rotation.propagators import free_motion, theta
from supervessel.rotation.propagators.method import NOT_FLOWING, NOT_FREE, Propagator

STATE_SIZE = 7

SHORT = 2.0**-5
"""Angle [rad] up to which `free_step` is a series of order SHORT_ORDER.

The closed form's turn is known to some u; over the angle, so are its derivatives by the rates. Where the
largest factor of Euler's equations, see `principal_products`, is above 1, as no rigid body has it, the angle
is less by that factor.
"""

SHORT_ORDER = 10
"""Highest power of the time in that series.

Its terms fall at least as those of 1/(1 - SHORT), so that what is left out of derivatives is below
12 SHORT^11 = 2^-51 of them.
"""


def free_functions(size: int, where: slice) -> list[ca.Function]:
    """Returns free motion in four functions, between whose second and last C loops over the third.

    size  : length of a
    where : of the part of a that the body turns by: moments (3,), R_body_principal column by column (9,)

    free_phase  : x, a, t -> the angle [rad] that says how many doublings are needed
    free_start  : x, a, t, share -> v, k, of the time t share, share a power of two
    free_double : v, k -> v, of twice the time
    free_finish : x, a, t, v, k -> x at t
    Rates and moments must be about 1: the caller scales them by powers of two.
    """
    x, a, t, share = (ca.SX.sym(*s) for s in (("x", STATE_SIZE), ("a", size), ("t", 1), ("share", 1)))
    moments, R_body_principal = a[where][:3], ca.reshape(a[where][3:], 3, 3)
    omega = R_body_principal.T @ x[4:]
    begun = free_motion.start(moments, omega, t, share)
    v, k = ca.SX.sym("v", free_motion.VARYING), ca.SX.sym("k", begun.numel() - free_motion.VARYING)
    s = ca.vertcat(v, k)
    end = _in_body(x, R_body_principal, *free_motion.finish(moments, omega, t, s))
    return [
        ca.Function(
            "free_phase", [x, a, t], [free_motion.phase(moments, omega, t)], ["x", "a", "t"], ["angle"]
        ),
        ca.Function(
            "free_start",
            [x, a, t, share],
            [begun[: free_motion.VARYING], begun[free_motion.VARYING :]],
            ["x", "a", "t", "share"],
            ["v", "k"],
        ),
        ca.Function(
            "free_double", [v, k], [free_motion.double(s)[: free_motion.VARYING]], ["v", "k"], ["v_next"]
        ),
        ca.Function("free_finish", [x, a, t, v, k], [end], ["x", "a", "t", "v", "k"], ["x_next"]),
    ]


def free_functions_of_start(size: int, where: slice) -> list[ca.Function]:
    """Returns free motion to many times from one start, in two functions; arguments as of `free_functions`.

    free_constants : x, a, scale -> k, not all finite where `theta` does not serve; x holds rates over scale
    free_at        : k, t -> x at t
    """
    x, a, scale, t = (ca.SX.sym(*s) for s in (("x", STATE_SIZE), ("a", size), ("scale", 1), ("t", 1)))
    k = ca.SX.sym("k", theta.CONSTANTS)
    moments, R_body_principal = a[where][:3], ca.reshape(a[where][3:], 3, 3)
    found = theta.constants(x, moments, R_body_principal, scale)
    return [
        ca.Function("free_constants", [x, a, scale], [found], ["x", "a", "scale"], ["k"]),
        ca.Function("free_at", [k, t], [theta.at(k, t)], ["k", "t"], ["x"]),
    ]


def free_step(state: ca.SX, moments: ca.SX, R_body_principal: ca.SX, time: ca.SX, doublings: int) -> ca.SX:
    """Returns the state (attitude, angular velocity), (7,), after free motion.

    moments          : principal, (3,), ascending; any unit
    R_body_principal : (3, 3), its columns are the principal axes
    time             : [s]
    doublings        : largest number of doublings; the state is NaN where more are needed, or the body turns
                       by more than LARGEST_TURN
    """
    omega = R_body_principal.T @ state[4:]
    factor = ca.fmax(1.0, ca.mmax(ca.fabs(principal_products(moments))))
    is_short = ca.sumsqr(omega * (factor * time)) <= SHORT**2
    short = short_step(state, moments, R_body_principal, ca.if_else(is_short, time, 0.0))
    fastest = ca.if_else(is_short, 1.0, ca.mmax(ca.fabs(omega)))
    moving, span = ca.if_else(is_short, ca.SX([0.5, 0.75, 0.625]), omega / fastest), time * fastest
    closed = free_motion.free_turn(moments / moments[2], moving, ca.if_else(is_short, 0.0, span), doublings)
    turn, end = closed
    return ca.if_else(is_short, short, _in_body(state, R_body_principal, turn, fastest * end))


def short_step(state: ca.SX, moments: ca.SX, R_body_principal: ca.SX, time: ca.SX) -> ca.SX:
    """Returns what `free_step` does, and its derivatives, where the body turns by SHORT at the most.

    Taylor series of the rates and of the turn p in s = (time since the start)/time, as in `taylor`, with half
    angles y = omega time/2 beside omega, since products of rates alone might underflow. In principal axes,
    with (i, j, l) cyclic, a the factors of Euler's equations and sums over m from 0 to k,
    (k + 1) omega_i,k+1 = 2 a_i sum y_j,m omega_l,k-m and (k + 1) p_k+1 = sum p_m (0, y_k-m).
    The rate and the half angle themselves stay in body axes: no derivative by them or by the axes comes out
    of a difference.
    """
    factors, rate = principal_products(moments), R_body_principal.T @ state[4:]
    half = 0.5 * time
    rates, angles = [rate], [half * rate]
    turns = [ca.vertcat(0.0, angles[0])]
    for k in range(SHORT_ORDER):
        scale = 2.0 / (k + 1)
        pairs = zip(angles, reversed(rates), strict=True)
        rates.append((scale * factors) * _total([_products(y, w) for y, w in pairs]))
        turned = [_turned(turn, y) for turn, y in zip(turns, reversed(angles), strict=True)]
        angles.append(half * rates[-1])
        turns.append((1.0 / (k + 2)) * _total([ca.vertcat(0.0, angles[-1]), *turned]))
    bent = _total(turns[:0:-1])
    turn = ca.vertcat(bent[0], half * state[4:] + R_body_principal @ bent[1:])
    attitude = state[:4] + product(state[:4], turn)
    return ca.vertcat(unit(attitude), state[4:] + R_body_principal @ _total(rates[:0:-1]))


def _products(y: ca.SX, w: ca.SX) -> ca.SX:
    """Returns y_j w_k, (3,), (i, j, k) cyclic."""
    return ca.vertcat(y[1] * w[2], y[2] * w[0], y[0] * w[1])


def _turned(turn: ca.SX, vector: ca.SX) -> ca.SX:
    """Returns the product of a quaternion and (0, vector), (4,)."""
    return ca.vertcat(-ca.dot(turn[1:], vector), turn[0] * vector + ca.cross(turn[1:], vector))


def _total(terms: Sequence[ca.SX]) -> ca.SX:
    """Returns the sum, the first terms first."""
    return reduce(add, terms)


def _in_body(state: ca.SX, R_body_principal: ca.SX, turn: ca.SX, omega_end: ca.SX) -> ca.SX:
    """Returns the state after a turn given in principal axes, with the angular velocity there."""
    turn_body = ca.vertcat(turn[0], R_body_principal @ turn[1:])
    return ca.vertcat(unit(product(state[:4], turn_body)), R_body_principal @ omega_end)


def _suits(law: str, inputs: Mapping[str, Any]) -> str:
    """Returns why free motion alone makes no sense: under a torque that follows from the rate."""
    return NOT_FLOWING if inputs.get("flow") else ""


PROPAGATOR = Propagator(
    None,
    "error",
    "always",
    "Free motion in one step of any length, from the last instant at which torque or inertia changed in "
    "value, by addition theorems of Jacobi's elliptic functions, or by theta functions where a second step "
    "goes on from there ([VS], [F]). Knows no torque.",
    c_files=("free_step", "free_motion"),
    marker="P",
    setting="",
    suits=_suits,
    wheels=NOT_FREE + "the momentum that they hold turns the body otherwise than free motion",
)
