"""What a trade tries: laws, inputs left at their start, propagators, and their steps or tolerances."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, get_args

from fmu_build.flight.experiment import acts, at_start, experiment_of
from supervessel.loading import parse_scene
from supervessel.rotation.propagators import plan_of
from supervessel.scene.schema import Law, Scene

LAWS_TRIED: tuple[Law, ...] = get_args(Law)

ANGLES = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2)
"""max_angle_step [rad] of rk4, finest first."""
QUICK_ANGLES = (0.01, 0.05, 0.2)
TOLERANCES = tuple(10.0**-k for k in range(3, 13))
QUICK_TOLERANCES = (1e-3, 1e-6, 1e-9, 1e-12)
FINEST = 1e-15
"""Tolerance of references."""

SHOWN = ("attitude", "angular_velocity")

FROZEN_KINDS = {"mass": ("mass", "pmi"), "pose": ("position", "direction", "alignment", "velocity", "rate")}
"""What can be left at its start, and the last parts of its inputs' names."""


@dataclass(frozen=True)
class Model:
    """What is taken into account: a law, and the kind of inputs, "mass", "pose" or "", left at the start."""

    law: Law
    frozen: str = ""

    def __str__(self) -> str:
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


def models(scene: Scene, *, quick: bool) -> list[Model]:
    """Returns the models that a scene and its experiment make sense of, cheapest first, the best last."""
    laws = [law for law in LAWS_TRIED if not (law == "none" and scene.inputs.motion)]
    if quick:
        laws = [law for law in laws if law in ("principal", "tensor")]
    moved = [kind for kind in FROZEN_KINDS if moved_inputs(scene, kind)]
    return [Model(law, frozen) for law in laws for frozen in (*(moved if law != "none" else ()), "")]


def moved_inputs(scene: Scene, kind: str) -> list[str]:
    """Returns the inputs of a kind that leave their value at the start; none of docks that close."""
    closing = tuple(f"{name}." for name in scene.inputs.docked)
    return [
        name
        for name, rows in experiment_of(scene).inputs.items()
        if len({value for _, value in rows}) > 1
        and name.rpartition(".")[2].partition("[")[0] in FROZEN_KINDS[kind]
        and not name.startswith(closing)
    ]


def reference_choices(scene: Scene, model: Model) -> tuple[Choice, Choice]:
    """Returns two ways to a model's exact motion that share nothing but its equations: series, and stages.

    Series do not know parts that move: there the second is the first at ten times the tolerance.
    """
    if scene.inputs.motion:
        return Choice(model, "dop853", None, FINEST), Choice(model, "dop853", None, 10.0 * FINEST)
    return Choice(model, "taylor", None, FINEST), Choice(model, "dop853", None, FINEST)


def by_tolerance(scene: Scene, model: Model, *, quick: bool) -> Iterator[Choice]:
    """Yields what is tried of a model besides rk4."""
    tolerances = QUICK_TOLERANCES if quick else TOLERANCES
    moves, torque = bool(scene.inputs.motion), acts(scene)
    variant = variant_of(scene, Choice(model, "auto"))
    names = ["dop853", *([] if moves else ["taylor"])]
    if plan_of(variant).free == "while free":
        names.append("auto")
    if torque and not moves and model.law != "none":
        names.append("split")
    for name in names:
        yield from (Choice(model, name, None, tolerance) for tolerance in tolerances)
    if not torque and not moves:
        yield Choice(model, "exact")


def by_angle(model: Model, *, quick: bool) -> list[Choice]:
    """Returns what is tried of rk4, finest first."""
    return [Choice(model, "rk4", angle) for angle in (QUICK_ANGLES if quick else ANGLES)]


def variant_of(scene: Scene, choice: Choice) -> Scene:
    """Returns the scene that a choice is built from; a tolerance is left to whoever flies it."""
    raw: dict[str, Any] = scene.model_dump(exclude_none=True)
    raw.pop("accuracy", None)
    rotation = raw["rotation"] | {"law": choice.model.law, "propagator": choice.propagator}
    if choice.angle is not None:
        rotation["max_angle_step"] = choice.angle
    if choice.model.law == "none":  # keeps the rate always
        rotation = {
            key: value for key, value in rotation.items() if key not in ("mass_change", "pose_change")
        }
    raw["rotation"] = rotation
    names = list(raw["outputs"]["names"])
    raw["outputs"] = {"names": [*names, *(name for name in SHOWN if name not in names)]}
    if choice.model.frozen:
        _freeze(raw, choice.model.frozen, at_start(scene))
    return parse_scene(raw, scene.name)


def _freeze(raw: dict[str, Any], kind: str, start: Mapping[str, float]) -> None:
    """Makes constants of the inputs of a kind, with the experiment's values at its start."""
    inputs, vessels = raw["inputs"], raw["vessels"]
    for name, value in start.items():
        owner, _, last = name.rpartition(".")
        part, _, index = last.rstrip("]").partition("[")
        if part not in FROZEN_KINDS[kind] or owner in inputs.get("docked", ()):
            continue
        vessel, _, port = owner.partition(".")
        table = vessels[vessel]["ports"][port] if port else vessels[vessel]
        if not index:
            table[part] = value
        elif part in table:  # a velocity is zero where it is no input
            table[part] = tuple(value if i == int(index) else x for i, x in enumerate(table[part], start=1))
    gone = {"mass": ("mass", "pmi"), "pose": ("pose", "motion")}[kind]
    inputs |= dict.fromkeys(gone, ())
    kept = {n: b for n, b in inputs["range"].items() if _kind_of(n, inputs) != kind}
    inputs["range"] = kept
    courses = raw["experiment"]["inputs"]
    raw["experiment"]["inputs"] = {n: rows for n, rows in courses.items() if _kind_of(n, inputs) != kind}


def _kind_of(name: str, inputs: Mapping[str, Any]) -> str:
    """Returns which kind an input is of, "" where it is of none that can be left at its start."""
    owner, _, last = name.rpartition(".")
    part = last.partition("[")[0]
    if owner in inputs.get("docked", ()):
        return ""
    return next((kind for kind, parts in FROZEN_KINDS.items() if part in parts), "")
