"""Apollo's published sheet and a tank that drains: what the page says is what they print, and it is right."""

import apollo
import draining
import numpy as np
import pytest

from supervessel import load_scene
from support.pages import ROOT, text

INCH_HALF = 0.05
"""Rounding of the sheet's stations [in]."""


@pytest.mark.parametrize("part", [apollo.comparison, apollo.spread])
def test_the_page_has_apollos_tables(part):
    assert part() in text("examples/README.md")


def test_the_scene_has_the_rows_of_the_sheet():
    scene = load_scene(ROOT / "examples" / "apollo.toml")
    for name in ("CSM", "LM"):
        mass, centre, tensor = apollo.published(name)
        vessel = scene.vessels[name]
        assert abs(vessel.mass - mass) <= 0.005
        assert np.abs(np.subtract(vessel.centre_of_mass, centre)).max() <= 5e-6
        assert np.abs(np.subtract(vessel.tensor, tensor)).max() <= 0.05
    assert scene.notes == ()


def test_the_reports_sum_follows_from_its_parts_within_their_rounding():
    """The stations' rounding moves the parallel-axis part by m |2 d|, m the reduced mass, d the distances."""
    (one, first, _), (other, second, _) = (apollo.published(name) for name in ("CSM", "LM"))
    total, centre, theirs = apollo.published("total docked")
    mass, barycentre, ours = apollo.composite()
    reduced = one * other / (one + other)
    d, rounding = np.abs(second - first), 2.0 * INCH_HALF * apollo.INCH
    units = 1.5 * apollo.SLUG_FT2
    assert abs(mass - total) <= 0.1 * apollo.POUND
    assert np.abs(barycentre - centre).max() <= rounding
    for i in range(3):
        for j in range(3):
            moved = [k for k in range(3) if k != i] if i == j else [i, j]
            allowed = reduced * rounding * (2.0 if i == j else 1.0) * (d[moved].sum() + rounding)
            assert abs(ours[i, j] - theirs[i, j]) <= allowed + units, (i, j)


def test_products_of_the_other_sign_would_not_add_up():
    """The xy product: the parts' own change sign, their distances do not."""
    _, _, theirs = apollo.published("total docked")
    _, _, ours = apollo.composite()
    own = sum(apollo.published(name)[2][0, 1] for name in ("CSM", "LM"))
    assert abs(ours[0, 1] - theirs[0, 1]) < 0.05 * abs(ours[0, 1] - 2.0 * own - theirs[0, 1])


def test_what_orbiter_tells_is_the_sum_over_its_six_points():
    """Its points are at 1/2 sqrt(k_2 + k_3 - k_1), ... from the barycentre, and none is a sixth of a mass."""
    pmi, away = np.array([2.0, 5.0, 6.0]), np.array([0.3, -0.4, 1.5])
    half = 0.5 * np.sqrt(pmi.sum() - 2.0 * pmi)
    points = np.vstack([np.diag(half), -np.diag(half)]) + away
    squares = (points**2).sum(axis=0)
    assert np.allclose(apollo.told_by_orbiter(pmi, away, np.zeros(3)), squares.sum() - squares, rtol=1e-14)


@pytest.mark.parametrize("number", [0, 2])
def test_the_page_has_what_the_draining_tank_does(number):
    assert draining.row(list(draining.ways())[number]) in text("examples/README.md")


def test_the_page_has_the_tanks_motion_by_quadrature():
    rate, angle = draining.by_quadrature()
    assert f"| by hand, integrated by SciPy | 0 | 0 | {rate:.4f} | {angle:.3f} | 0 |" in text(
        "examples/README.md"
    )


def test_slices_come_nearer_as_the_square_of_their_number():
    few, many = (draining.worst(*draining.sliced(count)) for count in (4, 16))
    assert 12.0 < few[0] / many[0] < 17.0
    assert 10.0 < few[1] / many[1] < 20.0


def test_a_part_that_moves_is_the_column():
    place, across = draining.worst(load_scene(draining.SCENE), draining.moved)
    assert place < 1e-9
    assert across < 1e-9
