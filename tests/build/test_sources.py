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
from fmpy.build import build_platform_binary
from fmpy.model_description import read_build_description, read_model_description
from lxml import etree

from fmu_build.compile.compiler import fmi_headers
from fmu_build.generate.model import generate
from fmu_build.generate.picked_files import PICKED
from fmu_build.generate.picked_files import STEPS as OF_STEPS
from fmu_build.generate.sources import LAYER, layer_files, source_file_names, source_files
from fmu_build.storage.cache import cache_folder
from jets.scenes import STACK
from supervessel.rotation.propagators import PROPAGATORS
from support import ISS_DG, OK, STEADY, Instance, body, built, scene, variant
from support.costs import station
from support.marks import FMI, FMI_3_AT_ONCE, some_at_once
from support.orbits import EARTH, ORBIT
from wheels.scenes import CARRIER

STEP, STEPS = 0.1, 100
"""s, and how many: long enough for a difference of one ulp to grow."""

PILOT = Path(__file__).with_name("pilot.c")

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
    plain = f"-DFMI{fmi}_OVERRIDE_FUNCTION_PREFIX"
    run_compiler(folder, fmi, command, optimised, plain, "-shared", "-o", str(library), "-lm")
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
    "momentum kept by masses": variant(ISS_DG, {"rotation": {"mass_change": "momentum"} | STEADY}),
    "momentum kept": variant(ISS_DG, {"rotation": {"mass_change": "momentum", "pose_change": "momentum"}}),
    "docks": variant(
        ISS_DG,
        {
            "docks": [{"ports": ["ISS.P2", "DG.nose"], "name": "berth", "docked": False}],
            "inputs": {"docked": ["berth"]},
        },
    ),
    "wheels": CARRIER,
    "flows": variant(STACK, {"rotation.propagator": "taylor"}),
    "field": variant(body(propagator="taylor"), {"inputs.gravity": True, "gravity": {"mu": EARTH, **ORBIT}}),
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


def test_no_two_files_of_the_layer_have_a_function_of_their_own_with_the_same_name():
    """All files of an FMU are compiled as one; only those of FMI 2 and 3 never meet."""
    owners: dict[str, set[str]] = {}
    for path in LAYER.glob("*.c"):
        text = path.read_text(encoding="utf-8")
        for name in re.findall(r"^static (?:inline )?[A-Za-z_][\w ]*?\*?\b(\w+)\(", text, re.MULTILINE):
            owners.setdefault(name, set()).add(path.stem)
    assert len(owners) > 100
    shared = {name: files for name, files in owners.items() if len(files) > 1}
    assert all(name.startswith("fmi") for files in shared.values() for name in files), shared


@pytest.mark.parametrize("path", sorted(LAYER.glob("*.[ch]")), ids=lambda path: path.name)
def test_a_file_of_the_layer_opens_with_its_subject_and_names_only_python_that_is_there(path):
    text, root = path.read_text(encoding="utf-8"), LAYER.parents[1]
    assert re.match(r"/\* [A-Z]", text)
    for name in re.findall(r"[\w/]+\.py\b", text):
        assert (root / name).is_file() or (root / "model" / name).is_file(), name


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
        (plain,) = file_set.findall("PreprocessorDefinition")
        assert (plain.get("name"), plain.get("optional")) == ("FMI3_OVERRIDE_FUNCTION_PREFIX", "true")
        libraries = [(lib.get("name"), lib.get("external")) for lib in configuration.findall("Library")]
        assert libraries == ([("m", "true")] if configuration.get("platform") else [])


def test_fmi_2_lists_its_source_files_in_the_model_description():
    listed = (
        read_model_description(str(built(ISS_DG, 2))).buildConfigurations[0].sourceFileSets[0].sourceFiles
    )
    assert listed == sorted(name for name in packed_sources(2) if name.endswith(".c"))


@pytest.mark.parametrize("compiler", some_at_once(list(COMPILERS), "gcc"))
@FMI_3_AT_ONCE
def test_the_sources_compile_to_a_library_with_bit_identical_results(tmp_path, fmi, compiler):
    fmpy.extract(str(built(ISS_DG, fmi, optimised=True)), unzipdir=str(tmp_path))
    expected = flight(tmp_path)
    compiled(tmp_path, fmi, COMPILERS[compiler])
    assert len(expected) == STEPS + 1
    assert flight(tmp_path).tobytes() == expected.tobytes()


# Several FMUs in one program.

FMI_2_HEADER = """\
#include "{folder}/fmi2TypesPlatform.h"
#include "{folder}/fmi2FunctionTypes.h"
#if !defined(FMI2_OVERRIDE_FUNCTION_PREFIX) && defined(FMI2_FUNCTION_PREFIX)
#define fmi2Paste(a, b) a##b
#define fmi2PasteB(a, b) fmi2Paste(a, b)
#define fmi2FullName(name) fmi2PasteB(FMI2_FUNCTION_PREFIX, name)
#else
#define fmi2FullName(name) name
#endif
#define fmi2Version "2.0"
"""
"""How the standard's header begins; FMPy's has been changed so that it never puts a prefix."""


def standard_headers(folder: Path) -> Path:
    """Returns a folder with the headers of both versions that put prefixes before the functions' names."""
    made = folder / "headers"
    shutil.copytree(fmi_headers(), made)
    declared = re.findall(r"FMI2_Export\s+\w+TYPE\s+(\w+);", (made / "fmi2Functions.h").read_text())
    text = FMI_2_HEADER.format(folder=fmi_headers())
    text += "".join(f"#define {name} fmi2FullName({name})\n{name}TYPE {name};\n" for name in declared)
    (made / "fmi2Functions.h").write_text(text)
    return made


PROGRAM = """\
#include <stdio.h>
#include <stddef.h>
{declarations}
int main(void) {{
    const double values[] = {{0.02, 900.0}};
    double read[7];
    int ok = 1;
{begin}
    for (int i = 0; i < {steps}; i++) {{
{step}
    }}
{end}
    return ok ? 0 : 1;
}}
"""
DECLARATIONS = """\
int {pilot}_begin(const char *token, const unsigned references[], const double values[], size_t count);
int {pilot}_step(double time, double h);
int {pilot}_read(const unsigned references[], double values[], size_t count);
static const unsigned {pilot}_set[] = {{{set}}}, {pilot}_out[] = {{{out}}};
"""
SET = ("angular_velocity_start[3]", "torque[1]")
READ = ("state.attitude", "state.angular_velocity")


def program(pilots: dict[str, Instance]) -> str:
    """Returns C that flies FMUs step by step, turn by turn, and prints the states at the end of each."""

    def lines(form: str) -> str:
        return "\n".join(form.format(pilot=pilot, token=it.description.guid) for pilot, it in pilots.items())

    declarations = ""
    for pilot, it in pilots.items():
        names = [name for group in READ for name in it.names(group)]
        references = [", ".join(str(it.references[name]) for name in some) for some in (SET, names)]
        declarations += DECLARATIONS.format(pilot=pilot, set=references[0], out=references[1])
    return PROGRAM.format(
        declarations=declarations,
        steps=STEPS,
        begin=lines('    ok = ok && {pilot}_begin("{token}", {pilot}_set, values, 2);'),
        step=lines(f"        ok = ok && {{pilot}}_step(i * {STEP}, {STEP});"),
        end=lines(
            "    ok = ok && {pilot}_read({pilot}_out, read, 7);\n"
            "    for (int i = 0; i < 7; i++) printf(\"%a%c\", read[i], i < 6 ? ' ' : '\\n');"
        ),
    )


def test_the_sources_of_fmus_of_both_versions_are_linked_into_one_program_and_fly(tmp_path):
    headers, pilots, objects = standard_headers(tmp_path), {}, []
    gcc = [*COMPILERS["gcc"], "-O0", "-I", str(headers)]
    for fmi in (2, 3):
        for raw in (ISS_DG, {**body(), "inputs": {"torque": True}}):
            folder = tmp_path / f"{raw['name']}_{fmi}"
            fmpy.extract(str(built(raw, fmi)), unzipdir=str(folder))
            run_compiler(folder, fmi, gcc, "-c")
            prefix = f"-DFMI{fmi}_FUNCTION_PREFIX={raw['name']}_"
            pilot = folder / "pilot.o"
            command = [*gcc, f"-DFMI={fmi}", prefix, "-c", str(PILOT), "-o", str(pilot)]
            subprocess.run(command, check=True, timeout=60.0)
            objects += [*map(str, folder.glob("sources/*.o")), str(pilot)]
            pilots[f"{raw['name']}_pilot{fmi}"] = Instance(raw, fmi)
    main = tmp_path / "main.c"
    main.write_text(program(pilots))
    subprocess.run([*gcc, str(main), *objects, "-lm", "-o", str(tmp_path / "all")], check=True, timeout=60.0)
    flown = subprocess.run([str(tmp_path / "all")], capture_output=True, text=True, check=True, timeout=60.0)
    for instance, line in zip(pilots.values(), flown.stdout.splitlines(), strict=True):
        assert instance.initialise(**dict(zip(SET, (0.02, 900.0), strict=True))) == OK
        for i in range(STEPS):
            instance.time = i * STEP
            assert instance.step(STEP) == OK
        assert [float.fromhex(number) for number in line.split()] == [
            number for group in READ for number in instance.get(group)
        ]
        instance.free()


@FMI_3_AT_ONCE
def test_fmpy_compiles_the_sources_to_a_library_that_it_flies(tmp_path, fmi):
    """As `fmpy compile` does: FMPy passes what buildDescription.xml lists, and nothing else on Linux."""
    if shutil.which("cmake") is None:
        pytest.skip("cmake is not installed (Debian package cmake)")
    fmpy.extract(str(built(ISS_DG, fmi)), unzipdir=str(tmp_path))
    expected, library = flight(tmp_path), next(tmp_path.glob("binaries/*/*"))
    library.unlink()
    build = tmp_path / "build"
    build.mkdir()
    build_platform_binary(tmp_path, build, cmake_options={"CMAKE_C_FLAGS_RELEASE:STRING": "-O0"})
    assert library.is_file()
    assert flight(tmp_path).tobytes() == expected.tobytes()


@FMI_3_AT_ONCE
def test_a_shared_library_made_of_the_sources_has_the_plain_names(tmp_path, fmi):
    """The macro is that of the standard's headers (FMI 2.0.4: 2.1.1)."""
    fmpy.extract(str(built(ISS_DG, fmi)), unzipdir=str(tmp_path))
    headers, library = standard_headers(tmp_path), tmp_path / "plain.so"
    options = ["-O0", f"-DFMI{fmi}_OVERRIDE_FUNCTION_PREFIX", "-shared", "-o", str(library), "-lm"]
    run_compiler(tmp_path, fmi, [*COMPILERS["gcc"], "-I", str(headers)], *options)
    names = exported(library)
    assert f"fmi{fmi}DoStep" in names
    assert not [name for name in names if not name.startswith((f"fmi{fmi}", f"iss_dg_fmi{fmi}_"))]
