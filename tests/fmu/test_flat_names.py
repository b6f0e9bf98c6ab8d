"""FMUs with flat names: what importers read and fly is the FMU with structured names, renamed."""

import csv
import io
import re
import zipfile
from functools import cache
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from lxml import etree

from fmu.descriptions import CHAIN, SCENES
from fmu_build import BuildError, build_fmu
from fmu_build.interface.names import check_names
from supervessel.composite.resolved import resolve
from support import DISCARD, ERROR, ISS_DG, OK, TURNING, Instance, body, built, scene, variant
from support.marks import FMI

REFERENCE = "extra/org.fmi-standard.fmi-ls-ref"

FLOWN = variant(ISS_DG, {"name": "flat", "rotation": TURNING})
RENAMED = {
    "time": "time",
    "DG.mass": "DG_mass",
    "DG.pmi[3]": "DG_pmi_3",
    "DG.nose.position[1]": "DG_nose_position_1",
    "torque[1]": "torque_1",
    "angular_velocity_start[2]": "angular_velocity_start_2",
    "mass": "mass",
    "inertia[1,2]": "inertia_12",
    "attitude[4]": "attitude_4",
    "state.attitude[4]": "state_attitude_4",
    "der(state.angular_velocity[3])": "der_state_angular_velocity_3",
}

CLASHING = {
    **variant(ISS_DG, {"name": "clash", "outputs": None}),
    "docks": [{"ports": ["ISS.P2", "DG.nose"], "name": "DG_nose"}],
    "inputs": {"pose": ["DG.nose"], "motion": ["DG.nose"], "docked": ["DG_nose"]},
}
"""The motion of the port DG.nose, and that of the dock DG_nose at contact."""


@cache
def archive(fmi: int, naming: str = "flat") -> dict[str, bytes]:
    with zipfile.ZipFile(built(FLOWN, fmi, naming)) as packed:
        return {name: packed.read(name) for name in packed.namelist()}


def described(fmi: int, naming: str) -> etree._Element:
    return etree.fromstring(archive(fmi, naming)["modelDescription.xml"])


def names_of(fmi: int, naming: str) -> list[str]:
    return [element.get("name") for element in described(fmi, naming).find("ModelVariables")]


@FMI
def test_fmpy_finds_nothing_to_complain_of_and_reads_that_names_are_flat(fmi):
    path = str(built(FLOWN, fmi, "flat"))
    assert validate_fmu(path) == []
    assert fmpy.read_model_description(path).variableNamingConvention == "flat"
    assert fmpy.read_model_description(str(built(FLOWN, fmi))).variableNamingConvention == "structured"


@FMI
def test_each_name_is_one_word_and_stands_for_one_structured_name(fmi):
    names = names_of(fmi, "flat")
    assert all(re.fullmatch("[A-Za-z][A-Za-z0-9_]*", name) for name in names)
    assert len(set(names)) == len(names)
    pairs = dict(zip(names_of(fmi, "structured"), names, strict=True))
    assert {name: pairs[name] for name in RENAMED} == RENAMED


@FMI
def test_all_but_the_names_is_the_description_of_the_fmu_with_structured_ones(fmi):
    flat, structured = (described(fmi, naming) for naming in ("flat", "structured"))
    for element in (*flat.find("ModelVariables"), *structured.find("ModelVariables")):
        del element.attrib["name"]
    for root in (flat, structured):
        del root.attrib["guid" if fmi == 2 else "instantiationToken"]
        del root.attrib["variableNamingConvention"]
    assert etree.tostring(flat) == etree.tostring(structured)


@FMI
@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_a_flight_is_that_of_the_fmu_with_structured_names_to_the_last_bit(fmi, kind):
    pairs = dict(zip(names_of(fmi, "structured"), names_of(fmi, "flat"), strict=True))
    start = {"DG.mass": 12000.0, "torque[1]": 500.0, "torque[3]": -20.0}
    shown = [name for name in pairs if name.startswith(("inertia", "attitude[", "angular_velocity["))]
    results = [
        fmpy.simulate_fmu(
            str(built(FLOWN, fmi, naming)),
            fmi_type=kind,
            stop_time=5.0,
            output_interval=0.5,
            start_values={(pairs[name] if naming == "flat" else name): x for name, x in start.items()},
            output=[pairs[name] if naming == "flat" else name for name in shown],
        )
        for naming in ("flat", "structured")
    ]
    assert results[0].dtype.names == ("time", *(pairs[name] for name in shown))
    assert all(np.array_equal(results[0][pairs[name]], results[1][name]) for name in shown)
    assert len(set(results[0]["angular_velocity_1"])) > 5


@FMI
@pytest.mark.parametrize("table", ["inputs", "outputs"])
def test_numpy_reads_the_tables_of_the_reference_result_by_the_fmus_names(fmi, table):
    """Split at commas, as many readers do it; "inertia[1,2]" makes two columns of one."""
    content = archive(fmi)[f"{REFERENCE}/{table}.csv"].decode()
    read = np.genfromtxt(io.StringIO(content), delimiter=",", names=True, deletechars="", replace_space=" ")
    causality = table.removesuffix("s")
    variables = fmpy.read_model_description(str(built(FLOWN, fmi, "flat"))).modelVariables
    assert read.dtype.names == ("time", *(v.name for v in variables if v.causality == causality))
    numbers = archive(fmi, "structured")[f"{REFERENCE}/{table}.csv"].decode()
    rows = np.array([[float(cell) for cell in row] for row in list(csv.reader(io.StringIO(numbers)))[1:]])
    assert np.array_equal(np.array(read.tolist()), rows)


@FMI
def test_terminals_name_the_fmus_variables_and_keep_the_names_of_their_members(fmi):
    flat, structured = (
        etree.fromstring(archive(fmi, naming)["terminalsAndIcons/terminalsAndIcons.xml"])
        for naming in ("flat", "structured")
    )
    pairs = dict(zip(names_of(fmi, "structured"), names_of(fmi, "flat"), strict=True))
    members = [list(root.iter("TerminalMemberVariable")) for root in (flat, structured)]
    assert members[0]
    for one, other in zip(*members, strict=True):
        assert one.get("variableName") == pairs[other.get("variableName")]
        assert one.get("memberName") == other.get("memberName")


@FMI
def test_the_page_has_the_fmus_names_and_beside_them_those_of_scene_and_twin(fmi):
    page = etree.fromstring(archive(fmi)["documentation/index.html"])
    rows = {
        cells[1]: cells for row in page.iter("tr") if len(cells := ["".join(c.itertext()) for c in row]) == 8
    }
    for structured, flat in zip(names_of(fmi, "structured"), names_of(fmi, "flat"), strict=True):
        assert rows[flat][-1] == structured
        assert not {structured} & {name for name in rows if name != flat}


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "moments": ({"DG_pmi_1": 1.0, "DG_pmi_2": 1.0, "DG_pmi_3": 5.0}, "DG_pmi = (1, 1, 5) m2: 5 exceeds"),
    "mass": ({"DG_mass": -1.0}, "DG_mass = -1 kg: must be >= 0"),
    "length": (
        {f"DG_nose_direction_{i}": 0.0 for i in (1, 2, 3)},
        "DG_nose_direction = (0, 0, 0): must have",
    ),
    "parallel": (
        {"DG_nose_alignment_1": 0.0, "DG_nose_alignment_2": 0.0, "DG_nose_alignment_3": 1.0},
        "DG_nose_alignment = (0, 0, 1): must not be parallel to DG_nose_direction = (0, 0, -1)",
    ),
}


@FMI
@pytest.mark.parametrize("values", REFUSED)
def test_log_lines_have_the_fmus_names(fmi, values):
    instance = Instance(FLOWN, fmi, naming="flat")
    assert instance.initialise() == OK
    assert instance.set(REFUSED[values][0]) == OK
    assert instance.step(0.1) in (DISCARD, ERROR)
    assert REFUSED[values][1] in instance.messages()[-1]
    instance.free()


def test_the_log_line_of_a_torque_that_exact_cannot_take_has_the_fmus_name():
    instance = Instance(body(propagator="exact", **TURNING), naming="flat", optimised=False)
    assert instance.initialise() == OK
    assert instance.set({"torque_2": 1.0}) == OK
    assert instance.step(0.1) == DISCARD
    assert "torque = (0, 1, 0) N.m" in instance.messages()[-1]
    instance.free()


def test_the_log_line_of_an_attitude_that_is_none_has_the_fmus_name():
    instance = Instance(FLOWN, naming="flat", exchange=True)
    assert instance.initialise() == OK
    instance.run()
    instance.fmu.setContinuousStates((np.ctypeslib.ctypes.c_double * 7)(), 7)
    assert instance.get_status("attitude_1") == DISCARD
    assert "state_attitude = (0, 0, 0, 0)" in instance.messages()[-1]
    instance.free()


@pytest.mark.parametrize("raw", [*SCENES.values(), CHAIN])
def test_flat_names_of_the_scenes_here_do_not_clash(raw):
    check_names(resolve(scene(raw)), "flat")


def test_names_that_would_be_one_are_refused_with_both_and_nothing_is_written(tmp_path):
    with pytest.raises(BuildError) as caught:
        build_fmu(scene(CLASHING), tmp_path / "clash.fmu", names="flat")
    lines = str(caught.value).splitlines()
    assert lines == [
        f"clash: flat names: DG.nose.{key}[{i}] and DG_nose.{key}[{i}] would both be DG_nose_{key}_{i}; "
        "rename a part of one of them"
        for key in ("velocity", "rate")
        for i in (1, 2, 3)
    ]
    assert list(tmp_path.iterdir()) == []


def test_a_naming_that_is_none_is_refused(tmp_path):
    with pytest.raises(ValueError, match="names = 'camel': must be 'structured' or 'flat'"):
        build_fmu(scene(FLOWN), tmp_path / "camel.fmu", names="camel")
