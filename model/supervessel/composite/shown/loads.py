"""What docks carry, in CasADi symbols: the load that a named dock's second port receives from its first.

For a tree of docks the load follows from the motion of the vessels on one side of the dock, and from the
forces and torques on them. The side is the lighter one, so that no large terms cancel in a small load. All is
reckoned about the port, so that no arm is longer than what hangs on the dock. Root axes have the directions
of body axes.
Source: [EQ] What docks carry, and points, eqs. (21) and (22).
"""

from collections.abc import Iterable, Sequence, Set
from dataclasses import dataclass

import casadi as ca

from supervessel.composite.actions import acting_about, acting_on, torque_on_root
from supervessel.composite.bodies import (
    Lookup,
    Placed,
    PlacedGroup,
    group_bodies,
    placed_groups,
    placed_vessels,
    port_place,
    way_holds,
)
from supervessel.composite.docks import Way
from supervessel.composite.inertia import Body, from_upper_triangle, offset_tensor, upper_triangle
from supervessel.composite.resolved import ResolvedScene
from supervessel.composite.shown.points import InstantMotion
from supervessel.composite.wheels import WheelAxes
from supervessel.layout import slices_of
from supervessel.scene.inputs import vessel_of

SIZES = {"side": 1, "mass": 1, "lever": 3, "inertia": 6, "port": 3, "axes": 9}
"""Sizes of the first elements of a dock's part of c. Of the vessels on one side, see `ResolvedScene.lighter`:

side    : 1 if they have the dock's second port, -1 if its first; 0 while the dock is open or off the root
mass    : theirs [kg]
lever   : sum of m_j d_j over them [kg m], d_j the centre of mass of vessel j from the port, body axes
inertia : their tensor about the port [kg m2], body axes, xx, yy, zz, xy, xz, yz
port    : the port from the barycentre [m], body axes
axes    : R_body_vessel of the first port's vessel, column by column

Behind them, all zero while their vessel is not on that side: of each force or torque on a vessel the matrices
of `Acting` about the port, column by column; of each wheel its axis b_w, (3,).
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
    placed = placed_groups(resolved, lookup)
    where = placed_vessels(resolved, lookup, set(resolved.scene.vessels))
    return {
        f".{name}": _Weighed(resolved, lookup, placed, where, name).part(centre, wheels)
        for name in resolved.docks_shown
    }


@dataclass(frozen=True)
class _Weighed:
    """The vessels on the lighter side of a dock.

    placed : the rigid groups
    where  : the poses of all vessels
    name   : of the dock
    """

    resolved: ResolvedScene
    lookup: Lookup
    placed: Sequence[PlacedGroup]
    where: Placed
    name: str

    def part(self, centre: ca.SX, wheels: WheelAxes | None) -> ca.SX:
        """Returns the part of c of the dock, in the layout of SIZES; centre, wheels : as of `load_parts`."""
        scene, side = self.resolved.scene, self.resolved.lighter[self.name]
        first, second = scene.dock(self.name).ports
        port = port_place(scene, first, self.where, self.lookup)
        beyond = self._crossed(vessel_of(second), True) - self._crossed(vessel_of(first), False)
        axes = ca.vec(self.where[vessel_of(first)][0].rotation)
        acting = (
            self._share(vessel) * ca.vec(matrix)
            for vessel, one in acting_about(self.resolved, self.where, port, side.vessels)
            for matrix in one.matrices
        )
        spun = (
            self._share(vessel_of(scene.wheels[w])) * wheels.axes[:, w]
            for w in _wheels_on(self.resolved, side.vessels)
            if wheels is not None
        )
        sign = -beyond if side.is_near else beyond
        return ca.vertcat(sign, *self._shape(port), port - centre, axes, *acting, *spun)

    def _crossed(self, vessel: str, forwards: bool) -> ca.SX:
        """Returns 1 while a way leads over the dock, in that direction, to a vessel, else 0."""
        ways = (
            crossing.way
            for crossing in self.resolved.crossings[self.name]
            if vessel in crossing.vessels and crossing.forwards is forwards
        )
        return self._held(ways)

    def _share(self, vessel: str) -> ca.SX:
        """Returns 1 while a vessel is on the side, else 0."""
        pieces = self.resolved.lighter[self.name].pieces
        return self._held(way for way, vessels in pieces if vessel in vessels)

    def _held(self, ways: Iterable[Way]) -> ca.SX:
        """Returns 1 while one of these ways holds its group, else 0."""
        flags = (way_holds(way, self.resolved, self.lookup) for way in ways)
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
        """Returns the vessels as bodies in root axes, without mass while they are not on that side."""
        found = []
        for way, vessels in self.resolved.lighter[self.name].pieces:
            group = self.resolved.part_of_group(way.group, vessels)
            bodies = group_bodies(self.resolved, way.group, group, self.placed[way.group], self.lookup)
            flag = way_holds(way, self.resolved, self.lookup)
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
    rest, vessels = part[sum(SIZES.values()) :], resolved.lighter[name].vessels
    if resolved.lighter[name].is_near:
        moment -= torque_on_root(resolved, u)
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
