"""Derivatives of what the FMU gives while inputs change, against differences of its own values."""

from typing import Any

import numpy as np
import pytest

from changes.histories import EVENTS, Array, Values, assembly, elements, start_values
from changes.scenes import TUG, TUG_EVENTS
from support import EPS, OK, Instance, scene, variant

OF_VESSELS = ("origin", "centre_of_mass", "attitude", "angular_velocity", "angular_momentum")
OF_ALL = ("mass", "barycentre", "pmi", "inertia", "angular_velocity", "attitude", "kinetic_energy")
SHOWN = [*OF_ALL, "angular_momentum", "principal_moments", "net_force"]
SHOWN += [f"{vessel}.{what}" for vessel in ("V0", "V1", "V2") for what in OF_VESSELS]
PLACES: list[tuple[str, tuple[str, ...]]] = [
    ("cs initialising", ()),
    ("cs stepping", ()),
    ("cs stepping", ("undock", "transfer", "move")),
    ("events event", ()),
    ("events event", ("transfer", "move")),
    ("me initialising", ()),
    ("me event", ("undock", "move")),
]


class Flight:
    """An instance at a place of its life, inputs drawn and some of them changed there."""

    def __init__(self, raw: dict[str, Any], place: str, kinds: tuple[str, ...]) -> None:
        interface, self.mode = place.split()
        self.exchange, flown, rng = interface == "me", scene(raw), np.random.default_rng(0)
        options = {"eventModeUsed": True} if interface == "events" else {}
        self.instance = Instance(raw, exchange=self.exchange, optimised=False, **options)
        values = start_values(flown)
        vectors = [f"{name}.{key}" for name in flown.inputs.motion for key in ("velocity", "rate")]
        vectors += [f"{name}.force" for name in flown.inputs.force]
        vectors += [f"{name}.torque" for name in flown.inputs.vessel_torque]
        for name in (*vectors, "torque"):
            values |= elements(name, rng.normal(size=3))
        for name in flown.inputs.pmi:
            values |= elements(f"{name}.pmi", flown.vessels[name].pmi or ())
        assert self.instance.enter() == OK
        assert self.instance.set(values) == OK
        if self.mode != "initialising":
            self._bring(interface)
            for kind in kinds:
                values |= (change := EVENTS[kind](flown, values, rng))
                assert self.instance.set(change) == OK
        variables = [v for v in self.instance.description.modelVariables if v.type != "Boolean"]
        states = [v.name for v in variables if v.name.startswith("state.")]
        self.held = states if self.exchange and self.mode != "initialising" else []
        self.knowns = [v.name for v in variables if v.causality == "input"] + self.held
        self.unknowns = [v.name for v in variables if v.causality == "output"]
        if self.mode == "initialising":
            self.knowns += [v.name for v in variables if v.causality == "parameter"]
            self.unknowns += states
        if self.exchange:
            self.unknowns += [v.name for v in variables if v.name.startswith("der(")]
        self.states = {name: self.instance.get(name) for name in self.held}
        self.saved = self.instance.fmu.getFMUState()

    def _bring(self, interface: str) -> None:
        instance = self.instance
        assert instance.exit() == OK
        if interface == "events":
            instance.fmu.updateDiscreteStates()
            assert instance._status(instance.fmu.enterStepMode) == OK
        assert (instance.run() if self.exchange else instance.step(0.25)) == OK
        if self.mode == "event":
            assert instance._status(instance.fmu.enterEventMode) == OK

    def values(self, changed: Values) -> Array:
        """Returns the unknowns with some knowns changed, states as they are unless they are among these."""
        instance = self.instance
        instance.fmu.setFMUState(self.saved)
        assert instance.set({n: x for n, x in changed.items() if n not in self.held}) == OK
        if self.held:
            assert instance.set(self.states | {n: x for n, x in changed.items() if n in self.held}) == OK
        return np.array(instance.fmu.getFloat64([instance.references[n] for n in self.unknowns]))

    def differences(self, name: str) -> tuple[Array, Array]:
        """Returns derivatives by a known and the errors of these.

        Central differences at steps h, h/2, h/4, of which the terms in h^2 are taken off; how two of those
        differ bounds what is left. Values are rounded, after a hundred operations each, to 256 EPS.
        """
        self.instance.fmu.setFMUState(self.saved)
        x, size = self.instance.get(name), np.abs(self.values({}))
        steps = [max(abs(x), 0.1) * 1e-3 / 2**i for i in range(3)]
        d = [(self.values({name: x + h}) - self.values({name: x - h})) / (2.0 * h) for h in steps]
        first, second = (4.0 * d[1] - d[0]) / 3.0, (4.0 * d[2] - d[1]) / 3.0
        largest = np.array([size[self.group(n)].max() for n in self.unknowns])
        return second, np.abs(second - first) + 256 * EPS * largest / steps[2]

    def group(self, name: str) -> list[int]:
        """Returns where the vector stands whose element this is."""
        return [i for i, n in enumerate(self.unknowns) if n.partition("[")[0] == name.partition("[")[0]]

    def both(self) -> tuple[Array, Array]:
        """Returns the matrix of derivatives of unknowns by knowns, by columns forward and by rows adjoint."""
        self.instance.fmu.setFMUState(self.saved)
        columns = [self.instance.directional(self.unknowns, [name], [1.0]) for name in self.knowns]
        rows = [self.instance.adjoint([name], self.knowns, [1.0]) for name in self.unknowns]
        return np.array(columns).T, np.array(rows)


@pytest.mark.parametrize("law", ["tensor", "principal"])
@pytest.mark.parametrize(
    "kept", [("rate", "momentum"), ("momentum", "momentum"), ("momentum", "rate")], ids=" ".join
)
def test_derivatives_are_those_of_what_is_read(kept, law):
    raw = assembly(4, 3, mass_change=kept[0], pose_change=kept[1], law=law)
    raw = variant(raw, {"outputs.names": SHOWN})
    for place, kinds in PLACES:
        flight = Flight(raw, place, kinds)
        forward, adjoint = flight.both()
        assert np.isfinite(forward).all()
        for i, name in enumerate(flight.knowns):
            found, error = flight.differences(name)
            off = np.abs(forward[:, i] - found) > error
            assert not off.any(), (
                place,
                kinds,
                name,
                [n for n, o in zip(flight.unknowns, off, strict=True) if o],
            )
        size = np.abs(flight.values({}))[:, None] + np.abs(forward).max(axis=1, keepdims=True)
        # Terms that cancel are as large as the values or the largest derivative; a few hundred roundings.
        assert (np.abs(forward - adjoint) <= 512 * EPS * (1.0 + size)).all(), (place, kinds)
        flight.instance.free()


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
        # As above.
        assert np.abs(forward - adjoint).max() <= 512 * EPS * (1.0 + np.abs(forward).max())
        instance.free()
