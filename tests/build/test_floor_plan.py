"""The floor plan: which package knows which, and how little a new kind of input or output needs."""

import ast
from collections import Counter
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from pydantic.fields import FieldInfo

import fmu_build
import supervessel
from fmu_build.document.documentation import documentation
from fmu_build.flight.choices import BEST, models
from fmu_build.flight.experiment import acts
from fmu_build.interface.terminals import terminals
from fmu_build.interface.variable_table import variable_table
from supervessel import SceneError, Twin, output_expressions, parse_scene
from supervessel.composite.actions import equation_of
from supervessel.equations import equations
from supervessel.scene import inputs, outputs, schema
from support import OK, Instance, body, variant
from support.marks import FMI

MODEL, BUILD = Path(supervessel.__path__[0]), Path(fmu_build.__path__[0])

DOOR = MODEL / "fmu.py"
"""The one module of supervessel that knows fmu_build."""

WITNESS = MODEL / "reference"
"""The model in numpy, an independent witness: for tests and users, off the path on which FMUs are made."""

WITH_BOTH = variant(
    body(),
    {
        "inputs.drag": True,
        "inputs.range": {"drag[2]": [-1.0, 1.0]},
        "outputs.names": ["spin_squared", "angular_velocity", "attitude"],
        "experiment": {"duration": 1.0, "step": 0.5, "inputs": {"drag[2]": [[0.0, 1.0]]}},
    },
)


def imported(path: Path) -> set[str]:
    """Returns the names of what a module imports, inside functions too: modules, and names from them."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names |= {node.module or "", *(f"{node.module}.{alias.name}" for alias in node.names)}
    return names


@pytest.mark.parametrize("path", sorted(MODEL.rglob("*.py")), ids=lambda path: str(path.relative_to(MODEL)))
def test_only_the_door_knows_fmu_build(path):
    known = {name for name in imported(path) if name.partition(".")[0] == "fmu_build"}
    assert path == DOOR or not known


ALL = sorted(path for package in (MODEL, BUILD) for path in package.rglob("*.py"))


@pytest.mark.parametrize("path", ALL, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_only_the_public_names_know_the_witness(path):
    known = {name for name in imported(path) if f"{name}.".startswith("supervessel.reference.")}
    assert WITNESS in path.parents or path == MODEL / "__init__.py" or not known


def test_the_model_holds_no_c():
    assert list(MODEL.rglob("*.[ch]")) == []


def test_a_class_name_stands_once_in_the_house():
    names = Counter(
        node.name
        for package in (MODEL, BUILD)
        for path in package.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ClassDef)
    )
    assert [name for name, count in names.items() if count > 1] == []


def test_about_a_dozen_modules_stand_beside_each_other():
    counts = {
        folder: len(list(folder.glob("*.py")))
        for package in (MODEL, BUILD)
        for folder in (package, *(path for path in package.rglob("*") if path.is_dir()))
    }
    assert {folder.name: n for folder, n in counts.items() if n > 13} == {}


@pytest.fixture
def new_kinds(monkeypatch):
    """A throw-away kind of input, a second torque on the whole, and an output.

    Each is its row; the input also has its key in the schema, the output its expression.
    """
    drag = replace(
        inputs.TORQUE, key="drag", quantity="drag", description="drag, {axis} in body axes", judge=""
    )
    monkeypatch.setattr(inputs, "BLOCKS", (*inputs.BLOCKS, (drag,)))
    row = outputs.OutputKind("spin_squared", "1/s", "square of the rate", ())
    monkeypatch.setitem(outputs.OUTPUTS, "spin_squared", row)
    monkeypatch.setitem(output_expressions.EXPRESSIONS, "spin_squared", lambda known: ca.sumsqr(known.omega))
    fields = schema.Inputs.__pydantic_fields__
    fields["drag"] = FieldInfo.from_annotated_attribute(schema.Flag, False)
    _rebuild()
    yield
    del fields["drag"]
    _rebuild()


def _rebuild():
    schema.Inputs.model_rebuild(force=True)
    schema.Scene.model_rebuild(force=True)


@pytest.mark.usefixtures("new_kinds")
def test_a_new_kind_of_input_is_known_to_the_errors_of_a_scene():
    wrong = variant(WITH_BOTH, {"inputs.range": {"drag[4]": [0.0, 1.0]}, "outputs.names": ["spin_square"]})
    with pytest.raises(SceneError) as error:
        parse_scene(wrong)
    assert 'inputs.range: unknown input "drag[4]" (did you mean "drag[3]"?)' in error.value.problems
    assert (
        'outputs.names: unknown output "spin_square" (did you mean "spin_squared"?)' in error.value.problems
    )


@pytest.mark.usefixtures("new_kinds")
def test_a_new_kind_of_input_and_an_output_are_in_the_twin():
    twin = Twin(parse_scene(WITH_BOTH))
    assert twin.u_names[3:] == ("drag[1]", "drag[2]", "drag[3]")
    rate = twin.ode([1, 0, 0, 0, 0, 0, 0], [1, 0, 0, 0, 4, 0], [])
    assert np.allclose(np.array(rate[4:]).ravel(), [1e-3, 2e-3, 0.0], rtol=1e-15)
    assert float(twin.outputs([1, 0, 0, 0, 1, 2, 3], [0] * 6, [])[0]) == 14.0


@pytest.mark.usefixtures("new_kinds")
def test_a_new_kind_of_input_and_an_output_are_on_the_page_and_among_the_terminals():
    scene = parse_scene(WITH_BOTH)
    entries = variable_table(equations(scene))
    html = documentation(scene, entries, 3)["documentation/index.html"].decode()
    assert "drag, y in body axes" in html
    assert "square of the rate" in html
    (terminal,) = (one for one in terminals(scene, entries) if one.name == "drag")
    assert [entry.variable.name for entry in terminal.members] == ["drag[1]", "drag[2]", "drag[3]"]


def test_a_new_kind_that_is_no_torque_needs_an_equation():
    per_second = replace(inputs.TORQUE, key="gradient", unit="1/s")
    with pytest.raises(KeyError, match=r"no equation for inputs\.gradient"):
        equation_of(per_second)


@pytest.mark.usefixtures("new_kinds")
def test_a_new_kind_of_input_acts_in_a_trade():
    scene = parse_scene(WITH_BOTH)
    assert acts(scene)
    assert BEST in models(scene, quick=True)


@pytest.mark.usefixtures("new_kinds")
@FMI
def test_a_new_kind_of_input_and_an_output_are_in_the_fmu(fmi):
    it = Instance(WITH_BOTH, fmi, optimised=False)
    it.initialise()
    assert it.set({"drag": [0.0, 4.0, 0.0]}) == OK
    assert it.step(0.5) == OK
    rate, square = it.get("angular_velocity")[1], it.get("spin_squared")
    it.free()
    assert rate == pytest.approx(4.0 / 2000.0 * 0.5, rel=1e-9)
    assert square == pytest.approx(rate**2, rel=1e-12)
