"""Saving an instance's state, as bytes too, and giving it back, by FMPy and by the C functions."""

from ctypes import byref, c_ubyte, c_void_p, cast
from typing import Any

from support import OK, Instance


def save(instance: Instance) -> Any:
    return instance.fmu.getFMUState()


def bytes_of(instance: Instance) -> bytes:
    """Returns the instance's state as bytes."""
    state = save(instance)
    result = bytes(instance.fmu.serializeFMUState(state))
    instance.fmu.freeFMUState(state)
    return result


def restore(instance: Instance, content: bytes) -> int:
    """Gives an instance the state that bytes hold; returns the first status that is not OK."""
    state = c_void_p()
    size = len(content)
    buffer = (c_ubyte * max(size, 1)).from_buffer_copy(content or b"\0")
    status = deserialize(instance, buffer, size, byref(state))
    if status == OK:
        status = instance._status(instance.fmu.setFMUState, state)
        instance.fmu.freeFMUState(state)
    else:
        assert state.value is None
    return status


def function(instance: Instance, name: str) -> Any:
    """Returns a C function by its name in FMI 3.0."""
    if instance.fmi == 2:
        name = name.replace("FMUState", "FMUstate").replace("Deserialize", "DeSerialize")
    return instance.fmu._functions[f"fmi{instance.fmi}{name}"]


def deserialize(instance: Instance, content: Any, size: int, state: Any) -> int:
    call = function(instance, "DeserializeFMUState")
    argument = content and cast(content, call.argtypes[1])
    return int(call(instance.fmu.component, argument, size, state))
