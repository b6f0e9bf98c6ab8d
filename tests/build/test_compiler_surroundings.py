"""What a compiler sees: what it is given, nothing of the user's surroundings or of the working folder."""

import ctypes
import os
import subprocess
import sys
from pathlib import Path

import pytest

from fmu_build import BuildError
from fmu_build.compile.compiler import TRIAL_FLAGS, compile_library
from fmu_build.platforms import host_platform
from fmu_build.storage.cache import cache_folder
from fmu_build.storage.compiler_files import compiler_folder
from support import BALL
from support.compilers import fake_compiler
from support.processes import ROOT, cache, needs_posix

__all__ = ["cache"]

needs_linux = pytest.mark.skipif(sys.platform != "linux", reason="an environment is read in /proc")

SCENE = BALL + "[experiment]\nduration = 2.0\nstep = 1.0\n"

HOSTILE = (
    "CCC_OVERRIDE_OPTIONS",
    "CLANG_CONFIG_FILE_SYSTEM_DIR",
    "CLANG_MODULE_CACHE_PATH",
    "COMPILER_PATH",
    "CPATH",
    "CPLUS_INCLUDE_PATH",
    "C_INCLUDE_PATH",
    "DYLD_INSERT_LIBRARIES",
    "GCC_EXEC_PREFIX",
    "LIBRARY_PATH",
    "MACOSX_DEPLOYMENT_TARGET",
    "PYTHONSTARTUP",
    "SDKROOT",
    "SOURCE_DATE_EPOCH",
    "ZIG_LIBC",
    "ZIG_LIB_DIR",
    "ZIG_VERBOSE_CC",
    "anything",
)


@needs_linux
def test_a_compiler_gets_two_variables_and_no_other(tmp_path, monkeypatch):
    """A compiler in the place of the real one writes down what it has."""
    heard = tmp_path / "heard"
    site = fake_compiler(tmp_path / "site", f"cat /proc/$$/environ > {heard}; exit 1")
    monkeypatch.syspath_prepend(site)
    monkeypatch.setenv("SUPERVESSEL_CACHE", str(tmp_path / "cache"))  # the next compiler would begin anew
    for name in HOSTILE:
        monkeypatch.setenv(name, str(tmp_path))
    with pytest.raises(BuildError, match=r"compiler for .* failed"):
        compile_library([tmp_path / "any.c"], host_platform(), tmp_path / "any.so")
    variables = dict(line.split("=", 1) for line in heard.read_text().split("\0") if line)
    assert variables.keys() == {"ZIG_GLOBAL_CACHE_DIR", "ZIG_LOCAL_CACHE_DIR"}
    assert variables["ZIG_GLOBAL_CACHE_DIR"] == str(compiler_folder())
    objects = Path(variables["ZIG_LOCAL_CACHE_DIR"])
    assert objects.is_relative_to(cache_folder())  # a folder of this compilation alone
    assert not objects.exists()


@pytest.mark.parametrize("name", HOSTILE)
def test_a_compiler_finds_the_real_headers_and_libraries(tmp_path, monkeypatch, name):
    """sqrt is 7 by a doctored math.h, and by an option."""
    doctored = tmp_path / "doctored"
    doctored.mkdir()
    (doctored / "math.h").write_text("#define sqrt(x) 7.0\n")
    source = tmp_path / "root.c"  # which no cache has seen before: its own path is in it
    source.write_text(f"/* {tmp_path} */\n#include <math.h>\ndouble root(double x) {{ return sqrt(x); }}\n")
    monkeypatch.setenv(name, "+-Dsqrt(x)=7.0" if name == "CCC_OVERRIDE_OPTIONS" else str(doctored))
    library = tmp_path / f"root{host_platform().suffix}"
    compile_library([source], host_platform(), library, (*TRIAL_FLAGS, "-fvisibility=default"))
    root = ctypes.CDLL(str(library)).root
    root.restype, root.argtypes = ctypes.c_double, [ctypes.c_double]
    assert root(9.0) == 3.0


PLANTED = ("ziglang", "fmpy", "subprocess", "ctypes", "json")


def planted(folder: Path, names: tuple[str, ...]) -> Path:
    """Plants packages in a folder; returns the file that appears when one of them is run."""
    trace = folder / "a planted package has been run"
    for name in names:
        (folder / name).mkdir()
        for file in ("__init__.py", "__main__.py"):
            (folder / name / file).write_text(f"open({str(trace)!r}, 'w').close()\n")
        program = folder / name / "zig"
        program.write_text(f"#!/bin/sh\ntouch '{trace}'; exit 1\n")
        program.chmod(0o755)
    return trace


@needs_posix
@pytest.mark.parametrize(
    ("words", "names"),
    [
        pytest.param(
            ["-P", "-m", "supervessel", "trade", "ball.toml", "--quick"], PLANTED, marks=pytest.mark.thorough
        ),
        (["-P", "-m", "fmu_build", "ball.toml"], PLANTED),
        (["-m", "fmu_build", "ball.toml"], ("ziglang", "fmpy")),
    ],
    ids=["trade", "build", "build by a Python that imports from the working folder"],
)
def test_no_package_of_the_working_folder_is_run(tmp_path, cache, words, names):
    """With -P Python itself imports nothing from there, as in the command `supervessel`."""
    (tmp_path / "ball.toml").write_text(SCENE)
    trace = planted(tmp_path, names)
    path = os.pathsep.join((str(ROOT), str(ROOT / "model")))
    done = subprocess.run(
        [sys.executable, *words],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": path, "SUPERVESSEL_CACHE": str(cache)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert not trace.exists()
    assert (done.returncode, done.stderr) == (0, "")


def test_a_working_folder_that_is_gone_is_no_traceback(tmp_path):
    script = (
        "import os, pathlib; gone = pathlib.Path('gone'); gone.mkdir(); os.chdir(gone); "
        "os.rmdir('../gone'); from fmu_build.compile.compiler import compiler; print(compiler().name[:3])"
    )
    path = os.pathsep.join((str(ROOT), str(ROOT / "model")))
    done = subprocess.run(
        [sys.executable, "-c", script],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    if os.name == "posix":  # Windows removes no folder in which a program is
        assert (done.stdout, done.stderr) == ("zig\n", "")
