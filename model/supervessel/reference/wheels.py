"""Wheels of an assembly: what their momentum and their motors do to the body that carries them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from supervessel.reference.assembly import Array


@dataclass(frozen=True)
class Wheels:
    """Wheels of what is joined to the root. The mass of a wheel is in its vessel's inertia, as if locked.

    axes     : (n, 3), unit, body axes
    inertias : (n,) [kg m2], of each wheel about its axis; 0 where only its momentum counts
    momenta  : (n,) [N m s], of each wheel along its axis: inertia times its angular velocity about the axis,
               which is the speed relative to its vessel plus the vessel's own angular velocity about the axis
    torques  : (n,) [N m], of each motor on its wheel along the axis; the vessel gets the opposite

    A body of inertia J with wheels turns as one of J - A does that has `momentum` beside its own and on which
    `reaction` acts, A being `inertia`:
    (J - A) omega' = M + reaction - omega x L, L = (J - A) omega + momentum, and momenta' = torques.

    Example:
        >>> wheel = reference.Wheels(np.eye(3)[:1], np.array([0.5]), np.array([4.0]), np.array([0.1]))
        >>> J, omega = np.diag([1.0, 2.0, 3.0]), np.array([2.0, 0.0, 1.0])
        >>> reference.angular_acceleration("tensor", J - wheel.inertia, omega, wheel.reaction, wheel.momentum)
        array([-0.2, -0. ,  0. ])
    """

    axes: Array
    inertias: Array
    momenta: Array
    torques: Array

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
    def reaction(self) -> Array:
        """The torque of their motors on the vessels, -sum u b, (3,) [N m], body axes.

        Example:
            >>> reference.Wheels(np.eye(3), np.zeros(3), np.zeros(3), np.array([1.0, 2.0, 3.0])).reaction
            array([-1., -2., -3.])
        """
        reaction: Array = -self.torques @ self.axes
        return reaction

    def speeds(self, angular_velocity: ArrayLike) -> Array:
        """Returns each wheel's speed relative to the body, (n,) [rad/s]; a wheel of inertia 0 has none: nan.

        angular_velocity : (3,) [rad/s], of the vessels that carry the wheels, body axes

        Example:
            >>> wheel = reference.Wheels(np.eye(3)[:1], np.array([0.5]), np.array([4.0]), np.zeros(1))
            >>> wheel.speeds([3.0, 0.0, 0.0])
            array([5.])
        """
        absolute = np.full(len(self.inertias), np.nan)
        np.divide(self.momenta, self.inertias, out=absolute, where=self.inertias > 0.0)
        speeds: Array = absolute - self.axes @ np.asarray(angular_velocity, dtype=float)
        return speeds
