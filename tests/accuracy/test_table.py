"""The table `[accuracy]`: what is read, and what is refused, by place and value."""

import json
import sys

import pytest

from fmu_build.flight.choices import Choice, Model, variant_of
from supervessel import SceneError, parse_scene
from supervessel.scene.schema import without_accuracy
from support import BALL, ISS_DG, variant
from support.processes import interrupted, needs_posix, run
from support.scenes import ACCURACY_ASKED
from support.signals import KEPT

ACCURACY = {"attitude": 1e-4, "rate": 1e-6, "horizon": 600.0, "step": 0.1}
SCENE = variant(
    ISS_DG,
    {
        "inputs": {
            "mass": ["DG"],
            "torque": True,
            "range": {"DG.mass": [11000.0, 24500.0], "torque": [-10.0, 10.0]},
        },
        "rotation": {"angular_velocity": [0.0, 0.0011, 0.0]},
        "accuracy": ACCURACY,
    },
)


def problems(changes):
    with pytest.raises(SceneError) as caught:
        parse_scene(variant(SCENE, changes))
    return list(caught.value.problems)


def test_the_table_is_read_and_leaves_the_law_open():
    scene = parse_scene(SCENE)
    assert scene.accuracy.model_dump() == ACCURACY | {"error_bound": True}
    assert not scene.is_chosen
    assert parse_scene(variant(SCENE, {"accuracy.rate": None})).accuracy.rate is None
    kept = {"rotation": {"mass_change": "momentum", "attitude": [1, 1, 0, 0]}}
    assert not parse_scene(variant(SCENE, kept)).is_chosen
    assert parse_scene(variant(SCENE, {"accuracy": None})).is_chosen


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        (
            {"accuracy.attitude": 1e-16},
            "accuracy.attitude = 1e-16 rad: must be a number from 1e-15, what doubles tell, to 1",
        ),
        (
            {"accuracy.attitude": 2.0},
            "accuracy.attitude = 2.0 rad: must be a number from 1e-15, what doubles tell, to 1",
        ),
        ({"accuracy.error_bound": 1}, "accuracy.error_bound = 1: must be true or false"),
        ({"accuracy.rate": 0.0}, "accuracy.rate = 0.0 rad/s: must be a finite number > 0"),
        (
            {"accuracy.rate": 1e-20},
            "accuracy.rate = 1e-20 rad/s: must be at least 1.22e-19 rad/s, what doubles tell of this "
            "angular_velocity",
        ),
        ({"accuracy.horizon": 0.0}, "accuracy.horizon = 0.0 s: must be a finite number > 0"),
        ({"accuracy.step": -1.0}, "accuracy.step = -1.0 s: must be a finite number > 0"),
        ({"accuracy.step": 601.0}, "accuracy.step = 601.0 s: must not exceed horizon = 600.0 s"),
        (
            {"accuracy.step": 1e-4},
            "accuracy.horizon = 600.0 s: in steps of 0.0001 s that are 6e+06 steps; at most 1000000",
        ),
        ({"accuracy.horizon": None}, "accuracy.horizon: missing"),
        ({"accuracy.atitude": 1.0}, 'accuracy: unknown key "atitude" (did you mean "attitude"?)'),
        ({"accuracy": 1e-4}, "accuracy = 0.0001: must be a table"),
        (
            {"rotation.law": "tensor"},
            "rotation.law: given beside [accuracy], which chooses it; leave it out",
        ),
        (
            {"rotation.tolerance": 1e-9},
            "rotation.tolerance: given beside [accuracy], which chooses it; leave it out",
        ),
        (
            {"inputs.range": {"DG.mass": [11000.0, 24500.0]}},
            'inputs.range: missing for "torque": [accuracy] needs one for every input that is a number',
        ),
        (
            {"inputs.range": {"torque[2]": [0.0, 1.0]}, "inputs.pose": ["DG.nose"]},
            'inputs.range: missing for "DG.mass", "DG.nose.position", "DG.nose.direction", '
            '"DG.nose.alignment", "torque[1]", "torque[3]": [accuracy] needs one for every input that is a '
            "number",
        ),
    ],
)
def test_a_table_that_leaves_nothing_to_choose_is_refused(changes, problem):
    assert problems(changes) == [problem]


def test_all_that_is_wrong_is_said_at_once():
    found = problems({"rotation.law": "tensor", "rotation.propagator": "rk4", "accuracy.step": 0.0})
    assert [text.partition(":")[0].partition(" =")[0] for text in found] == [
        "accuracy.step",
        "rotation.law",
        "rotation.propagator",
    ]


def test_docks_need_no_range():
    docks = [{"name": "berth", "ports": ["ISS.P2", "DG.nose"]}]
    still = {f"berth.{key}": [0.0, 0.0] for key in ("velocity", "rate")}
    inputs = {"docked": ["berth"], "range": still}
    assert not parse_scene(variant(SCENE, {"docks": docks, "inputs": inputs})).is_chosen


def command(limit=""):
    build = f"{sys.executable} -m fmu_build ball.toml"
    return ["sh", "-c", f"{limit}exec {build}"]


@needs_posix
@pytest.mark.thorough
def test_an_interrupt_keeps_whole_results_and_leaves_no_fmu(tmp_path, cache):
    (tmp_path / "ball.toml").write_text(BALL + ACCURACY_ASKED)
    done, kept = interrupted(command(), tmp_path, cache, "accuracy")
    assert (done.returncode, done.stdout, done.stderr) == (130, "", f"{KEPT}\n")
    assert [path.name for path in tmp_path.iterdir()] == ["ball.toml"]
    assert kept
    assert all(json.loads(content).get("refused") is None for content in kept.values())
    done = run(command(), tmp_path, cache)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines()[1] == "ball.fmu"
    assert {path: path.read_bytes() for path in kept} == kept


@needs_posix
def test_a_full_disk_is_said_and_leaves_nothing_half_written(tmp_path, cache):
    """The room suffices for no history of inputs."""
    (tmp_path / "ball.toml").write_text(BALL + ACCURACY_ASKED.replace("horizon = 5.0", "horizon = 5.1"))
    done = run(command("ulimit -f 1; "), tmp_path, cache)
    assert (done.returncode, done.stdout) == (1, "")
    assert "Traceback" not in done.stderr
    assert done.stderr.strip()
    assert [path.name for path in tmp_path.iterdir()] == ["ball.toml"]


def test_a_trade_takes_the_scene_without_what_it_asks():
    scene = parse_scene(SCENE)
    made = variant_of(scene, Choice(Model("principal"), "rk4", 0.1))
    assert made.accuracy is None
    assert (made.rotation.law, made.rotation.propagator, made.rotation.max_angle_step) == (
        "principal",
        "rk4",
        0.1,
    )
    assert without_accuracy(scene).is_chosen
