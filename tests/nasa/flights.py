"""NASA's motions flown by FMUs, and how far from the published and from the true states they end."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from nasa.facts import Row, brick_inertia, brick_rates, brick_simulators, cylinder, station, table
from support import OK, Array, Instance, hamilton
from support.gyrostat import Course, Gyrostat, GyrostatState
from support.series import flight, mp, norm

SETTINGS: dict[str, dict[str, Any]] = {
    "taylor": {"propagator": "taylor", "tolerance": 1e-15},
    "dop853": {"propagator": "dop853", "tolerance": 1e-15},
    "rk4": {"propagator": "rk4"},
    "split": {"propagator": "split"},
    "exact": {"propagator": "exact"},
    "auto": {"propagator": "auto", "tolerance": 1e-15},
}
"""What a scene's table [rotation] has for each propagator."""


@dataclass(frozen=True)
class Error:
    """How far a state is from another: attitude [rad], rates [rad/s], the largest component's difference."""

    attitude: float
    rates: float


def error(own: Any, other: Any) -> Error:
    """Returns how far a state is from another; each has `attitude` and `rates`, of which q and -q are one."""
    a, b = ([mp.mpf(float(x) if isinstance(x, np.floating) else x) for x in y.attitude] for y in (own, other))
    turn = hamilton([a[0], -a[1], -a[2], -a[3]], b)
    rates = max(abs(x - y) for x, y in zip(map(mp.mpf, own.rates), map(mp.mpf, other.rates), strict=True))
    return Error(float(2 * mp.atan2(norm(turn[1:]), abs(turn[0]))), float(rates))


def raw_scene(name: str, inertia: Array, start: Row, propagator: str, **more: Any) -> dict[str, Any]:
    """Returns the raw scene of a single body that starts as a published state says."""
    rotation = {
        **SETTINGS[propagator],
        "attitude": list(start.attitude),
        "angular_velocity": list(start.rates),
    }
    return {
        "name": f"{name}_{propagator}",
        "root": "B",
        "vessels": {"B": {"mass": 1000.0, "inertia": np.asarray(inertia).tolist()}},
        "rotation": rotation,
        "outputs": {"names": ["attitude", "angular_velocity"]},
        **more,
    }


def state(it: Instance) -> Row:
    """Returns what an instance's outputs say."""
    return Row(it.time, tuple(it.get("attitude")), tuple(it.get("angular_velocity")))


# The station under a torque


@cache
def station_flight(propagator: str, step: float = 20.0) -> tuple[Row, ...]:
    """Returns the FMU's states at the published times; the step [s] divides these, 1000 and 2000."""
    facts, rows = table("iss_torque"), station()
    raw = raw_scene("station", facts["inertia"], rows[0], propagator, inputs={"torque": True})
    it, states = Instance(raw, optimised=False), []
    assert it.initialise() == OK, it.log
    count = 0
    for row in rows:
        while count * step < row.time:
            pushed = facts["start"] <= count * step < facts["end"]
            assert it.set({"torque": facts["torque"] if pushed else [0.0] * 3}) == OK
            assert it.step(step) == OK, it.log
            count += 1
        assert it.time == row.time
        states.append(state(it))
    it.free()
    return tuple(states)


@cache
def station_truth() -> tuple[GyrostatState, ...]:
    """Returns the true states at the times of the published ones."""
    facts, rows = table("iss_torque"), station()
    pushed = Gyrostat(facts["inertia"], torque=facts["torque"])
    free, start, end = Gyrostat(facts["inertia"]), facts["start"], facts["end"]
    rest = GyrostatState(rows[0].attitude, rows[0].rates)
    push = Course(pushed, rest, end - start)
    after = Course(free, push.at(end - start), rows[-1].time - end)
    return tuple(
        after.at(row.time - end) if row.time >= end else push.at(max(row.time - start, 0.0)) for row in rows
    )


# The tumbling brick


def brick_truth(times: Iterable[float]) -> Iterator[GyrostatState]:
    """Yields the brick's true states at times; north, east and down are its axes at the start."""
    start = [1, 0, 0, 0, *brick_rates()]
    moments = [[mp.mpf(x) for x in row] for row in np.diag(table("brick")["moments_slug_ft2"])]
    for time in times:
        end = flight("tensor", moments, start, [0, 0, 0], mp.mpf(time), digits=30)
        yield GyrostatState(end[:4], end[4:])


@cache
def brick_errors() -> dict[str, Error]:
    """Returns the worst error of each of NASA's simulators over its published states."""
    return {
        name: worst(rows, list(brick_truth(row.time for row in rows)))
        for name, rows in brick_simulators().items()
    }


def worst(states: Sequence[Any], truth: Sequence[Any]) -> Error:
    """Returns the largest errors of states."""
    errors = [error(own, exact) for own, exact in zip(states, truth, strict=True)]
    return Error(max(e.attitude for e in errors), max(e.rates for e in errors))


@cache
def brick_flight(
    propagator: str, step: float = 0.1, times: tuple[float, ...] = (1, 2, 3, 4, 29, 29.5, 30)
) -> Error:
    """Returns the worst error of the FMU over times that `step` divides."""
    rates = tuple(float(x) for x in brick_rates())
    it = Instance(
        raw_scene("brick", brick_inertia(), Row(0.0, (1.0, 0.0, 0.0, 0.0), rates), propagator),
        optimised=False,
    )
    assert it.initialise() == OK, it.log
    states = []
    for count in range(1, round(times[-1] / step) + 1):
        assert it.step(step) == OK, it.log
        if round(count * step, 9) in times:
            states.append(state(it))
    it.free()
    return worst(states, list(brick_truth(times)))


# The cylinder in its orbit


@cache
def cylinder_truth() -> Course:
    """Returns the true course of the cylinder."""
    facts, rows = table("cylinder"), cylinder()
    start = GyrostatState(rows[0].attitude, rows[0].rates, rows[0].orbit[:3], rows[0].orbit[3:])
    return Course(Gyrostat(facts["inertia"], mu=facts["mu"]), start, rows[-1].time)


def cylinder_scene(propagator: str, **rotation: Any) -> dict[str, Any]:
    """Returns the raw scene of the cylinder."""
    facts, start = table("cylinder"), cylinder()[0]
    gravity = {"mu": facts["mu"], "position": list(start.orbit[:3]), "velocity": list(start.orbit[3:])}
    raw = raw_scene(
        "cylinder", facts["inertia"], start, propagator, gravity=gravity, inputs={"gravity": True}
    )
    raw["rotation"] |= rotation
    return raw


@cache
def cylinder_flight(propagator: str, step: float, **rotation: Any) -> tuple[Row, ...]:
    """Returns the FMU's states at the published times; the true orbit is set every `step` [s]."""
    it, states = Instance(cylinder_scene(propagator, **rotation), optimised=False), []
    times = {row.time for row in cylinder()}
    assert it.initialise() == OK, it.log
    states.append(state(it))
    orbit = cylinder_truth().orbit(step * np.arange(round(cylinder()[-1].time / step)))
    for _ in in_orbit(it, step, orbit.tolist()):
        if it.time in times:
            states.append(state(it))
    it.free()
    return tuple(states)


def in_orbit(it: Instance, step: float, orbit: Iterable[Sequence[float]]) -> Iterator[None]:
    """Steps an instance, position and velocity set before each step; yields after each."""
    place = [it.references[name] for name in it.names("gravity.position") + it.names("gravity.velocity")]
    for count, values in enumerate(orbit, start=1):
        it.fmu.setFloat64(place, values)
        it.fmu.doStep(it.time, step)
        it.time = count * step
        yield
