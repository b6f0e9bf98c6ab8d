"""What docks carry, in CasADi symbols: the load that a named dock's second port receives from its first.

For a tree of docks the load follows from the motion of the vessels beyond the dock, seen from the root, and
from the forces and torques on them. All is reckoned about the port, so that no arm is longer than what hangs
on the dock. Root axes have the directions of body axes.
Source: [EQ] What docks carry, and points, eqs. (21) and (22).
"""

from collections.abc import Set
from dataclasses import dataclass

import casadi as ca

from supervessel.composite.actions import acting_about, acting_on
from supervessel.composite.bodies import (
    Lookup,
    Placed,
    group_bodies,
    placed_groups,
    placed_vessels,
    port_place,
    way_holds,
)
from supervessel.composite.inertia import Body, from_upper_triangle, offset_tensor, upper_triangle
from supervessel.composite.resolved import ResolvedScene
from supervessel.composite.shown.points import InstantMotion
from supervessel.composite.wheels import WheelAxes
from supervessel.layout import slices_of
from supervessel.scene.inputs import vessel_of

SIZES = {"side": 1, "mass": 1, "lever": 3, "inertia": 6, "port": 3, "axes": 9}
"""Sizes of the first elements of a dock's part of c; all but `port` and `axes` are zero while it is open.

side    : 1 if the vessels beyond the dock, seen from the root, hang on its second port, -1 if on its first
mass    : of the vessels beyond [kg]
lever   : sum of m_j d_j over them [kg m], d_j the centre of mass of vessel j from the port, body axes
inertia : their tensor about the port [kg m2], body axes, xx, yy, zz, xy, xz, yz
port    : the port from the barycentre [m], body axes
axes    : R_body_vessel of the first port's vessel, column by column

Behind them, all zero while their vessel is not beyond: of each force or torque on a vessel the matrices of
`Acting` about the port, column by column; of each wheel its axis b_w, (3,).
"""


def load_parts(
    resolved: ResolvedScene, lookup: Lookup, centre: ca.SX, wheels: WheelAxes | None
) -> dict[str, ca.SX]:
    """Returns the part of c of each dock that outputs are about, by the dock's name after a dot.

    centre : barycentre, (3,) [m], root axes, from the root's anchor
    wheels : of all vessels
    """
    if not resolved.docks_shown:
        return {}
    where = placed_vessels(resolved, lookup, set(resolved.scene.vessels))
    return {
        f".{name}": _Beyond(resolved, lookup, where, name).part(centre, wheels)
        for name in resolved.docks_shown
    }


@dataclass(frozen=True)
class _Beyond:
    """The vessels beyond a dock, seen from the root.

    where : the poses of all vessels
    name  : of the dock
    """

    resolved: ResolvedScene
    lookup: Lookup
    where: Placed
    name: str

    def part(self, centre: ca.SX, wheels: WheelAxes | None) -> ca.SX:
        """Returns the part of c of the dock, in the layout of SIZES; centre, wheels : as of `load_parts`."""
        scene, vessels = self.resolved.scene, self.resolved.beyond(self.name)
        first, second = scene.dock(self.name).ports
        port = port_place(scene, first, self.where, self.lookup)
        side = self.share(vessel_of(second), True) - self.share(vessel_of(first), False)
        axes = ca.vec(self.where[vessel_of(first)][0].rotation)
        acting = (
            self.share(vessel) * ca.vec(matrix)
            for vessel, one in acting_about(self.resolved, self.where, port, vessels)
            for matrix in one.matrices
        )
        spun = (
            self.share(vessel_of(scene.wheels[w])) * wheels.axes[:, w]
            for w in _wheels_on(self.resolved, vessels)
            if wheels is not None
        )
        return ca.vertcat(side, *self._shape(port), port - centre, axes, *acting, *spun)

    def share(self, vessel: str, forwards: bool | None = None) -> ca.SX:
        """Returns 1 while a vessel is beyond the dock, else 0.

        forwards : the direction of the ways that count, see `Crossing`; None: both
        """
        flags = (
            way_holds(crossing.way, self.resolved, self.lookup)
            for crossing in self.resolved.crossings[self.name]
            if vessel in crossing.vessels and forwards in (None, crossing.forwards)
        )
        return sum((ca.SX(1.0) if flag is None else flag for flag in flags), ca.SX(0.0))

    def _shape(self, port: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Returns mass, lever and inertia of SIZES; port : (3,) [m], root axes, from the root's anchor."""
        mass, lever, inertia = ca.SX(0.0), ca.SX.zeros(3), ca.SX.zeros(3, 3)
        for body in self._bodies():
            arm = body.centre - port
            mass += body.mass
            lever += body.mass * arm
            inertia += body.inertia + body.mass * offset_tensor(arm)
        return mass, lever, upper_triangle(inertia)

    def _bodies(self) -> list[Body]:
        """Returns the vessels as bodies in root axes, without mass while they are not beyond."""
        placed, found = placed_groups(self.resolved, self.lookup), []
        for crossing in self.resolved.crossings[self.name]:
            number = crossing.way.group
            group = self.resolved.part_of_group(number, crossing.vessels)
            bodies = group_bodies(self.resolved, number, group, placed[number], self.lookup)
            flag = way_holds(crossing.way, self.resolved, self.lookup)
            found += bodies if flag is None else [body.times(flag) for body in bodies]
        return found


def _wheels_on(resolved: ResolvedScene, vessels: Set[str]) -> list[int]:
    """Returns the numbers of the wheels on some vessels."""
    return [w for w, name in enumerate(resolved.scene.wheels) if vessel_of(name) in vessels]


def load_outputs(
    resolved: ResolvedScene, name: str, part: ca.SX, u: ca.SX, motion: InstantMotion
) -> dict[str, ca.SX]:
    """Returns the outputs of a dock by name; `scene.outputs` says what they are, with units and axes.

    part : the dock's part of c, in the layout of SIZES
    u    : the inputs that torques follow from, (m,)
    With s the specific force at the port and d the arm from there, f = m s + B g - sum F and t = g x s +
    J' alpha + omega x J' omega - 3 k r^ x J r^ - sum (M + d x F) + sum (u b + omega x h_w b): g is the lever,
    B d is `InstantMotion.felt_around`, and J' is J less what wheels have about their axes.
    """
    pieces = {key: part[place] for key, place in slices_of(SIZES).items()}
    J, lever = from_upper_triangle(pieces["inertia"]), pieces["lever"]
    felt = motion.linear + motion.felt_around(pieces["port"])
    force = pieces["mass"] * felt + motion.felt_around(lever)
    moment = ca.cross(lever, felt)
    if motion.tide is not None:
        moment -= motion.tide.moment(J)
    rest, vessels = part[sum(SIZES.values()) :], resolved.beyond(name)
    for place, is_force in acting_on(resolved, vessels):
        own = u[place : place + 3]
        moment -= ca.reshape(rest[:9], 3, 3) @ own
        if is_force:
            force -= ca.reshape(rest[9:18], 3, 3) @ own
        rest = rest[18 if is_force else 9 :]
    for number, w in enumerate(_wheels_on(resolved, vessels)):
        axis, spun = rest[3 * number : 3 * number + 3], motion.spun
        assert spun is not None
        J -= spun.inertias[w] * (axis @ axis.T)
        moment += spun.motors[w] * axis + spun.momenta[w] * ca.cross(motion.omega, axis)
    moment += J @ motion.alpha + ca.cross(motion.omega, J @ motion.omega)
    to_first = pieces["side"] * ca.reshape(pieces["axes"], 3, 3).T
    return {f"{name}.force": to_first @ force, f"{name}.moment": to_first @ moment}
