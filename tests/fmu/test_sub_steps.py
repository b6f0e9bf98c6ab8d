"""Sub-steps of each propagator, as intermediate update of FMI 3.0 shows them."""

from collections.abc import Mapping
from ctypes import byref, c_bool, c_double
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from fmu.flights import FREE, TOLERANCE, TORQUE, WEAK_TORQUE, assembly, error, state
from support import NAN, OK, Array, Instance, body


class Listener(Instance):
    """An instance that records time and state at each intermediate update, and may end the step at `at`."""

    def __init__(self, raw: Mapping[str, Any], at: float | None = None) -> None:
        self.times: list[float] = []
        self.states: list[Array] = []
        self.at = at
        super().__init__(
            raw, earlyReturnAllowed=True, intermediateUpdate=self._updated, requiredIntermediateVariables=None
        )
        assert self.initialise() == OK

    def _updated(self, environment: Any, time: float, *rest: Any) -> None:
        *_, wanted, return_time = rest
        self.times.append(time)
        self.states.append(np.concatenate([self.get("attitude"), self.get("angular_velocity")]))
        if self.at is not None:
            wanted[0], return_time[0] = True, self.at

    def go(self, h: float) -> tuple[int, bool, float]:
        """Steps from the instance's time; returns status, early return and last successful time."""
        early, time, flags = c_bool(True), c_double(NAN), (byref(c_bool()), byref(c_bool()))
        call = self.fmu._functions["fmi3DoStep"]
        status = call(self.fmu.component, self.time, h, True, *flags, byref(early), byref(time))
        self.time = time.value
        return int(status), early.value, time.value


@pytest.mark.parametrize("propagator", FREE)
def test_free_motion_calls_once_a_step_however_long(propagator):
    listener = Listener(assembly(propagator))
    for end in (1.0, 1000.0):
        assert listener.go(end - listener.time) == (OK, False, end)
        assert listener.times[-1] == end
    assert len(listener.times) == 2
    listener.free()


@pytest.mark.parametrize("propagator", ["dop853", "taylor", "split"])
def test_controlled_steps_call_at_each_sub_step_with_the_states_there(propagator):
    torque = WEAK_TORQUE if propagator == "split" else TORQUE
    listener = Listener(assembly(propagator))
    x, J = state(listener), listener.get("inertia")
    assert listener.set({"torque": torque}) == OK
    assert listener.go(20.0) == (OK, False, 20.0)
    assert len(listener.times) > 2
    assert all(a < b for a, b in pairwise([0.0, *listener.times]))
    assert listener.times[-1] == 20.0
    some = np.linspace(0, len(listener.times) - 1, 3).astype(int)
    for i in some:
        off = error(listener.states[i], ("tensor", J), x, torque, listener.times[i])
        assert off.max() <= TOLERANCE
    listener.free()


@pytest.mark.parametrize("propagator", ["dop853", "taylor", "split"])
@pytest.mark.parametrize("at", [0.0, 7.3])
def test_controlled_steps_return_early_when_asked(propagator, at):
    torque = WEAK_TORQUE if propagator == "split" else TORQUE
    listener = Listener(assembly(propagator), at)
    x, J = state(listener), listener.get("inertia")
    assert listener.set({"torque": torque}) == OK
    status, early, time = listener.go(20.0)
    assert (status, early) == (OK, True)
    assert time == at or (at == 0.0 and time == listener.times[0] < 20.0)
    end = state(listener)
    assert error(end, ("tensor", J), x, torque, time).max() <= TOLERANCE
    listener.at = None
    assert listener.go(20.0 - time) == (OK, False, 20.0)
    assert error(state(listener), ("tensor", J), x, torque, 20.0).max() <= 2 * TOLERANCE
    listener.free()


@pytest.mark.parametrize("propagator", ["taylor", "auto"])
@pytest.mark.parametrize(
    ("tolerance", "reached", "most"), [(1e-5, 1e-6, 49), (1e-9, 1e-9, 63), (1e-12, 1e-12, 66)]
)
def test_constant_torque_takes_few_sub_steps(propagator, tolerance, reached, most):
    """36 rad in 40 s. The numbers are those measured, and a few more; `make bench` tells the time."""
    torque, span = (0.01, -0.02, 0.015), 40.0
    rates = [0.3, 0.7, 0.5]
    raw = body(1.0, (1.0, 2.0, 3.0), propagator=propagator, tolerance=tolerance, angular_velocity=rates)
    listener = Listener(raw)
    x, J = state(listener), listener.get("inertia")
    assert listener.set({"torque": torque}) == OK
    assert listener.go(span) == (OK, False, span)
    assert error(state(listener), ("tensor", J), x, torque, span).max() <= reached
    assert len(listener.times) <= most
    listener.free()
