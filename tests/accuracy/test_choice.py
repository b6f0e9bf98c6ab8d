"""What `[accuracy]` chooses: by whom, with which evidence, the same each time, in the FMU and in the twin."""

import json
import shutil
import zipfile
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from accuracy.confirm import flown
from fmu_build import BuildError, build_fmu
from fmu_build.__main__ import main
from fmu_build.accuracy.flights import body_of
from fmu_build.accuracy.histories import course_up_to, histories
from fmu_build.flight.choices import BEST, Choice
from fmu_build.flight.experiment import course_of
from fmu_build.flight.flying import InputCourses, run_host
from fmu_build.flight.results import keep, read
from fmu_build.flight.workshop import build_all, source_of, workshop
from supervessel import AccuracyError, Twin, choose, parse_scene
from supervessel.equations import equations
from supervessel.orbit import two_body
from supervessel.scene.schema import without_accuracy
from support import ISS_DG, OK, Instance, variant
from support.marks import some_at_once
from support.orbits import EARTH, ORBIT, orbiting
from support.processes import kept_in

ACCURACY = {"attitude": 1e-4, "horizon": 20.0, "step": 0.5}
TORQUE = 2e4
DOCKED = variant(
    ISS_DG,
    {
        "name": "asked",
        "inputs": {
            "mass": ["DG"],
            "torque": True,
            "range": {"DG.mass": [11000.0, 24500.0], "torque": [-TORQUE, TORQUE]},
        },
        "rotation": {"angular_velocity": [0.02, 0.03, -0.01]},
        "outputs": {"names": ["angular_velocity", "attitude"]},
        "accuracy": ACCURACY,
    },
)
"""The ISS with a ship that burns fuel, and a torque that turns it by some degrees."""

SPIN = {
    "name": "spin",
    "root": "B",
    "vessels": {"B": {"mass": 1.0, "pmi": [1.0, 2.0, 2.0]}},
    "rotation": {"angular_velocity": [0.1, 0.0, 0.0]},
    "accuracy": {"attitude": 1e-6, "horizon": 10.0, "step": 0.1},
}
"""A steady spin about a principal axis: any law will do."""


def asked(raw, attitude):
    return parse_scene(variant(raw, {"accuracy.attitude": attitude}))


def test_the_cheapest_law_that_will_do_is_chosen():
    """Steady spin: no law is needed. Off axis, with moments that differ: Euler's equations."""
    assert choose(parse_scene(SPIN))[0].rotation.law == "none"
    tumble = variant(SPIN, {"vessels.B.pmi": [1.0, 1.6, 2.4], "rotation.angular_velocity": [0.1, 0.2, 0.05]})
    chosen, evidence = choose(parse_scene(tumble))
    assert chosen.rotation.law == "principal"
    enough = {one["law"]: one["enough"] for one in evidence["candidates"] if one["propagator"] == "taylor"}
    assert enough["none"] is enough["decoupled"] is False


@pytest.mark.accuracy
def test_more_accuracy_costs_more():
    found = [choose(asked(DOCKED, attitude))[1] for attitude in (0.1, 1e-5, 1e-9)]
    costs = [evidence["operations"] for evidence in found]
    assert costs == sorted(costs)
    assert costs[0] < costs[-1]
    for evidence, attitude in zip(found, (0.1, 1e-5, 1e-9), strict=True):
        assert evidence["margin"] * evidence["attitude"] <= attitude
        cheaper = [one for one in evidence["candidates"] if one["operations"] < evidence["operations"]]
        assert not any(one["enough"] for one in cheaper)
        assert all(one["operations"] >= evidence["operations"] for one in evidence["dearer"])


def test_the_evidence_is_in_the_fmu_and_the_fmu_is_the_same_each_time(tmp_path):
    scene = parse_scene(DOCKED)
    chosen, evidence = choose(scene)
    first, second = (build_fmu(s, tmp_path / f"{i}.fmu") for i, s in enumerate((scene, chosen)))
    assert first.read_bytes() == second.read_bytes()
    with zipfile.ZipFile(first) as archive:
        assert json.loads(archive.read("resources/accuracy.json")) == evidence
        page = ET.fromstring(archive.read("documentation/index.html").decode().partition("\n")[2])
    text = " ".join(page.itertext())
    rotation = chosen.rotation
    assert f"{rotation.law}, {rotation.propagator}" in text
    assert "Not covered" in text
    assert not {"ns", "us", "machine", "time", "seconds"} & evidence.keys()


def test_what_is_kept_and_what_is_found_anew_are_the_same(cache):
    kept = kept_in(cache) / "accuracy"
    found = choose(parse_scene(SPIN))
    assert list(kept.iterdir())
    shutil.rmtree(kept)
    assert choose(parse_scene(SPIN)) == found


def one_less(kept, name):
    return {key: kept[key] for key in kept if key != name}


def refused(kept):
    candidates = [one | {"enough": False} for one in kept["candidates"]]
    return kept | {"candidates": candidates}


WRONG = {
    "a list": lambda kept: [kept],
    "a number": lambda kept: 7,
    "no choice": lambda kept: one_less(kept, "choice"),
    "no candidates": lambda kept: kept | {"candidates": []},
    "a choice that was not tried": lambda kept: kept | {"choice": kept["choice"] | {"max_angle_step": 0.9}},
    "a choice that is not enough": refused,
    "no choice of a rotation": lambda kept: kept | {"choice": {"law": "any", "propagator": "rk4"}},
    "another scene's": lambda kept: kept | {"scene": "other"},
    "an answer to another wish": lambda kept: kept | {"asked": kept["asked"] | {"attitude": 0.1}},
    "a text for a number": lambda kept: kept | {"attitude": "1"},
    "numbers for names": lambda kept: kept | {"histories": [1, 2]},
    "no doubt": lambda kept: kept | {"doubt": {}},
    "another claim": lambda kept: kept | {"claim": "It is exact."},
}
"""What may be kept in the place of a choice, whole in itself."""


@pytest.mark.parametrize("wrong", some_at_once(WRONG, "a list", "a choice that is not enough"))
def test_what_is_no_choice_for_the_scene_is_found_anew(cache, wrong):
    scene = parse_scene(SPIN)
    found = choose(scene)
    places = [path for path in (kept_in(cache) / "accuracy").iterdir() if "candidates" in path.read_text()]
    [place] = [path for path in places if (read(path) or {}).get("scene") == "spin"]
    kept = read(place)
    keep(place, wrong(kept))
    assert choose(scene) == found
    assert read(place) == kept


NO_ERRORS = {
    "no attitude": {"attitude": []},
    "texts": {"attitude": ["1"]},
    "one number of sub-steps": {"sub_steps": 7},
    "a number for a reason": {"refused": 7},
    "more": {"more": 1},
}


@pytest.mark.parametrize("change", some_at_once(NO_ERRORS, "texts"))
def test_what_are_no_errors_of_flights_is_flown_anew(cache, change):
    """Attitudes, rates and sub-steps of each flight, or why there are none."""
    scene = parse_scene(SPIN)
    found = choose(scene)
    folder = kept_in(cache) / "accuracy"
    kept = {path: content for path in folder.iterdir() if "sub_steps" in (content := read(path))}
    assert kept
    for path in folder.iterdir():
        if path in kept:
            keep(path, kept[path] | change)
        else:
            path.unlink()
    assert choose(scene) == found


@pytest.mark.thorough
def test_the_twin_takes_the_same_choice(tmp_path):
    """One step under the scene's inputs: the twin's sub-step is the FMU's to the last bit."""
    scene = parse_scene(DOCKED)
    twin = Twin(scene)
    chosen = choose(scene)[0]
    assert twin.scene == chosen
    start = {"DG.mass": 24500.0, "torque[1]": 100.0, "torque[2]": -50.0, "torque[3]": 20.0}
    fmu = build_fmu(scene, tmp_path / "asked.fmu")
    end = flown(fmu, scene, [start])[0]
    assert chosen.rotation.propagator == "rk4"
    mine = twin.step(twin.x_start, [100.0, -50.0, 20.0], twin.p_start, ACCURACY["step"])
    assert np.array(mine).ravel().tolist() == end.tolist()


def test_what_needs_a_law_says_that_it_is_still_to_be_chosen():
    scene = parse_scene(DOCKED)
    with pytest.raises(ValueError, match=r'scene "asked" leaves its law to \[accuracy\]'):
        equations(scene)
    with pytest.raises(ValueError, match=r'scene "asked" has no \[accuracy\]'):
        choose(without_accuracy(scene))


def test_a_choice_that_was_changed_afterwards_is_refused(tmp_path):
    chosen, _ = choose(parse_scene(SPIN))
    changed = chosen.model_copy(
        update={"rotation": chosen.rotation.model_copy(update={"max_angle_step": 0.5})}
    )
    with pytest.raises(BuildError, match=r"spin: accuracy: \[rotation\] has been changed"):
        build_fmu(changed, tmp_path / "spin.fmu")


@pytest.mark.accuracy
def test_an_accuracy_that_no_double_gives_is_refused_with_the_best():
    """Two ways to the exact motion differ by some u = 1.1e-16; three digits more than that cannot be had."""
    scene = asked(
        variant(SPIN, {"rotation.angular_velocity": [0.1, 0.2, 0.05], "accuracy.step": 0.01}), 1e-15
    )
    message = r"accuracy\.attitude = 1e-15 rad: .* the best that can be had is"
    with pytest.raises(AccuracyError, match=message) as caught:
        choose(scene)
    best = float(str(caught.value).rpartition(" is ")[2].split()[0])
    assert 1e-15 < best < 1e-12
    choose(asked(variant(SPIN, {"rotation.angular_velocity": [0.1, 0.2, 0.05], "accuracy.step": 0.01}), best))


@pytest.mark.parametrize("name", some_at_once(["taylor", "dop853", "auto", "split"], "auto", "split"))
def test_libraries_for_trials_fly_the_same_to_the_last_bit(name):
    inputs = {"DG.mass": [[0, 24500], [20, 12000]], "torque[1]": [[0, 0], [10, 2e4]]}
    experiment = {"duration": 20.0, "step": 2.0, "inputs": inputs}
    scene = parse_scene(variant(DOCKED, {"accuracy": None, "experiment": experiment}))
    course = course_of(scene)
    columns = np.column_stack([course.numbers[name] for name in inputs])
    flown_with = InputCourses(np.arange(course.steps), columns, np.zeros((course.steps, 0)))
    choice = Choice(BEST, name, None, 1e-10)
    job = {"tolerance": 1e-10, "size": 2.0, "last_size": 2.0, "steps": course.steps, "seconds": 0.0}
    samples = []
    for trial in (True, False):
        with workshop(trial=trial) as shop:
            build_all(scene, [choice], shop, lambda _: None)
            courses = [flown_with.written(shop.folder / "inputs")]
            names, asked = (tuple(inputs), ()), job | {"sampled": course.sampled.tolist()}
            samples.append(run_host(shop.built[source_of(choice)], shop.folder, asked, names, courses))
    assert samples[0] == samples[1]
    if name == "split":
        assert samples[0][0][0]["sub_steps"] > 2 * course.steps  # divided, by powers of libm's


def ball(numbers, docks):
    """A sphere of 1e8 kg m2 under three torques."""
    return 1e8 * np.eye(3), 1e-8 * np.eye(3)


ORBITING = variant(
    orbiting({}, base=SPIN),
    {
        "inputs": {"gravity": True, "mass": ["B"], "range": {"B.mass": [0.5, 1.0]}},
        "rotation.angular_velocity": [0.0, 1e-3, 0.0],
        "accuracy": {"attitude": 1e-6, "horizon": 600.0, "step": 60.0},
    },
)
"""A body that turns with its orbit, roughly."""


def test_histories_go_along_the_orbit_and_leave_it_alone():
    scene = parse_scene(ORBITING)
    model = equations(without_accuracy(scene))
    every = histories(
        scene, scene.accuracy, lambda inputs: np.ones(len(inputs.rows), bool), body_of(scene, model)
    )
    assert every.numbers == ("B.mass",)
    times = every.course.size * np.arange(every.course.steps)
    motion = np.hstack(two_body(ORBIT["position"], ORBIT["velocity"], EARTH, times))
    assert np.array_equal(np.column_stack(list(every.course.field.values())), motion)


@pytest.mark.thorough
def test_the_gradient_counts_in_what_is_chosen():
    """By no law but the full one: nothing is proven about the gradient over ranges."""
    chosen, evidence = choose(parse_scene(ORBITING))
    assert chosen.rotation.law == "tensor"
    assert evidence["grade"]["name"] == "flown"
    assert "another orbit than that of [experiment.orbit]" in evidence["not_covered"]
    assert {one["propagator"] for one in evidence["candidates"]} <= {"taylor", "dop853", "rk4"}
    reasons = {one["law"]: one["refused"] for one in evidence["candidates"] if one["refused"]}
    assert reasons.keys() == {"none", "decoupled", "principal"}
    assert all("gravity's gradient along an orbit" in reason for reason in reasons.values())


def test_histories_stay_in_their_ranges_and_reach_both_ends():
    scene = parse_scene(DOCKED)
    every = histories(scene, scene.accuracy, lambda inputs: np.ones(len(inputs.rows), dtype=bool), ball)
    assert every.numbers == ("DG.mass", "torque[1]", "torque[2]", "torque[3]")
    values = np.concatenate([history.inputs.numbers for history in every.flown])
    low, high = np.array([11000.0, *3 * [-TORQUE]]), np.array([24500.0, *3 * [TORQUE]])
    assert (values.min(0) == low).all()
    assert (values.max(0) == high).all()
    for history in every.flown:
        assert history.inputs.rows[0] == 0
        assert (np.diff(history.inputs.rows) > 0).all()
        assert history.inputs.rows[-1] < every.course.steps == course_up_to(scene, scene.accuracy).steps == 40
    assert len({history.name for history in every.flown}) == len(every.flown) > 15


@pytest.mark.parametrize(("low", "high"), [(-TORQUE, 0.0), (0.0, TORQUE), (-TORQUE, 1.0)])
def test_what_acts_one_way_alone_spins_a_body_up_from_rest(low, high):
    """A sphere at rest: nothing but the larger end, which the rate then goes along with."""
    changes = {"inputs.range": {"DG.mass": [11000.0, 24500.0], "torque": [low, high]}}
    raw = variant(DOCKED, changes | {"rotation.angular_velocity": [0.0, 0.0, 0.0]})
    scene = parse_scene(raw)
    every = histories(scene, scene.accuracy, lambda inputs: np.ones(len(inputs.rows), dtype=bool), ball)
    [spun] = [history for history in every.flown if history.name == "spun up 1"]
    assert (spun.inputs.numbers[:, 1:] == max(low, high, key=abs)).all()


def test_what_acts_pushes_against_the_rate_if_it_is_stronger_there():
    changes = {"inputs.range": {"DG.mass": [11000.0, 24500.0], "torque": [-TORQUE, 1.0]}}
    scene = parse_scene(variant(DOCKED, changes | {"rotation.angular_velocity": [1e-9, 1e-9, 1e-9]}))
    every = histories(scene, scene.accuracy, lambda inputs: np.ones(len(inputs.rows), dtype=bool), ball)
    [pushed] = [history for history in every.flown if history.name == "pushed, then spun up 1"]
    assert (pushed.inputs.numbers[:, 1:] == -TORQUE).all()


def test_rows_that_no_fmu_starts_with_are_left_out_and_counted():
    scene = parse_scene(DOCKED)
    every = histories(scene, scene.accuracy, lambda inputs: inputs.numbers[:, 1] <= 0.0, ball)
    assert every.senseless > every.drawn / 4
    for history in every.flown:
        if not history.name.startswith(("spun", "pushed", "corner 1, to and fro", "corner 2, to and fro")):
            assert (history.inputs.numbers[:, 1] <= 0.0).all()


@pytest.mark.accuracy
def test_moments_that_no_body_has_are_left_out():
    """pmi = [1, 1, k], k from 0 to 3: above 2 no body has them, half of a third of what is drawn."""
    raw = variant(
        SPIN, {"inputs": {"pmi": ["B"], "range": {"B.pmi": [1.0, 3.0]}}, "vessels.B.pmi": [1, 1, 1]}
    )
    _, evidence = choose(parse_scene(raw))
    assert 0.1 < evidence["rows_senseless"] / evidence["rows_drawn"] < 0.6
    assert "B.pmi low" not in evidence["histories"]  # the scene's own values
    assert "all high" in evidence["histories"]


@pytest.mark.thorough
def test_the_command_says_in_a_line_what_it_has_chosen(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = 'name = "spin"\nroot = "B"\n[vessels.B]\nmass = 1.0\npmi = [1.0, 2.0, 2.0]\n[rotation]\n'
    text += "angular_velocity = [0.1, 0.0, 0.0]\n[accuracy]\nattitude = {}\nhorizon = 10.0\nstep = 0.1\n"
    (tmp_path / "spin.toml").write_text(text.format(1e-6))
    assert main(["spin.toml"]) == 0
    out, error = capsys.readouterr()
    assert out.splitlines()[0].startswith(
        'law = "none", propagator = "rk4", max_angle_step = 0.011: proven within '
    )
    assert (out.splitlines()[1:], error) == (["spin.fmu"], "")
    (tmp_path / "spin.toml").write_text(
        text.format(1e-15).replace("0.1, 0.0", "0.1, 0.2").replace("= 0.1", "= 0.01")
    )
    (tmp_path / "spin.fmu").unlink()
    assert main(["spin.toml"]) == 1
    out, error = capsys.readouterr()
    assert (out, error[:46]) == ("", "spin.toml: accuracy.attitude = 1e-15 rad: two ")
    assert [path.name for path in tmp_path.iterdir()] == ["spin.toml"]


def test_what_is_not_proven_is_watched_unless_the_scene_says_otherwise(tmp_path):
    """The output decides nothing: the same choice, with it or without; and a proven one has none."""
    demanding = variant(DOCKED, {"accuracy.attitude": 1e-9})
    chosen, evidence = choose(parse_scene(demanding))
    assert evidence["grade"]["name"] != "proven"
    assert (chosen.outputs.names[-1], evidence["watched"]) == ("error_bound", True)
    assert choose(chosen) == (chosen, evidence)
    unwatched, other = choose(parse_scene(variant(demanding, {"accuracy.error_bound": False})))
    assert (unwatched.outputs.names, other) == (
        ("angular_velocity", "attitude"),
        evidence | {"watched": False},
    )
    assert unwatched.rotation == chosen.rotation
    spinning, proven = choose(parse_scene(SPIN))
    assert (proven["grade"]["name"], proven["watched"]) == ("proven", False)
    assert "error_bound" not in spinning.outputs.names


@pytest.mark.accuracy
def test_what_is_watched_already_is_so_once():
    demanding = variant(DOCKED, {"accuracy.attitude": 1e-9})
    listed = parse_scene(
        variant(demanding, {"outputs.names": ["error_bound", "attitude", "angular_velocity"]})
    )
    chosen, _ = choose(listed)
    assert chosen.outputs.names == listed.outputs.names
    assert chosen.rotation == choose(parse_scene(demanding))[0].rotation


@pytest.mark.accuracy
def test_what_the_true_motion_keeps_counts_for_the_bound_of_a_law_that_keeps_the_rate():
    """A mass that grows by 1e-7 of itself: as the momentum stays, a spin of 0.1 rad/s slows by 1e-8 rad/s."""
    changes = {
        "inputs": {"mass": ["B"], "range": {"B.mass": [1.0, 1.0000001]}},
        "rotation.mass_change": "momentum",
        "outputs": {"names": ["attitude", "angular_velocity", "error_bound"]},
    }
    chosen, evidence = choose(parse_scene(variant(SPIN, changes)))
    assert (chosen.rotation.law, evidence["grade"]["name"]) == ("none", "proven")
    instance = Instance(
        chosen.model_dump(mode="json", exclude_none=True, exclude={"accuracy"}), optimised=False
    )
    assert instance.initialise() == OK
    assert instance.set({"B.mass": 1.0000001}) == OK
    assert instance.step(0.1) == OK
    off, bound = 0.1 * (0.1 - 0.1 / 1.0000001), instance.get("error_bound")
    instance.free()
    assert off <= bound <= 1.01 * off
