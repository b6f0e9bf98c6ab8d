"""The table of what scenes cost in MEASURED.md; `make bench` prints it with times."""

import pytest

from supervessel import parse_scene
from support.costs import table_raw, table_row
from support.marks import some_at_once
from support.pages import text

SCENES = table_raw()


@pytest.mark.parametrize(
    "name", some_at_once(list(SCENES), "a single body", "ISS with a ship, mass of the ship")
)
def test_the_table_says_what_a_scene_costs(name):
    stated = next(
        (line for line in text("tests/MEASURED.md").splitlines() if line.startswith(f"| {name} |")), ""
    )
    row = table_row(name, parse_scene(SCENES[name]))
    assert stated.startswith(row), f"MEASURED.md has {stated!r}"
