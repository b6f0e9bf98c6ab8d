"""The equations of one scene as CasADi functions: what the FMU is generated from and what the twin evaluates.

p are the inputs that shape the composite, u the torque inputs, x = (attitude, angular velocity), c what
follows from p alone, a the principal moments and axes that follow from c, where the scene needs them. c is
computed when p changes, a when c has changed and somebody asks; everything else uses them. Whatever of c is
constant in this scene is a number in those functions, not an argument that is read.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import frexp, ldexp

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from supervessel.composite.actions import (
    action_parts,
    torque_about_barycentre,
    vessel_parts,
)
from supervessel.composite.bodies import composite_body
from supervessel.composite.inertia import Body, from_upper_triangle, ldl, ldl_inverse, upper_triangle
from supervessel.composite.resolved import ResolvedScene, resolve
from supervessel.output_expressions import outputs_of
from supervessel.rotation.attitude import attitude_dot, rotation_matrix
from supervessel.rotation.changes import Change, change_functions, lookup_in
from supervessel.rotation.laws import LAWS, principal_products
from supervessel.rotation.principal import principal, principal_forward, quaternion
from supervessel.rotation.propagators import PROPAGATORS, Plan, plan_of
from supervessel.rotation.propagators.bound import fastest_square
from supervessel.rotation.propagators.exact import free_functions, free_functions_of_start
from supervessel.rotation.propagators.method import StepSymbols
from supervessel.scene.numbers import EPSILON
from supervessel.scene.reuse import reused
from supervessel.scene.schema import Scene, changes_rate, keeps_momentum
from supervessel.shell.interrupts import interrupt_afterwards

COMPOSITE_SIZES = {"mass": 1, "barycentre": 3, "inertia": 6, "pmi": 3, "margins": 3}
"""Layout of what every c begins with; see `composite_parts` for what follows. inertia is the upper
triangle xx, yy, zz, xy, xz, yz.

margins are the pivots of J = L D L^T less what rounding may leave of a zero: positive where the tensor is
positive definite as far as doubles can tell.
"""

LONGEST_EXPONENT = 200
"""Binary exponent of a length beyond which p_start scales a direction: its fourth power is no double."""

PIVOT_SLACK = 16.0 * EPSILON
"""What rounding may leave of a pivot that is zero, over the element J_kk that it was taken from.

The elements of a composite tensor are each off by a few u of sqrt(J_ii J_jj), which bounds |J_ij|. So the
second pivot of L D L^T is off by a few u of J_22, the third by a few u of J_33 J_22/d_2: what the second row
takes from it is divided by that row's own pivot d_2.
"""


@dataclass(frozen=True)
class Equations:
    """Functions and names of one scene.

    resolved     : the scene
    composite    : p -> c
    axes         : c -> a; "principal" of the composite for outputs, "free" of what the law turns freely:
                   three moments each, ascending, and axes: quaternion (4,) or matrix, column by column, (9,);
                   "series", what takes the products of two rates to the acceleration in principal axes, (3,),
                   then, unless these are the body's, the axes
    ode          : x, u, c -> rate of x
    outputs      : x, u, c, a, e -> the outputs y, in the scene's order; e is the last step's error estimate
    fastest_square : x, u, c -> square [rad2/s2] of the fastest rate while turning by the scene's angle
    step         : x, u, c, h -> x after one sub-step of h [s]; a second result is its estimated error, (2,),
                   if the scene's method steps by it or the scene asks for it
    by_torque    : u, c -> what the torque alone gives, (3,) [rad/s2], for the Taylor steps of C
    free_...     : exact free motion of length t [s] from x, see `propagators.exact`; with C's loop between
                   start and finish
    propagation  : those of them that the scene's co-simulation uses

    Derivatives: a name ending in _forward takes small changes of the arguments, each after the arguments
    themselves, to those of the results; _reverse takes weights of the results to those of the arguments.
    response is (state_ode, outputs); it takes z, u, c and a, the changes or weights are those of z, u, c.

    composite_graph : p and c as expressions, of which the composite's derivatives are made

    z is the state of model exchange: x, or (attitude, angular momentum) where every change keeps that.
    state_ode      : z, u, c -> rate of z
    state_outputs  : z, u, c, a, e -> the outputs
    change         : what happens when inputs change; None where the rate never changes with them
    changing       : what the FMU needs of it
    slices         : where the parts of c stand
    """

    resolved: ResolvedScene
    composite: ca.Function
    axes: ca.Function
    ode: ca.Function
    state_ode: ca.Function
    state_outputs: ca.Function
    outputs: ca.Function
    fastest_square: ca.Function
    step: ca.Function
    propagation: tuple[ca.Function, ...]
    composite_graph: tuple[ca.SX, ca.SX]
    response_forward: ca.Function
    response_reverse: ca.Function
    change: Change | None
    changing: tuple[ca.Function, ...]
    plan: Plan
    slices: Mapping[str, slice]
    axes_slices: Mapping[str, slice]
    error_exponent: int
    product_count: int
    p_names: tuple[str, ...]
    k_names: tuple[str, ...]
    u_names: tuple[str, ...]
    x_names: tuple[str, ...]
    y_names: tuple[str, ...]

    @cached_property
    def composite_derivatives(self) -> tuple[ca.Function, ca.Function]:
        """composite_forward and composite_reverse; they are made when somebody asks."""
        p, c = self.composite_graph
        with interrupt_afterwards(), simplification(True):
            forward, reverse = derivatives("composite", [p], [c]).values()
        return forward, reverse

    @property
    def functions(self) -> tuple[ca.Function, ...]:
        """The functions that the FMU needs."""
        return (self.composite, *self._motion, *self.composite_derivatives, *self._responses)

    @property
    def functions_beside_composite(self) -> tuple[ca.Function, ...]:
        """Those of them that are not the composite or its derivatives."""
        return (*self._motion, *self._responses)

    @property
    def _motion(self) -> tuple[ca.Function, ...]:
        found = (self.axes,) if self.axes_slices else ()
        return (self.state_ode, self.outputs, *self.propagation, *found)

    @property
    def _responses(self) -> tuple[ca.Function, ...]:
        return (self.response_forward, self.response_reverse, *self.changing)


def composite_slices() -> dict[str, slice]:
    """Returns where each part stands with which every c begins."""
    return _slices(COMPOSITE_SIZES)


def _slices(sizes: Mapping[str, int]) -> dict[str, slice]:
    """Returns where parts of these sizes stand one after the other."""
    slices, end = {}, 0
    for name, size in sizes.items():
        slices[name] = slice(end, end := end + size)
    return slices


@contextmanager
def simplification(on: bool) -> Iterator[None]:
    """Has CasADi simplify expressions as they are built, or not, whatever the caller has set for his own."""
    before = ca.GlobalOptions.getSimplificationOnTheFly()
    ca.GlobalOptions.setSimplificationOnTheFly(on)
    try:
        yield
    finally:
        ca.GlobalOptions.setSimplificationOnTheFly(before)


@interrupt_afterwards()
@simplification(True)
def equations(scene: Scene) -> Equations:
    """Returns the equations of a scene, folded for what it holds constant.

    Raises ValueError for a scene whose law is still to be chosen.
    """
    resolved = resolve(scene)
    p_names, k_names, u_names = (
        tuple(variable.name for variable in inputs)
        for inputs in (resolved.shaping, resolved.contact, resolved.acting)
    )
    k, u, x, h = (ca.SX.sym(*s) for s in (("k", len(k_names)), ("u", len(u_names)), ("x", 7), ("h", 1)))

    law, plan = LAWS[scene.rotation.law], plan_of(scene)
    p, of_p = _composite_of_inputs(resolved)
    where = _slices({name: part.numel() for name, part in of_p.items()})
    c_of_p = ca.densify(ca.vertcat(*of_p.values()))
    c = ca.SX.sym("c", c_of_p.numel())

    def parts_of(symbols: ca.SX) -> dict[str, ca.SX]:
        n = range(c_of_p.numel())
        known = ca.vertcat(*(c_of_p[i] if c_of_p[i].is_constant() else symbols[i] for i in n))
        return {name: known[place] for name, place in where.items()}

    parts = parts_of(c)
    inertia = from_upper_triangle(parts["inertia"])
    torque = torque_about_barycentre(resolved, parts, u)
    spin = parts["momentum"][:3] if "momentum" in parts and law.gyroscopic_term else None

    def rate(state: ca.SX) -> ca.SX:
        acting = torque if spin is None else torque - ca.cross(state[4:], spin)
        acceleration = law.acceleration(parts["law"], state[4:], acting)
        return ca.vertcat(attitude_dot(state[:4], state[4:]), acceleration)

    products = _without_zeros(law.gyroscopic(parts["law"]))
    slices, a_of_c = _axes(resolved, plan, inertia, products)
    a, e = ca.SX.sym("a", a_of_c.numel()), ca.SX.sym("e")
    with_error = "error_estimate" in scene.outputs.names
    motion = StepSymbols(x, rate, law, parts["law"], torque, h, scene.rotation.tolerance, with_error)
    rate_square, step, propagation, exponent = _steps(scene, plan, motion, parts, spin, u, c)
    if plan.free != "never":
        propagation += free_functions(a.numel(), slices["free"])
    if plan.free in ("always", "while free"):
        propagation += free_functions_of_start(a.numel(), slices["free"])

    def outputs_from(x: ca.SX) -> ca.SX:
        shown = a[slices["principal"]] if "principal" in slices else ca.SX.zeros(7)
        return outputs_of(resolved, x, u, parts | {"principal": shown, "error_estimate": e})

    args, names = [x, u, c], ["x", "u", "c"]
    state_args, state_names = args, names
    y, z_rate = y_of_x, x_rate = outputs_from(x), rate(x)
    change = change_functions(resolved, c, parts_of, p, k) if changes_rate(scene) else None
    by_momentum = change is not None and keeps_momentum(scene)
    if change is not None and by_momentum:
        z = ca.SX.sym("z", 7)
        state_args, state_names = [z, u, c], ["z", "u", "c"]
        omega = change.rate_of_momentum(z[4:], c)
        y = outputs_from(ca.vertcat(z[:4], omega))
        turning = ca.cross(omega, z[4:]) if law.gyroscopic_term else ca.SX.zeros(3)
        z_rate = ca.vertcat(attitude_dot(z[:4], omega), torque - turning)
    return Equations(
        resolved=resolved,
        composite=ca.Function("composite", [p], [c_of_p], ["p"], ["c"]),
        axes=ca.Function("axes", [c], [a_of_c], ["c"], ["a"]),
        ode=ca.Function("ode", args, [x_rate], names, ["x_dot"]),
        state_ode=ca.Function("ode", state_args, [z_rate], state_names, [f"{state_names[0]}_dot"]),
        outputs=ca.Function("outputs", [*args, a, e], [y_of_x], [*names, "a", "e"], ["y"]),
        state_outputs=ca.Function("outputs", [*state_args, a, e], [y], [*state_names, "a", "e"], ["y"]),
        fastest_square=rate_square,
        step=step,
        propagation=tuple(propagation),
        product_count=products.size2(),
        composite_graph=(p, c_of_p),
        **derivatives("response", state_args, [z_rate, y], (a, *_axes_change(inertia, c, a, slices))),
        change=change,
        changing=_changing(scene, change, by_momentum),
        plan=plan,
        slices=where,
        axes_slices=slices,
        error_exponent=exponent,
        p_names=p_names,
        k_names=k_names,
        u_names=u_names,
        x_names=tuple(variable.name for variable in resolved.states),
        y_names=resolved.output_names,
    )


def _steps(  # noqa: PLR0913, PLR0917
    scene: Scene,
    plan: Plan,
    motion: StepSymbols,
    parts: Mapping[str, ca.SX],
    spin: ca.SX | None,
    u: ca.SX,
    c: ca.SX,
) -> tuple[ca.Function, ca.Function, list[ca.Function], int]:
    """Returns fastest_square and step of `Equations`, what of both its co-simulation uses, and the power of
    the step that its error grows with.

    Where a scene has exact motion alone, the step is that of dop853.
    """
    by_torque = motion.acceleration_by_torque
    fastest = fastest_square(
        motion.state[4:],
        by_torque,
        motion.law.growth,
        scene.rotation.max_angle_step,
        None if spin is None else parts["momentum"][3],
    )
    method = plan.method or PROPAGATORS["dop853"]
    assert method.build is not None
    built = method.build(motion)
    results = [built.state] if built.error is None else [built.state, built.error]
    args, names = [motion.state, u, c], ["x", "u", "c"]
    rate_square = ca.Function("fastest_square", args, [fastest], names, ["rate_square"])
    step = ca.Function(
        "step", [*args, motion.step], results, [*names, "h"], ["x_next", "error"][: len(results)]
    )
    series = ca.Function("by_torque", [u, c], [by_torque], ["u", "c"], ["acceleration"])
    used = {"angle": [rate_square, step], "error": [step], "series": [series]}
    return rate_square, step, used[plan.method.control] if plan.method else [], built.exponent


def _without_zeros(products: ca.SX) -> ca.SX:
    """Returns a law's map of products, (3, n), without the columns of squares where axes are principal."""
    columns = [products[:, i] for i in range(products.size2())]
    diagonal = all(products[i, j].is_zero() for i in range(3) for j in range(products.size2()) if i != j)
    return ca.densify(ca.horzcat(*columns[:3]) if diagonal and columns else products)


def _axes(
    resolved: ResolvedScene, plan: Plan, inertia: ca.SX, products: ca.SX
) -> tuple[dict[str, slice], ca.SX]:
    """Returns where the parts of a stand, and a as an expression of c; both empty where nobody needs them."""
    rotation = resolved.scene.rotation
    shown = any(kind.axes for kind, _ in resolved.output_kinds)
    in_series = plan.method is not None and plan.method.control == "series"
    mapped = in_series and products.size2() > 3
    parts: dict[str, ca.SX] = {}
    if plan.free != "never" or mapped or (shown and rotation.law == "tensor"):
        moments, axes = principal(LAWS[rotation.law].turning(inertia))
    if shown:
        own_moments, own_axes = (moments, axes) if rotation.law == "tensor" else principal(inertia)
        parts["principal"] = ca.vertcat(own_moments, quaternion(own_axes))
    if plan.free != "never":
        parts["free"] = ca.vertcat(moments, ca.vec(axes))
    if in_series:
        own = ca.diag(products) if products.numel() and not mapped else ca.SX(0, 1)
        parts["series"] = ca.vertcat(principal_products(moments), ca.vec(axes)) if mapped else own
    return _slices({name: part.numel() for name, part in parts.items()}), ca.densify(
        ca.vertcat(ca.SX(0, 1), *parts.values())
    )


def _axes_change(inertia: ca.SX, c: ca.SX, a: ca.SX, slices: Mapping[str, slice]) -> tuple[ca.SX, ca.SX]:
    """Returns a small change of c and what it makes of a, for the part of a that outputs show.

    The axes that were found stand in it as they are: CasADi never differentiates how they were found.
    """
    dc = ca.SX.sym("dc", c.numel())
    da = ca.SX.zeros(a.numel())
    if "principal" in slices:
        where = slices["principal"]
        moments, axes = a[where][:3], rotation_matrix(a[where][3:])
        change = ca.jtimes(inertia, c, dc)
        da[where] = ca.vertcat(*principal_forward(moments, axes, change))
    return dc, da


def p_start(scene: Scene) -> NDArray[np.float64]:
    """Returns the scene's values of p, (n,).

    A direction whose square would under- or overflow is scaled by a power of two, as the FMU does: only
    where it points matters.
    """
    values = []
    for variable in resolve(scene).shaping:
        start = variable.start
        if variable.kind.directed:
            _, exponent = frexp(max(map(abs, variable.kind.start(scene, variable.owner))))
            start = ldexp(start, -exponent) if abs(exponent) > LONGEST_EXPONENT else start
        values.append(start)
    return np.array(values)


@interrupt_afterwards()
@simplification(True)
def composite_at_start(scene: Scene) -> dict[str, NDArray[np.float64]]:
    """Returns the parts of c by name, (n,) each, for the scene's own values of the inputs."""
    p, parts = _composite_of_inputs(resolve(scene))
    c = ca.Function("composite", [p], [ca.vertcat(*parts.values())])
    values = np.array(c(p_start(scene))).ravel()
    return {name: values[where] for name, where in _slices({n: v.numel() for n, v in parts.items()}).items()}


@reused
def _composite_of_inputs(resolved: ResolvedScene) -> tuple[ca.SX, dict[str, ca.SX]]:
    """Returns p, and the parts of c as expressions of it: for the check of a scene and for its equations."""
    p = ca.SX.sym("p", len(resolved.shaping))
    return p, composite_parts(resolved, p)


def composite_parts(resolved: ResolvedScene, p: ca.SX) -> dict[str, ca.SX]:
    """Returns the parts of c by name as expressions of p: those of COMPOSITE_SIZES, then

    law           : the law's own numbers
    momentum      : where ports move, angular momentum h, (3,) [N m s], of what moves relative to the body
                    axes, and the square of a bound, [rad2/s2], of |J^-1 (omega x h)|/|omega|
    moment, force : see `vessels.action_parts`
    .NAME         : see `vessels.vessel_parts`
    """
    lookup = lookup_in(resolved.shaping, p)
    body = composite_body(resolved, lookup)
    parts = body_parts(resolved.scene, body)
    parts |= action_parts(resolved, lookup, body.centre) | vessel_parts(resolved, lookup, body)
    return {name: ca.densify(part) for name, part in parts.items()}


def body_parts(scene: Scene, body: Body) -> dict[str, ca.SX]:
    """Returns those parts of c by name that follow from the whole as one body in the root's axes."""
    law = LAWS[scene.rotation.law]
    J = body.inertia
    steady = scene.rotation.law == "none"  # the one law that takes points, whose moments are 0
    lower, pivots = ldl(J, singular=steady)
    second = ca.if_else(pivots[1] == 0.0, 1.0, pivots[1]) if steady else pivots[1]
    margins = ca.vertcat(
        pivots[0],
        pivots[1] - PIVOT_SLACK * J[1, 1],
        pivots[2] - PIVOT_SLACK * (J[2, 2] * (J[1, 1] / second)),
    )
    parts = {
        "mass": body.mass,
        "barycentre": body.centre,
        "inertia": upper_triangle(J),
        "pmi": ca.diag(J) / body.mass,
        "margins": margins,
        "law": law.prepare(J),
    }
    if body.spin is not None:
        bound = ca.SX(0.0) if steady else ca.trace(ldl_inverse(lower, pivots))
        parts["momentum"] = ca.vertcat(body.spin, ca.sumsqr(body.spin) * bound * bound)
    return {name: ca.densify(part) for name, part in parts.items()}


def _changing(scene: Scene, change: Change | None, by_momentum: bool) -> tuple[ca.Function, ...]:
    """Returns what the FMU needs of a change: with derivatives, of the state by momentum, else of follow."""
    if change is None:
        return ()
    functions = [change.momentum_of, change.rate_of_momentum] if by_momentum else []
    functions += [change.keep_momentum] if "momentum" in scene.keeps.values() else []
    for function in functions[:1]:
        arguments = [ca.SX.sym(f"v{i}", function.numel_in(i)) for i in range(function.n_in())]
        functions += derivatives(function.name(), arguments, [function(*arguments)]).values()
    return (*functions, *((change.contact_momentum, change.docked_rate) if scene.inputs.docked else ()))


def derivatives(
    name: str, arguments: list[ca.SX], results: list[ca.SX], axes: tuple[ca.SX, ca.SX, ca.SX] | None = None
) -> dict[str, ca.Function]:
    """Returns the functions NAME_forward and NAME_reverse.

    axes : a, a small change of the last argument, and the change of a that it makes: a is one more argument
           of both functions, without a change or weight of its own
    """
    together, changed = ca.vertcat(*arguments), ca.vertcat(*results)
    seeds = [ca.SX.sym(f"d{i}", a.numel()) for i, a in enumerate(arguments)]
    weights = [ca.SX.sym(f"w{i}", r.numel()) for i, r in enumerate(results)]
    forward = ca.jtimes(changed, together, ca.vertcat(*seeds))
    reverse = ca.jtimes(changed, together, ca.vertcat(*weights), True)
    given = list(arguments)
    if axes is not None:
        a, dc, da = axes
        given.append(a)
        last = arguments[-1].numel()
        forward += ca.jtimes(changed, a, ca.substitute(da, dc, seeds[-1]))
        weight = ca.jtimes(da, dc, ca.jtimes(changed, a, ca.vertcat(*weights), True), True)
        reverse += ca.vertcat(ca.SX.zeros(together.numel() - last), weight)
    forward, reverse = ca.densify(forward), ca.densify(reverse)
    return {
        f"{name}_forward": ca.Function(f"{name}_forward", given + seeds, _split(forward, results)),
        f"{name}_reverse": ca.Function(f"{name}_reverse", given + weights, _split(reverse, arguments)),
    }


def _split(vector: ca.SX, like: list[ca.SX]) -> list[ca.SX]:
    """Returns a vector cut into parts of the sizes of `like`."""
    ends = np.cumsum([0] + [part.numel() for part in like])
    return [vector[int(start) : int(end)] for start, end in pairwise(ends)]
