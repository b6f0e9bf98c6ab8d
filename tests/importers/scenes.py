"""The six scenes that importers fly, and how every input of each moves.

Every input starts at the scene's own value, so that no change happens before the first step; from then on it
moves in each communication step. Docks open and close at three times.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from changes.scenes import MIR, TUG
from supervessel import Scene, parse_scene
from supervessel.scene.variables import InputVariable, input_variables
from support import BALL, ISS_DG, Array, variant
from support.costs import EXAMPLES, station
from support.scenes import ACCURACY_ASKED

STEP = 0.1  # s; 200 of them, added up in doubles, pass 20 s by 2e-14 s
COUNT = 200
TIMES: Array = STEP * np.arange(COUNT + 1)
DURATION = 20.0  # s
TIGHT = {"propagator": "dop853", "tolerance": 1e-12, "attitude": [3, 1, -2, 5]}


@dataclass(frozen=True)
class Course:
    """A scene and how far its inputs move.

    raw     : the scene
    moment  : of torques [N m]; each axis its own part of it
    push    : of forces [N]
    docked  : by name of a dock, the times [s] at which it opens or closes
    """

    raw: Mapping[str, Any]
    moment: float
    push: float = 0.0
    docked: Mapping[str, tuple[float, ...]] | None = None

    @cached_property
    def scene(self) -> Scene:
        """The scene as users have it: other tests' helper sets defaults of its own."""
        return parse_scene(self.raw)


def _courses() -> dict[str, Course]:
    example = tomllib.loads((EXAMPLES / "iss_dg.toml").read_text(encoding="utf-8"))
    names = {"outputs.names": ["mass", "inertia", "angular_velocity", "attitude"]}
    turning = {"rotation": {**TIGHT, "angular_velocity": [0.05, -0.08, 0.11]}}
    docks = {"docked": ["berth", "front"], "torque": True}
    arm = {"mass": ["tank"], "pose": ["tug.arm"], "motion": ["tug.arm"], "torque": True}
    arm_docks = [{"ports": ["tug.arm", "tank.end"], "name": "held"}]
    thrusters = {"rcs1": {"position": [0.0, 0.5, 6.0]}, "rcs2": {"position": [0.5, 0.0, -6.0]}}
    forces = {"mass": ["DG"], "force": ["DG.rcs1", "DG.rcs2"], "vessel_torque": ["DG"], "torque": True}
    given = {"rotation": {"angular_velocity": [0.02, 0.03, -0.01]}}
    return {
        "docks": Course(
            variant(MIR, {"name": "docks", **names, **turning, "inputs": docks}),
            moment=1e5,
            docked={"berth": (4.0, 9.0), "front": (13.0,)},
        ),
        "moving ports": Course(
            variant(TUG, {"name": "moving_ports", **names, **turning, "inputs": arm, "docks": arm_docks}),
            moment=50.0,
        ),
        "forces": Course(
            variant(
                ISS_DG,
                {"name": "forces", **names, **turning, "inputs": forces, "vessels.DG.points": thrusters},
            ),
            moment=1e5,
            push=3e3,
        ),
        "accuracy": Course(
            variant(
                tomllib.loads(BALL + ACCURACY_ASKED),
                {"name": "accuracy", **given, "accuracy.horizon": DURATION, "accuracy.step": STEP},
            ),
            moment=0.05,
        ),
        "100 vessels": Course(
            variant(station(100, [f"v{i}" for i in range(100)]), {"name": "vessels_100", **names, **turning}),
            moment=2e5,
        ),
        "ISS and ship": Course(example, moment=2e4),
    }


COURSES = _courses()


def inputs(course: Course) -> dict[str, Array]:
    """Returns what each input is at each communication point, (COUNT + 1,), by the FMU's names."""
    variables = input_variables(course.scene)
    return {v.name: _values(course, v, number) for number, v in enumerate(variables, 1)}


def booleans(course: Course) -> frozenset[str]:
    """Returns the names of the inputs that are Booleans."""
    return frozenset(v.name for v in input_variables(course.scene) if v.boolean)


def _values(course: Course, variable: InputVariable, number: int) -> Array:
    """Returns an input over time, (COUNT + 1,); its number tells apart inputs of one kind."""
    swing = np.sin((0.4 + 0.02 * (number % 17)) * TIMES)  # a turn and more
    start, quantity = variable.start, variable.kind.quantity
    if variable.boolean:
        switches = (course.docked or {}).get(variable.owner, ())
        turned = sum((time - STEP / 2 <= TIMES for time in switches), np.zeros(len(TIMES), int))
        return (start + turned) % 2.0
    if quantity in ("mass", "pmi"):
        return np.asarray(start * (1.0 - 0.4 * TIMES / DURATION) * (1.0 + 0.02 * swing))
    sizes = {"torque": course.moment, "force": course.push, "position": 0.5}
    return np.asarray(start + sizes.get(quantity, 0.05) * swing)
