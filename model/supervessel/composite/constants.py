"""Constants of a scene as numbers: poses of vessels in their rigid groups, their masses, centres and tensors.

The equations are those of `poses` and `inertia`, each made a CasADi function once and evaluated for all
vessels together. The operations and their order are the same as on symbols that hold constants, and so are
all bits; it takes a small part of the time.
"""

from collections.abc import Mapping, Sequence
from functools import cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from supervessel.composite.docks import Joint, VesselGroup, alone_as_given
from supervessel.composite.inertia import combine_numbers, orbiter_moments, placed_body
from supervessel.composite.poses import Pose, constant, from_anchor, mated_pose, port_axes, scaled
from supervessel.scene.inputs import vessel_of
from supervessel.scene.schema import ORIGIN, Mount, Port, Scene, Vessel

Places = Mapping[str, Pose]
"""Poses of vessels, whose origins are their anchors, constants, in the axes of their group."""


def places(scene: Scene, parts: Sequence[VesselGroup]) -> list[Places]:
    """Returns of each rigid group the poses of its vessels in its axes, by name."""
    steps = iter(_joint_poses(scene, [joint for part in parts for joint in part.joints]))
    found: list[Places] = []
    for part in parts:
        inside = {part.reference: Pose(constant(np.eye(3)), constant(np.zeros(3)))}
        for joint in part.joints:
            inside[joint.child] = inside[joint.parent].then(next(steps))
        found.append(inside)
    return found


def constant_and_varying(scene: Scene, inside: Places) -> tuple[list[str], list[str]]:
    """Returns the names of a group's constant vessels, and of its varying ones, in the order of summation.

    A vessel varies if its mass or its moments are inputs, or its moments differ while it is alone, see
    `docks.alone_as_given`. The heaviest stand first; vessels whose mass is an
    input stand last; vessels whose mass is constant and zero are left out.
    """
    of_mass, of_moments = set(scene.inputs.mass), set(scene.inputs.pmi)
    of_moments |= {scene.root} if alone_as_given(scene) else set()
    known = [name for name in inside if name not in of_mass and scene.vessels[name].mass > 0.0]
    known.sort(key=lambda name: -scene.vessels[name].mass)
    varying = [name for name in known if name in of_moments] + [name for name in inside if name in of_mass]
    return [name for name in known if name not in of_moments], varying


def lump(scene: Scene, placed: Places) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """Returns vessels of constant mass as one body: mass [kg], centre (3,) [m], inertia (3, 3) [kg m2].

    placed : by name, their poses in the group's axes, in the order of summation; at least one
    The centre is from the origin of the group's axes, the inertia about the centre in these axes, see
    `inertia.combine`.
    """
    masses = np.array([scene.vessels[name].mass for name in placed])
    centres, tensors = _seen(scene, placed, masses)
    return combine_numbers(masses, centres, tensors)


def seen_in_group(scene: Scene, placed: Places) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns centres of mass, (n, 3) [m], and tensors over mass, (n, 3, 3) [m2], in the group's axes."""
    centres, tensors = _seen(scene, placed, np.ones(len(placed)))
    return centres.T, tensors.transpose(2, 0, 1)


def _seen(
    scene: Scene, placed: Places, masses: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns centres, (3, n) [m], and inertia tensors, (3, 3, n) [kg m2], in the group's axes."""
    vessels = [scene.vessels[name] for name in placed]
    centres, inertias = _placed_bodies()(
        masses[None, :],
        np.hstack([_specific_inertia(scene, vessel) for vessel in vessels]),
        np.array([from_anchor(scene, name, scene.vessels[name].centre_of_mass) for name in placed]).T,
        ca.evalf(ca.horzcat(*(pose.rotation for pose in placed.values()))),
        ca.evalf(ca.horzcat(*(pose.origin for pose in placed.values()))),
    )
    return np.array(centres), np.array(inertias).reshape(3, len(vessels), 3).transpose(0, 2, 1)


def _specific_inertia(scene: Scene, vessel: Vessel) -> NDArray[np.float64]:
    """Returns a vessel's inertia tensor over mass, (3, 3) [m2], vessel axes, by the scene's convention."""
    if scene.convention == "orbiter" and vessel.pmi is not None:
        return np.diag(np.array(ca.evalf(orbiter_moments(constant(vessel.pmi))))[:, 0])
    return np.array(vessel.specific_inertia)


def port_frame(port: Port) -> NDArray[np.float64]:
    """Returns R_vessel_port, (3, 3), of a port as the scene has it, see `poses.port_axes`."""
    return np.array(ca.evalf(port_axes(constant(scaled(port.direction)), constant(scaled(port.alignment)))))


def _joint_poses(scene: Scene, joints: Sequence[Joint]) -> list[Pose]:
    """Returns the pose of the child in the parent's axes of each joint, none of whose ports moves."""
    mated = iter(_mated_poses(scene, [joint for joint in joints if joint.mount is None]))
    mounted = iter(_mounted_poses(scene, [joint for joint in joints if joint.mount is not None]))
    return [next(mated if joint.mount is None else mounted) for joint in joints]


def mount_rotation(mount: Mount) -> NDArray[np.float64]:
    """Returns R_parent_child, (3, 3), of a mount.

    Each element is over the square of the quaternion's length: quarter turns, whose numbers are rounded, then
    give 0 and 1 exactly. Source: [EQ] Conventions, eq. (1), of a quaternion of any length.
    """
    w, x, y, z = mount.attitude
    ww, xx, yy, zz = w * w, x * x, y * y, z * z
    rows = [
        [(ww + xx) - (yy + zz), 2.0 * (x * y - w * z), 2.0 * (z * x + w * y)],
        [2.0 * (x * y + w * z), (ww + yy) - (zz + xx), 2.0 * (y * z - w * x)],
        [2.0 * (z * x - w * y), 2.0 * (y * z + w * x), (ww + zz) - (xx + yy)],
    ]
    return np.array(rows) / ((ww + xx) + (yy + zz))


def _mounted_poses(scene: Scene, joints: Sequence[Joint]) -> list[Pose]:
    """Returns the pose of the child in the parent's axes of each joint, all of them mounts.

    As with ports: the place in the parent less R times that in the child, here the origin of one of the two.
    """
    rotations, here, there = [], [], []
    for joint in joints:
        mount = joint.mount
        assert mount is not None
        R_parent_child, forwards = mount_rotation(mount), mount.parent == joint.parent
        rotations.append(R_parent_child if forwards else R_parent_child.T)
        here.append(from_anchor(scene, joint.parent, mount.position if forwards else ORIGIN))
        there.append(from_anchor(scene, joint.child, ORIGIN if forwards else mount.position))
    if not joints:
        return []
    origins = _mounted()(np.hstack(rotations), np.array(here).T, np.array(there).T)
    return _poses(ca.DM(np.hstack(rotations)), origins)


def _mated_poses(scene: Scene, joints: Sequence[Joint]) -> list[Pose]:
    """Returns the pose of the child in the parent's axes of each joint, all of them pairs of ports."""
    if not joints:
        return []
    ports = [[(joint.ports[side], scene.port(joint.ports[side])) for joint in joints] for side in (0, 1)]
    numbers = [
        np.array(vectors).T
        for side in ports
        for vectors in (
            [from_anchor(scene, vessel_of(name), port.position) for name, port in side],
            [scaled(port.direction) for _, port in side],
            [scaled(port.alignment) for _, port in side],
        )
    ]
    return _poses(*_mated()(*numbers))


def _poses(rotations: ca.DM, origins: ca.DM) -> list[Pose]:
    """Returns n poses of rotations (3, 3 n) and origins (3, n) [m]."""
    return [
        Pose(rotation, origin)
        for rotation, origin in zip(
            ca.horzsplit(ca.SX(rotations), 3), ca.horzsplit(ca.SX(origins)), strict=True
        )
    ]


@cache
def _mated() -> ca.Function:
    """Returns the function from position, direction, alignment of parent's and child's port to a pose."""
    names = [
        f"{side}_{key}" for side in ("parent", "child") for key in ("position", "direction", "alignment")
    ]
    vectors = [ca.SX.sym(name, 3) for name in names]
    parent, child = ((vectors[i], port_axes(*vectors[i + 1 : i + 3])) for i in (0, 3))
    pose = mated_pose(parent, child)
    return ca.Function("mated", vectors, [pose.rotation, pose.origin])


@cache
def _mounted() -> ca.Function:
    """Returns the function from R and one place, in the parent and in the child, to the child's origin."""
    R_parent_child, here, there = ca.SX.sym("rotation", 3, 3), ca.SX.sym("here", 3), ca.SX.sym("there", 3)
    return ca.Function("mounted", [R_parent_child, here, there], [here - R_parent_child @ there])


@cache
def _placed_bodies() -> ca.Function:
    """Returns the function from `placed_body`'s arguments to centre and inertia."""
    sizes = {
        "mass": (1,),
        "specific_inertia": (3, 3),
        "centre": (3,),
        "R_outer_vessel": (3, 3),
        "origin": (3,),
    }
    arguments = {name: ca.SX.sym(name, *size) for name, size in sizes.items()}
    body = placed_body(**arguments)
    return ca.Function("placed", list(arguments.values()), [body.centre, body.inertia])
