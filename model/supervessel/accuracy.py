"""The choice of law and propagator by `[accuracy]`, at the place where it was: now of `fmu` and `problems`."""

from supervessel.fmu import choose
from supervessel.problems import AccuracyError

__all__ = ["AccuracyError", "choose"]
