"""The kinds of outputs that a scene may list: one row each; `output_expressions` has the equation of each."""

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt
from typing import Literal

AXES = ("x", "y", "z")
QUATERNION = ("w", "x", "y", "z")
NUMBERS = ("1", "2", "3")
ROWS = tuple((i, j) for i in (1, 2, 3) for j in (1, 2, 3))


@dataclass(frozen=True)
class Magnitudes:
    """Magnitudes of the assembly at the start, of which nominals are made.

    mass   : [kg]
    moment : mean of the three moments of inertia [kg m2]
    rate   : length of the angular velocity [rad/s], 1 at rest
    stored : largest momentum of a wheel [N m s], 1 where all are 0
    spun   : largest speed of a wheel [rad/s] relative to its vessel at rest, 1 where all stand still
    """

    mass: float
    moment: float
    rate: float
    stored: float = 1.0
    spun: float = 1.0

    @property
    def size(self) -> float:
        """Root of moment over mass [m]."""
        return sqrt(self.moment / self.mass)


OutputOwner = Literal["", "vessel", "dock", "wheel", "point"]
"""Whose output it is: "" of the whole; a vessel, a dock, or a vessel's wheel or point."""


@dataclass(frozen=True)
class OutputKind:
    """A kind of output.

    name        : name of the output; in a scene the owner's name and a dot stand before it, "vessel.name",
                  "dock.name", "vessel.wheel.name", "vessel.point.name"
    unit        : as FMI writes it, "" for a pure number
    description : text of its variables with a place for {owner}, and of a dock for its ports {first} and
                  {second} and the first one's vessel {first_vessel}
    labels      : of its elements, whose variables carry an index from 1; none for a scalar
    owner       : whose it is
    accelerated : whether it follows from the accelerations of parts, which are not known where ports move
    matrix      : whether it is a (3, 3) matrix, row by row, whose variables carry two indices
    axes        : whether it shows principal moments or axes, which are computed only for such outputs
    of_step     : whether it is a result of a communication step; the twin, which takes none, leaves it out
    jump        : whether it tells what the last instant of change did; the twin, which knows no last one,
                  leaves it out
    nominal     : magnitudes of the assembly -> its magnitude, for an importer's solver
    """

    name: str
    unit: str
    description: str
    labels: tuple[str, ...] = AXES
    owner: OutputOwner = ""
    accelerated: bool = False
    matrix: bool = False
    axes: bool = False
    of_step: bool = False
    jump: bool = False
    nominal: Callable[[Magnitudes], float] = lambda whole: 1.0

    @property
    def of_history(self) -> bool:
        """Whether it does not follow from states and inputs as they are, so that the twin leaves it out."""
        return self.of_step or self.jump

    def elements(self, group: str) -> list[tuple[str, str]]:
        """Returns name and label of each variable of an output.

        group : the output's name as the scene lists it, "vessel.name" for one of a vessel
        """
        if self.matrix:
            return [(f"{group}[{i},{j}]", f"{AXES[i - 1]}{AXES[j - 1]}") for i, j in ROWS]
        return [(f"{group}[{i}]", label) for i, label in enumerate(self.labels, start=1)] or [(group, "")]


def _by_name(*kinds: OutputKind) -> dict[str, OutputKind]:
    return {kind.name: kind for kind in kinds}


OUTPUTS: dict[str, OutputKind] = _by_name(
    OutputKind("mass", "kg", "total mass", (), nominal=lambda whole: whole.mass),
    OutputKind("barycentre", "m", "barycentre in the root vessel's axes, from its origin"),
    OutputKind(
        "pmi",
        "m2",
        "diagonal of the inertia tensor over mass, body axes",
        nominal=lambda whole: whole.moment / whole.mass,
    ),
    OutputKind(
        "inertia",
        "kg.m2",
        "inertia tensor about the barycentre, body axes",
        matrix=True,
        nominal=lambda whole: whole.moment,
    ),
    OutputKind(
        "angular_velocity",
        "rad/s",
        "angular velocity of the body relative to inertial space, body axes",
        nominal=lambda whole: whole.rate,
    ),
    OutputKind("attitude", "", "unit quaternion from body to inertial axes", QUATERNION),
    OutputKind(
        "kinetic_energy",
        "J",
        "rotational kinetic energy",
        (),
        nominal=lambda whole: 0.5 * whole.moment * whole.rate * whole.rate,
    ),
    OutputKind(
        "total_kinetic_energy",
        "J",
        "kinetic energy relative to the barycentre, of parts that move and of wheels included",
        (),
        nominal=lambda whole: 0.5 * whole.moment * whole.rate * whole.rate,
    ),
    OutputKind(
        "angular_momentum",
        "N.m.s",
        "angular momentum about the barycentre, inertial axes",
        nominal=lambda whole: whole.moment * whole.rate,
    ),
    OutputKind(
        "principal_moments",
        "kg.m2",
        "principal moment of inertia about the barycentre, ascending",
        NUMBERS,
        axes=True,
        nominal=lambda whole: whole.moment,
    ),
    OutputKind(
        "principal_axes",
        "",
        "unit quaternion from principal to body axes, of the four that fit the one with the "
        "largest scalar part",
        QUATERNION,
        axes=True,
    ),
    OutputKind(
        "error_estimate",
        "rad",
        "estimated error of the attitude that the last communication step added",
        (),
        of_step=True,
    ),
    OutputKind(
        "error_bound",
        "rad",
        "in co-simulation: bound of the angle between the attitude and that of the law tensor with the "
        "same inputs since the start; pi says nothing",
        (),
        of_step=True,
    ),
    OutputKind("net_force", "N", "sum of the forces, body axes"),
    OutputKind(
        "barycentre_velocity",
        "m/s",
        "velocity of the barycentre relative to the root vessel's origin and axes, by ports that move",
    ),
    OutputKind(
        "barycentre_jump",
        "m",
        "jump of the barycentre at the last instant of change, inertial axes",
        jump=True,
    ),
    OutputKind(
        "barycentre_velocity_jump",
        "m/s",
        "jump of the barycentre's velocity at the last instant of change, inertial axes",
        jump=True,
    ),
)
"""Outputs of the whole, by name."""

VESSEL_OUTPUTS: dict[str, OutputKind] = _by_name(
    OutputKind("origin", "m", "origin of {owner}, from the barycentre, body axes", owner="vessel"),
    OutputKind(
        "centre_of_mass",
        "m",
        "centre of mass of {owner}, from the barycentre, body axes",
        owner="vessel",
    ),
    OutputKind(
        "attitude",
        "",
        "unit quaternion from the axes of {owner} to body axes",
        QUATERNION,
        owner="vessel",
    ),
    OutputKind(
        "angular_velocity",
        "rad/s",
        "angular velocity of {owner} relative to inertial space, its own axes",
        owner="vessel",
        nominal=lambda whole: whole.rate,
    ),
    OutputKind(
        "angular_momentum",
        "N.m.s",
        "share of {owner} in the angular momentum about the barycentre, inertial axes",
        owner="vessel",
        nominal=lambda whole: whole.moment * whole.rate,
    ),
    OutputKind(
        "velocity",
        "m/s",
        "velocity of the centre of mass of {owner} relative to the barycentre, inertial axes",
        owner="vessel",
    ),
)
"""Outputs of a vessel, by name, written "vessel.name" in a scene. All are zero while docks do not join the
vessel to the root."""

WHEEL_OUTPUTS: dict[str, OutputKind] = _by_name(
    OutputKind(
        "momentum",
        "N.m.s",
        "angular momentum of wheel {owner} along its axis, that of its vessel's rate included",
        (),
        owner="wheel",
        nominal=lambda whole: whole.stored,
    ),
    OutputKind(
        "speed",
        "rad/s",
        "angular velocity of wheel {owner} relative to its vessel",
        (),
        owner="wheel",
        nominal=lambda whole: whole.spun,
    ),
)
"""Outputs of a wheel, by name, written "vessel.wheel.name" in a scene. The speed is zero while docks do not
join the vessel to the root."""

POINT_OUTPUTS: dict[str, OutputKind] = _by_name(
    OutputKind(
        "position",
        "m",
        "{owner} from the barycentre, body axes",
        owner="point",
        nominal=lambda whole: whole.size,
    ),
    OutputKind(
        "velocity",
        "m/s",
        "velocity of {owner} relative to the barycentre, body axes",
        owner="point",
        nominal=lambda whole: whole.size * whole.rate,
    ),
    OutputKind(
        "acceleration",
        "m/s2",
        "acceleration of {owner} relative to the barycentre, body axes",
        owner="point",
        accelerated=True,
        nominal=lambda whole: whole.size * whole.rate**2,
    ),
    OutputKind(
        "specific_force",
        "m/s2",
        "acceleration of {owner} less that of gravity there, as an accelerometer reads it, body axes",
        owner="point",
        accelerated=True,
        nominal=lambda whole: whole.size * whole.rate**2,
    ),
)
"""Outputs of a point, by name, written "vessel.point.name" in a scene. Velocity and acceleration are relative
to axes that do not turn. All are zero while docks do not join the vessel to the root."""

DOCK_OUTPUTS: dict[str, OutputKind] = _by_name(
    OutputKind(
        "force",
        "N",
        "force on {second} from {first}, axes of {first_vessel}",
        owner="dock",
        accelerated=True,
        nominal=lambda whole: whole.mass * whole.size * whole.rate**2,
    ),
    OutputKind(
        "moment",
        "N.m",
        "moment on {second} from {first} about the port, axes of {first_vessel}",
        owner="dock",
        accelerated=True,
        nominal=lambda whole: whole.moment * whole.rate**2,
    ),
)
"""Outputs of a dock that has a name, written "dock.name" in a scene. Both are zero while the dock is open."""

OF_OWNER = (OUTPUTS, VESSEL_OUTPUTS | DOCK_OUTPUTS, WHEEL_OUTPUTS | POINT_OUTPUTS)
"""By the number of names that an owner's name is made of, its outputs: no two owners of as many names have an
output of the same name."""


def output_kind(group: str) -> tuple[OutputKind, str]:
    """Returns kind and owner of an output that a scene lists: "", "vessel", "dock", "vessel.wheel" or
    "vessel.point".

    Raises LookupError for an unknown name.
    """
    owner, _, name = group.rpartition(".")
    return OF_OWNER[len(owner.split(".")) if owner else 0][name], owner


def is_accelerated(group: str) -> bool:
    """Whether an output, written as in a scene, follows from accelerations; an unknown one does not."""
    try:
        return output_kind(group)[0].accelerated
    except LookupError:
        return False
