"""Poses in CasADi symbols: where frames stand and how they move, port frames, mating."""

from dataclasses import dataclass
from math import frexp, ldexp

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from supervessel.composite.templates import inlined
from supervessel.scene.numbers import Vector


@dataclass(frozen=True)
class Pose:
    """Where a frame stands: rotation (3, 3) out of it and its origin (3,) [m], both in outer axes.

    velocity, rate : (3,) [m/s] of the origin and (3,) [rad/s], relative to the outer axes, in them; both None
                     where the frame is at rest there
    """

    rotation: ca.SX
    origin: ca.SX
    velocity: ca.SX | None = None
    rate: ca.SX | None = None

    def then(self, inner: "Pose") -> "Pose":
        """Returns the pose, in these outer axes, of a frame whose pose is known in this one."""
        arm = self.rotation @ inner.origin
        rotation, origin = self.rotation @ inner.rotation, self.origin + arm
        velocity, rate = self.velocity, self.rate
        if velocity is not None and rate is not None:
            velocity = velocity + ca.cross(rate, arm)
        if inner.velocity is not None and inner.rate is not None:
            shift, turn = self.rotation @ inner.velocity, self.rotation @ inner.rate
            velocity = shift if velocity is None else velocity + shift
            rate = turn if rate is None else rate + turn
        return Pose(rotation, origin, velocity, rate)

    def inverse(self) -> "Pose":
        """Returns the pose of the outer axes in this frame, which is at rest."""
        return Pose(self.rotation.T, -(self.rotation.T @ self.origin))


@inlined((3,), (3,))
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


def scaled(vector: Vector) -> ArrayLike:
    """Returns a vector scaled by a power of two, exactly, to a length between 1/2 and 2."""
    _, exponent = frexp(max(map(abs, vector)))
    return [ldexp(component, -exponent) for component in vector]


def constant(value: ArrayLike) -> ca.SX:
    """Returns numbers as symbols."""
    return ca.densify(ca.SX(ca.DM(np.asarray(value, dtype=float))))
