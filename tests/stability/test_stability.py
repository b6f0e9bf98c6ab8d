"""Every reference case through real FMUs by every propagator: right to rounding or tolerance, or refused."""

import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy import read_model_description

from fmu_build.compile.compiler import fmi_headers
from fmu_build.platforms import host_platform
from stability import truth
from stability.flights import TEMPLATE, Craft, craft, one_tensor, single
from stability.pair import MASSES, pair, pair_case, pair_inertia, pair_truth
from stability.runs import RUNS, Run, applies, flights, is_long, motion_problem, problem
from supervessel import Twin
from support import DISCARD, OK, U, scene, store, unpacked, variant
from support.marks import some_at_once

FREE = [name for name in truth.categories() if not name.startswith("torque")]
DIAGONAL = [name for name in FREE if not name.endswith("full tensor")]


def answers(run: Run, category: str, long: bool, parts: int = 1) -> None:
    """Flies a category; nothing may be wrong."""
    wrong = {}
    for case, end, _ in flights(run, category, long=long, parts=parts):
        found = problem(run, case, end)
        if found:
            wrong[case.name] = found
    assert not wrong, "\n".join(f"{name}: {what}" for name, what in wrong.items())


def some(run: Run, category: str, long: bool) -> bool:
    return any(applies(run, case) and is_long(run, case) == long for case in truth.cases(category))


def pairs(long: bool) -> list[Any]:
    return [
        pytest.param(run, category, id=f"{run}, {category}")
        for run in RUNS
        for category in truth.categories()
        if some(run, category, long)
    ]


def every_other(cases: list[Any]) -> list[Any]:
    """Marks as thorough the cases whose run and category have no numbers that are odd or even alike."""
    runs, categories = list(RUNS), list(truth.categories())
    return [
        case
        if (runs.index(case.values[0]) + categories.index(case.values[1])) % 2 == 0
        else pytest.param(*case.values, id=case.id, marks=pytest.mark.thorough)
        for case in cases
    ]


@pytest.mark.parametrize(("run", "category"), every_other(pairs(long=False)))
def test_a_step_is_right_or_refused(run, category):
    answers(run, category, long=False)


@pytest.mark.stability
@pytest.mark.parametrize(("run", "category"), pairs(long=True))
def test_a_long_step_is_right_or_refused(run, category):
    answers(run, category, long=True)


@pytest.mark.parametrize("parts", [2, 8])
@pytest.mark.parametrize("category", FREE)
def test_exact_motion_in_several_steps_is_as_right_as_in_one(category, parts):
    """From the second step on theta functions serve where the nome lets them."""
    answers(Run("exact"), category, long=False, parts=parts)


def test_theta_functions_serve_most_of_the_reference_cases():
    """The control for the test above: two steps have other bits than the one they come to."""
    cases = [case for name in FREE for case in truth.cases(name) if case.time]
    ends = [[craft("exact", case.full).fly(case, parts=n).state.tobytes() for n in (1, 2)] for case in cases]
    assert sum(one != two for one, two in ends) > 0.7 * len(cases)


@pytest.mark.parametrize("parts", [1, 2])
@pytest.mark.parametrize("category", DIAGONAL)
def test_exact_motion_of_a_diagonal_body_is_as_right_as_its_motion_allows(category, parts):
    found = [
        (case.name, motion_problem(case, end))
        for case, end, _ in flights(Run("exact"), category, long=False, parts=parts)
        if not case.full
    ]
    assert not [pair for pair in found if pair[1]]


@pytest.mark.parametrize("category", FREE)
def test_auto_without_torque_gives_the_bits_of_exact(category):
    for case in truth.cases(category):
        for parts in (1, 2):
            one, other = (craft(name, case.full).fly(case, parts=parts) for name in ("auto", "exact"))
            assert one.state.tobytes() == other.state.tobytes(), case.name


def test_a_flight_of_a_span_of_no_time_is_the_start():
    [case] = [case for case in truth.cases("at rest") if case.name == "no time"]
    end = craft("exact", case.full).fly(case)
    assert end.omega.tolist() == case.omega.tolist()
    assert np.abs(end.attitude - case.attitude).max() <= 2 * U


BUILT = [
    ("exact", "general, full tensor", "10 s"),
    ("exact", "slender, full tensor", "1e-12, 1000 s"),
    ("exact", "many turns, full tensor", "10000 rad/s, 1000 s"),
    ("exact", "tiny and huge moments, full tensor", "1e-300 kg m2, 1 rad/s, 10 s"),
    ("auto", "near the separatrix, full tensor", None),
    ("auto", "torque, odd bodies, full tensor", "1e300 kg m2"),
    ("taylor", "torque, moderate, full tensor", "about 36 rad"),
    ("taylor", "torque, odd bodies, full tensor", "slender, 1e-6"),
    ("dop853", "omega h of 1, 10, 1000, full tensor", "10 rad, 50 rad/s"),
    ("rk4", "nearly spherical, full tensor", None),
    ("split", "torque, weak, full tensor", "1e-09 N m, 40 s"),
]


@pytest.mark.parametrize(("propagator", "category", "name"), some_at_once(BUILT, *BUILT[::3]))
def test_a_tensor_put_into_an_fmu_flies_as_in_one_built_for_it(propagator, category, name):
    """To the bit, but for principal axes: a constant tensor's are folded when the code is generated."""
    case = next(case for case in truth.cases(category) if name in (None, case.name))
    own = Craft(propagator, True, one_tensor(propagator, case.inertia))
    run = next(run for run in RUNS if run.propagator == propagator)
    one, other = (flown.fly(case, run.tolerance) for flown in (own, craft(propagator, True)))
    own.instance.free()
    assert problem(run, case, one) is None
    assert problem(run, case, other) is None
    if propagator in ("rk4", "dop853"):
        assert one.estimate == other.estimate
        assert one.state.tobytes() == other.state.tobytes()


# Two vessels of very different mass


@pytest.mark.parametrize("masses", [MASSES, MASSES[::-1]])
def test_the_inertia_of_a_pair_of_mass_ratio_1e_12_is_right_to_rounding(masses):
    raw = pair("exact", masses)
    found, exact = pair_inertia(raw), pair_truth(raw)
    size = np.sqrt(np.outer(np.diag(found), np.diag(found)))
    # mass, distance squared, their product, two sums
    assert all(abs(f - e) <= 8 * U * s for f, e, s in zip(found.flat, exact.flat, size.flat, strict=True))


@pytest.mark.parametrize("run", [Run("exact"), Run("taylor", 1e-9)], ids=str)
def test_a_pair_of_mass_ratio_1e_12_flies_right(run):
    flown = Craft(run.propagator, True, pair(run.propagator, MASSES))
    assert problem(run, pair_case(), flown.fly(pair_case(), run.tolerance)) is None
    flown.instance.free()


# Moments about the boundary of the triangle


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("beyond", [1e-14, 1e-9, 0.5])
def test_moments_beyond_the_triangle_are_refused_with_the_numbers(axis, beyond):
    flown = craft("exact", False)
    it = flown.instance
    moments = np.roll([3.0 + beyond, 1.0, 2.0], axis)
    flown.begin(truth.cases("flat")[0])
    assert it.set({"B.pmi": moments}) == OK
    before = it.fmu.getFloat64([it.references[f"state.attitude[{i}]"] for i in (1, 2, 3, 4)])
    assert it.step(1.0) == DISCARD
    [message] = it.messages()
    assert f"B.pmi = ({', '.join(f'{x:.10g}' for x in moments)}) m2" in message
    assert f"exceeds 1 + 2 by {float(moments.max()) - 3.0:.6g}; no rigid body has these moments" in message
    assert it.fmu.getFloat64([it.references[f"state.attitude[{i}]"] for i in (1, 2, 3, 4)]) == before
    assert it.set({"B.pmi": np.roll([3.0, 1.0, 2.0], axis)}) == OK
    assert it.step(1.0) == OK


# There and back, in the twin: its steps take any sign

BODY = variant(
    single({"inertia": TEMPLATE}, "exact"),
    {"rotation.angular_velocity": [0.3, 0.7, 0.5]},
)
TORQUE = [0.02, -0.04, 0.03]


@cache
def twin(propagator: str, tolerance: float) -> Twin:
    changes = {"rotation.propagator": propagator, "rotation.tolerance": tolerance}
    return Twin(scene(variant(BODY, changes)))


def defect(propagator: str, h: float, torque: list[float], tolerance: float = 1e-9) -> float:
    """Returns how far a step of h and one of -h lead away from the start."""
    by = twin(propagator, tolerance)
    there = by.step(by.x_start, torque, [], h)
    return float(np.abs(np.array(by.step(there, torque, [], -h)).ravel() - by.x_start).max())


@pytest.mark.parametrize("h", [1e-9, 0.3, 4.0, 25.0, 90.0])
def test_exact_motion_there_and_back_is_at_the_start(h):
    angle = float(np.linalg.norm(BODY["rotation"]["angular_velocity"])) * h
    # each way 16 u (1 + angle); the rate's error there turns on for the way back
    assert defect("exact", h, [0.0] * 3) <= 16 * U * (2.0 + 3.0 * angle)


@pytest.mark.parametrize(
    ("propagator", "tolerance", "order", "h"),
    [("rk4", 1e-9, 4, 0.4), ("dop853", 1e-9, 8, 1.5), ("taylor", 1e-3, 8, 1.5), ("taylor", 1e-6, 12, 2.0)],
)
def test_there_and_back_the_errors_of_even_order_methods_cancel_but_for_the_next_power(
    propagator, tolerance, order, h
):
    defects = [defect(propagator, h / 2**n, TORQUE, tolerance) for n in range(3)]
    # C h^(p + 1) and C (-h)^(p + 1) cancel: h^(p + 2) remains; the next even order is two away
    slopes = np.log2(np.array(defects[:-1]) / np.array(defects[1:]))
    assert np.abs(slopes - (order + 2)).max() < 1.0, (defects, slopes)


@pytest.mark.parametrize("propagator", ["rk4", "dop853", "taylor", "split"])
@pytest.mark.parametrize("h", [1e-9, 1e-3])
def test_short_steps_there_and_back_are_at_the_start_to_rounding(propagator, h):
    torque = [1e-9 * x for x in TORQUE] if propagator == "split" else TORQUE
    assert defect(propagator, h, torque) <= 16 * U


# A million steps

STEPS, STEP = 1_000_000, 0.01
MOMENTUM = "kinetic_energy", "angular_momentum", "attitude"


@pytest.mark.parametrize(
    "inertia",
    some_at_once({"diagonal": np.diag([1.0, 2.0, 2.5]), "full tensor": np.array(TEMPLATE)}, "full tensor"),
)
@pytest.mark.parametrize(("propagator", "tolerance"), [("exact", 0.0), ("auto", 0.0), ("taylor", 1e-15)])
def test_a_million_steps_keep_momentum_and_energy(propagator, tolerance, inertia):
    raw = variant(
        one_tensor(propagator, inertia),
        {"name": "long", "outputs.names": list(MOMENTUM), "rotation.angular_velocity": [0.3, 0.7, 0.5]},
    )
    folder = unpacked(raw, optimised=True)
    description = read_model_description(str(folder))
    references = {v.name: v.valueReference for v in description.modelVariables}
    library = folder / "binaries" / host_platform().name / f"long{host_platform().suffix}"
    first = [references[name] for name in ("attitude[1]", "angular_momentum[1]", "kinetic_energy")]
    words = [build_host(), library, description.guid, STEPS, STEP, tolerance, *first]
    done = subprocess.run([str(word) for word in words], check=True, capture_output=True, text=True)
    energy, length, vector, attitude = map(float, done.stdout.split())
    assert energy <= 1e-12
    assert length <= 1e-12
    # the attitude's error turns it: that of a turn of 9000 rad, and a few u of each step of those that divide
    assert vector <= (16 * U * 1e4 if propagator != "taylor" else 16 * U * STEPS)
    assert attitude <= 4 * U


@cache
def build_host() -> Path:
    """Returns the program that takes the steps."""
    program = Path(tempfile.mkdtemp(dir=store())) / "long_run"
    command = [sys.executable, "-m", "ziglang", "cc", "-target", host_platform().target, "-std=gnu99", "-O2"]
    command += [
        "-isystem",
        str(fmi_headers()),
        f"-I{Path(__file__).parent.parent / 'support'}",
        str(Path(__file__).with_name("long_run.c")),
        "-o",
        str(program),
    ]
    subprocess.run([*command, "-lm", "-ldl"], check=True)
    return program
