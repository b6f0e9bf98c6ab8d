"""The equation of each output, in CasADi symbols; `scene.outputs` has the row of each."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import casadi as ca

from supervessel.composite.actions import net_force, vessel_outputs, vessel_pieces
from supervessel.composite.inertia import from_upper_triangle
from supervessel.composite.resolved import ResolvedScene
from supervessel.composite.shown.loads import load_outputs
from supervessel.composite.shown.points import InstantMotion, SpunBeside, Tide, point_outputs
from supervessel.composite.wheels import (
    WheelAxes,
    axes_of,
    free_inertia,
    momentum_of_vessel,
    wheel_energy,
    wheel_outputs,
)
from supervessel.rotation.attitude import to_body, to_inertial, unit
from supervessel.rotation.dynamics import Dynamics
from supervessel.rotation.gravity import strength


@dataclass(frozen=True)
class Known:
    """The quantities that outputs are computed from.

    resolved : the scene
    attitude : q_inertial_body, (4,), of unit length
    omega    : angular velocity, (3,) [rad/s], body axes
    u        : the inputs that torques follow from, (m,)
    parts    : by name, the parts of c, see `composite.parts`; "principal", the part of a, (7,), zeros where
               no output shows it; "error_estimate" and "error_bound" [rad]
    inertia  : J about the barycentre, (3, 3) [kg m2], body axes
    wheels   : see `composite.wheels`; None where there are none
    stored   : momentum of each wheel, (n,) [N m s]
    dynamics : the equation of rotation
    """

    resolved: ResolvedScene
    attitude: ca.SX
    omega: ca.SX
    u: ca.SX
    parts: Mapping[str, ca.SX]
    inertia: ca.SX
    wheels: WheelAxes | None
    stored: ca.SX
    dynamics: Dynamics

    @cached_property
    def motion(self) -> InstantMotion:
        """How the body moves at the instant."""
        state = ca.vertcat(self.attitude, self.omega, self.stored)
        alpha = self.dynamics.state_rate(state)[4:7]
        linear = net_force(self.resolved, self.parts, self.u) / self.parts["mass"]
        return InstantMotion(self.omega, alpha, linear, self._tide, self._spun)

    @property
    def _tide(self) -> Tide | None:
        field = self.dynamics.field
        if field is None:
            return None
        place = field.start[:3]
        return Tide(strength(field.mu, place) / 3.0, unit(to_body(self.attitude, place)))

    @property
    def _spun(self) -> SpunBeside | None:
        spun = self.dynamics.wheels
        return None if spun is None else SpunBeside(spun.axes.inertias, spun.motors, self.stored)

    @cached_property
    def turned(self) -> ca.SX:
        """(J - A) omega, (3,) [N m s], body axes: the angular momentum without moving parts and wheels."""
        return free_inertia(self.inertia, self.wheels) @ self.omega


def _momentum(known: Known) -> ca.SX:
    """Returns (J - A) omega + h + sum of h_w b_w, (3,) [N m s], inertial axes."""
    turned, parts = known.turned, known.parts
    momentum = turned + parts["momentum"][:3] if "momentum" in parts else turned
    if known.wheels is not None:
        momentum += known.wheels.axes @ known.stored
    return to_inertial(known.attitude, momentum)


def _energy(known: Known) -> ca.SX:
    """Returns (J - A) omega . omega/2 + omega . h, what parts have that move, and wheels, [J]."""
    energy = 0.5 * ca.dot(known.omega, known.turned) + known.parts["moving"]
    if "momentum" in known.parts:
        energy += ca.dot(known.omega, known.parts["momentum"][:3])
    return (
        energy if known.wheels is None else energy + wheel_energy(known.resolved, known.wheels, known.stored)
    )


EXPRESSIONS: dict[str, Callable[[Known], ca.SX]] = {
    "mass": lambda known: known.parts["mass"],
    "barycentre": lambda known: known.parts["barycentre"],
    "pmi": lambda known: known.parts["pmi"],
    "inertia": lambda known: ca.vec(known.inertia),
    "angular_velocity": lambda known: known.omega,
    "attitude": lambda known: known.attitude,
    "kinetic_energy": lambda known: 0.5 * ca.dot(known.omega, known.turned),
    "total_kinetic_energy": _energy,
    "angular_momentum": _momentum,
    "principal_moments": lambda known: known.parts["principal"][:3],
    "principal_axes": lambda known: known.parts["principal"][3:],
    "error_estimate": lambda known: known.parts["error_estimate"],
    "error_bound": lambda known: known.parts["error_bound"],
    "barycentre_velocity": lambda known: known.parts.get("velocity", ca.SX.zeros(3)),
    "barycentre_jump": lambda known: ca.SX.zeros(3),
    "barycentre_velocity_jump": lambda known: ca.SX.zeros(3),
    "net_force": lambda known: net_force(known.resolved, known.parts, known.u),
}
"""By name of an output of the whole, its expression; `composite` has those of vessels, wheels, points, docks.

`scene.outputs` says units and axes. To jumps, and to outputs of vessels that leave, the FMU adds what
`rotation.hand_over` gives.
"""


def outputs_of(
    resolved: ResolvedScene, x: ca.SX, u: ca.SX, parts: Mapping[str, ca.SX], dynamics: Dynamics
) -> ca.SX:
    """Returns the scene's outputs in its order, y, (n,).

    x        : attitude q_inertial_body, angular velocity [rad/s], body axes, and momenta of wheels [N m s]
    u        : the inputs that torques follow from, (m,)
    parts    : see `Known`
    dynamics : the equation of rotation, in terms of `u` and `parts`
    The attitude is brought to unit length here: as a state it keeps its length only as accurately as it is
    integrated.
    """
    attitude, omega, stored, wheels = unit(x[:4]), x[4:7], x[7:], axes_of(resolved, parts)
    inertia = from_upper_triangle(parts["inertia"])
    known = Known(resolved, attitude, omega, u, parts, inertia, wheels, stored, dynamics)
    of_owners = {} if wheels is None else wheel_outputs(resolved, wheels, omega, stored)
    for name in resolved.vessels_shown:
        held = momentum_of_vessel(resolved.scene, wheels, name, stored)
        pieces = vessel_pieces(resolved, name, parts)
        of_owners |= vessel_outputs(name, pieces, attitude, omega, held)
    for name in resolved.points_shown:
        of_owners |= point_outputs(name, parts[f".{name}"], known.motion)
    for name in resolved.docks_shown:
        of_owners |= load_outputs(resolved, name, parts[f".{name}"], u, known.motion)
    shown = (
        of_owners[group] if group in of_owners else EXPRESSIONS[group](known)
        for group in resolved.scene.outputs.names
    )
    return ca.densify(ca.vertcat(*shown))
