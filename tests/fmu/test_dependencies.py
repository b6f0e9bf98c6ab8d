"""Dependencies of the model description, against the Jacobian."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from fmu.jacobians import (
    NAME,
    SCENES,
    SEED,
    columns,
    initialising,
    knowns,
    standing,
    start_names,
    unknowns,
    values,
)
from support import Instance

SIGNIFICANT = 1e-9  # of the row: what is smaller in all of DRAWS points is the rounding of a zero
DRAWS = 4


def declared(elements: Any, rows: Sequence[str]) -> dict[str, dict[str, str]]:
    """Returns what the model description says: unknown -> known -> kind."""
    found = {
        element.variable.name: {
            known.name: kind
            for known, kind in zip(element.dependencies, element.dependenciesKind, strict=True)
        }
        for element in elements
    }
    assert sorted(found) == sorted(rows)
    return found


def jacobians(name: str, exchange: bool) -> list[np.ndarray]:
    """Returns Jacobians at points drawn: of model exchange, else of initialisation."""
    results = []
    for draw in range(DRAWS):
        at = values(name, "drawn", SEED + draw)
        if exchange:
            instance, rows, by = standing(name, at), unknowns(name), knowns(name)
        else:
            instance, at = initialising(name, 1.0 + draw)
            rows, by = start_names(name)
        results.append(columns(instance, rows, by))
        instance.free()
    return results


@pytest.mark.parametrize("exchange", [True, False], ids=["running", "initialising"])
@NAME
def test_dependencies_are_exactly_what_the_jacobian_shows(name, exchange):
    instance = Instance(SCENES[name])
    md = instance.description
    rows, by = (unknowns(name), knowns(name)) if exchange else start_names(name)
    elements = [*md.outputs, *md.derivatives] if exchange else md.initialUnknowns
    kinds = declared(elements, rows)
    found, at = np.max(np.abs(jacobians(name, exchange)), axis=0), np.abs(values(name, "drawn"))
    sizes = np.where(at == 0.0, 1.0, at)
    if not exchange:
        sizes = np.concatenate([sizes[:-7], sizes[-3:], sizes[-7:-3]])
    weights = found * sizes
    significant = weights > SIGNIFICANT * weights.max(axis=1, keepdims=True)
    shown = {
        row: {known for known, s in zip(by, line, strict=True) if s}
        for row, line in zip(rows, significant, strict=True)
    }
    assert {row: set(line) for row, line in kinds.items()} == shown
    instance.free()


@pytest.mark.parametrize("exchange", [True, False], ids=["running", "initialising"])
@NAME
def test_a_dependency_declared_constant_has_the_same_factor_everywhere(name, exchange):
    instance = Instance(SCENES[name])
    md = instance.description
    rows, by = (unknowns(name), knowns(name)) if exchange else start_names(name)
    kinds = declared([*md.outputs, *md.derivatives] if exchange else md.initialUnknowns, rows)
    one, *others = jacobians(name, exchange)
    varying = [
        (row, known)
        for row, line in kinds.items()
        for known, kind in line.items()
        if kind == "constant"
        and any(
            other[rows.index(row), by.index(known)] != one[rows.index(row), by.index(known)]
            for other in others
        )
    ]
    assert varying == []
    instance.free()
