"""The twin: the FMU's own equations as CasADi functions, for control design and estimation."""

from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from supervessel.equations import Equations, composite_slices, equations, p_start, simplification
from supervessel.inertia import from_upper_triangle
from supervessel.scene import Scene


class Twin:
    """CasADi functions of a scene, from the very expressions that its FMU is generated from.

    x = (attitude w, x, y, z; angular velocity [rad/s], body axes), (7,)
    u = the torque inputs [N m], (3,) or (0,)
    p = the FMU's other inputs, (n,), in the order of its model description
    h = step [s]

    Each function's numbers are the FMU's to the last bit: both evaluate the same operations in the same
    order, and only + - * / and the square root occur, which IEEE 754 rounds correctly everywhere.

    composite    : p -> mass [kg], barycentre (3,) [m], inertia (3, 3) [kg m2], pmi (3,) [m2]
    ode          : x, u, p -> x_dot
    step         : x, u, p, h -> x_next by one RK4 step, attitude at unit length
    longest_step : x, u, p -> h_max, the longest sub-step [s] that the FMU takes from x
    outputs      : x, u, p -> y, the FMU's outputs

    Directions in p may have any length whose square a double holds. Nothing in p is checked: the FMU
    refuses a negative mass or parallel port axes, the twin is a formula that an optimiser may take there.

    Example:
        twin = Twin(load_scene("examples/iss_dg.toml"))
        x_next = twin.step(twin.x_start, [0, 0, 100], twin.p_start, 0.1)
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        model = equations(scene)
        self.p_names, self.u_names = model.p_names, model.u_names
        self.x_names, self.y_names = model.x_names, model.y_names
        self.p = ca.SX.sym("p", len(self.p_names))
        self.u = ca.SX.sym("u", len(self.u_names))
        self.x = ca.SX.sym("x", len(self.x_names))
        self.h = ca.SX.sym("h")
        # CasADi turns x * (1/y) into x/y when the two meet in one graph. The FMU computes 1/y once for each
        # change of inertia, so the twin must multiply by it as well to give the same last bit.
        with simplification(False):
            self._compose(model)

    def _compose(self, model: Equations) -> None:
        """Makes functions of p out of those of c."""
        c = model.composite(self.p)
        where = composite_slices()
        inertia = from_upper_triangle(c[where["inertia"]])
        args, names = [self.x, self.u, self.p], ["x", "u", "p"]
        self.composite = ca.Function(
            "composite",
            [self.p],
            [c[where["mass"]], c[where["barycentre"]], inertia, c[where["pmi"]]],
            ["p"],
            ["mass", "barycentre", "inertia", "pmi"],
        )
        at = (self.x, self.u, c)
        self.ode = ca.Function("ode", args, [model.ode(*at)], names, ["x_dot"])
        longest = self.scene.rotation.max_angle_step / ca.sqrt(model.fastest_square(*at))
        self.longest_step = ca.Function("longest_step", args, [longest], names, ["h_max"])
        self.step = ca.Function("step", [*args, self.h], [model.step(*at, self.h)], [*names, "h"], ["x_next"])
        self.outputs = ca.Function("outputs", args, [model.outputs(*at)], names, ["y"])

    @cached_property
    def x_start(self) -> NDArray[np.float64]:
        """The scene's state at the start, (7,)."""
        rotation = self.scene.rotation
        return np.array([*rotation.attitude, *rotation.angular_velocity])

    @cached_property
    def p_start(self) -> NDArray[np.float64]:
        """The scene's values of p, (n,)."""
        return p_start(self.scene)
