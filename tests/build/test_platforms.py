"""Which platforms an FMU is built for, in which folders their libraries lie, and the universal library."""

import struct
from pathlib import Path

import pytest

from fmu_build import BuildError
from fmu_build.__main__ import main
from fmu_build.compile.compiler import compile_binaries
from fmu_build.compile.universal import universal_library
from fmu_build.platforms import PLATFORMS, host_platform, library_contents, platforms_named

X86_64, ARM64 = 0x01000007, 0x0100000C


def names(contents):
    """Returns the names of the platforms in each folder."""
    return {folder: [platform.name for platform in parts] for folder, parts in contents.items()}


def thin_library(cputype: int, size: int, cpusubtype: int = 3) -> bytes:
    """Returns bytes with a 64-bit Mach-O library's header, made up but for its machine."""
    return struct.pack("<3I", 0xFEEDFACF, cputype, cpusubtype) + bytes(i % 251 for i in range(size - 12))


def fat_rows(universal: bytes) -> list[tuple[int, ...]]:
    """Returns cputype, cpusubtype, offset, size and alignment of each library in a universal one."""
    magic, count = struct.unpack_from(">2I", universal)
    assert magic == 0xCAFEBABE
    return [struct.unpack_from(">5I", universal, 8 + 20 * i) for i in range(count)]


def test_fmi_3_has_a_folder_for_each_platform_tuple():
    assert names(library_contents(PLATFORMS, 3)) == {
        platform: [platform]
        for platform in ("x86_64-linux", "aarch64-linux", "x86_64-windows", "x86_64-darwin", "aarch64-darwin")
    }


def test_fmi_2_has_its_own_folders_for_x86_and_a_universal_macos_library():
    assert names(library_contents(PLATFORMS, 2)) == {
        "linux64": ["x86_64-linux"],
        "aarch64-linux": ["aarch64-linux"],
        "win64": ["x86_64-windows"],
        "darwin64": ["x86_64-darwin", "aarch64-darwin"],
        "aarch64-darwin": ["aarch64-darwin"],
    }


def test_fmi_2_for_intel_macs_alone_has_no_code_for_apple_silicon():
    assert names(library_contents(platforms_named(["x86_64-darwin"]), 2)) == {"darwin64": ["x86_64-darwin"]}


def test_fmi_2_for_apple_silicon_alone_keeps_darwin64_usable_on_intel_macs():
    contents = names(library_contents(platforms_named(["aarch64-darwin"]), 2))
    assert contents["darwin64"] == ["x86_64-darwin", "aarch64-darwin"]


def test_all_stands_for_every_platform_and_repetitions_for_one():
    assert platforms_named(["x86_64-darwin", "all", "x86_64-darwin"]) == PLATFORMS
    assert len(platforms_named(["x86_64-linux", "x86_64-linux"])) == 1


@pytest.mark.parametrize(
    ("machine", "system", "name"),
    [
        ("AMD64", "Windows", "x86_64-windows"),
        ("arm64", "Darwin", "aarch64-darwin"),
        ("aarch64", "Linux", "aarch64-linux"),
        ("x86_64", "Linux", "x86_64-linux"),
    ],
)
def test_the_host_is_found_by_what_python_calls_it(monkeypatch, machine, system, name):
    monkeypatch.setattr("platform.machine", lambda: machine)
    monkeypatch.setattr("platform.system", lambda: system)
    assert host_platform().name == name


def test_an_unknown_host_must_name_a_platform(monkeypatch):
    monkeypatch.setattr("platform.machine", lambda: "riscv64")
    monkeypatch.setattr("platform.system", lambda: "Linux")
    with pytest.raises(BuildError, match="this machine is riscv64-linux; name the platform to build for"):
        host_platform()


def test_an_unknown_platform_is_wrong_usage_and_the_nearest_is_named(capsys):
    with pytest.raises(SystemExit) as exit_status:
        main(["scene.toml", "--platform", "x86_64-linux", "aarch64-linus"])
    assert exit_status.value.code == 2
    assert 'unknown platform "aarch64-linus" (did you mean "aarch64-linux"?)' in capsys.readouterr().err


@pytest.mark.thorough
def test_a_platform_that_does_not_compile_is_named_with_the_compilers_words(tmp_path: Path):
    files = {"model.c": b'#ifdef __aarch64__\n#error "not for this machine"\n#endif\n'}
    both = platforms_named(["x86_64-linux", "aarch64-linux"])
    with pytest.raises(BuildError) as error:
        compile_binaries(files, "model.c", both, 3, "broken")
    assert str(error.value).startswith("compiler for aarch64-linux failed:\nmodel.c:2:2: error:")
    assert "not for this machine" in str(error.value)
    assert "x86_64" not in str(error.value)


def test_every_platform_that_does_not_compile_is_named(tmp_path: Path):
    files = {"model.c": b'#error "for no machine"\n'}
    both = platforms_named(["x86_64-linux", "aarch64-linux"])
    with pytest.raises(BuildError) as error:
        compile_binaries(files, "model.c", both, 3, "broken")
    for platform in both:
        assert f"compiler for {platform.name} failed:\nmodel.c:1:2: error:" in str(error.value)


def test_a_universal_library_holds_its_parts_unchanged_on_page_boundaries():
    intel, apple = thin_library(X86_64, 50000), thin_library(ARM64, 70001, cpusubtype=0)
    universal = universal_library([intel, apple])
    assert fat_rows(universal) == [(X86_64, 3, 4096, 50000, 12), (ARM64, 0, 65536, 70001, 14)]
    assert universal[4096 : 4096 + 50000] == intel
    assert universal[65536:] == apple
    assert not any(universal[48:4096])
    assert not any(universal[4096 + 50000 : 65536])


def test_parts_that_end_on_a_page_boundary_follow_without_a_gap():
    universal = universal_library([thin_library(ARM64, 2 << 14), thin_library(X86_64, 5000)])
    assert [row[2] for row in fat_rows(universal)] == [1 << 14, 3 << 14]


@pytest.mark.parametrize("content", [b"", b"\xcf\xfa\xed\xfe", b"\x7fELF" + bytes(60), thin_library(7, 100)])
def test_what_is_no_thin_mac_library_is_refused(content):
    with pytest.raises(BuildError, match="not a thin Mach-O library"):
        universal_library([content])


def test_two_libraries_of_one_machine_are_refused():
    with pytest.raises(BuildError, match="each machine once"):
        universal_library([thin_library(ARM64, 100), thin_library(ARM64, 200)])
