"""How fast small errors grow along histories of inputs: a cheap way to look for attacks, never a truth."""

from math import ceil

import numpy as np
from numpy.typing import NDArray

from accuracy.truth import state_rate
from supervessel import Scene

Array = NDArray[np.float64]

SMALL = 1e-9
"""Error of attitude and rate that each communication step adds, as a method does."""

ANGLE, MOST_SUB_STEPS = 0.4, 16
"""Angle [rad] of a sub-step of rk4, and how many a communication step has at most."""


def grown(scene: Scene, shapes: Array, torques: Array, seed: int = 0) -> Array:
    """Returns the largest error of the attitude over that of a step, (n,), for errors at random at each step.

    shapes  : (n, steps, 3, 3) [kg m2], tensors
    torques : (n, steps, 3) [N m]
    Motion and disturbed motion are followed together by rk4. Where the scene keeps the momentum anywhere all
    changes of the tensor keep it. A motion that is spun up beyond all bounds grows nothing: 0.
    """
    accuracy, draw = scene.accuracy, np.random.default_rng(seed)
    assert accuracy is not None
    n, momentum = len(shapes), "momentum" in scene.keeps.values()
    start = np.append(scene.rotation.attitude, scene.rotation.angular_velocity)
    states, most = np.tile(start, (2 * n, 1)), np.zeros(n)
    shapes, torques = (np.concatenate([part, part]) for part in (shapes, torques))
    inverses = np.linalg.inv(shapes)
    with np.errstate(all="ignore"):
        for step in range(shapes.shape[1]):
            if momentum and step:
                turning = shapes[:, step - 1] @ states[:, 4:, None]
                states[:, 4:] = (inverses[:, step] @ turning)[..., 0]
            still = shapes[:, step], inverses[:, step], torques[:, step]
            states = _after(states, accuracy.step, still)
            states[n:] += SMALL * draw.normal(size=(n, 7)) * _sizes(states[n:])
            apart = np.linalg.norm(states[n:, :4] - states[:n, :4], axis=1)
            most = np.maximum(most, 2.0 * apart / SMALL)
    return np.where(np.isfinite(most), most, 0.0)


def _sizes(states: Array) -> Array:
    """Returns what errors are relative to, (n, 7): half of one in the attitude, the rate's length."""
    rate = np.linalg.norm(states[:, 4:], axis=1)
    return np.hstack([np.full((len(states), 4), 0.5), np.repeat(rate[:, None], 3, axis=1)])


def _after(states: Array, span: float, still: tuple[Array, Array, Array]) -> Array:
    """Returns states after a step [s] of rk4's sub-steps; attitudes of unit length."""
    fastest = np.linalg.norm(states[:, 4:], axis=1).max()
    angle = float(fastest) * span / ANGLE if np.isfinite(fastest) else 1.0
    count = min(max(2, ceil(angle)), MOST_SUB_STEPS)
    h = span / count
    for _ in range(count):
        one = state_rate(states, *still)
        two = state_rate(states + 0.5 * h * one, *still)
        three = state_rate(states + 0.5 * h * two, *still)
        four = state_rate(states + h * three, *still)
        states = states + h / 6.0 * (one + 2.0 * two + 2.0 * three + four)
    states[:, :4] /= np.linalg.norm(states[:, :4], axis=1)[:, None]
    return states
