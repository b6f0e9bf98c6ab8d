"""Results that depend on a scene alone, kept for the scene that was used last."""

from collections.abc import Callable
from functools import wraps
from typing import TypeVar

Given = TypeVar("Given")
Result = TypeVar("Result")


def reused(function: Callable[[Given], Result]) -> Callable[[Given], Result]:
    """Returns a function that keeps its latest result and returns it again for the same argument.

    The same argument is the same object, not an equal one. Neither argument nor result may be changed: all
    callers share them.
    """
    kept: list[tuple[Given, Result]] = []

    @wraps(function)
    def call(given: Given) -> Result:
        for known, result in tuple(kept):
            if known is given:
                return result
        result = function(given)
        kept[:] = [(given, result)]
        return result

    return call
