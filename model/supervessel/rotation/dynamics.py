"""The rate of a body's state under a scene's rotation law, in CasADi symbols."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import casadi as ca

from supervessel.composite.actions import jet_damping, torque_about_barycentre
from supervessel.composite.inertia import from_upper_triangle
from supervessel.composite.resolved import ResolvedScene
from supervessel.composite.wheels import (
    WheelAxes,
    axes_of,
    free_inertia,
    motor_torques,
    stored_rate,
)
from supervessel.rotation.attitude import attitude_dot
from supervessel.rotation.gravity import Field, field_of
from supervessel.rotation.laws import LAWS, RotationLaw


@dataclass(frozen=True)
class SpunWheels:
    """The wheels in the equation of rotation.

    axes      : b_w and I_w, see `composite.wheels`
    motors    : torque u_w of each wheel's motor, (n,) [N m]
    rate      : h_w' of each wheel, (n,) [N m]
    lightness : trace((J - A)^-1) [1/(kg m2)]
    """

    axes: WheelAxes
    motors: ca.SX
    rate: ca.SX
    lightness: ca.SX

    @property
    def reaction(self) -> ca.SX:
        """Sum of u_w b_w, (3,) [N m], body axes: the motors' torque on the wheels; the body gets the
        opposite."""
        return self.axes.axes @ self.motors

    @property
    def motored(self) -> bool:
        """Whether a wheel has a motor."""
        return not self.motors.is_zero()

    def momentum(self, stored: ca.SX) -> ca.SX:
        """Returns the sum of h_w b_w, (3,) [N m s], body axes; stored : h_w, (n,) [N m s]."""
        return self.axes.axes @ stored


@dataclass(frozen=True)
class Dynamics:
    """The quantities in the equation of rotation, all about the barycentre in body axes.

    law         : the rotation law
    numbers     : the law's own numbers, from `RotationLaw.prepare`
    inertia     : J, (3, 3) [kg m2]
    torque      : M, sum of all torques but gravity's and those of motors of wheels, (3,) [N m]
    moving      : h, angular momentum of the parts that move relative to body axes, (3,) [N m s]; None where
                  no port moves
    spin        : the same where the law has a gyroscopic term, else None
    spin_square : [rad2/s2], square of a bound of |J^-1 (omega x h)|/|omega|; None where spin is None
    wheels      : None where there are none
    field       : the field of gravity whose gradient is a torque too; None where there is none
    excess      : by how much d|omega|/dt over |omega|^2 may exceed the law's `growth`; None: a rigid body's
                  moments never let it, see `composite.parts`
    damping     : D, (3, 3) [N m s], of jet damping, whose torque is -D omega, the part of it that the law
                  takes of J; None where there is none
    """

    law: RotationLaw
    numbers: ca.SX
    inertia: ca.SX
    torque: ca.SX
    moving: ca.SX | None
    spin: ca.SX | None
    spin_square: ca.SX | None
    wheels: SpunWheels | None = None
    field: Field | None = None
    excess: ca.SX | None = None
    damping: ca.SX | None = None

    @property
    def turning(self) -> ca.SX:
        """J - A, (3, 3) [kg m2]: the tensor of all that turns with the body."""
        return free_inertia(self.inertia, None if self.wheels is None else self.wheels.axes)

    @property
    def body_torque(self) -> ca.SX:
        """M - sum of u_w b_w, (3,) [N m]: the torque but gravity's on all that turns with the body."""
        return self.torque if self.wheels is None else self.torque - self.wheels.reaction

    def torque_at(self, torque: ca.SX, attitude: ca.SX, position: ca.SX | None = None) -> ca.SX:
        """Returns a torque with that of gravity's gradient added, (3,) [N m], body axes.

        torque   : all others, (3,) [N m]
        attitude : q_inertial_body, (4,), of any length
        position : of the barycentre from the attracting centre, (3,) [m], inertial axes; None: as the field
                   has it
        """
        if self.field is None:
            return torque
        place = self.field.start[:3] if position is None else position
        return torque + self.field.torque(attitude, place)

    @property
    def slowing(self) -> ca.SX | None:
        """The matrix, (3, 3) [1/s], that takes omega to the opposite of the acceleration by jet damping."""
        if self.damping is None:
            return None
        columns = (self.law.acceleration(self.numbers, ca.SX.zeros(3), D) for D in ca.horzsplit(self.damping))
        return ca.densify(ca.horzcat(*columns))

    def damped(self, torque: ca.SX, omega: ca.SX) -> ca.SX:
        """Returns a torque with that of jet damping added, (3,) [N m], body axes."""
        return torque if self.damping is None else torque - self.damping @ omega

    def held_momentum(self, state: ca.SX) -> ca.SX | None:
        """Returns h + sum of h_w b_w, (3,) [N m s], body axes, where the law has a gyroscopic term.

        state : see `state_rate`; what a step carries besides may follow
        None where nothing moves relative to the body, or the law takes no notice.
        """
        if self.wheels is None or not self.law.gyroscopic_term:
            return self.spin
        held = self.wheels.momentum(state[7 : 7 + self.wheels.motors.numel()])
        return held if self.spin is None else self.spin + held

    def state_rate(self, state: ca.SX, position: ca.SX | None = None) -> ca.SX:
        """Returns the rate of the state, (7 + n,): q' = q (0, omega)/2, omega' by the law, and h_w'.

        state    : q_inertial_body, (4,), omega, (3,) [rad/s], body axes, and h_w of n wheels [N m s]
        position : see `torque_at`
        The law is given the torque M - sum of u_w b_w - D omega - omega x (h + sum of h_w b_w), and the
        tensor J - A.
        Source: [EQ] Conventions, eq. (2); Rotation: the four laws, eqs. (7) to (10); When masses or poses
        change, eq. (11); Wheels, eqs. (16) and (17); Jet damping, eq. (28).
        """
        attitude, omega, held = state[:4], state[4:7], self.held_momentum(state)
        acting = self.damped(self.torque_at(self.body_torque, attitude, position), omega)
        torque = acting if held is None else acting - ca.cross(omega, held)
        acceleration = self.law.acceleration(self.numbers, omega, torque)
        rate = ca.vertcat(attitude_dot(attitude, omega), acceleration)
        return rate if self.wheels is None else ca.vertcat(rate, self.wheels.rate)

    def held_square(self, state: ca.SX, angle: float, push: Callable[[ca.SX], ca.SX]) -> ca.SX | None:
        """Returns the square, [rad2/s2], of a bound of |(J - A)^-1 (omega x S + D omega)|/|omega| over a
        sub-step.

        S     : `held_momentum` from state on, which motors change by |S'| <= |sum of u_w b_w|
        angle : largest angle of a sub-step [rad]; its length is at most this over the root of the result
        push  : a vector -> its length
        None where S and D are None. With k = trace((J - A)^-1) the bound without D grows from k |S| to
        k (|S| + |S'| t), and its square is taken as R^2 = 2 k^2 |S|^2 + 2 k |S'| angle: at t = angle/R it is
        at most 2 k^2 |S|^2 + 2 (k |S'| angle)^2/R^2 <= R^2. D adds |(J - A)^-1 D| to the bound, and
        (a + b)^2 <= 2 (a^2 + b^2).
        """
        held, slowing = self._held_square(state, angle, push), self.slowing
        if slowing is None:
            return held
        own = ca.sumsqr(slowing)
        return own if held is None else 2.0 * (held + own)

    def _held_square(self, state: ca.SX, angle: float, push: Callable[[ca.SX], ca.SX]) -> ca.SX | None:
        """Returns what `held_square` does without jet damping."""
        held = self.held_momentum(state)
        if self.wheels is None or held is None:
            return self.spin_square
        lightness = self.wheels.lightness
        square = ca.sumsqr(held) * lightness * lightness
        if not self.wheels.motored:
            return square
        return 2.0 * square + 2.0 * angle * lightness * push(self.wheels.reaction)

    def momentum_rate(self, attitude: ca.SX, omega: ca.SX, momentum: ca.SX) -> ca.SX:
        """Returns H' = M - omega x H, (3,) [N m], of the components of the angular momentum in body axes.

        attitude : q_inertial_body, (4,), of any length
        omega    : angular velocity, (3,) [rad/s], body axes
        momentum : H = (J - A) omega + h + sum of h_w b_w, (3,) [N m s], body axes
        A law without gyroscopic term leaves omega x H out.
        """
        turning = ca.cross(omega, momentum) if self.law.gyroscopic_term else ca.SX.zeros(3)
        return self.damped(self.torque_at(self.torque, attitude), omega) - turning


def dynamics_of(resolved: ResolvedScene, parts: Mapping[str, ca.SX], u: ca.SX) -> Dynamics:
    """Returns the quantities in the equation of rotation of a scene's composite.

    parts : the parts of c by name, see `composite.parts`
    u     : the inputs that torques follow from, (m,), in the order of `ResolvedScene.turning`
    """
    law = LAWS[resolved.scene.rotation.law]
    spins = "momentum" in parts and law.gyroscopic_term
    damping = jet_damping(resolved, parts, u)
    return Dynamics(
        law=law,
        numbers=parts["law"],
        inertia=from_upper_triangle(parts["inertia"]),
        torque=torque_about_barycentre(resolved, parts, u),
        moving=parts["momentum"][:3] if "momentum" in parts else None,
        spin=parts["momentum"][:3] if spins else None,
        spin_square=parts["momentum"][3] if spins else None,
        wheels=_wheels(resolved, parts, u),
        field=field_of(resolved, parts, u),
        excess=parts.get("excess"),
        damping=None if damping is None else law.keeping(damping),
    )


def _wheels(resolved: ResolvedScene, parts: Mapping[str, ca.SX], u: ca.SX) -> SpunWheels | None:
    """Returns the wheels of a scene; parts, u : as of `dynamics_of`."""
    axes = axes_of(resolved, parts)
    if axes is None:
        return None
    motors = motor_torques(resolved, u)
    return SpunWheels(axes, motors, stored_rate(resolved, axes, motors), parts["lightness"])
