"""What the adversary's records say in all: grades by law, broken claims, shares of what is asked."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import beta

from fmu_build.accuracy.grades import FLOWN, GRADES, LAW_PROVEN, PROVEN

Record = Mapping[str, Any]

SLOW = 3.0
"""Angle [rad] that a slow scene turns by less than, in every attack."""

CONFIDENCE = 0.95
BROKEN_FLOWN = 1.0 / 200.0
"""Share of claims that rest on flights alone that may be broken, at most."""

PROVEN_OF_SLOW = 1.0 / 3.0
"""Share of the slow scenes whose law shall be proven, at least."""


def upper(broken: int, count: int) -> float:
    """Returns the one-sided upper limit of Clopper and Pearson for a share of which some were seen."""
    return 1.0 if broken >= count else float(beta.ppf(CONFIDENCE, broken + 1, count - broken))


def grade(record: Record) -> str:
    return str(record["grade"]["name"])


def breaches(record: Record) -> list[str]:
    """Returns a line for everything that an attack has broken in a scene."""
    if record["refused"] is not None:
        return []
    output = record["output"] or {"broken": []}
    what = {
        "the claim": record["broken"],
        "the proven bound": record["bound_broken"],
        "the law's bound": record["law_broken"],
        "error_bound": output["broken"],
    }
    return [
        f"scene {record['number']} ({record['kind']}), {grade(record)}, {_settings(record)}: {said} broken "
        f'by "{attack}", {record["used"][attack]:.3g} of what is asked'
        for said, names in what.items()
        for attack in names
    ]


def failures(records: Iterable[Record]) -> list[str]:
    """Returns what must not be: a bound that is broken, or a claim whose law is proven."""
    built = [one for one in records if one["refused"] is None]
    wrong = [
        one
        for one in built
        if one["bound_broken"]
        or (one["output"] or {"broken": []})["broken"]
        or (grade(one) != FLOWN and (one["broken"] or one["law_broken"]))
    ]
    return [line for one in wrong for line in breaches(one)]


def _settings(record: Record) -> str:
    return " ".join(
        f"{value:g}" if isinstance(value, float) else str(value) for value in record["choice"].values()
    )


def report(records: Sequence[Record]) -> str:
    """Returns all figures as text."""
    built = [one for one in records if one["refused"] is None]
    lines = [f"{len(records)} scenes of {len({one['code'] for one in records})} version(s) of the code: "]
    lines[0] += f"{len(built)} built, {len(records) - len(built)} refused"
    if not built:
        return lines[0]
    used = np.array([max(one["used"].values()) for one in built])
    seconds = np.array([one["seconds"] for one in records])
    flights = sum(len(one["used"]) for one in built)
    lines += [
        f"processor time of a scene: {np.median(seconds):.1f} s median, {seconds.max():.1f} s at most; "
        f"{flights} flights against claims",
        *_of_grades(built),
        *_of_slow(built),
        *_broken(built),
        f"share of what is asked that was used: {np.median(used):.2g} median, "
        f"{np.quantile(used, 0.9):.2g} at 90 %, {used.max():.3g} at most (scene "
        f"{built[int(np.argmax(used))]['number']}, {grade(built[int(np.argmax(used))])})",
        *_above(built),
        *_old_rule(built),
        *_of_output(built),
        *(line for one in built for line in breaches(one)),
        *(f"refused: {one['refused'][:160]}" for one in records if one["refused"] is not None),
    ]
    return "\n".join(lines)


def _of_grades(built: Sequence[Record]) -> list[str]:
    counts = Counter((grade(one), one["choice"]["law"]) for one in built)
    lines = []
    for name in GRADES:
        of_law = {law: count for (said, law), count in counts.items() if said == name}
        by_law = ", ".join(f"{law} {count}" for law, count in sorted(of_law.items()))
        total = sum(of_law.values())
        lines.append(f"{name}: {total} ({total / len(built):.0%}): {by_law}")
    methods = Counter(one["choice"]["propagator"] for one in built)
    return [*lines, "methods: " + ", ".join(f"{name} {count}" for name, count in methods.most_common())]


def slow_scenes(built: Iterable[Record]) -> list[Record]:
    return [one for one in built if one["turned"] < SLOW]


def _of_slow(built: Sequence[Record]) -> list[str]:
    slow = slow_scenes(built)
    proven = sum(grade(one) in (PROVEN, LAW_PROVEN) for one in slow)
    cheap = sum(one["choice"]["law"] != "tensor" for one in slow)
    why = Counter(one["grade"]["why"].partition(":")[0] for one in slow if grade(one) == FLOWN)
    return [
        f"slow, less than {SLOW:g} rad in every flight: {len(slow)} of {len(built)}; law proven in {proven} "
        f"({proven / max(len(slow), 1):.0%}), a cheaper law than tensor in {cheap}",
        "slow but flown because of: " + ", ".join(f"{name} {count}" for name, count in why.most_common()),
    ]


def _broken(built: Sequence[Record]) -> list[str]:
    lines = []
    for name in GRADES:
        of_grade = [one for one in built if grade(one) == name]
        broken = sum(bool(one["broken"]) for one in of_grade)
        bounds = sum(bool(one["bound_broken"] or one["law_broken"]) for one in of_grade)
        if of_grade:
            lines.append(
                f"claims broken, {name}: {broken} of {len(of_grade)}, at {CONFIDENCE:.0%} at most "
                f"{upper(broken, len(of_grade)):.2%}; bounds broken: {bounds}"
            )
    return lines


def _above(built: Sequence[Record]) -> list[str]:
    above = np.array([one["largest"] / max(one["attitude"], 1e-300) for one in built])
    most = int(np.argmax(above))
    return [
        f"attacks that err more than the choice's own flights: in {int(np.sum(above > 1.0))} scenes, at most "
        f"{above[most]:.3g} times (scene {built[most]['number']})"
    ]


def _old_rule(built: Sequence[Record]) -> list[str]:
    """How much dearer the graded choice is than the cheapest that flights alone find to be enough."""
    both = [one for one in built if "old" in one["rules"]]
    if not both:
        return []
    factor = np.array([one["operations"] / one["rules"]["old"]["operations"] for one in both])
    dearer = factor[factor > 1.01]  # operations of the evidence have three digits
    if not len(dearer):
        return [f"dearer than the old rule's choice: 0 of {len(both)}"]
    return [
        f"dearer than the old rule's choice: {len(dearer)} of {len(both)}, {np.median(dearer):.2f} times the "
        f"operations in the median of these, {dearer.max():.2f} at most; "
        f"{np.exp(np.log(np.maximum(factor, 1.0)).mean()):.2f} in the geometric mean over all"
    ]


def _of_output(built: Sequence[Record]) -> list[str]:
    shown = [one["output"] for one in built if one["output"]]
    if not shown:
        return ["error_bound: no FMU has it"]
    beyond, flights = (sum(one[key] for one in shown) for key in ("beyond", "flights"))
    broken = sum(len(one["broken"]) for one in shown)
    return [
        f"error_bound, {len(shown)} FMUs: below the true error in {broken} of {flights} flights; more than "
        f"what is asked though the claim held in {beyond}"
    ]
