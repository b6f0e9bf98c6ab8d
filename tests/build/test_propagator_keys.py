"""The propagator and the tolerance of a scene: what is refused and what is read."""

import pytest

from supervessel import SceneError, parse_scene
from support import INF, ISS_DG, NAN, scene, variant

ALLOWED = "must be a number from 1e-15 to 0.1"


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        (
            {"rotation": {"propagator": "split", "law": "none"}},
            'rotation.propagator = "split": makes no sense with rotation.law = "none", where torque does '
            "nothing; take any other",
        ),
        (
            {"rotation": {"propagator": "split"}, "inputs.torque": False},
            'rotation.propagator = "split": must be "exact" or "auto" without inputs.torque',
        ),
        (
            {"rotation": {"propagator": "dop85"}},
            'rotation.propagator = "dop85": must be one of auto, rk4, dop853, taylor, exact, split',
        ),
        *(
            ({"rotation": {"tolerance": value}}, f"rotation.tolerance = {shown}: {ALLOWED}")
            for value, shown in (
                (0, "0"),
                (-1e-9, "-1e-09"),
                (1e-16, "1e-16"),
                (1.0, "1.0"),
                (0.11, "0.11"),
                (NAN, "nan"),
                (INF, "inf"),
                ("1e-9", '"1e-9"'),
                (True, "true"),
                ([1e-9], "[1e-09]"),
            )
        ),
    ],
    ids=str,
)
def test_a_scene_that_cannot_be_propagated_is_refused_with_place_value_and_what_is_allowed(changes, expected):
    with pytest.raises(SceneError) as caught:
        parse_scene(variant(ISS_DG, changes))
    assert list(caught.value.problems) == [expected]


@pytest.mark.parametrize("tolerance", [1e-15, 1e-9, 0.1])
def test_tolerances_from_end_to_end_are_read(tolerance):
    assert scene(variant(ISS_DG, {"rotation": {"tolerance": tolerance}})).rotation.tolerance == tolerance
