"""Inputs by name: the elements of p that a name stands for, and values given by names."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from supervessel.problems import unknown
from supervessel.scene.variables import InputVariable


def settled(
    fixed: bool | Iterable[str] | Mapping[str, ArrayLike], inputs: Sequence[InputVariable]
) -> dict[int, float]:
    """Returns, by place in p, the values of the inputs that are to be numbers instead of elements of p.

    fixed  : False: none; True: all, with the scene's values; names, with or without index: these, with the
             scene's values; a mapping from names to values: these, with the values given
    inputs : the inputs p in their order
    Raises ValueError, as `placed_values` and `places_of`.
    """
    if isinstance(fixed, Mapping):
        return placed_values(fixed, inputs)
    if isinstance(fixed, bool):
        return {i: variable.start for i, variable in enumerate(inputs)} if fixed else {}
    if isinstance(fixed, str):
        fixed = (fixed,)
    return {i: inputs[i].start for name in fixed for i in places_of(name, inputs)}


def placed_values(values: Mapping[str, ArrayLike], inputs: Sequence[InputVariable]) -> dict[int, float]:
    """Returns values by their places among inputs.

    values : by name, with or without index, a number or as many numbers as the name has elements
    Raises ValueError for an unknown name, a wrong count, and a number that is not finite or that the input
    can never have.
    """
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
    """Returns the places of the inputs that a name, with or without index, stands for.

    Raises ValueError for an unknown name, with the nearest known one.
    """
    places = [i for i, variable in enumerate(inputs) if name in (variable.name, variable.group)]
    if not places:
        raise ValueError(unknown("input", name, dict.fromkeys(variable.group for variable in inputs)))
    return places
