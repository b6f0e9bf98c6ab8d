"""Flights of the ISS with its ship by programmes of drawn inputs and step sizes."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from fmu.exchange import change
from supervessel import reference
from support import ISS_DG, OK, Instance, draw_inputs, scene, variant

SEED = 20240612


SPINNING = variant(
    ISS_DG,
    {
        "name": "spinning",
        "rotation": {"angular_velocity": [0.01, -0.02, 0.03], "attitude": [1.0, 2.0, 3.0, 4.0]},
    },
)


def outputs(instance: Instance) -> list[float]:
    """Returns all outputs, states and rates, read in one call."""
    names = [v.name for v in instance.description.modelVariables if v.causality in ("output", "local")]
    getter = instance.fmu.getFloat64 if instance.fmi == 3 else instance.fmu.getReal
    return list(getter([instance.references[name] for name in names]))


def programme(instance: Instance, seed: int, steps: int = 25) -> Iterator[list[float]]:
    """Initialises an instance and flies it with inputs and step sizes drawn; yields the outputs each time."""
    generator = np.random.default_rng(seed)
    assert instance.enter() == OK
    assert (
        instance.set(draw_inputs(generator) | {"angular_velocity_start": generator.normal(size=3) * 0.1})
        == OK
    )
    yield outputs(instance)
    assert instance.exit() == OK
    for _ in range(steps):
        assert instance.set(draw_inputs(generator)) == OK
        yield outputs(instance)
        assert instance.step(generator.uniform(0.01, 5.0)) == OK
        yield outputs(instance)


def exchange(instance: Instance, seed: int, moves: int = 25) -> Iterator[list[float]]:
    """Takes an instance of model exchange through its modes, inputs and states drawn; yields the outputs."""
    generator = np.random.default_rng(seed)
    assert instance.enter() == OK
    assert (
        instance.set(draw_inputs(generator) | {"angular_velocity_start": generator.normal(size=3) * 0.1})
        == OK
    )
    yield outputs(instance)
    assert instance.exit() == OK
    yield outputs(instance)
    assert instance.run() == OK
    for _ in range(moves):
        states = {
            "state.attitude": generator.normal(size=4),
            "state.angular_velocity": generator.normal(size=3) * 0.1,
        }
        assert change(instance, draw_inputs(generator)) == [OK] * 3
        assert instance.set(states) == OK
        assert instance._status(instance.fmu.setTime, generator.uniform(0.0, 10.0)) == OK
        yield [*outputs(instance), instance.get("time")]


def alone(fmi: int, seed: int, steps: int = 25) -> list[list[float]]:
    """Returns what a programme gives when nothing else runs."""
    instance = Instance(ISS_DG, fmi, logging=False)
    result = list(programme(instance, seed, steps))
    instance.free()
    return result


def expected(raw: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the outputs at the start by the numpy reference, from values by group or name."""
    scalars: dict[str, float] = {}
    for name, value in values.items():
        numbers = np.ravel(value)
        names = [name] if np.ndim(value) == 0 else [f"{name}[{i + 1}]" for i in range(len(numbers))]
        scalars |= {n: float(x) for n, x in zip(names, numbers, strict=True)}
    whole = reference.composite(scene(raw), scalars)
    omega = np.array([scalars[f"angular_velocity_start[{i}]"] for i in (1, 2, 3)])
    attitude = np.array([scalars[f"attitude_start[{i}]"] for i in (1, 2, 3, 4)])
    attitude /= np.linalg.norm(attitude)
    momentum = whole.inertia @ omega
    return {
        "mass": whole.mass,
        "barycentre": whole.barycentre,
        "pmi": whole.pmi,
        "inertia": whole.inertia.ravel(),
        "angular_velocity": omega,
        "attitude": attitude,
        "kinetic_energy": omega @ momentum / 2.0,
        "angular_momentum": reference.rotation_matrix(attitude) @ momentum,
    }
