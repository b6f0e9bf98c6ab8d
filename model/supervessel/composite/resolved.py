"""What a scene means, found once: its variables, the rigid groups of its vessels, and how they hang together.

Everything that comes after reading a scene asks this value, and the scene itself only for the numbers that
stand in it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from supervessel.composite.constants import Places, constant_and_varying, lump, places
from supervessel.composite.docks import VesselGroup, Way, groups, ways
from supervessel.scene.inputs import Change
from supervessel.scene.outputs import OutputKind, output_kind
from supervessel.scene.reuse import reused
from supervessel.scene.schema import Scene
from supervessel.scene.variables import (
    InputVariable,
    OutputVariable,
    Parameter,
    StateVariable,
    Variable,
    derivative_variables,
    input_variables,
    output_variables,
    parameter_variables,
    state_variables,
)

Lump = tuple[float, NDArray[np.float64], NDArray[np.float64]]
"""Mass [kg], centre (3,) [m] and inertia (3, 3) [kg m2] of a body, in the axes of its group."""


@dataclass(frozen=True, eq=False)
class RigidGroup:
    """Vessels that never move relative to each other.

    reference : the vessel in whose axes the group is put together
    inside    : poses of its vessels in these axes, constants
    ways      : the ways by which the group may hang on the root
    fixed     : its vessels of constant mass and moments as one body, None where there are none
    varying   : its other vessels, in the order in which they are added up
    """

    reference: str
    inside: Places
    ways: tuple[Way, ...]
    fixed: Lump | None
    varying: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class ResolvedScene:
    """A scene with what follows from it; see `resolve`.

    Each of its properties is found when it is first asked for, and stays.
    """

    scene: Scene

    @cached_property
    def inputs(self) -> tuple[InputVariable, ...]:
        """The inputs in the order of the model description: what shapes the composite, contact, actions."""
        return input_variables(self.scene)

    @cached_property
    def shaping(self) -> tuple[InputVariable, ...]:
        """The inputs that shape the composite, p."""
        return tuple(variable for variable in self.inputs if variable.part == "shape")

    @cached_property
    def contact(self) -> tuple[InputVariable, ...]:
        """The inputs that are the motion with which parts dock, k."""
        return tuple(variable for variable in self.inputs if variable.part == "contact")

    @cached_property
    def acting(self) -> tuple[InputVariable, ...]:
        """The inputs that act, u."""
        return tuple(variable for variable in self.inputs if variable.part == "action")

    @cached_property
    def changes(self) -> frozenset[Change]:
        """The kinds of change that inputs can make."""
        return frozenset(variable.kind.change for variable in self.inputs) - {""}

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """The parameters: the state at the start."""
        return parameter_variables(self.scene)

    @cached_property
    def outputs(self) -> tuple[OutputVariable, ...]:
        """The outputs in the scene's order, element by element."""
        return output_variables(self.scene)

    @cached_property
    def output_kinds(self) -> tuple[tuple[OutputKind, str], ...]:
        """Kind and vessel, "" for the whole, of each output in the scene's order."""
        return tuple(output_kind(group) for group in self.scene.outputs.names)

    @cached_property
    def output_names(self) -> tuple[str, ...]:
        """Names of the outputs in the scene's order, element by element."""
        groups_of = zip(self.scene.outputs.names, self.output_kinds, strict=True)
        return tuple(name for group, (kind, _) in groups_of for name, _ in kind.elements(group))

    @cached_property
    def states(self) -> tuple[StateVariable, ...]:
        """The seven states of model exchange."""
        return state_variables(self.scene)

    @cached_property
    def derivatives(self) -> tuple[Variable, ...]:
        """The rates of the states."""
        return derivative_variables(self.states)

    @cached_property
    def vessels_shown(self) -> tuple[str, ...]:
        """The vessels that outputs are about, in the scene's order."""
        shown = {vessel for _, vessel in self.output_kinds}
        return tuple(vessel for vessel in self.scene.vessels if vessel in shown)

    @cached_property
    def groups(self) -> tuple[RigidGroup, ...]:
        """The rigid groups of vessels, the root's own first, in the order in which they hang on it.

        Raises TooManyWaysError.
        """
        graph = groups(self.scene)
        hanging, inside = ways(self.scene, graph), places(self.scene, graph)
        return tuple(map(self._group, graph, inside, hanging))

    @cached_property
    def home(self) -> Mapping[str, RigidGroup]:
        """The group of each vessel."""
        return {vessel: group for group in self.groups for vessel in group.inside}

    def _group(self, graph: VesselGroup, inside: Places, hanging: list[Way]) -> RigidGroup:
        constants, varying = constant_and_varying(self.scene, inside)
        fixed = lump(self.scene, {name: inside[name] for name in constants}) if constants else None
        return RigidGroup(graph.reference, inside, tuple(hanging), fixed, tuple(varying))


@reused
def resolve(scene: Scene) -> ResolvedScene:
    """Returns what a scene means; of the latest scene the same value again."""
    return ResolvedScene(scene)
