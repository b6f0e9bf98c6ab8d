"""The table of what scenes cost in MEASURED.md; `make bench` prints it with times."""

import pytest

from supervessel import parse_scene
from support.costs import table_raw, table_row
from support.pages import text


@pytest.mark.parametrize(("name", "raw"), table_raw().items(), ids=table_raw())
def test_the_table_says_what_a_scene_costs(name, raw):
    stated = next(
        (line for line in text("tests/MEASURED.md").splitlines() if line.startswith(f"| {name} |")), ""
    )
    row = table_row(name, parse_scene(raw))
    assert stated.startswith(row), f"MEASURED.md has {stated!r}"
