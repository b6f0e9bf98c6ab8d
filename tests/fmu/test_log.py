"""The log: its categories, their statuses, and when nothing is logged."""

import pytest

from support import DISCARD, ERROR, ISS_DG, NAN, OK, Instance, flying
from support.marks import FMI


def provoke(instance: Instance) -> None:
    """Gives an initialised instance a reason for a line of each category."""
    instance.set({"DG.mass": instance.get("DG.mass") / 2.0})
    instance.step(0.1)
    instance.set({"DG.mass": NAN})
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


@pytest.mark.parametrize(
    ("calls", "logged"),
    [
        ([(False, ["logComposite"])], {"logStatusDiscard", "logStatusError"}),
        (
            [(False, []), (True, ["logComposite"]), (True, ["logStatusError"])],
            {"logComposite", "logStatusError"},
        ),
        ([(True, ["logComposite"])], {"logComposite", "logStatusDiscard", "logStatusError"}),
        (
            [(False, ["logStatusError", "logComposite"]), (True, ["logComposite"])],
            {"logComposite", "logStatusDiscard"},
        ),
        ([(False, ["logAll"]), (True, ["logStatusDiscard"])], {"logStatusDiscard"}),
    ],
)
@FMI
def test_categories_are_added_and_removed_and_the_others_stay(fmi, calls, logged):
    """FMI 2.0.4, 2.1.5; FMI 3.0, 2.3.1: loggingOn is about the categories named, or about all if none is."""
    instance = Instance(ISS_DG, fmi)
    for on, categories in calls:
        assert instance._status(instance.fmu.setDebugLogging, on, categories) == OK
    instance.initialise()
    provoke(instance)
    assert {category for _, category, _ in instance.log} == logged
    instance.free()


@pytest.mark.parametrize("on", [True, False])
@FMI
def test_an_unknown_category_is_an_error_and_changes_no_other(fmi, on):
    """The allowed names are those of the model description (FMI 2.0.4: 2.1.5, FMI 3.0: 2.3.1)."""
    instance = Instance(ISS_DG, fmi)
    assert instance._status(instance.fmu.setDebugLogging, on, ["logComposite", "logNoise"]) == ERROR
    message = f"fmi{fmi}SetDebugLogging: category 2 is not one of the model description's"
    assert instance.log == [(ERROR, "logStatusError", message)]
    instance.reset()
    instance.initialise()
    provoke(instance)
    assert {category for _, category, _ in instance.log} == {
        "logComposite",
        "logStatusDiscard",
        "logStatusError",
    }
    instance.free()


@FMI
def test_the_categories_are_those_of_the_model_description(fmi):
    instance = Instance(ISS_DG, fmi)
    declared = [category.name for category in instance.description.logCategories]
    assert declared == ["logStatusDiscard", "logStatusError", "logComposite", "logTolerance", "logAll"]
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
