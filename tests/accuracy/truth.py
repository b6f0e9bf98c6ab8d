"""The exact motion of many flights at once: the reference in numpy, integrated by SciPy's DOP853."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]

RTOL, ATOL = 1e-13, 1e-15


def after_a_step(  # noqa: PLR0917
    states: Array, span: float, J: Array, M: Array, rtol: float = RTOL, turning: float = 1.0
) -> Array:
    """Returns attitudes and rates, (n, 7), after a span [s] of constant inputs; attitudes of unit length.

    states : (n, 7), attitude and rate [rad/s] of n bodies
    J, M   : (n, 3, 3) [kg m2], (n, 3) [N m]
    rtol   : of DOP853; attitudes and rates, these in units of their own, are integrated together
    turning : share of the gyroscopic torque that counts, 1 or 0
    """
    inverse = np.linalg.inv(J)
    unit = np.maximum(np.linalg.norm(states[:, 4:], axis=1) * span, 1e-3)[:, None] / span

    def rate(_: float, flat: Array) -> Array:
        y = flat.reshape(-1, 7)
        found = state_rate(np.hstack([y[:, :4], y[:, 4:] * unit]), turning * J, inverse, M)
        found[:, 4:] /= unit
        return found.ravel()

    scaled = np.hstack([states[:, :4], states[:, 4:] / unit]).ravel()
    found = solve_ivp(rate, (0.0, span), scaled, "DOP853", rtol=rtol, atol=ATOL * rtol / RTOL)
    assert found.success, found.message
    end = found.y[:, -1].reshape(-1, 7)
    return np.hstack([end[:, :4] / np.linalg.norm(end[:, :4], axis=1)[:, None], end[:, 4:] * unit])


def state_rate(states: Array, J: Array, inverse: Array, M: Array) -> Array:
    """Returns the rates of attitudes and angular velocities, (n, 7), of n bodies: Euler's equations.

    J, inverse : (n, 3, 3), tensors [kg m2] of the gyroscopic torque, and the inverses that what acts meets
    M          : (n, 3) [N m]
    """
    w, v, omega = states[:, :1], states[:, 1:4], states[:, 4:]
    push = M - _cross(omega, np.einsum("nij,nj->ni", J, omega))
    turn = 0.5 * (w * omega + _cross(v, omega))
    scalar = -0.5 * np.sum(v * omega, axis=1, keepdims=True)
    return np.hstack([scalar, turn, np.einsum("nij,nj->ni", inverse, push)])


def _cross(a: Array, b: Array) -> Array:
    """Returns a x b, (n, 3); numpy's own takes several times as long."""
    return np.stack(
        [
            a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1],
            a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2],
            a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0],
        ],
        axis=1,
    )


def turned(states: Sequence[Array] | Array, span: float) -> Array:
    """Returns the angles [rad] by which bodies turn in all, (n,); of states after steps, (steps, n, 7)."""
    return np.asarray(np.linalg.norm(np.asarray(states)[..., 4:], axis=2).sum(axis=0) * span)
