"""The same scene gives the same bytes for every platform, in whatever folder and by whatever cache."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from fmu_build import build_fmu
from fmu_build.platforms import PLATFORMS
from support import ISS_DG, scene

pytestmark = pytest.mark.platforms

BUILD = """
import sys
from fmu_build import build_fmu
from fmu_build.platforms import PLATFORMS
from support import ISS_DG, scene
build_fmu(scene(ISS_DG), sys.argv[1], int(sys.argv[2]), PLATFORMS)
"""


def contents(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


@pytest.fixture(scope="module")
def empty_cache(tmp_path_factory) -> Path:
    """Returns a folder for the compiler's cache, empty for the first build: that takes minutes."""
    return tmp_path_factory.mktemp("cache")


@pytest.mark.parametrize("fmi", [3, 2])
def test_archives_are_identical_whatever_the_folders_and_the_compilers_cache(tmp_path, empty_cache, fmi):
    here = build_fmu(scene(ISS_DG), tmp_path / "here.fmu", fmi, PLATFORMS)
    elsewhere = tmp_path / "a folder elsewhere"
    temporary = elsewhere / "of a name much longer than the other's"
    temporary.mkdir(parents=True)
    tests = str(Path(__file__).parents[1])
    environment = {
        "TMPDIR": str(temporary),
        "HOME": str(elsewhere),
        "SUPERVESSEL_CACHE": str(empty_cache),
        "PYTHONPATH": os.pathsep.join([tests, *sys.path]),
        "PYTHONHASHSEED": "1",
    }
    subprocess.run(
        [sys.executable, "-c", BUILD, "there.fmu", str(fmi)],
        cwd=elsewhere,
        env=os.environ | environment,
        check=True,
        timeout=3600.0,
    )
    expected, found = contents(here), contents(elsewhere / "there.fmu")
    assert [name for name in expected if found.get(name) != expected[name]] == []
    assert (elsewhere / "there.fmu").read_bytes() == here.read_bytes()
