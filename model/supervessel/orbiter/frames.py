"""From Orbiter's left-handed axes (x right, y up, z forward) to right-handed ones, by reversing z.

With P = diag(1, 1, -1) every vector, angular velocity among them, is P v, and a rotation matrix P R P:
Orbiter writes its cross products in reversed order, and P (a x b) = -(P a) x (P b).
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Triple = tuple[float, float, float]

MIRROR = np.diag([1.0, 1.0, -1.0])


def mirrored(vector: Sequence[float]) -> Triple:
    """Returns P v."""
    x, y, z = vector
    return x, y, 0.0 - z


def rotation(arot: Sequence[float]) -> Array:
    """Returns R_inertial_vessel, (3, 3), right-handed, of the angles of AROT, (3,) [degrees].

    AROT is X Y Z, vessel to global, with X = [[1, 0, 0], [0, c, s], [0, -s, c]] of the first angle,
    Y = [[c, 0, -s], [0, 1, 0], [s, 0, c]] of the second, Z = [[c, s, 0], [-s, c, 0], [0, 0, 1]] of the third.
    """
    (cx, cy, cz), (sx, sy, sz) = np.cos(np.radians(arot)), np.sin(np.radians(arot))
    X = np.array([[1.0, 0.0, 0.0], [0.0, cx, sx], [0.0, -sx, cx]])
    Y = np.array([[cy, 0.0, -sy], [0.0, 1.0, 0.0], [sy, 0.0, cy]])
    Z = np.array([[cz, sz, 0.0], [-sz, cz, 0.0], [0.0, 0.0, 1.0]])
    turned: Array = MIRROR @ (X @ Y @ Z) @ MIRROR
    return turned


def quaternion(R_outer_inner: Array) -> tuple[float, float, float, float]:
    """Returns the unit quaternion q_outer_inner = (w, x, y, z), w >= 0, of R_outer_inner, (3, 3).

    The columns of q q^T times 4, all of which the matrix gives, are multiples of q; the longest is taken.
    """
    (a, b, c), (d, e, f), (g, h, i) = R_outer_inner
    products = np.array(
        [
            [1.0 + a + e + i, h - f, c - g, d - b],
            [h - f, 1.0 + a - e - i, b + d, c + g],
            [c - g, b + d, 1.0 - a + e - i, f + h],
            [d - b, c + g, f + h, 1.0 - a - e + i],
        ]
    )
    q = products[np.argmax(np.diag(products))]
    q = q / np.linalg.norm(q) * (-1.0 if q[0] < 0.0 else 1.0)
    w, x, y, z = (float(element) + 0.0 for element in q)
    return w, x, y, z


def turn_angle(R_outer_inner: Array) -> float:
    """Returns the angle [rad], from 0 to pi, between two frames, of R_outer_inner, (3, 3)."""
    w, x, y, z = quaternion(R_outer_inner)
    return 2.0 * float(np.arctan2(np.linalg.norm([x, y, z]), w))
