"""What a trade tries: laws, inputs left at their start, propagators, and their steps or tolerances."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, get_args

from fmu_build.flight.experiment import acts, at_start, experiment_of
from supervessel.loading import parse_scene
from supervessel.rotation.propagators import PROPAGATORS, plan_of, stepping
from supervessel.rotation.propagators.method import Propagator
from supervessel.scene.inputs import FLOW, MASS, Change, by_name, listed, part_of, vessel_of
from supervessel.scene.numbers import LEAST_TOLERANCE
from supervessel.scene.outputs import is_accelerated
from supervessel.scene.schema import Law, Scene

LAWS_TRIED: tuple[Law, ...] = get_args(Law)

ANGLES = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2)
"""max_angle_step [rad] of rk4, finest first."""
QUICK_ANGLES = (0.01, 0.05, 0.2)
TOLERANCES = tuple(10.0**-k for k in range(3, 13))
QUICK_TOLERANCES = (1e-3, 1e-6, 1e-9, 1e-12)
FINEST = LEAST_TOLERANCE
"""Tolerance of references."""

SHOWN = ("attitude", "angular_velocity")

FROZEN: dict[Change, str] = {"mass": "mass", "pose": "pose"}
"""What can be left at its start, by the kind of change that it is then not, and its name in a trade."""

NO_GRADIENT = "gravity"
"""What `Model.frozen` has for a model without gravity's gradient."""


@dataclass(frozen=True)
class Model:
    """What is taken into account.

    law    : the rotation law
    frozen : "mass" or "pose", the kind of inputs that are left at the start; "gravity", whose gradient is
             left out; "", nothing
    """

    law: Law
    frozen: str = ""

    def __str__(self) -> str:
        if self.frozen == NO_GRADIENT:
            return f"{self.law}, no gradient"
        return self.law + (f", {self.frozen} frozen" if self.frozen else "")


BEST = Model("tensor")


def label(row: Mapping[str, Any]) -> str:
    """Returns the name of the model of a row of a trade."""
    return str(Model(row["law"], row["frozen"]))


@dataclass(frozen=True)
class Choice:
    """A model and how it is propagated: by the angle of a sub-step [rad], or by a tolerance, or neither."""

    model: Model
    propagator: str
    angle: float | None = None
    tolerance: float | None = None

    @property
    def settings(self) -> dict[str, float]:
        """The angle or the tolerance by its name in [rotation], nothing where there is neither."""
        both = {"max_angle_step": self.angle, "tolerance": self.tolerance}
        return {key: value for key, value in both.items() if value is not None}

    def __str__(self) -> str:
        return " ".join([f"{self.model},", self.propagator, *(f"{x:g}" for x in self.settings.values())])


def laws_of(scene: Scene) -> list[Law]:
    """Returns the laws that make sense in a scene, cheapest first."""
    placed = scene.inputs.gravity and any(map(is_accelerated, scene.outputs.names))
    moves = _is_never_free(scene) or placed
    return [law for law in LAWS_TRIED if not (law == "none" and moves)]


def models(scene: Scene, *, quick: bool) -> list[Model]:
    """Returns the models that a scene and its experiment make sense of, cheapest first, the best last."""
    laws = laws_of(scene)
    if quick:
        laws = [law for law in laws if law in ("principal", "tensor")]
    left = [
        *([NO_GRADIENT] if scene.inputs.gravity else []),
        *(kind for kind in FROZEN if moved_inputs(scene, kind)),
    ]
    return [Model(law, frozen) for law in laws for frozen in (*(left if law != "none" else ()), "")]


def moved_inputs(scene: Scene, change: Change) -> list[str]:
    """Returns the inputs of a kind of change that leave their value at the start."""
    known = by_name(dict(scene.inputs))
    return [
        name
        for name, rows in experiment_of(scene).inputs.items()
        if known[name].change == change and len({value for _, value in rows}) > 1
    ]


def reference_choices(scene: Scene, model: Model) -> tuple[Choice, Choice]:
    """Returns two ways to a model's exact motion that share nothing but its equations: series, and stages.

    Series do not know parts that move: there the second is the first at ten times the tolerance.
    """
    first, second = stepping(scene), "dop853"
    return Choice(model, first, None, FINEST), Choice(
        model, second, None, FINEST if first != second else 10.0 * FINEST
    )


def is_free(scene: Scene, model: Model) -> bool:
    """Whether a model's motion is free all through the experiment: nothing acts and nothing else changes."""
    known = by_name(dict(scene.inputs))
    moved = [
        known[name].change
        for name, rows in experiment_of(scene).inputs.items()
        if known[name].part != "field" and len({value for _, value in rows}) > 1
    ]
    frozen = all(change != "" and change == model.frozen for change in moved)
    return frozen and not is_pushed(scene, model) and not _is_never_free(scene)


def _is_never_free(scene: Scene) -> bool:
    """Whether a scene has what no method of free motion alone is let know, used or not."""
    return bool(scene.inputs.motion or scene.wheels or scene.inputs.flow)


def is_pushed(scene: Scene, model: Model) -> bool:
    """Whether a torque acts at some time under a model: one of the inputs', or gravity's."""
    return acts(scene) or (scene.inputs.gravity and model.frozen != NO_GRADIENT)


def ways_to(scene: Scene, model: Model) -> list[Choice]:
    """Returns ways to a model's motion in an experiment, the most exact first.

    Where the motion is free that is `exact`: an unstable motion enlarges what each step leaves, which
    `reference_choices` take and it does not.
    """
    free = [Choice(model, name) for name in always_free()] if is_free(scene, model) else []
    return [*free, *reference_choices(scene, model)]


def by_tolerance(scene: Scene, model: Model, *, quick: bool) -> Iterator[Choice]:
    """Yields what is tried of a model besides rk4."""
    tolerances = QUICK_TOLERANCES if quick else TOLERANCES
    torque = is_pushed(scene, model)
    for name in (
        *stepped(scene, model),
        *while_free(scene, model),
        *(kicked(scene, model) if torque else ()),
    ):
        yield from (Choice(model, name, None, tolerance) for tolerance in tolerances)
    if not torque and not _is_never_free(scene):
        yield from (Choice(model, name) for name in always_free())


def stepped(scene: Scene, model: Model) -> list[str]:
    """Returns the methods that suit a scene and control the error of steps through any motion."""
    return [
        name for name, row in _suiting(scene, model) if row.setting == "tolerance" and row.free == "never"
    ]


def while_free(scene: Scene, model: Model) -> list[str]:
    """Returns "auto", where it is more than another name of one method."""
    variant = variant_of(scene, Choice(model, "auto"))
    return ["auto"] if plan_of(variant).free == "while free" else []


def kicked(scene: Scene, model: Model) -> list[str]:
    """Returns the methods that suit a scene and take a torque as kicks between pieces of free motion."""
    return [name for name, row in _suiting(scene, model) if row.free == "between kicks"]


def always_free() -> list[str]:
    """Returns the methods that know free motion alone."""
    return [name for name, row in PROPAGATORS.items() if row.free == "always"]


def _suiting(scene: Scene, model: Model) -> list[tuple[str, Propagator]]:
    """Returns the methods that make sense with a scene's inputs under a model, by name."""
    inputs = dict(scene.inputs)
    wheels = bool(scene.wheels)
    return [(n, row) for n, row in PROPAGATORS.items() if not row.reason_against(model.law, inputs, wheels)]


def by_angle(model: Model, *, quick: bool) -> list[Choice]:
    """Returns what is tried of rk4, finest first."""
    return [Choice(model, "rk4", angle) for angle in (QUICK_ANGLES if quick else ANGLES)]


def keeping_rate(rotation: Mapping[str, Any]) -> dict[str, Any]:
    """Returns [rotation] without what changes keep: under the law "none" that is the rate always."""
    return {key: value for key, value in rotation.items() if key not in ("mass_change", "pose_change")}


def variant_of(scene: Scene, choice: Choice) -> Scene:
    """Returns the scene that a choice is built from; a tolerance is left to whoever flies it."""
    raw: dict[str, Any] = scene.model_dump(exclude_none=True)
    raw.pop("accuracy", None)
    rotation = raw["rotation"] | {"law": choice.model.law, "propagator": choice.propagator}
    if choice.angle is not None:
        rotation["max_angle_step"] = choice.angle
    if choice.model.law == "none":
        rotation = keeping_rate(rotation)
    raw["rotation"] = rotation
    if choice.model.frozen == NO_GRADIENT:
        _leave_out_gravity(raw)
    names = list(raw["outputs"]["names"])
    raw["outputs"] = {"names": [*names, *(name for name in SHOWN if name not in names)]}
    if choice.model.frozen in FROZEN:
        _freeze(raw, choice.model.frozen, at_start(scene))
    return parse_scene(raw, scene.name)


def _leave_out_gravity(raw: dict[str, Any]) -> None:
    """Takes gravity and what moves the body in its field out of a raw scene."""
    inputs, experiment = raw["inputs"], raw["experiment"]
    names = {name for name, kind in by_name(inputs).items() if kind.part == "field"}
    names |= {kind.group(owner) for kind, owner in listed(inputs) if kind.part == "field"}
    del raw["gravity"]
    inputs |= {"gravity": False, "range": {n: b for n, b in inputs["range"].items() if n not in names}}
    experiment.pop("orbit", None)
    experiment["inputs"] = {n: rows for n, rows in experiment["inputs"].items() if n not in names}


def _freeze(raw: dict[str, Any], change: str, start: Mapping[str, float]) -> None:
    """Makes constants of the inputs of a kind of change, with the experiment's values at its start.

    A mass that is constant has no flow: flows are taken out with masses.
    """
    inputs, vessels = raw["inputs"], raw["vessels"]
    frozen = {
        name: (kind, owner, element)
        for kind, owner in listed(inputs)
        if kind.change == change or (kind is FLOW and change == MASS.change)
        for element, name in enumerate(kind.names(owner))
    }
    for name, value in start.items():
        if name in frozen and frozen[name][0] is not FLOW:
            kind, owner, element = frozen[name]
            vessel = vessels[vessel_of(owner)]
            table = vessel["ports"][part_of(owner)[1]] if kind.owner == "port" else vessel
            if not kind.elements:
                table[kind.quantity] = value
            elif kind.quantity in table:  # a velocity is zero where it is no input
                old = table[kind.quantity]
                table[kind.quantity] = tuple(value if i == element else x for i, x in enumerate(old))
    groups = {kind.group(owner) for kind, owner, _ in frozen.values()}
    inputs |= dict.fromkeys({kind.key for kind, _, _ in frozen.values()}, ())
    inputs["range"] = {n: b for n, b in inputs["range"].items() if n not in frozen and n not in groups}
    courses = raw["experiment"]["inputs"]
    raw["experiment"]["inputs"] = {n: rows for n, rows in courses.items() if n not in frozen}
