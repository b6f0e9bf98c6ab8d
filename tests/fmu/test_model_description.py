"""modelDescription.xml of built FMUs: against the standard's schema, the scene and the FMU's behaviour."""

import math
from collections.abc import Mapping
from ctypes import c_double
from importlib.metadata import version
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from lxml import etree

from fmu.descriptions import (
    CHAIN,
    NINE,
    RATES,
    SCENE,
    input_names,
    measured_in,
    output_names,
    start_of,
    types,
    variables,
    xml,
)
from supervessel import reference
from support import EPS, ISS_DG, PARAMETERS, STATES, Instance, body, built, flying, scene, variant
from support.marks import FMI

# SI exponents, from the definitions N = kg m/s2 and J = N m.
UNITS = {
    "1": {},
    "s": {"s": 1},
    "kg": {"kg": 1},
    "m": {"m": 1},
    "m2": {"m": 2},
    "1/s": {"s": -1},
    "rad/s": {"rad": 1, "s": -1},
    "rad/s2": {"rad": 1, "s": -2},
    "N.m": {"kg": 1, "m": 2, "s": -2},
    "kg.m2": {"kg": 1, "m": 2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "N.m.s": {"kg": 1, "m": 2, "s": -1},
}
UNIT_OF = {
    "time": "s",
    "mass": "kg",
    "pmi": "m2",
    "position": "m",
    "direction": "1",
    "alignment": "1",
    "torque": "N.m",
    "angular_velocity_start": "rad/s",
    "attitude_start": "1",
    "barycentre": "m",
    "inertia": "kg.m2",
    "angular_velocity": "rad/s",
    "attitude": "1",
    "kinetic_energy": "J",
    "angular_momentum": "N.m.s",
}

UNIT_OF_RATE = {"1": "1/s", "rad/s": "rad/s2"}
DISPLAY = {"rad/s": "deg/s", "rad/s2": "deg/s2"}


def described(raw: Mapping[str, Any], fmi: int) -> dict[str, dict[str, str]]:
    """Returns the attributes of each variable that both versions have, states being named, not counted."""
    found = {name: dict(attributes) for name, attributes in variables(raw, fmi).items()}
    for attributes in found.values():
        attributes.pop("intermediateUpdate", None)
        if "derivative" in attributes:
            attributes["derivative"] = state_of(raw, fmi, attributes["derivative"])
    return found


def state_of(raw: Mapping[str, Any], fmi: int, number: str) -> str:
    """Returns the variable that an attribute `derivative` stands for: a number from 1, or a reference."""
    if fmi == 2:
        return list(variables(raw, fmi))[int(number) - 1]
    [name] = [name for name, v in variables(raw, fmi).items() if v["valueReference"] == number]
    return name


def strict_schema(fmi: int, folder: Path) -> etree.XMLSchema:
    """Returns the standard's schema without its permission for attributes of anybody's own."""
    for path in (Path(fmpy.__file__).parent / "schema" / f"fmi{fmi}").glob("*.xsd"):
        tree = etree.parse(path)
        for element in tree.findall(".//{*}anyAttribute"):
            element.getparent().remove(element)
        tree.write(folder / path.name)
    return etree.XMLSchema(file=str(folder / f"fmi{fmi}ModelDescription.xsd"))


@FMI
@SCENE
def test_fmpy_finds_nothing_to_complain_of(raw, fmi):
    assert validate_fmu(str(built(raw, fmi))) == []


@FMI
@SCENE
def test_every_element_and_attribute_is_declared_in_the_schema(raw, fmi, tmp_path):
    schema = strict_schema(fmi, tmp_path)
    schema.validate(xml(raw, fmi))
    assert [str(error) for error in schema.error_log] == []


@pytest.mark.parametrize(
    "place", [".", "CoSimulation", "ModelExchange", "ModelVariables/*[2]", "ModelStructure//*[@dependencies]"]
)
@FMI
def test_the_schema_used_here_refuses_an_attribute_of_ones_own(fmi, place, tmp_path):
    root = etree.fromstring(etree.tostring(xml(ISS_DG, fmi)))
    root.find(place).set("canDoEverything", "true")
    assert not strict_schema(fmi, tmp_path).validate(root)


@FMI
@SCENE
def test_variables_stand_in_the_order_of_the_interface(raw, fmi):
    assert list(variables(raw, fmi)) == [
        "time",
        *input_names(raw),
        *PARAMETERS,
        *output_names(raw),
        *STATES,
        *RATES,
    ]


@FMI
def test_inertia_has_nine_elements_row_by_row(fmi):
    names = list(variables(CHAIN, fmi))
    first = names.index("inertia[1,1]")
    assert names[first : first + 9] == NINE
    with flying(CHAIN, fmi) as instance:
        J = np.array([instance.get(name) for name in NINE]).reshape(3, 3)
    # All distinct but for the symmetry: no element stands in another one's place.
    assert np.array_equal(J, J.T)
    assert len(set(J.ravel())) == 6


@FMI
@SCENE
def test_value_references_are_unique(raw, fmi):
    references = [v["valueReference"] for v in variables(raw, fmi).values()]
    assert len(set(references)) == len(references)


@FMI
@SCENE
def test_units_are_those_of_the_interface(raw, fmi):
    for name, unit in measured_in(raw, fmi).items():
        inner = name.removeprefix("der(")
        expected = UNIT_OF[inner.partition("[")[0].rpartition(".")[2]]
        assert unit == (expected if inner == name else UNIT_OF_RATE[expected]), name


@FMI
@SCENE
def test_each_unit_used_is_defined_by_its_si_exponents(raw, fmi):
    defined = {
        unit.get("name"): {base: int(power) for base, power in unit.find("BaseUnit").attrib.items()}
        for unit in xml(raw, fmi).find("UnitDefinitions")
    }
    assert defined == {unit: UNITS[unit] for unit in measured_in(raw, fmi).values()}


@FMI
@SCENE
def test_angles_are_displayed_in_degrees(raw, fmi):
    displays = {
        unit.get("name"): [dict(display.attrib) for display in unit.findall("DisplayUnit")]
        for unit in xml(raw, fmi).find("UnitDefinitions")
    }
    factor = repr(180.0 / math.pi)
    assert displays == {
        unit: [{"name": DISPLAY[unit], "factor": factor}] if unit in DISPLAY else [] for unit in displays
    }
    units, shown = measured_in(raw, fmi), measured_in(raw, fmi, "displayUnit")
    assert shown == {name: DISPLAY.get(unit) for name, unit in units.items()}


@FMI
@SCENE
def test_each_variable_is_of_a_declared_type_and_leaves_units_to_it(raw, fmi):
    declared, found = types(raw, fmi), variables(raw, fmi)
    assert {v["declaredType"] for v in found.values()} == set(declared)
    assert all(kind["unit"] and kind["quantity"] for kind in declared.values())
    assert not any({"unit", "displayUnit", "quantity"} & v.keys() for v in found.values())


@FMI
@SCENE
def test_an_importer_reads_the_unit_of_each_variable(raw, fmi):
    """By FMPy's reader: that of the variable's type."""
    read = fmpy.read_model_description(str(built(raw, fmi))).modelVariables
    assert {v.name: v.declaredType.unit for v in read} == measured_in(raw, fmi)


@FMI
@SCENE
def test_variables_of_one_type_are_those_of_one_unit_and_quantity(raw, fmi):
    declared = types(raw, fmi)
    assert len({kind["unit"] for kind in declared.values()}) == len(declared)


SAID = {
    "description": "Two vessels & a <dock>",
    "version": "2.1.0-rc.1",
    "author": 'A. "B" C',
    "copyright": "© 2026 D",
    "license": "CC-BY-4.0",
}


@FMI
def test_what_a_scene_says_of_itself_stands_in_the_description_word_for_word(raw_said, fmi, tmp_path):
    root = xml(raw_said, fmi)
    assert {key: root.get(key) for key in SAID} == SAID
    read = fmpy.read_model_description(str(built(raw_said, fmi)))
    found = (read.description, read.version, read.author, read.copyright, read.license)
    assert found == tuple(SAID[key] for key in ("description", "version", "author", "copyright", "license"))
    assert strict_schema(fmi, tmp_path).validate(root)


@pytest.fixture(scope="module")
def raw_said() -> dict[str, Any]:
    """A scene that says everything of itself that it can."""
    return variant(body(), {"name": "said", **SAID})


@FMI
def test_a_scene_that_says_nothing_of_itself_has_no_attribute_of_it(fmi):
    root = xml(ISS_DG, fmi)
    assert [key for key in SAID if root.get(key) is not None] == ["description"]
    assert root.get("generationTool") == f"supervessel {version('supervessel')}"


HALF_A_DIGIT = 0.5e-2 * (1.0 + 16 * EPS)
"""Of three digits: what rounding may change of a magnitude, relatively, where the first digit is 1."""


def nominals(raw: Mapping[str, Any], fmi: int) -> dict[str, float]:
    """Returns the nominal of each variable, 1 where none is declared."""
    return {name: float(v.get("nominal", 1.0)) for name, v in variables(raw, fmi).items()}


@FMI
@SCENE
def test_nominals_are_magnitudes_of_the_scene(raw, fmi):
    found, flown = nominals(raw, fmi), scene(raw)
    whole = reference.composite(flown)
    rate = float(np.linalg.norm(flown.rotation.angular_velocity)) or 1.0
    moment = float(np.trace(whole.inertia)) / 3.0
    magnitudes = {
        "mass": whole.mass,
        "pmi": moment / whole.mass,
        "inertia": moment,
        "angular_velocity": rate,
        "state.angular_velocity": rate,
        "kinetic_energy": 0.5 * moment * rate**2,
        "angular_momentum": moment * rate,
    }
    for name in (*output_names(raw), *STATES):
        expected = magnitudes.get(name.partition("[")[0], 1.0)
        assert found[name] == pytest.approx(expected, rel=HALF_A_DIGIT), name
        assert found[name] == float(f"{found[name]:.3g}"), name
    assert all(math.isfinite(nominal) and nominal > 0.0 for nominal in found.values())


@FMI
@SCENE
def test_nominals_of_states_are_those_that_the_fmu_returns(raw, fmi):
    instance = Instance(raw, fmi, exchange=True)
    array = (c_double * len(STATES))()
    instance.fmu.getNominalsOfContinuousStates(array, len(STATES))
    assert list(array) == [nominals(raw, fmi)[state] for state in STATES]
    instance.free()


@FMI
@SCENE
def test_each_variable_has_a_description_of_its_own(raw, fmi):
    descriptions = [v["description"].strip() for v in variables(raw, fmi).values()]
    assert all(descriptions)
    assert len(set(descriptions)) == len(descriptions)


@FMI
@SCENE
def test_inputs_start_with_the_values_of_the_scene(raw, fmi):
    found = variables(raw, fmi)
    assert {n: float(found[n]["start"]) for n in input_names(raw)} == {
        n: start_of(raw, n) for n in input_names(raw)
    }


@FMI
def test_parameters_start_with_the_scenes_rate_and_its_attitude_at_unit_length(fmi):
    start = [float(variables(CHAIN, fmi)[name]["start"]) for name in PARAMETERS]
    assert start[:3] == [0.01, -0.02, 0.03]
    # A sum, a root and a quotient are rounded: less than 2 ulp of a number in [1/2, 1), EPS/2 each.
    assert np.abs(np.array(start[3:]) - [0.5**0.5, 0.0, 0.0, -(0.5**0.5)]).max() <= EPS


@FMI
@SCENE
def test_start_values_are_what_a_new_instance_returns(raw, fmi):
    instance = Instance(raw, fmi)
    instance.enter()
    for name, variable in variables(raw, fmi).items():
        if "start" in variable:
            assert instance.get(name) == float(variable["start"]), name
    instance.free()


@FMI
@SCENE
def test_outputs_rates_and_time_have_no_start_value(raw, fmi):
    started = [name for name, variable in variables(raw, fmi).items() if "start" in variable]
    assert started == [*input_names(raw), *PARAMETERS, *STATES]


@FMI
@SCENE
def test_causality_variability_and_initial_follow_from_the_role(raw, fmi):
    inputs = raw.get("inputs", {})
    # Beside masses and moments, which keep the rate, poses, which keep the momentum, change at events alone.
    ports = tuple(f"{port}." for port in inputs.get("pose", []) if inputs.get("mass") or inputs.get("pmi"))
    variability = {n: "discrete" if n.startswith(ports) else "continuous" for n in input_names(raw)}
    roles = {
        **dict.fromkeys(["time"], ("independent", "continuous", None)),
        **{name: ("input", kind, None) for name, kind in variability.items()},
        **dict.fromkeys(PARAMETERS, ("parameter", "fixed", "exact")),
        **dict.fromkeys(output_names(raw), ("output", "continuous", "calculated")),
        **dict.fromkeys(STATES, ("local", "continuous", "approx")),
        **dict.fromkeys(RATES, ("local", "continuous", "calculated")),
    }
    found = variables(raw, fmi).items()
    assert {n: (v.get("causality"), v.get("variability"), v.get("initial")) for n, v in found} == roles


@FMI
@SCENE
def test_min_and_max_are_the_ranges_of_the_scene(raw, fmi):
    limits = raw.get("inputs", {}).get("range", {})
    # Without a range of the scene: what is possible at all.
    lowest = {n: 0.0 for n in input_names(raw) if n.partition("[")[0].endswith((".mass", ".pmi"))}
    expected = {
        name: limits.get(name, limits.get(name.partition("[")[0], [lowest.get(name), None]))
        for name in variables(raw, fmi)
    }
    found = {
        name: [None if v.get(key) is None else float(v[key]) for key in ("min", "max")]
        for name, v in variables(raw, fmi).items()
    }
    assert found == expected


@FMI
def test_the_default_experiment_is_that_of_the_scene(fmi):
    experiment = xml(CHAIN, fmi).find("DefaultExperiment").attrib
    assert {key: float(value) for key, value in experiment.items()} == {
        "startTime": 0.0,
        "stopTime": 60.0,
        "stepSize": 0.25,
        "tolerance": 1e-9,
    }


@FMI
def test_a_scene_without_experiment_has_no_default_experiment(fmi):
    assert xml(ISS_DG, fmi).find("DefaultExperiment") is None


SHARED_CLAIMS = {
    2: {
        "modelIdentifier": "chain",
        "canNotUseMemoryManagementFunctions": "true",
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
        "providesDirectionalDerivative": "true",
    },
    3: {
        "modelIdentifier": "chain",
        "canGetAndSetFMUState": "true",
        "canSerializeFMUState": "true",
        "providesDirectionalDerivatives": "true",
        "providesAdjointDerivatives": "true",
    },
}
STEPPING_CLAIMS = {
    2: {"canHandleVariableCommunicationStepSize": "true", "maxOutputDerivativeOrder": "1"},
    3: {
        "canHandleVariableCommunicationStepSize": "true",
        "maxOutputDerivativeOrder": "1",
        "providesIntermediateUpdate": "true",
        "canReturnEarlyAfterIntermediateUpdate": "true",
    },
}
EXCHANGE_CLAIMS = {2: {"completedIntegratorStepNotNeeded": "true"}, 3: {}}


@FMI
def test_exactly_what_is_there_is_claimed(fmi):
    root = xml(CHAIN, fmi)
    assert dict(root.find("CoSimulation").attrib) == SHARED_CLAIMS[fmi] | STEPPING_CLAIMS[fmi]
    assert dict(root.find("ModelExchange").attrib) == SHARED_CLAIMS[fmi] | EXCHANGE_CLAIMS[fmi]
    assert root.find("ScheduledExecution") is None


def test_outputs_alone_may_be_read_within_a_step():
    found = {name for name, v in variables(CHAIN, 3).items() if v.get("intermediateUpdate") == "true"}
    assert found == set(output_names(CHAIN))


@FMI
@SCENE
def test_each_rate_is_the_derivative_of_its_state_and_nothing_else_is_one(raw, fmi):
    found = {name: v["derivative"] for name, v in described(raw, fmi).items() if "derivative" in v}
    assert found == dict(zip(RATES, STATES, strict=True))


@FMI
@SCENE
def test_nothing_has_an_event_indicator(raw, fmi):
    root = xml(raw, fmi)
    assert root.get("numberOfEventIndicators") == ("0" if fmi == 2 else None)
    assert root.findall("ModelStructure/EventIndicator") == []


@SCENE
def test_both_versions_describe_the_same_variables(raw):
    assert described(raw, 2) == described(raw, 3)
