"""The flight of the reference result: how its inputs move, and what comes of them, by a scene's equations.

Fifty communication steps from the scene's start. Masses lose up to a tenth within their range, unless that
would change the rate; flows of propellant grow from nothing to what in that time takes a tenth of their
vessel; the torque grows to what would double the rate at the start, or give 0.01 rad/s; one dock with an
input switches after a third of the time, and back after two thirds, with a rate at contact of a tenth of the
body's; in a field of gravity the body goes on about the centre, its inputs having a row for each
communication point; everything else stays.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, inf, sqrt
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from supervessel.composite.docks import switchable
from supervessel.equations import Equations, composite_slices, p_start
from supervessel.orbit import gravity_inputs, orbit_problem, two_body
from supervessel.rotation.changes import followed
from supervessel.scene.inputs import CONTACT_RATE, FLOW, MASS, TORQUE, part_of, vessel_of
from supervessel.scene.schema import Dock, Mount, Scene
from supervessel.scene.variables import InputVariable

STEPS = 50
SWITCHES = (STEPS // 3, 2 * STEPS // 3)
"""Numbers of the communication steps at whose start a dock switches, and switches back."""
DEFAULT_STEP = 0.1  # s
MOST_SUB_STEPS = 2000
ATTEMPTS = 8
LEFT = 0.9
"""What is left at the end of a mass that an input gives."""
CONTACT = 0.1
"""Rate with which a part docks, over the body's."""

EXCHANGE_ANGLE = 0.01
"""Angle [rad] of a step of the integration of model exchange: RK4's error is some 1e-10 of it in each."""
FEWEST_EXCHANGE_STEPS = 4

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Stimuli:
    """How the inputs move, in the order of the model description, and by which steps.

    step     : communication step [s]
    instants : times [s] of the rows, ascending; two rows at one time are a jump
    rows     : inputs at these times, (n, inputs), linear between the rows
    """

    step: float
    instants: Array
    rows: Array

    @property
    def times(self) -> Array:
        """The communication points [s], (STEPS + 1,)."""
        return self.step * np.arange(STEPS + 1, dtype=np.float64)

    def within(self, begin: float, end: float) -> Callable[[float], Array]:
        """Returns the function time [s] -> inputs over a span of time [s], at its end those before a jump."""
        return lambda time: self.at(time, before=time >= end)

    def at(self, time: float, *, before: bool = False) -> Array:
        """Returns the inputs at a time [s], at a jump those after it.

        before : at a jump those before it
        """
        place = int(np.searchsorted(self.instants, time, side="left" if before else "right"))
        high = min(max(place, 1), len(self.instants) - 1)
        low = high - 1
        if time == self.instants[high]:  # a product and a sum would round
            return np.asarray(self.rows[high])
        share = (time - self.instants[low]) / (self.instants[high] - self.instants[low])
        return np.asarray(self.rows[low] + share * (self.rows[high] - self.rows[low]))


@dataclass(frozen=True)
class ReferenceFlight:
    """A flight in co-simulation: its inputs are set at the start of each step and hold over it.

    results : outputs at each communication point, those of a step's end, (STEPS + 1, outputs). Those that
              tell of a step's error are 0: it is not known here
    """

    stimuli: Stimuli
    results: Array


def reference_flight(model: Equations) -> ReferenceFlight | None:
    """Returns the flight. The steps are the scene's, or a tenth of them and so on where the body turns fast.

    None for a body that turns too fast for ATTEMPTS of these; in a field of gravity also under the propagator
    exact, which does not know it, and where the start is that of no orbit.
    """
    scene = model.resolved.scene
    if scene.gravity is not None:
        in_orbit = not orbit_problem(*scene.gravity_start, scene.gravity.mu)
        if not in_orbit or (model.has_field and model.plan.free == "always"):
            return None
    step = scene.experiment.step if scene.experiment else DEFAULT_STEP
    dock = _dock_that_switches(model)
    change = _change(model) if dock else None
    for _ in range(ATTEMPTS):
        stimuli = _stimuli(model, step, dock)
        if stimuli is not None:
            results = _fly(model, stimuli, change)
            if results is not None and np.all(np.isfinite(results)):
                return ReferenceFlight(stimuli, results)
        step /= 10.0
    return None


def state_at_start(scene: Scene) -> Array:
    """Returns attitude, angular velocity [rad/s] and momenta of wheels [N m s] at the start, (7 + n,)."""
    momenta = (scene.wheel(name).momentum for name in scene.wheels)
    return np.array([*scene.rotation.attitude, *scene.rotation.angular_velocity, *momenta])


def exchange_flight(model: Equations, stimuli: Stimuli) -> tuple[Array, Array]:
    """Returns times [s], (n,), and outputs, (n, outputs), of a flight in model exchange.

    The inputs are those of `stimuli` at every time, the outputs those of the communication points; at a jump
    there are two rows, before and after it. Integrated by classical Runge-Kutta in steps of EXCHANGE_ANGLE.
    """
    scene, change = model.resolved.scene, _change(model)
    x = state_at_start(scene)
    times, rows = [0.0], [_outputs(model, x, stimuli.at(0.0))]
    for begin, end in pairwise(stimuli.times):
        x = _integrated(model, stimuli.within(begin, end), x, (begin, end))
        old, new = stimuli.at(end, before=True), stimuli.at(end)
        times.append(end)
        rows.append(_outputs(model, x, old))
        if np.any(old != new):
            handed = _handed_over(model, x, (old, new))
            x = _changed(model, change, x, (old, new))
            times.append(end)
            rows.append(_outputs(model, x, new) + handed)
    return np.array(times), np.vstack(rows)


def _integrated(
    model: Equations, inputs_at: Callable[[float], Array], x: Array, span: tuple[float, float]
) -> Array:
    """Returns the state x at the end of a span of time [s], by RK4.

    inputs_at : time [s] -> inputs
    """
    begin, end = span
    first = inputs_at(begin)
    square = float(model.steps.fastest_square(x, _action(model, first), _composite(model, first)))
    count = max(FEWEST_EXCHANGE_STEPS, ceil((end - begin) * sqrt(square) / EXCHANGE_ANGLE))
    h = (end - begin) / count

    def rate(x: Array, time: float) -> Array:
        inputs = inputs_at(time)
        return np.array(model.ode(x, _action(model, inputs), _composite(model, inputs))).ravel()

    for i in range(count):
        now, then = begin + i * h, begin + (i + 1) * h if i + 1 < count else end
        middle = 0.5 * (now + then)
        k1 = rate(x, now)
        k2 = rate(x + 0.5 * h * k1, middle)
        k3 = rate(x + 0.5 * h * k2, middle)
        k4 = rate(x + h * k3, then)
        x = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        x[:4] /= np.linalg.norm(x[:4])
    return x


def _stimuli(model: Equations, step: float, dock: Dock | None) -> Stimuli | None:
    """Returns how the inputs move in steps of this size [s]; None where doubles do not hold that."""
    resolved, duration = model.resolved, step * STEPS
    inputs = resolved.inputs
    first = np.zeros(len(inputs))
    first[: len(model.names.p)] = p_start(resolved.scene)
    if not 0.0 < duration < inf:
        return None
    last = _last_inputs(model, inputs, first, duration)
    if not np.all(np.isfinite(last)):
        return None
    if dock is None:
        whole = Stimuli(step, np.array([0.0, duration]), np.vstack([first, last]))
        return _along_orbit(resolved.scene, whole)
    owned = [variable.owner == dock.name for variable in inputs]
    switched = np.array([v.boolean and own for v, own in zip(inputs, owned, strict=True)])
    jumping = np.array([v.part == "contact" or v.boolean for v in inputs])
    values = [
        np.where(jumping, first, first + number / STEPS * (last - first)) for number in (*SWITCHES, STEPS)
    ]
    moving = np.where(jumping & ~switched, last, values)
    there = np.where(switched, 1.0 - first, moving)
    back = np.where(switched, first, moving)
    one, other = (number * step for number in SWITCHES)
    whole = Stimuli(
        step,
        np.array([0.0, one, one, other, other, duration]),
        np.vstack([first, values[0], there[0], there[1], back[1], back[2]]),
    )
    return _along_orbit(resolved.scene, whole)


def _along_orbit(scene: Scene, stimuli: Stimuli) -> Stimuli:
    """Returns stimuli with a row for each communication point, where gravity's inputs follow the orbit."""
    if not scene.inputs.gravity:
        return stimuli
    jumps = stimuli.instants[1:][np.diff(stimuli.instants) == 0.0]
    instants = np.sort(np.concatenate([stimuli.times, jumps]))
    before = np.append(np.diff(instants) == 0.0, False)
    rows = np.array(
        [stimuli.at(time, before=old) for time, old in zip(instants.tolist(), before.tolist(), strict=True)]
    )
    motion = np.column_stack(list(gravity_inputs(scene, instants).values()))
    rows[:, len(rows[0]) - motion.shape[1] :] = motion  # they are the last inputs
    return Stimuli(stimuli.step, instants, rows)


def _last_inputs(model: Equations, inputs: Sequence[InputVariable], first: Array, duration: float) -> Array:
    """Returns the inputs at the end of the experiment; a dock is as at the start."""
    scene = model.resolved.scene
    with np.errstate(over="ignore"):  # an infinite rate makes an infinite torque, which is not flown
        rate = float(np.linalg.norm(scene.rotation.angular_velocity)) or 0.01
    xx, yy, zz, xy, xz, yz = _composite(model, first)[composite_slices()["inertia"]]
    smallest = max(float(np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])[0]), 0.0)
    last = []
    for variable, start in zip(inputs, first, strict=True):
        value = float(start)
        if variable.kind is MASS and scene.keeps["mass"] == "rate":
            value = max(LEFT * value, variable.low or 0.0)
        elif variable.kind is FLOW:
            value = _within(variable, (1.0 - LEFT) * scene.vessels[vessel_of(variable.owner)].mass / duration)
        elif variable.kind is TORQUE and model.plan.method is not None:  # else free motion alone is possible
            value = _within(variable, smallest * rate / duration)
        elif variable.kind is CONTACT_RATE:
            value = _within(variable, CONTACT * rate)
        last.append(value)
    return np.array(last)


def _within(variable: InputVariable, value: float) -> float:
    """Returns a value brought into the range that the scene gives, if it gives one."""
    value = min(value, variable.high if variable.high is not None else inf)
    return max(value, variable.low if variable.low is not None else -inf)


def _dock_that_switches(model: Equations) -> Dock | None:
    """Returns a dock with an input that makes another body, which the law can turn; None: none does."""
    scene = model.resolved.scene
    start = p_start(scene)
    before = _composite(model, start)
    for dock in (dock for dock in scene.docks if switchable(scene, dock)):
        if not dock.docked and not _makes_a_tree([*(d for d in scene.docks if d.docked), dock], scene.mounts):
            continue
        after = start.copy()
        flag = model.names.p.index(f"{dock.name}.docked")
        after[flag] = 1.0 - after[flag]
        c = _composite(model, after)
        if np.any(c != before) and _is_a_body(scene, c):
            return dock
    return None


def _makes_a_tree(docks: Sequence[Dock], mounts: Sequence[Mount]) -> bool:
    """Whether docks, all closed, take each port once and with mounts, which make none, make no loop."""
    home: dict[str, str] = {}

    def found(vessel: str) -> str:
        while vessel in home:
            vessel = home[vessel]
        return vessel

    for mount in mounts:
        home[found(mount.child)] = found(mount.parent)
    ports = [port for dock in docks for port in dock.ports]
    for dock in docks:
        one, other = (found(part_of(port)[0]) for port in dock.ports)
        if one == other:
            return False
        home[one] = other
    return len(set(ports)) == len(ports)


def _is_a_body(scene: Scene, c: Array) -> bool:
    """Whether a composite has a mass, and a tensor that the law can turn."""
    slices = composite_slices()
    usable = scene.rotation.law == "none" or bool(np.all(c[slices["margins"]] > 0.0))
    return bool(np.all(np.isfinite(c[slices["inertia"]])) and np.all(c[slices["mass"]] > 0.0)) and usable


def _change(model: Equations) -> ca.Function | None:
    """Returns the function omega, p before, p after, k -> omega of a change of inputs; None: it stays."""
    if model.change is None:
        return None
    rates = 3 + len(model.resolved.scene.wheels)
    sizes = {
        "omega": rates,
        "before": len(model.names.p),
        "after": len(model.names.p),
        "k": len(model.names.k),
    }
    symbols = tuple(ca.SX.sym(name, size) for name, size in sizes.items())
    margins = composite_slices()["margins"]
    omega = followed(model.resolved, model.change, model.composite, margins, symbols)
    return ca.Function("change", symbols, [omega])


def _changed(model: Equations, change: ca.Function | None, x: Array, inputs: tuple[Array, Array]) -> Array:
    """Returns the state x after the inputs have changed, from those before to those after."""
    if change is None:
        return x
    p = len(model.names.p)
    before, after = inputs
    k = after[p : len(after) - len(model.names.u)]
    return np.concatenate([x[:4], np.array(change(x[4:], before[:p], after[:p], k)).ravel(), x[7:]])


def _handed_over(model: Equations, x: Array, inputs: tuple[Array, Array]) -> Array:
    """Returns what a change of inputs adds to the outputs at its instant, (outputs,).

    x      : before the change
    inputs : before and after it; neither poses change nor masses that keep the momentum
    See `rotation.hand_over`.
    """
    found, handed, p = np.zeros(len(model.names.y)), model.hand_over, len(model.names.p)
    if handed is None:
        return found
    before, after = (_composite(model, each) for each in inputs)
    flags = np.array([variable.boolean for variable in model.resolved.shaping])
    velocity: Any = np.zeros(3)
    if handed.contact_velocity is not None and np.any((inputs[1] > inputs[0])[:p][flags]):
        k = inputs[1][p : len(inputs[1]) - len(model.names.u)]
        velocity = handed.contact_velocity(inputs[1][:p], k)
    vector = np.array(handed.handed_over(x, x[4:], before, after, after, after, velocity)).ravel()
    for group, place in handed.slices.items():
        if group in model.resolved.scene.outputs.names:
            first = model.names.y.index(f"{group}[1]")
            found[first : first + place.stop - place.start] = vector[place]
    return found


def _composite(model: Equations, inputs: Array) -> Array:
    return np.array(model.composite(inputs[: len(model.names.p)])).ravel()


def _action(model: Equations, inputs: Array) -> Array:
    """Returns those of all inputs that torques follow from; they are the last ones."""
    return inputs[len(inputs) - len(model.names.u) :]


def _fly(model: Equations, stimuli: Stimuli, change: ca.Function | None) -> Array | None:
    """Returns the outputs at each communication point, (STEPS + 1, ny), by the scene's own method.

    Of "split", which is more than a step of it, by RK4 in steps of EXCHANGE_ANGLE.

    change : what a change of inputs does to the rate, None where none of these changes does anything
    None if that takes more than MOST_SUB_STEPS.
    """
    scene = model.resolved.scene
    x = state_at_start(scene)
    held, taken = stimuli.at(0.0), 0
    rows = [_outputs(model, x, held)]
    for time in stimuli.times[:-1]:
        inputs = stimuli.at(time)
        x = _changed(model, change, x, (held, inputs))
        held = inputs
        end = _stepped(model, x, held, stimuli.step, MOST_SUB_STEPS - taken)
        if end is None:
            return None
        x, sub_steps = end
        taken += sub_steps
        rows.append(_outputs(model, x, held))  # of the step's end: its inputs still hold
    return np.vstack(rows)


def _stepped(model: Equations, x: Array, held: Array, step: float, most: int) -> tuple[Array, int] | None:
    """Returns the state x after a communication step [s], and in how many sub-steps; None beyond `most`."""
    scene, c, u = model.resolved.scene, _composite(model, held), _action(model, held)
    angle, field = scene.rotation.max_angle_step, len(u) - len(model.resolved.field)
    remaining, taken = step, 0
    while remaining > 0.0:
        square = float(model.steps.fastest_square(x, u, c))
        count = remaining * sqrt(square) / angle if square >= 0.0 else np.inf
        taken += 1
        if not taken + count <= most:
            return None
        if model.plan.free == "between kicks":
            return _integrated(model, _moving(scene, held), x, (0.0, step)), taken
        size = remaining / max(1, ceil(count))
        found = [np.array(result).ravel() for result in model.steps.step.call([x, u, c, size])]
        x = found[0]
        if model.has_field:
            u = np.concatenate([u[:field], found[2]])
        remaining = remaining - size if count > 1.0 else 0.0
    return x, taken


def _moving(scene: Scene, held: Array) -> Callable[[float], Array]:
    """Returns the function time [s] -> inputs that are held from time 0 on, but for gravity's.

    Where the body is in its field follows from them, as within a step of the FMU.
    """
    if scene.gravity is None:
        return lambda _: held
    mu, start = scene.gravity.mu, held[-6:]
    return lambda time: np.append(held[:-6], two_body(start[:3], start[3:], mu, [time]))


def _outputs(model: Equations, x: Array, inputs: Array) -> Array:
    c = _composite(model, inputs)
    return np.array(model.outputs(x, _action(model, inputs), c, model.axes(c), 0.0)).ravel()
