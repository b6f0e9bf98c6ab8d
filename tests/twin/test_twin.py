"""The twin's numbers and derivatives are the FMU's; its names and signatures."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import casadi as ca
import numpy as np
import pytest

from supervessel import Twin, reference
from support import ISS_DG, LAWS, OK, STATES, U, body, flying, scene, variant
from support.marks import FMI, some_at_once
from twin.flights import MASS_ULPS, SEEDS, STAGE_ULPS, STEPS, flight, groups, rk4, twin_of
from twin.scenes import numbers, random_inputs, random_scene

# The FMU and the twin differentiate the same operations and multiply the same partials, in another order: 27
# terms of up to 12 products, a rounding each, on either side. Nothing is inverted twice: no condition number.
CHAIN_ULPS = 2 * 27 * 12


# Names and signatures


@FMI
def test_p_and_u_names_are_the_inputs_in_the_order_of_the_model_description(fmi: int) -> None:
    twin = twin_of(1)
    with flying(random_scene(1), fmi) as fmu:
        inputs = [v.name for v in fmu.description.modelVariables if v.causality == "input"]
    assert twin.u_names == ("torque[1]", "torque[2]", "torque[3]")
    assert twin.p_names == tuple(name for name in inputs if not name.startswith("torque["))


def test_y_names_are_the_outputs_in_the_order_of_the_model_description() -> None:
    with flying(random_scene(1)) as fmu:
        outputs = [v.name for v in fmu.description.modelVariables if v.causality == "output"]
    assert twin_of(1).y_names == tuple(outputs)


def test_p_start_holds_the_start_values_of_the_model_description() -> None:
    twin = twin_of(1)
    with flying(random_scene(1)) as fmu:
        start = {v.name: v.start for v in fmu.description.modelVariables}
    assert twin.p_start.tolist() == [float(start[name]) for name in twin.p_names]


def test_x_names_are_the_states_of_the_fmu() -> None:
    assert twin_of(0).x_names == tuple(STATES)


@pytest.mark.parametrize(
    ("function", "inputs", "outputs"),
    [
        ("composite", ["p"], ["mass", "barycentre", "inertia", "pmi"]),
        ("ode", ["x", "u", "p"], ["x_dot"]),
        ("step", ["x", "u", "p", "h"], ["x_next"]),
        ("outputs", ["x", "u", "p"], ["y"]),
    ],
)
def test_functions_have_named_arguments_in_one_order(
    function: str, inputs: list[str], outputs: list[str]
) -> None:
    twin = twin_of(1)
    named = getattr(twin, function)
    sizes = {"x": 7, "u": 3, "p": len(twin.p_names), "h": 1}
    assert (named.name(), named.name_in(), named.name_out()) == (function, inputs, outputs)
    assert [named.numel_in(name) for name in inputs] == [sizes[name] for name in inputs]


def test_symbols_are_handed_out_beside_the_functions() -> None:
    twin = twin_of(1)
    again = ca.Function(
        "again", [twin.x, twin.u, twin.p, twin.h], [twin.step(twin.x, twin.u, twin.p, twin.h)]
    )
    at = (twin.x_start, [1.0, 2.0, 3.0], twin.p_start, 0.1)
    assert numbers(again(*at)).tolist() == numbers(twin.step(*at)).tolist()


def test_functions_take_matrix_symbols_and_keywords() -> None:
    twin = twin_of(1)
    x = ca.MX.sym("x", 7)
    at = {"u": [1.0, 2.0, 3.0], "p": twin.p_start, "h": 0.1}
    step = ca.Function("step", [x], [twin.step(x=x, **at)["x_next"]])
    assert numbers(step(twin.x_start)).tolist() == numbers(twin.step(x=twin.x_start, **at)["x_next"]).tolist()


# The FMU's numbers to the last bit


@pytest.mark.parametrize("seed", some_at_once(SEEDS, 0, 3, 6, 9))
def test_composite_is_the_fmus_to_the_last_bit(seed: int) -> None:
    for moment in flight(seed):
        for value, name in zip(
            twin_of(seed).composite(moment.p), twin_of(seed).composite.name_out(), strict=True
        ):
            assert numbers(value).tolist() == moment.y[name].tolist(), name


@pytest.mark.parametrize("seed", some_at_once(SEEDS, 0, 3, 6, 9))
def test_outputs_are_the_fmus_to_the_last_bit(seed: int) -> None:
    twin = twin_of(seed)
    for moment in flight(seed):
        for x, y in ((moment.x, moment.y), (moment.x_next, moment.y_next)):
            expected = [number for name in twin.scene.outputs.names for number in y[name]]
            assert numbers(twin.outputs(x, moment.u, moment.p)).tolist() == expected


@pytest.mark.parametrize("seed", some_at_once(SEEDS, 0, 3, 6, 9))
def test_chained_steps_are_the_fmus_to_the_last_bit(seed: int) -> None:
    moments = flight(seed)
    x = moments[0].x
    for moment in moments:
        x = numbers(twin_of(seed).step(x, moment.u, moment.p, moment.h))
        assert x.tolist() == moment.x_next.tolist()


@pytest.mark.parametrize("seed", some_at_once(SEEDS, 0, 3, 6, 9))
def test_runge_kutta_over_the_ode_is_the_fmus_step_to_the_last_bit(seed: int) -> None:
    twin = twin_of(seed)
    for m in flight(seed):
        step = rk4(lambda x, m=m: numbers(twin.ode(x, m.u, m.p)), m.x, m.h)
        assert step.tolist() == m.x_next.tolist()


@pytest.mark.parametrize("seed", some_at_once(SEEDS, 0, 3, 6, 9))
def test_state_at_the_start_is_the_fmus_to_the_last_bit(seed: int) -> None:
    assert twin_of(seed).x_start.tolist() == flight(seed)[0].x.tolist()


def test_step_stops_being_the_fmus_where_the_fmu_takes_two_sub_steps() -> None:
    twin = twin_of(9)
    x, u, p = twin.x_start, np.zeros(3), twin.p_start
    h = 1.5 * float(twin.longest_step(x, u, p))
    with flying(random_scene(9)) as fmu:
        assert fmu.step(h) == OK
        rates = fmu.get("angular_velocity")
    half = twin.step(x, u, p, 0.5 * h)
    assert rates.tolist() == numbers(twin.step(half, u, p, 0.5 * h))[4:].tolist()
    assert rates.tolist() != numbers(twin.step(x, u, p, h))[4:].tolist()


def test_two_twins_of_a_scene_give_the_same_numbers() -> None:
    for m in flight(11):
        one, other = (Twin(scene(random_scene(11))) for _ in range(2))
        for name, at in (("composite", (m.p,)), ("ode", (m.x, m.u, m.p)), ("step", (m.x, m.u, m.p, m.h))):
            values = [ca.veccat(*getattr(twin, name).call(at)) for twin in (one, other)]
            assert numbers(values[0]).tolist() == numbers(values[1]).tolist()


# The FMU's derivatives


def response(twin: Twin) -> ca.Function:
    """Returns the twin's outputs and rates and their Jacobian by p, u, x, as a function of those."""
    rows = ca.vertcat(twin.outputs(twin.x, twin.u, twin.p), twin.ode(twin.x, twin.u, twin.p))
    knowns = ca.vertcat(twin.p, twin.u, twin.x)
    return ca.Function("response", [knowns], [ca.jacobian(rows, knowns)])


@pytest.mark.parametrize("seed", some_at_once(SEEDS, 0, 3, 6, 9))
def test_directional_and_adjoint_derivatives_of_the_fmu_are_the_twins(seed: int) -> None:
    raw, twin, rng = random_scene(seed), twin_of(seed), np.random.default_rng(2000 + seed)
    knowns = [*twin.p_names, *twin.u_names, *twin.x_names]
    unknowns = [*twin.y_names, *(f"der({name})" for name in twin.x_names)]
    jacobian = response(twin)
    with flying(raw) as fmu:
        for _ in range(STEPS):
            x = np.concatenate([fmu.get("state.attitude"), fmu.get("state.angular_velocity")])
            p, u = random_inputs(twin, rng)
            assert fmu.set(dict(zip(knowns, (*p, *u), strict=False))) == OK, fmu.log
            at = np.concatenate([p, u, x])
            J = np.array(jacobian(at))
            # Changes are of the inputs' own sizes, rounding that of the largest of an output's elements.
            size = np.maximum(np.abs(at), 1.0)
            share = np.zeros(J.shape)
            for rows in groups(tuple(unknowns)):
                share[rows] = np.abs(J[rows] * size).max(axis=0)
            seeds, weights = rng.normal(size=len(knowns)) * size, rng.normal(size=len(unknowns))
            difference = fmu.directional(unknowns, knowns, seeds) - J @ seeds
            assert (np.abs(difference) <= CHAIN_ULPS * U * (share @ np.abs(seeds / size))).all()
            difference = (fmu.adjoint(unknowns, knowns, weights) - J.T @ weights) * size
            assert (np.abs(difference) <= CHAIN_ULPS * U * (share.T @ np.abs(weights))).all()
            assert fmu.step(0.1) == OK, fmu.log


# Scenes with little in them


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(
    "raw", [variant(body(), {"inputs": {}}), variant(ISS_DG, {"inputs": {}})], ids=["one", "two"]
)
def test_scene_without_inputs_has_empty_p_and_u(raw: dict[str, Any], law: str) -> None:
    rates = [0.03, -0.02, 0.01]
    twin = Twin(scene(variant(raw, {"rotation": {"law": law, "angular_velocity": rates}})))
    assert (twin.p_names, twin.u_names, twin.p_start.shape) == ((), (), (0,))
    expected = rk4(lambda x: reference.ode(twin.scene, x), twin.x_start, 0.5)
    # J of these scenes has a condition below 3: what STAGE_ULPS says of a stage, relative to the rates.
    assert np.abs(numbers(twin.step(twin.x_start, [], [], 0.5)) - expected).max() <= 3 * STAGE_ULPS * U
    whole = reference.composite(twin.scene)
    assert abs(float(twin.composite([])[0]) - whole.mass) <= MASS_ULPS * U * whole.mass
    assert numbers(twin.outputs(twin.x_start, [], [])).shape == (len(twin.y_names),)


# CasADi's own settings


@contextmanager
def simplification(setting: bool) -> Iterator[None]:
    found = ca.GlobalOptions.getSimplificationOnTheFly()
    ca.GlobalOptions.setSimplificationOnTheFly(setting)
    try:
        yield
    finally:
        ca.GlobalOptions.setSimplificationOnTheFly(found)


@pytest.mark.parametrize("setting", [True, False])
def test_twin_leaves_casadis_simplification_as_it_found_it(setting: bool) -> None:
    with simplification(setting):
        Twin(scene(body()))
        assert ca.GlobalOptions.getSimplificationOnTheFly() is setting


def test_composite_is_the_fmus_whatever_casadis_simplification() -> None:
    with simplification(False):
        twin = Twin(scene(random_scene(7)))
    for m in flight(7):
        assert numbers(twin.composite(m.p)[2]).tolist() == m.y["inertia"].tolist()
