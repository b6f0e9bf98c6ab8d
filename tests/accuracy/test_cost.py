"""What candidates cost: counted, in the C as it is written."""

import shutil
from ctypes import CDLL
from pathlib import Path

import casadi as ca
import pytest

from fmu_build.accuracy.cost import (
    free_operations,
    free_spans,
    gradient_operations,
    operations,
    series_operations,
)
from fmu_build.compile.compiler import TRIAL_FLAGS, compile_library
from fmu_build.generate.sources import LAYER
from fmu_build.platforms import host_platform
from supervessel.rotation.propagators.taylor import MOST_ORDER

HERE = Path(__file__).parent

FLAGS = (
    *(flag for flag in TRIAL_FLAGS if not flag.startswith("-std=")),
    "-w",
    "-nostdlib++",
    "-fno-exceptions",
)
"""Those of a library of C, so that the compiler has all that it links: it comes with no C++ library built."""


@pytest.mark.parametrize("gradient", [0, 3, 6])
@pytest.mark.parametrize(
    ("product_count", "gyroscopic", "turned"), [(0, False, False), (3, True, False), (9, True, True)]
)
def test_operations_of_a_series_are_those_of_its_loop_in_c(
    tmp_path, product_count, gyroscopic, turned, gradient
):
    """taylor_series.c, run with numbers that count; both are quadratic in the order: five points prove it."""
    for name in ("taylor_series.c", "taylor_series.h", "gradient_series.h"):
        shutil.copy(LAYER / name, tmp_path)
    shutil.copy(HERE / "counted.cpp", tmp_path)
    field = (
        f"#define FIELD 1\n#define GRADIENT_COUNT {gradient}\n#define GRAVITY_MU 1.5\n" if gradient else ""
    )
    (tmp_path / "scene.h").write_text(
        f"#define PRODUCT_COUNT {product_count}\n#define TAYLOR_MOST_ORDER {MOST_ORDER}\n{field}"
    )
    platform = host_platform()
    library = tmp_path / f"counted{platform.suffix}"
    compile_library([tmp_path / "counted.cpp"], platform, library, FLAGS)
    counted = CDLL(str(library)).counted
    for order in (6, 8, 12, 16, 20):
        expected = series_operations(order, gyroscopic=gyroscopic, turned=turned)
        if gradient:
            expected += gradient_operations(order, mixed_alone=gradient == 3, turned=turned)
        assert counted(order) == expected, order


def test_slow_operations_count_as_several_and_moves_as_none():
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    assert operations(ca.Function("f", [x, y], [x])) == 0
    assert operations(ca.Function("f", [x, y], [x * y + 2.0])) == 2
    assert operations(ca.Function("f", [x, y], [ca.sqrt(x) / y])) == 10


def test_a_doubling_of_free_motion_is_a_small_part_of_it():
    free = free_operations()
    assert 50 < free.doubling < free.once / 5


def test_free_motion_from_a_start_that_has_been_stepped_from_is_a_small_part_of_one_that_has_not():
    free = free_operations()
    assert free.again < free.once / 3
    # what is found once pays for itself in three steps, each beyond the first angle
    assert free.start + 3 * free.again < 3 * (free.once + free.doubling)


def test_steps_of_free_motion_are_told_apart_by_where_they_start():
    lengths, still, jumped = (4, 3, 5, 1), (True, True, True, False), (False, True, False, False)
    assert free_spans(lengths, still, jumped, in_jumps=True) == [4, 8]
    assert free_spans(lengths, still, jumped, in_jumps=False) == [4, 7]
    assert free_spans((1, 1, 2), (True, False, True), (False, False, False), in_jumps=False) == [1, 2]
    assert free_spans((1, 1), (True, True), (False, True), in_jumps=False) == [1]
