"""The reference result in the archive, which importers can fly; what goes with an FMU, and its roles."""

import csv
import io
import re
import tomllib
import zipfile
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import urljoin

import fmpy
import numpy as np
import pytest
from lxml import etree

from fmu.descriptions import CHAIN
from fmu_build.document.reference_flight import reference_flight
from fmu_build.document.reference_result import manifest
from supervessel import load_scene, parse_scene
from supervessel.equations import equations
from supervessel.orbit import two_body
from supervessel.scene.writing import scene_text
from support import ISS_DG, TURNING, Array, body, built, scene, variant
from support.marks import FMI, some_at_once
from support.orbits import EARTH, ORBIT, orbiting

SLOW = TURNING | {"angular_velocity": [0.001, 0.002, -0.001]}
FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
EXAMPLES = sorted((Path(__file__).parents[2] / "examples").glob("*.toml"))

BERTH = {
    **variant(ISS_DG, {"name": "berth", "rotation": TURNING, "outputs": None}),
    "docks": [{"ports": ["ISS.P2", "DG.nose"], "name": "berth"}],
    "inputs": {"mass": ["DG", "ISS"], "docked": ["berth"], "torque": True},
}
HUB = {
    **variant(BERTH, {"name": "hub", "vessels.tug": ISS_DG["vessels"]["DG"] | {"mass": 9000.0}}),
    "docks": [
        {"ports": ["ISS.P2", "DG.nose"], "name": "berth", "docked": False},
        {"ports": ["ISS.P2", "tug.nose"], "name": "other"},
    ],
    "inputs": {"docked": ["berth", "other"], "torque": True, "pose": ["tug.nose"], "mass": ["tug"]},
}
"""A port that is taken: the first dock cannot close at the start."""
SCENES: dict[str, dict[str, Any]] = {
    "mass and torque": variant(ISS_DG, {"name": "plain", "rotation": TURNING}),
    "closed at the start": BERTH,
    "open at the start": variant(BERTH, {"name": "open", "docks": [BERTH["docks"][0] | {"docked": False}]}),
    "port taken": HUB,
    "moving port": variant(
        BERTH,
        {
            "name": "moving",
            "inputs.pose": ["DG.nose"],
            "inputs.motion": ["DG.nose"],
            "rotation.propagator": "dop853",
        },
    ),
    "principal": variant(BERTH, {"name": "principal", "rotation.law": "principal"}),
    "dock, law none": variant(BERTH, {"name": "held", "rotation.law": "none"}),
    "split": {**body(propagator="split", tolerance=1e-11, **TURNING), "name": "split"},
    "exact": {**body(propagator="exact", **TURNING), "name": "exact"},
    "auto": {**body(propagator="auto", **TURNING), "name": "auto"},
    "orbit and dock": orbiting(
        {
            "name": "orbit_dock",
            "rotation.propagator": "rk4",
            "experiment.duration": 1e3,
            "experiment.step": 20.0,
        },
        base=BERTH,
    ),
    "orbit": orbiting(
        {
            "name": "orbit",
            "experiment.duration": 3e3,
            "experiment.step": 60.0,
            "vessels.B.wheels": {"yaw": {"axis": [0.0, 0.6, 0.8], "inertia": 2.0, "momentum": 3.0}},
        },
        base=body(propagator="auto", **SLOW),
    ),
    "orbit, split": orbiting(
        {"name": "orbit_split"}, base=body(propagator="split", tolerance=1e-11, **TURNING)
    ),
    "error told": variant(body(**TURNING), {"name": "told", "outputs.names": ["error_estimate", "attitude"]}),
}

# RK4's steps are the same but for rounding; dop853 keeps 1e-9 a step, attitude in rad and rate relative; the
# result of split is RK4's, in steps of 0.01 rad, the others' are of higher order than any of these.
TOLERANCE = {
    "moving port": 1e-7,
    "split": 1e-8,
    "exact": 1e-10,
    "auto": 1e-10,
    "orbit": 1e-9,
    "orbit, split": 1e-8,
}
ROUNDING = 1e-12


@cache
def archive(name: str, fmi: int) -> dict[str, bytes]:
    with zipfile.ZipFile(built(SCENES[name], fmi)) as packed:
        return {place: packed.read(place) for place in packed.namelist()}


def table(name: str, fmi: int, file: str) -> Array:
    """Returns a table of the archive, by its columns."""
    text = io.StringIO(archive(name, fmi)[f"{FOLDER}/{file}.csv"].decode())
    [names] = csv.reader([text.readline()])
    return np.array(
        [tuple(row) for row in np.loadtxt(text, delimiter=",")], [(name, float) for name in names]
    )


def experiment(name: str, fmi: int) -> Any:
    return etree.fromstring(archive(name, fmi)[f"{FOLDER}/experiments.xml"]).find("Experiment")


def flown(name: str, fmi: int, **how: Any) -> Array:
    """Returns what FMPy flies as the archive says."""
    asked = experiment(name, fmi)
    return fmpy.simulate_fmu(
        str(built(SCENES[name], fmi)),
        fmi_type="CoSimulation",
        stop_time=float(asked.get("stopTime")),
        output_interval=float(asked.get("stepSize")),
        input=table(name, fmi, "inputs"),
        output=list(table(name, fmi, "outputs").dtype.names[1:]),
        **how,
    )


def assert_same(found: Array, expected: Array, tolerance: float) -> None:
    assert found.dtype.names == expected.dtype.names
    assert np.allclose(found["time"], expected["time"], rtol=1e-14, atol=0.0)
    for column in expected.dtype.names[1:]:
        group = [c for c in expected.dtype.names if c.partition("[")[0] == column.partition("[")[0]]
        size = max(np.abs(expected[c]).max() for c in group)
        assert np.abs(found[column] - expected[column]).max() <= tolerance * size, column


@pytest.mark.parametrize(
    ("name", "fmi"),
    some_at_once(
        [*((name, 3) for name in SCENES), ("mass and torque", 2), ("closed at the start", 2)],
        *((name, 3) for name in ("mass and torque", "port taken", "moving port", "auto", "orbit and dock")),
        ("closed at the start", 2),
    ),
)
def test_an_importer_that_flies_it_gets_the_reference_result(name, fmi):
    assert_same(flown(name, fmi), table(name, fmi, "outputs"), TOLERANCE.get(name, ROUNDING))


@pytest.mark.parametrize("name", ["closed at the start", "open at the start", "moving port"])
def test_an_importer_with_events_gets_it_too(name):
    """It shows each switch twice, before and after: the table has what is before."""
    found = flown(name, 3, use_event_mode=True)
    first = np.append(True, np.diff(found["time"]) > 0.0)
    assert (~first).sum() == 2
    assert_same(found[first], table(name, 3, "outputs"), TOLERANCE.get(name, ROUNDING))


@pytest.mark.parametrize("name", [name for name, raw in SCENES.items() if raw["inputs"].get("docked")])
def test_one_dock_switches_and_switches_back_with_a_motion_at_contact(name):
    moved, shown = table(name, 3, "inputs"), table(name, 3, "outputs")
    docks = [column for column in moved.dtype.names if column.endswith(".docked")]
    [dock] = [column for column in docks if len(set(moved[column])) > 1]
    first, other = np.flatnonzero(np.diff(moved[dock].astype(float)))
    given = {one["name"]: one.get("docked", True) for one in SCENES[name]["docks"]}
    assert bool(moved[dock][0]) == given[dock.removesuffix(".docked")]
    assert moved[dock][0] == moved[dock][-1]
    assert all(moved["time"][i] == moved["time"][i + 1] for i in (first, other))
    assert moved[dock.replace("docked", "rate[1]")][other + 1] > 0.0
    steps = [int(np.searchsorted(shown["time"], moved["time"][i])) for i in (first, other)]
    assert set(np.argsort(np.abs(np.diff(shown["mass"])))[-2:]) == set(steps)


@pytest.mark.parametrize("name", ["mass and torque", "error told"])
def test_a_scene_without_docks_has_two_rows_of_inputs(name):
    assert len(table(name, 3, "inputs")) == 2
    assert len(table(name, 3, "outputs")) == 51


@pytest.mark.parametrize("name", ["orbit and dock", "orbit"])
def test_in_an_orbit_there_is_a_row_of_inputs_for_each_communication_point(name):
    moved, shown = table(name, 3, "inputs"), table(name, 3, "outputs")
    assert sorted({*moved["time"].tolist()}) == shown["time"].tolist()
    positions, velocities = two_body(ORBIT["position"], ORBIT["velocity"], EARTH, moved["time"])
    for quantity, expected in (("position", positions), ("velocity", velocities)):
        found = np.column_stack([moved[f"gravity.{quantity}[{i}]"] for i in (1, 2, 3)])
        assert np.array_equal(found, expected)


def test_what_cannot_fly_in_its_field_has_no_reference_result():
    start = {"mu": EARTH, "position": ORBIT["position"], "velocity": [0.0, 0.0, 0.0]}
    falling = orbiting({"gravity": start, "experiment": None}, base=body())
    exact = orbiting({}, base=body(propagator="exact"))
    assert [reference_flight(equations(parse_scene(raw))) for raw in (falling, exact)] == [None, None]


def test_what_tells_of_a_steps_error_is_no_reference():
    assert table("error told", 3, "outputs").dtype.names == (
        "time",
        *(f"attitude[{i}]" for i in (1, 2, 3, 4)),
    )


MAIN_ROLES = (
    "document|requirement|specification|model|parameter|system|testcase|experiment|result|method|rationale|"
    "report|request|delivery|configuration|signature|serialized-state|meta-data|other"
)
"""Of the table of role values of FMI-LS-REF; only an experiment has the sub-roles below."""
ROLE = re.compile(f"({MAIN_ROLES})|experiment/(smoke-test|validation|uncertainty-analysis)")
NAME_SPACE = "{http://fmi-standard.org/fmi-ls-manifest}"


@FMI
def test_the_manifest_lists_what_is_there_with_roles_of_the_layered_standard(fmi):
    files = archive("closed at the start", fmi)
    root = etree.fromstring(files[f"{FOLDER}/fmi-ls-manifest.xml"])
    assert root.tag == "fmiReferences"
    assert root.get(f"{NAME_SPACE}fmi-ls-name") == "org.fmi-standard.fmi-ls-ref"
    assert root.get(f"{NAME_SPACE}fmi-ls-version") == "1.0.0-alpha.1"
    # A source is relative to the manifest.
    roles = {
        urljoin(f"http://fmu/{FOLDER}/fmi-ls-manifest.xml", one.get("source")).removeprefix(
            "http://fmu/"
        ): one.get("role")
        for one in root
    }
    assert all(ROLE.fullmatch(role) for role in roles.values())
    assert roles.keys() <= files.keys()
    assert roles == {
        "documentation/index.html": "document",
        "resources/scene.toml": "model",
        f"{FOLDER}/experiments.xml": "experiment/smoke-test",
        f"{FOLDER}/inputs.csv": "experiment/smoke-test",
        f"{FOLDER}/outputs.csv": "result",
    }


def test_evidence_is_listed_as_a_report_where_there_is_some():
    root = etree.fromstring(manifest(["resources/accuracy.json"])[f"{FOLDER}/fmi-ls-manifest.xml"])
    assert [(one.get("source"), one.get("role")) for one in root] == [
        ("../../resources/accuracy.json", "report")
    ]


@FMI
def test_the_scene_in_the_archive_is_the_one_that_was_built(fmi):
    raw = tomllib.loads(archive("moving port", fmi)["resources/scene.toml"].decode())
    assert parse_scene(raw) == scene(SCENES["moving port"])


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_a_scene_that_is_written_out_is_read_as_the_same(path, tmp_path):
    one = load_scene(path)
    (tmp_path / "again.toml").write_text(scene_text(one), encoding="utf-8")
    assert load_scene(tmp_path / "again.toml") == one


ODD = variant(
    CHAIN,
    {
        "author": 'Ä "quoted" \\ 漢',
        "rotation.attitude": [0.1, 0.7, -0.3, 1e-300],
        "rotation.angular_velocity": [1e-300, 1e22, -0.1],
        "experiment.inputs": {"B.mass": [[0.0, 500.0], [1.0, 0.1]]},
    },
)


@pytest.mark.parametrize("raw", [ODD, HUB, BERTH], ids=["odd", "hub", "berth"])
def test_numbers_and_texts_are_written_out_whole(raw):
    one = parse_scene(raw)
    assert parse_scene(tomllib.loads(scene_text(one))) == one


def test_an_attitude_that_was_normalised_is_read_as_it_is():
    """Else one in three of those drawn here would be another one in its last bit each time it is read."""
    drawn = np.random.default_rng(20261130).normal(size=(100, 4))
    for attitude in drawn:
        once = parse_scene(body(attitude=attitude.tolist())).rotation.attitude
        assert parse_scene(body(attitude=list(once))).rotation.attitude == once


def test_what_accuracy_has_chosen_is_not_written_out():
    asked = {"accuracy": {"attitude": 1e-6, "horizon": 10.0, "step": 0.1}}
    one = parse_scene(variant(body(), {"inputs": {}}) | asked)
    rotation = one.rotation.model_copy(update={"law": "none", "propagator": "rk4"})
    chosen = one.model_copy(update={"rotation": rotation})
    assert parse_scene(tomllib.loads(scene_text(chosen))) == one
