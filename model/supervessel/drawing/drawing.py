"""Drawings of a docked assembly: an isometric view with names and three views along the body axes.

Lengths are in metres in the root vessel's axes, which are the body axes; positions on the drawing in
pixels. A view is a projection along parallel lines, so one scale bar holds everywhere in it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from math import floor, log10, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from supervessel.drawing.figure import Figure, Group, Item, Path, Point, Text, arrow, regular_polygon, sector
from supervessel.drawing.geometry import Assembly, DrawnPoint, DrawnPort, DrawnVessel

Array = NDArray[np.float64]
Area = tuple[float, float, float, float]
"""Left, top, width, height [px]."""

WIDTH = 960
MAIN_AREA = (190.0, 80.0, 580.0, 332.0)
SMALL_AREAS = tuple((50.0 + 313.0 * i, 530.0, 230.0, 170.0) for i in range(3))
ICON_SIZE = 256

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#8a6d00", "#3b9fd4", "#7b3fa0", "#5b6b2f")
"""Of vessels, in turn; told apart by the colour-blind too."""
AXIS_COLOURS = ("#b00000", "#007000", "#0000b0")
AXIS_NAMES = ("x", "y", "z")
DARK, GREY = "#222222", "#666666"

LIGHT = np.array([2.0, 5.0, 3.0]) / sqrt(38.0)
"""Where the light comes from, root axes: faces towards it are paler."""
SMALLEST_EXTENT = 1e-100  # m; what is smaller has no size that a scale could be taken from
SMALLEST_BOX = 4.0  # px; what is smaller in a view is a dot
NAME_LENGTH = 18  # letters of a name that a drawing shows
NAMES_IN_A_NOTE = 6


@dataclass(frozen=True)
class View:
    """A direction to look from.

    across, up : (3,), what is drawn one unit to the right and upwards, root axes
    towards    : (3,), unit, to the viewer
    """

    kind: str
    caption: str
    across: Sequence[float]
    up: Sequence[float]
    towards: Sequence[float]

    @property
    def projection(self) -> Array:
        """Takes a vector to the drawing, (2, 3): to the right and downwards."""
        return np.array([self.across, [-component for component in self.up]])


_C, _N = sqrt(0.75), sqrt(1.0 / 3.0)
ISOMETRIC = View(
    "isometric", "isometric: x, y and z at full length", (_C, 0.0, -_C), (-0.5, 1.0, -0.5), (_N, _N, _N)
)
"""Enlarged by sqrt(3/2), as isometric drawings are, so that lengths along the axes are not shortened."""

SMALL_VIEWS = (
    View("top", "from +y: x right, z down", (1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)),
    View("front", "from +z: x right, y up", (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    View("side", "from +x: z left, y up", (0.0, 0.0, -1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)),
)


@dataclass(frozen=True)
class Panel:
    """A view on its place in the drawing: [px] = scale * projection @ position + offset."""

    view: View
    area: Area
    scale: float
    offset: Array

    def at(self, position: Array) -> Point:
        """Returns where a position, (3,) [m], stands in the drawing [px]."""
        x, y = self.scale * self.view.projection @ position + self.offset
        return float(x), float(y)

    def along(self, position: Array, direction: Array, length: float) -> Point:
        """Returns the point that lies `length` [px], as the view shortens it, along a unit vector."""
        x, y = (
            self.scale * self.view.projection @ position
            + self.offset
            + length * self.view.projection @ direction
        )
        return float(x), float(y)


def drawing(parts: Assembly) -> Figure:
    """Returns the drawing of an assembly."""
    scene = parts.scene
    points = _points(parts)
    main = _panel(ISOMETRIC, MAIN_AREA, points)
    small = [_panel(view, area, points) for view, area in zip(SMALL_VIEWS, SMALL_AREAS, strict=True)]
    count = len(parts.poses)
    vessels = f"{count} vessel{'s' if count > 1 else ''}"
    items: list[Item] = [
        Text((20.0, 28.0), _short(scene.name, 60), size=17.0, colour=DARK),
        Text(
            (20.0, 47.0),
            f"{vessels}, {parts.whole['mass'][0]:.6g} kg; body axes are those of {_short(scene.root)}",
            colour=GREY,
        ),
        _main_view(parts, main),
        *(_small_view(parts, panel) for panel in small),
    ]
    notes = _notes(parts)
    items += [Text((20.0, 762.0 + 17.0 * i), note, colour=GREY) for i, note in enumerate(notes)]
    title = f"{scene.name}: {vessels}, seen from four sides"
    return Figure(WIDTH, 762 + 17 * len(notes), title, items, background="#ffffff")


def icon(parts: Assembly) -> Figure:
    """Returns a square picture of an assembly's vessels, without names and ports, on no background."""
    margin = ICON_SIZE / 16
    area = (margin, margin, ICON_SIZE - 2 * margin, ICON_SIZE - 2 * margin)
    panel = _panel(ISOMETRIC, area, _points(parts, ports=False))
    items = [item for vessel in _by_depth(parts.vessels, panel.view) for item in _vessel(vessel, panel, 2.0)]
    return Figure(ICON_SIZE, ICON_SIZE, parts.scene.name, items)


def _points(parts: Assembly, ports: bool = True) -> Array:
    """Returns every point, (n, 3) [m], that the views must hold."""
    points = [vessel.centre[None, :] for vessel in parts.vessels]
    points += [vessel.corners.reshape(8, 3) for vessel in parts.vessels if not vessel.massless]
    points += [port.position[None, :] for port in parts.ports if ports]
    points += [point.position[None, :] for point in parts.points if ports]
    if parts.barycentre is not None and ports and not parts.vessels_omitted:
        points.append(parts.barycentre[None, :])
    return np.vstack([*points, np.zeros((0, 3))])


def _panel(view: View, area: Area, points: Array) -> Panel:
    """Returns a view at the largest scale at which the points fit into an area.

    Where the points have no extent, a metre is 100 px.
    """
    left, top, width, height = area
    projected = points @ view.projection.T if len(points) else np.zeros((1, 2))
    low, high = projected.min(axis=0), projected.max(axis=0)
    sizes = zip((width, height), high - low, strict=True)
    scale = min((room / float(extent) for room, extent in sizes if extent > SMALLEST_EXTENT), default=100.0)
    middle = np.array([left + width / 2.0, top + height / 2.0])
    return Panel(view, area, scale, middle - scale * (low + high) / 2.0)


def _by_depth(vessels: Sequence[DrawnVessel], view: View) -> list[DrawnVessel]:
    """Returns vessels in the order of painting, the farthest first."""
    return sorted(vessels, key=lambda vessel: float(np.dot(view.towards, vessel.centre)))


def _main_view(parts: Assembly, panel: Panel) -> Group:
    boxes = [
        Group("vessel", list(_vessel(vessel, panel, 1.2)), vessel.name)
        for vessel in _by_depth(parts.vessels, panel.view)
    ]
    length = _arrow_length(parts)
    left, top, width, height = panel.area
    return Group(
        "isometric",
        [
            *boxes,
            *_names(parts.vessels, panel),
            *(_port(port, panel, length) for port in parts.ports),
            *(_force_point(point, panel) for point in parts.points),
            _body_axes(parts, panel, 56.0),
            _scale_bar(panel.scale, (left + width, top + height + 58.0)),
            Text((20.0, top + height + 58.0), panel.view.caption, colour=GREY),
        ],
    )


def _small_view(parts: Assembly, panel: Panel) -> Group:
    left, top, width, height = panel.area
    length = 0.6 * _arrow_length(parts)
    items: list[Item] = [Text((left - 30.0, top - 16.0), panel.view.caption, colour=GREY)]
    items += [
        item
        for vessel in _by_depth(parts.vessels, panel.view)
        for item in _vessel(vessel, panel, 1.0, paint=0.45)
    ]
    items += [_port(port, panel, length) for port in parts.ports]
    items += [_force_point(point, panel) for point in parts.points]
    items.append(_body_axes(parts, panel, 34.0))
    items += _numbers(parts, panel)
    items.append(_scale_bar(panel.scale, (left + width, top + height + 34.0)))
    return Group(panel.view.kind, items)


def _vessel(vessel: DrawnVessel, panel: Panel, width: float, paint: float = 1.0) -> Iterator[Item]:
    """Yields a vessel's box; a mark where it has no mass or no size.

    paint : factor of the faces' opacity; with less than 1 the hidden edges are left out
    """
    colour = COLOURS[(vessel.number - 1) % len(COLOURS)]
    centre = panel.at(vessel.centre)
    if vessel.massless:
        yield Path(
            regular_polygon(centre, 6.0, 4),
            stroke=colour,
            width=1.5,
            fill="#ffffff",
            opacity=0.8,
            closed=True,
        )
        return
    corners = {place: panel.at(vessel.corners[place]) for place in product((0, 1), repeat=3)}
    across, down = zip(*corners.values(), strict=True)
    if max(max(across) - min(across), max(down) - min(down)) < SMALLEST_BOX:
        yield Path(regular_polygon(centre, 4.0, 12), fill=colour, closed=True)
        return
    facing = [float(np.dot(vessel.axes[:, axis], panel.view.towards)) for axis in range(3)]
    if paint == 1.0:
        far = tuple(int(cosine < 0.0) for cosine in facing)  # the corner that the box itself hides
        for axis in range(3):
            end = tuple(1 - side if i == axis else side for i, side in enumerate(far))
            yield Path((corners[far], corners[end]), stroke=colour, width=0.7, dash=3.0)
    for axis, cosine in enumerate(facing):
        if abs(cosine) > 1e-9:
            side = int(cosine > 0.0)
            normal = np.sign(cosine) * vessel.axes[:, axis]
            opacity = paint * (0.62 - 0.4 * max(0.0, float(normal @ LIGHT)))
            outline = tuple(corners[place] for place in _face(axis, side))
            yield Path(outline, stroke=colour, width=width, fill=colour, opacity=opacity, closed=True)


def _face(axis: int, side: int) -> list[tuple[int, ...]]:
    """Returns the four corners of a box's face, in order around it."""
    return [(*around[:axis], side, *around[axis:]) for around in ((0, 0), (0, 1), (1, 1), (1, 0))]


def _port(port: DrawnPort, panel: Panel, length: float) -> Group:
    """Returns a port: a line from its vessel's centre, a dot, an arrow outwards, a tick along the alignment.

    A direction along the line of sight shows as a ring with a dot (towards the viewer) or a cross.
    """
    colour = COLOURS[(port.vessel.number - 1) % len(COLOURS)]
    position = panel.at(port.position)
    x, y = position
    items: list[Item] = [Path((panel.at(port.vessel.centre), position), stroke=colour, width=0.8, dash=1.5)]
    facing = float(np.dot(port.direction, panel.view.towards))
    if abs(facing) > 0.97:
        items.append(Path(regular_polygon(position, 5.0, 16), stroke=DARK, fill="#ffffff", closed=True))
        if facing < 0.0:
            items += [Path(((x - 3.5, y - s), (x + 3.5, y + s)), stroke=DARK) for s in (-3.5, 3.5)]
    else:
        items += arrow(position, panel.along(port.position, port.direction, length), DARK)
    tick = panel.along(port.position, port.alignment, 0.45 * length)
    items.append(Path((position, tick), stroke=colour, width=3.0))
    items.append(Path(regular_polygon(position, 2.5, 12), fill=DARK, closed=True))
    if port.switchable:
        ring = regular_polygon(position, 8.0, 24)
        items += [Path(ring[i : i + 3], stroke=DARK) for i in range(0, 24, 4)]
    return Group("port", items, port.name)


def _force_point(point: DrawnPoint, panel: Panel) -> Group:
    """Returns a point where a force acts: a cross."""
    colour = COLOURS[(point.vessel.number - 1) % len(COLOURS)]
    x, y = panel.at(point.position)
    lines = [((x - 4.0, y - s), (x + 4.0, y + s)) for s in (-4.0, 4.0)]
    return Group("point", [Path(line, stroke=colour, width=2.0) for line in lines], point.name)


def _arrow_length(parts: Assembly) -> float:
    """Returns the length [px] of the ports' arrows in the large view: the more ports, the shorter."""
    return 30.0 if len(parts.ports) <= 8 else 22.0 if len(parts.ports) <= 30 else 16.0


def _sign(parts: Assembly, panel: Panel) -> Point | None:
    """Returns where the barycentre stands, None where that is outside the view (of a part of the vessels)."""
    if parts.barycentre is None:
        return None
    x, y = panel.at(parts.barycentre)
    left, top, width, height = panel.area
    inside = left - 1.0 <= x <= left + width + 1.0 and top - 1.0 <= y <= top + height + 1.0
    return (x, y) if inside else None


def _body_axes(parts: Assembly, panel: Panel, length: float) -> Group:
    """Returns the body axes with their names at the barycentre's sign, or at the lower left."""
    left, top, _, height = panel.area
    sign = _sign(parts, panel)
    x, y = sign or (left, top + height)
    items: list[Item] = []
    for name, colour, (across, down) in zip(AXIS_NAMES, AXIS_COLOURS, panel.view.projection.T, strict=True):
        shaft = arrow((x, y), (x + length * across, y + length * down), colour, width=1.8, head=8.0)
        if shaft:
            end = x + (length + 10.0) * across, y + (length + 10.0) * down + 4.0
            items += [*shaft, Text(end, name, colour=colour, anchor="middle", halo=True)]
    if sign is None:
        return Group("axes", items, "body axes")
    items.append(Path(regular_polygon(sign, 6.5, 24), stroke=DARK, fill="#ffffff", closed=True))
    items += [Path(sector(sign, 6.5, a, a + pi / 2), fill=DARK, closed=True) for a in (0.0, pi)]
    return Group("barycentre", items, "barycentre and body axes")


def _names(vessels: Sequence[DrawnVessel], panel: Panel) -> Iterator[Item]:
    """Yields numbers and names of the vessels in a column on either side, with lines to their centres."""
    centres = {vessel.number: panel.at(vessel.centre) for vessel in vessels}
    across = sorted(vessels, key=lambda vessel: (centres[vessel.number][0], vessel.number))
    middle = (len(vessels) + 1) // 2
    left, top, width, height = panel.area
    columns = ((across[:middle], left - 22.0, "end"), (across[middle:], left + width + 22.0, "start"))
    for column, x, anchor in columns:
        downwards = sorted(column, key=lambda vessel: (centres[vessel.number][1], vessel.number))
        heights = _spread([centres[vessel.number][1] for vessel in downwards], 17.0, top, top + height)
        for vessel, y in zip(downwards, heights, strict=True):
            start = (x + (5.0 if anchor == "end" else -5.0), y - 4.0)
            yield Path((start, centres[vessel.number]), stroke="#999999", width=0.7)
            yield Path(regular_polygon(centres[vessel.number], 1.8, 8), fill="#777777", closed=True)
            colour = COLOURS[(vessel.number - 1) % len(COLOURS)]
            yield Text((x, y), f"{vessel.number} {_short(vessel.name)}", colour=colour, anchor=anchor)


def _spread(wanted: Sequence[float], gap: float, low: float, high: float) -> list[float]:
    """Returns ascending heights as near to the wanted ones as a gap between them allows, within limits.

    Where they do not fit between the limits, they start at `low` and go beyond `high`.
    """
    heights: list[float] = []
    for height in wanted:
        heights.append(max(height, heights[-1] + gap if heights else low))
    ceiling = high
    for i in reversed(range(len(heights))):
        heights[i] = min(heights[i], ceiling)
        ceiling = heights[i] - gap
    shift = max(0.0, low - heights[0]) if heights else 0.0
    return [height + shift for height in heights]


def _numbers(parts: Assembly, panel: Panel) -> Iterator[Text]:
    """Yields the vessels' numbers at their centres, beside the barycentre's sign where that stands there.

    A number that would cover a nearer vessel's is left out; a single vessel needs none.
    """
    taken: list[Point] = []
    vessels = _by_depth(parts.vessels, panel.view) if len(parts.vessels) > 1 else []
    sign = _sign(parts, panel)
    for vessel in reversed(vessels):
        x, y = panel.at(vessel.centre)
        if sign and abs(x - sign[0]) < 12.0 and abs(y - sign[1]) < 12.0:
            x, y = sign[0] - 14.0, sign[1] + 14.0
        if all(abs(x - a) > 12.0 or abs(y - b) > 10.0 for a, b in taken):
            taken.append((x, y))
            colour = COLOURS[(vessel.number - 1) % len(COLOURS)]
            yield Text((x, y + 4.0), str(vessel.number), size=11.0, colour=colour, anchor="middle", halo=True)


def _scale_bar(scale: float, end: Point) -> Group:
    """Returns a bar of a round length, at most 110 px, that ends at a point."""
    decade = 10.0 ** floor(log10(110.0 / scale))
    metres = max(m for m in (decade, 2.0 * decade, 5.0 * decade) if m * scale <= 110.0)
    x, y = end
    start = x - metres * scale
    bar = [((start, y), (x, y)), ((start, y - 4.0), (start, y + 4.0)), ((x, y - 4.0), (x, y + 4.0))]
    label = f"{metres:g} m"
    return Group(
        "scale",
        [
            *(Path(line, stroke=DARK, width=1.5) for line in bar),
            Text(((start + x) / 2.0, y - 7.0), label, colour=DARK, anchor="middle"),
        ],
        label,
    )


def _notes(parts: Assembly) -> list[str]:
    """Returns what a reader of the drawing must know."""
    notes = [
        "Each box is the uniform cuboid with its vessel's moments of inertia; everything at its start value."
    ]
    if parts.ports:
        notes.append(
            "Docking ports: arrow outwards, thick tick along alignment, dotted line to the vessel's centre."
        )
    if any(port.switchable for port in parts.ports):
        notes.append("A dashed ring is around a port whose dock can open and close.")
    if parts.points:
        notes.append("A cross is a point where a force acts.")
    if any(vessel.massless for vessel in parts.vessels):
        notes.append("A diamond is a vessel without mass.")
    omitted = [
        f"{count} {what}{'s' if count > 1 else ''}"
        for count, what in ((parts.vessels_omitted, "vessel"), (parts.ports_omitted, "docking port"))
        if count
    ]
    if omitted:
        notes.append(f"Not drawn: {' and '.join(omitted)}.")
    if parts.detached:
        names = [_short(name) for name in parts.detached[:NAMES_IN_A_NOTE]]
        others = " and others" if len(parts.detached) > NAMES_IN_A_NOTE else ""
        notes.append(f"Not docked at the start, so without a place: {', '.join(names)}{others}.")
    return notes


def _short(name: str, length: int = NAME_LENGTH) -> str:
    """Returns a name, its end replaced by dots where it is too long."""
    return name if len(name) <= length else name[: length - 1] + "…"
