"""A cache of the tests' own: nothing has been flown before, and the compiler starts cold once."""

import pytest

from supervessel.trade.flight import workshop


@pytest.fixture(scope="session", autouse=True)
def cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("cache")
        patch.setenv("SUPERVESSEL_CACHE", str(folder))
        yield folder


@pytest.fixture
def shop():
    """A workshop."""
    with workshop() as shop:
        yield shop
