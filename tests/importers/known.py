"""Cells that are red by the importer's own fault: what it says, why, and on what else that is seen.

A cell that is listed here must be red and must say so; one that has come right fails its test, so that the
list is true of the pinned versions.
"""

from dataclasses import dataclass

from importers.cells import Cell
from importers.scenes import COURSES


@dataclass(frozen=True)
class Fault:
    """A fault of an importer.

    says   : a part of what it says instead of flying; "" where it flies wrongly
    reason : what it does wrong
    shown  : where the same is seen without an FMU of ours
    """

    says: str
    reason: str
    shown: str = ""


ATTRIBUTE = Fault(
    "unknown field",
    "fmi-sim refuses a model description of FMI 3.0 in which a `Float64` has `nominal` or `unit`, which the "
    "standard gives that element: its package fmi-schema 0.8.0 lists neither.",
    "BouncingBall's description of the Reference FMUs, cut down to two variables, is read; with `nominal` "
    "added to `h` it is refused in the same words.",
)
BOOLEAN = Fault(
    "Unsupported datatype Boolean",
    "fmi-sim ends where inputs in a file hold a Boolean, but for FMI 2.0's co-simulation: its search for the "
    "next event compares numbers alone (`src/sim/io.rs`).",
    "Not shown on a Reference FMU (Feedthrough has such an input): no package that was found holds them.",
)

KNOWN: dict[tuple[str, str], Fault] = {
    ("fmi_sim-me2", "docks"): BOOLEAN,
    **{(f"fmi_sim-{way}", name): ATTRIBUTE for way in ("cs3", "me3") for name in COURSES},
}
"""By row and scene."""


def explains(fault: Fault, cell: Cell) -> bool:
    """Returns whether a fault is what became of a cell."""
    return (fault.says in cell.instead) if fault.says else cell.deviation is not None
