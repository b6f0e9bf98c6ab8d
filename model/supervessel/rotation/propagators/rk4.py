"""The classical Runge-Kutta method of order 4."""

from collections.abc import Callable

import casadi as ca

from supervessel.rotation.attitude import unit
from supervessel.rotation.propagators.method import Propagator, Step, StepSymbols


def rk4_step(ode: Callable[[ca.SX], ca.SX], state: ca.SX, step: ca.SX) -> ca.SX:
    """Returns the state (attitude, and what goes along), (n,), one step later, the attitude at unit length.

    ode   : state -> its rate
    step  : [s]
    Source: [HNW] section II.1, table 1.2: the classical method of order 4, for attitude and
    rate jointly.
    """
    half = 0.5 * step
    k1 = ode(state)
    k2 = ode(state + half * k1)
    k3 = ode(state + half * k2)
    k4 = ode(state + step * k3)
    end = state + step / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
    return ca.vertcat(unit(end[:4]), end[4:])


def build(motion: StepSymbols) -> Step:
    """Returns one step; its error, where asked for, is its distance to two half steps, times 16/15."""
    end = rk4_step(motion.rate, motion.state, motion.step)
    if not motion.with_error:
        return Step(end, None, 5)
    half = 0.5 * motion.step
    better = rk4_step(motion.rate, rk4_step(motion.rate, motion.state, half), half)
    off = (16.0 / 15.0) * (end - better)
    return Step(end, ca.vertcat(2.0 * ca.norm_2(off[:4]), ca.norm_2(off[4:7])), 5)


PROPAGATOR = Propagator(
    build,
    "angle",
    "never",
    "The classical Runge-Kutta method of order 4 ([HNW] section II.1) for attitude and angular velocity "
    "jointly. A communication step is divided so that the body surely turns by no more than "
    "<code>max_angle_step</code> in a sub-step, spin-up by torque included.",
    c_files=("rk4",),
    marker="o",
    setting="max_angle_step",
)
