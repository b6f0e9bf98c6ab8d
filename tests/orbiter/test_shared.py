"""Orbiter's own scenarios and vessels: each imports, agrees with what it saved, and sums as Orbiter does."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from fmu_build import build_fmu
from fmu_build.generate.model import generate
from orbiter.points import scene_pmi
from supervessel import Twin, parse_scene, reference
from supervessel.orbiter import import_scenario
from support import relative_error

DATA = Path(__file__).parents[2].parent / "shared" / "data" / "orbiter"
SCENARIOS = sorted(DATA.rglob("*.scn"))

pytestmark = pytest.mark.skipif(not SCENARIOS, reason=f"Orbiter's scenarios are not in {DATA}")

AGREEMENT = 1e-13
"""Six vessels of six points at most, each good to some 1.1e-16 of the largest sum: 900 roundings."""

ROUNDED_POSITION = np.sqrt(3.0) * 0.005
"""m, of RPOS: half a unit of the second decimal in each of three components."""
ROUNDED_ANGLE = 3.0 * np.radians(0.005)
"""rad, of AROT: the same of each of three angles."""

STALE = {
    ("Project Alpha", "STS-101"): 0.29,
    ("ISS", "STS-101"): 0.29,
    ("Shuttle-A Docked at ISS", "ISS"): 0.35,
    ("Vessel-vessel", "GL-01"): 0.48,
    ("Mir", "Mir"): 6.82,
}
"""m: how far a vessel was saved from where its docks have it, seen from the one with the focus."""

EXPECTED = {
    "Docked at ISS": (455000.0 + 24500.0, 2),
    "Mir": (124340.0 + 11000.0 + 12900.0 + 0.993 * 600.0, 2),
    "Atlantis docked at ISS": (455000.0 + 77564.3 + 13446.852, 2),
    "DG dumbbell": (2 * 11000.0 + (0.553 + 0.409) * 12900.0 + 2 * 600.0 + 3 * 8000.0, 5),
    "Space Shuttle ascent autopilot": (
        77564.3 + 13446.852 + 29937.0 + 728715.23 + 2 * (87603.65 + 501673.161),
        4,
    ),
}
"""kg and vessels, by hand from scenario and classes."""


def imported(path, **options):
    return import_scenario(path, config=[DATA], table=DATA / "cpp_vessels.toml", **options)


@pytest.fixture(params=SCENARIOS or [DATA], ids=lambda path: path.stem)
def path(request):
    return request.param


def saved(path):
    """Returns the words of RPOS and AROT by vessel, of those that have both."""
    found, name = {}, ""
    for line in path.read_text().split("BEGIN_SHIPS")[1].splitlines():
        if line and not line.startswith(" ") and line not in ("END", "END_SHIPS"):
            name = line.partition(":")[0]
        words = line.split()
        if words[:1] in (["RPOS"], ["AROT"]):
            found.setdefault(name, {})[words[0]] = np.array(words[1:], dtype=float)
    return {name: lines for name, lines in found.items() if len(lines) == 2}


def to_global(arot):
    """Returns vessel to global, left-handed, of AROT [degrees]."""
    (ca, cb, cc), (sa, sb, sc) = np.cos(np.radians(arot)), np.sin(np.radians(arot))
    X = np.array([[1, 0, 0], [0, ca, sa], [0, -sa, ca]])
    Y = np.array([[cb, 0, -sb], [0, 1, 0], [sb, 0, cb]])
    Z = np.array([[cc, sc, 0], [-sc, cc, 0], [0, 0, 1]])
    return X @ Y @ Z


def test_a_scenario_gives_a_scene_whose_code_is_generated(path):
    scene = parse_scene(tomllib.loads(imported(path).text))
    sources, description = generate(scene, 3)
    assert "composite" in sources["model.c"]
    assert scene.name.encode() in description


def test_mir_with_its_ship_builds(tmp_path):
    (path,) = (path for path in SCENARIOS if path.stem == "Mir")
    assert build_fmu(parse_scene(tomllib.loads(imported(path).text)), tmp_path / "mir.fmu").exists()


@pytest.mark.parametrize("name", EXPECTED)
def test_mass_and_count_of_vessels_are_those_worked_out_by_hand(name):
    (path,) = (path for path in SCENARIOS if path.stem == name)
    scene = parse_scene(tomllib.loads(imported(path).text))
    mass, count = EXPECTED[name]
    assert len(scene.vessels) == count
    assert reference.composite(scene).mass == pytest.approx(mass, rel=1e-14)


def test_docks_put_vessels_where_they_were_saved_or_the_distance_is_said(path):
    """Checked in Orbiter's axes: what the scene says is mirrored back, and nothing of the import is used."""
    made = imported(path)
    scene = parse_scene(tomllib.loads(made.text))
    P = np.diag([1.0, 1.0, -1.0])
    poses = {name: (P @ R @ P, P @ origin) for name, (R, origin) in reference.poses(scene).items()}
    lines = {name.replace("-", "_"): (name, line) for name, line in saved(path).items()}
    lines = {key: line for key, line in lines.items() if key in poses}
    distances = {}
    if scene.root in lines:
        base = lines[scene.root][1]
        R_global_root = to_global(base["AROT"])
        own = reference.rotation_matrix(scene.rotation.attitude)
        assert np.abs(own - P @ R_global_root @ P).max() < 1e-14
        for key, (name, line) in lines.items():
            R, origin = poses[key]
            turned = (R_global_root @ R).T @ to_global(line["AROT"])
            angle = np.arcsin(min(1.0, np.linalg.norm(turned - turned.T) / np.sqrt(8.0)))
            assert angle < 2.0 * ROUNDED_ANGLE
            assert np.trace(turned) > 2.9
            distance = np.linalg.norm(R_global_root.T @ (line["RPOS"] - base["RPOS"]) - origin)
            if distance > 2.0 * ROUNDED_POSITION + np.linalg.norm(origin) * ROUNDED_ANGLE:
                distances[name] = round(float(distance), 2)
    assert distances == {name: far for (stem, name), far in STALE.items() if stem == path.stem}
    said = [re.search(r'"(\S+)" was saved (\S+) m from', note) for note in made.notes]
    assert {note[1]: float(note[2]) for note in said if note} == distances


def test_the_saved_places_are_compared_at_all():
    compared = [path.stem for path in SCENARIOS if len(saved(path)) > 1]
    assert {stem for stem, _ in STALE} | {"DG dumbbell", "Mission 2 - ISS to Mir"} <= set(compared)


@pytest.mark.parametrize("engine", ["reference", "twin"])
def test_by_orbiters_convention_the_composite_is_the_sum_of_six_points_a_vessel(path, engine):
    raw = tomllib.loads(imported(path, convention="orbiter").text)
    scene = parse_scene(raw)
    if engine == "reference":
        pmi = reference.composite(scene).pmi
    else:
        twin = Twin(scene)
        pmi = np.array(twin.composite(p=twin.p_start)["pmi"]).ravel()
    assert relative_error(pmi, scene_pmi(raw)) < AGREEMENT


def test_the_wheel_is_imported_by_orbiters_convention_and_says_so():
    """Alone, so its moments are those of its file."""
    (path,) = (path for path in SCENARIOS if path.stem == "Mir")
    made = imported(path, vessel="Luna-OB1")
    raw = tomllib.loads(made.text)
    assert raw["convention"] == "orbiter"
    assert "52800.0 exceeds 26000.0 + 26000.0 by 800" in made.notes[0]
    assert np.allclose(raw["rotation"]["angular_velocity"], [0.0, 0.0, -np.radians(10.0)], rtol=1e-15)
    assert relative_error(reference.composite(parse_scene(raw)).pmi, [26000.0, 26000.0, 52800.0]) < AGREEMENT


def test_each_scenario_names_the_sections_of_the_table_that_it_does_not_use(path):
    made = imported(path)
    classes = re.findall(r': class "(\S+)"$', made.text, re.MULTILINE)
    sections = tomllib.loads((DATA / "cpp_vessels.toml").read_text()).keys()
    said = [
        note.partition(".toml: [")[2].partition("]: not used")[0] for note in made.notes if "not used" in note
    ]
    assert said == [name for name in sections if name not in classes]
