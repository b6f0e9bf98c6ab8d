"""Partial derivatives that the FMU gives, against the twin's, against differences of the FMU's own values."""

from collections.abc import Sequence
from ctypes import c_double, c_int, c_uint
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest

from supervessel import Twin
from support import DISCARD, EPS, ERROR, INF, ISS_DG, NAN, OK, Instance, body, scene, variant
from support.marks import FMI, KIND

SEED = 20240609

# Both sides evaluate the same formulas with some hundred roundings, none of which is amplified by more than
# ten within a row: 1e3 EPS, rounded up.
TWIN_TOLERANCE = 1e-12

SHIP = {"angular_velocity": [0.05, -0.08, 0.11], "attitude": [0.5, -0.5, 0.7, 0.1]}
RAW = variant(ISS_DG, {"name": "derived", "rotation": SHIP})
CHAIN: dict[str, Any] = {
    "name": "chain",
    "root": "A",
    "vessels": {
        "A": {
            "mass": 9000.0,
            "inertia": [[2e4, 1e3, -5e2], [1e3, 3e4, 2e3], [-5e2, 2e3, 2.5e4]],
            "centre_of_mass": [0.1, -0.2, 0.3],
            "ports": {
                "one": {"position": [1.0, 0.5, -0.2], "direction": [1.0, 0, 0], "alignment": [0, 1.0, 0]},
                "two": {"position": [-2.0, 0.1, 0.2], "direction": [0, 0, -1.0], "alignment": [1.0, 0, 0]},
            },
        },
        "B": {
            "mass": 3000.0,
            "pmi": [1.0, 1.5, 2.0],
            "ports": {
                "aft": {"position": [0, 0, 1.5], "direction": [0, 0, 1.0], "alignment": [0, 1.0, 0]},
                "fore": {"position": [0, 0.2, -1.5], "direction": [0, 0, -1.0], "alignment": [0, 1.0, 0]},
            },
        },
        "C": {
            "mass": 500.0,
            "pmi": [0.3, 0.4, 0.5],
            "ports": {"aft": {"position": [0, 0, 0.5], "direction": [0, 0, 1.0], "alignment": [0, 1.0, 0]}},
        },
        "D": {
            "mass": 0.0,
            "pmi": [0.3, 0.4, 0.5],
            "ports": {"aft": {"position": [0, 0.3, 0.5], "direction": [0, 0, 1.0], "alignment": [0, 1.0, 0]}},
        },
    },
    "docks": [{"ports": ["A.one", "B.aft"]}, {"ports": ["C.aft", "B.fore"]}, {"ports": ["A.two", "D.aft"]}],
    "inputs": {"mass": ["A", "C", "D"], "pmi": ["B"], "pose": ["A.one", "B.fore", "C.aft"], "torque": True},
    "rotation": SHIP,
    "outputs": ISS_DG["outputs"],
}
SCENES: dict[str, dict[str, Any]] = {
    "tensor": RAW,
    "chain": CHAIN,
    "principal": variant(RAW, {"name": "principal", "rotation.law": "principal"}),
    "decoupled": variant(RAW, {"name": "decoupled", "rotation.law": "decoupled"}),
    "none": variant(RAW, {"name": "held", "rotation.law": "none"}),
    "without inputs": {**body(**SHIP), "name": "constant", "inputs": {}},
}
NAME = pytest.mark.parametrize("name", SCENES)
POINTS = ("start", "at rest", "empty", "on an axis", "drawn")
POINT = pytest.mark.parametrize("point", POINTS)


@cache
def twin(name: str) -> Twin:
    return Twin(scene(SCENES[name]))


def knowns(name: str) -> list[str]:
    """Returns the inputs and states of a scene in the order of their value references."""
    return [*twin(name).p_names, *twin(name).u_names, *twin(name).x_names]


def unknowns(name: str) -> list[str]:
    """Returns the outputs and rates of a scene."""
    return [*twin(name).y_names, *(f"der({state})" for state in twin(name).x_names)]


def values(name: str, point: str, seed: int = SEED) -> np.ndarray:
    """Returns values of the knowns: those of the scene, or where something is zero, or drawn ones."""
    generator, sizes = np.random.default_rng(seed), [len(twin(name).p_names), len(twin(name).u_names)]
    p, u, x = np.array(twin(name).p_start), np.zeros(sizes[1]), np.array(twin(name).x_start)
    if point == "at rest":
        x = np.array([1.0, 0, 0, 0, 0, 0, 0])
    if point == "empty":
        p[[k.endswith(".mass") and k != "A.mass" for k in twin(name).p_names]] = 0.0
        u[:1] = 1e3
    if point == "on an axis":
        x = np.array([0, 0, 1.0, 0, 0, 0.1, 0])
        u[1:2] = 1e3
    if point == "drawn":
        p *= generator.uniform(0.9, 1.1, len(p))
        p += np.where(p == 0, generator.normal(0, 0.1, len(p)), 0)
        p[[k.endswith(".mass") for k in twin(name).p_names]] += 1e3
        p[["pmi" in k for k in twin(name).p_names]] += 10.0
        u, x = generator.normal(0, 1e3, len(u)), generator.normal(0, 0.3, 7)
    return np.concatenate([p, u, x])


@cache
def jacobian_function(name: str) -> ca.Function:
    """Returns the twin's outputs and rates and their Jacobian as functions of p, u, x."""
    t = twin(name)
    p, u, x = (ca.SX.sym(*s) for s in (("p", len(t.p_names)), ("u", len(t.u_names)), ("x", 7)))
    all_ = ca.vertcat(t.outputs(x, u, p), t.ode(x, u, p))
    return ca.Function("truth", [ca.vertcat(p, u, x)], [all_, ca.jacobian(all_, ca.vertcat(p, u, x))])


def truth(name: str, at: np.ndarray) -> np.ndarray:
    return np.asarray(jacobian_function(name)(at)[1].full())


def standing(name: str, at: np.ndarray, fmi: int = 3, exchange: bool = True) -> Instance:
    """Returns an instance that stands at values of the knowns; in co-simulation it starts there."""
    instance = Instance(SCENES[name], fmi, exchange=exchange)
    numbers = dict(zip(knowns(name), at, strict=True))
    start = {"attitude_start": at[-7:-3], "angular_velocity_start": at[-3:]}
    assert instance.enter() == OK
    assert instance.set(start | {k: v for k, v in numbers.items() if not k.startswith("state.")}) == OK
    assert instance.exit() == OK, instance.log
    if exchange:
        assert instance.run() == OK
        assert instance.set(numbers) == OK
    instance.log.clear()
    return instance


def columns(instance: Instance, rows: Sequence[str], by: Sequence[str]) -> np.ndarray:
    """Returns a Jacobian by directional derivatives, one column each."""
    if not by:
        return np.zeros((len(rows), 0))
    return np.column_stack([instance.directional(rows, by, seed) for seed in np.eye(len(by))])


def transposed_rows(instance: Instance, rows: Sequence[str], by: Sequence[str]) -> np.ndarray:
    """Returns the same Jacobian by adjoint derivatives, one row each."""
    return np.array([instance.adjoint(rows, by, seed) for seed in np.eye(len(rows))])


def weighted(jacobian: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Returns a Jacobian in units of its knowns' values, so that the elements of a row can be compared."""
    return jacobian * np.where(at == 0.0, 1.0, np.abs(at))


def error(found: np.ndarray, right: np.ndarray, at: np.ndarray) -> float:
    """Returns the largest error relative to the largest element of its row; a row of zeros must be zeros."""
    size = np.abs(weighted(right, at)).max(axis=1, keepdims=True)
    difference = np.abs(weighted(found - right, at))
    return float((difference / np.where(size == 0.0, np.finfo(float).tiny, size)).max())


def normalised(at: np.ndarray) -> np.ndarray:
    """Returns the values with the attitude at length 1, as co-simulation holds it."""
    at = at.copy()
    at[-7:-3] /= np.linalg.norm(at[-7:-3])
    return at


# The Jacobian of outputs and rates by inputs and states.


@POINT
@NAME
def test_directional_derivatives_are_the_twins(name, point):
    at = values(name, point)
    instance = standing(name, at)
    assert error(columns(instance, unknowns(name), knowns(name)), truth(name, at), at) <= TWIN_TOLERANCE
    instance.free()


@POINT
@NAME
def test_adjoint_derivatives_are_the_twins(name, point):
    at = values(name, point)
    instance = standing(name, at)
    found = transposed_rows(instance, unknowns(name), knowns(name))
    assert error(found, truth(name, at), at) <= TWIN_TOLERANCE
    instance.free()


@POINT
@NAME
def test_what_is_zero_in_the_twins_jacobian_is_zero(name, point):
    at = values(name, point)
    instance, zero = standing(name, at), truth(name, at) == 0.0
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
    assert error(found, truth(name, at), at) <= TWIN_TOLERANCE
    instance.free()


def test_derivatives_after_a_step_are_those_at_its_end():
    at = normalised(values("tensor", "drawn"))
    instance = standing("tensor", at, exchange=False)
    assert instance.step(7.0) == OK
    at[-7:] = [instance.get(name) for name in twin("tensor").x_names]
    found = columns(instance, unknowns("tensor"), knowns("tensor"))
    assert error(found, truth("tensor", at), at) <= TWIN_TOLERANCE
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


# A known of magnitude k is moved by h = DIFFERENCE k to both sides. A value of the row's magnitude s changes
# over k as a function of directions and distances does: its third derivative is below 192 s/k^3, a sixth of
# which times h^2 is left out; 64 EPS of rounding in each value come out over h.
DIFFERENCE = EPS ** (1 / 3)
DIFFERENCE_TOLERANCE = (32 + 64) * DIFFERENCE**2


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


def start_names(name: str) -> tuple[list[str], list[str]]:
    """Returns unknowns and knowns of initialisation mode."""
    parameters = [f"angular_velocity_start[{i}]" for i in (1, 2, 3)]
    parameters += [f"attitude_start[{i}]" for i in (1, 2, 3, 4)]
    return [*unknowns(name), *twin(name).x_names], [*knowns(name)[:-7], *parameters]


def initialising(
    name: str, length: float, fmi: int = 3, exchange: bool = True
) -> tuple[Instance, np.ndarray]:
    """Returns an instance in initialisation mode and the values of its knowns; the attitude has a length."""
    drawn = values(name, "drawn")
    at = np.concatenate([drawn[:-7], drawn[-3:], length * drawn[-7:-3] / np.linalg.norm(drawn[-7:-3])])
    instance = Instance(SCENES[name], fmi, exchange=exchange)
    assert instance.enter() == OK
    assert instance.set(dict(zip(start_names(name)[1], at, strict=True))) == OK
    return instance, at


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


# What is asked for wrongly.

WAY = pytest.mark.parametrize(
    ("fmi", "adjoint"), [(2, False), (3, False), (3, True)], ids=["2", "3", "3 adjoint"]
)
ROLE = "cannot be {} of a derivative here"
MISUSES = {
    "an input": (["DG.mass"], ["DG.mass"], "DG.mass " + ROLE.format("an unknown")),
    "a parameter": (["attitude_start[1]"], ["DG.mass"], ROLE.format("an unknown")),
    "time": (["time"], ["DG.mass"], "time " + ROLE.format("an unknown")),
    "a state": (["state.attitude[1]"], ["DG.mass"], ROLE.format("an unknown")),
    "by an output": (["mass"], ["mass"], "mass " + ROLE.format("a known")),
    "by a rate": (["mass"], ["der(state.attitude[1])"], ROLE.format("a known")),
    "by a parameter": (["mass"], ["attitude_start[1]"], ROLE.format("a known")),
    "good, then bad": (["mass", "pmi[1]"], ["DG.mass", "mass"], "mass " + ROLE.format("a known")),
}


def ask(
    instance: Instance, rows: Any, by: Any, seed: Any, result: Any, *sizes: int, adjoint: bool = False
) -> int:
    """Calls the C function with arrays of value references and numbers, any of which may be None."""
    kinds = ((c_uint, rows), (c_uint, by), (c_double, seed), (c_double, result))
    u, k, s, r = (None if array is None else (kind * len(array))(*array) for kind, array in kinds)
    lengths = sizes or tuple(0 if a is None else len(a) for a in (rows, by, seed, result))
    arguments = (u, lengths[0], k, lengths[1], s, r)
    if instance.fmi == 3:
        arguments = (u, lengths[0], k, lengths[1], s, lengths[2], r, lengths[3])
    name = f"fmi{instance.fmi}Get{'Adjoint' if adjoint else 'Directional'}Derivative"
    return int(instance.fmu._functions[name](instance.fmu.component, *arguments))


def spread(instance: Instance) -> list[float]:
    """Returns every variable."""
    getter = instance.fmu.getFloat64 if instance.fmi == 3 else instance.fmu.getReal
    return list(getter(list(instance.references.values())))


@WAY
@pytest.mark.parametrize("misuse", MISUSES)
def test_a_variable_of_the_wrong_kind_is_an_error_that_names_it(fmi, misuse, adjoint):
    rows, by, text = MISUSES[misuse]
    instance = standing("tensor", values("tensor", "start"), fmi)
    before = spread(instance)
    numbers = [[instance.references[name] for name in names] for names in (rows, by)]
    sizes = [len(rows), len(by)] if adjoint else [len(by), len(rows)]
    assert ask(instance, *numbers, *([1.0] * n for n in sizes), adjoint=adjoint) == ERROR
    [message] = instance.messages()
    assert text in message
    assert spread(instance) == before
    instance.free()


@pytest.mark.parametrize("known", ["state.attitude[1]", "time", "attitude_start[1]"])
@FMI
def test_states_are_unknowns_and_start_parameters_knowns_only_while_initialising(fmi, known):
    instance, _ = initialising("tensor", 1.0, fmi)
    references = [instance.references[name] for name in ("state.attitude[2]", known)]
    status = ask(instance, references[:1], references[1:], [1.0], [0.0])
    assert status == (ERROR if known.startswith("state") else OK)
    instance.free()


# Arrays as (unknowns, knowns, seed, result), sizes that are told, part of the log line.
WRONG_ARRAYS = {
    "no unknowns": ((None, [1], [1.0], [0.0]), (1, 1, 1, 1), "NULL"),
    "no knowns": (([40], None, [1.0], [0.0]), (1, 1, 1, 1), "NULL"),
    "no seed": (([40], [1], None, [0.0]), (1, 1, 1, 1), "NULL"),
    "no result": (([40], [1], [1.0], None), (1, 1, 1, 1), "NULL"),
    "unknown of no variable": (([4000], [1], [1.0], [0.0]), (1, 1, 1, 1), "4000 is unknown"),
    "known of no variable": (([40], [2**32 - 1], [1.0], [0.0]), (1, 1, 1, 1), "4294967295 is unknown"),
    "long seed": (([40], [1], [1.0, 1.0], [0.0]), (1, 1, 2, 1), "nSeed = 2"),
    "short seed": (([40], [1], [1.0], [0.0]), (1, 1, 0, 1), "nSeed = 0"),
    "long result": (([40], [1], [1.0], [0.0, 0.0]), (1, 1, 1, 2), "nSensitivity = 2"),
    "short result": (([40], [1], [1.0], [0.0]), (1, 1, 1, 0), "nSensitivity = 0"),
}


@pytest.mark.parametrize(
    ("fmi", "adjoint", "case"),
    [
        (*way, case)
        for way in ((2, False), (3, False), (3, True))
        for case, (*_, text) in WRONG_ARRAYS.items()
        if way[0] == 3 or "nSe" not in text  # FMI 2.0 does not tell these sizes
    ],
)
def test_wrong_arrays_are_errors_with_one_line(fmi, case, adjoint):
    arrays, sizes, text = WRONG_ARRAYS[case]
    instance = standing("tensor", values("tensor", "start"), fmi)
    assert ask(instance, *arrays, *sizes, adjoint=adjoint) == ERROR
    [message] = instance.messages()
    assert text in message
    instance.free()


@pytest.mark.parametrize("seed", [NAN, INF, -INF])
@WAY
def test_a_seed_that_is_not_finite_is_refused_with_its_place(fmi, adjoint, seed):
    instance = standing("tensor", values("tensor", "start"), fmi)
    numbers = [instance.references[name] for name in ("mass", "DG.mass", "pmi[1]")]
    rows, by = ([numbers[0], numbers[2]], numbers[1:2]) if adjoint else (numbers[:1], [numbers[1]] * 2)
    status = ask(instance, rows, by, [1.0, seed], [0.0], adjoint=adjoint)
    assert status == (DISCARD if fmi == 3 else ERROR)
    assert instance.messages()[0].endswith(f"seed 2 = {seed:g}: must be finite")
    instance.free()


@pytest.mark.parametrize("adjoint", [False, True], ids=["directional", "adjoint"])
def test_derivatives_by_unusable_inputs_are_discarded_until_they_are_corrected(adjoint):
    instance = standing("tensor", values("tensor", "start"))
    numbers = [[instance.references[name]] for name in ("mass", "DG.mass")]
    instance.set({"DG.mass": -1.0})
    assert ask(instance, *numbers, [1.0], [0.0], adjoint=adjoint) == DISCARD
    assert "DG.mass = -1 kg: must be >= 0" in instance.messages()[0]
    instance.set({"DG.mass": 0.0})
    assert ask(instance, *numbers, [1.0], [0.0], adjoint=adjoint) == OK
    instance.free()


@pytest.mark.parametrize("adjoint", [False, True], ids=["directional", "adjoint"])
def test_derivatives_at_an_attitude_without_length_are_discarded(adjoint):
    instance = standing("tensor", values("tensor", "start"))
    numbers = [[instance.references[name]] for name in ("attitude[1]", "state.attitude[1]")]
    instance.set({"state.attitude": [0.0, 0.0, 0.0, 0.0]})
    assert ask(instance, *numbers, [1.0], [0.0], adjoint=adjoint) == DISCARD
    assert "state.attitude = (0, 0, 0, 0)" in instance.messages()[0]
    instance.free()


@pytest.mark.parametrize("adjoint", [False, True], ids=["directional", "adjoint"])
@pytest.mark.parametrize(
    ("values_set", "unknown", "known"),
    [
        ({"DG.nose.direction": [0.0, 0.0, -1e-310]}, "inertia[1,2]", "DG.nose.direction[1]"),
        ({"state.angular_velocity": [1e305, 1e305, 1e305]}, "kinetic_energy", "DG.mass"),
    ],
    ids=["of a short direction", "at a high rate"],
)
def test_derivatives_beyond_the_range_of_numbers_are_discarded(values_set, unknown, known, adjoint):
    instance = standing("tensor", values("tensor", "start"))
    assert instance.set(values_set) == OK
    numbers = [[instance.references[name]] for name in (unknown, known)]
    assert ask(instance, *numbers, [1.0], [0.0], adjoint=adjoint) == DISCARD
    assert len(instance.messages()) == 1
    instance.free()


@FMI
def test_derivatives_leave_all_values_and_the_flight_as_they_were(fmi):
    at = normalised(values("tensor", "drawn"))
    asked, other = (standing("tensor", at, fmi, exchange=False) for _ in range(2))
    rows, by = unknowns("tensor"), knowns("tensor")
    for _ in range(3):
        before = spread(asked)
        columns(asked, rows, by)
        if fmi == 3:
            transposed_rows(asked, rows, by)
        time_derivatives(asked, twin("tensor").y_names)
        assert spread(asked) == before
        assert [asked.step(0.7), other.step(0.7)] == [OK, OK]
    assert spread(asked) == spread(other)
    asked.free()
    other.free()


# Derivatives with respect to time.


def time_derivatives(instance: Instance, names: Sequence[str]) -> np.ndarray:
    fmu = instance.fmu
    getter = fmu.getOutputDerivatives if instance.fmi == 3 else fmu.getRealOutputDerivatives
    return np.array(getter([instance.references[name] for name in names], [1] * len(names)))


@pytest.mark.parametrize("name", ["tensor", "chain", "principal"])
def test_output_derivatives_are_limits_of_differences_over_time(name):
    at = normalised(values(name, "drawn"))
    instance, names = standing(name, at, exchange=False), twin(name).y_names
    h = DIFFERENCE  # s, an angle of less than DIFFERENCE rad: rates are below 1 rad/s

    def read() -> np.ndarray:
        return np.array([instance.get(output) for output in names])

    before = read()
    assert instance.step(h) == OK
    middle, found = read(), time_derivatives(instance, names)
    assert instance.step(h) == OK
    after = read()
    groups = [output.partition("[")[0] for output in names]
    size = {g: max(abs(v) for v, other in zip(middle, groups, strict=True) if other == g) for g in groups}
    bound = DIFFERENCE_TOLERANCE * np.array([size[g] for g in groups])
    assert (np.abs(found - (after - before) / (2 * h)) <= bound).all()
    instance.free()


@FMI
def test_output_derivatives_are_the_rates_of_the_states(fmi):
    at = normalised(values("tensor", "drawn"))
    instance = standing("tensor", at, fmi, exchange=False)
    names = [f"angular_velocity[{i}]" for i in (1, 2, 3)]
    assert list(time_derivatives(instance, names)) == [instance.get(f"der(state.{name})") for name in names]
    assert not time_derivatives(instance, ["mass", "pmi[1]", "inertia[1,2]", "barycentre[3]"]).any()
    instance.free()


@FMI
def test_output_derivatives_follow_inputs_at_once(fmi):
    at = normalised(values("tensor", "start"))
    instance = standing("tensor", at, fmi, exchange=False)
    time_derivatives(instance, ["angular_velocity[1]"])
    instance.set({"DG.mass": 12000.0, "torque[1]": 1e6})
    found = time_derivatives(instance, ["angular_velocity[1]"])
    assert found[0] == instance.get("der(state.angular_velocity[1])")
    instance.free()


TIME_MISUSES = {
    "second order": (["mass"], [2], "order 2 of mass"),
    "order zero": (["mass"], [0], "order 0 of mass"),
    "an input": (["DG.mass"], [1], "DG.mass cannot be differentiated: only outputs"),
    "a state": (["state.attitude[1]"], [1], "only outputs"),
    "no values": (["mass"], None, "NULL"),
}


@pytest.mark.parametrize("misuse", TIME_MISUSES)
@FMI
def test_wrongly_asked_output_derivatives_are_errors_with_one_line(fmi, misuse):
    names, orders, text = TIME_MISUSES[misuse]
    instance = standing("tensor", normalised(values("tensor", "start")), fmi, exchange=False)
    references = (c_uint * len(names))(*(instance.references[name] for name in names))
    given = None if orders is None else (c_int * len(orders))(*orders)
    result = (c_double * len(names))()
    sizes = (len(names),) if fmi == 3 else ()
    function = "fmi3GetOutputDerivatives" if fmi == 3 else "fmi2GetRealOutputDerivatives"
    call = instance.fmu._functions[function]
    assert call(instance.fmu.component, references, len(names), given, result, *sizes) == ERROR
    [message] = instance.messages()
    assert message.startswith(f"{function}: ")
    assert text in message
    instance.free()


# Dependencies in the model description.

SIGNIFICANT = 1e-9  # of the row: what is smaller in all of DRAWS points is the rounding of a zero
DRAWS = 4


def declared(elements: Any, rows: Sequence[str]) -> dict[str, dict[str, str]]:
    """Returns what the model description says: unknown -> known -> kind."""
    found = {
        element.variable.name: {
            known.name: kind
            for known, kind in zip(element.dependencies, element.dependenciesKind, strict=True)
        }
        for element in elements
    }
    assert sorted(found) == sorted(rows)
    return found


def jacobians(name: str, exchange: bool) -> list[np.ndarray]:
    """Returns Jacobians at points drawn: of model exchange, else of initialisation."""
    results = []
    for draw in range(DRAWS):
        at = values(name, "drawn", SEED + draw)
        if exchange:
            instance, rows, by = standing(name, at), unknowns(name), knowns(name)
        else:
            instance, at = initialising(name, 1.0 + draw)
            rows, by = start_names(name)
        results.append(columns(instance, rows, by))
        instance.free()
    return results


@pytest.mark.parametrize("exchange", [True, False], ids=["running", "initialising"])
@NAME
def test_dependencies_are_exactly_what_the_jacobian_shows(name, exchange):
    instance = Instance(SCENES[name])
    md = instance.description
    rows, by = (unknowns(name), knowns(name)) if exchange else start_names(name)
    elements = [*md.outputs, *md.derivatives] if exchange else md.initialUnknowns
    kinds = declared(elements, rows)
    found, at = np.max(np.abs(jacobians(name, exchange)), axis=0), np.abs(values(name, "drawn"))
    sizes = np.where(at == 0.0, 1.0, at)
    if not exchange:
        sizes = np.concatenate([sizes[:-7], sizes[-3:], sizes[-7:-3]])
    weights = found * sizes
    significant = weights > SIGNIFICANT * weights.max(axis=1, keepdims=True)
    shown = {
        row: {known for known, s in zip(by, line, strict=True) if s}
        for row, line in zip(rows, significant, strict=True)
    }
    assert {row: set(line) for row, line in kinds.items()} == shown
    instance.free()


@pytest.mark.parametrize("exchange", [True, False], ids=["running", "initialising"])
@NAME
def test_a_dependency_declared_constant_has_the_same_factor_everywhere(name, exchange):
    instance = Instance(SCENES[name])
    md = instance.description
    rows, by = (unknowns(name), knowns(name)) if exchange else start_names(name)
    kinds = declared([*md.outputs, *md.derivatives] if exchange else md.initialUnknowns, rows)
    one, *others = jacobians(name, exchange)
    varying = [
        (row, known)
        for row, line in kinds.items()
        for known, kind in line.items()
        if kind == "constant"
        and any(
            other[rows.index(row), by.index(known)] != one[rows.index(row), by.index(known)]
            for other in others
        )
    ]
    assert varying == []
    instance.free()
