"""What candidates cost: counted, in the C as it is written."""

import shutil
import subprocess
import sys
from pathlib import Path

import casadi as ca
import pytest

from fmu_build.sources import LAYER
from supervessel.accuracy.cost import free_operations, operations, series_operations

HERE = Path(__file__).parent


@pytest.mark.parametrize(
    ("product_count", "gyroscopic", "turned"), [(0, False, False), (3, True, False), (9, True, True)]
)
def test_operations_of_a_series_are_those_of_its_loop_in_c(tmp_path, product_count, gyroscopic, turned):
    """taylor.c, run with numbers that count; both are quadratic in the order: five points prove it."""
    for name in ("taylor.c", "taylor.h"):
        shutil.copy(LAYER / name, tmp_path)
    shutil.copy(HERE / "counted.cpp", tmp_path)
    (tmp_path / "scene.h").write_text(
        f"#define STEPS 3\n#define STEPS_BY_SERIES 3\n#define PRODUCT_COUNT {product_count}\n"
    )
    command = [sys.executable, "-m", "ziglang", "cc", "-w", "-o", "counted", "counted.cpp"]
    subprocess.run(command, cwd=tmp_path, check=True)
    for order in (6, 8, 12, 16, 20):
        done = subprocess.run(
            [tmp_path / "counted", str(order)], capture_output=True, text=True, check=True, cwd=tmp_path
        )
        assert int(done.stdout) == series_operations(order, gyroscopic=gyroscopic, turned=turned), order


def test_slow_operations_count_as_several_and_moves_as_none():
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    assert operations(ca.Function("f", [x, y], [x])) == 0
    assert operations(ca.Function("f", [x, y], [x * y + 2.0])) == 2
    assert operations(ca.Function("f", [x, y], [ca.sqrt(x) / y])) == 10


def test_a_doubling_of_free_motion_is_a_small_part_of_it():
    whole, doubling = free_operations()
    assert 50 < doubling < whole / 5
