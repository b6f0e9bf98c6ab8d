"""The kinds of inputs that a scene may list, one row each, which all code about inputs reads.

A new kind whose effect follows from inputs alone needs its row here, its key in `schema.Inputs`, and its
equation: in `composite.bodies` if it shapes the composite, in `composite.actions` if it is a torque or a
force. A torque that depends on attitude or rate besides needs `rotation.dynamics` (its rate of change),
`rotation.steps` (how fast it grows), `twin.twin` (trim), and a word in the `suits` of propagators that cannot
have it; gravity's gradient, `rotation.gravity`, and jet damping, `composite.actions.jet_parts`, are such.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from supervessel.scene.schema import Scene

Part = Literal["shape", "contact", "action", "field"]
"""Use of an input: it shapes the composite, is the motion with which a part docks, acts on the body, or says
where the body is in a field of gravity."""

Change = Literal["mass", "pose", "docked", ""]
"""What changes with an input: masses and moments; poses and motion of ports; docks; "": none of these."""

Owner = Literal["vessel", "port", "dock", "point", "wheel", ""]
"""What the entries of a list in `[inputs]` name; "": the key is true or false and stands for the assembly."""

Judge = Literal["MASS", "PMI", "PORT", ""]
"""The check by which the FMU judges an owner's values together: CHECK_... of fmu_build/c/variable_table.h."""

Values = tuple[float, ...]


@dataclass(frozen=True)
class InputKind:
    """A kind of input.

    key         : key of `[inputs]`, whose list names the owners
    quantity    : last part of the variables' names, `mass` in `DG.mass`
    owner       : what an owner is
    elements    : 3 for a vector, whose variables carry an index from 1, as every force or torque on the
                  body is; 0 for a scalar
    unit        : as FMI writes it, "" for a pure number
    part        : its use
    change      : what changes with it; by it `schema.discrete_changes` tells the kinds that change at events
                  only because of what the scene's other changes keep
    description : text of a variable with places for {owner}, {vessel}, {axis} and, of a dock, for its ports
                  {first}, {second} and the first one's vessel {first_vessel}
    start       : scene, owner -> the scene's value, element by element
    lowest      : least possible value, None where all values are possible
    noun        : its name in an error text, "a mass"
    boolean     : whether it is true or false, 1 or 0 as a number
    discrete    : whether it changes at events only, in every scene: a dock opens and closes at an instant,
                  when the motion at contact is read
    directed    : whether it is a vector of which only the direction matters; it must then not be zero
    judge       : the check by which the FMU judges it; of an owner's vectors only the first one names it
    given_by    : key that the owner's table must have, "" for none
    within      : key of `[inputs]` whose list must name the owner too, "" for none
    """

    key: str
    quantity: str
    owner: Owner
    elements: int
    unit: str
    part: Part
    change: Change
    description: str
    start: Callable[["Scene", str], Values]
    lowest: float | None = None
    noun: str = "an input"
    boolean: bool = False
    discrete: bool = False
    directed: bool = False
    judge: Judge = ""
    given_by: str = ""
    within: str = ""

    def group(self, owner: str) -> str:
        """Returns the name of an owner's input, without the index of an element."""
        return f"{owner}.{self.quantity}" if owner else self.quantity

    def names(self, owner: str) -> list[str]:
        """Returns the names of an owner's variables, element by element."""
        group = self.group(owner)
        return [f"{group}[{i}]" for i in range(1, self.elements + 1)] or [group]

    def words(self, scene: "Scene", owner: str, axis: str) -> str:
        """Returns the description of an element of an owner's input."""
        first, second = scene.dock(owner).ports if self.owner == "dock" else ("", "")
        return self.description.format(
            owner=owner,
            vessel=vessel_of(owner),
            first=first,
            second=second,
            first_vessel=vessel_of(first),
            axis=axis,
        )

    def problem(self, values: Sequence[float]) -> str:
        """Returns why an input can never have these values, whatever the others are, or "" if it may.

        values : all elements, or some of them
        """
        if self.lowest is not None and min(values) < self.lowest:
            return "must not be negative" if self.lowest == 0.0 else f"must be at least {self.lowest}"
        if self.boolean and values[0] not in (0.0, 1.0):
            return "must be 0 or 1"
        if self.directed and len(values) == self.elements and not any(values):
            return "must be longer than 0"
        return ""


def vessel_of(name: str) -> str:
    """Returns "vessel" of "vessel.port", "vessel.point", "vessel.wheel" or "vessel"."""
    return name.partition(".")[0]


def part_of(name: str) -> tuple[str, str]:
    """Returns "vessel" and "part" of "vessel.part", the name of a port, a point or a wheel."""
    vessel, part = name.split(".")
    return vessel, part


def _zero(scene: "Scene", owner: str) -> Values:
    return (0.0, 0.0, 0.0)


def _mass(scene: "Scene", owner: str) -> Values:
    return (scene.vessels[owner].mass,)


def _pmi(scene: "Scene", owner: str) -> Values:
    pmi = scene.vessels[owner].pmi
    assert pmi is not None
    return pmi


def _docked(scene: "Scene", owner: str) -> Values:
    return (float(scene.dock(owner).docked),)


MASS = InputKind(
    "mass", "mass", "vessel", 0, "kg", "shape", "mass", "mass of {owner}", _mass, 0.0, "a mass", judge="MASS"
)
PMI = InputKind(
    "pmi",
    "pmi",
    "vessel",
    3,
    "m2",
    "shape",
    "mass",
    "mass-normalised moment of inertia of {owner} about its {axis} axis",
    _pmi,
    0.0,
    "a moment",
    judge="PMI",
    given_by="pmi",
)
POSITION = InputKind(
    "pose",
    "position",
    "port",
    3,
    "m",
    "shape",
    "pose",
    "position of docking port {owner}, {axis} in the axes of {vessel}",
    lambda scene, owner: scene.port(owner).position,
)
DIRECTION = InputKind(
    "pose",
    "direction",
    "port",
    3,
    "",
    "shape",
    "pose",
    "approach direction of docking port {owner}, outward, {axis} in the axes of {vessel}",
    lambda scene, owner: scene.port(owner).direction,
    directed=True,
    judge="PORT",
)
ALIGNMENT = InputKind(
    "pose",
    "alignment",
    "port",
    3,
    "",
    "shape",
    "pose",
    "alignment direction of docking port {owner}, {axis} in the axes of {vessel}",
    lambda scene, owner: scene.port(owner).alignment,
    directed=True,
)
PORT_VELOCITY = InputKind(
    "motion",
    "velocity",
    "port",
    3,
    "m/s",
    "shape",
    "pose",
    "rate of change of the position of docking port {owner}, {axis} in the axes of {vessel}",
    _zero,
    within="pose",
)
PORT_RATE = InputKind(
    "motion",
    "rate",
    "port",
    3,
    "rad/s",
    "shape",
    "pose",
    "angular velocity of docking port {owner}, {axis} in the axes of {vessel}",
    _zero,
    within="pose",
)
DOCKED = InputKind(
    "docked",
    "docked",
    "dock",
    0,
    "",
    "shape",
    "docked",
    "whether {first} and {second} are docked",
    _docked,
    boolean=True,
    discrete=True,
)
CONTACT_VELOCITY = InputKind(
    "docked",
    "velocity",
    "dock",
    3,
    "m/s",
    "contact",
    "",
    "velocity at contact, of {second} relative to {first}, {axis} in the axes of {first_vessel}",
    _zero,
    discrete=True,
)
CONTACT_RATE = InputKind(
    "docked",
    "rate",
    "dock",
    3,
    "rad/s",
    "contact",
    "",
    "angular velocity at contact, of {second} relative to {first}, {axis} in the axes of {first_vessel}",
    _zero,
    discrete=True,
)
TORQUE = InputKind(
    "torque",
    "torque",
    "",
    3,
    "N.m",
    "action",
    "",
    "external torque about the barycentre, {axis} in body axes",
    _zero,
)
WHEEL_TORQUE = InputKind(
    "wheel",
    "torque",
    "wheel",
    0,
    "N.m",
    "action",
    "",
    "motor torque on wheel {owner} along its axis; {vessel} gets the opposite",
    _zero,
)
FORCE = InputKind(
    "force",
    "force",
    "point",
    3,
    "N",
    "action",
    "",
    "external force at {owner}, {axis} in the axes of {vessel}",
    _zero,
)
VESSEL_TORQUE = InputKind(
    "vessel_torque",
    "torque",
    "vessel",
    3,
    "N.m",
    "action",
    "",
    "external torque on {owner}, {axis} in its axes",
    _zero,
)
FLOW = InputKind(
    "flow",
    "flow",
    "point",
    0,
    "kg/s",
    "action",
    "",
    "propellant that leaves {vessel} through {owner}; the mass of {vessel} is to fall by it",
    lambda scene, owner: (0.0,),
    0.0,
    "a flow",
)
GRAVITY_POSITION = InputKind(
    "gravity",
    "gravity.position",
    "",
    3,
    "m",
    "field",
    "",
    "position of the barycentre from the attracting centre, {axis} in inertial axes",
    lambda scene, owner: scene.gravity_start[0],
)
GRAVITY_VELOCITY = InputKind(
    "gravity",
    "gravity.velocity",
    "",
    3,
    "m/s",
    "field",
    "",
    "velocity of the barycentre relative to the attracting centre, {axis} in inertial axes",
    lambda scene, owner: scene.gravity_start[1],
)

BLOCKS: tuple[tuple[InputKind, ...], ...] = (
    (MASS,),
    (PMI,),
    (POSITION, DIRECTION, ALIGNMENT, PORT_VELOCITY, PORT_RATE),
    (DOCKED,),
    (CONTACT_VELOCITY, CONTACT_RATE),
    (TORQUE,),
    (WHEEL_TORQUE,),
    (FORCE,),
    (VESSEL_TORQUE,),
    (FLOW,),
    (GRAVITY_POSITION, GRAVITY_VELOCITY),
)
"""All kinds, in the order of the model description: shape, contact, action, field.

The inputs of an owner that stand in one block follow each other; the first kind of a block lists the owners.
"""


def kinds() -> Iterator[InputKind]:
    """Yields all kinds of inputs."""
    for block in BLOCKS:
        yield from block


def rows_by_key() -> dict[str, InputKind]:
    """Returns the first kind of each key of `[inputs]`, by key."""
    found: dict[str, InputKind] = {}
    for kind in kinds():
        found.setdefault(kind.key, kind)
    return found


def by_name(inputs: Mapping[str, Any]) -> dict[str, InputKind]:
    """Returns, by the name of a variable, its kind, for all inputs that the table `[inputs]` lists."""
    return {name: kind for kind, owner in listed(inputs) for name in kind.names(owner)}


def by_group(inputs: Mapping[str, Any]) -> dict[str, tuple[InputKind, list[str]]]:
    """Returns, by the name of an input without index, its kind and the names of its variables.

    inputs : the table `[inputs]`
    """
    return {kind.group(owner): (kind, kind.names(owner)) for kind, owner in listed(inputs)}


def acting(inputs: Mapping[str, Any]) -> bool:
    """Whether the table `[inputs]` asks for a torque or a force, gravity's included."""
    return any(kind.part in ("action", "field") for kind, _ in listed(inputs))


def listed(inputs: Mapping[str, Any]) -> Iterator[tuple[InputKind, str]]:
    """Yields kind and owner of each input that `[inputs]` asks for, in the order of the model description.

    inputs : the table by its keys, as in a file; a missing list is empty, an entry that is no name is skipped
    """
    for block in BLOCKS:
        owners = {kind.key: _owners(inputs, kind) for kind in block}
        for owner in owners[block[0].key]:
            for kind in block:
                if owner in owners[kind.key]:
                    yield kind, owner


def _owners(inputs: Mapping[str, Any], kind: InputKind) -> dict[str, None]:
    """Returns the owners of the inputs of a kind, in the order of the list, each once; "" is the assembly."""
    value = inputs.get(kind.key)
    if not kind.owner:
        return {"": None} if value is True else {}
    names = value if isinstance(value, list | tuple) else ()
    return dict.fromkeys(name for name in names if isinstance(name, str))
