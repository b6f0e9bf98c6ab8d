"""What a change of inputs at one instant does to the angular velocity, from the momentum of points."""

from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from supervessel.reference.assembly import Array, Points, composite, joined, motions, points, vector
from supervessel.reference.rotation import angular_momentum, turning_tensor
from supervessel.reference.wheels import wheels_of
from supervessel.scene.schema import ORIGIN, Scene

MASS_INPUTS = ("mass", "pmi")


def change(scene: Scene, rates: ArrayLike, before: Mapping[str, float], after: Mapping[str, float]) -> Array:
    """Returns the rates after inputs have changed at one instant, (3 + n,), momenta of wheels as they were.

    rates         : angular velocity [rad/s], body axes, and momenta of wheels [N m s], (3 + n,), until then
    before, after : inputs by the FMU's structured names; what is missing has the scene's value
    In this order: vessels leave, with the motion they have; masses and moments change; poses and the motion
    of ports change; vessels arrive. The law "none" keeps the angular velocity.
    Raises ValueError if docks close that cannot, see `closed_docks`.

    Example:
        >>> rate = reference.change(scene, [0.0, 0.0011, 0.0], {}, {"DG.nose.position[1]": 5.0})
        >>> bool(rate[1] < 0.0011)  # the ship is farther out: the same momentum, a lower rate
        True
    """
    if scene.rotation.law == "none":
        return np.array(rates, dtype=float)
    moved = stages(scene, before, after)[-1]
    return _arrived(scene, before_arrivals(scene, rates, before, after), moved, after)


Values = Mapping[str, float]


def stages(scene: Scene, before: Values, after: Values) -> tuple[Values, Values, Values]:
    """Returns the inputs after vessels have left; after masses have changed too; after poses have as well.

    Example:
        >>> left, filled, moved = reference.stages(scene, {}, {"DG.mass": 12000.0})
        >>> left, filled
        ({}, {'DG.mass': 12000.0})
    """
    left = {**before, **_docked_in_both(scene, before, after)}
    filled = {name: x for name, x in left.items() if _kind(name) not in MASS_INPUTS}
    filled |= {name: x for name, x in after.items() if _kind(name) in MASS_INPUTS}
    moved = {name: x for name, x in left.items() if _kind(name) == "docked"}
    moved |= {name: x for name, x in after.items() if _kind(name) != "docked"}
    return left, filled, moved


def before_arrivals(scene: Scene, rates: ArrayLike, before: Values, after: Values) -> Array:
    """Returns the rates, as `change` does, before vessels arrive.

    Example:
        >>> reference.before_arrivals(scene, [0.0, 0.0011, 0.0], {}, {"DG.mass": 12000.0}).tolist()
        [0.0, 0.0011, 0.0]
    """
    left, filled, moved = stages(scene, before, after)
    rates = _changed(scene, "mass", np.array(rates, dtype=float), left, filled)
    return _changed(scene, "pose", rates, filled, moved)


def _kind(name: str) -> str:
    return name.rpartition(".")[2].partition("[")[0]


def _docked_in_both(scene: Scene, *values: Mapping[str, float]) -> dict[str, float]:
    return {
        f"{name}.docked": float(all(v.get(f"{name}.docked", scene.dock(name).docked) for v in values))
        for name in scene.inputs.docked
    }


def _changed(
    scene: Scene, kind: str, rates: Array, before: Mapping[str, float], after: Mapping[str, float]
) -> Array:
    """Returns the rates after masses or poses have changed, as the scene says what is kept.

    What H lacks or has too much is made up by the angular velocity.
    """
    if scene.keeps.get(kind, "rate") == "rate":
        return rates
    excess = angular_momentum(scene, rates, before) - angular_momentum(scene, rates, after)
    return _turned_on(rates, np.linalg.solve(turning_tensor(scene, after), excess))


def _turned_on(rates: Array, by: ArrayLike) -> Array:
    """Returns the rates with something added to the angular velocity."""
    return np.concatenate([rates[:3] + np.asarray(by, dtype=float), rates[3:]])


def _arrived(scene: Scene, rates: Array, before: Mapping[str, float], after: Mapping[str, float]) -> Array:
    """Returns the rates after docks have closed: all points and wheels keep H about their barycentre.

    Wheels do not turn with the vessel that arrives: what they would, locked, is left out.
    """
    touching, rigid = at_contact(scene, rates[:3], before, after), at_contact(scene, rates[:3], after, after)
    excess = joined(touching.values()).momentum - joined(rigid.values()).momentum
    own = wheels_of(scene, rates[3:], after)
    for arrival in _arrivals(scene, before, after):
        on_board = np.array([name.partition(".")[0] in arrival.vessels for name in scene.wheels], dtype=bool)
        excess -= (on_board * own.inertias * (own.axes @ arrival.rate)) @ own.axes
    return _turned_on(rates, np.linalg.solve(composite(scene, after).inertia - own.inertia, excess))


@dataclass(frozen=True)
class _Arrival:
    """Vessels that a dock joins to the root, and how they move about it at contact, beside what it does.

    contact, velocity, rate : (3,) [m], [m/s], [rad/s], root axes: the ports' common point, the motion there
    """

    vessels: Set[str]
    contact: Array
    velocity: Array
    rate: Array


def _arrivals(scene: Scene, before: Mapping[str, float], after: Mapping[str, float]) -> Iterator[_Arrival]:
    """Yields what docks that close bring, as `at_contact` says."""
    placed, both = motions(scene, after), _docked_in_both(scene, before, after)
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
        yield _Arrival(arriving, contact, velocity, sign * axes @ vector(f"{name}.rate", ORIGIN, after))


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
    own = points(scene, after)
    omega = np.asarray(angular_velocity, dtype=float)
    velocities = {vessel: part.velocities + np.cross(omega, part.positions) for vessel, part in own.items()}
    for arrival in _arrivals(scene, before, after):
        for vessel in arrival.vessels:
            arm = own[vessel].positions - arrival.contact
            velocities[vessel] = velocities[vessel] + arrival.velocity + np.cross(arrival.rate, arm)
    return {vessel: Points(part.masses, part.positions, velocities[vessel]) for vessel, part in own.items()}
