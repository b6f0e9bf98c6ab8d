"""Sections of the table: of single ships, which go before their classes, of classes, and of nobody."""

import pytest

from orbiter.files import TABLE

OWN = """\
["GL-01"]
empty_mass = 12500.0
propellant = [100.0]
pmi = [10.0, 11.0, 12.0]
dock = [[0, 0, 7, 0, 0, 1, 1, 0, 0]]
"""
NOT_USED = "not used: no vessel of the assembly takes a number from it"


def test_a_ships_own_section_goes_before_its_class_and_the_class_is_not_used(files):
    files.table.write_text(TABLE + OWN)
    files.replace(files.scenario, (" 1:1.0", ""))
    ship = files.raw()["vessels"]["GL_01"]
    assert (ship["mass"], ship["pmi"]) == (12550.0, [10.0, 11.0, 12.0])
    assert ship["ports"]["dock0"]["position"] == [0.0, 0.0, -7.0]
    assert files.raw()["inputs"]["range"]["GL_01.mass"] == [12500.0, 12600.0]
    assert files.notes() == [f"code.toml: [Glider]: {NOT_USED}"]
    assert "# code.toml [GL-01] pmi\npmi = [10.0" in files.made().text


@pytest.mark.parametrize("given", OWN.splitlines()[1:])
def test_what_a_ships_own_section_does_not_give_is_its_classs(files, given):
    """In the order of the lines of OWN: mass, tanks, moments, ports."""
    before = files.raw()["vessels"]["GL_01"]
    files.table.write_text(f'{TABLE}["gl-01"]\n{given}\n')
    files.replace(files.scenario, (" 1:1.0", " 1:1.0" if given[:4] != "prop" else ""))
    ship = files.raw()["vessels"]["GL_01"]
    own = {"empty_mass": 12500.0 + 6600.0, "propellant": 11050.0}.get(given.split()[0], before["mass"])
    assert ship["mass"] == own
    assert ship["pmi"] == ([10.0, 11.0, 12.0] if given[:3] == "pmi" else before["pmi"])
    assert ship["ports"]["dock0"]["position"] == (
        [0.0, 0.0, -7.0] if given[:4] == "dock" else [0.0, -0.5, -10.0]
    )
    assert files.notes() == []


def test_one_ship_of_a_class_has_numbers_of_its_own_beside_others(files):
    files.table.write_text(
        f'{TABLE.replace("dock = [", "dock = [[0, 0, -9, 0, 0, -1, 0, 1, 0], ")}["GL-02"]\nempty_mass = 1.0\n'
    )
    files.replace(
        files.scenario,
        ("0:1,Station", "1:1,Station 0:0,GL-02"),
        ("1:0,GL-01", "1:1,GL-01"),
        ("Satellite\n", "GL-02:Glider\n  PRPLEVEL 0:0 1:0\n  DOCKINFO 0:0,GL-01\nEND\nSatellite\n"),
    )
    raw = files.raw()
    assert {name: vessel["mass"] for name, vessel in raw["vessels"].items()} == {
        "GL_01": 17600.0,
        "Station": 20125.0,
        "GL_02": 1.0,
    }
    assert files.notes() == []


def test_a_ships_own_section_goes_before_the_file_of_its_class(files):
    files.table.write_text(f"{TABLE}[Station]\nsize = 3.0\n")
    station = files.raw()["vessels"]["Station"]
    assert (station["mass"], station["pmi"], len(station["ports"])) == (20125.0, [6.0, 6.0, 3.0], 2)
    assert [note.partition(": no Inertia")[0] for note in files.notes()] == [
        'code.toml: [Station] size: moments of "Station"'
    ]


def test_a_ship_needs_no_class_beside_a_section_with_mass_and_moments(files):
    files.table.write_text(OWN)
    files.replace(files.scenario, ("GL-01:Glider", "GL-01:Nowhere"), (" 1:1.0", ""))
    assert files.raw()["vessels"]["GL_01"]["mass"] == 12550.0
    files.table.write_text(OWN.replace("propellant = [100.0]\n", ""))
    assert files.raw()["vessels"]["GL_01"]["mass"] == 12500.0
    files.table.write_text(OWN.replace("empty_mass", "size = 2.0 #"))
    assert files.problems() == [
        "code.toml: [GL-01]: empty_mass is missing",
        'side.scn:21: "GL-01": class "Nowhere" is not in code.toml or the .cfg files below Config/Vessels',
    ]


def test_a_section_that_is_a_ship_and_a_class_is_said(files):
    files.table.write_text(f"{TABLE}[Hub]\nempty_mass = 5000.0\n")
    files.replace(files.scenario, ("GL-01:", "Hub:"), ("0,GL-01", "0,Hub"), ("Ship GL-01", "Ship Hub"))
    said = files.problems()
    assert said == ["code.toml: [Hub]: neither pmi nor size"]  # as the class of the station
    files.table.write_text(
        f"{TABLE}[Hub]\nempty_mass = 5000.0\nsize = 4.0\ndock = [{'[0, 0, 1, 0, 0, 1, 0, 1, 0], ' * 2}]\n"
    )
    raw = files.raw()
    assert {name: vessel["mass"] for name, vessel in raw["vessels"].items()} == {
        "Hub": 11600.0,
        "Station": 5000.0,
    }
    assert (
        'code.toml: [Hub]: taken for the vessel "Hub", and for the class of this name as well'
        in files.notes()
    )


def test_a_ship_called_like_its_class_has_one_section(files):
    files.replace(
        files.scenario, ("GL-01:Glider", "Glider"), ("0,GL-01", "0,Glider"), ("Ship GL-01", "Ship Glider")
    )
    assert files.raw()["vessels"]["Glider"]["mass"] == 17600.0
    assert files.notes() == []


def test_every_section_that_gives_no_number_is_said(files):
    files.table.write_text(f'{TABLE}["GL-1"]\nempty_mas = 1.0\n[glider]\n[Atlantis]\n["a\\nb"]\n')
    assert sorted(files.notes()) == [
        f"code.toml: [{key}]: {NOT_USED}" for key in ("Atlantis", "GL-1", "a\\nb", "glider")
    ]
    assert "# - code.toml [Atlantis]: not used" in files.made().text


def test_a_ships_section_without_any_number_is_said(files):
    expected = files.raw()
    files.table.write_text(f'{TABLE}["GL-01"]\nsource = "somewhere"\n')
    assert files.raw() == expected
    assert files.notes() == [f"code.toml: [GL-01]: {NOT_USED}"]


def test_of_many_sections_that_are_not_used_the_first_are_named(files):
    files.table.write_text(TABLE + "".join(f"[x{i}]\n" for i in range(20_000)))
    notes = files.notes()
    assert len(notes) == 101
    assert notes[-1] == "code.toml: [x100]: not used, and 19899 more sections after it"


def test_a_ships_section_that_cannot_be_used_is_refused_by_key(files):
    files.table.write_text(f'{TABLE}["GL-01"]\nempty_mass = -1\npmi = [1, 2]\ndoc = 1\n')
    assert sorted(files.problems()) == [
        "code.toml: [GL-01] empty_mass = -1: must be a number >= 0 (kg)",
        "code.toml: [GL-01] pmi = [1, 2]: must be three numbers >= 0 (m2)",
        'code.toml: [GL-01]: unknown key "doc" (did you mean "dock"?)',
    ]
    files.table.write_text(f'"GL-01" = 3\n{TABLE}')
    assert files.problems() == ["code.toml: [GL-01]: must be a table"]
