"""What follows from a scene alone and is asked for again and again."""

from collections.abc import Callable
from functools import wraps
from typing import TypeVar

Given = TypeVar("Given")
Result = TypeVar("Result")


def reused(function: Callable[[Given], Result]) -> Callable[[Given], Result]:
    """Returns the function with its latest result at hand: for the same argument it is not made again.

    The same is the very same object. Neither it nor the result, which all callers share, may change.
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
