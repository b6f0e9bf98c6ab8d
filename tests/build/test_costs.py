"""The README's table of what scenes cost; `make bench` prints it with times."""

from pathlib import Path

import pytest

from supervessel import parse_scene
from support.costs import table_raw, table_row

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(("name", "raw"), table_raw().items(), ids=table_raw())
def test_the_readme_says_what_a_scene_costs(name, raw):
    stated = next((line for line in README.splitlines() if line.startswith(f"| {name} |")), "")
    row = table_row(name, parse_scene(raw))
    assert stated.startswith(row), f"the README has {stated!r}"
