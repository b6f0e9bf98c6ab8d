"""The native host flies as an importer does: set, step, get, to the last bit."""

import sys
from dataclasses import asdict

import numpy as np
import pytest

from fmu_build.compile.compiler import compile_library
from fmu_build.flight.choices import BEST, Choice, Model, models, reference_choices, variant_of
from fmu_build.flight.experiment import course_of
from fmu_build.flight.flying import fly_all
from fmu_build.flight.results import keep, place_of, read
from fmu_build.flight.workshop import HERE, HOST_FLAGS, workshop
from fmu_build.platforms import host_platform
from supervessel import parse_scene
from support import ISS_DG, OK, Instance, variant
from support.orbits import orbiting

COURSES = {
    "berth.docked": [[0, True], [3, False], [6, True]],
    "berth.rate[2]": [[0, 0.01]],
    "DG.mass": [[0, 24000], [8, 12000]],
    "torque[1]": [[0, 0], [2, 3e4], [2, -1e4]],
    "torque[3]": [[5, 2e4]],
}

DOCKING = variant(
    ISS_DG,
    {
        "name": "watched",
        "docks": [{"name": "berth", "ports": ["ISS.P2", "DG.nose"]}],
        "inputs": {"mass": ["DG"], "docked": ["berth"], "torque": True},
        "rotation": {"propagator": "dop853", "angular_velocity": [0.01, 0.02, -0.03]},
        "experiment": {"duration": 9.5, "step": 1.0, "inputs": COURSES},
    },
)
"""A ship that burns fuel, leaves and comes back while torque acts; the last step is half as long."""


ORBITING = orbiting(
    {
        "name": "orbiting",
        "inputs.pose": [],
        "inputs.pmi": [],
        "rotation": {"propagator": "dop853", "angular_velocity": [0.0, 0.0, 0.0]},
        "experiment.duration": 95.0,
        "experiment.step": 10.0,
        "experiment.inputs": {"DG.mass": [[0, 24000], [80, 12000]]},
    }
)
"""A ship that burns fuel in its orbit; nothing else turns it."""


@pytest.mark.parametrize("raw", [DOCKING, ORBITING], ids=["docking", "orbiting"])
def test_the_host_flies_what_an_importer_flies(shop, raw):
    scene = parse_scene(raw)
    choice = Choice(BEST, "dop853", None, 1e-7)
    flown = fly_all(scene, [choice], shop)[choice]
    course = course_of(scene)
    instance = Instance(variant(raw, {"rotation.tolerance": 1e-7}))
    try:
        for i in range(course.steps):
            held = {name: float(v[i]) for name, v in (course.numbers | course.field).items()}
            held |= {name: bool(v[i]) for name, v in course.booleans.items()}
            if i == 0:
                instance.enter()
            assert instance.set(held) == OK, instance.log
            if i == 0:
                assert instance.exit() == OK, instance.log
            assert instance.step(course.size if i + 1 < course.steps else course.last_size) == OK, (
                instance.log
            )
            shown = [*instance.get("attitude"), *instance.get("angular_velocity")]
            assert shown == flown.samples[i].tolist(), i
    finally:
        instance.free()
    assert np.abs(np.diff(flown.samples[:, 4:], axis=0)).max() > 1e-6  # it did turn
    if "docked" in raw["inputs"]:
        assert course.booleans["berth.docked"].tolist() == [1, 1, 1, 0, 0, 0, 1, 1, 1, 1]


def test_a_library_without_gravity_is_flown_without_the_orbit():
    raw = variant(ORBITING, {"rotation.angular_velocity": [0.0, 0.001, 0.0]})
    alone = variant(raw, {"gravity": None, "inputs.gravity": False, "experiment.orbit": None})
    without, own = (Choice(model, "dop853", None, 1e-9) for model in (Model("tensor", "gravity"), BEST))
    with workshop(trial=True) as shop, workshop(trial=True) as other:
        flown = fly_all(parse_scene(raw), [without, own], shop)
        samples = flown[without].samples
        assert np.array_equal(samples, fly_all(parse_scene(alone), [own], other)[own].samples)
    assert not np.array_equal(samples, flown[own].samples)


def test_sub_steps_are_counted(shop):
    """rk4 divides a step of 1 s at 1 rad/s, about a principal axis, into 20 sub-steps of at most 0.05 rad.

    The bound of the rate exceeds the rate by up to exp(0.05/(3 sqrt 3)) - 1 = 1 %: 21 are taken.
    """
    ball = {
        "name": "ball",
        "root": "B",
        "vessels": {"B": {"mass": 1.0, "pmi": [1.0, 2.0, 2.5]}},
        "rotation": {"angular_velocity": [0.0, 0.0, 1.0]},
        "experiment": {"duration": 3.0, "step": 1.0},
    }
    choice = Choice(BEST, "rk4", 0.05)
    flown = fly_all(parse_scene(ball), [choice], shop)[choice]
    assert flown.sub_steps == 3 * 21
    assert flown.samples[-1, :4] == pytest.approx([np.cos(1.5), 0.0, 0.0, np.sin(1.5)], abs=1e-6)


def test_every_model_of_a_scene_with_moving_parts_is_a_scene():
    """Laws and propagators that know no moving parts are not tried."""
    raw = variant(
        ISS_DG,
        {
            "inputs": {"pose": ["DG.nose"], "motion": ["DG.nose"], "mass": ["DG"]},
            "experiment": {
                "duration": 2.0,
                "step": 1.0,
                "inputs": {"DG.nose.velocity[1]": [[0, 0], [1, 0.1]], "DG.mass": [[0, 24500], [2, 24000]]},
            },
        },
    )
    scene = parse_scene(raw)
    tried = models(scene, quick=False)
    assert Model("none") not in tried
    assert {m.frozen for m in tried} == {"", "mass", "pose"}
    for model in tried:
        for choice in reference_choices(scene, model):
            assert choice.propagator == "dop853"
            variant_of(scene, choice)


@pytest.mark.parametrize("content", ["{}", "[]", "7", "null", '{"refused": null}', '{"kept": {}}', '{"sha'])
def test_what_was_not_kept_whole_is_not_read(tmp_path, content):
    place = tmp_path / "kept.json"
    place.write_text(content)
    assert read(place) is None


def test_what_was_kept_is_read_to_the_last_bit_unless_it_is_changed(tmp_path):
    place, found = tmp_path / "kept.json", {"refused": None, "samples": [0.1 + 0.2, 5e-324, float("inf")]}
    assert read(place) is None
    keep(place, found)
    assert read(place) == found
    place.write_text(place.read_text().replace("5e-324", "1e-323"))
    assert read(place) is None


BALL = {
    "name": "ball",
    "root": "B",
    "vessels": {"B": {"mass": 1.0, "pmi": [1.0, 2.0, 2.5]}},
    "rotation": {"angular_velocity": [0.0, 0.0, 1.0]},
    "experiment": {"duration": 3.0, "step": 1.0},
}

WRONG = {
    "a list": lambda kept: [kept],
    "a part less": lambda kept: {name: kept[name] for name in kept if name != "ratio"},
    "a part more": lambda kept: kept | {"more": 1},
    "a row less": lambda kept: kept | {"samples": kept["samples"][1:]},
    "no rows": lambda kept: kept | {"samples": []},
    "short rows": lambda kept: kept | {"samples": [row[1:] for row in kept["samples"]]},
    "rows of another shape": lambda kept: kept | {"samples": [kept["samples"][0] * 3]},
    "texts for numbers": lambda kept: kept | {"samples": [[str(x) for x in row] for row in kept["samples"]]},
    "true for a number": lambda kept: kept | {"sub_steps": True},
    "a text for a time": lambda kept: kept | {"nanoseconds": "1.0"},
    "a refusal that is none": lambda kept: kept | {"refused": 7},
    "a refusal with samples": lambda kept: kept | {"refused": "no"},
}
"""What may be kept in the place of a flight, whole in itself."""


def test_what_is_no_flight_is_flown_anew(shop):
    scene, choice = parse_scene(BALL), Choice(BEST, "rk4", 0.05)
    flown = fly_all(scene, [choice], shop)[choice]
    place = place_of("trade", scene, asdict(choice))
    kept = read(place)
    for name, wrong in WRONG.items():
        keep(place, wrong(kept))
        again = fly_all(scene, [choice], shop)[choice]
        assert again.samples.tolist() == flown.samples.tolist(), name
        assert again.sub_steps == flown.sub_steps, name
        assert read(place).keys() == kept.keys(), name


@pytest.mark.skipif(sys.platform != "linux", reason="an environment is read in /proc")
def test_the_host_has_no_variables_but_where_its_libraries_are(shop, monkeypatch, tmp_path):
    """What a flight gives depends on nothing else."""
    monkeypatch.setenv("LD_PRELOAD", str(tmp_path / "none.so"))
    monkeypatch.setenv("LD_LIBRARY_PATH", str(tmp_path))
    scene, choice = parse_scene(BALL), Choice(BEST, "rk4", 0.06)
    heard = tmp_path / "heard"
    python = tmp_path / "python"
    python.write_text(f'#!/bin/sh\ncat /proc/$$/environ > {heard}\nexec {sys.executable} "$@"\n')
    python.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(python))
    assert fly_all(scene, [choice], shop)[choice].refused is None
    variables = [line for line in heard.read_text().split("\0") if line]
    assert variables == [f"LD_LIBRARY_PATH={tmp_path}"]


def test_the_host_compiles_without_warnings(tmp_path):
    strict = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Wstrict-prototypes", "-Werror")
    platform = host_platform()
    compile_library([HERE / "host.c"], platform, tmp_path / f"host{platform.suffix}", (*HOST_FLAGS, *strict))
