"""The tables of a scene file: vessels with masses and ports, docks, inputs, rotation, experiment, outputs.

Every number is in SI units. Each class is a table and checks its own values; `supervessel.loading` reads
files and checks the tables against each other.
"""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, get_args

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ModelWrapValidatorHandler,
    PrivateAttr,
    model_validator,
)

from supervessel.problems import quantity
from supervessel.rotation.propagators import PROPAGATORS
from supervessel.scene.inputs import part_of
from supervessel.scene.mending import mend_note, mended_values
from supervessel.scene.numbers import (
    Angle,
    AngularVelocity,
    Attitude,
    AttitudeError,
    Bounds,
    Course,
    Direction,
    Mass,
    Matrix,
    Moments,
    Mu,
    Pmi,
    Position,
    RateError,
    Seconds,
    Tensor,
    Tolerance,
    Vector,
    Velocity,
    WheelInertia,
    WheelMomentum,
)
from supervessel.scene.sheets import about_centre, as_published, tensor_from_moments

ORIGIN: Vector = (0.0, 0.0, 0.0)

PARALLEL_LIMIT = 1e-6
"""Angle [rad] between alignment and +-direction below which a port has no usable alignment."""
PERPENDICULAR_LIMIT = 1e-3
"""Departure [rad] of alignment from the plane across direction that a scene file may have."""

MOST_STEPS = 1_000_000
"""Most communication steps of an experiment: each moving input takes eight bytes a step."""


LONGEST_SAID = 200
"""Most characters of what a scene says of itself as a model: importers show it in a line."""


class Table(BaseModel):
    """A table of a scene file: unknown keys are refused, values never change once read."""

    model_config = ConfigDict(extra="forbid", frozen=True, hide_input_in_errors=True)


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


def _said(value: object) -> object:
    if isinstance(value, str) and value.strip() and len(value) <= LONGEST_SAID and value.isprintable():
        return value
    raise ValueError(
        f" = {quantity(value)}: must be a line of 1 to {LONGEST_SAID} printable characters in quotes"
    )


def _one_of(*allowed: str) -> BeforeValidator:
    def check(value: object) -> object:
        if value in allowed:
            return value
        raise ValueError(f" = {quantity(value)}: must be one of {', '.join(allowed)}")

    return BeforeValidator(check)


Name = Annotated[str, BeforeValidator(_text)]
Names = Annotated[tuple[str, ...], BeforeValidator(_names)]
Flag = Annotated[bool, BeforeValidator(_flag)]
Said = Annotated[str, BeforeValidator(_said)]
Convention = Literal["rigid_body", "orbiter"]
About = Literal["centre_of_mass", "origin"]
Law = Literal["none", "decoupled", "principal", "tensor"]
Kept = Literal["rate", "momentum"]
PROPAGATOR_NAMES = ("auto", *PROPAGATORS)


class Port(Table):
    """A docking port: position [m], outward approach direction and alignment direction, vessel axes."""

    position: Position
    direction: Direction
    alignment: Direction


class Point(Table):
    """A point where a force acts: position [m], vessel axes."""

    position: Position


class Wheel(Table):
    """A wheel, or a gyroscope of which only the momentum counts.

    axis     : its direction, vessel axes, of any length > 0
    inertia  : I_w about the axis [kg m2]; its mass and its moments are part of the vessel's own. With 0 it is
               a store of momentum along the axis and nothing else: three of them are a cluster of gyroscopes
    momentum : along the axis at the start [N m s], that of the body's own rate included:
               I_w (wheel speed + axis . angular velocity of the vessel)
    """

    axis: Direction
    inertia: WheelInertia = 0.0
    momentum: WheelMomentum = 0.0


class Vessel(Table):
    """A rigid part: mass [kg], moments about its centre of mass, centre of mass [m] in vessel axes, ports.

    Its moments are one of three: `pmi`, three mass-normalised moments [m2] along the vessel axes; `inertia`,
    the full tensor [kg m2] or its diagonal; `moments` [kg m2] with `products`, the integrals of x y, y z, z x
    over mass [kg m2]. The last two are at the mass given and scale with the mass when that is an input.
    The tensor is taken about the vessel's centre of mass, in vessel axes: its diagonal elements are the
    integrals of y^2 + z^2, z^2 + x^2, x^2 + y^2 over mass, its off-diagonal elements MINUS the integrals of
    x y, x z, y z. With `inertia_about` "origin" inertia, or moments and products, are about the origin of the
    vessel axes, at the mass given. With `mend` published, rounded numbers that no body can have are moved by
    no more than the rounding of their last digits, and the fields are those that a body can have; see
    `published`. See model/docs/equations.md, "What an inertia is".
    """

    mass: Mass
    pmi: Pmi | None = None
    inertia: Tensor | None = None
    moments: Moments | None = None
    products: Moments | None = None
    inertia_about: Annotated[About, _one_of(*get_args(About))] = "centre_of_mass"
    mend: Flag = False
    centre_of_mass: Position = ORIGIN
    ports: dict[str, Port] = Field(default_factory=dict)
    points: dict[str, Point] = Field(default_factory=dict)
    wheels: dict[str, Wheel] = Field(default_factory=dict)
    _published: dict[str, Any] = PrivateAttr(default_factory=dict)

    @model_validator(mode="wrap")
    @classmethod
    def _mended(cls, raw: Any, read: ModelWrapValidatorHandler["Vessel"]) -> "Vessel":
        moved = mended_values(raw) if isinstance(raw, Mapping) else {}
        vessel = read({**raw, **moved} if moved else raw)
        vessel._published.update({key: as_published(raw[key]) for key in moved})
        return vessel

    @property
    def published(self) -> Mapping[str, Any]:
        """By key, the numbers of the scene file that `mend` has moved; empty where it has moved none."""
        return self._published

    @property
    def tensor(self) -> Matrix | None:
        """Inertia tensor at the mass given, (3, 3) [kg m2], about the centre of mass; None with `pmi`."""
        given = self.inertia
        if self.moments is not None:
            given = tensor_from_moments(self.moments, self.products)
        if given is not None and self.inertia_about == "origin":
            return about_centre(given, self.mass, self.centre_of_mass)
        return given

    @property
    def specific_inertia(self) -> Matrix:
        """Inertia tensor over mass, (3, 3) [m2], about the centre of mass, vessel axes."""
        if self.pmi is not None:
            k1, k2, k3 = self.pmi
            return ((k1, 0.0, 0.0), (0.0, k2, 0.0), (0.0, 0.0, k3))
        tensor = self.tensor
        assert tensor is not None
        return tuple(tuple(x / self.mass for x in row) for row in tensor)  # type: ignore[return-value]


class Dock(Table):
    """Two docking ports, "vessel.port" each, that are mated: always, or while `docked` is true.

    A dock listed in `inputs.docked` needs a `name`; `docked` is then its value at the start.
    """

    ports: Names
    name: Name | None = None
    docked: Flag = True


class Mount(Table):
    """A vessel, the child, that is fixed to another one, the parent, without ports.

    position : of the origin of the child's axes, in the parent's [m]
    attitude : q_parent_child, (w, x, y, z): takes components in the child's axes to those in the parent's;
               normalised when read
    """

    parent: Name
    child: Name
    position: Position
    attitude: Attitude = (1.0, 0.0, 0.0, 0.0)


class Inputs(Table):
    """What may change while the scene runs; everything else is a constant.

    mass, pmi     : vessels
    pose          : docked ports, "vessel.port"
    motion        : ports listed in `pose` whose velocity and rate are inputs too
    docked        : docks, by name
    torque        : whether there is a torque about the barycentre
    wheel         : wheels with a motor, "vessel.wheel"
    force         : points, "vessel.point"
    vessel_torque : vessels
    flow          : points through which propellant leaves, "vessel.point", of vessels listed in `mass`
    gravity       : whether the gradient of gravity turns the body, of the centre in `[gravity]`
    range         : lowest and highest value by an input's name, with or without index, in the input's unit
    """

    mass: Names = ()
    pmi: Names = ()
    pose: Names = ()
    motion: Names = ()
    docked: Names = ()
    torque: Flag = False
    wheel: Names = ()
    force: Names = ()
    vessel_torque: Names = ()
    flow: Names = ()
    gravity: Flag = False
    range: dict[str, Bounds] = Field(default_factory=dict)


class Gravity(Table):
    """A centre whose gravity attracts the body as a mass point would.

    mu       : gravitational parameter [m3/s2]
    position : of the barycentre from the centre [m], inertial axes, at the start
    velocity : of the barycentre relative to the centre [m/s], inertial axes, at the start
    Where `[experiment.orbit]` has both they are not given here.
    """

    mu: Mu
    position: Position | None = None
    velocity: Velocity | None = None


class Rotation(Table):
    """The rotation law, how it is propagated, what changes keep, and the state at the start.

    law              : see model/docs/equations.md, "Rotation: the four laws"
    propagator       : see model/docs/scene.md, "Propagators"
    tolerance        : of a controlled error over a communication step: attitude [rad], rate relative
    max_angle_step   : largest angle that the body turns in a sub-step of rk4 [rad]
    mass_change      : what a change of masses or moments keeps, the angular velocity or the angular momentum
    pose_change      : what a change of poses keeps; see `Scene.keeps` for the default
    angular_velocity : at the start, (3,) [rad/s], body axes
    attitude         : q_inertial_body at the start, (w, x, y, z), normalised when read
    """

    law: Annotated[Law, _one_of(*get_args(Law))] = "tensor"
    propagator: Annotated[str, _one_of(*PROPAGATOR_NAMES)] = "auto"
    tolerance: Tolerance = 1e-9
    max_angle_step: Angle = 0.05
    mass_change: Annotated[Kept, _one_of(*get_args(Kept))] = "rate"
    pose_change: Annotated[Kept, _one_of(*get_args(Kept))] | None = None
    angular_velocity: AngularVelocity = ORIGIN
    attitude: Attitude = (1.0, 0.0, 0.0, 0.0)


class Orbit(Table):
    """Two-body motion about the centre in `[gravity]`, from position and velocity at time 0 of an experiment.

    position : of the barycentre from the centre [m], inertial axes
    velocity : of the barycentre relative to the centre [m/s], inertial axes
    """

    position: Position
    velocity: Velocity


class Experiment(Table):
    """The default experiment: duration [s], communication step [s]; what `supervessel trade` flies.

    orbit  : what the inputs of gravity follow from; None: they do as any other input
    inputs : by the name of an input, rows of time [s] and value. Between rows the value is linear, before the
             first and after the last row it is held, and where two rows have the same time it jumps; a dock's
             values are true and false. Inputs that are not named keep the scene's values.
    """

    duration: Seconds
    step: Seconds
    orbit: Orbit | None = None
    inputs: dict[str, Course] = Field(default_factory=dict)


class Accuracy(Table):
    """How exact the motion shall be; law, propagator and its setting are then chosen.

    attitude    : largest error of the attitude [rad]
    rate        : largest error of the angular velocity [rad/s]; None: any
    horizon     : time from the start until which they hold [s]
    step        : communication step [s]
    error_bound : whether the output error_bound watches the flight where the accuracy is not proven
    """

    attitude: AttitudeError
    rate: RateError | None = None
    horizon: Seconds
    step: Seconds
    error_bound: Flag = True


class Outputs(Table):
    """The outputs that the FMU has."""

    names: Names = ("mass", "barycentre", "pmi", "angular_velocity", "attitude")


class Scene(Table):
    """A docked assembly. Made by `load_scene` or `parse_scene`, which check it as a whole.

    Description, version, author, copyright and license are what the FMU says of itself as a model, word for
    word; None: nothing, of the description a line that names vessels and law.
    Under the convention "orbiter" the composite is that of the Orbiter simulator, for comparison: moments
    that no rigid body has are taken by the absolute values of [CV] eqs. (3-5), but for a root that nothing is
    joined to, and of the composite's tensor the diagonal alone is kept.

    Example:
        >>> scene.vessels["DG"].mass
        24500.0
    """

    name: Name
    description: Said | None = None
    version: Said | None = None
    author: Said | None = None
    copyright: Said | None = None
    license: Said | None = None
    root: Name
    convention: Annotated[Convention, _one_of(*get_args(Convention))] = "rigid_body"
    vessels: dict[str, Vessel]
    docks: tuple[Dock, ...] = ()
    mounts: tuple[Mount, ...] = ()
    inputs: Inputs = Inputs()
    gravity: Gravity | None = None
    rotation: Rotation = Rotation()
    accuracy: Accuracy | None = None
    experiment: Experiment | None = None
    outputs: Outputs = Outputs()

    def port(self, name: str) -> Port:
        """Returns the port called "vessel.port". Raises KeyError if there is none.

        Example:
            >>> scene.port("DG.nose").direction
            (0.0, 0.0, -1.0)
        """
        vessel, port = part_of(name)
        return self.vessels[vessel].ports[port]

    def point(self, name: str) -> Point:
        """Returns the point called "vessel.point". Raises KeyError if there is none.

        Example:
            >>> scene.point("DG.thruster")
            Traceback (most recent call last):
            KeyError: 'thruster'
        """
        vessel, point = part_of(name)
        return self.vessels[vessel].points[point]

    def wheel(self, name: str) -> Wheel:
        """Returns the wheel called "vessel.wheel". Raises KeyError if there is none.

        Example:
            >>> scene.wheel("DG.pitch")
            Traceback (most recent call last):
            KeyError: 'pitch'
        """
        vessel, wheel = part_of(name)
        return self.vessels[vessel].wheels[wheel]

    @property
    def wheels(self) -> tuple[str, ...]:
        """Names "vessel.wheel" of all wheels, in the scene's order: that of their momenta among the states.

        Example:
            >>> scene.wheels
            ()
        """
        return tuple(f"{name}.{wheel}" for name, vessel in self.vessels.items() for wheel in vessel.wheels)

    @property
    def notes(self) -> tuple[str, ...]:
        """What the reading of the scene has changed in its numbers, a line each: what `mend` has moved.

        Example:
            >>> scene.notes
            ()
        """
        moved = {name: vessel for name, vessel in self.vessels.items() if vessel.published}
        raw = {name: vessel.model_dump(exclude_unset=True) for name, vessel in moved.items()}
        return tuple(
            f"vessels.{name}{mend_note({**raw[name], **vessel.published}, raw[name])}"
            for name, vessel in moved.items()
        )

    def dock(self, name: str) -> Dock:
        """Returns the dock of that name. Raises KeyError if there is none.

        Example:
            >>> scene.dock("berth")
            Traceback (most recent call last):
            KeyError: 'berth'
        """
        for dock in self.docks:
            if dock.name == name:
                return dock
        raise KeyError(name)

    @property
    def gravity_start(self) -> tuple[Vector, Vector]:
        """Position [m] and velocity [m/s] of the barycentre from the attracting centre at the start.

        Both in inertial axes. Raises ValueError for a scene without `inputs.gravity`.

        Example:
            >>> scene.gravity_start
            Traceback (most recent call last):
            ValueError: scene "iss_dg" has no gravity
        """
        given = self.experiment.orbit if self.experiment and self.experiment.orbit else self.gravity
        if given is None or given.position is None or given.velocity is None:
            raise ValueError(f'scene "{self.name}" has no gravity')
        return given.position, given.velocity

    @property
    def is_chosen(self) -> bool:
        """Whether law and propagator are known: as given, or as `[accuracy]` has been answered.

        Example:
            >>> scene.is_chosen
            True
        """
        return self.accuracy is None or "law" in self.rotation.model_fields_set

    @property
    def keeps(self) -> dict[str, Kept]:
        """What a change keeps, for the kinds of change that inputs can make: "mass" (and moments), "pose".

        A pose keeps momentum unless the scene says otherwise; the law "none" keeps the angular velocity
        always.

        Example:
            >>> scene.keeps
            {'mass': 'rate', 'pose': 'momentum'}
        """
        inputs, rotation = self.inputs, self.rotation
        kinds: dict[str, Kept] = {}
        if inputs.mass or inputs.pmi:
            kinds["mass"] = rotation.mass_change
        if inputs.pose:
            kinds["pose"] = rotation.pose_change or "momentum"
        return dict.fromkeys(kinds, "rate") if rotation.law == "none" else kinds


def keeps_momentum(scene: Scene) -> bool:
    """Whether every change that inputs can make keeps momentum: it is then the state of model exchange."""
    return set(scene.keeps.values()) == {"momentum"}


SAID = ("description", "version", "author", "copyright", "license")
"""Keys of a scene that tell of the model and change no number."""

CHOSEN = ("law", "propagator", "tolerance", "max_angle_step")
"""Keys of `[rotation]` that are chosen where a scene has `[accuracy]`."""


def without_accuracy(scene: Scene) -> Scene:
    """Returns the scene without `[accuracy]`: with the law that it has, or by default."""
    return scene.model_copy(update={"accuracy": None})


def changes_rate(scene: Scene) -> bool:
    """Whether a change of inputs can change the angular velocity."""
    changing = "momentum" in scene.keeps.values() or bool(scene.inputs.docked)
    return changing and scene.rotation.law != "none"


def discrete_changes(scene: Scene) -> frozenset[str]:
    """Returns the kinds of change that inputs make at events only, because of what other changes keep.

    Where some changes keep the angular velocity and others the momentum, the state of model exchange is the
    angular velocity. What keeps the momentum would change it all the time, by a rate that follows from the
    inputs' own rates, and these are not told.
    """
    if keeps_momentum(scene) or not changes_rate(scene):
        return frozenset()
    return frozenset(change for change, kept in scene.keeps.items() if kept == "momentum")


def jumps(scene: Scene) -> bool:
    """Whether an event can change the states of model exchange: the angular velocity or momentum."""
    jumping = bool(scene.inputs.docked) or not keeps_momentum(scene)
    return changes_rate(scene) and jumping


TABLES: dict[tuple[str, ...], type[Table]] = {
    (): Scene,
    ("vessels", "*"): Vessel,
    ("vessels", "*", "ports", "*"): Port,
    ("vessels", "*", "points", "*"): Point,
    ("vessels", "*", "wheels", "*"): Wheel,
    ("docks", "*"): Dock,
    ("mounts", "*"): Mount,
    ("inputs",): Inputs,
    ("gravity",): Gravity,
    ("rotation",): Rotation,
    ("accuracy",): Accuracy,
    ("experiment",): Experiment,
    ("experiment", "orbit"): Orbit,
    ("outputs",): Outputs,
}
"""Which table stands at which place of a scene file; "*" is a name or a number."""


def known_keys(place: tuple[Any, ...]) -> list[str]:
    """Returns the keys of the table at `place`, [] where no table is known."""
    for pattern, table in TABLES.items():
        if len(pattern) == len(place) and all(p in ("*", q) for p, q in zip(pattern, place, strict=True)):
            return list(table.model_fields)
    return []


def tables(raw: Any, key: str) -> list[tuple[str, Mapping[str, Any]]]:
    """Returns names and tables under a key of a raw table, without what is no table."""
    value = raw.get(key) if isinstance(raw, Mapping) else None
    found = value.items() if isinstance(value, Mapping) else ()
    return [(name, table) for name, table in found if isinstance(table, Mapping)]
