"""What tests of an accuracy share; how many random scenes the long run confirms."""

import pytest

from support.processes import cache

__all__ = ["cache"]

SCENES = 200


def pytest_addoption(parser):
    parser.addoption("--scenes", type=int, default=SCENES, help="random scenes that make accuracy confirms")


@pytest.fixture
def scene_count(request):
    return request.config.getoption("--scenes", default=SCENES)
