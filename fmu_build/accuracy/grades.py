"""What the accuracy of a choice rests on: a bound of law and method, of the law alone, or flights."""

from dataclasses import dataclass
from math import isfinite

from fmu_build.accuracy.proven import ProvenBound, proven_bound, to_narrow
from fmu_build.flight.choices import Choice
from supervessel.scene.schema import Accuracy, Scene

PROVEN, LAW_PROVEN, FLOWN = "proven", "proven law, estimated method", "flown"

GRADES = {
    PROVEN: "It is proven: by a bound of law and method over all inputs in their ranges.",
    LAW_PROVEN: "What the law is off by is proven to stay within that, over all inputs in their ranges; what "
    "the method adds is estimated, and kept small in flights, not proven.",
    FLOWN: "It is shown by flights, not proven.",
}
"""Grades, best first, and what each says."""


@dataclass(frozen=True)
class Grade:
    """What a choice rests on.

    name           : of GRADES
    attitude, rate : bound of law and method [rad], [rad/s]; None where there is none
    law            : bound of the law alone [rad], or None
    why            : growth, residual or method, and how it is in the way of a better grade, "" for "proven"
    narrow         : the input, by name without index, whose range is best narrowed, "" for none
    """

    name: str
    attitude: float | None
    rate: float | None
    law: float | None
    why: str
    narrow: str


def law_is_off(scene: Scene, accuracy: Accuracy, choice: Choice) -> str:
    """Returns why a law that leaves terms out is not proven to do, "" where it is, or leaves nothing out."""
    if choice.model.law == "tensor":
        return ""
    flown = under(scene, choice)
    bound = proven_bound(flown, accuracy.horizon, accuracy.step, of_law_alone=True)
    why = _in_the_way(bound, accuracy)
    if not why:
        return ""
    narrow = to_narrow(flown, accuracy.horizon, accuracy.step)
    return f"not proven: {why}" + (f"; a narrower range of {narrow} helps most" if narrow else "")


def grade_of(scene: Scene, accuracy: Accuracy, choice: Choice) -> Grade:
    """Returns what the accuracy of a choice, whose flights keep it, rests on."""
    flown = under(scene, choice)
    bound = proven_bound(flown, accuracy.horizon, accuracy.step)
    whole, rate, law = (float(part[-1]) for part in (bound.whole, bound.rate, bound.law))
    within = whole <= accuracy.attitude and (accuracy.rate is None or rate <= accuracy.rate)
    known = [value if isfinite(value) else None for value in (whole, rate, law)]
    if within and bound.method == "remainder":
        return Grade(PROVEN, known[0], known[1], known[2], "", "")
    why = _in_the_way(bound, accuracy)
    if not why and (within or choice.model.law != "tensor"):
        beyond = "" if bound.method == "estimate" else f": its remainder leaves {whole:.2g} rad"
        return Grade(LAW_PROVEN, known[0], known[1], known[2], f"method: {choice.propagator}{beyond}", "")
    if not why:
        why = bound.why or f"method: its steps are bounded by {whole:.2g} rad over the ranges only"
    return Grade(FLOWN, known[0], known[1], known[2], why, to_narrow(flown, accuracy.horizon, accuracy.step))


def _in_the_way(bound: ProvenBound, accuracy: Accuracy) -> str:
    """Returns why the law is not bounded within what is asked, "" where it is."""
    law, rate = float(bound.law[-1]), float(bound.law_rate[-1])
    if not isfinite(law):
        return bound.why
    if law <= accuracy.attitude and (accuracy.rate is None or rate <= accuracy.rate):
        return ""
    return f"residual: what the law leaves out is bounded by {law:.2g} rad, {rate:.2g} rad/s only"


def under(scene: Scene, choice: Choice) -> Scene:
    """Returns a scene as a choice has it."""
    settings = {"law": choice.model.law, "propagator": choice.propagator, **choice.settings}
    rotation = scene.rotation.model_copy(update=settings)
    return scene.model_copy(update={"rotation": rotation, "accuracy": None})
