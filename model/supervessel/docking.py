"""Docking geometry in CasADi symbols: port frames, mating, and the bodies of a scene in the root's axes."""

from collections.abc import Callable
from dataclasses import dataclass
from math import frexp, ldexp

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from supervessel.assembly import Joint, joints
from supervessel.inertia import Body, combine, congruence
from supervessel.quantities import Vector
from supervessel.scene import Scene

Lookup = Callable[[str, ArrayLike], ca.SX]
"""Takes an input's name without index and the scene's value; returns its symbols, or the constant."""


@dataclass(frozen=True)
class Pose:
    """Where a frame stands: rotation (3, 3) out of it and its origin (3,) [m], both in outer axes."""

    rotation: ca.SX
    origin: ca.SX

    def then(self, inner: "Pose") -> "Pose":
        """Returns the pose, in these outer axes, of a frame whose pose is known in this one."""
        return Pose(self.rotation @ inner.rotation, self.origin + self.rotation @ inner.origin)


def port_axes(direction: ca.SX, alignment: ca.SX) -> ca.SX:
    """Returns the orthonormal columns (d, a, d x a), (3, 3), of a port, vessel axes.

    direction : (3,), kept but for its length
    alignment : (3,), projected onto the plane across direction
    Both of any length > 0 whose square neither under- nor overflows, not parallel. The projection is
    (d x alignment) x d, which is perpendicular to d to rounding even where the two are nearly parallel.
    """
    d = direction / ca.sqrt(ca.sumsqr(direction))
    across = ca.cross(ca.cross(d, alignment), d)
    a = across / ca.sqrt(ca.sumsqr(across))
    return ca.horzcat(d, a, ca.cross(d, a))


def mated_pose(parent: tuple[ca.SX, ca.SX], child: tuple[ca.SX, ca.SX]) -> Pose:
    """Returns the pose of the child vessel in the parent's axes.

    parent, child : position (3,) [m] and axes (3, 3) of the mated ports, each in its own vessel's axes
    Source: [CV] eqs. (8), (9): R d_child = -d_parent, R a_child = a_parent, ports at one point.
    """
    (position_parent, axes_parent), (position_child, axes_child) = parent, child
    facing = ca.horzcat(-axes_parent[:, 0], axes_parent[:, 1], -axes_parent[:, 2])
    rotation = facing @ axes_child.T
    return Pose(rotation, position_parent - rotation @ position_child)


def composite_body(scene: Scene, lookup: Lookup) -> Body:
    """Returns the whole assembly as one body in the root vessel's axes.

    Vessels that no pose input separates form a rigid group. Those of constant mass are combined in the axes
    of the group's first vessel, so that they have become numbers before the group is placed by the pose that
    moves it; the others are placed one by one.
    """
    groups = {scene.root: scene.root}
    inside = {scene.root: Pose(constant(np.eye(3)), constant(np.zeros(3)))}
    placed = {scene.root: inside[scene.root]}
    moving = set(scene.inputs.pose)
    for joint in joints(scene):
        pose = inside[joint.parent].then(_joint_pose(scene, joint, lookup))
        if moving.intersection(joint.ports):
            groups[joint.child] = joint.child
            placed[joint.child] = placed[groups[joint.parent]].then(pose)
            inside[joint.child] = inside[scene.root]
        else:
            groups[joint.child] = groups[joint.parent]
            inside[joint.child] = pose
    members: dict[str, list[Body]] = {group: [] for group in placed}
    for vessel, pose in inside.items():
        members[groups[vessel]].append(_vessel_body(scene, vessel, lookup, pose))
    bodies = []
    for group, pose in placed.items():
        lumped = _lump(members[group])
        bodies += lumped if group == scene.root else [b.seen_from(pose.rotation, pose.origin) for b in lumped]
    return combine(bodies)


def _lump(bodies: list[Body]) -> list[Body]:
    """Returns bodies with those of constant mass combined, first of all; those without mass are left out."""
    constants = [body for body in bodies if body.mass.is_constant() and not body.mass.is_zero()]
    constants.sort(key=lambda body: -float(body.mass))
    fixed = [body for body in constants if body.inertia.is_constant()]
    others = [body for body in bodies if not body.mass.is_constant()]
    return (
        ([combine(fixed)] if fixed else []) + [b for b in constants if not b.inertia.is_constant()] + others
    )


def constant(value: ArrayLike) -> ca.SX:
    return ca.densify(ca.SX(ca.DM(np.asarray(value, dtype=float))))


def _joint_pose(scene: Scene, joint: Joint, lookup: Lookup) -> Pose:
    """Returns the child's pose in the parent's axes."""
    parent, child = (_port(scene, name, lookup) for name in joint.ports)
    return mated_pose(parent, child)


def _port(scene: Scene, name: str, lookup: Lookup) -> tuple[ca.SX, ca.SX]:
    """Returns position and axes of a port in its vessel's axes."""
    port = scene.port(name)
    position = lookup(f"{name}.position", port.position)
    direction, alignment = (
        lookup(f"{name}.{key}", _scaled(getattr(port, key))) for key in ("direction", "alignment")
    )
    return position, port_axes(direction, alignment)


def _scaled(vector: Vector) -> ArrayLike:
    """Returns a vector scaled by a power of two, exactly, to a length between 1/2 and 2."""
    _, exponent = frexp(max(map(abs, vector)))
    return [ldexp(component, -exponent) for component in vector]


def _vessel_body(scene: Scene, name: str, lookup: Lookup, pose: Pose) -> Body:
    """Returns a vessel as a body in the axes of its group."""
    vessel = scene.vessels[name]
    mass = lookup(f"{name}.mass", vessel.mass)
    if vessel.pmi is not None:
        specific_inertia = ca.diag(lookup(f"{name}.pmi", vessel.pmi))
    else:
        specific_inertia = constant(vessel.specific_inertia)
    centre = constant(vessel.centre_of_mass)
    specific = congruence(pose.rotation, specific_inertia)
    return Body(mass, pose.origin + pose.rotation @ centre, mass * specific)
