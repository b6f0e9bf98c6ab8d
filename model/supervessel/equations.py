"""The equations of one scene as CasADi functions: what the FMU is generated from and what the twin evaluates.

p are the inputs that shape the composite, u the torque inputs, x = (attitude, angular velocity), and c
what follows from p alone. c is computed when p changes, everything else uses c. Whatever of c is
constant in this scene is a number in those functions, not an argument that is read.
"""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
from numpy.typing import ArrayLike

from supervessel.attitude import attitude_dot, to_inertial
from supervessel.docking import composite_body, constant
from supervessel.inertia import ldl, symmetric
from supervessel.propagators import longest_step, rk4_step
from supervessel.quantities import PIVOT_SLACK
from supervessel.rotation import LAWS
from supervessel.scene import Scene
from supervessel.variables import input_variables, output_variables, state_names

UPPER_TRIANGLE = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))

COMPOSITE_SIZES = {"mass": 1, "barycentre": 3, "inertia": 6, "pmi": 3, "margins": 3}
"""Layout of c; the law's own numbers follow. inertia is the upper triangle xx, yy, zz, xy, xz, yz.

margins are the pivots of J = L D L^T less what rounding may leave of a zero: positive where the
tensor is positive definite as far as doubles can tell.
"""


@dataclass(frozen=True)
class Equations:
    """Functions and names of one scene.

    composite    : p -> c
    ode          : x, u, c -> rate of x
    longest_step : x, u, c -> longest sub-step [s] within the scene's angle
    step         : x, u, c, h -> x after one sub-step of h [s]
    outputs      : x, u, c -> the outputs, in the scene's order
    """

    composite: ca.Function
    ode: ca.Function
    longest_step: ca.Function
    step: ca.Function
    outputs: ca.Function
    p_names: tuple[str, ...]
    u_names: tuple[str, ...]
    x_names: tuple[str, ...]
    y_names: tuple[str, ...]

    @property
    def functions(self) -> tuple[ca.Function, ...]:
        """All functions."""
        return self.composite, self.ode, self.longest_step, self.step, self.outputs


def composite_slices() -> dict[str, slice]:
    """Returns where each part of c stands; "law" is what follows them."""
    slices, start = {}, 0
    for name, size in COMPOSITE_SIZES.items():
        slices[name] = slice(start, start + size)
        start += size
    return slices | {"law": slice(start, None)}


def equations(scene: Scene) -> Equations:
    """Returns the equations of a scene, folded for what it holds constant."""
    inputs = [variable.name for variable in input_variables(scene)]
    p_names = tuple(name for name in inputs if not name.startswith("torque["))
    u_names = tuple(name for name in inputs if name.startswith("torque["))
    p, u, x, h = (ca.SX.sym(*s) for s in (("p", len(p_names)), ("u", len(u_names)), ("x", 7), ("h", 1)))

    law = LAWS[scene.rotation.law]
    c_of_p = _composite(scene, p_names, p, law.prepare)
    c = ca.SX.sym("c", c_of_p.numel())
    known = ca.vertcat(*(c_of_p[i] if c_of_p[i].is_constant() else c[i] for i in range(c.numel())))
    parts = {name: known[where] for name, where in composite_slices().items()}
    torque = u if u_names else ca.SX.zeros(3)

    def rate(state: ca.SX) -> ca.SX:
        acceleration = law.acceleration(parts["law"], state[4:], torque)
        return ca.vertcat(attitude_dot(state[:4], state[4:]), acceleration)

    by_torque = law.acceleration(parts["law"], ca.SX.zeros(3), torque)
    longest = longest_step(x[4:], by_torque, law.growth, scene.rotation.max_angle_step)
    y = _outputs(scene, x, parts)
    args, names = [x, u, c], ["x", "u", "c"]
    return Equations(
        composite=ca.Function("composite", [p], [c_of_p], ["p"], ["c"]),
        ode=ca.Function("ode", args, [rate(x)], names, ["x_dot"]),
        longest_step=ca.Function("longest_step", args, [longest], names, ["h_max"]),
        step=ca.Function("step", [*args, h], [rk4_step(rate, x, h)], [*names, "h"], ["x_next"]),
        outputs=ca.Function("outputs", args, [y], names, ["y"]),
        p_names=p_names,
        u_names=u_names,
        x_names=state_names(),
        y_names=tuple(variable.name for variable in output_variables(scene)),
    )


def _composite(scene: Scene, names: tuple[str, ...], p: ca.SX, prepare: Callable[[ca.SX], ca.SX]) -> ca.SX:
    """Returns c as an expression of p."""
    symbols = dict(zip(names, ca.vertsplit(p), strict=True)) if names else {}

    def lookup(group: str, value: ArrayLike) -> ca.SX:
        if group in symbols:
            return symbols[group]
        if f"{group}[1]" in symbols:
            return ca.vertcat(*(symbols[f"{group}[{i}]"] for i in (1, 2, 3)))
        return constant(value)

    body = composite_body(scene, lookup)
    J = body.inertia
    _, pivots = ldl(J)
    return ca.densify(
        ca.vertcat(
            body.mass,
            body.centre,
            ca.vertcat(*(J[i, j] for i, j in UPPER_TRIANGLE)),
            ca.diag(J) / body.mass,
            pivots - PIVOT_SLACK * ca.diag(J),
            prepare(J),
        )
    )


def _outputs(scene: Scene, x: ca.SX, parts: dict[str, ca.SX]) -> ca.SX:
    """Returns the scene's outputs, in its order."""
    attitude, omega = x[:4], x[4:]
    elements = dict(zip(UPPER_TRIANGLE, ca.vertsplit(parts["inertia"]), strict=True))
    J = symmetric(lambda i, j: elements[i, j])
    momentum = J @ omega
    available = {
        "mass": parts["mass"],
        "barycentre": parts["barycentre"],
        "pmi": parts["pmi"],
        "inertia": ca.vec(J),
        "angular_velocity": omega,
        "attitude": attitude,
        "kinetic_energy": 0.5 * ca.dot(omega, momentum),
        "angular_momentum": to_inertial(attitude, momentum),
    }
    return ca.densify(ca.vertcat(*(available[name] for name in scene.outputs.names)))
