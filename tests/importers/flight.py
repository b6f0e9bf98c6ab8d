"""What an importer is asked to fly, and helpers that several importers share."""

import csv
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import read_model_description
from numpy.typing import NDArray

Array = NDArray[np.float64]

Series = dict[str, Array]
"""By names of scalars, what they are at each communication point, (n + 1,)."""


SOLVER = 1e-10
"""Relative tolerance that importers' solvers are asked for."""


class InsteadError(Exception):
    """Says what an importer did instead of flying."""


@dataclass(frozen=True)
class Flight:
    """An FMU, an interface, and how its inputs move.

    fmu      : path of the archive
    fmi      : version of the standard
    exchange : model exchange, else co-simulation
    times    : (n + 1,) [s], communication points, evenly spaced from 0
    inputs   : what each input is at each of them
    booleans : names of the inputs that are Booleans
    outputs  : names of the outputs that are wanted
    folder   : of this flight's own, for what an importer writes
    """

    fmu: Path
    fmi: int
    exchange: bool
    times: Array
    inputs: Mapping[str, Array]
    booleans: frozenset[str]
    outputs: Sequence[str]
    folder: Path

    @property
    def step(self) -> float:
        """Between two communication points [s]."""
        return float(self.times[1])

    @property
    def reals(self) -> list[str]:
        """Names of the inputs that are numbers."""
        return [name for name in self.inputs if name not in self.booleans]

    @cached_property
    def description(self) -> Any:
        """What FMPy reads in modelDescription.xml."""
        return read_model_description(str(self.fmu))

    @cached_property
    def references(self) -> dict[str, int]:
        """Value references by name."""
        return {v.name: v.valueReference for v in self.description.modelVariables}

    @cached_property
    def discrete(self) -> set[str]:
        """Names of the inputs that change at events only, as the model description says."""
        found = self.description.modelVariables
        return {v.name for v in found if v.causality == "input" and v.variability == "discrete"}

    def at(self, k: int, names: Iterable[str]) -> list[float]:
        """Returns values of inputs at a communication point."""
        return [float(self.inputs[name][k]) for name in names]


def series(names: Sequence[str], points: Sequence[Sequence[float]]) -> Series:
    """Returns what was read at each communication point, by name."""
    return dict(zip(names, np.array(points, dtype=float).T, strict=True))


def written(path: Path, wanted: Sequence[str], prefix: str = "") -> Series:
    """Returns columns of a CSV file that an importer wrote.

    prefix : what it puts before the names
    Names hold commas, which not every importer puts between quotes: pieces of a name are joined again.
    """
    with path.open(newline="", encoding="utf-8") as file:
        heads, *rows = list(csv.reader(file))
    names: list[str] = []
    for head in (head.strip() for head in heads):
        if names and names[-1].count("[") > names[-1].count("]"):
            names[-1] += "," + head
        else:
            names.append(head)
    numbers = np.array([[float(cell) for cell in row[: len(names)]] for row in rows])
    missing = [name for name in wanted if prefix + name not in names]
    if missing:
        raise InsteadError(f"wrote no {missing[0]}")
    return {name: numbers[:, names.index(prefix + name)] for name in wanted}
