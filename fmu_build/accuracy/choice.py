"""The cheapest law and propagator by which a scene is as exact as `[accuracy]` asks, and what shows it."""

import json
from collections.abc import Mapping
from math import ceil, floor, log10
from typing import Any

import numpy as np

from fmu_build.accuracy.flights import LONG
from fmu_build.accuracy.grades import GRADES, LAW_PROVEN, PROVEN, grade_of
from fmu_build.accuracy.search import MARGIN, Progress, Search, Tried, begun
from fmu_build.flight.choices import BEST, Choice, keeping_rate, reference_choices
from fmu_build.flight.results import are_numbers, keep, place_of, read
from fmu_build.flight.workshop import workshop
from supervessel.problems import AccuracyError
from supervessel.scene.schema import CHOSEN, Accuracy, Outputs, Rotation, Scene

CLAIM = (
    "From the scene's start, in communication steps of that length, with inputs anywhere in their ranges and "
    "held over each step, the error stays within what is asked up to the horizon: against the exact motion "
    "under the law tensor with the same inputs."
)

NOT_COVERED = (
    "another state at the start, other communication steps, a tolerance that an importer gives",
    "model exchange, where the importer's solver integrates",
    "what the law tensor itself leaves out: parts that bend, propellant that sloshes; errors of the inputs",
    "inputs that make no sense in themselves, which the FMU discards",
    "masses and poses that go to and fro, some keeping the rate and some the momentum, in just the order "
    "that spins a body up with each round",
)

ANOTHER_ORBIT = "another orbit than that of [experiment.orbit]"


def not_covered(scene: Scene) -> tuple[str, ...]:
    """Returns what the claim about a scene does not cover."""
    return (*NOT_COVERED, ANOTHER_ORBIT) if scene.inputs.gravity else NOT_COVERED


ABOUT = {
    "asked, attitude, rate": "largest errors of the attitude [rad], of the rate [rad/s]; horizon, step: s",
    "grade": "what the claim rests on: name; bounds of law and method and of the law alone, attitude [rad], "
    "rate [rad/s], null where there are none; what is in the way of a better grade; the range to narrow",
    "margin": "least of what is asked over the largest error in flight",
    "doubt": "largest distance of the two ways to the exact motion, in truth",
    "operations": "counted, of a communication step on an average over the flight in which it costs most",
    "worst": "history of the largest error of what was chosen, and what it holds, null where inputs move",
    "watched": "whether the output error_bound is there because the accuracy is not proven",
    "histories": "what inputs do in each flight",
    "steps, looked_at": "communication steps of a flight, and at how many of their ends errors were taken",
    "rows_drawn, rows_senseless": "values of all inputs that were drawn; those that the FMU discards",
    "candidates": "in the order tried; one that is not enough, or refused, is broken off: flights says after "
    "how many, worst names the history of its largest error",
    "dearer": "not flown: this setting and any finer one take so many operations at least",
    "max_angle_step": "rad",
}


WATCH = "error_bound"
"""The output that watches a flight whose accuracy is not proven."""

COUNTS = ("steps", "looked_at", "rows_drawn", "rows_senseless")
"""Keys of the evidence that are numbers of things."""


def choose(scene: Scene, progress: Progress = lambda _: None) -> tuple[Scene, dict[str, Any]]:
    """Returns what `supervessel.choose` does."""
    accuracy = scene.accuracy
    if accuracy is None:
        raise ValueError(f'scene "{scene.name}" has no [accuracy]: nothing is to be chosen')
    given = scene.rotation.model_dump(exclude_unset=True)
    opened = {key: value for key, value in given.items() if key not in CHOSEN}
    whole = _as_flown(scene, Rotation.model_validate(opened))
    place = place_of("accuracy", whole, "choice")
    asked = accuracy.model_dump(mode="json", exclude={"error_bound"})
    kept = read(place, lambda kept: _is_evidence(kept, whole, asked))
    if kept is None:
        kept = _chosen(whole, accuracy, progress)
        keep(place, kept)
    watched = accuracy.error_bound and kept["grade"]["name"] != PROVEN
    outputs = _watching(scene.outputs) if watched else scene.outputs
    rotation = opened | kept["choice"]
    if rotation["law"] == "none" and WATCH not in outputs.names:  # the rate stays, and nobody asks what would
        rotation = keeping_rate(rotation)
    chosen = Rotation.model_validate(rotation)
    if scene.is_chosen and scene.rotation != chosen:
        raise AccuracyError("accuracy: [rotation] has been changed since it was chosen")
    return scene.model_copy(update={"rotation": chosen, "outputs": outputs}), kept | {"watched": watched}


def _watching(outputs: Outputs) -> Outputs:
    """Returns outputs with error_bound among them."""
    return Outputs(names=tuple(dict.fromkeys((*outputs.names, WATCH))))


def _as_flown(scene: Scene, rotation: Rotation) -> Scene:
    """Returns a scene as candidates are made of it: what watches the flight decides nothing."""
    names = tuple(name for name in scene.outputs.names if name != WATCH)
    accuracy = scene.accuracy and scene.accuracy.model_copy(update={"error_bound": True})
    outputs = Outputs(names=names) if names else scene.outputs
    return scene.model_copy(update={"rotation": rotation, "accuracy": accuracy, "outputs": outputs})


def _chosen(scene: Scene, accuracy: Accuracy, progress: Progress) -> dict[str, Any]:
    """Returns the evidence. Raises AccuracyError where nothing meets what is asked."""
    brief = accuracy.horizon <= LONG * accuracy.step
    with workshop(trial=brief) as shop:
        search = begun(scene, accuracy, shop, progress)
        search.run()
    best = search.best
    if best is None:
        raise AccuracyError(_refusal(search, accuracy))
    course, (attitude, rate) = search.every.course, search.doubt
    grade = grade_of(scene, accuracy, best.choice)
    return {
        "about": ABOUT,
        "scene": scene.name,
        "asked": accuracy.model_dump(mode="json", exclude={"error_bound"}),
        "claim": f"{CLAIM} {GRADES[grade.name]}",
        "grade": {
            "name": grade.name,
            "attitude": _upwards(grade.attitude),
            "rate": _upwards(grade.rate),
            "law": _upwards(grade.law),
            "why": grade.why,
            "narrow": grade.narrow,
        },
        "not_covered": list(not_covered(scene)),
        "margin": MARGIN,
        "choice": _settings(best.choice),
        "attitude": _brief(best.attitude),
        "rate": _brief(best.rate),
        "operations": _brief(best.operations),
        "worst": {"history": best.worst, "held": _held(search, best.worst)},
        "histories": [history.name for history in search.every.flown],
        "steps": course.steps,
        "looked_at": len(course.sampled),
        "rows_drawn": search.every.drawn,
        "rows_senseless": search.every.senseless,
        "truth": [str(choice) for choice in reference_choices(scene, BEST)],
        "doubt": {"attitude": _brief(attitude.max()), "rate": _brief(rate.max())},
        "candidates": [
            _settings(one.choice)
            | {
                "operations": _brief(one.operations),
                "attitude": None if one.refused else _brief(one.attitude),
                "rate": None if one.refused else _brief(one.rate),
                "worst": one.worst,
                "flights": one.flights,
                "refused": one.refused,
                "enough": one.excess(accuracy) <= 1.0,
            }
            for one in search.tried.values()
        ],
        "dearer": [
            _settings(choice) | {"operations": _brief(at_least)} for choice, at_least in search.left.values()
        ],
    }


def _is_evidence(kept: Any, scene: Scene, asked: Mapping[str, Any]) -> bool:
    """Whether what JSON has given is evidence about this scene, in every part, for the choice in it.

    Where a part is missing, or has another form, that may also show as an error.
    """
    opened = scene.rotation.model_dump(exclude_unset=True)
    choice = kept["choice"]
    chosen = [one for one in kept["candidates"] if choice.items() <= one.items()]
    Rotation.model_validate(opened | choice)
    held = kept["worst"]["held"]
    texts = [
        kept["worst"]["history"],
        *kept["histories"],
        *kept["truth"],
        *(one["worst"] for one in kept["candidates"]),
    ]
    numbers = [kept[name] for name in ("attitude", "rate", "operations", *COUNTS)]
    numbers += [kept["doubt"]["attitude"], kept["doubt"]["rate"]]
    numbers += [one["operations"] for one in (*kept["candidates"], *kept["dearer"])]
    for one in kept["candidates"]:
        numbers += [one["flights"], *((one["attitude"], one["rate"]) if one["refused"] is None else ())]
    for one in kept["dearer"]:
        Rotation.model_validate({key: value for key, value in one.items() if key != "operations"})
    grade = kept["grade"]
    numbers += [] if held is None else [*held.values()]
    numbers += [grade[name] for name in ("attitude", "rate", "law") if grade[name] is not None]
    texts += [grade["why"], grade["narrow"]]
    claim = f"{CLAIM} {GRADES[grade['name']]}"
    return (
        (kept["about"], kept["scene"], kept["claim"]) == (ABOUT, scene.name, claim)
        and (kept["not_covered"], kept["margin"]) == (list(not_covered(scene)), MARGIN)
        and kept["asked"] == asked
        and [(one["enough"], one["refused"]) for one in chosen] == [(True, None)]
        and are_numbers(numbers)
        and all(isinstance(text, str) for text in texts)
    )


def _held(search: Search, name: str) -> dict[str, float] | None:
    """Returns the inputs that a history holds from the start, None where they move."""
    every = search.every
    inputs = next(history.inputs for history in every.flown if history.name == name)
    if len(inputs.rows) > 1:
        return None
    row = np.concatenate([inputs.numbers[0], inputs.booleans[0]])
    return dict(zip((*every.numbers, *every.docks), (float(value) for value in row), strict=True))


def _settings(choice: Choice) -> dict[str, Any]:
    """Returns a choice as keys of [rotation]."""
    return {"law": choice.model.law, "propagator": choice.propagator, **choice.settings}


def _refusal(search: Search, accuracy: Accuracy) -> str:
    """Returns why there is no choice, and the best that there is."""
    nearest: Tried = min(search.tried.values(), key=lambda one: one.excess(accuracy))
    asked = f"attitude = {accuracy.attitude} rad"
    reached = f"{MARGIN * nearest.attitude:.2g} rad"
    if accuracy.rate is not None:
        asked += f", rate = {accuracy.rate} rad/s"
        reached += f" and {MARGIN * nearest.rate:.2g} rad/s"
    return (
        f"accuracy: {asked} up to {accuracy.horizon:g} s: nothing meets it; the best is {reached}, a margin "
        f"of {MARGIN:g} included, by {nearest.choice}"
    )


def _brief(value: float) -> float:
    """Returns a number rounded to three digits: what is below differs between C libraries."""
    return float(f"{value:.3g}")


def _upwards(value: float | None) -> float | None:
    """Returns a bound rounded up to three digits."""
    if value is None or value == 0.0:
        return value
    unit = 10.0 ** (floor(log10(value)) - 2)
    return float(f"{ceil(value / unit * (1.0 - 1e-12)) * unit:.3g}")


def said(evidence: Mapping[str, Any]) -> str:
    """Returns in one line what was chosen."""
    choice, asked = evidence["choice"], evidence["asked"]
    settings = ", ".join(
        f"{key} = {json.dumps(value) if isinstance(value, str) else f'{value:g}'}"
        for key, value in choice.items()
    )
    found = f"{evidence['attitude']:.1e} rad of {asked['attitude']:g} rad"
    if asked["rate"] is not None:
        found += f", {evidence['rate']:.1e} rad/s of {asked['rate']:g} rad/s"
    count = len(evidence["histories"])
    flown = f"largest error in {count} flight{'s' * (count > 1)} of {asked['horizon']:g} s"
    watched = "; the output error_bound watches the flight" if evidence["watched"] else ""
    return f"{settings}: {_graded(evidence['grade'])}; {flown} {found}{watched}"


def _graded(grade: Mapping[str, Any]) -> str:
    """Returns what a choice rests on, and what is in the way of more."""
    if grade["name"] == PROVEN:
        return f"proven within {grade['attitude']:.2g} rad"
    if grade["name"] == LAW_PROVEN:
        return f"law proven within {grade['law']:.2g} rad, method estimated ({grade['why']})"
    narrow = f"; narrow {grade['narrow']}" if grade["narrow"] else ""
    return f"flown, not proven ({grade['why']}{narrow})"
