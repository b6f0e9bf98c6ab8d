"""How exact a scene's motion shall be, and the cheapest law and propagator that make it so."""

from supervessel.accuracy.choice import choose, said
from supervessel.accuracy.flights import AccuracyError

__all__ = ["AccuracyError", "choose", "said"]
