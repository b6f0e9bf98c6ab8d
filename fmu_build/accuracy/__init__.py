"""How exact a scene's motion shall be, and the cheapest law and propagator that make it so."""

from fmu_build.accuracy.choice import choose, said
from supervessel.problems import AccuracyError

__all__ = ["AccuracyError", "choose", "said"]
