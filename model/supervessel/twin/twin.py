"""The twin: the FMU's own equations as CasADi functions, for control design and estimation."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from supervessel.fmu import communication_step, generate
from supervessel.problems import unknown
from supervessel.rotation.attitude import to_inertial, unit
from supervessel.rotation.dynamics import Dynamics, dynamics_of
from supervessel.rotation.principal import principal
from supervessel.scene.inputs import FLOW
from supervessel.twin.conventions import acados_model, do_mpc_model
from supervessel.twin.error_state import error_rate, retracted, state_error
from supervessel.twin.functions import TwinFunction
from supervessel.twin.linear import discrete_model, linear_model
from supervessel.twin.plant import Plant

FUNCTIONS = (
    "composite",
    "ode",
    "step",
    "longest_step",
    "outputs",
    "change",
    "error_bound",
    "error_bound_change",
    "error",
    "retract",
    "error_ode",
    "linearise",
    "discretise",
    "trim",
    "trim_by_wheels",
    "principal",
    "invariants",
)
"""Names of the twin's functions of fixed form."""


@dataclass(frozen=True)
class Scales:
    """Magnitudes by which the numbers of a problem are divided to be about 1.

    x : of attitude, angular velocity [rad/s] and momenta of wheels [N m s]
    u : (m,), of torques [N m]; the same numbers stand for forces [N]; of flows [kg/s] the mass over the time
    p : (n,), each in the unit of its input
    e : of the error state [rad, rad/s, N m s]
    h : [s]
    """

    x: NDArray[np.float64]
    u: NDArray[np.float64]
    p: NDArray[np.float64]
    e: NDArray[np.float64]
    h: float


class Twin(Plant):
    """CasADi functions of a scene, from the very expressions that its FMU is generated from.

    x = (attitude w, x, y, z; angular velocity [rad/s], body axes), (7,), and behind that the momentum of each
        wheel along its axis [N m s]: seven numbers are told below, each wheel adds one
    u = the inputs that act, torque [N m] first, then motors of wheels [N m], forces [N], torques on vessels
        and flows of propellant [kg/s], (m,)
    p = the FMU's other inputs, (n,), in the order of its model description
    h = step [s]
    e = (error of attitude [rad], of angular velocity [rad/s]) about a reference, body axes, (6,), and behind
        that the difference of each wheel's momentum [N m s]

    `composite`, `ode`, `step`, `longest_step`, `outputs`, `rollout` and `communication_step` give the FMU's
    numbers; `error_bound` and `error_bound_change` bound what law and method are off by; `error`, `retract`,
    `error_ode`, `linearise`, `discretise`, `trim`, `trim_by_wheels`, `principal`, `invariants` are for
    control design. All have named arguments, are made when first used, and check numbers that they are
    called with (`TwinFunction`). p, u, x, h are symbols; p_names, u_names, x_names, y_names the FMU's names,
    structured ones always; p_start and x_start the scene's values.

    Each number of composite, ode, outputs but principal ones, and of a single sub-step of "rk4", "dop853" and
    "taylor" is the FMU's to the last bit: both evaluate the same operations in the same order, and only
    + - * / and the square root occur, which IEEE 754 rounds correctly everywhere. Taylor steps, free motion
    and principal axes agree to a few u (1 + angle turned).

    Directions in p may have any length whose square a double holds. Of p as a whole nothing is checked but
    that it is finite: the FMU refuses a negative mass, parallel port axes, two ships at one port; the twin is
    a formula that an optimiser may take there. `p_with` refuses what an input can never have.

    scene      : from `load_scene`; with `[accuracy]`, as `choose` finds it
    propagator : "rk4" and so on, instead of the scene's
    doublings  : of free motion, "exact" and "split", in a step: room for a phase of FIRST_ANGLE 2^doublings,
                 about the angle turned; where more is needed the step is NaN, as it is beyond 2e9 rad (which
                 the FMU discards) and as is "exact" with a torque
    error_form : "rotvec", "mrp" or "vec", of the attitude's error, see `error`
    fixed      : inputs that shall be numbers, not elements of p: True for all; names, "DG.mass" or
                 "DG.nose.position" for its three elements, for the scene's values; or a dictionary of values

    Derivatives of a step are right wherever values are, with one exception: those of free motion by p need
    principal axes. They are off by about 1e-15/gap, relatively, gap being the least difference of principal
    moments over the largest; where it is below GAP = 1e-8 they are NaN. Steps of the other propagators need
    no axes.

    Example:
        >>> from supervessel import Twin, load_scene
        >>> twin = Twin(load_scene("examples/iss_dg.toml"))
        >>> x_next = twin.step(twin.x_start, [0, 0, 100], twin.p_start, 0.1)
        >>> lighter = Twin(twin.scene, fixed={"DG.mass": 12000.0})
        >>> lighter.p_names[0], len(lighter.p_names)
        ('DG.nose.position[1]', 9)
    """

    @cached_property
    def error(self) -> TwinFunction:
        """x, x_ref -> e, (6,) [rad, rad/s], body axes: error of the attitude, then of the angular velocity.

        x and x_ref are states, (7,), each in its own body axes. The attitude's error, (3,), is of
        q_reference_body = q_ref* q by `error_form`: "rotvec" the rotation vector, "mrp" 4 times the modified
        Rodrigues parameters, "vec" 2 times the vector part; all the same to first order. The error of the
        angular velocity is omega - omega_ref, component by component. q and -q give the same error, so a
        controller takes the shorter way; value, gradient and Hessian are finite everywhere. Used as the
        residual of a least-squares cost it is all that a Gauss-Newton method needs.

        Example:
            >>> twin.error([-0.8, 0, 0, -0.6, 0, 0, 0.5], [1, 0, 0, 0, 0, 0, 0])
            DM([-0, -0, 1.287, 0, 0, 0.5])
        """
        x_ref = ca.SX.sym("x_ref", self.x.numel())
        e = state_error(self.x, x_ref, self.error_form)
        return self._function("error", {"x": self.x, "x_ref": x_ref}, {"e": e})

    @cached_property
    def retract(self) -> TwinFunction:
        """x_ref, e -> x, (7,): the state that has the error e about x_ref; the inverse of `error`.

        x_ref : (7,), e : (6,) [rad, rad/s]. x is NaN for "vec" where the attitude's error is longer than 2.

        Example:
            >>> x = twin.retract(twin.x_start, [0.1, 0, 0, 0, 0, 1e-3])
            >>> [round(v, 12) for v in twin.error(x, twin.x_start).full().ravel().tolist()]
            [0.1, 0.0, 0.0, 0.0, 0.0, 0.001]
        """
        x_ref, e = ca.SX.sym("x_ref", self.x.numel()), ca.SX.sym("e", self.x.numel() - 1)
        x = retracted(x_ref, e, self.error_form)
        return self._function("retract", {"x_ref": x_ref, "e": e}, {"x": x})

    @cached_property
    def error_ode(self) -> TwinFunction:
        """e, u, p, x_ref, acceleration_ref -> e_dot, (6,) [rad/s, rad/s2], about a reference in motion.

        acceleration_ref : (3,) [rad/s2], rate of the components of omega_ref, and of momenta of wheels behind
                           that [N m]; left out it is zero

        Example:
            >>> twin.error_ode(e=[0.1, 0, 0, 0, 0, 0], x_ref=[1, 0, 0, 0, 0, 0, 0.5])["e_dot"][:3]
            DM([0, -0.05, 0])
        """
        size = self.x.numel()
        sizes = (("x_ref", size), ("e", size - 1), ("acceleration_ref", size - 4))
        x_ref, e, a_ref = (ca.SX.sym(*s) for s in sizes)
        x = ca.vertcat(retracted(x_ref, e, self.error_form)[:4], x_ref[4:] + e[3:])
        acceleration = self._model.ode(x, self._turning_inputs, self._c)[4:]
        e_dot = error_rate(e, x_ref[4:7], acceleration, a_ref, self.error_form)
        args = {"e": e, "u": self.u, "p": self.p, "x_ref": x_ref, "acceleration_ref": a_ref}
        return self._function("error_ode", args, {"e_dot": e_dot})

    @cached_property
    def linearise(self) -> TwinFunction:
        """x, u, p -> A (6, 6), B (6, m), E (6, n): e_dot = A e + B du + E dp about x, u, p.

        Each wheel adds a row to all three and a column to A, as it adds a number to e.
        e is the error state, (6,) [rad, rad/s], to first order the same for each form of the error. A model
        of the seven numbers of x has an uncontrollable direction, the length of the attitude; this one has
        not, so that a Riccati equation has a solution.

        Example:
            >>> A, B, E = twin.linearise(twin.x_start, [0, 0, 0], twin.p_start)
            >>> A.shape, B.shape, E.shape
            ((6, 6), (6, 3), (6, 10))
        """
        acceleration = self._model.ode(self.x, self._turning_inputs, self._c)[4:]
        model = linear_model(self.x, self.u, self.p, acceleration)
        return self._function("linearise", self._at, dict(zip("ABE", model, strict=True)))

    @cached_property
    def discretise(self) -> TwinFunction:
        """x, u, p, h -> A (6, 6), B (6, m), E (6, n): e_next = A e + B du + E dp over one `step` from x.

        Each wheel makes them larger as it does those of `linearise`.
        These are derivatives of `step` itself, not the exponential of `linearise`: they hold about any
        trajectory, as exactly as the propagator steps. u and p are held over the step of h [s].

        Example:
            >>> A, B, E = twin.discretise(twin.x_start, [0, 0, 0], twin.p_start, 0.1)
            >>> round(float(A[0, 3]), 6)
            0.1
        """
        end, _ = self._stepped(self._place, self._c, self._a)
        model = discrete_model(self.x, self.u, self.p, end)
        return self._function("discretise", self._at | {"h": self.h}, dict(zip("ABE", model, strict=True)))

    @cached_property
    def trim(self) -> TwinFunction:
        """x, p -> u, (m,), whose torque keeps the angular velocity of x constant; all else in u is zero.

        The torque is omega x (J omega + h), (3,) [N m], body axes, h the momentum of moving ports and of
        wheels, less that of gravity's gradient: a relative equilibrium. Without h and gravity it is zero for
        spins about `principal` axes.

        Example:
            >>> u = twin.trim(twin.x_start, twin.p_start)
            >>> float(ca.norm_inf(twin.ode(twin.x_start, u, twin.p_start)[4:])) < 1e-18
            True
        """
        self.check_torque("trim", otherwise="; for motors of wheels take trim_by_wheels")
        u = ca.vertcat(self._holding_torque, ca.SX.zeros(len(self.u_names) - 3))
        return self._function("trim", {"x": self.x, "p": self.p}, {"u": u})

    @cached_property
    def trim_by_wheels(self) -> TwinFunction:
        """x, p -> u, (m,), whose motors of wheels keep the angular velocity of x constant; all else is zero.

        Of more than three motors the torques of the least sum of squares. They are there as long as the axes
        of the motors lie in no common plane; where under p they do, or docks do not hold enough of their
        vessels to the root, the result means nothing. Raises ValueError where it is so at the start.

        Source: [EQ] Wheels, eq. (17) with omega' = 0: B u = -torque, u = -B^T (B B^T)^-1 torque, with the
        axes b_w as columns of B.

        Example:
            >>> from supervessel import Twin, load_scene
            >>> twin = Twin(load_scene("examples/station_momentum.toml"))
            >>> u = twin.trim_by_wheels(twin.x_start, twin.p_start)
            >>> float(ca.norm_inf(twin.ode(twin.x_start, u, twin.p_start)[4:7])) < 1e-18
            True
        """
        wheels = self._dynamics.wheels
        # columns of what is no motor are 0
        axes = ca.SX(3, 0) if wheels is None else ca.jacobian(wheels.reaction, self.u)
        at_start = np.array(ca.Function("axes", [self.p], [axes])(self.p_start))
        if not at_start.size or np.linalg.matrix_rank(at_start) < 3:
            raise ValueError(
                f'trim_by_wheels: scene "{self.scene.name}" needs motors of wheels, listed in inputs.wheel, '
                "whose axes lie in no common plane at the start"
            )
        u = -axes.T @ ca.solve(axes @ axes.T, self._holding_torque)
        return self._function("trim_by_wheels", {"x": self.x, "p": self.p}, {"u": u})

    @cached_property
    def _holding_torque(self) -> ca.SX:
        """The torque, (3,) [N m], body axes, under which the angular velocity of x stays: see `trim`."""
        omega = self.x[4:7]
        torque = ca.cross(omega, self._turning @ omega + self._spin)
        field = self._dynamics.field
        return torque if field is None else torque - field.torque(self.x[:4], self._place[:3])

    @cached_property
    def principal(self) -> TwinFunction:
        """p -> moments (3,) [kg m2], ascending, and axes (3, 3), R_body_principal, of the law's tensor.

        The law's tensor is J for "tensor", its diagonal for "principal", the unit tensor for the others. A
        spin about a column of axes needs no torque: about the first and last it is stable, about the middle
        one it is not. With wheels it is J less what they have about their axes, and that holds where they
        hold no momentum.

        Example:
            >>> moments, axes = twin.principal(twin.p_start)
            >>> spin = ca.vertcat(1, 0, 0, 0, 0.01 * axes[:, 2])
            >>> float(ca.norm_inf(twin.ode(spin, [0, 0, 0], twin.p_start)[4:])) < 1e-18
            True
        """
        moments, axes = principal(self._turning)
        return self._function("principal", {"p": self.p}, {"moments": moments, "axes": axes})

    @cached_property
    def invariants(self) -> TwinFunction:
        """x, p -> kinetic_energy [J], angular_momentum (3,) [N m s], inertial axes: constant without torque.

        Gravity's gradient is a torque: along an orbit neither is constant.

        Both are formed with the law's tensor, as in `principal`: "decoupled" and "none" keep the angular
        velocity itself, and the unit tensor stands for J. Momenta of wheels are part of the angular momentum,
        not of the energy, which is constant where no motor acts.

        Example:
            >>> round(float(twin.invariants(twin.x_start, twin.p_start)[0]), 3)
            198.191
        """
        omega = self.x[4:7]
        momentum = self._turning @ omega
        results = {
            "kinetic_energy": 0.5 * ca.dot(omega, momentum),
            "angular_momentum": to_inertial(unit(self.x[:4]), momentum + self._spin),
        }
        return self._function("invariants", {"x": self.x, "p": self.p}, results)

    def scales(self, time: float) -> Scales:
        """Returns magnitudes for a manoeuvre that turns the body by about 1 rad in `time` [s].

        Example:
            >>> scales = twin.scales(60.0)
            >>> scaled = ca.SX.sym("u", 3)  # about 1
            >>> x_dot = twin.ode(x=twin.x, u=scales.u * scaled, p=twin.p)["x_dot"] / scales.x
        """
        if not (np.isfinite(time) and time > 0.0):
            raise ValueError(f"scales: time = {time!r} s: must be positive")
        rate = np.full(3, 1.0 / time)
        moment = float(ca.trace(self.composite(self.p_start)[2])) / 3.0
        mass = float(self.composite(self.p_start)[0])
        by_kind = (mass / time if v.kind is FLOW else moment / time**2 for v in self.u_variables)
        torque = np.fromiter(by_kind, dtype=np.float64)
        groups = [variable.group for variable in self._p_variables]
        p = [
            max(abs(v) for v, g in zip(self.p_start, groups, strict=True) if g == group) or 1.0
            for group in groups
        ]
        moving = [*rate, *[moment / time] * len(self.scene.wheels)]
        return Scales(np.array([1.0] * 4 + moving), torque, np.array(p), np.array([1.0] * 3 + moving), time)

    def check_torque(self, what: str, *, motors: bool = False, otherwise: str = "") -> None:
        """Raises ValueError where the scene has no torque input, which `what` needs.

        motors    : whether a motor of a wheel does as well
        otherwise : what else to do where the scene has such motors, end of the message

        Example:
            >>> twin.check_torque("my controller")
        """
        inputs = self.scene.inputs
        if not (inputs.torque or (motors and inputs.wheel)):
            raise ValueError(
                f'{what}: scene "{self.scene.name}" has no torque input; put "torque = true" under [inputs]'
                + (otherwise if inputs.wheel else "")
            )

    @cached_property
    def _spin(self) -> ca.SX:
        """h, (3,) [N m s], body axes, of moving parts and wheels; zero where the law has no gyroscopic
        term."""
        held = self._dynamics.held_momentum(self.x)
        return ca.SX.zeros(3) if held is None else held

    @cached_property
    def _dynamics(self) -> Dynamics:
        """The quantities in the equation of rotation under u and p."""
        parts = {name: self._c[place] for name, place in self._model.slices.composite.items()}
        return dynamics_of(self._model.resolved, parts, self._turning_inputs)

    @cached_property
    def _turning(self) -> ca.SX:
        """The tensor, (3, 3) [kg m2], body axes, whose free motion is the law's: `RotationLaw.turning`."""
        return self._dynamics.law.turning(self._dynamics.turning)

    def generate(
        self,
        folder: str | PathLike[str],
        functions: Iterable[str | ca.Function] = ("composite", "ode", "step", "outputs"),
        *,
        derivatives: int = 1,
    ) -> dict[str, ca.Function]:
        """Returns functions by name, compiled to machine code and loaded back as `ca.external`.

        folder      : of the C file and the library, made if need be; unchanged C is not compiled again
        functions   : names of functions of this twin, or CasADi functions such as `twin.rollout(20)`
        derivatives : highest order of the derivatives that are compiled too: 0, 1, or 2 for exact Hessians
        The compiled functions return the same numbers to the last bit where only + - * / and the square root
        occur.
        Raises ValueError for an unknown name, BuildError if the compiler of package fmu_build fails.

        Example:
            >>> step = twin.generate("build/twin", ["step"], derivatives=0)["step"]
            >>> at = twin.x_start, [0, 0, 100], twin.p_start, 0.1
            >>> float(ca.norm_inf(step(*at) - twin.step(*at)))
            0.0
        """
        if isinstance(functions, str | ca.Function):
            functions = (functions,)
        chosen = [self._named(f) if isinstance(f, str) else f for f in functions]
        compiled = generate(chosen, Path(folder), f"{self.scene.name}_twin", derivatives)
        return {
            f.name(): f.like(c) if isinstance(f, TwinFunction) else c
            for f, c in zip(chosen, compiled, strict=True)
        }

    def communication_step(self, folder: str | PathLike[str], sub_steps: int = 1) -> TwinFunction:
        """Returns the function x, u, p, h -> x_next of a whole communication step, by the FMU's own C.

        The step is that of an FMU started at x under p, to the last bit: its sub-steps, its control of the
        error, its choice under "auto". (An FMU counts free motion over several steps from its beginning; a
        later step then differs in the last bits.) Where the FMU refuses a step, the call raises RuntimeError
        and writes the reason to stderr: h <= 0, a torque for "exact", inputs that make no rigid body, too
        many sub-steps. The function is compiled: `generate` refuses functions that call it.

        folder    : of the library, made if need be; an unchanged library is not compiled again
        sub_steps : number of equal steps of `step` whose derivatives, of any order, the function has. They
                    are derivatives of the value itself, to rounding, where the FMU takes the same sub-steps;
                    else they are as accurate as steps of that size
        Raises ValueError for a count below 1, BuildError if the compiler of package fmu_build fails.

        Example:
            >>> step = twin.communication_step("build/twin")
            >>> states = step.mapaccum(5)(x=twin.x_start, u=[0, 0, 100], h=120.0)["x_next"]
            >>> states.shape
            (7, 5)
        """
        if not isinstance(sub_steps, int) or sub_steps < 1:
            raise ValueError(f"communication_step: {sub_steps!r} sub-steps: must be a whole number from 1")
        compiled = communication_step(self.scene, Path(folder))
        sizes = {name: self.step.size1_in(name) for name in self.step.name_in()}
        at = {name: ca.MX.sym(name, size) for name, size in sizes.items()}
        held, size = ca.repmat(at["u"], 1, sub_steps), at["h"] / sub_steps
        if self._model.has_field:
            end = self.rollout(sub_steps)(at["x"], held, at["p"], size)[:, -1]
        else:
            columns = (held, ca.repmat(at["p"], 1, sub_steps), ca.repmat(size, 1, sub_steps))
            end = self.step.fold(sub_steps)(at["x"], *columns)
        blocks = [ca.jacobian(end, known) for known in at.values()]
        jacobian = ca.Function(
            f"jac_{compiled.name()}", [*at.values(), ca.MX.sym("x_next", self.x.numel())], blocks
        )
        inputs = ca.Function("inputs", [self.p], [self._inputs])(at["p"])
        first = len(self._model.names.p) + len(self._model.names.k)  # of the place in a field of gravity
        x_next = compiled(at["x"], ca.vertcat(at["u"], inputs[first:, :]), inputs[:first, :], at["h"])
        options: Any = {"custom_jacobian": jacobian, "enable_forward": False, "enable_reverse": False}
        step = ca.Function(compiled.name(), [*at.values()], [x_next], [*at], ["x_next"], options)
        return self._checked(step)

    def to_acados(self, step: float | None = None) -> Any:
        """Returns the plant as `acados_template.AcadosModel`: x, u, p, explicit and implicit ode.

        step : [s], for discrete dynamics, disc_dyn_expr, by `step`
        Raises ImportError without acados_template, ValueError for a scene without torque and motor inputs.

        Example:
            >>> model = twin.to_acados(step=0.5)  # doctest: +SKIP
        """
        self.check_torque("to_acados", motors=True)
        return acados_model(self, step)

    def to_do_mpc(self, step: float | None = None) -> Any:
        """Returns the plant as `do_mpc.model.Model`, not yet set up: states attitude and angular_velocity.

        With wheels their momenta are a state too, momentum. Input torque (u where others act too), parameter
        p. Add what your cost needs, then call its setup().
        step : [s], for a discrete model by `step`; None: a continuous one
        Raises ImportError without do_mpc, ValueError for a scene without torque and motor inputs.

        Example:
            >>> model = twin.to_do_mpc(step=0.5)  # doctest: +SKIP
        """
        self.check_torque("to_do_mpc", motors=True)
        return do_mpc_model(self, step)

    def to_dae(self) -> dict[str, ca.SX]:
        """Returns the plant as `ca.integrator` takes it: x, u, p, ode.

        Example:
            >>> flow = ca.integrator("flow", "cvodes", twin.to_dae(), 0.0, 1.0)
            >>> flow(x0=twin.x_start, u=[0, 0, 100], p=twin.p_start)["xf"].shape
            (7, 1)
        """
        return {"x": self.x, "u": self.u, "p": self.p, "ode": self.ode(self.x, self.u, self.p)}

    def _named(self, name: str) -> TwinFunction:
        """Returns one of the functions by its name."""
        if name not in FUNCTIONS:
            raise ValueError(f"generate: {unknown('function', name, FUNCTIONS)}")
        function: TwinFunction = getattr(self, name)
        return function
