"""The README and its pages: links, commands, figures and pictures are what they say, the README is short."""

import re
import tomllib
from urllib.parse import urlsplit

import numpy as np
import pytest

from fmu_build.document.documentation import documentation
from fmu_build.interface.variable_table import variable_table
from fmu_build.storage.cache import OURS
from supervessel import load_scene, parse_scene
from supervessel.equations import equations
from support import ISS_DG, OK, body, flying, variant
from support.pages import PAGES, ROOT, anchors, blocks, links, prose, text

LONGEST_README = 170
COMMAND = re.compile(r"`(?:time )?(?:\.venv/bin/)?(make|pytest|python|supervessel) ([^`]*)`")
FIGURES = {
    "the same bits": "| twin against FMU, composite, rates, steps of `rk4` and `dop853` | 0 ulp |",
    "agree to 1e-13": "agree to 1e-13",
    "at most 3.7 u (1 + cond)": "| 5e9/2e9 | 5e4/5e4, 4 of 18 | 8e4/2e5 | 2e2/4e2 | 3.7/2.2 |",
    "balances to 6 u of the sum": "books close to 6 u of the sum of the terms",
    "1.7 to 2.7 plain RK4 steps": "| torque; attitude and rate: set, step, get | 1.7 to 2.7 |",
    "1/410 of the time": "with the state every 0.1 s 1/410",
    "| 49 ns |": "| 1000 | 8 | 0.08 | 49 |",
}
"""Figures of the README, and where they stand in tests/MEASURED.md."""


def test_the_readme_takes_three_minutes():
    assert len(text("README.md").splitlines()) <= LONGEST_README


@pytest.mark.parametrize("page", PAGES)
def test_every_link_leads_to_a_file_and_a_heading_that_exist(page):
    lost = []
    for link in links(page):
        target = urlsplit(link)
        if target.scheme:
            assert target.scheme == "https", link
            continue
        path = (PAGES[page].parent / target.path).resolve() if target.path else PAGES[page]
        name = str(path.relative_to(ROOT))
        if not path.exists() or (target.fragment and target.fragment not in anchors(name)):
            lost.append(link)
    assert lost == []


def test_every_page_can_be_reached_from_the_readme():
    found, waiting = set(), ["README.md"]
    while waiting:
        page = waiting.pop()
        found.add(page)
        paths = {(PAGES[page].parent / urlsplit(link).path).resolve() for link in links(page)}
        waiting += {name for name, path in PAGES.items() if path in paths} - found
    assert set(PAGES) - found == {"CHANGELOG.md"}


@pytest.mark.parametrize("page", PAGES)
def test_commands_of_a_page_name_what_exists(page):
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    lost = []
    for program, words in COMMAND.findall(re.sub(r"\s+", " ", prose(page))):
        if program == "make":
            lost += [] if words.split()[0] in targets or "=" in words.split()[0] else [words]
        else:
            paths = re.findall(r"(?:^| )((?:tests|examples)/[^ :]+)", words)
            lost += [path for path in paths if "NAME" not in path and not (ROOT / path).exists()]
    assert lost == []


@pytest.mark.parametrize(("short", "whole"), FIGURES.items(), ids=FIGURES)
def test_figures_of_the_readme_stand_in_the_tables(short, whole):
    assert short in text("README.md")
    assert whole in re.sub(r"\s+", " ", text("tests/MEASURED.md"))


def test_the_readme_has_at_most_eight_figures_each_with_its_command():
    rows = text("README.md").partition("## Figures\n")[2].partition("\n## ")[0].split("\n|")[3:]
    assert 0 < len(rows) <= 8
    assert all(COMMAND.search(row.split("|")[-2]) for row in rows)


def test_the_page_on_commands_names_the_folder_of_the_cache():
    assert set(re.findall(r"supervessel-\d+", text("fmu_build/docs/commands.md"))) == {OURS}


def test_the_picture_is_what_the_scene_draws():
    scene = load_scene(ROOT / "examples" / "launch_stack.toml")
    drawn = documentation(scene, variable_table(equations(scene)), 3)["documentation/diagram.svg"]
    assert (ROOT / "examples" / "launch_stack.svg").read_bytes() == drawn


def test_the_tables_of_the_page_on_changes_make_a_scene():
    raw = tomllib.loads((ROOT / "examples" / "iss_dg.toml").read_text(encoding="utf-8"))
    (block,) = map(tomllib.loads, blocks("fmu_build/docs/changes.md", "toml"))
    points = block.pop("vessels")["DG"]["points"]
    scene = parse_scene(variant(raw | block, {"vessels.DG.points": points}))
    assert scene.keeps == {"mass": "rate", "pose": "momentum"}
    assert scene.inputs.force == ("DG.rcs1",)


def test_the_vessels_of_the_page_on_scenes_are_one():
    block, mounts = map(tomllib.loads, blocks("model/docs/scene.md", "toml"))
    assert len(parse_scene(body() | block | mounts | {"root": "tug"}).mounts) == 1
    tug, same = (
        parse_scene(body() | {"root": name, "vessels": {name: vessel}}).vessels[name]
        for name, vessel in block["vessels"].items()
    )
    assert tug.specific_inertia[0][1] == 200.0 / 4000.0
    assert np.abs(np.subtract(tug.tensor, same.tensor)).max() <= 1e-11


def test_the_log_line_of_the_page_on_the_fmu_is_the_real_one():
    (line,) = blocks("fmu_build/docs/fmu.md", "text")
    with flying(ISS_DG) as fmu:
        assert fmu.set({"DG.pmi": [1.0, 1.0, 5.0]}) == OK
        assert fmu.step(0.1) != OK
        assert fmu.messages()[-1].endswith(line.strip())
