"""Instances of model exchange: their states and rates by arrays, their outputs."""

from collections.abc import Callable
from ctypes import byref, c_bool, c_double
from typing import Any

import numpy as np
from fmpy.fmi2 import fmi2EventInfo

from support import ERROR, ISS_DG, OK, STEADY, TURNING, Instance, variant

RATES, ATTITUDE = TURNING["angular_velocity"], TURNING["attitude"]
RAW = variant(ISS_DG, {"name": "exchanged", "rotation": TURNING | STEADY})


def start(raw: dict[str, Any] = RAW, fmi: int = 3, mode: str = "continuous") -> Instance:
    """Returns an instance of model exchange in a state of its life cycle."""
    instance = Instance(raw, fmi, exchange=True)
    if mode != "instantiated":
        assert instance.enter(stop=100.0) == OK
    if mode not in ("instantiated", "initialising"):
        assert instance.exit() == OK
    if mode in ("continuous", "terminated"):
        assert instance.run() == OK
    if mode == "terminated":
        assert instance._status(instance.fmu.terminate) == OK
    if mode == "after an error":
        assert instance.set({"mass": 1.0}) == ERROR
    instance.log.clear()
    return instance


def change(instance: Instance, values: dict[str, Any]) -> list[int]:
    """Changes inputs, of which some may be discrete, in model exchange by an event; returns the statuses."""
    if hasattr(instance.fmu, "doStep"):
        return [instance.set(values)]
    return [instance._status(instance.fmu.enterEventMode), instance.set(values), instance.run()]


def scalars(values: dict[str, Any]) -> dict[str, float]:
    """Returns values by group as values of scalars."""
    return {
        f"{name}[{i + 1}]" if np.ndim(value) else name: float(x)
        for name, value in values.items()
        for i, x in enumerate(np.ravel(value))
    }


def raw_call(name: str, *arguments: Any) -> Callable[[Instance], int]:
    return lambda i: i.fmu._functions[f"fmi{i.fmi}{name}"](i.fmu.component, *arguments)


def raw_update(instance: Instance) -> int:
    if instance.fmi == 2:
        return raw_call("NewDiscreteStates", byref(fmi2EventInfo()))(instance)
    return raw_call("UpdateDiscreteStates", *(byref(c_bool()) for _ in range(5)), byref(c_double()))(instance)


def get_rates(instance: Instance) -> int:
    name = "GetContinuousStateDerivatives" if instance.fmi == 3 else "GetDerivatives"
    return raw_call(name, (c_double * 7)(), 7)(instance)
