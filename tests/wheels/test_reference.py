"""Scenes with wheels by the numpy reference and by the twin: rates, momentum, changes, outputs."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from changes.scenes import TUG
from supervessel import Twin, reference
from support import Array, U, scene, variant
from support.orbits import orbiting

LAWS = ("decoupled", "principal", "tensor")
AGREEMENT = 512 * U
"""Of a rate's largest component: a composite good to 64 U, solved with, its condition below 8."""

WHEELED = variant(
    TUG,
    {
        "vessels.tug.wheels.fast": {"axis": [1.0, 2.0, -2.0], "inertia": 30.0, "momentum": 400.0},
        "vessels.tug.wheels.store": {"axis": [0.0, 0.0, 3.0], "momentum": -250.0},
        "vessels.tank.wheels.own": {"axis": [0.0, 1.0, 1.0], "inertia": 50.0, "momentum": 300.0},
        "inputs.wheel": ["tug.fast", "tug.store", "tank.own"],
        "inputs.motion": ["tug.arm"],
        "outputs.names": [
            "angular_momentum",
            *(f"{wheel}.momentum" for wheel in ("tug.fast", "tug.store", "tank.own")),
            *(f"{wheel}.speed" for wheel in ("tug.fast", "tank.own")),
            "tug.angular_momentum",
            "tank.angular_momentum",
        ],
    },
)
"""A tug that holds a tank on an arm that moves; wheels are on both, one of them of no inertia."""

MOVING = {"tug.arm.velocity[2]": 0.3, "tug.arm.rate[1]": 0.2, "tug.arm.rate[3]": -0.4, "tank.mass": 500.0}
MOTORS = {"tug.fast.torque": 3.0, "tug.store.torque": -2.0, "tank.own.torque": 5.0, "torque[2]": 20.0}
LOOSE = {"held.docked": 0.0}


@cache
def twin(law: str) -> Twin:
    return Twin(scene(orbiting({"rotation.law": law}, WHEELED)))


def given(of: Twin, values: dict[str, float]) -> tuple[list[float], list[float]]:
    """Returns u and p of the inputs that differ from the scene's."""
    u = dict.fromkeys(of.u_names, 0.0)
    p = dict(zip(of.p_names, of.p_start, strict=True))
    assert values.keys() <= u.keys() | p.keys()
    return [values.get(name, x) for name, x in u.items()], [values.get(name, x) for name, x in p.items()]


def numbers(found: Any) -> Array:
    return np.array(found).ravel()


def close(own: Array, other: Array) -> bool:
    return bool(np.abs(own - other).max() <= AGREEMENT * np.abs(other).max())


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("held", [{}, LOOSE])
def test_rates_are_the_twins(law: str, held: dict[str, float]) -> None:
    of, values = twin(law), {**MOVING, **MOTORS, **held}
    x = of.x_start + 0.01 * np.arange(len(of.x_start))
    x[:4] /= np.linalg.norm(x[:4])
    own, other = reference.ode(of.scene, x, None, values), numbers(of.ode(x, *given(of, values)))
    for part in (slice(4), slice(4, 7)):
        assert close(own[part], other[part])
    assert own[7:].tolist() == other[7:].tolist() == [3.0, -2.0, 0.0 if held else 5.0]


@pytest.mark.parametrize("held", [{}, LOOSE])
def test_outputs_are_the_twins(held: dict[str, float]) -> None:
    of, values = twin("tensor"), {**MOVING, **MOTORS, **held}
    x = of.x_start
    R = reference.rotation_matrix(x[:4])
    own = reference.wheel_outputs(of.scene, x, values) | reference.vessel_outputs(of.scene, x, values)
    own |= {"angular_momentum": R @ reference.angular_momentum(of.scene, x[4:], values)}
    y = dict(zip(of.y_names, numbers(of.outputs(x, *given(of, values))), strict=True))
    for name in of.scene.outputs.names:
        other = np.array([number for full, number in y.items() if full.partition("[")[0] == name])
        assert np.abs(own[name] - other).max() <= AGREEMENT * max(1.0, np.abs(other).max()), name


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(
    ("before", "after"),
    [
        ({}, {"tank.mass": 700.0}),
        ({}, {"tug.arm.position[1]": 2.0, "tug.arm.alignment[3]": 0.5}),
        ({}, MOVING),
        (MOVING, LOOSE),
        (LOOSE, {"held.velocity[1]": -0.2, "held.rate[2]": 0.3, "held.rate[3]": 0.1}),
        (LOOSE, {"stowed.docked": 1.0, "held.docked": 0.0, "stowed.rate[1]": 0.2}),
    ],
)
def test_changes_are_the_twins(law: str, before: dict[str, float], after: dict[str, float]) -> None:
    of = twin(law)
    own = reference.change(of.scene, of.x_start[4:], before, after)
    other = numbers(of.change(of.x_start, given(of, before)[1], given(of, after)[1]))[4:]
    assert close(own[:3], other[:3])
    assert own[3:].tolist() == other[3:].tolist() == of.x_start[7:].tolist()


@pytest.mark.parametrize("after", [{}, {"held.rate[2]": 0.3, "held.velocity[1]": 0.1}])
def test_a_vessel_that_arrives_brings_its_wheels_momentum(after: dict[str, float]) -> None:
    # The momentum of all points about the common barycentre, and what wheels hold beside locked ones.
    flown, rates = twin("tensor").scene, twin("tensor").x_start[4:]
    touching = reference.at_contact(flown, rates[:3], LOOSE, after)
    wheels = reference.wheels_of(flown, rates[3:], after)
    arriving = [after.get(f"held.rate[{i}]", 0.0) for i in (1, 2, 3)]
    turning = np.array([rates[:3], rates[:3], rates[:3] + arriving])
    beside = wheels.momenta - wheels.inertias * (wheels.axes * turning).sum(axis=1)
    momentum = reference.joined(touching.values()).momentum + beside @ wheels.axes
    landed = reference.change(flown, rates, LOOSE, after)
    assert close(reference.angular_momentum(flown, landed, after), momentum)


def test_the_rate_of_momentum_is_what_acts_from_outside() -> None:
    # H in body axes: H' + omega x H = M, whatever motors do.
    flown, values = twin("tensor").scene, {**MOVING, **MOTORS}
    x = twin("tensor").x_start
    H = reference.angular_momentum(flown, x[4:], values)
    state = np.concatenate([x[:4], H, x[7:]])
    assert close(reference.angular_velocity(flown, state[4:], values), x[4:7])
    rate = reference.momentum_ode(flown, state, values)
    outside = reference.external_torque(flown, values) + reference.gradient_torque(flown, x[:4], values)
    assert np.abs(rate[4:7] + np.cross(x[4:7], H) - outside).max() <= AGREEMENT * np.abs(H).max()
    assert rate[7:].tolist() == [3.0, -2.0, 5.0]


def test_momenta_of_too_few_wheels_are_refused() -> None:
    with pytest.raises(ValueError, match="momenta of 1 wheels: the scene has 3"):
        reference.wheels_of(twin("tensor").scene, [1.0])
