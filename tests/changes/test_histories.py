"""Momentum books over histories of burns, transfers, moves, dockings and undockings, up to 20 vessels."""

from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import Phase, given, settings

from changes.histories import (
    EVENTS,
    FLIGHT_ERROR,
    ByExchange,
    ByFmu,
    ByReference,
    ByTwin,
    Driver,
    Values,
    assembly,
    books,
    flight,
    happening,
    start_values,
    stored_in_wheels,
)
from supervessel import Scene, reference
from support import Array, U, scene
from support.marks import FMI

BOOKS = 64 * U
"""Of the sum of the magnitudes of all terms: what rounding may leave open."""

HISTORIES = st.lists(
    st.tuples(st.lists(st.sampled_from(sorted(EVENTS)), min_size=1, max_size=3), st.integers(0, 2**32 - 1)),
    min_size=1,
    max_size=20,
)
KEPT = [("rate", "momentum"), ("momentum", "momentum")]


def momentum_of(flown: Scene, omega: Array, values: Values) -> Array:
    """Returns the angular momentum, that of wheels included, (3,) [N m s], body axes."""
    locked, stored = stored_in_wheels(flown, values)
    J, h = reference.composite(flown, values).inertia, reference.internal_momentum(flown, values)
    momentum: Array = (J - locked) @ omega + h + stored
    return momentum


def follow(raw: dict[str, Any], driver: Driver, history: list[tuple[list[str], int]]) -> None:
    """Flies a history; asserts that the books close over every event and every flight."""
    flown = scene(raw)
    values = start_values(flown)
    for kinds, seed in history:
        after = values | happening(flown, values, kinds, seed)
        old, attitude = driver.angular_velocity, driver.attitude
        driver.set({name: x for name, x in after.items() if values.get(name) != x})
        new = driver.angular_velocity
        missing, size = books(flown, values, after, old, new)
        assert missing <= BOOKS * size, (kinds, seed, missing / size / U)
        assert driver.attitude.tolist() == attitude.tolist()
        values = after
        driver.fly(0.5)
        end, impulse = flight(flown, attitude, new, values, 0.5)
        momenta = [
            reference.rotation_matrix(q / np.linalg.norm(q)) @ momentum_of(flown, omega, values)
            for q, omega in ((attitude, new), (driver.attitude, driver.angular_velocity))
        ]
        scale = size + np.abs(impulse).max()
        assert np.abs(momenta[1] - momenta[0] - impulse).max() <= FLIGHT_ERROR * scale
        assert np.abs(driver.angular_velocity - end[4:]).max() <= FLIGHT_ERROR * (1.0 + np.abs(end[4:]).max())


@pytest.mark.parametrize("kept", KEPT, ids=" ".join)
@settings(deadline=None, derandomize=True, max_examples=10, phases=(Phase.explicit, Phase.generate))
@given(seed=st.integers(0, 10**6), count=st.integers(2, 20), history=HISTORIES)
def test_the_reference_balances_momentum_over_random_histories(kept, seed, count, history):
    raw = assembly(seed, count, mass_change=kept[0], pose_change=kept[1])
    follow(raw, ByReference(raw), history)


@pytest.mark.parametrize("count", [3, 20])
@settings(deadline=None, derandomize=True, max_examples=10, phases=(Phase.explicit, Phase.generate))
@given(history=HISTORIES)
def test_the_fmu_balances_momentum_over_random_histories(count, history):
    raw = assembly(count, count, mass_change="rate", pose_change="momentum")
    driver = ByFmu(raw, optimised=count < 20)  # many vessels take half a minute
    follow(raw, driver, history)
    driver.instance.free()


@pytest.mark.parametrize("driver", [ByFmu, ByExchange])
@FMI
@pytest.mark.parametrize("kept", KEPT, ids=" ".join)
@settings(deadline=None, derandomize=True, max_examples=5, phases=(Phase.explicit, Phase.generate))
@given(history=HISTORIES)
def test_both_interfaces_of_the_fmu_balance_momentum_over_random_histories(kept, fmi, driver, history):
    raw = assembly(3, 3, mass_change=kept[0], pose_change=kept[1])
    flying = driver(raw, fmi)
    follow(raw, flying, history)
    flying.instance.free()


@pytest.mark.parametrize("driver", [ByFmu, ByExchange, ByTwin])
@pytest.mark.parametrize("kept", KEPT, ids=" ".join)
@settings(deadline=None, derandomize=True, max_examples=5, phases=(Phase.explicit, Phase.generate))
@given(history=HISTORIES)
def test_the_books_hold_the_momentum_of_wheels_over_random_histories(kept, driver, history):
    raw = assembly(7, 3, wheels=True, mass_change=kept[0], pose_change=kept[1])
    assert all(vessel["wheels"] for vessel in raw["vessels"].values())
    flying = driver(raw)
    follow(raw, flying, history)
    if not isinstance(flying, ByTwin):
        flying.instance.free()


@pytest.mark.parametrize("count", [3, 20])
@pytest.mark.parametrize("kept", KEPT, ids=" ".join)
@settings(deadline=None, derandomize=True, max_examples=5, phases=(Phase.explicit, Phase.generate))
@given(history=HISTORIES)
def test_the_twin_balances_momentum_over_random_histories(kept, count, history):
    raw = assembly(count, count, mass_change=kept[0], pose_change=kept[1])
    follow(raw, ByTwin(raw), history)
