"""Every unknown of an FMU by every known, in every mode: derivatives, differences, declared dependencies.

    python -m changes.pairs [SEEDS]

flies the scenes of the test, and assemblies of as many seeds more, and prints the worst figures met.
"""

import sys
from collections.abc import Iterator
from ctypes import c_double, c_uint32
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from fmpy.fmi1 import FMICallException

from changes.histories import EVENTS, Values, assembly, elements, legal, start_values
from support import EPS, ISS_DG, OK, TURNING, Array, Instance, scene, variant

OF_VESSELS = ("origin", "centre_of_mass", "attitude", "angular_velocity", "angular_momentum", "velocity")
OF_BARYCENTRE = ("barycentre_velocity", "barycentre_jump", "barycentre_velocity_jump")
OF_ALL = ("mass", "barycentre", "pmi", "inertia", "angular_velocity", "attitude", "kinetic_energy")
SHOWN = [*OF_ALL, "angular_momentum", "principal_moments", "principal_axes", "error_estimate", "net_force"]


def shown(raw: dict[str, Any], *vessels: str) -> dict[str, Any]:
    """Returns the scene with every output that it can have, those of some vessels among them."""
    names = [*SHOWN, *OF_BARYCENTRE, *(f"{vessel}.{what}" for vessel in vessels for what in OF_VESSELS)]
    if not (raw["inputs"].get("force")):
        names.remove("net_force")
    return variant(raw, {"outputs.names": names})


def drawn(seed: int, masses: str, poses: str, law: str = "tensor", count: int = 3) -> dict[str, Any]:
    """Returns an assembly whose inputs are of every kind, but for motion where poses keep the rate."""
    raw = assembly(seed, count, mass_change=masses, pose_change=poses, law=law)
    return shown(raw, *list(raw["vessels"])[:3])


SCENES: dict[str, dict[str, Any]] = {
    "mixed": drawn(4, "rate", "momentum"),
    "mixed the other way": drawn(4, "momentum", "rate", "principal"),
    "momentum": drawn(4, "momentum", "momentum", "principal"),
    "rate": drawn(4, "rate", "rate", "decoupled"),
    "no law": drawn(4, "rate", "rate", "none"),
    "no docks": variant(shown(ISS_DG, "DG"), {"name": "undocked_never", "rotation": TURNING}),
}
"""Assemblies with docks, and one without, whose defaults are not touched."""

LOOSE = ("undock", "then")

PLACES: list[tuple[str, tuple[str, ...]]] = [
    ("cs initialising", ()),
    ("cs stepping", ()),
    (
        "cs stepping",
        (
            *LOOSE,
            "dock",
        ),
    ),
    ("cs stepping", ("undock", "transfer", "move")),
    ("events event", (*LOOSE, "dock", "move")),
    ("events event", ("transfer", "move")),
    ("me initialising", ()),
    ("me event", ()),
    (
        "me event",
        (
            *LOOSE,
            "dock",
        ),
    ),
    ("me event", (*LOOSE, "dock", "transfer", "move")),
    ("me event", ("undock", "move")),
    ("me continuous", (*LOOSE, "dock", "move")),
]
"""Interface and mode, and what happens there: what stands before "then" has happened. In event mode, and
between steps, the rest is about to; in continuous-time mode it has."""


POSES = (".position", ".direction", ".alignment")

SIGNIFICANT = 1e-9
"""Of the largest derivative of an unknown, by knowns of their magnitudes: what is smaller may be the rounding
of a zero."""


REACH = 30.0
"""m, m/s: of a jump, the difference of numbers of the whole, which may be 0 where it is differentiated."""


@dataclass
class Found:
    """What was found at places of a scene.

    worst    : largest distance of a derivative from the difference, of the error that the difference can have
    relative : the same, of the larger of the unknown's magnitude per the known's and the derivative
    pairs    : how many pairs were compared
    problems : in words
    moved    : pairs of unknown and known of which the known moved the unknown
    """

    worst: float = 0.0
    relative: float = 0.0
    pairs: int = 0
    problems: list[str] = field(default_factory=list)
    moved: set[tuple[str, str]] = field(default_factory=set)


class Place:
    """An instance at a place of its life, inputs drawn and some of them changed there."""

    def __init__(self, raw: dict[str, Any], place: str, kinds: tuple[str, ...], fmi: int = 3) -> None:
        interface, self.mode = place.split()
        self.exchange, self.scene, self.rng = interface == "me", scene(raw), np.random.default_rng(0)
        options = {"eventModeUsed": True} if interface == "events" else {}
        self.instance = Instance(raw, fmi, exchange=self.exchange, optimised=False, **options)
        self.initialising = self.mode == "initialising"
        self._start()
        if not self.initialising:
            self._bring(interface, kinds)
        if (
            self.scene.inputs.gravity
        ):  # derivatives are by the inputs, which a place that has moved on is none of
            names = [f"gravity.{key}" for key in ("position", "velocity")]
            assert self.instance.set({name: self.instance.get(name) for name in names}) == OK
        self._sort()
        self.instance.log.clear()
        fmu = self.instance.fmu
        self.saved = fmu.getFMUState() if fmi == 3 else fmu.getFMUstate()
        self.places = (c_uint32 * len(self.unknowns))(*map(self.instance.references.get, self.unknowns))

    def _start(self) -> None:
        """Draws the inputs, and sets them in initialisation mode."""
        flown, values = self.scene, start_values(self.scene)
        vectors = [f"{name}.{key}" for name in flown.inputs.motion for key in ("velocity", "rate")]
        vectors += [f"{name}.force" for name in flown.inputs.force]
        vectors += [f"{name}.torque" for name in flown.inputs.vessel_torque]
        for name in (*vectors, "torque"):
            values |= elements(name, self.rng.normal(size=3))
        for name in flown.inputs.pmi:
            values |= elements(f"{name}.pmi", flown.vessels[name].pmi or ())
        self.inputs = values
        if not flown.inputs.docked:
            self.inputs = values | self._nudge()
        assert self.instance.enter() == OK
        assert self.instance.set(self.inputs) == OK

    def _bring(self, interface: str, kinds: tuple[str, ...]) -> None:
        instance = self.instance
        assert instance.exit() == OK, instance.log
        if interface == "events":
            assert instance.update_discrete_states() == OK
            assert instance._status(instance.fmu.enterStepMode) == OK
        assert (instance.run() if self.exchange else instance.step(0.25)) == OK
        if self.mode in ("event", "continuous"):
            assert instance._status(instance.fmu.enterEventMode) == OK
        for kind in kinds:
            if kind == "then":
                self._commit(interface)
            else:
                self._change(kind)
        if self.mode == "continuous":
            assert instance.run() == OK, instance.log

    def _change(self, kind: str) -> None:
        """Sets what happens; in a scene without docks all that shapes the composite, whatever happens."""
        docks = self.scene.inputs.docked
        change = EVENTS[kind](self.scene, self.inputs, self.rng) if docks else self._nudge()
        assert change, kind
        self.inputs |= change
        assert self.instance.set(change) == OK

    def _commit(self, interface: str) -> None:
        """Has what was set happen, before more is."""
        instance = self.instance
        assert (instance.step(0.25) if interface == "cs" else instance.update_discrete_states()) == OK

    def _nudge(self) -> Values:
        """Draws changes of all that shapes a composite without docks.

        Where a vessel is turned by half a turn, as by the scene's own poses, its quaternion changes sign.
        """
        changed = {}
        for name, x in self.inputs.items():
            if "torque" not in name:
                off = 0.02 * self.rng.normal() if any(part in name for part in POSES) else 0.0
                changed[name] = x * self.rng.uniform(0.99, 1.01) + off
        return changed

    def _sort(self) -> None:
        """Finds the unknowns and the knowns, and what the model description declares of them."""
        md = self.instance.description
        inputs = [v for v in md.modelVariables if v.causality == "input"]
        held = "continuous" if self.mode == "continuous" else ""
        self.knowns = [v.name for v in inputs if v.type != "Boolean" and held in v.variability]
        self.booleans = [] if held else [v.name for v in inputs if v.type == "Boolean"]
        outputs = [v.name for v in md.modelVariables if v.causality == "output"]
        states = [v.name for v in md.modelVariables if v.name.startswith("state.")]
        rates = [v.name for v in md.modelVariables if v.name.startswith("der(")] if self.exchange else []
        self.unknowns = [*outputs, *rates, *(states if self.initialising else [])]
        if self.initialising:
            self.knowns += [v.name for v in md.modelVariables if v.causality == "parameter"]
        elif self.exchange:
            self.knowns += states
        if self.exchange and not self.initialising:
            self.knowns.append("time")
        vectors = np.array([name.partition("[")[0] for name in self.unknowns])
        self.groups = [vectors == vector for vector in vectors]  # where the vector of each unknown stands
        self.jumps = np.array(["_jump" in name for name in self.unknowns])
        elements = md.initialUnknowns if self.initialising else [*md.outputs, *md.derivatives]
        self.declared = {e.variable.name: [known.name for known in e.dependencies] for e in elements}

    def restore(self) -> None:
        fmu = self.instance.fmu
        (fmu.setFMUState if self.instance.fmi == 3 else fmu.setFMUstate)(self.saved)

    def free(self) -> None:
        fmu = self.instance.fmu
        (fmu.freeFMUState if self.instance.fmi == 3 else fmu.freeFMUstate)(self.saved)
        self.instance.free()

    def values(self, changed: Values) -> Array:
        """Returns the unknowns with some knowns changed."""
        fmu, three, count = self.instance.fmu, self.instance.fmi == 3, len(self.unknowns)
        self.restore()
        if "time" in changed:
            fmu.setTime(changed["time"])
        else:
            assert self.instance.set(changed) == OK, self.instance.log
        numbers = (c_double * count)()
        if three:
            fmu.fmi3GetFloat64(fmu.component, self.places, count, numbers, count)
        else:
            fmu.fmi2GetReal(fmu.component, self.places, count, numbers)
        return np.array(numbers)

    def differences(self, name: str) -> tuple[Array, Array, float]:
        """Returns derivatives by a known, the errors of these, and the known's magnitude.

        Central differences at steps h, h/2, h/4, of which the terms in h^2 are taken off; how two of those
        differ bounds what is left. Values are rounded, after a hundred operations each, to 256 EPS of the
        largest element of their vector.
        """
        self.restore()
        x, size = self.instance.get(name), np.abs(self.values({}))
        steps = [max(abs(x), 0.1) * 1e-3 / 2**i for i in range(3)]
        d = [(self.values({name: x + h}) - self.values({name: x - h})) / (2.0 * h) for h in steps]
        first, second = (4.0 * d[1] - d[0]) / 3.0, (4.0 * d[2] - d[1]) / 3.0
        largest = np.array([size[group].max() for group in self.groups])
        largest[self.jumps] = REACH
        return second, np.abs(second - first) + 256 * EPS * largest / steps[2], max(abs(x), 0.1)

    def both(self) -> tuple[Array, Array]:
        """Returns the matrix of derivatives of unknowns by knowns, by columns forward and by rows adjoint.

        FMI 2.0 has no adjoint derivatives: there both are the same.
        """
        self.restore()
        columns = [self.instance.directional(self.unknowns, [name], [1.0]) for name in self.knowns]
        forward = np.array(columns).T
        if self.instance.fmi == 2:
            return forward, forward
        return forward, np.array([self.instance.adjoint([n], self.knowns, [1.0]) for n in self.unknowns])

    def compare(self, found: Found) -> None:
        """Adds what is found of every pair here."""
        forward, adjoint = self.both()
        size = np.abs(self.values({}))
        by_known = [self._differences(found, known) for known in self.knowns]
        weights = np.abs(forward) * [magnitude for _, _, magnitude in by_known]
        significant = weights > SIGNIFICANT * weights.max(axis=1, keepdims=True)
        for i, (known, (difference, error, magnitude)) in enumerate(zip(self.knowns, by_known, strict=True)):
            off, per = np.abs(forward[:, i] - difference), size / magnitude
            found.worst = max(found.worst, float((off / np.where(error > 0.0, error, np.inf)).max()))
            scale = np.maximum(np.maximum(per, np.abs(forward[:, i])), 1.0)
            found.relative = max(found.relative, float((off / scale).max()))
            found.pairs += len(off)
            self._judge(found, known, off > error, (np.abs(difference) > error) | significant[:, i])
        for known in self.booleans:
            self._toggle(found, known)
        size = size[:, None] + np.abs(forward).max(axis=1, keepdims=True)
        # Terms that cancel are as large as the values or the largest derivative; a few hundred roundings.
        apart = ~(np.abs(forward - adjoint) <= 512 * EPS * (1.0 + size))
        found.problems += [f"{self.unknowns[i]} by {self.knowns[j]}: adjoint" for i, j in np.argwhere(apart)]

    def _differences(self, found: Found, known: str) -> tuple[Array, Array, float]:
        """Returns what `differences` does, with errors of infinity where the FMU refuses a change."""
        try:
            return self.differences(known)
        except FMICallException:
            found.problems.append(f"{known}: {self.instance.messages()[-1]}")
            count = len(self.unknowns)
            return np.zeros(count), np.full(count, np.inf), 1.0

    def _judge(self, found: Found, known: str, off: Array, moved: Array) -> None:
        """Adds problems with a known: derivatives that are off, and dependencies that are not declared."""
        for unknown, is_off, is_moved in zip(self.unknowns, off, moved, strict=True):
            if is_off:
                found.problems.append(f"{unknown} by {known}: not the difference")
            if is_moved:
                found.moved.add((unknown, known))
                if known not in self.declared[unknown]:
                    found.problems.append(f"{unknown} by {known}: not declared")

    def _toggle(self, found: Found, known: str) -> None:
        """Adds what is found of a dock's Boolean, which has no derivative."""
        turned = {known: 1.0 - self.inputs[known]}
        if not legal(self.scene, self.inputs | turned):
            return
        before = self.values({})
        change = np.abs(self.values(turned) - before)
        largest = np.array([np.abs(before[group]).max() for group in self.groups])
        self._judge(found, known, np.zeros(len(change), bool), change > 256 * EPS * largest)


def places(raw: dict[str, Any], fmi: int) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yields the places that a scene's FMU has: event mode of co-simulation is FMI 3.0's, where docks are."""
    for place, kinds in PLACES:
        if place.startswith("events") and not (fmi == 3 and raw["inputs"].get("docked")):
            continue
        yield place, kinds


def everywhere(raw: dict[str, Any], fmi: int = 3) -> Found:
    """Returns what is found at every place of a scene."""
    found = Found()
    for place, kinds in places(raw, fmi):
        before = len(found.problems)
        at = Place(raw, place, kinds, fmi)
        at.compare(found)
        at.free()
        found.problems[before:] = [f"{place}, {' '.join(kinds)}: {p}" for p in found.problems[before:]]
    return found


def main(seeds: int) -> int:
    """Prints the worst figures over the scenes and over assemblies of some seeds."""
    kept = [("rate", "momentum"), ("momentum", "rate"), ("momentum", "momentum"), ("rate", "rate")]
    laws = ["tensor", "principal", "decoupled"]
    more = {f"seed {i}": drawn(i, *kept[i % 4], laws[i % 3], 3 + i % 3) for i in range(seeds)}
    total = Found()
    for name, raw in (SCENES | more).items():
        for fmi in (3, 2):
            found = everywhere(raw, fmi)
            print(
                f"{name}, FMI {fmi}: {found.pairs} pairs, {found.worst:.2f} of the error that the difference "
                f"can have, {found.relative:.1e} relative, {len(found.problems)} problems"
            )
            for problem in found.problems[:5]:
                print(f"    {problem}")
            total.pairs += found.pairs
            total.worst, total.relative = max(total.worst, found.worst), max(total.relative, found.relative)
            total.problems += found.problems
    print(
        f"all: {total.pairs} pairs, {total.worst:.2f}, {total.relative:.1e}, {len(total.problems)} problems"
    )
    return 1 if total.problems else 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 0))
