"""Flies an FMU's library in a process of its own: python host.py JOB.json, the result on stdout as JSON.

Started by `flying.py`, with nothing of this package: whatever a library does, the trade goes on.
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
"""Numbers that are got after a step: attitude and angular velocity."""

MESSAGE_SIZE = 1024


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
        ("field_count", ctypes.c_longlong),
        ("field_references", ctypes.c_void_p),
        ("field", ctypes.c_void_p),
        ("row_count", ctypes.c_longlong),
        ("rows", ctypes.c_void_p),
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
        ("message", ctypes.c_char * MESSAGE_SIZE),
    )


def fly(job: dict[str, Any]) -> list[dict[str, Any]]:
    """Returns what came of a job's courses, as `flying.py` lays them out, up to the first that is refused.

    Samples go into a file, a course's after those of the one before. A job may ask to judge rows of inputs
    instead: a byte each, 1 where an instance can start with them.
    """
    host, fmu = ctypes.CDLL(job["host"]), ctypes.CDLL(job["library"])
    functions = (ctypes.c_void_p * len(FUNCTIONS))(
        *(ctypes.cast(getattr(fmu, name), ctypes.c_void_p).value for name in FUNCTIONS)
    )
    references = [
        (ctypes.c_uint32 * len(job[key]))(*job[key])
        for key in ("number_references", "boolean_references", "shown", "field_references")
    ]
    field = ctypes.create_string_buffer(Path(job["field"]).read_bytes())
    sampled = (ctypes.c_longlong * len(job["sampled"]))(*job["sampled"])
    samples = (ctypes.c_double * (SHOWN * len(sampled)))()
    found: list[dict[str, Any]] = []
    with Path(job["samples"]).open("wb") as file:
        for course in job["courses"]:
            kept = [
                ctypes.create_string_buffer(Path(course[key]).read_bytes())
                for key in ("rows", "numbers", "booleans")
            ]
            flight = Flight(
                job["token"].encode(),
                job["tolerance"],
                job["size"],
                job["last_size"],
                job["steps"],
                *(len(array) for array in references[:2]),
                *(ctypes.addressof(array) for array in references[:3]),
                len(references[3]),
                ctypes.addressof(references[3]),
                ctypes.addressof(field),
                course["row_count"],
                *(ctypes.addressof(array) for array in kept),
                len(sampled),
                ctypes.addressof(sampled),
                job["seconds"],
            )
            if job["judge"]:
                usable = (ctypes.c_ubyte * course["row_count"])()
                host.trade_judge(functions, ctypes.byref(flight), usable)
                file.write(usable)
                continue
            report = Report()
            if host.trade_fly(functions, ctypes.byref(flight), ctypes.byref(report), samples):
                message = report.message.decode(errors="replace") or "a call did not succeed"
                return [*found, {"refused": f"at {report.failed_at:.10g} s: {message}"}]
            file.write(samples)
            found.append(
                {
                    "refused": None,
                    "nanoseconds": report.nanoseconds,
                    "ratio": report.ratio,
                    "sub_steps": report.sub_steps,
                }
            )
    return found


if __name__ == "__main__":
    json.dump(fly(json.loads(Path(sys.argv[1]).read_text())), sys.stdout)
