"""What an instant of change hands over to whoever integrates the orbit, in CasADi symbols.

A change of inputs, see `rotation.changes`, moves the barycentre of what hangs on the root and gives it
another velocity wherever matter or vessels come or go: the jumps. A vessel that docks let go has a state from
which its own flight begins. The FMU adds both to its outputs. One change leads through four composites:

    before  : as the change begins
    freed   : docks have opened; masses and moments have changed too, unless they keep the momentum
    closing : masses, moments and poses have changed, docks have not closed
    after   : as the change ends

From `before` to `freed` and from `closing` to `after` matter comes and goes; from `freed` to `closing` all
is moved inside the body, whose barycentre that leaves alone.
Source of the equations: [EQ] What an instant of change does to the barycentre.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import casadi as ca

from supervessel.composite.actions import vessel_outputs, vessel_pieces
from supervessel.composite.bodies import composite_body
from supervessel.composite.resolved import ResolvedScene
from supervessel.composite.wheels import axes_of, momentum_of_vessel
from supervessel.derivatives import derivatives_of, named_function
from supervessel.layout import slices_of
from supervessel.rotation.attitude import to_inertial, unit
from supervessel.rotation.changes import lookup_at_contact

Parts = Mapping[str, ca.SX]
"""Parts of c by name."""

JUMPS = {"barycentre_jump": 3, "barycentre_velocity_jump": 3}
"""The outputs with which every vector of what is handed over begins, and their sizes."""


@dataclass(frozen=True)
class HandOver:
    """What a change hands over: a vector that is added to outputs.

    slices           : by name of an output, its place in the vector; JUMPS come first
    handed_over      : x, omega, before, freed, closing, after, velocity -> the vector, (n,): x as the change
                       begins; omega at contact, (3,) [rad/s], with the momenta of wheels behind it; the four
                       composites; contact_velocity
    contact_velocity : p, k -> velocity of the barycentre relative to the root vessel's axes, (3,) [m/s], that
                       the motion k of parts at contact makes; None without docks that close
    """

    slices: Mapping[str, slice]
    handed_over: ca.Function
    contact_velocity: ca.Function | None

    @property
    def functions(self) -> tuple[ca.Function, ...]:
        """The functions that the FMU needs, with their derivatives."""
        plain = [f for f in (self.handed_over, self.contact_velocity) if f is not None]
        return (*plain, *(found for f in plain for found in derivatives_of(f)))


def hand_over(
    resolved: ResolvedScene, parts_of: Callable[[ca.SX], Parts], c: ca.SX, inputs: tuple[ca.SX, ca.SX]
) -> HandOver | None:
    """Returns what a change of inputs hands over; None where no output shows it, or nothing ever jumps.

    parts_of : composite, (n,) -> its parts by name
    c        : symbols of a composite, (n,)
    inputs   : symbols of p and k, see `equations`
    """
    if not resolved.hands_over:
        return None
    wheels = len(resolved.scene.wheels)
    x, omega, velocity = ca.SX.sym("x", 7 + wheels), ca.SX.sym("omega", 3 + wheels), ca.SX.sym("velocity", 3)
    names = ("before", "freed", "closing", "after")
    composites = {name: ca.SX.sym(name, c.numel()) for name in names}
    parts = {name: parts_of(symbols) for name, symbols in composites.items()}
    attitude = unit(x[:4])
    jump, velocity_jump = _jumps(parts, x[4:7], omega[:3], velocity)
    found = {
        "barycentre_jump": to_inertial(attitude, jump),
        "barycentre_velocity_jump": to_inertial(attitude, velocity_jump),
    }
    for name in resolved.leaving:
        shown = _left(resolved, name, (parts["before"], parts["after"]), x, (jump, velocity_jump))
        found |= {group: shown[group] for group in resolved.scene.outputs.names if group in shown}
    arguments = {"x": x, "omega": omega, **composites, "velocity": velocity}
    p, k = inputs
    contact = contact_velocity(resolved, p, k) if resolved.contact else None
    return HandOver(
        slices_of({name: value.numel() for name, value in found.items()}),
        named_function("handed_over", arguments, ca.vertcat(*found.values())),
        None if contact is None else named_function("contact_velocity", {"p": p, "k": k}, contact),
    )


def _jumps(
    parts: Mapping[str, Parts], omega: ca.SX, omega_at_contact: ca.SX, velocity: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """Returns the jumps of the barycentre, (3,) [m], and of its velocity, (3,) [m/s], body axes.

    Source: [EQ] What an instant of change does to the barycentre, eqs. (24), (25).

    parts            : of the four composites, by name
    omega            : as the change begins, (3,) [rad/s], body axes
    omega_at_contact : as docks close
    velocity         : of the barycentre relative to the root vessel, by the motion at contact, (3,) [m/s]
    """
    c = {name: of["centre"] for name, of in parts.items()}
    v = {name: of.get("velocity", ca.SX.zeros(3)) for name, of in parts.items()}
    left, joined = c["freed"] - c["before"], c["after"] - c["closing"]
    turned = ca.cross(omega, left) + ca.cross(omega_at_contact, joined)
    drifted = (v["freed"] - v["before"]) + (v["after"] - v["closing"])
    return left + joined, turned + drifted + velocity


def _left(
    resolved: ResolvedScene, name: str, parts: tuple[Parts, Parts], x: ca.SX, jumps: tuple[ca.SX, ca.SX]
) -> dict[str, ca.SX]:
    """Returns the outputs of a vessel at the instant at which docks let it go, zeros if they do not.

    parts : of the composite before and after the change
    x     : as the change begins
    jumps : of the barycentre, (3,) [m], and of its velocity, (3,) [m/s], body axes
    They are relative to the barycentre after the change, eqs. (26) and (27).
    """
    before, after = (vessel_pieces(resolved, name, of) for of in parts)
    (jump, velocity_jump), omega, attitude = jumps, x[4:7], unit(x[:4])
    rho, relative = before["centre"] - jump, before["velocity"] + ca.cross(omega, jump) - velocity_jump
    moves = ca.cross(omega, rho) + relative
    shift = before["mass"] * (ca.cross(before["centre"], velocity_jump) + ca.cross(jump, moves))
    pieces = before | {
        "origin": before["origin"] - jump,
        "centre": rho,
        "velocity": relative,
        "spin": before["spin"] - shift,
    }
    stored = momentum_of_vessel(resolved.scene, axes_of(resolved, parts[0]), name, x[7:])
    leaves = before["docked"] * (1.0 - after["docked"])
    shown = vessel_outputs(name, pieces, attitude, omega, stored)
    return {group: leaves * value for group, value in shown.items()}


def contact_velocity(resolved: ResolvedScene, p: ca.SX, k: ca.SX) -> ca.SX:
    """Returns the velocity of the barycentre relative to the root vessel, (3,) [m/s], root axes, by the
    motion k of parts at contact alone."""
    body = composite_body(resolved, lookup_at_contact(resolved, p, k))
    return ca.SX.zeros(3) if body.velocity is None else body.velocity
