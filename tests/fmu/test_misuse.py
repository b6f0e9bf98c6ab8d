"""Calls with wrong arguments, made through the C interface: each is answered, none crashes."""

import re
from collections.abc import Callable
from ctypes import c_bool, c_char_p, c_double, c_int, c_uint
from typing import Any

import pytest
from fmpy.fmi2 import fmi2LastSuccessfulTime, fmi2Terminated

from fmu.calls import (
    CONTINUOUS,
    STEPPING,
    Raw,
    discrete_states,
    enter,
    get,
    nothing,
    reals,
    reference,
    set_,
    set_one,
    states,
    step,
)
from support import DISCARD, ERROR, INF, NAN, OK
from support.marks import FMI


def step_without_result(raw: Raw, missing: int) -> int:
    """Steps with NULL for one of the four results."""
    kinds = (c_bool, c_bool, c_bool, c_double)
    results = [None if i == missing else kind() for i, kind in enumerate(kinds)]
    return raw("fmi3DoStep", 0.0, 0.1, True, *results)


def numbered(raw: Raw, *numbers: int) -> Any:
    """Returns an array of value references by number, -1 being one more than the largest."""
    return (c_uint * len(numbers))(*(len(raw.instance.references) if n == -1 else n for n in numbers))


def logging(raw: Raw, count: int, *names: bytes | None) -> int:
    function = f"fmi{raw.fmi}SetDebugLogging"
    return raw(function, True, count, (c_char_p * len(names))(*names) if names else None)


def state_array(raw: Raw, verb: str, array: Any, count: int) -> int:
    return raw(f"fmi{raw.fmi}{verb}ContinuousStates", array, count)


# Versions, state, call, part of the log line.
Mistake = tuple[tuple[int, ...], str, Callable[[Raw], int], str]
BOTH, UNKNOWN, NO_ARRAY = (2, 3), "is unknown", "an array is NULL"


def flying(call: Callable[[Raw], int], text: str, versions: tuple[int, ...] = BOTH) -> Mistake:
    """Returns a mistake made between steps."""
    return versions, STEPPING, call, text


def exchanging(call: Callable[[Raw], int], text: str, versions: tuple[int, ...] = BOTH) -> Mistake:
    """Returns a mistake made in continuous-time mode."""
    return versions, CONTINUOUS, call, text


MISTAKES: dict[str, Mistake] = {
    "get, one reference too far": flying(lambda r: get(r, numbered(r, -1), 1, reals(0)), UNKNOWN),
    "get, largest reference": flying(lambda r: get(r, numbered(r, 2**32 - 1), 1, reals(0)), "4294967295"),
    "get, bad after good": flying(lambda r: get(r, numbered(r, 0, -1), 2, reals(0, 0)), UNKNOWN),
    "get, no references": flying(lambda r: get(r, None, 1, reals(0.0)), NO_ARRAY),
    "get, no values": flying(lambda r: get(r, numbered(r, 0), 1, None), NO_ARRAY),
    "get, more values": flying(lambda r: get(r, numbered(r, 0), 1, reals(0, 0), 2), "nValues = 2", (3,)),
    "get, fewer values": flying(lambda r: get(r, numbered(r, 0), 1, reals(0), 0), "nValues = 0", (3,)),
    "get, values for nothing": flying(lambda r: get(r, None, 0, reals(0), 1), "nValues = 1", (3,)),
    "set, one reference too far": flying(lambda r: set_(r, numbered(r, -1), 1, reals(0)), UNKNOWN),
    "set, bad after good": flying(lambda r: set_(r, numbered(r, 1, -1), 2, reals(2e4, 0)), UNKNOWN),
    "set, no references": flying(lambda r: set_(r, None, 1, reals(0.0)), NO_ARRAY),
    "set, no values": flying(lambda r: set_(r, numbered(r, 1), 1, None), NO_ARRAY),
    "set, more values": flying(lambda r: set_(r, numbered(r, 1), 1, reals(1, 2), 2), "nValues = 2", (3,)),
    "set, fewer values": flying(lambda r: set_(r, numbered(r, 1), 1, reals(1), 0), "nValues = 0", (3,)),
    "set, output": flying(set_one("pmi[2]", 1.0), "pmi[2] is an output and cannot be set"),
    "set, output after input": flying(
        lambda r: set_(r, reference(r, "DG.mass", "mass"), 2, reals(2e4, 2e4)), "mass is an output"
    ),
    "set, time": flying(set_one("time", 1.0), "time is the independent variable and cannot be set"),
    "set, parameter after initialisation": flying(
        set_one("attitude_start[2]", 1.0),
        "attitude_start[2] is a fixed parameter and cannot be set after initialisation",
    ),
    "set, state between steps": flying(
        set_one("state.attitude[2]", 1.0),
        "state.attitude[2] is a state: it can be set in model exchange once it runs",
    ),
    "set, state after input": flying(
        lambda r: set_(r, reference(r, "DG.mass", "state.attitude[1]"), 2, reals(2e4, 1.0)),
        "state.attitude[1] is a state",
    ),
    "set, state while initialising": (
        BOTH,
        "me, initialising",
        set_one("state.angular_velocity[2]", 1.0),
        "state.angular_velocity[2] is a state: it can be set in model exchange once it runs",
    ),
    "set, rate": flying(
        set_one("der(state.attitude[2])", 1.0), "der(state.attitude[2]) is a local variable and cannot be set"
    ),
    "set, output while initialising": (BOTH, "cs, initialising", set_one("mass", 1.0), "mass is an output"),
    "set, output at once": (BOTH, "cs, instantiated", set_one("mass", 1.0), "mass is an output"),
    "set, time at once": (BOTH, "cs, instantiated", set_one("time", 1.0), "time is the independent variable"),
    "step of nothing": flying(lambda r: step(r, 0.0, 0.0), "communicationStepSize = 0 s: must be"),
    "step backwards": flying(lambda r: step(r, 0.0, -0.1), "communicationStepSize = -0.1 s: must be"),
    "step of nan": flying(lambda r: step(r, 0.0, NAN), "communicationStepSize = nan s: must be"),
    "step without end": flying(lambda r: step(r, 0.0, INF), "communicationStepSize = inf s: must be"),
    "step from later": flying(lambda r: step(r, 1e-3, 0.1), "currentCommunicationPoint = 0.001"),
    "step from before": flying(lambda r: step(r, -1e-3, 0.1), "currentCommunicationPoint = -0.001"),
    "step from nan": flying(lambda r: step(r, NAN, 0.1), "currentCommunicationPoint = nan s"),
    "step past the end": flying(lambda r: step(r, 0.0, 100.1), "passes stopTime = 100 s"),
    "step just past the end": flying(lambda r: step(r, 0.0, 100.0 + 2e-7), "passes stopTime = 100 s"),
    "step, no event flag": flying(lambda r: step_without_result(r, 0), "NULL", (3,)),
    "step, no termination flag": flying(lambda r: step_without_result(r, 1), "NULL", (3,)),
    "step, no early return flag": flying(lambda r: step_without_result(r, 2), "NULL", (3,)),
    "step, no time": flying(lambda r: step_without_result(r, 3), "NULL", (3,)),
    "start at nan": (BOTH, "cs, instantiated", lambda r: enter(r, NAN), "startTime = nan s: must be finite"),
    "start at no time": (BOTH, "cs, instantiated", lambda r: enter(r, -INF), "startTime = -inf s: must be"),
    "stop before start": (
        BOTH,
        "cs, instantiated",
        lambda r: enter(r, 1.0, 0.5),
        "stopTime = 0.5 s: must not",
    ),
    "stop at nan": (BOTH, "cs, instantiated", lambda r: enter(r, 0.0, NAN), "stopTime = nan s"),
    "no categories": flying(lambda r: logging(r, 2), "categories is NULL"),
    "unknown category": flying(lambda r: logging(r, 2, b"logAll", b"logNone"), "category 2"),
    "category NULL": flying(lambda r: logging(r, 1, None), "category 1"),
    "exchange: get, one reference too far": exchanging(
        lambda r: get(r, numbered(r, -1), 1, reals(0)), UNKNOWN
    ),
    "exchange: get, no references": exchanging(lambda r: get(r, None, 1, reals(0.0)), NO_ARRAY),
    "exchange: get, no values": exchanging(lambda r: get(r, numbered(r, 0), 1, None), NO_ARRAY),
    "exchange: set, one reference too far": exchanging(
        lambda r: set_(r, numbered(r, -1), 1, reals(0)), UNKNOWN
    ),
    "exchange: set, bad after good": exchanging(
        lambda r: set_(r, numbered(r, 1, -1), 2, reals(2e4, 0)), UNKNOWN
    ),
    "exchange: set, no references": exchanging(lambda r: set_(r, None, 1, reals(0.0)), NO_ARRAY),
    "exchange: set, no values": exchanging(lambda r: set_(r, numbered(r, 1), 1, None), NO_ARRAY),
    "exchange: set, output after state": exchanging(
        lambda r: set_(r, reference(r, "state.attitude[2]", "mass"), 2, reals(0.1, 2e4)), "mass is an output"
    ),
    "exchange: set, rate": exchanging(
        set_one("der(state.attitude[2])", 1.0), "der(state.attitude[2]) is a local variable and cannot be set"
    ),
    "exchange: set, time": exchanging(
        set_one("time", 1.0), "time is the independent variable and cannot be set"
    ),
    "exchange: set, parameter": exchanging(
        set_one("attitude_start[2]", 1.0), "attitude_start[2] is a fixed parameter"
    ),
    "exchange: no states to set": exchanging(lambda r: state_array(r, "Set", None, 7), "the array is NULL"),
    "exchange: no states to get": exchanging(lambda r: state_array(r, "Get", None, 7), "the array is NULL"),
    "exchange: six states": exchanging(
        lambda r: state_array(r, "Set", states(6), 6), "6 elements: must be 7"
    ),
    "exchange: eight states": exchanging(
        lambda r: state_array(r, "Get", states(8), 8), "8 elements: must be 7"
    ),
    "exchange: unknown category": exchanging(lambda r: logging(r, 1, b"logNone"), "category 1"),
    "exchange: start at nan": (
        BOTH,
        "me, instantiated",
        lambda r: enter(r, NAN),
        "startTime = nan s: must be",
    ),
    "exchange: stop before start": (
        BOTH,
        "me, instantiated",
        lambda r: enter(r, 1.0, 0.5),
        "stopTime = 0.5 s",
    ),
    "no place for the time": flying(
        lambda r: r("fmi2GetRealStatus", fmi2LastSuccessfulTime, None), "value is NULL", (2,)
    ),
    "no place for the answer": flying(
        lambda r: r("fmi2GetBooleanStatus", fmi2Terminated, None), "value is NULL", (2,)
    ),
}
CASES = [pytest.param(v, *rest, id=f"{v}-{name}") for name, (vs, *rest) in MISTAKES.items() for v in vs]
MISTAKE = pytest.mark.parametrize(("fmi", "state", "call", "text"), CASES)
MISTAKE_IN_FLIGHT = pytest.mark.parametrize(
    ("fmi", "state", "call", "text"), [case for case in CASES if case.values[1] in (STEPPING, CONTINUOUS)]
)


@MISTAKE
def test_a_wrong_argument_is_an_error_and_one_line_says_which(fmi, state, call, text):
    raw = Raw(fmi, state)
    assert call(raw) == ERROR
    [(status, category, message)] = [line for line in raw.instance.log if line[0] != OK]
    assert (status, category) == (ERROR, "logStatusError")
    assert re.match(rf"fmi{fmi}\w+: ", message)
    assert text in message
    raw.free()


@MISTAKE_IN_FLIGHT
def test_a_wrong_argument_leaves_all_values_as_they_were(fmi, state, call, text):
    raw = Raw(fmi, state)
    before = raw.read()
    call(raw)
    assert raw.read() == before
    raw.free()


@MISTAKE
def test_after_an_error_an_instance_does_not_go_on(fmi, state, call, text):
    raw = Raw(fmi, state)
    call(raw)
    for again in (
        lambda: step(raw, 0.0, 0.1),
        lambda: set_one("DG.mass", 2e4)(raw),
        lambda: discrete_states(raw),
        lambda: state_array(raw, "Set", states(), 7),
        lambda: raw(
            f"fmi{fmi}EnterInitializationMode", *nothing(raw.functions[f"fmi{fmi}EnterInitializationMode"])
        ),
        lambda: raw(f"fmi{fmi}ExitInitializationMode"),
        lambda: raw(f"fmi{fmi}Terminate"),
    ):
        assert again() == ERROR
    raw.free()


@MISTAKE
def test_after_an_error_reset_makes_an_instance_fly_like_a_new_one(fmi, state, call, text):
    runs = []
    for broken in (False, True):
        raw = Raw(fmi, state)
        if broken:
            call(raw)
        assert raw.instance.reset() == OK
        runs.append(raw.fly())
        raw.free()
    assert runs[0] == runs[1]


@FMI
def test_an_error_of_one_instance_leaves_another_alone(fmi):
    broken, other = Raw(fmi, STEPPING), Raw(fmi, STEPPING)
    assert step(broken, 0.0, -1.0) == ERROR
    assert step(other, 0.0, 0.1) == OK
    assert other.instance.messages() == []
    broken.free()
    other.free()


@FMI
@pytest.mark.parametrize("state", [STEPPING, CONTINUOUS])
def test_arrays_of_no_elements_may_be_null(fmi, state):
    raw = Raw(fmi, state)
    assert [get(raw, None, 0, None), set_(raw, None, 0, None)] == [OK, OK]
    raw.free()


@FMI
def test_a_step_may_end_at_the_stop_time_within_a_few_roundings(fmi):
    raw = Raw(fmi, STEPPING)
    assert step(raw, 0.0, 100.0 * (1 + 2.0**-52)) == OK
    raw.free()


@pytest.mark.parametrize("kind", [0, 1, 2, 3, 17, -1])
@pytest.mark.parametrize(
    ("name", "value", "known"),
    [
        ("fmi2GetStatus", c_int(), None),
        ("fmi2GetRealStatus", c_double(), fmi2LastSuccessfulTime),
        ("fmi2GetIntegerStatus", c_int(), None),
        ("fmi2GetBooleanStatus", c_int(), fmi2Terminated),
        ("fmi2GetStringStatus", c_char_p(), None),
    ],
)
def test_a_status_that_there_is_not_is_discarded_and_flight_goes_on(name, value, known, kind):
    raw = Raw(2, STEPPING)
    assert raw(name, kind, value) == (OK if kind == known else DISCARD)
    assert step(raw, 0.0, 0.1) == OK
    raw.free()
