"""A bound of what a law and its method are off by, proven for all inputs in their ranges, whenever they jump.

The error, of the rate where every change of inputs keeps the rate, of the momentum where every change keeps
that, is taken in the energy norm of one fixed tensor K, whatever the true one is at the time. Such a change
does not alter it, so that inputs may jump at every communication step.
Derivation: [EB] eqs. (29) to (42), model/docs/error_bound.md.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import ceil, exp, inf, isfinite, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from fmu_build.accuracy.range_suprema import (
    MOST_DOCKS,
    SLACK,
    Bounds,
    RangeSuprema,
    growth_over,
    off_over,
    range_suprema,
    ranges_of,
    rates_over,
    residual_over,
)
from supervessel.composite.resolved import ResolvedScene, resolve
from supervessel.rotation.error_bound.constants import LEAST_COUPLING
from supervessel.rotation.error_bound.functions import keeps_in_truth
from supervessel.rotation.error_bound.remainder import DEPTH, remainder_of
from supervessel.rotation.laws import LAWS
from supervessel.scene.inputs import Change
from supervessel.scene.numbers import EPSILON
from supervessel.scene.schema import Kept, Scene

Array = NDArray[np.float64]

MOST_POINTS = 1000
"""Communication points at which the bound is given."""

CHANGES, CHANGE_DEPTH = 2, 64
"""Changes that keep the momentum at one instant, of masses and of poses; and the roundings that follow on
each other in one, at most (counted in tests/accuracy/test_proven_momentum.py). [EB] eq. (42)."""

SEGMENTS = 24
"""Parts of the flight, over each of which the largest growth and residual count."""


@dataclass(frozen=True)
class ProvenBound:
    """What a law and its method are off by at most, at communication points.

    times    : (n,) [s], communication points, at most MOST_POINTS of them, the last one among them
    law      : (n,) [rad], of the law alone
    law_rate : (n,) [rad/s], of the law alone
    whole    : (n,) [rad], of law and method
    rate     : (n,) [rad/s], of law and method
    method   : "remainder", proven, or "estimate", the tolerance taken for the local error of each step
    growth   : largest over the flight [1/s]
    residual : largest over the flight [J^(1/2)/s]
    why      : what is in the way where `whole` is not finite at the end, else ""
    """

    times: Array
    law: Array
    law_rate: Array
    whole: Array
    rate: Array
    method: str
    growth: float
    residual: float
    why: str


def proven_bound(scene: Scene, duration: float, step: float, *, of_law_alone: bool = False) -> ProvenBound:
    """Returns the bound over all inputs in their ranges, held over communication steps, from the start.

    scene          : with law, propagator and its setting; every input that is a number with a range
    duration, step : [s], of the flight, of a communication step
    of_law_alone   : whether steps of the method are left out, everywhere
    """
    count = max(1, ceil(duration / step * (1.0 - 1e-12)))
    points = np.unique(np.rint(np.linspace(1, count, min(count, MOST_POINTS))))
    times: Array = step * points
    resolved = resolve(scene)
    found = _known(resolved, ranges_of(resolved))
    if isinstance(found, str):
        unknown = np.full(len(times), inf)
        return ProvenBound(times, unknown, unknown, unknown, unknown, "remainder", inf, inf, found)
    return _flown(scene, found, times, step, of_law_alone=of_law_alone)


def to_narrow(scene: Scene, duration: float, step: float) -> str:
    """Returns the input, by name without index, whose range alone adds most to the bound; "" for none."""
    resolved = resolve(scene)
    groups = dict.fromkeys(v.group for v in resolved.inputs if v.boolean or (v.high or 0.0) > (v.low or 0.0))
    best, name = inf, ""
    for group in groups:
        narrowed = ranges_of(resolved) | {
            v.name: (float(v.start), float(v.start)) for v in resolved.inputs if v.group == group
        }
        found = _known(resolved, narrowed)
        if isinstance(found, str):
            continue
        law = _along(scene, found, (np.array([duration]), step), _nothing)
        size = law.angles[-1] if isfinite(law.angles[-1]) else 1e300 * min(law.growth, 1e6)
        if size < best:
            best, name = size, group
    return name


def _known(resolved: ResolvedScene, ranges: Bounds) -> RangeSuprema | str:
    """Returns what the bound needs of ranges, or why they are not looked at."""
    refusal = _refusal(resolved, ranges)
    if refusal:
        return refusal
    found = range_suprema(resolved, ranges, "momentum" if _changes(resolved, ranges)["momentum"] else "rate")
    if found is None:
        return (
            "growth: in its ranges the composite is not shown to have an inertia tensor that can be inverted"
        )
    return found


def _changes(resolved: ResolvedScene, ranges: Bounds) -> Mapping[Kept, list[Change]]:
    """Returns the kinds of change that the ranges allow, by what the true motion keeps at them."""
    kinds = dict.fromkeys(
        v.kind.change for v in resolved.shaping if ranges[v.name] != (float(v.start), float(v.start))
    )
    kept = keeps_in_truth(resolved.scene)
    momentum = [kind for kind in kinds if kept.get(kind) == "momentum"]
    return {"momentum": momentum, "rate": [kind for kind in kinds if kind not in momentum]}


def _refusal(resolved: ResolvedScene, ranges: Bounds) -> str:
    """Returns why ranges are not looked at; "" where they are."""
    if resolved.field:
        return "growth: gravity's gradient along an orbit is not bounded over ranges"
    for v in resolved.inputs:
        if not v.boolean and (v.low is None or v.high is None) and ranges[v.name] != (v.start, v.start):
            return f"growth: {v.name} has no range"
    changes = _changes(resolved, ranges)
    if changes["momentum"] and changes["rate"]:
        momentum, rate = (" and ".join(changes[kept]) for kept in ("momentum", "rate"))
        return (
            f"growth: changes of {momentum} keep the momentum, changes of {rate} the rate: "
            "in turns they may speed the body up at every step"
        )
    docks = sum(v.boolean and ranges[v.name][0] < ranges[v.name][1] for v in resolved.shaping)
    if docks > MOST_DOCKS:
        return f"growth: {docks} docks that open and close: more than {MOST_DOCKS}"
    for v in resolved.contact if docks else ():
        if ranges[v.name] != (0.0, 0.0):
            return f"growth: {v.name}: docks that close in motion may speed the body up at every step"
    return ""


Sources = Callable[[tuple[Array, Array]], tuple[float, float, float]]
"""What steps of a method add where y is in a box, over their length: angle [rad/s], rate [J^(1/2)/s], and to
each element of y."""


def _nothing(_box: tuple[Array, Array]) -> tuple[float, float, float]:
    return 0.0, 0.0, 0.0


def _boxes(found: RangeSuprema, spans: Array, step: float, sources: Sources) -> list[tuple[Array, Array]]:
    """Returns boxes, (3,) and (3,), that hold y, rate or momentum of the law, over each span.

    A box that holds what y may reach from the box before, at the fastest change inside it and with what steps
    add there, one more than fit in, holds y; so does what its length allows. They are infinite where none is
    found. [EB] eqs. (33), (35).
    """
    low, high = found.start
    middle = float(np.linalg.norm(found.own.T @ (0.5 * (low + high))))
    energy = (middle + float(np.linalg.norm(np.abs(found.own.T) @ (0.5 * (high - low))))) * SLACK
    shares = np.linalg.norm(np.linalg.inv(found.own), axis=0) * SLACK
    heaviest = float(np.linalg.norm(found.own)) * sqrt(3.0) * SLACK
    nowhere = np.full(3, -inf), np.full(3, inf)
    boxes: list[tuple[Array, Array]] = []
    for span in spans:
        inner, outer = low, high
        for _ in range(60):
            by_steps = (float(span) + step) * sources((inner, outer))[2] * SLACK
            if not isfinite(by_steps):
                return boxes + [nowhere] * (len(spans) - len(boxes))
            reached = _energy_after(found, energy + heaviest * by_steps, float(span))
            cap = reached * shares
            change = span * found.cheap.fastest(np.maximum(np.abs(inner), np.abs(outer))) * SLACK + by_steps
            wanted = np.maximum(low - change, -cap), np.minimum(high + change, cap)
            if np.all(wanted[0] >= inner) and np.all(wanted[1] <= outer):
                break
            inner = np.maximum(low - 1.05 * change, -cap)
            outer = np.minimum(high + 1.05 * change, cap)
        else:
            inner, outer = wanted = -1.05 * cap, 1.05 * cap
            by_steps = (float(span) + step) * sources(wanted)[2] * SLACK
            reached = _energy_after(found, energy + heaviest * by_steps, float(span))
            if not np.all(reached * shares <= outer):
                return boxes + [nowhere] * (len(spans) - len(boxes))
        boxes.append((inner, outer))
        energy = reached
        low, high = wanted
    return boxes


def _energy_after(found: RangeSuprema, energy: float, span: float) -> float:
    """Returns a bound of the length n of own^T y over a span. [EB] eqs. (31), (35).

    energy : of n at the start, and all that steps of a method add to it on the way: that grows along with n
    """
    top = energy + found.pushed * span
    for _ in range(100):
        wanted = (energy + (found.own_cubic * top * top + found.pushed) * span) * SLACK
        if wanted <= top or not isfinite(wanted):
            return wanted
        top = 1.05 * wanted
    return inf


def _flown(
    scene: Scene, found: RangeSuprema, times: Array, step: float, *, of_law_alone: bool
) -> ProvenBound:
    """Returns the bound along the flight, of the law's exact motion and of a method's steps."""
    method = _method(scene)

    def sources(box: tuple[Array, Array]) -> tuple[float, float, float]:
        return _method_sources(scene, found, box, step, method)

    law = whole = _along(scene, found, (times, step), _nothing)
    if not of_law_alone:
        whole = _along(scene, found, (times, step), sources)
    why = ""
    if not isfinite(law.angles[-1]):
        why = "growth: errors may grow beyond any bound in the ranges"
    elif not isfinite(whole.angles[-1]):
        why = f"method: steps of {step:g} s turn too far for the remainder"
    return ProvenBound(
        times, law.angles, law.rates, whole.angles, whole.rates, method, law.growth, law.residual, why
    )


@dataclass(frozen=True)
class _Along:
    """A bound at communication points, (n,) [rad] and [rad/s], and its largest growth and residual."""

    angles: Array
    rates: Array
    growth: float
    residual: float


def _along(scene: Scene, found: RangeSuprema, at: tuple[Array, float], sources: Sources) -> _Along:
    """Returns the bound along a flight, of parts over which growth and residual are at their largest.

    at : times [s] of communication points, and the step [s]
    """
    times, step = at
    duration = float(times[-1])
    ends = np.unique(times[np.unique(np.linspace(0, len(times) - 1, SEGMENTS + 1).astype(int))])
    if len(times) == 1:
        ends = np.linspace(0.0, duration, SEGMENTS + 1)[1:]
    spans = np.diff(np.append(0.0, ends))
    carried = _Carried(found.rate_share, energy=found.begun)
    angles, rates = (np.full(len(times), inf) for _ in range(2))
    begun, most = 0.0, [0.0, 0.0]
    for end, span, box in zip(ends, spans, _boxes(found, spans, step, sources), strict=True):
        if not np.isfinite(box).all():
            most = [inf, inf]
            break
        growth, off = float(growth_over(found, *box)), float(off_over(found, *box))
        residual = 0.0 if scene.rotation.law == "tensor" else float(residual_over(found, *box))
        most = [max(most[0], growth), max(most[1], residual)]
        added = sources(box)

        def after(
            span: float,
            so_far: _Carried = carried,
            by_law: tuple[float, float, float] = (growth, residual, off),
            added: tuple[float, float, float] = added,
        ) -> _Carried:
            growth, residual, off = by_law
            return so_far.after(span, growth, found.cubic, residual + added[1], off + added[0])

        for i in np.flatnonzero((times > begun + 1e-9 * step) & (times <= end * (1 + 1e-12))):
            there = after(float(times[i]) - begun)
            angles[i], rates[i] = there.angle, there.rate_share * there.energy + off
        carried, begun = after(float(span)), float(end)
    return _Along(angles, rates, *most)


@dataclass(frozen=True)
class _Carried:
    """Bounds of the angle [rad] and of the rate's error in the norm of K."""

    rate_share: float
    angle: float = 0.0
    energy: float = 0.0

    def after(self, span: float, growth: float, cubic: float, residual: float, drift: float) -> "_Carried":
        """Returns the bounds after a span; infinite where the cubic term cannot be held. [EB] eq. (34).

        drift : what is added to the angle [rad/s]
        """
        top = max(self.energy, residual * span) * 1.1
        for _ in range(40):
            exponent = (growth + cubic * top) * span
            if not exponent <= 300.0 or not isfinite(residual):
                break
            rise = exp(exponent) * SLACK
            energy = rise * self.energy + residual * span * 0.5 * (1.0 + rise)
            if energy <= top or cubic == 0.0:
                angle = self.angle + span * (drift + self.rate_share * 0.5 * (self.energy + energy)) * SLACK
                return replace(self, angle=angle, energy=energy)
            top = 1.5 * energy
        return replace(self, angle=inf, energy=inf)


def _method(scene: Scene) -> str:
    return "remainder" if scene.rotation.propagator == "rk4" else "estimate"


def _method_sources(
    scene: Scene, found: RangeSuprema, box: tuple[Array, Array], step: float, method: str
) -> tuple[float, float, float]:
    """Returns what steps add, see `Sources`; to y nothing where it is only estimated.

    What rk4 leaves out is that of a single sub-step: smaller ones leave out less. Its rounding is of all.
    Of other methods each communication step adds the tolerance.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # of a box that is not bounded
        rates = rates_over(found, *box)
        speed = float(np.linalg.norm(rates))
    if method == "estimate":
        tolerance = scene.rotation.tolerance
        return tolerance / step, tolerance * speed * found.heaviest / step, 0.0
    constants = remainder_of("rk4")
    coupling = max(found.law.coupling, LEAST_COUPLING)
    spin = float(np.linalg.norm(found.law.turn))
    v = speed + max(sqrt(float(np.linalg.norm(found.law.push)) / coupling), 0.5 * spin / coupling)
    z = coupling * v * step
    if z > constants.limit:
        return inf, inf, inf
    power = float(z**constants.power)
    fastest = float(np.linalg.norm(found.law.fastest(rates)))
    sub_steps = _most_sub_steps(scene.rotation.max_angle_step, step, speed, fastest, found.spin_rate)
    force = found.torque + speed * (found.inertia * speed + found.spin)
    rounding = 0.5 * EPSILON * (4.0 * speed * sub_steps + DEPTH * step * found.lightness * force)
    rounding += 0.5 * EPSILON * CHANGES * CHANGE_DEPTH * (found.change_speed * speed + found.change_spin)
    rate = float(constants.rate) * v * power * bool(LAWS[scene.rotation.law].products) + rounding
    turn = pi * (
        float(constants.turn) * power
        + 0.5 * EPSILON * (8.0 * sub_steps + DEPTH * step * speed)
        + 0.5 * step * rate
    )
    of_rate = rate / step * SLACK
    return turn / step * SLACK, found.heaviest * of_rate, found.stretch * of_rate


def _most_sub_steps(angle: float, step: float, speed: float, fastest: float, spin_rate: float) -> int:
    """Returns as many sub-steps as `propagators.bound.fastest_square` asks for at most, angle <= 1 rad.

    speed     : largest rate [rad/s]
    fastest   : largest acceleration [rad/s2]
    spin_rate : largest size of what the spin of moving parts adds to the acceleration, over the rate [rad/s]
    There e <= 1.5 and f <= 1.5 angle, and where ports move e <= 4.1 and f <= 2.2 angle.
    """
    e, f = (4.1, 2.2) if spin_rate else (1.5, 1.5)
    square = e * speed * speed + 2.0 * f * angle * fastest + (f * angle + 1.0) * spin_rate * spin_rate
    return 1 + ceil(step * sqrt(square) / angle)
