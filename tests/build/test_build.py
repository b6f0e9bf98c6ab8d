"""From a scene to an FMU: the same bytes every time, only what was asked for, C that compiles cleanly."""

import re
import shutil
import struct
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest

import fmu_build
from fmu_build import BuildError, build_fmu
from fmu_build.compile.compiler import compile_library, fmi_headers
from fmu_build.compile.library import compile_sources
from fmu_build.generate.model import generate
from fmu_build.generate.sources import source_file_names, source_files
from fmu_build.platforms import PLATFORMS, host_platform
from supervessel import load_scene
from support import BALL, ISS_DG, PARAMETERS, STATES, STEADY, body, built, scene, variant
from support.marks import FMI, FMI_3_AT_ONCE, some_at_once

LAYER = Path(fmu_build.__file__).parent / "c"
NOSE = "vessels.DG.ports.nose"
BARE = variant(ISS_DG, {"inputs": None, "outputs.names": []})
needs_elf = pytest.mark.skipif(sys.platform != "linux", reason="reads ELF, the library format of Linux")


def token(raw: dict[str, Any], fmi: int = 3) -> str:
    """Returns the token of a scene's FMU, without compiling it."""
    root = ET.fromstring(generate(scene(raw), fmi)[1])
    return root.get("instantiationToken" if fmi == 3 else "guid") or ""


@FMI
def test_a_scene_gives_the_same_bytes_in_every_folder(tmp_path, fmi):
    paths = [tmp_path / "one" / "a.fmu", tmp_path / "other" / "folder" / "b.fmu"]
    for path in paths:
        path.parent.mkdir(parents=True)
        build_fmu(scene(ISS_DG), path, fmi)
    one, other = (path.read_bytes() for path in paths)
    assert one == other


@FMI
def test_the_archive_holds_one_library_and_what_the_standard_has_beside_it(fmi):
    folder = host_platform().folder(fmi)
    with zipfile.ZipFile(built(ISS_DG, fmi, optimised=True)) as archive:
        names = archive.namelist()
    assert names[0] == f"binaries/{folder}/iss_dg{host_platform().suffix}"
    folders = {name.partition("/")[0] for name in names[1:]}
    icon = {"model.png"} if fmi == 2 else set()
    beside = {"documentation", "extra", "modelDescription.xml", "resources", "sources", "terminalsAndIcons"}
    assert folders == beside | icon


@FMI
def test_the_library_carries_the_token_of_the_description(fmi):
    with zipfile.ZipFile(built(ISS_DG, fmi, optimised=True)) as archive:
        library, description = archive.read(archive.namelist()[0]), archive.read("modelDescription.xml")
    assert token(ISS_DG, fmi).encode() in description
    assert token(ISS_DG, fmi).encode() in library


@pytest.mark.parametrize(
    "change",
    [
        {"name": "iss_dg2"},
        {"root": "DG"},
        {"vessels.ISS.mass": 455000.00000000006},
        {"vessels.DG.mass": 24500.000000000004},
        {"vessels.ISS.pmi": [385.0, 719.0, 508.00000000000006]},
        {"vessels.ISS.centre_of_mass": [0.0, 0.0, 1e-3]},
        {f"{NOSE}.position": [0.0, -0.49, -10.0]},
        {"vessels.ISS.ports.P2.direction": [0.0, -1.0, 1e-4]},
        {"inputs.mass": []},
        {"inputs.torque": False},
        {"inputs.range": {"DG.mass": [11000.0, 24500.0]}},
        {"rotation.law": "principal"},
        {"rotation.max_angle_step": 0.04},
        {"rotation.angular_velocity": [0.0, 0.0, 1e-3]},
        {"rotation.attitude": [0.0, 1.0, 0.0, 0.0]},
        {"experiment": {"duration": 600.0, "step": 0.1}},
        {"outputs.names": ["mass", "pmi"]},
    ],
    ids=lambda change: next(iter(change)),
)
@FMI_3_AT_ONCE
def test_a_change_of_the_scene_changes_the_token(change, fmi):
    assert token(variant(ISS_DG, change), fmi) != token(ISS_DG, fmi)


@pytest.mark.parametrize(
    "text",
    [
        "# a ball\n" + BALL,
        BALL.replace("\n", "   # SI\r\n\r\n"),
        BALL.replace("2.0", "2").replace("1.5", "15e-1"),
        'root = "B"\nname = "ball"\nvessels.B = {pmi = [1.0, 1.5, 2.0], mass = 2.0}\n',
        BALL + '[rotation]\nlaw = "tensor"\nmax_angle_step = 0.05\n',
    ],
    ids=["comment", "white space", "numbers", "order of keys", "defaults"],
)
def test_the_same_scene_in_other_words_keeps_the_token(tmp_path, text):
    tokens = []
    for name, words in (("one", BALL), ("other", text)):
        path = tmp_path / f"{name}.toml"
        path.write_bytes(words.encode())
        tokens.append(ET.fromstring(generate(load_scene(path), 3)[1]).get("instantiationToken"))
    assert tokens[0] == tokens[1]


def vector(name: str, size: int = 3) -> list[str]:
    return [f"{name}[{i}]" for i in range(1, size + 1)]


LOCALS = [*STATES, *(f"der({state})" for state in STATES)]


@pytest.mark.parametrize(
    ("inputs", "outputs", "input_names", "output_names"),
    [
        ({}, ["mass"], [], ["mass"]),
        ({"torque": True}, [], vector("torque"), []),
        ({"mass": ["DG", "ISS"]}, ["kinetic_energy"], ["DG.mass", "ISS.mass"], ["kinetic_energy"]),
        ({"pmi": ["ISS"]}, ["attitude", "pmi"], vector("ISS.pmi"), [*vector("attitude", 4), *vector("pmi")]),
        (
            {"mass": ["DG"], "pose": ["DG.nose"], "torque": True},
            ["inertia", "barycentre", "angular_momentum"],
            [
                "DG.mass",
                *vector("DG.nose.position"),
                *vector("DG.nose.direction"),
                *vector("DG.nose.alignment"),
                *vector("torque"),
            ],
            [
                *(f"inertia[{i},{j}]" for i in (1, 2, 3) for j in (1, 2, 3)),
                *vector("barycentre"),
                *vector("angular_momentum"),
            ],
        ),
    ],
    ids=["none", "torque", "masses", "pmi", "pose"],
)
@FMI
def test_the_description_has_only_what_the_scene_lists(inputs, outputs, input_names, output_names, fmi):
    raw = variant(ISS_DG, {"inputs": inputs, "outputs.names": outputs})
    root = ET.fromstring(generate(scene(raw), fmi)[1])
    variables = [(v.get("name"), v.get("causality")) for v in root.find("ModelVariables") or ()]
    found = {c: [name for name, causality in variables if causality == c] for _, c in variables}
    expected = {
        "independent": ["time"],
        "input": input_names,
        "parameter": PARAMETERS,
        "output": output_names,
        "local": LOCALS,
    }
    assert found == {causality: names for causality, names in expected.items() if names}


def generated_composite(raw: dict[str, Any]) -> str:
    """Returns the body of the generated function that computes the composite."""
    source = generate(scene(raw), 3)[0]["model.c"]
    found = re.search(r"/\* composite:.*?\{(.*?)\n\}", source, re.DOTALL)
    assert found is not None, source
    return found[1]


@pytest.mark.parametrize("inputs", [{}, {"torque": True}], ids=["no inputs", "torque alone"])
def test_a_composite_without_inputs_is_numbers_that_read_no_argument(inputs):
    source = generated_composite(variant(ISS_DG, {"inputs": inputs}))
    assert "res[0]" in source
    assert "arg[" not in source


def test_a_composite_reads_its_inputs_as_arguments():
    assert "arg[0]" in generated_composite(ISS_DG)


BROKEN_C = "int answer(void) {\n    return 42\n}\n"


def test_a_compiler_that_fails_is_quoted_with_file_and_line(tmp_path):
    source, library = tmp_path / "broken.c", tmp_path / "broken.so"
    source.write_text(BROKEN_C)
    with pytest.raises(BuildError) as caught:
        compile_library([source], host_platform(), library)
    message = str(caught.value)
    assert message.startswith(f"compiler for {host_platform().name} failed:\n")
    assert f"{source}:2:14: error: expected ';' after return statement" in message
    assert not library.exists()


@FMI
def test_a_scene_whose_c_does_not_compile_is_refused_in_the_compilers_words(fmi):
    sources = generate(scene(body()), fmi)[0] | {"model.c": BROKEN_C}
    packed, names = source_files(sources, fmi, "body"), source_file_names(sources, fmi)
    with pytest.raises(BuildError, match=r"model\.c:3:14: error: expected ';' after return statement"):
        compile_sources(packed, names, fmi, [host_platform()], "body")


def test_the_compiler_keeps_its_files_where_supervessel_cache_says(tmp_path, monkeypatch):
    source, cache, home = tmp_path / "small.c", tmp_path / "new" / "cache", tmp_path / "home"
    source.write_text("int answer(void) { return 42; }\n")
    home.mkdir()
    monkeypatch.setenv("SUPERVESSEL_CACHE", str(cache))
    monkeypatch.setenv("HOME", str(home))
    for name in ("XDG_CACHE_HOME", "ZIG_GLOBAL_CACHE_DIR", "ZIG_LOCAL_CACHE_DIR"):
        monkeypatch.delenv(name, raising=False)
    compile_library([source], host_platform(), tmp_path / "small.o", flags=("-c",))
    assert any(cache.iterdir())
    assert not any(home.iterdir())


def test_another_version_of_fmi_is_a_value_error(tmp_path):
    with pytest.raises(ValueError, match=r"^fmi = 4: must be 2 or 3$"):
        build_fmu(scene(body()), tmp_path / "body.fmu", 4)


STRICT = (
    "-std=c99",
    "-Wall",
    "-Wextra",
    "-Wpedantic",
    "-Wconversion",
    "-Wshadow",
    "-Wstrict-prototypes",
)
COMPILERS = {"gcc": ["gcc", "-O2"], "zig": [sys.executable, "-m", "ziglang", "cc", "-O0"]}
"""Warnings of gcc follow the flow of values, as it does when it optimises; those of zig's clang do not."""


DOCKS = variant(
    ISS_DG,
    {
        "docks": [{"ports": ["ISS.P2", "DG.nose"], "name": "berth", "docked": False}],
        "inputs.docked": ["berth"],
    },
)

SHAPES = {
    "every step, free motion": variant(ISS_DG, {"rotation.propagator": "auto"}),
    "steps by error": variant(ISS_DG, {"rotation.propagator": "dop853"}),
    "steps by angle": ISS_DG,
    "kicks": variant(ISS_DG, {"rotation.propagator": "split"}),
    "no inputs and outputs": variant(BARE, {"rotation.propagator": "exact"}),
    "momentum for a state": variant(
        ISS_DG, {"rotation": {"mass_change": "momentum", "pose_change": "momentum"}}
    ),
    "one kind of change keeps momentum": variant(
        ISS_DG, {"rotation": {"mass_change": "momentum", "pose_change": "rate"}}
    ),
    "docks": DOCKS,
    "docks, the rate kept": variant(DOCKS, {"rotation": STEADY}),
    "docks, momentum for a state": variant(DOCKS, {"rotation": {"mass_change": "momentum"}}),
    "a vessel that leaves, and jumps": variant(
        DOCKS, {"outputs.names": ["barycentre_velocity_jump", "DG.velocity", "DG.attitude"]}
    ),
    "jumps, the rate never changes": variant(
        ISS_DG, {"inputs": {"mass": ["DG"]}, "outputs.names": ["barycentre_jump"]}
    ),
}
"""What the C layer compiles differently."""


@pytest.mark.parametrize(
    "raw",
    some_at_once(SHAPES, "every step, free motion", "docks, momentum for a state"),
)
@pytest.mark.parametrize("compiler", COMPILERS)
@FMI_3_AT_ONCE
def test_the_hand_written_c_compiles_without_warnings(tmp_path, fmi, compiler, raw):
    command = COMPILERS[compiler]
    if shutil.which(command[0]) is None:
        pytest.skip(f"{command[0]} is not installed")
    generated = generate(scene(raw), fmi)[0]
    for name in ("scene.h", "scene.c"):
        (tmp_path / name).write_text(generated[name])
    layer = [LAYER / name for name in source_file_names(generated, fmi) if (LAYER / name).exists()]
    sources = [*layer, tmp_path / "scene.c"]
    assert len(sources) >= 6
    options = [*STRICT, "-Werror", f"-I{tmp_path}", f"-I{LAYER}", "-isystem", str(fmi_headers())]
    done = subprocess.run(
        [*command, *options, "-c", *map(str, sources)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_a_scene_without_inputs_and_outputs_compiles_for_both_versions(tmp_path):
    for fmi in (2, 3):
        assert build_fmu(scene(BARE), tmp_path / f"bare{fmi}.fmu", fmi).is_file()


class Elf:
    """What the dynamic linker reads of a 64-bit little-endian ELF library."""

    def __init__(self, content: bytes) -> None:
        assert content[:6] == b"\x7fELF\x02\x01"
        self.content = content
        (offset,) = struct.unpack_from("<Q", content, 0x28)
        size, count = struct.unpack_from("<HH", content, 0x3A)
        rows = [struct.unpack_from("<IIQQQQIIQQ", content, offset + i * size) for i in range(count)]
        self.sections = {row[1]: row for row in rows}  # by type; each type read here occurs once
        self.by_index = rows

    def _text(self, linked: tuple[int, ...], offset: int) -> str:
        start = self.by_index[linked[6]][4] + offset
        return self.content[start : self.content.index(b"\0", start)].decode()

    def _rows(self, kind: int, form: str) -> list[tuple[int, ...]]:
        _, _, _, _, start, size, *_ = self.sections[kind]
        return list(struct.iter_unpack(form, self.content[start : start + size]))

    @property
    def exported(self) -> set[str]:
        """Names of the symbols that the library defines for others."""
        table = self.sections[11]  # SHT_DYNSYM
        symbols = self._rows(11, "<IBBHQQ")[1:]
        return {self._text(table, name) for name, _, _, section, _, _ in symbols if section != 0}

    @property
    def needed(self) -> set[str]:
        """Names of the libraries that it loads."""
        table = self.sections[6]  # SHT_DYNAMIC
        return {self._text(table, value) for tag, value in self._rows(6, "<qQ") if tag == 1}  # DT_NEEDED

    @property
    def versions(self) -> set[str]:
        """Versions of the symbols that it takes from other libraries."""
        table = self.sections[0x6FFFFFFE]  # SHT_GNU_verneed
        found, library = set(), table[4]
        while True:
            _, count, _, first, following = struct.unpack_from("<HHIII", self.content, library)
            version = library + first
            for _ in range(count):
                _, _, _, name, step = struct.unpack_from("<IHHII", self.content, version)
                found.add(self._text(table, name))
                version += step
            if following == 0:
                return found
            library += following


def library(fmi: int) -> Elf:
    with zipfile.ZipFile(built(ISS_DG, fmi, optimised=True)) as archive:
        return Elf(archive.read(archive.namelist()[0]))


def declared_functions(fmi: int) -> set[str]:
    """Returns the functions that the header of the FMI standard declares."""
    header = (fmi_headers() / f"fmi{fmi}Functions.h").read_text()
    return set(re.findall(rf"FMI{fmi}_Export\s+\w+TYPE\s+(\w+);", header))


def test_the_standard_has_75_functions_in_version_3():
    assert len(declared_functions(3)) == 75


@needs_elf
@FMI
def test_the_library_exports_the_functions_of_the_standard_and_no_other(fmi):
    assert library(fmi).exported == declared_functions(fmi)


@needs_elf
@FMI
def test_the_library_needs_the_c_library_alone(fmi):
    assert library(fmi).needed <= {"libc.so.6", "libm.so.6"}


@needs_elf
@FMI
def test_the_library_runs_with_glibc_2_17(fmi):
    versions = {tuple(map(int, name.removeprefix("GLIBC_").split("."))) for name in library(fmi).versions}
    assert (2, 2, 5) in versions or host_platform() is not PLATFORMS[0]
    assert max(versions) <= (2, 17)
