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


def product(first: ca.SX, second: ca.SX) -> ca.SX:
    """Returns the Hamilton product of two quaternions, (4,)."""
    p, q = first[1:], second[1:]
    w = first[0] * second[0] - ca.dot(p, q)
    return ca.vertcat(w, first[0] * q + second[0] * p + ca.cross(p, q))


def rotation_matrix(attitude: ca.SX) -> ca.SX:
    """Returns R_inertial_body, (3, 3), of a unit quaternion, (4,)."""
    w, x, y, z = ca.vertsplit(attitude)
    X, Y, Z = 2.0 * x, 2.0 * y, 2.0 * z
    ww, xx, yy, zz = w * w, x * x, y * y, z * z
    per = 1.0 / ((ww + xx) + (yy + zz))
    return per * ca.vertcat(
        ca.horzcat((ww + xx) - (yy + zz), x * Y - w * Z, x * Z + w * Y),
        ca.horzcat(x * Y + w * Z, (ww + yy) - (xx + zz), y * Z - w * X),
        ca.horzcat(x * Z - w * Y, y * Z + w * X, (ww + zz) - (xx + yy)),
    )


def quaternion(rotation: ca.SX) -> ca.SX:
    """Returns the unit quaternion, (4,), scalar part >= 0, of a rotation matrix, (3, 3).

    Of the four multiples of the quaternion that the matrix gives the longest is brought to unit length; it
    jumps to its negative where the body has turned by 180 degrees.
    """
    R = rotation
    x, y, z = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    xy, zx, yz = R[1, 0] + R[0, 1], R[0, 2] + R[2, 0], R[2, 1] + R[1, 2]
    best = ca.vertcat(1.0 + R[0, 0] + R[1, 1] + R[2, 2], x, y, z)
    pivot = best[0]
    for candidate, size in (
        (ca.vertcat(x, 1.0 + R[0, 0] - R[1, 1] - R[2, 2], xy, zx), 1),
        (ca.vertcat(y, xy, 1.0 - R[0, 0] + R[1, 1] - R[2, 2], yz), 2),
        (ca.vertcat(z, zx, yz, 1.0 - R[0, 0] - R[1, 1] + R[2, 2]), 3),
    ):
        better = candidate[size] > pivot
        best, pivot = ca.if_else(better, candidate, best), ca.if_else(better, candidate[size], pivot)
    return unit(ca.if_else(best[0] < 0.0, -best, best))
