"""The twin for control: calls that are checked, fixed inputs, roll-outs, generated C, trim, scales, docs."""

import gc
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

from fmu_build.errors import BuildError
from supervessel import Twin, reference
from supervessel.twin.twin import FUNCTIONS
from support import ISS_DG, NAN, TURNING, Array, U, body, relative_error, scene, variant
from support.processes import ROOT
from twin.scenes import numbers

H = 0.5
STEPS = 20
RAW = variant(ISS_DG, {"rotation": TURNING})
PROPAGATORS = ("rk4", "dop853", "taylor", "split")
TORQUE = (2e5, -1e5, 3e5)


@pytest.fixture(scope="module")
def twin() -> Twin:
    return Twin(scene(RAW))


# Calls by numbers are checked


@pytest.mark.parametrize(
    ("call", "problem"),
    [
        (lambda t: t.step(t.x_start[:6], TORQUE, t.p_start, H), "step: x holds 6 numbers: 7 numbers wanted"),
        (lambda t: t.step(t.x_start, 0.0, t.p_start, H), "step: u holds 1 number: 3 numbers wanted"),
        (lambda t: t.ode(t.x, t.u, t.p[:3]), "ode: p holds 3 numbers: 13 numbers wanted"),
        (lambda t: t.step(t.x_start, TORQUE, t.p_start), "3 arguments given, 4 wanted"),
        (lambda t: t.step(x=t.x_start), "step(x, u, p, h): h is missing"),
        (lambda t: t.step(x=t.x_start, hh=H), 'unknown argument "hh" (did you mean "h"?)'),
        (lambda t: t.step(t.x_start, h=H), "either all named or all in order"),
        (lambda t: t.step(x="start", h=H), "step: x = 'start': must be numbers or CasADi symbols"),
        (lambda t: t.ode(x=t.x, u=[t.u[0], 0]), "ode: u holds 2 numbers: 3 numbers wanted"),
        (lambda t: t.step(x=np.full(7, np.nan), h=H), "must be finite"),
        (lambda t: t.ode(x=t.x_start, u=[0, 0, np.inf]), "must be finite"),
        (lambda t: t.step(x=[1, 1, 0, 0, 0, 0, 0], h=H), "the attitude in x has length 1.41421: must be 1"),
        (lambda t: t.step(x=[0.71, 0.71, 0, 0, 0, 0, 0], h=H), "length 1.00409"),
        (lambda t: t.error(t.x_start, [0] * 7), "the attitude in x_ref has length 0"),
        (lambda t: t.step.mapaccum(3)(x=t.x_start, u=np.zeros((3, 2)), h=H), "holds 3 by 2: 3 by 3 wanted"),
        (lambda t: t.step.map(2)(x=np.ones((7, 2)), h=H), "length 2: must be 1"),
        (lambda t: t.p_with({"DG.mas": 1.0}), 'unknown input "DG.mas" (did you mean "DG.mass"?)'),
        (lambda t: t.p_with({"DG.pmi": 1.0}), "DG.pmi = 1.0: must be 3 finite numbers"),
        (lambda t: t.p_with({"DG.mass": np.nan}), "DG.mass = nan: must be a finite number"),
        (lambda t: t.p_with({"DG.mass": -1.0}), "DG.mass = -1.0: must not be negative"),
        (lambda t: t.p_with({"DG.pmi[2]": -1.0}), "DG.pmi[2] = -1.0: must not be negative"),
        (lambda t: t.p_with({"DG.nose.direction": [0, 0, 0]}), "must be longer than 0"),
        (lambda t: Twin(t.scene, fixed={"DG.mass": -1.0}), "DG.mass = -1.0: must not be negative"),
        (lambda t: Twin(t.scene, fixed=["DG.nose"]), 'unknown input "DG.nose"'),
        (lambda t: Twin(t.scene, fixed={"torque": [1, 2, 3]}), 'unknown input "torque"'),
        (lambda t: Twin(t.scene, error_form="euler"), "must be one of vec, rotvec, mrp"),
        (lambda t: t.rollout(0), "rollout: 0 steps: must be a whole number from 1"),
        (lambda t: t.scales(0.0), "time = 0.0 s: must be positive"),
        (lambda t: t.generate("build", ["stp"]), 'unknown function "stp" (did you mean "step"?)'),
        (lambda t: t.generate("build", derivatives=3), "derivatives = 3: must be 0, 1 or 2"),
    ],
)
def test_misuse_is_refused_with_what_is_wanted(
    twin: Twin, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: Callable[[Twin], Any], problem: str
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match=re.escape(problem)):
        call(twin)
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(
    "use",
    [
        lambda t: t.trim,
        lambda t: t.to_acados(),
        lambda t: t.to_do_mpc(),
        lambda t: t.step(t.x_start, TORQUE, t.p_start, H),
    ],
)
def test_control_of_a_scene_without_torque_is_refused_with_what_to_do(use: Callable[[Twin], Any]) -> None:
    without = Twin(scene(variant(RAW, {"inputs.torque": False})))
    with pytest.raises(ValueError, match=r'has no torque input; put "torque = true" under \[inputs\]'):
        use(without)


def test_attitudes_of_loose_integration_pass(twin: Twin) -> None:
    x = twin.x_start * ([0.9995] * 4 + [1.0] * 3)
    assert np.isfinite(numbers(twin.step(x, TORQUE, twin.p_start, H))).all()
    x = twin.x_start * ([2.0] * 4 + [1.0] * 3)
    # the output attitude is brought to unit length, rates are right at any
    assert numbers(twin.outputs(x, TORQUE, twin.p_start)).tolist() == pytest.approx(
        numbers(twin.outputs(twin.x_start, TORQUE, twin.p_start)).tolist(), rel=8 * U, abs=8 * U
    )


def test_arguments_left_out_are_no_torque_and_the_scenes_inputs(twin: Twin) -> None:
    short = twin.step(x=twin.x_start, h=H)["x_next"]
    assert numbers(short).tolist() == numbers(twin.step(twin.x_start, np.zeros(3), twin.p_start, H)).tolist()
    short = twin.step.mapaccum(3)(x=twin.x_start, h=H)["x_next"]
    whole = np.array(twin.step.mapaccum(3)(x=twin.x_start, u=np.zeros(3), p=twin.p_start, h=H)["x_next"])
    assert np.array(short).tolist() == whole.tolist()


@pytest.mark.parametrize("kind", [ca.SX, ca.MX])
def test_a_list_may_hold_symbols_among_numbers(twin: Twin, kind: Any) -> None:
    torque = kind.sym("torque")
    rate = twin.ode(x=twin.x_start, u=[0.0, torque, 5.0])["x_dot"]
    found = numbers(ca.Function("rate", [torque], [rate])(7.0))
    assert found.tolist() == numbers(twin.ode(twin.x_start, [0.0, 7.0, 5.0], twin.p_start)).tolist()


def test_p_with_puts_values_where_their_names_stand(twin: Twin) -> None:
    p = twin.p_with({"DG.mass": 12000.0, "DG.nose.position": [1, 2, 3], "DG.pmi[2]": 20.0})
    changed = dict(zip(twin.p_names, p, strict=True))
    places = [f"DG.nose.position[{i}]" for i in (1, 2, 3)]
    assert [changed[name] for name in ("DG.mass", "DG.pmi[2]", *places)] == [12000.0, 20.0, 1.0, 2.0, 3.0]
    assert (p != twin.p_start).sum() == 5


def test_functions_stay_casadis_own(twin: Twin, tmp_path: Path) -> None:
    assert isinstance(twin.step, ca.Function)
    at = (twin.x_start, TORQUE, twin.p_start, H)
    file = str(tmp_path / "step.casadi")
    twin.step.save(file)
    again = ca.Function.load(file)
    assert numbers(again(*at)).tolist() == numbers(twin.step(*at)).tolist()
    assert again.name_in() == twin.step.name_in()
    text = ca.Function.deserialize(twin.step.serialize())
    assert numbers(text(*at)).tolist() == numbers(twin.step(*at)).tolist()


@pytest.mark.parametrize("name", [name for name in FUNCTIONS if name != "trim_by_wheels"])
def test_each_function_survives_saving(twin: Twin, name: str) -> None:
    function = getattr(twin, name)
    again = ca.Function.deserialize(function.serialize())
    rng = np.random.default_rng(1)
    at = {"x": twin.x_start, "x_ref": twin.x_start, "p": twin.p_start, "u": TORQUE, "h": H}
    at |= {
        "e": 0.1 * rng.normal(size=6),
        "acceleration_ref": rng.normal(size=3),
        "p_next": 1.01 * twin.p_start,
        "bound": [1e-3, 1e-2],
    }
    arguments = [at[argument] for argument in function.name_in()]
    values = [numbers(v).tolist() for v in (again.call(arguments), function.call(arguments)) for v in v]
    assert values[: len(values) // 2] == values[len(values) // 2 :]


@pytest.mark.parametrize(
    ("bound", "h", "words"),
    [
        ([0.0, -1.0], H, r"error_bound: bound = \[0\.0, -1\.0\]: must be >= 0"),
        ([NAN, 0.0], H, r"error_bound: bound = \[nan, 0\.0\]: must be >= 0"),
        ([0.0, 0.0], -H, r"error_bound: h = .*: must be > 0"),
        ([0.0, 0.0], 0.0, r"error_bound: h = .*: must be > 0"),
    ],
)
def test_what_is_no_bound_and_steps_back_are_refused(twin: Twin, bound: Any, h: float, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        twin.error_bound(twin.x_start, bound, TORQUE, twin.p_start, h)


def test_a_bound_that_is_infinite_stays_infinite(twin: Twin) -> None:
    bound = twin.error_bound(twin.x_start, [np.inf, np.inf], TORQUE, twin.p_start, H)
    assert numbers(bound).ravel().tolist() == [np.inf, np.inf]


# Fixed inputs, many steps


@pytest.mark.parametrize("propagator", PROPAGATORS)
def test_a_twin_with_fixed_inputs_gives_the_same_numbers(propagator: Any) -> None:
    free = Twin(scene(RAW), propagator=propagator)
    values = {"DG.mass": 12000.0, "DG.nose.position": [0.3, -0.5, -9.0]}
    p = free.p_with(values)
    some = Twin(scene(RAW), propagator=propagator, fixed=values)
    assert some.p_names == tuple(n for n in free.p_names if n.partition("[")[0] not in values)
    whole = numbers(free.step(free.x_start, TORQUE, p, H))
    assert numbers(some.step(x=some.x_start, u=TORQUE, h=H)["x_next"]).tolist() == whole.tolist()
    assert (
        numbers(some.ode(x=some.x_start, u=TORQUE)["x_dot"]).tolist()
        == numbers(free.ode(free.x_start, TORQUE, p)).tolist()
    )
    inertia = numbers(free.composite(p)[2]).tolist()
    assert numbers(some.composite(p=some.p_start)["inertia"]).tolist() == inertia
    every = Twin(scene(RAW), propagator=propagator, fixed=True)
    assert (every.p_names, every.p_start.shape) == ((), (0,))
    named = Twin(scene(RAW), propagator=propagator, fixed=["DG.mass", "DG.pmi[1]"])
    assert len(named.p_names) == len(free.p_names) - 2
    for t in (every, named):
        end = t.step(t.x_start, TORQUE, t.p_start, H)
        assert numbers(end).tolist() == numbers(free.step(free.x_start, TORQUE, free.p_start, H)).tolist()


@pytest.mark.parametrize("fixed", [False, True])
@pytest.mark.parametrize("propagator", PROPAGATORS)
def test_rollout_is_the_chain_of_steps_to_the_last_bit(propagator: Any, fixed: bool) -> None:
    t = Twin(scene(RAW), propagator=propagator, fixed=fixed)
    u = 1e5 * np.random.default_rng(3).normal(size=(3, STEPS))
    states = np.array(t.rollout(STEPS)(t.x_start, u, t.p_start, H))
    x = t.x_start
    for i in range(STEPS):
        x = numbers(t.step(x, u[:, i], t.p_start, H))
        assert states[:, i].tolist() == x.tolist()


@pytest.mark.parametrize("fixed", [False, True])
def test_rollout_of_free_motion_is_a_step_to_each_time_to_the_last_bit(fixed: bool) -> None:
    """So roundings do not pile up; where one step has no room for the last time, the rollout has."""
    t = Twin(scene(RAW), propagator="exact", fixed=fixed, doublings=2)
    roomy = Twin(t.scene, propagator="exact", fixed=fixed, doublings=8)
    longest = np.array(t.rollout(STEPS)(x=t.x_start, h=20 * H)["x_next"])
    for i in range(STEPS):
        x = numbers(roomy.step(x=t.x_start, h=(i + 1) * 20 * H)["x_next"])
        assert longest[:, i].tolist() == x.tolist()
    assert np.isnan(numbers(t.step(x=t.x_start, h=STEPS * 20 * H)["x_next"])).all()


def test_rollout_of_free_motion_is_no_number_from_the_first_torque_on() -> None:
    t = Twin(scene(RAW), propagator="exact")
    u = np.zeros((3, STEPS))
    u[1, 2] = 1e-300
    states = np.array(t.rollout(STEPS)(t.x_start, u, t.p_start, H))
    assert np.isfinite(states[:, :2]).all()
    assert np.isnan(states[:, 2:]).all()


@pytest.mark.parametrize("law", ["none", "decoupled", "principal"])
def test_rollout_of_each_law_is_the_chain_of_steps(law: str) -> None:
    t = Twin(scene(variant(RAW, {"rotation.law": law})))
    states = np.array(t.rollout(2)(x=t.x_start, u=TORQUE, h=H)["x_next"])
    x = t.step(t.step(t.x_start, TORQUE, t.p_start, H), TORQUE, t.p_start, H)
    assert states[:, 1].tolist() == numbers(x).tolist()


def test_map_mapaccum_and_fold_are_single_steps(twin: Twin) -> None:
    rng = np.random.default_rng(4)
    u, p = 1e5 * rng.normal(size=(3, 4)), np.tile(twin.p_start[:, None], 4)
    p[0] *= rng.uniform(0.9, 1.1, 4)
    h = np.full((1, 4), H)
    starts = np.array([numbers(twin.step(twin.x_start, u[:, i], p[:, i], i * H)) for i in range(4)]).T
    apart = np.array(twin.step.map(4)(starts, u, p, h))
    threads = np.array(twin.step.map(4, "thread", 2)(starts, u, p, h))
    x, chain = twin.x_start, []
    for i in range(4):
        assert apart[:, i].tolist() == numbers(twin.step(starts[:, i], u[:, i], p[:, i], H)).tolist()
        x = numbers(twin.step(x, u[:, i], p[:, i], H))
        chain.append(x.tolist())
    assert threads.tolist() == apart.tolist()
    assert np.array(twin.step.mapaccum(4)(twin.x_start, u, p, h)).T.tolist() == chain
    assert numbers(twin.step.fold(4)(twin.x_start, u, p, h)).tolist() == chain[-1]


# Generated C


@pytest.mark.parametrize("propagator", [*PROPAGATORS, "exact"])
def test_generated_c_gives_the_twins_numbers(tmp_path: Path, propagator: Any) -> None:
    t = Twin(scene(RAW), propagator=propagator)
    compiled = t.generate(tmp_path, ["composite", "ode", "step", t.rollout(3)], derivatives=0)
    assert list(compiled) == ["composite", "ode", "step", "rollout"]
    u = np.zeros(3) if propagator == "exact" else np.array(TORQUE)
    at = {"x": t.x_start, "u": u, "p": t.p_start, "h": H}
    for name, original in (("composite", t.composite), ("ode", t.ode), ("step", t.step)):
        given = {key: at[key] for key in original.name_in()}
        for key, value in original(**given).items():
            assert numbers(compiled[name](**given)[key]).tolist() == numbers(value).tolist()
    assert compiled["step"].class_name() == "External"
    states = np.array(t.rollout(3)(**at)["x_next"])
    assert np.array(compiled["rollout"](**at)["x_next"]).tolist() == states.tolist()


def test_generated_c_is_checked_and_compiled_once(tmp_path: Path, twin: Twin) -> None:
    step = twin.generate(tmp_path, ["step"], derivatives=0)["step"]
    with pytest.raises(ValueError, match=r"length 1\.41421"):
        step(x=[1, 1, 0, 0, 0, 0, 0], h=H)
    before = {path: path.stat().st_mtime_ns for path in tmp_path.iterdir() if path.suffix != ".c"}
    twin.generate(tmp_path, ["step"], derivatives=0)
    assert {path: path.stat().st_mtime_ns for path in tmp_path.iterdir() if path.suffix != ".c"} == before
    Twin(twin.scene, fixed=True).generate(tmp_path, ["step"], derivatives=0)
    assert len([path for path in tmp_path.iterdir() if path.suffix != ".c"]) == len(before) + 1 == 2


def test_in_place_loops_over_the_same_numbers(tmp_path: Path, twin: Twin) -> None:
    compiled = twin.generate(tmp_path, ["step", "linearise"], derivatives=0)
    for step in (twin.step, compiled["step"]):
        run, at = step.in_place()
        assert at["p"].tolist() == twin.p_start.tolist()
        x, at["x"][:], at["h"][:] = twin.x_start, twin.x_start, H
        gc.collect()  # nothing that is called may hang on what the caller has dropped
        for i in range(STEPS):
            at["u"][:] = 1e4 * i
            run()
            at["x"][:] = at["x_next"]
            x = numbers(twin.step(x, np.full(3, 1e4 * i), twin.p_start, H))
            assert at["x_next"].tolist() == x.tolist()
    run, at = compiled["linearise"].in_place()
    at["x"][:] = twin.x_start
    run()
    for name, value in twin.linearise(x=twin.x_start).items():
        assert at[name].tolist() == np.array(value).tolist()
    u = twin.rollout(3).in_place()[1]["u"]
    assert (u.shape, u.flags.f_contiguous) == ((3, 3), True)


def test_in_place_refuses_a_sparse_result(twin: Twin) -> None:
    sparse = twin.step.like(ca.Function("sparse", [twin.x], [ca.diag(twin.x)], ["x"], ["y"]))
    with pytest.raises(ValueError, match="sparse: y is sparse: not for in_place"):
        sparse.in_place()


@pytest.mark.parametrize("order", [1, 2])
def test_generated_c_has_the_derivatives_asked_for(tmp_path: Path, twin: Twin, order: int) -> None:
    step = twin.generate(tmp_path, ["step"], derivatives=order)["step"]
    z = ca.MX.sym("z", 7 + 3 + len(twin.p_names) + 1)
    at = [*twin.x_start, *TORQUE, *twin.p_start, H]

    def derivative(function: Any) -> Array:
        parts = ca.vertsplit(z, [0, 7, 10, 10 + len(twin.p_names), z.numel()])
        end = function(*parts)
        wanted = ca.jacobian(end, z) if order == 1 else ca.hessian(ca.dot(end, ca.DM(range(1, 8))), z)[0]
        return np.array(ca.Function("wanted", [z], [wanted])(at))

    truth = derivative(twin.step)
    # by forward seeds in C, by whatever CasADi chooses in its own: some hundred roundings
    assert relative_error(derivative(step), truth) <= 512 * U


def test_what_cannot_be_compiled_is_a_build_error(tmp_path: Path, twin: Twin) -> None:
    flow = ca.integrator("flow", "cvodes", twin.to_dae(), 0.0, 1.0)
    with pytest.raises(BuildError, match="CvodesInterface"):
        twin.generate(tmp_path, [flow], derivatives=0)


# Trim, principal axes, invariants, scales


LAW = pytest.mark.parametrize("law", ["none", "decoupled", "principal", "tensor"])


@LAW
def test_trim_holds_a_spin(law: str) -> None:
    t = Twin(scene(variant(RAW, {"rotation.law": law})))
    u = numbers(t.trim(t.x_start, t.p_start))
    rates = numbers(t.ode(t.x_start, u, t.p_start))[4:]
    omega = np.array(TURNING["angular_velocity"])
    # what rounding leaves of two equal torques, solved with a tensor of condition below 2
    assert np.abs(rates).max() <= 64 * U * float(omega @ omega)
    if law == "tensor":
        J = reference.composite(t.scene).inertia
        assert relative_error(u, np.cross(omega, J @ omega)) <= 1e-12


def test_spins_about_principal_axes_need_no_torque_and_the_middle_one_is_unstable() -> None:
    t = Twin(scene(RAW))
    moments, axes = (np.array(v) for v in t.principal(t.p_start))
    J = reference.composite(t.scene).inertia
    assert relative_error(moments.ravel(), np.linalg.eigvalsh(J)) <= 1e-12
    growth = []
    for k in range(3):
        x = [1.0, 0, 0, 0, *(0.01 * axes[:, k])]
        assert np.abs(numbers(t.trim(x, t.p_start))).max() <= 64 * U * moments[2, 0] * 1e-4
        A = np.array(t.linearise(x, np.zeros(3), t.p_start)[0])
        growth.append(np.linalg.eigvals(A).real.max())
    A, B, C = moments.ravel()
    expected = 0.01 * np.sqrt((C - B) * (B - A) / (A * C))
    assert growth[1] == pytest.approx(expected, rel=1e-9)
    assert max(growth[0], growth[2]) <= 1e-6 * expected


@LAW
def test_invariants_are_kept_without_torque(law: str) -> None:
    t = Twin(scene(variant(RAW, {"rotation.law": law})), propagator="dop853")
    x = t.rollout(STEPS)(x=t.x_start, h=H)["x_next"][:, -1]
    before, after = (np.concatenate([numbers(v) for v in t.invariants(x, t.p_start)]) for x in (t.x_start, x))
    # DOP853 at 0.07 rad a step is at rounding: 8 u a step
    assert np.abs(after[0] / before[0] - 1.0) <= 16 * STEPS * U
    assert np.abs(after[1:] - before[1:]).max() <= 16 * STEPS * U * np.linalg.norm(before[1:])


def test_invariants_of_the_tensor_law_are_the_outputs(twin: Twin) -> None:
    y = dict(zip(twin.y_names, numbers(twin.outputs(x=twin.x_start, u=TORQUE)["y"]), strict=True))
    energy, momentum = twin.invariants(twin.x_start, twin.p_start)
    assert float(energy) == y["kinetic_energy"]
    assert numbers(momentum).tolist() == [y[f"angular_momentum[{i}]"] for i in (1, 2, 3)]


def test_a_scaled_problem_has_numbers_of_about_one(twin: Twin) -> None:
    scales = twin.scales(60.0)
    B = np.array(twin.linearise(twin.x_start, np.zeros(3), twin.p_start)[1])
    scaled = 60.0 * B * scales.u / scales.e[:, None]
    moments = np.diag(np.array(twin.composite(twin.p_start)[2]))
    assert np.diag(scaled[3:]) == pytest.approx(moments.mean() / moments, rel=0.01)
    assert (scales.x[:4].tolist(), scales.x[4:].tolist()) == ([1.0] * 4, [1 / 60.0] * 3)
    assert np.abs(twin.p_start / scales.p).max() == 1.0
    assert (scales.p > 0.0).all()


# Conventions of other packages


def test_opti_solves_with_the_twin() -> None:
    t = Twin(scene(body()), error_form="mrp")
    opti = ca.Opti()
    u = opti.variable(3, STEPS)
    states = t.rollout(STEPS)(x=[1, 0, 0, 0, 0, 0, 0], u=200.0 * u, h=H)["x_next"]
    target = [np.cos(0.5), 0, 0, np.sin(0.5), 0, 0, 0]
    opti.subject_to(t.error(states[:, -1], target) == 0.0)
    opti.minimize(ca.sumsqr(u))
    opti.solver("ipopt", {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes"})
    end = opti.solve().value(states[:, -1])
    assert np.abs(numbers(t.error(end, target))).max() <= 1e-8  # ipopt's own tolerance


def test_casadis_integrator_takes_the_dae() -> None:
    t = Twin(scene(RAW), propagator="dop853")
    options = {"reltol": 1e-12, "abstol": 1e-14}
    flow = ca.integrator("flow", "cvodes", t.to_dae(), 0.0, H, options)
    end = numbers(flow(x0=t.x_start, u=TORQUE, p=t.p_start)["xf"])
    assert np.abs(end - numbers(t.step(t.x_start, TORQUE, t.p_start, H))).max() <= 1e-9


def test_do_mpc_simulates_what_the_twin_steps(twin: Twin) -> None:
    do_mpc = pytest.importorskip("do_mpc", reason="package do-mpc is not installed")
    model = twin.to_do_mpc(step=H)
    model.setup()
    simulator = do_mpc.simulator.Simulator(model)
    simulator.set_param(t_step=H)
    template = simulator.get_p_template()
    template["p"] = twin.p_start
    simulator.set_p_fun(lambda time: template)
    simulator.setup()
    simulator.x0 = twin.x_start
    end = numbers(simulator.make_step(np.array(TORQUE)[:, None]))
    # do-mpc wraps the step in a graph of its own, with simplification
    assert np.abs(end - numbers(twin.step(twin.x_start, TORQUE, twin.p_start, H))).max() <= 64 * U


def test_acados_model_holds_the_twins_equations(twin: Twin) -> None:
    reason = "acados_template is not installed: no registry has it by that name, it comes with acados' source"
    pytest.importorskip("acados_template", reason=reason)
    model = twin.to_acados(step=H)
    at = (twin.x_start, TORQUE, twin.p_start)
    symbols = [model.x, model.u, model.p]
    explicit, discrete = ca.Function("f", symbols, [model.f_expl_expr, model.disc_dyn_expr])(*at)
    # the expressions are put into a new graph, with simplification
    for found, expected in ((explicit, twin.ode(*at)), (discrete, twin.step(*at, H))):
        assert np.abs(numbers(found) - numbers(expected)).max() <= 64 * U


@pytest.mark.parametrize(("convert", "package"), [("to_acados", "acados_template"), ("to_do_mpc", "do_mpc")])
def test_a_missing_package_is_named(
    twin: Twin, monkeypatch: pytest.MonkeyPatch, convert: str, package: str
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    monkeypatch.setitem(sys.modules, f"{package}.model", None)
    with pytest.raises(ImportError, match=package):
        getattr(twin, convert)()


def test_importing_the_twin_imports_no_compiler_and_no_other_package(tmp_path: Path) -> None:
    (tmp_path / "model.py").write_text("raise RuntimeError('this is the user\\'s')\n")
    script = (
        "import sys, supervessel\n"
        f"t = supervessel.Twin(supervessel.load_scene({str(ROOT / 'examples' / 'iss_dg.toml')!r}))\n"
        "t.linearise(x=t.x_start)\n"
        "print([n for n in ('fmu_build', 'do_mpc', 'acados_template', 'model') if n in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout.strip()) == (0, "[]"), done.stderr


def test_generating_c_minds_no_model_py_of_the_users(tmp_path: Path) -> None:
    (tmp_path / "model.py").write_text("raise RuntimeError('this is the user\\'s')\n")
    script = (
        "from supervessel import Twin, load_scene\n"
        f"t = Twin(load_scene({str(ROOT / 'examples' / 'iss_dg.toml')!r}))\n"
        "print(t.generate('out', ['ode'], derivatives=0)['ode'].class_name())"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout.strip()) == (0, "External"), done.stderr


# Types


@pytest.mark.thorough
def test_type_checkers_see_the_interface(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "import numpy as np\n"
        "from supervessel import Twin, load_scene\n"
        'twin = Twin(load_scene("scene.toml"), error_form="mrp", fixed={"DG.mass": 1.0})\n'
        "x: np.ndarray = twin.x_start\n"
        "x_next = twin.step(x=x, u=[0, 0, 1], h=0.1)\n"
        'Twin(twin.scene, error_form="euler")\n'
        "twin.rollout(2.5)\n"
        "twin.stepp\n"
    )
    command = [sys.executable, "-m", "mypy", "--config-file", str(ROOT / "pyproject.toml"), str(script)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    lines = [line for line in done.stdout.splitlines() if "script.py:" in line and ": error: " in line]
    found = [re.sub(r".*script\.py:(\d+): error: .*\[(.*)\]", r"\1 \2", line) for line in lines]
    assert found == ["6 arg-type", "7 arg-type", "8 attr-defined"], done.stdout + done.stderr
