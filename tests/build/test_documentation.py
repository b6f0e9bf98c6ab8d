"""Documentation, licences, terminals and icons of an FMU."""

import dataclasses
import re
from functools import cache
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path
from typing import get_args

import fmpy
import pytest
from lxml import etree

from fmu_build import BuildError
from fmu_build.document.documentation import documentation
from fmu_build.document.licences import header_notice, licence_files
from fmu_build.interface.terminals import terminals_and_icons
from fmu_build.interface.variable_table import variable_table
from supervessel import parse_scene
from supervessel.equations import equations
from supervessel.scene.schema import PROPAGATOR_NAMES, Law
from support import ISS_DG, body, variant
from support.marks import FMI, FMI_3_AT_ONCE
from support.orbits import orbiting

VOID = {"meta", "br", "hr", "img", "link", "input"}
SCHEMA = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"
PROJECT = Path(__file__).parents[2]

INDEX = "documentation/index.html"
HOSTILE = """</title><script>alert("1")</script><img src='x' onerror=y>&amp;&#60;"""

HOSTILE_NAMES = variant(
    ISS_DG,
    {
        "name": "script",
        "root": "html",
        "vessels": {
            "html": ISS_DG["vessels"]["ISS"] | {"ports": {"onload": ISS_DG["vessels"]["ISS"]["ports"]["P2"]}},
            "__proto__": ISS_DG["vessels"]["DG"]
            | {"ports": {"svg": ISS_DG["vessels"]["DG"]["ports"]["nose"]}},
        },
        "docks": [{"ports": ["html.onload", "__proto__.svg"]}],
        "inputs": {"mass": ["__proto__"], "pose": ["__proto__.svg"], "torque": True},
    },
)
"""Every name is legal in a scene and means something in a page."""

SCENES = {
    "iss": ISS_DG,
    "single": body(),
    "nothing_in": variant(body(), {"inputs": {}, "outputs": {"names": ["mass"]}}),
    "hostile_names": HOSTILE_NAMES,
    "orbit": orbiting({"rotation": {"law": "principal"}}),
    "docks": variant(
        ISS_DG,
        {
            "docks": [{"ports": ["ISS.P2", "DG.nose"], "name": "berth"}],
            "inputs": {"docked": ["berth"], "mass": ["DG"]},
        },
    ),
}


@cache
def made(name, fmi=3):
    """Returns a scene of SCENES, its variable table and its files."""
    scene = parse_scene(SCENES[name])
    entries = variable_table(equations(scene))
    return scene, entries, documentation(scene, entries, fmi)


def rows(html):
    """Returns the cells of each row of the page's tables, by the text of the first or second cell."""
    page = etree.fromstring(html)
    found = [["".join(cell.itertext()) for cell in row] for row in page.iter("tr")]
    return {cells[0]: cells for cells in found} | {cells[1]: cells for cells in found if len(cells) == 7}


class Balance(HTMLParser):
    """Keeps the open tags of a page and what its attributes refer to."""

    def __init__(self):
        super().__init__()
        self.open, self.tags, self.references, self.ids = [], set(), [], []

    def handle_starttag(self, tag, attributes):
        self.tags.add(tag)
        self.note(attributes)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.tags.add(tag)
        self.note(attributes)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def note(self, attributes):
        for name, value in attributes:
            assert not name.startswith("on"), name
            if name in ("href", "src", "xlink:href", "data", "action"):
                self.references.append(value)
            if name == "id":
                self.ids.append(value)


def checked(html):
    """Returns the page's tags and references after checking that every tag is closed in order."""
    parser = Balance()
    parser.feed(html.decode())
    parser.close()
    assert parser.open == []
    return parser


@FMI_3_AT_ONCE
@pytest.mark.parametrize("name", SCENES)
def test_the_page_is_well_formed(name, fmi):
    html = made(name, fmi)[2][INDEX]
    assert html.startswith(b"<!DOCTYPE html>")
    checked(html)
    etree.fromstring(html)


@pytest.mark.parametrize("name", SCENES)
def test_the_page_needs_nothing_from_elsewhere(name):
    files = made(name)[2]
    parser = checked(files[INDEX])
    assert parser.tags.isdisjoint({"script", "link", "iframe", "object", "embed", "img", "base"})
    assert not re.search(rb"https?:|@import|url\(|javascript:", files[INDEX])
    for reference in parser.references:
        if reference.startswith("#"):
            assert reference[1:] in parser.ids
        else:
            assert f"documentation/{reference}" in files
    assert len(parser.ids) == len(set(parser.ids))


@pytest.mark.parametrize("name", SCENES)
def test_the_page_lists_every_variable_with_unit_start_and_range(name):
    _, entries, files = made(name)
    table = rows(files[INDEX])
    for entry in entries:
        variable = entry.variable
        reference, _, _, unit, start, span, description = table[variable.name]
        assert (int(reference), unit, description) == (entry.reference, variable.unit, variable.description)
        assert (float({"true": "1", "false": "0"}.get(start, start)) if start else None) == variable.start
        bounds = [bound for bound in (variable.low, variable.high) if bound is not None]
        assert [float(bound) for bound in re.findall(r"[-+.\de]+", span)] == bounds


@pytest.mark.parametrize(
    ("name", "discrete"), [("iss", ["DG.nose.position[1]"]), ("docks", ["berth.docked", "berth.velocity[1]"])]
)
def test_the_page_says_which_inputs_change_in_event_mode_alone(name, discrete):
    """By default masses keep the rate and poses the momentum, so that poses are discrete."""
    table = rows(made(name)[2][INDEX])
    said = {"DG.mass": "continuous", "attitude_start[1]": "fixed", "attitude[1]": "continuous"}
    said |= dict.fromkeys(discrete, "discrete")
    assert {variable: table[variable][2] for variable in said} == said


def test_the_page_has_the_start_of_a_dock_in_words():
    assert rows(made("docks")[2][INDEX])["berth.docked"][4] == "true"


def test_the_page_gives_the_composite_that_the_reference_finds():
    table = rows(made("iss")[2][INDEX])
    assert float(table["mass [kg]"][1]) == 479500.0
    pmi = [float(x) for x in table["pmi [m2]"][1].split(", ")]
    assert pmi == pytest.approx([404.598, 683.188, 521.120], abs=1e-3)  # as examples/README.md prints them


def test_the_page_says_what_the_scene_says_of_itself():
    said = {"description": "A <ball>", "version": "1.2", "author": "A & B", "copyright": "C", "license": "D"}
    scene = parse_scene(variant(body(), said))
    table = rows(documentation(scene, variable_table(equations(scene)), 3)[INDEX])
    found = [table[key][1] for key in ("description", "version", "author", "copyright", "licence")]
    assert found == list(said.values())
    assert not {"version", "author", "copyright", "licence"} & rows(made("iss")[2][INDEX]).keys()


def test_the_page_lists_vessels_and_ports():
    table = rows(made("iss")[2][INDEX])
    assert "0.09, -17.9, 3.8" in table["ISS.P2"]
    assert table["DG.nose"][-1] == "ISS.P2"


@pytest.mark.parametrize("law", get_args(Law))
def test_the_page_gives_the_equation_of_each_law(law):
    scene = parse_scene(body(law=law))
    html = documentation(scene, variable_table(equations(scene)), 3)[INDEX].decode()
    assert f"Rotation: law {law}" in html
    assert ("positive definite" in html) == (law != "none")


@pytest.mark.parametrize("propagator", PROPAGATOR_NAMES)
def test_the_page_describes_each_propagator(propagator):
    scene = parse_scene(body(propagator=propagator))
    html = documentation(scene, variable_table(equations(scene)), 3)[INDEX].decode()
    assert f"propagator {propagator}" in html


def test_nothing_that_a_name_or_a_description_holds_becomes_markup():
    scene, entries, _ = made("iss")
    hostile = scene.model_copy(update={"name": HOSTILE, "root": "ISS"})
    bad = [
        dataclasses.replace(
            entry, variable=dataclasses.replace(entry.variable, description=HOSTILE, unit=HOSTILE)
        )
        for entry in entries
    ]
    files = documentation(hostile, bad, 3)
    assert "script" not in checked(files[INDEX]).tags
    page = etree.fromstring(files[INDEX])
    assert page.findtext("head/title") == HOSTILE
    assert rows(files[INDEX])["DG.mass"][-1] == HOSTILE
    for name, content in files.items():
        if name.endswith(".svg"):
            assert not list(etree.fromstring(content).iter("{*}script")), name
    terminals = etree.fromstring(terminals_and_icons(hostile, bad, 3))
    assert terminals.find(".//Terminal").get("name") == "DG.nose"


@FMI
def test_documentation_is_the_same_each_time(fmi):
    scene, entries, files = made("iss", fmi)
    assert documentation(scene, entries, fmi) == files


@FMI
@pytest.mark.parametrize("name", SCENES)
def test_files_stand_where_the_standard_wants_them(name, fmi):
    files = made(name, fmi)[2]
    assert {INDEX, "documentation/licenses/license.txt", "terminalsAndIcons/icon.png"} <= set(files)
    assert ("model.png" in files) == (fmi == 2)
    folders = {path.partition("/")[0] for path in files} - {"model.png"}
    assert folders == {"documentation", "terminalsAndIcons"}
    for path in files:
        if path.endswith(".svg"):
            assert path.removesuffix("svg") + "png" in files


@FMI
@pytest.mark.parametrize("name", SCENES)
def test_terminals_fit_the_schema_and_name_what_is_there(name, fmi):
    scene, entries, files = made(name, fmi)
    root = etree.fromstring(terminals_and_icons(scene, entries, fmi))
    etree.XMLSchema(etree.parse(str(SCHEMA))).assertValid(root)
    assert root.get("fmiVersion") == "3.0"
    variables = {entry.variable.name: entry.role for entry in entries}
    members = [member.get("variableName") for member in root.iter("TerminalMemberVariable")]
    assert len(members) == len(set(members))
    assert all(variables[member] in ("input", "output") for member in members)
    for graphic in root.iter("TerminalGraphicalRepresentation"):
        assert f"terminalsAndIcons/{graphic.get('iconBaseName')}.png" in files


@pytest.mark.parametrize("name", SCENES)
def test_kinds_of_terminals_are_names_in_reverse_domain_notation_below_a_domain_that_no_host_has(name):
    """RFC 9476 keeps "alt" for names outside the DNS; labels are those of RFC 1123, underscores allowed."""
    scene, entries, _ = made(name)
    root = etree.fromstring(terminals_and_icons(scene, entries, 3))
    kinds = [terminal.get("terminalKind") for terminal in root.iter("Terminal")]
    assert all(re.fullmatch(r"alt\.supervessel\.[a-z]+(_[a-z]+)*", kind) for kind in kinds), kinds
    assert bool(kinds) == (name != "nothing_in")


def test_terminals_are_the_ports_whose_pose_is_an_input_the_torque_and_the_attitude():
    scene, entries, _ = made("iss")
    root = etree.fromstring(terminals_and_icons(scene, entries, 3))
    found = {
        terminal.get("name"): [member.get("memberName") for member in terminal.iter("TerminalMemberVariable")]
        for terminal in root.iter("Terminal")
    }
    pose = [f"{part}[{i}]" for part in ("position", "direction", "alignment") for i in (1, 2, 3)]
    assert found["DG.nose"] == pose
    assert found["torque"] == ["torque[1]", "torque[2]", "torque[3]"]
    assert sorted(found["attitude"]) == sorted(
        [f"attitude[{i}]" for i in (1, 2, 3, 4)] + [f"angular_velocity[{i}]" for i in (1, 2, 3)]
    )
    assert len(found) == 3


def test_terminals_of_one_model_do_not_cover_each_other():
    ports = [f"m{i}" for i in range(40)]
    one = ISS_DG["vessels"]["ISS"]["ports"]["P2"]
    other = ISS_DG["vessels"]["DG"]["ports"]["nose"]
    raw = variant(
        body(),
        {
            "vessels.B.ports": dict.fromkeys(ports, one),
            "inputs.pose": [f"B.{name}" for name in ports],
            "docks": [{"ports": [f"B.{name}", f"v{name}.p"]} for name in ports],
        },
    )
    raw["vessels"] |= {
        f"v{name}": {"mass": 1.0, "pmi": [1.0, 1.0, 1.0], "ports": {"p": other}} for name in ports
    }
    scene = parse_scene(raw)
    root = etree.fromstring(terminals_and_icons(scene, variable_table(equations(scene)), 3))
    spans = sorted(
        (float(graphic.get("y1")), float(graphic.get("y2")))
        for graphic in root.iter("TerminalGraphicalRepresentation")
        if float(graphic.get("x1")) < 0.0
    )
    assert len(spans) == 41
    assert all(below[1] < above[0] for below, above in pairwise(spans))


@FMI
def test_the_licence_folder_holds_the_texts_that_its_overview_names(fmi):
    files = licence_files(fmi)
    overview = files["documentation/licenses/license.txt"].decode()
    names = {path.rpartition("/")[2] for path in files} - {"license.txt"}
    assert set(re.findall(r"\w+\.txt", overview)) == names
    assert files["documentation/licenses/supervessel.txt"].decode() == (PROJECT / "LICENSE").read_text()
    notice = files["documentation/licenses/fmi_standard.txt"].decode()
    assert notice.startswith("Copyright (C)")
    assert "Redistributions in binary form must reproduce" in notice
    assert "#include" not in notice


def test_a_missing_licence_text_is_named(monkeypatch):
    class Empty:
        def read_text(self, name):
            return None

    with pytest.raises(BuildError, match="fmpy"):
        header_notice("/* nothing here */")
    monkeypatch.setattr("fmu_build.document.licences.distribution", lambda package: Empty())
    with pytest.raises(BuildError, match="supervessel has no licence text"):
        licence_files(3)


@pytest.mark.parametrize(("law", "told"), [("none", False), ("principal", True), ("tensor", True)])
def test_the_page_tells_of_the_gradient_where_it_turns_the_body(law, told):
    scene = parse_scene(orbiting({"rotation": {"law": law}}, base=body()))
    html = documentation(scene, variable_table(equations(scene)), 3)[INDEX].decode()
    assert ("Gravity's gradient adds to" in html) is told
    assert ("farther from the barycentre than twice the assembly's size" in html) is told
    assert ("is the diagonal there too" in html) is (law == "principal")
    assert "3.986004418e+14" in html or "398600441800000" in html
