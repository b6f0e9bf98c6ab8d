"""Steps in time as functions: a scene's method, how long its steps may be, and exact free motion."""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca

from supervessel.rotation.axes import AxesGraph
from supervessel.rotation.dynamics import Dynamics, SpunWheels
from supervessel.rotation.error_bound.remainder import has_sure_remainder
from supervessel.rotation.lengths import smooth_length, smooth_root
from supervessel.rotation.propagators import PROPAGATORS, Plan
from supervessel.rotation.propagators.bound import fastest_square, longest_step, stretched
from supervessel.rotation.propagators.exact import free_functions, free_functions_of_start
from supervessel.rotation.propagators.method import Step, StepSymbols
from supervessel.rotation.rounding import turned_by_rounding
from supervessel.scene.schema import Scene


@dataclass(frozen=True)
class StepFunctions:
    """Steps of a scene in time: x is (attitude, angular velocity, momenta of wheels), u the inputs that act,
    c the composite.

    fastest_square : x, u, c -> square [rad2/s2] of a rate that the body does not exceed while it turns by the
                     scene's largest angle of a sub-step
    longest_step   : x, u, c -> that angle over that rate [s], with derivatives at rest and without torque too
    step           : x, u, c, h -> x after one sub-step of h [s]; its second result is the estimated error,
                     (2,), where the method is controlled by it or the scene shows it; in a field of gravity
                     its third one is position [m] and velocity [m/s] afterwards, (6,)
    error_exponent : power of h with which the estimated error grows
    propagation    : the functions that the scene's co-simulation uses: of fastest_square and step as many as
                     its method needs, with wheels or jet damping always the first; by_torque: u, c -> angular
                     acceleration by the torque alone, (3,) [rad/s2], for Taylor steps, with jet damping
                     damping: u, c -> `Dynamics.slowing`, and with wheels held, see `_held_function`;
                     free_...: exact free motion, see `propagators.exact`; rounding: x, u,
                     c, h -> angle [rad] by which rounding of the tensor turns the body in h, where the scene
                     shows its error and the law has a gyroscopic term
    """

    fastest_square: ca.Function
    longest_step: ca.Function
    step: ca.Function
    error_exponent: int
    propagation: tuple[ca.Function, ...]


def step_functions(
    scene: Scene, plan: Plan, dynamics: Dynamics, symbols: tuple[ca.SX, ca.SX, ca.SX], axes: AxesGraph
) -> StepFunctions:
    """Returns the steps of a scene.

    symbols : x, u and c, of which `dynamics` is made
    A scene that has exact free motion alone is given the step of dop853, which its co-simulation never takes.
    """
    h = ca.SX.sym("h")
    shown = "error_estimate" in scene.outputs.names
    has_sure = has_sure_remainder(scene.rotation, in_orbit=dynamics.field is not None)
    estimated = shown or ("error_bound" in scene.outputs.names and not has_sure)
    state, rate = _extended(symbols[0], dynamics)
    motion = StepSymbols(
        state,
        rate,
        dynamics.law,
        dynamics.numbers,
        dynamics.body_torque,
        h,
        scene.rotation.tolerance,
        estimated,
        dynamics.field,
        dynamics.wheels,
        dynamics.slowing,
    )
    method = plan.method or PROPAGATORS["dop853"]
    assert method.build is not None
    built = method.build(motion)
    rate_square = _rate_function(scene.rotation.max_angle_step, motion, dynamics, symbols)
    longest = _longest_step_function(scene.rotation.max_angle_step, motion, dynamics, symbols)
    step = _step_function(built, symbols, h)
    series = [
        ca.Function(
            "by_torque", [*symbols[1:]], [motion.acceleration_by_torque], ["u", "c"], ["acceleration"]
        )
    ]
    rounding = [_rounding_function(motion, dynamics, symbols, h)] if shown and dynamics.law.products else []
    needed = {"angle": (rate_square, step), "error": (step,), "series": tuple(series)}
    if motion.slowing is not None:
        series.append(ca.Function("damping", [*symbols[1:]], [motion.slowing], ["u", "c"], ["slowing"]))
    if dynamics.wheels is not None:
        series.append(_held_function(dynamics.wheels, symbols))
    if dynamics.wheels is not None or motion.slowing is not None:
        needed |= {"error": (step, rate_square), "series": (*series, rate_square)}
    stepping = needed[plan.method.control] if plan.method else ()
    return StepFunctions(
        rate_square, longest, step, built.exponent, (*stepping, *_free_motion(plan, axes), *rounding)
    )


def _held_function(wheels: SpunWheels, symbols: tuple[ca.SX, ca.SX, ca.SX]) -> ca.Function:
    """Returns held: x, u, c -> S = sum of h_w b_w [N m s], S' [N m], both in body axes, and h_w' [N m]."""
    held = ca.densify(ca.vertcat(wheels.momentum(symbols[0][7:]), wheels.reaction, wheels.rate))
    return ca.Function("held", [*symbols], [held], ["x", "u", "c"], ["held"])


def _extended(x: ca.SX, dynamics: Dynamics) -> tuple[ca.SX, Callable[[ca.SX], ca.SX]]:
    """Returns the state that a step carries on, and its rate as a function of it; see `StepSymbols`."""
    field, size = dynamics.field, x.numel()
    if field is None:
        return x, dynamics.state_rate

    def rate(state: ca.SX) -> ca.SX:
        turning, orbit = state[:size], state[size:]
        return ca.vertcat(dynamics.state_rate(turning, orbit[:3]), field.rate(orbit))

    return ca.vertcat(x, field.start), rate


def _rate_function(
    angle: float, motion: StepSymbols, dynamics: Dynamics, symbols: tuple[ca.SX, ca.SX, ca.SX]
) -> ca.Function:
    """Returns fastest_square.

    angle : largest angle of a sub-step [rad]
    """
    square = _fastest_square(angle, motion, dynamics, lambda vector: ca.sqrt(ca.sumsqr(vector)))
    return ca.Function("fastest_square", [*symbols], [square], ["x", "u", "c"], ["rate_square"])


def _fastest_square(
    angle: float, motion: StepSymbols, dynamics: Dynamics, length: Callable[[ca.SX], ca.SX]
) -> ca.SX:
    """Returns the square [rad2/s2] of a rate that the body does not exceed while it turns by `angle` [rad].

    length : a vector -> its length
    In a field of gravity the direction to the centre turns too: relative to it the body turns no faster than
    by the sum of both rates.
    """
    field, omega = motion.field, motion.state[4:7]
    by_torque = length(motion.acceleration_by_torque)
    turning = motion.state if field is None else motion.state[: -field.start.numel()]
    held = dynamics.held_square(turning, angle, length)
    pushed = by_torque
    if field is not None:
        pushed = by_torque + field.largest_acceleration(motion.law, motion.numbers)
    square = fastest_square(omega, pushed, motion.law.growth, angle, held)
    if dynamics.excess is not None:
        square = square * stretched(dynamics.excess, angle)
    if field is None:
        return square
    orbit = field.orbit_rate()
    return square + orbit * (orbit + 2.0 * smooth_root(square))


def _longest_step_function(
    angle: float, motion: StepSymbols, dynamics: Dynamics, symbols: tuple[ca.SX, ca.SX, ca.SX]
) -> ca.Function:
    """Returns longest_step.

    angle : largest angle of a sub-step [rad]
    """
    square = _fastest_square(angle, motion, dynamics, smooth_length)
    return ca.Function("longest_step", [*symbols], [longest_step(square, angle)], ["x", "u", "c"], ["h_max"])


def _step_function(built: Step, symbols: tuple[ca.SX, ca.SX, ca.SX], h: ca.SX) -> ca.Function:
    """Returns the function of a step, with its estimated error where it has one.

    In a field of gravity its third result is where the centre is afterwards, field_next, (6,) [m, m/s]; the
    second one is then zero where there is no estimate.
    """
    size = symbols[0].numel()
    x_next, field_next = built.state[:size], built.state[size:]
    results = {"x_next": x_next} | ({} if built.error is None else {"error": built.error})
    if field_next.numel():
        results = {"x_next": x_next, "error": results.get("error", ca.SX.zeros(2)), "field_next": field_next}
    return ca.Function("step", [*symbols, h], [*results.values()], ["x", "u", "c", "h"], [*results])


def _rounding_function(
    motion: StepSymbols, dynamics: Dynamics, symbols: tuple[ca.SX, ca.SX, ca.SX], h: ca.SX
) -> ca.Function:
    """Returns rounding."""
    turning = dynamics.law.turning(dynamics.turning)
    angle = turned_by_rounding(turning, motion.state[4:7], motion.acceleration_at_start, h)
    return ca.Function("rounding", [*symbols, h], [angle], ["x", "u", "c", "h"], ["angle"])


def _free_motion(plan: Plan, axes: AxesGraph) -> list[ca.Function]:
    """Returns the functions of exact free motion that a plan uses."""
    if plan.free == "never":
        return []
    functions = free_functions(axes.a.numel(), axes.slices["free"])
    if plan.free in ("always", "while free"):
        functions += free_functions_of_start(axes.a.numel(), axes.slices["free"])
    return functions


def map_of_products(dynamics: Dynamics) -> ca.SX:
    """Returns the linear map, (3, n), of products of two rates to the acceleration without torque, body axes.

    n is the number of the law's `products`. Where body axes are principal axes the squares of rates have no
    effect: their columns are left out, and n is 3.
    """
    products = dynamics.law.gyroscopic(dynamics.numbers)
    count = products.size2()
    diagonal = all(products[i, j].is_zero() for i in range(3) for j in range(count) if i != j)
    return ca.densify(products[:, :3] if diagonal and count else products)
