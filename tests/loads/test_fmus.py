"""Loads and points as FMUs show them: every pair of unknown and known, in orbit, in both versions of FMI."""

from typing import Any

import numpy as np
import pytest

from changes.pairs import everywhere
from changes.scenes import TUG
from fmu.listeners import Listener, outputs
from loads.scenes import NEAR, dumbbell, shown
from supervessel.orbit import two_body
from supervessel.scene.outputs import DOCK_OUTPUTS, POINT_OUTPUTS
from support import DISCARD, ERROR, OK, Instance, U, refusal, scene, variant
from support.marks import FMI_3_AT_ONCE, some_at_once

WHEEL = {"x": {"axis": [1.0, 2.0, 0.5], "inertia": 3.0, "momentum": 40.0}}
POINTS = {"imu": {"position": [0.4, -0.3, 0.2]}, "jet": {"position": [-1.0, 0.5, 0.0]}}
SHOWN = [f"{dock}.{kind}" for dock in ("held", "stowed") for kind in DOCK_OUTPUTS]
SHOWN += [f"tank.imu.{kind}" for kind in POINT_OUTPUTS]

LADEN: dict[str, Any] = variant(
    TUG,
    {
        "name": "laden",
        "vessels.tank.points": POINTS,
        "vessels.tank.wheels": WHEEL,
        "inputs.mass": ["tug", "tank"],
        "inputs.pmi": ["tank"],
        "inputs.force": ["tank.jet"],
        "inputs.vessel_torque": ["tank"],
        "inputs.wheel": ["tank.x"],
        "inputs.gravity": True,
        "gravity": NEAR,
        "rotation.mass_change": "rate",
        "rotation.pose_change": "rate",
        "outputs.names": [*SHOWN, "attitude"],
    },
)


@FMI_3_AT_ONCE
def test_derivatives_are_differences_of_what_is_read_and_all_that_counts_is_declared(fmi):
    problems = everywhere(LADEN, fmi).problems
    assert [text for text in problems if "must be 0 while docks do not hold" not in text] == []  # the motor


# In a field of gravity


ORBITING = variant(
    dumbbell((300.0, 500.0), (4.0, 2.5), propagator="taylor", tolerance=1e-14),
    {
        "inputs": {"gravity": True, "torque": True},
        "gravity": NEAR,
        "rotation.angular_velocity": [0.1, -0.2, 0.3],
    },
)
H, TORQUE = 0.25, [3.0, -2.0, 1.0]


def differs(instance: Instance, position: Any, torque: Any = None) -> float:
    """Returns how far the loads are from the twin's with the barycentre at a place, relative."""
    x = np.append(instance.get("attitude"), instance.get("angular_velocity"))
    values = {f"gravity.position[{i}]": float(p) for i, p in enumerate(position, start=1)}
    values |= {f"torque[{i}]": t for i, t in enumerate(torque or TORQUE, start=1)}
    true = shown(scene(ORBITING), x, values)
    return max(
        np.abs(instance.get(f"bar.{kind}") - true[f"bar.{kind}"]).max() / np.abs(true[f"bar.{kind}"]).max()
        for kind in DOCK_OUTPUTS
    )


@pytest.mark.parametrize("propagator", some_at_once(["taylor", "dop853", "rk4"], "taylor"))
@FMI_3_AT_ONCE
def test_after_a_step_the_place_is_that_of_its_end_until_one_is_set(fmi, propagator):
    raw = variant(ORBITING, {"rotation.propagator": propagator, "rotation.max_angle_step": 0.002})
    instance, start = Instance(raw, fmi, optimised=False), NEAR["position"]
    assert instance.initialise(torque=TORQUE) == OK
    assert differs(instance, start) <= 64 * U
    place, turned = two_body(start, NEAR["velocity"], NEAR["mu"], [H])[0][0], [-t for t in TORQUE]
    for _ in range(2):
        assert instance.step(H) == OK, instance.log
        assert differs(instance, place) <= 1e-11  # the method's own error of the place
        assert differs(instance, start) > 1e-3
        assert instance.set({"torque": turned}) == OK
        assert differs(instance, place, turned) <= 1e-11
        assert instance.set({"torque": TORQUE}) == OK
        assert instance.set({"gravity.position": start}) == OK  # what it was: the place is said anew
        assert differs(instance, start) <= 64 * U
    instance.free()


def test_a_saved_state_holds_the_place_and_a_refused_step_leaves_it():
    instance = Instance(ORBITING, optimised=False)
    assert instance.initialise(torque=TORQUE) == OK
    assert instance.step(H) == OK
    force, state = instance.get("bar.force").tolist(), instance.fmu.getFMUState()
    assert instance.step(1e9) == DISCARD
    assert instance.get("bar.force").tolist() == force
    assert instance.set({"gravity.position": [100.0, 0.0, 0.0]}) == OK
    assert instance.get("bar.force").tolist() != force
    instance.fmu.setFMUState(state)
    assert instance.get("bar.force").tolist() == force
    instance.fmu.freeFMUState(state)
    assert instance.reset() == OK
    assert instance.initialise(torque=TORQUE) == OK
    assert differs(instance, NEAR["position"]) <= 64 * U
    instance.free()


def test_an_error_within_a_step_leaves_what_was_read_there():
    def wrong(listener: Listener, *rest: Any) -> None:
        if len(listener.times) == 2:
            assert listener._status(listener.fmu.terminate) == ERROR  # not to be called within a step

    listener = Listener(variant(ORBITING, {"rotation.tolerance": 1e-9}), wrong)
    assert listener.set({"torque": TORQUE}) == OK
    status, *_ = listener.fly(5.0)
    assert (status, len(listener.times)) == (ERROR, 2)
    found = outputs(listener)
    assert found == listener.read[-1][1:]
    state = listener.fmu.getFMUState()
    listener.fmu.setFMUState(state)
    assert outputs(listener) == found
    listener.fmu.freeFMUState(state)
    listener.free()


def test_the_rate_of_a_load_counts_the_motion_of_the_place():
    instance, h = Instance(ORBITING, optimised=False), 1e-3
    assert instance.initialise(torque=TORQUE) == OK
    assert instance.step(H) == OK
    references = [instance.references[f"bar.{kind}[{i}]"] for kind in DOCK_OUTPUTS for i in (1, 2, 3)]
    rate = np.array(instance.fmu.getOutputDerivatives(references, [1] * 6))
    loads = [np.append(instance.get("bar.force"), instance.get("bar.moment"))]
    for begin in (H, H + h):
        place, velocity = two_body(NEAR["position"], NEAR["velocity"], NEAR["mu"], [begin])
        assert instance.set({"gravity.position": place[0], "gravity.velocity": velocity[0]}) == OK
        assert instance.step(h) == OK
        loads.append(np.append(instance.get("bar.force"), instance.get("bar.moment")))
    difference = (4 * loads[1] - 3 * loads[0] - loads[2]) / (2 * h)
    assert np.abs(rate - difference).max() <= 1e-5 * np.abs(difference).max()
    instance.free()


@pytest.mark.parametrize("place", [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1e200, 0.0, 0.0]])
@pytest.mark.parametrize("fmi", [3, 2])
def test_a_load_with_the_centre_where_it_cannot_be_is_refused_and_nothing_else(fmi, place):
    instance = Instance(variant(ORBITING, {"outputs.names": ["bar.force", "mass"]}), fmi, optimised=False)
    assert instance.initialise() == OK
    assert instance.set({"gravity.position": place}) == OK
    assert instance.get("mass") == 800.0
    assert instance.get_status("bar.force") == refusal(fmi)
    assert "gravity.position = " in instance.log[-1][2]
    assert instance.set({"gravity.position": NEAR["position"]}) == OK
    assert np.all(np.isfinite(instance.get("bar.force")))
    instance.free()
