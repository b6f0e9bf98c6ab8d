"""Attitudes: the rotation matrix of a quaternion, the quaternion of a matrix, the rate of a quaternion."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def rotation_matrix(attitude: ArrayLike) -> Array:
    """Returns R_inertial_body, (3, 3), of the unit quaternion `attitude`, (4,), scalar first.

    Example:
        >>> (reference.rotation_matrix([0, 0, 0, 1]) @ [1, 2, 3]).tolist()
        [-1.0, -2.0, 3.0]
    """
    w, x, y, z = np.asarray(attitude, dtype=float)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    rotation: Array = np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross
    return rotation


def attitude_dot(attitude: ArrayLike, angular_velocity: ArrayLike) -> Array:
    """Returns the rate of the attitude quaternion, (4,) [1/s]: half the product q * (0, omega).

    attitude         : (4,), unit, scalar first, body to inertial
    angular_velocity : (3,) [rad/s], body axes

    Example:
        >>> reference.attitude_dot([1, 0, 0, 0], [0.2, 0, 0]).tolist()
        [0.0, 0.1, 0.0, 0.0]
    """
    q, omega = np.asarray(attitude, dtype=float), np.asarray(angular_velocity, dtype=float)
    return 0.5 * np.concatenate([[-q[1:] @ omega], q[0] * omega + np.cross(q[1:], omega)])


def quaternion(rotation: ArrayLike) -> Array:
    """Returns the unit quaternion, (4,), scalar first and not negative, of a rotation matrix, (3, 3).

    The inverse of `rotation_matrix`: w, x, y, z times each other are linear in the matrix's elements, and the
    quaternion is the axis that the matrix of these products has.

    Example:
        >>> quarter_turn = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]  # about the third axis
        >>> reference.quaternion(quarter_turn)[[0, 3]].round(6).tolist()
        [0.707107, 0.707107]
    """
    R = np.asarray(rotation, dtype=float)
    twist = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    products = np.empty((4, 4))
    products[0, 0], products[0, 1:], products[1:, 0] = np.trace(R), twist, twist
    products[1:, 1:] = R + R.T - np.trace(R) * np.eye(3)
    axis: Array = np.linalg.eigh(products)[1][:, 3]
    return axis if axis[0] >= 0.0 else -axis
