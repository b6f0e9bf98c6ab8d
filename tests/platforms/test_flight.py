"""The same flight on every platform that runs here, natively or emulated, with the same bits as results."""

import os
import re
import shutil
import struct
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from fmpy import read_model_description

from fmu_build import build_fmu
from fmu_build.compile.compiler import FLAGS, fmi_headers
from fmu_build.platforms import PLATFORMS, Platform, host_platform
from fmu_build.storage.cache import cache_folder
from support import ISS_DG, scene, variant

pytestmark = pytest.mark.platforms

STEPS, STEP = 1000, 0.1
"""How many, and s."""

ARM64_ROOT = Path("/usr/aarch64-linux-gnu")
WINE = ("wine64", "wine", "/usr/lib/wine/wine64")

INEXACT = r"\b(sin|cos|tan|asin|acos|atan|atan2|sinh|cosh|tanh|exp|expm1|log|log1p|pow|cbrt|hypot|erf)\("
"""Functions that C libraries round as they like."""


def bits(value: float) -> str:
    """Returns the 16 hexadecimal digits of a number's bits."""
    return struct.pack(">d", value).hex()


def number(digits: str) -> float:
    value: float = struct.unpack(">d", bytes.fromhex(digits))[0]
    return value


def script(references: dict[str, int], outputs: list[str]) -> str:
    """Returns the flight: a tumbling start, torque, fuel burnt, the port moved; a reading each tenth step."""

    def put(values: dict[str, float]) -> list[str]:
        return [f"set {references[name]} {bits(value)}" for name, value in values.items()]

    lines = put({"angular_velocity_start[1]": 0.01, "angular_velocity_start[3]": -0.02})
    lines += [*put({"attitude_start[1]": 0.8, "attitude_start[2]": 0.6}), "exit"]
    for i in range(STEPS):
        if i % 100 == 0:
            lines += put({f"torque[{axis}]": 1000.0 * (axis - 2) * (i // 100 - 5) for axis in (1, 2, 3)})
        if 300 <= i < 500:
            lines += put({"DG.mass": 24500.0 - 13.37 * (i - 299)})
        if i == 600:
            lines += put({"DG.nose.position[2]": 0.31, "DG.nose.direction[1]": 0.12})
        lines += [f"step {bits(STEP)}"]
        if i % 10 == 9:
            lines += [f"get {references[name]}" for name in outputs]
    return "\n".join(lines) + "\n"


@pytest.fixture(scope="session")
def wine(tmp_path_factory) -> Iterator[dict[str, str]]:
    """Yields the environment of a Windows system of its own, and stops it."""
    environment = os.environ | {
        "WINEPREFIX": str(tmp_path_factory.mktemp("wine")),
        "WINEDEBUG": "-all",
        "WINEDLLOVERRIDES": "mscoree=;mshtml=",
    }
    yield environment
    if server := shutil.which("wineserver") or shutil.which("/usr/lib/wine/wineserver"):
        subprocess.run([server, "-k"], env=environment, check=False, timeout=60.0)


def runner(platform: Platform) -> list[str]:
    """Returns the command that programs for a platform are run with here; skips where there is none."""
    if platform == host_platform():
        return []
    if platform.name == "aarch64-linux":
        if shutil.which("qemu-aarch64") is None:
            pytest.skip("qemu-aarch64 is not installed (Debian package qemu-user)")
        if not ARM64_ROOT.is_dir():
            pytest.skip("the C library for aarch64 is not installed (Debian package libc6-arm64-cross)")
        return ["qemu-aarch64", "-L", str(ARM64_ROOT)]
    if platform.name == "x86_64-windows":
        found = [path for name in WINE if (path := shutil.which(name))]
        if not found:
            pytest.skip("wine is not installed (Debian package wine64)")
        return found[:1]
    pytest.skip(f"programs for {platform.name} do not run on {host_platform().name}")


def compile_host(platform: Platform, folder: Path) -> Path:
    """Compiles host.c for a platform, with the libraries' flags so that the compiler's cache serves both."""
    program = folder / ("host.exe" if platform.suffix == ".dll" else "host")
    flags = [flag for flag in FLAGS if flag != "-shared"]
    command = [sys.executable, "-m", "ziglang", "cc", "-target", platform.target, *flags]
    command += ["-isystem", str(fmi_headers()), f"-I{Path(__file__).parent.parent / 'support'}"]
    command += ["-o", str(program), str(Path(__file__).with_name("host.c"))]
    cache = str(cache_folder())
    environment = os.environ | {"ZIG_GLOBAL_CACHE_DIR": cache, "ZIG_LOCAL_CACHE_DIR": cache}
    libraries = ["-ldl"] if platform.suffix == ".so" else []
    subprocess.run([*command, *libraries], env=environment, check=True, timeout=1800.0)
    return program


def fly(fmu: Path, platform: Platform, folder: Path, environment: dict[str, str]) -> list[float]:
    """Returns all outputs of the flight on a platform."""
    folder.mkdir()
    description = read_model_description(str(fmu))
    references = {variable.name: variable.valueReference for variable in description.modelVariables}
    outputs = [v.name for v in description.modelVariables if v.causality == "output"]
    library = folder / f"{description.modelName}{platform.suffix}"
    with zipfile.ZipFile(fmu) as archive:
        library.write_bytes(archive.read(f"binaries/{platform.name}/{library.name}"))
    done = subprocess.run(
        [*runner(platform), str(compile_host(platform, folder)), f"./{library.name}", description.guid],
        input=script(references, outputs),
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=600.0,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    values = [number(line) for line in done.stdout.split()]
    assert len(values) == len(outputs) * STEPS // 10
    return values


@pytest.mark.parametrize("law", ["tensor", "principal", "decoupled", "none"])
@pytest.mark.parametrize("name", ["aarch64-linux", "x86_64-windows", "x86_64-linux"])
def test_results_are_bit_identical_to_this_machines(tmp_path, wine, name, law):
    (platform,) = [platform for platform in PLATFORMS if platform.name == name]
    if platform == host_platform():
        pytest.skip(f"{name} is this machine's own platform")
    runner(platform)
    raw = variant(ISS_DG, {"rotation": {"law": law, "propagator": "rk4"}})
    fmu = build_fmu(scene(raw), tmp_path / "scene.fmu", 3, [host_platform(), platform])
    with zipfile.ZipFile(fmu) as archive:
        text = archive.read("sources/model.c").decode()
    assert not re.findall(INEXACT, text), "a function whose rounding differs between C libraries"
    expected = fly(fmu, host_platform(), tmp_path / "here", wine)
    assert expected[0] != expected[-1]
    assert fly(fmu, platform, tmp_path / "there", wine) == expected


@pytest.mark.parametrize("name", ["aarch64-linux", "x86_64-windows", "x86_64-linux"])
def test_free_motion_and_error_control_agree_but_for_the_c_libraries_rounding(tmp_path, wine, name):
    (platform,) = [platform for platform in PLATFORMS if platform.name == name]
    if platform == host_platform():
        pytest.skip(f"{name} is this machine's own platform")
    runner(platform)
    raw = variant(ISS_DG, {"rotation": {"propagator": "auto"}})
    fmu = build_fmu(scene(raw), tmp_path / "scene.fmu", 3, [host_platform(), platform])
    expected = fly(fmu, host_platform(), tmp_path / "here", wine)
    found = fly(fmu, platform, tmp_path / "there", wine)
    assert expected[0] != expected[-1]
    for rows in zip(found, expected, strict=True):
        # a few ulp of sin, cos and atan2 in the turn, of rates and attitudes of about 1 and momenta of 1e7
        assert np.allclose(*rows, rtol=1e-12, atol=1e-12 * np.abs(rows[1]).max())
