"""Scenes that are refused: cases of raw scenes with changes, and the words of their problems."""

from typing import Any

import pytest

from supervessel import SceneError, parse_scene
from support import ISS_DG, body, variant

NOSE = "vessels.DG.ports.nose"
PORT = {"position": [0.0, 0.0, 0.0], "direction": [1.0, 0.0, 0.0], "alignment": [0.0, 1.0, 0.0]}

NO_POSE = variant(ISS_DG, {"inputs.pose": []})
CUBE = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
DOCK = {"ports": ["ISS.P2", "DG.nose"]}

NUMBER = "must be a finite number >= 0"
THREE = "must be three finite numbers"
MOMENTS = "must be three finite numbers >= 0"
DIRECTION = "must be three finite numbers, a direction of any length > 0"
BOUNDS = "must be two finite numbers [low, high]"
KNOWN_LAWS = "must be one of none, decoupled, principal, tensor"
NO_BODY = "no rigid body has these moments"
ONE_PORT = 'must be a port, written "vessel.port"'
UNREACHED = "is not reached from the root ISS by docks"


def problems(raw: Any) -> list[str]:
    """Returns the problems that a scene is refused with."""
    with pytest.raises(SceneError) as caught:
        parse_scene(raw)
    return list(caught.value.problems)


def case(label: str, changes: dict[str, Any], *expected: str, base: dict[str, Any] = ISS_DG) -> Any:
    return pytest.param(base, changes, list(expected), id=label)


def shaped(label: str, inertia: Any, *expected: str, mass: float = 1000.0) -> Any:
    """A case of a single body given by a tensor."""
    changes = {"vessels.B.pmi": None, "vessels.B.inertia": inertia, "vessels.B.mass": mass}
    return case(label, changes, *expected, base=body())
