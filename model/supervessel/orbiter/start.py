"""Attitude and rates of the root at the start: its own, or those of a ship docked to it, turned."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from supervessel.composite.start import poses_at_start
from supervessel.orbiter.frames import Array, mirrored, quaternion, rotation, turn_angle
from supervessel.orbiter.scenario import Ship
from supervessel.orbiter.text import Note, numbers
from supervessel.orbiter.writing import Assembled, Start, identifiers
from supervessel.problems import quantity
from supervessel.scene.schema import Scene

ROUNDED_POSITION = math.sqrt(3.0) * 0.005
"""Length [m] of what rounding to the second decimal, as Orbiter does, leaves of RPOS at most."""
ROUNDED_ANGLE = 3.0 * math.radians(0.005)
"""Angle [rad] of what rounding to the second decimal leaves of AROT at most: three turns in a row."""
FARTHEST = 1e150
"""Largest RPOS [m]: the distance of two such places is still a number."""


@dataclass(frozen=True)
class Saved:
    """What a scenario saved of a ship's motion: AROT as R_inertial_vessel, VROT [rad/s], RPOS [m], turned."""

    attitude: Array | None
    rate: Array | None
    position: Array | None


def saved_motion(ship: Ship, problems: list[str]) -> Saved:
    """Returns what a ship's lines say; what cannot be read goes to `problems`."""

    def read(key: str, allowed: str = "", most: float = math.inf) -> tuple[float, ...] | None:
        entry = ship.entry(key)
        if entry is None:
            return None
        found = numbers(entry.words, 3)
        if found is None or any(abs(x) > most for x in found):
            must = f"must be {key} and three numbers{allowed}"
            problems.append(f"{entry.place}: {quantity(ship.name)}: {entry}: {must}")
            return None
        return found

    arot, vrot = read("AROT"), read("VROT")
    rpos = read("RPOS", f" of at most {FARTHEST:g} m", FARTHEST)
    rate = np.radians(mirrored(vrot)) if vrot and not ship.landed else None
    return Saved(rotation(arot) if arot else None, rate, np.array(mirrored(rpos)) if rpos else None)


def start_of(scene: Scene, parts: Assembled, saved: Mapping[str, Saved]) -> tuple[Start, list[Note]]:
    """Returns the state at the start, of the root or of what is docked to it, and notes."""
    names = identifiers(list(parts.members))
    placed = poses_at_start(scene)
    poses = {name: placed[names[name]] for name in parts.members}
    root = parts.members[parts.root].ship.place
    attitude, said = (1.0, 0.0, 0.0, 0.0), "no AROT: body axes are the inertial ones"
    notes: list[Note] = []
    turned = [(name, own) for name in parts.members if (own := saved[name].attitude) is not None]
    if turned:
        name, R_inertial_vessel = turned[0]
        R_inertial_root = R_inertial_vessel @ poses[name][0].T
        attitude, said = quaternion(R_inertial_root), _origin(parts, name, "AROT")
        notes += list(_stale(parts, saved, poses, name, R_inertial_root))
        if parts.members[name].ship.landed:
            notes.append(Note(root, "the assembly is landed: its AROT is relative to the turning ground"))
    else:
        notes.append(Note(root, "no vessel of the assembly has AROT: taken as zero"))
    turning = [(name, omega) for name in parts.members if (omega := saved[name].rate) is not None]
    rate, rate_said = np.zeros(3), "no VROT: not turning"
    if turning:
        name, omega = turning[0]
        rate, rate_said = poses[name][0] @ omega, _origin(parts, name, "VROT")
    return Start(attitude, said, [float(x) + 0.0 for x in rate], rate_said), notes


def _origin(parts: Assembled, name: str, key: str) -> str:
    """Returns where a part of the root's state is from: its own line, or another ship's."""
    entry = parts.members[name].ship.entry(key)
    assert entry is not None
    via = "" if name == parts.root else f" of {quantity(name)}, from there by the docks"
    return f"{entry.place.short}: {entry}{via}"


def _stale(
    parts: Assembled,
    saved: Mapping[str, Saved],
    poses: Mapping[str, tuple[Array, Array]],
    base: str,
    R_inertial_root: Array,
) -> Iterator[Note]:
    """Yields which ships were saved elsewhere than their docks have them, seen from the one called `base`.

    poses : R_root_vessel, (3, 3), and origin, (3,) [m], root axes, of each ship
    """
    for name, (R_root_vessel, origin) in poses.items():
        one, other = saved[base], saved[name]
        if name == base or other.attitude is None:
            continue
        angle = turn_angle((R_inertial_root @ R_root_vessel).T @ other.attitude)
        far = [f"{math.degrees(angle):.2f} degrees"] if angle > 2.0 * ROUNDED_ANGLE else []
        if one.position is not None and other.position is not None:
            offset = origin - poses[base][1]
            distance = math.hypot(*(R_inertial_root.T @ (other.position - one.position) - offset))
            if distance > 2.0 * ROUNDED_POSITION + math.hypot(*offset) * ROUNDED_ANGLE:
                far.append(f"{distance:.2f} m")
        if far:
            where = f"{' and '.join(far)} from where its docks to {quantity(base)} have it"
            text = f"{quantity(name)} was saved {where}; the docks are followed"
            yield Note(parts.members[name].ship.place, text)
