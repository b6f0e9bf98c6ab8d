"""The variables of a scene's model: the one table that the FMU, its C layer and the twin are made from."""

from collections.abc import Iterable
from dataclasses import dataclass

from supervessel.scene import Scene, input_groups


@dataclass(frozen=True)
class Variable:
    """A scalar of the model's interface.

    name  : structured, `DG.nose.position[1]`; elements of vectors and tensors carry indices from 1
    unit  : as FMI writes it, "" for a pure number
    start : value at the start, None for what is calculated
    low, high : the range that the scene gives, None where it gives none
    """

    name: str
    unit: str
    description: str
    start: float | None = None
    low: float | None = None
    high: float | None = None

    @property
    def group(self) -> str:
        """The name without its index."""
        return self.name.partition("[")[0]


@dataclass(frozen=True)
class InputVariable(Variable):
    """An input; it always has a start value, the scene's."""

    start: float = 0.0


UNITS = {
    "mass": "kg",
    "pmi": "m2",
    "position": "m",
    "direction": "",
    "alignment": "",
    "torque": "N.m",
    "barycentre": "m",
    "inertia": "kg.m2",
    "angular_velocity": "rad/s",
    "attitude": "",
    "kinetic_energy": "J",
    "angular_momentum": "N.m.s",
}

AXES = ("x", "y", "z")
QUATERNION = ("w", "x", "y", "z")

OUTPUT_DESCRIPTIONS = {
    "mass": "total mass",
    "barycentre": "barycentre in the root vessel's axes, from its origin",
    "pmi": "diagonal of the inertia tensor over mass, body axes",
    "inertia": "inertia tensor about the barycentre, body axes",
    "angular_velocity": "angular velocity of the body relative to inertial space, body axes",
    "attitude": "unit quaternion from body to inertial axes",
    "kinetic_energy": "rotational kinetic energy",
    "angular_momentum": "angular momentum about the barycentre, inertial axes",
}

STATE_SIZES = {"attitude": 4, "angular_velocity": 3}


def input_variables(scene: Scene) -> tuple[InputVariable, ...]:
    """Returns the inputs in the order of the model description: masses, PMI, poses, then the torque."""
    inputs = scene.inputs
    variables = []
    for group, size in input_groups(inputs.mass, inputs.pmi, inputs.pose, inputs.torque).items():
        owner, _, kind = group.rpartition(".")
        for index in range(1, size + 1) if size else (0,):
            name = f"{group}[{index}]" if index else group
            low, high = inputs.range.get(name, inputs.range.get(group, (None, None)))
            start = _start(scene, owner, kind, index)
            description = _input_description(owner, kind, index)
            variables.append(InputVariable(name, UNITS[kind], description, start, low, high))
    return tuple(variables)


def _start(scene: Scene, owner: str, kind: str, index: int) -> float:
    """Returns the scene's value of an input; `index` counts from 1, 0 for a scalar."""
    if kind == "torque":
        return 0.0
    if kind == "mass":
        return scene.vessels[owner].mass
    if kind == "pmi":
        pmi = scene.vessels[owner].pmi
        assert pmi is not None
        return pmi[index - 1]
    value: tuple[float, ...] = getattr(scene.port(owner), kind)
    return value[index - 1]


def _input_description(owner: str, kind: str, index: int) -> str:
    axis = AXES[index - 1]
    vessel = owner.partition(".")[0]
    return {
        "mass": f"mass of {owner}",
        "pmi": f"mass-normalised moment of inertia of {owner} about its {axis} axis",
        "position": f"position of docking port {owner}, {axis} in the axes of {vessel}",
        "direction": f"approach direction of docking port {owner}, outward, {axis} in the axes of {vessel}",
        "alignment": f"alignment direction of docking port {owner}, {axis} in the axes of {vessel}",
        "torque": f"external torque about the barycentre, {axis} in body axes",
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


def output_variables(scene: Scene) -> tuple[Variable, ...]:
    """Returns the outputs that the scene lists, in its order, vectors and tensors element by element."""
    return tuple(
        Variable(name, UNITS[group], f"{OUTPUT_DESCRIPTIONS[group]}{label}")
        for group in scene.outputs.names
        for name, label in _elements(group)
    )


def _elements(group: str) -> Iterable[tuple[str, str]]:
    """Yields name and label of each element of an output."""
    if group in ("mass", "kinetic_energy"):
        yield group, ""
    elif group == "inertia":
        for i, row in enumerate(AXES, start=1):
            for j, column in enumerate(AXES, start=1):
                yield f"inertia[{i},{j}]", f", {row}{column}"
    else:
        labels = QUATERNION if group == "attitude" else AXES
        for i, label in enumerate(labels, start=1):
            yield f"{group}[{i}]", f", {label}"


def state_names() -> tuple[str, ...]:
    """Returns the names of the seven states: attitude (w, x, y, z), then angular velocity."""
    return tuple(f"state.{group}[{i}]" for group, size in STATE_SIZES.items() for i in range(1, size + 1))
