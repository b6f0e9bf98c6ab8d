"""What importers are compared with tells a wrong flight from a right one."""

import numpy as np
import pytest

from importers.cells import held_but
from importers.scenes import COURSES, inputs
from importers.truth import deviation, tolerance, truth

pytestmark = pytest.mark.importers

TOLD_APART = 10.0
"""How many times what is allowed a wrong flight must be off by."""


@pytest.mark.parametrize("name", COURSES)
def test_a_flight_whose_inputs_come_one_step_late_fails(name):
    course, right = COURSES[name], held_but(name, frozenset(inputs(COURSES[name])))
    late = {known: np.concatenate([values[:1], values[:-1]]) for known, values in inputs(course).items()}
    off = deviation(truth(course, late).before, right.before)
    for solver in (False, True):
        assert off > TOLD_APART * tolerance(course, right.angle, euler=False, solver=solver)


def test_a_flight_with_a_number_that_is_none_fails():
    right = held_but("accuracy", frozenset(inputs(COURSES["accuracy"]))).before
    wrong = {name: values.copy() for name, values in right.items()}
    wrong["attitude[2]"][17] = np.nan
    assert not deviation(wrong, right) <= 1.0
