"""Reset at any moment of an instance's life makes it fly like a new one."""

import numpy as np
import pytest

from fmu.programmes import SEED, SPINNING, alone, exchange, outputs, programme
from support import DISCARD, ERROR, ISS_DG, OK, Instance, draw_inputs, flying, refusal
from support.marks import FMI


def spoil(instance: Instance, moment: str) -> None:
    """Brings a fresh instance, inputs and parameters changed, to a moment of its life."""
    rates = {"angular_velocity_start": [1.0, 2.0, 3.0], "attitude_start": [0.0, 0.0, 5.0, 0.0]}
    instance.set(draw_inputs(np.random.default_rng(SEED)) | rates)
    if moment != "instantiated":
        assert instance.enter(start=17.0, stop=18.0) == OK
    if moment not in ("instantiated", "initialising"):
        assert instance.exit() == OK
        assert instance.step(0.5) == OK
    if moment == "with unusable inputs":
        assert instance.set({"DG.mass": -1.0}) == OK
        assert instance.step(0.1) == refusal(instance.fmi)
    if moment == "terminated":
        assert instance._status(instance.fmu.terminate) == OK
    if moment == "after an error":
        assert instance.step(-1.0) == ERROR


MOMENT = pytest.mark.parametrize(
    "moment",
    ["instantiated", "initialising", "stepping", "with unusable inputs", "terminated", "after an error"],
)


@MOMENT
@FMI
def test_reset_gives_the_first_run_again_bit_for_bit(fmi, moment):
    instance = Instance(ISS_DG, fmi)
    spoil(instance, moment)
    assert instance.reset() == OK
    again = list(programme(instance, SEED))
    instance.free()
    assert again == alone(fmi, SEED)


@MOMENT
@FMI
def test_reset_restores_every_start_value_and_time(fmi, moment):
    instance = Instance(SPINNING, fmi)
    spoil(instance, moment)
    assert instance.reset() == OK
    instance.enter()
    starts = {v.name: float(v.start) for v in instance.description.modelVariables if v.start is not None}
    assert {name: instance.get(name) for name in starts} == starts
    assert instance.get("time") == 0.0
    instance.free()


@MOMENT
@FMI
def test_reset_gives_the_outputs_of_a_new_instance(fmi, moment):
    instance = Instance(SPINNING, fmi)
    spoil(instance, moment)
    assert instance.reset() == OK
    assert instance.initialise() == OK
    with flying(SPINNING, fmi) as fresh:
        assert outputs(instance) == outputs(fresh)
    instance.free()


def spoil_exchange(instance: Instance, moment: str) -> None:
    """Brings a fresh instance of model exchange, everything changed that can be, to a moment of its life."""
    rates = {"angular_velocity_start": [1.0, 2.0, 3.0], "attitude_start": [0.0, 0.0, 5.0, 0.0]}
    instance.set(draw_inputs(np.random.default_rng(SEED)) | rates)
    if moment != "instantiated":
        assert instance.enter(start=17.0, stop=18.0) == OK
    if moment not in ("instantiated", "initialising"):
        assert instance.exit() == OK
    if moment not in ("instantiated", "initialising", "event"):
        assert instance.run() == OK
        assert instance._status(instance.fmu.setTime, 17.5) == OK
        assert instance.set({"state.attitude[2]": 0.25, "state.angular_velocity[3]": -7.0}) == OK
    if moment == "with unusable inputs":
        assert instance.set({"DG.mass": -1.0}) == OK
        assert instance.get_status("mass") == DISCARD
    if moment == "with an unusable attitude":
        assert instance.set({"state.attitude": [0.0, 0.0, 0.0, 0.0]}) == OK
        assert instance.get_status("attitude") == DISCARD
    if moment == "terminated":
        assert instance._status(instance.fmu.terminate) == OK
    if moment == "after an error":
        assert instance.set({"mass": 1.0}) == ERROR


@pytest.mark.parametrize(
    "moment",
    [
        "instantiated",
        "initialising",
        "event",
        "continuous",
        "with unusable inputs",
        "with an unusable attitude",
        "terminated",
        "after an error",
    ],
)
@FMI
def test_reset_of_model_exchange_gives_the_first_run_again_bit_for_bit(fmi, moment):
    instance, fresh = (Instance(SPINNING, fmi, exchange=True) for _ in range(2))
    spoil_exchange(instance, moment)
    assert instance.reset() == OK
    assert list(exchange(instance, SEED)) == list(exchange(fresh, SEED))
    assert [instance.reset(), fresh.reset()] == [OK, OK]
    assert [instance.enter(), fresh.enter()] == [OK, OK]
    everything = list(instance.references)
    assert [instance.get(name) for name in everything] == [fresh.get(name) for name in everything]
    instance.free()
    fresh.free()
