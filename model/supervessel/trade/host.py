"""Flies an FMU's library in a process of its own: python host.py JOB.json, the result on stdout as JSON.

Started by `flight.py`, with nothing of this package: whatever a library does, the trade goes on.
"""

import ctypes
import json
import sys
from pathlib import Path
from typing import Any

FUNCTIONS = (
    "fmi3InstantiateCoSimulation",
    "fmi3EnterInitializationMode",
    "fmi3ExitInitializationMode",
    "fmi3SetFloat64",
    "fmi3SetBoolean",
    "fmi3GetFloat64",
    "fmi3DoStep",
    "fmi3FreeInstance",
)
SHOWN = 7


class Flight(ctypes.Structure):
    """As in host.c."""

    _fields_ = (
        ("token", ctypes.c_char_p),
        ("tolerance", ctypes.c_double),
        ("size", ctypes.c_double),
        ("last_size", ctypes.c_double),
        ("steps", ctypes.c_longlong),
        ("number_count", ctypes.c_longlong),
        ("boolean_count", ctypes.c_longlong),
        ("number_references", ctypes.c_void_p),
        ("boolean_references", ctypes.c_void_p),
        ("shown", ctypes.c_void_p),
        ("numbers", ctypes.c_void_p),
        ("booleans", ctypes.c_void_p),
        ("sample_count", ctypes.c_longlong),
        ("sampled", ctypes.c_void_p),
        ("seconds", ctypes.c_double),
    )


class Report(ctypes.Structure):
    """As in host.c."""

    _fields_ = (
        ("nanoseconds", ctypes.c_double),
        ("ratio", ctypes.c_double),
        ("sub_steps", ctypes.c_longlong),
        ("failed_at", ctypes.c_double),
        ("message", ctypes.c_char * 1024),
    )


def fly(job: dict[str, Any]) -> dict[str, Any]:
    """Returns what came of a job, as `flight.fly` lays it out."""
    host, fmu = ctypes.CDLL(job["host"]), ctypes.CDLL(job["library"])
    functions = (ctypes.c_void_p * len(FUNCTIONS))(
        *(ctypes.cast(getattr(fmu, name), ctypes.c_void_p).value for name in FUNCTIONS)
    )
    kept = [
        (ctypes.c_uint32 * len(job[key]))(*job[key])
        for key in ("number_references", "boolean_references", "shown")
    ]
    numbers, booleans = (
        ctypes.create_string_buffer(Path(job[key]).read_bytes()) for key in ("numbers", "booleans")
    )
    sampled = (ctypes.c_longlong * len(job["sampled"]))(*job["sampled"])
    flight = Flight(
        job["token"].encode(),
        job["tolerance"],
        job["size"],
        job["last_size"],
        job["steps"],
        len(kept[0]),
        len(kept[1]),
        *(ctypes.addressof(array) for array in kept),
        ctypes.addressof(numbers),
        ctypes.addressof(booleans),
        len(sampled),
        ctypes.addressof(sampled),
        job["seconds"],
    )
    samples = (ctypes.c_double * (SHOWN * len(sampled)))()
    report = Report()
    failed = host.trade_fly(functions, ctypes.byref(flight), ctypes.byref(report), samples)
    if failed:
        message = report.message.decode(errors="replace") or "a call did not succeed"
        return {"refused": f"at {report.failed_at:.10g} s: {message}"}
    return {
        "refused": None,
        "nanoseconds": report.nanoseconds,
        "ratio": report.ratio,
        "sub_steps": report.sub_steps,
        "samples": list(samples),
    }


if __name__ == "__main__":
    json.dump(fly(json.loads(Path(sys.argv[1]).read_text())), sys.stdout)
