"""The twin: the FMU's own equations as CasADi functions, for control design and estimation."""

from functools import cached_property
from typing import get_args

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from supervessel.changes import followed
from supervessel.equations import Equations, composite_slices, equations, p_start, simplification
from supervessel.inertia import from_upper_triangle
from supervessel.propagators.exact import free_step
from supervessel.scene import Propagator, Scene

GAP = 1e-8
"""Least difference of principal moments, over the largest, for derivatives of free motion by p."""


X_NAMES = (
    *(f"state.attitude[{i}]" for i in range(1, 5)),
    *(f"state.angular_velocity[{i}]" for i in range(1, 4)),
)
"""Names of the FMU's states, which the twin's are wherever the angular velocity is one."""


class Twin:
    """CasADi functions of a scene, from the very expressions that its FMU is generated from.

    x = (attitude w, x, y, z; angular velocity [rad/s], body axes), (7,)
    u = the torque inputs [N m], (3,) or (0,)
    p = the FMU's other inputs, (n,), in the order of its model description
    h = step [s]

    Each function's numbers are the FMU's to the last bit, for composite, ode, outputs but principal ones, and
    a single sub-step of "rk4", "dop853" and "taylor": both evaluate the same operations in the same order,
    and only + - * / and the square root occur, which IEEE 754 rounds correctly everywhere. Taylor steps,
    free motion and principal axes agree to a few u (1 + angle turned).

    composite    : p -> mass [kg], barycentre (3,) [m], inertia (3, 3) [kg m2], pmi (3,) [m2]
    ode          : x, u, p -> x_dot
    step         : x, u, p, h -> x_next, attitude at unit length, by one step of the scene's propagator; of
                   "auto" by the method that it takes with torque
    longest_step : x, u, p -> h_max, the longest sub-step [s] that the FMU takes from x by "rk4"
    outputs      : x, u, p -> y, the FMU's outputs but error_estimate, which follows from a step

    Directions in p may have any length whose square a double holds. Nothing in p is checked: the FMU
    refuses a negative mass or parallel port axes, the twin is a formula that an optimiser may take there.

    scene      : from `load_scene`
    propagator : "rk4" and so on, instead of the scene's
    doublings  : of free motion, "exact" and "split", in a step: room for a phase of FIRST_ANGLE 2^doublings,
                 about the angle turned; where more is needed the step is NaN, as it is beyond 2e9 rad (which
                 the FMU discards) and as is "exact" with a torque

    Derivatives of a step are right wherever values are, with one exception: those of free motion by p need
    principal axes. They are off by about 1e-15/gap, relatively, gap being the least difference of principal
    moments over the largest; where it is below GAP = 1e-8 they are NaN. Steps of the other propagators need
    no axes.

    Example:
        twin = Twin(load_scene("examples/iss_dg.toml"))
        x_next = twin.step(twin.x_start, [0, 0, 100], twin.p_start, 0.1)
    """

    def __init__(self, scene: Scene, *, propagator: Propagator | None = None, doublings: int = 8) -> None:
        if propagator not in (None, *get_args(Propagator)):
            raise ValueError(f"propagator = {propagator!r}: must be one of {', '.join(get_args(Propagator))}")
        if not (isinstance(doublings, int) and 0 <= doublings <= 64):
            raise ValueError(f"doublings = {doublings!r}: must be a whole number from 0 to 64")
        if propagator is not None:
            rotation = scene.rotation.model_copy(update={"propagator": propagator})
            scene = scene.model_copy(update={"rotation": rotation})
        self.scene, self.doublings = scene, doublings
        model = self._model = equations(scene)
        self.p_names, self.u_names, self.x_names = model.p_names + model.k_names, model.u_names, X_NAMES
        self.y_names = tuple(name for name in model.y_names if name != "error_estimate")
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
        shaping = len(model.p_names)
        c = model.composite(self.p[:shaping])
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
        a = model.axes(c)
        step = self._step(model, c, a)
        self.step = ca.Function("step", [*args, self.h], [step], [*names, "h"], ["x_next"])
        y = model.outputs(*at, a, 0.0)
        shown = [i for i, name in enumerate(model.y_names) if name in self.y_names]
        self.outputs = ca.Function("outputs", args, [y[shown]], names, ["y"])

    def _step(self, model: Equations, c: ca.SX, a: ca.SX) -> ca.SX:
        """Returns the state after h by the scene's method."""

        def free(x: ca.SX) -> ca.SX:
            axes = a[model.axes_slices["free"]]
            end = free_step(x, axes[:3], ca.reshape(axes[3:], 3, 3), self.h, self.doublings)
            return end + _zero_without_derivative_at_equal(axes[:3])

        def stepped(x: ca.SX) -> ca.SX:
            return model.step.call([x, self.u, c, self.h])[0]

        if model.plan.method is None:
            pushed = ca.sumsqr(self.u) > 0.0 if self.u_names else ca.SX(0.0)
            return free(self.x) + ca.if_else(pushed, ca.SX.nan(), 0.0)
        if model.plan.free == "between kicks":
            return stepped(free(stepped(self.x)))
        return stepped(self.x)

    @cached_property
    def change(self) -> ca.Function:
        """x, p, p_next -> x_next: what becomes of the state when the inputs p change, at one instant.

        What undocks leaves with its share; masses, then poses change and keep rate or momentum as the scene
        says; what docks brings its momentum along, moving as the inputs of motion at contact in p_next say.
        """
        model = self._model
        p_next = ca.SX.sym("p_next", self.p.numel())
        omega, shaping = self.x[4:], len(model.p_names)
        if model.change is not None:
            inputs = (omega, self.p[:shaping], p_next[:shaping], p_next[shaping:])
            with simplification(False):
                omega = followed(self.scene, model.change, model.composite, inputs)
        x_next = ca.vertcat(self.x[:4], omega)
        return ca.Function("change", [self.x, self.p, p_next], [x_next], ["x", "p", "p_next"], ["x_next"])

    @cached_property
    def x_start(self) -> NDArray[np.float64]:
        """The scene's state at the start, (7,)."""
        rotation = self.scene.rotation
        return np.array([*rotation.attitude, *rotation.angular_velocity])

    @cached_property
    def p_start(self) -> NDArray[np.float64]:
        """The scene's values of p, (n,)."""
        return np.append(p_start(self.scene), np.zeros(len(self._model.k_names)))


def _zero_without_derivative_at_equal(moments: ca.SX) -> ca.SX:
    """Returns 0; its derivative is NaN where moments, (3,), ascending, are too close to tell axes by."""
    if moments.is_constant():
        return ca.SX(0.0)
    least = ca.fmin(moments[1] - moments[0], moments[2] - moments[1])
    beyond = least - GAP * moments[2]
    # sqrt(0) has the derivative infinity; that of what it is taken from is 0 below the limit
    return ca.if_else(beyond <= 0.0, ca.sqrt(ca.fmax(beyond, 0.0)), 0.0)
