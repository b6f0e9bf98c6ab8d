"""Vectors that are stacked from parts: the place of each part, and how a vector is cut into parts again."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import casadi as ca
import numpy as np


def slices_of(sizes: Mapping[str, int]) -> dict[str, slice]:
    """Returns by name the place of each part in a vector of parts of these sizes, one after the other."""
    slices, end = {}, 0
    for name, size in sizes.items():
        slices[name] = slice(end, end := end + size)
    return slices


def stacked(parts: Mapping[str, ca.SX]) -> tuple[dict[str, slice], ca.SX]:
    """Returns by name the place of each part in the vector of all parts, and that vector, dense, (n,)."""
    slices = slices_of({name: part.numel() for name, part in parts.items()})
    return slices, ca.densify(ca.vertcat(ca.SX(0, 1), *parts.values()))


def split(vector: ca.SX, like: Sequence[ca.SX]) -> list[ca.SX]:
    """Returns a vector, (n,), cut into parts with the numbers of elements that those of `like` have."""
    ends = np.cumsum([0] + [part.numel() for part in like])
    return [vector[int(start) : int(end)] for start, end in pairwise(ends)]
