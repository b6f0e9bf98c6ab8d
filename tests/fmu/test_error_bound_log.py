"""What an FMU says of its `error_bound`: once, that it has passed what [accuracy] asks; and nothing of it
where a scene does not show it."""

import locale
import re
from typing import Any

import pytest

from fmu.bounds import showing
from fmu.saved_states import bytes_of, restore
from fmu_build.generate.model import generate
from fmu_build.generate.sources import source_files
from support import OK, Instance, body, scene, unpacked, variant
from support.locales import german
from support.marks import FMI, KIND

ASKED = {"attitude": 2e-3, "rate": 1e3, "horizon": 10.0, "step": 0.1}
RATE = [0.11, 0.07, 0.05]
ASKING = variant(
    showing(body(1000.0, (1.0, 1.5, 2.0)), law="decoupled", angular_velocity=RATE), {"accuracy": ASKED}
)
"""Flown by a law that [accuracy] would not have chosen: the bound soon passes what is asked."""
OF_RATE = variant(ASKING, {"accuracy.attitude": 1.0, "accuracy.rate": 3e-3})
STEP = 0.25
CATEGORY = "logAccuracy"
NUMBER = r"(\d[\d.e+-]*)"
MESSAGE = re.compile(
    rf"\S+DoStep: at {NUMBER} s error_bound = {NUMBER} rad passes attitude = {NUMBER} rad, "
    r"which \[accuracy\] asks for"
)
MESSAGE_OF_RATE = re.compile(
    rf"\S+DoStep: at {NUMBER} s the rate's error, up to {NUMBER} rad/s, passes rate = {NUMBER} rad/s, "
    r"which \[accuracy\] asks for"
)


def told(instance: Instance) -> list[tuple[int, str]]:
    return [(status, message) for status, category, message in instance.log if category == CATEGORY]


def flown(raw: dict[str, Any], fmi: int, steps: int = 12, **named: Any) -> Instance:
    instance = Instance(raw, fmi, optimised=False, **named)
    assert instance.initialise() == OK, instance.log
    for _ in range(steps):
        assert instance.step(STEP) == OK
    return instance


@FMI
def test_it_is_told_once_with_the_numbers_of_the_first_step_beyond(fmi):
    instance = Instance(ASKING, fmi, optimised=False)
    assert instance.initialise() == OK
    first = None
    for _ in range(12):
        assert told(instance) == [] or first is not None
        assert instance.step(STEP) == OK
        if first is None and instance.get("error_bound") > ASKED["attitude"]:
            first = instance.time, instance.get("error_bound")
    [(status, message)] = told(instance)
    assert first is not None
    assert first[0] > STEP  # else it would be told of every flight
    assert status == OK  # no more than what the call answers (FMI 3.0: 2.3.1)
    found = MESSAGE.fullmatch(message)
    assert found, message
    assert [float(number) for number in found.groups()] == [
        pytest.approx(first[0], rel=1e-9),
        pytest.approx(first[1], rel=5e-3),
        ASKED["attitude"],
    ]
    instance.free()


@FMI
def test_of_the_rate_likewise(fmi):
    instance = flown(OF_RATE, fmi)
    [(status, message)] = told(instance)
    assert status == OK  # no more than what the call answers (FMI 3.0: 2.3.1)
    found = MESSAGE_OF_RATE.fullmatch(message)
    assert found, message
    time, bound, asked = (float(number) for number in found.groups())
    assert STEP < time <= instance.time
    assert asked == 3e-3 < bound
    instance.free()


@FMI
def test_no_rate_is_asked_for_where_the_scene_has_none(fmi):
    instance = flown(variant(OF_RATE, {"accuracy.rate": None}), fmi)
    assert told(instance) == []
    instance.free()


@FMI
@pytest.mark.parametrize(
    ("categories", "times"), [([], 1), (["logAll"], 1), ([CATEGORY], 1), (["logComposite"], 0)]
)
def test_only_with_its_category_on(fmi, categories, times):
    instance = Instance(ASKING, fmi, logging=False, optimised=False)
    assert instance._status(instance.fmu.setDebugLogging, True, categories) == OK
    assert instance.initialise() == OK
    for _ in range(12):
        assert instance.step(STEP) == OK
    assert len(told(instance)) == times
    instance.free()


@FMI
def test_again_after_a_reset_but_not_after_a_state_is_restored(fmi):
    instance = Instance(ASKING, fmi, optimised=False)
    assert instance.initialise() == OK
    content = bytes_of(instance)
    for _ in range(12):
        assert instance.step(STEP) == OK
    assert len(told(instance)) == 1
    assert restore(instance, content) == OK
    instance.time = 0.0
    for _ in range(12):
        assert instance.step(STEP) == OK
    assert len(told(instance)) == 1
    assert instance.reset() == OK
    assert instance.initialise() == OK
    for _ in range(12):
        assert instance.step(STEP) == OK
    assert len(told(instance)) == 2
    instance.free()


@FMI
def test_a_mass_point_of_which_nothing_is_known_is_told_of_too(fmi):
    raw = variant(ASKING, {"rotation.law": "none", "vessels.B.pmi": [0.0, 0.0, 0.0]})
    instance = flown(raw, fmi, 1)
    [(_, message)] = told(instance)
    assert "error_bound = 3.14 rad" in message
    instance.free()


@FMI
def test_model_exchange_tells_nothing(fmi):
    instance = Instance(ASKING, fmi, exchange=True, optimised=False)
    assert instance.initialise() == OK
    assert instance.run() == OK
    assert told(instance) == []
    instance.free()


def test_its_numbers_have_points_where_the_host_has_commas(tmp_path, monkeypatch):
    for name, value in german(tmp_path).items():
        monkeypatch.setenv(name, value)
    before = locale.setlocale(locale.LC_NUMERIC)
    try:
        locale.setlocale(locale.LC_NUMERIC, "de_DE.UTF-8")
        assert locale.localeconv()["decimal_point"] == ","
        instance = flown(ASKING, 3)
    finally:
        locale.setlocale(locale.LC_NUMERIC, before)
    [(_, message)] = told(instance)
    assert MESSAGE.fullmatch(message), message
    assert "attitude = 0.002 rad" in message
    instance.free()


# What is declared, and what is packed.

SHOWN, SILENT = variant(ASKING, {"accuracy": None}), variant(ASKING, {"outputs.names": ["attitude"]})


@FMI
@pytest.mark.parametrize(("raw", "declared"), [(ASKING, True), (SHOWN, False), (SILENT, False)])
def test_the_category_is_declared_where_the_scene_has_both(fmi, raw, declared):
    description = generate(scene(raw), fmi)[1].decode()
    assert (f'<Category name="{CATEGORY}"' in description) == declared


@FMI
def test_a_category_that_is_not_declared_is_refused(fmi):
    instance = Instance(SHOWN, fmi, optimised=False)
    assert instance._status(instance.fmu.setDebugLogging, True, [CATEGORY]) != OK
    instance.free()


@FMI
@KIND
def test_its_error_is_named_where_it_is_shown(fmi, exchange):
    instance = Instance(SHOWN, fmi, exchange=exchange, optimised=False)
    [variable] = [v for v in instance.description.modelVariables if v.name == "error_bound"]
    assert (variable.causality, variable.declaredType.unit) == ("output", "rad")
    instance.free()


@FMI
def test_nothing_of_it_is_packed_where_it_is_not_shown(fmi):
    """By the names of files and functions: in the others' binaries there is nothing to call."""
    packed = source_files(generate(scene(SILENT), fmi)[0], fmi, "body")
    files = {path.rpartition("/")[2]: text for path, text in packed.items()}
    assert "error_bound.c" not in files
    assert b"#define ERROR_BOUND 0" in files["scene.h"] or b"ERROR_BOUND = 0" in files["scene.h"]
    generated = b"".join(
        text for name, text in files.items() if name.startswith("model") and name != "model.h"
    )
    assert b"bound_" not in generated
    shown = source_files(generate(scene(SHOWN), fmi)[0], fmi, "body")
    assert any(path.endswith("/error_bound.c") for path in shown)


def test_nothing_of_it_is_in_the_binary_where_it_is_not_shown():
    """The message is in the library of a scene that asks, and of no other."""
    words = b"error_bound = %.3g rad passes"
    for raw, has in ((ASKING, True), (SHOWN, False), (SILENT, False)):
        [library] = (unpacked(raw, optimised=False) / "binaries").rglob("body.*")
        content = library.read_bytes()
        assert (words in content) == has
        assert (CATEGORY.encode() in content) == has
        assert (b"error_bound" in content) == (raw is not SILENT)
