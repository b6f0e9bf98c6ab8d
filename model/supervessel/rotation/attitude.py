"""Attitude quaternions in CasADi symbols: unit, scalar first, Hamilton product, body to inertial axes.

q = (w, v) = (w, x, y, z) takes body components of a vector to inertial ones: (0, v_inertial) =
q (0, v_body) q*, with q* = (w, -v). Source of all that follows from this: [EQ] Conventions, eq. (1).
"""

import casadi as ca


def attitude_dot(attitude: ca.SX, angular_velocity: ca.SX) -> ca.SX:
    """Returns the rate of the attitude, q' = q (0, omega)/2, (4,) [1/s].

    attitude         : q_inertial_body, (4,), of any length
    angular_velocity : omega, of the body relative to inertial axes, (3,) [rad/s], body axes
    Source: [EQ] Conventions, eq. (2).
    """
    w, x, y, z = ca.vertsplit(attitude)
    p, q, r = ca.vertsplit(0.5 * angular_velocity)
    return ca.vertcat(
        -(x * p + y * q + z * r),
        w * p + y * r - z * q,
        w * q + z * p - x * r,
        w * r + x * q - y * p,
    )


def unit(vector: ca.SX) -> ca.SX:
    """Returns a quaternion, (4,), or a vector, (3,), at length 1.

    The square of its length must be an ordinary double.
    """
    return vector / ca.sqrt(ca.sumsqr(vector))


def to_inertial(attitude: ca.SX, vector_body: ca.SX) -> ca.SX:
    """Returns a vector, (3,), in inertial axes, in its own unit.

    attitude    : q_inertial_body, (4,), of unit length
    vector_body : u, (3,), body axes
    u + 2 w v x u + 2 v x (v x u) is the vector part of q (0, u) q*.
    """
    w, axis = attitude[0], attitude[1:]
    twice = 2.0 * ca.cross(axis, vector_body)
    return vector_body + w * twice + ca.cross(axis, twice)


def to_body(attitude: ca.SX, vector_inertial: ca.SX) -> ca.SX:
    """Returns a vector, (3,), in body axes, in its own unit: the inverse of `to_inertial`.

    attitude        : q_inertial_body, (4,); of another length than 1 it changes the vector's length
    vector_inertial : (3,), inertial axes
    (w^2 - |v|^2) u + 2 (v . u) v - 2 w v x u is |q|^2 times the vector, whatever the length of q = (w, v).
    """
    w, axis = attitude[0], attitude[1:]
    along, across = ca.dot(axis, vector_inertial), ca.cross(axis, vector_inertial)
    same = (w * w - ca.sumsqr(axis)) * vector_inertial
    return same + 2.0 * (along * axis - w * across)


def product(first: ca.SX, second: ca.SX) -> ca.SX:
    """Returns the Hamilton product of two quaternions, (4,): q_A_C of q_A_B and q_B_C.

    (w1, v1)(w2, v2) = (w1 w2 - v1 . v2, w1 v2 + w2 v1 + v1 x v2).
    """
    p, q = first[1:], second[1:]
    w = first[0] * second[0] - ca.dot(p, q)
    return ca.vertcat(w, first[0] * q + second[0] * p + ca.cross(p, q))


def rotation_matrix(attitude: ca.SX) -> ca.SX:
    """Returns R_inertial_body, (3, 3), the matrix of `to_inertial`.

    attitude : q_inertial_body, (4,), of any length whose square is an ordinary double
    (w^2 - |v|^2) E + 2 v v^T + 2 w [v x], over w^2 + |v|^2.
    """
    w, x, y, z = ca.vertsplit(attitude)
    X, Y, Z = 2.0 * x, 2.0 * y, 2.0 * z
    ww, xx, yy, zz = w * w, x * x, y * y, z * z
    per = 1.0 / ((ww + xx) + (yy + zz))
    return per * ca.vertcat(
        ca.horzcat((ww + xx) - (yy + zz), x * Y - w * Z, x * Z + w * Y),
        ca.horzcat(x * Y + w * Z, (ww + yy) - (xx + zz), y * Z - w * X),
        ca.horzcat(x * Z - w * Y, y * Z + w * X, (ww + zz) - (xx + yy)),
    )


def quaternion(R_outer_inner: ca.SX) -> ca.SX:
    """Returns q_outer_inner, (4,), of unit length and scalar part >= 0: the inverse of `rotation_matrix`.

    R_outer_inner : (3, 3), a rotation
    The elements of R give 4 w q, 4 x q, 4 y q and 4 z q. The one with the largest factor is brought to unit
    length, so nothing small divides. The result jumps to its negative where R turns by 180 degrees.
    """
    R = R_outer_inner
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
