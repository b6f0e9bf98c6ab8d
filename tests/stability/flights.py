"""Reference cases flown through real FMUs: one for each propagator and kind of body, of any inertia.

A diagonal body has 1 kg and its moments as inputs. A full tensor is put into the FMU's own saved state, where
what follows from a body's inertia stands in the order of `supervessel.equations`: the library then flies it
as if it had been built for it (`test_stability.py` compares with those that were).
"""

import ctypes
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from stability.truth import Case, attitude_error, rate_error
from supervessel.equations import composite_at_start, composite_slices
from support import DISCARD, OK, Array, Instance, U, scene, variant

TEMPLATE = [[3.0, 0.1, -0.2], [0.1, 4.0, 0.3], [-0.2, 0.3, 5.0]]
"""Any tensor none of whose elements is zero: what is constant is folded into the code."""


def single(vessel: dict[str, Any], propagator: str, **rotation: Any) -> dict[str, Any]:
    """Returns the raw scene of one vessel with torque inputs."""
    return {
        "name": f"stable_{propagator}",
        "root": "B",
        "vessels": {"B": {"mass": 1.0, **vessel}},
        "inputs": {"torque": True},
        "rotation": {"propagator": propagator, **rotation},
        "outputs": {"names": ["mass", "inertia", "angular_velocity", "attitude", "error_estimate"]},
    }


def any_diagonal(propagator: str) -> dict[str, Any]:
    """Returns the raw scene of a body of 1 kg whose moments are inputs."""
    return variant(single({"pmi": [1.0, 1.0, 1.0]}, propagator), {"inputs.pmi": ["B"]})


def any_tensor(propagator: str) -> dict[str, Any]:
    """Returns the raw scene whose FMU full tensors are put into; mass is an input: nothing is folded."""
    return variant(single({"inertia": TEMPLATE}, propagator), {"inputs.mass": ["B"]})


def one_tensor(propagator: str, inertia: Array) -> dict[str, Any]:
    """Returns the raw scene of a body with this tensor and no other."""
    return single({"inertia": inertia.tolist()}, propagator)


def _composite(raw: dict[str, Any]) -> bytes:
    """Returns what follows from the inertia of a scene's body as the FMU keeps it."""
    parts = composite_at_start(scene(raw))
    return np.concatenate([parts[name] for name in (*composite_slices(), "law")]).tobytes()


@cache
def _template() -> bytes:
    return _composite(any_tensor("rk4"))


@cache
def _built_for(tensor: str) -> bytes:
    return _composite(one_tensor("rk4", np.array(json.loads(tensor))))


@dataclass(frozen=True)
class End:
    """A flight's end, or its refusal.

    attitude, omega : (4,), (3,) [rad/s], the outputs
    state    : (7,), the state
    estimate : `error_estimate` [rad]
    refused  : what the FMU said, or None
    kept     : whether a refusal left every variable as it was
    """

    attitude: Array
    omega: Array
    state: Array
    estimate: float
    refused: str | None
    kept: bool


class Craft:
    """An FMU that bodies of one kind are flown with, one after the other."""

    def __init__(self, propagator: str, full: bool, raw: dict[str, Any] | None = None) -> None:
        """Builds it; raw: a scene of one tensor, which is not to be replaced."""
        self.own = raw is not None
        self.full = full
        self.raw = raw or (any_tensor if full else any_diagonal)(propagator)
        self.instance = Instance(self.raw)
        self.references = list(self.instance.references.values())

    def begin(self, case: Case, tolerance: float | None = None) -> None:
        """Initialises the body of a case; one with a negative span turns the other way."""
        it = self.instance
        assert it.reset() == OK
        it.log.clear()
        assert it._status(it.fmu.enterInitializationMode, tolerance=tolerance) == OK, it.log
        backwards = -1.0 if case.time < 0.0 else 1.0
        values = {
            "attitude_start": case.attitude,
            "angular_velocity_start": backwards * case.omega,
            "torque": case.torque,
        }
        if not self.full:
            values["B.pmi"] = np.diag(case.inertia)
        assert it.set(values) == OK, it.log
        assert it.exit() == OK, it.log
        if self.full and not self.own:
            self._put(case.inertia)
        assert it.get("inertia").tolist() == case.inertia.ravel().tolist()

    def _put(self, inertia: Array) -> None:
        """Puts a tensor into the instance by way of its saved state."""
        it = self.instance
        built_for, wanted = _template(), _built_for(json.dumps(inertia.tolist()))
        saved = it.fmu.getFMUState()
        size = len(it.fmu.serializeFMUState(saved)) - len(it.description.guid) - 24  # its header
        held = ctypes.string_at(saved, size)
        place = held.find(built_for)
        assert place > 0
        assert held.find(built_for, place + 1) == -1
        ctypes.memmove(saved.value + place, wanted, len(wanted))
        it.fmu.setFMUState(saved)
        it.fmu.freeFMUState(saved)

    def fly(self, case: Case, tolerance: float | None = None, parts: int = 1) -> End:
        """Flies a case in `parts` steps of its span."""
        self.begin(case, tolerance)
        it = self.instance
        refused, kept = None, True
        for _ in range(parts if case.time else 0):
            before = it.fmu.getFloat64(self.references)
            status = it.step(abs(case.time) / parts)
            if status != OK:
                assert status == DISCARD, it.log
                [refused] = it.messages()
                kept = [x.hex() for x in it.fmu.getFloat64(self.references)] == [x.hex() for x in before]
                break
        forwards = -1.0 if case.time < 0.0 else 1.0
        return End(
            it.get("attitude"),
            forwards * it.get("angular_velocity"),
            np.concatenate([it.get("state.attitude"), it.get("state.angular_velocity")]),
            it.get("error_estimate"),
            refused,
            kept,
        )


@cache
def craft(propagator: str, full: bool) -> Craft:
    """Returns the FMU for bodies of a kind, built once for each test process."""
    return Craft(propagator, full)


def errors(case: Case, end: End) -> tuple[float, float]:
    """Returns the errors of attitude [rad] and rate (relative)."""
    return attitude_error(case, end.attitude), rate_error(case, end.omega)


def units(case: Case, found: Sequence[float]) -> float:
    """Returns the larger of the two errors, each in units of u (1 + cond)."""
    attitude, rate = found
    return max(attitude / (U * (1.0 + case.cond_attitude)), rate / (U * (1.0 + case.cond_rate)))


def motion_units(case: Case, found: Sequence[float]) -> float:
    """Returns the same with what the motion alone makes of cond."""
    attitude, rate = found
    return max(attitude / (U * (1.0 + case.motion_attitude)), rate / (U * (1.0 + case.motion_rate)))


def length_off(q: Array) -> float:
    """Returns how far a quaternion's length is from 1, in u."""
    return abs(math.sqrt(math.fsum(x * x for x in q)) - 1.0) / U
