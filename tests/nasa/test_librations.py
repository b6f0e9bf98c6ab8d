"""Librations on a circular orbit, flown by the FMU: their frequencies, and what the motion keeps."""

import numpy as np
import pytest

from nasa.librations import (
    PERIOD,
    coupled_frequencies,
    flown,
    frequencies,
    frequency,
    invariant,
    pitch_frequency,
    raw_scene,
    small,
)
from support import Array

FINE = {"tolerance": 1e-15}
ONE_KICK = {"tolerance": 0.1}  # nothing here reaches it: split takes one step a communication step
LARGE = (0.3, -0.4, 0.5)  # rad
STEPS = 96  # of a revolution
EVERY = 4  # steps between samples of which frequencies are found
INTERVAL = EVERY * PERIOD / STEPS  # s


def test_pitch_librates_at_its_frequency() -> None:
    # An amplitude a lowers it by a^2/4 of itself; measured: within 1.2e-10 of that over 40 revolutions.
    amplitude = 1e-3
    states = small(flown(raw_scene("taylor", **FINE), (0.0, 0.0, amplitude), 40 * STEPS, every=EVERY))
    found = frequency(states.pitch, INTERVAL) / pitch_frequency()
    assert abs(found - 1.0) <= 1e-6
    assert found == pytest.approx(1.0 - amplitude**2 / 4.0, rel=1e-9)


@pytest.mark.parametrize(("amplitude", "bound"), [(1e-3, 1e-6), (1e-4, 1e-8)])
def test_roll_and_yaw_librate_at_the_roots_of_their_quartic(amplitude: float, bound: float) -> None:
    # Measured: 4.7e-7 and 2.2e-8 at 1e-3 rad, a hundredth of it at 1e-4 rad.
    turn = (amplitude, amplitude, 0.0)
    states = small(flown(raw_scene("taylor", **FINE), turn, 80 * STEPS, every=EVERY))
    found = frequencies([states.roll, states.yaw], INTERVAL)
    assert found == pytest.approx(coupled_frequencies(), rel=bound)


def energies_of(propagator: str, rotation: dict[str, float], revolutions: int, revolution: int) -> Array:
    """Returns the invariant over n^2 times the largest moment at every 41st of so many steps a revolution."""
    raw, count = raw_scene(propagator, **rotation), revolutions * revolution
    states = flown(raw, LARGE, count, revolution=revolution, every=41, optimised=count >= 1e6 - revolution)
    return np.array([invariant(state, angle) for angle, state in states])


@pytest.mark.parametrize("propagator", ["taylor", "dop853"])
def test_a_circular_orbit_has_an_invariant(propagator: str) -> None:
    # Measured: 1.5e-14 and 5.6e-15 of J n^2 over 200 revolutions; rounding makes it grow.
    assert np.ptp(energies_of(propagator, FINE, 100, revolution=96)) <= 1e-13


def test_strang_splitting_swings_about_the_invariant_and_stays() -> None:
    # Measured: a swing of 3.6e-5, some 0.1 (n h)^2; the means of the halves differ by 2e-7.
    energies = energies_of("split", ONE_KICK, 40, revolution=384)
    assert 1e-5 <= np.ptp(energies) <= 6e-5
    first, second = np.array_split(energies, 2)
    assert abs(first.mean() - second.mean()) <= 2e-6


@pytest.mark.stability
@pytest.mark.parametrize("propagator", ["taylor", "dop853"])
def test_a_million_steps_keep_the_invariant(propagator: str) -> None:
    # Measured: 2.4e-13 by taylor, 2.0e-13 by dop853, of J n^2, over 10 416 revolutions.
    assert np.ptp(energies_of(propagator, FINE, 10_416, revolution=96)) <= 1e-12


@pytest.mark.stability
def test_a_million_steps_of_strang_splitting_do_not_drift() -> None:
    # Measured: twenty parts are 1.9e-7 to 4.5e-7 below the start in the mean; a swing of 3.7e-5.
    energies = energies_of("split", ONE_KICK, 2604, revolution=384)
    parts = [part.mean() for part in np.array_split(energies, 20)]
    assert np.ptp(energies) <= 6e-5
    assert np.ptp(parts) <= 1e-6
