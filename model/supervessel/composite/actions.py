"""What single vessels do in the whole, in CasADi symbols: where forces act, and outputs of a vessel."""

from collections.abc import Set

import casadi as ca

from supervessel.composite.bodies import Lookup, placed_groups, vessel_body
from supervessel.composite.inertia import Body, from_upper_triangle, offset_tensor, upper_triangle
from supervessel.composite.poses import Pose, constant
from supervessel.rotation.attitude import quaternion, to_inertial
from supervessel.scene.schema import Scene


def action_parts(scene: Scene, lookup: Lookup, centre: ca.SX) -> dict[str, ca.SX]:
    """Returns the parts of c by which forces and torques on vessels act.

    centre : barycentre, (3,) [m], root axes

    "moment" : (9 n,), n matrices (3, 3) column by column, one for each force, then for each torque on a
               vessel: what each makes of its three components as torque about the barycentre, body axes
    "force"  : (9 m,), likewise for each force its components in body axes
    """
    inputs = scene.inputs
    if not (inputs.force or inputs.vessel_torque):
        return {}
    where = _placed(
        scene, lookup, {*(name.partition(".")[0] for name in inputs.force), *inputs.vessel_torque}
    )
    moments, forces = [], []
    for name in inputs.force:
        pose, attached = where[name.partition(".")[0]]
        arm = pose.origin + pose.rotation @ constant(scene.point(name).position) - centre
        turned = pose.rotation if attached is None else attached * pose.rotation
        moments.append(ca.skew(arm) @ turned)
        forces.append(turned)
    for name in inputs.vessel_torque:
        pose, attached = where[name]
        moments.append(pose.rotation if attached is None else attached * pose.rotation)
    parts = {"moment": ca.vertcat(*map(ca.vec, moments))}
    if "net_force" in scene.outputs.names and forces:
        parts["force"] = ca.vertcat(*map(ca.vec, forces))
    return parts


def torque_about_barycentre(scene: Scene, parts: dict[str, ca.SX], u: ca.SX) -> ca.SX:
    """Returns the torque of everything that acts, (3,) [N m], body axes.

    u : the inputs that act: torque if there is one, forces, torques on vessels
    """
    first = 3 if scene.inputs.torque else 0
    total = u[:3] if first else ca.SX.zeros(3)
    return _sum(total, parts.get("moment"), u[first:])


def net_force(scene: Scene, parts: dict[str, ca.SX], u: ca.SX) -> ca.SX:
    """Returns the sum of the forces, (3,) [N], body axes."""
    first = 3 if scene.inputs.torque else 0
    return _sum(ca.SX.zeros(3), parts.get("force"), u[first:])


def _sum(total: ca.SX, matrices: ca.SX | None, vectors: ca.SX) -> ca.SX:
    """Returns the total and the products of matrices, (9 n,), with as many vectors, (3 n,) or more."""
    if matrices is None:
        return total
    for i in range(matrices.numel() // 9):
        total = total + ca.reshape(matrices[9 * i : 9 * i + 9], 3, 3) @ vectors[3 * i : 3 * i + 3]
    return total


def vessels_shown(scene: Scene) -> list[str]:
    """Returns the vessels that outputs are about, in the scene's order."""
    shown = {name.partition(".")[0] for name in scene.outputs.names if "." in name}
    return [vessel for vessel in scene.vessels if vessel in shown]


SIZES = {"docked": 1, "origin": 3, "centre": 3, "rotation": 9, "rate": 3, "inertia": 6, "spin": 3}
"""Layout of what c holds of a vessel that outputs are about; zero while it is not docked.

docked, 1 or 0; origin, centre of mass [m] from the barycentre; rotation, column by column, into body axes;
rate [rad/s] relative to the body axes, in them; inertia [kg m2] about the barycentre; spin [N m s] about it
of its motion relative to the body axes.
"""


def vessel_parts(scene: Scene, lookup: Lookup, whole: Body) -> dict[str, ca.SX]:
    """Returns the part of c, (28,), named after each vessel that outputs are about, with a dot before it.

    whole : all of it as one body
    """
    if not vessels_shown(scene):
        return {}
    where = _placed(scene, lookup, set(vessels_shown(scene)))
    parts = {}
    for name in vessels_shown(scene):
        pose, attached = where[name]
        body = vessel_body(scene, name, lookup, Pose(ca.SX.eye(3), ca.SX.zeros(3)))
        seen = body.seen_from(pose.rotation, pose.origin, pose.velocity, pose.rate)
        rho = seen.centre - whole.centre
        inertia = seen.inertia + seen.mass * offset_tensor(rho)
        spin, rate = ca.SX.zeros(3), ca.SX.zeros(3)
        if whole.velocity is not None:
            velocity = ca.SX.zeros(3) if seen.velocity is None else seen.velocity
            spin = seen.mass * ca.cross(rho, velocity - whole.velocity)
            spin = spin if seen.spin is None else spin + seen.spin
            rate = rate if pose.rate is None else pose.rate
        part = ca.vertcat(
            1.0,
            pose.origin - whole.centre,
            rho,
            ca.vec(pose.rotation),
            rate,
            upper_triangle(inertia),
            spin,
        )
        parts[f".{name}"] = part if attached is None else attached * part
    return parts


def vessel_outputs(name: str, part: ca.SX, attitude: ca.SX, omega: ca.SX) -> dict[str, ca.SX]:
    """Returns the outputs of a vessel by name.

    part     : what c holds of it, see SIZES
    attitude : of the body, (4,)
    omega    : angular velocity of the body, (3,) [rad/s], body axes
    """
    pieces, start = {}, 0
    for key, size in SIZES.items():
        pieces[key] = part[start : start + size]
        start += size
    rotation = ca.reshape(pieces["rotation"], 3, 3)
    share = from_upper_triangle(pieces["inertia"]) @ omega + pieces["spin"]
    if pieces["docked"].is_constant():
        own_attitude = quaternion(rotation)
    else:
        is_docked = pieces["docked"] > 0.5
        own_attitude = ca.if_else(is_docked, quaternion(ca.if_else(is_docked, rotation, ca.SX.eye(3))), 0.0)
    return {
        f"{name}.origin": pieces["origin"],
        f"{name}.centre_of_mass": pieces["centre"],
        f"{name}.attitude": own_attitude,
        f"{name}.angular_velocity": rotation.T @ (omega + pieces["rate"]),
        f"{name}.angular_momentum": to_inertial(attitude, share),
    }


def _placed(scene: Scene, lookup: Lookup, names: Set[str]) -> dict[str, tuple[Pose, ca.SX | None]]:
    """Returns some vessels' poses in the root's axes, and whether they hang on the root (None: always)."""
    return {
        name: (group.pose_of(name), group.attached)
        for group in placed_groups(scene, lookup)
        for name in group.inside
        if name in names
    }
