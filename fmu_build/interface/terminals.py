"""terminalsAndIcons.xml: terminals, groups of variables that are connected together, and their icons.

FMI 3.0 defines the file; FMI 2.0.4 and later take it as it is.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, pi, sin
from xml.etree import ElementTree as ET

from fmu_build.interface.variable_table import TableEntry
from fmu_build.interface.xml_text import xml_text
from fmu_build.versions import VERSIONS
from supervessel.drawing.figure import Figure, Item, Path, arrow, regular_polygon, svg
from supervessel.drawing.raster import png
from supervessel.scene.inputs import vessel_of
from supervessel.scene.schema import Scene
from supervessel.scene.variables import InputVariable

ICON_EXTENT = 100.0
"""The FMU's icon fills the square from -100 to 100, the coordinates that FMI takes by default."""
TERMINAL_SIZE = 24.0  # in the same coordinates
TERMINAL_ICON_SIZE = 64  # px
CONNECTION_COLOUR = "34 34 34"

VENDOR = "alt.supervessel"
"""Beginning of the kinds of terminals, in reverse domain name notation.

The top-level domain "alt" is kept for names outside the DNS, RFC 9476: no host is called so, now or later.
"""


@dataclass(frozen=True)
class Terminal:
    """Variables that are connected together.

    name        : of the terminal
    kind        : terminals of the same kind, of any models, can be connected; also the name of the icon file
    rule        : "plug" where a connection needs all members, "bus" where some members are enough
    description : for people
    members     : its variables
    prefix      : beginning of the variables' structured names that the members' names leave out; a member's
                  name is the same whatever names the FMU's variables have, so that any two FMUs connect
    """

    name: str
    kind: str
    rule: str
    description: str
    members: Sequence[TableEntry]
    prefix: str = ""

    @property
    def is_input(self) -> bool:
        """Whether the FMU takes these variables."""
        return all(entry.role == "input" for entry in self.members)


@dataclass(frozen=True)
class Connection:
    """Form of the terminal of an owner's inputs.

    kind        : of the terminal
    description : of the terminal, with places for {owner}, {vessel} and, of a dock, {ports}
    name        : of the terminal, with the same places
    """

    kind: str
    description: str
    name: str = "{owner}"


MOVING_PORT = Connection("port_motion", "pose and motion of docking port {owner} in the axes of {vessel}")

CONNECTIONS: dict[str, Connection | None] = {
    "mass": None,
    "pmi": None,
    "pose": Connection("port_pose", "pose of docking port {owner} in the axes of {vessel}"),
    "docked": Connection("dock", "whether {ports} are docked, motion at contact"),
    "wheel": Connection("motor", "torque of the motor of wheel {owner}, along its axis", "{owner}.motor"),
    "force": Connection("force", "external force at {owner}, axes of its vessel"),
    "vessel_torque": Connection("torque", "external torque on {owner}, its axes", "{owner}.torque"),
    "flow": Connection("flow", "propellant that leaves {vessel} through {owner}", "{owner}.flow"),
    "gravity": Connection("orbit", "place and velocity from the attracting centre, inertial axes", "gravity"),
    "torque": Connection("torque", "external torque about the barycentre, body axes", "torque"),
}
"""By key of `[inputs]`, the form of the inputs' terminal; None: no terminal. Inputs of any other key have a
terminal whose kind is the key."""


def terminals(scene: Scene, entries: Sequence[TableEntry]) -> list[Terminal]:
    """Returns the terminals of a scene: ports whose pose is an input, docks, forces, torques, attitude."""
    together: dict[tuple[str, str], list[TableEntry]] = {}
    for entry in entries:
        variable = entry.variable
        if isinstance(variable, InputVariable):
            key = variable.kind.within or variable.kind.key
            together.setdefault((key, variable.owner), []).append(entry)
    found = [_of_inputs(scene, key, owner, members) for (key, owner), members in together.items()]
    shown = [entry for entry in entries if entry.role == "output"]
    attitude = [entry for entry in shown if entry.variable.group in ("attitude", "angular_velocity")]
    whole = Terminal("attitude", "attitude", "bus", "attitude and angular velocity of the body", attitude)
    known = [terminal for terminal in found if terminal is not None]
    known.sort(key=lambda terminal: terminal.name == "torque")  # that of the whole comes after those of parts
    return [*known, whole] if attitude else known


def _of_inputs(scene: Scene, key: str, owner: str, members: Sequence[TableEntry]) -> Terminal | None:
    """Returns the terminal of an owner's inputs, None where inputs of that key have no terminal.

    key, owner : of `[inputs]`, and the entry of its list
    members    : the inputs
    """
    generic = Connection(
        key, key.replace("_", " ") + (" of {owner}" if owner else ""), "{owner}." + key if owner else key
    )
    connection = CONNECTIONS.get(key, generic)
    if connection is None:
        return None
    if owner in scene.inputs.motion:
        connection = MOVING_PORT
    words = {"owner": owner, "vessel": vessel_of(owner)}
    if key == "docked":
        words["ports"] = " and ".join(scene.dock(owner).ports)
    name, text = connection.name.format(**words), connection.description.format(**words)
    return Terminal(name, connection.kind, "plug", text, members, prefix=f"{owner}." if owner else "")


def terminals_and_icons(scene: Scene, entries: Sequence[TableEntry], fmi: int) -> bytes:
    """Returns the text of terminalsAndIcons/terminalsAndIcons.xml.

    entries : the variable table
    fmi     : version of the FMU, of `versions.VERSIONS`
    """
    root = ET.Element("fmiTerminalsAndIcons", fmiVersion=VERSIONS[fmi].terminals)
    graphics = ET.SubElement(root, "GraphicalRepresentation")
    extent = {"x1": -ICON_EXTENT, "y1": -ICON_EXTENT, "x2": ICON_EXTENT, "y2": ICON_EXTENT}
    corners = {name: repr(value) for name, value in extent.items()}
    ET.SubElement(graphics, "CoordinateSystem", corners | {"suggestedScalingFactorTo_mm": "0.1"})
    ET.SubElement(graphics, "Icon", corners)
    found = terminals(scene, entries)
    if found:
        parent = ET.SubElement(root, "Terminals")
        for side, members in (
            (-1.0, [t for t in found if t.is_input]),
            (1.0, [t for t in found if not t.is_input]),
        ):
            for place, terminal in enumerate(members):
                _write(parent, terminal, side, place, len(members))
    return xml_text(root)


def terminal_icons(scene: Scene, entries: Sequence[TableEntry]) -> dict[str, bytes]:
    """Returns the image files that terminalsAndIcons.xml names, by their place in the archive."""
    files = {}
    for kind in sorted({terminal.kind for terminal in terminals(scene, entries)}):
        figure = Figure(
            TERMINAL_ICON_SIZE, TERMINAL_ICON_SIZE, kind.replace("_", " "), ICONS.get(kind, ICONS["torque"])
        )
        files[f"terminalsAndIcons/{kind}.png"] = png(figure)
        files[f"terminalsAndIcons/{kind}.svg"] = svg(figure).encode()
    return files


def _write(parent: ET.Element, terminal: Terminal, side: float, place: int, count: int) -> None:
    """Writes a terminal; it stands on the left (`side` -1) or right edge of the icon, one below the other."""
    element = ET.SubElement(
        parent,
        "Terminal",
        name=terminal.name,
        matchingRule=terminal.rule,
        terminalKind=f"{VENDOR}.{terminal.kind}",
        description=terminal.description,
    )
    for entry in terminal.members:
        attributes = {
            "variableName": entry.name,
            "memberName": entry.variable.name.removeprefix(terminal.prefix),
            "variableKind": "signal",
        }
        ET.SubElement(element, "TerminalMemberVariable", attributes)
    spacing = 2.0 * ICON_EXTENT / count
    half = min(TERMINAL_SIZE, 0.9 * spacing) / 2.0
    x, y = side * (ICON_EXTENT + half), ICON_EXTENT - spacing * (place + 0.5)
    box = {"x1": x - half, "y1": y - half, "x2": x + half, "y2": y + half}
    ET.SubElement(
        element,
        "TerminalGraphicalRepresentation",
        {
            "defaultConnectionColor": CONNECTION_COLOUR,
            **{corner: repr(round(value, 6)) for corner, value in box.items()},
            "iconBaseName": terminal.kind,
        },
    )


def _port_icon() -> list[Item]:
    """Returns a docking port: its face, an arrow outwards, a tick along the alignment."""
    return [
        Path(((22.0, 10.0), (22.0, 54.0)), stroke="#0072b2", width=6.0),
        Path(((22.0, 32.0), (22.0, 12.0)), stroke="#d55e00", width=6.0),
        *arrow((22.0, 32.0), (58.0, 32.0), "#222222", width=4.0, head=14.0),
        Path(regular_polygon((22.0, 32.0), 6.0, 16), fill="#222222", closed=True),
    ]


def _dock_icon() -> list[Item]:
    """Returns two docking ports, face to face."""
    return [
        Path(((26.0, 12.0), (26.0, 52.0)), stroke="#0072b2", width=6.0),
        Path(((38.0, 12.0), (38.0, 52.0)), stroke="#d55e00", width=6.0),
        *arrow((4.0, 32.0), (22.0, 32.0), "#222222", width=4.0, head=12.0),
        *arrow((60.0, 32.0), (42.0, 32.0), "#222222", width=4.0, head=12.0),
    ]


def _force_icon() -> list[Item]:
    """Returns an arrow from a point."""
    return [
        *arrow((12.0, 52.0), (54.0, 10.0), "#222222", width=5.0, head=18.0),
        Path(regular_polygon((12.0, 52.0), 7.0, 16), fill="#d55e00", closed=True),
    ]


def _torque_icon() -> list[Item]:
    """Returns an arrow around an axis."""
    angles = [2.4 + 1.5 * pi * i / 24 for i in range(25)]
    circle = tuple((32.0 + 20.0 * cos(a), 32.0 + 20.0 * sin(a)) for a in angles)
    return [
        Path(circle, stroke="#222222", width=4.0),
        *arrow(circle[-2], (circle[-1][0] + 2.0, circle[-1][1] + 9.0), "#222222", width=4.0, head=14.0),
        Path(regular_polygon((32.0, 32.0), 5.0, 16), fill="#d55e00", closed=True),
    ]


def _attitude_icon() -> list[Item]:
    """Returns the three axes of a body."""
    ends = ((58.0, 47.0), (32.0, 5.0), (6.0, 47.0))
    colours = ("#b00000", "#007000", "#0000b0")
    return [
        item
        for end, colour in zip(ends, colours, strict=True)
        for item in arrow((32.0, 34.0), end, colour, width=4.0, head=13.0)
    ]


ICONS = {
    "port_pose": _port_icon(),
    "port_motion": _port_icon(),
    "dock": _dock_icon(),
    "force": _force_icon(),
    "torque": _torque_icon(),
    "attitude": _attitude_icon(),
}
