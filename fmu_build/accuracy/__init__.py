"""How exact a scene's motion shall be, and the cheapest law and propagator that make it so."""

from fmu_build.accuracy.choice import choose, said
from fmu_build.accuracy.flights import AccuracyError

__all__ = ["AccuracyError", "choose", "said"]
