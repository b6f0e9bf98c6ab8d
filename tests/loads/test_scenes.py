"""Outputs of docks and points that are refused, by name, and what is said of those that are there."""

from typing import Any

import pytest

from fmu_build.flight.choices import laws_of
from loads.scenes import NEAR
from supervessel.composite.resolved import resolve
from supervessel.equations import equations
from supervessel.scene.outputs import VESSEL_OUTPUTS
from support import ISS_DG, scene, variant
from support.pages import text
from support.refusals import problems

NAMED = variant(
    ISS_DG,
    {
        "docks": [{"ports": ["ISS.P2", "DG.nose"], "name": "berth"}],
        "vessels.DG.points": {"imu": {"position": [0.0, 1.0, 2.0]}},
    },
)
MOVING = "accelerations are not known where inputs.motion lists ports; leave one of the two out"
VESSEL = ", ".join(VESSEL_OUTPUTS)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        (
            {"docks": [{"ports": ["ISS.P2", "DG.nose"]}], "outputs.names": ["berth.force"]},
            'outputs.names: unknown dock "berth"; there is none to name here; a dock shows its load by its '
            "name",
        ),
        (
            {"outputs.names": ["birth.moment"]},
            'outputs.names: unknown dock "birth" (did you mean "berth"?); a dock shows its load by its name',
        ),
        (
            {"outputs.names": ["berth.forse"]},
            'outputs.names: unknown output of berth "forse" (did you mean "force"?)',
        ),
        (
            {"outputs.names": ["DG.force"]},
            f'outputs.names: unknown output of DG "force"; known: {VESSEL}',
        ),
        (
            {"outputs.names": ["DG.imo.position"]},
            'outputs.names: unknown point of DG "imo" (did you mean "imu"?)',
        ),
        (
            {"outputs.names": ["DG.imu.place"]},
            'outputs.names: unknown output of DG.imu "place"; known: position, velocity, acceleration, '
            "specific_force",
        ),
        (
            {"inputs.motion": ["DG.nose"], "outputs.names": ["berth.force"]},
            f"outputs.names: berth.force: {MOVING}",
        ),
        (
            {"inputs.motion": ["DG.nose"], "outputs.names": ["DG.imu.velocity", "DG.imu.specific_force"]},
            f"outputs.names: DG.imu.specific_force: {MOVING}",
        ),
        (
            {
                "rotation.law": "none",
                "inputs.gravity": True,
                "gravity": NEAR | {"position": [8e3, 0.0, 0.0]},
                "outputs.names": ["berth.moment", "DG.imu.position"],
            },
            'outputs.names: berth.moment: rotation.law = "none" with inputs.gravity does not follow the '
            'place in the field; take another law, "decoupled" costs hardly more',
        ),
    ],
)
def test_a_scene_that_cannot_have_such_an_output_is_refused(changes: dict[str, Any], expected: str):
    assert problems(variant(NAMED, changes)) == [expected]


def test_what_the_outputs_of_a_dock_and_a_point_are_is_said_of_each():
    names = ["berth.force", "berth.moment", "DG.imu.specific_force"]
    found = {
        v.name: (v.unit, v.description)
        for v in resolve(scene(variant(NAMED, {"outputs.names": names}))).outputs
    }
    assert found["berth.force[1]"] == ("N", "force on DG.nose from ISS.P2, axes of ISS, x")
    assert found["berth.moment[2]"] == ("N.m", "moment on DG.nose from ISS.P2 about the port, axes of ISS, y")
    assert found["DG.imu.specific_force[3]"] == (
        "m/s2",
        "acceleration of DG.imu less that of gravity there, as an accelerometer reads it, body axes, z",
    )


def test_a_trade_leaves_out_the_law_that_cannot_show_the_loads_of_an_orbit():
    orbit = {"gravity": NEAR | {"position": [8e3, 0.0, 0.0]}, "inputs.gravity": True}
    assert "none" in laws_of(scene(variant(NAMED, orbit)))
    assert "none" not in laws_of(scene(variant(NAMED, orbit | {"outputs.names": ["berth.force"]})))


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (["berth.force", "berth.moment"], "takes {} operations"),
        (["DG.imu.specific_force"], "force {} and {} ("),
    ],
)
def test_the_page_says_how_many_operations_they_take(names, said):
    raw = variant(NAMED, {"inputs.pose": [], "inputs.pmi": [], "outputs.names": ["attitude"]})
    plain, with_them = (
        equations(scene(variant(raw, {"outputs.names": shown})))
        for shown in (["attitude"], ["attitude", *names])
    )
    costs = [
        getattr(with_them, name).n_instructions() - getattr(plain, name).n_instructions()
        for name in ("outputs", "composite")
    ]
    page = " ".join(text("model/docs/equations.md").split())
    assert said.format(*costs) in page
    assert f"{costs[1]} when the mass changes" in page or said.count("{}") == 2
