"""What happens to the angular velocity when masses, poses and docks change, in CasADi symbols.

A change happens at one instant and takes the inputs p from their values before to those after, in stages:

1. docks open: what undocks takes its share of the momentum along, and the root's part keeps its rate omega;
2. masses and moments change, keeping omega or the momentum H = J omega + S, as the scene says;
3. poses and the motion of ports change, likewise;
4. docks close: what docks brings along its angular momentum about the common barycentre.

All vectors and tensors are about the barycentre in body axes. S = h + sum of h_w b_w is the momentum of
moving parts and wheels [N m s], J the tensor without what wheels have about their axes, J - A, [kg m2]: [EQ]
When masses or poses change, eq. (11), and Wheels, eq. (18), the sources of the equations here. In stages 2
and 3 J is the tensor of the law, `RotationLaw.keeping`; in stage 4 it is the full tensor under every law. No
change changes the momentum h_w of a wheel.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import reduce

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from supervessel.composite.bodies import Lookup, composite_body, lookup_in
from supervessel.composite.inertia import from_upper_triangle, ldl, ldl_solve
from supervessel.composite.poses import constant
from supervessel.composite.resolved import ResolvedScene
from supervessel.composite.wheels import axes_of, free_inertia, placed_wheels, without_locked
from supervessel.derivatives import named_function
from supervessel.rotation.laws import LAWS

Parts = Mapping[str, ca.SX]
"""Parts of c by name."""


@dataclass(frozen=True)
class Change:
    """The functions that a change of inputs is made of; omega is (3,) [rad/s], c and d are composites, (n,).

    Arguments omega and H, (3 + m,), have the momenta of the scene's m wheels [N m s] behind them; results are
    (3,).

    momentum_of      : omega, c -> H = J omega + S, (3,) [N m s]
    rate_of_momentum : H, c -> omega = J^-1 (H - S)
    keep_momentum    : omega, c, d -> omega - J_d^-1 ((J_d - J_c) omega + S_d - S_c), after a change from c to
                       d that keeps H; to the last bit omega where c and d are the same
    contact_momentum : p, k -> dH, (3,) [N m s], that closing docks bring, whose parts move by k at contact
    docked_rate      : omega, dH, d -> omega + J_d^-1 dH, J_d the full tensor; omega under the law "none"

    The tensors that are inverted must be positive definite; it is not checked here.
    """

    momentum_of: ca.Function
    rate_of_momentum: ca.Function
    keep_momentum: ca.Function
    contact_momentum: ca.Function
    docked_rate: ca.Function


def change_functions(
    resolved: ResolvedScene, c: ca.SX, parts_of: Callable[[ca.SX], Parts], p: ca.SX, k: ca.SX
) -> Change:
    """Returns the functions that a change of inputs is made of.

    c        : symbols of a composite, (n,)
    parts_of : composite, (n,) -> its parts by name, see `composite.parts`
    p        : symbols of the inputs that shape the composite, (m,)
    k        : symbols of the motion at contact, (6 d,): of each of d docks velocity [m/s] and rate [rad/s] of
               its second port relative to the first, in the axes of the first one's vessel
    """
    law = LAWS[resolved.scene.rotation.law]
    size = 3 + len(resolved.scene.wheels)
    rates, momenta, d = ca.SX.sym("omega", size), ca.SX.sym("added", size), ca.SX.sym("d", c.numel())
    omega, stored, momentum, added = rates[:3], rates[3:], momenta[:3], ca.SX.sym("added", 3)
    before, after = parts_of(c), parts_of(d)
    wheels, wheels_after = (axes_of(resolved, parts) for parts in (before, after))
    turning = free_inertia(from_upper_triangle(before["inertia"]), wheels)
    full = free_inertia(from_upper_triangle(after["inertia"]), wheels_after)
    kept, kept_after = law.keeping(turning), law.keeping(full)
    spin, spin_after = (spin_of(parts) for parts in (before, after))
    change = (kept_after - kept) @ omega + (spin_after - spin)
    held, held_of_momentum = spin, spin
    if wheels is not None and wheels_after is not None:
        change += (wheels_after.axes - wheels.axes) @ stored
        held, held_of_momentum = held + wheels.axes @ stored, held + wheels.axes @ momenta[3:]
    return Change(
        momentum_of=named_function("momentum_of", {"omega": rates, "c": c}, kept @ omega + held),
        rate_of_momentum=named_function(
            "rate_of_momentum",
            {"momentum": momenta, "c": c},
            ldl_solve(*ldl(kept), momentum - held_of_momentum),
        ),
        keep_momentum=named_function(
            "keep_momentum", {"omega": rates, "c": c, "d": d}, omega - ldl_solve(*ldl(kept_after), change)
        ),
        contact_momentum=named_function(
            "contact_momentum", {"p": p, "k": k}, contact_momentum(resolved, p, k)
        ),
        docked_rate=named_function(
            "docked_rate",
            {"omega": rates, "momentum": added, "d": d},
            omega if law is LAWS["none"] else omega + ldl_solve(*ldl(full), added),
        ),
    )


@dataclass(frozen=True)
class ChangeStage:
    """Part of a change of inputs p, at one instant: the inputs of one kind change.

    kept          : "rate" or "momentum"
    before, after : p, (n,)
    """

    kept: str
    before: ca.SX
    after: ca.SX


def stages(
    resolved: ResolvedScene, keeps: Mapping[str, str], before: ca.SX, after: ca.SX
) -> tuple[list[ChangeStage], ca.SX]:
    """Returns the stages between the docks that open and those that close; and which docks close, (n,).

    keeps         : what changes keep by their kind, see `Scene.keeps`
    before, after : p, (n,)
    """
    kinds = [variable.kind.change for variable in resolved.shaping]

    def taken(stage: ca.SX, kind: str) -> ca.SX:
        """Returns a stage with the inputs of a kind as they are after the change."""
        return ca.vertcat(*(after[i] if kinds[i] == kind else stage[i] for i in range(len(kinds))))

    docks = [kind == "docked" for kind in kinds]
    stage = ca.vertcat(*(before[i] * after[i] if dock else before[i] for i, dock in enumerate(docks)))
    found = []
    for kind, kept in keeps.items():
        following = taken(stage, kind)
        found.append(ChangeStage(kept, stage, following))
        stage = following
    closing = (after[i] * (1.0 - stage[i]) for i, dock in enumerate(docks) if dock)
    return found, ca.vertcat(ca.SX(0, 1), *closing)


def stage_composites(
    stage: ChangeStage, composite: ca.Function, margins: slice, instead: ca.SX
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Returns the composites before and after a stage, and 0, or NaN where momentum cannot be kept over it.

    composite, margins : see `followed`
    instead            : p of a usable composite, which stands for both where one of them is not
    """
    pivots = ca.vertcat(*(composite(at)[margins] for at in (stage.before, stage.after)))
    usable = reduce(ca.logic_and, ca.vertsplit(pivots > 0.0))
    moved = reduce(ca.logic_or, ca.vertsplit(stage.before != stage.after))
    # composites are of something usable always: what is NaN here would be NaN in derivatives
    c, d = (composite(ca.if_else(usable, at, instead)) for at in (stage.before, stage.after))
    refused = ca.logic_and(ca.logic_not(usable), moved)
    return c, d, ca.if_else(refused, ca.SX.nan(), 0.0)


def followed(
    resolved: ResolvedScene, change: Change, composite: ca.Function, margins: slice, inputs: tuple[ca.SX, ...]
) -> ca.SX:
    """Returns the angular velocity, (3,) [rad/s], body axes, after the stages of a change.

    composite : p -> c
    margins   : place in c of the three numbers that are positive where the tensor is positive definite
    inputs    : omega before, (3,) [rad/s], body axes, and momenta of wheels [N m s]; p before and p after,
                (m,); k, (6 d,)
    Between two stages the composite may have no mass or a singular tensor. NaN is returned where a stage that
    keeps the momentum changes an input from or to such a composite; the FMU refuses that change.
    """
    rates, before, after, k = inputs
    omega, stored = rates[:3], rates[3:]
    found, closing = stages(resolved, resolved.scene.keeps, before, after)
    for stage in found:
        if stage.kept == "momentum":
            c, d, refused = stage_composites(stage, composite, margins, after)
            omega = change.keep_momentum(ca.vertcat(omega, stored), c, d) + refused
    if closing.numel():
        momentum = change.contact_momentum(after, each_motion(closing) * k)
        omega = change.docked_rate(ca.vertcat(omega, stored), momentum, composite(after))
    return omega


def each_motion(closing: ca.SX) -> ca.SX:
    """Returns for each element of k, (6 n,), whether its dock closes, of which docks do, (n,)."""
    return ca.vertcat(*(flag for flag in ca.vertsplit(closing) for _ in range(6)))


def spin_of(parts: Parts) -> ca.SX:
    """Returns h, (3,) [N m s]: zero where no port moves."""
    return parts["momentum"][:3] if "momentum" in parts else ca.SX.zeros(3)


def contact_momentum(resolved: ResolvedScene, p: ca.SX, k: ca.SX) -> ca.SX:
    """Returns the angular momentum about the barycentre, (3,), of parts that move with k as they touch."""
    if not resolved.contact:
        return ca.SX.zeros(3)
    lookup = lookup_at_contact(resolved, p, k)
    body = without_locked(composite_body(resolved, lookup), placed_wheels(resolved, lookup))
    return ca.SX.zeros(3) if body.spin is None else body.spin


def lookup_at_contact(resolved: ResolvedScene, p: ca.SX, k: ca.SX) -> Lookup:
    """Returns the inputs as docks close whose parts move by k, while ports that move stand still."""
    still = {variable.group for variable in resolved.shaping if variable.kind.key == "motion"}
    lookup = lookup_in((*resolved.shaping, *resolved.contact), ca.vertcat(p, k))

    def at_contact(group: str, value: ArrayLike) -> ca.SX:
        return constant(np.zeros(3)) if group in still else lookup(group, value)

    return at_contact
