"""What goes with what: the page's tables cell by cell, and FMUs of a sample of the cells."""

from itertools import product

import pytest

from features.matrix import (
    DISCARDS,
    FEATURES,
    LAWS,
    PAGE,
    SOURCE,
    against,
    scene_with,
    section,
    tables,
    traded,
    traded_scene,
)
from fmu_build.flight.choices import variant_of
from supervessel import parse_scene
from supervessel.equations import equations
from supervessel.scene.schema import PROPAGATOR_NAMES
from support import DISCARD, OK, Instance

CELLS = list(product(FEATURES, LAWS, PROPAGATOR_NAMES))
HAS_EQUATIONS = [cell for cell in CELLS if cell[1] in ("tensor", "none")]
"""The laws with most and with fewest terms."""


def test_the_page_has_these_tables():
    assert section() == tables(), f"PYTHONPATH=tests python -m features.matrix writes {PAGE} anew"


@pytest.mark.parametrize("propagator", PROPAGATOR_NAMES)
def test_what_goes_has_equations(propagator):
    """What is refused is known to be, by its reasons on the page."""
    for feature, law, name in HAS_EQUATIONS:
        if name == propagator and against(feature, law, name) in ((), (DISCARDS,)):
            assert equations(parse_scene(scene_with(feature, law, name), SOURCE)).names.y


@pytest.mark.parametrize("feature", FEATURES)
def test_what_a_trade_tries_is_no_scene_that_is_refused(feature):
    scene = traded_scene(feature)
    kinds = {(choice.model, choice.propagator): choice for choice in traded(feature)}
    for choice in kinds.values():
        assert variant_of(scene, choice).rotation.law == choice.model.law


ACTING = {
    "torque, forces": {"torque": [0.0, 0.0, 1.0]},
    "wheels": {"A.w.torque": 1.0},
    "ports that move": {"B.q.rate": [0.0, 0.1, 0.0]},
    "docks that open": {"berth.docked": False},
}
"""What is set before a step."""


@pytest.mark.parametrize(
    ("feature", "law", "propagator"),
    [
        ("torque, forces", "tensor", "exact"),
        ("gravity", "none", "exact"),
        ("ports that move", "tensor", "exact"),
        ("ports that move", "decoupled", "exact"),
        ("gravity", "principal", "split"),
        ("wheels", "decoupled", "taylor"),
        ("ports that move", "principal", "rk4"),
    ],
)
def test_an_fmu_does_what_the_table_says(feature, law, propagator):
    fmu = Instance(scene_with(feature, law, propagator), optimised=False)
    assert fmu.initialise() == OK
    assert fmu.set(ACTING.get(feature, {})) == OK
    assert fmu.step(0.5) == (DISCARD if against(feature, law, propagator) == (DISCARDS,) else OK), fmu.log
    fmu.free()
