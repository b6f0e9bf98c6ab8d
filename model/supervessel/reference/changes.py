"""What a change of inputs at one instant does to the angular velocity, from the momentum of points."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from supervessel.reference.assembly import Array, Points, composite, joined, motions, points, vector
from supervessel.reference.laws import law_tensor
from supervessel.reference.rotation import angular_momentum
from supervessel.scene.schema import ORIGIN, Scene

MASS_INPUTS = ("mass", "pmi")


def change(
    scene: Scene, angular_velocity: ArrayLike, before: Mapping[str, float], after: Mapping[str, float]
) -> Array:
    """Returns the angular velocity, (3,) [rad/s], body axes, after inputs have changed at one instant.

    angular_velocity : (3,) [rad/s], body axes, until then
    before, after    : inputs by the FMU's structured names; what is missing has the scene's value
    In this order: vessels leave, with the motion they have; masses and moments change; poses and the motion
    of ports change; vessels arrive. The law "none" keeps the angular velocity.
    Raises ValueError if docks close that cannot, see `closed_docks`.

    Example:
        >>> rate = reference.change(scene, [0.0, 0.0011, 0.0], {}, {"DG.nose.position[1]": 5.0})
        >>> bool(rate[1] < 0.0011)  # the ship is farther out: the same momentum, a lower rate
        True
    """
    omega = np.array(angular_velocity, dtype=float)
    if scene.rotation.law == "none":
        return omega
    left = {**before, **_docked_in_both(scene, before, after)}
    filled = {name: x for name, x in left.items() if _kind(name) not in MASS_INPUTS}
    filled |= {name: x for name, x in after.items() if _kind(name) in MASS_INPUTS}
    moved = {name: x for name, x in left.items() if _kind(name) == "docked"}
    moved |= {name: x for name, x in after.items() if _kind(name) != "docked"}
    omega = _changed(scene, "mass", omega, left, filled)
    omega = _changed(scene, "pose", omega, filled, moved)
    return _arrived(scene, omega, moved, after)


def _kind(name: str) -> str:
    return name.rpartition(".")[2].partition("[")[0]


def _docked_in_both(scene: Scene, *values: Mapping[str, float]) -> dict[str, float]:
    return {
        f"{name}.docked": float(all(v.get(f"{name}.docked", scene.dock(name).docked) for v in values))
        for name in scene.inputs.docked
    }


def _changed(
    scene: Scene, kind: str, omega: Array, before: Mapping[str, float], after: Mapping[str, float]
) -> Array:
    """Returns the angular velocity after masses or poses have changed, as the scene says what is kept.

    What H = J omega + h lacks or has too much is made up by the angular velocity.
    """
    if scene.keeps.get(kind, "rate") == "rate":
        return omega
    excess = angular_momentum(scene, omega, before) - angular_momentum(scene, omega, after)
    changed: Array = omega + np.linalg.solve(_tensor(scene, after), excess)
    return changed


def _tensor(scene: Scene, values: Mapping[str, float]) -> Array:
    return law_tensor(scene.rotation.law, composite(scene, values).inertia)


def _arrived(scene: Scene, omega: Array, before: Mapping[str, float], after: Mapping[str, float]) -> Array:
    """Returns the angular velocity after docks have closed: all points keep H about their barycentre."""
    touching, rigid = at_contact(scene, omega, before, after), at_contact(scene, omega, after, after)
    excess = joined(touching.values()).momentum - joined(rigid.values()).momentum
    arrived: Array = omega + np.linalg.solve(composite(scene, after).inertia, excess)
    return arrived


def at_contact(
    scene: Scene, angular_velocity: ArrayLike, before: Mapping[str, float], after: Mapping[str, float]
) -> dict[str, Points]:
    """Returns the points of each vessel that is joined to the root after docks close, as they do.

    angular_velocity : (3,) [rad/s], of the root, body axes
    Their velocities are those relative to inertial space, in body axes, but for a common one. What arrives
    moves as a rigid body: with the root, and by the dock's velocity and rate beside that. These are the
    motion of the dock's second port relative to its first at their common point, in the axes of the first
    port's vessel; where the first port's vessel is the one that arrives, it moves oppositely.

    Example:
        >>> parts = reference.at_contact(scene, [0.0, 0.0, 0.01], {}, {})
        >>> bool(abs(reference.joined(parts.values()).momentum[2]) > 1e6)
        True
    """
    placed, own = motions(scene, after), points(scene, after)
    omega = np.asarray(angular_velocity, dtype=float)
    velocities = {vessel: part.velocities + np.cross(omega, part.positions) for vessel, part in own.items()}
    both = _docked_in_both(scene, before, after)
    for name in scene.inputs.docked:
        first, port = scene.dock(name).ports[0].split(".")
        closes = after.get(f"{name}.docked", scene.dock(name).docked) and not both[f"{name}.docked"]
        if not closes or first not in placed:
            continue
        arriving = placed.keys() - motions(scene, {**after, f"{name}.docked": 0.0}).keys()
        sign, axes = (-1.0 if first in arriving else 1.0), placed[first].rotation
        contact, _ = placed[first].carry(
            vector(f"{first}.{port}.position", scene.vessels[first].ports[port].position, after)
        )
        velocity = sign * axes @ vector(f"{name}.velocity", ORIGIN, after)
        rate = sign * axes @ vector(f"{name}.rate", ORIGIN, after)
        for vessel in arriving:
            arm = own[vessel].positions - contact
            velocities[vessel] = velocities[vessel] + velocity + np.cross(rate, arm)
    return {vessel: Points(part.masses, part.positions, velocities[vessel]) for vessel, part in own.items()}
