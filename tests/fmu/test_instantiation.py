"""Instances that are refused, that have no logger, or the token of another FMU."""

from ctypes import c_bool, c_char_p, c_uint
from typing import Any

import pytest
from fmpy import read_model_description
from fmpy.fmi2 import fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.fmi3 import fmi3LogMessageCallback

from fmu.calls import RAW, Raw, nothing
from support import ERROR, OK, body, built
from support.marks import FMI

ENVIRONMENT = 4711
Lines = list[tuple[int, str, str]]


def instantiate(
    fmi: int,
    *,
    exchange: bool = False,
    name: bytes | None = b"it",
    kind: int | None = None,
    event_mode: bool = False,
    intermediate: tuple[int, ...] | None = (),
    callbacks: bool = True,
    logger: bool = True,
    **token: bytes | None,
) -> tuple[int | None, Lines, set[Any]]:
    """Instantiates for an interface; returns the instance, what it logs till it is freed, and to whom.

    An instance that is made is initialised, makes an error that it may log, and is freed. `kind` is FMI 2.0's
    number of the interface if it is not the right one; `intermediate` None stands for an array of one element
    that is NULL.
    """
    raw, lines, addressees = Raw(fmi), [], set()

    def log(*arguments: Any) -> None:
        *addressee, status, category, text = arguments
        lines.append((status, category.decode(), text.decode()))
        addressees.add(tuple(addressee))

    secret = token.get("token", raw.fmu.guid.encode())
    if fmi == 2:
        structure = fmi2CallbackFunctions(componentEnvironment=ENVIRONMENT)
        if logger:
            structure.logger = fmi2CallbackLoggerTYPE(log)
        pointer = structure if callbacks else None
        kind = (0 if exchange else 1) if kind is None else kind
        component = raw.functions["fmi2Instantiate"](name, kind, secret, None, pointer, False, True)
    else:
        callback = fmi3LogMessageCallback(log) if logger else fmi3LogMessageCallback()
        common = name, secret, None, False, True
        if exchange:
            component = raw.functions["fmi3InstantiateModelExchange"](*common, ENVIRONMENT, callback)
        else:
            variables = (None, 1) if intermediate is None else ((c_uint * len(intermediate))(*intermediate),)
            component = raw.functions["fmi3InstantiateCoSimulation"](
                *common,
                event_mode,
                False,
                *(variables if intermediate is None else (*variables, len(intermediate))),
                ENVIRONMENT,
                callback,
                raw.fmu.intermediateUpdate,
            )
    if component:
        enter_, exit_ = (f"fmi{fmi}{verb}InitializationMode" for verb in ("Enter", "Exit"))
        assert raw.functions[enter_](component, *nothing(raw.functions[enter_])) == OK
        assert [raw.functions[exit_](component) for _ in range(2)] == [OK, ERROR]
        raw.functions[f"fmi{fmi}FreeInstance"](component)
    raw.free()
    return component, lines, addressees


NAMELESS, TOKENLESS = "instanceName must hold a character", "is not that of this library"
REFUSED_INSTANCES = [
    pytest.param(fmi, changes, text, id=f"{fmi}-{name}{' (exchange)' if changes.get('exchange') else ''}")
    for fmi, name, changes, text in [
        *(
            (fmi, name, changes | {"exchange": exchange}, text)
            for fmi in (2, 3)
            for exchange in (False, True)
            for name, changes, text in [
                ("no name", {"name": None}, NAMELESS),
                ("empty name", {"name": b""}, NAMELESS),
                ("blank name", {"name": b" \t\r\n"}, NAMELESS),
                ("no token", {"token": None}, TOKENLESS),
                ("empty token", {"token": b""}, TOKENLESS),
                ("wrong token", {"token": b"{00000000-0000-0000-0000-000000000000}"}, TOKENLESS),
            ]
        ),
        (2, "unknown kind", {"kind": 7}, "fmuType must be fmi2ModelExchange or fmi2CoSimulation"),
        (2, "negative kind", {"kind": -1}, "fmuType must be fmi2ModelExchange or fmi2CoSimulation"),
        (3, "event mode", {"event_mode": True}, "eventModeUsed is true, but this FMU has no event mode"),
        (3, "an input within steps", {"intermediate": (1,)}, "holds a reference that is no output"),
        (3, "time within steps", {"intermediate": (0,)}, "holds a reference that is no output"),
        (
            3,
            "what is not there within steps",
            {"intermediate": (2**32 - 1,)},
            "a reference that is no output",
        ),
        (3, "NULL within steps", {"intermediate": None}, "requiredIntermediateVariables is NULL"),
    ]
]


@pytest.mark.parametrize(("fmi", "changes", "text"), REFUSED_INSTANCES)
def test_wrong_arguments_give_no_instance_and_one_line_that_says_why(fmi, changes, text):
    component, log, _ = instantiate(fmi, **changes)
    assert component is None
    [(status, category, message)] = log
    assert (status, category) == (ERROR, "logStatusError")
    interface = "ModelExchange" if changes.get("exchange") else "CoSimulation"
    assert message.startswith("fmi2Instantiate: " if fmi == 2 else f"fmi3Instantiate{interface}: ")
    assert text in message


@pytest.mark.parametrize(("fmi", "changes", "text"), REFUSED_INSTANCES)
def test_wrong_arguments_and_no_logger_give_no_instance(fmi, changes, text):
    assert instantiate(fmi, logger=False, **changes) == (None, [], set())


@pytest.mark.parametrize("exchange", [False, True])
@pytest.mark.parametrize(
    ("fmi", "changes"), [(2, {"callbacks": False}), (2, {"logger": False}), (3, {"logger": False})], ids=str
)
def test_an_instance_without_a_logger_flies(fmi, changes, exchange):
    component, log, _ = instantiate(fmi, exchange=exchange, **changes)
    assert component
    assert log == []


@pytest.mark.parametrize("token", [{}, {"token": b"wrong"}], ids=["in flight", "when refused"])
@pytest.mark.parametrize("exchange", [False, True])
@FMI
def test_lines_are_logged_to_the_importers_environment(fmi, exchange, token):
    _, log, addressees = instantiate(fmi, exchange=exchange, **token)
    assert log
    assert addressees == {(ENVIRONMENT, b"it") if fmi == 2 else (ENVIRONMENT,)}


@pytest.mark.parametrize("logger", [True, False])
def test_scheduled_execution_gives_no_instance_and_one_line(logger):
    raw, log = Raw(3), []
    name = "fmi3InstantiateScheduledExecution"
    function = raw.functions[name]
    callback = fmi3LogMessageCallback(
        lambda _, status, category, text: log.append((status, category.decode(), text.decode()))
    )
    arguments = [
        (callback if logger else kind())
        if kind is fmi3LogMessageCallback
        else {c_bool: True, c_char_p: raw.fmu.guid.encode()}.get(kind, kind())
        for kind in function.argtypes
    ]
    assert function(*arguments) is None
    line = (ERROR, "logStatusError", f"{name}: this FMU has no scheduled execution")
    assert log == ([line] if logger else [])
    raw.free()


@pytest.mark.parametrize("exchange", [False, True])
@pytest.mark.parametrize("other", [(body(), 3), (RAW, 2)], ids=["of another scene", "of the other version"])
def test_a_token_of_another_fmu_is_refused(other, exchange):
    token = read_model_description(str(built(*other))).guid.encode()
    assert instantiate(3, exchange=exchange, token=token)[0] is None
