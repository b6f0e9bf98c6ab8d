"""The model structure of built FMUs: unknowns, and dependencies as the FMU shows them."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pytest
from lxml import etree

from fmu.descriptions import (
    RATES,
    SCENE,
    groups,
    input_names,
    output_names,
    scalars,
    start_of,
    variables,
    xml,
)
from support import OK, PARAMETERS, STATES, Instance
from support.marks import FMI

SEED = 20240611

# Elements of the model structure by what stands in them, in FMI 2.0 and FMI 3.0.
PARTS = {
    "outputs": ("Outputs", "Output"),
    "derivatives": ("Derivatives", "ContinuousStateDerivative"),
    "initial unknowns": ("InitialUnknowns", "InitialUnknown"),
}
PART = pytest.mark.parametrize("part", PARTS)


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
