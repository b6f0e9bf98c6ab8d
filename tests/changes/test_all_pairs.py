"""Every unknown by every known, in every mode of both interfaces: derivatives, differences, dependencies."""

import numpy as np
import pytest

from changes.pairs import OF_VESSELS, SCENES, SHOWN, Found, Place, everywhere
from changes.scenes import TUG, TUG_EVENTS
from support import EPS, OK, Instance, variant
from support.marks import some_at_once


@pytest.mark.parametrize(
    ("name", "fmi"),
    some_at_once(
        [*((name, 3) for name in SCENES), *((name, 2) for name in ("mixed", "momentum", "no docks"))],
        ("mixed", 3),
        ("no docks", 2),
    ),
)
def test_derivatives_are_differences_of_what_is_read_and_all_that_counts_is_declared(name, fmi):
    assert everywhere(SCENES[name], fmi).problems == []


@pytest.mark.parametrize("place", ["me continuous", "me event", "cs stepping"])
def test_the_motion_of_the_only_port_that_moves_is_declared_too(place):
    at, found = Place(variant(TUG, {"name": "arm", "inputs.motion": ["tug.arm"]}), place, ()), Found()
    at.compare(found)
    at.free()
    assert found.problems == []
    assert ("angular_velocity[1]", "tug.arm.velocity[3]") in found.moved


def test_derivatives_are_finite_while_a_vessel_is_detached_or_comes_back():
    raw = variant(TUG, {"outputs.names": [*SHOWN[:10], *(f"tank.{what}" for what in OF_VESSELS)]})
    for inputs in ({"held.docked": 0.0}, *TUG_EVENTS[1:]):
        instance = Instance(raw)
        assert instance.initialise() == OK
        assert instance.set(inputs) == OK
        variables = [v for v in instance.description.modelVariables if v.type != "Boolean"]
        knowns = [v.name for v in variables if v.causality == "input"]
        unknowns = [v.name for v in variables if v.causality == "output"]
        forward = np.array([instance.directional(unknowns, [name], [1.0]) for name in knowns]).T
        adjoint = np.array([instance.adjoint([name], knowns, [1.0]) for name in unknowns])
        assert np.isfinite(forward).all()
        # Terms that cancel are as large as the largest derivative; a few hundred roundings.
        assert np.abs(forward - adjoint).max() <= 512 * EPS * (1.0 + np.abs(forward).max())
        instance.free()
