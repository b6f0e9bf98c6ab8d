"""The reference solutions: the file is the script's, motion keeps what it must, other ways give the same."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from stability import truth
from stability.truth import Case, Problem, Vector, mp
from support.extrapolation import midpoint_rule
from support.numbers import hamilton

KEPT = mp.mpf(10) ** (
    1 - truth.DIGITS
)  # bound of the relative rounding of a number kept, with a factor 2 spare
FREE = [name for name in truth.categories() if not name.startswith("torque")]
FORCED = [name for name in truth.categories() if name.startswith("torque")]


def problem(case: Case) -> Problem:
    fields = (case.attitude.tolist(), case.omega.tolist(), case.torque.tolist(), case.time)
    return Problem(case.name, case.inertia.tolist(), *fields)


def inputs(case: Case) -> truth.Inputs:
    return truth._inputs(problem(case))


def turned_at_most(case: Case) -> float:
    """Returns |omega| t + |J^-1 M| t^2 / 2 [rad], which overestimates little where it is small."""
    push = np.linalg.solve(case.inertia / case.inertia.max(), case.torque / case.inertia.max())
    size = float(mp.norm([mp.mpf(x) for x in case.omega]) * abs(case.time))
    return size + float(np.linalg.norm(push)) * case.time**2 / 2


def shortest(category: str, least: float) -> Case:
    """Returns the case of a category that turns least of those that turn by more than `least` [rad]."""
    return min((c for c in truth.cases(category) if turned_at_most(c) > least), key=turned_at_most)


def to_inertial(q: Any, v: Vector) -> Vector:
    unit = truth._unit([mp.mpf(x) for x in q])
    return hamilton(hamilton(unit, [mp.zero, *v]), truth._conjugate(unit))[1:]


def gaps(case: Case, turn: Vector, omega: Vector) -> tuple[Any, Any]:
    """Returns how far a solution (turn from the start, rate) is from the one kept: angle, relative rate."""
    end = hamilton(truth._unit([mp.mpf(x) for x in case.attitude]), turn)
    return truth.differences((list(case.attitude_end), list(case.omega_end)), (end, omega))


def extrapolated(case: Case, columns: int) -> tuple[Vector, Vector]:
    """Returns the turn and the rate by the extrapolated midpoint rule, in parts of about a radian."""
    inertia, omega, torque, time = inputs(case)
    inverse = mp.inverse(mp.matrix(inertia)).tolist()

    def ode(x: Vector) -> Vector:
        q, w = x[:4], x[4:]
        gyro = truth._cross(w, truth._apply(inertia, w))
        change = truth._apply(inverse, [m - g for m, g in zip(torque, gyro, strict=True)])
        return [*(y / 2 for y in hamilton(q, [mp.zero, *w])), *change]

    start, parts = [mp.one, mp.zero, mp.zero, mp.zero, *omega], int(np.ceil(turned_at_most(case)))
    end = midpoint_rule(ode, start, time, parts, columns)
    return end[:4], end[4:]


# The file


def test_file_has_the_problems_of_the_script() -> None:
    made = [(category, repr(each)) for category, each in truth.problems()]
    assert [(case.category, repr(problem(case))) for case in truth.cases()] == made


def test_names_are_unique() -> None:
    names = [(case.category, case.name) for case in truth.cases()]
    assert len(set(names)) == len(names)


def test_attitudes_are_unit() -> None:
    assert max(abs(truth._norm(case.attitude_end) - 1) for case in truth.cases()) <= 2 * KEPT


@pytest.mark.parametrize("category", FREE)
def test_free_motion_keeps_momentum_and_energy(category: str) -> None:
    # Rounding moves J w by KEPT |J| |w|, the turn to inertial axes by 4 KEPT (two products of a quaternion).
    for case in truth.cases(category):
        inertia, start, _, _ = inputs(case)
        end = list(case.omega_end)
        before, after = truth._apply(inertia, start), truth._apply(inertia, end)
        size = max(abs(x) for row in inertia for x in row) * 3 * max(truth._norm(start), truth._norm(end))
        one, other = to_inertial(case.attitude, before), to_inertial(case.attitude_end, after)
        assert truth._norm([a - b for a, b in zip(one, other, strict=True)]) <= 5 * KEPT * size
        energy = [sum(a * b for a, b in zip(w, h, strict=True)) for w, h in ((start, before), (end, after))]
        assert abs(energy[0] - energy[1]) <= 2 * KEPT * size * truth._norm(start)


# Other ways


@pytest.mark.parametrize(
    "category", [name for name in FREE if not name.startswith(("at rest", "many turns"))]
)
def test_free_motion_is_that_of_a_taylor_series(category: str) -> None:
    case = shortest(category, 0.3)
    assert max(gaps(case, *truth.taylor(*inputs(case), 40))) <= 4 * KEPT


def test_many_turns_are_a_power_of_one_period() -> None:
    # 1e9 rad at most: the error of one period, about 1e-48, grows by as much.
    many = truth.cases("many turns") + truth.cases("many turns, full tensor")
    found = [(case, truth.by_periods(inputs(case), 18.0, 50)) for case in many]
    errors = [max(gaps(case, *other)) for case, other in found if other is not None]
    assert len(errors) >= 3
    assert max(errors) <= 4 * KEPT


@pytest.mark.parametrize("category", FORCED)
def test_motion_under_torque_is_that_of_extrapolation(category: str) -> None:
    case = shortest(category, 0.05)
    assert max(gaps(case, *extrapolated(case, 20))) <= 4 * KEPT


def test_torque_about_one_axis_from_rest_gives_half_a_t_squared() -> None:
    (case,) = (c for c in truth.cases("torque that dwarfs momentum") if c.name == "about one axis")
    _, _, torque, time = inputs(case)
    rate = torque[1] / mp.mpf(case.inertia[1, 1])
    turn = truth._about(1, rate * time**2 / 2)
    assert max(gaps(case, turn, [mp.zero, rate * time, mp.zero])) <= 4 * KEPT


@pytest.mark.parametrize(
    ("category", "name"), [("general, full tensor", "1 s"), ("symmetric to an ulp", "0.7, 3 ulp, 1 s")]
)
def test_conditions_do_not_depend_on_the_size_of_the_difference(category: str, name: str) -> None:
    # Here 1e-18 of an input instead of 1e-25, by Taylor series: the second derivative adds less than 1e-9 of
    # the first, and four digits are kept.
    (case,) = (c for c in truth.cases(category) if c.name == name)
    base, factor = inputs(case), mp.mpf(10) ** -18 / truth.PERTURBATION
    start = truth.taylor(*base, 40)
    moved = []
    for changed in truth._perturbed(base):
        further = _scaled_away(base, changed, factor)
        moved.append(truth.differences(start, truth.taylor(*further, 40)))
    sums = [float(sum(pair[i] for pair in moved) * mp.mpf(10) ** 18) for i in range(2)]
    assert sums == pytest.approx([case.cond_attitude, case.cond_rate], rel=1e-3)


def _scaled_away(base: truth.Inputs, changed: truth.Inputs, factor: Any) -> truth.Inputs:
    def away(a: Any, b: Any) -> Any:
        return (
            [away(x, y) for x, y in zip(a, b, strict=True)] if isinstance(a, list) else a + factor * (b - a)
        )

    inertia, omega, torque, time = (away(a, b) for a, b in zip(base, changed, strict=True))
    return inertia, omega, torque, time


# Errors


def sample() -> Case:
    return truth.cases("general")[5]


def test_attitude_error_sees_the_sign_and_angles_below_rounding() -> None:
    q = truth._unit([mp.mpf(x) for x in (0.5, -0.1, 0.7, 0.3)])
    doubles = [float(x) for x in q]
    for angle in (1e-17, 1e-9, 1.0):
        end = tuple(hamilton([mp.mpf(x) for x in doubles], truth._about(0, mp.mpf(angle))))
        assert truth.attitude_error(replace(sample(), attitude_end=end), doubles) == pytest.approx(angle)
    exact = replace(sample(), attitude_end=tuple(mp.mpf(x) for x in doubles))
    assert truth.attitude_error(exact, np.array(doubles)) == 0.0
    assert truth.attitude_error(exact, -2.0 * np.array(doubles)) == 2 * np.pi


def test_rate_error_is_relative_and_leaves_half_a_denormal_free() -> None:
    end = (mp.mpf(3), mp.mpf(0), mp.mpf(-4))
    case = replace(sample(), omega_end=end)
    assert truth.rate_error(case, [3.0, 5e-16, -4.0]) == pytest.approx(1e-16)
    tiny = mp.mpf(2) ** -1074
    case = replace(sample(), omega_end=(tiny * 10, tiny / 2, mp.zero))
    assert truth.rate_error(case, [float(tiny * 10), 0.0, 0.0]) == 0.0
    assert truth.rate_error(case, [float(tiny * 11), 0.0, 0.0]) == pytest.approx(0.5 / 10, rel=1e-2)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.parametrize("error", [truth.attitude_error, truth.rate_error])
def test_error_of_a_number_out_of_range_is_infinite(error: Callable[..., float], bad: float) -> None:
    size = 4 if error is truth.attitude_error else 3
    assert error(sample(), [bad] * size) == np.inf
