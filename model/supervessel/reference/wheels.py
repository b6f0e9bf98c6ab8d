"""Wheels of an assembly: what their momentum and their motors do to the body that carries them."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from supervessel.reference.assembly import Array, motions
from supervessel.scene.schema import Scene


@dataclass(frozen=True)
class Wheels:
    """Wheels of what is joined to the root. The mass of a wheel is in its vessel's inertia, as if locked.

    axes     : (n, 3), unit, body axes
    inertias : (n,) [kg m2], of each wheel about its axis; 0 where only its momentum counts
    momenta  : (n,) [N m s], of each wheel along its axis: inertia times its angular velocity about the axis,
               which is the speed relative to its vessel plus the vessel's own angular velocity about the axis
    torques  : (n,) [N m], of each motor on its wheel along the axis; the vessel gets the opposite
    rates    : (n,) [rad/s], of each wheel's vessel relative to the root, about the wheel's axis

    A body of inertia J with wheels turns as one of J - A does that has `momentum` beside its own and on which
    `reaction` acts, A being `inertia`:
    (J - A) omega' = M + reaction - omega x L, L = (J - A) omega + momentum, and momenta' = torques.

    Example:
        >>> wheel = reference.Wheels(np.eye(3)[:1], np.array([0.5]), np.array([4.0]), np.array([0.1]))
        >>> J, omega = np.diag([1.0, 2.0, 3.0]), np.array([2.0, 0.0, 1.0])
        >>> reference.angular_acceleration("tensor", J - wheel.inertia, omega, wheel.reaction, wheel.momentum)
        array([-0.2,  0.5,  0. ])
    """

    axes: Array
    inertias: Array
    momenta: Array
    torques: Array
    rates: Array | float = 0.0

    @property
    def inertia(self) -> Array:
        """Their inertia A = sum I_w b b^T about their own axes b, (3, 3) [kg m2], body axes.

        Example:
            >>> reference.Wheels(np.eye(3), np.array([0.5, 0.2, 0.1]), *np.zeros((2, 3))).inertia.diagonal()
            array([0.5, 0.2, 0.1])
        """
        inertia: Array = (self.axes.T * self.inertias) @ self.axes
        return inertia

    @property
    def momentum(self) -> Array:
        """The momentum that they store along their axes, sum h_w b, (3,) [N m s], body axes.

        Example:
            >>> reference.Wheels(np.eye(3), np.zeros(3), np.array([1.0, 2.0, 3.0]), np.zeros(3)).momentum
            array([1., 2., 3.])
        """
        momentum: Array = self.momenta @ self.axes
        return momentum

    @property
    def carried(self) -> Array:
        """What locked wheels would have of the motion of their vessels, (3,) [N m s], body axes.

        The momentum of parts that move relative to the root has it: there wheels turn with their vessels.

        Example:
            >>> wheel = reference.Wheels(np.eye(3)[:1], np.array([0.5]), *np.zeros((2, 1)), np.array([0.2]))
            >>> wheel.carried
            array([0.1, 0. , 0. ])
        """
        carried: Array = (self.inertias * self.rates) @ self.axes
        return carried

    @property
    def reaction(self) -> Array:
        """The torque of their motors on the vessels, -sum u b, (3,) [N m], body axes.

        Example:
            >>> reference.Wheels(np.eye(3), np.zeros(3), np.zeros(3), np.array([1.0, 2.0, 3.0])).reaction
            array([-1., -2., -3.])
        """
        reaction: Array = -self.torques @ self.axes
        return reaction

    def speeds(self, angular_velocity: ArrayLike) -> Array:
        """Returns each wheel's speed relative to its vessel, (n,) [rad/s]; nan for a wheel of inertia 0.

        angular_velocity : (3,) [rad/s], of the body, body axes

        Example:
            >>> wheel = reference.Wheels(np.eye(3)[:1], np.array([0.5]), np.array([4.0]), np.zeros(1))
            >>> wheel.speeds([3.0, 0.0, 0.0])
            array([5.])
        """
        absolute = np.full(len(self.inertias), np.nan)
        np.divide(self.momenta, self.inertias, out=absolute, where=self.inertias > 0.0)
        speeds: Array = absolute - self.axes @ np.asarray(angular_velocity, dtype=float) - self.rates
        return speeds


def wheels_of(scene: Scene, momenta: ArrayLike, values: Mapping[str, float] | None = None) -> Wheels:
    """Returns the wheels of a scene in the order of its states.

    momenta : (n,) [N m s], of each
    A wheel whose vessel is not joined to the root has zeros for its axis, and its motor does nothing.
    Raises ValueError for another number of momenta than the scene has wheels.

    Example:
        >>> reference.wheels_of(scene, []).momentum.tolist()
        [0.0, 0.0, 0.0]
    """
    momenta, n = np.array(momenta, dtype=float), len(scene.wheels)
    if momenta.shape != (n,):
        raise ValueError(f"momenta of {momenta.size} wheels: the scene has {n}")
    axes, inertias, torques, rates = np.zeros((n, 3)), np.zeros(n), np.zeros(n), np.zeros(n)
    placed = motions(scene, values)
    for i, name in enumerate(scene.wheels):
        wheel, motion = scene.wheel(name), placed.get(name.partition(".")[0])
        inertias[i] = wheel.inertia
        if motion is not None:
            axis = np.array(wheel.axis) / np.abs(wheel.axis).max()
            axes[i] = motion.rotation @ (axis / np.linalg.norm(axis))
            torques[i] = (values or {}).get(f"{name}.torque", 0.0)
            rates[i] = axes[i] @ motion.rate
    return Wheels(axes, inertias, momenta, torques, rates)


def wheel_outputs(
    scene: Scene, state: ArrayLike, values: Mapping[str, float] | None = None
) -> dict[str, float]:
    """Returns the outputs of each wheel, "vessel.wheel.output"; a wheel of inertia 0 has no speed.

    state : (attitude, angular velocity, momenta of wheels), (7 + n,)
    The speed is 0 where the wheel's vessel is not joined to the root.

    Example:
        >>> reference.wheel_outputs(scene, [1, 0, 0, 0, 0, 0.0011, 0])
        {}
    """
    state = np.asarray(state, dtype=float)
    found = wheels_of(scene, state[7:], values)
    joined = motions(scene, values)
    outputs = {}
    for name, momentum, speed in zip(scene.wheels, found.momenta, found.speeds(state[4:7]), strict=True):
        outputs[f"{name}.momentum"] = float(momentum)
        if not np.isnan(speed):
            outputs[f"{name}.speed"] = float(speed) if name.partition(".")[0] in joined else 0.0
    return outputs
