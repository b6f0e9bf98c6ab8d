"""Derivatives of the twin's steps by state, torque, time and inputs, where closed forms are awkward too."""

from typing import Any

import casadi as ca
import numpy as np
import pytest

from supervessel import Twin
from supervessel.twin.plant import GAP
from support import ISS_DG, body, scene, variant
from support.marks import some_at_once

H = 0.8  # s
STEPPED = 8  # steps of DOP853 that reach H to rounding
RATES = {
    "general": (0.3, 0.7, 0.5),
    "rest": (0.0, 0.0, 0.0),
    "about the first axis": (0.9, 0.0, 0.0),
    "about the middle axis": (0.0, 0.9, 0.0),
    "about the last axis": (0.0, 0.0, -0.9),
    "near the middle axis": (1e-9, 0.9, -1e-9),
}
EVERY_RATE = pytest.mark.parametrize("rates", some_at_once(RATES, "general", "rest", "near the middle axis"))
MOMENTS = {
    "asymmetric": (1.0, 1.2, 1.5),
    "prolate": (1.0, 1.5, 1.5),
    "oblate": (1.0, 1.0, 1.5),
    "spherical": (1.2, 1.2, 1.2),
}


def jacobians(twin: Twin, steps: int = 1) -> list[np.ndarray]:
    """Returns the derivatives of the state after H by x, u, p, h at the scene's start, by columns."""
    x = twin.x
    for _ in range(steps):
        x = twin.step(x, twin.u, twin.p, twin.h / steps)
    knowns = [twin.x, twin.u, twin.p, twin.h]
    function = ca.Function("jacobians", knowns, [ca.jacobian(x, known) for known in knowns])
    return [np.array(j) for j in function(twin.x_start, np.zeros(len(twin.u_names)), twin.p_start, H)]


def raw_body(pmi: Any, rates: Any, torque: bool = True) -> dict[str, Any]:
    raw = body(1000.0, pmi, angular_velocity=list(rates))
    return variant(raw, {"inputs": {"mass": ["B"], "torque": torque}})


@EVERY_RATE
@pytest.mark.parametrize("pmi", MOMENTS.values(), ids=MOMENTS)
def test_free_motion_has_the_derivatives_of_steps_by_state_and_time(pmi, rates):
    truth = jacobians(Twin(scene(raw_body(pmi, rates)), propagator="dop853"), STEPPED)
    found = jacobians(Twin(scene(raw_body(pmi, rates, torque=False)), propagator="exact"))
    # `exact` states 1e-12 at such points; DOP853 at 0.1 rad a step is at rounding
    assert np.abs(found[0] - truth[0]).max() <= 2e-12 * np.abs(truth[0]).max()
    assert np.abs(found[3] - truth[3]).max() <= 2e-12


@EVERY_RATE
@pytest.mark.parametrize("pmi", MOMENTS.values(), ids=MOMENTS)
@pytest.mark.parametrize("propagator", ["rk4", "dop853", "taylor", "split"])
def test_derivatives_by_torque_are_finite_and_those_of_small_torques(propagator, pmi, rates):
    twin = Twin(scene(raw_body(pmi, rates)), propagator=propagator)
    _, by_torque, _, _ = jacobians(twin)
    torque = 1e-3  # N m, on 1000 kg m2: the change is linear to 1e-6 of itself
    for i, column in enumerate(by_torque.T):
        u = np.eye(3)[i] * torque
        ends = [np.array(twin.step(twin.x_start, s * u, twin.p_start, H)).ravel() for s in (1.0, -1.0)]
        difference = (ends[0] - ends[1]) / (2.0 * torque)
        # Rounding of a state of about 1 over twice the torque, and of steps of some twenty roundings.
        assert np.abs(column - difference).max() <= 20 * 2.0**-52 / torque


def assembly(gap: float) -> dict[str, Any]:
    """Returns a nearly spherical vessel with a ship so light that it spoils the gap no more than slightly."""
    pmi = [1.0, 1.0 + gap, 1.0 + 2.0 * gap]
    changes = {
        "vessels.ISS.mass": 1000.0,
        "vessels.ISS.pmi": pmi,
        "vessels.ISS.ports.P2.position": [0.1, -0.2, 0.3],
        "vessels.DG.mass": 1e-3 * gap,
        "vessels.DG.ports.nose.position": [0.2, 0.3, -0.1],
        "inputs": {"mass": ["DG"], "pose": ["DG.nose"], "torque": False},
        "rotation": {"angular_velocity": [0.3, 0.7, 0.5]},
    }
    return variant(ISS_DG, changes)


@pytest.mark.parametrize("gap", [1e-1, 1e-3, 1e-5, 4e-8])
def test_derivatives_of_free_motion_by_inputs_lose_digits_as_stated(gap):
    truth = jacobians(Twin(scene(assembly(gap)), propagator="dop853"), STEPPED)[2]
    found = jacobians(Twin(scene(assembly(gap)), propagator="exact"))[2]
    size = np.abs(truth).max(axis=0)
    moved = size > 0.0
    error = np.abs(found - truth).max(axis=0)[moved] / size[moved]
    assert moved.sum() >= 7
    assert error.max() <= 8e-15 / gap  # the twin states "about 1e-15/gap"


@pytest.mark.parametrize("pmi", [(1.0, 1.0, 1.5), (1.0, 1.5, 1.5), (1.0, 1.0 + 0.5 * GAP, 1.5)])
def test_derivatives_of_free_motion_by_inputs_are_nan_where_axes_are_not_unique(pmi):
    raw = variant(raw_body(pmi, RATES["general"], torque=False), {"inputs.pmi": ["B"]})
    twin = Twin(scene(raw), propagator="exact")
    by_state, _, by_inputs, by_time = jacobians(twin)
    assert np.isnan(by_inputs[:, 1:]).any()
    assert np.isfinite(by_state).all()
    assert np.isfinite(by_time).all()
    assert np.isfinite(np.array(twin.step(twin.x_start, [], twin.p_start, H))).all()


@pytest.mark.parametrize("pmi", MOMENTS.values(), ids=MOMENTS)
def test_steps_that_need_no_axes_have_derivatives_by_inputs_everywhere(pmi):
    raw = variant(raw_body(pmi, RATES["general"], torque=False), {"inputs.pmi": ["B"]})
    twin = Twin(scene(raw), propagator="dop853")
    by_inputs = jacobians(twin)[2]
    for i, column in enumerate(by_inputs.T):
        p, change = twin.p_start, 1e-6 * abs(twin.p_start[i])
        ends = [
            np.array(twin.step(twin.x_start, [], p + s * change * np.eye(4)[i], H)).ravel() for s in (1, -1)
        ]
        # Third order of the difference, 1e-12, and some twenty roundings over the change.
        assert np.abs(column - (ends[0] - ends[1]) / (2.0 * change)).max() <= 20 * 2.0**-52 / change + 1e-11
