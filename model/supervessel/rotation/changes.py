"""What happens to the angular velocity when masses, poses and docks change, in CasADi symbols.

A change goes from the inputs as they were to those as they are, at one instant, in this order: what undocks
leaves with its share, so that the rest keeps its rate; masses and moments change, then poses and the motion
of ports, each keeping rate or momentum as the scene says; what docks brings its momentum along.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import reduce

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from supervessel.composite.bodies import composite_body, lookup_in
from supervessel.composite.inertia import from_upper_triangle, ldl, ldl_solve
from supervessel.composite.poses import constant
from supervessel.composite.resolved import ResolvedScene
from supervessel.rotation.laws import LAWS

Parts = Mapping[str, ca.SX]
"""Parts of c by name."""


@dataclass(frozen=True)
class Change:
    """Functions of what changes, in CasADi symbols; c and d are composites.

    momentum_of      : omega, c -> angular momentum J omega + h, (3,) [N m s], body axes, J the law's tensor
    rate_of_momentum : momentum, c -> omega
    keep_momentum    : omega, c, d -> omega after a change from c to d that keeps the momentum
    contact_momentum : p, k -> momentum, (3,) [N m s], that docks which close bring with motion k at contact
    docked_rate      : omega, momentum, d -> omega when that momentum has been added, by the full tensor
    """

    momentum_of: ca.Function
    rate_of_momentum: ca.Function
    keep_momentum: ca.Function
    contact_momentum: ca.Function
    docked_rate: ca.Function


def change_functions(
    resolved: ResolvedScene, c: ca.SX, parts_of: Callable[[ca.SX], Parts], p: ca.SX, k: ca.SX
) -> Change:
    """Returns the functions of what changes.

    c        : symbols of a composite
    parts_of : composite -> its parts
    p, k     : symbols of the inputs that shape the composite, of the motion at contact
    """
    law = LAWS[resolved.scene.rotation.law]
    omega, added, d = ca.SX.sym("omega", 3), ca.SX.sym("added", 3), ca.SX.sym("d", c.numel())
    before, after = parts_of(c), parts_of(d)
    kept, kept_after = (law.keeping(from_upper_triangle(parts["inertia"])) for parts in (before, after))
    spin, spin_after = (_spin(parts) for parts in (before, after))
    change = (kept_after - kept) @ omega + (spin_after - spin)
    full = from_upper_triangle(after["inertia"])
    return Change(
        momentum_of=_function("momentum_of", {"omega": omega, "c": c}, kept @ omega + spin),
        rate_of_momentum=_function(
            "rate_of_momentum", {"momentum": added, "c": c}, ldl_solve(*ldl(kept), added - spin)
        ),
        keep_momentum=_function(
            "keep_momentum", {"omega": omega, "c": c, "d": d}, omega - ldl_solve(*ldl(kept_after), change)
        ),
        contact_momentum=_function("contact_momentum", {"p": p, "k": k}, _contact_momentum(resolved, p, k)),
        docked_rate=_function(
            "docked_rate",
            {"omega": omega, "momentum": added, "d": d},
            omega + ldl_solve(*ldl(full), added),
        ),
    )


def followed(
    resolved: ResolvedScene, change: Change, composite: ca.Function, margins: slice, inputs: tuple[ca.SX, ...]
) -> ca.SX:
    """Returns the angular velocity, (3,) [rad/s], after a change of inputs, in the order of this module.

    composite : p -> c
    margins   : part of c, positive where its tensor is positive definite
    inputs    : angular velocity before, p before, p after, motions at contact k
    On the way a stage may have no mass or no moment of inertia, but then nothing may change from or to it
    that keeps the momentum, else NaN (the FMU refuses it).
    """
    omega, before, after, k = inputs
    kinds = [variable.kind.change for variable in resolved.shaping]

    def taken(stage: ca.SX, kind: str) -> ca.SX:
        """Returns a stage with the inputs of a kind as they are after the change."""
        return ca.vertcat(*(after[i] if kinds[i] == kind else stage[i] for i in range(len(kinds))))

    def kept_over(omega: ca.SX, stage: ca.SX, following: ca.SX) -> ca.SX:
        """Returns the angular velocity after a change that keeps the momentum."""
        pivots = ca.vertcat(*(composite(at)[margins] for at in (stage, following)))
        usable = reduce(ca.logic_and, ca.vertsplit(pivots > 0.0))
        moved = reduce(ca.logic_or, ca.vertsplit(stage != following))
        # composites are of something usable always: what is NaN here would be NaN in derivatives
        c, d = (composite(ca.if_else(usable, at, after)) for at in (stage, following))
        refused = ca.logic_and(ca.logic_not(usable), moved)
        return change.keep_momentum(omega, c, d) + ca.if_else(refused, ca.SX.nan(), 0.0)

    flags = [i for i, kind in enumerate(kinds) if kind == "docked"]
    stage = ca.vertcat(*(before[i] * after[i] if i in flags else before[i] for i in range(len(kinds))))
    for kind, kept in resolved.scene.keeps.items():
        following = taken(stage, kind)
        if kept == "momentum":
            omega = kept_over(omega, stage, following)
        stage = following
    if flags:
        closing = [after[i] * (1.0 - stage[i]) for i in flags for _ in range(6)]
        momentum = change.contact_momentum(after, ca.vertcat(*closing) * k)
        omega = change.docked_rate(omega, momentum, composite(after))
    return omega


def _spin(parts: Parts) -> ca.SX:
    return parts["momentum"][:3] if "momentum" in parts else ca.SX.zeros(3)


def _function(name: str, arguments: Mapping[str, ca.SX], result: ca.SX) -> ca.Function:
    return ca.Function(name, list(arguments.values()), [ca.densify(result)], list(arguments), ["result"])


def _contact_momentum(resolved: ResolvedScene, p: ca.SX, k: ca.SX) -> ca.SX:
    """Returns the angular momentum about the barycentre, (3,), of parts that move with k as they touch."""
    if not resolved.contact:
        return ca.SX.zeros(3)
    still = {variable.group for variable in resolved.shaping if variable.kind.key == "motion"}
    lookup = lookup_in((*resolved.shaping, *resolved.contact), ca.vertcat(p, k))

    def at_contact(group: str, value: ArrayLike) -> ca.SX:
        return constant(np.zeros(3)) if group in still else lookup(group, value)

    spin = composite_body(resolved, at_contact).spin
    return ca.SX.zeros(3) if spin is None else spin
