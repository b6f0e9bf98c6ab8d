"""The variables of a scene's model: the one table that the FMU, its C layer and the twin are made from."""

from collections.abc import Iterable
from dataclasses import dataclass

from supervessel.scene.inputs import InputKind, Part, listed, vessel_of
from supervessel.scene.outputs import (
    AXES,
    OUTPUTS,
    QUATERNION,
    WHEEL_OUTPUTS,
    OutputKind,
    output_kind,
)
from supervessel.scene.schema import Scene, discrete_changes, jumps, keeps_momentum


@dataclass(frozen=True)
class Variable:
    """A scalar of the model's interface.

    name      : structured, `DG.nose.position[1]`; elements of vectors and tensors carry indices from 1
    unit      : as FMI writes it, "" for a pure number
    start     : value at the start, None for what is calculated
    low, high : the range that the scene gives, else what is possible at all, None where all is
    group     : the name without its index
    element   : place in its group, from 0
    boolean   : whether it is true or false; its numbers are then 1 and 0
    discrete  : whether it is an input or an output that changes at events only
    jumps     : whether it is a state that an event can change
    """

    name: str
    unit: str
    description: str
    start: float | None = None
    low: float | None = None
    high: float | None = None
    group: str = ""
    element: int = 0
    boolean: bool = False
    discrete: bool = False
    jumps: bool = False


@dataclass(frozen=True)
class Parameter(Variable):
    """A parameter; its start value is the scene's."""

    start: float = 0.0


@dataclass(frozen=True, kw_only=True)
class InputVariable(Variable):
    """An input; its start value is the scene's.

    kind  : its row in the table of inputs
    owner : whom it belongs to, "DG", "DG.nose", a dock's name; "" for the whole assembly
    """

    start: float = 0.0
    kind: InputKind
    owner: str = ""

    @property
    def part(self) -> Part:
        """Whether it shapes the composite, is the motion with which a part docks, or acts."""
        return self.kind.part


@dataclass(frozen=True, kw_only=True)
class OutputVariable(Variable):
    """An output.

    kind  : its row in the table of outputs
    owner : the vessel or the wheel that it is of, "" for the whole
    """

    kind: OutputKind
    owner: str = ""


@dataclass(frozen=True, kw_only=True)
class StateVariable(Variable):
    """A state of model exchange.

    kind : the row, in the tables of outputs, of the quantity whose element it is
    """

    kind: OutputKind


RATE_UNITS = {"": "1/s", "rad/s": "rad/s2", "N.m.s": "N.m"}


def input_variables(scene: Scene) -> tuple[InputVariable, ...]:
    """Returns the inputs in the order of the model description: shape, contact, action."""
    ranges, at_events = scene.inputs.range, discrete_changes(scene)
    variables = []
    for kind, owner in listed(dict(scene.inputs)):
        group, start = kind.group(owner), kind.start(scene, owner)
        span = ranges.get(group, (kind.lowest, None))
        for i, name in enumerate(kind.names(owner)):
            low, high = ranges.get(name, span)
            text = kind.words(scene, owner, AXES[i])
            variables.append(
                InputVariable(
                    name,
                    kind.unit,
                    text,
                    start=start[i],
                    low=low,
                    high=high,
                    group=group,
                    element=i,
                    boolean=kind.boolean,
                    discrete=kind.discrete or kind.change in at_events,
                    kind=kind,
                    owner=owner,
                )
            )
    return tuple(variables)


def parameter_variables(scene: Scene) -> tuple[Parameter, ...]:
    """Returns the parameters: the state at the start, angular velocity, attitude, momenta of wheels."""
    rotation = scene.rotation
    rate, attitude = "angular_velocity_start", "attitude_start"
    rates = (
        Parameter(
            f"{rate}[{i + 1}]",
            "rad/s",
            f"angular velocity at the start, {AXES[i]} in body axes",
            value,
            group=rate,
            element=i,
        )
        for i, value in enumerate(rotation.angular_velocity)
    )
    components = (
        Parameter(
            f"{attitude}[{i + 1}]",
            "",
            f"attitude at the start, {QUATERNION[i]}; any length > 0",
            value,
            group=attitude,
            element=i,
        )
        for i, value in enumerate(rotation.attitude)
    )
    momenta = (
        Parameter(
            f"{name}.momentum_start",
            "N.m.s",
            f"momentum of wheel {name} at the start, along its axis",
            scene.wheel(name).momentum,
            group=f"{name}.momentum_start",
        )
        for name in scene.wheels
    )
    return (*rates, *components, *momenta)


def output_variables(scene: Scene) -> tuple[OutputVariable, ...]:
    """Returns the outputs that the scene lists, in its order, vectors and tensors element by element."""
    at_events = _changes_at_events(scene)
    return tuple(
        OutputVariable(
            name,
            kind.unit,
            _described(scene, kind, owner) + (f", {label}" if label else ""),
            group=group,
            element=i,
            discrete=kind.jump and at_events,
            kind=kind,
            owner=owner,
        )
        for group in scene.outputs.names
        for kind, owner in (output_kind(group),)
        for i, (name, label) in enumerate(kind.elements(group))
    )


def _described(scene: Scene, kind: OutputKind, owner: str) -> str:
    """Returns the description of an owner's output, without that of its elements."""
    first, second = scene.dock(owner).ports if kind.owner == "dock" else ("", "")
    return kind.description.format(owner=owner, first=first, second=second, first_vessel=vessel_of(first))


def _changes_at_events(scene: Scene) -> bool:
    """Whether what shapes the composite changes at events only, where there are events.

    In co-simulation only scenes with docks have event mode, in FMI 3.0. An importer that uses it may set what
    is continuous between events too.
    """
    shaping = (variable for variable in input_variables(scene) if variable.part == "shape")
    return not scene.inputs.docked or all(variable.discrete for variable in shaping)


def state_variables(scene: Scene) -> tuple[StateVariable, ...]:
    """Returns the states of model exchange: attitude (w, x, y, z), what changes keep, momenta of wheels.

    What changes keep is the angular velocity, or the angular momentum where every change keeps it; (x, y, z)
    in body axes.
    """
    attitude, kept = OUTPUTS["attitude"], OUTPUTS["angular_velocity"]
    words = kept.description
    if keeps_momentum(scene):
        kept, words = OUTPUTS["angular_momentum"], "angular momentum about the barycentre, body axes"
    body = (
        StateVariable(
            f"state.{kind.name}[{i + 1}]",
            kind.unit,
            f"state: {description}, {label}; it starts from the start parameters",
            group=f"state.{kind.name}",
            element=i,
            jumps=kind is kept and jumps(scene),
            kind=kind,
        )
        for kind, description, labels in ((attitude, attitude.description, QUATERNION), (kept, words, AXES))
        for i, label in enumerate(labels)
    )
    return (*body, *map(_wheel_state, scene.wheels))


def _wheel_state(name: str) -> StateVariable:
    """Returns the state of the wheel called "vessel.wheel": no change of inputs changes it."""
    kind = WHEEL_OUTPUTS["momentum"]
    words = f"state: {kind.description.format(owner=name)}; it starts from {name}.momentum_start"
    group = f"state.{name}.{kind.name}"
    return StateVariable(group, kind.unit, words, group=group, kind=kind)


def derivative_variables(states: Iterable[Variable]) -> tuple[Variable, ...]:
    """Returns the rates of the states."""
    return tuple(
        Variable(
            f"der({state.name})",
            RATE_UNITS[state.unit],
            f"rate of the state {_words(state)}",
            group=f"der({state.group})",
            element=state.element,
        )
        for state in states
    )


def _words(state: Variable) -> str:
    """Returns what a state is, in words."""
    name = state.group.removeprefix("state.")
    return (
        name
        if name == state.name.removeprefix("state.")
        else f"{name.replace('_', ' ')}, element {state.element + 1}"
    )
