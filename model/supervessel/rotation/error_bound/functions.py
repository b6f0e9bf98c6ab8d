"""The functions by which an FMU carries the bound of `error_bound` along its flight.

b : the bound, (3,): of the angle [rad] between the attitude and that of the law "tensor" with the same
    inputs; of the difference of the rates in the energy norm [J^(1/2)]; of that difference [rad/s]
s : of a sub-step, (4,): its length [s]; one more than the order of its Taylor series; the method's own
    estimates of its error, [rad] and [rad/s]
"""

from collections.abc import Sequence

import casadi as ca

from supervessel.composite.inertia import from_upper_triangle
from supervessel.composite.parts import CompositeGraph
from supervessel.composite.resolved import ResolvedScene
from supervessel.rotation.axes import AxesGraph
from supervessel.rotation.changes import spin_of
from supervessel.rotation.dynamics import Dynamics, dynamics_of
from supervessel.rotation.error_bound.carried import (
    INFLATION,
    MotionBounds,
    TurnedBody,
    carried,
    kept_momentum,
    kept_rate,
    largest_growth,
    largest_residual,
    motion_bounds,
)
from supervessel.rotation.error_bound.constants import BoundConstants, constants_of, restored
from supervessel.rotation.error_bound.remainder import (
    UNKNOWN,
    Remainder,
    has_sure_remainder,
    remainder_of,
    remainder_of_taylor,
    step_error,
)
from supervessel.rotation.propagators import Plan, name_of
from supervessel.rotation.propagators.method import Propagator
from supervessel.scene.schema import Scene


def bound_after_step(
    constants: BoundConstants, body: TurnedBody, state: ca.SX, step: ca.SX, bound: ca.SX
) -> tuple[ca.SX, MotionBounds]:
    """Returns the bound, (2,) [rad, J^(1/2)], after a step of the law's exact motion, and where that may be.

    body  : tensor, torque and spin as they are, whatever the law makes of them
    state : x at the start of the step, (7,)
    step  : [s]
    """
    norm, motion = constants.norm, motion_bounds(constants, body, state[4:], step)
    growth, residual = largest_growth(constants, motion), largest_residual(constants, body, motion)
    return carried(bound, norm.rate_share, growth, residual, step), motion


def bound_functions(
    resolved: ResolvedScene, plan: Plan, graph: CompositeGraph, axes: AxesGraph, symbols: Sequence[ca.SX]
) -> tuple[ca.Function, ...]:
    """Returns the functions by which a scene's FMU carries its bound; none where no output shows it.

    symbols : x, u and c

    bound_step          : x, u, c, a, s, b -> b after a sub-step
    bound_kept_rate     : energy norm, c, d -> that after a change from c to d under which both rates stay
    bound_kept_momentum : energy norm, c, d, omega, omega after -> that after a change under which the true
                          momentum stays and the cheap rate becomes another
    """
    if "bound" not in axes.slices:
        return ()
    x, u, c = symbols
    d, a, s, b = (ca.SX.sym(*size) for size in (("d", c.numel()), ("a", axes.a.numel()), ("s", 4), ("b", 3)))
    before, after = graph.parts(c), graph.parts(d)
    dynamics = dynamics_of(resolved, before, u)
    constants = restored(constants_of(dynamics), a[axes.slices["bound"]])
    body = body_of(dynamics)
    end, motion = bound_after_step(constants, body, x, s[0], b[:2])
    sure = has_sure_remainder(resolved.scene.rotation)
    end += _step_error(plan, constants, body, motion, s if not sure else s[:2])
    rate = INFLATION * constants.norm.rate_share * end[1]
    energy, omega, turned = b[1], ca.SX.sym("omega", 3), ca.SX.sym("turned", 3)
    tensor, other = dynamics.inertia, from_upper_triangle(after["inertia"])
    excess = other @ turned - tensor @ omega + spin_of(after) - spin_of(before)
    return (
        ca.Function("bound_step", [x, u, c, a, s, b], [ca.cse(ca.vertcat(end, rate))]),
        ca.Function("bound_kept_rate", [energy, c, d], [kept_rate(energy, tensor, other)]),
        ca.Function(
            "bound_kept_momentum",
            [energy, c, d, omega, turned],
            [kept_momentum(energy, tensor, other, excess)],
        ),
    )


def body_of(dynamics: Dynamics) -> TurnedBody:
    """Returns what turns the body, whatever the law makes of it."""
    spin = ca.SX.zeros(3) if dynamics.moving is None else dynamics.moving
    return TurnedBody(dynamics.inertia, dynamics.torque, spin)


def keeps_in_truth(scene: Scene) -> dict[str, str]:
    """Returns what changes keep, by their kind, in the motion that the bound is about: the law "tensor"."""
    rotation = scene.rotation.model_copy(update={"law": "tensor"})
    return dict(scene.model_copy(update={"rotation": rotation}).keeps)


def _step_error(
    plan: Plan, constants: BoundConstants, body: TurnedBody, motion: MotionBounds, s: ca.SX
) -> ca.SX:
    """Returns what a sub-step of a scene's plan adds, (2,) [rad, J^(1/2)].

    s : see the module; s[1] is 0 for free motion, and the estimates are left out where none are asked for
    """
    free = step_error(None, constants, body, motion)
    if plan.method is None:
        return free
    stepped = step_error(
        _remainder(plan.method, s[1]), constants, body, motion, s[2:] if s.numel() > 2 else None
    )
    return ca.if_else(s[1] == 0.0, free, stepped) if plan.free == "while free" else stepped


def _remainder(method: Propagator, power: ca.SX) -> Remainder:
    """Returns the remainder of a method's steps, the power of a Taylor step's being an expression."""
    name = name_of(method)
    if name == "taylor":
        return remainder_of_taylor(power - 1.0)
    return UNKNOWN if name == "split" else remainder_of(name)
