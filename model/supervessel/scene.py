"""The scene: vessels with their masses and ports, how they are docked, what may change, how it turns.

Every number is in SI units. The classes hold what a scene file says, checked one table at a time;
`supervessel.loading` reads files and checks what the tables say of each other.
"""

import math
from collections.abc import Iterable
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

from supervessel.problems import quantity
from supervessel.quantities import (
    Angle,
    AngularVelocity,
    Attitude,
    Bounds,
    Direction,
    Mass,
    Matrix,
    Pmi,
    Position,
    Seconds,
    Tensor,
    Tolerance,
    Vector,
)

ORIGIN: Vector = (0.0, 0.0, 0.0)

PARALLEL_LIMIT = 1e-6
"""Angle [rad] between alignment and +-direction below which a port has no usable alignment."""
PERPENDICULAR_LIMIT = 1e-3
"""Departure [rad] of alignment from the plane across direction that a scene file may have."""

OUTPUT_NAMES = (
    "mass",
    "barycentre",
    "pmi",
    "inertia",
    "angular_velocity",
    "attitude",
    "kinetic_energy",
    "angular_momentum",
)


class Table(BaseModel):
    """A table of a scene file: unknown keys are refused, values never change once read."""

    model_config = ConfigDict(extra="forbid", frozen=True, hide_input_in_errors=True)


def _refuse(problems: list[tuple[str, str]]) -> None:
    """Raises what a table's keys say of each other, as pairs (key, text), if there is any."""
    if problems:
        raise PydanticCustomError("table", "inconsistent", {"problems": problems})


def _text(value: object) -> object:
    if isinstance(value, str):
        return value
    raise ValueError(f" = {quantity(value)}: must be a name in quotes")


def _names(value: object) -> object:
    if isinstance(value, list | tuple) and all(isinstance(name, str) for name in value):
        return tuple(value)
    raise ValueError(f" = {quantity(value)}: must be a list of names in quotes")


def _flag(value: object) -> object:
    if isinstance(value, bool):
        return value
    raise ValueError(f" = {quantity(value)}: must be true or false")


def _one_of(*allowed: str) -> BeforeValidator:
    def check(value: object) -> object:
        if value in allowed:
            return value
        raise ValueError(f" = {quantity(value)}: must be one of {', '.join(allowed)}")

    return BeforeValidator(check)


Name = Annotated[str, BeforeValidator(_text)]
Names = Annotated[tuple[str, ...], BeforeValidator(_names)]
Flag = Annotated[bool, BeforeValidator(_flag)]
Law = Literal["none", "decoupled", "principal", "tensor"]
Propagator = Literal["auto", "rk4"]


class Port(Table):
    """A docking port: position [m], outward approach direction and alignment direction, vessel axes."""

    position: Position
    direction: Direction
    alignment: Direction

    @model_validator(mode="after")
    def _check_directions(self) -> Self:
        problems = [
            (key, f" = {quantity(value)}: must have a length greater than 0")
            for key, value in (("direction", self.direction), ("alignment", self.alignment))
            if not any(value)
        ]
        _refuse(problems)
        sine, cosine = _sine_cosine(self.direction, self.alignment)
        where = (
            f" = {quantity(self.alignment)}: must be perpendicular to direction = {quantity(self.direction)}"
        )
        if sine < PARALLEL_LIMIT:
            _refuse([("alignment", f"{where}, but is parallel to it within {PARALLEL_LIMIT:g} rad")])
        if abs(math.atan2(cosine, sine)) > PERPENDICULAR_LIMIT:
            off = abs(math.atan2(cosine, sine))
            _refuse(
                [("alignment", f"{where}, but is {off:.6g} rad off; at most {PERPENDICULAR_LIMIT:g} rad")]
            )
        return self


def _sine_cosine(a: Vector, b: Vector) -> tuple[float, float]:
    """Returns sine and cosine of the angle between two vectors of any length > 0."""
    a, b = (tuple(x / max(map(abs, v)) for x in v) for v in (a, b))  # type: ignore[assignment]
    cross = (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    length = math.hypot(*a) * math.hypot(*b)
    return math.hypot(*cross) / length, sum(x * y for x, y in zip(a, b, strict=True)) / length


class Vessel(Table):
    """A rigid part: mass [kg], moments about its centre of mass, centre of mass [m] in vessel axes, ports.

    Either `pmi`, three mass-normalised moments [m2] along the vessel axes, or `inertia`, the full
    tensor [kg m2] at the mass given, which scales with the mass when that is an input.
    """

    mass: Mass
    pmi: Pmi | None = None
    inertia: Tensor | None = None
    centre_of_mass: Position = ORIGIN
    ports: dict[str, Port] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _check_moments(self) -> Self:
        if self.pmi is None and self.inertia is None:
            _refuse([("pmi", ": missing; a vessel needs pmi [m2] or inertia [kg m2]")])
        if self.pmi is not None and self.inertia is not None:
            _refuse([("inertia", ": given beside pmi; a vessel takes one of the two")])
        if self.inertia is not None and self.mass == 0.0:
            _refuse([("mass", " = 0.0 kg: must be > 0 for a vessel given by inertia; inertia/mass is kept")])
        return self

    @property
    def specific_inertia(self) -> Matrix:
        """Inertia tensor over mass, (3, 3) [m2], about the centre of mass, vessel axes."""
        if self.pmi is not None:
            k1, k2, k3 = self.pmi
            return ((k1, 0.0, 0.0), (0.0, k2, 0.0), (0.0, 0.0, k3))
        assert self.inertia is not None
        return tuple(tuple(x / self.mass for x in row) for row in self.inertia)  # type: ignore[return-value]


class Dock(Table):
    """Two docking ports, "vessel.port" each, that are mated."""

    ports: Names


class Inputs(Table):
    """What may change while the scene runs; everything else is a constant."""

    mass: Names = ()
    pmi: Names = ()
    pose: Names = ()
    torque: Flag = False
    range: dict[str, Bounds] = Field(default_factory=dict)


class Rotation(Table):
    """The rotation law, how it is propagated, and the state at the start."""

    law: Annotated[Law, _one_of("none", "decoupled", "principal", "tensor")] = "tensor"
    propagator: Annotated[Propagator, _one_of("auto", "rk4")] = "auto"
    tolerance: Tolerance = 1e-9
    max_angle_step: Angle = 0.05
    angular_velocity: AngularVelocity = ORIGIN
    attitude: Attitude = (1.0, 0.0, 0.0, 0.0)


class Experiment(Table):
    """The default experiment: duration [s] and communication step [s]."""

    duration: Seconds
    step: Seconds

    @model_validator(mode="after")
    def _check_step(self) -> Self:
        if self.step > self.duration:
            _refuse([("step", f" = {self.step} s: must not exceed duration = {self.duration} s")])
        return self


class Outputs(Table):
    """The outputs that the FMU has."""

    names: Names = ("mass", "barycentre", "pmi", "angular_velocity", "attitude")


class Scene(Table):
    """A docked assembly. Made by `load_scene` or `parse_scene`, which check it as a whole."""

    name: Name
    root: Name
    vessels: dict[str, Vessel]
    docks: tuple[Dock, ...] = ()
    inputs: Inputs = Inputs()
    rotation: Rotation = Rotation()
    experiment: Experiment | None = None
    outputs: Outputs = Outputs()

    def port(self, name: str) -> Port:
        """Returns the port called "vessel.port". Raises KeyError if there is none."""
        vessel, port = name.split(".")
        return self.vessels[vessel].ports[port]


TABLES: dict[tuple[str, ...], type[Table]] = {
    (): Scene,
    ("vessels", "*"): Vessel,
    ("vessels", "*", "ports", "*"): Port,
    ("docks", "*"): Dock,
    ("inputs",): Inputs,
    ("rotation",): Rotation,
    ("experiment",): Experiment,
    ("outputs",): Outputs,
}
"""Which table stands at which place of a scene file; "*" is a name or a number."""


def known_keys(place: tuple[Any, ...]) -> list[str]:
    """Returns the keys of the table at `place`, [] where no table is known."""
    for pattern, table in TABLES.items():
        if len(pattern) == len(place) and all(p in ("*", q) for p, q in zip(pattern, place, strict=True)):
            return list(table.model_fields)
    return []


def input_groups(
    mass: Iterable[str], pmi: Iterable[str], pose: Iterable[str], torque: bool
) -> dict[str, int]:
    """Returns the inputs that the lists of `[inputs]` ask for: name without index -> elements (scalar: 0).

    The order is that of the FMU's model description; the twin's p is all but the torque.
    """
    groups = {f"{name}.mass": 0 for name in mass}
    groups |= {f"{name}.pmi": 3 for name in pmi}
    for name in pose:
        groups |= {f"{name}.{part}": 3 for part in ("position", "direction", "alignment")}
    return groups | ({"torque": 3} if torque else {})
