"""Values on the edge of what is allowed, directions of any length."""

import numpy as np
import pytest

from fmu.refusals import SINGLE
from support import DISCARD, EPS, ISS_DG, OK, flying, relative_error, variant
from support.marks import FMI

# The same numbers from directions that differ by a power of two or by what is projected out: about 20
# roundings on the way to a port's axes, twice in each element of a tensor.
SAME_AXES_TOLERANCE = 64 * EPS


@pytest.mark.parametrize(
    ("raw", "values"),
    [
        (ISS_DG, {"DG.mass": 0.0}),
        (ISS_DG, {"DG.pmi": [0.0, 0.0, 0.0]}),
        (ISS_DG, {"DG.pmi": [0.0, 2.0, 2.0]}),
        (ISS_DG, {"DG.pmi": [1.0, 2.0, 3.0]}),
        (ISS_DG, {"DG.pmi": [0.8, 0.1, 0.7]}),  # 0.1 + 0.7 is one rounding less than 0.8
        (ISS_DG, {"DG.nose.alignment": [0.0, 1.1e-6, -1.0]}),
        (ISS_DG, {"torque": [1e12, 0.0, 0.0]}),
        (SINGLE, {"B.mass": 1e-300}),
        (SINGLE, {"B.pmi": [1e-9, 2.0, 2.0]}),
        (variant(SINGLE, {"rotation": {"law": "none"}}), {"B.pmi": [0.0, 0.0, 0.0]}),
        (variant(SINGLE, {"rotation": {"law": "none"}}), {"B.pmi": [0.0, 2.0, 2.0]}),
    ],
    ids=str,
)
@FMI
def test_values_on_the_edge_of_what_is_allowed_are_used(fmi, raw, values):
    with flying(raw, fmi) as instance:
        assert instance.set(values) == OK
        assert instance.get_status("inertia") == OK
        assert instance.step(1e-3) == OK, instance.messages()


DIRECTION, ALIGNMENT = np.array([1.0, 2.0, -2.0]), np.array([2.0, 1.0, 2.0])
POWERS = [-1070, -332, -300, -150, 150, 300, 332, 1020]  # of two


@pytest.mark.parametrize(
    ("power_direction", "power_alignment"), [pair for p in POWERS for pair in ((p, 0), (0, p), (p, p))]
)
def test_directions_of_any_length_give_the_same_composite(power_direction, power_alignment):
    with flying(ISS_DG) as instance:
        instance.set({"DG.nose.direction": DIRECTION, "DG.nose.alignment": ALIGNMENT})
        truth = instance.get("inertia")
        instance.set({"DG.nose.direction": np.ldexp(DIRECTION, power_direction)})
        instance.set({"DG.nose.alignment": np.ldexp(ALIGNMENT, power_alignment)})
        assert instance.get_status("inertia") == OK, instance.messages()
        assert relative_error(instance.get("inertia"), truth) <= SAME_AXES_TOLERANCE


@pytest.mark.parametrize("power", POWERS[1:])
@pytest.mark.parametrize(("angle", "status"), [(9e-7, DISCARD), (1.1e-6, OK)])
def test_directions_are_judged_by_their_angle_at_any_length(angle, status, power):
    with flying(ISS_DG) as instance:
        alignment = DIRECTION + angle * ALIGNMENT  # both of length 3 and perpendicular
        instance.set({"DG.nose.direction": np.ldexp(DIRECTION, power)})
        instance.set({"DG.nose.alignment": np.ldexp(alignment, power)})
        assert instance.get_status("inertia") == status


def test_an_alignment_that_is_not_perpendicular_is_projected():
    with flying(ISS_DG) as instance:
        instance.set({"DG.nose.direction": DIRECTION, "DG.nose.alignment": ALIGNMENT})
        truth = instance.get("inertia")
        instance.set({"DG.nose.alignment": ALIGNMENT - 3.0 * DIRECTION})
        assert relative_error(instance.get("inertia"), truth) <= SAME_AXES_TOLERANCE
