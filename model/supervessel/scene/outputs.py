"""The kinds of outputs that a scene may list: one row each; `output_expressions` has the equation of each."""

from collections.abc import Callable
from dataclasses import dataclass

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


@dataclass(frozen=True)
class OutputKind:
    """A kind of output.

    name        : name of the output; an output of a vessel is written "vessel.name" in a scene, one of a
                  wheel "vessel.wheel.name"
    unit        : as FMI writes it, "" for a pure number
    description : text of its variables with a place for {vessel}, or {wheel} as "vessel.wheel"
    labels      : of its elements, whose variables carry an index from 1; none for a scalar
    of_vessel   : whether it is an output of a vessel, else of the assembly
    matrix      : whether it is a (3, 3) matrix, row by row, whose variables carry two indices
    axes        : whether it shows principal moments or axes, which are computed only for such outputs
    of_step     : whether it is a result of a communication step; the twin, which takes none, leaves it out
    nominal     : magnitudes of the assembly -> its magnitude, for an importer's solver
    """

    name: str
    unit: str
    description: str
    labels: tuple[str, ...] = AXES
    of_vessel: bool = False
    matrix: bool = False
    axes: bool = False
    of_step: bool = False
    nominal: Callable[[Magnitudes], float] = lambda whole: 1.0

    def elements(self, group: str) -> list[tuple[str, str]]:
        """Returns name and label of each variable of an output.

        group : the output's name as the scene lists it, "vessel.name" for one of a vessel
        """
        if self.matrix:
            return [(f"{group}[{i},{j}]", f"{AXES[i - 1]}{AXES[j - 1]}") for i, j in ROWS]
        return [(f"{group}[{i}]", label) for i, label in enumerate(self.labels, start=1)] or [(group, "")]


OUTPUTS: dict[str, OutputKind] = {
    kind.name: kind
    for kind in (
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
    )
}
"""Outputs of the whole, by name."""

VESSEL_OUTPUTS: dict[str, OutputKind] = {
    kind.name: kind
    for kind in (
        OutputKind("origin", "m", "origin of {vessel}, from the barycentre, body axes", of_vessel=True),
        OutputKind(
            "centre_of_mass",
            "m",
            "centre of mass of {vessel}, from the barycentre, body axes",
            of_vessel=True,
        ),
        OutputKind(
            "attitude",
            "",
            "unit quaternion from the axes of {vessel} to body axes",
            QUATERNION,
            of_vessel=True,
        ),
        OutputKind(
            "angular_velocity",
            "rad/s",
            "angular velocity of {vessel} relative to inertial space, its own axes",
            of_vessel=True,
            nominal=lambda whole: whole.rate,
        ),
        OutputKind(
            "angular_momentum",
            "N.m.s",
            "share of {vessel} in the angular momentum about the barycentre, inertial axes",
            of_vessel=True,
            nominal=lambda whole: whole.moment * whole.rate,
        ),
    )
}
"""Outputs of a vessel, by name, written "vessel.name" in a scene. All are zero while docks do not join the
vessel to the root."""

WHEEL_OUTPUTS: dict[str, OutputKind] = {
    kind.name: kind
    for kind in (
        OutputKind(
            "momentum",
            "N.m.s",
            "angular momentum of wheel {wheel} along its axis, that of its vessel's rate included",
            (),
            nominal=lambda whole: whole.stored,
        ),
        OutputKind(
            "speed",
            "rad/s",
            "angular velocity of wheel {wheel} relative to its vessel",
            (),
            nominal=lambda whole: whole.spun,
        ),
    )
}
"""Outputs of a wheel, by name, written "vessel.wheel.name" in a scene. The speed is zero while docks do not
join the vessel to the root."""

OF_OWNER = (OUTPUTS, VESSEL_OUTPUTS, WHEEL_OUTPUTS)
"""By the number of names that an owner's name is made of, its outputs."""


def output_kind(group: str) -> tuple[OutputKind, str]:
    """Returns kind and owner of an output that a scene lists: "", "vessel" or "vessel.wheel".

    Raises KeyError for an unknown name.
    """
    owner, _, name = group.rpartition(".")
    return OF_OWNER[len(owner.split(".")) if owner else 0][name], owner
