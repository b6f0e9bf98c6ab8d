"""A reference result inside the FMU, so that an importer can see that it flies it right; what else is beside.

Laid out as the layered standard FMI-LS-REF (1.0.0-alpha.1) says: a manifest of the files that go with the FMU
and of their roles, an experiment, what goes in and what comes out, as CSV.
"""

import csv
import io
from collections.abc import Collection, Sequence, Set
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from fmu_build.document.reference_flight import STEPS, ReferenceFlight, reference_flight
from fmu_build.interface.variable_table import Role, TableEntry
from fmu_build.interface.xml_text import xml_text
from supervessel.equations import Equations
from supervessel.scene.variables import OutputVariable

FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
NAMESPACE = "http://fmi-standard.org/fmi-ls-manifest"

SCENE = "resources/scene.toml"
EVIDENCE = "resources/accuracy.json"
PAGE = "documentation/index.html"

RELATED = (
    ("text/html", PAGE, "document", "scene, frames, variables, equations, values that are refused"),
    ("application/toml", SCENE, "model", "the scene that the FMU was built from"),
    ("application/json", EVIDENCE, "report", "by what flights law and propagator were chosen"),
    (
        "application/xml",
        f"{FOLDER}/experiments.xml",
        "experiment/smoke-test",
        "inputs and results of fifty steps",
    ),
    ("text/csv", f"{FOLDER}/inputs.csv", "experiment/smoke-test", "inputs, linear between the rows"),
    ("text/csv", f"{FOLDER}/outputs.csv", "result", "outputs at each communication point"),
)
"""Of each file that may go with an FMU: type, place in the archive, role and description."""

Array = NDArray[np.float64]


def reference_result(model: Equations, entries: Sequence[TableEntry]) -> dict[str, bytes]:
    """Returns the files of the reference result by their paths in the archive, see `reference_flight`.

    entries : the variable table
    Nothing for a body that turns too fast or has no motion in its field of gravity. Outputs that tell of a
    step's error are not in the result.
    """
    flight = reference_flight(model)
    if flight is None:
        return {}
    times = flight.stimuli.times
    return {
        f"{FOLDER}/experiments.xml": _experiments(flight),
        f"{FOLDER}/inputs.csv": inputs_table(flight, entries),
        f"{FOLDER}/outputs.csv": outputs_table(times, flight.results, entries, shown_outputs(entries)),
    }


def manifest(files: Collection[str]) -> dict[str, bytes]:
    """Returns fmi-ls-manifest.xml by its path in the archive: the role of each of the files that has one.

    files : by their places in the archive
    """
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
    for kind, place, role, description in RELATED:
        if place in files:
            beside = place.startswith(f"{FOLDER}/")
            source = place.removeprefix(f"{FOLDER}/") if beside else f"../../{place}"
            ET.SubElement(root, "Related", type=kind, source=source, role=role, description=description)
    return {f"{FOLDER}/fmi-ls-manifest.xml": xml_text(root)}


def shown_outputs(entries: Sequence[TableEntry]) -> list[TableEntry]:
    """Returns the outputs that a reference result has: all but those that tell of a step's error."""
    return [e for e in entries if isinstance(e.variable, OutputVariable) and not e.variable.kind.of_history]


def inputs_table(flight: ReferenceFlight, entries: Sequence[TableEntry], *, quoted: bool = False) -> bytes:
    """Returns the table of the inputs, a row each time that a line ends; those of docks are 0 or 1.

    quoted : whether names stand in quotes, all of them; else those that need it
    """
    inputs = _of(entries, "input")
    booleans = {entry.name for entry in inputs if entry.variable.boolean}
    rows = np.column_stack([flight.stimuli.instants, flight.stimuli.rows])
    return _csv([entry.name for entry in inputs], rows, booleans, quoted=quoted)


def outputs_table(
    times: Array,
    results: Array,
    entries: Sequence[TableEntry],
    shown: Sequence[TableEntry],
    *,
    quoted: bool = False,
) -> bytes:
    """Returns the table of some outputs.

    times, results : [s], (n,), and all outputs, (n, outputs)
    shown          : some of the outputs
    quoted         : as in `inputs_table`
    """
    all_outputs = _of(entries, "output")
    columns = [all_outputs.index(entry) for entry in shown]
    names = [entry.name for entry in shown]
    return _csv(names, np.column_stack([times, results[:, columns]]), quoted=quoted)


def _of(entries: Sequence[TableEntry], role: Role) -> list[TableEntry]:
    return [entry for entry in entries if entry.role == role]


def _csv(
    names: Sequence[str], rows: Array, booleans: Set[str] = frozenset(), *, quoted: bool = False
) -> bytes:
    """Returns a table with time in the first column; those named in `booleans` are 0 or 1."""
    text = io.StringIO()
    columns = ["time", *names]
    writer = csv.writer(text, lineterminator="\n", quoting=csv.QUOTE_ALL if quoted else csv.QUOTE_MINIMAL)
    writer.writerow(columns)
    for row in rows:
        cells = zip(columns, map(float, row), strict=True)
        line = ",".join([str(int(value)) if name in booleans else repr(value) for name, value in cells])
        text.write(f"{line}\n")
    return text.getvalue().encode()


def _experiments(flight: ReferenceFlight) -> bytes:
    root = ET.Element("Experiments")
    experiment = ET.SubElement(
        root,
        "Experiment",
        name="fifty_steps",
        description="co-simulation; inputs are set at the start of each step and hold over it",
        startTime="0.0",
        stopTime=repr(float(flight.stimuli.times[STEPS])),
        stepSize=repr(flight.stimuli.step),
    )
    ET.SubElement(experiment, "Stimuli", source="inputs.csv")
    ET.SubElement(experiment, "References", source="outputs.csv")
    return xml_text(root)
