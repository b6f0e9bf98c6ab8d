"""A CasADi function as an FMU: valid, equal to the function, and clear about wrong calls."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from fmpy import extract, read_model_description, supported_platforms
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu
from function_fmu import build_function_fmu

from fmu_build.platforms import host_platform
from support import DISCARD, ERROR, OK
from support.marks import FMI

STARTS = {"angles": [0.1, 0.2], "gain": 3.0}


def law() -> ca.Function:
    """angles (2,), gain -> turned (2,), size: a function of products and roots."""
    angles, gain = ca.SX.sym("angles", 2), ca.SX.sym("gain")
    turned = gain * ca.vertcat(angles[1], -angles[0] * angles[1])
    results = [turned, ca.sqrt(ca.sumsqr(angles) + gain)]
    return ca.Function("law", [angles, gain], results, ["angles", "gain"], ["turned", "size"])


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> dict[int, Path]:
    folder = tmp_path_factory.mktemp("law")
    return {fmi: build_function_fmu(law(), folder / f"law{fmi}.fmu", fmi, STARTS) for fmi in (2, 3)}


class Law:
    """An instance of the FMU of either version; each call returns the status."""

    def __init__(self, path: Path, token: str | None = None) -> None:
        description = read_model_description(str(path))
        self.log: list[str] = []
        self.three = description.fmiVersion == "3.0"
        given = {
            "guid": token or description.guid,
            "unzipDirectory": extract(str(path)),
            "modelIdentifier": "law",
            "instanceName": "it",
        }
        self.fmu = (FMU3Slave if self.three else FMU2Slave)(**given)
        if self.three:
            self.fmu.instantiate(loggingOn=True, logMessage=lambda *line: self.log.append(line[3].decode()))
        else:
            callbacks = fmi2CallbackFunctions()
            callbacks.logger = fmi2CallbackLoggerTYPE(
                lambda *line: self.log.append(f"{line[1].decode()}: {line[4].decode()}")
            )
            self.fmu.instantiate(loggingOn=True, callbacks=callbacks)

    def status(self, name: str, *arguments: Any) -> int:
        try:
            getattr(self.fmu, name)(*arguments)
        except FMICallException as exception:
            return int(exception.status)
        return OK

    def set(self, references: list[int], values: list[float]) -> int:
        return self.status("setFloat64" if self.three else "setReal", references, values)

    def get(self, references: list[int]) -> list[float]:
        return list((self.fmu.getFloat64 if self.three else self.fmu.getReal)(references))


@contextmanager
def running(path: Path) -> Iterator[Law]:
    """Yields an instance between steps; frees it."""
    it = Law(path)
    if not it.three:
        it.fmu.setupExperiment()
    it.fmu.enterInitializationMode()
    it.fmu.exitInitializationMode()
    yield it
    it.fmu.freeInstance()


@FMI
def test_the_archive_is_valid_and_names_every_element(built, fmi):
    assert validate_fmu(str(built[fmi])) == []
    description = read_model_description(str(built[fmi]))
    names = {variable.name: (variable.causality, variable.start) for variable in description.modelVariables}
    assert names == {
        "time": ("independent", None),
        "angles[1]": ("input", "0.1"),
        "angles[2]": ("input", "0.2"),
        "gain": ("input", "3.0"),
        "turned[1]": ("output", None),
        "turned[2]": ("output", None),
        "size": ("output", None),
    }
    assert host_platform().fmi2 in supported_platforms(str(built[fmi]))


@FMI
def test_outputs_are_the_functions_to_the_last_bit(built, fmi):
    rng = np.random.default_rng(3)
    with running(built[fmi]) as it:
        np.testing.assert_array_equal(it.get([1, 2, 3]), [0.1, 0.2, 3.0])
        for k in range(20):
            values = rng.uniform(0.1, 10.0, 3)
            expected = np.concatenate([np.array(part).ravel() for part in law()(values[:2], values[2])])
            assert it.set([1, 2, 3], [*values]) == OK
            np.testing.assert_array_equal(it.get([4, 5, 6]), expected)
            assert it.status("doStep", 0.5 * k, 0.5) == OK
            np.testing.assert_array_equal(it.get([0, 6, 4]), [0.5 * k + 0.5, expected[2], expected[0]])


@FMI
def test_values_that_cannot_be_used_are_discarded_and_change_nothing(built, fmi):
    with running(built[fmi]) as it:
        before = it.get([1, 2, 3, 4, 5, 6])
        assert it.set([1, 3], [7.0, np.nan]) == DISCARD
        assert "gain = nan: must be finite" in it.log[-1]
        assert it.get([1, 2, 3, 4, 5, 6]) == before
        assert it.status("doStep", 0.0, -1.0) == DISCARD
        assert it.get([0]) == [0.0]


@FMI
def test_an_output_that_is_no_number_is_refused_with_its_name(built, fmi):
    with running(built[fmi]) as it:
        assert it.set([3], [-9.0]) == OK
        with pytest.raises(FMICallException):
            it.get([6])
        assert "size leaves the range of finite numbers" in it.log[-1]


@FMI
@pytest.mark.parametrize(
    ("call", "problem"),
    [
        (lambda it: it.set([4], [1.0]), "value reference 4 is no input"),
        (lambda it: it.set([0], [1.0]), "value reference 0 is no input"),
        (lambda it: it.set([7], [1.0]), "value reference 7 is no input"),
        (lambda it: it.status("getFloat64" if it.three else "getReal", [7]), "value reference 7 is unknown"),
        (lambda it: it.status("enterInitializationMode"), "must not be called in this state"),
    ],
)
def test_wrong_calls_are_errors_that_say_what_is_wrong(built, fmi, call, problem):
    with running(built[fmi]) as it:
        assert call(it) == ERROR
        assert problem in it.log[-1]
        assert it.set([1], [1.0]) == ERROR
        assert it.status("reset") == OK
        assert it.set([1], [1.0]) == OK


@FMI
def test_another_builds_token_is_refused(built, fmi):
    with pytest.raises(Exception, match="nstantiate"):
        Law(built[fmi], token="{another}")


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"starts": {"gian": 1.0}}, 'unknown input "gian" (did you mean "gain"?)'),
        ({"fmi": 1}, "fmi = 1: must be 2 or 3"),
        (
            {"function": ca.Function("f", [ca.SX.sym("a")], [ca.SX(2, 1)])},
            "f: has sparse arguments or results",
        ),
    ],
)
def test_what_cannot_be_built_is_refused(tmp_path, change, problem):
    with pytest.raises(ValueError, match=re.escape(problem)):
        build_function_fmu(**({"function": law(), "output": tmp_path / "law.fmu"} | change))
    assert not any(tmp_path.iterdir())
