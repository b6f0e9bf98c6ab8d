"""The vector a of principal moments and axes that a scene needs: its parts, and its derivative by c."""

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca

from supervessel.composite.inertia import congruence
from supervessel.composite.resolved import ResolvedScene
from supervessel.derivatives import GivenDerivative
from supervessel.layout import stacked
from supervessel.rotation.attitude import rotation_matrix
from supervessel.rotation.dynamics import Dynamics
from supervessel.rotation.error_bound.constants import constants_of, stored
from supervessel.rotation.gravity import Field
from supervessel.rotation.laws import LAWS, gyroscopic_torque, principal_products
from supervessel.rotation.principal import principal, principal_forward, quaternion_of_axes
from supervessel.rotation.propagators import Plan


@dataclass(frozen=True)
class AxesGraph:
    """Principal moments and axes in CasADi symbols.

    a      : all parts, one after the other, as an expression of c, (n,); empty where the scene needs none
    slices : by the name of a part, its place in a
    """

    a: ca.SX
    slices: Mapping[str, slice]


def axes_graph(resolved: ResolvedScene, plan: Plan, dynamics: Dynamics, products: ca.SX) -> AxesGraph:
    """Returns the principal moments and axes that a scene's outputs and propagation need.

    dynamics : of the composite
    products : the law's map of products of rates, see `rotation.steps.map_of_products`

    principal : (7,), where outputs show it: moments [kg m2], ascending, and q_body_principal
    free      : (12,), where free motion is exact: principal moments [kg m2] of `RotationLaw.turning`, and
                R_body_principal, column by column
    series    : for Taylor steps: the factors (J_j - J_k)/J_i of products of two rates, (3,), principal axes;
                then, unless body axes are principal axes, R_body_principal, (9,), column by column
    gradient  : for Taylor steps in a field of gravity: the map of products to the acceleration in the axes of
                `series`, (3,) or, column by column, (18,), see `Field.gradient_map`
    response  : (3,) [1/(kg m2)], for Taylor steps with wheels under a law with products: the acceleration by
                a torque over that torque, element by element in the axes of `series`
    bound     : (n,), where error_bound is an output: see `rotation.error_bound.constants.stored`
    """
    inertia, turning = dynamics.inertia, dynamics.turning
    rotation = resolved.scene.rotation
    shown = any(kind.axes for kind, _ in resolved.output_kinds)
    in_series = plan.method is not None and plan.method.control == "series"
    series_turn = in_series and products.size2() > 3
    parts: dict[str, ca.SX] = {}
    shared = rotation.law == "tensor" and dynamics.wheels is None
    if plan.free != "never" or series_turn or (shown and shared):
        moments, R_body_principal = principal(LAWS[rotation.law].turning(turning))
    if shown:
        own = (moments, R_body_principal) if shared else principal(inertia)
        parts["principal"] = ca.vertcat(own[0], quaternion_of_axes(own[1]))
    if plan.free != "never":
        parts["free"] = ca.vertcat(moments, ca.vec(R_body_principal))
    if series_turn:
        parts["series"] = ca.vertcat(principal_products(moments), ca.vec(R_body_principal))
    elif in_series:
        parts["series"] = ca.diag(products) if products.numel() else ca.SX(0, 1)
    if in_series and dynamics.wheels is not None and products.numel():
        parts["response"] = 1.0 / moments if series_turn else _response(dynamics)
    if in_series and dynamics.field is not None:
        if series_turn and dynamics.wheels is not None:
            parts["gradient"] = _turned_gradient_map(dynamics.field, moments, R_body_principal)
        elif products.numel() and dynamics.wheels is None:
            parts["gradient"] = -parts["series"][:3]
        else:
            parts["gradient"] = _gradient_map(dynamics)
    if "error_bound" in resolved.scene.outputs.names:
        parts["bound"] = stored(constants_of(dynamics))
    slices, a = stacked(parts)
    return AxesGraph(a, slices)


def _gradient_map(dynamics: Dynamics) -> ca.SX:
    """Returns the map of products to the acceleration by gravity's gradient, body axes, see `axes_graph`."""
    assert dynamics.field is not None
    found = dynamics.field.gradient_map(dynamics.law, dynamics.numbers)
    return ca.diag(found) if found.size2() == 3 else ca.vec(found)


def _turned_gradient_map(field: Field, moments: ca.SX, R_body_principal: ca.SX) -> ca.SX:
    """Returns the same, (18,), in the principal axes of J - A, in which J is not diagonal.

    moments : of J - A, (3,) [kg m2]
    """
    inertia = congruence(R_body_principal.T, field.inertia)
    return ca.densify(ca.vec(-(gyroscopic_torque(inertia) / ca.repmat(moments, 1, 6))))


def _response(dynamics: Dynamics) -> ca.SX:
    """Returns the response, see `axes_graph`, of a body whose axes are those of the series."""
    by_axes = (
        dynamics.law.acceleration(dynamics.numbers, ca.SX.zeros(3), e) for e in ca.horzsplit(ca.SX.eye(3))
    )
    return ca.diag(ca.horzcat(*by_axes))


def axes_derivative(inertia: ca.SX, c: ca.SX, a: ca.SX, slices: Mapping[str, slice]) -> GivenDerivative:
    """Returns the derivative by c of the principal moments and axes that outputs show.

    inertia : (3, 3) [kg m2], body axes, an expression of c
    c, a    : symbols of the composite, (n,), and of its moments and axes, (m,)
    slices  : by the name of a part, its place in a
    The derivative is `principal_forward` at the moments and axes in a, so CasADi never differentiates the
    iteration that found them. The parts of a that outputs do not show get the derivative zero.
    """
    dc = ca.SX.sym("dc", c.numel())
    da = ca.SX.zeros(a.numel())
    if "principal" in slices:
        place = slices["principal"]
        moments, R_body_principal = a[place][:3], rotation_matrix(a[place][3:])
        change = ca.jtimes(inertia, c, dc)
        da[place] = ca.vertcat(*principal_forward(moments, R_body_principal, change))
    return GivenDerivative(a, dc, da)
