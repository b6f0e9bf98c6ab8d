"""What tests compute with: arrays, the rounding of doubles, rotations."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NAN, INF = math.nan, math.inf

EPS = 2.0**-52
"""The distance from 1 to the next double."""

U = EPS / 2
"""The largest relative error of a rounding."""

UNIT_TOLERANCE = 4 * EPS
"""A quotient by the root of a sum of four squares is off by at most 2 EPS relative in each component; taking
the norm again rounds by up to EPS more."""

COMPOSITE_TOLERANCE = 64 * EPS
"""Sums of 12 points, those of two vessels, with about 5 roundings each, no term larger than the largest
element compared."""


def relative_error(value: Any, truth: Any) -> float:
    """Returns the largest difference over the largest magnitude of the truth."""
    value, truth = np.asarray(value, dtype=float), np.asarray(truth, dtype=float)
    return float(np.abs(value - truth).max() / np.abs(truth).max())


def random_rotation(seed: int) -> np.ndarray:
    """Returns a rotation matrix, (3, 3), drawn with a seed."""
    q = np.random.default_rng(seed).normal(size=4)
    w, x, y, z = q / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def hamilton(a: Sequence[Any], b: Sequence[Any]) -> list[Any]:
    """Returns the Hamilton product of two quaternions, scalar first, of numbers of any kind."""
    return [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] + a[2] * b[0] + a[3] * b[1] - a[1] * b[3],
        a[0] * b[3] + a[3] * b[0] + a[1] * b[2] - a[2] * b[1],
    ]


def cross(a: Sequence[Any], b: Sequence[Any]) -> list[Any]:
    """Returns a x b of numbers of any kind."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
