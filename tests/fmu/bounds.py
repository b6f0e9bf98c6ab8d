"""Scenes that show `error_bound`, and what the bound is compared with: the twin's, the true motion."""

import json
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np

from changes.histories import ByReference, Values, elements
from changes.scenes import TUG
from supervessel import Twin
from support import Array, Instance, hamilton, scene, variant

MOTION = elements("tug.arm.velocity", (0.1, 0.0, 0.05)) | elements("tug.arm.rate", (0.0, 0.02, -0.01))
CONTACT = elements("stowed.velocity", (0.1, -0.2, 0.3)) | elements("stowed.rate", (0.2, 0.1, -0.1))


def showing(raw: Mapping[str, Any], **rotation: Any) -> dict[str, Any]:
    """Returns a raw scene that shows the bound, with keys of [rotation] changed."""
    outputs = ["angular_velocity", "attitude", "error_bound"]
    changes = {f"rotation.{key}": value for key, value in rotation.items()}
    return variant(raw, {"outputs.names": outputs, **changes})


def tug(law: str, propagator: str = "rk4", *, mass: str = "rate", pose: str = "momentum") -> dict[str, Any]:
    """Returns a tug with a tank that it loses and takes up again on an arm that moves, under a law.

    mass, pose : what changes of them keep; under "none" the rate always stays, and the truth alone keeps it
    """
    raw = showing(TUG, law=law, propagator=propagator, max_angle_step=0.2)
    raw["inputs"] |= {"pmi": ["tank"]} | ({} if law == "none" or pose == "rate" else {"motion": ["tug.arm"]})
    return variant(raw, {"rotation.mass_change": mass, "rotation.pose_change": pose})


@cache
def _twin(text: str) -> Twin:
    return Twin(scene(json.loads(text)))


def twin_of(raw: Mapping[str, Any]) -> Twin:
    """Returns the twin of a raw scene, made once."""
    return _twin(json.dumps(raw))


class TwinBound:
    """The bound of an FMU's flight by the twin's functions, from the states that the FMU passes through."""

    def __init__(self, raw: Mapping[str, Any]) -> None:
        self.twin = twin_of(raw)
        self.p, self.u = self.twin.p_start.copy(), np.zeros(len(self.twin.u_names))
        self.pending, self.bound = self.p.copy(), np.zeros(2)

    def set(self, inputs: Values) -> None:
        for name, value in inputs.items():
            acts = name in self.twin.u_names
            names, numbers = (self.twin.u_names, self.u) if acts else (self.twin.p_names, self.pending)
            numbers[names.index(name)] = value

    def change(self, before: Array) -> None:
        """Takes what was set for one change; before : x, (7,)."""
        found = self.twin.error_bound_change(before, self.bound, self.p, self.pending)
        self.bound, self.p = np.array(found).ravel(), self.pending.copy()

    def step(self, after_change: Array, h: float) -> None:
        found = self.twin.error_bound(after_change, self.bound, self.u, self.p, h)
        self.bound = np.array(found).ravel()


def state(instance: Instance) -> Array:
    """Returns attitude and angular velocity, (7,)."""
    return np.concatenate([instance.get("attitude"), instance.get("angular_velocity")])


def apart(q: Sequence[float], r: Sequence[float]) -> float:
    """Returns the angle [rad] between two attitudes, unit quaternions."""
    w, *v = hamilton([q[0], *(-x for x in q[1:])], list(r))
    return float(2.0 * np.arctan2(np.linalg.norm(v), abs(w)))


def truth_of(raw: Mapping[str, Any]) -> ByReference:
    """Returns the motion of the law "tensor" by the numpy reference and SciPy's DOP853, of the same scene."""
    kept = {"rotation.pose_change": raw["rotation"].get("pose_change", "momentum")}
    return ByReference(variant(raw, {"rotation.law": "tensor"} | kept))
