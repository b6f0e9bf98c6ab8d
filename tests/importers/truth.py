"""What a flight must be: the numpy reference, inputs held over each communication step.

The reference shares no code with what FMUs are made of. Between communication points SciPy integrates it, or
one step of Euler's explicit method, for importers that have no other. Tolerances follow from what the FMU's
propagator, or the importer's solver, may add in a step.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import solve_ivp

from changes.histories import ByReference, Values
from importers.flight import SOLVER
from importers.scenes import COUNT, STEP, TIMES, Course
from supervessel import reference
from supervessel.scene.inputs import MASS, TORQUE
from supervessel.scene.variables import input_variables
from support import Array

Trajectory = dict[str, Array]  # by name of a scalar, at each communication point, (COUNT + 1,)

EULER = 1e-11
"""Of trajectories by Euler's method: the same operations but for their order, some hundred roundings of 1e-16
a step over COUNT steps."""


@dataclass(frozen=True)
class Truth:
    """A trajectory, told twice: outputs read before and after the inputs of a communication point are set.

    angle : [rad] that the body turns by in all
    """

    before: Trajectory
    after: Trajectory
    angle: float


class Exactly(ByReference):
    """The numpy reference, what does not change with masses found once."""

    def __init__(self, course: Course) -> None:
        super().__init__(course.raw)
        self.scene = course.scene
        kinds = {v.kind for v in input_variables(self.scene)}
        # Then nothing but masses and a torque about the barycentre can change, at an unchanged rate.
        self.simple = kinds <= {MASS, TORQUE} and self.scene.keeps.get("mass", "rate") == "rate"
        self.parts = reference.points(self.scene)

    def set(self, inputs: Values) -> None:
        """Changes inputs at one instant."""
        if self.simple:
            self.values = self.values | inputs
        else:
            super().set(inputs)

    @property
    def composite(self) -> reference.Composite:
        """The composite under the inputs as they are: sums over points, six a vessel."""
        if not self.simple:
            return reference.composite(self.scene, self.values)
        scaled = [
            replace(part, masses=np.full(6, self.values[f"{name}.mass"] / 6.0))
            if f"{name}.mass" in self.values
            else part
            for name, part in self.parts.items()
        ]
        whole = reference.joined(scaled)
        arms = whole.positions - whole.barycentre
        squares = np.einsum("n,ni,nj->ij", whole.masses, arms, arms)
        inertia = np.trace(squares) * np.eye(3) - squares
        return reference.Composite(float(whole.masses.sum()), whole.barycentre, inertia)

    def rate(self) -> Callable[[Array], Array]:
        """Returns the rate of the state (attitude, angular velocity), (7,), while inputs are held."""
        J, law = self.composite.inertia, self.scene.rotation.law
        if self.simple:
            torque, h = np.array([self.values.get(f"torque[{i}]", 0.0) for i in (1, 2, 3)]), np.zeros(3)
        else:
            torque = reference.external_torque(self.scene, self.values)
            h = reference.internal_momentum(self.scene, self.values)

        def rate(state: Array) -> Array:
            acceleration = reference.angular_acceleration(law, J, state[4:], torque, h)
            return np.concatenate([reference.attitude_dot(state[:4], state[4:]), acceleration])

        return rate

    def fly(self, duration: float) -> None:
        """Goes on under the inputs as they are."""
        rate, start = self.rate(), np.concatenate([self.attitude, self.angular_velocity])
        end = solve_ivp(lambda _, y: rate(y), (0.0, duration), start, "DOP853", rtol=1e-13, atol=1e-16).y[
            :, -1
        ]
        self.attitude, self.angular_velocity = end[:4] / np.linalg.norm(end[:4]), end[4:]


class ByEuler(Exactly):
    """The same by Euler's explicit method; as with an importer, nothing brings the quaternion to length 1."""

    def fly(self, duration: float) -> None:
        """Goes on by one step."""
        state = np.concatenate([self.attitude, self.angular_velocity])
        state = state + duration * self.rate()(state)
        self.attitude, self.angular_velocity = state[:4], state[4:]


def truth(course: Course, inputs: Mapping[str, Array], euler: bool = False) -> Truth:
    """Returns the trajectory of a course under inputs, (COUNT + 1,) each; those not named are the scene's."""
    flown = (ByEuler if euler else Exactly)(course)
    flown.values = _at(inputs, 0)
    before, after, angle = [_outputs(flown)], [_outputs(flown)], 0.0
    for k in range(1, COUNT + 1):
        angle += float(np.linalg.norm(flown.angular_velocity)) * STEP
        flown.fly(TIMES[k] - TIMES[k - 1])
        before.append(_outputs(flown))
        flown.set(_at(inputs, k))
        after.append(_outputs(flown))
    return Truth(_series(before), _series(after), angle)


def _at(inputs: Mapping[str, Array], k: int) -> Values:
    return {name: float(values[k]) for name, values in inputs.items()}


def _outputs(flown: Exactly) -> dict[str, Array]:
    composite = flown.composite
    return {
        "mass": np.array([composite.mass]),
        "pmi": composite.pmi,
        "inertia": composite.inertia.ravel(),
        "angular_velocity": flown.angular_velocity,
        "attitude": flown.attitude / np.linalg.norm(flown.attitude),
    }


def _series(points: list[dict[str, Array]]) -> Trajectory:
    return {
        name: values
        for group in points[0]
        for name, values in zip(
            scalar_names(group), np.array([point[group] for point in points]).T, strict=True
        )
    }


SIZES = {"mass": 1, "pmi": 3, "inertia": 9, "angular_velocity": 3, "attitude": 4}
"""Outputs that are compared, and how many scalars each has."""


def scalar_names(group: str) -> list[str]:
    """Returns the FMU's names of the scalars of an output."""
    if group == "inertia":
        return [f"inertia[{i},{j}]" for i in (1, 2, 3) for j in (1, 2, 3)]
    return [group] if SIZES[group] == 1 else [f"{group}[{i + 1}]" for i in range(SIZES[group])]


def compared(names: Iterable[str]) -> list[str]:
    """Returns which of an FMU's outputs are compared, group by group."""
    there = set(names)
    return [name for group in SIZES for name in scalar_names(group) if name in there]


def deviation(found: Mapping[str, Array], right: Mapping[str, Array]) -> float:
    """Returns the largest difference at any communication point, relative to the largest length of its group.

    NaN if anything found is not a number.
    """
    worst = 0.0
    for group in SIZES:
        names = [name for name in scalar_names(group) if name in found]
        if names:
            one, other = (np.array([series[name] for name in names]) for series in (found, right))
            error = np.linalg.norm(one - other, axis=0).max() / np.linalg.norm(other, axis=0).max()
            worst = float(np.maximum(worst, error))  # keeps a NaN
    return worst


def tolerance(course: Course, angle: float, *, euler: bool, solver: bool) -> float:
    """Returns how far a flight may be off, in `deviation`.

    Over a step the propagator adds at most its tolerance to attitude [rad] and rate (relative); an importer's
    solver adds its own in each of some thirty steps after a jump of the inputs. What is added to the rate
    turns the attitude from there on. A scene that states its accuracy is off by that.
    """
    if euler:
        return EULER
    parsed = course.scene
    if parsed.accuracy is not None and not solver:
        return float(parsed.accuracy.attitude)
    step = 30.0 * SOLVER if solver else parsed.rotation.tolerance
    return COUNT * step * (1.0 + angle)
