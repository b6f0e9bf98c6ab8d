"""Single vessels of the composite in CasADi symbols: what acts on them, and their outputs.

Root axes are the root vessel's; body axes have the same directions, with the origin at the barycentre.
"""

from collections.abc import Callable, Mapping, Set
from dataclasses import dataclass

import casadi as ca
import numpy as np

from supervessel.composite.bodies import Lookup, Placed, placed_vessels, vessel_body
from supervessel.composite.inertia import Body, from_upper_triangle, offset_tensor, symmetric, upper_triangle
from supervessel.composite.poses import Pose, constant, from_anchor
from supervessel.composite.resolved import ResolvedScene
from supervessel.composite.wheels import free_inertia, wheels_on, without_locked
from supervessel.layout import slices_of
from supervessel.rotation.attitude import quaternion, to_inertial
from supervessel.scene.inputs import FLOW, FORCE, TORQUE, WHEEL_TORQUE, InputKind, vessel_of
from supervessel.scene.schema import Scene
from supervessel.scene.variables import InputVariable


@dataclass(frozen=True)
class Acting:
    """Matrices that take the three components of a force or torque on a vessel, in its axes, to body axes.

    moment : (3, 3), to the torque about the barycentre: [rho x] R_body_vessel of a force at rho from the
             barycentre, R_body_vessel of a torque
    force  : (3, 3), to the force: R_body_vessel; None of a torque
    Both are zero while the vessel is not docked.
    """

    moment: ca.SX
    force: ca.SX | None = None

    @property
    def matrices(self) -> tuple[ca.SX, ...]:
        """Those that there are."""
        return (self.moment,) if self.force is None else (self.moment, self.force)


def _at_point(scene: Scene, name: str, where: Placed, centre: ca.SX) -> Acting:
    """Returns the matrices of a force at the point called "vessel.point", for the moment about `centre`."""
    pose, attached = where[vessel_of(name)]
    position = from_anchor(scene, vessel_of(name), scene.point(name).position)
    arm = pose.origin + pose.rotation @ constant(position) - centre
    turned = pose.rotation if attached is None else attached * pose.rotation
    return Acting(ca.skew(arm) @ turned, turned)


def _on_vessel(scene: Scene, name: str, where: Placed, centre: ca.SX) -> Acting:
    """Returns the matrices of a torque on the vessel called `name`."""
    pose, attached = where[name]
    return Acting(pose.rotation if attached is None else attached * pose.rotation)


Equation = Callable[[Scene, str, Placed, ca.SX], Acting]

ACTIONS: dict[str, Equation] = {
    "force": _at_point,
    "vessel_torque": _on_vessel,
}
"""By key of `[inputs]`: scene, owner, poses of vessels, barycentre -> the matrices of an input that acts."""


def equation_of(kind: InputKind) -> Equation | None:
    """Returns the equation of an input that acts; None: it is itself a torque about the barycentre.

    That is a kind of the whole assembly, in N m and body axes. Raises KeyError for another without an
    equation.
    """
    if kind.key not in ACTIONS and (kind.owner or kind.unit != TORQUE.unit):
        raise KeyError(f"composite.actions.ACTIONS has no equation for inputs.{kind.key} [{kind.unit}]")
    return ACTIONS.get(kind.key)


def action_parts(resolved: ResolvedScene, lookup: Lookup, centre: ca.SX) -> dict[str, ca.SX]:
    """Returns the parts of c by which forces and torques on vessels act.

    centre : barycentre, (3,) [m], root axes, from the root's anchor

    "moment" : (9 n,), the matrices `Acting.moment`, column by column, of each force, then of each torque on a
               vessel
    "force"  : (9 m,), the matrices `Acting.force`, column by column, of each force
    """
    everywhere = resolved.scene.vessels.keys()
    owners = {vessel_of(variable.owner) for _, variable in _on_vessels(resolved, everywhere)}
    if not owners:
        return {}
    where = placed_vessels(resolved, lookup, owners)
    found = [one for _, one in acting_about(resolved, where, centre, everywhere)]
    parts = {"moment": ca.vertcat(*(ca.vec(one.moment) for one in found))}
    forces = [ca.vec(one.force) for one in found if one.force is not None]
    if resolved.shows_forces and forces:
        parts["force"] = ca.vertcat(*forces)
    return parts


def acting_on(resolved: ResolvedScene, vessels: Set[str]) -> list[tuple[int, bool]]:
    """Returns the place in u of each force or torque on one of these vessels, and whether it is a force."""
    return [(place, variable.kind is FORCE) for place, variable in _on_vessels(resolved, vessels)]


def acting_about(
    resolved: ResolvedScene, where: Placed, about: ca.SX, vessels: Set[str]
) -> list[tuple[str, Acting]]:
    """Returns vessel and matrices of each force or torque on one of these vessels, in the order of
    `acting_on`.

    where : the poses of the vessels
    about : the point that moments are taken about, (3,) [m], root axes, from the root's anchor
    """
    found = []
    for _, variable in _on_vessels(resolved, vessels):
        equation = equation_of(variable.kind)
        assert equation is not None
        acting = equation(resolved.scene, variable.owner, where, about)
        found.append((vessel_of(variable.owner), acting))
    return found


def _on_vessels(resolved: ResolvedScene, vessels: Set[str]) -> list[tuple[int, InputVariable]]:
    """Returns what acts on some vessels, as `_acting` does; a torque about the barycentre acts on the root
    and is none."""
    return [
        (place, variable)
        for place, variable in _acting(resolved)
        if vessel_of(variable.owner) in vessels and equation_of(variable.kind) is not None
    ]


def _acting(resolved: ResolvedScene) -> list[tuple[int, InputVariable]]:
    """Returns of each force or torque on the body its place in u and the variable of its first element.

    Motors of wheels are none, see `composite.wheels.motor_torques`, nor are flows, see `jet_parts`.
    """
    return [
        (place, variable)
        for place, variable in enumerate(resolved.acting)
        if variable.element == 0 and variable.kind not in (WHEEL_TORQUE, FLOW)
    ]


def torque_about_barycentre(resolved: ResolvedScene, parts: Mapping[str, ca.SX], u: ca.SX) -> ca.SX:
    """Returns the sum M of all torques about the barycentre, those of forces included, (3,) [N m], body axes.

    Without the torques of motors, which act between parts of the body.

    parts : the parts of c by name, see `action_parts`
    u     : the inputs that act, (m,) [N m, N]
    """
    total, taken = ca.SX.zeros(3), 0
    for place, variable in _acting(resolved):
        own = u[place : place + 3]
        if equation_of(variable.kind) is not None:
            own = _matrix(parts["moment"], taken) @ own
            taken += 1
        total = total + own
    return total


def torque_on_root(resolved: ResolvedScene, u: ca.SX) -> ca.SX:
    """Returns the torque about the barycentre that is an input itself, (3,) [N m], body axes.

    u : the inputs that act. It counts as a torque on the root vessel.
    """
    places = [place for place, variable in _acting(resolved) if equation_of(variable.kind) is None]
    return sum((u[place : place + 3] for place in places), ca.SX.zeros(3))


def net_force(resolved: ResolvedScene, parts: Mapping[str, ca.SX], u: ca.SX) -> ca.SX:
    """Returns the sum of all forces, (3,) [N], body axes; parts, u : as in `torque_about_barycentre`."""
    total = ca.SX.zeros(3)
    places = [place for place, variable in _acting(resolved) if variable.kind is FORCE]
    for number, place in enumerate(places):
        total = total + _matrix(parts["force"], number) @ u[place : place + 3]
    return total


def _matrix(numbers: ca.SX, number: int) -> ca.SX:
    """Returns one of the matrices, (3, 3), that `numbers` holds column by column, counted from 0."""
    return ca.reshape(numbers[9 * number : 9 * number + 9], 3, 3)


def jet_parts(resolved: ResolvedScene, lookup: Lookup, centre: ca.SX) -> dict[str, ca.SX]:
    """Returns the part of c by which flows of propellant act, none in a scene without them.

    centre : barycentre, (3,) [m], root axes, from the root's anchor

    Propellant that leaves vessel V at the rate f [kg/s] through a nozzle at r from the barycentre acts on the
    body as the torque -f K omega, K = off(r) - off(rho) - S: rho is V's centre of mass from the barycentre, S
    its tensor over its mass about that, off(d) = |d|^2 E - d d^T; all in body axes.
    Source: [EQ] Jet damping, eq. (28).

    "jets" : (6 n,) [m2], the matrix K of one flow after the other, xx, yy, zz, xy, xz, yz; zeros while docks
             do not hold its vessel to the root
    """
    flows = resolved.scene.inputs.flow
    if not flows:
        return {}
    where = placed_vessels(resolved, lookup, {vessel_of(name) for name in flows})
    return {"jets": ca.vertcat(*(_jet(resolved, lookup, name, where, centre) for name in flows))}


def _jet(resolved: ResolvedScene, lookup: Lookup, name: str, where: Placed, centre: ca.SX) -> ca.SX:
    """Returns K, (6,) [m2], of the flow through the point called "vessel.point".

    where, centre : see `jet_parts`
    """
    scene, vessel = resolved.scene, vessel_of(name)
    pose, attached = where[vessel]
    specific = vessel_body(scene, vessel, lookup, pose, ca.SX(1.0))
    nozzle = from_anchor(scene, vessel, scene.point(name).position)
    of_vessel = from_anchor(scene, vessel, scene.vessels[vessel].centre_of_mass)
    own = upper_triangle(_lever(specific, pose.rotation @ constant(nozzle - of_vessel), centre))
    return own if attached is None else attached * own


def _lever(specific: Body, outward: ca.SX, centre: ca.SX) -> ca.SX:
    """Returns K, (3, 3) [m2].

    specific : the vessel with a mass of 1 kg, root axes
    outward  : e, the nozzle from the vessel's centre of mass, (3,) [m], root axes
    centre   : barycentre, (3,) [m], root axes
    With s = rho + r, off(r) - off(rho) is e . s E - (e s^T + s e^T)/2: no squares are subtracted, of arms
    that are long where the vessel is far from the barycentre.
    """
    e = outward
    s = 2.0 * (specific.centre - centre) + e

    def element(i: int, j: int) -> ca.SX:
        if i != j:
            return -0.5 * (e[i] * s[j] + s[i] * e[j]) - specific.inertia[i, j]
        one, other = (k for k in range(3) if k != i)
        return (e[one] * s[one] + e[other] * s[other]) - specific.inertia[i, i]

    return symmetric(element)


def jet_damping(resolved: ResolvedScene, parts: Mapping[str, ca.SX], u: ca.SX) -> ca.SX | None:
    """Returns D, (3, 3) [N m s], body axes, whose torque is -D omega; None in a scene without flows.

    parts : the parts of c by name, see `jet_parts`
    u     : the inputs that act, in the order of `ResolvedScene.acting`
    """
    places = [place for place, variable in enumerate(resolved.acting) if variable.kind is FLOW]
    if not places:
        return None
    total = ca.SX.zeros(6)
    for number, place in enumerate(places):
        total = total + u[place] * parts["jets"][6 * number : 6 * number + 6]
    return from_upper_triangle(total)


SIZES: Mapping[str, int] = {
    "docked": 1,
    "origin": 3,
    "centre": 3,
    "rotation": 9,
    "rate": 3,
    "inertia": 6,
    "spin": 3,
}
"""Sizes of the elements of a vessel's part of c; all are zero while the vessel is not docked.

docked   : 1 or 0
origin   : origin of the vessel axes [m], body axes
centre   : the vessel's centre of mass [m], body axes
rotation : R_body_vessel, column by column
rate     : angular velocity of the vessel relative to body axes [rad/s], body axes
inertia  : of the vessel, less A of its wheels, about the barycentre of the composite [kg m2], body axes, xx,
           yy, zz, xy, xz, yz
spin     : angular momentum of the vessel's motion relative to body axes, about the barycentre [N m s], body
           axes, its wheels' along their axes left out
"""

SIZES_IN_MOTION: Mapping[str, int] = {**SIZES, "velocity": 3}
"""The same of a vessel whose `velocity` is an output.

velocity : of the vessel's centre of mass relative to the barycentre and body axes [m/s], body axes
"""

SIZES_LEAVING: Mapping[str, int] = {**SIZES_IN_MOTION, "mass": 1}
"""The same of a vessel that may leave, see `ResolvedScene.leaving`; mass : of the vessel [kg]."""


def sizes_of(resolved: ResolvedScene, name: str) -> Mapping[str, int]:
    """Returns the sizes of the elements of a vessel's part of c, in their order."""
    if name in resolved.leaving:
        return SIZES_LEAVING
    return SIZES_IN_MOTION if f"{name}.velocity" in resolved.scene.outputs.names else SIZES


def vessel_parts(resolved: ResolvedScene, lookup: Lookup, whole: Body) -> dict[str, ca.SX]:
    """Returns the part of c of each vessel that outputs are about, by the vessel's name after a dot.

    whole : the composite as one body
    `sizes_of` has the layout of a part.
    """
    if not resolved.vessels_shown:
        return {}
    where = placed_vessels(resolved, lookup, set(resolved.vessels_shown))
    parts = {}
    for name in resolved.vessels_shown:
        pose, attached = where[name]
        body = vessel_body(resolved.scene, name, lookup, Pose(ca.SX.eye(3), ca.SX.zeros(3)))
        origin = constant(from_anchor(resolved.scene, name, np.zeros(3)))
        seen = body.seen_from(pose.rotation, pose.origin, pose.velocity, pose.rate)
        pieces = _vessel_part(_free_of_wheels(resolved.scene, name, seen, pose), pose, origin, whole)
        part = ca.vertcat(*(pieces[key] for key in sizes_of(resolved, name)))
        parts[f".{name}"] = part if attached is None else attached * part
    return parts


def vessel_pieces(resolved: ResolvedScene, name: str, parts: Mapping[str, ca.SX]) -> dict[str, ca.SX]:
    """Returns the elements of a vessel's part of c by name.

    parts : the parts of c by name
    """
    part = parts[f".{name}"]
    return {key: part[place] for key, place in slices_of(sizes_of(resolved, name)).items()}


def _free_of_wheels(scene: Scene, name: str, seen: Body, pose: Pose) -> Body:
    """Returns a vessel, in root axes, with J - A for its tensor J."""
    wheels = wheels_on(scene, name, pose)
    body = without_locked(seen, wheels)
    return Body(body.mass, body.centre, free_inertia(body.inertia, wheels), body.velocity, body.spin)


def _vessel_part(seen: Body, pose: Pose, origin: ca.SX, whole: Body) -> dict[str, ca.SX]:
    """Returns the elements of the part of c of a docked vessel, by their names in SIZES_LEAVING.

    seen   : the vessel in the root's axes
    pose   : of the vessel in the root's axes, its origin the anchor
    origin : (3,) [m], of its axes, from its anchor
    whole  : the composite as one body
    """
    rho = seen.centre - whole.centre
    inertia = seen.inertia + seen.mass * offset_tensor(rho)
    spin, rate, velocity = ca.SX.zeros(3), ca.SX.zeros(3), ca.SX.zeros(3)
    if whole.velocity is not None:
        velocity = (velocity if seen.velocity is None else seen.velocity) - whole.velocity
        spin = seen.mass * ca.cross(rho, velocity)
        spin = spin if seen.spin is None else spin + seen.spin
        rate = rate if pose.rate is None else pose.rate
    return {
        "docked": ca.SX(1.0),
        "origin": pose.origin + pose.rotation @ origin - whole.centre,
        "centre": rho,
        "rotation": ca.vec(pose.rotation),
        "rate": rate,
        "inertia": upper_triangle(inertia),
        "spin": spin,
        "velocity": velocity,
        "mass": seen.mass,
    }


def vessel_outputs(
    name: str, pieces: Mapping[str, ca.SX], attitude: ca.SX, omega: ca.SX, stored: ca.SX | None
) -> dict[str, ca.SX]:
    """Returns the outputs of a vessel by name; `scene.outputs` says what they are, with units and axes.

    pieces   : the elements of the vessel's part of c by name, see `vessel_pieces`
    attitude : q_inertial_body, (4,), of unit length
    omega    : angular velocity of the body, (3,) [rad/s], body axes
    stored   : momentum of the vessel's wheels, (3,) [N m s], body axes; None: it has none
    """
    R_body_vessel = ca.reshape(pieces["rotation"], 3, 3)
    share = from_upper_triangle(pieces["inertia"]) @ omega + pieces["spin"]
    share = share if stored is None else share + stored
    if pieces["docked"].is_constant():
        q_body_vessel = quaternion(R_body_vessel)
    else:
        is_docked = pieces["docked"] > 0.5
        R_or_identity = ca.if_else(is_docked, R_body_vessel, ca.SX.eye(3))
        q_body_vessel = ca.if_else(is_docked, quaternion(R_or_identity), 0.0)
    outputs = {
        f"{name}.origin": pieces["origin"],
        f"{name}.centre_of_mass": pieces["centre"],
        f"{name}.attitude": q_body_vessel,
        f"{name}.angular_velocity": R_body_vessel.T @ (omega + pieces["rate"]),
        f"{name}.angular_momentum": to_inertial(attitude, share),
    }
    if "velocity" in pieces:
        velocity = ca.cross(omega, pieces["centre"]) + pieces["velocity"]
        outputs[f"{name}.velocity"] = to_inertial(attitude, velocity)
    return outputs
