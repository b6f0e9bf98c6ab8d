"""Published, rounded moments that no body can have, moved within their rounding to moments that one can have.

A body has second moments of mass S = 1/2 tr(J) E - J, the integrals of x x, x y, ..., that are positive
semidefinite, and every such S is that of a body: S >= 0 holds the triangle inequalities of the principal
moments. Of the numbers x as published and h, half a unit of the last digit of each, two convex problems ask:

    the least s for which moves y h with |y_i| <= s give S(x + y h) >= 0: the numbers are refused if s > 1
    the least sum of y_i^2 with |y_i| <= 1 and S(x + y h) >= 0: its y is unique, and what need not move stays

Both are solved by Newton's method on their logarithmic barriers -log det S - sum log(s^2 - y_i^2), which are
self-concordant: from a point inside, a step cut to 1/(1 + decrement) stays inside. With the objective over t
added, the minimum is within (3 + 2 k) t of the least one, k numbers. Source: [BV] sections 9.6.4 and 11.6.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from supervessel.problems import quantity
from supervessel.scene.sheets import Sheet, sheet_of, sheet_problem, sheet_text, tensor_of

MOST_UNITS, MOST_UNEVEN = 1e12, 1e8
"""Most units of the last digit that a number may have, and most of one number's that are another's: doubles
then tell the moves."""
TOO_FINE = (
    "the numbers are written so finely, or so unevenly, that doubles do not tell how far that is enough"
)
WEIGHTS = 0.1 ** np.arange(0.0, 11.5, 0.5)
"""Weights t of the barrier, one after the other: moves are right to t of half a unit of the last digit."""
TOLD = 1e-14
"""Least weight over the largest number in units of the last digit: S is right to some 1e-16 of that."""
CENTRED = 0.1
"""Newton's decrement from which a minimum counts as found."""
DIGITS = 8
"""Decimals of moves that need half a unit of the last digit, no less: they are found to more."""
MOST_STEPS = 100
"""Most steps of Newton's method for one weight."""

Numbers = NDArray[np.float64]


@dataclass(frozen=True)
class Mended:
    """What comes of a sheet's numbers.

    sheet  : with numbers that a body can have; None where they cannot be mended
    reason : why they cannot, "" if they can
    """

    sheet: Sheet | None
    reason: str = ""


def mended_values(vessel: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the values of the keys of a vessel's table that `mend = true` changes, and their new numbers.

    Empty where the table does not ask for it, where a body can have the moments as they are, and where the
    rounding does not reach so far.
    """
    sheet = sheet_of(vessel) if vessel.get("mend") is True else None
    found = mend(sheet) if sheet is not None and sheet_problem(sheet) else None
    if found is None or found.sheet is None:
        return {}
    moved = found.sheet.elements.tolist()
    if sheet is not None and sheet.key == "inertia":
        rows = tensor_of(moved).tolist()
        return {"inertia": moved[:3] if len(np.shape(vessel["inertia"])) == 1 else rows}
    products = {"products": [-element for element in moved[3:]]} if "products" in vessel else {}
    return {found.sheet.key: moved[:3], **products}


def mend_note(published: Mapping[str, Any], moved: Mapping[str, Any]) -> str:
    """Returns what was mended, and by how much, in words that stand behind the vessel's path.

    published, moved : raw tables of a vessel, before and after; both hold all keys of the sheet
    """
    before, after = sheet_of(published), sheet_of(moved)
    assert before is not None
    assert after is not None
    moves = np.abs(after.elements - before.elements)
    written = before.halves > 0.0
    share = float(np.max(moves[written] / before.halves[written]))
    digit = f"{share:.3g} of half a unit of the last digit"
    most = quantity(float(f"{np.max(moves):.3g}"), before.unit)
    return (
        f"{sheet_text(published, before)}: mended to {sheet_text(moved, after)[1:]}: by up to {most}, {digit}"
    )


def mend(sheet: Sheet) -> Mended:
    """Returns the nearest moments that a body can have, each off by half a unit of its last digit at most.

    sheet : with moments that no body can have
    """
    unit, written = float(np.max(sheet.halves)), sheet.halves > 0.0
    size = float(max(np.max(np.abs(sheet.elements)), np.max(np.abs(sheet.shift))))
    even = np.all(written[:3]) and unit <= MOST_UNEVEN * float(np.min(sheet.halves[written]))
    if not (even and size <= MOST_UNITS * unit):
        return Mended(None, TOO_FINE)
    free = np.flatnonzero(written)
    given = _second_moments((sheet.elements - sheet.shift) / unit)
    halves = sheet.halves[free] / unit
    moved_by = np.array([half * _second_moments(np.eye(6)[i]) for i, half in zip(free, halves, strict=True)])
    share, weights = _least_share(given, moved_by), WEIGHTS[TOLD * size / unit <= WEIGHTS]
    moves = np.full(len(free), 2.0)
    if share <= 1.0 + 0.1**DIGITS:
        moves, share = _inside(given, moved_by, halves, weights)
    just_enough = np.round(moves, DIGITS)  # half a unit of each that moves
    moves = _nearest(given, moved_by, moves, weights) if share < 1.0 else just_enough
    if np.any(np.abs(moves) > 1.0):
        return Mended(None, f"{share:.3g} of that would be needed at least")
    elements = sheet.elements.copy()
    elements[free] += unit * halves * moves
    moved = replace(sheet, elements=elements)
    return Mended(None, TOO_FINE) if sheet_problem(moved) else Mended(moved)


def _least_share(given: Numbers, moved_by: Numbers) -> float:
    """Returns a share s that moves must have at least: with smaller ones v.S v < 0 for one vector v."""
    values, vectors = np.linalg.eigh(given)
    v = vectors[:, 0]
    reach = float(np.sum(np.abs(np.einsum("i,kij,j->k", v, moved_by, v))))
    return -float(values[0]) / reach if reach > 0.0 else 0.0


def _second_moments(elements: Numbers) -> Numbers:
    """Returns S = 1/2 tr(J) E - J, (3, 3), of a tensor by its elements (6,)."""
    return 0.5 * float(np.sum(elements[:3])) * np.eye(3) - tensor_of(elements)


def _inside(given: Numbers, moved_by: Numbers, halves: Numbers, weights: Numbers) -> tuple[Numbers, float]:
    """Returns moves y, (k,), with |y_i| < s and S > 0, and s; s is below 1, or the least one.

    given    : S of the numbers as published, (3, 3)
    moved_by : what a move by half a unit of the last digit adds to S, (k, 3, 3), the diagonal's first
    halves   : half a unit of the last digit, (k,), the largest is 1
    weights  : of the barrier
    """
    raised = 2.0 * (
        1.0 + max(0.0, -float(np.linalg.eigvalsh(given)[0]))
    )  # the diagonal, by so much, is enough
    moves = np.zeros(len(halves))
    moves[:3] = raised / halves[:3]
    point = np.array([*moves, 2.0 * float(np.max(moves))])
    for weight in weights:
        for _ in range(MOST_STEPS):
            gradient, hessian = _barrier(given, moved_by, point[:-1], point[-1])
            gradient[-1] += 1.0 / weight
            step, decrement = _newton(gradient, hessian)
            if not _is_inside(given, moved_by, point + step):
                break
            point += step
            if point[-1] < 1.0:
                return point[:-1], float(point[-1])
            if decrement < CENTRED:
                break
    return point[:-1], float(point[-1])


def _nearest(given: Numbers, moved_by: Numbers, moves: Numbers, weights: Numbers) -> Numbers:
    """Returns the moves y, (k,), of the least sum of squares with |y_i| < 1 and S > 0.

    moves : any with |y_i| < 1 and S > 0; for the others see `_inside`
    """
    for weight in weights:
        for _ in range(MOST_STEPS):
            gradient, hessian = (x[..., :-1] for x in _barrier(given, moved_by, moves, 1.0))
            step, decrement = _newton(gradient + moves / weight, hessian[:-1] + np.eye(len(moves)) / weight)
            if not _is_inside(given, moved_by, np.append(moves + step, 1.0)):
                break
            moves = moves + step
            if decrement < CENTRED:
                break
    return moves


def _is_inside(given: Numbers, moved_by: Numbers, point: Numbers) -> bool:
    """Whether |y_i| < s and S > 0 hold for point = (y, s): rounding may lead outside."""
    moves, most = point[:-1], point[-1]
    S = given + np.tensordot(moves, moved_by, 1)
    return bool(np.all(np.abs(moves) < most) and np.linalg.eigvalsh(S)[0] > 0.0)


def _newton(gradient: Numbers, hessian: Numbers) -> tuple[Numbers, float]:
    """Returns a step of Newton's method that stays inside, and Newton's decrement."""
    size = 1.0 / np.sqrt(np.diag(hessian))  # numbers rounded unevenly make the Hessian's sizes uneven
    step: Numbers = size * np.linalg.solve(hessian * np.outer(size, size), -gradient * size)
    decrement = sqrt(max(0.0, -float(gradient @ step)))
    return step / (1.0 + decrement), decrement


def _barrier(given: Numbers, moved_by: Numbers, moves: Numbers, most: float) -> tuple[Numbers, Numbers]:
    """Returns gradient, (k + 1,), and Hessian of -log det S - sum log(s^2 - y_i^2) by the moves y and s."""
    inverse = np.linalg.inv(given + np.tensordot(moves, moved_by, 1))
    turned = inverse @ moved_by
    above, below = 1.0 / (most - moves), 1.0 / (most + moves)
    curvature = above**2 + below**2
    pulled = np.trace(turned, axis1=1, axis2=2)
    gradient: Numbers = np.array([*(above - below - pulled), -np.sum(above + below)])
    hessian = np.zeros((len(moves) + 1, len(moves) + 1))
    hessian[:-1, :-1] = np.einsum("aij,bji->ab", turned, turned) + np.diag(curvature)
    hessian[-1, :-1] = hessian[:-1, -1] = below**2 - above**2
    hessian[-1, -1] = np.sum(curvature)
    return gradient, hessian
