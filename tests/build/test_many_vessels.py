"""The composite of many moving vessels: a loop in C, the same as the twin's straight code."""

import ctypes
import tempfile
from functools import cache
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from fmu_build.compile.compiler import FLAGS, compile_library
from fmu_build.generate.model import generate
from fmu_build.generate.sources import source_files
from fmu_build.generate.vessel_loop import LANES, LONGEST_CODE, loop_tables
from fmu_build.platforms import host_platform
from supervessel import Scene, Twin, parse_scene
from supervessel.equations import Equations, equations, p_start
from support import EPS, ISS_DG, OK, flying, scene, store, variant
from support.costs import station
from support.marks import some_at_once

VISIBLE = [flag for flag in FLAGS if flag not in ("-fvisibility=hidden", "-s")]
COUNT = 16


def every_kind() -> dict:
    """Returns a scene of every kind of frame and body."""
    raw = station(COUNT, ["v1", "v4", "v6", "v9", "v15"])
    ports = [docks["ports"] for docks in raw["docks"]]
    raw["inputs"]["pmi"] = ["v2", "v6", "v11"]
    raw["inputs"]["pose"] = [parent for parent, _ in ports[:12:2]] + [child for _, child in ports[4:]]
    raw["vessels"]["v3"]["mass"] = 0.0
    raw["vessels"]["v5"]["centre_of_mass"] = [0.1, -0.2, 0.3]
    tensor = [[1500.0, 100.0, 20.0], [100.0, 1600.0, -50.0], [20.0, -50.0, 1700.0]]
    raw["vessels"]["v9"] |= {"inertia": tensor, "centre_of_mass": [0.5, 0.0, -0.1]}
    del raw["vessels"]["v9"]["pmi"]
    return variant(raw, {"rotation.pose_change": "rate"})


def everything() -> dict:
    raw = station(COUNT, [f"v{i}" for i in range(COUNT)])
    raw["inputs"]["pose"] = [port for dock in raw["docks"] for port in dock["ports"]]
    return variant(raw, {"rotation.pose_change": "rate"})


SCENES = {
    "every kind": every_kind(),
    "everything": everything(),
    "in Orbiter's convention": variant(everything(), {"convention": "orbiter", "inputs.pmi": ["v3", "v0"]}),
    "by the law principal": variant(every_kind(), {"rotation.law": "principal"}),
}


class Compiled:
    """Functions of a scene's generated C, loaded."""

    def __init__(self, scene: Scene, folder: Path, lanes: int = LANES) -> None:
        self.name = scene.name
        for path, text in source_files(generate(scene, 3)[0], 3, scene.name).items():
            for_lanes = text.replace(f"LOOP_LANES {LANES}".encode(), f"LOOP_LANES {lanes}".encode())
            (folder / Path(path).name).write_bytes(for_lanes)
        self.work = int(_constant((folder / "scene.h").read_text(), "WORK_REAL"))
        library = folder / f"scene{host_platform().suffix}"
        sources = [Path(name) for name in ("vessel_loop.c", "model.c", "scene.c")]
        compile_library(sources, host_platform(), library, VISIBLE, folder)
        self.library = ctypes.CDLL(str(library))

    def __call__(self, name: str, *arguments: np.ndarray, size: int) -> np.ndarray:
        result, work = np.full(size, np.nan), np.full(self.work, np.nan)
        arg = (ctypes.c_void_p * 8)(*(a.ctypes.data for a in arguments))
        res = (ctypes.c_void_p * 4)(result.ctypes.data)
        function = getattr(self.library, f"{self.name}_fmi3_{name}")
        assert function(arg, res, None, ctypes.c_void_p(work.ctypes.data), 0) == 0
        return result


def _constant(header: str, name: str) -> str:
    return (
        next(line for line in header.splitlines() if line.strip().startswith(f"{name} = "))
        .split()[2]
        .strip(",")
    )


@cache
def compiled_for(name: str) -> Compiled:
    return Compiled(parse_scene(SCENES[name]), Path(tempfile.mkdtemp(dir=store())))


@pytest.fixture(scope="module", params=some_at_once(SCENES.keys(), "everything"))
def both(request) -> tuple[Compiled, Equations, np.ndarray]:
    """The loop, the straight code, and values of the inputs that are off the scene's."""
    scene = parse_scene(SCENES[request.param])
    model = equations(scene)
    assert loop_tables(model) is not None
    start = p_start(scene)
    generator = np.random.default_rng(1)
    p = start * generator.uniform(0.9, 1.1, len(start)) + generator.uniform(-0.1, 0.1, len(start))
    return compiled_for(request.param), model, p


def test_the_loop_gives_the_bits_of_the_straight_code(both):
    compiled, model, p = both
    truth = np.array(model.composite(p)).ravel()
    np.testing.assert_array_equal(compiled("composite", p, size=len(truth)), truth)


@pytest.mark.thorough
def test_one_vessel_at_a_time_gives_the_same_bits(tmp_path):
    """As compilers without registers of several numbers take them."""
    scene = parse_scene(every_kind())
    p, count = p_start(scene), equations(scene).composite.numel_out(0)
    one, several = (
        compiled("composite", p, size=count)
        for compiled in (Compiled(scene, tmp_path, 1), compiled_for("every kind"))
    )
    np.testing.assert_array_equal(one, several)


def test_forward_derivatives_of_the_loop_are_those_of_the_straight_code(both):
    """Both sum the same products, in other orders: each of n vessels adds tens of roundings."""
    compiled, model, p = both
    generator = np.random.default_rng(2)
    for _ in range(3):
        dp = generator.normal(size=len(p))
        truth = np.array(model.composite_derivatives[0](p, dp)).ravel()
        scale = _largest_terms(model, p, dp)
        got = compiled("composite_forward", p, dp, size=len(truth))
        assert np.all(np.abs(got - truth) <= 100 * COUNT * EPS * scale)


def test_reverse_derivatives_of_the_loop_are_those_of_the_straight_code(both):
    compiled, model, p = both
    jacobian = _jacobian(model, p)
    for row in range(jacobian.shape[0]):
        weight = np.zeros(jacobian.shape[0])
        weight[row] = 1.0
        got = compiled("composite_reverse", p, weight, size=len(p))
        scale = np.abs(jacobian[row]).max() + np.abs(jacobian).max() * EPS
        assert np.all(np.abs(got - jacobian[row]) <= 100 * COUNT * COUNT * EPS * scale), row


def _jacobian(model: Equations, p: np.ndarray) -> np.ndarray:
    """Returns dc/dp by the straight code, one column after the other."""
    columns = model.composite_derivatives[0].map(len(p))(ca.repmat(ca.DM(p), 1, len(p)), np.eye(len(p)))
    return np.array(columns)


def _largest_terms(model: Equations, p: np.ndarray, dp: np.ndarray) -> np.ndarray:
    return np.abs(_jacobian(model, p)) @ np.abs(dp)


def test_a_short_composite_is_straight_code():
    model = equations(scene(ISS_DG))
    assert model.composite.n_instructions() <= LONGEST_CODE
    assert loop_tables(model) is None


@pytest.mark.parametrize(
    "more",
    [
        {"inputs.force": ["v0.thruster"], "vessels.v0.points": {"thruster": {"position": [1.0, 0.0, 0.0]}}},
        {"inputs.vessel_torque": ["v3"]},
        {"outputs.names": ["mass", "v3.origin"]},
        {"inputs.motion": ["v1.root"], "rotation.pose_change": "momentum"},
    ],
)
def test_what_a_loop_does_not_know_is_straight_code(more):
    scene = parse_scene(variant(everything(), more))
    assert loop_tables(equations(scene)) is None


def test_an_fmu_with_a_loop_flies_as_the_twin_does():
    raw = everything()
    twin = Twin(scene(raw))
    with flying(
        raw, **{"v5.mass": 1500.0, "v3.root.position": [1.2, 0.0, 0.3], "torque": [10.0, 20.0, -30.0]}
    ) as fmu:
        assert fmu.step(0.01) == OK
        p = np.array([fmu.get(name) for name in twin.p_names])
        truth = twin.step(twin.x_start, [10.0, 20.0, -30.0], p, 0.01)
        got = np.concatenate([fmu.get("attitude"), fmu.get("angular_velocity")])
    np.testing.assert_array_equal(got, np.array(truth).ravel())
