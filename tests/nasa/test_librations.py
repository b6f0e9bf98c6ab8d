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


@pytest.mark.parametrize("propagator", ["taylor", "dop853"])
def test_a_circular_orbit_has_an_invariant(propagator: str) -> None:
    # Measured: 1.5e-14 and 5.6e-15 of J n^2 over 200 revolutions; rounding makes it grow.
    states = flown(raw_scene(propagator, **FINE), LARGE, 100 * STEPS, every=8)
    energies = np.array([invariant(state, angle) for angle, state in states])
    assert np.ptp(energies) <= 1e-13
