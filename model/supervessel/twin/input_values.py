"""Inputs by name: which elements of p a name stands for."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from supervessel.problems import unknown
from supervessel.scene.variables import InputVariable


def settled(
    fixed: bool | Iterable[str] | Mapping[str, ArrayLike], inputs: Sequence[InputVariable]
) -> dict[int, float]:
    """Returns the values of inputs that are numbers, by their places in p."""
    if isinstance(fixed, Mapping):
        return placed_values(fixed, inputs)
    if isinstance(fixed, bool):
        return {i: variable.start for i, variable in enumerate(inputs)} if fixed else {}
    if isinstance(fixed, str):
        fixed = (fixed,)
    return {i: inputs[i].start for name in fixed for i in places_of(name, inputs)}


def placed_values(values: Mapping[str, ArrayLike], inputs: Sequence[InputVariable]) -> dict[int, float]:
    """Returns values by their places among inputs. Raises ValueError for what an input can never have."""
    placed: dict[int, float] = {}
    for name, value in values.items():
        places, given = places_of(name, inputs), np.ravel(np.asarray(value, dtype=float))
        if len(given) != len(places) or not np.isfinite(given).all():
            count = "a finite number" if len(places) == 1 else f"{len(places)} finite numbers"
            raise ValueError(f"{name} = {value!r}: must be {count}")
        problem = inputs[places[0]].kind.problem(given.tolist())
        if problem:
            raise ValueError(f"{name} = {value!r}: {problem}")
        placed |= dict(zip(places, given.tolist(), strict=True))
    return placed


def places_of(name: str, inputs: Sequence[InputVariable]) -> list[int]:
    """Returns the places of the inputs that a name with or without index stands for."""
    places = [i for i, variable in enumerate(inputs) if name in (variable.name, variable.group)]
    if not places:
        raise ValueError(unknown("input", name, dict.fromkeys(variable.group for variable in inputs)))
    return places
