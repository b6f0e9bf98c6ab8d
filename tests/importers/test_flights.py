"""Other people's importers fly FMUs of ours as the numpy reference does, at every communication point."""

import pytest

from importers.cells import run
from importers.known import KNOWN, explains
from importers.scenes import COURSES
from importers.table import ROWS

pytestmark = pytest.mark.importers


@pytest.mark.parametrize("name", COURSES)
@pytest.mark.parametrize("key", ROWS)
def test_an_importer_flies_as_the_reference_does(key, name):
    cell, fault = run(key, name), KNOWN.get((key, name))
    if cell.lacking:
        pytest.skip(cell.lacking)
    if fault is None:
        assert cell.passed, cell
    else:
        assert not cell.passed, f"this fault of the importer is gone: {fault.reason}"
        assert explains(fault, cell), cell
