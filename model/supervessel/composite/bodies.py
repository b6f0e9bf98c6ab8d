"""Docking in CasADi symbols: the vessels of a scene, placed in root axes and put together.

Root axes are the axes of the root vessel. A rigid group is a set of vessels that never move relative to each
other; its axes are those of one of its vessels, see `resolved.RigidGroup`.
Source of poses and sums: [EQ] The assembly, eqs. (4) to (6); of motions: [EQ] When masses or poses
change, eq. (11).
"""

from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass
from functools import cache

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from supervessel.composite.constants import Places
from supervessel.composite.docks import Joint, Way, alone_as_given, docks_of_root
from supervessel.composite.inertia import Body, combine, orbiter_moments, placed_body, symmetric
from supervessel.composite.poses import Pose, constant, from_anchor, mated_pose, port_axes, scaled
from supervessel.composite.resolved import ResolvedScene, RigidGroup
from supervessel.scene.inputs import vessel_of
from supervessel.scene.schema import Scene
from supervessel.scene.variables import InputVariable

Lookup = Callable[[str, ArrayLike], ca.SX]
"""Name of an input without index, the scene's value -> its symbols, or that value where it is no input."""


def lookup_in(inputs: Sequence[InputVariable], values: ca.SX) -> Lookup:
    """Returns the function that gives an input's symbols by its name without index.

    inputs : the inputs that have symbols; for any other name the function returns the scene's value
    values : symbols of the inputs, in their order, (n,)
    """
    first: dict[str, int] = {}
    for place, variable in enumerate(inputs):
        first.setdefault(variable.group, place)

    def lookup(group: str, value: ArrayLike) -> ca.SX:
        if group not in first:
            return constant(value)
        place = first[group]
        return values[place : place + (inputs[place].kind.elements or 1)]

    return lookup


@dataclass(frozen=True)
class PlacedGroup:
    """A rigid group of vessels, placed in root axes.

    pose     : of the group's axes in root axes
    attached : 1 while docks hold the group to the root, else 0; None where they always do
    inside   : by vessel, its pose in the group's axes, a constant
    """

    pose: Pose
    attached: ca.SX | None
    inside: Places

    def pose_of(self, vessel: str) -> Pose:
        """Returns the pose of one of its vessels, whose origin is its anchor, from the root's anchor."""
        return self.pose.then(self.inside[vessel])


def composite_body(resolved: ResolvedScene, lookup: Lookup) -> Body:
    """Returns what hangs on the root as one body in the root vessel's axes, their origin at its anchor.

    Vessels between which there is no pose input and no dock input form a rigid group. Its vessels of constant
    mass are combined in the axes of the group's first vessel, so that they are numbers before the group is
    placed by the pose that moves it; its other vessels are placed one by one.
    """
    bodies = []
    for number, (group, placed) in enumerate(
        zip(resolved.groups, placed_groups(resolved, lookup), strict=True)
    ):
        lumped = group_bodies(resolved, number, group, placed, lookup)
        if placed.attached is not None:
            lumped = [body.times(placed.attached) for body in lumped]
        bodies += lumped
    return by_convention(resolved.scene, combine(bodies))


def group_bodies(
    resolved: ResolvedScene, number: int, group: RigidGroup, placed: PlacedGroup, lookup: Lookup
) -> list[Body]:
    """Returns a rigid group, or some of its vessels, as bodies in root axes, as if docks held it there.

    number : of the group; the root's own, 0, has root axes
    """
    lumped = _lumped(resolved.scene, group, lookup)
    if number == 0:
        return lumped
    pose = placed.pose
    return [b.seen_from(pose.rotation, pose.origin, pose.velocity, pose.rate) for b in lumped]


def energy_of_motion(resolved: ResolvedScene, lookup: Lookup, whole: Body) -> ca.SX:
    """Returns the kinetic energy of parts that move relative to the root's axes, [J]; 0 where none does.

    whole : the composite as one body
    Sum of m_j |v_j - v|^2/2 + w_j . J_j w_j/2 in the root's axes, v_j the velocity of the centre of mass of
    body j and w_j its rate, v the barycentre's velocity. Wheels count as locked.
    """
    energy = ca.SX(0.0)
    if whole.velocity is None:
        return energy
    placed_all = placed_groups(resolved, lookup)
    for number, (group, placed) in enumerate(zip(resolved.groups, placed_all, strict=True)):
        for body in group_bodies(resolved, number, group, placed, lookup):
            drift = -whole.velocity if body.velocity is None else body.velocity - whole.velocity
            own = body.mass * ca.sumsqr(drift)
            if body.spin is not None and placed.pose.rate is not None:
                own += ca.dot(placed.pose.rate, body.spin)
            energy += 0.5 * (own if placed.attached is None else placed.attached * own)
    return energy


def by_convention(scene: Scene, whole: Body) -> Body:
    """Returns the composite under the scene's convention: Orbiter's leaves the products of inertia out."""
    if scene.convention == "orbiter":
        diagonal = symmetric(lambda i, j: whole.inertia[i, i] if i == j else ca.SX(0.0))
        return Body(whole.mass, whole.centre, diagonal, whole.velocity, whole.spin)
    return whole


def placed_groups(resolved: ResolvedScene, lookup: Lookup) -> list[PlacedGroup]:
    """Returns the rigid groups of a scene, the root's own first."""
    pose_by = _placing(resolved, lookup)
    placed = []
    for group in resolved.groups:
        poses = [pose_by(way) for way in group.ways]
        attached = [_all_true(way, lookup) for way in group.ways]
        holding = [i for i, flag in enumerate(attached) if flag is None]
        if len(group.ways) == 1 or holding:  # no other way can hold beside one that always does
            always = holding[0] if holding else 0
            placed.append(PlacedGroup(poses[always], attached[always], group.inside))
        else:
            flags = [flag for flag in attached if flag is not None]
            holds, pose = _chosen(flags, poses)
            placed.append(PlacedGroup(pose, holds, group.inside))
    return placed


Placed = Mapping[str, tuple[Pose, ca.SX | None]]
"""Poses of vessels, whose origins are their anchors, in the root's axes; and 1 while a vessel hangs on the
root, else 0 (None: always)."""


def placed_vessels(resolved: ResolvedScene, lookup: Lookup, names: Set[str]) -> Placed:
    """Returns some vessels by name, as inputs place them."""
    return {
        name: (group.pose_of(name), group.attached)
        for group in placed_groups(resolved, lookup)
        for name in group.inside
        if name in names
    }


def way_holds(way: Way, resolved: ResolvedScene, lookup: Lookup) -> ca.SX | None:
    """Returns 1 where a way holds its group, else 0; None where it always does.

    Beside a way that always holds no other can: it is then never said to.
    """
    flag, others = _all_true(way, lookup), resolved.groups[way.group].ways
    if flag is not None and any(_all_true(other, lookup) is None for other in others):
        return ca.SX(0.0)
    return flag


def port_place(scene: Scene, name: str, where: Placed, lookup: Lookup) -> ca.SX:
    """Returns where the port called "vessel.port" is, (3,) [m], root axes, from the root's anchor."""
    pose, _ = where[vessel_of(name)]
    position, _ = _port(scene, name, lookup)
    return pose.origin + pose.rotation @ position


def _placing(resolved: ResolvedScene, lookup: Lookup) -> Callable[[Way], Pose]:
    """Returns the function from a way to the pose, in root axes, of the group at its end.

    A pose is the product of the poses along the way: of the parent's group, of the parent vessel in it, of
    the child vessel in the parent's axes, and of the child's group in the child's axes.
    """
    scene, home = resolved.scene, resolved.home

    @cache
    def pose_by(way: Way) -> Pose:
        if way.joint is None or way.before is None:
            return resolved.groups[0].inside[scene.root]
        joint, group = way.joint, resolved.groups[way.group]
        step = home[joint.parent].inside[joint.parent].then(_joint_pose(scene, joint, lookup))
        own = group.inside[joint.child]
        is_reference = group.reference == joint.child
        return pose_by(way.before).then(step if is_reference else step.then(own.inverse()))

    return pose_by


def _all_true(way: Way, lookup: Lookup) -> ca.SX | None:
    """Returns 1 where every dock on a way is closed, else 0; None if no input opens a dock on it."""
    product = None
    for dock in way.docks:
        flag = lookup(f"{dock}.docked", 1.0)
        product = flag if product is None else product * flag
    return product


def _chosen(flags: Sequence[ca.SX], poses: Sequence[Pose]) -> tuple[ca.SX, Pose]:
    """Returns 1 and the pose by the way that holds; 0 and a pose of zeros where none holds.

    flags : of each way, 1 if it holds, else 0; at most one holds, as docks make no loop
    poses : of the group by each way, root axes
    """

    def pick(values: Sequence[ca.SX]) -> ca.SX:
        return sum(
            (flag * value for flag, value in zip(flags[1:], values[1:], strict=True)), flags[0] * values[0]
        )

    rotation, origin = pick([p.rotation for p in poses]), pick([p.origin for p in poses])
    attached = sum(flags[1:], flags[0])
    if all(pose.rate is None for pose in poses):
        return attached, Pose(rotation, origin)
    still = ca.SX.zeros(3)
    velocities = [still if pose.velocity is None else pose.velocity for pose in poses]
    rates = [still if pose.rate is None else pose.rate for pose in poses]
    return attached, Pose(rotation, origin, pick(velocities), pick(rates))


def _lumped(scene: Scene, group: RigidGroup, lookup: Lookup) -> list[Body]:
    """Returns a group's bodies in its axes: the constant vessels as one, then each vessel that varies."""
    bodies = [vessel_body(scene, name, lookup, group.inside[name]) for name in group.varying]
    if group.fixed is None:
        return bodies
    mass, centre, inertia = group.fixed
    return [Body(constant(mass), constant(centre), constant(inertia)), *bodies]


def _joint_pose(scene: Scene, joint: Joint, lookup: Lookup) -> Pose:
    """Returns the pose of the child vessel in the parent's axes, with its motion where a port moves.

    With R = R_parent_child, p_P, v_P, w_P position, velocity and rate of the parent's port in the parent's
    axes, and p_C, v_C, w_C of the child's port in the child's axes, o = p_P - R p_C differentiated gives the
    child's rate w = w_P - R w_C and the velocity v_P - R v_C - w x R p_C of its origin. The motion at contact
    of a dock is added to that of the parent's port.
    """
    parent, child = (_port(scene, name, lookup) for name in joint.ports)
    pose = mated_pose(parent, child)
    motions = [_port_motion(scene, name, lookup) for name in joint.ports]
    if joint.dock is not None:
        motions.append(_contact_motion(scene, joint, lookup, pose))
    known = [motion for motion in motions if motion is not None]
    if not known:
        return pose
    velocity, rate = ca.SX.zeros(3), ca.SX.zeros(3)
    if motions[0] is not None:
        velocity, rate = motions[0]
    arm = pose.rotation @ child[0]
    if motions[1] is not None:
        rate = rate - pose.rotation @ motions[1][1]
        velocity = velocity - pose.rotation @ motions[1][0]
    if len(motions) > 2 and motions[2] is not None:
        velocity, rate = velocity + motions[2][0], rate + motions[2][1]
    return Pose(pose.rotation, pose.origin, velocity - ca.cross(rate, arm), rate)


def _port_motion(scene: Scene, name: str, lookup: Lookup) -> tuple[ca.SX, ca.SX] | None:
    """Returns velocity, (3,) [m/s], and rate, (3,) [rad/s], of a port, its vessel's axes; None: at rest."""
    if name not in scene.inputs.motion:
        return None
    velocity, rate = (lookup(f"{name}.{key}", np.zeros(3)) for key in ("velocity", "rate"))
    if velocity.is_zero() and rate.is_zero():
        return None
    return velocity, rate


def _contact_motion(scene: Scene, joint: Joint, lookup: Lookup, pose: Pose) -> tuple[ca.SX, ca.SX] | None:
    """Returns the motion of the child's port at contact, (3,) [m/s] and (3,) [rad/s], parent's axes; or None.

    joint : a dock that an input closes, its `dock`
    pose  : of the child in the parent's axes
    The inputs are velocity and rate of the dock's second port relative to the first, in the axes of the first
    port's vessel. Where the parent has the second port, both are reversed and turned into its axes.
    """
    velocity, rate = (lookup(f"{joint.dock}.{key}", np.zeros(3)) for key in ("velocity", "rate"))
    if velocity.is_zero() and rate.is_zero():
        return None
    if joint.ports[0] == scene.dock(joint.dock or "").ports[0]:
        return velocity, rate
    return -(pose.rotation @ velocity), -(pose.rotation @ rate)


def _port(scene: Scene, name: str, lookup: Lookup) -> tuple[ca.SX, ca.SX]:
    """Returns position, from its vessel's anchor, vessel axes, and R_vessel_port of a port."""
    port = scene.port(name)
    position = lookup(f"{name}.position", from_anchor(scene, vessel_of(name), port.position))
    direction, alignment = (
        lookup(f"{name}.{key}", scaled(getattr(port, key))) for key in ("direction", "alignment")
    )
    return position, port_axes(direction, alignment)


def _moments(scene: Scene, name: str, lookup: Lookup, pmi: ca.SX) -> ca.SX:
    """Returns a vessel's moments over mass, (3,) [m2], by the scene's convention; pmi : as they are given.

    Orbiter takes six points where vessels are docked, and the moments of a vessel that is alone as they are.
    Source: [EQ] Orbiter.
    """
    if scene.convention != "orbiter":
        return pmi
    if name != scene.root or not alone_as_given(scene):
        return orbiter_moments(pmi)
    closed = [lookup(f"{dock.name}.docked", 1.0) for dock in docks_of_root(scene)]
    if not closed:
        return pmi
    return ca.if_else(sum(closed[1:], closed[0]) > 0.5, orbiter_moments(pmi), pmi)


def vessel_body(scene: Scene, name: str, lookup: Lookup, pose: Pose, mass: ca.SX | None = None) -> Body:
    """Returns a vessel as a body in the axes of its group; mass : [kg], instead of its own."""
    vessel = scene.vessels[name]
    mass = lookup(f"{name}.mass", vessel.mass) if mass is None else mass
    if vessel.pmi is not None:
        pmi = lookup(f"{name}.pmi", vessel.pmi)
        specific_inertia = ca.diag(_moments(scene, name, lookup, pmi))
    else:
        specific_inertia = constant(vessel.specific_inertia)
    centre = constant(from_anchor(scene, name, vessel.centre_of_mass))
    return placed_body(mass, specific_inertia, centre, pose.rotation, pose.origin)
