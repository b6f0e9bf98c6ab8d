"""The sources in an FMU: complete, described as the standard wants, and giving the library's own results."""

import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.model_description import read_build_description, read_model_description
from lxml import etree

from fmu_build.compile.compiler import fmi_headers
from fmu_build.generate.model import generate
from fmu_build.generate.picked_files import PICKED
from fmu_build.generate.picked_files import STEPS as OF_STEPS
from fmu_build.generate.sources import LAYER, layer_files, source_file_names, source_files
from fmu_build.storage.cache import cache_folder
from supervessel.rotation.propagators import PROPAGATORS
from support import ISS_DG, body, built, scene, variant
from support.costs import station
from support.marks import FMI

STEP, STEPS = 0.1, 100
"""s, and how many: long enough for a difference of one ulp to grow."""

INPUTS = {"DG.mass": 12000.0, "torque[1]": 900.0, "torque[2]": -1500.0, "angular_velocity_start[3]": 0.02}

STANDARD_HEADERS = {path.name for path in fmi_headers().glob("fmi*.h")}
LIBRARY_HEADERS = {
    "fenv.h",
    "float.h",
    "locale.h",
    "math.h",
    "stdarg.h",
    "stdbool.h",
    "stddef.h",
    "stdint.h",
    "stdio.h",
    "stdlib.h",
}
LIBRARY_HEADERS |= {"limits.h", "string.h"}

GENERATED = {"model.c": "/* */", "scene.c": "/* */", "scene.h": "/* */"}


def packed_sources(fmi: int) -> dict[str, str]:
    """Returns the files in sources/ of a built FMU."""
    with zipfile.ZipFile(built(ISS_DG, fmi)) as archive:
        return {
            name.removeprefix("sources/"): archive.read(name).decode()
            for name in archive.namelist()
            if name.startswith("sources/")
        }


COMPILERS = {
    "gcc": ["gcc", "-std=c99"],
    "gcc, its own C and this CPU": ["gcc", "-std=gnu99", "-march=native"],
    "zig": [sys.executable, "-m", "ziglang", "cc", "-std=c99"],
}
"""The last is Clang. The second and, on their own, Clang fuse products and sums where the CPU can."""


def run_compiler(folder: Path, fmi: int, command: list[str], *options: str) -> None:
    """Compiles the source files that an FMU unpacked in `folder` lists, with only the standard's headers."""
    if shutil.which(command[0]) is None:
        pytest.skip(f"{command[0]} is not installed (Debian package {command[0]})")
    if fmi == 3:
        configurations = read_build_description(str(folder))
    else:
        configurations = read_model_description(str(folder)).buildConfigurations
    sources = configurations[0].sourceFileSets[0].sourceFiles
    cache = str(cache_folder())
    subprocess.run(
        [*command, "-fPIC", "-I", str(fmi_headers()), *sources, *options],
        cwd=folder / "sources",
        env=os.environ | {"ZIG_GLOBAL_CACHE_DIR": cache, "ZIG_LOCAL_CACHE_DIR": cache},
        check=True,
        timeout=300.0,
    )


def compiled(folder: Path, fmi: int, command: list[str], optimised: str = "-O2") -> Path:
    """Compiles an FMU unpacked in `folder` and puts the library in the place of its own."""
    library = next(folder.glob("binaries/*/*"))
    library.unlink()
    run_compiler(folder, fmi, command, optimised, "-shared", "-o", str(library), "-lm")
    return library


def exported(library: Path) -> set[str]:
    """Returns the names that an ELF library exports."""
    listed = subprocess.run(
        ["nm", "--dynamic", "--defined-only", str(library)], capture_output=True, text=True, check=True
    )
    return {line.split()[-1] for line in listed.stdout.splitlines()}


def flight(folder: Path) -> np.ndarray:
    """Returns the outputs over a short co-simulation of an unpacked FMU."""
    result: np.ndarray = fmpy.simulate_fmu(
        str(folder),
        stop_time=STEP * STEPS,
        step_size=STEP,
        output_interval=STEP,
        start_values=INPUTS,
        fmi_type="CoSimulation",
    )
    return result


@FMI
def test_every_header_included_is_packed_or_the_standards_or_the_c_librarys(fmi):
    files = packed_sources(fmi)
    for name, text in files.items():
        own = set(re.findall(r'#include "(.*?)"', text))
        assert own <= files.keys() | STANDARD_HEADERS, name
        assert set(re.findall(r"#include <(.*?)>", text)) <= LIBRARY_HEADERS, name
    assert not files.keys() & STANDARD_HEADERS


@pytest.mark.parametrize(("fmi", "other"), [(2, "fmi3"), (3, "fmi2")])
def test_only_the_layer_of_the_version_is_packed(fmi, other):
    names = packed_sources(fmi).keys()
    assert {f"fmi{fmi}.c", "model.c", "scene.c", "scene.h"} <= names
    assert not [name for name in names if name.startswith(other)]


@FMI
def test_every_c_file_is_to_be_compiled(fmi):
    listed = source_file_names(GENERATED, fmi)
    packed = source_files(GENERATED, fmi, "name")
    assert [f"sources/{name}" for name in listed] == [name for name in packed if name.endswith(".c")]


@FMI
def test_generated_files_do_not_hide_those_of_the_layer(fmi):
    files = packed_sources(fmi)
    for name, text in layer_files(fmi).items():
        assert files[name].endswith(text)


SCENES = {
    "exact": body(propagator="exact") | {"inputs": {"torque": False}},
    **{name: body(propagator=name) for name in PROPAGATORS if name != "exact"},
    "auto": variant(ISS_DG, {"rotation.propagator": "auto"}),
    "momentum kept by masses": variant(ISS_DG, {"rotation.mass_change": "momentum"}),
    "momentum kept": variant(ISS_DG, {"rotation": {"mass_change": "momentum", "pose_change": "momentum"}}),
    "docks": variant(
        ISS_DG,
        {
            "docks": [{"ports": ["ISS.P2", "DG.nose"], "name": "berth", "docked": False}],
            "inputs": {"docked": ["berth"]},
        },
    ),
    "bounded": variant(body(propagator="rk4"), {"outputs.names": ["error_bound"]}),
    "many vessels": station(60, [f"v{i}" for i in range(60)]),
}


def picked(raw: dict[str, Any]) -> set[str]:
    """Returns the files of PICKED, without .c and .h, that a scene's FMU has."""
    return {name.partition(".")[0] for name in generate(scene(raw), 3)[0]} & PICKED


def test_every_file_that_only_some_scenes_need_is_there_and_in_some_fmu():
    assert {path.stem for path in LAYER.glob("*.[ch]")} > PICKED
    assert set().union(*map(picked, SCENES.values())) == PICKED


def test_an_fmu_holds_the_sub_steps_of_its_own_propagator_alone():
    assert picked(SCENES["rk4"]) & OF_STEPS == {"rk4", "every_step"}
    assert picked(SCENES["dop853"]) & OF_STEPS == {"dop853", "tried_steps", "estimated_steps", "every_step"}
    assert picked(SCENES["exact"]) & OF_STEPS == {"exact", "free_step", "free_motion"}


@pytest.mark.parametrize("path", sorted(LAYER.glob("*.[ch]")), ids=lambda path: path.name)
def test_a_file_of_the_layer_opens_with_its_subject_and_names_only_python_that_is_there(path):
    text, root = path.read_text(encoding="utf-8"), LAYER.parents[1]
    assert re.match(r"/\* [A-Z]", text)
    for name in re.findall(r"[\w/]+\.py\b", text):
        assert (root / name).is_file() or (root / "model" / name).is_file(), name


@FMI
def test_no_source_file_fixes_a_prefix_of_the_function_names(fmi):
    for name, text in packed_sources(fmi).items():
        assert "FUNCTION_PREFIX" not in text, name


def test_build_description_obeys_its_schema():
    schema = etree.XMLSchema(file=str(Path(fmpy.__file__).parent / "schema/fmi3/fmi3BuildDescription.xsd"))
    schema.assertValid(etree.fromstring(source_files(GENERATED, 3, "name")["sources/buildDescription.xml"]))


def test_build_description_says_how_to_compile_for_each_platform():
    root = etree.fromstring(source_files(GENERATED, 3, "iss_dg")["sources/buildDescription.xml"])
    configurations = root.findall("BuildConfiguration")
    assert [c.get("platform") for c in configurations] == [None, "aarch64-linux", "x86_64-linux"]
    for configuration in configurations:
        assert configuration.get("modelIdentifier") == "iss_dg"
        (file_set,) = configuration.findall("SourceFileSet")
        assert file_set.get("language") == "C99"
        assert [f.get("name") for f in file_set.findall("SourceFile")] == source_file_names(GENERATED, 3)
        assert [d.get("name") for d in file_set.findall("IncludeDirectory")] == ["."]
        assert not file_set.findall("PreprocessorDefinition")
        libraries = [(lib.get("name"), lib.get("external")) for lib in configuration.findall("Library")]
        assert libraries == ([("m", "true")] if configuration.get("platform") else [])


def test_fmi_2_lists_its_source_files_in_the_model_description():
    listed = (
        read_model_description(str(built(ISS_DG, 2))).buildConfigurations[0].sourceFileSets[0].sourceFiles
    )
    assert listed == sorted(name for name in packed_sources(2) if name.endswith(".c"))


@pytest.mark.parametrize("compiler", COMPILERS)
@FMI
def test_the_sources_compile_to_a_library_with_bit_identical_results(tmp_path, fmi, compiler):
    fmpy.extract(str(built(ISS_DG, fmi)), unzipdir=str(tmp_path))
    expected = flight(tmp_path)
    compiled(tmp_path, fmi, COMPILERS[compiler])
    assert len(expected) == STEPS + 1
    assert flight(tmp_path).tobytes() == expected.tobytes()


@FMI
def test_all_names_that_a_linker_sees_are_fmis_or_begin_with_the_models(tmp_path, fmi):
    fmpy.extract(str(built(ISS_DG, fmi)), unzipdir=str(tmp_path))
    names = exported(compiled(tmp_path, fmi, COMPILERS["gcc"], "-O0"))
    assert f"fmi{fmi}DoStep" in names
    assert not [name for name in names if not name.startswith((f"fmi{fmi}", "iss_dg_"))]


def test_fmus_linked_into_one_program_with_prefixes_do_not_clash(tmp_path):
    """For FMI 3.0 only: FMPy's header of FMI 2.0 is changed so that it never puts a prefix."""
    objects: list[str] = []
    for raw in (ISS_DG, body()):
        folder = tmp_path / raw["name"]
        fmpy.extract(str(built(raw)), unzipdir=str(folder))
        run_compiler(folder, 3, COMPILERS["gcc"], "-O0", f"-DFMI3_FUNCTION_PREFIX={raw['name']}_", "-c")
        objects += map(str, folder.glob("sources/*.o"))
    both = tmp_path / "both.so"
    subprocess.run(["gcc", "-shared", "-o", str(both), *objects, "-lm"], check=True, timeout=60.0)
    names = exported(both)
    assert {"iss_dg_fmi3DoStep", "body_fmi3DoStep"} <= names
    assert not [name for name in names if name.startswith("fmi")]
