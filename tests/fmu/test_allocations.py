"""No memory is asked for after instantiation: the packed sources, with malloc counted."""

import subprocess
import sys
from pathlib import Path

import fmpy

from fmu_build.compile.compiler import fmi_headers
from fmu_build.platforms import host_platform
from support import ISS_DG, built

COUNTED = [f"-D{name}=counted_{name}" for name in ("malloc", "calloc", "realloc")]


def test_an_instance_is_one_block_and_nothing_is_allocated_after_it(tmp_path):
    fmu = built(ISS_DG)
    sources = Path(fmpy.extract(str(fmu), unzipdir=str(tmp_path))) / "sources"
    compiler = [sys.executable, "-m", "ziglang", "cc", "-target", host_platform().target, "-std=c99", "-O1"]
    compiler += ["-DFMI3_OVERRIDE_FUNCTION_PREFIX"]
    compiler += ["-isystem", str(fmi_headers()), "-I", str(sources)]
    objects = []
    for source in [Path(__file__).with_name("allocations.c"), *sorted(sources.glob("*.c"))]:
        objects.append(str(tmp_path / f"{source.stem}.o"))
        counted = COUNTED if source.parent == sources else []
        subprocess.run([*compiler, *counted, "-c", str(source), "-o", objects[-1]], check=True, timeout=300.0)
    program = tmp_path / "allocations"
    subprocess.run([*compiler, *objects, "-o", str(program), "-lm"], check=True, timeout=300.0)
    token = fmpy.read_model_description(str(fmu)).instantiationToken
    done = subprocess.run([str(program), token], capture_output=True, text=True, timeout=60.0, check=False)
    assert (done.stdout, done.stderr) == ("1 0\n", "")
