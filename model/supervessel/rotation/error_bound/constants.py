"""What the bound of a cheaper law's error needs of a composite while that stays, in CasADi symbols.

Derivation: [EB].
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import casadi as ca

from supervessel.composite.inertia import UPPER_TRIANGLE, from_upper_triangle, ldl, symmetric
from supervessel.rotation.dynamics import Dynamics
from supervessel.rotation.gravity import Field
from supervessel.rotation.laws import LAWS, RotationLaw, gyroscopic_torque

COSINE_STEPS = 4
"""Even number of steps of [EB] eq. (10); they leave at most 1e-5 of the cosine."""

COSINE_SLACK = 2.0**-45
"""Added to the argument of [EB] eq. (10): more than its rounding, 100 u."""


SMALLEST = 2.0**-1000
"""The least number whose reciprocal is taken."""


@dataclass(frozen=True)
class EnergyNorm:
    """The energy norm of a tensor J = L L^T, of which nothing else changes from step to step.

    inertia    : J, (3, 3) [kg m2]
    lower      : L, (3, 3)
    inverse    : L^-1, (3, 3)
    rate_share : the least k with |e| <= k |e|_J: 1/sqrt(least moment), from above, [EB] eq. (6)
    turned     : S(e_k), (3, 3), of the three axes e_k, [EB] eq. (4)
    squares    : Q, (3, 3): the square of the Frobenius norm of S(w) is w . Q w
    steepest   : the growth is at most this times the length of a rate, [EB] eq. (11)
    """

    inertia: ca.SX
    lower: ca.SX
    inverse: ca.SX
    rate_share: ca.SX
    turned: tuple[ca.SX, ca.SX, ca.SX]
    squares: ca.SX
    steepest: ca.SX

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
    turned = [_symmetric_part(inverse, axis, L) for axis in ca.horzsplit(ca.SX.eye(3))]
    columns = [ca.vec(S) for S in turned]
    squares = symmetric(lambda i, j: ca.dot(columns[i], columns[j]))
    return EnergyNorm(
        inertia=inertia,
        lower=L,
        inverse=inverse,
        rate_share=ca.sqrt(largest_eigenvalue(inverse.T @ inverse)),
        turned=(turned[0], turned[1], turned[2]),
        squares=squares,
        steepest=ca.sqrt(2.0 / 3.0 * largest_eigenvalue(squares)),
    )


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

    Scaled by its largest element first: no power of it under- or overflows. Of one whose reciprocal might be
    no double three times that is returned: the eigenvalue is at most the Frobenius norm.
    """
    size = ca.norm_inf(ca.vec(S))
    invertible = size > SMALLEST
    scale = 1.0 / ca.if_else(invertible, size, 1.0)
    unit = symmetric(lambda i, j: scale * S[i, j])
    square = ca.sumsqr(unit) / 6.0
    radius = ca.sqrt(square)
    cubed = ca.if_else(invertible, square * radius, 1.0)
    argument = ca.fmin(ca.fmax(0.5 * ca.det(unit) / cubed, -1.0) + COSINE_SLACK, 1.0)
    return size * ca.if_else(invertible, 2.0 * radius * _cosine_of_third(argument), 3.0)


def _cosine_of_third(x: ca.SX) -> ca.SX:
    """Returns cos(arccos(x)/3) from above, x from -1 to 1. [EB] eq. (10)."""
    c = ca.fmin(0.5 + 0.5 * ca.sqrt((1.0 + x) / 1.5), 1.0)
    for _ in range(COSINE_STEPS):
        c = 0.5 + 0.5 * ca.sqrt((1.0 + x) / (1.0 + c))
    return c


@dataclass(frozen=True)
class LeftOut:
    """What a law leaves unbalanced in the full equation, in the energy norm. [EB] eqs. (17), (18).

    by_torque : L^-1 (J D^-1 - 1), (3, 3), times the torque
    by_rate   : linear map of w, (3, 3), of the spin of moving parts; None where none moves
    by_rates  : linear map of MIXED_PRODUCTS and SQUARES, (3, 6)
    bend      : rho with |by_rates(a, b)| <= rho |a| |b|
    """

    by_torque: ca.SX
    by_rate: ca.SX | None
    by_rates: ca.SX
    bend: ca.SX


@dataclass(frozen=True)
class GradientConstants:
    """What the bound needs of a composite that gravity's gradient turns; torques are those of 3 mu/|r|^3 = 1.

    coupling : k (J_max - J_min), where |e| <= k |e|_J: two attitudes an angle apart have torques that far
               apart in the norm of J^-1, over the angle, [EB] eq. (43)
    push     : |D^-1 torque| is at most that, D being the tensor of the law [1]
    lift     : |torque| in the norm of D^-1 is at most that; 0 where the law has no gyroscopic term
    left_out : linear map of products of r^ to L^-1 (J D^-1 torque by D - torque by J), (3, 6), [EB] eq. (45);
               None of the law that leaves nothing out
    bend     : rho with |left_out(a, b)| <= rho |a| |b|
    """

    coupling: ca.SX
    push: ca.SX
    lift: ca.SX
    left_out: ca.SX | None
    bend: ca.SX


@dataclass(frozen=True)
class BoundConstants:
    """What the bound needs of a composite, computed when that changes.

    law       : the law of the cheap motion
    numbers   : the law's own, of the tensor J
    norm      : of J
    left_out  : by the law; None of the law that leaves nothing out
    own_share : 1/sqrt(least moment) of the tensor D that the law turns, from above, [EB] eq. (13)
    coupling  : g of [EB] eq. (23), at least LEAST_COUPLING
    lightness : Frobenius norm of the inverse of the law's own tensor [1/(kg m2)]
    heaviest  : Frobenius norm of J [kg m2]
    gradient  : of gravity; None where there is no field
    """

    law: RotationLaw
    numbers: ca.SX
    norm: EnergyNorm
    left_out: LeftOut | None
    own_share: ca.SX
    coupling: ca.SX
    lightness: ca.SX
    heaviest: ca.SX
    gradient: GradientConstants | None = None


LEAST_COUPLING = 0.25
"""Least g of [EB] eq. (23): a larger one than the law's is right too, and one majorant of attitudes does."""


def constants_of(dynamics: Dynamics) -> BoundConstants:
    """Returns what the bound needs of a scene's composite."""
    law, numbers, field = dynamics.law, dynamics.numbers, dynamics.field
    return bound_constants(law, numbers, dynamics.inertia, dynamics.moving, field)


def bound_constants(
    law: RotationLaw, numbers: ca.SX, inertia: ca.SX, spin: ca.SX | None, field: Field | None = None
) -> BoundConstants:
    """Returns what the bound needs of a composite.

    numbers : the law's own, of the tensor
    inertia : (3, 3) [kg m2]
    spin    : angular momentum of the parts that move in body axes, (3,) [N m s]; None where none moves
    field   : of gravity, whose gradient turns the body; None where there is none
    """
    may_be_point = law is LAWS["none"]
    norm = norm_of(inertia, singular=may_be_point)
    own = law.turning(inertia) if law.gyroscopic_term else law.keeping(inertia)
    inverse = ca.SX.zeros(3, 3) if may_be_point else ca.inv_minor(own)
    own_share = ca.sqrt(largest_eigenvalue(inverse)) if law.gyroscopic_term else ca.SX(0.0)
    return BoundConstants(
        law=law,
        numbers=numbers,
        norm=norm,
        left_out=None if law is LAWS["tensor"] else _left_out(law, numbers, norm, spin),
        own_share=own_share,
        coupling=ca.fmax(_bilinear_norm(law.gyroscopic(numbers)), LEAST_COUPLING),
        lightness=ca.norm_fro(inverse),
        heaviest=ca.norm_fro(inertia),
        gradient=None if field is None else _gradient(law, numbers, norm, own_share, field),
    )


def _gradient(
    law: RotationLaw, numbers: ca.SX, norm: EnergyNorm, own_share: ca.SX, field: Field
) -> GradientConstants:
    """Returns what the bound needs of a body in a field of gravity; own_share : see `BoundConstants`."""
    own = field.gradient_map(law, numbers)
    own = ca.horzcat(own, ca.SX.zeros(3, 6 - own.size2()))
    left_out = None
    if law is not LAWS["tensor"]:
        left_out = ca.densify(norm.inverse @ (norm.inertia @ own + gyroscopic_torque(norm.inertia)))
    return GradientConstants(
        coupling=norm.rate_share * _spread(norm.inertia),
        push=_bilinear_norm(own),
        lift=own_share * (0.5 * _spread(field.inertia)),
        left_out=left_out,
        bend=ca.SX(0.0) if left_out is None else _bilinear_norm(left_out),
    )


def _spread(inertia: ca.SX) -> ca.SX:
    """Returns the largest moment less the least one [kg m2], from above."""
    deviator = inertia - (ca.trace(inertia) / 3.0) * ca.SX.eye(3)
    return largest_of_traceless(deviator) + largest_of_traceless(-deviator)


def _left_out(law: RotationLaw, numbers: ca.SX, norm: EnergyNorm, spin: ca.SX | None) -> LeftOut:
    """Returns what a law leaves out: delta = J w' - M + w x (J w + h) as a function of M and w."""
    J, still = norm.inertia, ca.SX.zeros(3)
    axes = ca.horzsplit(ca.SX.eye(3))
    unbalanced = J @ ca.horzcat(*(law.acceleration(numbers, still, axis) for axis in axes)) - ca.SX.eye(3)
    own = law.gyroscopic(numbers)
    own = ca.horzcat(own, ca.SX.zeros(3, 6 - own.size2()))
    by_rates = ca.densify(norm.inverse @ (J @ own - gyroscopic_torque(J)))
    by_rate = None
    if spin is not None:
        acting = ca.skew(spin)  # -w x h: the torque that moving parts add
        by_rate = ca.densify(norm.inverse @ (unbalanced if law.gyroscopic_term else -ca.SX.eye(3)) @ acting)
    return LeftOut(ca.densify(norm.inverse @ unbalanced), by_rate, by_rates, _bilinear_norm(by_rates))


def _bilinear_norm(products: ca.SX) -> ca.SX:
    """Returns g with |G(a, b)| <= g |a| |b| of a map of MIXED_PRODUCTS and SQUARES, (3, n). [EB] eq. (23)."""
    columns = ca.horzsplit(products) if products.numel() else []
    mixed, squares = columns[:3], columns[3:]
    square = sum((0.5 * ca.sumsqr(column) for column in mixed), ca.SX(0.0))
    return ca.sqrt(sum((ca.sumsqr(column) for column in squares), square))


def stored(constants: BoundConstants) -> ca.SX:
    """Returns what steps read of the constants as a vector, (n,); `restored` makes constants of it again."""
    norm, left_out = constants.norm, constants.left_out
    if left_out is None:
        parts = [_elements(norm.squares, UPPER_TRIANGLE)]
    else:
        by_rate = [] if left_out.by_rate is None else [ca.vec(left_out.by_rate)]
        parts = [ca.vec(left_out.by_torque), *by_rate, ca.vec(left_out.by_rates), left_out.bend]
        parts += [_elements(S, UPPER_TRIANGLE) for S in norm.turned]
    scalars = (norm.rate_share, norm.steepest)
    own = (constants.own_share, constants.coupling, constants.lightness, constants.heaviest)
    gradient = constants.gradient
    of_gradient: list[ca.SX] = []
    if gradient is not None:
        of_gradient = [gradient.coupling, gradient.push, gradient.lift]
        if gradient.left_out is not None:
            of_gradient += [ca.vec(gradient.left_out), gradient.bend]
    return ca.vertcat(*parts, *scalars, *own, *of_gradient)


def _elements(matrix: ca.SX, places: Sequence[tuple[int, int]]) -> ca.SX:
    return ca.vertcat(*(matrix[i, j] for i, j in places))


def restored(constants: BoundConstants, vector: ca.SX) -> BoundConstants:
    """Returns constants of the same form, with what steps read taken from a vector that `stored` made.

    What is a number in every composite stays one.
    """
    known = enumerate(ca.vertsplit(stored(constants)))
    elements = iter([own if own.is_constant() else vector[i] for i, own in known])
    norm, left_out = constants.norm, constants.left_out
    if left_out is None:
        norm = replace(norm, squares=_symmetric(elements))
    else:
        by_torque = _matrix(elements, 3)
        by_rate = None if left_out.by_rate is None else _matrix(elements, 3)
        left_out = LeftOut(by_torque, by_rate, _matrix(elements, 6), next(elements))
        norm = replace(norm, turned=(_symmetric(elements), _symmetric(elements), _symmetric(elements)))
    norm = replace(norm, rate_share=next(elements), steepest=next(elements))
    own_share, coupling, lightness, heaviest = (next(elements) for _ in range(4))
    return replace(
        constants,
        norm=norm,
        left_out=left_out,
        own_share=own_share,
        coupling=coupling,
        lightness=lightness,
        heaviest=heaviest,
        gradient=_restored_gradient(constants.gradient, elements),
    )


def _restored_gradient(
    gradient: GradientConstants | None, elements: Iterator[ca.SX]
) -> GradientConstants | None:
    if gradient is None:
        return None
    coupling, push, lift = (next(elements) for _ in range(3))
    if gradient.left_out is None:
        return replace(gradient, coupling=coupling, push=push, lift=lift)
    return GradientConstants(coupling, push, lift, _matrix(elements, 6), next(elements))


def _symmetric(elements: Iterator[ca.SX]) -> ca.SX:
    return from_upper_triangle(ca.vertcat(*(next(elements) for _ in UPPER_TRIANGLE)))


def _matrix(elements: Iterator[ca.SX], columns: int) -> ca.SX:
    """Returns a matrix of three rows, its columns one after the other."""
    return ca.horzcat(*(ca.vertcat(*(next(elements) for _ in range(3))) for _ in range(columns)))
