"""The error of a state about a reference, six numbers, and its inverse, in CasADi symbols.

A state is (7 + n,): q_inertial_body, of unit length, omega [rad/s], body axes, and the momenta h of n wheels
[N m s]. The reference has body axes of its own. The error is (6 + n,): of the attitude, from q_reference_body
= q_ref* q = (w, v), then the differences omega - omega_ref of the components [rad/s] and h - h_ref. q and -q
give the same error: the sign of q_reference_body is chosen so that w is not negative. For a turn by the angle
alpha about a unit vector n, w = cos(alpha/2) and v = n sin(alpha/2), the three forms of the attitude's error,
(3,), all equal alpha n [rad] to first order:

vec    : 2 v, a polynomial; from 0 to 2 in length, flat at a half turn
rotvec : alpha n, the rotation vector; from 0 to pi in length
mrp    : 4 v/(1 + w) = 4 n tan(alpha/4), four times the modified Rodrigues parameters; from 0 to 4 in length
"""

from typing import Literal

import casadi as ca

from supervessel.rotation.attitude import attitude_dot, product

ErrorForm = Literal["vec", "rotvec", "mrp"]

ARCTANGENT_TERMS = 14
"""Terms of the series of arctan(y)/y in y^2, for y <= tan(pi/16): the first term left out is 7e-22, and 2e-17
in the second derivative."""

SERIES_LIMIT = 0.25
"""Square of half an angle [rad2] below which cosine and sine are series: beyond it, sin(a)/a loses
2/0.25^2 = 32 u in its second derivative."""

SERIES_TERMS = 10
"""Terms of the series of cos(a) and sin(a)/a in a^2, up to SERIES_LIMIT: the first term left out is 4e-25."""


def state_error(state: ca.SX, reference: ca.SX, form: ErrorForm) -> ca.SX:
    """Returns the error, (6 + n,) [rad, rad/s, N m s], body axes.

    state, reference : (7 + n,), see the module
    """
    q_reference_body = product(_conjugate(reference[:4]), state[:4])
    q_reference_body = q_reference_body * ca.if_else(q_reference_body[0] < 0.0, -1.0, 1.0)
    return ca.vertcat(attitude_error(q_reference_body, form), state[4:] - reference[4:])


def attitude_error(q_reference_body: ca.SX, form: ErrorForm) -> ca.SX:
    """Returns the attitude's error, (3,) [rad], body axes.

    q_reference_body : (4,), of unit length, scalar part not negative
    """
    w, v = q_reference_body[0], q_reference_body[1:]
    if form == "vec":
        return 2.0 * v
    tangents = v / (1.0 + w)  # axis times the tangent of a fourth of the angle
    if form == "mrp":
        return 4.0 * tangents
    # Two more halvings leave an angle of at most pi/16: a series, without a branch and smooth at zero.
    for _ in range(2):
        tangents = tangents / (1.0 + ca.sqrt(1.0 + ca.sumsqr(tangents)))
    square = ca.sumsqr(tangents)
    series = ca.SX(0.0)
    for k in reversed(range(ARCTANGENT_TERMS)):
        series = (-1.0) ** k / (2 * k + 1) + square * series
    return 16.0 * series * tangents


def retracted(reference: ca.SX, error: ca.SX, form: ErrorForm) -> ca.SX:
    """Returns the state, (7 + n,), that has an error about a reference: `state_error` inverted.

    reference : (7 + n,); the state's attitude has the length of the reference's
    error     : (6 + n,) [rad, rad/s, N m s]; NaN is returned for "vec" where the attitude's error is longer
                than 2
    """
    q_reference_body = turn(error[:3], form)
    return ca.vertcat(product(reference[:4], q_reference_body), reference[4:] + error[3:])


def turn(error: ca.SX, form: ErrorForm) -> ca.SX:
    """Returns q_reference_body, (4,), of unit length, of an attitude's error, (3,) [rad]."""
    if form == "vec":
        half = 0.5 * error
        return ca.vertcat(ca.sqrt(1.0 - ca.sumsqr(half)), half)
    if form == "mrp":
        quarter = 0.25 * error
        square = ca.sumsqr(quarter)
        return ca.vertcat(1.0 - square, 2.0 * quarter) / (1.0 + square)
    half = 0.5 * error
    cosine, sine_over = _cosine_and_sine_over(ca.sumsqr(half))
    return ca.vertcat(cosine, sine_over * half)


def _cosine_and_sine_over(square: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Returns cos(a) and sin(a)/a, smooth at zero; square : a^2 [rad2]."""
    small = square < SERIES_LIMIT
    within = ca.if_else(small, square, 0.0)
    cosine, sine_over = ca.SX(0.0), ca.SX(0.0)
    for k in reversed(range(SERIES_TERMS)):
        cosine = 1.0 - within / ((2 * k + 1) * (2 * k + 2)) * cosine
        sine_over = 1.0 - within / ((2 * k + 2) * (2 * k + 3)) * sine_over
    angle = ca.sqrt(ca.if_else(small, 1.0, square))
    return (
        ca.if_else(small, cosine, ca.cos(angle)),
        ca.if_else(small, sine_over, ca.sin(angle) / angle),
    )


def error_rate(
    error: ca.SX, rate_reference: ca.SX, acceleration: ca.SX, acceleration_reference: ca.SX, form: ErrorForm
) -> ca.SX:
    """Returns the rate of an error, (6 + n,) [rad/s, rad/s2, N m], as the body and its reference move.

    error                  : (6 + n,) [rad, rad/s, N m s]
    rate_reference         : omega_ref, (3,) [rad/s], axes of the reference; omega = omega_ref + error[3:6]
    acceleration           : omega' [rad/s2], body axes, and h' [N m], (3 + n,)
    acceleration_reference : omega_ref' [rad/s2], axes of the reference, and h_ref' [N m], (3 + n,)
    q_e = q_reference_body = q_ref* q has the rate q_e' = (q_e (0, omega) - (0, omega_ref) q_e)/2, by the rate
    of an attitude, [EQ] Conventions, eq. (2). The rate of the attitude's error is its derivative by q_e times
    q_e'.
    """
    q = ca.SX.sym("q", 4)
    q_dot = ca.SX.sym("q_dot", 4)
    by_turn = ca.Function("by_turn", [q, q_dot], [ca.jtimes(attitude_error(q, form), q, q_dot)])
    q_reference_body = turn(error[:3], form)
    by_reference = product(ca.vertcat(0.0, 0.5 * rate_reference), q_reference_body)
    q_dot_value = attitude_dot(q_reference_body, rate_reference + error[3:6]) - by_reference
    return ca.vertcat(by_turn(q_reference_body, q_dot_value), acceleration - acceleration_reference)


def tangent(attitude: ca.SX) -> ca.SX:
    """Returns the derivative of an attitude by a small error of it, (4, 3) [1/rad]: columns q (0, e_i)/2.

    attitude : q = q_inertial_body, (4,); e_i are the unit vectors of body axes
    It is the derivative of `retracted` at zero error, of every form.
    """
    return ca.horzcat(*(attitude_dot(attitude, axis) for axis in ca.horzsplit(ca.SX.eye(3))))


def _conjugate(quaternion: ca.SX) -> ca.SX:
    """Returns (w, -v) of (w, v), (4,)."""
    return ca.vertcat(quaternion[0], -quaternion[1:])
