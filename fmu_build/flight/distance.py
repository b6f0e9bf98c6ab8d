"""How far two motions are apart."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

HALF_ULP = 2.0**-53
"""What a number near 1 is known to: no distance of attitudes tells of less."""


def attitude_apart(one: Array, other: Array) -> Array:
    """Returns the angles [rad], (n,), between attitudes, (n, 4) each; q and -q are the same.

    From the vector part of the turn between them: an angle of 1e-16 shows.
    """
    w, v = one[:, 0], one[:, 1:]
    a, b = other[:, 0], other[:, 1:]
    vector = w[:, None] * b - a[:, None] * v - np.cross(v, b)
    scalar = np.abs(w * a + np.sum(v * b, axis=1))
    return np.asarray(2.0 * np.arctan2(np.linalg.norm(vector, axis=1), scalar))
