"""What a scene may say: the edges of what is accepted, what is normalised on reading, and the defaults."""

import math
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from supervessel import SceneError, Twin, load_scene, parse_scene, reference
from support import DISCARD, EPS, ISS_DG, OK, body, flying, random_rotation, relative_error, scene, variant

NOSE = "vessels.DG.ports.nose"

COMPOSITE_TOLERANCE = 64 * EPS
"""A composite is a sum of two tensors, each turned by two products of (3, 3) matrices of unit columns: about
30 operations for an element, each rounding by EPS/2 of the largest one, in both of two calculations."""

UNIT_TOLERANCE = 2 * EPS
"""Scaling, the square root of a sum of four squares and one division: a component of a normalised
quaternion is off by less than four roundings of EPS/2."""


def numbers(raw: dict[str, Any]) -> tuple[float, np.ndarray, np.ndarray]:
    """Returns mass, barycentre and inertia of a scene from the symbolic model."""
    twin = Twin(scene(raw))
    mass, barycentre, inertia, _ = (np.array(value) for value in twin.composite(twin.p_start))
    return float(mass.item()), barycentre.ravel(), inertia


def shaped(inertia: np.ndarray, **rotation: Any) -> dict[str, Any]:
    """Returns the raw scene of a single body given by a tensor."""
    changes = {"vessels.B.pmi": None, "vessels.B.inertia": ((inertia + inertia.T) / 2).tolist()}
    return variant(body(**rotation), changes)


@pytest.mark.parametrize(
    "pmi",
    [(3000, 3000, 6000), (6000, 3000, 3000), (3000, 6000, 3000), (0.1, 0.2, 0.3), (0.7, 0.1, 0.8)],
    ids=str,
)
def test_a_plate_on_the_edge_of_the_triangle_is_accepted(pmi):
    assert scene(body(pmi=pmi)).vessels["B"].pmi == pmi


@settings(deadline=None, derandomize=True, max_examples=300)
@given(
    digits=st.tuples(st.integers(1, 10**12), st.integers(1, 10**12)),
    exponent=st.integers(-20, 6),
    largest=st.integers(0, 2),
)
def test_moments_whose_decimals_add_up_exactly_are_accepted(digits, exponent, largest):
    one, other = (Decimal(f"{n}e{exponent}") for n in digits)
    moments = [float(one), float(other)]
    moments.insert(largest, float(one + other))
    assert scene(body(pmi=moments)).vessels["B"].pmi == tuple(moments)


@settings(deadline=None, derandomize=True, max_examples=300)
@given(
    moments=st.tuples(st.floats(1e-6, 1e6), st.floats(1e-6, 1e6)),
    excess=st.floats(16, 1e6),  # in roundings of EPS/2; decimals that add up come with 4 at most
)
def test_more_than_rounding_beyond_the_triangle_is_refused(moments, excess):
    small, middle = moments
    largest = (small + middle) * (1.0 + excess * EPS / 2)
    assert Fraction(largest) > Fraction(small) + Fraction(middle)
    with pytest.raises(SceneError, match="no rigid body"):
        scene(body(pmi=(small, middle, largest)))


def test_an_fmu_accepts_at_its_start_the_decimal_equality_that_the_scene_accepted():
    raw = variant(ISS_DG, {"vessels.DG.pmi": [0.1, 0.7, 0.8]})
    assert 0.1 + 0.7 < 0.8
    with flying(raw) as instance:
        assert list(instance.get("DG.pmi")) == [0.1, 0.7, 0.8]


@pytest.mark.parametrize("moments", [(0.0, 1.0, 1.0), (1.0, 2.0, 3.0)], ids=["rod", "plate"])
@pytest.mark.parametrize("seed", range(8))
def test_a_tensor_on_the_edge_of_the_triangle_is_accepted_at_any_angle(moments, seed):
    rotation = random_rotation(seed)
    inertia = rotation @ np.diag(moments) @ rotation.T
    assert scene(shaped(inertia, law="none")).vessels["B"].inertia is not None


@pytest.mark.parametrize("pmi", [(0.0, 1.0, 1.0), (0.0, 0.0, 0.0)], ids=["rod", "point"])
def test_the_law_none_takes_a_body_that_cannot_be_turned_by_torque(pmi):
    assert scene(body(pmi=pmi, law="none")).vessels["B"].pmi == pmi


@pytest.mark.parametrize("law", ["decoupled", "principal", "tensor"])
def test_a_thin_body_that_is_no_rod_is_accepted_at_any_angle(law):
    rotation = random_rotation(1)
    assert scene(shaped(rotation @ np.diag([1e-9, 1.0, 1.0]) @ rotation.T, law=law)).rotation.law == law


def test_two_rods_across_each_other_are_accepted():
    port = {"position": [0, 0, 0], "direction": [0, 0, 1], "alignment": [1, 0, 0]}
    turned = {"position": [0, 0, 0], "direction": [0, 0, 1], "alignment": [0, 1, 0]}
    raw = {
        "name": "cross",
        "root": "A",
        "vessels": {
            "A": {"mass": 3.0, "pmi": [0, 1, 1], "ports": {"p": port}},
            "B": {"mass": 3.0, "pmi": [0, 1, 1], "ports": {"p": turned}},
        },
        "docks": [{"ports": ["A.p", "B.p"]}],
    }
    expected = np.diag([3.0, 3.0, 6.0])
    assert relative_error(reference.composite(scene(raw)).inertia, expected) <= COMPOSITE_TOLERANCE


def test_an_adapter_without_mass_joins_its_neighbours_as_if_it_were_not_there():
    faces = {
        "lower": {"position": [0, 0, 0], "direction": [0, 0, 1], "alignment": [1, 0, 0]},
        "upper": {"position": [0, 0, 0], "direction": [0, 0, -1], "alignment": [1, 0, 0]},
    }
    adapter = variant(
        ISS_DG,
        {
            "vessels.PMA": {"mass": 0, "pmi": [0, 0, 0], "ports": faces},
            "docks": [{"ports": ["ISS.P2", "PMA.lower"]}, {"ports": ["PMA.upper", "DG.nose"]}],
        },
    )
    for value, truth in zip(numbers(adapter), numbers(ISS_DG), strict=True):
        assert relative_error(value, truth) <= COMPOSITE_TOLERANCE


def test_integers_are_read_as_the_floats_they_stand_for():
    integers = {
        "vessels.DG.mass": 24500,
        "vessels.ISS.pmi": [385, 719, 508],
        f"{NOSE}.direction": [0, 0, -1],
        "rotation.angular_velocity": [0, 1, 0],
        "rotation.max_angle_step": 1,
        "experiment": {"duration": 600, "step": 1},
        "inputs.range": {"DG.mass": [0, 30000]},
    }
    floats = {
        "rotation.angular_velocity": [0.0, 1.0, 0.0],
        "rotation.max_angle_step": 1.0,
        "experiment": {"duration": 600.0, "step": 1.0},
        "inputs.range": {"DG.mass": [0.0, 30000.0]},
    }
    read = scene(variant(ISS_DG, integers))
    assert read == scene(variant(ISS_DG, floats))
    assert type(read.vessels["DG"].mass) is float
    assert all(type(x) is float for x in read.vessels["ISS"].pmi or ())


@pytest.mark.parametrize(
    "attitude",
    [
        (3, 0, 4, 0),
        (1, 1, 1, 1),
        (-1, 2, -3, 4),
        (1e308, 1e308, 0, 1e308),
        (1e-200, 0, 1e-200, 0),
        (0, 0, 0, 7e-320),
    ],
    ids=str,
)
def test_an_attitude_of_any_length_is_normalised_on_reading(attitude):
    exact = [Fraction(component) for component in attitude]
    square = sum(component * component for component in exact)
    read = scene(body(attitude=list(attitude))).rotation.attitude
    for component, value in zip(exact, read, strict=True):
        truth = math.copysign(math.sqrt(component * component / square), component)
        assert abs(value - truth) <= UNIT_TOLERANCE


LENGTHS = (1e-200, 1e-160, 1e-90, 1e90, 1e160, 1e200)


def along_nose(length: float, tilt: float = 1.0) -> dict[str, list[float]]:
    """Returns direction and alignment of the nose at a length, for tilt = 1 as in the scene."""
    return {"direction": [0.0, 0.0, -length], "alignment": [0.0, tilt * length, (1.0 - tilt) * length]}


@pytest.mark.parametrize("length", LENGTHS)
def test_a_constant_port_of_any_length_gives_the_composite_of_unit_length(length):
    raw = variant(ISS_DG, {"inputs": {"torque": True}})
    long = variant(raw, {f"{NOSE}.{key}": value for key, value in along_nose(length).items()})
    truth = reference.composite(scene(raw))
    assert relative_error(numbers(long)[2], truth.inertia) <= COMPOSITE_TOLERANCE


@pytest.mark.parametrize("length", LENGTHS)
def test_a_port_set_to_any_length_gives_the_composite_of_unit_length(length):
    truth = reference.composite(scene(ISS_DG)).inertia
    values = {f"DG.nose.{key}": value for key, value in along_nose(length).items()}
    with flying(ISS_DG) as instance:
        assert instance.set(values) == OK
        assert instance.get_status("inertia") == OK, instance.messages()
        assert relative_error(instance.get("inertia").reshape(3, 3), truth) <= COMPOSITE_TOLERANCE


@pytest.mark.parametrize("length", LENGTHS)
def test_an_alignment_nearly_parallel_is_refused_at_any_length(length):
    values = along_nose(length, tilt=1e-7)
    with pytest.raises(SceneError, match="parallel"):
        scene(variant(ISS_DG, {f"{NOSE}.{key}": value for key, value in values.items()}))
    with flying(ISS_DG) as instance:
        assert instance.set({f"DG.nose.{key}": value for key, value in values.items()}) == OK
        assert instance.get_status("inertia") == DISCARD


@pytest.mark.parametrize("angle", [-0.999e-3, 0.999e-3])
def test_an_alignment_almost_perpendicular_is_projected(angle):
    off = variant(ISS_DG, {f"{NOSE}.alignment": [0.0, math.cos(angle), math.sin(angle)]})
    for value, truth in zip(numbers(off), numbers(ISS_DG), strict=True):
        assert relative_error(value, truth) <= COMPOSITE_TOLERANCE


MINIMAL = """
name = "ball"
root = "B"
[vessels.B]
mass = 2.0
pmi = [1.0, 1.0, 1.0]
"""

SPELLED_OUT = """
name = "ball"
root = "B"
docks = []
[vessels.B]
mass = 2.0
pmi = [1.0, 1.0, 1.0]
centre_of_mass = [0.0, 0.0, 0.0]
[vessels.B.ports]
[inputs]
mass = []
pmi = []
pose = []
torque = false
[inputs.range]
[rotation]
law = "tensor"
propagator = "auto"
tolerance = 1e-9
max_angle_step = 0.05
angular_velocity = [0.0, 0.0, 0.0]
attitude = [1.0, 0.0, 0.0, 0.0]
[outputs]
names = ["mass", "barycentre", "pmi", "angular_velocity", "attitude"]
"""


@pytest.mark.parametrize(
    "as_written", [str.encode, lambda text: text.replace("\n", "\r\n").encode()], ids=["LF", "CRLF"]
)
def test_what_a_scene_file_leaves_out_has_the_documented_default(tmp_path, as_written):
    short, full = tmp_path / "short.toml", tmp_path / "full.toml"
    short.write_bytes(as_written(MINIMAL))
    full.write_bytes(as_written(SPELLED_OUT))
    assert load_scene(short) == load_scene(str(full))
    assert load_scene(short).experiment is None


DOCUMENTED = """
name = "iss_dg"                       # model name and identifier
root = "ISS"                          # its axes are the body axes

[vessels.ISS]
mass = 455000.0                       # kg
pmi = [385.0, 719.0, 508.0]           # m²
[vessels.ISS.ports.P2]
position = [0.09, -17.9, 3.8]         # m, vessel axes
direction = [0.0, -1.0, 0.0]          # outward
alignment = [0.0, 0.0, -1.0]          # perpendicular to direction

[vessels.DG]
mass = 24500.0
pmi = [15.5, 22.1, 7.7]
[vessels.DG.ports.nose]
position = [0.0, -0.49, -10.076]
direction = [0.0, 0.0, -1.0]
alignment = [0.0, 1.0, 0.0]

[[docks]]                             # none for a single body
ports = ["ISS.P2", "DG.nose"]

[inputs]                              # everything not listed is a constant and costs nothing
mass = ["DG"]                         # vessels
pmi = []                              # vessels given by pmi
pose = ["DG.nose"]                    # docked ports
torque = true                         # about the barycentre, body axes
[inputs.range]                        # optional; becomes min and max of the FMU's variables
"DG.mass" = [11000.0, 24500.0]

[experiment]
duration = 600.0                      # s
step = 0.1                            # s

[outputs]
names = ["pmi", "angular_velocity"]
"""


def test_a_scene_file_says_the_same_as_nested_dictionaries(tmp_path):
    path = tmp_path / "iss_dg.toml"
    path.write_text(DOCUMENTED, encoding="utf-8")
    changes = {
        "inputs.pmi": [],
        "inputs.range": {"DG.mass": [11000.0, 24500.0]},
        "experiment": {"duration": 600.0, "step": 0.1},
        "outputs.names": ["pmi", "angular_velocity"],
    }
    assert load_scene(path) == parse_scene(variant(ISS_DG, changes))


@pytest.mark.parametrize("name", ["a", "A1", "iss_dg_2", "Mir2001"])
def test_a_model_name_of_letters_digits_and_single_underscores_is_accepted(name):
    assert scene(variant(ISS_DG, {"name": name})).name == name


@pytest.mark.parametrize("bounds", [[24500.0, 24500.0], [0.0, 24500.0], [24500.0, 1e9]], ids=str)
def test_a_start_value_on_the_bounds_of_its_range_is_accepted(bounds):
    assert scene(variant(ISS_DG, {"inputs.range": {"DG.mass": bounds}})).inputs.range["DG.mass"] == tuple(
        bounds
    )


@pytest.mark.parametrize("mass", [12250.0, 49000.0, 24500.0 / 3.0])
def test_the_tensor_of_a_vessel_scales_with_its_mass_input(mass):
    tensor = np.array([[400e3, 12e3, -3e3], [12e3, 520e3, 7e3], [-3e3, 7e3, 190e3]])
    given_by_inertia = {
        "name": "ship",
        "root": "DG",
        "vessels": {"DG": {"mass": 24500.0, "inertia": tensor.tolist()}},
        "inputs": {"mass": ["DG"]},
    }
    twin = Twin(scene(given_by_inertia))
    inertia = np.array(twin.composite([mass])[2])
    assert relative_error(inertia, tensor * (mass / 24500.0)) <= COMPOSITE_TOLERANCE
