"""Lengths of vectors in CasADi symbols, with finite derivatives where a length is zero."""

import casadi as ca


def smooth_length(vector: ca.SX) -> ca.SX:
    """Returns the length of a vector, with derivative 0, the mean of those to either side, where it is 0."""
    return smooth_root(ca.sumsqr(vector))


def smooth_root(square: ca.SX) -> ca.SX:
    """Returns the square root of a number, with derivative 0 where it is 0."""
    some = square > 0.0
    return ca.if_else(some, ca.sqrt(ca.if_else(some, square, 1.0)), 0.0)
