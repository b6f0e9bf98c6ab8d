"""Free motion between two halves of the torque's kick: for weak torque, however fast the body turns.

In a field of gravity the kicks are those of the gradient where the body is at the step's ends, and the motion
about the attracting centre goes on in between by a step of dop853.
"""

from collections.abc import Mapping
from typing import Any

import casadi as ca

from supervessel.rotation.gravity import Field
from supervessel.rotation.propagators.dop853 import runge_kutta_end
from supervessel.rotation.propagators.method import (
    NOT_FLOWING,
    NOT_FREE,
    STILL_PARTS,
    Propagator,
    Step,
    StepSymbols,
)
from supervessel.scene.inputs import acting


def build(motion: StepSymbols) -> Step:
    """Returns the state after the first half kick; free motion over the step and the same kick again follow.

    The symmetric splitting of order 2. Its error is that of the trapezoidal rule for what the torque does,
    carried on by the free motion to the end of the step. With a = |acceleration by torque| and
    W = |omega| + a h: attitude a h^2 min(1, W h (2 + W h)/12),
    angular velocity a h min(1, a h^2/4 + (W h)^2/3).
    The gyroscopic term alone, of order (a h^2)^2, makes the a h^2/4; it is bounded by GYROSCOPIC_GROWTH < 1.
    The gradient's torque turns, seen from the body, by up to twice its rate and the orbit's.
    Source: G. Strang's splitting, [HLW] section II.5.
    """
    h, omega = motion.step, motion.state[4:7]
    by_torque = motion.acceleration_at_start
    kicked = ca.vertcat(motion.state[:4], omega + 0.5 * h * by_torque)
    a = ca.norm_2(by_torque)
    angle = h * (ca.norm_2(omega) + a * h)
    if motion.field is not None:
        kicked = ca.vertcat(kicked, orbit_step(motion.field, h))
        a = ca.norm_2(motion.acceleration_by_torque) + motion.field.largest_acceleration(
            motion.law, motion.numbers
        )
        angle = h * (2.0 * ca.norm_2(omega) + 2.0 * a * h + motion.field.orbit_rate())
    attitude = a * h * h * ca.fmin(1.0, angle * (2.0 + angle) / 12.0)
    rate = a * h * ca.fmin(1.0, 0.25 * a * h * h + angle * angle / 3.0)
    return Step(kicked, ca.vertcat(attitude, rate), 3)


def orbit_step(field: Field, step: ca.SX) -> ca.SX:
    """Returns position and velocity, (6,) [m, m/s], a step [s] later, by the method of order 8."""
    return runge_kutta_end(field.rate, field.start, step)


def _suits(law: str, inputs: Mapping[str, Any]) -> str:
    """Returns why kicks make no sense: without a torque, and where parts move."""
    if law == "none":
        return 'makes no sense with rotation.law = "none", where torque does nothing; take any other'
    if inputs.get("motion"):
        return STILL_PARTS
    if inputs.get("flow"):
        return NOT_FLOWING
    if not acting(inputs):
        return 'must be "exact" or "auto" without inputs.torque'
    return ""


PROPAGATOR = Propagator(
    build,
    "error",
    "between kicks",
    "Half of the torque's change of angular velocity, exact free motion over the step, the other half "
    "([HLW] section II.5). The steps keep an a-priori bound of the error within the tolerance; they are not "
    "limited by how fast the body turns, only by how strong the torque is.",
    c_files=("split", "tried_steps", "estimated_steps", "free_motion"),
    marker="v",
    suits=_suits,
    wheels=NOT_FREE + "between kicks the momentum that they hold turns the body otherwise than free motion",
)
