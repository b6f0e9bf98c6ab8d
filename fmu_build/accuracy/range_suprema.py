"""What a law and the law "tensor" do at most over the ranges of a scene's inputs, by interval arithmetic.

The norm is that of one fixed tensor K: [EB] eqs. (29) to (32), model/docs/error_bound.md.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from math import sqrt

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fmu_build.accuracy.intervals import Interval, boxes_of, over_boxes
from supervessel.composite.actions import torque_about_barycentre
from supervessel.composite.inertia import from_upper_triangle, ldl, ldl_inverse, upper_triangle
from supervessel.composite.parts import composite_graph
from supervessel.composite.resolved import ResolvedScene
from supervessel.rotation.laws import LAWS, MIXED_PRODUCTS, SQUARES
from supervessel.scene.numbers import EPSILON
from supervessel.scene.schema import Law

Array = NDArray[np.float64]
Bounds = Mapping[str, tuple[float, float]]

BOXES = 256
"""Boxes into which the ranges of what shapes the composite are cut, at most, for each set of docks."""

MOST_DOCKS = 6
"""Docks that open and close, at most: all their combinations are looked at."""

SLACK = 1.0 + 1e-9
"""What rounding of the scalar sums, of some hundreds of positive terms, and of eigenvalues may lose."""

PAIRS = (*MIXED_PRODUCTS, *SQUARES)
"""Products of two rates, in the order of columns."""


@dataclass(frozen=True)
class RangeSuprema:
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


def range_suprema(resolved: ResolvedScene, ranges: Bounds) -> RangeSuprema | None:
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
    return RangeSuprema(
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
    """Returns p -> what `range_suprema` needs, each flat, rows first. [EB] eqs. (29) to (32).

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


def fastest_change(found: RangeSuprema, low: Array, high: Array) -> Array:
    sizes = np.maximum(np.abs(low), np.abs(high))
    with np.errstate(invalid="ignore", over="ignore"):
        return np.asarray(found.push + found.pull @ np.array([sizes[i] * sizes[j] for i, j in PAIRS]))


def growth_over(found: RangeSuprema, low: Array, high: Array) -> float:
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


def residual_over(found: RangeSuprema, low: Array, high: Array) -> float:
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
