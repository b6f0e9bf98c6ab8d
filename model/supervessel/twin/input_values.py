"""Inputs by name: which elements of p a name stands for."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from supervessel.problems import unknown


def settled(
    fixed: bool | Iterable[str] | Mapping[str, ArrayLike], names: Sequence[str], start: NDArray[np.float64]
) -> dict[int, float]:
    """Returns the values of inputs that are numbers, by their places in p."""
    if isinstance(fixed, Mapping):
        return placed_values(fixed, names)
    if isinstance(fixed, bool):
        return dict(enumerate(start)) if fixed else {}
    if isinstance(fixed, str):
        fixed = (fixed,)
    return {i: float(start[i]) for name in fixed for i in places_of(name, names)}


def placed_values(values: Mapping[str, ArrayLike], names: Sequence[str]) -> dict[int, float]:
    """Returns values by their places among names."""
    placed: dict[int, float] = {}
    for name, value in values.items():
        places, given = places_of(name, names), np.ravel(np.asarray(value, dtype=float))
        if len(given) != len(places) or not np.isfinite(given).all():
            count = "a finite number" if len(places) == 1 else f"{len(places)} finite numbers"
            raise ValueError(f"{name} = {value!r}: must be {count}")
        problem = _problem(name.rpartition(".")[2].partition("[")[0], given.tolist())
        if problem:
            raise ValueError(f"{name} = {value!r}: {problem}")
        placed |= dict(zip(places, given.tolist(), strict=True))
    return placed


def _problem(kind: str, given: Sequence[float]) -> str:
    """Returns why an input cannot have these values whatever the others are, or "" if it may."""
    if kind in ("mass", "pmi") and min(given) < 0.0:
        return "must not be negative"
    if kind == "docked" and given[0] not in (0.0, 1.0):
        return "must be 0 or 1"
    if kind in ("direction", "alignment") and len(given) == 3 and not any(given):
        return "must be longer than 0"
    return ""


def places_of(name: str, names: Sequence[str]) -> list[int]:
    """Returns the places of the inputs that a name with or without index stands for."""
    places = [i for i, known in enumerate(names) if name in (known, known.partition("[")[0])]
    if not places:
        raise ValueError(unknown("input", name, dict.fromkeys(n.partition("[")[0] for n in names)))
    return places
