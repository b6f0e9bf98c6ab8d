"""A cache of the tests' own, removed at the end; how many random scenes the long run confirms."""

import os
import tempfile

import pytest

SCENES = 200


def pytest_addoption(parser):
    parser.addoption("--scenes", type=int, default=SCENES, help="random scenes that make accuracy confirms")


@pytest.fixture(scope="session", autouse=True)
def cache():
    before = os.environ.get("SUPERVESSEL_CACHE")
    with tempfile.TemporaryDirectory(prefix="supervessel-test-") as folder:
        os.environ["SUPERVESSEL_CACHE"] = folder
        yield folder
    if before is None:
        del os.environ["SUPERVESSEL_CACHE"]
    else:
        os.environ["SUPERVESSEL_CACHE"] = before


@pytest.fixture
def scene_count(request):
    return request.config.getoption("--scenes", default=SCENES)
