"""Wheels of the vessels of a composite, in CasADi symbols: their axes, and the momentum that they hold.

b_w : axis of a wheel, of unit length, body axes; zeros while docks do not hold its vessel to the root
I_w : its inertia about the axis [kg m2], a constant of the scene, part of its vessel's tensor
h_w : its angular momentum along the axis [N m s], relative to inertial space
A   : sum of I_w b_w b_w^T over the wheels, (3, 3) [kg m2]

J - A is the tensor of all that turns with the body: a wheel's momentum along its axis is h_w, whatever the
body does. Root axes have the directions of body axes.
Source: [EQ] Wheels, eqs. (16) and (17).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

from supervessel.composite.bodies import Lookup, placed_vessels
from supervessel.composite.inertia import Body, symmetric
from supervessel.composite.poses import Pose, constant, scaled
from supervessel.composite.resolved import ResolvedScene
from supervessel.scene.inputs import vessel_of
from supervessel.scene.schema import Scene


@dataclass(frozen=True)
class WheelAxes:
    """Wheels by their axes.

    axes     : b_w, (3, n), a column a wheel
    inertias : I_w, n numbers [kg m2]
    rates    : b_w . k, (n,) [rad/s], of the rate k of each wheel's vessel relative to body axes; None where
               no port moves
    """

    axes: ca.SX
    inertias: Sequence[float]
    rates: ca.SX | None = None

    @property
    def locked(self) -> ca.SX:
        """A, (3, 3) [kg m2], exactly symmetric."""
        b = self.axes

        def element(i: int, j: int) -> ca.SX:
            own = (inertia * (b[i, w] * b[j, w]) for w, inertia in enumerate(self.inertias))
            return sum(own, ca.SX(0.0))

        return symmetric(element)

    @property
    def moved(self) -> ca.SX | None:
        """A k summed over the wheels, each with the rate of its vessel, (3,) [N m s]; None: no port moves."""
        return None if self.rates is None else self.axes @ (ca.SX(list(self.inertias)) * self.rates)

    @property
    def locked_energy(self) -> ca.SX:
        """k . A k/2 summed over the wheels, [J], each with the rate k of its vessel."""
        return ca.SX(0.0) if self.rates is None else 0.5 * ca.dot(ca.SX(list(self.inertias)), self.rates**2)


def axes_of(resolved: ResolvedScene, parts: Mapping[str, ca.SX]) -> WheelAxes | None:
    """Returns the wheels of a scene, None where it has none.

    parts : the parts of c by name, see `wheel_parts`
    """
    names = resolved.scene.wheels
    if not names:
        return None
    axes = ca.reshape(parts["wheels"], 3, len(names))
    return WheelAxes(axes, _inertias(resolved.scene, names), parts.get("wheel_rates"))


def free_inertia(inertia: ca.SX, wheels: WheelAxes | None) -> ca.SX:
    """Returns J - A, (3, 3) [kg m2]; inertia : J."""
    return inertia if wheels is None else inertia - wheels.locked


def wheel_parts(wheels: WheelAxes | None) -> dict[str, ca.SX]:
    """Returns the parts of c about wheels, none in a scene without them.

    "wheels"      : (3 n,), b_w of one wheel after the other
    "wheel_rates" : (n,) [rad/s], where ports move, see `WheelAxes.rates`
    """
    if wheels is None:
        return {}
    parts = {"wheels": ca.vec(wheels.axes)}
    return parts if wheels.rates is None else parts | {"wheel_rates": wheels.rates}


def placed_wheels(resolved: ResolvedScene, lookup: Lookup) -> WheelAxes | None:
    """Returns the wheels of a scene where inputs put them, None where it has none."""
    scene = resolved.scene
    if not scene.wheels:
        return None
    where = placed_vessels(resolved, lookup, {vessel_of(name) for name in scene.wheels})
    return _stacked(scene, scene.wheels, [where[vessel_of(name)] for name in scene.wheels])


def wheels_on(scene: Scene, vessel: str, pose: Pose) -> WheelAxes | None:
    """Returns the wheels of one vessel, held to the root in such a pose, None where it has none."""
    names = tuple(f"{vessel}.{name}" for name in scene.vessels[vessel].wheels)
    return _stacked(scene, names, [(pose, None)] * len(names)) if names else None


def _stacked(scene: Scene, names: Sequence[str], where: Sequence[tuple[Pose, ca.SX | None]]) -> WheelAxes:
    """Returns wheels by the poses of their vessels in the root's axes, and by whether they hang on the
    root."""
    axes, rates, moves = [], [], any(pose.rate is not None for pose, _ in where)
    for name, (pose, attached) in zip(names, where, strict=True):
        axis = pose.rotation @ unit_axis(scene, name)
        axes.append(axis if attached is None else attached * axis)
        rates.append(ca.SX(0.0) if pose.rate is None else ca.dot(axes[-1], pose.rate))
    return WheelAxes(ca.horzcat(*axes), _inertias(scene, names), ca.vertcat(*rates) if moves else None)


def _inertias(scene: Scene, names: Sequence[str]) -> list[float]:
    return [scene.wheel(name).inertia for name in names]


def unit_axis(scene: Scene, name: str) -> ca.SX:
    """Returns the axis of the wheel called "vessel.wheel" at unit length, (3,), vessel axes."""
    axis = constant(scaled(scene.wheel(name).axis))
    return axis / ca.norm_2(axis)


def without_locked(body: Body, wheels: WheelAxes | None) -> Body:
    """Returns a body with the momentum of what moves in it less A k: a wheel does not turn with its
    vessel."""
    if wheels is None or wheels.moved is None or body.spin is None:
        return body
    return Body(body.mass, body.centre, body.inertia, body.velocity, body.spin - wheels.moved)


def motor_torques(resolved: ResolvedScene, u: ca.SX) -> ca.SX:
    """Returns the torque of each wheel's motor, (n,) [N m], 0 of a wheel without one.

    u : the inputs that act, in the order of `ResolvedScene.acting`
    """
    places = {variable.name: place for place, variable in enumerate(resolved.acting)}
    inputs = (places.get(f"{name}.torque") for name in resolved.scene.wheels)
    return ca.vertcat(*(ca.SX(0.0) if place is None else u[place] for place in inputs))


def stored_rate(resolved: ResolvedScene, wheels: WheelAxes, motors: ca.SX) -> ca.SX:
    """Returns h_w' of each wheel, (n,) [N m]: the torque of its motor, 0 while its vessel is not held.

    motors : see `motor_torques`
    """
    rates = []
    for w, name in enumerate(resolved.scene.wheels):
        is_held = ca.sumsqr(wheels.axes[:, w]) > 0.5
        leaves = resolved.may_leave(vessel_of(name))
        rates.append(ca.if_else(is_held, motors[w], 0.0) if leaves else motors[w])
    return ca.vertcat(*rates)


def wheel_outputs(
    resolved: ResolvedScene, wheels: WheelAxes, omega: ca.SX, stored: ca.SX
) -> dict[str, ca.SX]:
    """Returns the outputs of wheels by name; `scene.outputs` says what they are.

    omega  : angular velocity of the body, (3,) [rad/s], body axes
    stored : h_w of each wheel, (n,) [N m s]
    The speed, h_w/I_w less what the vessel turns about the axis, is 0 while the vessel is not held.
    """
    found = {}
    for w, name in enumerate(resolved.scene.wheels):
        axis, inertia = wheels.axes[:, w], wheels.inertias[w]
        found[f"{name}.momentum"] = stored[w]
        if inertia == 0.0:
            continue
        turned = ca.dot(axis, omega) if wheels.rates is None else ca.dot(axis, omega) + wheels.rates[w]
        speed, leaves = stored[w] / inertia - turned, resolved.may_leave(vessel_of(name))
        found[f"{name}.speed"] = ca.if_else(ca.sumsqr(axis) > 0.5, speed, 0.0) if leaves else speed
    return found


def wheel_energy(resolved: ResolvedScene, wheels: WheelAxes, stored: ca.SX) -> ca.SX:
    """Returns the sum of h_w^2/(2 I_w), [J], over the wheels that the body holds and that have inertia.

    stored : h_w of each wheel, (n,) [N m s]
    """
    energy = ca.SX(0.0)
    for w, name in enumerate(resolved.scene.wheels):
        if wheels.inertias[w] > 0.0:
            own = stored[w] ** 2 / (2.0 * wheels.inertias[w])
            leaves = resolved.may_leave(vessel_of(name))
            energy += ca.if_else(ca.sumsqr(wheels.axes[:, w]) > 0.5, own, 0.0) if leaves else own
    return energy


def momentum_of_vessel(scene: Scene, wheels: WheelAxes | None, vessel: str, stored: ca.SX) -> ca.SX | None:
    """Returns the sum of h_w b_w of the wheels of a vessel, (3,) [N m s], body axes; None: it has none."""
    own = [w for w, name in enumerate(scene.wheels) if vessel_of(name) == vessel]
    return wheels.axes[:, own] @ stored[own] if wheels is not None and own else None
