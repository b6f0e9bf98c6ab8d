"""The equations of one scene as CasADi functions: what the FMU is generated from and what the twin evaluates.

p are the inputs that shape the composite, u the torque inputs, x = (attitude, angular velocity), c what
follows from p alone, a the principal moments and axes that follow from c, where the scene needs them. c is
computed when p changes, a when c has changed and somebody asks; everything else uses them. Whatever of c is
constant in this scene is a number in those functions, not an argument that is read.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from math import frexp, ldexp

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from supervessel.attitude import attitude_dot, rotation_matrix, to_inertial, unit
from supervessel.docking import composite_body, constant
from supervessel.inertia import from_upper_triangle, ldl, upper_triangle
from supervessel.principal import principal, principal_forward, quaternion
from supervessel.propagators import PROPAGATORS, Plan, plan_of
from supervessel.propagators.bound import fastest_square
from supervessel.propagators.exact import free_functions
from supervessel.propagators.method import Motion
from supervessel.quantities import EPSILON
from supervessel.rotation import LAWS, turned_products
from supervessel.scene import Scene
from supervessel.variables import input_variables, output_variables, state_variables

COMPOSITE_SIZES = {"mass": 1, "barycentre": 3, "inertia": 6, "pmi": 3, "margins": 3}
"""Layout of c; the law's own numbers follow. inertia is the upper triangle xx, yy, zz, xy, xz, yz.

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


PRINCIPAL_OUTPUTS = frozenset({"principal_moments", "principal_axes"})


@dataclass(frozen=True)
class Equations:
    """Functions and names of one scene.

    composite    : p -> c
    axes         : c -> a; "principal" of the composite for outputs, "free" of what the law turns freely:
                   three moments each, ascending, and axes: quaternion (4,) or matrix, column by column, (9,);
                   "series", the law's map of the products of two rates, (3, n) column by column
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
    response is (ode, outputs); it takes x, u, c and a, the changes or weights are those of x, u, c.
    """

    composite: ca.Function
    axes: ca.Function
    ode: ca.Function
    outputs: ca.Function
    fastest_square: ca.Function
    step: ca.Function
    propagation: tuple[ca.Function, ...]
    composite_forward: ca.Function
    composite_reverse: ca.Function
    response_forward: ca.Function
    response_reverse: ca.Function
    plan: Plan
    axes_slices: Mapping[str, slice]
    error_exponent: int
    product_count: int
    p_names: tuple[str, ...]
    u_names: tuple[str, ...]
    x_names: tuple[str, ...]
    y_names: tuple[str, ...]

    @property
    def functions(self) -> tuple[ca.Function, ...]:
        """The functions that the FMU needs."""
        always = (self.composite, self.ode, self.outputs, *self.propagation)
        derivatives = (
            self.composite_forward,
            self.composite_reverse,
            self.response_forward,
            self.response_reverse,
        )
        return (*always, *((self.axes,) if self.axes_slices else ()), *derivatives)


def composite_slices() -> dict[str, slice]:
    """Returns where each part of c stands; "law" is what follows them."""
    slices, start = {}, 0
    for name, size in COMPOSITE_SIZES.items():
        slices[name] = slice(start, start + size)
        start += size
    return slices | {"law": slice(start, None)}


@contextmanager
def simplification(on: bool) -> Iterator[None]:
    """Has CasADi simplify expressions as they are built, or not, whatever the caller has set for his own."""
    before = ca.GlobalOptions.getSimplificationOnTheFly()
    ca.GlobalOptions.setSimplificationOnTheFly(on)
    try:
        yield
    finally:
        ca.GlobalOptions.setSimplificationOnTheFly(before)


@simplification(True)
def equations(scene: Scene) -> Equations:
    """Returns the equations of a scene, folded for what it holds constant."""
    inputs = input_variables(scene)
    p_names, k_names, u_names = (
        tuple(variable.name for variable in inputs if variable.part == part)
        for part in ("shape", "contact", "action")
    )
    p, u, x, h = (ca.SX.sym(*s) for s in (("p", len(p_names)), ("u", len(u_names)), ("x", 7), ("h", 1)))

    law, plan = LAWS[scene.rotation.law], plan_of(scene)
    c_of_p = _composite(scene, p_names, p, law.prepare)
    c = ca.SX.sym("c", c_of_p.numel())
    known = ca.vertcat(*(c_of_p[i] if c_of_p[i].is_constant() else c[i] for i in range(c.numel())))
    parts = {name: known[where] for name, where in composite_slices().items()}
    inertia = from_upper_triangle(parts["inertia"])
    torque = u if u_names else ca.SX.zeros(3)

    def rate(state: ca.SX) -> ca.SX:
        acceleration = law.acceleration(parts["law"], state[4:], torque)
        return ca.vertcat(attitude_dot(state[:4], state[4:]), acceleration)

    products = _without_zeros(law.gyroscopic(parts["law"]))
    slices, a_of_c = _axes(scene, plan, inertia, products)
    a, e = ca.SX.sym("a", a_of_c.numel()), ca.SX.sym("e")
    by_torque = law.acceleration(parts["law"], ca.SX.zeros(3), torque)
    fastest = fastest_square(x[4:], by_torque, law.growth, scene.rotation.max_angle_step)
    with_error = "error_estimate" in scene.outputs.names
    motion = Motion(x, rate, law, parts["law"], torque, h, scene.rotation.tolerance, with_error)
    method = plan.method or PROPAGATORS["dop853"]
    assert method.build is not None
    step = method.build(motion)
    results = [step.state] if step.error is None else [step.state, step.error]
    args, names = [x, u, c], ["x", "u", "c"]
    steps = [
        ca.Function("fastest_square", args, [fastest], names, ["rate_square"]),
        ca.Function("step", [*args, h], results, [*names, "h"], ["x_next", "error"][: len(results)]),
    ]
    series = ca.Function("by_torque", [u, c], [by_torque], ["u", "c"], ["acceleration"])
    propagation = (
        {"angle": steps, "error": steps[1:], "series": [series]}[plan.method.control] if plan.method else []
    )
    if plan.free != "never":
        propagation += free_functions(a.numel(), slices["free"])
    y = _outputs(scene, x, parts, a[slices["principal"]] if "principal" in slices else ca.SX.zeros(7), e)
    return Equations(
        composite=ca.Function("composite", [p], [c_of_p], ["p"], ["c"]),
        axes=ca.Function("axes", [c], [a_of_c], ["c"], ["a"]),
        ode=ca.Function("ode", args, [rate(x)], names, ["x_dot"]),
        outputs=ca.Function("outputs", [*args, a, e], [y], [*names, "a", "e"], ["y"]),
        fastest_square=steps[0],
        step=steps[1],
        propagation=tuple(propagation),
        product_count=products.size2(),
        **_derivatives("composite", [p], [c_of_p]),
        **_derivatives("response", args, [rate(x), y], (a, *_axes_change(inertia, c, a, slices))),
        plan=plan,
        axes_slices=slices,
        error_exponent=step.exponent,
        p_names=p_names,
        u_names=u_names,
        x_names=tuple(variable.name for variable in state_variables(scene)),
        y_names=tuple(variable.name for variable in output_variables(scene)),
    )


def _without_zeros(products: ca.SX) -> ca.SX:
    """Returns a law's map of products, (3, n), without the columns of squares where axes are principal."""
    columns = [products[:, i] for i in range(products.size2())]
    diagonal = all(products[i, j].is_zero() for i in range(3) for j in range(products.size2()) if i != j)
    return ca.densify(ca.horzcat(*columns[:3]) if diagonal and columns else products)


def _axes(scene: Scene, plan: Plan, inertia: ca.SX, products: ca.SX) -> tuple[dict[str, slice], ca.SX]:
    """Returns where the parts of a stand, and a as an expression of c; both empty where nobody needs them."""
    rotation = scene.rotation
    shown = not PRINCIPAL_OUTPUTS.isdisjoint(scene.outputs.names)
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
        parts["series"] = ca.vec(turned_products(moments, axes) if mapped else products)
    slices, end = {}, 0
    for name, part in parts.items():
        slices[name] = slice(end, end := end + part.numel())
    return slices, ca.densify(ca.vertcat(ca.SX(0, 1), *parts.values()))


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
    for variable in input_variables(scene):
        if variable.part != "shape":
            continue
        owner, _, kind = variable.group.rpartition(".")
        start = variable.start
        if kind in ("direction", "alignment"):
            _, exponent = frexp(max(map(abs, getattr(scene.port(owner), kind))))
            start = ldexp(start, -exponent) if abs(exponent) > LONGEST_EXPONENT else start
        values.append(start)
    return np.array(values)


@simplification(True)
def composite_at_start(scene: Scene) -> dict[str, NDArray[np.float64]]:
    """Returns the parts of c by name, (n,) each, for the scene's own values of the inputs."""
    inputs = [v for v in input_variables(scene) if v.part == "shape"]
    p = ca.SX.sym("p", len(inputs))
    names = tuple(v.name for v in inputs)
    c = ca.Function("composite", [p], [_composite(scene, names, p, LAWS[scene.rotation.law].prepare)])
    values = np.array(c(p_start(scene))).ravel()
    return {name: values[where] for name, where in composite_slices().items()}


def _composite(scene: Scene, names: tuple[str, ...], p: ca.SX, prepare: Callable[[ca.SX], ca.SX]) -> ca.SX:
    """Returns c as an expression of p."""
    symbols = dict(zip(names, ca.vertsplit(p), strict=True)) if names else {}

    def lookup(group: str, value: ArrayLike) -> ca.SX:
        if group in symbols:
            return symbols[group]
        if f"{group}[1]" in symbols:
            return ca.vertcat(*(symbols[f"{group}[{i}]"] for i in (1, 2, 3)))
        return constant(value)

    body = composite_body(scene, lookup)
    J = body.inertia
    _, pivots = ldl(J)
    return ca.densify(
        ca.vertcat(
            body.mass,
            body.centre,
            upper_triangle(J),
            ca.diag(J) / body.mass,
            pivots[0],
            pivots[1] - PIVOT_SLACK * J[1, 1],
            pivots[2] - PIVOT_SLACK * (J[2, 2] * (J[1, 1] / pivots[1])),
            prepare(J),
        )
    )


def _derivatives(
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


def _outputs(
    scene: Scene, x: ca.SX, parts: dict[str, ca.SX], principal_part: ca.SX, estimate: ca.SX
) -> ca.SX:
    """Returns the scene's outputs, in its order.

    The attitude is brought to unit length once more: as a state it keeps it only to the accuracy of
    whoever integrates it.
    """
    attitude, omega = unit(x[:4]), x[4:]
    J = from_upper_triangle(parts["inertia"])
    momentum = J @ omega
    available = {
        "mass": parts["mass"],
        "barycentre": parts["barycentre"],
        "pmi": parts["pmi"],
        "inertia": ca.vec(J),
        "angular_velocity": omega,
        "attitude": attitude,
        "kinetic_energy": 0.5 * ca.dot(omega, momentum),
        "angular_momentum": to_inertial(attitude, momentum),
        "principal_moments": principal_part[:3],
        "principal_axes": principal_part[3:],
        "error_estimate": estimate,
    }
    return ca.densify(ca.vertcat(*(available[name] for name in scene.outputs.names)))
