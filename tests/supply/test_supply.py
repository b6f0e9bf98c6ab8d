"""What the package is made of: versions that are tested, and what the wheel says of itself."""

import json
import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from importlib.metadata import distributions, requires, version
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from support.pages import PAGES, ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
OWN = PROJECT["project"]["name"]

PINNED = re.compile(r'[A-Za-z0-9_.-]+==[A-Za-z0-9_.!+-]+( ; python_version == "3\.11")?')

as_installed = pytest.mark.skipif(
    Path(sys.prefix).resolve() != ROOT / ".venv" or sys.version_info[:2] != (3, 11),
    reason="needs the environment that make test installs, on Python 3.11",
)


def pinned(name):
    """Returns versions by canonical names from a file of constraints."""
    lines = (ROOT / "tests" / name).read_text().splitlines()[1:]
    assert [line for line in lines if not PINNED.fullmatch(line)] == []
    found = [Requirement(line) for line in lines]
    return {canonicalize_name(one.name): str(one.specifier).removeprefix("==") for one in found}


@pytest.mark.parametrize("extra", ["", "plot", "examples"])
def test_lower_bounds_are_the_versions_that_make_lowest_tests(extra):
    project = PROJECT["project"]
    given = project["optional-dependencies"][extra] if extra else project["dependencies"]
    bounds = [one for one in map(Requirement, given) if one.name != OWN]
    lowest = pinned("lowest.txt")
    assert {one.name: str(one.specifier) for one in bounds} == {
        one.name: f">={lowest[canonicalize_name(one.name)]}" for one in bounds
    }


@as_installed
def test_everything_that_is_installed_has_the_version_of_the_constraints():
    installed = {canonicalize_name(one.name): one.version for one in distributions()}
    assert installed.pop(OWN) == PROJECT["project"]["version"]
    constraints = pinned("constraints.txt")
    assert installed == {name: constraints.get(name, "not constrained") for name in installed}


def test_constraints_are_for_the_tested_python_alone():
    lines = (ROOT / "tests" / "constraints.txt").read_text().splitlines()
    assert lines[0].startswith("# Versions that are tested, by make constraints")
    assert all(line.endswith(' ; python_version == "3.11"') for line in lines[1:])


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The files of a wheel, built here and now by what is installed, by path."""
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "--no-index"]
    done = subprocess.run(
        [*command, "--wheel-dir", str(folder), str(ROOT)],
        capture_output=True,
        text=True,
        check=False,
        cwd=folder,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    (file,) = folder.iterdir()
    with zipfile.ZipFile(file) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


@pytest.fixture(scope="module")
def bill(wheel):
    """The bill of materials in the wheel."""
    (name,) = (name for name in wheel if ".dist-info/sboms/" in name)
    assert name.endswith(".dist-info/sboms/supervessel.cdx.json")
    return json.loads(wheel[name])


@pytest.mark.parametrize("package", ["supervessel", "fmu_build"])
def test_the_wheel_tells_type_checkers_that_its_packages_are_typed(wheel, package):
    assert f"{package}/py.typed" in wheel


def test_the_wheel_holds_no_page_whose_links_would_lead_nowhere(wheel):
    assert [name for name in wheel if name.endswith(".md")] == []


def test_the_source_archive_holds_every_page_and_picture(tmp_path):
    command = [sys.executable, "-m", "hatchling", "build", "-t", "sdist", "-d", str(tmp_path)]
    subprocess.run(command, check=True, capture_output=True, cwd=ROOT)
    (file,) = tmp_path.iterdir()
    with tarfile.open(file) as archive:
        held = {name.partition("/")[2] for name in archive.getnames()}
    assert {*PAGES, "examples/launch_stack.svg", "examples/iss_dg.png"} <= held


def needed():
    """Returns the packages that the installed one needs, with those that each of them needs."""
    found, names = {}, [OWN]
    while names:
        name = names.pop()
        if name not in found:
            wanted = [Requirement(one) for one in requires(name) or ()]
            found[name] = {
                canonicalize_name(one.name)
                for one in wanted
                if one.marker is None or one.marker.evaluate({"extra": ""})
            }
            names += found[name]
    return found


@as_installed
def test_the_bill_of_materials_lists_what_is_needed_with_its_version(bill):
    listed = {canonicalize_name(one["name"]): one["version"] for one in bill["components"]}
    assert listed == {name: version(name) for name in needed() if name != OWN}
    root = bill["metadata"]["component"]
    assert (root["name"], root["version"]) == (OWN, PROJECT["project"]["version"])


@as_installed
def test_the_bill_of_materials_says_what_needs_what(bill):
    names = {one["bom-ref"]: canonicalize_name(one["name"]) for one in bill["components"]}
    names[bill["metadata"]["component"]["bom-ref"]] = OWN
    said = {
        names[one["ref"]]: {names[ref] for ref in one.get("dependsOn", ())} for one in bill["dependencies"]
    }
    for name, wanted in needed().items():
        named = {canonicalize_name(Requirement(one).name) for one in requires(name) or ()}
        assert wanted <= said[name] <= named  # optional ones too, where something else needs them


def test_the_bill_of_materials_has_no_address_path_or_time(bill):
    assert bill["bomFormat"] == "CycloneDX"
    assert "serialNumber" not in bill
    assert "timestamp" not in bill["metadata"]
    assert re.findall(r"\w+://|\"/\w|\bfile:", json.dumps(bill)) == []
