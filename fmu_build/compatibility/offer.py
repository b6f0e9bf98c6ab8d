"""FMUs of a scene with inputs, reference results, options and a readme, checked by FMPy.

Files, their names and the form of the tables are those that the FMI project asks for: Contributing to the
fmi-standard.org website, Compatibility information, and before that the FMI Cross-Check Rules 4.1.
"""

import zipfile
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Literal
from xml.etree import ElementTree as ET

import fmpy
import numpy as np
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu
from numpy.typing import NDArray

from fmu_build.accuracy import choose
from fmu_build.build import build_fmu
from fmu_build.document.reference_flight import STEPS, ReferenceFlight, exchange_flight, reference_flight
from fmu_build.document.reference_result import inputs_table, outputs_table, shown_outputs
from fmu_build.errors import BuildError
from fmu_build.interface.names import Naming
from fmu_build.interface.variable_table import TableEntry, variable_table
from fmu_build.platforms import Platform, host_platform
from fmu_build.storage.temporary import temporary_folder
from fmu_build.versions import VERSIONS
from supervessel.equations import Equations, equations
from supervessel.scene.schema import Scene

Array = NDArray[np.float64]
Kind = Literal["cs", "me"]

MOST_SHOWN = 10
"""Most variables of a reference result."""
FIRST_SHOWN = ("attitude", "angular_velocity", "mass")
"""Outputs that a reference result has before others."""

RELATIVE_TOLERANCE = 1e-6
"""RelTol of the options: what reference results are exact to, and more."""

FINER = 20
"""In model exchange FMPy sets inputs once per output interval: this many of them are flown in a step."""
ALLOWED: dict[Kind, float] = {"cs": 1e-6, "me": 1e-2}
"""Largest difference, over a variable's largest value, between FMPy's flight and the reference result. In
model exchange it comes from the inputs that FMPy holds."""

INTERFACES: dict[Kind, str] = {"cs": "CoSimulation", "me": "ModelExchange"}


@dataclass(frozen=True)
class Reference:
    """A reference result of one interface.

    shown   : the outputs in it
    times   : [s], (n,); in model exchange two rows at one time are those before and after a jump
    results : all outputs, (n, outputs)
    """

    shown: Sequence[TableEntry]
    times: Array
    results: Array


def offer(
    scene: Scene, platforms: Sequence[Platform], naming: Naming, progress: Callable[[str], None]
) -> dict[str, bytes]:
    """Returns the files of a scene by their places: VERSION/INTERFACE/PLATFORM/NAME/...

    progress : told what is being done
    Raises BuildError for a body without a reference result (`reference_flight`), or where FMPy finds fault.
    """
    known = choose(scene)[0] if scene.accuracy else scene
    model = equations(known)
    entries = variable_table(model, naming)
    flight = reference_flight(model)
    if flight is None:
        other = ", or does not orbit" if scene.gravity else ""
        raise BuildError(f"{scene.name}: turns too fast for a reference result{other}")
    references = _references(model, entries, flight)
    files: dict[str, bytes] = {}
    with temporary_folder() as folder:
        for fmi in VERSIONS:
            for platform in platforms:
                progress(f"{scene.name}: FMI {VERSIONS[fmi].name}, {platform.name}")
                fmu = build_fmu(scene, folder / f"{scene.name}.fmu", fmi, [platform], naming)
                for kind, reference in references.items():
                    said = _checked(fmu, flight, entries, (kind, reference), platform)
                    place = f"{VERSIONS[fmi].name}/{kind}/{platform.folder(fmi)}/{scene.name}"
                    files |= {
                        f"{place}/{scene.name}.fmu": fmu.read_bytes(),
                        f"{place}/{scene.name}_in.csv": inputs_table(flight, entries, quoted=True),
                        f"{place}/{scene.name}_ref.csv": _table(reference, entries),
                        f"{place}/{scene.name}_ref.opt": _options(kind, flight),
                        f"{place}/Readme.txt": _readme(fmu, known, kind, said),
                    }
    return files


def overview(scenes: Sequence[Scene]) -> dict[str, bytes]:
    """Returns the readme of the whole folder by its place."""
    listed = "".join(f"- {scene.name}\n" for scene in scenes)
    text = (
        f"FMUs exported by Supervessel {version('supervessel')}\n\n"
        "Folders are VERSION/INTERFACE/PLATFORM/MODEL. In each:\n\n"
        "- MODEL.fmu: the FMU, both interfaces in it\n"
        "- MODEL_in.csv: inputs, linear between the rows; two rows at one time are a jump\n"
        "- MODEL_ref.csv: reference result\n"
        "- MODEL_ref.opt: options of the reference result\n"
        "- Readme.txt: what the FMU is, which features of FMI it has, how it was checked\n\n"
        f"Models:\n\n{listed}"
    )
    return {"Readme.txt": text.encode()}


def _references(
    model: Equations, entries: Sequence[TableEntry], flight: ReferenceFlight
) -> dict[Kind, Reference]:
    """Returns the reference result of each interface."""
    shown = sorted(
        (entry for entry in shown_outputs(entries) if "," not in entry.name),
        key=lambda e: (
            FIRST_SHOWN.index(e.variable.group) if e.variable.group in FIRST_SHOWN else len(FIRST_SHOWN)
        ),
    )[:MOST_SHOWN]
    return {
        "cs": Reference(shown, flight.stimuli.times, flight.results),
        "me": Reference(shown, *exchange_flight(model, flight.stimuli)),
    }


def _table(reference: Reference, entries: Sequence[TableEntry]) -> bytes:
    return outputs_table(reference.times, reference.results, entries, reference.shown, quoted=True)


def _options(kind: Kind, flight: ReferenceFlight) -> bytes:
    """Returns the options of a reference result; a step of 0 stands for a solver's own."""
    step = flight.stimuli.step
    options = {
        "StartTime": 0.0,
        "StopTime": float(flight.stimuli.times[STEPS]),
        "StepSize": step if kind == "cs" else 0.0,
        "RelTol": RELATIVE_TOLERANCE,
        "SolverType": "FixedStep" if kind == "cs" else "VariableStep",
        "OutputIntervalLength": step,
    }
    return "".join(f"{name}, {value}\n" for name, value in options.items()).encode()


def _checked(
    fmu: Path,
    flight: ReferenceFlight,
    entries: Sequence[TableEntry],
    what: tuple[Kind, Reference],
    platform: Platform,
) -> str:
    """Returns what FMPy says of an FMU, in a line. Raises BuildError where it finds fault."""
    problems = validate_fmu(str(fmu))
    if problems:
        raise BuildError("\n".join(f"{fmu.name}: FMPy: {problem}" for problem in problems))
    tool = f"FMPy {version('fmpy')}: nothing to complain of"
    if platform != host_platform():
        return f"{tool}; not flown on this platform"
    kind, reference = what
    try:
        difference = _difference(fmu, flight, entries, kind, reference)
    except FMICallException as error:
        raise BuildError(f"{fmu.name}: {INTERFACES[kind]}: FMPy's flight ends: {error}") from None
    if not difference <= ALLOWED[kind]:
        raise BuildError(
            f"{fmu.name}: {INTERFACES[kind]}: FMPy's flight is {difference:.2g} of a variable's largest value"
            f" off the reference result; at most {ALLOWED[kind]:g}"
        )
    return f"{tool}; flown, at most {difference:.1e} of a variable's largest value off the reference result"


def _difference(
    fmu: Path, flight: ReferenceFlight, entries: Sequence[TableEntry], kind: Kind, reference: Reference
) -> float:
    """Returns the largest difference, over a variable's largest value, at times without a jump."""
    inputs = [entry.name for entry in entries if entry.role == "input"]
    rows = np.column_stack([flight.stimuli.instants, flight.stimuli.rows])
    signals = np.array([tuple(row) for row in rows], [(name, np.float64) for name in ("time", *inputs)])
    step = flight.stimuli.step
    found = fmpy.simulate_fmu(
        str(fmu),
        fmi_type=INTERFACES[kind],
        stop_time=float(flight.stimuli.times[STEPS]),
        output_interval=step if kind == "cs" else step / FINER,
        relative_tolerance=None if kind == "cs" else 1e-3 * RELATIVE_TOLERANCE,
        input=signals if inputs else None,
        output=[entry.name for entry in reference.shown],
    )
    jumps = flight.stimuli.instants[1:-1]
    steady = [i for i, time in enumerate(reference.times) if not np.any(jumps == time)]
    places = [int(np.argmin(np.abs(found["time"] - reference.times[i]))) for i in steady]
    all_outputs = [entry for entry in entries if entry.role == "output"]
    columns = {entry.name: reference.results[steady, all_outputs.index(entry)] for entry in reference.shown}
    sizes: dict[str, float] = {}
    for entry in reference.shown:
        group = entry.variable.group
        sizes[group] = max(sizes.get(group, 0.0), float(np.abs(columns[entry.name]).max()))
    off = (
        np.abs(found[entry.name][places] - columns[entry.name]).max() / (sizes[entry.variable.group] or 1.0)
        for entry in reference.shown
    )
    return float(max(off, default=0.0))


def _readme(fmu: Path, scene: Scene, kind: Kind, said: str) -> bytes:
    """Returns what an FMU represents, which features of FMI it has, and how it was checked."""
    description = fmpy.read_model_description(str(fmu))
    with zipfile.ZipFile(fmu) as archive:
        interface = ET.fromstring(archive.read("modelDescription.xml")).find(INTERFACES[kind])
    assert interface is not None
    features = [
        f"{name}" if value == "true" else f"{name} = {value}"
        for name, value in interface.attrib.items()
        if name != "modelIdentifier" and value != "false"
    ]
    inputs = [v for v in description.modelVariables if v.causality == "input"]
    counts = [
        f"inputs, {kind}: {n}" for kind, n in Counter(f"{v.variability} {v.type}" for v in inputs).items()
    ]
    jumps = "Docks open and close while it runs." if scene.inputs.docked else ""
    lines = [
        f"{scene.name}.fmu, FMI {description.fmiVersion}, {INTERFACES[kind]}",
        "",
        f"{description.description}. Attitude and angular velocity of a docked assembly of rigid vessels,",
        "and its mass, barycentre and inertia. " + jumps,
        f"Exported by Supervessel {version('supervessel')}; frames and equations are in documentation/.",
        "",
        "What can be tested with it:",
        *(f"- {one}" for one in (*counts, *features)),
        f"- names of variables: {description.variableNamingConvention}",
        "- terminals and icons, source code, a reference result by FMI-LS-REF in extra/",
        "",
        "In co-simulation inputs are set at the start of each step and hold over it; in model exchange they",
        "are those of their table at every time. At a jump the table has two rows at one time.",
        "",
        f"Checked by {said}.",
    ]
    return ("\n".join(line.rstrip() for line in lines) + "\n").encode()
