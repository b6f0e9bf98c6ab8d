"""An instance in any state of its life whose C functions are called by name, with any arguments."""

from collections.abc import Callable, Mapping
from ctypes import byref, c_bool, c_double, c_int, c_size_t, c_uint
from typing import Any

from fmpy.fmi2 import FMU2Model, FMU2Slave, fmi2EventInfo

from support import ERROR, ISS_DG, OK, Instance

RAW = ISS_DG

STEPPING, CONTINUOUS = "cs, stepping", "me, continuous"


class Raw:
    """An instance whose C functions are called by name with the instance as first argument.

    The functions of both interfaces are there, whichever the instance is of.
    """

    def __init__(
        self,
        fmi: int,
        state: str = "cs, instantiated",
        scene: Mapping[str, Any] = RAW,
        **arguments: Any,
    ) -> None:
        interface, state = state.split(", ")
        self.exchange = interface == "me"
        self.instance = Instance(scene, fmi, exchange=self.exchange, **arguments)
        self.fmi, self.fmu = fmi, self.instance.fmu
        self.functions = dict(self.fmu._functions)
        if fmi == 2:  # FMPy keeps the functions of the two interfaces apart
            self.other = (FMU2Slave if self.exchange else FMU2Model)(
                guid=self.fmu.guid,
                modelIdentifier=self.fmu.modelIdentifier,
                unzipDirectory=self.fmu.unzipDirectory,
            )
            self.functions = self.other._functions | self.functions
        if state != "instantiated":
            assert self.instance.enter(stop=100.0) == OK
        if state not in ("instantiated", "initialising"):
            assert self.instance.exit() == OK
        if self.exchange and state in ("continuous", "terminated"):
            assert self.instance.run() == OK
        if state == "terminated":
            assert self.instance._status(self.fmu.terminate) == OK
        if state == "after an error":
            assert self.instance.set({"mass": 1.0}) == ERROR
        self.instance.log.clear()

    def __call__(self, function: str, *arguments: Any) -> int:
        return self.functions[function](self.fmu.component, *arguments)

    def free(self) -> None:
        if self.fmi == 2:
            self.other.freeLibrary()
        self.instance.free()

    def read(self) -> list[float]:
        """Returns every variable, which is allowed after an error as well."""
        return self.instance.everything()

    def fly(self) -> list[float]:
        """Initialises, takes a step or goes on to continuous-time mode; returns every variable."""
        assert self.instance.initialise() == OK
        if self.exchange:
            assert self.instance.run() == OK
            assert set_(self, reference(self, "torque[2]", "state.attitude[2]"), 2, reals(5.0, 0.1)) == OK
        else:
            assert step(self, 0.0, 0.1) == OK
        return self.read()


def nothing(function: Any, *, first: int = 1) -> list[Any]:
    """Returns arguments of a function from the first-th on: NULL, false, and a count of 2 for each array."""
    values: dict[Any, Any] = {c_double: 0.0, c_bool: False, c_int: 0, c_uint: 0, c_size_t: 2}
    return [values.get(kind) for kind in function.argtypes[first:]]


def reference(raw: Raw, *names: str) -> Any:
    """Returns an array of value references."""
    return (c_uint * len(names))(*(raw.instance.references[name] for name in names))


def reals(*numbers: float) -> Any:
    return (c_double * len(numbers))(*numbers)


def get(raw: Raw, references: Any, count: int, values: Any, value_count: int | None = None) -> int:
    if raw.fmi == 2:
        return raw("fmi2GetReal", references, count, values)
    return raw("fmi3GetFloat64", references, count, values, count if value_count is None else value_count)


def set_(raw: Raw, references: Any, count: int, values: Any, value_count: int | None = None) -> int:
    if raw.fmi == 2:
        return raw("fmi2SetReal", references, count, values)
    return raw("fmi3SetFloat64", references, count, values, count if value_count is None else value_count)


def set_one(name: str, number: float) -> Callable[[Raw], int]:
    return lambda raw: set_(raw, reference(raw, name), 1, reals(number))


def step(raw: Raw, time: float, h: float) -> int:
    if raw.fmi == 2:
        return raw("fmi2DoStep", time, h, True)
    return raw("fmi3DoStep", time, h, True, c_bool(), c_bool(), c_bool(), c_double())


def enter(raw: Raw, start: float, stop: float | None = None) -> int:
    arguments = (False, 0.0, start, stop is not None, stop or 0.0)
    return raw("fmi2SetupExperiment" if raw.fmi == 2 else "fmi3EnterInitializationMode", *arguments)


def states(count: int = 7) -> Any:
    return (c_double * count)(1.0, *[0.0] * (count - 1))


def discrete_states(raw: Raw) -> int:
    if raw.fmi == 2:
        return raw("fmi2NewDiscreteStates", byref(fmi2EventInfo()))
    return raw("fmi3UpdateDiscreteStates", *(c_bool() for _ in range(5)), c_double())
