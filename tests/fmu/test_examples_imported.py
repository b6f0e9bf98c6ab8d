"""The examples in model exchange, as they are: flown by FMPy, differentiated and integrated by CasADi."""

import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.model_description import read_model_description
from scipy.integrate import solve_ivp

from changes.histories import start_values
from supervessel import Scene, Twin, reference
from support import EPS, STATES, Array, relative_error, scene, unpacked
from support.marks import FMI

EXAMPLES = {path.stem: path for path in (Path(__file__).parents[2] / "examples").glob("*.toml")}
NAME = pytest.mark.parametrize("name", sorted(EXAMPLES))

INTERVAL, COUNT = 0.25, 16
"""Of a flight: seconds between the instants at which FMPy sets inputs, and how many."""

SEED = 20261130
SPAN = INTERVAL * COUNT


@cache
def raw(name: str) -> dict[str, Any]:
    return tomllib.loads(EXAMPLES[name].read_text())


@cache
def flown(name: str) -> Scene:
    return scene(raw(name))


@cache
def twin(name: str) -> Twin:
    return Twin(flown(name))


@cache
def folder(name: str, fmi: int) -> Path:
    return unpacked(raw(name), fmi, optimised=False)


def by_variability(name: str, fmi: int) -> dict[str, list[str]]:
    """Returns the names of the inputs that are continuous and of those that are discrete."""
    inputs = [v for v in read_model_description(folder(name, fmi)).modelVariables if v.causality == "input"]
    return {kind: [v.name for v in inputs if v.variability == kind] for kind in ("continuous", "discrete")}


def size(name: str, values: dict[str, float]) -> float:
    """Returns the largest of the elements of a vector, without sign."""
    return max(abs(values[known]) for known in values if known.partition("[")[0] == name.partition("[")[0])


def courses(name: str, fmi: int, share: float = 1.0) -> list[dict[str, float]]:
    """Returns the inputs at the instants of a flight: what is continuous moves all the time, what is discrete
    jumps once, halfway.

    share : of moves that turn the body as its spin does and burn a third of the masses
    """
    rng, inputs = np.random.default_rng(SEED), by_variability(name, fmi)
    start = dict(zip(twin(name).p_names, twin(name).p_start, strict=True))
    fastest = np.abs(flown(name).rotation.angular_velocity).max() or 1e-3
    torque = fastest / SPAN * np.linalg.norm(np.array(twin(name).composite(twin(name).p_start)[2]), 2)
    sizes = {known: abs(start[known]) or size(known, start) for known in start}
    drift = {known: share * rng.uniform(0.5, 1.0) for known in inputs["continuous"]}
    jump = {known: start[known] * rng.uniform(0.9, 1.1) + 0.2 * rng.normal() for known in inputs["discrete"]}
    jump |= {known: 1.0 - start[known] for known in jump if known.endswith(".docked")}
    rows = []
    for i in range(COUNT + 1):
        moved = {known: jump[known] if 2 * i >= COUNT else start[known] for known in jump}
        for known, whole in drift.items():
            along = whole * i / COUNT
            moved[known] = start[known] - 0.3 * along * sizes[known] if known in start else torque * along
        rows.append(moved)
    return rows


def by_fmpy(name: str, fmi: int, rows: list[dict[str, float]], **settings: Any) -> Array:
    """Returns attitude, angular velocity and momenta of wheels at the end."""
    states = [*STATES, *(f"state.{wheel}.momentum" for wheel in flown(name).wheels)]
    columns = [("time", float), *((known, float) for known in rows[0])]
    signals = [(INTERVAL * i, *row.values()) for i, row in enumerate(rows)]
    result = simulate_fmu(
        folder(name, fmi),
        fmi_type="ModelExchange",
        stop_time=SPAN,
        output_interval=INTERVAL,
        input=np.array(signals, columns),
        output=states,
        **settings,
    )
    return np.array([result[known][-1] for known in states])


def by_reference(name: str, rows: list[dict[str, float]]) -> Array:
    """Returns the same by Euler's method on the numpy reference, inputs held over its steps as FMPy does."""
    flying, rotation = flown(name), flown(name).rotation
    values = start_values(flying) | rows[0]
    wheels = [flying.wheel(wheel) for wheel in flying.wheels]
    y = np.array([*rotation.attitude, *rotation.angular_velocity, *(wheel.momentum for wheel in wheels)])
    for row in rows[:-1]:
        after = values | row
        y[4:] = reference.change(flying, y[4:], values, after)
        values = after
        y = y + INTERVAL * rate_by_reference(flying, y, values)
    return y


def rate_by_reference(flying: Scene, y: Array, values: dict[str, float]) -> Array:
    """Returns the rate of the state, (7 + n,), whose attitude is of any length by Euler's method."""
    attitude = y[:4] / np.linalg.norm(y[:4])
    torque = reference.external_torque(flying, values) + reference.gradient_torque(flying, attitude, values)
    return reference.ode(flying, y, torque, values)


def apart(found: Array, right: Array) -> float:
    """Returns the largest relative difference of attitude, angular velocity and momenta of wheels."""
    parts = [slice(4), slice(4, 7), slice(7, None)][: 3 if len(right) > 7 else 2]
    return max(relative_error(found[part], right[part]) for part in parts)


@NAME
@FMI
def test_fmpy_flies_the_examples_with_every_input_moving(fmi, name):
    rows = courses(name, fmi)
    assert all(rows[0][known] != rows[-1][known] for known in rows[0])
    found = by_fmpy(name, fmi, rows, solver="Euler", step_size=INTERVAL)
    # Some hundred roundings a step, tensors whose moments are at most 100 apart.
    assert apart(found, by_reference(name, rows)) <= COUNT * 1e4 * EPS
    # CVode, the default, goes past the instants at which FMPy sets inputs, and fails where they jump far, or
    # where the scene's own tolerance, which FMPy takes, is too fine for jumps.
    rows = courses(name, fmi, 1e-3)
    assert apart(by_fmpy(name, fmi, rows, relative_tolerance=1e-5), by_reference(name, rows)) <= 0.05


RISE = 20.0
"""s, in which the servicer's torques rise to 5, 10 and 15 N m."""


def risen(kind: str, interval: float, *, every_row_twice: bool = False, **settings: Any) -> float:
    """Returns how far off FMPy's attitude is after the rise, as a share of the angle turned."""
    count = round(RISE / interval) if every_row_twice else 1
    rows = [(t, *(t / RISE * np.array([5.0, 10.0, 15.0]))) for t in np.linspace(0.0, RISE, count + 1)]
    rows = [row for row in rows for _ in range(1 + every_row_twice)]
    names = [f"attitude[{i}]" for i in range(1, 5)]
    result = simulate_fmu(
        folder("servicer", 3),
        fmi_type=kind,
        stop_time=RISE,
        output_interval=interval,
        input=np.array(rows, [("time", float), *((known, float) for known in twin("servicer").u_names)]),
        output=names,
        **settings,
    )
    right = risen_by_scipy()
    return float(np.linalg.norm([result[name][-1] for name in names] - right) / np.arccos(abs(right[0])))


@cache
def risen_by_scipy() -> Array:
    t = twin("servicer")
    solution = solve_ivp(
        lambda time, x: t.ode(x, time / RISE * np.array([5.0, 10.0, 15.0]), t.p_start).full().ravel(),
        (0.0, RISE),
        t.x_start,
        method="DOP853",
        rtol=1e-10,
        atol=1e-12,
    )
    attitude: Array = solution.y[:4, -1]
    return attitude


@pytest.mark.parametrize(("interval", "share"), [(0.1, 0.01), (0.01, 0.001)])
def test_fmpy_flies_a_ramp_as_well_as_co_simulation_where_every_row_is_an_event(interval, share):
    """The figures are the FMU's page's. CVode, FMPy's default, else holds inputs over its own long steps."""
    held = risen("CoSimulation", interval)
    events = risen("ModelExchange", interval, every_row_twice=True, relative_tolerance=1e-8)
    assert 0.5 * share < held < share
    assert events < share
    assert 0.05 < risen("ModelExchange", interval) < 0.07


@cache
def builder(name: str, fmi: int) -> ca.DaeBuilder:
    return ca.DaeBuilder(f"{name}_{fmi}", str(folder(name, fmi)))


@FMI
@NAME
def test_casadi_has_the_continuous_inputs_for_inputs(fmi, name):
    assert builder(name, fmi).u() == by_variability(name, fmi)["continuous"]


def both(name: str, fmi: int) -> tuple[ca.MX, ca.MX, ca.MX, ca.MX]:
    """Returns symbols of states and continuous inputs, and rates and outputs by the FMU and by the twin.

    Outputs that events make, which the twin leaves out, are not among them.
    """
    t, names = twin(name), by_variability(name, fmi)["continuous"]
    x, u = ca.MX.sym("x", t.x.numel()), ca.MX.sym("u", len(names))
    given = dict(zip(names, ca.vertsplit(u), strict=True))
    start = dict(zip(t.p_names, t.p_start, strict=True))
    p, torque = (ca.vertcat(*(given.get(k, start.get(k)) for k in ks)) for ks in (t.p_names, t.u_names))
    rate, y = builder(name, fmi).create("f", ["x", "u"], ["ode", "y"])(x, u)
    variables = read_model_description(folder(name, fmi)).modelVariables
    shown = [v.name in t.y_names for v in variables if v.causality == "output"]
    by_fmu = ca.vertcat(rate, y[np.flatnonzero(shown).tolist()])
    return x, u, by_fmu, ca.vertcat(t.ode(x, torque, p), t.outputs(x, torque, p))


def point(name: str, fmi: int) -> tuple[Array, Array]:
    """Returns values of states and of continuous inputs, none of them the scene's own."""
    names, last = by_variability(name, fmi)["continuous"], courses(name, fmi)[-1]
    momenta = [0.7 * flown(name).wheel(wheel).momentum for wheel in flown(name).wheels]
    return np.array([0.8, -0.3, 0.4, 0.33, 0.02, -0.03, 0.04, *momenta]), np.array(
        [last[known] for known in names]
    )


def largest_difference(found: ca.DM, right: ca.DM) -> float:
    """Returns the largest difference of two matrices over the largest element of the second."""
    return float(ca.mmax(ca.fabs(ca.densify(found - right))) / ca.mmax(ca.fabs(ca.densify(right))))


EXACT = 1e-12
"""The same formulas on both sides, in an order that a compiler may change."""

DIFFERENCED = 5e-3
"""CasADi takes second derivatives of an FMU as differences of first ones, by steps that do not know how large
a mass is: of a launch stack of 1e6 kg it is off by 1.3e-3, of the other examples by 1e-6 to 1e-4."""


@FMI
@NAME
def test_casadi_evaluates_and_differentiates_the_examples(fmi, name):
    x, u, by_fmu, by_twin = both(name, fmi)
    at, values = ca.vertcat(x, u), point(name, fmi)
    sizes = np.abs(np.concatenate(values))
    function = ca.Function("f", [x, u], [by_fmu, by_twin, ca.jacobian(by_fmu, at), ca.jacobian(by_twin, at)])
    y, right, jacobian, right_jacobian = function(*values)
    assert largest_difference(y, right) <= EXACT
    assert largest_difference(jacobian @ np.diag(sizes), right_jacobian @ np.diag(sizes)) <= EXACT
    weights = 1.0 / np.maximum(np.abs(right.full().ravel()), 1e-3)
    hessians = ca.Function("h", [x, u], [ca.hessian(ca.dot(weights, e), at)[0] for e in (by_fmu, by_twin)])
    assert largest_difference(*(h * np.outer(sizes, sizes) for h in hessians(*values))) <= DIFFERENCED


@FMI
@NAME
def test_casadi_integrates_the_examples_with_sensitivities(fmi, name):
    x, u, *rates = both(name, fmi)
    at, values, ends = ca.vertcat(x, u), point(name, fmi), []
    rng = np.random.default_rng(SEED)
    change, weight = rng.normal(size=at.numel()) * np.abs(np.concatenate(values)), rng.normal(size=x.numel())
    settings = {"reltol": 1e-10, "abstol": 1e-10}
    for rate in rates:
        flight = ca.integrator(
            "flight", "cvodes", {"x": x, "p": u, "ode": rate[: x.numel()]}, 0.0, 12.0, settings
        )
        end = flight(x0=x, p=u)["xf"]
        results = [end, ca.jtimes(end, at, change), ca.jtimes(end, at, weight, True)]
        ends.append(ca.Function("end", [x, u], results)(*values))
    for found, right in zip(*ends, strict=True):
        # The same steps on both sides; FMI 2.0 has no adjoint derivatives, and CasADi differences instead.
        assert largest_difference(found, right) <= 1e-7
