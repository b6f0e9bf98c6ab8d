"""What follows from a scene and is asked for by one module after the other."""

from collections.abc import Callable
from functools import wraps
from typing import TypeVar

from supervessel.scene.schema import Scene

Result = TypeVar("Result")


def latest(function: Callable[[Scene], Result]) -> Callable[[Scene], Result]:
    """Returns the function with its latest result at hand: that of the same scene is not made again.

    A scene does not change; nor may the result, which all callers share.
    """
    kept: list[tuple[Scene, Result]] = []

    @wraps(function)
    def call(scene: Scene) -> Result:
        for known, result in tuple(kept):
            if known is scene:
                return result
        result = function(scene)
        kept[:] = [(scene, result)]
        return result

    return call
