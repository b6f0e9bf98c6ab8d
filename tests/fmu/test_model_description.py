"""modelDescription.xml of built FMUs: against the standard's schema, the scene and the FMU's behaviour."""

import math
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from ctypes import c_double
from functools import cache
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from lxml import etree

from supervessel import reference
from support import EPS, ISS_DG, OK, Instance, body, built, flying, scene, variant
from support.marks import FMI

SEED = 20240611

PARAMETERS = [
    *(f"angular_velocity_start[{i}]" for i in (1, 2, 3)),
    *(f"attitude_start[{i}]" for i in (1, 2, 3, 4)),
]
STATES = [
    *(f"state.attitude[{i}]" for i in (1, 2, 3, 4)),
    *(f"state.angular_velocity[{i}]" for i in (1, 2, 3)),
]
RATES = [f"der({state})" for state in STATES]
SIZES = {"mass": 0, "kinetic_energy": 0, "attitude": 4}  # elements of an output; 3 if not listed
NINE = [f"inertia[{i},{j}]" for i in (1, 2, 3) for j in (1, 2, 3)]

# SI exponents, from the definitions N = kg m/s2 and J = N m.
UNITS = {
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
    "direction": None,
    "alignment": None,
    "torque": "N.m",
    "angular_velocity_start": "rad/s",
    "attitude_start": None,
    "barycentre": "m",
    "inertia": "kg.m2",
    "angular_velocity": "rad/s",
    "attitude": None,
    "kinetic_energy": "J",
    "angular_momentum": "N.m.s",
}

UNIT_OF_RATE = {None: "1/s", "rad/s": "rad/s2"}
DISPLAY = {"rad/s": "deg/s", "rad/s2": "deg/s2"}

# Elements of the model structure by what stands in them, in FMI 2.0 and FMI 3.0.
PARTS = {
    "outputs": ("Outputs", "Output"),
    "derivatives": ("Derivatives", "ContinuousStateDerivative"),
    "initial unknowns": ("InitialUnknowns", "InitialUnknown"),
}
PART = pytest.mark.parametrize("part", PARTS)

# Three vessels in a row, ports at odd angles: the root's tensor is full and its mass an input, the middle one
# has all its figures as inputs, both docks can be moved, one of them by the root's own port.
CHAIN: dict[str, Any] = {
    "name": "chain",
    "root": "A",
    "vessels": {
        "A": {
            "mass": 900.0,
            "inertia": [[800.0, 50.0, -30.0], [50.0, 900.0, 40.0], [-30.0, 40.0, 700.0]],
            "centre_of_mass": [0.1, -0.2, 0.3],
            "ports": {"fore": {"position": [1.0, 2.0, 3.0], "direction": [3, 0, 4], "alignment": [-4, 5, 3]}},
        },
        "B": {
            "mass": 500.0,
            "pmi": [1.0, 1.3, 1.6],
            "ports": {
                "aft": {"position": [-2.0, 0.3, 0.1], "direction": [-1, 1, 0], "alignment": [1, 1, 1]},
                "fore": {"position": [2.0, 0.1, 0.2], "direction": [1, 2, 0], "alignment": [-2, 1, 1]},
            },
        },
        "C": {
            "mass": 70.0,
            "pmi": [0.4, 0.5, 0.6],
            "ports": {"aft": {"position": [-1.0, 0.2, 0.4], "direction": [-2, 1, 0], "alignment": [0, 0, 3]}},
        },
    },
    "docks": [{"ports": ["B.aft", "A.fore"]}, {"ports": ["B.fore", "C.aft"]}],
    "inputs": {
        "mass": ["B", "A"],
        "pmi": ["B"],
        "pose": ["C.aft", "A.fore"],
        "range": {"B.mass": [0.0, 500.0], "B.pmi": [0.5, 2.0], "C.aft.position[2]": [-0.5, 0.5]},
    },
    "rotation": {
        "law": "principal",
        "angular_velocity": [0.01, -0.02, 0.03],
        "attitude": [2.0, 0.0, 0.0, -2.0],
    },
    "experiment": {"duration": 60.0, "step": 0.25},
    "outputs": {"names": ["attitude", "inertia", "mass", "pmi", "angular_momentum", "kinetic_energy"]},
}
SINGLE = variant(
    body(1000.0, (1.0, 2.0, 2.5), law="none"), {"inputs": {"mass": ["B"], "pmi": ["B"], "torque": True}}
)
# A port adapter without mass: its moments are an input that nothing follows from.
ADAPTER = variant(
    ISS_DG,
    {"name": "adapter", "vessels.DG.mass": 0.0, "inputs": {"pmi": ["DG"], "pose": ["DG.nose", "ISS.P2"]}},
)
SCENES = {
    "everything": ISS_DG,
    "chain": CHAIN,
    "single": SINGLE,
    "adapter": ADAPTER,
    "no inputs": variant(body(law="decoupled"), {"name": "plain", "inputs": None, "outputs": None}),
}
SCENE = pytest.mark.parametrize("raw", SCENES.values(), ids=SCENES.keys())


@cache
def _xml(path: Path) -> etree._Element:
    with zipfile.ZipFile(path) as archive:
        return etree.fromstring(archive.read("modelDescription.xml"))


def xml(raw: Mapping[str, Any], fmi: int) -> etree._Element:
    """Returns the root element of a scene's model description."""
    return _xml(built(raw, fmi))


def variables(raw: Mapping[str, Any], fmi: int) -> dict[str, dict[str, str]]:
    """Returns the attributes of each variable by name, laid out alike for both versions, in order."""
    elements = xml(raw, fmi).find("ModelVariables")
    if fmi == 3:
        return {e.get("name"): dict(e.attrib) for e in elements}
    return {e.get("name"): {**e.attrib, **e[0].attrib} for e in elements}


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


def groups(raw: Mapping[str, Any]) -> Iterator[tuple[str, int]]:
    """Yields the scene's inputs as name without index and number of elements, 0 for a scalar."""
    inputs = raw.get("inputs", {})
    yield from ((f"{vessel}.mass", 0) for vessel in inputs.get("mass", []))
    yield from ((f"{vessel}.pmi", 3) for vessel in inputs.get("pmi", []))
    for port in inputs.get("pose", []):
        yield from ((f"{port}.{part}", 3) for part in ("position", "direction", "alignment"))
    if inputs.get("torque"):
        yield "torque", 3


def scalars(name: str, size: int) -> list[str]:
    return [f"{name}[{i}]" for i in range(1, size + 1)] if size else [name]


def input_names(raw: Mapping[str, Any]) -> list[str]:
    return [scalar for name, size in groups(raw) for scalar in scalars(name, size)]


def output_names(raw: Mapping[str, Any]) -> list[str]:
    default = ["mass", "barycentre", "pmi", "angular_velocity", "attitude"]
    names = raw.get("outputs", {}).get("names", default)
    return [s for name in names for s in (NINE if name == "inertia" else scalars(name, SIZES.get(name, 3)))]


def start_of(raw: Mapping[str, Any], name: str) -> float:
    """Returns what the raw scene says of an input."""
    group, _, index = name.rstrip("]").partition("[")
    if group == "torque":
        return 0.0
    vessel, *port, key = group.split(".")
    table = raw["vessels"][vessel]
    value = (table["ports"][port[0]] if port else table)[key]
    return float(value[int(index) - 1] if index else value)


def structure(raw: Mapping[str, Any], fmi: int, part: str) -> dict[str, etree._Element]:
    """Returns the elements of a part of the model structure by the variable that they stand for, in order."""
    names = list(variables(raw, fmi))
    root, tag = xml(raw, fmi).find("ModelStructure"), PARTS[part][fmi - 2]
    elements = root.findall(tag) if fmi == 3 else list(root.find(tag))
    if fmi == 2:
        return {names[int(e.get("index")) - 1]: e for e in elements}
    by_reference = {v["valueReference"]: name for name, v in variables(raw, fmi).items()}
    return {by_reference[e.get("valueReference")]: e for e in elements}


def kinds(raw: Mapping[str, Any], fmi: int, part: str) -> dict[str, dict[str, str]]:
    """Returns by unknown the names of the variables that it is declared to depend on, with the kind."""
    names = list(variables(raw, fmi))
    by_reference = {v["valueReference"]: name for name, v in variables(raw, fmi).items()}
    found = {}
    for unknown, element in structure(raw, fmi, part).items():
        numbers = element.attrib["dependencies"].split()
        knowns = [names[int(n) - 1] if fmi == 2 else by_reference[n] for n in numbers]
        assert len(set(knowns)) == len(knowns), unknown
        found[unknown] = dict(zip(knowns, element.attrib["dependenciesKind"].split(), strict=True))
    return found


def dependencies(raw: Mapping[str, Any], fmi: int, part: str) -> dict[str, set[str]]:
    """Returns by unknown the names of the variables that it is declared to depend on."""
    return {unknown: set(line) for unknown, line in kinds(raw, fmi, part).items()}


def unknowns(raw: Mapping[str, Any], part: str) -> list[str]:
    """Returns what stands in a part of the model structure."""
    outputs = output_names(raw)
    return {"outputs": outputs, "derivatives": RATES, "initial unknowns": [*outputs, *STATES, *RATES]}[part]


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
    for name, variable in variables(raw, fmi).items():
        inner = name.removeprefix("der(")
        unit = UNIT_OF[inner.partition("[")[0].rpartition(".")[2]]
        assert variable.get("unit") == (unit if inner == name else UNIT_OF_RATE[unit]), name


@FMI
@SCENE
def test_each_unit_used_is_defined_by_its_si_exponents(raw, fmi):
    defined = {
        unit.get("name"): {base: int(power) for base, power in unit.find("BaseUnit").attrib.items()}
        for unit in xml(raw, fmi).find("UnitDefinitions")
    }
    used = {v["unit"] for v in variables(raw, fmi).values() if "unit" in v}
    assert defined == {unit: UNITS[unit] for unit in used}


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
    for name, variable in variables(raw, fmi).items():
        assert variable.get("displayUnit") == DISPLAY.get(variable.get("unit")), name


@FMI
@SCENE
def test_each_variable_is_of_a_declared_type_with_its_unit(raw, fmi):
    types = {
        element.get("name"): dict((element[0] if fmi == 2 else element).attrib)
        for element in xml(raw, fmi).find("TypeDefinitions")
    }
    found = variables(raw, fmi)
    assert {v["declaredType"] for v in found.values()} == set(types)
    for name, variable in found.items():
        declared = types[variable["declaredType"]]
        for attribute in ("unit", "displayUnit"):
            assert declared.get(attribute) == variable.get(attribute), name
        assert declared["quantity"]


@FMI
@SCENE
def test_variables_of_one_type_are_those_of_one_unit_and_quantity(raw, fmi):
    units = {(v["declaredType"], v.get("unit")) for v in variables(raw, fmi).values()}
    assert len(units) == len({kind for kind, _ in units}) == len({unit for _, unit in units})


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
    truth = {
        "mass": whole.mass,
        "pmi": moment / whole.mass,
        "inertia": moment,
        "angular_velocity": rate,
        "state.angular_velocity": rate,
        "kinetic_energy": 0.5 * moment * rate**2,
        "angular_momentum": moment * rate,
    }
    for name in (*output_names(raw), *STATES):
        expected = truth.get(name.partition("[")[0], 1.0)
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
def test_what_is_calculated_and_time_have_no_start_value(raw, fmi):
    started = [name for name, variable in variables(raw, fmi).items() if "start" in variable]
    assert started == [*input_names(raw), *PARAMETERS]


@FMI
@SCENE
def test_causality_variability_and_initial_follow_from_the_role(raw, fmi):
    roles = {
        **dict.fromkeys(["time"], ("independent", "continuous", None)),
        **dict.fromkeys(input_names(raw), ("input", "continuous", None)),
        **dict.fromkeys(PARAMETERS, ("parameter", "fixed", "exact")),
        **dict.fromkeys(output_names(raw), ("output", "continuous", "calculated")),
        **dict.fromkeys([*STATES, *RATES], ("local", "continuous", "calculated")),
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


@PART
@SCENE
def test_both_versions_declare_the_same_dependencies(raw, part):
    assert kinds(raw, 2, part) == kinds(raw, 3, part)


@PART
@FMI
@SCENE
def test_every_unknown_stands_in_the_model_structure_in_order(raw, fmi, part):
    assert list(dependencies(raw, fmi, part)) == unknowns(raw, part)


@FMI
@SCENE
def test_the_model_structure_holds_nothing_else(raw, fmi):
    root = xml(raw, fmi).find("ModelStructure")
    assert {element.tag for element in root} == {tags[fmi - 2] for tags in PARTS.values()}


@PART
@FMI
@SCENE
def test_each_dependency_is_declared_constant_or_dependent(raw, fmi, part):
    for unknown, line in kinds(raw, fmi, part).items():
        assert set(line.values()) <= {"constant", "dependent"}, unknown


@FMI
@SCENE
def test_an_angular_velocity_is_at_the_start_its_parameter(raw, fmi):
    found = kinds(raw, fmi, "initial unknowns")
    for i in (1, 2, 3):
        assert found[f"state.angular_velocity[{i}]"] == {f"angular_velocity_start[{i}]": "constant"}
    for i in (1, 2, 3, 4):
        assert found[f"state.attitude[{i}]"] == {f"attitude_start[{k}]": "dependent" for k in (1, 2, 3, 4)}


def random_point(raw: Mapping[str, Any], generator: np.random.Generator) -> dict[str, float]:
    """Returns values for every input and start parameter in general position, all of them usable."""
    point: dict[str, float] = {}
    for name, size in groups(raw):
        start = np.array([start_of(raw, scalar) for scalar in scalars(name, size)])
        if name.endswith(("direction", "alignment", "position")) or name == "torque":
            numbers = start + generator.uniform(-0.3, 0.3, size)
        elif name.endswith("pmi"):
            numbers = start.mean() * generator.uniform(0.8, 1.2, size)  # 0.8 + 0.8 > 1.2: a rigid body
        else:
            numbers = start * generator.uniform(0.5, 1.5)
        point |= dict(zip(scalars(name, size), numbers, strict=True))
    return point | dict(zip(PARAMETERS, generator.normal(size=7), strict=True))


def observed(
    raw: Mapping[str, Any], fmi: int, names: Sequence[str], running: str | None
) -> dict[str, set[str]]:
    """Returns by variable with which it changes, in the last bit at least, at any of some points.

    The inputs have changed before: what a change of one makes may depend on that of another.

    running : "exchange", "steps", or None while initialising; knowns are the inputs, with the states in model
        exchange and the parameters before the start
    """
    generator = np.random.default_rng(SEED)
    found: dict[str, set[str]] = {name: set() for name in names}
    for _ in range(4):
        point = random_point(raw, generator)
        instance = Instance(raw, fmi, exchange=running == "exchange")
        assert instance.enter() == OK
        assert instance.set(point) == OK
        if running:
            assert instance.exit() == OK
            moved = random_point(raw, generator)
            point = {name: moved[name] for name in input_names(raw)}
        if running == "steps":
            assert instance.step(0.5) == OK
        if running:
            assert instance.set(point) == OK
        if running == "exchange":  # still in event mode
            point |= {state: instance.get(state) for state in STATES}
        references = [instance.references[name] for name in names]
        read = instance.fmu.getFloat64 if fmi == 3 else instance.fmu.getReal
        for name in point:
            before = read(references)
            assert instance.set({name: point[name] * (1 + 0.01 * generator.uniform(0.5, 1.0))}) == OK
            after = read(references)
            assert instance.set({name: point[name]}) == OK
            for unknown, old, new in zip(names, before, after, strict=True):
                if old != new:
                    found[unknown].add(name)
        instance.free()
    return found


def without_kept(found: Mapping[str, set[str]]) -> dict[str, set[str]]:
    """Returns dependencies without those of the angular momentum on poses: only rounding shows."""
    poses = tuple(f".{part}[{i}]" for part in ("position", "direction", "alignment") for i in (1, 2, 3))
    return {
        unknown: {
            name for name in names if not (unknown.startswith("angular_momentum") and name.endswith(poses))
        }
        for unknown, names in found.items()
    }


@PART
@FMI
@SCENE
def test_declared_dependencies_are_exactly_those_that_the_fmu_shows(raw, fmi, part):
    running = None if part == "initial unknowns" else "exchange"
    found = observed(raw, fmi, unknowns(raw, part), running)
    declared = dependencies(raw, fmi, part)
    if running:
        declared, found = without_kept(declared), without_kept(found)
    assert declared == found


@FMI
@SCENE
def test_declared_dependencies_on_inputs_are_those_that_show_between_steps(raw, fmi):
    inputs = set(input_names(raw))
    declared = {
        unknown: known & inputs
        for part in ("outputs", "derivatives")
        for unknown, known in dependencies(raw, fmi, part).items()
    }
    found = observed(raw, fmi, [*output_names(raw), *RATES], "steps")
    assert without_kept(declared) == without_kept(found)
