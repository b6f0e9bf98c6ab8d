"""Histories of an assembly: scenes of many vessels, what happens to them, who flies them, and the books."""

import json
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

    wheels : whether two vessels of three have a wheel or two, of which one in three has no inertia
    moving : how many ports have a pose that is an input, and a motion unless poses keep the rate
    others : how many vessels have a second place to dock
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
    for i in range(count if wheels else 0):
        vessels[f"V{i}"]["wheels"] = _wheels(rng, vessels[f"V{i}"])
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


def happening(flown: Scene, values: Values, kinds: Iterable[str], seed: int) -> Values:
    """Returns the inputs that change when these things happen at one instant."""
    rng, changed = np.random.default_rng(seed), Values()
    for kind in kinds:
        changed |= EVENTS[kind](flown, values | changed, rng)
    return changed


# Who flies


class Driver(Protocol):
    """Something that flies a scene: inputs go in, angular velocity and attitude come out."""

    def set(self, inputs: Values) -> None: ...

    def fly(self, duration: float) -> None: ...

    @property
    def angular_velocity(self) -> Array: ...

    @property
    def attitude(self) -> Array: ...


class ByReference:
    """The numpy reference, its state integrated by SciPy."""

    def __init__(self, raw: Mapping[str, Any]) -> None:
        self.scene = scene(raw)
        self.values: Values = start_values(self.scene)
        rotation = self.scene.rotation
        self.attitude, self.angular_velocity = (
            np.array(rotation.attitude),
            np.array(rotation.angular_velocity),
        )

    def set(self, inputs: Values) -> None:
        after = self.values | inputs
        self.angular_velocity = reference.change(self.scene, self.angular_velocity, self.values, after)
        self.values = after

    def fly(self, duration: float) -> None:
        end, _ = flight(self.scene, self.attitude, self.angular_velocity, self.values, duration)
        self.attitude, self.angular_velocity = end[:4] / np.linalg.norm(end[:4]), end[4:]


class ByFmu:
    """The FMU in co-simulation."""

    def __init__(self, raw: Mapping[str, Any], fmi: int = 3, *, optimised: bool = True) -> None:
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
        self.count = 7 + len(scene(raw).wheels)
        assert self.instance.initialise() == OK, self.instance.log
        assert self.instance.run() == OK, self.instance.log

    def set(self, inputs: Values) -> None:
        fmu = self.instance.fmu
        assert self.instance._status(fmu.enterEventMode) == OK
        assert self.instance.set(inputs) == OK, self.instance.log
        assert self.instance.run() == OK, self.instance.log

    @property
    def states(self) -> Array:
        """Attitude and angular velocity, or momentum, and momenta of wheels, (7 + n,)."""
        array = (c_double * self.count)()
        self.instance.fmu.getContinuousStates(array, self.count)
        return np.array(array)

    @states.setter
    def states(self, values: Array) -> None:
        fmu, array = self.instance.fmu, (c_double * self.count)(*values)
        assert self.instance._status(fmu.setContinuousStates, array, self.count) == OK

    def rates(self, time: float, states: Array, inputs: Values | None = None) -> Array:
        """Returns the rates of the states in continuous-time mode with these inputs."""
        fmu, array = self.instance.fmu, (c_double * self.count)()
        fmu.setTime(time)
        self.states = states
        assert self.instance.set(inputs or {}) == OK, self.instance.log
        (fmu.getContinuousStateDerivatives if self.instance.fmi == 3 else fmu.getDerivatives)(
            array, self.count
        )
        return np.array(array)

    def fly(self, duration: float, inputs: Callable[[float], Values] = lambda _: {}) -> None:
        """Flies on; inputs may be functions of time."""
        end = self.time + duration
        largest = np.abs(self.states).max()
        done = solve_ivp(
            lambda t, y: self.rates(t, y, inputs(t)),
            (self.time, end),
            self.states,
            "DOP853",
            rtol=1e-13,
            atol=1e-15 * largest,
        )
        self.rates(end, done.y[:, -1], inputs(end))
        self.time = end

    @property
    def angular_velocity(self) -> Array:
        return np.asarray(self.instance.get("angular_velocity"))

    @property
    def attitude(self) -> Array:
        return np.asarray(self.instance.get("attitude"))


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
        for _ in range(TWIN_STEPS):
            self.x = np.array(self.twin.step(self.x, self.u, self.p, duration / TWIN_STEPS)).ravel()

    @property
    def angular_velocity(self) -> Array:
        return self.x[4:7]

    @property
    def attitude(self) -> Array:
        return self.x[:4]


# A step of order eight then turns a hundredth of a radian or so.
TWIN_STEPS = 50

# DOP853 at rtol 1e-13 over some radians.
FLIGHT_ERROR = 1e-11


def flight(
    flown: Scene, attitude: Array, angular_velocity: Array, values: Values, duration: float
) -> tuple[Array, Array]:
    """Returns the state after a flight, (7,), and the impulse of the torque, (3,) [N m s], inertial axes."""
    locked, stored = stored_in_wheels(flown, values)
    J = reference.composite(flown, values).inertia - locked
    h = reference.internal_momentum(flown, values) + stored
    torque, law = reference.external_torque(flown, values), flown.rotation.law

    def rate(_: float, y: Array) -> Array:
        acceleration = reference.angular_acceleration(law, J, y[4:7], torque, h)
        unit = y[:4] / np.linalg.norm(y[:4])
        impulse_dot = reference.rotation_matrix(unit) @ torque
        return np.concatenate([reference.attitude_dot(y[:4], y[4:7]), acceleration, impulse_dot])

    start = np.concatenate([attitude, angular_velocity, np.zeros(3)])
    end = solve_ivp(rate, (0.0, duration), start, "DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
    return end[:7], end[7:]


def stored_in_wheels(flown: Scene, values: Mapping[str, float]) -> tuple[Array, Array]:
    """Returns A = sum I b b^T, (3, 3) [kg m2], of the wheels of what is joined to the root, and what they add
    to the momentum h of what moves, (3,) [N m s]: h_w b less I b (b . k) that their vessel's rate k does not
    turn along. Body axes.
    """
    locked, stored = np.zeros((3, 3)), np.zeros(3)
    for name, motion in reference.motions(flown, values).items():
        for wheel in flown.vessels[name].wheels.values():
            b = motion.rotation @ (np.array(wheel.axis) / np.linalg.norm(wheel.axis))
            locked += wheel.inertia * np.outer(b, b)
            stored += (wheel.momentum - wheel.inertia * (b @ motion.rate)) * b
    return locked, stored


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


def parts(flown: Scene, angular_velocity: Array, values: Mapping[str, float]) -> dict[str, Part]:
    """Returns each vessel that is joined to the root, as it moves."""
    omega, found = angular_velocity.astype(Long), {}
    for name, motion in reference.motions(flown, values).items():
        vessel = flown.vessels[name]
        mass, pmi = Long(values.get(f"{name}.mass", vessel.mass)), np.array(vessel.pmi)
        pmi = np.array([values.get(f"{name}.pmi[{i + 1}]", k) for i, k in enumerate(pmi)])
        R, r = motion.rotation.astype(Long), motion.origin.astype(Long)
        turning = omega + motion.rate
        momentum = R @ (mass * pmi * (R.T @ turning))
        size = length(momentum)
        for wheel in vessel.wheels.values():  # which no change of inputs speeds up or slows down
            b = R @ (np.array(wheel.axis, Long) / length(np.array(wheel.axis, Long)))
            own = (Long(wheel.momentum) - Long(wheel.inertia) * (b @ turning)) * b
            momentum, size = momentum + own, size + length(own)
        velocity = motion.velocity + np.cross(omega, r)
        found[name] = Part(mass, r, velocity, momentum, size)
    return found


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

    old, new : angular velocities
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
        locked, stored = stored_in_wheels(flown, moved)
        J = reference.composite(flown, moved).inertia - locked
        inner = reference.internal_momentum(flown, moved) + stored
        rate = np.linalg.solve(J, kept.astype(float) - inner)
        meeting = parts(flown, rate, touching(flown, before, after))
        base = whole(part for name, part in meeting.items() if name not in arriving)
        others = [meeting[name] for name in arriving]
        together = whole([base, *others])
        kept, size = kept + together.momentum - base.momentum, size + together.size
    end = whole(parts(flown, new, after).values())
    return float(length(end.momentum - kept)), float(size + end.size)
