"""Outputs of single vessels and the net force, against the reference, and shares that make up the whole."""

from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from changes.histories import Values, assembly, elements, happening, start_values
from supervessel import Scene, Twin, reference
from supervessel.scene.outputs import VESSEL_OUTPUTS
from support import EPS, OK, flying, scene, variant
from support.examples import examples

AGREEMENT = 1000 * EPS
"""Of the largest number of an output's kind: poses go down a chain of up to five vessels, each of a few dozen
roundings, and a vessel's place is off by that of the others' lengths."""


def shown(seed: int, count: int, **rotation: Any) -> dict[str, Any]:
    """Returns a random assembly with outputs of every vessel, the forces' sum and the whole momentum."""
    raw = assembly(seed, count, **rotation)
    names = [f"{vessel}.{name}" for vessel in raw["vessels"] for name in VESSEL_OUTPUTS]
    names += ["net_force", "angular_momentum", "barycentre_velocity"]
    return variant(raw, {"outputs": {"names": names}})


def moved(flown: Scene, seed: int) -> Values:
    """Returns inputs after a few things have happened."""
    values = start_values(flown)
    for number, kind in enumerate(("burn", "move", "undock", "dock", "move", "burn")):
        values |= happening(flown, values, [kind], seed + number)
    rng = np.random.default_rng(seed)
    for point in flown.inputs.force:
        values |= elements(f"{point}.force", rng.normal(size=3))
    return values


def state(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    attitude = rng.normal(size=4)
    return np.array([*(attitude / np.linalg.norm(attitude)), *rng.normal(size=3)])


def twins_outputs(flown: Scene, x: np.ndarray, values: Values) -> dict[str, np.ndarray]:
    """Returns the twin's outputs by name, vectors whole."""
    twin = Twin(flown)
    known = {name: value for name, value in values.items() if name in twin.p_names}
    u = [values.get(name, 0.0) for name in twin.u_names]
    numbers = np.array(twin.outputs(x, u, twin.p_with(known))).ravel()
    found: dict[str, list[float]] = {}
    for name, number in zip(twin.y_names, numbers, strict=True):
        found.setdefault(name.partition("[")[0], []).append(number)
    return {name: np.array(values) for name, values in found.items()}


@examples(8, 20)
@given(seed=st.integers(0, 10**6), count=st.integers(2, 7))
def test_outputs_of_vessels_are_the_references(seed, count):
    flown = scene(shown(seed, count))
    values, x = moved(flown, seed), state(seed)
    found, truth = twins_outputs(flown, x, values), reference.vessel_outputs(flown, x, values)
    for kind in VESSEL_OUTPUTS:
        largest = max(np.abs(truth[f"{vessel}.{kind}"]).max() for vessel in flown.vessels)
        for vessel in flown.vessels:
            value, right = found[f"{vessel}.{kind}"], truth[f"{vessel}.{kind}"]
            if kind == "attitude" and value @ right < 0.0:  # at half a turn either sign is right
                value = -value
            assert np.abs(value - right).max() <= AGREEMENT * largest, (vessel, kind)
    drift = reference.barycentre_velocity(flown, values)
    assert np.abs(found["barycentre_velocity"] - drift).max() <= AGREEMENT * (np.abs(drift).max() + 1.0)
    force = reference.net_force(flown, values)
    assert np.abs(found["net_force"] - force).max() <= AGREEMENT * (np.abs(force).max() + 3.0)


@pytest.mark.parametrize("law", ["none", "decoupled", "principal", "tensor"])
def test_shares_of_momentum_make_up_the_whole(law):
    rotation = {"law": law, "pose_change": "rate"} if law == "none" else {"law": law}
    flown = scene(shown(5, 6, **rotation))
    found = twins_outputs(flown, state(1), moved(flown, 5))
    shares = [found[f"{vessel}.angular_momentum"] for vessel in flown.vessels]
    size = np.abs(shares).sum()
    assert np.abs(sum(shares) - found["angular_momentum"]).max() <= AGREEMENT * size
    assert size > 0.0


def test_the_fmu_shows_a_vessel_while_it_is_docked():
    raw = shown(3, 3)
    flown = scene(raw)
    name = flown.inputs.docked[0]
    child = flown.dock(name).ports[1].partition(".")[0]
    with flying(raw) as it:
        for docked in (True, False, True):
            it.set({f"{dock}.docked": dock == name and docked for dock in flown.inputs.docked})
            attitude = it.get(f"{child}.attitude")
            values = {f"{dock}.docked": float(dock == name and docked) for dock in flown.inputs.docked}
            truth = reference.vessel_outputs(flown, [1, 0, 0, 0, 0, 0, 0], values)[f"{child}.attitude"]
            assert abs(abs(attitude @ truth) - float(truth.any())) <= AGREEMENT
            assert attitude.any() == truth.any()


@examples(8, 20)
@given(seed=st.integers(0, 10**6), count=st.integers(2, 7), wheels=st.booleans())
def test_the_whole_energy_is_that_of_all_points_and_wheels(seed, count, wheels):
    flown = scene(variant(assembly(seed, count, wheels=wheels), {"outputs.names": ["total_kinetic_energy"]}))
    values, rng = moved(flown, seed), np.random.default_rng(seed)
    for port in flown.inputs.motion:
        values |= elements(f"{port}.velocity", rng.normal(size=3)) | elements(
            f"{port}.rate", rng.normal(size=3)
        )
    x = np.append(state(seed), 50.0 * rng.normal(size=len(flown.wheels)))
    found = twins_outputs(flown, x, values)["total_kinetic_energy"][0]
    true = reference.total_kinetic_energy(flown, x, values)
    assert abs(found - true) <= AGREEMENT * true


def test_what_motors_do_is_the_work_that_the_whole_energy_gains():
    # A motor spins up a wheel of a free body: E' = u (speed of the wheel).
    raw = variant(
        assembly(1, 3, moving=0, others=0, wheels=True), {"outputs.names": ["total_kinetic_energy"]}
    )
    wheel = next(name for name in scene(raw).wheels if scene(raw).wheel(name).inertia > 0.0)
    raw = variant(raw, {"outputs.names": ["total_kinetic_energy", f"{wheel}.speed"], "inputs.docked": []})
    for dock in raw["docks"]:
        dock["docked"] = True
    with flying(raw) as instance:
        assert instance.set({f"{wheel}.torque": 0.5}) == OK
        begin, h = instance.get("total_kinetic_energy"), 0.01
        speeds = [instance.get(f"{wheel}.speed")]
        for _ in range(100):
            assert instance.step(h) == OK
            speeds.append(instance.get(f"{wheel}.speed"))
        s = np.array(speeds)
        work = 0.5 * h / 3.0 * (s[0] + s[-1] + 4.0 * s[1::2].sum() + 2.0 * s[2:-1:2].sum())  # Simpson's rule
        gained = instance.get("total_kinetic_energy") - begin
        assert abs(gained - work) <= 1e-9 * abs(work) + 1e-12 * begin
