"""The text of a scene file made from Orbiter's files, with comments that say where its numbers are from."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from supervessel.orbiter.classes import ClassPort, VesselClass
from supervessel.orbiter.docks import Mention
from supervessel.orbiter.frames import mirrored
from supervessel.orbiter.scenario import Scenario, Ship
from supervessel.orbiter.text import Note
from supervessel.problems import LONGEST_PROBLEM, printable, quantity
from supervessel.scene.names import DEVICE, IDENTIFIER, LONGEST_NAME, RESERVED

LONGEST_SCENE_NAME = 60
"""Letters of a scene's name, which becomes that of a library."""
LONGEST_PLAIN = 80
"""Letters that an identifier takes over from a name; a number may follow them."""


@dataclass(frozen=True)
class Member:
    """A ship of the assembly with its class.

    mass, full : with the propellant it has, and with full tanks [kg]
    propellant : where the first is from
    ports      : by number, those that a scene can have
    """

    ship: Ship
    of: VesselClass
    mass: float
    full: float
    propellant: str
    ports: Mapping[int, ClassPort]


@dataclass(frozen=True)
class Start:
    """The state at the start: attitude q_inertial_root, (w, x, y, z), angular velocity [rad/s] in root axes,
    and where they are from.
    """

    attitude: Sequence[float] = (1.0, 0.0, 0.0, 0.0)
    attitude_from: str = ""
    angular_velocity: Sequence[float] = (0.0, 0.0, 0.0)
    angular_velocity_from: str = ""


@dataclass(frozen=True)
class Assembled:
    """All that a scene file says; `convention` is the reason for writing the key, "" for leaving it out."""

    scenario: Scenario
    root: str
    members: Mapping[str, Member]
    docks: Sequence[Mention]
    convention: str
    notes: Sequence[Note]


def scene_name(stem: str) -> str:
    """Returns a name for a scene: the file's, in small letters, what is no letter or digit an underscore."""
    words = re.sub(r"[^a-z0-9]+", "_", stem.lower()).strip("_")
    usable = words[:1].isalpha() and not DEVICE.fullmatch(words)
    name = words if usable else f"scene_{words}"
    return name[:LONGEST_SCENE_NAME].strip("_")


def identifiers(names: Sequence[str]) -> dict[str, str]:
    """Returns an identifier for each name: itself where it is one, else a similar one that nobody has."""
    usable = {name for name in names if _is_usable(name)}
    taken = usable | RESERVED
    last: dict[str, int] = {}
    found = {}
    for name in names:
        if name in usable:
            found[name] = name
            continue
        plain = re.sub(r"[^A-Za-z0-9_]", "_", name[:LONGEST_PLAIN])
        plain = plain if IDENTIFIER.fullmatch(plain) else f"_{plain}"
        found[name] = plain
        while found[name] in taken:
            last[plain] = last.get(plain, 1) + 1
            found[name] = f"{plain}_{last[plain]}"
        taken.add(found[name])
    return found


def _is_usable(name: str) -> bool:
    return len(name) <= LONGEST_NAME and IDENTIFIER.fullmatch(name) is not None and name not in RESERVED


def scene_text(parts: Assembled, start: Start) -> str:
    """Returns the text of the scene file."""
    names = identifiers(list(parts.members))
    path = parts.scenario.path
    lines = [
        _comment(
            f"Made by `supervessel import` from Orbiter's scenario {quantity(path.name)}. Orbiter's axes"
        ),
        "# (x right, y up, z forward, left-handed) are turned into right-handed ones by reversing z.",
    ]
    if parts.notes:
        lines += ["#", "# To know:", *(_comment(f"- {note.short}") for note in parts.notes)]
    lines += ["", f'name = "{scene_name(path.stem)}"', f'root = "{names[parts.root]}"']
    if parts.convention:
        lines += [_comment(parts.convention), 'convention = "orbiter"']
    for name, member in parts.members.items():
        lines += _vessel(names[name], member)
    for dock in parts.docks:
        ends = f'"{names[dock.ship]}.dock{dock.port}", "{names[dock.mate]}.dock{dock.mate_port}"'
        said = f"{dock.place.short}: DOCKINFO {dock} of {quantity(dock.ship)}"
        lines += ["", _comment(said), "[[docks]]", f"ports = [{ends}]"]
    lines += _inputs(parts, names)
    lines += ["", "[rotation]", _comment(start.angular_velocity_from)]
    lines += [f"angular_velocity = {_vector(start.angular_velocity)}  # rad/s"]
    lines += [_comment(start.attitude_from), f"attitude = {_vector(start.attitude)}"]
    return "\n".join(lines) + "\n"


def _vessel(name: str, member: Member) -> list[str]:
    ship, made = member.ship, member.of
    called = "" if ship.name == name else f"{quantity(ship.name)}, "
    empty = f"{made.mass_place.short}: empty {made.empty_mass} kg"
    lines = ["", _comment(f"{called}{ship.place.short}: class {quantity(ship.class_name)}")]
    lines += [f"[vessels.{name}]", _comment(f"{empty}; {member.propellant}"), f"mass = {member.mass}  # kg"]
    lines.append(_comment(made.pmi_place.short + (f": {made.fallback}" if made.fallback else "")))
    lines.append(f"pmi = {_vector(made.pmi)}  # m2")
    for number, port in member.ports.items():
        lines += [_comment(port.place.short), f"[vessels.{name}.ports.dock{number}]"]
        lines.append(f"position = {_vector(mirrored(port.position))}  # m")
        lines.append(f"direction = {_vector(mirrored(port.direction))}")
        lines.append(f"alignment = {_vector(mirrored(port.alignment))}")
    return lines


def _inputs(parts: Assembled, names: Mapping[str, str]) -> list[str]:
    """Returns the inputs: masses of what has propellant, from empty to full, and the torque."""
    burning = {names[n]: m for n, m in parts.members.items() if m.full > m.of.empty_mass}
    lines = ["", "[inputs]"]
    if burning:
        lines.append(f"mass = [{', '.join(quantity(name) for name in burning)}]  # what has propellant")
    lines.append("torque = true")
    if burning:
        lines += ["[inputs.range]", "# kg, from empty to full"]
        lines += [f'"{name}.mass" = {_vector((m.of.empty_mass, m.full))}' for name, m in burning.items()]
    return lines


def _vector(values: Sequence[float]) -> str:
    return f"[{', '.join(repr(float(value)) for value in values)}]"


def _comment(text: str) -> str:
    return f"# {printable(text, LONGEST_PROBLEM)}"
