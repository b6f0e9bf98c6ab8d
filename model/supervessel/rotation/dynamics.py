"""The rate of a body's state under a scene's rotation law, in CasADi symbols."""

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca

from supervessel.composite.actions import torque_about_barycentre
from supervessel.composite.inertia import from_upper_triangle
from supervessel.composite.resolved import ResolvedScene
from supervessel.rotation.attitude import attitude_dot
from supervessel.rotation.laws import LAWS, RotationLaw


@dataclass(frozen=True)
class Dynamics:
    """What turns a body.

    law         : the rotation law
    numbers     : the law's own numbers, from `RotationLaw.prepare`
    inertia     : tensor about the barycentre, (3, 3) [kg m2], body axes
    torque      : about the barycentre, (3,) [N m], body axes
    spin        : angular momentum, (3,) [N m s], body axes, of the parts that move relative to the body; None
                  where no port moves or the law has no gyroscopic term
    spin_square : square of a bound of the acceleration by that spin over |omega|, [rad2/s2]; None with `spin`
    """

    law: RotationLaw
    numbers: ca.SX
    inertia: ca.SX
    torque: ca.SX
    spin: ca.SX | None
    spin_square: ca.SX | None

    def state_rate(self, state: ca.SX) -> ca.SX:
        """Returns the rate, (7,), of the state (attitude, angular velocity), (7,)."""
        attitude, omega = state[:4], state[4:]
        torque = self.torque if self.spin is None else self.torque - ca.cross(omega, self.spin)
        acceleration = self.law.acceleration(self.numbers, omega, torque)
        return ca.vertcat(attitude_dot(attitude, omega), acceleration)

    def momentum_rate(self, omega: ca.SX, momentum: ca.SX) -> ca.SX:
        """Returns the rate, (3,) [N m], of the angular momentum's components in body axes.

        omega    : angular velocity, (3,) [rad/s], body axes
        momentum : (3,) [N m s], body axes, with the spin
        """
        turning = ca.cross(omega, momentum) if self.law.gyroscopic_term else ca.SX.zeros(3)
        return self.torque - turning


def dynamics_of(resolved: ResolvedScene, parts: Mapping[str, ca.SX], u: ca.SX) -> Dynamics:
    """Returns what turns the composite of a scene.

    parts : of the composite by name, see `composite.parts`
    u     : the inputs that act
    """
    law = LAWS[resolved.scene.rotation.law]
    spins = "momentum" in parts and law.gyroscopic_term
    return Dynamics(
        law=law,
        numbers=parts["law"],
        inertia=from_upper_triangle(parts["inertia"]),
        torque=torque_about_barycentre(resolved, parts, u),
        spin=parts["momentum"][:3] if spins else None,
        spin_square=parts["momentum"][3] if spins else None,
    )
