"""Partial derivatives that are asked for wrongly or that cannot be given."""

from ctypes import c_double, c_uint
from typing import Any

import pytest

from fmu.jacobians import (
    columns,
    initialising,
    knowns,
    normalised,
    standing,
    time_derivatives,
    transposed_rows,
    twin,
    unknowns,
    values,
)
from support import DISCARD, ERROR, INF, NAN, OK, Instance
from support.marks import FMI

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


@WAY
@pytest.mark.parametrize("misuse", MISUSES)
def test_a_variable_of_the_wrong_kind_is_an_error_that_names_it(fmi, misuse, adjoint):
    rows, by, text = MISUSES[misuse]
    instance = standing("tensor", values("tensor", "start"), fmi)
    before = instance.everything()
    numbers = [[instance.references[name] for name in names] for names in (rows, by)]
    sizes = [len(rows), len(by)] if adjoint else [len(by), len(rows)]
    assert ask(instance, *numbers, *([1.0] * n for n in sizes), adjoint=adjoint) == ERROR
    [message] = instance.messages()
    assert text in message
    assert instance.everything() == before
    instance.free()


@pytest.mark.parametrize("known", ["state.attitude[1]", "time", "attitude_start[1]"])
@FMI
def test_states_are_unknowns_while_initialising_and_start_parameters_knowns(fmi, known):
    instance, _ = initialising("tensor", 1.0, fmi)
    references = [instance.references[name] for name in ("state.attitude[2]", known)]
    status = ask(instance, references[:1], references[1:], [1.0], [0.0])
    assert status == (ERROR if known.startswith("state") else OK)
    instance.free()


@WAY
def test_a_start_parameter_changes_nothing_once_the_states_are_given(fmi, adjoint):
    """No equation holds it then: it is in no `dependencies` but those of InitialUnknowns."""
    instance = standing("tensor", values("tensor", "start"), fmi)
    rows, by = ["kinetic_energy", "attitude[1]", "mass"], ["angular_velocity_start[1]", "attitude_start[2]"]
    if adjoint:
        assert instance.adjoint(rows, [*by, "DG.mass"], [1.0, 1.0, 1.0])[:2].tolist() == [0.0, 0.0]
    else:
        assert instance.directional(rows, by, [1.0, 1.0]).tolist() == [0.0, 0.0, 0.0]
        assert instance.directional(rows, [*by, "DG.mass"], [1.0, 1.0, 1.0])[2] == 1.0
    assert instance.messages() == []
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
        before = asked.everything()
        columns(asked, rows, by)
        if fmi == 3:
            transposed_rows(asked, rows, by)
        time_derivatives(asked, twin("tensor").y_names)
        assert asked.everything() == before
        assert [asked.step(0.7), other.step(0.7)] == [OK, OK]
    assert asked.everything() == other.everything()
    asked.free()
    other.free()
