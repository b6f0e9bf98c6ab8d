"""The vector c of everything that follows from the inputs that shape the composite, p: its parts and layout.

c begins with the parts of COMPOSITE_SIZES; `composite_parts` says what follows them.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca

from supervessel.composite.actions import action_parts, jet_parts, vessel_parts
from supervessel.composite.bodies import composite_body, energy_of_motion, lookup_in
from supervessel.composite.docks import alone_as_given
from supervessel.composite.inertia import Body, ldl, ldl_inverse, upper_triangle
from supervessel.composite.poses import anchor, constant
from supervessel.composite.resolved import ResolvedScene, resolve
from supervessel.composite.shown.loads import load_parts
from supervessel.composite.shown.points import point_parts
from supervessel.composite.wheels import (
    WheelAxes,
    free_inertia,
    placed_wheels,
    wheel_parts,
    without_locked,
)
from supervessel.layout import slices_of, stacked
from supervessel.rotation.laws import LAWS, growth_excess
from supervessel.scene.numbers import EPSILON
from supervessel.scene.reuse import reused
from supervessel.scene.schema import Scene

COMPOSITE_SIZES = {"mass": 1, "barycentre": 3, "inertia": 6, "pmi": 3, "margins": 3}
"""Sizes of the parts with which every c begins.

mass       : [kg]
barycentre : [m], from the root vessel's origin, root axes
inertia    : J about the barycentre [kg m2], body axes: xx, yy, zz, xy, xz, yz
pmi        : diagonal of J over mass [m2]
margins    : pivots of J - A = L D L^T, A of wheels, see `composite.wheels`, each less PIVOT_SLACK [kg m2];
             all three are positive where J - A is positive definite as far as doubles can tell
"""

PIVOT_SLACK = 16.0 * EPSILON
"""Bound of what rounding leaves of a pivot that is exactly zero, over the element J_kk of its row.

Each element of a composite tensor is off by a few u of sqrt(J_ii J_jj), which bounds |J_ij|. So the second
pivot of L D L^T is off by a few u of J_22. The third pivot is off by a few u of J_33 J_22/d_2, d_2 the second
pivot: the elimination of the second row divides by d_2.
"""


@dataclass(frozen=True)
class CompositeGraph:
    """The composite of a scene in CasADi symbols.

    p      : the inputs that shape the composite, symbols, (n,)
    c      : all parts as an expression of p, (m,)
    slices : where each part stands in c
    """

    p: ca.SX
    c: ca.SX
    slices: Mapping[str, slice]

    def parts(self, symbols: ca.SX) -> dict[str, ca.SX]:
        """Returns the parts of c by name, in terms of `symbols` of c, (m,); constant elements are numbers."""
        elements = zip(ca.vertsplit(self.c), ca.vertsplit(symbols), strict=True)
        known = ca.vertcat(*(own if own.is_constant() else symbol for own, symbol in elements))
        return {name: known[place] for name, place in self.slices.items()}


def composite_slices() -> dict[str, slice]:
    """Returns the places in c of the parts of COMPOSITE_SIZES, with which every c begins, by name."""
    return slices_of(COMPOSITE_SIZES)


@reused
def composite_graph(resolved: ResolvedScene) -> CompositeGraph:
    """Returns the composite of a scene in symbols. The check of a scene and its equations share it."""
    p = ca.SX.sym("p", len(resolved.shaping))
    slices, c = stacked(composite_parts(resolved, p))
    return CompositeGraph(p, c, slices)


def composite_parts(resolved: ResolvedScene, p: ca.SX) -> dict[str, ca.SX]:
    """Returns the parts of c by name as expressions of p.

    The parts of COMPOSITE_SIZES come first. Then, each where the scene has it:

    centre        : (3,) [m], where a change hands something over: the barycentre from the root's anchor, root
                    axes, of which differences lose no digits where these axes begin far away
    law           : the numbers that the rotation law needs, of J - A, see `rotation.laws`
    momentum      : (4,), where ports move: angular momentum h, (3,) [N m s], body axes, of the parts that
                    move relative to body axes; and the square, [rad2/s2], of |h| trace((J - A)^-1), which
                    bounds |(J - A)^-1 (omega x h)|/|omega|
    velocity      : (3,) [m/s], where ports move and outputs need it: velocity of the barycentre relative to
                    the root vessel's axes, body axes
    lightness     : (1,) [1/(kg m2)], where there are wheels: trace((J - A)^-1)
    excess        : (1,), where moments may be those of no rigid body, see `growth_excess`: where there are
                    wheels, or the root has its own moments alone, see `docks.alone_as_given`
    moving        : (1,) [J], where the output total_kinetic_energy is asked for: kinetic energy of parts that
                    move relative to body axes, without what wheels would have of it if they were locked
    wheels, wheel_rates : see `composite.wheels.wheel_parts`
    moment, force : see `composite.actions.action_parts`
    jets          : see `composite.actions.jet_parts`
    .NAME         : of the vessel NAME, see `composite.actions.vessel_parts`, of a point, see
                    `composite.shown.points.point_parts`, or of a dock, see `composite.shown.loads.load_parts`
    """
    lookup = lookup_in(resolved.shaping, p)
    body, wheels = composite_body(resolved, lookup), placed_wheels(resolved, lookup)
    parts = body_parts(resolved.scene, without_locked(body, wheels), wheels) | wheel_parts(wheels)
    if "total_kinetic_energy" in resolved.scene.outputs.names:
        locked = ca.SX(0.0) if wheels is None else wheels.locked_energy
        parts["moving"] = energy_of_motion(resolved, lookup, body) - locked
    if body.velocity is not None and resolved.shows_velocity:
        parts["velocity"] = body.velocity
    parts |= action_parts(resolved, lookup, body.centre) | jet_parts(resolved, lookup, body.centre)
    parts |= vessel_parts(resolved, lookup, body)
    parts |= point_parts(resolved, lookup, body) | load_parts(resolved, lookup, body.centre, wheels)
    return {name: ca.densify(part) for name, part in parts.items()}


def body_parts(scene: Scene, body: Body, wheels: WheelAxes | None = None) -> dict[str, ca.SX]:
    """Returns the parts of c that follow from the composite as one body.

    body   : the composite in the root vessel's axes, their origin at its anchor
    wheels : of its vessels
    """
    J, law = body.inertia, scene.rotation.law
    may_be_point = law == "none"  # the one law that takes a mass point, whose moments are zero
    turning = free_inertia(J, wheels)
    lower, pivots = ldl(turning, singular=may_be_point)
    parts = {
        "mass": body.mass,
        "barycentre": body.centre + constant(anchor(scene, scene.root)),
        "inertia": upper_triangle(J),
        "pmi": ca.diag(J) / body.mass,
        "margins": _margins(turning, pivots, may_be_point),
        "law": LAWS[law].prepare(turning),
    }
    if resolve(scene).hands_over:
        parts["centre"] = body.centre
    if body.spin is not None or wheels is not None:
        bound = ca.SX(0.0) if may_be_point else ca.trace(ldl_inverse(lower, pivots))
    if wheels is not None:
        parts["lightness"] = bound
    if wheels is not None or alone_as_given(scene):
        parts["excess"] = growth_excess(LAWS[law], turning)
    if body.spin is not None:
        parts["momentum"] = ca.vertcat(body.spin, ca.sumsqr(body.spin) * bound * bound)
    return {name: ca.densify(part) for name, part in parts.items()}


def _margins(inertia: ca.SX, pivots: ca.SX, may_be_point: bool) -> ca.SX:
    """Returns the pivots of a tensor less what rounding leaves of a pivot that is zero, (3,) [kg m2]."""
    J = inertia
    divisor = ca.if_else(pivots[1] == 0.0, 1.0, pivots[1]) if may_be_point else pivots[1]
    return ca.vertcat(
        pivots[0],
        pivots[1] - PIVOT_SLACK * J[1, 1],
        pivots[2] - PIVOT_SLACK * (J[2, 2] * (J[1, 1] / divisor)),
    )
