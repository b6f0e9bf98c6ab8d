"""Gravity's gradient as a torque, and the motion about the attracting centre, in CasADi symbols.

r is the barycentre's position from the centre [m] and v its velocity [m/s], inertial axes; the centre
attracts as a mass point does, and the torque is of first order in the body's size over |r|.
Source: [EQ] Gravity's gradient, eqs. (13) and (14).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import casadi as ca

from supervessel.composite.inertia import from_upper_triangle
from supervessel.rotation.attitude import to_body, unit
from supervessel.rotation.laws import LAWS, MIXED_PRODUCTS, SQUARES, RotationLaw, gyroscopic_torque
from supervessel.rotation.lengths import smooth_length

if TYPE_CHECKING:
    from supervessel.composite.resolved import ResolvedScene

PRODUCTS = MIXED_PRODUCTS + SQUARES

NEARER = 8.0
"""Bound of what the gradient grows by in a sub-step that is no longer than `orbit_rate` allows, see there."""


@dataclass(frozen=True)
class Field:
    """The field of gravity that a body is in.

    mu      : gravitational parameter [m3/s2]
    inertia : the tensor of the scene's law, (3, 3) [kg m2], body axes
    start   : r and v, (6,), inertial axes, at the start of a step
    """

    mu: float
    inertia: ca.SX
    start: ca.SX

    def torque(self, attitude: ca.SX, position: ca.SX) -> ca.SX:
        """Returns 3 mu/|r|^3 r^ x J r^, (3,) [N m], body axes, r^ = r/|r|.

        attitude : q_inertial_body, (4,), of any length: only the direction of r in body axes counts
        position : r, (3,) [m], inertial axes
        """
        direction = unit(to_body(attitude, position))
        return -strength(self.mu, position) * (gyroscopic_torque(self.inertia) @ products_of(direction))

    def rate(self, motion: ca.SX) -> ca.SX:
        """Returns the rate of r and v, (6,): v and -mu r/|r|^3.

        motion : r and v, (6,), inertial axes
        """
        position, velocity = motion[:3], motion[3:]
        return ca.vertcat(velocity, -(strength(self.mu, position) / 3.0) * position)

    def gradient_map(self, law: RotationLaw, numbers: ca.SX) -> ca.SX:
        """Returns the linear map, (3, n), that takes products of r^ to the acceleration by 3 mu/|r|^3 = 1.

        law, numbers : the rotation law and its own numbers
        n is 6, of PRODUCTS, or 3 where those of the squares are zero.
        """
        torques = ca.horzsplit(-gyroscopic_torque(self.inertia))
        found = ca.horzcat(*(law.acceleration(numbers, ca.SX.zeros(3), torque) for torque in torques))
        diagonal = all(found[i, j].is_zero() for i in range(3) for j in range(6) if i != j)
        return ca.densify(found[:, :3] if diagonal else found)

    def largest_acceleration(self, law: RotationLaw, numbers: ca.SX) -> ca.SX:
        """Returns a bound, [rad/s2], of the acceleration by the gradient in a sub-step, in whatever attitude.

        The six products of a unit vector are no longer than 1 together, since those of four components are
        part of the square of its square.
        """
        size = smooth_length(ca.vec(self.gradient_map(law, numbers)))
        return NEARER * strength(self.mu, self.start[:3]) * size

    def orbit_rate(self) -> ca.SX:
        """Returns 3 sqrt(|v|^2/|r|^2 + mu/|r|^3), [rad/s].

        In a step h no longer than 1 over this rate, a = h |v|/|r| and b = h^2 mu/|r|^3 have a^2 + b <= 1/9.
        While the distance is at least half of |r| it has shrunk by no more than (a + 2 b) |r| <= 0.35 |r|: so
        it never gets to half of it, the gradient grows by less than NEARER, and r^ turns by less than 1 rad.
        """
        position, velocity = self.start[:3], self.start[3:]
        square = ca.sumsqr(position)
        return 3.0 * ca.sqrt(ca.sumsqr(velocity) / square + strength(self.mu, position) / 3.0)


def strength(mu: float, position: ca.SX) -> ca.SX:
    """Returns 3 mu/|r|^3 [1/s2]; position : r, (3,) [m]."""
    square = ca.sumsqr(position)
    return (3.0 * mu / square) / ca.sqrt(square)


def products_of(vector: ca.SX) -> ca.SX:
    """Returns the products of two components of a vector, (6,), in the order of PRODUCTS."""
    return ca.vertcat(*(vector[i] * vector[j] for i, j in PRODUCTS))


def field_of(resolved: "ResolvedScene", parts: Mapping[str, ca.SX], u: ca.SX) -> Field | None:
    """Returns the field that turns a scene's body; None where there is none, or the law knows no torque.

    parts : the parts of c by name, see `composite.parts`
    u     : the inputs that torques follow from, (m,), in the order of `ResolvedScene.turning`
    """
    gravity, law = resolved.scene.gravity, resolved.scene.rotation.law
    if gravity is None or not resolved.field or law == "none":
        return None
    inertia = LAWS[law].keeping(from_upper_triangle(parts["inertia"]))
    return Field(gravity.mu, inertia, u[len(resolved.acting) :])
