"""What goes with what: each law, propagator and feature of a scene, asked of the code and written on a page.

`PYTHONPATH=tests python -m features.matrix` writes the tables anew into model/docs/scene.md.
"""

from collections.abc import Iterable, Iterator
from functools import cache
from string import ascii_lowercase
from typing import Any, get_args

from lxml import etree

from fmu_build.flight.choices import Choice, by_angle, by_tolerance, models
from fmu_build.interface.model_description import model_description
from fmu_build.interface.variable_table import variable_table
from supervessel import Scene, SceneError, parse_scene
from supervessel.equations import equations
from supervessel.rotation.propagators import PROPAGATORS, plan_of
from supervessel.scene.inputs import acting, by_group
from supervessel.scene.schema import PROPAGATOR_NAMES, Law
from support.pages import ROOT, text

Raw = dict[str, Any]

PAGE = "model/docs/scene.md"
HEADING, NEXT = "### What goes with what", "## What is refused"
LAWS: tuple[str, ...] = get_args(Law)
SOURCE = "scene"

SPIN = {"angular_velocity": [0.01, 0.02, -0.01]}
VESSELS: Raw = {
    "A": {
        "mass": 1000.0,
        "inertia": [[900.0, 20.0, -10.0], [20.0, 1400.0, 30.0], [-10.0, 30.0, 1600.0]],
        "ports": {"p": {"position": [1, 0, 0], "direction": [1, 0, 0], "alignment": [0, 1, 0]}},
        "points": {"jet": {"position": [0, 1, 0]}},
    },
    "B": {
        "mass": 300.0,
        "pmi": [0.5, 0.6, 0.7],
        "ports": {"q": {"position": [-1, 0, 0], "direction": [-1, 0, 0], "alignment": [0, 1, 0]}},
    },
}
WHEELED = VESSELS | {
    "A": VESSELS["A"] | {"wheels": {"w": {"axis": [0, 0, 1], "inertia": 2.0, "momentum": 9.0}}}
}
MU = 3.986e14
PLACE: Raw = {"position": [0.0, 0.0, 6.8e6], "velocity": [7.6e3, 0.0, 0.0]}

FEATURES: dict[str, Raw] = {
    "nothing acts": {},
    "torque, forces": {"inputs": {"torque": True, "force": ["A.jet"], "vessel_torque": ["B"]}},
    "flows": {"inputs": {"mass": ["A"], "flow": ["A.jet"]}},
    "gravity": {"inputs": {"gravity": True}, "gravity": {"mu": MU} | PLACE},
    "wheels": {"vessels": WHEELED, "inputs": {"wheel": ["A.w"]}},
    "ports that move": {"inputs": {"pose": ["B.q"], "motion": ["B.q"]}},
    "docks that open": {"inputs": {"docked": ["berth"]}},
}
"""Keys that a scene has for a feature."""

DISCARDS = "read; a step in which a torque, gravity included, acts or a port moves is discarded"
"""What becomes of what keeps the motion from being free where the propagator knows no other."""

INTRODUCTION = """
What a scene may have under each propagator in co-simulation. A cell holds for every law, but for the laws
that it names. Letters stand for the reasons listed below, in the words of the refusal. The scenes behind the
row of `split` have a torque input in every column but the first.
"""
BETWEEN = """
In scenes with `[accuracy]`, in a trade (which propagators it tries), and among derivatives of the FMU:
"""
HEADER = ["scene with", "`[accuracy]`", "`supervessel trade`", "adjoint derivatives, FMI 3.0"]


Reasons = tuple[str, ...]
"""Why something does not go, or with what reserve; none: it goes."""


def scene_with(feature: str, law: str, propagator: str) -> Raw:
    """Returns a scene file's tables; a propagator whose steps are kicks has a torque, where anything acts."""
    raw = {
        "name": "matrix",
        "root": "A",
        "vessels": VESSELS,
        "docks": [{"ports": ["A.p", "B.q"], "name": "berth"}],
        "rotation": SPIN | {"law": law, "propagator": propagator},
    } | FEATURES[feature]
    kicked = propagator in PROPAGATORS and PROPAGATORS[propagator].free == "between kicks"
    if kicked and feature != "nothing acts":
        raw["inputs"] = raw["inputs"] | {"torque": True}
    return raw


def refusals(raw: Raw) -> Reasons:
    """Returns why a scene is refused as it is read."""
    try:
        parse_scene(raw, SOURCE)
    except SceneError as error:
        return tuple(line.removeprefix(f"{SOURCE}: ") for line in str(error).splitlines())
    return ()


@cache
def against(feature: str, law: str, propagator: str) -> Reasons:
    """Returns what a feature has against it under a law and a propagator."""
    raw = scene_with(feature, law, propagator)
    reasons = refusals(raw)
    if reasons:
        return reasons
    scene = parse_scene(raw, SOURCE)
    free = plan_of(scene).method is None
    return (DISCARDS,) if free and (acting(dict(scene.inputs)) or scene.inputs.motion) else ()


def asking(feature: str) -> Raw:
    """Returns a scene with a feature that states an accuracy, and ranges for it."""
    raw = scene_with(feature, "tensor", "auto")
    inputs = raw.get("inputs", {})
    numbers = {
        group: [-1.0 if kind.lowest is None else kind.lowest, 1.0]
        for group, (kind, _) in by_group(inputs).items()
        if not kind.boolean and kind.part != "field"
    }
    ranges = {"range": numbers} if numbers else {}
    asked = {"attitude": 1e-3, "horizon": 100.0, "step": 1.0}
    raw |= {"inputs": inputs | ranges, "accuracy": asked, "rotation": SPIN}
    return raw if "gravity" not in raw else raw | {"gravity": {"mu": MU}, **on_orbit()}


def on_orbit() -> Raw:
    """Returns an experiment, on an orbit."""
    return {"experiment": {"duration": 100.0, "step": 1.0, "orbit": PLACE}}


@cache
def against_accuracy(feature: str) -> Reasons:
    """Returns why a scene with a feature may not state an accuracy."""
    return refusals(asking(feature))


def traded_scene(feature: str) -> Scene:
    """Returns a scene with a feature and an experiment, in which the first torque or force grows."""
    raw = scene_with(feature, "tensor", "auto")
    flight = {"duration": 100.0, "step": 1.0}
    acts = [names for kind, names in by_group(raw.get("inputs", {})).values() if kind.part == "action"]
    if acts:
        flight |= {"inputs": {acts[0][0]: [[0.0, 0.0], [100.0, 1.0]]}}
    if "gravity" in raw:
        raw, flight = raw | {"gravity": {"mu": MU}}, flight | {"orbit": PLACE}
    return parse_scene(raw | {"experiment": flight}, SOURCE)


@cache
def traded(feature: str) -> tuple[Choice, ...]:
    """Returns what a trade tries in a scene with a feature."""
    scene, quick = traded_scene(feature), {"quick": True}
    return tuple(
        choice
        for model in models(scene, quick=False)
        for choice in (*by_angle(model, **quick), *by_tolerance(scene, model, **quick))
    )


@cache
def against_adjoints(feature: str) -> Reasons:
    """Returns why the FMI 3.0 FMU of a scene with a feature has no adjoint derivatives."""
    scene = parse_scene(scene_with(feature, "tensor", "rk4"), SOURCE)
    root = etree.fromstring(model_description(scene, variable_table(equations(scene)), "token", 3))
    told = {root.find(kind).get("providesAdjointDerivatives") for kind in ("ModelExchange", "CoSimulation")}
    return () if told == {"true"} else ("the model description does not offer them",)


# The page


class _Letters:
    """Letters for reasons, in the order in which they are first asked for."""

    def __init__(self) -> None:
        self.letters: dict[str, str] = {}

    def cell(self, reasons: Reasons) -> str:
        """Returns what a cell says."""
        known = [self.letters.setdefault(why, ascii_lowercase[len(self.letters)]) for why in reasons]
        return ", ".join(f"({letter})" for letter in known) or "yes"

    def by_law(self, found: dict[str, Reasons]) -> str:
        """Returns what a cell says of reasons by law: those of `tensor`, then the laws with others."""
        usual = found["tensor"]
        parts = [self.cell(usual)]
        for other in dict.fromkeys(reasons for reasons in found.values() if reasons != usual):
            laws = ", ".join(f"`{law}`" for law in LAWS if found[law] == other)
            parts.append(f"{laws}: {self.cell(other)}")
        return "; ".join(parts)

    def lines(self) -> Iterator[str]:
        """Yields the reasons, a list."""
        for reason, letter in self.letters.items():
            yield f"- ({letter}) {reason}"


def _table(header: Iterable[str], rows: Iterable[Iterable[str]]) -> list[str]:
    names = list(header)
    return [
        f"| {' | '.join(names)} |",
        "|" + "---|" * len(names),
        *(f"| {' | '.join(row)} |" for row in rows),
    ]


def _tried(feature: str) -> str:
    """Returns which propagators a trade tries of models with the feature, and under which laws not."""
    tried = {(choice.model.law, choice.propagator) for choice in traded(feature) if not choice.model.frozen}
    laws = [law for law in LAWS if any(law == known for known, _ in tried)]
    parts = []
    for name in PROPAGATOR_NAMES:
        under = [law for law in laws if (law, name) in tried]
        without = ", ".join(f"`{law}`" for law in laws if law not in under)
        if under:
            parts.append(f"`{name}`" + (f" (not under {without})" if without else ""))
    never = ", ".join(f"`{law}`" for law in LAWS if law not in laws)
    return ", ".join(parts) + (f"; no law {never}" if never else "")


def tables() -> str:
    """Returns the section of the page, without its heading."""
    letters = _Letters()
    suits = [
        [
            f"`{name}`",
            *(letters.by_law({law: against(feature, law, name) for law in LAWS}) for feature in FEATURES),
        ]
        for name in PROPAGATOR_NAMES
    ]
    beside = [
        [f, letters.cell(against_accuracy(f)), _tried(f), letters.cell(against_adjoints(f))] for f in FEATURES
    ]
    first, second = _table(["`propagator`", *FEATURES], suits), _table(HEADER, beside)
    return "\n".join([INTRODUCTION, *first, BETWEEN, *second, "", *letters.lines(), ""])


def section() -> str:
    """Returns what the page has."""
    return text(PAGE).partition(f"{HEADING}\n")[2].partition(f"\n{NEXT}\n")[0]


def main() -> None:
    """Writes the tables into the page."""
    page = ROOT / PAGE
    before, _, rest = page.read_text(encoding="utf-8").partition(f"{HEADING}\n")
    after = rest.partition(f"\n{NEXT}\n")[2]
    page.write_text(f"{before}{HEADING}\n{tables()}\n{NEXT}\n{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
