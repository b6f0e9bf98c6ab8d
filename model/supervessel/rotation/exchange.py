"""The states of model exchange: the angular momentum in place of the rate where every change keeps it."""

from dataclasses import dataclass

import casadi as ca

from supervessel.rotation.attitude import attitude_dot
from supervessel.rotation.changes import Change
from supervessel.rotation.dynamics import Dynamics


@dataclass(frozen=True)
class ExchangeStates:
    """The states z that an importer's solver integrates.

    symbols : z, (7,)
    name    : of z as an argument of functions
    rate    : z_dot, (7,)
    x       : (attitude, angular velocity), (7,), as an expression of z
    """

    symbols: ca.SX
    name: str
    rate: ca.SX
    x: ca.SX


def states_by_rate(x: ca.SX, dynamics: Dynamics) -> ExchangeStates:
    """Returns attitude and angular velocity as the states."""
    return ExchangeStates(x, "x", dynamics.state_rate(x), x)


def states_by_momentum(change: Change, c: ca.SX, dynamics: Dynamics) -> ExchangeStates:
    """Returns attitude and angular momentum as the states.

    c : symbols of the composite
    A change of inputs that keeps the angular momentum then leaves the states as they are.
    """
    z = ca.SX.sym("z", 7)
    attitude, momentum = z[:4], z[4:]
    omega = change.rate_of_momentum(momentum, c)
    rate = ca.vertcat(attitude_dot(attitude, omega), dynamics.momentum_rate(omega, momentum))
    return ExchangeStates(z, "z", rate, ca.vertcat(attitude, omega))
