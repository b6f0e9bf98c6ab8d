"""The page on accuracy: what it says of a scene that asks for one, recomputed."""

import re
import tomllib

import pytest

from fmu_build.accuracy import said
from supervessel import choose, parse_scene
from support import variant
from support.pages import ROOT, section

SECTION = section("fmu_build/docs/accuracy.md", "## Asking for accuracy")


def asked(attitude):
    """The scene of the section, or with another accuracy."""
    raw = tomllib.loads((ROOT / "examples" / "iss_dg.toml").read_text())
    block = re.search(r"```toml\n(.*?)```", SECTION, re.DOTALL)
    assert block is not None
    raw |= tomllib.loads(block[1])
    return parse_scene(variant(raw, {"accuracy.attitude": attitude or raw["accuracy"]["attitude"]}))


def row(attitude):
    _, evidence = choose(asked(attitude))
    choice = evidence["choice"]
    values = [f"`{choice['law']}`", f"`{choice['propagator']}`"]
    values += [f"{key} {choice[key]:g}" for key in ("tolerance", "max_angle_step") if key in choice]
    grade = evidence["grade"]
    cells = [f"{attitude:g}", ", ".join(values), f"{evidence['operations']:g}", f"{evidence['attitude']:.1e}"]
    cells += [grade["name"], f"{grade['attitude']:.2g}"]
    return f"| {' | '.join(cells)} |"


@pytest.mark.accuracy
def test_the_line_is_what_the_scene_gives():
    block = re.search(r"```text\n(.*?)\n```", SECTION, re.DOTALL)
    assert block is not None
    assert block[1] == said(choose(asked(None))[1])


@pytest.mark.accuracy
def test_the_table_is_what_the_scene_gives():
    rows = re.findall(r"^\| (\S+) \| `.*$", SECTION, re.MULTILINE)
    assert len(rows) == 4
    for attitude in rows:
        assert row(float(attitude)) in SECTION
