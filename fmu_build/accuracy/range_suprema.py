"""What a law and the law "tensor" do at most over the ranges of a scene's inputs, by interval arithmetic.

The norm is that of one fixed tensor K: [EB] eqs. (29) to (42), model/docs/error_bound.md.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from itertools import product

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fmu_build.accuracy.compared import (
    PAIRS,
    Compared,
    acted_on,
    momenta_compared,
    rates_compared,
    shift_of,
)
from fmu_build.accuracy.intervals import Interval, boxes_of, over_boxes
from supervessel.composite.parts import CompositeGraph, composite_graph
from supervessel.composite.resolved import ResolvedScene
from supervessel.scene.numbers import EPSILON
from supervessel.scene.schema import Kept

Array = NDArray[np.float64]
Bounds = Mapping[str, tuple[float, float]]

BOXES = 256
"""Boxes into which the ranges of what shapes the composite are cut, at most, for each set of docks."""

MOST_DOCKS = 6
"""Docks that open and close, at most: all their combinations are looked at."""

SLACK = 1.0 + 1e-9
"""What rounding of the scalar sums, of some hundreds of positive terms, and of eigenvalues may lose."""


@dataclass(frozen=True)
class LargestResponse:
    """Largest sizes of y': by what acts, (3,), by products of y, (3, 6), by y, (3, 3)."""

    push: Array
    pull: Array
    turn: Array

    @property
    def coupling(self) -> float:
        """The g of [EB] eq. (23)."""
        weights = np.array([1.0 if i == j else 0.5 for i, j in PAIRS])
        return float(np.sqrt((self.pull**2 * weights).sum()))

    def fastest(self, sizes: Array) -> Array:
        """Returns the largest sizes of y', (3,), of sizes of y, (3,)."""
        with np.errstate(invalid="ignore", over="ignore"):
            pairs = np.array([sizes[i] * sizes[j] for i, j in PAIRS])
            return np.asarray(self.push + self.pull @ pairs + self.turn @ sizes)


@dataclass(frozen=True)
class Affine:
    """A linear map of y, (boxes, 3, 3), and a constant, (boxes, 3, 1): middles and half widths of each."""

    linear: Interval
    constant: Interval

    def sizes(self, low: Array, high: Array) -> Array:
        """Returns the largest sizes, (boxes, 3), over a box of y."""
        mean, spread = _mean_and_spread(low, high)
        (linear, blurred), (constant, off) = self.linear, self.constant
        middle = np.abs(linear @ mean + constant[:, :, 0])
        return np.asarray(
            (middle + np.abs(linear) @ spread + blurred @ _sizes(low, high) + off[:, :, 0]) * SLACK
        )


@dataclass(frozen=True)
class RangeSuprema:
    """What a law and the law "tensor" do over boxes of what shapes the composite; see `compared.Compared`.

    start        : box of y at the start, (3,) and (3,)
    begun        : largest error at the start, in the norm of K
    shift        : c, (3,)
    cheap, law   : responses of y and of the rate under the law
    forms        : growth by each component of y + c, and without, (boxes, 4, 3, 3): middles and half widths
    left         : residual by products of y, (boxes, 3, 6): middles and half widths
    left_affine  : the rest of the residual but for what acts
    left_acting  : largest residual by what acts [J^(1/2)/s]
    cubic        : kappa of [EB] eq. (31) or (39)
    own          : (3, 3), the law's own motion is bounded by the length n of own^T y:
    own_cubic    : n' <= own_cubic n^2 + pushed
    pushed       : see there
    rate_share   : largest difference of rates by the error in the norm of K
    off          : difference of rates beside it
    rate         : the law's rate
    heaviest     : largest error in the norm of K by an error of the law's rate
    stretch      : largest change of y by an error of the law's rate: 1, or the law's tensor [kg m2]
    change_speed : rounding of a change of inputs, over u and roundings: by the rate [1]; [EB] eq. (42)
    change_spin  : and by the spin of moving parts [rad/s]
    spin_rate    : largest |h| trace(J^-1) [rad/s]
    lightness    : largest Frobenius norm of the inverse of the law's tensor [1/(kg m2)]; [EB] eq. (28)
    inertia      : and of the tensor [kg m2], 0 where the law has no gyroscopic term
    spin         : and of the spin of moving parts [N m s], likewise
    torque       : longest torque under the law [N m]
    """

    start: tuple[Array, Array]
    begun: float
    shift: Array
    cheap: LargestResponse
    law: LargestResponse
    forms: Interval
    left: Interval
    left_affine: Affine
    left_acting: float
    cubic: float
    own: Array
    own_cubic: float
    pushed: float
    rate_share: float
    off: Affine
    rate: Affine
    heaviest: float
    stretch: float
    change_speed: float
    change_spin: float
    spin_rate: float
    lightness: float
    inertia: float
    spin: float
    torque: float


def ranges_of(resolved: ResolvedScene) -> dict[str, tuple[float, float]]:
    """Returns the ranges of all inputs by name; of docks 0 and 1."""
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


def range_suprema(resolved: ResolvedScene, ranges: Bounds, kept: Kept) -> RangeSuprema | None:
    """Returns what the bound needs of a scene's ranges; None where the tensor may be singular.

    kept : what every change of the inputs keeps, "rate" or "momentum"
    """
    low, high = _boxes(resolved, ranges)
    graph = composite_graph(resolved)
    inertia = ca.Function("inertia", [graph.p], [ca.densify(graph.c[graph.slices["inertia"]])])
    least, most = over_boxes(inertia, low, high)[0]
    if not (np.isfinite(least).all() and np.isfinite(most).all()):
        return None
    middle = _tensor_of(0.5 * (least.min(axis=0) + most.max(axis=0)))
    if np.linalg.eigvalsh(middle)[0] <= 0.0:
        return None
    begin = np.array([[v.start for v in resolved.shaping]], dtype=float)
    low, high = np.concatenate([begin, low]), np.concatenate([begin, high])
    law, start = resolved.scene.rotation.law, np.array(resolved.scene.rotation.angular_velocity, dtype=float)
    body = acted_on(resolved, graph.parts(graph.c))
    if kept == "momentum":
        shift = _at(graph, shift_of(law, body.inertia, start), begin[0])
        compared = momenta_compared(law, body, middle, start, shift)
    else:
        compared = rates_compared(law, body, middle, start)
    found = _over_boxes(compared, graph.p, (low, high))
    return None if found is None else _suprema(compared, found, resolved, (kept, ranges))


def _suprema(
    compared: Compared,
    found: Mapping[str, Interval],
    resolved: ResolvedScene,
    changes: tuple[Kept, Bounds],
) -> RangeSuprema:
    """Returns suprema of what `_over_boxes` has found; its first box, the start's values, is among them.

    changes : what changes keep, and the ranges
    """
    kept, ranges = changes
    acting = [ranges[v.name] for v in resolved.acting]
    sizes = np.array([max(abs(a), abs(b)) for a, b in acting], dtype=float)
    D, h, inverse = (_frobenius(found[name]) for name in ("kept_tensor", "kept_spin", "kept_inverse"))
    low, high = found["start"]
    return RangeSuprema(
        start=(low.min(axis=0), high.max(axis=0)),
        begun=SLACK * _frobenius(found["begun"]),
        shift=compared.shift,
        cheap=_response(found, "cheap", sizes),
        law=_response(found, "law", sizes),
        forms=_middle_and_half(found["forms"], (-1, 4, 3, 3)),
        left=_middle_and_half(found["left_products"], (-1, 3, len(PAIRS))),
        left_affine=_affine(found, "left"),
        left_acting=_by_acting(found["left_acting"], resolved, ranges),
        cubic=SLACK * _frobenius(found["apart"]) * _frobenius(found["turned"]),
        own=compared.own,
        own_cubic=SLACK * _frobenius(found["own_apart"]) * _frobenius(found["own_turned"]),
        pushed=_by_acting(found["own_pushed"], resolved, ranges),
        rate_share=_longest(found["by_error"]),
        off=_affine(found, "off"),
        rate=_affine(found, "rate"),
        heaviest=SLACK * _frobenius(found["by_rate"]),
        stretch=SLACK * D if kept == "momentum" else 1.0,
        change_speed=6.0 * SLACK * inverse * D,
        change_spin=2.0 * SLACK * inverse * h,
        spin_rate=_frobenius(found["spin_rate"]),
        lightness=SLACK * _frobenius(found["rounded_inverse"]),
        inertia=SLACK * _frobenius(found["rounded_tensor"]),
        spin=SLACK * _frobenius(found["rounded_spin"]),
        torque=_by_acting(found["rounded_arm"], resolved, ranges),
    )


def _expressions(compared: Compared) -> dict[str, ca.SX]:
    """Returns all that is looked at over boxes, by name."""
    found = {"forms": ca.vertcat(*compared.forms)}
    for name in ("cheap", "law", "left"):
        motion = getattr(compared, name)
        found |= {f"{name}_{one.name}": getattr(motion, one.name) for one in fields(motion)}
    found |= {
        name: getattr(compared, name)
        for name in (
            "apart",
            "turned",
            "own_pushed",
            "by_error",
            "by_rate",
            "start",
            "begun",
            "spin_rate",
        )
    }
    found["own_apart"], found["own_turned"] = compared.own_cubic
    for name in ("off", "rate"):
        found[f"{name}_linear"], found[f"{name}_constant"] = getattr(compared, name)
    found["kept_tensor"], found["kept_spin"], found["kept_inverse"] = compared.kept
    names = ("rounded_inverse", "rounded_tensor", "rounded_spin", "rounded_arm")
    return found | dict(zip(names, compared.rounded, strict=True))


def _over_boxes(compared: Compared, p: ca.SX, boxes: tuple[Array, Array]) -> dict[str, Interval] | None:
    """Returns all that is looked at, each flat, rows first, over boxes of p; None where it is not finite."""
    found = _expressions(compared)
    flat = [ca.densify(ca.vec(ca.densify(one).T)) for one in found.values()]
    results = over_boxes(ca.Function("compared", [p], flat), *boxes)
    if not all(np.isfinite(end).all() for pair in results for end in pair):
        return None
    return dict(zip(found, results, strict=True))


def _at(graph: CompositeGraph, expression: ca.SX, p: Array) -> Array:
    """Returns the value of an expression of the inputs that shape the composite."""
    return np.array(ca.Function("value", [graph.p], [ca.densify(expression)])(p)).ravel()


def _tensor_of(six: Array) -> Array:
    xx, yy, zz, xy, xz, yz = six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _response(found: Mapping[str, Interval], name: str, acting: Array) -> LargestResponse:
    """Returns the largest response of a quadratic; acting : largest sizes of what acts, (m,)."""
    return LargestResponse(
        _largest(found[f"{name}_acting"], (3, len(acting))) @ acting
        + _largest(found[f"{name}_constant"], (3,)),
        _largest(found[f"{name}_products"], (3, len(PAIRS))),
        _largest(found[f"{name}_linear"], (3, 3)),
    )


def _affine(found: Mapping[str, Interval], name: str) -> Affine:
    return Affine(
        _middle_and_half(found[f"{name}_linear"], (-1, 3, 3)),
        _middle_and_half(found[f"{name}_constant"], (-1, 3, 1)),
    )


def _largest(interval: Interval, shape: tuple[int, ...]) -> Array:
    """Returns the largest size of each element over all boxes."""
    sizes = np.maximum(np.abs(interval[0]), np.abs(interval[1]))
    return np.asarray(sizes.max(axis=0).reshape(shape))


def _frobenius(interval: Interval) -> float:
    """Returns the largest Frobenius norm over all boxes."""
    sizes = np.maximum(np.abs(interval[0]), np.abs(interval[1]))
    return float(np.linalg.norm(sizes, axis=1).max())


def _longest(interval: Interval) -> float:
    """Returns the largest singular value of (3, 3) matrices over all boxes."""
    middle, half = _middle_and_half(interval, (-1, 3, 3))
    values = np.linalg.svd(middle, compute_uv=False)[:, 0] + np.linalg.norm(half, axis=(1, 2))
    return float(values.max()) * SLACK


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


def _sizes(low: Array, high: Array) -> Array:
    return np.maximum(np.abs(low), np.abs(high))


def _mean_and_spread(low: Array, high: Array) -> tuple[Array, Array]:
    """Returns the middle of a box and its half widths, the latter with what rounding loses."""
    return 0.5 * (low + high), 0.5 * (high - low) * SLACK + EPSILON * _sizes(low, high)


def growth_over(found: RangeSuprema, low: Array, high: Array) -> float:
    """Returns the largest growth over a box of y and all boxes. [EB] eqs. (30), (38)."""
    middle, half = found.forms
    low, high = np.nextafter(low + found.shift, -np.inf), np.nextafter(high + found.shift, np.inf)
    weights = np.append(_sizes(low, high), 1.0)
    blurred = np.linalg.norm(np.einsum("k,bkij->bij", weights, half), axis=(1, 2))
    largest = 0.0
    for corner in {tuple(c) for c in product(*zip(low, high, strict=True))}:
        S = np.einsum("k,bkij->bij", np.array([*corner, 1.0]), middle)
        lost = 64 * EPSILON * np.einsum("k,bkij->bij", weights, np.abs(middle)).sum(axis=(1, 2))
        largest = max(largest, float((np.linalg.eigvalsh(S)[:, -1] + blurred + lost).max()))
    return largest * SLACK


def residual_over(found: RangeSuprema, low: Array, high: Array) -> float:
    """Returns the largest residual over a box of y, all boxes and what acts. [EB] eqs. (32), (40)."""
    middle, half = found.left
    ends = [[a * b for a in (low[i], high[i]) for b in (low[j], high[j])] for i, j in PAIRS]
    least, most = np.array([min(e) for e in ends]), np.array([max(e) for e in ends])
    squares = [k for k, (i, j) in enumerate(PAIRS) if i == j]
    for k in squares:
        i = PAIRS[k][0]
        least[k] = 0.0 if low[i] <= 0.0 <= high[i] else min(low[i] ** 2, high[i] ** 2)
    mean, spread = _mean_and_spread(least, most)
    mean_of_y, spread_of_y = _mean_and_spread(low, high)
    (linear, linear_half), (constant, constant_half) = found.left_affine.linear, found.left_affine.constant
    at_mean = np.abs(middle @ mean + linear @ mean_of_y + constant[:, :, 0])
    beside = np.abs(middle) @ spread + half @ _sizes(least, most)
    beside += np.abs(linear) @ spread_of_y + linear_half @ _sizes(low, high) + constant_half[:, :, 0]
    return (float(np.linalg.norm(at_mean + beside, axis=1).max()) + found.left_acting) * SLACK


def off_over(found: RangeSuprema, low: Array, high: Array) -> float:
    """Returns the largest difference of rates [rad/s] that the error does not make. [EB] eq. (41)."""
    return float(np.linalg.norm(found.off.sizes(low, high), axis=1).max())


def rates_over(found: RangeSuprema, low: Array, high: Array) -> Array:
    """Returns the largest sizes of the law's rate, (3,) [rad/s], over a box of y."""
    return np.asarray(found.rate.sizes(low, high).max(axis=0))
