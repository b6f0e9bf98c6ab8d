"""The README's table of what scenes cost; `make bench` prints it with times."""

from pathlib import Path

import pytest

from support.costs import table_row, table_scenes

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", table_scenes())
def test_the_readme_says_what_a_scene_costs(name):
    stated = next((line for line in README.splitlines() if line.startswith(f"| {name} |")), "")
    row = table_row(name, table_scenes()[name])
    assert stated.startswith(row), f"the README has {stated!r}"
