"""The FMU's own equations as CasADi functions, to the last bit: what the twin is built on."""

from collections.abc import Iterable, Mapping
from functools import cached_property
from typing import get_args

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from supervessel.composite.inertia import from_upper_triangle
from supervessel.equations import composite_slices, equations, p_start, simplification
from supervessel.fmu import choose
from supervessel.rotation.changes import followed
from supervessel.rotation.propagators.exact import free_step
from supervessel.scene.schema import PROPAGATOR_NAMES, Scene
from supervessel.twin.bounds import bound_over_change, bound_over_step
from supervessel.twin.error_state import ErrorForm
from supervessel.twin.functions import TwinFunction
from supervessel.twin.input_values import placed_values, settled

GAP = 1e-8
"""Least difference of principal moments, over the largest, for derivatives of free motion by p."""

MANY = 2.0**900
"""Makes any moment above 2^-847 kg m2 a whole number; the square of it makes any change of one infinite."""


X_NAMES = (
    *(f"state.attitude[{i}]" for i in range(1, 5)),
    *(f"state.angular_velocity[{i}]" for i in range(1, 4)),
)
"""Names of the FMU's states of the body, where the angular velocity is one; the first seven of the twin's
x."""


class Plant:
    """Functions that give the FMU's numbers, symbols and names; `Twin` is where they are described."""

    def __init__(
        self,
        scene: Scene,
        *,
        propagator: str | None = None,
        doublings: int = 8,
        error_form: ErrorForm = "rotvec",
        fixed: bool | Iterable[str] | Mapping[str, ArrayLike] = False,
    ) -> None:
        if propagator not in (None, *PROPAGATOR_NAMES):
            raise ValueError(f"propagator = {propagator!r}: must be one of {', '.join(PROPAGATOR_NAMES)}")
        if error_form not in get_args(ErrorForm):
            raise ValueError(f"error_form = {error_form!r}: must be one of {', '.join(get_args(ErrorForm))}")
        if not (isinstance(doublings, int) and 0 <= doublings <= 64):
            raise ValueError(f"doublings = {doublings!r}: must be a whole number from 0 to 64")
        if not scene.is_chosen:
            scene, _ = choose(scene)
        if propagator is not None:
            rotation = scene.rotation.model_copy(update={"propagator": propagator})
            scene = scene.model_copy(update={"rotation": rotation})
        self.scene, self.doublings, self.error_form = scene, doublings, error_form
        self._model = equations(scene)
        resolved = self._model.resolved
        inputs = (*resolved.shaping, *resolved.contact, *resolved.field)
        at_start = [variable.start for variable in resolved.field]
        start = np.concatenate([p_start(scene), np.zeros(len(resolved.contact)), at_start])
        constants = settled(fixed, inputs)
        free = [i for i in range(len(inputs)) if i not in constants]
        self._p_variables = [inputs[i] for i in free]
        self.p_names = tuple(variable.name for variable in self._p_variables)
        self.u_variables = resolved.acting
        self.u_names = tuple(variable.name for variable in resolved.acting)
        self.x_names = (*X_NAMES, *(f"state.{name}.momentum" for name in scene.wheels))
        self.y_names = tuple(v.name for v in self._model.resolved.outputs if not v.kind.of_history)
        self.p = ca.SX.sym("p", len(free))
        self.u = ca.SX.sym("u", len(self.u_names))
        self.x = ca.SX.sym("x", len(self.x_names))
        self.h = ca.SX.sym("h")
        self.p_start = start[free]
        """The scene's values of p, (n,)."""
        symbols = dict(zip(free, ca.vertsplit(self.p) if free else [], strict=True))
        elements = [symbols[i] if i in symbols else ca.SX(constants[i]) for i in range(len(inputs))]
        self._inputs = ca.vertcat(ca.SX(0, 1), *elements)
        self._place = ca.vertcat(ca.SX(0, 1), *elements[len(inputs) - len(resolved.field) :])
        """Position [m] and velocity [m/s] in a field of gravity, (6,), or (0,)."""
        self._turning_inputs = ca.vertcat(self.u, self._place)
        """The equations' u: what torques follow from."""
        # CasADi turns x * (1/y) into x/y when the two meet in one graph. The FMU computes 1/y once for each
        # change of inertia, so the twin must multiply by it as well to give the same last bit.
        with simplification(False):
            self._c = self._model.composite(self._inputs[: len(self._model.names.p)])
            self._a = self._model.axes(self._c)

    @cached_property
    def x_start(self) -> NDArray[np.float64]:
        """The scene's state at the start, (7,), and the momenta of wheels behind that.

        Example:
            >>> twin.x_start.tolist()
            [1.0, 0.0, 0.0, 0.0, 0.0, 0.0011, 0.0]
        """
        rotation, momenta = (
            self.scene.rotation,
            (self.scene.wheel(name).momentum for name in self.scene.wheels),
        )
        return np.array([*rotation.attitude, *rotation.angular_velocity, *momenta])

    def p_with(self, values: Mapping[str, ArrayLike]) -> NDArray[np.float64]:
        """Returns the scene's p, (n,), with some values changed.

        values : by the names of p, or three at once by a name without index
        Raises ValueError for names that are none, sizes that do not fit, values that an
        input can never have. What makes no sense together the FMU alone judges.

        Example:
            >>> twin.p_with({"DG.mass": 12000.0})[0]
            np.float64(12000.0)
        """
        p = self.p_start.copy()
        for i, value in placed_values(values, self._p_variables).items():
            p[i] = value
        return p

    @cached_property
    def composite(self) -> TwinFunction:
        """p -> mass [kg], barycentre (3,) [m], inertia (3, 3) [kg m2], pmi (3,) [m2].

        Example:
            >>> float(twin.composite(p=twin.p_start)["mass"])
            479500.0
        """
        parts = {name: self._c[where] for name, where in composite_slices().items()}
        with simplification(False):
            results = {
                "mass": parts["mass"],
                "barycentre": parts["barycentre"],
                "inertia": from_upper_triangle(parts["inertia"]),
                "pmi": parts["pmi"],
            }
        return self._function("composite", {"p": self.p}, results)

    @cached_property
    def ode(self) -> TwinFunction:
        """x, u, p -> x_dot, of the size of x; right for an attitude of any length.

        Example:
            >>> twin.ode(twin.x_start, [0, 0, 100], twin.p_start).shape
            (7, 1)
        """
        with simplification(False):
            rate = self._model.ode(self.x, self._turning_inputs, self._c)
        return self._function("ode", self._at, {"x_dot": rate}, unit=False)

    @cached_property
    def longest_step(self) -> TwinFunction:
        """x, u, p -> h_max, the longest sub-step [s] that the FMU takes from x by "rk4".

        Infinite at rest without torque, with derivatives 0. Without torque it has a kink in u: its derivative
        there is 0, the mean of those to either side.

        Example:
            >>> round(float(twin.longest_step(twin.x_start, [0, 0, 0], twin.p_start)), 2)
            45.02
        """
        with simplification(False):
            longest = self._model.steps.longest_step(self.x, self._turning_inputs, self._c)
        return self._function("longest_step", self._at, {"h_max": longest}, unit=False)

    @cached_property
    def step(self) -> TwinFunction:
        """x, u, p, h -> x_next, attitude at unit length, by one step of the scene's propagator.

        Of "auto" by the method that it takes with torque. Where a problem's first attitude is of unit length,
        |q| = 1 is no constraint to add: it would depend on the others.

        Example:
            >>> states = twin.step.mapaccum(50)(x=twin.x_start, u=[0, 0, 100], h=0.1)["x_next"]
            >>> states.shape
            (7, 50)
        """
        with simplification(False):
            end, _ = self._stepped(self._place, self._c, self._a)
        return self._function("step", self._at | {"h": self.h}, {"x_next": end})

    @cached_property
    def outputs(self) -> TwinFunction:
        """x, u, p -> y, the FMU's outputs but those of past steps and changes.

        These are error_estimate, error_bound and the jumps of the barycentre. Outputs of a vessel that leaves
        are 0 at once.

        Example:
            >>> y = twin.outputs(twin.x_start, [0, 0, 0], twin.p_start)
            >>> y.numel() == len(twin.y_names)
            True
        """
        with simplification(False):
            y = self._model.outputs(self.x, self._turning_inputs, self._c, self._a, 0.0)
        shown = [i for i, name in enumerate(self._model.names.y) if name in self.y_names]
        return self._function("outputs", self._at, {"y": y[shown]}, unit=False)

    @cached_property
    def change(self) -> TwinFunction:
        """x, p, p_next -> x_next: what becomes of the state when the inputs p change, at one instant.

        What undocks leaves with its share; masses, then poses change and keep rate or momentum as the scene
        says; what docks brings its momentum along, moving as the inputs of motion at contact in p_next say.
        NaN where what is joined has no moment of inertia when masses or poses change and keep the momentum,
        which the FMU refuses.

        Example:
            >>> moved = twin.p_with({"DG.nose.position": [5.0, -0.49, -10.076]})
            >>> x_next = twin.change(twin.x_start, twin.p_start, moved)
            >>> bool(x_next[5] < twin.x_start[5])  # the ship is farther out: the same momentum, a lower rate
            True
        """
        model, p_next = self._model, ca.SX.sym("p_next", self.p.numel())
        shaping, rates = len(model.names.p), self.x[4:]
        omega = rates[:3]
        after = ca.substitute(self._inputs, self.p, p_next)
        if model.change is not None:
            inputs = (rates, self._inputs[:shaping], after[:shaping], self._contact(after))
            with simplification(False):
                margins = composite_slices()["margins"]
                omega = followed(model.resolved, model.change, model.composite, margins, inputs)
        x_next = ca.vertcat(self.x[:4], omega, rates[3:])
        return self._function("change", {"x": self.x, "p": self.p, "p_next": p_next}, {"x_next": x_next})

    @cached_property
    def error_bound(self) -> TwinFunction:
        """x, bound, u, p, h -> bound_next: what law and method are off by at most, over a `step` from x.

        bound : (2,), of the difference from the motion of the law "tensor", exactly integrated, with the same
                inputs: angle [rad] between the attitudes; difference e of the rates in the energy norm
                sqrt(e . J e) [J^(1/2)], so that |e| is at most that over sqrt(J_min). [0, 0] where both
                begin alike

        Proven for any h, up to rounding, which is allowed for; a long step gives a larger bound than many
        short ones, an infinite one where the remainder of "rk4", "taylor" or "dop853" is not known ("dop853":
        beyond some 0.015 rad; in a field of gravity earlier, all after some seconds to a minute of a low
        orbit). Of "exact" rounding alone is counted. It is large, and useless, where the motion itself is
        sensitive: over tens of radians of a tumble. Where p changes between steps, `error_bound_change` comes
        first. Not meant to be differentiated. Derivation, and what it rests on: model/docs/error_bound.md.
        Raises ValueError for "split", whose steps have no bound, for a scene with wheels or flows, and for
        the law "none" in a field of gravity.

        Example:
            >>> bound = twin.error_bound(twin.x_start, [0, 0], [0, 0, 100], twin.p_start, 0.1)
            >>> bool(bound[0] < 1e-12)  # the law "tensor" leaves nothing out: method and rounding alone
            True
        """
        self.refuse_unbounded("error_bound")
        bound = ca.SX.sym("bound", 2)
        parts = {name: self._c[place] for name, place in self._model.slices.composite.items()}
        end = bound_over_step(self._model, parts, bound, (self.x, self._turning_inputs, self.h))
        arguments = {"x": self.x, "bound": bound, "u": self.u, "p": self.p, "h": self.h}
        return self._function("error_bound", arguments, {"bound_next": end})

    @cached_property
    def error_bound_change(self) -> TwinFunction:
        """x, bound, p, p_next -> bound_next: `error_bound` over a change of the inputs p at one instant.

        x : before the change, see `change`
        A mass that goes up and down makes the bound of the rate larger each time. The true motion keeps
        what the scene says for the law "tensor". Raises ValueError for a scene with wheels or flows.

        Example:
            >>> lighter = twin.p_with({"DG.mass": 12000.0})
            >>> bound = twin.error_bound_change(twin.x_start, [0, 1], twin.p_start, lighter)
            >>> bool(bound[1] <= 1.0)  # the rates stay, and so does their difference; the moments shrink
            True
        """
        self.refuse_unbounded("error_bound_change")
        p_next, bound = ca.SX.sym("p_next", self.p.numel()), ca.SX.sym("bound", 2)
        shaping = len(self._model.names.p)
        following = ca.substitute(self._inputs, self.p, p_next)
        inputs = (self._inputs[:shaping], following[:shaping], self._contact(following))
        end = bound_over_change(self._model, self.x[4:], bound, inputs)
        arguments = {"x": self.x, "bound": bound, "p": self.p, "p_next": p_next}
        return self._function("error_bound_change", arguments, {"bound_next": end})

    def refuse_unbounded(self, what: str) -> None:
        """Raises ValueError where the scene has wheels or flows, which `what` does not know.

        Example:
            >>> twin.refuse_unbounded("my bound")
        """
        known = {"wheels": self.scene.wheels, "flows of propellant": self.scene.inputs.flow}
        for kind, names in known.items():
            if names:
                raise ValueError(
                    f'{what}: scene "{self.scene.name}" has {kind}, which the bound does not know'
                )

    def rollout(self, count: int) -> TwinFunction:
        """Returns the function x, u (m, N), p, h -> x_next (n, N) of N steps under one p.

        The composite is computed once: a step costs less than one of `step.mapaccum`, whose p may change
        at each. The numbers are the same; of "exact" each state is found from the first one, as in the FMU,
        so that roundings do not pile up. Its doublings are as many more as N steps of the room of one take,
        and it is NaN from the first torque on.

        Example:
            >>> states = twin.rollout(50)(x=twin.x_start, u=[0, 0, 100], h=0.1)["x_next"]
            >>> states.shape
            (7, 50)
        """
        if not isinstance(count, int) or count < 1:
            raise ValueError(f"rollout: {count!r} steps: must be a whole number from 1")
        x, u = ca.MX.sym("x", self.x.numel()), ca.MX.sym("u", self.u.numel(), count)
        p, h = ca.MX.sym("p", self.p.numel()), ca.MX.sym("h")
        always_free = self._model.plan.method is None
        more = (count - 1).bit_length() if always_free else 0
        c, a = (ca.SX.sym(name, part.numel()) for name, part in (("c", self._c), ("a", self._a)))
        place = ca.SX.sym("place", self._place.numel())
        with simplification(False):
            end = ca.vertcat(*self._stepped(place, c, a, more))
        numbers = ca.vertcat(c, a)
        used = [i for i, needed in enumerate(ca.which_depends(end, numbers, 1, False)) if needed]
        state = ca.vertcat(self.x, place)
        step = ca.Function("step_of_composite", [state, self.u, numbers[used], self.h], [end])
        composite = ca.Function("numbers", [self.p], [ca.densify(ca.vertcat(self._c, self._a)[used])])
        known = ca.repmat(composite(p), 1, count)
        begun = ca.vertcat(x, ca.Function("place", [self.p], [self._place])(p))
        if always_free:
            so_far = ca.cumsum(ca.fabs(u), 1) if self.u_names else u
            states = step.map(count)(
                ca.repmat(begun, 1, count), so_far, known, h * ca.DM(range(1, count + 1)).T
            )
        else:
            states = step.mapaccum(count)(begun, u, known, ca.repmat(h, 1, count))
        states = states[: self.x.numel(), :]
        return self._checked(ca.Function("rollout", [x, u, p, h], [states], ["x", "u", "p", "h"], ["x_next"]))

    @property
    def _at(self) -> dict[str, ca.SX]:
        return {"x": self.x, "u": self.u, "p": self.p}

    def _function(
        self, name: str, arguments: Mapping[str, ca.SX], results: Mapping[str, ca.SX], unit: bool = True
    ) -> TwinFunction:
        function = ca.Function(name, [*arguments.values()], [*results.values()], [*arguments], [*results])
        return self._checked(function, unit)

    def _checked(self, function: ca.Function, unit: bool = True) -> TwinFunction:
        defaults = {"u": np.zeros(len(self.u_names)), "acceleration_ref": np.zeros(self.x.numel() - 4)}
        defaults |= {"p": self.p_start, "p_next": self.p_start}
        return TwinFunction(function, defaults, unit)

    def _contact(self, inputs: ca.SX) -> ca.SX:
        """Returns the motion at contact, k, of all inputs that the twin's p stands for."""
        first = len(self._model.names.p)
        return inputs[first : first + len(self._model.names.k)]

    def _stepped(self, place: ca.SX, c: ca.SX, a: ca.SX, more: int = 0) -> tuple[ca.SX, ca.SX]:
        """Returns state and place in the field after h by the scene's method.

        place : position [m] and velocity [m/s] in a field of gravity, (6,), or (0,)
        c, a  : the composite and its axes
        more  : doublings of free motion, beyond the twin's own
        """
        model = self._model

        def free(x: ca.SX) -> ca.SX:
            axes = a[model.slices.axes["free"]]
            end = free_step(x, axes[:3], ca.reshape(axes[3:], 3, 3), self.h, self.doublings + more)
            return end + _zero_without_derivative_at_equal(axes[:3])

        def stepped(x: ca.SX, place: ca.SX) -> tuple[ca.SX, ca.SX]:
            results = model.steps.step.call([x, ca.vertcat(self.u, place), c, self.h])
            return results[0], results[2] if model.has_field else place

        if model.plan.method is None:
            pushed = ca.norm_1(self.u) > 0.0 if self.u_names else ca.SX(0.0)
            if model.has_field:
                pushed = ca.SX(1.0)
            return free(self.x) + ca.if_else(pushed, ca.SX.nan(), 0.0), place
        kicked, moved = stepped(self.x, place)
        if model.plan.free == "between kicks":
            return stepped(free(kicked), moved)[0], moved
        return kicked, moved


def _zero_without_derivative_at_equal(moments: ca.SX) -> ca.SX:
    """Returns 0; its derivative is NaN where moments, (3,), ascending, are too close to tell axes by.

    That is, NaN times a change of the moments, but 0 where they do not change: CasADi's forward mode carries
    changes that are 0 along, and 0 times a NaN would be one.
    """
    if moments.is_constant():
        return ca.SX(0.0)
    least = ca.fmin(moments[1] - moments[0], moments[2] - moments[1])
    close = least <= GAP * moments[2]

    def zero(whole: ca.SX) -> ca.SX:
        """Whole numbers are their own floor, whose derivative is 0: this changes as they do, infinitely."""
        return ca.dot(ca.floor(whole), ca.if_else(close, whole - ca.floor(whole), 0.0))

    return zero(MANY * moments) - zero(2.0 * MANY * moments)  # infinity less infinity
