"""Numbers as large and as small as there are: refused, or all of an FMU but its library is made, no warning.

Warnings are errors in these tests, numpy's of overflow and of invalid operations among them.
"""

import pytest

from fmu_build.build import companions
from fmu_build.generate.model import generate
from fmu_build.interface.variable_table import variable_table
from orbiter.files import Files
from supervessel import SceneError, Twin, parse_scene, reference
from supervessel.equations import equations
from supervessel.orbiter import ScenarioError
from support import ISS_DG, variant
from support.marks import some_at_once

VALUES = (1.7e308, 1e200, 1e155, 1e77, 1e-77, 1e-155, 1e-200, 5e-324)

PLACES = {
    "masses": lambda x: {"vessels.ISS.mass": x, "vessels.DG.mass": x},
    "one mass": lambda x: {"vessels.DG.mass": x},
    "moments": lambda x: {"vessels.ISS.pmi": [x, x, x], "vessels.DG.pmi": [x, x, x]},
    "one moment": lambda x: {"vessels.DG.pmi": [1.0, x, x]},
    "position": lambda x: {"vessels.DG.ports.nose.position": [x, -x, x]},
    "direction": lambda x: {"vessels.DG.ports.nose.direction": [0.0, 0.0, -x]},
    "rate": lambda x: {"rotation.angular_velocity": [x, -x, x]},
    "attitude": lambda x: {"rotation.attitude": [x, x, 0.0, -x]},
    "all": lambda x: {
        "vessels.ISS.mass": x,
        "vessels.ISS.pmi": [x, x, x],
        "vessels.DG.ports.nose.position": [x, -x, x],
        "rotation.angular_velocity": [x, -x, x],
    },
}

OUTPUTS = {
    "outputs.names": [
        *("pmi", "mass", "barycentre", "inertia", "attitude", "angular_velocity", "kinetic_energy"),
        *("angular_momentum", "principal_moments", "principal_axes", "error_estimate"),
    ]
}


@pytest.mark.parametrize("law", ["tensor", pytest.param("decoupled", marks=pytest.mark.stability)])
@pytest.mark.parametrize("value", some_at_once(VALUES, 1.7e308, 1e-155))
@pytest.mark.parametrize("place", PLACES)
def test_a_scene_of_extreme_numbers_is_refused_or_made_without_a_warning(place, value, law):
    raw = variant(ISS_DG, OUTPUTS | {"rotation.law": law} | PLACES[place](value))
    try:
        scene = parse_scene(raw)
    except SceneError:
        return
    model = equations(scene)
    generate(scene, 3, model)
    companions(model, variable_table(model), 3)
    twin = Twin(scene)
    twin.composite(twin.p_start)
    twin.step(twin.x_start, [0.0, 0.0, 0.0], twin.p_start, 0.1)
    reference.composite(scene)


SCENARIOS = {
    "AROT": ("AROT 30.00 -20.00 70.00", "AROT {x} -{x} {x}"),
    "VROT": ("VROT 0.10 0.20 -0.30", "VROT {x} {x} -{x}"),
    "RPOS": ("AROT 30.00 -20.00 70.00", "AROT 30.00 -20.00 70.00\n  RPOS {x} -{x} {x}"),
}


@pytest.mark.parametrize("value", VALUES)
@pytest.mark.parametrize("key", SCENARIOS)
def test_a_scenario_of_extreme_numbers_is_refused_or_imported_without_a_warning(tmp_path, key, value):
    """Both vessels have a place, so that one is judged against the other."""
    old, new = SCENARIOS[key]
    files = Files(tmp_path)
    its_own = f"  AROT 1.00 2.00 3.00\n  RPOS -{value} {value} 7\n  PRPLEVEL 0:0.5 1:1.0"
    changes = (old, new.format(x=value)), ("  PRPLEVEL 0:0.5 1:1.0", its_own)
    files.replace(files.scenario, *changes)
    try:
        files.made()
    except (ScenarioError, SceneError):
        return
