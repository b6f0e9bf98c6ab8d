"""Lines of Orbiter's files that are used, and those that are not: other encodings, levels, blocks."""

import pytest

from orbiter.files import HUB, SCENARIO, line_of

UMLAUT = "ü".encode("latin-1")


def written(files, **texts):
    """Writes texts to files by name, each "~" a byte that is not UTF-8."""
    for name, text in texts.items():
        getattr(files, name).write_bytes(text.encode().replace(b"~", UMLAUT))


UNUSED = {
    "the description": (("A glider", "F~r a glider"), None),
    "a comment behind a used line": (("0:0.5 1:1.0", "0:0.5 1:1.0 ; gef~llt"), None),
    "a line for the code of a vessel": (("NAVFREQ 0 0", "SKIN gr~n"), None),
    "a block of the code of a vessel": (("NAVFREQ 0 0", "BEGIN_T~R\n  PRPLEVEL 0:~\n  END_T~R"), None),
    "another assembly": (("Satellite\n", "S~dpol\n  AROT ~\n  PRPLEVEL ~\nEND\nSatellite\n"), None),
    "another focus": (("Ship GL-01", "Ship S~dpol"), "GL-01"),
    "a comment of a class": (("; a station", "; f~nf"), None),
    "another key of a class": (("Size = 6", "Meshname = gr~n\nSize = 6"), None),
    "another block of a class": (("P 0 0 0  0 -1 0  0 0 1  XS", "~"), None),
}


@pytest.mark.parametrize(("change", "vessel"), UNUSED.values(), ids=UNUSED)
def test_bytes_that_are_not_utf_8_do_not_matter_in_lines_that_are_not_used(files, change, vessel):
    before = files.raw()
    written(files, scenario=SCENARIO.replace(*change), hub=HUB.replace(*change))
    made = files.made(vessel=vessel or "")
    assert made.text.encode("utf-8")
    assert files.raw(vessel=vessel or "") == before


USED = {
    "the name of a vessel": ("Station", "St~tion", "side.scn:14"),
    "a class": ("Station:Hub", "Station:H~b", "side.scn:14"),
    "a class of the same name": ("Station:Hub", "Station~", "side.scn:14"),
    "a status": ("Orbiting Earth\n  AROT", "Orbiting E~rth\n  AROT", "side.scn:15"),
    "an attitude": ("30.00 -20.00", "3~.00 -20.00", "side.scn:16"),
    "a level": ("0:0.25", "0:0.~5", "side.scn:18"),
    "a dock": ("1:0,GL-01", "1:0,GL-01 ~", "side.scn:19"),
    "a mass": ("20e3", "2~e3", "Config/Vessels/Hub.cfg:2"),
    "a tank": ("MaxFuel = 500", "PropellantResource1 = 500 ~", "Config/Vessels/Hub.cfg:5"),
    "a port": ("0 1 0   588", "0 1 0   588 ~", "Config/Vessels/Hub.cfg:7"),
}


@pytest.mark.parametrize(("old", "new", "where"), USED.values(), ids=USED)
def test_bytes_that_are_not_utf_8_are_refused_in_lines_that_are_used(files, old, new, where):
    written(files, scenario=SCENARIO.replace(old, new), hub=HUB.replace(old, new))
    assert files.problems()[-1] == f"{where}: is not UTF-8 text (byte 0xfc)"


def test_levels_of_tanks_that_a_class_no_longer_has_are_said_and_not_used(files):
    files.replace(files.scenario, ("0:0.5 1:1.0", "0:0.5 1:1.0 3:0.25 2:1.0"), ("0:0.25", "0:0.25 1:0.125"))
    raw = files.raw()
    assert raw["vessels"]["GL_01"]["mass"] == 11000.0 + 0.5 * 12000.0 + 600.0
    assert raw["vessels"]["Station"]["mass"] == 20e3 + 0.25 * 500.0
    assert files.notes() == [
        'side.scn:23: PRPLEVEL of tanks 2, 3: class "Glider" of "GL-01" has tanks 0 to 1; not used',
        'side.scn:18: PRPLEVEL of tank 1: class "Hub" of "Station" has tank 0 only; not used',
    ]


def test_levels_of_a_class_without_tanks_are_said(files):
    files.replace(files.hub, ("MaxFuel = 500\n", ""))
    assert files.raw()["vessels"]["Station"]["mass"] == 20e3
    assert files.notes() == [
        'side.scn:18: PRPLEVEL of tank 0: class "Hub" of "Station" has no tanks; not used'
    ]


BLOCKS = {
    "BEGIN_X": ("BEGIN_TANKS", "END_TANKS"),
    "in small letters": ("begin_tanks", "End_Tanks"),
    "X_BEGIN": ("AGC_BEGIN", "AGC_END"),
    "with a word behind": ("BEGIN_MFD Left", "END_MFD"),
    "an at sign": ("@SUBSYSTEM OMS", "@ENDSUBSYSTEM OMS"),
    "angles": ("<INTERNALS>", "</INTERNALS>"),
    "END X": ("INTERNAL: v1.0.0B", "END INTERNAL"),
}
INNER = """\
  STATUS Landed Mars
  AROT 1 2 3
  VROT 4 5 6
  PRPLEVEL 0:0.125
  FUEL 0.5
  DOCKINFO 0:0,Satellite"""


@pytest.mark.parametrize(("opening", "closing"), BLOCKS.values(), ids=BLOCKS)
@pytest.mark.parametrize("before", ["  AROT 30.00", "END\nGL-01"], ids=["first", "last"])
def test_lines_in_a_block_of_a_vessels_code_are_not_its_own(files, opening, closing, before):
    """Wherever the block stands: it goes before the lines that follow, and after those that it repeats."""
    expected = files.raw(vessel="Station")
    block = f"  {opening}\n{INNER}\n  {closing}\n"
    text = files.replace(files.scenario, (before, block + before))
    assert files.raw(vessel="Station") == expected
    own, inner = (line_of(text, f"PRPLEVEL 0:{level}") for level in ("0.25", "0.125"))
    key, _, words = opening.partition(" ")
    shown = f"{key.upper()} {words}".strip()
    assert files.notes(vessel="Station") == [
        f"side.scn:{inner}: PRPLEVEL 0:0.125: a level in the block {shown} of the code of "
        f'"Station", not read; the vessel\'s own is in line {own}'
    ]


def test_the_block_of_orbiters_dragonfly_is_not_its_own_and_its_tanks_are_said(files):
    expected = files.raw()
    inner = "HYDRAULICS:\nTANK 1 0.0 129964 170.0\nTANK 0 0.0 1 1\nPANEL :\nSW 0 1\nSW END\nROT END\nFUEL 0.1"
    block = f"INTERNAL: v1.0.0B\n{inner}\nEND INTERNAL\n"
    text = files.replace(files.scenario, ("  AROT 30.00", block + "  AROT 30.00"))
    assert files.raw() == expected
    assert files.notes() == [
        f"side.scn:{line_of(text, 'TANK')}: TANK 1 0.0 129964 170.0: a level in the block INTERNAL: v1.0.0B "
        f'of the code of "Station", not read; the vessel\'s own is in line {line_of(text, "PRPLEVEL")}'
    ]


def test_a_block_alone_gives_no_level(files):
    text = files.replace(
        files.scenario, ("  PRPLEVEL 0:0.25\n", "  AGC_BEGIN\n  PRPLEVEL 0:0.25\n  AGC_END\n")
    )
    assert files.raw()["vessels"]["Station"]["mass"] == 20500.0
    assert files.notes() == [
        'side.scn:14: "Station" has neither PRPLEVEL nor FUEL: taken as full',
        f"side.scn:{line_of(text, 'PRPLEVEL')}: PRPLEVEL 0:0.25: a level in the block AGC_BEGIN of the code "
        'of "Station", not read; the vessel has none of its own',
    ]


def test_blocks_of_one_name_stand_within_each_other(files):
    expected = files.raw()
    block = "  BEGIN_A\n  BEGIN_A\n  END_A\n  AROT 1 2 3\n  END_A\n  BEGIN_A\n  VROT 1 2 3\n  END_A\n"
    files.replace(files.scenario, ("  AROT 30.00", block + "  AROT 30.00"))
    assert files.raw() == expected
    assert files.notes() == []


def test_a_block_that_ends_behind_the_one_in_which_it_begins_belongs_to_that(files):
    expected = files.raw()
    block = "  BEGIN_A\n  BEGIN_B\n  END_A\n  PRPLEVEL 0:0.125\n  AROT 1 2 3\n  END_B\n"
    text = files.replace(files.scenario, ("  AROT 30.00", block + "  AROT 30.00"))
    assert files.raw() == expected
    inner, own = (line_of(text, f"PRPLEVEL 0:{level}") for level in ("0.125", "0.25"))
    assert files.notes() == [
        f"side.scn:{inner}: PRPLEVEL 0:0.125: a level in the block BEGIN_A of the code of "
        f'"Station", not read; the vessel\'s own is in line {own}'
    ]


def test_a_block_ends_with_the_last_line_that_closes_one_where_an_inner_one_does_not(files):
    expected = files.raw()
    block = "  BEGIN_A\n  BEGIN_A\n  AROT 1 2 3\n  END_A\n"
    files.replace(files.scenario, ("  AROT 30.00", block + "  AROT 30.00"))
    assert files.raw() == expected


@pytest.mark.parametrize("line", ["MISSION_BEGIN 52000.5", "BEGIN_", "_BEGIN", "<>", "@", "END_A", "@END"])
def test_a_line_that_only_looks_like_a_block_is_one_of_the_vessels_code(files, line):
    expected = files.raw()
    files.replace(files.scenario, ("  AROT 30.00", f"  {line}\n  AROT 30.00"))
    assert files.raw() == expected
    assert files.notes() == []


def test_a_block_without_end_is_refused_where_a_used_line_follows(files):
    expected = files.raw()
    text = files.replace(files.scenario, ("  NAVFREQ 0 0", "  BEGIN_A\n  NAVFREQ 0 0"))
    assert files.raw() == expected
    files.replace(
        files.scenario,
        ("  STATUS Orbiting Earth\n  PRPLEVEL", "  B_BEGIN\n  STATUS Orbiting Earth\n  PRPLEVEL"),
    )
    assert files.problems() == [
        f'side.scn:{line_of(text, "STATUS", "GL-01")}: B_BEGIN in "GL-01" begins a block without end; which '
        "lines after it are the vessel's own cannot be told"
    ]
    files.replace(files.scenario, ("Satellite\n", "Satellite\n  A_BEGIN\n"), ("  B_BEGIN\n", ""))
    assert files.raw() == expected  # of another assembly


def test_many_blocks_without_end_take_no_time(files):
    lines = "".join(f"  BEGIN_{i} 1\n" for i in range(30_000))
    files.replace(files.scenario, ("  NAVFREQ 0 0\n", lines))
    assert list(files.raw()["vessels"]) == ["GL_01", "Station"]
