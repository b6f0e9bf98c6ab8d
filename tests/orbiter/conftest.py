"""The folder of small files that the tests of the import change."""

import pytest

from orbiter.files import Files


@pytest.fixture
def files(tmp_path):
    return Files(tmp_path)
