"""What the bound of a cheaper law's error needs of a composite while that stays, in CasADi symbols.

Derivation: [EB].
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import casadi as ca

from supervessel.composite.inertia import UPPER_TRIANGLE, from_upper_triangle, ldl, symmetric
from supervessel.rotation.laws import RotationLaw

COSINE_STEPS = 4
"""Even number of steps of [EB] eq. (10); they leave at most 1e-5 of the cosine."""

COSINE_SLACK = 2.0**-45
"""Added to the argument of [EB] eq. (10): more than its rounding, 100 u."""


@dataclass(frozen=True)
class EnergyNorm:
    """The energy norm of a tensor J = L L^T, of which nothing else changes from step to step.

    inertia    : J, (3, 3) [kg m2]
    lower      : L, (3, 3)
    inverse    : L^-1, (3, 3)
    rate_share : the least k with |e| <= k |e|_J: 1/sqrt(least moment), from above, [EB] eq. (6)
    turned     : S(e_k), (3, 3), of the three axes e_k, [EB] eq. (4)
    in_box     : (3, 3), sums of the products of the sizes of two S's elements, [EB] eq. (11)
    """

    inertia: ca.SX
    lower: ca.SX
    inverse: ca.SX
    rate_share: ca.SX
    turned: tuple[ca.SX, ca.SX, ca.SX]
    in_box: ca.SX

    def of_torque(self, torque: ca.SX) -> ca.SX:
        """Returns |L^-1 torque|, the energy norm of J^-1 torque."""
        return ca.norm_2(self.inverse @ torque)


def norm_of(inertia: ca.SX, *, singular: bool = False) -> EnergyNorm:
    """Returns the energy norm of a positive definite tensor, (3, 3) [kg m2].

    singular : whether the tensor of a mass point may be given, for which the result means nothing
    """
    lower, pivots = ldl(inertia, singular=singular)
    if singular:
        pivots = ca.if_else(pivots > 0.0, pivots, 1.0)
    roots = ca.sqrt(pivots)
    L = ca.densify(_unit_lower(lower) @ ca.diag(roots))
    m21, m31, m32 = -lower[0], lower[0] * lower[2] - lower[1], -lower[2]
    inverse = ca.densify(ca.diag(1.0 / roots) @ _unit_lower(ca.vertcat(m21, m31, m32)))
    share = ca.sqrt(largest_eigenvalue(inverse.T @ inverse))
    x, y, z = (_symmetric_part(inverse, axis, L) for axis in ca.horzsplit(ca.SX.eye(3)))
    sizes = [ca.vec(ca.fabs(S)) for S in (x, y, z)]
    in_box = symmetric(lambda i, j: ca.dot(sizes[i], sizes[j]))
    return EnergyNorm(inertia, L, inverse, share, (x, y, z), in_box)


def _unit_lower(below: ca.SX) -> ca.SX:
    """Returns the unit lower triangular matrix, (3, 3), of its elements 21, 31, 32."""
    return ca.vertcat(
        ca.horzcat(1.0, 0.0, 0.0),
        ca.horzcat(below[0], 1.0, 0.0),
        ca.horzcat(below[1], below[2], 1.0),
    )


def _symmetric_part(inverse: ca.SX, rate: ca.SX, lower: ca.SX) -> ca.SX:
    """Returns S(w), the symmetric part of -L^-1 [w x] L, (3, 3); its trace is zero. [EB] eq. (4)."""
    product = -(inverse @ (ca.skew(rate) @ lower))
    return symmetric(lambda i, j: 0.5 * (product[i, j] + product[j, i]))


def largest_eigenvalue(matrix: ca.SX) -> ca.SX:
    """Returns the largest eigenvalue of a symmetric (3, 3) matrix, from above, within 1e-5 of its spread."""
    mean = ca.trace(matrix) / 3.0
    return mean + largest_of_traceless(matrix - mean * ca.SX.eye(3))


def largest_of_traceless(S: ca.SX) -> ca.SX:
    """Returns the largest eigenvalue of a symmetric (3, 3) matrix of trace zero, from above.

    Scaled by its largest element first: no power of it under- or overflows.
    """
    size = ca.norm_inf(ca.vec(S))
    scale = 1.0 / ca.if_else(size > 0.0, size, 1.0)
    unit = symmetric(lambda i, j: scale * S[i, j])
    square = ca.sumsqr(unit) / 6.0
    radius = ca.sqrt(square)
    cubed = ca.if_else(size > 0.0, square * radius, 1.0)
    argument = ca.fmin(ca.fmax(0.5 * ca.det(unit) / cubed, -1.0) + COSINE_SLACK, 1.0)
    return 2.0 * size * radius * _cosine_of_third(argument)


def _cosine_of_third(x: ca.SX) -> ca.SX:
    """Returns cos(arccos(x)/3) from above, x from -1 to 1. [EB] eq. (10)."""
    c = ca.fmin(0.5 + 0.5 * ca.sqrt((1.0 + x) / 1.5), 1.0)
    for _ in range(COSINE_STEPS):
        c = 0.5 + 0.5 * ca.sqrt((1.0 + x) / (1.0 + c))
    return c


@dataclass(frozen=True)
class BoundConstants:
    """What the bound needs of a composite, computed when that changes.

    law        : the law of the cheap motion
    numbers    : the law's own, of the tensor J
    norm       : of J
    own_lower  : L_D, (3, 3), of the tensor D = L_D L_D^T that the law turns; (0, 0) where it turns none
    own_shares : sqrt((D^-1)_ii), (3,) [1/sqrt(kg m2)], [EB] eq. (13); (0,) likewise
    pull       : sizes of the elements of G, the law's map of products of rates, (3, n)
    coupling   : g of [EB] eq. (24), at least LEAST_COUPLING
    lightness  : Frobenius norm of the inverse of the law's own tensor [1/(kg m2)]
    heaviest   : Frobenius norm of L
    """

    law: RotationLaw
    numbers: ca.SX
    norm: EnergyNorm
    own_lower: ca.SX
    own_shares: ca.SX
    pull: ca.SX
    coupling: ca.SX
    lightness: ca.SX
    heaviest: ca.SX


LEAST_COUPLING = 0.25
"""Least g of [EB] eq. (24): a larger one than the law's is right too, and one majorant of attitudes does."""


def bound_constants(law: RotationLaw, numbers: ca.SX, inertia: ca.SX) -> BoundConstants:
    """Returns what the bound needs of a composite.

    numbers : the law's own, of the tensor
    inertia : (3, 3) [kg m2]
    """
    singular = not (
        law.products or numbers.numel()
    )  # the law that takes a mass point, whose moments are zero
    norm = norm_of(inertia, singular=singular)
    own_lower, own_shares = ca.SX(0, 0), ca.SX(0, 1)
    if law.gyroscopic_term:
        own = norm_of(law.turning(inertia))
        own_lower = own.lower
        own_shares = ca.vertcat(*(ca.norm_2(own.inverse[:, i]) for i in range(3)))
    kept = law.turning(inertia) if law.gyroscopic_term else law.keeping(inertia)
    lightness = ca.SX(0.0) if singular else ca.norm_fro(ca.inv_minor(kept))
    products = law.gyroscopic(numbers)
    return BoundConstants(
        law=law,
        numbers=numbers,
        norm=norm,
        own_lower=own_lower,
        own_shares=own_shares,
        pull=ca.fabs(products),
        coupling=_coupling(law, products),
        lightness=lightness,
        heaviest=ca.norm_fro(norm.lower),
    )


def _coupling(law: RotationLaw, products: ca.SX) -> ca.SX:
    """Returns g with |G(a, b)| <= g |a| |b|, at least LEAST_COUPLING. [EB] eq. (24)."""
    if not law.products:
        return ca.SX(LEAST_COUPLING)
    per = ca.vertcat(*(1.0 if i == j else 0.5 for i, j in law.products))
    square = ca.sum1(ca.sum2(products**2 @ ca.diag(per)))
    return ca.fmax(ca.sqrt(square), LEAST_COUPLING)


LOWER_TRIANGLE = tuple((i, j) for j in range(3) for i in range(j, 3))


def stored(constants: BoundConstants) -> ca.SX:
    """Returns what the bound needs of a composite as a vector, (n,), without what is zero in every one."""
    norm = constants.norm
    upper = (*norm.turned, norm.in_box)
    return ca.vertcat(
        *(_elements(matrix, LOWER_TRIANGLE) for matrix in (norm.lower, norm.inverse, constants.own_lower)),
        *(_elements(matrix, UPPER_TRIANGLE) for matrix in upper),
        constants.pull.nz[:],
        constants.own_shares,
        norm.rate_share,
        constants.coupling,
        constants.lightness,
        constants.heaviest,
    )


def _elements(matrix: ca.SX, places: Sequence[tuple[int, int]]) -> ca.SX:
    return ca.vertcat(*(matrix[i, j] for i, j in places)) if matrix.numel() else ca.SX(0, 1)


def restored(constants: BoundConstants, vector: ca.SX) -> BoundConstants:
    """Returns constants of the same form whose elements are those of a vector that `stored` made.

    What is a number in every composite stays one.
    """
    known = stored(constants)
    elements = iter(own if own.is_constant() else vector[i] for i, own in enumerate(ca.vertsplit(known)))
    norm = constants.norm
    lower, inverse, own_lower = (
        _lower(elements) if matrix.numel() else matrix
        for matrix in (norm.lower, norm.inverse, constants.own_lower)
    )
    x, y, z, in_box = (from_upper_triangle(_next(elements, 6)) for _ in range(4))
    pull = ca.SX(constants.pull.sparsity(), _next(elements, constants.pull.nnz()))
    shares = _next(elements, constants.own_shares.numel())
    rate_share, coupling, lightness, heaviest = (next(elements) for _ in range(4))
    return replace(
        constants,
        norm=replace(
            norm, lower=lower, inverse=inverse, rate_share=rate_share, turned=(x, y, z), in_box=in_box
        ),
        own_lower=own_lower,
        own_shares=shares,
        pull=pull,
        coupling=coupling,
        lightness=lightness,
        heaviest=heaviest,
    )


def _next(elements: Iterator[ca.SX], count: int) -> ca.SX:
    return ca.vertcat(ca.SX(0, 1), *(next(elements) for _ in range(count)))


def _lower(elements: Iterator[ca.SX]) -> ca.SX:
    matrix = ca.SX.zeros(3, 3)
    for i, j in LOWER_TRIANGLE:
        matrix[i, j] = next(elements)
    return matrix
