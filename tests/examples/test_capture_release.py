"""The capture and release: the books close, with jumps that matter, and the page says what is printed."""

import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from support.pages import text

ROOT = Path(__file__).parents[2]
sys.path.append(str(ROOT / "examples"))

import capture_release as example  # noqa: E402

CLOSED = np.array([1e-13, 1e-12])
"""Of the linear and of the angular momentum that has been booked, over 2400 steps: thirty times what was met,
for other machines. The tolerance of the FMU's steps, 1e-13 rad, is in the second."""


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    folder = tmp_path_factory.mktemp("capture")
    kept = []
    draw, example.draw = example.draw, lambda flight, path: (kept.append(flight), draw(flight, path))
    example.main(folder)
    example.draw = draw
    return kept[0], folder


def test_linear_and_angular_momentum_close_over_the_whole_flight(flown):
    flight, _ = flown
    assert len(flight.missing) == 2400
    assert np.all(np.array(flight.missing) <= CLOSED * flight.size)
    assert flight.size.min() > 1e4


def test_without_the_jumps_they_would_not(flown):
    flight, _ = flown
    _, jump, velocity_jump, _ = flight.events["capture"]
    assert jump > 0.5
    assert 40.0 < 1900.0 * velocity_jump < 50.0


def test_the_satellite_flies_on_as_it_was_let_go(flown):
    flight, _ = flown
    rates = np.array(flight.rates)[:, 1]
    release = round(example.RELEASE / example.STEP)
    assert np.all(np.isnan(rates[:release]))
    assert 1e-4 < np.linalg.norm(rates[release]) < 2e-3
    assert np.linalg.norm(rates[-1] - rates[release]) < 1e-4


def test_the_page_says_what_is_printed(flown):
    """But for what is missing, which is rounding."""
    flight, folder = flown
    for name, (time, jump, velocity_jump, _) in flight.events.items():
        assert f"| {name} | {time:.1f} | {jump:.6f} | {velocity_jump:.6f} |" in text("examples/README.md")
    booked = "| booked in all | | | | {:.0f} | {:.0f} |".format(*flight.size)
    assert booked in text("examples/README.md")
    assert imread(folder / "capture_release.png").std() > 0.05
