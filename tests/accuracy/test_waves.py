"""Square waves along which errors grow: what growth is, against SciPy, and that the worst is found first."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fmu_build.accuracy.waves import HALVES, Ends, waves_that_grow

STEP, STEPS = 0.5, 120
RATE = np.array([0.05, 0.8, 0.1])
HEAVY, LIGHT = np.diag([1.0, 1.5, 1.9]), np.diag([1.0, 0.8, 1.2])
STILL = np.zeros((2, 3))


def flown(wave, ends, momentum, disturbance):
    """Returns the rate after each step, (steps, 3), by SciPy; disturbed once, after the first step."""
    rate, rates, before = RATE.copy(), [], None
    for k, first in enumerate(wave.at_first(STEPS)):
        J, push = ends.inertia[0 if first else 1], ends.push[0 if first else 1]
        if momentum and before is not None:
            rate = np.linalg.solve(J, before @ rate)
        before = J

        def turned(t, w, J=J, push=push):
            return push - np.linalg.solve(J, np.cross(w, J @ w))

        rate = solve_ivp(turned, (0.0, STEP), rate, "DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
        if k == 0:
            rate = rate + disturbance
        rates.append(rate)
    return np.array(rates)


@pytest.mark.parametrize("momentum", [False, True])
def test_along_the_first_wave_errors_grow_as_found_and_more_than_along_others(momentum):
    """Errors are added at each step; one alone adds up to less than all, by 120 times at most."""
    ends = Ends(np.array([HEAVY, LIGHT]), STILL)
    waves = waves_that_grow([ends], RATE, STEP, STEPS, momentum=momentum)
    assert {wave.half for wave in waves} == {half for half in HALVES if half < STEPS}
    grown = []
    for wave in (waves[0], waves[-1]):
        size = 1e-7
        apart = flown(wave, ends, momentum, size * np.array([0.6, 0.0, 0.8])) - flown(
            wave, ends, momentum, 0.0
        )
        grown.append(np.linalg.norm(apart, axis=1).sum() * STEP / size * np.linalg.norm(RATE))
    assert 0.3 * grown[0] <= waves[0].growth <= STEPS * grown[0]
    assert waves[0].growth > 3.0 * waves[-1].growth
    assert grown[0] > grown[1]


def test_what_acts_alone_is_followed_too_and_a_motion_beyond_all_bounds_grows_nothing():
    same = np.array([HEAVY, HEAVY])
    shaken = Ends(same, np.array([[0.1, 0.0, 0.0], [-0.1, 0.0, 0.0]]))
    [first, *_] = waves_that_grow([shaken], RATE, STEP, STEPS, momentum=False)
    assert np.isfinite(first.growth)
    assert first.growth > 1.0
    wild = Ends(same, np.array([[1e300, 1e300, 0.0], [1e300, 1e300, 0.0]]))
    assert {wave.growth for wave in waves_that_grow([wild], RATE, STEP, STEPS, momentum=False)} == {0.0}
    assert waves_that_grow([], RATE, STEP, STEPS, momentum=False) == []
    assert waves_that_grow([wild], RATE, STEP, 1, momentum=False) == []
