"""The states of model exchange: attitude and angular velocity, or attitude and angular momentum.

The momentum is the state where every change of inputs keeps it: the states then do not jump with the inputs.
"""

from dataclasses import dataclass

import casadi as ca

from supervessel.rotation.attitude import attitude_dot
from supervessel.rotation.changes import Change
from supervessel.rotation.dynamics import Dynamics


@dataclass(frozen=True)
class ExchangeStates:
    """The states z that an importer's solver integrates.

    symbols : z, (7 + n,): q_inertial_body, then omega [rad/s] or the momentum H of the whole [N m s], body
              axes, then the momenta of n wheels [N m s]
    name    : name of z as an argument of functions, "x" or "z"
    rate    : z_dot, (7 + n,), an expression of z
    x       : q_inertial_body, omega [rad/s], body axes, and the momenta of wheels, (7 + n,), an expression of
              z
    """

    symbols: ca.SX
    name: str
    rate: ca.SX
    x: ca.SX


def states_by_rate(x: ca.SX, dynamics: Dynamics) -> ExchangeStates:
    """Returns attitude, angular velocity and momenta of wheels, x, (7 + n,), as the states."""
    return ExchangeStates(x, "x", dynamics.state_rate(x), x)


def states_by_momentum(change: Change, c: ca.SX, dynamics: Dynamics) -> ExchangeStates:
    """Returns attitude and angular momentum as the states.

    change : gives omega of H, see `changes.Change`
    c      : symbols of the composite, (n,)
    A change of inputs that keeps the angular momentum then leaves the states as they are.
    """
    z = ca.SX.sym("z", 4 + change.rate_of_momentum.numel_in(0))
    attitude, momentum, stored = z[:4], z[4:7], z[7:]
    omega = change.rate_of_momentum(z[4:], c)
    rate = ca.vertcat(attitude_dot(attitude, omega), dynamics.momentum_rate(attitude, omega, momentum))
    if dynamics.wheels is not None:
        rate = ca.vertcat(rate, dynamics.wheels.rate)
    return ExchangeStates(z, "z", rate, ca.vertcat(attitude, omega, stored))
