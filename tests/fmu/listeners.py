"""Instances whose importer listens within a step, by the intermediate update of FMI 3.0."""

from collections.abc import Callable
from ctypes import byref, c_bool, c_double
from typing import Any

from support import NAN, OK, Instance

Update = Callable[["Listener", float, list[bool], Any, Any], None]


class Listener(Instance):
    """An instance that records each intermediate update and what it could read there, then calls `update`."""

    def __init__(self, raw: dict[str, Any], update: Update | None = None, early: bool = True) -> None:
        self.times: list[float] = []
        self.flags: list[list[bool]] = []
        self.read: list[list[float]] = []
        self.update = update
        super().__init__(
            raw,
            earlyReturnAllowed=early,
            intermediateUpdate=self._updated,
            requiredIntermediateVariables=None,
        )
        assert self.initialise() == OK
        self.log.clear()

    def _updated(self, environment: Any, time: float, *rest: Any) -> None:
        *flags, wanted, return_time = rest
        self.times.append(time)
        self.flags.append(flags)
        self.read.append([self.get("time"), *outputs(self)])
        if self.update:
            self.update(self, time, flags, wanted, return_time)

    def fly(self, h: float) -> tuple[int, bool, float]:
        """Steps from the instance's time; returns status, early return and last successful time."""
        early, time = c_bool(True), c_double(NAN)
        call = self.fmu._functions["fmi3DoStep"]
        flags = byref(c_bool()), byref(c_bool())
        status = call(self.fmu.component, self.time, h, True, *flags, byref(early), byref(time))
        if status == OK:
            self.time = time.value
        return int(status), early.value, time.value


def output_names(instance: Instance) -> list[str]:
    return [v.name for v in instance.description.modelVariables if v.causality == "output"]


def outputs(instance: Instance) -> list[float]:
    return list(instance.fmu.getFloat64([instance.references[name] for name in output_names(instance)]))
