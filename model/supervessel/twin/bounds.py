"""The bound of what a scene's law and method are off by, of the twin's own expressions."""

from collections.abc import Mapping
from functools import reduce

import casadi as ca

from supervessel.composite.inertia import from_upper_triangle
from supervessel.equations import Equations, composite_slices
from supervessel.rotation.changes import contact_momentum, each_motion, stage_composites, stages
from supervessel.rotation.dynamics import dynamics_of
from supervessel.rotation.error_bound.carried import kept_momentum, kept_rate
from supervessel.rotation.error_bound.constants import constants_of, norm_of
from supervessel.rotation.error_bound.functions import body_of, bound_after_step, keeps_in_truth
from supervessel.rotation.error_bound.remainder import Remainder, remainder_of, step_error
from supervessel.rotation.propagators import name_of
from supervessel.rotation.propagators.taylor import taylor_order
from supervessel.scene.consistency import NO_BOUND_IN_ORBIT

Parts = Mapping[str, ca.SX]


def bound_over_step(model: Equations, parts: Parts, bound: ca.SX, at: tuple[ca.SX, ca.SX, ca.SX]) -> ca.SX:
    """Returns the bound, (2,) [rad, J^(1/2)], after one step of a scene's method.

    parts : of the composite by name, expressions
    at    : state x at the start, (7,), inputs that act u, step h [s]
    Raises ValueError for a method whose steps have no bound, and for the law "none" in a field of gravity.
    """
    x, u, h = at
    scene = model.resolved.scene
    if scene.gravity is not None and scene.rotation.law == "none":
        raise ValueError(f"error_bound: {NO_BOUND_IN_ORBIT}")
    dynamics = dynamics_of(model.resolved, parts, u)
    constants, body = constants_of(dynamics), body_of(dynamics)
    found = bound_after_step(constants, body, x, h, bound)
    return found.bound + step_error(method_remainder(model), constants, body, found.motion)


def inertia_of(c: ca.SX) -> ca.SX:
    """Returns the tensor, (3, 3) [kg m2], of a composite."""
    return from_upper_triangle(c[composite_slices()["inertia"]])


def method_remainder(model: Equations) -> Remainder | None:
    """Returns the remainder of a step of a scene's method; None for exact free motion."""
    method, tolerance = model.plan.method, model.resolved.scene.rotation.tolerance
    if method is None:
        return None
    name = name_of(method)
    if name == "split":
        raise ValueError(
            'error_bound: propagator = "split" has no proven bound of its steps: must be another one'
        )
    order = taylor_order(tolerance) if name == "taylor" else 0
    return remainder_of(name, order, in_orbit=model.has_field)


def bound_over_change(
    model: Equations, omega: ca.SX, bound: ca.SX, inputs: tuple[ca.SX, ca.SX, ca.SX]
) -> ca.SX:
    """Returns the bound, (2,) [rad, J^(1/2)], after a change of the inputs p at one instant.

    omega  : of the cheap motion, (3,) [rad/s], before the change
    inputs : p before, p after, (n,), motions at contact k
    What the true motion keeps is what the scene says for the law "tensor". Docks that open leave both rates,
    and those that close alter both alike, except under the law "none". A stage in which nothing changes costs
    nothing. [EB] eqs. (21), (22).
    """
    before, after, k = inputs
    resolved, margins = model.resolved, composite_slices()["margins"]
    energy, seen_in = bound[1], inertia_of(model.composite(before))
    kept, closing = stages(resolved, keeps_in_truth(resolved.scene), before, after)
    for stage in kept:
        if stage.kept == "rate":
            continue
        c, d, refused = stage_composites(stage, model.composite, margins, after)
        turned = omega if model.change is None else model.change.keep_momentum(omega, c, d)
        first, last = inertia_of(c), inertia_of(d)
        excess = last @ turned - first @ omega
        if "momentum" in model.slices.composite:
            place = model.slices.composite["momentum"]
            excess += d[place][:3] - c[place][:3]
        kept_so = kept_momentum(kept_rate(energy, seen_in, first), first, last, excess) + refused
        moved = reduce(ca.logic_or, ca.vertsplit(stage.before != stage.after))
        energy, seen_in = ca.if_else(moved, kept_so, energy), ca.if_else(moved, last, seen_in)
        omega = turned
    end = inertia_of(model.composite(after))
    energy = kept_rate(energy, seen_in, end)
    if model.change is None and closing.numel():
        energy += norm_of(end).of_torque(contact_momentum(resolved, after, each_motion(closing) * k))
    return ca.vertcat(bound[0], energy)
