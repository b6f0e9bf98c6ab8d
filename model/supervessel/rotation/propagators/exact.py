"""Exact free motion seen from the body axes, as functions for C and for the twin."""

import casadi as ca

from supervessel.rotation.attitude import product, unit
from supervessel.rotation.propagators import free_motion, theta
from supervessel.rotation.propagators.method import Propagator

STATE_SIZE = 7

SLOWEST = 2.0**-960
"""Rate [rad/s] below which rates are no longer brought to about 1."""


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
    fastest = ca.fmax(ca.mmax(ca.fabs(omega)), SLOWEST)
    turn, end = free_motion.free_turn(moments / moments[2], omega / fastest, time * fastest, doublings)
    return _in_body(state, R_body_principal, turn, fastest * end)


def _in_body(state: ca.SX, R_body_principal: ca.SX, turn: ca.SX, omega_end: ca.SX) -> ca.SX:
    """Returns the state after a turn given in principal axes, with the angular velocity there."""
    turn_body = ca.vertcat(turn[0], R_body_principal @ turn[1:])
    return ca.vertcat(unit(product(state[:4], turn_body)), R_body_principal @ omega_end)


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
)
