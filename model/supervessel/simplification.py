"""Whether CasADi simplifies expressions as they are built: what our functions compute depends on it."""

from collections.abc import Iterator
from contextlib import contextmanager

import casadi as ca


@contextmanager
def simplification(on: bool) -> Iterator[None]:
    """Sets whether CasADi simplifies expressions in a block; then the caller's own setting holds again."""
    before = ca.GlobalOptions.getSimplificationOnTheFly()
    ca.GlobalOptions.setSimplificationOnTheFly(on)
    try:
        yield
    finally:
        ca.GlobalOptions.setSimplificationOnTheFly(before)
