"""The rate of a body's state under a scene's rotation law, in CasADi symbols."""

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca

from supervessel.composite.actions import torque_about_barycentre
from supervessel.composite.inertia import from_upper_triangle
from supervessel.composite.resolved import ResolvedScene
from supervessel.rotation.attitude import attitude_dot
from supervessel.rotation.gravity import Field, field_of
from supervessel.rotation.laws import LAWS, RotationLaw


@dataclass(frozen=True)
class Dynamics:
    """The quantities in the equation of rotation, all about the barycentre in body axes.

    law         : the rotation law
    numbers     : the law's own numbers, from `RotationLaw.prepare`
    inertia     : J, (3, 3) [kg m2]
    torque      : M, sum of all torques but gravity's, (3,) [N m]
    moving      : h, angular momentum of the parts that move relative to body axes, (3,) [N m s]; None where
                  no port moves
    spin        : the same where the law has a gyroscopic term, else None
    spin_square : [rad2/s2], square of a bound of |J^-1 (omega x h)|/|omega|; None where spin is None
    field       : the field of gravity whose gradient is a torque too; None where there is none
    """

    law: RotationLaw
    numbers: ca.SX
    inertia: ca.SX
    torque: ca.SX
    moving: ca.SX | None
    spin: ca.SX | None
    spin_square: ca.SX | None
    field: Field | None = None

    def torque_at(self, attitude: ca.SX, position: ca.SX | None = None) -> ca.SX:
        """Returns the sum of all torques, (3,) [N m], body axes.

        attitude : q_inertial_body, (4,), of any length
        position : of the barycentre from the attracting centre, (3,) [m], inertial axes; None: as the field
                   has it
        """
        if self.field is None:
            return self.torque
        place = self.field.start[:3] if position is None else position
        return self.torque + self.field.torque(attitude, place)

    def state_rate(self, state: ca.SX, position: ca.SX | None = None) -> ca.SX:
        """Returns the rate of the state, (7,) [1/s, rad/s2]: q' = q (0, omega)/2, and omega' by the law.

        state    : q_inertial_body, (4,), and omega, (3,) [rad/s], body axes
        position : see `torque_at`
        The law is given the torque M - omega x h.
        Source: [EQ] Conventions, eq. (2); Rotation: the four laws, eqs. (7) to (10); When masses or poses
        change, eq. (11).
        """
        attitude, omega = state[:4], state[4:]
        acting = self.torque_at(attitude, position)
        torque = acting if self.spin is None else acting - ca.cross(omega, self.spin)
        acceleration = self.law.acceleration(self.numbers, omega, torque)
        return ca.vertcat(attitude_dot(attitude, omega), acceleration)

    def momentum_rate(self, attitude: ca.SX, omega: ca.SX, momentum: ca.SX) -> ca.SX:
        """Returns H' = M - omega x H, (3,) [N m], of the components of the angular momentum in body axes.

        attitude : q_inertial_body, (4,), of any length
        omega    : angular velocity, (3,) [rad/s], body axes
        momentum : H = J omega + h, (3,) [N m s], body axes
        A law without gyroscopic term leaves omega x H out.
        """
        turning = ca.cross(omega, momentum) if self.law.gyroscopic_term else ca.SX.zeros(3)
        return self.torque_at(attitude) - turning


def dynamics_of(resolved: ResolvedScene, parts: Mapping[str, ca.SX], u: ca.SX) -> Dynamics:
    """Returns the quantities in the equation of rotation of a scene's composite.

    parts : the parts of c by name, see `composite.parts`
    u     : the inputs that torques follow from, (m,), in the order of `ResolvedScene.turning`
    """
    law = LAWS[resolved.scene.rotation.law]
    spins = "momentum" in parts and law.gyroscopic_term
    return Dynamics(
        law=law,
        numbers=parts["law"],
        inertia=from_upper_triangle(parts["inertia"]),
        torque=torque_about_barycentre(resolved, parts, u),
        moving=parts["momentum"][:3] if "momentum" in parts else None,
        spin=parts["momentum"][:3] if spins else None,
        spin_square=parts["momentum"][3] if spins else None,
        field=field_of(resolved, parts, u),
    )
