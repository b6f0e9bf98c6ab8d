"""What NASA published, from the TOML files beside this module, each of which names its source."""

import tomllib
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from support import Array
from support.numbers import hamilton
from support.series import mp


@cache
def table(name: str) -> dict[str, Any]:
    """Returns the tables of a file."""
    return tomllib.loads(Path(__file__).with_name(f"{name}.toml").read_text(encoding="utf-8"))


@dataclass(frozen=True)
class Row:
    """A published state: time [s], attitude (4,), rates (3,) [rad/s], position and velocity if known (6,)."""

    time: float
    attitude: tuple[float, ...]
    rates: tuple[float, ...]
    orbit: tuple[float, ...] = ()


def station() -> list[Row]:
    """Returns the states of the station under a torque."""
    return [Row(row[0], tuple(row[4:8]), tuple(row[1:4])) for row in table("iss_torque")["rows"]]


def cylinder() -> list[Row]:
    """Returns the states of the cylinder in its orbit."""
    rows = table("cylinder")["rows"]
    return [Row(row[0], tuple(row[10:14]), tuple(row[7:10]), tuple(row[1:7])) for row in rows]


def brick_inertia() -> Array:
    """Returns the tensor of the brick, (3, 3) [kg m2]; one factor for all moments changes no motion."""
    brick = table("brick")
    return np.diag(brick["moments_slug_ft2"]) * brick["kg_m2_per_slug_ft2"]


def brick_rates() -> list[Any]:
    """Returns the brick's rates at the start, (3,) [rad/s], exact but for 60 digits."""
    with mp.workdps(60):
        return [mp.mpf(x) * mp.pi / 180 for x in table("brick")["angular_velocity_deg_s"]]


def brick_simulators() -> dict[str, list[Row]]:
    """Returns the states of each simulator, in the axes north, east, down of the start, held fixed."""
    earth = table("brick")["earth_rate"]
    rows = table("brick")["simulators"]
    return {name: [_brick_row(row, earth) for row in found] for name, found in rows.items()}


def _brick_row(row: list[float], earth_rate: float) -> Row:
    time, longitude, yaw, pitch, roll, *rates = row
    north = earth_rate * time + np.radians(longitude)
    q = [1.0, 0.0, 0.0, 0.0]
    for axis, angle in ((0, north), (2, np.radians(yaw)), (1, np.radians(pitch)), (0, np.radians(roll))):
        turn = [np.cos(angle / 2), 0.0, 0.0, 0.0]
        turn[1 + axis] = np.sin(angle / 2)
        q = hamilton(q, turn)
    return Row(time, tuple(q), tuple(np.radians(rates)))


# Composites


@dataclass(frozen=True)
class Part:
    """Mass [kg], centre of mass (3,) [m] and rotation (3, 3) in the whole's axes, inertia (3, 3) [kg m2]."""

    mass: float
    centre: Array
    rotation: Array
    inertia: Array


@dataclass(frozen=True)
class Whole:
    """A composite: its parts, mass [kg], barycentre (3,) [m] and inertia (3, 3) [kg m2] about it."""

    name: str
    parts: tuple[Part, ...]
    mass: float
    barycentre: Array
    inertia: Array


def exact(text: Any) -> Any:
    """Returns the number that is written as a fraction, times a root perhaps; or an array of such."""
    if isinstance(text, list):
        return np.array([exact(each) for each in text])
    fraction, _, root = text.partition("*sqrt(")
    value = Fraction(fraction)
    size = mp.mpf(value.numerator) / value.denominator
    return float(size * mp.sqrt(int(root.rstrip(")"))) if root else size)


def composites() -> list[Whole]:
    """Returns all composites, and those in turned axes that were published beside."""
    found = []
    for raw in table("composites")["composites"]:
        whole = Whole(
            raw["name"],
            tuple(_part(part) for part in raw["parts"]),
            exact(raw["mass"]),
            exact(raw["centre_of_mass"]),
            exact(raw["inertia"]),
        )
        found.append(whole)
        if "turned" in raw:
            found.append(_turned(whole, exact(raw["turned"]["axes"]), exact(raw["turned"]["inertia"])))
    return found


def _part(raw: dict[str, Any]) -> Part:
    mass, inertia = exact(raw["mass"]), exact(raw["inertia"])
    if "about" in raw:
        a = exact(raw["about"])
        inertia = inertia - mass * (a @ a * np.eye(3) - np.outer(a, a))
    rotation = exact(raw["rotation"]) if "rotation" in raw else np.eye(3)
    return Part(mass, exact(raw["centre"]), rotation, inertia)


def _turned(whole: Whole, axes: Array, inertia: Array) -> Whole:
    """Returns a whole in axes whose directions are the rows of a matrix."""
    parts = [Part(part.mass, axes @ part.centre, axes @ part.rotation, part.inertia) for part in whole.parts]
    return Whole(f"{whole.name}, turned", tuple(parts), whole.mass, axes @ whole.barycentre, inertia)
