"""The flight of tanker.toml that lqr_hold.py and two_fmus.py share: plants, course, figures."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from stepping import elements, stepped

from supervessel import Twin

FULL, EMPTY = 32000.0, 8000.0  # kg, of the tanker at the start and at the end
DURATION, STEP, KICK = 600.0, 0.5, 480.0  # s; the kick acts for 10 s
REFERENCE = np.array([1.0, 0.0, 0.0, 0.0])
Flight = tuple[np.ndarray, np.ndarray]  # states (n + 1, 7), control torques (n, 3)
Control = Callable[..., Any]  # attitude, angular velocity, mass, reference -> torque
STATE = [*elements("attitude", 4), *elements("angular_velocity", 3)]
TORQUE = elements("torque", 3)
Advance = Callable[[float, float, np.ndarray], np.ndarray]  # time, mass, torque -> state a step later


def twin_plant(twin: Twin) -> Advance:
    """Returns the plant as the twin has it, from the scene's start."""
    x, p = twin.x_start, twin.p_start

    def advance(_: float, mass: float, torque: np.ndarray) -> np.ndarray:
        nonlocal x, p
        p_next = twin.p_with({"tanker.mass": mass})
        x = twin.step(twin.change(x, p, p_next), torque, p_next, STEP).full().ravel()
        p = p_next
        return x

    return advance


@contextmanager
def fmu_plant(path: Path) -> Iterator[Advance]:
    """Yields the plant as the FMU has it."""
    inputs = ["tanker.mass", *TORQUE]
    with stepped(path, STEP) as step:
        yield lambda time, mass, torque: step(time, dict(zip(inputs, [mass, *torque], strict=True)), STATE)


@contextmanager
def fmu_controller(path: Path) -> Iterator[Control]:
    """Yields a controller that is an FMU; it steps before the plant does."""
    inputs, time = [*STATE, "mass", *elements("reference", 4)], count(0.0, STEP)

    def control(*given: ArrayLike) -> np.ndarray:
        return step(next(time), dict(zip(inputs, np.hstack(given), strict=True)), TORQUE)

    with stepped(path, STEP) as step:
        yield control


def fly(advance: Advance, control: Control, x: np.ndarray) -> Flight:
    """Returns the flight from the state x."""
    states, torques = [x], []
    for time in np.arange(0.0, DURATION, STEP):
        mass = float(np.interp(time, [0.0, DURATION], [FULL, EMPTY]))
        torques.append(np.array(control(x[:4], x[4:], mass, REFERENCE)).ravel())
        kick = 1000.0 * np.array([2.0, -1.0, 0.5]) * (KICK <= time < KICK + 10.0)  # N m
        states.append(x := advance(time, mass, torques[-1] + kick))
    return np.array(states), np.array(torques)


def off(states: np.ndarray) -> np.ndarray:
    """Returns the attitude's error against REFERENCE, the identity, (n, 3) [deg]."""
    return np.degrees(2.0 * states[:, 1:4] * np.sign(states[:, :1]))


def figures(states: np.ndarray, torques: np.ndarray) -> list[float]:
    """Returns settling [s] and overshoot [%] from the start, largest error [deg] and settling [s] after the
    kick, largest torque [N m], torque used [N m s]; settled: within 0.1 degrees."""
    e, kick = off(states), int(KICK / STEP)
    size = np.linalg.norm(e, axis=1)
    last = [np.flatnonzero(part > 0.1)[-1] + 1 for part in (size[:kick], size[kick:])]
    overshoot = 100.0 * np.max(-e[:kick] @ e[0]) / (e[0] @ e[0])
    strength = np.linalg.norm(torques, axis=1)
    return [
        last[0] * STEP,
        overshoot,
        size[kick:].max(),
        last[1] * STEP,
        strength.max(),
        strength.sum() * STEP,
    ]


def table(rows: dict[str, list[float]]) -> str:
    """Returns figures by flight as a Markdown table."""
    lines = [
        "| | settles [s] | overshoot [%] | kicked by [deg] | settles [s] | torque [N m] | used [N m s] |",
        "|---|---:|---:|---:|---:|---:|---:|",
    ]
    form = "| {} | {:.1f} | {:.2f} | {:.3f} | {:.1f} | {:.0f} | {:.0f} |"
    return "\n".join(lines + [form.format(name, *row) for name, row in rows.items()])
