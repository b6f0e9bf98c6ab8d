"""A scene resolved once: its variables, the rigid groups of its vessels, and the docks between these groups.

Code that comes after the reading of a scene takes all this from here, and only numbers from the scene itself.
"""

from collections.abc import Mapping, Set
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from supervessel.composite.constants import Places, constant_and_varying, lump, places
from supervessel.composite.docks import Crossing, VesselGroup, Way, crossings, groups, ways
from supervessel.scene.inputs import Change
from supervessel.scene.outputs import OutputKind, OutputOwner, output_kind
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
"""Mass [kg], centre of mass (3,) [m] and inertia about it (3, 3) [kg m2] of a body, group axes."""


@dataclass(frozen=True, eq=False)
class RigidGroup:
    """Vessels that never move relative to each other.

    reference : the vessel whose axes are the group's axes
    inside    : by vessel, its pose in the group's axes, a constant
    ways      : the ways by which the group may hang on the root
    fixed     : its vessels of constant mass and moments as one body, None where there are none
    varying   : names of its other vessels, in the order of summation
    """

    reference: str
    inside: Places
    ways: tuple[Way, ...]
    fixed: Lump | None
    varying: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Side:
    """The vessels on one side of a dock.

    is_near : whether it is the root's side, else the one beyond the dock
    pieces  : by way to a group, its vessels on that side while the way holds the group
    """

    is_near: bool
    pieces: tuple[tuple[Way, frozenset[str]], ...]

    @property
    def vessels(self) -> frozenset[str]:
        """All that may be on that side."""
        return frozenset[str]().union(*(vessels for _, vessels in self.pieces))


@dataclass(frozen=True, eq=False)
class ResolvedScene:
    """A scene with all that follows from it before any equation; made by `resolve`.

    Each property is found at its first use and kept.
    """

    scene: Scene

    @cached_property
    def inputs(self) -> tuple[InputVariable, ...]:
        """All inputs in the order of the model description: `shaping`, `contact`, `acting`, `field`."""
        return input_variables(self.scene)

    @cached_property
    def shaping(self) -> tuple[InputVariable, ...]:
        """The inputs p that shape the composite: masses, moments, poses and motion of ports, docks."""
        return tuple(variable for variable in self.inputs if variable.part == "shape")

    @cached_property
    def contact(self) -> tuple[InputVariable, ...]:
        """The inputs k: the motion with which parts dock."""
        return tuple(variable for variable in self.inputs if variable.part == "contact")

    @cached_property
    def acting(self) -> tuple[InputVariable, ...]:
        """The inputs that act: torques and forces."""
        return tuple(variable for variable in self.inputs if variable.part == "action")

    @cached_property
    def field(self) -> tuple[InputVariable, ...]:
        """The inputs that say where the body is in a field of gravity: position, then velocity, or none."""
        return tuple(variable for variable in self.inputs if variable.part == "field")

    @cached_property
    def turning(self) -> tuple[InputVariable, ...]:
        """The inputs u that torques follow from: `acting`, then `field`."""
        return self.acting + self.field

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
        """Kind and owner, "" for the whole, of each output in the scene's order."""
        return tuple(output_kind(group) for group in self.scene.outputs.names)

    @cached_property
    def output_names(self) -> tuple[str, ...]:
        """Names of the outputs in the scene's order, element by element."""
        groups_of = zip(self.scene.outputs.names, self.output_kinds, strict=True)
        return tuple(name for group, (kind, _) in groups_of for name, _ in kind.elements(group))

    @cached_property
    def states(self) -> tuple[StateVariable, ...]:
        """The states of model exchange."""
        return state_variables(self.scene)

    @cached_property
    def derivatives(self) -> tuple[Variable, ...]:
        """The rates of the states."""
        return derivative_variables(self.states)

    @cached_property
    def vessels_shown(self) -> tuple[str, ...]:
        """The vessels that outputs are about, in the scene's order."""
        return tuple(vessel for vessel in self.scene.vessels if vessel in self._owners("vessel"))

    @cached_property
    def docks_shown(self) -> tuple[str, ...]:
        """The docks that outputs are about, in the scene's order."""
        shown = self._owners("dock")
        return tuple(dock.name for dock in self.scene.docks if dock.name is not None and dock.name in shown)

    @cached_property
    def points_shown(self) -> tuple[str, ...]:
        """The points "vessel.point" that outputs are about, in the order in which outputs name them first."""
        return tuple(self._owners("point"))

    @cached_property
    def shows_forces(self) -> bool:
        """Whether outputs follow from the sum of the forces."""
        return any(kind.name == "net_force" or kind.accelerated for kind, _ in self.output_kinds)

    def _owners(self, owner: OutputOwner) -> dict[str, None]:
        """Returns the names of the owners of that kind that have outputs, each once."""
        return dict.fromkeys(name for kind, name in self.output_kinds if kind.owner == owner)

    def may_leave(self, vessel: str) -> bool:
        """Whether docks that open can take a vessel off the root."""
        return all(way.docks for way in self.home[vessel].ways)

    @cached_property
    def leaving(self) -> tuple[str, ...]:
        """The vessels with outputs that docks can take off the root, in the scene's order."""
        return tuple(name for name in self.vessels_shown if self.may_leave(name))

    @cached_property
    def hands_over(self) -> bool:
        """Whether outputs show jumps of the barycentre, and any change makes one, or a vessel that leaves.

        Vessels that dock or undock make jumps, and masses that change where that keeps the angular velocity.
        """
        shows = any(kind.jump for kind, _ in self.output_kinds)
        jumps = bool(self.scene.inputs.docked) or self.scene.keeps.get("mass") == "rate"
        return bool(self.leaving) or (shows and jumps)

    @cached_property
    def shows_velocity(self) -> bool:
        """Whether an output follows from the velocity of the barycentre relative to the root vessel."""
        return self.hands_over or "barycentre_velocity" in self.scene.outputs.names

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
        """By vessel, its rigid group."""
        return {vessel: group for group in self.groups for vessel in group.inside}

    @cached_property
    def crossings(self) -> Mapping[str, tuple[Crossing, ...]]:
        """By dock that outputs are about, the ways that lead over it."""
        hanging = [group.ways for group in self.groups]
        return {
            name: tuple(crossings(self.scene, self.scene.dock(name), hanging)) for name in self.docks_shown
        }

    @cached_property
    def lighter(self) -> Mapping[str, Side]:
        """By dock that outputs are about, the side whose vessels its load is computed from.

        It is the lighter one, by the masses at the start. Where the sum over all vessels does not close,
        under another law than "tensor" or Orbiter's convention, it is that beyond the dock, seen from the
        root.
        """
        return {name: self._lighter_side(name) for name in self.docks_shown}

    def _lighter_side(self, dock: str) -> Side:
        far = tuple((crossing.way, crossing.vessels) for crossing in self.crossings[dock])
        by_way = dict(far)
        near = tuple(
            (way, rest)
            for group in self.groups
            for way in group.ways
            if (rest := frozenset(group.inside) - by_way.get(way, frozenset()))
        )
        beyond = Side(False, far).vessels
        masses = {name: vessel.mass for name, vessel in self.scene.vessels.items()}
        heavy = sum(masses[name] for name in beyond)
        closes = self.scene.rotation.law == "tensor" and self.scene.convention == "rigid_body"
        is_near = closes and sum(masses.values()) - heavy < heavy
        return Side(True, near) if is_near else Side(False, far)

    def part_of_group(self, number: int, vessels: Set[str]) -> RigidGroup:
        """Returns some vessels of a group as a group with its axes and ways."""
        group = self.groups[number]
        if vessels == group.inside.keys():
            return group
        inside = {name: pose for name, pose in group.inside.items() if name in vessels}
        return self._lumped(group.reference, inside, group.ways)

    def _group(self, graph: VesselGroup, inside: Places, hanging: list[Way]) -> RigidGroup:
        return self._lumped(graph.reference, inside, tuple(hanging))

    def _lumped(self, reference: str, inside: Places, hanging: tuple[Way, ...]) -> RigidGroup:
        constants, varying = constant_and_varying(self.scene, inside)
        fixed = lump(self.scene, {name: inside[name] for name in constants}) if constants else None
        return RigidGroup(reference, inside, hanging, fixed, tuple(varying))


@reused
def resolve(scene: Scene) -> ResolvedScene:
    """Returns a scene resolved; called again for the latest scene it returns the same value."""
    return ResolvedScene(scene)
