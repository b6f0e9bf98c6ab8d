"""A bound of what a law and its method are off by, proven for all inputs in their ranges, whenever they jump.

The error e of the rate is taken in the energy norm of one fixed tensor K, whatever the true one is at the
time: a change under which the rate stays does not alter it, so that inputs may jump at every communication
step.
Derivation: [EB] eqs. (29) to (34), model/docs/error_bound.md.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product
from math import exp, inf, isfinite, pi, sqrt

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fmu_build.accuracy.intervals import Interval, boxes_of, over_boxes
from supervessel.composite.actions import torque_about_barycentre
from supervessel.composite.inertia import from_upper_triangle, ldl, ldl_inverse, upper_triangle
from supervessel.composite.parts import composite_graph
from supervessel.composite.resolved import ResolvedScene, resolve
from supervessel.rotation.laws import LAWS, MIXED_PRODUCTS, SQUARES
from supervessel.rotation.step_remainder import LEAST_COUPLING, remainder_of
from supervessel.scene.numbers import EPSILON
from supervessel.scene.schema import Law, Scene

Array = NDArray[np.float64]
Bounds = Mapping[str, tuple[float, float]]

BOXES = 256
"""Boxes into which the ranges of what shapes the composite are cut, at most, for each set of docks."""

MOST_DOCKS = 6
"""Docks that open and close, at most: all their combinations are looked at."""

MOST_POINTS = 1000
"""Communication points at which the bound is given."""

SEGMENTS = 24
"""Parts of the flight, over each of which the largest growth and residual count."""

SLACK = 1.0 + 1e-9
"""What rounding of the scalar sums, of some hundreds of positive terms, and of eigenvalues may lose."""

PAIRS = (*MIXED_PRODUCTS, *SQUARES)
"""Products of two rates, in the order of columns."""


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


@dataclass(frozen=True)
class _Suprema:
    """What a law and the law "tensor" do over boxes of what shapes the composite; [EB] eqs. (29) to (32).

    push, pull  : largest acceleration under the law by what acts, (3,) [rad/s2], by products of rates, (3, 6)
    forms       : growth by each rate, (boxes, 3, 3, 3): middles and half widths
    left        : residual by products of rates, (boxes, 3, 6): middles and half widths
    left_acting : largest residual by what acts [J^(1/2)/s]
    cubic       : kappa of [EB] eq. (31)
    own         : lower factor of the tensor that the law turns where the true one is K
    own_cubic   : kappa of [EB] eq. (31) of that tensor and that law
    pushed      : largest acceleration under the law by what acts, in the norm of that tensor
    rate_share  : 1/sqrt(least moment of K)
    heaviest    : Frobenius norm of K's factor
    """

    push: Array
    pull: Array
    forms: Interval
    left: Interval
    left_acting: float
    cubic: float
    own: Array
    own_cubic: float
    pushed: float
    rate_share: float
    heaviest: float


def proven_bound(scene: Scene, duration: float, step: float) -> ProvenBound:
    """Returns the bound over all inputs in their ranges, held over communication steps, from the start.

    scene          : with law, propagator and its setting; every input that is a number with a range
    duration, step : [s], of the flight, of a communication step
    """
    count = max(1, round(duration / step))
    points = np.unique(np.rint(np.linspace(1, count, min(count, MOST_POINTS))))
    times: Array = step * points
    refusal = _refusal(scene)
    unknown = np.full(len(times), inf)
    if refusal:
        return ProvenBound(times, unknown, unknown, unknown, unknown, "remainder", inf, inf, refusal)
    resolved = resolve(scene)
    found = _suprema(resolved, _ranges(resolved))
    if found is None:
        why = (
            "growth: in its ranges the composite is not shown to have an inertia tensor that can be inverted"
        )
        return ProvenBound(times, unknown, unknown, unknown, unknown, "remainder", inf, inf, why)
    return _flown(scene, found, times, step)


def to_narrow(scene: Scene, duration: float, step: float) -> str:
    """Returns the input, by name without index, whose range alone adds most to the bound; "" for none."""
    resolved = resolve(scene)
    groups = dict.fromkeys(v.group for v in resolved.inputs if v.boolean or (v.high or 0.0) > (v.low or 0.0))
    best, name = inf, ""
    for group in groups:
        narrowed = _ranges(resolved) | {
            v.name: (float(v.start), float(v.start)) for v in resolved.inputs if v.group == group
        }
        found = _suprema(resolved, narrowed)
        if found is None:
            continue
        bound = _flown(scene, found, np.array([duration]), step)
        size = bound.law[-1] if isfinite(bound.law[-1]) else 1e300 * min(bound.growth, 1e6)
        if size < best:
            best, name = size, group
    return name


def _refusal(scene: Scene) -> str:
    """Returns why a scene's ranges are not looked at; "" where they are."""
    inputs = scene.inputs
    rotation = scene.rotation.model_copy(update={"law": "tensor"})
    kept = scene.model_copy(update={"rotation": rotation}).keeps
    momentum = [kind for kind, what in kept.items() if what == "momentum"]
    if inputs.motion:
        return "growth: inputs.motion: ports that move are not bounded over ranges"
    if momentum:
        what = " and ".join(momentum)
        return f"growth: changes of {what} that keep the momentum are not bounded over ranges"
    if len(inputs.docked) > MOST_DOCKS:
        return f"growth: {len(inputs.docked)} docks that open and close: more than {MOST_DOCKS}"
    for variable in resolve(scene).inputs:
        if variable.part == "contact" and (variable.low, variable.high) != (0.0, 0.0):
            return f"growth: {variable.name}: docks that close in motion are not bounded over ranges"
        if not variable.boolean and (variable.low is None or variable.high is None):
            return f"growth: {variable.name} has no range"
    return ""


def _ranges(resolved: ResolvedScene) -> dict[str, tuple[float, float]]:
    return {
        v.name: (0.0, 1.0) if v.boolean else (float(v.low or 0.0), float(v.high or 0.0))
        for v in resolved.inputs
    }


def _boxes(resolved: ResolvedScene, ranges: Bounds) -> tuple[Array, Array]:
    """Returns boxes of p, (boxes, n): ranges cut, for every combination of docks."""
    variables = resolved.shaping
    docks = [i for i, v in enumerate(variables) if v.boolean and ranges[v.name][0] < ranges[v.name][1]]
    low, high = (np.array([ranges[v.name][end] for v in variables]) for end in (0, 1))
    lows, highs = [], []
    for flags in product((0.0, 1.0), repeat=len(docks)):
        low[docks] = high[docks] = flags
        one, other = boxes_of(low.tolist(), high.tolist(), BOXES)
        lows.append(one)
        highs.append(other)
    return np.concatenate(lows), np.concatenate(highs)


def _suprema(resolved: ResolvedScene, ranges: Bounds) -> _Suprema | None:
    """Returns what the bound needs of a scene's ranges; None where the tensor may be singular."""
    low, high = _boxes(resolved, ranges)
    graph = composite_graph(resolved)
    inertia = ca.Function("inertia", [graph.p], [ca.densify(graph.c[graph.slices["inertia"]])])
    least, most = over_boxes(inertia, low, high)[0]
    if not (np.isfinite(least).all() and np.isfinite(most).all()):
        return None
    middle: Array = _tensor_of(0.5 * (least.min(axis=0) + most.max(axis=0)))
    if np.linalg.eigvalsh(middle)[0] <= 0.0:
        return None
    factor: Array = np.array(np.linalg.cholesky(middle), dtype=np.float64)
    acting = [ranges[v.name] for v in resolved.acting]
    sizes = np.array([max(abs(a), abs(b)) for a, b in acting], dtype=float)
    turning = np.diag(np.diag(middle)) if resolved.scene.rotation.law == "principal" else middle
    own: Array = np.array(np.linalg.cholesky(turning), dtype=np.float64)
    function = _matrices(resolved, graph.p, graph.parts(graph.c), (factor, own))
    results = over_boxes(function, low, high)
    if not all(np.isfinite(end).all() for pair in results for end in pair):
        return None
    push, pull, forms, left, left_acting, apart, turned, own_apart, own_turned, pushed = results
    return _Suprema(
        push=_largest(push, (3, len(sizes))) @ sizes,
        pull=_largest(pull, (3, len(PAIRS))),
        forms=_middle_and_half(forms, (len(low), 3, 3, 3)),
        left=_middle_and_half(left, (len(low), 3, len(PAIRS))),
        left_acting=_by_acting(left_acting, resolved, ranges),
        cubic=SLACK * _frobenius(apart) * _frobenius(turned),
        own=own,
        own_cubic=SLACK * _frobenius(own_apart) * _frobenius(own_turned),
        pushed=_by_acting(pushed, resolved, ranges),
        rate_share=SLACK / sqrt(float(np.linalg.eigvalsh(middle)[0])),
        heaviest=float(np.linalg.norm(factor)),
    )


def _matrices(
    resolved: ResolvedScene, p: ca.SX, parts: Mapping[str, ca.SX], factors: tuple[Array, Array]
) -> ca.Function:
    """Returns p -> what `_suprema` needs, each flat, rows first. [EB] eqs. (29) to (32).

    factors : lower factors of K, and of the tensor that the law turns where the true one is K
    """
    factor, turning = factors
    law: Law = resolved.scene.rotation.law
    J = from_upper_triangle(parts["inertia"])
    inverse = ldl_inverse(*ldl(J))
    D = ca.diag(ca.diag(J)) if law == "principal" else J
    u = ca.SX.sym("u", len(resolved.acting))
    arm = ca.jacobian(torque_about_barycentre(resolved, parts, u), u) if u.numel() else ca.SX.zeros(3, 0)
    own, own_pull = _response(law, J, inverse)
    right, right_pull = _response("tensor", J, inverse)
    T, back = ca.SX(factor.T), ca.SX(np.linalg.inv(factor.T))
    forms = []
    for k in range(3):
        columns = [2.0 * (right_pull @ _pair_products(k, j)) for j in range(3)]
        matrix = T @ ca.horzcat(*columns) @ back
        forms.append(0.5 * (matrix + matrix.T))
    results = (
        own @ arm,
        own_pull,
        ca.vertcat(*forms),
        T @ (own_pull - right_pull),
        T @ ((own - right) @ arm),
        *_cubic(J, inverse, factor),
        *_cubic(D, ldl_inverse(*ldl(D)), turning),
        ca.SX(turning.T) @ own @ arm,
    )
    return ca.Function("matrices", [p], [ca.densify(ca.vec(ca.densify(result).T)) for result in results])


def _cubic(J: ca.SX, inverse: ca.SX, factor: Array) -> tuple[ca.SX, ca.SX]:
    """Returns F, (3, 3), and the forms, (3, 6), whose Frobenius norms multiply to kappa. [EB] eq. (31)."""
    T, back, lower = ca.SX(factor.T), ca.SX(np.linalg.inv(factor.T)), ca.SX(np.linalg.inv(factor))
    turned = []
    for j, k in PAIRS:
        b, d = back[:, j], back[:, k]
        form = 0.5 * (ca.cross(b, J @ d) + ca.cross(d, J @ b))
        turned.append(lower @ form * (1.0 if j == k else sqrt(2.0)))
    return T @ inverse @ T.T - ca.SX.eye(3), ca.horzcat(*turned)


def _response(law: Law, J: ca.SX, inverse: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Returns what a law makes of torque, (3, 3), and of PAIRS of rates, (3, 6), without the law's scale."""
    numbers = {
        "none": ca.SX(0, 1),
        "decoupled": 1.0 / ca.diag(J),
        "principal": ca.vertcat(ca.diag(J), 1.0 / ca.diag(J), 1.0),
        "tensor": ca.vertcat(upper_triangle(J), upper_triangle(inverse), 1.0),
    }[law]
    rules = LAWS[law]
    still = ca.SX.zeros(3)
    by_torque = ca.horzcat(*(rules.acceleration(numbers, still, axis) for axis in ca.horzsplit(ca.SX.eye(3))))
    pull = rules.gyroscopic(numbers)
    return ca.densify(by_torque), ca.horzcat(pull, ca.SX.zeros(3, len(PAIRS) - pull.size2()))


def _pair_products(k: int, j: int) -> ca.SX:
    """Returns the symmetric products, (6,), of the unit vectors k and j."""
    a, b = ca.SX.eye(3)[:, k], ca.SX.eye(3)[:, j]
    return ca.vertcat(*(0.5 * (a[m] * b[n] + a[n] * b[m]) for m, n in PAIRS))


def _tensor_of(six: Array) -> Array:
    xx, yy, zz, xy, xz, yz = six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _largest(interval: Interval, shape: tuple[int, int]) -> Array:
    """Returns the largest size of each element over all boxes."""
    sizes = np.maximum(np.abs(interval[0]), np.abs(interval[1]))
    return np.asarray(sizes.max(axis=0).reshape(shape))


def _frobenius(interval: Interval) -> float:
    """Returns the largest Frobenius norm over all boxes."""
    sizes = np.maximum(np.abs(interval[0]), np.abs(interval[1]))
    return float(np.linalg.norm(sizes, axis=1).max())


def _middle_and_half(interval: Interval, shape: tuple[int, ...]) -> Interval:
    """Returns middles and half widths, the latter with what the former lose to rounding."""
    low, high = interval
    middle = 0.5 * (low + high)
    half = np.maximum(high - middle, middle - low) * SLACK + EPSILON * np.abs(middle)
    return middle.reshape(shape), half.reshape(shape)


def _by_acting(interval: Interval, resolved: ResolvedScene, ranges: Bounds) -> float:
    """Returns the longest vector that what acts makes, over all boxes and the corners of its ranges."""
    acting = [ranges[v.name] for v in resolved.acting]
    if not acting:
        return 0.0
    shape = len(interval[0]), 3, len(acting)
    middle, half = _middle_and_half(interval, shape)
    sizes = np.array([max(abs(a), abs(b)) for a, b in acting])
    blurred = np.linalg.norm(half @ sizes, axis=1)
    if len(acting) > MOST_DOCKS:
        return float((np.linalg.norm(middle, axis=1) @ sizes + blurred).max()) * SLACK
    corners = np.array(list(product(*acting))).T
    return float((np.linalg.norm(middle @ corners, axis=1).max(axis=1) + blurred).max()) * SLACK


def _rate_boxes(found: _Suprema, start: Array, spans: Array) -> list[tuple[Array, Array]]:
    """Returns boxes, (3,) and (3,), that hold the cheap rate over each span; infinite where none is found.

    A box that holds what the rate may reach from the box before, at the fastest change inside it, holds the
    rate; so does the energy norm's own. [EB] eq. (33).
    """
    low, high, energy = start.copy(), start.copy(), float(np.linalg.norm(found.own.T @ start)) * SLACK
    shares = np.linalg.norm(np.linalg.inv(found.own), axis=0) * SLACK
    boxes = []
    for span in spans:
        energy = _energy_after(found, energy, float(span))
        cap = energy * shares
        inner, outer = low, high
        for _ in range(60):
            change = span * _fastest(found, inner, outer) * SLACK
            wanted = np.maximum(low - change, -cap), np.minimum(high + change, cap)
            if np.all(wanted[0] >= inner) and np.all(wanted[1] <= outer):
                break
            inner = np.maximum(low - 1.05 * change, -cap)
            outer = np.minimum(high + 1.05 * change, cap)
        else:
            inner, outer = wanted = -cap, cap
        boxes.append((inner, outer))
        low, high = wanted
    return boxes


def _energy_after(found: _Suprema, energy: float, span: float) -> float:
    """Returns a bound of the cheap rate's norm over a span: it grows by kappa n^2 and by what acts."""
    top = energy + found.pushed * span
    for _ in range(100):
        wanted = (energy + (found.own_cubic * top * top + found.pushed) * span) * SLACK
        if wanted <= top or not isfinite(wanted):
            return wanted
        top = 1.05 * wanted
    return inf


def _fastest(found: _Suprema, low: Array, high: Array) -> Array:
    sizes = np.maximum(np.abs(low), np.abs(high))
    with np.errstate(invalid="ignore", over="ignore"):
        return np.asarray(found.push + found.pull @ np.array([sizes[i] * sizes[j] for i, j in PAIRS]))


def _growth(found: _Suprema, low: Array, high: Array) -> float:
    """Returns the largest growth over a box of rates and all boxes. [EB] eq. (30)."""
    middle, half = found.forms
    sizes = np.maximum(np.abs(low), np.abs(high))
    blurred = np.linalg.norm(np.einsum("k,bkij->bij", sizes, half), axis=(1, 2))
    largest = 0.0
    for corner in {tuple(c) for c in product(*zip(low, high, strict=True))}:
        S = np.einsum("k,bkij->bij", np.array(corner), middle)
        values = np.linalg.eigvalsh(S)[:, -1] + blurred + 64 * EPSILON * np.linalg.norm(S, axis=(1, 2))
        largest = max(largest, float(values.max()))
    return largest * SLACK


def _residual(found: _Suprema, low: Array, high: Array) -> float:
    """Returns the largest residual over a box of rates, all boxes and what acts. [EB] eq. (32)."""
    middle, half = found.left
    ends = [[a * b for a in (low[i], high[i]) for b in (low[j], high[j])] for i, j in PAIRS]
    least, most = np.array([min(e) for e in ends]), np.array([max(e) for e in ends])
    squares = [k for k, (i, j) in enumerate(PAIRS) if i == j]
    for k in squares:
        i = PAIRS[k][0]
        least[k] = 0.0 if low[i] <= 0.0 <= high[i] else min(low[i] ** 2, high[i] ** 2)
    mean, spread = 0.5 * (least + most), 0.5 * (most - least) * SLACK
    by_rates = np.linalg.norm(
        np.abs(middle @ mean) + np.abs(middle) @ spread + half @ np.maximum(np.abs(least), np.abs(most)),
        axis=1,
    )
    return (float(by_rates.max()) + found.left_acting) * SLACK


def _flown(scene: Scene, found: _Suprema, times: Array, step: float) -> ProvenBound:
    """Returns the bound along the flight, of parts over which growth and residual are at their largest."""
    duration = float(times[-1])
    ends = np.unique(times[np.unique(np.linspace(0, len(times) - 1, SEGMENTS + 1).astype(int))])
    if len(times) == 1:
        ends = np.linspace(0.0, duration, SEGMENTS + 1)[1:]
    spans = np.diff(np.append(0.0, ends))
    start = np.array(scene.rotation.angular_velocity, dtype=float)
    boxes = _rate_boxes(found, start, spans)
    law, whole, method = _Carried(found.rate_share), _Carried(found.rate_share), _method(scene)
    of_law, law_rate, of_all, rate = (np.full(len(times), inf) for _ in range(4))
    begun, most = 0.0, [0.0, 0.0]
    for end, span, (low, high) in zip(ends, spans, boxes, strict=True):
        if not np.isfinite(low).all():
            most = [inf, inf]
            break
        growth = _growth(found, low, high)
        residual = 0.0 if scene.rotation.law == "tensor" else _residual(found, low, high)
        most = [max(most[0], growth), max(most[1], residual)]
        added = _method_sources(scene, found, (low, high), step, method)
        inside = np.flatnonzero((times > begun + 1e-9 * step) & (times <= end * (1 + 1e-12)))
        for i in inside:
            there = law.after(times[i] - begun, growth, found.cubic, residual, 0.0)
            of_law[i], law_rate[i] = there.angle, there.rate_share * there.energy
            there = whole.after(times[i] - begun, growth, found.cubic, residual + added[1], added[0])
            of_all[i], rate[i] = there.angle, there.rate_share * there.energy
        law = law.after(span, growth, found.cubic, residual, 0.0)
        whole = whole.after(span, growth, found.cubic, residual + added[1], added[0])
        begun = float(end)
    why = ""
    if not isfinite(of_law[-1]):
        why = "growth: errors may grow beyond any bound in the ranges"
    elif not isfinite(of_all[-1]):
        why = f"method: steps of {step:g} s turn too far for the remainder"
    return ProvenBound(times, of_law, law_rate, of_all, rate, method, most[0], most[1], why)


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
            if exponent > 300.0 or not isfinite(residual):
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
    scene: Scene, found: _Suprema, box: tuple[Array, Array], step: float, method: str
) -> tuple[float, float]:
    """Returns what steps add, over their length: angle [rad/s], rate [J^(1/2)/s].

    Of rk4 a communication step is taken as one sub-step: smaller ones add less. Of other methods each adds
    its tolerance.
    """
    speed = float(np.linalg.norm(np.maximum(np.abs(box[0]), np.abs(box[1]))))
    if method == "estimate":
        tolerance = scene.rotation.tolerance
        return tolerance / step, tolerance * speed * found.heaviest / step
    constants = remainder_of("rk4")
    weights = np.array([1.0 if i == j else 0.5 for i, j in PAIRS])
    coupling = max(float(np.sqrt(((found.pull**2) * weights).sum())), LEAST_COUPLING)
    v = speed + sqrt(float(np.linalg.norm(found.push)) / coupling)
    z = coupling * v * step
    if z > constants.limit:
        return inf, inf
    power = z**constants.power
    fastest = float(np.linalg.norm(_fastest(found, *box)))
    rounding = 0.5 * EPSILON * (4.0 * speed + 512.0 * step * fastest)
    rate = constants.rate * v * power * bool(LAWS[scene.rotation.law].products) + rounding
    turn = pi * (constants.turn * power + 0.5 * EPSILON * (8.0 + 512.0 * step * speed) + 0.5 * step * rate)
    return turn / step * SLACK, found.heaviest * rate / step * SLACK
