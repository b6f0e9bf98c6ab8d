"""What the engines are asked: cases of tests/stability/truth.json and some more, all of diagonal bodies."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stability import truth
from stability.truth import Case, Problem, mp

NO_TORQUE = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Task:
    """A case and the steps in which engines that step are asked to fly it.

    label   : of the table's row
    case    : start and end
    steps   : how many equal steps
    exists  : whether a rigid body can have these moments; if not, the case's end means nothing
    """

    label: str
    case: Case
    steps: int
    exists: bool = True


def tasks() -> list[Task]:
    """Returns the rows of the table; the first three are plain motion, by which conventions are checked."""
    flat = (3.0 + 1e-9, 1.0, 2.0), (3.5, 1.0, 2.0)
    return [
        Task("steady spin, steps of 10 ms", _of("steady spin", "axis 0, -0.7 rad/s, 20 s"), 2000),
        Task("tumble, steps of 10 ms", _of("general", "10 s"), 1000),
        Task("tumble, steps of 1 ms", _of("general", "10 s"), 10000),
        Task("omega h = 1, one step", _of("omega h of 1, 10, 1000", "1 rad, 1 rad/s"), 1),
        Task("omega h = 10, one step", _of("omega h of 1, 10, 1000", "10 rad, 1 rad/s"), 1),
        Task("omega h = 1000, one step", _of("omega h of 1, 10, 1000", "1000 rad, 1 rad/s"), 1),
        Task("free, 1 rad/s for 1e5 s, one step", _of("general", "100000 s"), 1),
        Task("the same in steps of 0.2 s", _of("general", "100000 s"), 500_000),
        Task("free, 1e-3 rad/s for 1e5 s, steps of 10 s", _of("many turns", "0.001 rad/s, 100000 s"), 10_000),
        Task("slender, 1e-12, steps of 10 ms", _of("slender", "1e-12, spinning"), 100_000),
        Task("flat (triangle's boundary), steps of 10 ms", _of("flat", "disc"), 5000),
        Task("1e-9 beyond the triangle, steps of 10 ms", _plain(flat[0]), 1000, exists=False),
        Task("1/2 beyond the triangle, steps of 10 ms", _plain(flat[1]), 1000, exists=False),
        Task("spherical to 1e-12, steps of 10 ms", _of("nearly spherical", "1e-12, 20 s"), 2000),
        Task("on the separatrix, steps of 10 ms", _separatrix(), 1000),
        Task(
            "middle axis, 1e-10 off, 60 s, steps of 10 ms",
            _of("spin disturbed", "axis 1, -1 rad/s, 1e-10, 60 s"),
            6000,
        ),
        Task("1e-310 rad/s, steps of 10 ms", _of("tiny and huge rates", "1e-310 rad/s, 1 s"), 100),
        Task("1e8 rad/s, 1 us, steps of 1 ns", _fast(), 1000),
        Task("1e150 rad/s, 10 rad in 1000 steps", _of("tiny and huge rates", "1e+150 rad/s, 1e-149 s"), 1000),
        Task(
            "moments of 1e-300, steps of 10 ms",
            _of("tiny and huge moments", "1e-300 kg m2, 1 rad/s, 10 s"),
            1000,
        ),
        Task(
            "moments of 1e300, steps of 10 ms",
            _of("tiny and huge moments", "1e+300 kg m2, 1 rad/s, 10 s"),
            1000,
        ),
        Task("torque, 36 rad, steps of 10 ms", _of("torque, moderate", "about 36 rad"), 4000),
        Task(
            "torque dwarfs momentum, one step of 4 s",
            _of("torque that dwarfs momentum", "0.001 rad/s, 1000 N m, 1000 kg m2, 4 s"),
            1,
        ),
        Task(
            "torque dwarfs momentum, steps of 0.1 ms",
            _of("torque that dwarfs momentum", "0.001 rad/s, 1000 N m, 1 kg m2, 0.25 s"),
            2500,
        ),
    ]


def _of(category: str, name: str) -> Case:
    [case] = [case for case in truth.cases(category) if case.name == name]
    return case


def _separatrix() -> Case:
    """Returns 10 s on the separatrix: 9 (9 - 8) w2^2 = 4 (8 - 4) w0^2."""
    return _solved("separatrix", (4.0, 8.0, 9.0), (0.375, 0.25, 0.5), 10.0)


def _fast() -> Case:
    return _solved("fast", (1.0, 2.0, 2.5), (3e7, 7e7, 5e7), 1e-6)


def _plain(moments: Sequence[float]) -> Case:
    """Returns a case of moments that no body has; its end is its start."""
    start = (1.0, 0.0, 0.0, 0.0)
    omega = np.array([0.3, 0.7, 0.5])
    none = tuple(map(mp.mpf, start)), tuple(map(mp.mpf, omega)), 0.0, 0.0, 0.0, 0.0
    return Case("", "", np.diag(moments), np.array(start), omega, np.array(NO_TORQUE), 10.0, *none)


def _solved(category: str, moments: Sequence[float], omega: Sequence[float], time: float) -> Case:
    """Returns a free case as truth.py solves it, two ways."""
    problem = Problem("", np.diag(moments).tolist(), [1.0, 0.0, 0.0, 0.0], list(omega), list(NO_TORQUE), time)
    raw, _ = truth._solved(category, problem)
    return Case(
        name=raw["name"],
        category=category,
        inertia=np.diag(moments),
        attitude=np.array(problem.attitude),
        omega=np.array(omega),
        torque=np.array(NO_TORQUE),
        time=time,
        attitude_end=tuple(mp.mpf(x) for x in raw["attitude_end"]),
        omega_end=tuple(mp.mpf(x) for x in raw["omega_end"]),
        **{key: float(raw[key]) for key in ("cond_attitude", "cond_rate", "motion_attitude", "motion_rate")},
    )
