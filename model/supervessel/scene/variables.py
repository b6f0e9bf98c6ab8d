"""The variables of a scene's model: the one table that the FMU, its C layer and the twin are made from."""

from collections.abc import Iterable
from dataclasses import dataclass
from math import hypot, isfinite
from typing import Literal

import numpy as np

from supervessel import reference
from supervessel.scene.reuse import latest
from supervessel.scene.schema import VARIABLE_UNITS, Scene, input_groups, keeps_momentum


@dataclass(frozen=True)
class Variable:
    """A scalar of the model's interface.

    name  : structured, `DG.nose.position[1]`; elements of vectors and tensors carry indices from 1
    unit  : as FMI writes it, "" for a pure number
    start : value at the start, None for what is calculated
    low, high : the range that the scene gives, else what is possible at all, None where all is
    nominal : its magnitude, for an importer's solver
    """

    name: str
    unit: str
    description: str
    start: float | None = None
    low: float | None = None
    high: float | None = None
    nominal: float = 1.0

    @property
    def group(self) -> str:
        """The name without its index."""
        return self.name.partition("[")[0]

    @property
    def boolean(self) -> bool:
        """Whether it is true or false; its numbers are then 1 and 0."""
        return self.name.endswith(".docked")


Part = Literal["shape", "contact", "action"]


@dataclass(frozen=True)
class InputVariable(Variable):
    """An input, or a parameter; it always has a start value, the scene's.

    part : of an input: whether it shapes the composite, is the motion with which a part docks, or acts
    """

    start: float = 0.0
    part: Part = "shape"


AXES = ("x", "y", "z")
QUATERNION = ("w", "x", "y", "z")
NUMBERS = ("1", "2", "3")

OUTPUT_DESCRIPTIONS = {
    "mass": "total mass",
    "barycentre": "barycentre in the root vessel's axes, from its origin",
    "pmi": "diagonal of the inertia tensor over mass, body axes",
    "inertia": "inertia tensor about the barycentre, body axes",
    "angular_velocity": "angular velocity of the body relative to inertial space, body axes",
    "attitude": "unit quaternion from body to inertial axes",
    "kinetic_energy": "rotational kinetic energy",
    "angular_momentum": "angular momentum about the barycentre, inertial axes",
    "principal_moments": "principal moment of inertia about the barycentre, ascending",
    "principal_axes": "unit quaternion from principal to body axes, of the four that fit the one with the "
    "largest scalar part",
    "error_estimate": "estimated error of the attitude that the last communication step added",
    "net_force": "sum of the forces, body axes",
}

VESSEL_OUTPUT_DESCRIPTIONS = {
    "origin": "origin of {}, from the barycentre, body axes",
    "centre_of_mass": "centre of mass of {}, from the barycentre, body axes",
    "attitude": "unit quaternion from the axes of {} to body axes",
    "angular_velocity": "angular velocity of {} relative to inertial space, its own axes",
    "angular_momentum": "share of {} in the angular momentum about the barycentre, inertial axes",
}
"""Of outputs of a vessel; they are all zero while it is not docked to the root's part."""

RATE_UNITS = {"": "1/s", "rad/s": "rad/s2", "N.m.s": "N.m"}


@latest
def input_variables(scene: Scene) -> tuple[InputVariable, ...]:
    """Returns the inputs in the order of the model description: shape, contact, action."""
    inputs = scene.inputs
    variables = []
    for group, size in input_groups(dict(inputs)).items():
        owner, _, kind = group.rpartition(".")
        unit, part = VARIABLE_UNITS[kind], _part(scene, owner, kind)
        description, start = _input_description(scene, owner, kind), _start(scene, owner, kind)
        lowest = 0.0 if kind in ("mass", "pmi") else None
        span = inputs.range.get(group, (lowest, None))
        for i in range(size or 1):
            name = f"{group}[{i + 1}]" if size else group
            low, high = inputs.range.get(name, span)
            text = description.format(AXES[i]) if size else description
            variables.append(InputVariable(name, unit, text, start[i], low, high, part=part))
    return tuple(variables)


def _part(scene: Scene, owner: str, kind: str) -> Part:
    if kind in ("torque", "force"):
        return "action"
    return "contact" if kind in ("velocity", "rate") and owner in scene.inputs.docked else "shape"


def _start(scene: Scene, owner: str, kind: str) -> tuple[float, ...]:
    """Returns the scene's value of an input, element by element."""
    if kind in ("torque", "force", "velocity", "rate"):
        return (0.0, 0.0, 0.0)
    if kind == "docked":
        return (float(scene.dock(owner).docked),)
    if kind == "mass":
        return (scene.vessels[owner].mass,)
    value: tuple[float, ...] | None = (
        scene.vessels[owner].pmi if kind == "pmi" else getattr(scene.port(owner), kind)
    )
    assert value is not None
    return value


PORT_DESCRIPTIONS = {
    "position": "position of docking port {}",
    "direction": "approach direction of docking port {}, outward",
    "alignment": "alignment direction of docking port {}",
    "velocity": "rate of change of the position of docking port {}",
    "rate": "angular velocity of docking port {}",
    "force": "external force at {}",
}


def _input_description(scene: Scene, owner: str, kind: str) -> str:
    """Returns what an input is, {} where the axis of an element goes."""
    vessel = owner.partition(".")[0]
    if owner in scene.inputs.docked:
        first, second = scene.dock(owner).ports
        meeting = (
            f"at contact, of {second} relative to {first}, {{}} in the axes of {first.partition('.')[0]}"
        )
        return {
            "docked": f"whether {first} and {second} are docked",
            "velocity": f"velocity {meeting}",
            "rate": f"angular velocity {meeting}",
        }[kind]
    if kind in PORT_DESCRIPTIONS:
        return f"{PORT_DESCRIPTIONS[kind].format(owner)}, {{}} in the axes of {vessel}"
    return {
        "mass": f"mass of {owner}",
        "pmi": f"mass-normalised moment of inertia of {owner} about its {{}} axis",
        "torque": f"external torque on {owner}, {{}} in its axes"
        if owner
        else "external torque about the barycentre, {} in body axes",
    }[kind]


def parameter_variables(scene: Scene) -> tuple[InputVariable, ...]:
    """Returns the parameters: the state at the start, angular velocity first."""
    rotation = scene.rotation
    rates = (
        InputVariable(
            f"angular_velocity_start[{i + 1}]",
            "rad/s",
            f"angular velocity at the start, {AXES[i]} in body axes",
            value,
        )
        for i, value in enumerate(rotation.angular_velocity)
    )
    attitude = (
        InputVariable(
            f"attitude_start[{i + 1}]", "", f"attitude at the start, {QUATERNION[i]}; any length > 0", value
        )
        for i, value in enumerate(rotation.attitude)
    )
    return (*rates, *attitude)


def output_names(scene: Scene) -> tuple[str, ...]:
    """Returns the names of the outputs that the scene lists, in its order, element by element."""
    return tuple(name for group in scene.outputs.names for name, _ in _elements(group))


@latest
def output_variables(scene: Scene) -> tuple[Variable, ...]:
    """Returns the outputs that the scene lists, in its order, vectors and tensors element by element."""
    nominal = _output_nominals(scene)
    return tuple(
        Variable(
            name,
            VARIABLE_UNITS[group.rpartition(".")[2]],
            f"{_output_description(group)}{label}",
            nominal=_usable(nominal.get(group.rpartition(".")[2], 1.0)),
        )
        for group in scene.outputs.names
        for name, label in _elements(group)
    )


def _output_description(group: str) -> str:
    vessel, _, output = group.rpartition(".")
    return VESSEL_OUTPUT_DESCRIPTIONS[output].format(vessel) if vessel else OUTPUT_DESCRIPTIONS[group]


@latest
def _output_nominals(scene: Scene) -> dict[str, float]:
    """Returns magnitudes of outputs at the start."""
    whole = reference.composite(scene)
    moment, rate = float(np.trace(whole.inertia)) / 3.0, _rate(scene)
    return {
        "mass": whole.mass,
        "pmi": moment / whole.mass,
        "inertia": moment,
        "angular_velocity": rate,
        "kinetic_energy": 0.5 * moment * rate * rate,
        "angular_momentum": moment * rate,
        "principal_moments": moment,
    }


def _elements(group: str) -> Iterable[tuple[str, str]]:
    """Yields name and label of each element of an output."""
    if group in ("mass", "kinetic_energy", "error_estimate"):
        yield group, ""
    elif group == "inertia":
        for i, row in enumerate(AXES, start=1):
            for j, column in enumerate(AXES, start=1):
                yield f"inertia[{i},{j}]", f", {row}{column}"
    else:
        labels = {"attitude": QUATERNION, "principal_axes": QUATERNION, "principal_moments": NUMBERS}.get(
            group.rpartition(".")[2], AXES
        )
        for i, label in enumerate(labels, start=1):
            yield f"{group}[{i}]", f", {label}"


def state_variables(scene: Scene) -> tuple[Variable, ...]:
    """Returns the seven states of model exchange: attitude (w, x, y, z), then what changes keep.

    That is the angular velocity, or the angular momentum where every change keeps it; (x, y, z) in body axes.
    """
    kept = "angular_momentum" if keeps_momentum(scene) else "angular_velocity"
    descriptions = OUTPUT_DESCRIPTIONS | {
        "angular_momentum": "angular momentum about the barycentre, body axes"
    }
    nominals = {"attitude": 1.0, kept: _rate(scene)}
    if kept == "angular_momentum":
        nominals[kept] = _usable(_output_nominals(scene)[kept])
    return tuple(
        Variable(
            f"state.{group}[{i}]",
            VARIABLE_UNITS[group],
            f"state: {descriptions[group]}, {label}",
            nominal=nominals[group],
        )
        for group, labels in (("attitude", QUATERNION), (kept, AXES))
        for i, label in enumerate(labels, start=1)
    )


def derivative_variables(scene: Scene) -> tuple[Variable, ...]:
    """Returns the rates of the seven states."""
    return tuple(
        Variable(f"der({state.name})", RATE_UNITS[state.unit], f"rate of {state.name}")
        for state in state_variables(scene)
    )


def _usable(nominal: float) -> float:
    """Returns a magnitude, 1 where it would be none: zero or beyond all doubles."""
    return nominal if isfinite(nominal) and nominal > 0.0 else 1.0


def _rate(scene: Scene) -> float:
    """Returns the magnitude of the angular velocity [rad/s]: the scene's at the start, or 1 from rest."""
    return hypot(*scene.rotation.angular_velocity) or 1.0
