"""Floating-point exceptions that calls of a loaded FMU leave raised, as hosts that trap them see it."""

import ctypes
import ctypes.util
import platform
from typing import Any

FLAGS = {
    "x86_64": {"invalid operation": 1, "division by zero": 4, "overflow": 8},
    "aarch64": {"invalid operation": 1, "division by zero": 2, "overflow": 4},
}
"""Bits of <fenv.h> by machine; underflow and inexact results are no fault."""

KINDS = FLAGS.get({"arm64": "aarch64"}.get(platform.machine(), platform.machine()), {})
FLAGS_KNOWN = bool(KINDS) and platform.system() != "Windows"


def watch(fmu: Any) -> None:
    """Has each call of an FMU's library that succeeds fail the test if it raised a floating-point exception.

    fmu : of FMPy, loaded; where the bits of the flags are unknown, nothing is watched
    """
    if not FLAGS_KNOWN:
        return
    library = ctypes.CDLL(ctypes.util.find_library("m"))
    everything = sum(KINDS.values())

    def watched(name: str, function: Any) -> Any:
        def call(*arguments: Any) -> Any:
            library.feclearexcept(everything)
            result = function(*arguments)
            raised = library.fetestexcept(everything)
            if raised and (function.restype is not ctypes.c_int or result in (0, 1)):  # OK, Warning
                kinds = ", ".join(kind for kind, bit in KINDS.items() if raised & bit)
                raise AssertionError(f"{name} succeeded and raised: {kinds}")
            return result

        call.__dict__ |= {"restype": function.restype, "argtypes": function.argtypes}
        call.__dict__["argnames"] = getattr(function, "argnames", None)
        return call

    for name, function in fmu._functions.items():
        fmu._functions[name] = watched(name, function)
