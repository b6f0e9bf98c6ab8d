"""Partial derivatives that the FMU gives, against the twin's, against differences of the FMU's own values."""

from collections.abc import Sequence
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest

from fmu.jacobians import (
    DIFFERENCE,
    DIFFERENCE_TOLERANCE,
    NAME,
    SEED,
    columns,
    initialising,
    knowns,
    normalised,
    standing,
    start_names,
    transposed_rows,
    twin,
    unknowns,
    values,
)
from support import EPS, ISS_DG, OK, Instance
from support.marks import FMI, KIND

# Both sides evaluate the same formulas with some hundred roundings, none of which is amplified by more than
# ten within a row: 1e3 EPS, rounded up.
TWIN_TOLERANCE = 1e-12

POINTS = ("start", "at rest", "empty", "on an axis", "drawn")
POINT = pytest.mark.parametrize("point", POINTS)


@cache
def jacobian_function(name: str) -> ca.Function:
    """Returns the twin's outputs and rates and their Jacobian as functions of p, u, x."""
    t = twin(name)
    p, u, x = (ca.SX.sym(*s) for s in (("p", len(t.p_names)), ("u", len(t.u_names)), ("x", 7)))
    all_ = ca.vertcat(t.outputs(x, u, p), t.ode(x, u, p))
    return ca.Function("jacobian", [ca.vertcat(p, u, x)], [all_, ca.jacobian(all_, ca.vertcat(p, u, x))])


def twins_jacobian(name: str, at: np.ndarray) -> np.ndarray:
    return np.asarray(jacobian_function(name)(at)[1].full())


def weighted(jacobian: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Returns a Jacobian in units of its knowns' values, so that the elements of a row can be compared."""
    return jacobian * np.where(at == 0.0, 1.0, np.abs(at))


def error(found: np.ndarray, right: np.ndarray, at: np.ndarray) -> float:
    """Returns the largest error relative to the largest element of its row; a row of zeros must be zeros."""
    size = np.abs(weighted(right, at)).max(axis=1, keepdims=True)
    difference = np.abs(weighted(found - right, at))
    return float((difference / np.where(size == 0.0, np.finfo(float).tiny, size)).max())


# The Jacobian of outputs and rates by inputs and states.


@POINT
@NAME
def test_directional_derivatives_are_the_twins(name, point):
    at = values(name, point)
    instance = standing(name, at)
    found = columns(instance, unknowns(name), knowns(name))
    assert error(found, twins_jacobian(name, at), at) <= TWIN_TOLERANCE
    instance.free()


@POINT
@NAME
def test_adjoint_derivatives_are_the_twins(name, point):
    at = values(name, point)
    instance = standing(name, at)
    found = transposed_rows(instance, unknowns(name), knowns(name))
    assert error(found, twins_jacobian(name, at), at) <= TWIN_TOLERANCE
    instance.free()


@POINT
@NAME
def test_what_is_zero_in_the_twins_jacobian_is_zero(name, point):
    at = values(name, point)
    instance, zero = standing(name, at), twins_jacobian(name, at) == 0.0
    found = columns(instance, unknowns(name), knowns(name))
    back = transposed_rows(instance, unknowns(name), knowns(name))
    assert not found[zero].any()
    # Reverse sums in another order: what cancels there may leave a rounding of the row.
    assert np.abs(weighted(np.where(zero, back, 0.0), at)).max() <= TWIN_TOLERANCE * np.abs(back * at).max()
    instance.free()


@pytest.mark.parametrize("point", ["start", "at rest", "drawn"])
@pytest.mark.parametrize(("fmi", "name"), [(2, "tensor"), (3, "tensor"), (3, "chain")])
def test_co_simulation_derives_what_the_outputs_are_now(fmi, name, point):
    at = normalised(values(name, point))
    instance = standing(name, at, fmi, exchange=False)
    found = columns(instance, unknowns(name), knowns(name))
    assert error(found, twins_jacobian(name, at), at) <= TWIN_TOLERANCE
    instance.free()


def test_derivatives_after_a_step_are_those_at_its_end():
    at = normalised(values("tensor", "drawn"))
    instance = standing("tensor", at, exchange=False)
    assert instance.step(7.0) == OK
    at[-7:] = [instance.get(name) for name in twin("tensor").x_names]
    found = columns(instance, unknowns("tensor"), knowns("tensor"))
    assert error(found, twins_jacobian("tensor", at), at) <= TWIN_TOLERANCE
    instance.free()


@KIND
@pytest.mark.parametrize("point", POINTS)
def test_both_versions_give_the_same_derivatives_bit_for_bit(point, exchange):
    at = values("tensor", point)
    two, three = (standing("tensor", at, fmi, exchange) for fmi in (2, 3))
    rows, by = unknowns("tensor"), knowns("tensor")
    assert columns(two, rows, by).tobytes() == columns(three, rows, by).tobytes()
    two.free()
    three.free()


def differences(
    instance: Instance, rows: Sequence[str], known: str, value: float
) -> tuple[np.ndarray, float]:
    """Returns the rates of rows with a known by differences, forward ones at an empty vessel, and its k."""
    k = max(abs(value), 1.0)
    sides = [value + DIFFERENCE * k, value - DIFFERENCE * k]
    if known.endswith(".mass") and sides[1] < 0.0:
        sides[1] = value
    results = []
    for side in sides:
        assert instance.set({known: side}) == OK
        results.append(np.array([instance.get(row) for row in rows]))
    assert instance.set({known: value}) == OK
    return (results[0] - results[1]) / (sides[0] - sides[1]), k


@POINT
@pytest.mark.parametrize("name", ["tensor", "chain", "principal"])
def test_directional_derivatives_are_limits_of_differences_of_the_fmus_values(name, point):
    at = values(name, point)
    instance, rows, by = standing(name, at), unknowns(name), knowns(name)
    right = columns(instance, rows, by)
    size = np.abs([instance.get(row) for row in rows])
    size = np.maximum(size, (np.abs(right) * np.maximum(np.abs(at), 1.0)).max(axis=1))
    wrong = {}
    for known, value, column in zip(by, at, right.T, strict=True):
        found, k = differences(instance, rows, known, value)
        for row, one, other, s in zip(rows, found, column, size, strict=True):
            if not abs(one - other) <= DIFFERENCE_TOLERANCE * s / k:
                wrong[f"{row} by {known}"] = one, other
    assert wrong == {}
    instance.free()


PORT = {"direction": [-1.0, 0, 0], "alignment": [0, 1.0, 0]}
TANKS: dict[str, Any] = {
    "name": "tanks",
    "root": "A",
    "vessels": {
        "A": {
            "mass": 1e3,
            "pmi": [1.0, 1.5, 2.0],
            "ports": {"p": {**PORT, "position": [1.0, 0, 0], "direction": [1.0, 0, 0]}},
        },
        "B": {
            "mass": 0.0,
            "pmi": [1.0, 1.5, 2.0],
            "ports": {
                "aft": {**PORT, "position": [-1.0, 0, 0]},
                "fore": {**PORT, "position": [1.0, 0, 0], "direction": [1.0, 0, 0]},
            },
        },
        "C": {"mass": 0.0, "pmi": [1.0, 1.5, 2.0], "ports": {"aft": {**PORT, "position": [-1.0, 0, 0]}}},
    },
    "docks": [{"ports": ["A.p", "B.aft"]}, {"ports": ["B.fore", "C.aft"]}],
    "inputs": {"mass": ["B", "C"], "pose": ["B.aft"]},
    "outputs": ISS_DG["outputs"],
}
"""Two empty tanks on a turning joint."""


@pytest.mark.parametrize(("tank", "distance"), [("B.mass", 2.0), ("C.mass", 4.0)])
def test_the_first_fuel_in_one_of_two_empty_tanks_moves_the_barycentre_towards_it(tank, distance):
    instance = Instance(TANKS)
    assert instance.initialise() == OK
    # Moments add up: m c' = distance from the barycentre, which is still A's.
    assert instance.directional(["barycentre[1]"], [tank], [1.0])[0] == pytest.approx(distance / 1e3)
    instance.free()


# In initialisation mode by inputs and start parameters.


@cache
def start_jacobian(name: str) -> ca.Function:
    """Returns the Jacobian of outputs, rates and states by inputs and start parameters."""
    t = twin(name)
    p, u, omega, s = (
        ca.SX.sym(*a) for a in (("p", len(t.p_names)), ("u", len(t.u_names)), ("w", 3), ("s", 4))
    )
    x = ca.vertcat(s / ca.norm_2(s), omega)
    by = ca.vertcat(p, u, omega, s)
    return ca.Function("start", [by], [ca.jacobian(ca.vertcat(t.outputs(x, u, p), t.ode(x, u, p), x), by)])


@KIND
@pytest.mark.parametrize("length", [1.0, 3.0, 1e-100])
@FMI
def test_derivatives_at_the_start_are_the_twins_through_the_normalised_attitude(fmi, length, exchange):
    instance, at = initialising("tensor", length, fmi, exchange)
    found = columns(instance, *start_names("tensor"))
    assert error(found, start_jacobian("tensor")(at).full(), at) <= TWIN_TOLERANCE
    instance.free()


@KIND
@pytest.mark.parametrize("name", ["tensor", "chain"])
def test_adjoint_derivatives_at_the_start_are_the_twins(name, exchange):
    instance, at = initialising(name, 3.0, 3, exchange)
    found = transposed_rows(instance, *start_names(name))
    assert error(found, start_jacobian(name)(at).full(), at) <= TWIN_TOLERANCE
    instance.free()


# Seeds.


@FMI
def test_several_knowns_at_once_give_the_sum_of_their_columns(fmi):
    at = values("tensor", "drawn")
    instance, rows, by = standing("tensor", at, fmi), unknowns("tensor"), knowns("tensor")
    generator = np.random.default_rng(SEED)
    jacobian = columns(instance, rows, by)
    for _ in range(5):
        seed = generator.normal(size=len(by)) * np.where(at == 0, 1.0, np.abs(at))
        bound = len(by) * EPS * np.abs(jacobian) @ np.abs(seed) + TWIN_TOLERANCE * np.abs(
            weighted(jacobian, at)
        ).max(1)
        assert (np.abs(instance.directional(rows, by, seed) - jacobian @ seed) <= bound).all()
    instance.free()


def test_an_adjoint_derivative_of_several_unknowns_is_the_transpose():
    at = values("tensor", "drawn")
    instance, rows, by = standing("tensor", at), unknowns("tensor"), knowns("tensor")
    generator = np.random.default_rng(SEED)
    jacobian = columns(instance, rows, by)
    for _ in range(5):
        seed = generator.normal(size=len(rows)) / np.abs(weighted(jacobian, at)).max(axis=1)
        found = instance.adjoint(rows, by, seed) - jacobian.T @ seed
        assert np.abs(weighted(found, at)).max() <= TWIN_TOLERANCE * len(rows)
    instance.free()


@KIND
@FMI
def test_nothing_changes_with_time(fmi, exchange):
    instance = standing("tensor", normalised(values("tensor", "drawn")), fmi, exchange)
    assert not instance.directional(unknowns("tensor"), ["time"], [1.0]).any()
    if fmi == 3:
        rows = unknowns("tensor")
        assert instance.adjoint(rows, ["time", "torque[1]"], np.ones(len(rows)))[0] == 0.0
    instance.free()


@FMI
def test_empty_sets_are_answered(fmi):
    instance = standing("tensor", values("tensor", "start"), fmi)
    assert not instance.directional(unknowns("tensor"), [], []).any()
    assert len(instance.directional([], knowns("tensor"), np.ones(len(knowns("tensor"))))) == 0
    if fmi == 3:
        assert not instance.adjoint([], knowns("tensor"), []).any()
    instance.free()


def test_unknowns_are_given_in_the_order_asked_for_and_as_often():
    instance = standing("tensor", values("tensor", "drawn"))
    rows = ["inertia[2,2]", "mass", "der(state.attitude[1])", "mass"]
    found = instance.directional(rows, ["DG.mass"], [2.0])
    assert list(found) == [instance.directional([row], ["DG.mass"], [2.0])[0] for row in rows]
    assert found[1] == 2.0
    instance.free()


@pytest.mark.parametrize("length", [1e-200, 1e-100, 1e100, 1e200])
@pytest.mark.parametrize("part", ["direction", "alignment"])
def test_directions_of_any_length_give_derivatives_over_that_length(part, length):
    at = values("tensor", "drawn")
    instance, rows, by = standing("tensor", at), unknowns("tensor"), knowns("tensor")
    right = columns(instance, rows, by)
    power = round(np.log2(length))
    where = [name.startswith(f"DG.nose.{part}") for name in by]
    instance.set({f"DG.nose.{part}": np.ldexp(at[where], power)})
    right[:, where] = np.ldexp(right[:, where], -power)
    at[where] = np.ldexp(at[where], power)
    assert error(columns(instance, rows, by), right, at) <= TWIN_TOLERANCE
    assert error(transposed_rows(instance, rows, by), right, at) <= TWIN_TOLERANCE
    instance.free()
