"""Mass-property sheets: diagonals, products, tensors about the origin, published numbers that are mended."""

from typing import Any

import numpy as np
import pytest

from fmu_build.document.documentation import documentation
from fmu_build.interface.variable_table import variable_table
from supervessel import SceneError, load_scene, parse_scene, reference
from supervessel.equations import equations
from supervessel.scene.mending import mend
from supervessel.scene.numbers import WrittenNumber
from supervessel.scene.schema import Scene
from supervessel.scene.sheets import Sheet, sheet_of, sheet_problem
from supervessel.scene.writing import scene_text
from support import Array, scene, variant
from support.refusals import NO_BODY, case, problems

MASS, CENTRE = 2.0, (0.5, -0.25, 1.0)


def alone(**vessel: Any) -> dict[str, Any]:
    """Returns the raw scene of one vessel."""
    return {"name": "alone", "root": "B", "vessels": {"B": {"mass": MASS, **vessel}}}


def tensor(**vessel: Any) -> Array:
    """Returns the tensor about the centre of mass, (3, 3) [kg m2], of a vessel alone."""
    found = scene(alone(**vessel)).vessels["B"].tensor
    assert found is not None
    return np.array(found)


def test_three_moments_are_the_diagonal() -> None:
    rows = [[3.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 5.0]]
    assert scene(alone(inertia=[3.0, 4.0, 5.0])) == scene(alone(inertia=rows))
    assert np.array_equal(tensor(moments=[3.0, 4.0, 5.0]), rows)


def test_products_are_integrals_and_the_tensor_has_minus_them() -> None:
    """Three mass points with products of all pairs of axes; integrals and tensor by their definitions."""
    points = np.array([[1.0, 2.0, 0.5], [-0.5, 1.0, 2.0], [0.25, -3.0, 1.0]])
    points -= points.mean(axis=0)
    masses = np.full(3, MASS / 3.0)
    J = sum(m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in zip(masses, points, strict=True))
    x, y, z = points.T
    products = [float(masses @ (a * b)) for a, b in ((x, y), (y, z), (z, x))]
    assert np.allclose(tensor(moments=np.diag(J).tolist(), products=products), J, rtol=0.0, atol=1e-14)


@pytest.mark.parametrize("key", ["inertia", "moments"])
def test_a_tensor_about_the_origin_is_moved_to_the_centre_of_mass(key: str) -> None:
    """A plate 1 m by 2 m of 1 kg about its corner: the six integrals over the plate, and about its middle."""
    corner = {"inertia": [[4 / 3, 0, -1 / 2], [0, 5 / 3, 0], [-1 / 2, 0, 1 / 3]]}
    if key == "moments":
        corner = {"moments": [4 / 3, 5 / 3, 1 / 3], "products": [0, 0, 1 / 2]}
    found = tensor(mass=1.0, centre_of_mass=[0.5, 0.0, 1.0], inertia_about="origin", **corner)
    assert np.allclose(found, np.diag([1 / 3, 5 / 12, 1 / 12]), rtol=0.0, atol=4e-16)


def test_what_is_about_the_origin_is_that_body_in_the_whole_and_in_the_reference() -> None:
    J = np.array([[9.0, 0.3, -0.2], [0.3, 8.0, 0.1], [-0.2, 0.1, 5.0]])
    c = np.array(CENTRE)
    moved = J + MASS * (c @ c * np.eye(3) - np.outer(c, c))
    about = alone(inertia=moved.tolist(), inertia_about="origin", centre_of_mass=CENTRE)
    found = reference.composite(scene(about))
    assert np.abs(found.inertia - J).max() <= 8e-15
    assert np.abs(found.barycentre - c).max() <= 1e-15


BAD = [
    case(
        "products that no body has",
        {"vessels": {"B": {"mass": 2.0, "moments": [2.0, 2.0, 2.0], "products": [0.0, 3.0, 0.0]}}},
        "vessels.B.moments = [2.0, 2.0, 2.0] kg m2, products = [0.0, 3.0, 0.0] kg m2: must be positive "
        "semidefinite, but its principal moments are -1, 2, 5 kg m2",
        base=alone(),
    ),
    case(
        "a diagonal that no body has",
        {"vessels.B.inertia": [1, 1, 3]},
        f"vessels.B.inertia = [1, 1, 3] kg m2: its principal moments are 1, 1, 3 kg m2: 3 exceeds 1 + 1 "
        f"by 1; {NO_BODY}; mend = true would move numbers by no more than the rounding of their last digit",
        base=alone(),
    ),
    case(
        "about the origin no body of that mass and centre",
        {
            "vessels.B.inertia": [2.0, 2.0, 2.0],
            "vessels.B.inertia_about": "origin",
            "vessels.B.centre_of_mass": [0.0, 0.0, 1.0],
        },
        "vessels.B.inertia = [2.0, 2.0, 2.0] kg m2: about the centre of mass its principal moments are 0, 0, "
        f"2 kg m2: 2 exceeds 0 + 0 by 2; {NO_BODY}",
        base=alone(),
    ),
    case(
        "pmi about the origin",
        {"vessels.B.pmi": [1.0, 1.0, 1.0], "vessels.B.inertia_about": "origin"},
        'vessels.B.inertia_about = "origin": given beside pmi, which is about the centre of mass; give '
        "inertia or moments [kg m2]",
        base=alone(),
    ),
    case(
        "about something else",
        {"vessels.B.inertia": [1.0, 1.0, 1.0], "vessels.B.inertia_about": "nose"},
        'vessels.B.inertia_about = "nose": must be one of centre_of_mass, origin',
        base=alone(),
    ),
    case(
        "products without moments",
        {"vessels.B.inertia": [1.0, 1.0, 1.0], "vessels.B.products": [0.1, 0.0, 0.0]},
        "vessels.B.products = [0.1, 0.0, 0.0] kg m2: without effect; they go with moments [kg m2]",
        base=alone(),
    ),
    case(
        "moments beside inertia",
        {"vessels.B.inertia": [1.0, 1.0, 1.0], "vessels.B.moments": [1.0, 1.0, 1.0]},
        "vessels.B.moments: given beside inertia; a vessel takes one of the two",
        base=alone(),
    ),
    case(
        "moments without mass",
        {"vessels.B.mass": 0.0, "vessels.B.moments": [1.0, 1.0, 1.0]},
        "vessels.B.mass = 0.0 kg: must be > 0 for a vessel given by moments; inertia/mass is kept",
        base=alone(),
    ),
    case(
        "pmi as input of a vessel given by moments",
        {"vessels.B.moments": [1.0, 1.0, 1.0], "inputs": {"pmi": ["B"]}},
        "inputs.pmi: B is given by moments; only a vessel given by pmi has this input",
        base=alone(),
    ),
    case(
        "moments and mend under Orbiter's convention",
        {"convention": "orbiter", "vessels.B.moments": [1.0, 1.0, 1.0], "vessels.B.mend": True},
        'vessels.B.moments: convention = "orbiter" knows no products of inertia; give pmi [m2]',
        'vessels.B.mend = true: convention = "orbiter" takes moments that no body has; leave it out',
        base=alone(),
    ),
    case(
        "mend beyond the last digit",
        {"vessels.B.pmi": [1.0, 1.0, 2.2], "vessels.B.mend": True},
        f"vessels.B.pmi = [1.0, 1.0, 2.2] m2: 2.2 exceeds 1.0 + 1.0 by 0.2; {NO_BODY}; mend = true moves "
        "each number by half a unit of its last digit, and 1.33 of that would be needed at least",
        base=alone(),
    ),
    case(
        "mend of integers beyond the last digit",
        {"vessels.B.inertia": [10, 10, 22], "vessels.B.mend": True},
        "vessels.B.inertia = [10, 10, 22] kg m2: its principal moments are 10, 10, 22 kg m2: 22 exceeds "
        f"10 + 10 by 2; {NO_BODY}; mend = true moves each number by half a unit of its last digit, and 1.33 "
        "of that would be needed at least",
        base=alone(),
    ),
    case(
        "mend that is no flag",
        {"vessels.B.pmi": [1.0, 1.0, 1.0], "vessels.B.mend": 0.1},
        "vessels.B.mend = 0.1: must be true or false",
        base=alone(),
    ),
]


@pytest.mark.parametrize(("base", "changes", "expected"), BAD)
def test_what_no_sheet_may_have_is_refused_by_name_and_value(
    base: dict[str, Any], changes: dict[str, Any], expected: list[str]
) -> None:
    assert problems(variant(base, changes)) == expected


# Mending


def written(value: float, digits: int) -> WrittenNumber:
    """Returns a number rounded to so many digits, as a file would have it."""
    return WrittenNumber(f"{value:.{digits - 1}e}")


def rounded_bodies() -> list[tuple[Sheet, Array]]:
    """Returns sheets of two to four mass points, so rounded that no body has them, and the true elements."""
    rng, found = np.random.default_rng(19), []
    for _ in range(150):
        masses = rng.uniform(1.0, 100.0, count := rng.integers(2, 5))
        points = rng.normal(size=(count, 3)) * 10.0 ** rng.uniform(-1.0, 1.0, 3)
        points -= masses @ points / masses.sum()
        second = (masses[:, None] * points).T @ points
        moments, digits = np.trace(second) - np.diag(second), int(rng.integers(2, 5))
        products = np.array([second[0, 1], second[1, 2], second[2, 0]])
        vessel = {
            "mass": float(masses.sum()),
            "moments": [written(x, digits) for x in moments],
            "products": [written(x, digits) for x in products],
        }
        sheet = sheet_of(vessel)
        assert sheet is not None
        if sheet_problem(sheet):
            found.append((sheet, np.array([*moments, *-products])))
    return found


def test_what_rounding_has_broken_is_mended_to_the_nearest_body() -> None:
    """The moves y in units of the rounding are those to the nearest point of a convex set, which holds the
    body that was rounded, t: (x - m).(t - m) <= 0 and so |t - m| <= |x - t|, x the rounded numbers, m the
    mended ones."""
    sheets = rounded_bodies()
    assert len(sheets) > 70
    for sheet, true in sheets:
        moved = mend(sheet).sheet
        assert moved is not None
        assert sheet_problem(moved) == ""
        moves = (moved.elements - sheet.elements) / sheet.halves
        assert np.abs(moves).max() <= 1.0
        rest = (true - moved.elements) / sheet.halves
        assert -moves @ rest <= 1e-7


def test_three_moments_share_the_excess_as_the_squares_of_their_rounding() -> None:
    """Least sum of (d_i/h_i)^2 with d_1 + d_2 - d_3 = e, by hand: the first goes as far as it may, the two
    others share the rest as h_2^2 and h_3^2."""
    sheet = sheet_of({"mass": 1.0, "pmi": [WrittenNumber(x) for x in ("1.00", "0.9995", "2.005")]})
    assert sheet is not None
    found = mend(sheet).sheet
    assert found is not None
    rest = (2.005 - 0.9995 - 1.005) / (1.0 + 100.0)
    assert np.allclose(found.elements[:3], [1.005, 0.9995 + rest, 2.005 - 100.0 * rest], rtol=0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("moments", "reason"),
    [
        (["-0.02", "0.0", "-0.0"], "4 of that would be needed at least"),
        (["1.0e300", "1.0e300", "2.5e300"], "3.33 of that would be needed at least"),
        (["1.0", "1.0", "2.00000000000001"], "doubles do not tell"),
        (["1e-400", "1.0", "2.1"], "doubles do not tell"),
        (["1.000000000", "1e5", "2e5"], "doubles do not tell"),
    ],
)
def test_numbers_at_the_ends_of_doubles_are_refused_with_a_reason(moments: list[str], reason: str) -> None:
    sheet = sheet_of({"mass": 1.0, "moments": [WrittenNumber(x) for x in moments]})
    assert sheet is not None
    assert reason in mend(sheet).reason


SHEET = """name = "sheet"
root = "B"
[vessels.B]
mass = 2.0
moments = [1.20e3, 8.5e2, 2.055e3]  # the last exceeds the sum by 5
mend = true
"""


def loaded(folder: Any, text: str) -> Scene:
    """Returns the scene of a file with that text."""
    path = folder / "sheet.toml"
    path.write_text(text, encoding="utf-8")
    return load_scene(path)


def test_a_mended_scene_says_by_how_much_and_is_written_as_it_was_published(tmp_path: Any) -> None:
    """Halves 5, 5 and 0.5 kg m2: by the squares 500/201, 500/201 and 5/201 kg m2 of the excess of 5."""
    given = loaded(tmp_path, SHEET)
    found = given.vessels["B"].moments
    assert found is not None
    assert np.allclose(found, [1200 + 500 / 201, 850 + 500 / 201, 2055 - 5 / 201], rtol=1e-9)
    assert found[2] <= found[0] + found[1]
    (note,) = given.notes
    start = "vessels.B.moments = [1200.0, 850.0, 2055.0] kg m2: mended to moments = [1202.48"
    assert note.startswith(start)
    assert note.endswith(": by up to 2.49 kg m2, 0.498 of half a unit of the last digit")
    text = scene_text(given)
    assert "moments = [1.20e3, 8.5e2, 2.055e3]" in text
    assert loaded(tmp_path, text) == given


def test_numbers_that_a_body_can_have_are_not_moved(tmp_path: Any) -> None:
    given = loaded(tmp_path, SHEET.replace("2.055", "2.045"))
    assert given.vessels["B"].moments == (1200.0, 850.0, 2045.0)
    assert given.notes == ()


def test_mended_numbers_read_again_stay(tmp_path: Any) -> None:
    given = loaded(tmp_path, SHEET)
    again = parse_scene(given.model_dump(exclude_none=True))
    assert again.vessels["B"].moments == given.vessels["B"].moments
    assert again.notes == ()


def test_numbers_of_any_kind_are_mended_and_written() -> None:
    given = parse_scene(alone(inertia=(np.float64(2.5), 1, np.float64(3.6)), mend=True))
    assert "inertia = [2.5, 1, 3.6]" in scene_text(given)
    assert np.allclose(np.diag(given.vessels["B"].tensor or 0.0), [2.501, 1.098, 3.599], rtol=0.0, atol=1e-3)
    rows = [[1.0, 0.0, 0.1], [0.0, 2.0, 0.0], [0.1, 0.0, 3.1]]
    (note,) = parse_scene(alone(inertia=rows, mend=True)).notes
    assert "mended to inertia = [[1.0" in note


def test_the_page_tells_what_was_mended(tmp_path: Any) -> None:
    given = loaded(tmp_path, SHEET)
    files = documentation(given, variable_table(equations(given)), 3, None)
    assert any(b"0.498 of half a unit of the last digit" in content for content in files.values())


def test_without_mend_rounded_numbers_are_refused(tmp_path: Any) -> None:
    with pytest.raises(SceneError, match="2055 exceeds 850 \\+ 1200 by 5"):
        loaded(tmp_path, SHEET.replace("mend = true", ""))


@pytest.mark.parametrize(
    ("given", "moved"),
    [
        ({"pmi": [10, 10.0, 20.6]}, [10.5, 10.05, 20.55]),
        ({"pmi": [1, 2.0, 3.6]}, [1.5, 2.05, 3.55]),
    ],
)
def test_half_a_unit_of_each_may_be_just_enough(given, moved) -> None:
    found = np.diag(np.array(scene(alone(mend=True, **given)).vessels["B"].specific_inertia))
    assert np.abs(found - moved).max() <= 1e-8
