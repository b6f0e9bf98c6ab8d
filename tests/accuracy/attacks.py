"""Histories of inputs by which the adversary attacks a claim: none of those by which it was chosen.

What is held is searched for over the ranges; what goes to and fro does so with the motion's own periods; the
torque of some follows the motion itself.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from accuracy.confirm import usable
from accuracy.growth import grown
from supervessel import Scene, reference
from supervessel.composite.resolved import resolve

Array = NDArray[np.float64]

SEARCHED, ZOOMS, ZOOMED = 96, 8, 16
"""Rows that are drawn in a search of the ranges, and how often and with how many it is drawn closer."""

WAVES = 24
"""Square waves of which the one is flown along which errors grow most."""

HELD = 25
"""Pieces in which random inputs are held, at most."""


@dataclass(frozen=True)
class Attack:
    """A history of inputs: `at` returns the row of a step that begins with a rate [rad/s], (n,)."""

    name: str
    at: Callable[[int, Array], Array]


class Ranges:
    """Inputs of a scene by column, and what the body is in a row of them."""

    def __init__(self, scene: Scene) -> None:
        variables = resolve(scene).inputs
        self.scene = scene
        self.names = [v.name for v in variables]
        self.start = np.array([v.start for v in variables], dtype=float)
        self.low = np.array([0.0 if v.boolean else v.low for v in variables], dtype=float)
        self.high = np.array([1.0 if v.boolean else v.high for v in variables], dtype=float)
        self.boolean = np.array([v.boolean for v in variables], dtype=bool)
        self.acting = np.array([v.part == "action" for v in variables], dtype=bool)
        self.inertias: dict[bytes, Array] = {}
        self.torques: dict[bytes, Array] = {}

    def values(self, row: Array) -> dict[str, float]:
        return dict(zip(self.names, row.tolist(), strict=True))

    def row(self, share: Array) -> Array:
        """Returns inputs at a share, 0 to 1, of their ranges; docks rounded, all within the ranges."""
        share = np.where(self.boolean, np.round(share), share)
        return np.clip(self.low + share * (self.high - self.low), self.low, self.high)

    def fits(self, row: Array) -> bool:
        return usable(self.scene, self.values(row))

    def inertia(self, row: Array) -> Array:
        """Returns the tensor, (3, 3) [kg m2], of the reference in numpy."""
        key = np.where(self.acting, 0.0, row).tobytes()
        if key not in self.inertias:
            self.inertias[key] = reference.composite(self.scene, self.values(row)).inertia
        return self.inertias[key]

    def torque(self, row: Array) -> Array:
        """Returns the torque about the barycentre, (3,) [N m], of the reference in numpy."""
        key = row.tobytes()
        if key not in self.torques:
            self.torques[key] = reference.external_torque(self.scene, self.values(row))
        return self.torques[key]


def growing(ranges: Ranges, row: Array, spin: Array) -> float:
    """How much the spin axis is the middle one: squared growth over squared rate, negative where stable."""
    a, b, moment = _across(ranges.inertia(row), spin)
    return (moment - a) * (b - moment) / (a * b)


def _across(inertia: Array, spin: Array) -> tuple[float, float, float]:
    """Returns the moments in the plane across a spin, ascending, and that about it."""
    axis = spin / np.linalg.norm(spin)
    plane = np.linalg.svd(axis[None])[2][1:]
    a, b = np.linalg.eigvalsh(plane @ inertia @ plane.T)
    return float(max(a, 1e-300)), float(b), float(axis @ inertia @ axis)


def leaning(ranges: Ranges, row: Array, spin: Array) -> float:
    """How far the momentum is from the spin axis: what laws without products leave out."""
    momentum = ranges.inertia(row) @ spin
    return float(np.linalg.norm(np.cross(spin, momentum)) / np.linalg.norm(momentum))


def lopsided(ranges: Ranges, row: Array, _spin: Array) -> float:
    """How much an acceleration by torque differs from that by the diagonal alone, for the tensor's trace."""
    inertia = ranges.inertia(row)
    return float(np.linalg.norm(np.linalg.inv(inertia) - np.diag(1.0 / np.diag(inertia))) * np.trace(inertia))


def worst(
    ranges: Ranges, how: Callable[[Ranges, Array, Array], float], spin: Array, draw: np.random.Generator
) -> Array:
    """Returns a row for which a criterion is largest, found by a search that is drawn closer and closer."""
    n = len(ranges.names)
    shares = draw.random((SEARCHED, n))
    shares[::3] = np.round(shares[::3])
    best, most = (
        (ranges.start - ranges.low) / np.where(ranges.high > ranges.low, ranges.high - ranges.low, 1),
        0.0,
    )
    most = how(ranges, ranges.row(best), spin)
    size = 0.5
    for tried in (shares, *[None] * ZOOMS):
        near = best + size * draw.uniform(-1.0, 1.0, (ZOOMED, n)) * ~ranges.boolean
        for share in np.clip(near, 0.0, 1.0) if tried is None else tried:
            row = ranges.row(share)
            found = how(ranges, row, spin) if ranges.fits(row) else -np.inf
            if found > most:
                best, most = share, found
        size *= 0.4
    return ranges.row(best)


def periods(ranges: Ranges, row: Array, spin: Array, horizon: float) -> tuple[float, float]:
    """Returns the periods [s] of the nutation and of the turn of a spin with inputs held."""
    rate = float(np.linalg.norm(spin))
    if rate * horizon < 1e-6:  # at rest
        return horizon / 3.0, horizon / 1.5
    a, b, moment = _across(ranges.inertia(row), spin)
    square = (moment - a) * (moment - b) / (a * b)
    nutation = rate * np.sqrt(abs(square))
    return 2.0 * np.pi / max(float(nutation), 1e-3 * rate), 2.0 * np.pi / rate


def attacks(scene: Scene, seed: int) -> Iterator[Attack]:
    """Yields the histories of a scene: 6 to 12, by what its inputs are."""
    assert scene.accuracy is not None
    ranges, draw = Ranges(scene), np.random.default_rng([seed, 13])
    steps = round(scene.accuracy.horizon / scene.accuracy.step)
    spin = np.array(scene.rotation.angular_velocity)
    criteria = {"growing": growing, "leaning": leaning} if np.any(spin) else {"lopsided": lopsided}
    if not ranges.names:
        yield Attack("as in the scene", lambda step, omega: ranges.start)
        return
    rows = []
    for name, how in criteria.items():
        row = worst(ranges, how, spin, draw)
        if not any(np.array_equal(row, other) for other in rows):
            rows.append(row)
            yield Attack(f"held, most {name}", lambda step, omega, row=row: row)
    yield from _waves(ranges, rows[0], spin, scene, draw)
    yield _grown_waves(ranges, scene, steps, draw)
    if ranges.acting.any():
        yield from _pumps(ranges, rows[0], draw)
    yield from _wandering(ranges, steps, draw)
    if ranges.boolean.any():
        yield _switching(ranges, rows[0], steps)


def _waves(
    ranges: Ranges, row: Array, spin: Array, scene: Scene, draw: np.random.Generator
) -> Iterator[Attack]:
    """Yields square waves with the motion's own periods: of what acts, of all, of one beside the other."""
    assert scene.accuracy is not None
    nutation, turn = periods(ranges, row, spin, scene.accuracy.horizon)
    size, here = scene.accuracy.step, np.round(draw.random(len(ranges.names)))
    acting = ranges.acting

    def wave(
        period: float, moved: NDArray[np.bool_], late: NDArray[np.bool_]
    ) -> Callable[[int, Array], Array]:
        def at(step: int, _omega: Array) -> Array:
            phase = 2.0 * np.pi * (step + 0.5) * size / max(period, 2.0 * size)
            high = np.where(late, np.cos(phase), np.sin(phase)) >= 0.0
            jumping = ranges.row(np.where(high, here, 1.0 - here))
            return np.where(moved, jumping, row)

        return at

    every, none = np.ones_like(acting), np.zeros_like(acting)
    if acting.any():
        yield Attack("torque with the nutation", wave(nutation, acting, none))
    if not acting.all():
        yield Attack("all with the nutation", wave(nutation, every, none))
        yield Attack("all with the turn, what acts a quarter later", wave(turn, every, acting))


def _grown_waves(ranges: Ranges, scene: Scene, steps: int, draw: np.random.Generator) -> Attack:
    """Returns the square wave, of many corners and periods, along which small errors grow most.

    It stays at a corner for some steps and as long or twice as long at the opposite one.
    """
    waves = []
    while len(waves) < WAVES:
        here, half = np.round(draw.random(len(ranges.names))), int(draw.integers(1, 1 + max(1, steps // 3)))
        ends = ranges.row(here), ranges.row(1.0 - here)
        rows = np.arange(steps) % int(half * draw.integers(2, 4)) < half
        if all(map(ranges.fits, ends)) or len(waves) == 0:
            waves.append((ends if all(map(ranges.fits, ends)) else (ranges.start, ranges.start), rows))
    inertias = np.array([[ranges.inertia(ends[int(k)]) for k in rows] for ends, rows in waves])
    torques = np.array([[ranges.torque(ends[int(k)]) for k in rows] for ends, rows in waves])
    (one, other), rows = waves[int(np.argmax(grown(scene, inertias, torques)))]
    return Attack("to and fro, most growing", lambda step, omega: other if rows[step] else one)


def _pumps(ranges: Ranges, row: Array, draw: np.random.Generator) -> Iterator[Attack]:
    """Yields histories in which what acts follows the rate, and in one of them all else too."""
    gains = np.array([_gain(ranges, row, i) if acts else np.zeros(3) for i, acts in enumerate(ranges.acting)])
    axis = draw.normal(size=3)

    def across(_step: int, omega: Array) -> Array:
        """What acts widens the nutation: it is along the rate across an axis."""
        along = gains @ (omega - axis * (axis @ omega) / (axis @ axis))
        return np.where(ranges.acting, np.where(along >= 0.0, ranges.high, ranges.low), row)

    def against(step: int, omega: Array) -> Array:
        """What acts pushes and pulls by turns of the rate; all else is at an end, another at each push."""
        end = np.where(gains @ omega >= 0.0, ranges.high, ranges.low)
        return np.where(ranges.acting, end, ranges.row(np.full(len(row), float(omega[step % 3] > 0.0))))

    yield Attack("torque along the rate across an axis", across)
    if not ranges.acting.all():
        yield Attack("torque along the rate, the body changing with it", against)


def _gain(ranges: Ranges, row: Array, i: int) -> Array:
    """Returns the torque [N m] that a unit of an input makes, (3,)."""
    still = np.where(ranges.acting, 0.0, row)
    pushed = still.copy()
    pushed[i] = 1.0
    torque: Array = ranges.torque(pushed) - ranges.torque(still)
    return torque


def _wandering(ranges: Ranges, steps: int, draw: np.random.Generator) -> Iterator[Attack]:
    """Yields a random walk, ramps, and all inputs jumping together to anywhere; docks jump seldom."""
    n, every = len(ranges.names), max(1, steps // HELD)
    pieces = -(-steps // every)
    walk = np.abs(
        (draw.random(n) + np.cumsum(0.15 * draw.normal(size=(pieces, n)), axis=0) + 1.0) % 2.0 - 1.0
    )
    rising = draw.random(n) < 0.5
    shares = {
        "walk": walk,
        "ramp": np.abs(np.arange(pieces)[:, None] / max(pieces - 1, 1) - rising),
        "all anywhere": draw.random((pieces, n)),
    }
    for name, share in shares.items():
        yield Attack(name, lambda step, omega, share=share: ranges.row(share[step // every]))


def _switching(ranges: Ranges, row: Array, steps: int) -> Attack:
    """Returns a history that goes through combinations of docks, held for as long as all fit in."""
    docks = int(ranges.boolean.sum())
    flags = np.array(list(product((0.0, 1.0), repeat=docks)))
    flags = flags[np.argsort([int("".join(str(int(f)) for f in one), 2) ^ 0b10101 for one in flags])]
    held = max(1, steps // len(flags))

    def at(step: int, _omega: Array) -> Array:
        switched = row.copy()
        switched[ranges.boolean] = flags[step // held % len(flags)]
        return switched

    return Attack("combinations of docks in turn", at)
