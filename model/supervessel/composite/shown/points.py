"""Points of vessels, in CasADi symbols: where they are, how they move, what an accelerometer there reads.

Root axes have the directions of body axes.
Source: [EQ] What docks carry, and points, eqs. (19) and (20).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from supervessel.composite.bodies import Lookup, placed_vessels
from supervessel.composite.inertia import Body
from supervessel.composite.poses import constant, from_anchor
from supervessel.composite.resolved import ResolvedScene
from supervessel.layout import slices_of
from supervessel.scene.inputs import vessel_of


@dataclass(frozen=True)
class Tide:
    """What gravity has in one place of a body beside what it has at the barycentre, to first order.

    strength  : k = mu/|r|^3 [1/s2]
    direction : r^ = r/|r|, (3,), body axes, r the barycentre from the attracting centre
    """

    strength: ca.SX
    direction: ca.SX

    def acceleration(self, place: ca.SX) -> ca.SX:
        """Returns k (3 r^ r^ . rho - rho), (3,) [m/s2]; place : rho, (3,) [m], from the barycentre."""
        return self.strength * (3.0 * ca.dot(self.direction, place) * self.direction - place)

    def moment(self, inertia: ca.SX) -> ca.SX:
        """Returns 3 k r^ x J r^, (3,) [N m]: what the part of the pull that turns with the arm sums up to.

        inertia : J about the point that arms are taken from, (3, 3) [kg m2]
        """
        return 3.0 * self.strength * ca.cross(self.direction, inertia @ self.direction)


@dataclass(frozen=True)
class SpunBeside:
    """What turns in vessels beside them: of each wheel of the scene, in its order.

    inertias : I_w [kg m2]
    motors   : torque of its motor, (n,) [N m]
    momenta  : h_w, (n,) [N m s]
    """

    inertias: Sequence[float]
    motors: ca.SX
    momenta: ca.SX


@dataclass(frozen=True)
class InstantMotion:
    """How a body moves at an instant, all in body axes.

    omega  : angular velocity, (3,) [rad/s]
    alpha  : its rate, (3,) [rad/s2]
    linear : A = F/M, acceleration of the barycentre but for gravity's, (3,) [m/s2]
    tide   : None where there is no gravity
    spun   : None where there are no wheels
    """

    omega: ca.SX
    alpha: ca.SX
    linear: ca.SX
    tide: Tide | None
    spun: SpunBeside | None

    def around(self, arm: ca.SX) -> ca.SX:
        """Returns alpha x d + omega x (omega x d), (3,) [m/s2], the acceleration of an end of an arm relative
        to its other one; arm : d, (3,) [m]."""
        return ca.cross(self.alpha, arm) + ca.cross(self.omega, ca.cross(self.omega, arm))

    def felt_around(self, arm: ca.SX) -> ca.SX:
        """Returns `around` less what gravity has at one end of the arm beside the other, (3,) [m/s2]."""
        return self.around(arm) if self.tide is None else self.around(arm) - self.tide.acceleration(arm)


SIZES = {"held": 1, "place": 3, "velocity": 3}
"""Sizes of the elements of a point's part of c; all are zero while its vessel is not docked.

held     : 1 or 0
place    : from the barycentre [m], body axes
velocity : relative to body axes and to the barycentre's own motion in them [m/s], body axes
"""


def point_parts(resolved: ResolvedScene, lookup: Lookup, whole: Body) -> dict[str, ca.SX]:
    """Returns the part of c, (7,), of each point that outputs are about, by its name after a dot.

    whole : the composite as one body
    """
    names = resolved.points_shown
    if not names:
        return {}
    where = placed_vessels(resolved, lookup, {vessel_of(name) for name in names})
    parts = {}
    for name in names:
        pose, attached = where[vessel_of(name)]
        position = from_anchor(resolved.scene, vessel_of(name), resolved.scene.point(name).position)
        arm, velocity = pose.rotation @ constant(position), ca.SX.zeros(3)
        if pose.velocity is not None and pose.rate is not None:
            velocity = pose.velocity + ca.cross(pose.rate, arm)
        if whole.velocity is not None:
            velocity = velocity - whole.velocity
        part = ca.vertcat(1.0, pose.origin + arm - whole.centre, velocity)
        parts[f".{name}"] = part if attached is None else attached * part
    return parts


def point_outputs(name: str, part: ca.SX, motion: InstantMotion) -> dict[str, ca.SX]:
    """Returns the outputs of a point by name; `scene.outputs` says what they are, with units and axes.

    part : the point's part of c, (7,), in the layout of SIZES
    """
    held, place, velocity = (part[where] for where in slices_of(SIZES).values())
    return {
        f"{name}.position": place,
        f"{name}.velocity": velocity + ca.cross(motion.omega, place),
        f"{name}.acceleration": motion.around(place),
        f"{name}.specific_force": held * motion.linear + motion.felt_around(place),
    }
