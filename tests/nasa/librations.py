"""A body that librates on a circular orbit: its motion by the FMU, its frequencies and its invariant."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from nasa.flights import in_orbit
from support import OK, Array, Instance

MU = 3.986004418e14  # m3/s2
RADIUS = 6.786e6  # m
RATE = math.sqrt(MU / RADIUS**3)  # rad/s
PERIOD = 2.0 * math.pi / RATE  # s

ALONG = (1000.0, 1800.0, 2200.0)
"""Moments [kg m2] about the radius, the direction of flight and the orbit's normal, the body's axes in the
the stable attitude."""


def orbit(angle: Array) -> Array:
    """Returns position and velocity, (n, 6), at angles, (n,) [rad], in the plane of the first two axes."""
    c, s, zero = np.cos(angle), np.sin(angle), np.zeros(len(angle))
    speed = RADIUS * RATE
    return np.column_stack([RADIUS * c, RADIUS * s, zero, -speed * s, speed * c, zero])


def raw_scene(propagator: str, **rotation: Any) -> dict[str, Any]:
    """Returns the raw scene of the body."""
    start = orbit(np.zeros(1))[0]
    return {
        "name": f"libration_{propagator}",
        "root": "B",
        "vessels": {"B": {"mass": 1000.0, "inertia": np.diag(ALONG).tolist()}},
        "gravity": {"mu": MU, "position": start[:3].tolist(), "velocity": start[3:].tolist()},
        "inputs": {"gravity": True},
        "rotation": {"propagator": propagator, **rotation},
        "outputs": {"names": ["attitude", "angular_velocity"]},
    }


def normal(q: Array) -> Array:
    """Returns the orbit's normal, the third inertial axis, in body axes."""
    w, x, y, z = q
    return np.array([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])


def radial(q: Array, angle: float) -> Array:
    """Returns the direction of a place in the orbit, given by its angle [rad], in body axes."""
    w, x, y, z = q
    first = np.array([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)])
    second = np.array([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)])
    return np.cos(angle) * first + np.sin(angle) * second


def flown(
    raw: dict[str, Any],
    turn: Sequence[float],
    count: int,
    *,
    revolution: int = 96,
    every: int = 1,
    optimised: bool = False,
) -> Iterator[tuple[float, Array]]:
    """Yields the angle along the orbit [rad] and the state (attitude, rates), (7,), as it goes on.

    turn       : (3,) [rad], the rotation vector out of the stable attitude; the body turns with the orbit
    count      : of communication steps
    revolution : how many of them are one, so that places repeat to the bit
    every      : steps between what is yielded
    """
    size = np.linalg.norm(turn)
    q = np.array([np.cos(size / 2), *(np.sin(size / 2) * np.array(turn) / size)])
    it, angles = Instance(raw, optimised=optimised), 2.0 * np.pi * np.arange(revolution) / revolution
    assert it.initialise(attitude_start=q, angular_velocity_start=RATE * normal(q)) == OK, it.log
    shown = [it.references[name] for name in it.names("attitude") + it.names("angular_velocity")]
    places = orbit(angles).tolist()
    steps = in_orbit(it, PERIOD / revolution, (places[i % revolution] for i in range(count)))
    for taken, _ in enumerate(steps, start=1):
        if taken % every == 0:
            yield float(angles[taken % revolution]), np.array(it.fmu.getFloat64(shown))
    it.free()


def invariant(state: Array, angle: float) -> float:
    """Returns E over n^2 times the largest moment.

    E = 1/2 w.J w + 3/2 n^2 r^.J r^ - 1/2 n^2 o^.J o^, w = omega - n o^, with the radius r^ and the normal o^.
    """
    o, r = normal(state[:4]), radial(state[:4], angle)
    w, J = state[4:] / RATE - o, np.array(ALONG)
    return float(w @ (J * w) + 3.0 * r @ (J * r) - o @ (J * o)) / (2.0 * J.max())


@dataclass(frozen=True)
class Small:
    """Small rotations out of the stable attitude, (n,) [rad], about the radius, the flight and the normal."""

    yaw: Array
    roll: Array
    pitch: Array


def small(states: Iterable[tuple[float, Array]]) -> Small:
    """Returns the rotation vectors of states relative to the orbit's axes."""
    vectors = []
    for angle, state in states:
        c, s = np.cos(angle / 2), np.sin(angle / 2)
        w, x, y, z = state[:4]
        turn = np.array([c * w + s * z, c * x + s * y, c * y - s * x, c * z - s * w])
        size = np.linalg.norm(turn[1:])
        vectors.append(2.0 * np.arctan2(size, abs(turn[0])) * np.sign(turn[0]) * turn[1:] / size)
    return Small(*np.array(vectors).T)


def frequency(samples: Array, interval: float) -> float:
    """Returns the frequency of one oscillation [rad/s] that fits x_(k+1) + x_(k-1) = 2 cos(w dt) x_k best."""
    sums = samples[2:] + samples[:-2]
    return float(np.arccos(samples[1:-1] @ sums / (2.0 * samples[1:-1] @ samples[1:-1]))) / interval


def frequencies(samples: Sequence[Array], interval: float) -> list[float]:
    """Returns the two frequencies of signals that are made of them [rad/s], ascending.

    x_(k+2) + x_(k-2) = a (x_(k+1) + x_(k-1)) + b x_k, and c = 2 cos(w dt) is a root of c^2 - a c - (2 + b).
    """
    near = np.concatenate([x[3:-1] + x[1:-3] for x in samples])
    middle = np.concatenate([x[2:-2] for x in samples])
    far = np.concatenate([x[4:] + x[:-4] for x in samples])
    (a, b), *_ = np.linalg.lstsq(np.column_stack([near, middle]), far, rcond=None)
    return sorted(float(np.arccos(c / 2.0)) / interval for c in np.roots([1.0, -a, -(2.0 + b)]))


def pitch_frequency() -> float:
    """Returns n sqrt(3 (I_y - I_r)/I_z) [rad/s], of pitch at no amplitude."""
    r, y, z = ALONG
    return RATE * math.sqrt(3.0 * (y - r) / z)


def coupled_frequencies() -> list[float]:
    """Returns those of roll and yaw [rad/s]: s^4 + (1 + 3 k_y + k_y k_r) n^2 s^2 + 4 k_y k_r n^4 = 0.

    Source: P. C. Hughes, Spacecraft Attitude Dynamics, 1986, chapter 9.
    """
    r, y, z = ALONG
    k_y, k_r = (z - r) / y, (z - y) / r
    squares = np.roots([1.0, 1.0 + 3.0 * k_y + k_y * k_r, 4.0 * k_y * k_r])
    return sorted(RATE * math.sqrt(-s) for s in squares.real)
