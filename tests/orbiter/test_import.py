"""What an import makes of numbers: masses, axes, attitude, rates, names, and what it says it did not know."""

import re
import subprocess
import sys
import tomllib

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fmu_build import build_fmu
from orbiter.files import SCENARIO, line_of
from supervessel import load_scene, parse_scene, reference
from support.pages import blocks, text
from support.processes import ROOT

ROUNDING = 1e-14
"""A quaternion of three turns and the matrix made of it: some 30 operations on numbers below 1."""

P = np.diag([1.0, 1.0, -1.0])


def orbiters_matrix(arot):
    """Returns vessel to global, left-handed, as Orbiter defines AROT [degrees]."""
    (a, b, c) = np.radians(arot)
    X = [[1, 0, 0], [0, np.cos(a), np.sin(a)], [0, -np.sin(a), np.cos(a)]]
    Y = [[np.cos(b), 0, -np.sin(b)], [0, 1, 0], [np.sin(b), 0, np.cos(b)]]
    Z = [[np.cos(c), np.sin(c), 0], [-np.sin(c), np.cos(c), 0], [0, 0, 1]]
    return np.array(X) @ np.array(Y) @ np.array(Z)


def inertial(raw):
    """Returns R_inertial_vessel of each vessel at the start, and the angular velocity, inertial axes."""
    scene = parse_scene(raw)
    R = reference.rotation_matrix(scene.rotation.attitude)
    attitudes = {name: R @ turned for name, (turned, _) in reference.poses(scene).items()}
    return attitudes, R @ np.array(scene.rotation.angular_velocity)


def test_the_assembly_of_the_focus_is_made_with_it_as_root(files):
    raw = files.raw()
    assert (raw["name"], raw["root"], list(raw["vessels"])) == ("side", "GL_01", ["GL_01", "Station"])
    assert raw["docks"] == [{"ports": ["Station.dock1", "GL_01.dock0"]}]
    assert "convention" not in raw


def test_masses_are_empty_plus_propellant_at_its_level(files):
    raw = files.raw()
    assert raw["vessels"]["GL_01"]["mass"] == 11000.0 + 0.5 * 12000.0 + 600.0
    assert raw["vessels"]["Station"]["mass"] == 20e3 + 0.25 * 500.0
    assert raw["inputs"] == {
        "mass": ["GL_01", "Station"],
        "torque": True,
        "range": {"GL_01.mass": [11000.0, 23600.0], "Station.mass": [20000.0, 20500.0]},
    }


def test_ports_and_moments_are_those_of_the_class_with_z_reversed(files):
    station = files.raw()["vessels"]["Station"]
    assert station["pmi"] == [40.0, 30.0, 20.0]
    assert station["ports"] == {
        "dock0": {"position": [0.0, 1.0, -5.0], "direction": [0.0, 0.0, -1.0], "alignment": [0.0, 1.0, 0.0]},
        "dock1": {"position": [3.0, 0.0, 1.0], "direction": [1.0, 0.0, 0.0], "alignment": [0.0, 1.0, 0.0]},
    }


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(arot=st.tuples(*[st.sampled_from([-180, -90, 0, 90, 180]) | st.floats(-180, 180)] * 3))
def test_an_attitude_is_orbiters_seen_in_mirrored_axes(files, arot):
    words = "AROT " + " ".join(repr(float(angle)) for angle in arot)
    files.scenario.write_text(SCENARIO.replace("AROT 30.00 -20.00 70.00", words))
    R = reference.rotation_matrix(files.raw(vessel="Station")["rotation"]["attitude"])
    assert np.abs(R - P @ orbiters_matrix(arot) @ P).max() < ROUNDING


def test_rates_are_in_vessel_axes_with_z_reversed(files):
    rate = files.raw(vessel="Station")["rotation"]["angular_velocity"]
    assert np.abs(np.array(rate) - np.radians([0.1, 0.2, 0.3])).max() < ROUNDING


def test_a_rate_is_the_one_that_orbiters_reversed_cross_product_gives(files):
    """A point at r moves at r x omega in Orbiter's axes, at omega x r in right-handed ones."""
    omega = np.array(files.raw(vessel="Station")["rotation"]["angular_velocity"])
    r = np.array([1.0, -2.0, 3.0])
    orbiters = np.cross(P @ r, np.radians([0.1, 0.2, -0.3]))
    assert np.abs(np.cross(omega, r) - P @ orbiters).max() < ROUNDING


def test_another_root_turns_everything_the_same_way(files):
    """GL-01 has neither AROT nor VROT: they follow from the station's by the docks."""
    (one, omega), (other, same) = inertial(files.raw()), inertial(files.raw(vessel="Station"))
    for name, R in one.items():
        assert np.abs(R - other[name]).max() < ROUNDING
    assert np.abs(omega - same).max() < ROUNDING
    assert np.linalg.norm(omega) == pytest.approx(np.radians(np.linalg.norm([0.1, 0.2, 0.3])), rel=1e-14)


def test_a_scene_file_that_is_made_loads_and_builds(files):
    path = files.folder / "side.toml"
    path.write_text(files.made().text)
    scene = load_scene(path)
    assert build_fmu(scene, files.folder / "side.fmu").exists()


def test_comments_say_where_each_number_is_from(files):
    lines = files.made().text.split("\n")

    def above(line):
        return lines[lines.index(line) - 1]

    assert above("[vessels.GL_01]") == '# "GL-01", side.scn line 21: class "Glider"'
    assert above("mass = 20125.0  # kg") == (
        "# Hub.cfg line 2: empty 20000.0 kg; propellant 125 of 500 kg (side.scn line 18: PRPLEVEL 0:0.25)"
    )
    assert above("pmi = [40.0, 30.0, 20.0]  # m2") == "# Hub.cfg line 4"
    assert above("[vessels.Station.ports.dock1]") == "# Hub.cfg line 8"
    assert above("pmi = [15.5, 22.1, 7.7]  # m2") == "# code.toml [Glider] pmi"
    assert above("[[docks]]") == '# side.scn line 19: DOCKINFO 1:0,GL-01 of "Station"'
    attitude = next(i for i, line in enumerate(lines) if line.startswith("attitude"))
    assert lines[attitude - 1].endswith('AROT 30.00 -20.00 70.00 of "Station", from there by the docks')


def test_a_file_that_says_everything_needs_no_note(files):
    assert files.notes() == []


def test_fuel_sets_the_level_of_every_tank(files):
    files.replace(files.scenario, ("PRPLEVEL 0:0.5 1:1.0", "FUEL 0.25"))
    assert files.raw()["vessels"]["GL_01"]["mass"] == 11000.0 + 0.25 * 12600.0


def test_no_level_at_all_is_taken_as_full_and_said(files):
    text = files.replace(files.scenario, ("  PRPLEVEL 0:0.5 1:1.0\n", ""))
    assert files.raw()["vessels"]["GL_01"]["mass"] == 23600.0
    where = f"side.scn:{line_of(text, 'GL-01:')}"
    assert files.notes() == [f'{where}: "GL-01" has neither PRPLEVEL nor FUEL: taken as full']


def test_a_tank_without_a_level_is_taken_as_empty_and_said(files):
    files.replace(files.scenario, ("PRPLEVEL 0:0.5 1:1.0", "PRPLEVEL 0:0.5"))
    assert files.raw()["vessels"]["GL_01"]["mass"] == 17000.0
    assert files.notes() == ['side.scn:23: "GL-01" has no level of tank 1: taken as empty']


def test_propellant_resources_go_before_the_old_key(files):
    files.replace(
        files.hub, ("MaxFuel = 500", "MaxFuel = 7\nPropellantResource1 = 100\nPropellantResource2 = 60 0.9")
    )
    files.replace(files.scenario, ("PRPLEVEL 0:0.25", "PRPLEVEL 0:0.25 1:0.5"))
    assert files.raw()["vessels"]["Station"]["mass"] == 20055.0


def test_missing_moments_are_orbiters_guess_from_the_size_and_said_in_a_comment(files):
    files.replace(files.hub, ("Inertia = 40 30 20\n", ""))
    assert files.raw()["vessels"]["Station"]["pmi"] == [12.0, 12.0, 6.0]
    assert "# Hub.cfg line 3: no Inertia: Orbiter's guess (2 s, 2 s, s) from the size s = 6.0 m\n" in (
        files.made().text
    )
    assert files.notes() == [
        'Config/Vessels/Hub.cfg:3: moments of "Station": no Inertia: Orbiter\'s guess (2 s, 2 s, s) from the '
        "size s = 6.0 m"
    ]


def test_moments_of_no_rigid_body_bring_the_convention_and_say_so(files):
    files.replace(files.hub, ("40 30 20", "40 30 80"))
    beyond = (
        'Config/Vessels/Hub.cfg:4: moments of "Station": 80.0 exceeds 30.0 + 40.0 by 10; no rigid body has these '
        "moments"
    )
    hence = 'hence convention = "orbiter", which keeps no products of inertia'
    assert files.raw()["convention"] == "orbiter"
    assert files.notes() == [f"{beyond}; {hence}"]
    assert files.problems(convention="rigid_body") == [beyond]
    assert files.notes(convention="orbiter") == []


def test_the_convention_can_be_asked_for(files):
    assert files.raw(convention="orbiter")["convention"] == "orbiter"
    assert "convention" not in files.raw(convention="rigid_body")


def test_a_free_vessel_can_be_had_alone(files):
    (files.config / "satellite.CFG").write_text("Mass = 500\nInertia = 1 1 1\n")
    raw = files.raw(vessel="Satellite")
    assert (raw["root"], list(raw["vessels"]), "docks" in raw) == ("Satellite", ["Satellite"], False)
    assert raw["inputs"] == {"torque": True}


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (("GL-01", "GL_01"), ["GL_01_2", "GL_01"]),
        (("GL_01", "GL-01"), ["GL_01", "GL_01_2"]),
        (("GL.01", "GL-01"), ["GL_01", "GL_01_2"]),
        (("Mir", "2nd"), ["Mir", "_2nd"]),
        (("time", "torque"), ["time_2", "torque_2"]),
        (("Мир", "Союз"), ["___", "____"]),
        (('a"b', "c\\d"), ["a_b", "c_d"]),
    ],
)
def test_names_become_identifiers_that_nobody_else_has(files, names, expected):
    text = SCENARIO.replace("Station", "\0").replace("GL-01", "\1")
    files.scenario.write_text(text.replace("\0", names[1]).replace("\1", names[0]), encoding="utf-8")
    assert list(files.raw()["vessels"]) == expected


def test_a_free_port_that_no_scene_can_have_is_left_out_and_said(files):
    files.replace(files.hub, ("0 0 1   0 1 0", "0 0 1   0 0 1"))
    assert list(files.raw()["vessels"]["Station"]["ports"]) == ["dock1"]
    (note,) = files.notes()
    assert note.startswith(
        "Config/Vessels/Hub.cfg:7: port 0.alignment = [0.0, 0.0, 1.0]: must be perpendicular"
    )
    assert note.endswith('; free on "Station", left out')


def test_the_port_of_old_classes_comes_first(files):
    files.replace(files.hub, ("MaxFuel", "DockRef = 0 2 7\nDockDir = 0 0 1\nDockRot = 0 1 0\nMaxFuel"))
    station = files.raw()["vessels"]["Station"]["ports"]
    assert station["dock0"]["position"] == [0.0, 2.0, -7.0]
    assert station["dock1"]["position"] == [0.0, 1.0, -5.0]


def test_what_is_attached_or_names_a_mass_is_not_read_and_said(files):
    files.replace(
        files.scenario,
        ("  NAVFREQ 0 0\n", "  PAYLOAD MASS 120.0 0\n"),
        ("Satellite\n", "Box:Box\n  ATTACHED 0:0,GL-01\nEND\nSatellite\n"),
    )
    assert files.notes() == [
        'side.scn:28: "Box" is attached to "GL-01": attachments are not read, its mass is in no vessel',
        'side.scn:25: PAYLOAD MASS 120.0 0: a line for the code of "GL-01", not read',
    ]


def test_a_class_with_code_of_its_own_is_said(files):
    files.replace(files.hub, ("Size = 6", "Size = 6\nModule = Hub"))
    assert files.notes() == [
        'Config/Vessels/Hub.cfg:2: class "Hub" has code of its own, module "Hub", which may change what its '
        "file says"
    ]


def test_without_an_attitude_body_axes_are_inertial_and_that_is_said(files):
    files.replace(files.scenario, ("  AROT 30.00 -20.00 70.00\n", ""), ("  VROT 0.10 0.20 -0.30\n", ""))
    assert files.raw()["rotation"] == {"attitude": [1.0, 0.0, 0.0, 0.0], "angular_velocity": [0.0, 0.0, 0.0]}
    assert files.notes() == ["side.scn:19: no vessel of the assembly has AROT: taken as zero"]


def test_a_landed_assembly_is_said_to_stand_on_turning_ground(files):
    files.replace(files.scenario, ("STATUS Orbiting", "STATUS Landed"))
    assert files.notes() == [
        "side.scn:21: the assembly is landed: its AROT is relative to the turning ground"
    ]
    assert files.raw()["rotation"]["angular_velocity"] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("off", [0.0, 0.002, 0.5, -6.82])
def test_a_place_that_the_docks_contradict_is_said_with_its_distance(files, off):
    """Rounding to centimetres and hundredths of a degree is none; it moves the distance by 21 mm at most."""
    raw = files.raw(vessel="Station")
    _, (_, origin) = reference.poses(parse_scene(raw)).values()
    R = P @ inertial(raw)[0]["Station"] @ P
    away = R @ (P @ origin) + off * np.array([0.6, 0.0, 0.8])
    arot = arot_of(P @ inertial(raw)[0]["GL_01"] @ P)
    files.replace(
        files.scenario,
        ("  AROT 30.00", "  RPOS 1000.00 2000.00 -3000.00\n  AROT 30.00"),
        (
            "  PRPLEVEL 0:0.5",
            "  RPOS {:.2f} {:.2f} {:.2f}\n".format(*(away + np.array([1000.0, 2000.0, -3000.0])))
            + "  AROT {:.2f} {:.2f} {:.2f}\n  PRPLEVEL 0:0.5".format(*arot),
        ),
    )
    found = [NOTE_OF_DISTANCE.fullmatch(note) for note in files.notes(vessel="Station")]
    assert [float(note[1]) for note in found] == (
        [pytest.approx(abs(off), abs=0.021)] if abs(off) > 0.1 else []
    )


NOTE_OF_DISTANCE = re.compile(
    r'side\.scn:22: "GL-01" was saved (\S+) m from where its docks to "Station" have it; the docks are followed'
)


def arot_of(matrix):
    """Returns the angles of X Y Z [degrees]: its last column is (-s_b, s_a c_b, c_a c_b)."""
    a = np.arctan2(matrix[1, 2], matrix[2, 2])
    c = np.arctan2(matrix[0, 1], matrix[0, 0])
    return np.degrees([a, np.arcsin(-matrix[0, 2]), c])


def test_an_attitude_that_the_docks_contradict_is_said(files):
    files.replace(files.scenario, ("  PRPLEVEL 0:0.5", "  AROT 30.00 -20.00 70.00\n  PRPLEVEL 0:0.5"))
    (note,) = files.notes()
    assert note.startswith('side.scn:14: "Station" was saved 90.00 degrees from where its docks to "GL-01"')


def test_the_table_goes_before_the_files_and_case_does_not_matter(files):
    (files.config / "glider.cfg").write_text("Mass = 1\nSize = 1\n")
    files.replace(files.table, ("[Glider]", "[GLIDER]"))
    assert files.raw()["vessels"]["GL_01"]["pmi"] == [15.5, 22.1, 7.7]


def test_a_class_in_a_folder_of_its_own_is_found_by_orbiters_path(files):
    (files.config / "Base").mkdir()
    files.hub.rename(files.config / "Base" / "Hub.cfg")
    files.replace(files.scenario, ("Station:Hub", "Station:base\\hub"))
    assert files.raw()["vessels"]["Station"]["mass"] == 20125.0


def test_the_nearest_file_of_a_class_goes_first(files):
    (files.config / "Old").mkdir()
    (files.config / "Old" / "Hub.cfg").write_text("Mass = 1e9\nSize = 1\n")
    assert files.raw()["vessels"]["Station"]["mass"] == 20125.0


def test_text_of_a_scenario_cannot_break_out_of_a_comment(files):
    hostile = 'GL-01\x7f[vessels.x]"#'
    files.scenario.write_text(SCENARIO.replace("GL-01", hostile), encoding="utf-8")
    assert list(tomllib.loads(files.made().text)["vessels"]) == ["GL_01__vessels_x___", "Station"]


def test_the_scenario_of_the_examples_is_two_cylinders_end_to_end(tmp_path):
    command = next(line for line in "".join(blocks("examples/README.md", "sh")).split("\n") if ".scn" in line)
    program, *words = command.split()
    assert program == ".venv/bin/supervessel"
    words[words.index("-o") + 1] = str(tmp_path / "docked.toml")
    subprocess.run([sys.executable, "-m", "supervessel", *words], cwd=ROOT, check=True)
    whole = reference.composite(load_scene(tmp_path / "docked.toml"))
    masses = np.array([9000.0 + 0.5 * 3000.0, 9000.0 + 3000.0])
    across = masses.sum() * 6.33 + masses.prod() / masses.sum() * 8.0**2  # centres are 8 m apart
    assert whole.mass == masses.sum()
    along = masses.sum() * 2.0
    assert np.abs(whole.inertia - np.diag([across, across, along])).max() <= ROUNDING * across
    said = f"{masses.sum():.0f} kg, and moments of {across:.0f} kg m2 across their common axis and {along:.0f} along it"
    assert said in " ".join(text("examples/README.md").split())
