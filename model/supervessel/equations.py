"""The equations of one scene as CasADi functions: what the FMU is generated from and what the twin evaluates.

Symbols, each a column vector; units and axes are those of the FMU's variables:

    p : the inputs that shape the composite: masses [kg], moments [m2], poses and motions of ports, docks
    k : the motion with which parts dock, velocities [m/s] and rates [rad/s]
    u : the inputs that torques follow from: torques [N m] and forces [N], then position [m] and velocity
        [m/s] in a field of gravity
    x : the state, (7 + n,): attitude q_inertial_body, angular velocity [rad/s], body axes, and momentum of
        each of n wheels along its axis [N m s]
    z : the state of model exchange, (7 + n,): x, or angular momentum [N m s], body axes, in place of angular
        velocity where every change of inputs keeps it; see `rotation.exchange`
    c : everything that follows from p alone, see `composite.parts`
    a : principal moments and axes, which follow from c, see `rotation.axes`
    e : (2,) [rad], estimated error of the last communication step, and bound of the error since the start,
        which the outputs error_estimate and error_bound show
    y : the outputs in the scene's order, see `scene.outputs`

c is computed when p changes; a is computed when it is needed and c has changed. An element of c that is
constant in this scene is a number in the functions of c: they do not read that element of the argument.
Source of the equations: model/docs/equations.md, cited as [EQ] with the title of a section and the
number of an equation.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import casadi as ca

from supervessel.composite.parts import (
    COMPOSITE_SIZES,
    CompositeGraph,
    composite_graph,
    composite_parts,
    composite_slices,
)
from supervessel.composite.resolved import ResolvedScene, resolve
from supervessel.composite.start import composite_at_start, p_start
from supervessel.derivatives import GivenDerivative, derivatives, derivatives_of
from supervessel.output_expressions import outputs_of
from supervessel.rotation.axes import axes_derivative, axes_graph
from supervessel.rotation.changes import Change, change_functions
from supervessel.rotation.dynamics import dynamics_of
from supervessel.rotation.error_bound.functions import bound_functions
from supervessel.rotation.exchange import ExchangeStates, states_by_momentum, states_by_rate
from supervessel.rotation.hand_over import HandOver, hand_over
from supervessel.rotation.propagators import Plan, plan_of
from supervessel.rotation.steps import StepFunctions, map_of_products, step_functions
from supervessel.scene.schema import Scene, changes_rate, keeps_momentum
from supervessel.shell.interrupts import interrupt_afterwards
from supervessel.simplification import simplification

__all__ = [
    "COMPOSITE_SIZES",
    "Equations",
    "composite_at_start",
    "composite_parts",
    "composite_slices",
    "equations",
    "p_start",
    "simplification",
]


@dataclass(frozen=True)
class VariableNames:
    """Names that the FMU gives to the elements of p, k, u, z and y."""

    p: tuple[str, ...]
    k: tuple[str, ...]
    u: tuple[str, ...]
    z: tuple[str, ...]
    y: tuple[str, ...]


@dataclass(frozen=True)
class Slices:
    """The places of the parts of c (`composite`) and of a (`axes`), by name."""

    composite: Mapping[str, slice]
    axes: Mapping[str, slice]


@dataclass(frozen=True)
class ExchangeFunctions:
    """Functions of the states z of model exchange.

    ode      : z, u, c -> rate of z [1/s, rad/s2 or N m]
    outputs  : z, u, c, a, e -> y
    forward  : z, u, c, a, then small changes of z, u, c -> changes of the rate of z and of y
    reverse  : z, u, c, a, then weights of the rate of z and of y -> weights of z, u, c
    """

    ode: ca.Function
    outputs: ca.Function
    forward: ca.Function
    reverse: ca.Function


@dataclass(frozen=True)
class Equations:
    """Functions and names of one scene; the module says what the symbols are.

    resolved        : the scene
    plan            : the method of its co-simulation
    names           : of the elements of p, k, u, z and y
    slices          : places of the parts of c and a
    composite_graph : p and c in symbols
    composite       : p -> c
    axes            : c -> a
    ode             : x, u, c -> rate of x [1/s, rad/s2]
    outputs         : x, u, c, a, e -> y
    product_count   : number of products of two rates in the gyroscopic term, see `steps.map_of_products`
    steps           : functions of steps in time
    bound           : functions by which the FMU carries its error_bound, see `rotation.error_bound.functions`
    exchange        : functions of model exchange
    change          : how the angular velocity changes with the inputs; None where it never does
    changing        : the functions of a change that the FMU needs, with derivatives
    hand_over       : what a change hands over to the orbit's owner; None where it is nothing
    has_field       : whether gravity's gradient turns the body
    """

    resolved: ResolvedScene
    plan: Plan
    names: VariableNames
    slices: Slices
    composite_graph: CompositeGraph
    composite: ca.Function
    axes: ca.Function
    ode: ca.Function
    outputs: ca.Function
    product_count: int
    steps: StepFunctions
    bound: tuple[ca.Function, ...]
    exchange: ExchangeFunctions
    change: Change | None
    changing: tuple[ca.Function, ...]
    hand_over: HandOver | None
    has_field: bool

    @cached_property
    def composite_derivatives(self) -> tuple[ca.Function, ca.Function]:
        """composite_forward and composite_reverse, see `derivatives`; made at their first use."""
        with interrupt_afterwards(), simplification(True):
            return derivatives("composite", [self.composite_graph.p], [self.composite_graph.c])

    @property
    def functions(self) -> tuple[ca.Function, ...]:
        """The functions that the FMU needs."""
        return (self.composite, *self._motion, *self.composite_derivatives, *self._responses)

    @property
    def functions_beside_composite(self) -> tuple[ca.Function, ...]:
        """The functions that the FMU needs, without the composite and its derivatives."""
        return (*self._motion, *self._responses)

    @property
    def _motion(self) -> tuple[ca.Function, ...]:
        axes = (self.axes,) if self.slices.axes else ()
        return (self.exchange.ode, self.outputs, *self.steps.propagation, *self.bound, *axes)

    @property
    def _responses(self) -> tuple[ca.Function, ...]:
        handing = () if self.hand_over is None else self.hand_over.functions
        return (self.exchange.forward, self.exchange.reverse, *self.changing, *handing)


@interrupt_afterwards()
@simplification(True)
def equations(scene: Scene) -> Equations:
    """Returns the equations of a scene; what the scene holds constant is folded to numbers.

    Raises ValueError for a scene whose law is still to be chosen, `Scene.is_chosen`.
    """
    plan, resolved = plan_of(scene), resolve(scene)
    names, graph = _names(resolved), composite_graph(resolved)
    k, u, x = (
        ca.SX.sym(*s) for s in (("k", len(names.k)), ("u", len(names.u)), ("x", 7 + len(scene.wheels)))
    )
    c = ca.SX.sym("c", graph.c.numel())
    parts = graph.parts(c)
    dynamics = dynamics_of(resolved, parts, u)
    products = map_of_products(dynamics)
    axes = axes_graph(resolved, plan, dynamics, products)
    a, e = ca.SX.sym("a", axes.a.numel()), ca.SX.sym("e", 2)
    handed = hand_over(resolved, graph.parts, c, (graph.p, k))
    inner = change_functions(resolved, c, graph.parts, graph.p, k) if changes_rate(scene) or handed else None
    change = inner if changes_rate(scene) else None
    if change is not None and keeps_momentum(scene):
        states = states_by_momentum(change, c, dynamics)
    else:
        states = states_by_rate(x, dynamics)

    def outputs_from(state: ca.SX) -> ca.SX:
        shown = a[axes.slices["principal"]] if "principal" in axes.slices else ca.SX.zeros(7)
        of_steps = {"error_estimate": e[0], "error_bound": e[1]}
        return outputs_of(resolved, state, u, parts | {"principal": shown} | of_steps, dynamics)

    axes_change = axes_derivative(dynamics.inertia, c, a, axes.slices)
    return Equations(
        resolved=resolved,
        plan=plan,
        names=names,
        slices=Slices(graph.slices, axes.slices),
        composite_graph=graph,
        composite=ca.Function("composite", [graph.p], [graph.c], ["p"], ["c"]),
        axes=ca.Function("axes", [c], [axes.a], ["c"], ["a"]),
        ode=ca.Function("ode", [x, u, c], [dynamics.state_rate(x)], ["x", "u", "c"], ["x_dot"]),
        outputs=_output_function(x, "x", outputs_from(x), (u, c, a, e)),
        product_count=products.size2(),
        steps=step_functions(scene, plan, dynamics, (x, u, c), axes),
        bound=bound_functions(resolved, plan, graph, axes, (x, u, c)),
        exchange=_exchange_functions(states, outputs_from(states.x), (u, c, a, e), axes_change),
        change=change,
        changing=_changing(scene, inner),
        hand_over=handed,
        has_field=dynamics.field is not None,
    )


def _names(resolved: ResolvedScene) -> VariableNames:
    inputs = (resolved.shaping, resolved.contact, resolved.turning)
    p, k, u, z = (tuple(v.name for v in variables) for variables in (*inputs, resolved.states))
    return VariableNames(p, k, u, z, resolved.output_names)


def _output_function(state: ca.SX, name: str, y: ca.SX, others: tuple[ca.SX, ...]) -> ca.Function:
    """Returns the outputs as a function of a state of this name, and of u, c, a and e."""
    return ca.Function("outputs", [state, *others], [y], [name, "u", "c", "a", "e"], ["y"])


def _exchange_functions(
    states: ExchangeStates, y: ca.SX, others: tuple[ca.SX, ca.SX, ca.SX, ca.SX], axes_change: GivenDerivative
) -> ExchangeFunctions:
    """Returns the functions of model exchange.

    y           : the outputs as expressions of z, u, c, a and e
    others      : u, c, a and e
    axes_change : how a changes with c
    """
    u, c, _, _ = others
    z, name = states.symbols, states.name
    forward, reverse = derivatives("response", [z, u, c], [states.rate, y], axes_change)
    return ExchangeFunctions(
        ode=ca.Function("ode", [z, u, c], [states.rate], [name, "u", "c"], [f"{name}_dot"]),
        outputs=_output_function(z, name, y, others),
        forward=forward,
        reverse=reverse,
    )


def _changing(scene: Scene, change: Change | None) -> tuple[ca.Function, ...]:
    """Returns the functions of a change that the FMU needs, those that it differentiates with derivatives.

    Where the angular momentum is a state of model exchange, it changes by docks alone: without docks the
    derivatives of keep_momentum are not needed.
    """
    if change is None:
        return ()
    docked, by_momentum = bool(scene.inputs.docked), keeps_momentum(scene)
    plain: list[ca.Function] = [change.rate_of_momentum] if by_momentum else []
    differentiated = [change.momentum_of] if by_momentum else []
    if "momentum" in scene.keeps.values():
        (differentiated if docked or not by_momentum else plain).append(change.keep_momentum)
    if docked:
        differentiated += [change.contact_momentum, change.docked_rate]
    return (*plain, *differentiated, *(found for f in differentiated for found in derivatives_of(f)))
