"""Figures as PNG images: convex polygons, lines and stroke letters with smoothed edges, drawn in numpy."""

import struct
import zlib
from collections.abc import Sequence
from itertools import pairwise
from math import ceil, copysign, floor, hypot

import numpy as np
from numpy.typing import NDArray

from supervessel.drawing.figure import Figure, Path, Point, Text, flat

Array = NDArray[np.float64]

SMALLEST_AREA = 1e-3
"""Area [px2] below which a polygon has no inside to be filled."""

MOST_AT_ONCE = 30_000
"""Pixels times segments of a line that is drawn at once."""

SHADES = 16.0
"""Steps of an edge pixel's cover: enough for the eye, and the file is smaller."""

LETTERS = {
    line[0]: line[2:]
    for line in """\
A 02 28 42|14 34
B 02 08 38 47 46 35 05|35 44 43 32 02
C 47 38 18 07 03 12 32 43
D 02 08 28 46 44 22 02
E 48 08 02 42|05 35
F 48 08 02|05 35
G 47 38 18 07 03 12 32 43 45 25
H 02 08|42 48|05 45
I 12 32|18 38|22 28
J 48 43 32 12 03
K 02 08|48 05 42
L 08 02 42
M 02 08 25 48 42
N 02 08 42 48
O 12 03 07 18 38 47 43 32 12
P 02 08 38 47 46 35 05
Q 12 03 07 18 38 47 43 32 12|24 42
R 02 08 38 47 46 35 05|25 42
S 47 38 18 07 06 15 35 44 43 32 12 03
T 08 48|28 22
U 08 03 12 32 43 48
V 08 22 48
W 08 12 25 32 48
X 02 48|08 42
Y 08 25 48|25 22
Z 08 48 02 42
a 16 36 45 42|43 32 12 03 14 44
b 08 02|05 16 36 45 43 32 12 03
c 45 36 16 05 03 12 32 43
d 48 42|45 36 16 05 03 12 32 43
e 04 44 45 36 16 05 03 12 32 43
f 38 28 17 12|06 36
g 46 41 30 10 01|45 36 16 05 03 12 32 43
h 08 02|05 16 36 45 42
i 16 26 22|12 32|28 28
j 36 31 20 10|38 38
k 08 02|46 04|25 42
l 18 28 22|12 32
m 02 06|05 16 25 22|25 36 45 42
n 02 06|05 16 36 45 42
o 12 03 05 16 36 45 43 32 12
p 00 06|05 16 36 45 43 32 12 03
q 40 46|45 36 16 05 03 12 32 43
r 02 06|05 16 36 45
s 45 36 16 05 14 34 43 32 12 03
t 18 13 22 32 43|06 36
u 06 03 12 32 43|46 42
v 06 22 46
w 06 12 25 32 46
x 02 46|06 42
y 06 22|46 22 10
z 06 46 02 42
0 12 03 07 18 38 47 43 32 12|13 37
1 16 28 22|12 32
2 07 18 38 47 46 02 42
3 07 18 38 47 46 35 15|35 44 43 32 12 03
4 32 38 04 44
5 48 08 05 35 44 43 32 12 03
6 47 38 18 07 03 12 32 43 44 35 15 04
7 08 48 12
8 15 06 07 18 38 47 46 35 15 04 03 12 32 43 44 35
9 03 12 32 43 47 38 18 07 06 15 35 46
_ 01 41
. 22 22
, 23 22 11
: 23 23|26 26
; 26 26|23 22 11
' 28 26
- 15 35
+ 05 45|23 27
= 04 44|06 46
( 38 27 23 32
) 18 27 23 12
[ 38 18 12 32
] 18 38 32 12
/ 02 48
… 02 02|22 22|42 42""".splitlines()
}
"""Strokes of a letter, parted by bars: points (x, y) on a grid, baseline at y = 2, capitals up to 8."""

UNKNOWN_LETTER = "03 07 47 43 03"
LETTER_ADVANCE = 0.6  # of the size, from one letter to the next
GRID_WIDTH, GRID_HEIGHT = 0.1, 0.12  # of the size


def png(figure: Figure, scale: float = 1.0) -> bytes:
    """Returns a figure as a PNG image of `scale` pixels for each pixel of the figure; its edges are smoothed.

    The image has an alpha channel where the figure has no background.
    """
    height, width = round(figure.height * scale), round(figure.width * scale)
    canvas = np.zeros((height, width, 4))
    if figure.background:
        canvas[:] = _premultiplied(figure.background, 1.0)
    for item in flat(figure.items):
        if isinstance(item, Text):
            _draw_text(canvas, item, scale)
        else:
            _draw_path(canvas, item, scale)
    return _encoded(canvas, opaque=bool(figure.background))


def _draw_path(canvas: Array, path: Path, scale: float) -> None:
    points = [(scale * x, scale * y) for x, y in path.points]
    if path.fill:
        _fill(canvas, points, path.fill, path.opacity)
    if path.stroke:
        line = points + points[:1] if path.closed else points
        _stroke(canvas, [line], path.stroke, path.width * scale, path.dash * scale)


def _draw_text(canvas: Array, text: Text, scale: float) -> None:
    shift = {"start": 0.0, "middle": 0.5, "end": 1.0}[text.anchor]
    advance = LETTER_ADVANCE * text.size
    left = text.position[0] - shift * advance * len(text.text)
    lines = [
        [(scale * x, scale * y) for x, y in line]
        for place, letter in enumerate(text.text)
        for line in _letter(letter, left + place * advance, text.position[1], text.size)
    ]
    if text.halo:
        _stroke(canvas, lines, "#ffffff", (0.1 * text.size + 3.0) * scale)
    _stroke(canvas, lines, text.colour, 0.1 * text.size * scale)


def _letter(letter: str, left: float, baseline: float, size: float) -> list[list[Point]]:
    """Returns the strokes of a letter as lines of points [px]."""
    if letter == " ":
        return []
    return [
        [
            (left + GRID_WIDTH * size * int(at[0]), baseline - GRID_HEIGHT * size * (int(at[1]) - 2))
            for at in line.split(" ")
        ]
        for line in LETTERS.get(letter, UNKNOWN_LETTER).split("|")
    ]


def _premultiplied(colour: str, opacity: float) -> Array:
    """Returns red, green, blue and alpha, (4,), each times the opacity, of a colour "#rrggbb"."""
    return opacity * np.array([*(int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)), 1.0])


def _window(canvas: Array, points: Sequence[Point], margin: float) -> tuple[slice, slice]:
    """Returns the rows and columns of the pixels that lie within `margin` [px] of the box around points."""
    spans = []
    for size, places in zip(canvas.shape[:2], ([y for _, y in points], [x for x, _ in points]), strict=True):
        bounds = floor(min(places) - margin), ceil(max(places) + margin)
        spans.append(slice(*(min(max(bound, 0), size) for bound in bounds)))
    return spans[0], spans[1]


def _centres(rows: slice, columns: slice) -> tuple[Array, Array]:
    """Returns x, (1, m), and y, (n, 1), of the centres of pixels [px]."""
    return np.arange(columns.start, columns.stop)[None, :] + 0.5, np.arange(rows.start, rows.stop)[
        :, None
    ] + 0.5


def _paint(part: Array, cover: Array, colour: str, opacity: float) -> None:
    """Lays a colour over a part of the canvas; `cover` is the share of each pixel that it covers."""
    cover = np.rint(SHADES * cover) / SHADES
    part *= 1.0 - opacity * cover[..., None]
    part += cover[..., None] * _premultiplied(colour, opacity)


def _fill(canvas: Array, points: Sequence[Point], colour: str, opacity: float) -> None:
    """Fills a convex polygon; a pixel's cover is its depth behind the nearest edge, from -1/2 to 1/2 px."""
    edges = list(pairwise([*points, points[0]]))
    twice_area = sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in edges)
    if abs(twice_area) < 2.0 * SMALLEST_AREA:
        return
    rows, columns = _window(canvas, points, 1.0)
    x, y = _centres(rows, columns)
    depth = np.full((y.size, x.size), np.inf)
    for (x0, y0), (x1, y1) in edges:
        length = copysign(hypot(x1 - x0, y1 - y0), twice_area)
        if length != 0.0:
            depth = np.minimum(depth, (y - y0) * ((x1 - x0) / length) - (x - x0) * ((y1 - y0) / length))
    _paint(canvas[rows, columns], np.clip(depth + 0.5, 0.0, 1.0), colour, opacity)


def _stroke(
    canvas: Array, lines: Sequence[Sequence[Point]], colour: str, width: float, dash: float = 0.0
) -> None:
    """Draws lines with round ends and joints; where they cross they are not laid over one another twice."""
    if not lines:
        return
    margin = width / 2.0 + 1.0
    rows, columns = _window(canvas, [point for line in lines for point in line], margin)
    cover = np.zeros((rows.stop - rows.start, columns.stop - columns.start))
    for line in (piece for whole in lines for piece in _pieces(canvas, whole, margin)):
        near = _window(canvas, line, margin)
        part = cover[
            near[0].start - rows.start : near[0].stop - rows.start,
            near[1].start - columns.start : near[1].stop - columns.start,
        ]
        distance = _distance(*_centres(*near), line, dash)
        np.maximum(part, np.clip(width / 2.0 + 0.5 - distance, 0.0, min(width, 1.0)), out=part)
    _paint(canvas[rows, columns], cover, colour, 1.0)


def _pieces(canvas: Array, line: Sequence[Point], margin: float) -> Sequence[Sequence[Point]]:
    """Returns a line that is small as it is, a large one as its segments: what is drawn at once."""
    rows, columns = _window(canvas, line, margin)
    small = (rows.stop - rows.start) * (columns.stop - columns.start) * len(line) <= MOST_AT_ONCE
    return [line] if small and len(line) > 1 else list(pairwise(line))


def _distance(x: Array, y: Array, line: Sequence[Point], dash: float) -> Array:
    """Returns the distance, (n, m), of points from a line, whose segments may have no length.

    dash : length of dashes and gaps of each segment, 0 for none; the distance is that from the nearest dash
    """
    segments = []
    for (x0, y0), (x1, y1) in pairwise(line):
        across, down = x1 - x0, y1 - y0
        length = hypot(across, down)
        unit = (across / length, down / length) if length > 0.0 else (across, down)
        segments.append((x0, y0, *unit, length))
    x0, y0, across, down, length = np.array(segments).T[..., None, None]
    x, y = x - x0, y - y0
    along = np.clip(x * across + y * down, 0.0, length)
    if dash > 0.0:
        since = along % (2.0 * dash)
        nearest_end = np.where(since < 1.5 * dash, dash - since, 2.0 * dash - since)
        along = along + np.where(since > dash, nearest_end, 0.0)
    distance: Array = np.hypot(x - along * across, y - along * down).min(axis=0)
    return distance


def _encoded(canvas: Array, opaque: bool) -> bytes:
    """Returns the PNG file of premultiplied red, green, blue, alpha, (height, width, 4), 0 to 1."""
    height, width, _ = canvas.shape
    channels = canvas[..., :3]
    if not opaque:
        alpha = canvas[..., 3:]
        colours = np.divide(channels, alpha, out=np.zeros_like(channels), where=alpha > 0.0)
        channels = np.concatenate([colours, alpha], axis=2)
    pixels = np.rint(255.0 * np.clip(channels, 0.0, 1.0)).astype(np.uint8)
    rows = pixels.reshape(height, -1)
    unfiltered = np.hstack([np.zeros((height, 1), np.uint8), rows])  # filters save nothing on plain areas
    header = struct.pack(">IIBBBBB", width, height, 8, 2 if opaque else 6, 0, 0, 0)
    chunks: Sequence[tuple[bytes, bytes]] = (
        (b"IHDR", header),
        (b"IDAT", zlib.compress(unfiltered.tobytes(), 9)),
        (b"IEND", b""),
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
        for kind, content in chunks
    )
