"""What a method of propagation is: the form that each file of this package fills."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import casadi as ca

if TYPE_CHECKING:
    from supervessel.rotation.dynamics import SpunWheels
    from supervessel.rotation.gravity import Field
    from supervessel.rotation.laws import RotationLaw

Control = Literal["angle", "error", "series"]
Free = Literal["never", "always", "between kicks"]


@dataclass(frozen=True)
class StepSymbols:
    """What a step is built from, symbols or expressions of one scene.

    state        : attitude and angular velocity, (7,), then momenta of n wheels [N m s]; in a field of
                   gravity then position [m] and velocity [m/s] from the attracting centre, inertial axes
    rate         : state -> its rate
    law, numbers : the rotation law and its own numbers
    torque       : (3,) [N m], body axes, constant over the step, that of motors of wheels included; gravity's
                   is another
    step         : [s]
    tolerance    : the scene's
    with_error   : whether a method that needs no estimate for itself shall give one
    field        : the field of gravity, None where there is none
    wheels       : None where there are none
    slowing      : of jet damping, see `Dynamics.slowing`; None where there is none
    """

    state: ca.SX
    rate: Callable[[ca.SX], ca.SX]
    law: "RotationLaw"
    numbers: ca.SX
    torque: ca.SX
    step: ca.SX
    tolerance: float
    with_error: bool
    field: "Field | None" = None
    wheels: "SpunWheels | None" = None
    slowing: ca.SX | None = None

    @property
    def acceleration_by_torque(self) -> ca.SX:
        """Angular acceleration by the constant torque alone, (3,) [rad/s2]."""
        return self.law.acceleration(self.numbers, ca.SX.zeros(3), self.torque)

    @property
    def acceleration_at_start(self) -> ca.SX:
        """Angular acceleration by all torques as the step begins, (3,) [rad/s2]."""
        torque = self.torque
        if self.field is not None:
            torque = torque + self.field.torque(self.state[:4], self.state[-6:-3])
        by_torque = self.law.acceleration(self.numbers, ca.SX.zeros(3), torque)
        return by_torque if self.slowing is None else by_torque - self.slowing @ self.state[4:7]


@dataclass(frozen=True)
class Step:
    """One step of a method.

    state    : after it, as in `StepSymbols`, the attitude at unit length; of "split" attitude and angular
               velocity after its first half kick
    error    : estimate of its local error, (2,): attitude [rad], angular velocity [rad/s]; None: not wanted
    exponent : power of the step that the estimate grows with
    """

    state: ca.SX
    error: ca.SX | None
    exponent: int


Setting = Literal["max_angle_step", "tolerance", ""]
"""Key of `[rotation]` that sets how fine the steps are."""


STILL_PARTS = 'must be "auto", "rk4", "dop853" or "exact" where inputs.motion lists ports'

NOT_FLOWING = (
    'must be "auto", "rk4", "dop853" or "taylor" where inputs.flow lists points: the torque of jet damping '
    "changes with the angular velocity"
)
"""Why a method made of free motion does not suit jet damping."""

NOT_FREE = 'must be "auto", "rk4", "dop853" or "taylor" in a scene with wheels: '
"""Beginning of why a method does not suit wheels."""


def suits_any(law: str, inputs: Mapping[str, Any]) -> str:
    """Returns "": a method that suits every scene."""
    return ""


@dataclass(frozen=True)
class Propagator:
    """A method.

    build   : one step of it; None: it has no other step than free motion
    control : what bounds a step: the angle that the body turns, or the estimated error; of a "series" too,
              whose steps C takes by a loop of its own
    free    : when it uses exact free motion
    text    : what it does, HTML
    c_files : names, without .c and .h, of the files of fmu_build/c that an FMU has for it
    marker  : of its points in plots, as matplotlib names it
    setting : what sets its steps
    suits   : rotation law and table `[inputs]` -> why it makes no sense with them, "" where it does
    wheels  : why it makes no sense in a scene with wheels, "" where it does
    safety  : by how much the sum of estimates may exceed the tolerance: they are that much too large
              (measured in tests/model/test_controlled.py)
    """

    build: Callable[[StepSymbols], Step] | None
    control: Control
    free: Free
    text: str
    c_files: tuple[str, ...]
    marker: str
    setting: Setting = "tolerance"
    suits: Callable[[str, Mapping[str, Any]], str] = suits_any
    wheels: str = ""
    safety: float = 1.0

    def reason_against(self, law: str, inputs: Mapping[str, Any], has_wheels: bool) -> str:
        """Returns why the method makes no sense in a scene, "" where it does; law, inputs : as of `suits`."""
        return (self.wheels if has_wheels else "") or self.suits(law, inputs)
