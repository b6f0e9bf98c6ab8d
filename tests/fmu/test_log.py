"""The log: its categories, their statuses, and when nothing is logged."""

import pytest

from support import DISCARD, ERROR, ISS_DG, OK, Instance, flying
from support.marks import FMI


def provoke(instance: Instance) -> None:
    """Gives an initialised instance a reason for a line of each category."""
    instance.set({"DG.mass": instance.get("DG.mass") / 2.0})
    instance.step(0.1)
    instance.set({"DG.mass": -1.0})
    instance.step(0.1)
    instance.set({"mass": 1.0})


@pytest.mark.parametrize(
    ("categories", "logged"),
    [
        ([], {"logComposite", "logStatusDiscard", "logStatusError"}),
        (["logAll"], {"logComposite", "logStatusDiscard", "logStatusError"}),
        (["logComposite"], {"logComposite"}),
        (["logStatusDiscard"], {"logStatusDiscard"}),
        (["logStatusError", "logComposite"], {"logComposite", "logStatusError"}),
    ],
)
@FMI
def test_only_the_categories_turned_on_are_logged(fmi, categories, logged):
    instance = Instance(ISS_DG, fmi, logging=False)
    assert instance._status(instance.fmu.setDebugLogging, True, categories) == OK
    instance.initialise()
    provoke(instance)
    assert {category for _, category, _ in instance.log} == logged
    instance.free()


@FMI
def test_the_categories_are_those_of_the_model_description(fmi):
    instance = Instance(ISS_DG, fmi)
    declared = [category.name for category in instance.description.logCategories]
    assert declared == ["logStatusDiscard", "logStatusError", "logComposite", "logAll"]
    for category in declared:
        assert instance._status(instance.fmu.setDebugLogging, True, [category]) == OK
    instance.free()


@FMI
def test_each_category_has_its_status(fmi):
    with flying(ISS_DG, fmi) as instance:
        provoke(instance)
        assert {(category, status) for status, category, _ in instance.log} == {
            ("logComposite", OK),
            ("logStatusDiscard", DISCARD),
            ("logStatusError", ERROR),
        }


@FMI
def test_nothing_is_logged_while_logging_is_off(fmi):
    instance = Instance(ISS_DG, fmi, logging=False)
    instance.initialise()
    provoke(instance)
    assert instance.log == []
    instance.free()


@FMI
def test_logging_can_be_turned_off(fmi):
    with flying(ISS_DG, fmi) as instance:
        instance._status(instance.fmu.setDebugLogging, False, [])
        lines = len(instance.log)
        provoke(instance)
        assert len(instance.log) == lines


@FMI
def test_log_settings_outlive_a_reset(fmi):
    instance = Instance(ISS_DG, fmi, logging=False)
    instance._status(instance.fmu.setDebugLogging, True, ["logStatusDiscard"])
    instance.reset()
    instance.initialise()
    provoke(instance)
    assert {category for _, category, _ in instance.log} == {"logStatusDiscard"}
    instance.free()
