"""The twin's communication step: the FMU's doStep to the last bit, its refusals, threads, derivatives."""

import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

from changes.scenes import MIR
from fmu_build import BuildError
from fmu_build.generate.model import generate
from fmu_build.generate.sources import LAYER
from supervessel import Twin
from supervessel.twin.functions import TwinFunction
from support import EPS, ISS_DG, OK, STEADY, Array, Instance, body, scene, variant
from support.marks import some_at_once
from support.processes import begin_cache
from twin.scenes import numbers, random_inputs, random_scene

STARTS = 12  # of flights of each scene
ANGLES = [0.01, 3.0, 40.0]  # rad, about what the body turns by in a communication step
WRAPPER = LAYER.parent / "compile" / "communication_step.c"
ATTITUDE_IS_TAKEN_AS_IT_IS = 4 * EPS  # departure of its square from 1, see instance_start_attitude


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("steps")


def random_assembly(seed: int, propagator: str) -> dict[str, Any]:
    """Returns a random scene that any propagator takes: by the full tensor, with a torque."""
    raw = random_scene(seed)
    changes = STEADY | {"law": "tensor", "propagator": propagator, "tolerance": 10.0 ** -(6 + seed)}
    return variant(raw, {"inputs.torque": True, **{f"rotation.{key}": v for key, v in changes.items()}})


SCENES = {
    **{
        name: random_assembly(seed, name)
        for seed, name in enumerate(("rk4", "dop853", "taylor", "exact", "split", "auto"))
    },
    "momentum": variant(
        ISS_DG, {"name": "keeping", "rotation": STEADY | {"propagator": "auto", "mass_change": "momentum"}}
    ),
    "no p": body(propagator="dop853"),
    "docks": variant(MIR, {"inputs.torque": True}),
}


@cache
def twin_of(name: str) -> Twin:
    return Twin(scene(SCENES[name]))


def state_of(fmu: Instance) -> Array:
    return np.concatenate([fmu.get("state.attitude"), fmu.get("state.angular_velocity")])


def random_start(name: str, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Returns x, u, p; a third without torque, and what cannot take torque always."""
    twin = twin_of(name)
    if name == "docks":
        p, closed = np.array(twin.p_start), rng.integers(3)
        for i, berth in enumerate(("berth", "front")):
            p[twin.p_names.index(f"{berth}.docked")] = closed == i + 1
        u = 1e4 * rng.normal(size=3)
    else:
        p, u = random_inputs(twin, rng)
    u *= {"exact": 0.0, "split": 1e-6}.get(name, rng.integers(3) > 0)
    q = rng.normal(size=4)
    return np.array([*q / np.linalg.norm(q), *0.1 * rng.normal(size=3)]), u, p


def start(fmu: Instance, twin: Twin, x: Array, u: Array, p: Array) -> None:
    """Starts the FMU anew at x under u and p."""
    assert fmu.reset() == OK
    fmu.enter()
    values = {
        "attitude_start": x[:4],
        "angular_velocity_start": x[4:],
        **dict(zip((*twin.p_names, *twin.u_names), (*p, *u), strict=True)),
    }
    assert fmu.set(values) == OK
    assert fmu.exit() == OK, fmu.log


@pytest.mark.parametrize("name", some_at_once(SCENES.keys(), "auto", "momentum", "docks", "rk4"))
def test_communication_step_is_the_fmus_to_the_last_bit(name: str, folder: Path) -> None:
    twin, rng = twin_of(name), np.random.default_rng(len(name))
    step, fmu = twin.communication_step(folder), Instance(SCENES[name])
    departures = []
    for i in range(STARTS):
        x, u, p = random_start(name, rng)
        h = ANGLES[i % 3] / float(np.linalg.norm(x[4:]))
        start(fmu, twin, x, u, p)
        for _ in range(3):
            assert fmu.step(h) == OK, fmu.log
            found, end = numbers(step(x, u, p, h)), state_of(fmu)
            assert found.tolist() == end.tolist()
            departures.append(np.abs(found - numbers(twin.step(x, u, p, h))).max())
            x = end
            if not u.any() or abs(x[:4] @ x[:4] - 1.0) > ATTITUDE_IS_TAKEN_AS_IT_IS:
                break  # free motion goes on from where it began
    fmu.free()
    # by sub-steps: a single step of the twin's own is far off, but of free motion
    assert name == "exact" or max(departures) > 1e-5


def test_attitudes_are_brought_to_unit_length_as_the_fmu_does(folder: Path) -> None:
    twin, fmu = twin_of("dop853"), Instance(SCENES["dop853"])
    x, u, p = random_start("dop853", np.random.default_rng(3))
    x[:4] *= 1.0 + 5e-4
    start(fmu, twin, x, u, p)
    assert fmu.step(2.0) == OK
    assert numbers(twin.communication_step(folder)(x, u, p, 2.0)).tolist() == state_of(fmu).tolist()
    fmu.free()


@pytest.mark.parametrize("fixed", [True, ["V0.mass"]])
def test_inputs_that_are_fixed_keep_their_places(fixed: Any, folder: Path) -> None:
    raw = variant(random_assembly(2, "taylor"), {"inputs.mass": ["V0", "V1"]})
    whole, settled = (Twin(scene(raw), fixed=f) for f in (False, fixed))
    x, u = whole.x_start, [1.0, 2.0, 3.0]
    expected = whole.communication_step(folder)(x, u, whole.p_start, 5.0)
    found = settled.communication_step(folder)(x, u, settled.p_start, 5.0)
    assert numbers(found).tolist() == numbers(expected).tolist()


REFUSED = {
    "backwards": ("taylor", {"h": -1.0}, "communicationStepSize = -1 s: must be finite and > 0"),
    "torque": ("exact", {"u": [1.0, 0.0, 0.0]}, "torque = (1, 0, 0) N.m: must be 0 for the propagator exact"),
    "turns": ("rk4", {"h": 1e12}, "sub-steps of max_angle_step"),
    "half docked": ("docks", {"p": {"berth.docked": 0.5}}, "berth.docked = 0.5: must be 0 or 1"),
    "port docked twice": ("docks", {"p": {"berth.docked": 1, "front.docked": 1}}, "is docked already"),
    "moments": ("momentum", {"p": {"DG.pmi[3]": 99.0}}, "no rigid body has these moments"),
    "no mass": ("momentum", {"p": {"DG.mass": -1.0}}, "DG.mass = -1 kg: must be >= 0"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_the_fmu_refuses_is_an_error_with_its_words(
    case: str, folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    name, changes, words = REFUSED[case]
    twin = twin_of(name)
    at = {"x": twin.x_start, "u": np.zeros(3), "p": twin.p_start, "h": 1.0} | changes
    if "p" in changes:
        at["p"] = twin.p_start.copy()
        for input_name, value in changes["p"].items():
            at["p"][twin.p_names.index(input_name)] = value
    step = twin.communication_step(folder)
    with pytest.raises(RuntimeError, match="Evaluation failed"):
        step(**at)
    assert words in capfd.readouterr().err


def test_numbers_that_are_not_finite_are_refused_inside_other_functions(
    folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    twin, h = twin_of("taylor"), ca.MX.sym("h")
    step = twin.communication_step(folder)
    inside = ca.Function("inside", [h], [step(twin.x_start, [0.0, ca.log(h), 0.0], twin.p_start, 1.0)])
    with pytest.raises(RuntimeError, match="Evaluation failed"):
        inside(0.0)
    assert "communication_step: torque[2] = -inf N.m: must be finite" in capfd.readouterr().err


def test_threads_give_the_same_numbers(folder: Path) -> None:
    step, rng = twin_of("auto").communication_step(folder), np.random.default_rng(8)
    starts = [random_start("auto", rng) for _ in range(64)]
    columns = [np.column_stack(parts) for parts in zip(*starts, strict=True)]
    at = (*columns, rng.uniform(0.1, 30.0, (1, 64)))
    found = step.map(64, "thread", 4)(*at)
    assert numbers(found).tolist() == numbers(step.map(64)(*at)).tolist()


def by_differences(step: TwinFunction, at: list[Array], which: int, size: float) -> Array:
    """Returns the Jacobian of a step by one argument, by central differences."""
    columns = []
    for i in range(at[which].size):
        moved = [[*at], [*at]]
        for sign, there in zip((1.0, -1.0), moved, strict=True):
            there[which] = at[which].copy()
            there[which][i] += sign * size
        ends = [numbers(step(*there)) for there in moved]
        columns.append((ends[0] - ends[1]) / (2.0 * size))
    return np.column_stack(columns)


@pytest.mark.parametrize("propagator", some_at_once(["rk4", "dop853", "taylor"], "dop853"))
def test_derivatives_of_one_sub_step_are_those_of_the_step(propagator: str, folder: Path) -> None:
    twin = Twin(scene(random_assembly(3, "rk4")), propagator=propagator)
    symbols = [ca.MX.sym("m", n) for n in (7, 3, len(twin.p_names), 1)]
    at = [twin.x_start, [1.0, 2.0, 3.0], twin.p_start, 0.05]
    step = twin.communication_step(folder)

    def derivatives(step: TwinFunction) -> tuple[list[Array], Array]:
        end = step(*symbols)
        hessian = ca.hessian(ca.dot([1, 2, 3, 4, 5, 6, 7], end), symbols[0])[0]
        results = [*(ca.jacobian(end, symbol) for symbol in symbols), hessian]
        *jacobians, last = map(numbers, ca.Function("d", symbols, results)(*at))
        return jacobians, last

    (found, hessian), (expected, other) = (derivatives(step) for step in (step, twin.step))
    assert len(twin.p_names)
    assert [jacobian.tolist() for jacobian in found] == [jacobian.tolist() for jacobian in expected]
    # The same partials are added in another order: seven rounded products of weights that sum to 28.
    assert np.abs(hessian - other).max() <= 7 * 28 * EPS * np.abs(other).max()


def test_derivatives_of_many_sub_steps_are_those_of_the_motion(folder: Path) -> None:
    raw = body(1000.0, (1.0, 2.0, 2.5), propagator="auto", tolerance=1e-13, angular_velocity=[0.3, -0.2, 0.5])
    twin = Twin(scene(raw))
    step = twin.communication_step(folder, 20)
    symbols = [ca.MX.sym("m", n) for n in (7, 3, 0, 1)]
    at = [twin.x_start, np.array([50.0, -20.0, 10.0]), np.zeros(0), np.array([6.0])]
    for which, size in ((0, 1e-4), (1, 1.0), (3, 1e-4)):
        jacobian = ca.Function("j", symbols, [ca.jacobian(step(*symbols), symbols[which])])
        found, truth = np.array(jacobian(*at)), by_differences(step, at, which, size)
        # differences: the tolerance over their size; their square times third derivatives of 4 rad
        error = 1e-13 / size + (4.0**3 if which != 1 else 1e-4) * size**2 * np.abs(truth).max()
        assert np.abs(found - truth).max() <= error


@pytest.mark.thorough
def test_a_function_that_calls_the_communication_step_cannot_be_generated(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    twin = twin_of("no p")
    steps = twin.communication_step(folder).mapaccum(3)
    begin_cache(tmp_path)  # where the linker fails, the next compiler begins anew
    monkeypatch.setenv("SUPERVESSEL_CACHE", str(tmp_path))
    with pytest.raises(BuildError, match="undefined symbol: communication_step"):
        twin.generate(folder, [steps], derivatives=0)


@pytest.mark.parametrize("name", ["taylor", "docks", "no p"])
def test_c_of_the_communication_step_compiles_without_warnings(name: str, tmp_path: Path) -> None:
    (tmp_path / "scene.h").write_text(generate(twin_of(name).scene, 3)[0]["scene.h"])
    strict = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Wstrict-prototypes", "-Werror"]
    compiler = [
        sys.executable,
        "-m",
        "ziglang",
        "cc",
        "-std=c99",
        "-c",
        "-o",
        str(tmp_path / "it.o"),
        *strict,
    ]
    command = [*compiler, "-I", str(tmp_path), "-I", str(LAYER), str(WRAPPER)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("count", [0, 2.5, "3"])
def test_sub_steps_that_are_no_whole_number_from_one_are_refused(count: Any, folder: Path) -> None:
    message = rf"^communication_step: {count!r} sub-steps: must be a whole number from 1$"
    with pytest.raises(ValueError, match=message):
        twin_of("taylor").communication_step(folder, count)


def test_the_library_is_compiled_once(tmp_path: Path) -> None:
    twin = twin_of("no p")
    twin.communication_step(tmp_path)
    made = {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    twin.communication_step(tmp_path)
    assert len(made) == 1
    assert {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()} == made
