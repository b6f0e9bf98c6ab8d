"""The CasADi twin: checked functions of the FMU's own equations, error states, linear models, generated C."""

from supervessel.twin.twin import Twin

__all__ = ["Twin"]
