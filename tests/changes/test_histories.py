"""Momentum books over histories of burns, transfers, moves, dockings and undockings, up to 20 vessels."""

from collections.abc import Iterable
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from changes.histories import (
    EVENTS,
    FLIGHT_ERROR,
    WHEEL_EVENTS,
    ByExchange,
    ByFmu,
    ByReference,
    ByTwin,
    Driver,
    assembly,
    books,
    flight,
    happening,
    start_values,
)
from supervessel import reference
from support import U, scene
from support.examples import examples
from support.marks import FMI

BOOKS = 64 * U
"""Of the sum of the magnitudes of all terms: what rounding may leave open."""


def histories_of(events: Iterable[str]) -> st.SearchStrategy[list[tuple[list[str], int]]]:
    """Returns lists of what happens at one instant, by kinds, with a seed."""
    kinds = st.lists(st.sampled_from(sorted(events)), min_size=1, max_size=3)
    return st.lists(st.tuples(kinds, st.integers(0, 2**32 - 1)), min_size=1, max_size=20)


HISTORIES, WHEEL_HISTORIES = histories_of(EVENTS), histories_of(WHEEL_EVENTS)
KEPT = [("rate", "momentum"), ("momentum", "momentum")]


def follow(raw: dict[str, Any], driver: Driver, history: list[tuple[list[str], int]]) -> None:
    """Flies a history; asserts that the books close over every event and every flight."""
    flown = scene(raw)
    values = start_values(flown)
    for kinds, seed in history:
        after = values | happening(flown, values, kinds, seed)
        old, attitude = driver.rates, driver.attitude
        driver.set({name: x for name, x in after.items() if values.get(name) != x})
        new = driver.rates
        assert new[3:].tolist() == old[3:].tolist()
        missing, size = books(flown, values, after, old, new)
        assert missing <= BOOKS * size, (kinds, seed, missing / size / U)
        assert driver.attitude.tolist() == attitude.tolist()
        values = after
        driver.fly(0.5)
        end, impulse = flight(flown, attitude, new, values, 0.5)
        momenta = [
            reference.rotation_matrix(q / np.linalg.norm(q))
            @ reference.angular_momentum(flown, rates, values)
            for q, rates in ((attitude, new), (driver.attitude, driver.rates))
        ]
        scale = size + np.abs(impulse).max()
        assert np.abs(momenta[1] - momenta[0] - impulse).max() <= FLIGHT_ERROR * scale
        assert np.abs(driver.rates - end[4:]).max() <= FLIGHT_ERROR * (1.0 + np.abs(end[4:]).max())


@pytest.mark.parametrize("kept", KEPT, ids=" ".join)
@examples(3, 10)
@given(seed=st.integers(0, 10**6), count=st.integers(2, 20), history=HISTORIES)
def test_the_reference_balances_momentum_over_random_histories(kept, seed, count, history):
    raw = assembly(seed, count, mass_change=kept[0], pose_change=kept[1])
    follow(raw, ByReference(raw), history)


@pytest.mark.parametrize("count", [3, 20])
@examples(3, 10)
@given(history=HISTORIES)
def test_the_fmu_balances_momentum_over_random_histories(count, history):
    raw = assembly(count, count, mass_change="rate", pose_change="momentum")
    driver = ByFmu(raw, optimised=count < 20)  # many vessels take half a minute
    follow(raw, driver, history)
    driver.instance.free()


@pytest.mark.parametrize("driver", [ByFmu, ByExchange])
@FMI
@pytest.mark.parametrize("kept", KEPT, ids=" ".join)
@examples(3, 5)
@given(history=HISTORIES)
def test_both_interfaces_of_the_fmu_balance_momentum_over_random_histories(kept, fmi, driver, history):
    raw = assembly(3, 3, mass_change=kept[0], pose_change=kept[1])
    flying = driver(raw, fmi)
    follow(raw, flying, history)
    flying.instance.free()


@pytest.mark.parametrize("count", [3, 20])
@pytest.mark.parametrize("kept", KEPT, ids=" ".join)
@examples(3, 5)
@given(history=HISTORIES)
def test_the_twin_balances_momentum_over_random_histories(kept, count, history):
    raw = assembly(count, count, mass_change=kept[0], pose_change=kept[1])
    follow(raw, ByTwin(raw), history)


@pytest.mark.parametrize("kept", KEPT, ids=" ".join)
@examples(3, 8)
@given(seed=st.integers(0, 10**6), count=st.integers(2, 8), history=WHEEL_HISTORIES)
def test_the_reference_balances_momentum_with_wheels(kept, seed, count, history):
    raw = assembly(seed, count, wheels=True, mass_change=kept[0], pose_change=kept[1])
    follow(raw, ByReference(raw), history)


@pytest.mark.parametrize("kept", KEPT, ids=" ".join)
@examples(3, 8)
@given(history=WHEEL_HISTORIES)
def test_the_twin_balances_momentum_with_wheels(kept, history):
    raw = assembly(7, 3, wheels=True, mass_change=kept[0], pose_change=kept[1])
    follow(raw, ByTwin(raw), history)


@pytest.mark.parametrize("driver", [ByFmu, ByExchange])
@examples(3, 8)
@given(history=WHEEL_HISTORIES)
def test_both_interfaces_of_the_fmu_balance_momentum_with_wheels(driver, history):
    raw = assembly(7, 3, wheels=True, mass_change="momentum", pose_change="momentum")
    flying = driver(raw)
    follow(raw, flying, history)
    flying.instance.free()
