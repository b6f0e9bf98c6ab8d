"""Equations that stand in a scene's composite once for each vessel, put together once."""

from collections.abc import Callable

import casadi as ca


def inlined(*sizes: tuple[int, ...]) -> Callable[[Callable[..., ca.SX]], Callable[..., ca.SX]]:
    """Returns a decorator for a function of dense symbols: the same operations, in a small part of the time.

    sizes : shapes of the arguments
    What is constant in a call folds as it does where the function is written out.
    """

    def decorator(function: Callable[..., ca.SX]) -> Callable[..., ca.SX]:
        symbols = [ca.SX.sym(f"a{i}", *size) for i, size in enumerate(sizes)]
        graph = ca.Function(function.__name__, symbols, [function(*symbols)])

        def call(*arguments: ca.SX) -> ca.SX:
            return graph(*arguments)

        call.__doc__, call.__name__ = function.__doc__, function.__name__
        return call

    return decorator
