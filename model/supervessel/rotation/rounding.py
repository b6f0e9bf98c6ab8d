"""What rounding of the composite's tensor comes to in a body's motion."""

import casadi as ca

from supervessel.composite.inertia import ldl, ldl_inverse

LEFT = 2.0**-55
"""Of the trace, by which the elements of a composite tensor are off.

A quarter of u: some u of the largest element at worst; this is four times what was found for slender vessels
docked askew (tests/fmu/test_error_control.py).
"""


def turned_by_rounding(inertia: ca.SX, omega: ca.SX, by_torque: ca.SX, step: ca.SX) -> ca.SX:
    """Returns the angle [rad] by which a step is off since the tensor is rounded.

    inertia   : (3, 3) [kg m2], the tensor that the law turns
    omega     : (3,) [rad/s], at the start
    by_torque : (3,) [rad/s2], acceleration by the torque alone
    step      : [s]
    J omega' = M - omega x J omega differentiated: |d omega'| <= |J^-1| |dJ| (|omega'| + |omega|^2). With
    |dJ| <= LEFT tr J and |J^-1| <= tr J^-1 the turn is off by half the square of the step times that; while
    the body turns over and over, by no more than the same share of the angle.
    """
    share = LEFT * ca.trace(inertia) * ca.trace(ldl_inverse(*ldl(inertia)))
    angle = step * ca.sqrt(ca.sumsqr(omega))
    pushed = 0.5 * step * step * ca.sqrt(ca.sumsqr(by_torque))
    return share * (angle * ca.fmin(1.0, 0.5 * angle) + pushed)
