"""Histories of an assembly: scenes of many vessels, what happens to them, who flies them, and the books."""

import json
import math
import re
from collections.abc import Callable, Iterable, Mapping
from ctypes import c_double
from dataclasses import dataclass
from functools import cache
from typing import Any, Protocol

import numpy as np
from scipy.integrate import solve_ivp

from supervessel import Scene, Twin, reference
from support import OK, Array, Instance, random_rotation, scene

Values = dict[str, float]
Long = np.longdouble


def elements(name: str, vector: Iterable[float]) -> Values:
    return {f"{name}[{i}]": float(x) for i, x in enumerate(vector, start=1)}


# Scenes


def _port(rng: np.random.Generator) -> dict[str, Any]:
    axes = random_rotation(int(rng.integers(10**9)))
    position = 3.0 * rng.normal(size=3)
    return {"position": position.tolist(), "direction": axes[0].tolist(), "alignment": axes[1].tolist()}


def _vessel(rng: np.random.Generator) -> dict[str, Any]:
    squares = rng.uniform(0.1, 2.0, size=3)
    pmi = (squares.sum() - squares).tolist()
    points = {"rcs": {"position": rng.normal(size=3).tolist()}}
    return {"mass": float(10.0 ** rng.uniform(1.0, 3.0)), "pmi": pmi, "ports": {}, "points": points}


def _wheels(rng: np.random.Generator, vessel: dict[str, Any]) -> dict[str, Any]:
    """Returns wheels that are part of a vessel, also where little of its mass is left."""
    most = vessel["mass"] * min(vessel["pmi"]) / 200.0
    return {
        f"w{i}": {
            "axis": rng.normal(size=3).tolist(),
            "inertia": float(rng.choice([0.0, most, 0.3 * most])),
            "momentum": float(rng.normal() * vessel["mass"]),
        }
        for i in range(int(rng.integers(0, 3)))
    }


def assembly(
    seed: int, count: int, moving: int = 4, others: int = 2, *, wheels: bool = False, **rotation: Any
) -> dict[str, Any]:
    """Returns the raw scene of a random tree of vessels.

    moving : how many ports have a pose that is an input, and a motion unless poses keep the rate
    others : how many vessels have a second place to dock
    wheels : whether two vessels of three have a wheel or two, with motors; one in three has no inertia
    Three docks in four can open, and of these one in four is open at the start.
    """
    rng = np.random.default_rng(seed)
    vessels = {f"V{i}": _vessel(rng) for i in range(count)}
    docks, named = [], []
    for i in range(1, count):
        parent = f"V{max(0, i - int(rng.integers(1, 4)))}"
        vessels[parent]["ports"][f"to{i}"], vessels[f"V{i}"]["ports"]["own"] = _port(rng), _port(rng)
        ports = [f"{parent}.to{i}", f"V{i}.own"]
        dock: dict[str, Any] = {"ports": ports if rng.uniform() < 0.5 else ports[::-1]}
        if rng.uniform() < 0.75:
            dock |= {"name": f"D{i}", "docked": bool(rng.uniform() < 0.75)}
            named.append(i)
        docks.append(dock)
    for i in named[:others]:
        other = f"V{int(rng.choice([j for j in range(count) if j != i]))}"
        vessels[other]["ports"][f"place{i}"] = _port(rng)
        docks.append({"ports": [f"{other}.place{i}", f"V{i}.own"], "name": f"E{i}", "docked": False})
    used = [port for dock in docks for port in dock["ports"]]
    posed = sorted(set(rng.choice(used, min(moving, len(used)), replace=False).tolist()))
    inputs = {
        "mass": list(vessels),
        "pmi": [f"V{count - 1}"],
        "pose": posed,
        "motion": [] if rotation.get("pose_change") == "rate" else posed,
        "docked": [dock["name"] for dock in docks if "name" in dock],
        "torque": True,
        "force": [f"{vessel}.rcs" for vessel in list(vessels)[:3]],
        "vessel_torque": [f"V{count - 1}"],
    }
    if wheels:
        for vessel in vessels.values():
            vessel["wheels"] = _wheels(rng, vessel)
        inputs["wheel"] = [f"{name}.{wheel}" for name, each in vessels.items() for wheel in each["wheels"]]
    state = {"angular_velocity": (0.3 * rng.normal(size=3)).tolist(), "attitude": rng.normal(size=4).tolist()}
    return {
        "name": f"assembly{seed}",
        "root": "V0",
        "vessels": vessels,
        "docks": docks,
        "inputs": inputs,
        "rotation": state | {"propagator": "dop853", "tolerance": 1e-12} | rotation,
        "outputs": {"names": ["mass", "inertia", "angular_velocity", "attitude", "angular_momentum"]},
    }


def start_values(flown: Scene) -> Values:
    """Returns docks, masses and poses at the start, as inputs."""
    values = {f"{name}.docked": float(flown.dock(name).docked) for name in flown.inputs.docked}
    values |= {f"{name}.mass": flown.vessels[name].mass for name in flown.inputs.mass}
    for name in flown.inputs.pose:
        for key in ("position", "direction", "alignment"):
            values |= elements(f"{name}.{key}", getattr(flown.port(name), key))
    return values


# What happens


def _burn(flown: Scene, values: Values, rng: np.random.Generator) -> Values:
    vessel, point = str(rng.choice(flown.inputs.mass)), str(rng.choice(flown.inputs.force))
    mass = {f"{vessel}.mass": values[f"{vessel}.mass"] * rng.uniform(0.5, 1.0)}
    push = elements(f"{point}.force", rng.normal(size=3)) | elements("torque", rng.normal(size=3))
    return mass | push | elements(f"{flown.inputs.vessel_torque[0]}.torque", rng.normal(size=3))


def _transfer(flown: Scene, values: Values, rng: np.random.Generator) -> Values:
    source, target = rng.choice(flown.inputs.mass, 2, replace=False).tolist()
    pumped = values[f"{source}.mass"] * rng.uniform(0.0, 0.7)
    changed = {f"{source}.mass": values[f"{source}.mass"] - pumped}
    changed[f"{target}.mass"] = values[f"{target}.mass"] + pumped
    squares = rng.uniform(0.1, 2.0, size=3)
    return changed | elements(f"{flown.inputs.pmi[0]}.pmi", squares.sum() - squares)


def _move(flown: Scene, values: Values, rng: np.random.Generator) -> Values:
    port, axes = str(rng.choice(flown.inputs.pose)), random_rotation(int(rng.integers(10**9)))
    changed = elements(f"{port}.position", 3.0 * rng.normal(size=3))
    changed |= elements(f"{port}.direction", axes[0]) | elements(f"{port}.alignment", axes[1])
    if port in flown.inputs.motion:
        steady = rng.uniform() < 0.3
        for key in ("velocity", "rate"):
            changed |= elements(f"{port}.{key}", 0.0 * axes[0] if steady else 0.3 * rng.normal(size=3))
    return changed


def _dock(flown: Scene, values: Values, rng: np.random.Generator) -> Values:
    there = reference.poses(flown, values)
    names = rng.permutation(flown.inputs.docked).tolist()
    # First those at which something can arrive.
    names.sort(key=lambda name: all(port.partition(".")[0] not in there for port in flown.dock(name).ports))
    for name in names:
        closed = {f"{name}.docked": 1.0}
        if not values[f"{name}.docked"] and legal(flown, values | closed):
            for key in ("velocity", "rate"):
                closed |= elements(f"{name}.{key}", 0.3 * rng.normal(size=3))
            return closed
    return {}


def _undock(flown: Scene, values: Values, rng: np.random.Generator) -> Values:
    closed = [name for name in flown.inputs.docked if values[f"{name}.docked"]]
    return {f"{rng.choice(closed)}.docked": 0.0} if closed else {}


def _spin(flown: Scene, values: Values, rng: np.random.Generator) -> Values:
    return {f"{name}.torque": 5.0 * rng.normal() for name in flown.wheels}


def _at_rest(flown: Scene, values: Values) -> Values:
    """Returns that the motors of wheels whose vessels are not joined to the root do nothing, as they must."""
    there = reference.poses(flown, values)
    return {f"{name}.torque": 0.0 for name in flown.wheels if name.partition(".")[0] not in there}


def legal(flown: Scene, values: Mapping[str, float]) -> bool:
    try:
        reference.closed_docks(flown, values)
    except ValueError:
        return False
    return True


EVENTS: dict[str, Callable[[Scene, Values, np.random.Generator], Values]] = {
    "burn": _burn,
    "transfer": _transfer,
    "move": _move,
    "dock": _dock,
    "undock": _undock,
}


WHEEL_EVENTS = EVENTS | {"spin": _spin}
"""With motors of wheels."""


def happening(flown: Scene, values: Values, kinds: Iterable[str], seed: int) -> Values:
    """Returns the inputs that change when these things happen at one instant."""
    rng, changed = np.random.default_rng(seed), Values()
    for kind in kinds:
        changed |= WHEEL_EVENTS[kind](flown, values | changed, rng)
    return changed | _at_rest(flown, values | changed)


# Who flies


class Driver(Protocol):
    """Something that flies a scene: inputs go in, angular velocity and attitude come out.

    rates : angular velocity and momenta of wheels, (3 + n,)
    """

    def set(self, inputs: Values) -> None: ...

    def fly(self, duration: float) -> None: ...

    @property
    def angular_velocity(self) -> Array: ...

    @property
    def rates(self) -> Array: ...

    @property
    def attitude(self) -> Array: ...


class ByReference:
    """The numpy reference, its state integrated by SciPy."""

    def __init__(self, raw: Mapping[str, Any]) -> None:
        self.scene = scene(raw)
        self.values: Values = start_values(self.scene)
        rotation = self.scene.rotation
        self.attitude, self.angular_velocity, self.momenta = (
            np.array(rotation.attitude),
            np.array(rotation.angular_velocity),
            np.array([self.scene.wheel(name).momentum for name in self.scene.wheels]),
        )

    @property
    def rates(self) -> Array:
        return np.concatenate([self.angular_velocity, self.momenta])

    def set(self, inputs: Values) -> None:
        after = self.values | inputs
        self.angular_velocity = reference.change(self.scene, self.rates, self.values, after)[:3]
        self.values = after

    def fly(self, duration: float) -> None:
        end, _ = flight(self.scene, self.attitude, self.rates, self.values, duration)
        self.attitude = end[:4] / np.linalg.norm(end[:4])
        self.angular_velocity, self.momenta = end[4:7], end[7:]


class ByFmu:
    """The FMU in co-simulation."""

    def __init__(self, raw: Mapping[str, Any], fmi: int = 3, *, optimised: bool | None = None) -> None:
        self.instance = Instance(raw, fmi, optimised=optimised)
        assert self.instance.initialise() == OK, self.instance.log

    def set(self, inputs: Values) -> None:
        assert self.instance.set(inputs) == OK, self.instance.log

    def fly(self, duration: float) -> None:
        assert self.instance.step(duration) == OK, self.instance.log

    @property
    def angular_velocity(self) -> Array:
        return np.asarray(self.instance.get("angular_velocity"))

    @property
    def attitude(self) -> Array:
        return np.asarray(self.instance.get("attitude"))

    @property
    def rates(self) -> Array:
        return rates_of(self.instance)


def rates_of(instance: Instance) -> Array:
    """Returns angular velocity and momenta of wheels, (3 + n,)."""
    stored = [instance.get(name) for name in instance.references if STORED.fullmatch(name)]
    return np.array([*instance.get("angular_velocity"), *stored])


STORED = re.compile(r"state\.\w+\.\w+\.momentum")
"""Names of the momenta of wheels."""


class ByEvents(ByFmu):
    """The FMU in co-simulation with event mode, FMI 3: each change of inputs is an event."""

    def __init__(self, raw: Mapping[str, Any], fmi: int = 3) -> None:
        assert fmi == 3
        self.instance = Instance(raw, eventModeUsed=True)
        assert self.instance.initialise() == OK, self.instance.log
        self._update()

    def set(self, inputs: Values) -> None:
        assert self.instance._status(self.instance.fmu.enterEventMode) == OK
        super().set(inputs)
        self._update()

    def _update(self) -> None:
        self.instance.fmu.updateDiscreteStates()
        assert self.instance._status(self.instance.fmu.enterStepMode) == OK


class ByExchange:
    """The FMU in model exchange: inputs change in event mode, SciPy integrates."""

    def __init__(self, raw: Mapping[str, Any], fmi: int = 3) -> None:
        self.instance, self.time = Instance(raw, fmi, exchange=True), 0.0
        assert self.instance.initialise() == OK, self.instance.log
        assert self.instance.run() == OK, self.instance.log
        self.size = 7 + sum(bool(STORED.fullmatch(name)) for name in self.instance.references)

    def set(self, inputs: Values) -> None:
        fmu = self.instance.fmu
        assert self.instance._status(fmu.enterEventMode) == OK
        assert self.instance.set(inputs) == OK, self.instance.log
        assert self.instance.run() == OK, self.instance.log

    @property
    def states(self) -> Array:
        """Attitude, angular velocity or momentum, and momenta of wheels, (7 + n,)."""
        array = (c_double * self.size)()
        self.instance.fmu.getContinuousStates(array, self.size)
        return np.array(array)

    @states.setter
    def states(self, values: Array) -> None:
        array = (c_double * self.size)(*values)
        assert self.instance._status(self.instance.fmu.setContinuousStates, array, self.size) == OK

    def states_dot(self, time: float, states: Array, inputs: Values | None = None) -> Array:
        """Returns the rates of the states, (7 + n,), in continuous-time mode with these inputs."""
        fmu, array = self.instance.fmu, (c_double * self.size)()
        fmu.setTime(time)
        self.states = states
        assert self.instance.set(inputs or {}) == OK, self.instance.log
        derivatives = fmu.getContinuousStateDerivatives if self.instance.fmi == 3 else fmu.getDerivatives
        derivatives(array, self.size)
        return np.array(array)

    def fly(self, duration: float, inputs: Callable[[float], Values] = lambda _: {}) -> None:
        """Flies on; inputs may be functions of time."""
        end = self.time + duration
        largest = np.abs(self.states).max()
        done = solve_ivp(
            lambda t, y: self.states_dot(t, y, inputs(t)),
            (self.time, end),
            self.states,
            "DOP853",
            rtol=1e-13,
            atol=1e-15 * largest,
        )
        self.states_dot(end, done.y[:, -1], inputs(end))
        self.time = end

    @property
    def angular_velocity(self) -> Array:
        return np.asarray(self.instance.get("angular_velocity"))

    @property
    def attitude(self) -> Array:
        return np.asarray(self.instance.get("attitude"))

    @property
    def rates(self) -> Array:
        return rates_of(self.instance)


@cache
def _twin(text: str) -> Twin:
    return Twin(scene(json.loads(text)))


class ByTwin:
    """The twin, in short steps."""

    def __init__(self, raw: Mapping[str, Any]) -> None:
        self.twin = _twin(json.dumps(raw))
        self.x, self.p, self.u = self.twin.x_start, self.twin.p_start, np.zeros(len(self.twin.u_names))

    def set(self, inputs: Values) -> None:
        p_next = self.p.copy()
        for name, value in inputs.items():
            names, numbers = (
                (self.twin.u_names, self.u) if name in self.twin.u_names else (self.twin.p_names, p_next)
            )
            numbers[names.index(name)] = value
        self.x = np.array(self.twin.change(self.x, self.p, p_next)).ravel()
        self.p = p_next

    def fly(self, duration: float) -> None:
        count = max(TWIN_STEPS, math.ceil(length(self.x[4:7]) * duration / TWIN_ANGLE))
        for _ in range(count):
            self.x = np.array(self.twin.step(self.x, self.u, self.p, duration / count)).ravel()

    @property
    def angular_velocity(self) -> Array:
        return self.x[4:7]

    @property
    def rates(self) -> Array:
        return self.x[4:]

    @property
    def attitude(self) -> Array:
        return self.x[:4]


# A step of order eight turns a hundredth of a radian or so, at most TWIN_ANGLE, which is off by some 1e-12,
# once a body has become light and turns fast.
TWIN_STEPS, TWIN_ANGLE = 50, 0.1

# DOP853 at rtol 1e-13 over some radians.
FLIGHT_ERROR = 1e-11


def flight(
    flown: Scene, attitude: Array, rates: Array, values: Values, duration: float
) -> tuple[Array, Array]:
    """Returns the state after a flight, (7 + n,), and the impulse of the torque, (3,) [N m s], inertial axes.

    rates : angular velocity and momenta of wheels, (3 + n,)
    """
    J, h = reference.composite(flown, values).inertia, reference.internal_momentum(flown, values)
    torque, law = reference.external_torque(flown, values), flown.rotation.law
    wheels, impulse = reference.wheels_of(flown, rates[3:], values), slice(4 + len(rates), None)

    def rate(_: float, y: Array) -> Array:
        held = h - wheels.carried + y[7 : impulse.start] @ wheels.axes
        acceleration = reference.angular_acceleration(
            law, J - wheels.inertia, y[4:7], torque + wheels.reaction, held
        )
        unit = y[:4] / np.linalg.norm(y[:4])
        impulse_dot = reference.rotation_matrix(unit) @ torque
        return np.concatenate(
            [reference.attitude_dot(y[:4], y[4:7]), acceleration, wheels.torques, impulse_dot]
        )

    start = np.concatenate([attitude, rates, np.zeros(3)])
    end = solve_ivp(rate, (0.0, duration), start, "DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
    return end[: impulse.start], end[impulse]


# The books


@dataclass(frozen=True)
class Part:
    """Something that moves: mass [kg], centre (3,) [m], velocity (3,) [m/s], momentum about it (3,) [N m s].

    Body axes, in extended precision; size [N m s] sums the magnitudes of all that made the momentum.
    """

    mass: Any
    centre: Any
    velocity: Any
    momentum: Any
    size: Any

    def __add__(self, other: "Part") -> "Part":
        """Returns both as one; they circle each other with the reduced mass."""
        mass = self.mass + other.mass
        d, v = other.centre - self.centre, other.velocity - self.velocity
        reduced = self.mass * other.mass / mass
        share = other.mass / mass
        return Part(
            mass,
            self.centre + share * d,
            self.velocity + share * v,
            self.momentum + other.momentum + reduced * np.cross(d, v),
            self.size + other.size + reduced * length(d) * length(v),
        )


def length(vector: Any) -> Any:
    return np.sqrt(vector @ vector)


def parts(flown: Scene, rates: Array, values: Mapping[str, float]) -> dict[str, Part]:
    """Returns each vessel that is joined to the root, as it moves; its wheels hold what they hold.

    rates : angular velocity and momenta of wheels, (3 + n,)
    """
    omega, found = rates[:3].astype(Long), {}
    for name, motion in reference.motions(flown, values).items():
        vessel = flown.vessels[name]
        mass, pmi = Long(values.get(f"{name}.mass", vessel.mass)), np.array(vessel.pmi)
        pmi = np.array([values.get(f"{name}.pmi[{i + 1}]", k) for i, k in enumerate(pmi)])
        R, r = motion.rotation.astype(Long), motion.origin.astype(Long)
        turning = omega + motion.rate
        momentum = R @ (mass * pmi * (R.T @ turning))
        velocity, size = motion.velocity + np.cross(omega, r), length(momentum)
        for i, wheel in enumerate(flown.wheels):
            if wheel.partition(".")[0] == name:
                axis = R @ unit(flown.wheel(wheel).axis)
                locked = Long(flown.wheel(wheel).inertia) * (axis @ turning)
                momentum = momentum + axis * (Long(rates[3 + i]) - locked)
                size += abs(locked) + abs(rates[3 + i])
        found[name] = Part(mass, r, velocity, momentum, size)
    return found


def unit(vector: Iterable[float]) -> Any:
    """Returns a vector at unit length, in extended precision."""
    long = np.array(list(vector), dtype=Long)
    return long / length(long)


def whole(of: Iterable[Part]) -> Part:
    first, *others = of
    for part in others:
        first = first + part
    return first


def touching(flown: Scene, before: Values, after: Values) -> Values:
    """Returns inputs by which what arrives at docks that close moves as if their first ports did."""
    moving = dict(after)
    for name in flown.inputs.docked:
        if after[f"{name}.docked"] and not before[f"{name}.docked"]:
            first = flown.dock(name).ports[0]
            for key in ("velocity", "rate"):
                for i in (1, 2, 3):
                    port, contact = f"{first}.{key}[{i}]", f"{name}.{key}[{i}]"
                    moving[port] = moving.get(port, 0.0) + after.get(contact, 0.0)
    return moving


def books(flown: Scene, before: Values, after: Values, old: Array, new: Array) -> tuple[float, float]:
    """Returns what is missing in the books of momentum over a change, and the sum of its terms [N m s].

    old, new : angular velocities and momenta of wheels, (3 + n,)
    H is that of all that stays joined, about its barycentre. It changes by mass that leaves or arrives moving
    with the body, where the scene says so, and by parts that arrive with momentum of their own.
    """
    docks = [f"{name}.docked" for name in flown.inputs.docked]
    staying = {name: before[name] * after[name] for name in docks}
    left = before | staying
    filled = left | {name: x for name, x in after.items() if name.endswith(".mass") or ".pmi[" in name}
    moved = after | staying
    held = whole(parts(flown, old, left).values())
    flow, size = np.zeros(3), held.size
    if flown.keeps["mass"] == "rate":
        full = whole(parts(flown, old, filled).values())
        flow, size = full.momentum - held.momentum, size + full.size
    # Poses are moved from inside: momentum is that of the base with what is still there, at some rate.
    kept = held.momentum + flow
    arriving = [name for name in reference.poses(flown, after) if name not in reference.poses(flown, moved)]
    if arriving:
        stored = old[3:]
        rate = reference.angular_velocity(flown, np.array([*kept.astype(float), *stored]), moved)
        meeting = parts(flown, np.array([*rate, *stored]), touching(flown, before, after))
        base = whole(part for name, part in meeting.items() if name not in arriving)
        others = [meeting[name] for name in arriving]
        together = whole([base, *others])
        kept, size = kept + together.momentum - base.momentum, size + together.size
    end = whole(parts(flown, new, after).values())
    return float(length(end.momentum - kept)), float(size + end.size)
