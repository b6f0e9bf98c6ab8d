"""What the page says of a scene with `[accuracy]`: what was asked, what was flown, with what errors; HTML."""

from collections.abc import Mapping
from html import escape
from typing import Any

from fmu_build.document.tables import Cell, table

CANDIDATE_COLUMNS = (
    "candidate",
    "operations per step, most in a flight",
    "attitude [rad]",
    "rate [rad/s]",
    "worst in",
    "flights",
    "enough",
)


def accuracy_text(evidence: Mapping[str, Any]) -> str:
    """Returns the section about the accuracy.

    evidence : of the choice of law and propagator, see `supervessel.choose`
    """
    candidates = [_flown(one) for one in evidence["candidates"]]
    candidates += [_not_flown(one) for one in evidence["dearer"]]
    excluded = "".join(f"<li>{escape(what)};</li>\n" for what in evidence["not_covered"])
    return (
        f"<h3>Accuracy</h3>\n<p>{escape(evidence['claim'])} Law and propagator are the cheapest, by counted "
        "operations, whose flights keep the accuracy with the margin. A candidate that is not enough is "
        "broken off.</p>\n"
        f"{table('', (), _asked_and_found(evidence))}<p>Not covered:</p>\n<ul>\n{excluded}</ul>\n"
        + table("Candidates: largest errors in flight", CANDIDATE_COLUMNS, candidates)
    )


def _asked_and_found(evidence: Mapping[str, Any]) -> list[tuple[Cell, ...]]:
    """Returns rows of what was asked, what was chosen, and by how many flights."""
    asked = evidence["asked"]
    return [
        ("largest error of the attitude asked [rad]", asked["attitude"]),
        ("of the rate [rad/s]", "any" if asked["rate"] is None else asked["rate"]),
        ("up to [s]", asked["horizon"]),
        ("in communication steps of [s]", asked["step"]),
        ("what it rests on", evidence["grade"]["name"]),
        ("bound of law and method [rad], [rad/s]", _bounds(evidence["grade"])),
        ("in the way of a better grade", evidence["grade"]["why"] or "nothing"),
        ("range whose narrowing helps most", evidence["grade"]["narrow"] or "none"),
        ("watched in flight", "by the output error_bound" if evidence["watched"] else "no"),
        ("margin that flights keep", evidence["margin"]),
        ("chosen", _settings(evidence["choice"])),
        ("its largest error in flight [rad], [rad/s]", (evidence["attitude"], evidence["rate"])),
        ("in the history, which holds", _worst(evidence["worst"])),
        ("the exact motion is known to [rad], [rad/s]", tuple(evidence["doubt"].values())),
        ("by two ways", "; ".join(evidence["truth"])),
        ("flights", f"{len(evidence['histories'])}: {'; '.join(evidence['histories'])}"),
        ("steps of each, of which looked at", (evidence["steps"], evidence["looked_at"])),
        ("inputs drawn, of which senseless", (evidence["rows_drawn"], evidence["rows_senseless"])),
    ]


def _worst(worst: Mapping[str, Any]) -> str:
    """Returns the worst history, and the inputs that it holds."""
    held = worst["held"]
    inputs = "inputs that move" if held is None else ", ".join(f"{k} {v:.6g}" for k, v in held.items())
    return f"{worst['history']}: {inputs or 'no inputs'}"


def _bounds(grade: Mapping[str, Any]) -> Cell:
    """Returns the bounds of attitude and rate, or that there are none."""
    return "none" if grade["attitude"] is None else (grade["attitude"], grade["rate"])


def _flown(candidate: Mapping[str, Any]) -> tuple[Cell, ...]:
    """Returns the row of a candidate that was flown, or that refused to."""
    refused = candidate["refused"]
    return (
        _settings(candidate),
        candidate["operations"],
        *(("", "") if refused else (candidate["attitude"], candidate["rate"])),
        f"refused: {refused}" if refused else candidate["worst"],
        candidate["flights"],
        "yes" if candidate["enough"] else "no",
    )


def _not_flown(candidate: Mapping[str, Any]) -> tuple[Cell, ...]:
    """Returns the row of a candidate that costs more than the one that was chosen."""
    operations = f"{candidate['operations']:g} at least"
    return (_settings(candidate), operations, "", "", "not flown: dearer, finer settings too", 0, "")


def _settings(choice: Mapping[str, Any]) -> str:
    """Returns the keys of [rotation] of a choice as text."""
    fine = (f"{key} {choice[key]:g}" for key in ("tolerance", "max_angle_step") if key in choice)
    return ", ".join([choice["law"], choice["propagator"], *fine])
