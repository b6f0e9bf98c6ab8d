"""Drawings as lists of paths and texts, in pixels from the upper left corner, and as SVG text."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape
from math import atan2, cos, pi, sin

Point = tuple[float, float]


@dataclass(frozen=True)
class Path:
    """A line through points; with `closed` and `fill` a polygon, which must be convex.

    points  : [px], x to the right, y downwards
    stroke  : colour "#rrggbb", "" for no line
    width   : of the line [px]
    fill    : colour, "" for none
    opacity : of the fill, 0 to 1
    dash    : length of dashes and gaps [px], 0 for a full line
    """

    points: tuple[Point, ...]
    stroke: str = ""
    width: float = 1.0
    fill: str = ""
    opacity: float = 1.0
    closed: bool = False
    dash: float = 0.0


@dataclass(frozen=True)
class Text:
    """A line of text.

    position : of its baseline [px]
    anchor   : "start", "middle" or "end": the part of the text that stands there
    halo     : whether a white rim sets it off from what is below
    """

    position: Point
    text: str
    size: float = 12.0
    colour: str = "#222222"
    anchor: str = "start"
    halo: bool = False


@dataclass(frozen=True)
class Group:
    """Items that belong together: `kind` is their class in the SVG, `title` a viewer shows on hovering."""

    kind: str
    items: Sequence["Item"]
    title: str = ""


Item = Path | Text | Group


@dataclass(frozen=True)
class Figure:
    """A drawing: its size [px], a sentence that says what it shows, a background colour ("" for none)."""

    width: int
    height: int
    title: str
    items: Sequence[Item]
    background: str = ""


def flat(items: Sequence[Item]) -> Iterator[Path | Text]:
    """Yields the paths and texts of nested groups, in the order of painting."""
    for item in items:
        if isinstance(item, Group):
            yield from flat(item.items)
        else:
            yield item


def regular_polygon(centre: Point, radius: float, corners: int) -> tuple[Point, ...]:
    """Returns the corners of a regular polygon, the first one on the right; many of them make a disc."""
    x, y = centre
    angles = (2.0 * pi * i / corners for i in range(corners))
    return tuple((x + radius * cos(a), y + radius * sin(a)) for a in angles)


def sector(centre: Point, radius: float, start: float, end: float, steps: int = 6) -> tuple[Point, ...]:
    """Returns the outline of a sector of a disc between two angles [rad], clockwise on the screen."""
    x, y = centre
    angles = (start + (end - start) * i / steps for i in range(steps + 1))
    return (centre, *((x + radius * cos(a), y + radius * sin(a)) for a in angles))


def arrow(start: Point, end: Point, colour: str, width: float = 1.5, head: float = 7.0) -> list[Path]:
    """Returns a line with a filled head at its end; nothing where it is too short to point anywhere."""
    dx, dy = end[0] - start[0], end[1] - start[1]
    if dx * dx + dy * dy < 1.0:
        return []
    angle = atan2(dy, dx)
    corners = tuple((end[0] - head * cos(angle + a), end[1] - head * sin(angle + a)) for a in (-0.4, 0.4))
    neck = (end[0] - 0.7 * head * cos(angle), end[1] - 0.7 * head * sin(angle))
    return [
        Path((start, neck), stroke=colour, width=width),
        Path((end, *corners), fill=colour, closed=True),
    ]


def svg(figure: Figure, standalone: bool = True) -> str:
    """Returns a figure as SVG text, coordinates rounded to 0.01 px.

    standalone : a file of its own; else an element to stand in an HTML page, which knows its namespace
    """
    width, height = figure.width, figure.height
    head = '<?xml version="1.0" encoding="UTF-8"?>\n' if standalone else ""
    namespace = ' xmlns="http://www.w3.org/2000/svg"' if standalone else ""
    lines = [
        f'{head}<svg{namespace} width="{width}" height="{height}" viewBox="0 0 {width} {height}" role="img"'
        ' font-family="sans-serif" stroke-linecap="round" stroke-linejoin="round" fill="none">',
        f"<title>{escape(figure.title)}</title>",
    ]
    if figure.background:
        lines.append(f'<rect width="{width}" height="{height}" fill="{figure.background}"/>')
    lines += [_item(item) for item in figure.items]
    return "\n".join([*lines, "</svg>\n"])


def _item(item: Item) -> str:
    if isinstance(item, Path):
        return _path(item)
    if isinstance(item, Text):
        return _text(item)
    title = [f"<title>{escape(item.title)}</title>"] if item.title else []
    return "\n".join([f'<g class="{escape(item.kind)}">', *title, *map(_item, item.items), "</g>"])


def _path(path: Path) -> str:
    tag = "polygon" if path.closed else "polyline"
    points = " ".join(f"{number(x)},{number(y)}" for x, y in path.points)
    attributes = f' points="{points}"'
    if path.fill:
        attributes += f' fill="{path.fill}"'
        if path.opacity != 1.0:
            attributes += f' fill-opacity="{number(path.opacity)}"'
    if path.stroke:
        attributes += f' stroke="{path.stroke}" stroke-width="{number(path.width)}"'
    if path.dash:
        attributes += f' stroke-dasharray="{number(path.dash)}"'
    return f"<{tag}{attributes}/>"


def _text(text: Text) -> str:
    x, y = text.position
    attributes = f' x="{number(x)}" y="{number(y)}" font-size="{number(text.size)}"'
    if text.anchor != "start":
        attributes += f' text-anchor="{text.anchor}"'
    content = f">{escape(text.text)}</text>"
    halo = (
        f'<text{attributes} stroke="#ffffff" stroke-width="3" aria-hidden="true"{content}\n'
        if text.halo
        else ""
    )
    return f'{halo}<text{attributes} fill="{text.colour}"{content}'


def number(value: float) -> str:
    """Returns a coordinate rounded to 0.01, without trailing zeros and without a sign on zero."""
    return f"{round(value, 2) + 0.0:.2f}".rstrip("0").rstrip(".")
