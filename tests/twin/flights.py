"""Flights of random scenes through the FMU, step by step, with the twin of each."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from supervessel import Twin
from support import OK, Array, flying, scene
from twin.scenes import random_inputs, random_scene

SEEDS = range(12)
STEPS = 8  # communication steps of a flight, each with new inputs

# Solving with J multiplies its relative error by the condition number; omega x J omega, its difference from
# the torque and the triangular solves are sums of at most 3 terms: about 16 roundings on either side.
STAGE_ULPS = 32
# The reference adds six sixths of each mass, 30 terms at most; the twin adds five masses.
MASS_ULPS = 36


@dataclass(frozen=True)
class Moment:
    """A communication step: before it x, u, p and the FMU's outputs y; after it x_next and y_next."""

    x: Array
    u: Array
    p: Array
    h: float
    y: dict[str, Array]
    x_next: Array
    y_next: dict[str, Array]


@cache
def twin_of(seed: int) -> Twin:
    return Twin(scene(random_scene(seed)))


@cache
def flight(seed: int) -> tuple[Moment, ...]:
    """Returns a flight of the FMU of a random scene, FMI 2 and 3 in turn, each step one sub-step."""
    raw, twin, rng = random_scene(seed), twin_of(seed), np.random.default_rng(1000 + seed)
    moments = []
    with flying(raw, 2 + seed % 2) as fmu:

        def outputs() -> dict[str, Array]:
            return {name: np.atleast_1d(fmu.get(name)) for name in raw["outputs"]["names"]}

        def state() -> Array:
            return np.concatenate([fmu.get("state.attitude"), fmu.get("state.angular_velocity")])

        for _ in range(STEPS):
            x, (p, u) = state(), random_inputs(twin, rng)
            names = (*twin.p_names, *twin.u_names)
            assert fmu.set(dict(zip(names, (*p, *u), strict=True))) == OK, fmu.log
            y = outputs()
            h = min(float(twin.longest_step(x, u, p)), 10.0) * rng.uniform(0.1, 1.0)
            assert fmu.step(h) == OK, fmu.log
            moments.append(Moment(x, u, p, h, y, state(), outputs()))
    return tuple(moments)


def rk4(ode: Any, x: NDArray[Any], h: Any) -> NDArray[Any]:
    """Returns the classical Runge-Kutta step with the attitude at unit length, in plain numpy."""
    k1 = ode(x)
    k2 = ode(x + 0.5 * h * k1)
    k3 = ode(x + 0.5 * h * k2)
    k4 = ode(x + h * k3)
    end = x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
    a, b, c, d = end[:4]
    return np.concatenate([end[:4] / np.sqrt(a * a + b * b + c * c + d * d), end[4:]])


def groups(names: tuple[str, ...]) -> Iterator[list[int]]:
    """Yields the places of the elements of each input vector."""
    kinds = [name.partition("[")[0] for name in names]
    for kind in dict.fromkeys(kinds):
        yield [i for i, other in enumerate(kinds) if other == kind]
