"""The functions by which an FMU carries the bound of `error_bound` along its flight.

b : the bound, (3,): of the angle [rad] between the attitude and that of the law "tensor" with the same
    inputs; of the difference of the rates in the energy norm [J^(1/2)]; of that difference [rad/s]; in a
    field of gravity, (4,), then the error of the centre's place since the communication step's start, see
    `place_during`
s : of a sub-step, (4,): its length [s]; one more than the order of its Taylor series; the method's own
    estimates of its error, [rad] and [rad/s]
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from supervessel.composite.inertia import from_upper_triangle
from supervessel.composite.parts import CompositeGraph
from supervessel.composite.resolved import ResolvedScene
from supervessel.rotation.axes import AxesGraph
from supervessel.rotation.changes import spin_of
from supervessel.rotation.dynamics import Dynamics, dynamics_of
from supervessel.rotation.error_bound.carried import (
    INFLATION,
    Drive,
    MotionBounds,
    TurnedBody,
    carried,
    carried_in_orbit,
    kept_momentum,
    kept_rate,
    largest_growth,
    largest_residual,
    motion_bounds,
)
from supervessel.rotation.error_bound.centre_motion import (
    FARTHEST_OFF,
    centre_motion,
    place_after,
    place_during,
)
from supervessel.rotation.error_bound.constants import BoundConstants, constants_of, restored
from supervessel.rotation.error_bound.remainder import (
    UNKNOWN,
    UNKNOWN_IN_ORBIT,
    Remainder,
    has_sure_remainder,
    place_error,
    remainder_of,
    remainder_of_taylor,
    step_error,
)
from supervessel.rotation.propagators import Plan, name_of
from supervessel.rotation.propagators.method import Propagator
from supervessel.scene.schema import Scene


@dataclass(frozen=True)
class CarriedBound:
    """The bound after a step of the law's exact motion.

    bound  : (2,) [rad, J^(1/2)]
    motion : where the law's rate and the attracting centre may be during the step
    place  : in a field of gravity the error of the centre's place at most during the step, see `place_during`
    """

    bound: ca.SX
    motion: MotionBounds
    place: ca.SX


def bound_after_step(
    constants: BoundConstants, body: TurnedBody, state: ca.SX, step: ca.SX, bound: ca.SX
) -> CarriedBound:
    """Returns the bound after a step of the law's exact motion.

    body  : tensor, torque, spin and field as they are, whatever the law makes of them
    state : x at the start of the step, (7,)
    step  : [s]
    bound : (2,) [rad, J^(1/2)]; (3,) in a field of gravity where the centre's place at the start is off too,
            see `place_during`
    """
    norm = constants.norm
    centre = None if body.field is None else centre_motion(body.field, state[:4], step)
    motion = motion_bounds(constants, body, state[4:], step, centre)
    growth, residual = largest_growth(constants, motion), largest_residual(constants, body, motion)
    if centre is None or constants.gradient is None:
        return CarriedBound(carried(bound, norm.rate_share, growth, residual, step), motion, ca.SX(0.0))
    coupling = centre.strongest * constants.gradient.coupling
    off, known = ca.SX(0.0), centre.known
    if bound.numel() > 2:
        off = place_during(centre, bound[2], step)
        residual += PLACE_SHARE * coupling * (ca.fmin(off, FARTHEST_OFF) / centre.nearest)
        known = ca.logic_and(known, off <= FARTHEST_OFF)
    found = carried_in_orbit(bound, norm.rate_share, Drive(growth, residual, coupling), step)
    return CarriedBound(found + ca.if_else(known, 0.0, ca.inf), motion, off)


PLACE_SHARE = 3.0
"""An error of the place, over its distance, counts as an angle that many times it. [EB] eq. (54)."""


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
    before, after = graph.parts(c), graph.parts(d := ca.SX.sym("d", c.numel()))
    dynamics = dynamics_of(resolved, before, u)
    in_orbit = dynamics.field is not None
    a, s, b = ca.SX.sym("a", axes.a.numel()), ca.SX.sym("s", 4), ca.SX.sym("b", 3 + in_orbit)
    constants = restored(constants_of(dynamics), a[axes.slices["bound"]])
    body = body_of(dynamics)
    found = bound_after_step(constants, body, x, s[0], ca.vertcat(b[:2], b[3:]))
    sure = has_sure_remainder(resolved.scene.rotation, in_orbit=in_orbit)
    known = s if not sure else s[:2]
    end = found.bound + _step_error(plan, constants, body, found.motion, known)
    rate = INFLATION * constants.norm.rate_share * end[1]
    after_step = ca.vertcat(end, rate, *([_place_after(plan, found, known)] if in_orbit else []))
    energy, omega, turned = b[1], ca.SX.sym("omega", 3), ca.SX.sym("turned", 3)
    tensor, other = dynamics.inertia, from_upper_triangle(after["inertia"])
    excess = other @ turned - tensor @ omega + spin_of(after) - spin_of(before)
    return (
        ca.Function("bound_step", [x, u, c, a, s, b], [ca.cse(after_step)]),
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
    return TurnedBody(dynamics.inertia, dynamics.torque, spin, dynamics.field)


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
    remainder = _remainder(plan.method, s[1], in_orbit=motion.centre is not None)
    stepped = step_error(remainder, constants, body, motion, s[2:] if s.numel() > 2 else None)
    return ca.if_else(s[1] == 0.0, free, stepped) if plan.free == "while free" else stepped


def _place_after(plan: Plan, found: CarriedBound, s: ca.SX) -> ca.SX:
    """Returns the error of the centre's place after a sub-step, see `place_after`; s : see `_step_error`."""
    remainder = None if plan.method is None else _remainder(plan.method, s[1], in_orbit=True)
    added = place_error(remainder, found.motion, s[2:] if s.numel() > 2 else None)
    assert found.motion.centre is not None
    return place_after(found.motion.centre, found.place, added)


def _remainder(method: Propagator, power: ca.SX, *, in_orbit: bool) -> Remainder:
    """Returns the remainder of a method's steps, the power of a Taylor step's being an expression."""
    name = name_of(method)
    if name == "taylor":
        return remainder_of_taylor(power - 1.0, in_orbit=in_orbit)
    if name == "split":
        return UNKNOWN_IN_ORBIT if in_orbit else UNKNOWN
    return remainder_of(name, in_orbit=in_orbit)
