"""Equations that a scene's composite repeats for each vessel: each is made a graph once, then reused."""

from collections.abc import Callable

import casadi as ca


def inlined(*sizes: tuple[int, ...]) -> Callable[[Callable[..., ca.SX]], Callable[..., ca.SX]]:
    """Returns a decorator by which a function of CasADi expressions is evaluated from a graph made once.

    sizes : shapes of the function's arguments, which must be dense and are given by position
    The operations are the same as without the decorator, and constants fold likewise; a call takes a small
    part of the time.
    """

    def decorator(function: Callable[..., ca.SX]) -> Callable[..., ca.SX]:
        symbols = [ca.SX.sym(f"a{i}", *size) for i, size in enumerate(sizes)]
        graph = ca.Function(function.__name__, symbols, [function(*symbols)])

        def call(*arguments: ca.SX) -> ca.SX:
            return graph(*arguments)

        call.__doc__, call.__name__ = function.__doc__, function.__name__
        return call

    return decorator
