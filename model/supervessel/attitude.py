"""Attitude quaternions in CasADi symbols: unit, scalar first, Hamilton product, body to inertial axes."""

import casadi as ca


def attitude_dot(attitude: ca.SX, angular_velocity: ca.SX) -> ca.SX:
    """Returns the rate of the attitude, (4,) [1/s]: half the product q * (0, omega).

    attitude         : (4,), q_inertial_body
    angular_velocity : (3,) [rad/s], body axes
    """
    w, x, y, z = ca.vertsplit(attitude)
    p, q, r = ca.vertsplit(0.5 * angular_velocity)
    return ca.vertcat(
        -(x * p + y * q + z * r),
        w * p + y * r - z * q,
        w * q + z * p - x * r,
        w * r + x * q - y * p,
    )


def unit(quaternion: ca.SX) -> ca.SX:
    """Returns the quaternion, (4,), at length 1; its length must be far from under- and overflow."""
    return quaternion / ca.sqrt(ca.sumsqr(quaternion))


def to_inertial(attitude: ca.SX, vector_body: ca.SX) -> ca.SX:
    """Returns a vector's components, (3,), in inertial axes.

    attitude    : (4,), unit, q_inertial_body
    vector_body : (3,), body axes
    """
    w, axis = attitude[0], attitude[1:]
    twice = 2.0 * ca.cross(axis, vector_body)
    return vector_body + w * twice + ca.cross(axis, twice)
