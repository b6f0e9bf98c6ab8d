"""Random scenes with `[accuracy]`, by number, for the adversary: half of them built to be nasty.

They are small, of 10 to 60 communication steps and few inputs, so that a choice takes seconds. "Slow" scenes
are drawn to turn by less than some 3 rad in all.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from supervessel import parse_scene, reference
from supervessel.scene.outputs import OUTPUTS

Array = NDArray[np.float64]
Raw = dict[str, Any]

SHOWN = [name for name in ("angular_velocity", "attitude", "error_bound") if name in OUTPUTS]
"""Outputs of the scenes: a bound of the error where FMUs have one."""

SLOW_NASTY, SLOW_ORDINARY = 0.45, 0.8
"""Shares of scenes that are drawn slow."""

ROOT = 1000.0  # kg
ROD = 100.0  # m2, of a rod across its length
"""The root vessel, and the moment over mass that a rod along the spin axis adds to both other axes."""


def scene_of(number: int) -> tuple[str, Raw]:
    """Returns the kind of a scene, and the scene as a file gives it; even numbers are nasty ones."""
    draw = np.random.default_rng([number, 11])
    kind = list(NASTY)[number // 2 % len(NASTY)] if number % 2 == 0 else "ordinary"
    slow = bool(draw.random() < (SLOW_ORDINARY if kind == "ordinary" else SLOW_NASTY))
    horizon = float(10.0 ** draw.uniform(0.5, 3.0))
    turn = float(10.0 ** (draw.uniform(-2.5, 0.3) if slow else draw.uniform(0.6, 1.8)))
    make = NASTY.get(kind, ordinary)
    raw: Raw = {"name": f"adversary{number}", "root": "R"} | make(draw, turn / horizon, turn)
    inputs = raw["inputs"]
    span, most = float(inputs.pop("push", 0.0)), float(10.0 ** draw.uniform(-2.0, 0.0))
    if span:  # what acts turns the body by about as much as it turns by itself, or less
        moments = np.diag(reference.composite(parse_scene(plain(raw))).inertia)
        size = float(span * most * turn / horizon**2 * np.mean(moments))
        inputs["range"]["torque"] = [-size, size] if "sided" not in inputs else inputs.pop("sided")(size)
    low, high = (-5.0, -0.5) if slow else (-7.0, -2.0)
    raw["accuracy"] = {
        "attitude": float(10.0 ** draw.uniform(low, high)),
        "horizon": horizon,
        "step": horizon / int(draw.integers(10, 61)),
    }
    if draw.random() < 0.2:
        raw["accuracy"]["rate"] = 3.0 * raw["accuracy"]["attitude"] * turn / horizon
    raw["outputs"] = {"names": SHOWN}
    return kind, raw


def plain(raw: Raw) -> Raw:
    """Returns a scene without inputs and at rest, of which moments are taken."""
    return {key: value for key, value in raw.items() if key not in ("inputs", "rotation")}


def spin_about(draw: np.random.Generator, axis: int, rate: float, tilt: float) -> Raw:
    """Returns [rotation] for a spin [rad/s] about a body axis that is tilted by a small angle [rad]."""
    direction = tilt * draw.normal(size=3)
    direction[axis] = 1.0
    spin = rate * direction / np.linalg.norm(direction)
    kept = {"mass_change": str(draw.choice(["rate", "momentum"], p=[0.8, 0.2]))}
    return {"angular_velocity": spin.tolist(), "attitude": draw.normal(size=4).tolist(), **kept}


def _port(direction: Array, alignment: Array, position: Array | None = None) -> dict[str, list[float]]:
    place = np.zeros(3) if position is None else position
    return {
        "position": place.tolist(),
        "direction": direction.tolist(),
        "alignment": alignment.tolist(),
    }


def _window(draw: np.random.Generator, most: float) -> tuple[int, Array]:
    """Returns a spin axis and the root's moments over its mass [m2], (3,).

    most : what the range adds, at its end, to the moments about both other axes [kg m2]
    The spin axis has the largest moment, and the smallest one once enough is added; it is the middle axis in
    a window of a thousandth to a third of the range.
    """
    axis = int(draw.integers(3))
    begun = float(draw.uniform(0.05, 0.9)) * most
    width = float(10.0 ** draw.uniform(-3.0, -0.5)) * most
    least = (begun + width) * float(draw.uniform(1.2, 5.0))
    moments = np.array([least - width, least - width, least - width])
    moments[(axis + 1) % 3] = least
    moments[axis] = least + begun
    return axis, moments / ROOT


def middle_by_mass(draw: np.random.Generator, rate: float, _turn: float) -> Raw:
    """The spin axis is the middle one for some masses of a tank inside its range only."""
    most = 1000.0
    axis, pmi = _window(draw, most * ROD)
    x, y = np.eye(3)[:2]
    rod = ROD * (1.0 - np.eye(3)[axis])
    vessels = {
        "R": {"mass": ROOT, "pmi": pmi.tolist(), "ports": {"a": _port(x, y)}},
        "T": {"mass": float(draw.uniform(0.0, most)), "pmi": rod.tolist(), "ports": {"a": _port(-x, y)}},
    }
    inputs: Raw = {"mass": ["T"], "range": {"T.mass": [0.0, most]}}
    if draw.random() < 0.5:
        inputs |= {"torque": True, "push": 1.0}
    return {
        "vessels": vessels,
        "docks": [{"ports": ["R.a", "T.a"]}],
        "inputs": inputs,
        "rotation": spin_about(draw, axis, rate, float(10.0 ** draw.uniform(-6.0, -1.0))),
    }


def middle_by_pose(draw: np.random.Generator, rate: float, _turn: float) -> Raw:
    """The same by the place of a port along the spin axis; half of them keep the momentum, as by default."""
    far, mass = 20.0, 1000.0
    reduced = mass * ROOT / (mass + ROOT)
    axis, pmi = _window(draw, reduced * far**2)
    e = np.eye(3)
    port = _port(e[axis], e[(axis + 1) % 3], far * float(draw.random()) * e[axis])
    vessels = {
        "R": {"mass": ROOT, "pmi": pmi.tolist(), "ports": {"a": port}},
        "T": {"mass": mass, "pmi": [0.0, 0.0, 0.0], "ports": {"a": _port(e[0], e[1])}},
    }
    ranges = {f"R.a.{part}[{i + 1}]": [x, x] for part, values in port.items() for i, x in enumerate(values)}
    ranges[f"R.a.position[{axis + 1}]"] = [0.0, far]
    rotation = spin_about(draw, axis, rate, float(10.0 ** draw.uniform(-6.0, -1.0)))
    del rotation["mass_change"]
    if draw.random() < 0.5:
        rotation["pose_change"] = "rate"
    return {
        "vessels": vessels,
        "docks": [{"ports": ["R.a", "T.a"]}],
        "inputs": {"pose": ["R.a"], "range": ranges},
        "rotation": rotation,
    }


def middle_by_docks(draw: np.random.Generator, rate: float, _turn: float) -> Raw:
    """The same in some of the combinations of 2 to 5 docks only, each rod twice as heavy as the last."""
    count = int(draw.integers(2, 6))
    unit = 1000.0 / (2**count - 1)
    axis = int(draw.integers(3))
    begun, width = ROD * unit * (int(draw.integers(1, 2**count - 1)) - 0.4), ROD * unit * draw.uniform(0.6, 2)
    least = (begun + width) * float(draw.uniform(1.2, 3.0))
    moments = np.full(3, least - width)
    moments[(axis + 1) % 3], moments[axis] = least, least + begun
    x, y = np.eye(3)[:2]
    names = [f"T{i}" for i in range(count)]
    rod = (ROD * (1.0 - np.eye(3)[axis])).tolist()
    vessels: Raw = {
        "R": {"mass": ROOT, "pmi": (moments / ROOT).tolist(), "ports": {n: _port(x, y) for n in names}}
    }
    vessels |= {
        n: {"mass": unit * 2**i, "pmi": rod, "ports": {"a": _port(-x, y)}} for i, n in enumerate(names)
    }
    docks = [
        {"ports": [f"R.{n}", f"{n}.a"], "name": f"to{n}", "docked": bool(draw.random() < 0.5)} for n in names
    ]
    ranges = {f"to{n}.{key}": [0.0, 0.0] for n in names for key in ("velocity", "rate")}
    rotation = spin_about(draw, axis, rate, float(10.0 ** draw.uniform(-6.0, -1.0)))
    del rotation["mass_change"]
    inputs = {"docked": [f"to{n}" for n in names], "range": ranges}
    return {"vessels": vessels, "docks": docks, "inputs": inputs, "rotation": rotation}


def _one(draw: np.random.Generator, pmi: Array, rotation: Raw, *, tank: float = 0.0) -> Raw:
    """Returns a body under torque, with a point mass of a variable share of its mass at a random place."""
    x, y = np.eye(3)[:2]
    place = 0.5 * float(np.sqrt(pmi.max())) * draw.normal(size=3)
    vessels: Raw = {"R": {"mass": ROOT, "pmi": pmi.tolist(), "ports": {"a": _port(x, y, place)}}}
    inputs: Raw = {"torque": True, "push": 1.0, "range": {}}
    docks = []
    if tank:
        vessels["T"] = {"mass": tank * ROOT, "pmi": [0.0] * 3, "ports": {"a": _port(-x, y)}}
        docks = [{"ports": ["R.a", "T.a"]}]
        inputs |= {
            "mass": ["T"],
            "range": {"T.mass": [float(draw.uniform(0.0, 0.9)) * tank * ROOT, tank * ROOT]},
        }
    else:
        rotation = {key: value for key, value in rotation.items() if key != "mass_change"}
    return {"vessels": vessels, "docks": docks, "inputs": inputs, "rotation": rotation}


def nutating(draw: np.random.Generator, rate: float, _turn: float) -> Raw:
    """A body that is nearly symmetric about its spin, whose nutation a torque can be in phase with."""
    axis, across = int(draw.integers(3)), float(10.0 ** draw.uniform(0.0, 2.0))
    pmi = across * (1.0 + float(10.0 ** draw.uniform(-8.0, -1.5)) * draw.random(3))
    pmi[axis] = across * float(draw.uniform(0.1, 1.9))
    tank = float(draw.choice([0.0, 10.0 ** draw.uniform(-3.0, -1.0)]))
    return _one(draw, pmi, spin_about(draw, axis, rate, float(10.0 ** draw.uniform(-4.0, -0.5))), tank=tank)


def _moments(draw: np.random.Generator) -> Array:
    """Returns moments of a body, (3,) [m2], ascending."""
    squares = np.sort(10.0 ** draw.uniform(-1.0, 1.5, size=3))[::-1]
    return np.array([squares[1] + squares[2], squares[0] + squares[2], squares[0] + squares[1]])


def separatrix(draw: np.random.Generator, rate: float, _turn: float) -> Raw:
    """A spin whose energy is next to that of the separatrix, free or under little torque."""
    I = _moments(draw)  # noqa: E741
    middle = float(10.0 ** draw.uniform(-3.0, 0.0))  # least share of the spin that is about the middle axis
    one = np.sqrt(I[2] * (I[2] - I[1])) * middle
    other = np.sqrt(I[0] * (I[1] - I[0])) * middle * (1.0 + float(10.0 ** draw.uniform(-12.0, -2.0)))
    spin = np.array([one / I[2], 1.0, other / I[0]]) * draw.choice([-1.0, 1.0], size=3)
    rotation = spin_about(draw, 0, rate, 0.0) | {
        "angular_velocity": (rate * spin / np.linalg.norm(spin)).tolist()
    }
    return _one(draw, I, rotation, tank=float(draw.choice([0.0, 10.0 ** draw.uniform(-4.0, -1.5)])))


def symmetric(draw: np.random.Generator, rate: float, _turn: float) -> Raw:
    """A body with two or three equal moments, or a rod, of which a small mass may break the symmetry."""
    form = [np.full(3, 2.0), np.array([2.0, 2.0, 3.0]), np.array([0.0, 2.0, 2.0]), np.array([1.0, 1.0, 2.0])]
    pmi = form[int(draw.integers(1, 4)) if draw.random() < 0.7 else 0] + 0.0
    pmi = np.roll(pmi * float(10.0 ** draw.uniform(-1.0, 2.0)), int(draw.integers(3)))
    tank = 10.0 ** draw.uniform(-4.0, -0.5) if pmi.min() == 0.0 or draw.random() < 0.7 else 0.0
    return _one(
        draw, pmi, spin_about(draw, int(draw.integers(3)), rate, float(draw.random())), tank=float(tank)
    )


def slender(draw: np.random.Generator, rate: float, _turn: float) -> Raw:
    """A body of moments 1e2 to 1e5 apart."""
    axis, thin = int(draw.integers(3)), float(10.0 ** draw.uniform(-5.0, -2.0))
    pmi = float(10.0 ** draw.uniform(0.0, 2.0)) * (1.0 - 0.3 * thin * draw.random(3))
    pmi[axis] *= thin
    tank = float(draw.choice([0.0, 10.0 ** draw.uniform(-5.0, -2.0)]))
    return _one(draw, pmi, spin_about(draw, int(draw.integers(3)), rate, float(draw.random())), tank=tank)


def one_sided(draw: np.random.Generator, _rate: float, _turn: float) -> Raw:
    """A body at rest whose torque has one sign."""
    tank = float(draw.choice([0.0, 10.0 ** draw.uniform(-3.0, -0.5)]))
    raw = _one(draw, draw.permutation(_moments(draw)), spin_about(draw, 0, 0.0, 0.0), tank=tank)
    below = bool(draw.random() < 0.5)
    raw["inputs"]["push"] = float(10.0 ** draw.uniform(0.0, 1.0))
    raw["inputs"]["sided"] = lambda size: [-size, 0.0] if below else [0.0, size]
    return raw


def pumped(draw: np.random.Generator, rate: float, _turn: float) -> Raw:
    """Masses and torque that together, in phase, spin a body up; both masses wide, none in the middle."""
    raw = chain(draw, 2)
    raw["inputs"] = {
        "mass": ["R", "V1"],
        "torque": True,
        "push": float(10.0 ** draw.uniform(0.5, 1.5)),
        "range": {},
    }
    for name in ("R", "V1"):
        mass = raw["vessels"][name]["mass"]
        raw["inputs"]["range"][f"{name}.mass"] = [float(draw.uniform(0.05, 0.5)) * mass, mass]
    raw["rotation"] = spin_about(draw, int(draw.integers(3)), rate, float(draw.random()))
    raw["rotation"]["mass_change"] = str(draw.choice(["rate", "momentum"]))
    return raw


def chain(draw: np.random.Generator, count: int) -> Raw:
    """Returns vessels in a chain, docked at random."""
    names = ["R", *(f"V{i}" for i in range(1, count))]
    vessels: Raw = {}
    for name in names:
        pmi = draw.permutation(_moments(draw))
        size = float(np.sqrt(pmi.max()))
        ports = {}
        for port in ("fore", "aft"):
            direction = draw.normal(size=3)
            across = np.cross(direction, draw.normal(size=3))
            ports[port] = _port(direction, across, 1.5 * size * draw.normal(size=3))
        jet = {"position": (1.5 * size * draw.normal(size=3)).tolist()}
        mass = float(10.0 ** draw.uniform(2.5, 4.5))
        vessels[name] = {"mass": mass, "pmi": pmi.tolist(), "ports": ports, "points": {"jet": jet}}
    docks = [{"ports": [f"{a}.aft", f"{b}.fore"], "name": f"to{b}"} for a, b in pairwise(names)]
    return {"vessels": vessels, "docks": docks}


def ordinary(draw: np.random.Generator, rate: float, turn: float) -> Raw:
    """One to three vessels of which some masses, moments, poses, docks, a force or a torque vary."""
    raw = chain(draw, int(draw.integers(1, 4)))
    vessels, names = raw["vessels"], list(raw["vessels"])
    some = [name for name in names if draw.random() < 0.5]
    inputs: Raw = {"mass": some, "range": {}, "torque": bool(draw.random() < 0.7)}
    for name in some:
        mass = vessels[name]["mass"]
        inputs["range"][f"{name}.mass"] = [float(mass * draw.uniform(0.3, 1.0)), mass]
    if inputs["torque"]:
        inputs["push"] = 1.0
    inputs["docked"] = [dock["name"] for dock in raw["docks"] if draw.random() < 0.2]
    for name in inputs["docked"]:
        inputs["range"] |= {f"{name}.velocity": [0.0, 0.0], f"{name}.rate": [0.0, 0.0]}
    inputs["pmi"] = [name for name in names if draw.random() < 0.1]
    for name in inputs["pmi"]:
        for i, k in enumerate(vessels[name]["pmi"], start=1):
            inputs["range"][f"{name}.pmi[{i}]"] = [0.95 * k, 1.05 * k]
    if draw.random() < 0.15:
        inputs["force"] = ["R.jet"]
        moment = vessels["R"]["mass"] * max(vessels["R"]["pmi"])
        arm = float(np.linalg.norm(vessels["R"]["points"]["jet"]["position"]))
        inputs["range"]["R.jet.force"] = [0.0, 0.1 * moment * rate * rate / turn / arm]
    raw["rotation"] = spin_about(draw, 0, rate, 10.0)
    if raw["docks"] and draw.random() < 0.2:
        inputs["pose"] = ["R.aft"]
        for part, values in vessels["R"]["ports"]["aft"].items():
            wide = (0.05 if part == "position" else 0.02) * float(np.linalg.norm(values))
            for i, x in enumerate(values, start=1):
                inputs["range"][f"R.aft.{part}[{i}]"] = [x - wide, x + wide]
        if draw.random() < 0.6:
            raw["rotation"]["pose_change"] = "rate"
    if not (some or inputs["pmi"]):
        del raw["rotation"]["mass_change"]
    raw["inputs"] = inputs
    return raw


NASTY: dict[str, Callable[[np.random.Generator, float, float], Raw]] = {
    "middle axis by mass": middle_by_mass,
    "middle axis by pose": middle_by_pose,
    "middle axis by docks": middle_by_docks,
    "nutation": nutating,
    "separatrix": separatrix,
    "symmetric": symmetric,
    "slender": slender,
    "one-sided torque": one_sided,
    "pumped": pumped,
}
