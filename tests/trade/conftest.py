"""What tests of a trade share."""

import pytest

from fmu_build.flight.workshop import workshop
from support.processes import cache

__all__ = ["cache"]


@pytest.fixture
def shop():
    """A workshop."""
    with workshop() as shop:
        yield shop
