"""A reference result inside the FMU, so that an importer can see that it flies it right.

Laid out as the layered standard FMI-LS-REF (1.0.0-alpha.1) says: a manifest, an experiment, what goes in
and what comes out, as CSV.
"""

import csv
import io
from collections.abc import Sequence, Set
from math import ceil, inf, sqrt
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from fmu_build.interface.variable_table import TableEntry
from fmu_build.interface.xml_text import xml_text
from supervessel.equations import Equations, composite_slices, p_start
from supervessel.scene.inputs import MASS, TORQUE
from supervessel.scene.schema import Scene
from supervessel.scene.variables import InputVariable

FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
NAMESPACE = "http://fmi-standard.org/fmi-ls-manifest"
STEPS = 50
DEFAULT_STEP = 0.1  # s
MOST_SUB_STEPS = 2000
ATTEMPTS = 8

Array = NDArray[np.float64]


def reference_result(model: Equations, entries: Sequence[TableEntry]) -> dict[str, bytes]:
    """Returns the files of the reference result by their paths in the archive.

    entries : the variable table
    Fifty steps from the scene's start, inputs moving linearly: masses lose up to a tenth within their
    range, unless that would change the rate, the torque grows to what would double the rate at the start, or
    give 0.01 rad/s; everything else stays. The steps are the
    scene's, or a tenth of them and so on where the body turns fast; a body that turns too fast for all of
    these has no reference result.
    """
    resolved, scene = model.resolved, model.resolved.scene
    inputs = resolved.inputs
    first = np.zeros(len(inputs))
    first[: len(model.names.p)] = p_start(scene)
    step = scene.experiment.step if scene.experiment else DEFAULT_STEP
    for _ in range(ATTEMPTS):
        duration = step * STEPS
        last = _last_inputs(scene, model, inputs, first, duration) if 0.0 < duration < inf else first
        if 0.0 < duration < inf and np.all(np.isfinite(last)):
            times = step * np.arange(STEPS + 1)
            stimuli = first + np.outer(times / times[-1], last - first)
            results = _fly(scene, model, stimuli, step)
            if results is not None and np.all(np.isfinite(results)):
                break
        step /= 10.0
    else:
        return {}
    ends = np.column_stack([times[[0, -1]], np.vstack([first, last])])
    names = {role: [entry.name for entry in entries if entry.role == role] for role in ("input", "output")}
    booleans = frozenset(entry.name for entry in entries if entry.variable.boolean)
    return {
        f"{FOLDER}/fmi-ls-manifest.xml": _manifest(),
        f"{FOLDER}/experiments.xml": _experiments(step, float(times[-1])),
        f"{FOLDER}/inputs.csv": _csv(names["input"], ends, booleans),
        f"{FOLDER}/outputs.csv": _csv(names["output"], np.column_stack([times, results])),
    }


def _composite(model: Equations, inputs: Array) -> Array:
    return np.array(model.composite(inputs[: len(model.names.p)])).ravel()


def _action(model: Equations, inputs: Array) -> Array:
    """Returns those of all inputs that act; they are the last ones."""
    return inputs[len(inputs) - len(model.names.u) :]


def _last_inputs(
    scene: Scene, model: Equations, inputs: Sequence[InputVariable], first: Array, duration: float
) -> Array:
    """Returns the inputs at the end of the experiment."""
    with np.errstate(over="ignore"):  # an infinite rate makes an infinite torque, which is not flown
        rate = float(np.linalg.norm(scene.rotation.angular_velocity)) or 0.01
    xx, yy, zz, xy, xz, yz = _composite(model, first)[composite_slices()["inertia"]]
    smallest = max(float(np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])[0]), 0.0)
    last = []
    for variable, start in zip(inputs, first, strict=True):
        value = float(start)
        if variable.kind is MASS and scene.keeps["mass"] == "rate":
            value = max(0.9 * value, variable.low or 0.0)
        elif variable.kind is TORQUE:
            value = min(smallest * rate / duration, variable.high if variable.high is not None else np.inf)
            value = max(value, variable.low if variable.low is not None else -np.inf)
        last.append(value)
    return np.array(last)


def _fly(scene: Scene, model: Equations, stimuli: Array, step: float) -> Array | None:
    """Returns the outputs at each communication point, (STEPS + 1, ny), as the FMU computes them.

    None if that takes more than MOST_SUB_STEPS.
    """
    x = np.array([*scene.rotation.attitude, *scene.rotation.angular_velocity])
    held, taken = stimuli[0], 0
    rows = [_outputs(model, x, held)]
    for inputs in stimuli[1:]:
        c, u = _composite(model, held), _action(model, held)
        remaining = step
        while remaining > 0.0:
            square = float(model.steps.fastest_square(x, u, c))
            count = remaining * sqrt(square) / scene.rotation.max_angle_step if square >= 0.0 else np.inf
            taken += 1
            if not taken + count <= MOST_SUB_STEPS:
                return None
            size = remaining / max(1, ceil(count))
            x = np.array(model.steps.step.call([x, u, c, size])[0]).ravel()
            remaining = remaining - size if count > 1.0 else 0.0
        rows.append(_outputs(model, x, held))  # of the step's end: its inputs still hold
        held = inputs
    return np.vstack(rows)


def _outputs(model: Equations, x: Array, inputs: Array) -> Array:
    c = _composite(model, inputs)
    return np.array(model.outputs(x, _action(model, inputs), c, model.axes(c), 0.0)).ravel()


def _csv(names: Sequence[str], rows: Array, booleans: Set[str] = frozenset()) -> bytes:
    """Returns a table with time in the first column; those named in `booleans` are 0 or 1."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    columns = ["time", *names]
    writer.writerow(columns)
    for row in rows:
        cells = zip(columns, map(float, row), strict=True)
        writer.writerow([str(int(value)) if name in booleans else repr(value) for name, value in cells])
    return text.getvalue().encode()


def _manifest() -> bytes:
    ET.register_namespace("fmi-ls", NAMESPACE)
    root = ET.Element(
        "fmiReferences",
        {
            f"{{{NAMESPACE}}}fmi-ls-name": "org.fmi-standard.fmi-ls-ref",
            f"{{{NAMESPACE}}}fmi-ls-version": "1.0.0-alpha.1",
            f"{{{NAMESPACE}}}fmi-ls-description": (
                "Layered Standard providing information on related files included in an FMU."
            ),
        },
    )
    for kind, source, role, description in (
        ("application/xml", "experiments.xml", "experiment/smoke-test", "inputs and results of fifty steps"),
        ("text/csv", "inputs.csv", "experiment/smoke-test", "inputs, linear between the rows"),
        ("text/csv", "outputs.csv", "result", "outputs at each communication point"),
    ):
        ET.SubElement(root, "Related", type=kind, source=source, role=role, description=description)
    return xml_text(root)


def _experiments(step: float, duration: float) -> bytes:
    root = ET.Element("Experiments")
    experiment = ET.SubElement(
        root,
        "Experiment",
        name="fifty_steps",
        description="co-simulation; inputs are set at the start of each step and hold over it",
        startTime="0.0",
        stopTime=repr(duration),
        stepSize=repr(step),
    )
    ET.SubElement(experiment, "Stimuli", source="inputs.csv")
    ET.SubElement(experiment, "References", source="outputs.csv")
    return xml_text(root)
