"""The choice of law and propagator by `[accuracy]`, importable from where it used to be."""

from supervessel.fmu import choose
from supervessel.problems import AccuracyError

__all__ = ["AccuracyError", "choose"]
