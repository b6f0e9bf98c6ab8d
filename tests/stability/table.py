"""Prints the stability suite's table in MEASURED.md: the worst error of each propagator by kind of motion.

python -m stability.table     (in tests, five minutes: `make stability`)
"""

import contextlib
from collections.abc import Callable, Iterable

import numpy as np

from stability import truth
from stability.flights import Craft, End, craft, errors, units
from stability.pair import MASSES, pair, pair_case
from stability.runs import RUNS, Run, applies
from stability.truth import Case
from support import DISCARD, OK

LONGEST = 1e5  # s


def of(*categories: str) -> Callable[[Case], bool]:
    """Returns whether a case is of one of these categories, of either kind of body."""
    return lambda case: case.category.removesuffix(", full tensor") in categories


ROWS: dict[str, Callable[[Case], bool]] = {
    "any body, 1e-9 to 1e5 s": of("general", "backwards"),
    "omega h = 1, 10, 1000": of("omega h of 1, 10, 1000"),
    "100 to 1e9 rad in a step": of("many turns"),
    "a communication step of 1e5 s": lambda case: abs(case.time) == LONGEST and not case.torque.any(),
    "rates from denormal to 1e150 rad/s": of("tiny and huge rates"),
    "moments from 1e-300 to 1e300 kg m2": of("tiny and huge moments"),
    "slender, moments 1e-3 to 1e-12 apart": of("slender"),
    "flat, on the triangle's boundary": of("flat"),
    "symmetric, exactly and to an ulp": of("symmetric", "symmetric to an ulp"),
    "spherical, exactly, to an ulp and nearly": of("spherical", "spherical to an ulp", "nearly spherical"),
    "on the separatrix, and 1e-15 to 1e-8 from it": of("separatrix", "near the separatrix"),
    "steady spin, and 1e-10 to 1e-5 from it": of("steady spin", "spin disturbed"),
    "torque, weak: 1e-12 to 1e-6 N m": of("torque, weak"),
    "torque, to 40 s and 50 rad": of("torque, moderate", "torque, omega h of 1, 10"),
    "torque on slender, flat, spherical, huge, tiny": of("torque, odd bodies"),
    "torque that dwarfs momentum": of("torque that dwarfs momentum"),
}


def cell(run: Run, cases: Iterable[Case]) -> str:
    """Returns the worst error, diagonal and full tensors, and how many of the cases were refused."""
    worst: dict[bool, float] = {}
    refused = 0
    flown = [case for case in cases if applies(run, case)]
    for case in flown:
        end = craft(run.propagator, case.full).fly(case, run.tolerance)
        if end.refused is not None:
            refused += 1
        else:
            worst[case.full] = max(worst.get(case.full, 0.0), units(case, errors(case, end)))
    if not flown:
        return "discarded"
    words = [" / ".join(number(worst[full]) for full in sorted(worst))] if worst else []
    if refused:
        words.append(f"{refused} of {len(flown)} refused" if worst else "refused")
    return ", ".join(words)


def number(value: float) -> str:
    """Returns a few digits."""
    return f"{value:.1f}" if value < 99.95 else f"{value:.0e}".replace("e+0", "e").replace("e+", "e")


def pair_cell(run: Run) -> str:
    """Returns the error of two docked vessels of mass ratio 1e-12."""
    flown = Craft(run.propagator, True, pair(run.propagator, MASSES))
    end: End = flown.fly(pair_case(), run.tolerance)
    flown.instance.free()
    return number(units(pair_case(), errors(pair_case(), end)))


def boundary_cell(run: Run) -> str:
    """Returns what a step says to moments beyond the triangle."""
    flown = craft(run.propagator, False)
    flown.begin(truth.cases("flat")[0])
    assert (
        flown.instance.set({"B.pmi": [1.0, 2.0, np.nextafter(3.0, 4.0) + 1e-14], "torque": [0.0] * 3}) == OK
    )
    return {OK: "accepted", DISCARD: "refused"}[flown.instance.step(1.0)]


def main() -> None:
    """Prints the table as Markdown."""
    print("| | " + " | ".join(str(run) for run in RUNS) + " |")
    print("|---|" + "---|" * len(RUNS))
    for row, chosen in ROWS.items():
        cases = [case for case in truth.cases() if chosen(case)]
        print(f"| {row} | " + " | ".join(cell(run, cases) for run in RUNS) + " |", flush=True)
    print("| two vessels, masses 1e12 apart | " + " | ".join(pair_cell(run) for run in RUNS) + " |")
    print("| moments beyond the triangle | " + " | ".join(boundary_cell(run) for run in RUNS) + " |")


if __name__ == "__main__":
    with contextlib.suppress(BrokenPipeError):
        main()
