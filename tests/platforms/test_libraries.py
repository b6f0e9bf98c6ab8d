"""The libraries for all platforms, looked at from outside: machine, exports, needs, oldest system."""

import re
import sys
import tempfile
import zipfile
from functools import cache
from pathlib import Path

import pytest

from fmu_build import build_fmu
from fmu_build.compile.compiler import fmi_headers
from fmu_build.generate.sources import LAYER
from fmu_build.platforms import PLATFORMS
from platforms.binaries import read_elf, read_macho, read_pe, read_universal, signed_pages
from support import ISS_DG, scene

pytestmark = pytest.mark.platforms

EM_X86_64, EM_AARCH64 = 62, 183
CPU_X86_64, CPU_ARM64 = 0x01000007, 0x0100000C
PE_X86_64 = 0x8664

OLDEST_GLIBC = (2, 17)
OLDEST_MACOS = (11, 0)
MACOS = 1
"""LC_BUILD_VERSION's number for macOS."""

HARDENING = 0x0020 | 0x0040 | 0x0100
"""High-entropy addresses, relocatable, no execution of data."""

LINKER_NAMES = {"__mh_dylib_header", "___dso_handle"}
"""Zig's linker exports the beginning of the library under these; no importer asks for them."""

DEBUG_REPRODUCIBLE = 16
"""The debug entry that says that the time stamp is a hash; others hold paths."""


@pytest.fixture(scope="session", params=[2, 3])
def fmi(request):
    return request.param


@cache
def libraries(fmi: int, folder: str) -> dict[str, bytes]:
    """Returns the libraries of the FMU for all platforms by their folder in binaries/."""
    path = build_fmu(scene(ISS_DG), f"{folder}/fmi{fmi}.fmu", fmi, PLATFORMS)
    with zipfile.ZipFile(path) as archive:
        return {name.split("/")[1]: archive.read(name) for name in archive.namelist() if "binaries/" in name}


@pytest.fixture
def binaries(fmi, tmp_path_factory) -> dict[str, bytes]:
    return libraries(fmi, str(tmp_path_factory.getbasetemp()))


def functions(fmi: int) -> set[str]:
    """Returns the functions that the standard's header names."""
    header = (fmi_headers() / f"fmi{fmi}Functions.h").read_text()
    return set(re.findall(rf"^#define (fmi{fmi}\w+) +fmi{fmi}FullName", header, re.MULTILINE)) - {
        f"fmi{fmi}FullName"
    }


def macho(binaries: dict[str, bytes], fmi: int, cputype: int) -> bytes:
    """Returns the thin library for a machine, out of the universal one in FMI 2.0."""
    if fmi == 2:
        (thin,) = [content for kind, _, content in read_universal(binaries["darwin64"]) if kind == cputype]
        return thin
    return binaries["x86_64-darwin" if cputype == CPU_X86_64 else "aarch64-darwin"]


ELF = pytest.mark.parametrize("machine", [EM_X86_64, EM_AARCH64])
MACH = pytest.mark.parametrize("cputype", [CPU_X86_64, CPU_ARM64])


def elf(binaries, fmi, machine):
    x86_64 = "linux64" if fmi == 2 else "x86_64-linux"
    return read_elf(binaries[x86_64 if machine == EM_X86_64 else "aarch64-linux"])


def pe(binaries, fmi):
    return read_pe(binaries["win64" if fmi == 2 else "x86_64-windows"])


def test_the_archive_has_the_folders_of_its_version(binaries, fmi):
    names = {
        2: {"linux64", "aarch64-linux", "win64", "darwin64", "aarch64-darwin"},
        3: {platform.name for platform in PLATFORMS},
    }
    assert binaries.keys() == names[fmi]


@ELF
def test_linux_libraries_are_for_their_machine_and_export_fmis_functions_only(binaries, fmi, machine):
    library = elf(binaries, fmi, machine)
    assert library.machine == machine
    assert library.exports == functions(fmi)


@ELF
def test_linux_libraries_need_an_old_c_library_and_nothing_else(binaries, fmi, machine):
    library = elf(binaries, fmi, machine)
    assert set(library.needed) <= {"libc.so.6", "libm.so.6"}
    assert not library.search_paths
    numbers = [re.fullmatch(r"GLIBC_(\d+)\.(\d+)(?:\.\d+)?", name) for name in library.versions]
    assert all(number and (int(number[1]), int(number[2])) <= OLDEST_GLIBC for number in numbers)


@ELF
def test_linux_libraries_write_no_code_and_run_no_data(binaries, fmi, machine):
    library = elf(binaries, fmi, machine)
    assert not library.executable_stack
    assert not library.text_relocations


def test_the_windows_library_is_for_its_machine_and_exports_fmis_functions_only(binaries, fmi):
    library = pe(binaries, fmi)
    assert library.machine == PE_X86_64
    assert library.is_dll
    assert library.exports == functions(fmi)


def test_the_windows_library_needs_only_what_comes_with_windows(binaries, fmi):
    others = [n for n in pe(binaries, fmi).imports if not re.fullmatch(r"kernel32\.dll|api-ms-win-crt-.*", n)]
    assert not others


def test_the_windows_library_is_hardened_and_holds_no_path_to_debug_information(binaries, fmi):
    library = pe(binaries, fmi)
    assert library.hardening & HARDENING == HARDENING
    assert set(library.debug_kinds) <= {DEBUG_REPRODUCIBLE}


@MACH
def test_macos_libraries_are_for_their_machine_and_export_fmis_functions_only(binaries, fmi, cputype):
    library = read_macho(macho(binaries, fmi, cputype))
    assert library.cputype == cputype
    assert library.exports - LINKER_NAMES == {f"_{name}" for name in functions(fmi)}


@MACH
def test_macos_libraries_run_from_version_11_wherever_they_lie(binaries, fmi, cputype):
    library = read_macho(macho(binaries, fmi, cputype))
    assert (library.platform, library.oldest_system) == (MACOS, OLDEST_MACOS)
    assert library.install_name == "@rpath/iss_dg.dylib"
    assert library.dylibs == ["/usr/lib/libSystem.B.dylib"]
    assert not library.search_paths


def test_the_library_for_apple_silicon_is_signed_also_inside_the_universal_one(binaries, fmi):
    content = macho(binaries, fmi, CPU_ARM64)
    pages = list(signed_pages(content, read_macho(content).signature))
    assert pages
    assert all(stated == found for stated, found in pages)


def test_the_universal_library_holds_both_machines_on_their_page_boundaries(binaries, fmi):
    if fmi == 2:
        parts = read_universal(binaries["darwin64"])
        assert [(cputype, alignment) for cputype, alignment, _ in parts] == [
            (CPU_X86_64, 1 << 12),
            (CPU_ARM64, 1 << 14),
        ]
        assert parts[1][2] == binaries["aarch64-darwin"]


def test_no_library_holds_a_name_from_the_machine_that_built_it(binaries):
    folders = [tempfile.gettempdir(), str(Path.home()), str(LAYER), sys.prefix, "binaries/", "sources/"]
    files = [path.name for path in LAYER.iterdir()] + ["model.c", "scene.c", ".pdb"]
    for folder, content in binaries.items():
        assert not [name for name in folders + files if name.encode() in content], folder
