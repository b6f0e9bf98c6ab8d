"""Poses in CasADi symbols: where frames stand and how they move, port frames, mating.

Places are reckoned from the anchor of a vessel, so that where its axes begin costs no digits: positions in
its axes may all be far from their origin, but their differences from the centre of mass are not, and of them
alone the composite's tensor is made.
"""

from dataclasses import dataclass
from math import frexp, ldexp

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from supervessel.composite.templates import inlined
from supervessel.scene.inputs import vessel_of
from supervessel.scene.numbers import Vector
from supervessel.scene.schema import Scene


@dataclass(frozen=True)
class Pose:
    """Where a frame, the inner axes, stands in outer axes, and how it moves there.

    rotation : R_outer_inner, (3, 3)
    origin   : (3,) [m], of the inner axes, outer axes
    velocity : (3,) [m/s], of that origin relative to the outer axes, outer axes
    rate     : (3,) [rad/s], of the inner axes relative to the outer axes, outer axes
    velocity and rate are both None where the inner axes are at rest in the outer ones.
    """

    rotation: ca.SX
    origin: ca.SX
    velocity: ca.SX | None = None
    rate: ca.SX | None = None

    def then(self, inner: "Pose") -> "Pose":
        """Returns the pose in this pose's outer axes of a frame that is known in this pose's inner axes.

        inner : pose of the frame in the inner axes
        With R, o, v, w of this pose and R_i, o_i, v_i, w_i of `inner`: rotation R R_i, origin o + R o_i,
        velocity v + w x R o_i + R v_i, rate w + R w_i.
        """
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
        """Returns the pose of the outer axes in the inner ones: R^T, -R^T o. Takes a pose at rest only."""
        return Pose(self.rotation.T, -(self.rotation.T @ self.origin))


@inlined((3,), (3,))
def port_axes(direction: ca.SX, alignment: ca.SX) -> ca.SX:
    """Returns R_vessel_port, (3, 3): the orthonormal columns d, a, d x a of a port.

    direction : (3,), vessel axes; d is its direction
    alignment : (3,), vessel axes; a is the direction of its projection onto the plane across d
    Both may have any length > 0 whose square neither under- nor overflows. They must not be parallel, which
    is not checked. The projection is (d x alignment) x d, perpendicular to d to rounding even where the two
    are nearly parallel.
    """
    d = direction / ca.sqrt(ca.sumsqr(direction))
    across = ca.cross(ca.cross(d, alignment), d)
    a = across / ca.sqrt(ca.sumsqr(across))
    return ca.horzcat(d, a, ca.cross(d, a))


def mated_pose(parent: tuple[ca.SX, ca.SX], child: tuple[ca.SX, ca.SX]) -> Pose:
    """Returns the pose of the child vessel in the parent's axes.

    parent, child : position (3,) [m] and R_vessel_port, (3, 3), of each mated port, its own vessel's axes
    With R = R_parent_child, R d_child = -d_parent and R a_child = a_parent; both ports are at one point.
    Source: [CV] eqs. (8), (9); [EQ] The assembly, eq. (4).
    """
    (position_parent, R_parent_port), (position_child, R_child_port) = parent, child
    facing = ca.horzcat(-R_parent_port[:, 0], R_parent_port[:, 1], -R_parent_port[:, 2])
    R_parent_child = facing @ R_child_port.T
    return Pose(R_parent_child, position_parent - R_parent_child @ position_child)


def scaled(vector: Vector) -> ArrayLike:
    """Returns a vector scaled by a power of two, exactly, to a length between 1/2 and 2."""
    _, exponent = frexp(max(map(abs, vector)))
    return [ldexp(component, -exponent) for component in vector]


def constant(value: ArrayLike) -> ca.SX:
    """Returns an array of numbers as a dense CasADi expression of the same shape."""
    return ca.densify(ca.SX(ca.DM(np.asarray(value, dtype=float))))


def anchor(scene: Scene, vessel: str) -> NDArray[np.float64]:
    """Returns a vessel's anchor, (3,) [m], vessel axes: its centre of mass.

    The origin of its axes where a port of it has a pose input: C adds that pose up as it is set.
    """
    moved = any(vessel_of(port) == vessel for port in scene.inputs.pose)
    return np.zeros(3) if moved else np.array(scene.vessels[vessel].centre_of_mass, dtype=float)


def from_anchor(scene: Scene, vessel: str, position: ArrayLike) -> NDArray[np.float64]:
    """Returns a position in a vessel's axes, (3,) [m], as seen from the vessel's anchor."""
    return np.asarray(position, dtype=float) - anchor(scene, vessel)
