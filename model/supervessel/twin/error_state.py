"""The error of a state about a reference, six numbers, and its inverse, in CasADi symbols.

The error is that of the body's attitude seen from the reference, q_e = q_ref* q, in body axes, then the
difference of the rates. q and -q give the same error: the sign of q_e is taken so that its scalar part is not
negative. Three forms, all equal to the angle [rad] about each axis to first order:

vec    : 2 vec(q_e), a polynomial; from 0 to 2 in length, flat at a half turn
rotvec : the rotation vector, angle times axis; from 0 to pi
mrp    : 4 vec(q_e) / (1 + scalar part), modified Rodrigues parameters; from 0 to 4
"""

from typing import Literal

import casadi as ca

from supervessel.rotation.attitude import attitude_dot, product

ErrorForm = Literal["vec", "rotvec", "mrp"]

ARCTANGENT_TERMS = 14
"""Of the series of arctan(y)/y in y^2 for y <= tan(pi/16): the first term left out is 7e-22, and 2e-17 in the
second derivative."""

SERIES_LIMIT = 0.25
"""Square of half an angle [rad2] below which cosine and sine are series: beyond it, sin(a)/a loses
2/0.25^2 = 32 u in its second derivative."""

SERIES_TERMS = 10
"""Of the series of cos(a) and sin(a)/a in a^2 up to SERIES_LIMIT: the first term left out is 4e-25."""


def state_error(state: ca.SX, reference: ca.SX, form: ErrorForm) -> ca.SX:
    """Returns attitude error and difference of rates, (6,) [rad, rad/s], body axes.

    state, reference : (7,), attitude of unit length and angular velocity [rad/s]
    """
    turned = product(_conjugate(reference[:4]), state[:4])
    turned = turned * ca.if_else(turned[0] < 0.0, -1.0, 1.0)
    return ca.vertcat(attitude_error(turned, form), state[4:] - reference[4:])


def attitude_error(turned: ca.SX, form: ErrorForm) -> ca.SX:
    """Returns the error, (3,) [rad], of a quaternion, (4,), of unit length and scalar part not negative."""
    w, v = turned[0], turned[1:]
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
    """Returns the state, (7,), that has an error, (6,), about a reference, (7,): `state_error` inverted.

    The attitude is as long as the reference's; NaN for "vec" where the attitude's error is longer than 2.
    """
    turned = turn(error[:3], form)
    return ca.vertcat(product(reference[:4], turned), reference[4:] + error[3:])


def turn(error: ca.SX, form: ErrorForm) -> ca.SX:
    """Returns the unit quaternion, (4,), of an attitude error, (3,) [rad]."""
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
    """Returns cos(a) and sin(a)/a of the square of an angle, smooth at zero."""
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
    """Returns the rate of an error, (6,) [rad/s, rad/s2], as the body and its reference move.

    rate_reference : (3,) [rad/s]; the body's rate is that and the error's second half
    accelerations  : (3,) [rad/s2], of the body and of the reference, each in its own axes
    With q_e' = (q_e omega - omega_ref q_e)/2.
    """
    q = ca.SX.sym("q", 4)
    q_dot = ca.SX.sym("q_dot", 4)
    by_turn = ca.Function("by_turn", [q, q_dot], [ca.jtimes(attitude_error(q, form), q, q_dot)])
    turned = turn(error[:3], form)
    backwards = product(ca.vertcat(0.0, 0.5 * rate_reference), turned)
    turned_dot = attitude_dot(turned, rate_reference + error[3:]) - backwards
    return ca.vertcat(by_turn(turned, turned_dot), acceleration - acceleration_reference)


def tangent(attitude: ca.SX) -> ca.SX:
    """Returns the change of an attitude, (4, 3), by a small error: d retract / d error at zero."""
    return ca.horzcat(*(attitude_dot(attitude, axis) for axis in ca.horzsplit(ca.SX.eye(3))))


def _conjugate(quaternion: ca.SX) -> ca.SX:
    return ca.vertcat(quaternion[0], -quaternion[1:])
