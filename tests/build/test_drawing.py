"""Drawings: what they show stands where the reference puts it, at any size and number of vessels."""

import io
import math
import string
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.image import imread

from supervessel import parse_scene, reference
from supervessel.drawing.drawing import drawing, icon
from supervessel.drawing.figure import Figure, Path, Text, number, svg
from supervessel.drawing.geometry import VESSEL_LIMIT, assembly, semi_axes
from supervessel.drawing.raster import LETTERS, png
from support import EPS, ISS_DG, body, random_rotation, variant

SVG = "{http://www.w3.org/2000/svg}"

VIEWS = {
    "isometric": [[math.sqrt(0.75), 0.0, -math.sqrt(0.75)], [0.5, -1.0, 0.5]],
    "top": [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
    "front": [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0]],
    "side": [[0.0, 0.0, -1.0], [0.0, -1.0, 0.0]],
}
"""Where a metre along x, y and z goes in each view, in scaled pixels to the right and downwards."""

# Coordinates are rounded to 0.01 px, and so are the two ends of the scale bar, some 50 px long, that the
# test takes the scale from: over the 500 px of a view that makes 500 * 0.01 / 50 px.
PLACE_TOLERANCE = 0.15  # px

# semi_axes divides by the largest moment, adds with one rounding, takes two roots and multiplies.
SQUARE_TOLERANCE = 16.0 * EPS


def port(position, direction, alignment):
    return {"position": position, "direction": direction, "alignment": alignment}


def chain(count, **changes):
    """Returns the raw scene of vessels docked one after the other, each turned against the one before."""
    vessels, docks = {}, []
    for i in range(count):
        angle = 0.3 * (i % 5)
        ports = {
            "aft": port([0.0, 0.0, 2.5], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]),
            "fore": port([0.0, 0.0, -2.5], [0.0, math.sin(angle), -math.cos(angle)], [1.0, 0.0, 0.0]),
            "free": port([1.5, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]),
        }
        vessels[f"m{i}"] = {"mass": 1000.0 + i, "pmi": [2.0, 3.0, 3.2], "ports": ports}
        if i:
            docks.append({"ports": [f"m{i - 1}.fore", f"m{i}.aft"]})
    return variant({"name": "chain", "root": "m0", "vessels": vessels, "docks": docks}, changes)


def placed(raw):
    return assembly(parse_scene(raw))


def parsed(raw):
    return ET.fromstring(svg(drawing(placed(raw))))


def groups(element, kind):
    """Returns the groups of a class within an SVG element, by title; of several with one title the last."""
    return {
        group.findtext(f"{SVG}title", ""): group
        for group in element.iter(f"{SVG}g")
        if group.get("class") == kind
    }


def points(element):
    return np.array([[float(x) for x in pair.split(",")] for pair in element.get("points").split()])


def port_marks(view):
    """Returns where a view shows its ports: the centre of each port's dot, which is drawn last."""
    return {name: points(group[-1]).mean(axis=0) for name, group in groups(view, "port").items()}


def scale_of(view):
    """Returns the scale [px/m] of a view by its scale bar."""
    ((label, group),) = groups(view, "scale").items()
    start, end = points(group.find(f"{SVG}polyline"))
    return (end[0] - start[0]) / float(label.removesuffix(" m"))


def port_positions(raw):
    scene = parse_scene(raw)
    poses = reference.poses(scene)
    return {
        f"{vessel}.{name}": poses[vessel][1] + poses[vessel][0] @ np.array(one.position)
        for vessel in scene.vessels
        for name, one in scene.vessels[vessel].ports.items()
    }


@pytest.mark.parametrize("view_name", VIEWS)
@pytest.mark.parametrize("raw", [ISS_DG, chain(6)], ids=["iss", "chain"])
def test_ports_stand_where_the_reference_puts_them(raw, view_name):
    view = groups(parsed(raw), view_name)[""]
    marks, positions = port_marks(view), port_positions(raw)
    sign = groups(view, "barycentre")["barycentre and body axes"]
    disc = next(polygon for polygon in sign.findall(f"{SVG}polygon") if polygon.get("fill") == "#ffffff")
    origin = points(disc).mean(axis=0)
    barycentre = reference.composite(parse_scene(raw)).barycentre
    assert set(marks) == set(positions)
    for name, position in positions.items():
        wanted = origin + scale_of(view) * np.array(VIEWS[view_name]) @ (position - barycentre)
        assert np.abs(marks[name] - wanted).max() < PLACE_TOLERANCE, name


def test_arrows_of_mated_ports_point_at_each_other():
    arrows = {
        name: np.diff(points(group.findall(f"{SVG}polyline")[1]), axis=0)[0]
        for name, group in groups(groups(parsed(ISS_DG), "isometric")[""], "port").items()
    }
    assert np.abs(arrows["ISS.P2"] + arrows["DG.nose"]).max() < PLACE_TOLERANCE
    down = np.array(VIEWS["isometric"]) @ np.array(ISS_DG["vessels"]["ISS"]["ports"]["P2"]["direction"])
    cosine = arrows["ISS.P2"] @ down / np.linalg.norm(arrows["ISS.P2"]) / np.linalg.norm(down)
    assert cosine > 1.0 - 1e-5  # an arrow of 25 px, its ends rounded to 0.01 px


EDGE = st.just(0.0) | st.floats(1e-6, 1e3)


@given(st.tuples(EDGE, EDGE, EDGE), st.floats(1e-100, 1e100))
def test_the_cuboid_of_given_moments_has_them(edges, scale):
    a, b, c = (scale * edge for edge in edges)
    moments = ((b * b + c * c) / 3.0, (c * c + a * a) / 3.0, (a * a + b * b) / 3.0)
    squares = semi_axes(moments) ** 2
    assert np.abs(squares - np.square([a, b, c])).max() <= SQUARE_TOLERANCE * max(moments)


@pytest.mark.parametrize("thin", [1e-3, 1e-9, 1e-15])
def test_the_box_of_a_thin_rod_keeps_its_digits(thin):
    rod = semi_axes((thin, 1.0, 1.0)) ** 2
    wanted = np.array([1.5 * (2.0 - thin), 1.5 * thin, 1.5 * thin])
    assert np.all(np.abs(rod - wanted) <= SQUARE_TOLERANCE * wanted)


def test_the_box_of_a_point_has_no_size():
    assert np.all(semi_axes((0.0, 0.0, 0.0)) == 0.0)


def test_a_box_has_the_moments_of_a_full_tensor_in_root_axes():
    turn = random_rotation(3)
    inertia = turn @ np.diag([300.0, 500.0, 700.0]) @ turn.T
    inertia = (inertia + inertia.T) / 2.0
    raw = variant(ISS_DG, {"vessels.DG.pmi": None, "vessels.DG.inertia": inertia.tolist(), "inputs.pmi": []})
    parts = placed(raw)
    vessel = next(vessel for vessel in parts.vessels if vessel.name == "DG")
    offsets = vessel.corners.reshape(8, 3) - vessel.centre
    second = offsets.T @ offsets / 8.0 / 3.0  # a cuboid's second moment is a third of its corners'
    rotation = parts.poses["DG"][0]
    wanted = rotation @ inertia @ rotation.T / ISS_DG["vessels"]["DG"]["mass"]
    found = np.trace(second) * np.eye(3) - second
    assert np.abs(found - wanted).max() <= 64.0 * EPS * np.abs(wanted).max()  # an eigendecomposition


@pytest.mark.parametrize("raw", [ISS_DG, body(), chain(20)], ids=["iss", "single", "chain"])
def test_a_drawing_is_the_same_each_time(raw):
    one, other = drawing(placed(raw)), drawing(placed(raw))
    assert svg(one) == svg(other)
    assert png(one) == png(other)


@pytest.mark.parametrize("scale", [1.0, 1.5])
@pytest.mark.parametrize("raw", [ISS_DG, body()], ids=["iss", "single"])
def test_the_image_decodes_to_its_size_and_is_not_blank(raw, scale):
    figure = drawing(placed(raw))
    image = imread(io.BytesIO(png(figure, scale)))
    assert image.shape == (round(figure.height * scale), round(figure.width * scale), 3)
    painted = np.mean(np.any(image < 1.0, axis=2))
    assert 0.05 < painted < 0.6


def test_the_image_shows_ports_where_the_vector_drawing_does():
    raw = chain(3)
    image = imread(io.BytesIO(png(drawing(placed(raw)))))
    marks = port_marks(groups(parsed(raw), "isometric")[""])
    for name, (x, y) in marks.items():
        assert np.allclose(image[int(y), int(x)], 34.0 / 255.0, atol=0.01), name


def test_the_icon_is_square_and_transparent_without_letters():
    figure = icon(placed(ISS_DG))
    image = imread(io.BytesIO(png(figure)))
    assert image.shape == (figure.height, figure.height, 4)
    assert np.all(image[0, :, 3] == 0.0)
    assert image[..., 3].max() > 0.9
    assert "<text" not in svg(figure)
    assert "port" not in svg(figure)


def test_twenty_names_stand_below_one_another_without_touching():
    view = groups(parsed(chain(20)), "isometric")[""]
    columns: dict[str, list[float]] = {}
    for text in view.findall(f"{SVG}text"):
        if " m" in (text.text or ""):
            columns.setdefault(text.get("x"), []).append(float(text.get("y")))
    assert sum(len(column) for column in columns.values()) == 20
    assert all(np.diff(sorted(column)).min() > 16.0 for column in columns.values())


def test_a_thousand_vessels_leave_a_small_drawing_that_says_what_is_missing():
    parts = placed(chain(1000))
    text = svg(drawing(parts))
    assert len(parts.vessels) == VESSEL_LIMIT
    assert "m0" in {vessel.name for vessel in parts.vessels}
    assert f"Not drawn: {1000 - VESSEL_LIMIT} vessels" in text
    assert len(text) < 400_000


def test_a_vessel_without_mass_is_a_diamond():
    raw = variant(ISS_DG, {"vessels.DG.mass": 0.0})
    drawn = groups(groups(parsed(raw), "isometric")[""], "vessel")["DG"]
    assert [len(points(polygon)) for polygon in drawn.findall(f"{SVG}polygon")] == [4]
    assert "A diamond is a vessel without mass." in svg(drawing(placed(raw)))


def test_a_vessel_too_small_to_see_is_a_dot():
    raw = variant(ISS_DG, {"vessels.DG.pmi": [0.0, 0.0, 0.0]})
    drawn = groups(groups(parsed(raw), "isometric")[""], "vessel")["DG"]
    assert [len(points(polygon)) for polygon in drawn.findall(f"{SVG}polygon")] == [12]


@pytest.mark.parametrize("size", [1e-200, 1e-12, 1.0, 1e12, 1e90])
def test_a_body_of_any_size_fills_its_view(size):
    raw = body(mass=1e-10, pmi=(size, size, size), law="none")
    parts = placed(raw)
    text = svg(drawing(parts))
    assert "nan" not in text
    assert "inf" not in text
    assert len(png(icon(parts))) > 200


def test_what_is_too_far_away_is_left_out():
    raw = variant(ISS_DG, {"vessels.DG.ports.nose.position": [0.0, 0.0, -1e120], "rotation": {"law": "none"}})
    text = svg(drawing(placed(raw)))
    assert "Not drawn: 1 vessel." in text
    assert "nan" not in text


def test_a_long_name_is_shortened_but_whole_on_hovering():
    name = "Very_long_name_" * 6
    raw = variant(body(), {"root": name, "vessels": {name: body()["vessels"]["B"]}})
    drawn = parsed(raw)
    assert all(len(text.text or "") < 120 for text in drawn.iter(f"{SVG}text"))
    assert name in groups(drawn, "vessel")


@pytest.mark.parametrize("order", [1, -1], ids=["clockwise", "anticlockwise"])
def test_a_polygon_covers_its_area(order):
    corners = ((10.3, 10.0), (20.8, 10.0), (20.8, 30.5), (10.3, 30.5))[::order]
    figure = Figure(40, 40, "", [Path(corners, fill="#000000", closed=True)])
    image = imread(io.BytesIO(png(figure)))
    # an edge pixel's cover is rounded to 1/16, which moves each edge by 1/32 px at most
    assert abs(float(image[..., 3].sum()) - 10.5 * 20.5) < (10.5 + 20.5) * 2.0 / 32.0


def test_a_dashed_line_has_dashes_with_round_ends():
    line = Path(((10.0, 10.0), (110.0, 10.0)), "#000000", 2.0, dash=10.0)
    image = imread(io.BytesIO(png(Figure(120, 20, "", [line]))))
    # five dashes of 10 px by 2 px; a round end, half a disc of 1 px, is drawn within half a pixel
    assert abs(float(image[..., 3].sum()) - 5.0 * (20.0 + math.pi)) < 10.0 * 0.5
    assert image[10, 15, 3] == 1.0
    assert image[10, 25, 3] == 0.0


def test_every_letter_of_a_name_has_strokes():
    assert set(string.ascii_letters + string.digits + "_.+-:;,'…") <= set(LETTERS)


def test_text_is_escaped_in_the_vector_drawing():
    text = svg(Figure(10, 10, '<&>"', [Text((0.0, 0.0), "<script>&")]))
    assert ET.fromstring(text).findtext(f"{SVG}text") == "<script>&"
    assert ET.fromstring(text).findtext(f"{SVG}title") == '<&>"'


def test_a_coordinate_carries_no_sign_on_zero():
    assert [number(x) for x in (-0.001, 0.0, 1.50, -2.345, 10.0)] == ["0", "0", "1.5", "-2.35", "10"]
