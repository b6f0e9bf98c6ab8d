"""Maestro: INTO-CPS's co-simulation engine, run as its command.

Inputs of an FMU can come from nothing but outputs of another: signals.c is built with what the inputs are,
and connected to them.
"""

import io
import json
import subprocess
import zipfile
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from fmu_build.compile.compiler import compile_library
from fmu_build.platforms import host_platform
from importers.flight import Array, Flight, InsteadError, Series, written
from importers.tools import class_path

SECONDS = 600.0
SOURCE = Path(__file__).with_name("signals.c")
TOKEN = "{5d0c6b1e-6a8f-4f0e-9a57-6f3f3d2b8c41}"


def fly(flight: Flight) -> Series:
    """Flies by a fixed-step algorithm; the same inputs hold over a step as with other masters."""
    names = [*flight.reals, *sorted(flight.booleans)]
    signals = _signals(flight, names)
    model = {
        "fmus": {"{given}": signals.as_uri(), "{flown}": flight.fmu.as_uri()},
        "connections": {f"{{given}}.s.o{i}": [f"{{flown}}.it.{name}"] for i, name in enumerate(names)},
        "parameters": {},
        "algorithm": {"type": "fixed-step", "size": flight.step},
        "logVariables": {"{flown}.it": list(flight.outputs)},
    }
    # Its time is summed up, and a step that would pass the end by a rounding is left out.
    end = float(flight.times[-1]) + flight.step / 2
    simulation = {"startTime": 0.0, "endTime": end, "reportProgress": False}
    files = {"model.json": model, "simulation.json": simulation}
    for name, content in files.items():
        (flight.folder / name).write_text(json.dumps(content), encoding="utf-8")
    words = ["java", "-cp", class_path("org.into-cps.maestro:maestro"), "org.intocps.maestro.Main"]
    words += ["import", "Sg1", "-output=.", "-i", "-if", *files]
    done = subprocess.run(
        words, cwd=flight.folder, capture_output=True, text=True, timeout=SECONDS, check=False
    )
    made = flight.folder / "outputs.csv"
    if not made.exists():
        raise InsteadError(_said(done.stdout + done.stderr))
    found = written(made, flight.outputs, "{flown}.it.")
    if len(found[flight.outputs[0]]) != len(flight.times):
        raise InsteadError(
            f"{_said(done.stdout + done.stderr)}; wrote {len(found[flight.outputs[0]])} points"
        )
    return found


def _said(text: str) -> str:
    """Returns the first line that tells of an error."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return next((line for line in lines if "rror" in line or "xception" in line), "said nothing")


def _signals(flight: Flight, names: list[str]) -> Path:
    """Returns the FMU whose outputs o0, o1, ... are the inputs of a flight, at its communication points."""
    folder, platform = flight.folder / "signals", host_platform()
    folder.mkdir()
    table = np.array([flight.inputs[name] for name in names]).T
    (folder / "table.h").write_text(_header(flight, table), encoding="utf-8")
    (folder / SOURCE.name).write_bytes(SOURCE.read_bytes())
    library = folder / f"signals{platform.suffix}"
    compile_library([Path(SOURCE.name)], platform, library, folder=folder)
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", _description(flight, names))
        archive.write(library, f"binaries/{platform.folder(2)}/{library.name}")
    fmu = folder / "signals.fmu"
    fmu.write_bytes(packed.getvalue())
    return fmu


def _header(flight: Flight, table: Array) -> str:
    rows = ",\n".join("{" + ", ".join(repr(float(value)) for value in row) + "}" for row in table)
    return f"""#define TOKEN "{TOKEN}"
#define STEP {flight.step!r}
enum {{ REAL_COUNT = {len(flight.reals)}, FLAG_COUNT = {len(flight.booleans)}, POINT_COUNT = {len(table)} }};
static const double VALUES[POINT_COUNT][REAL_COUNT + FLAG_COUNT] = {{
{rows}
}};
"""


def _description(flight: Flight, names: list[str]) -> bytes:
    root = ET.Element("fmiModelDescription", fmiVersion="2.0", modelName="signals", guid=TOKEN)
    part = {"modelIdentifier": "signals", "canHandleVariableCommunicationStepSize": "true"}
    ET.SubElement(root, "CoSimulation", part)
    variables = ET.SubElement(root, "ModelVariables")
    structure = ET.SubElement(root, "ModelStructure")
    outputs, initial = ET.SubElement(structure, "Outputs"), ET.SubElement(structure, "InitialUnknowns")
    for i, name in enumerate(names):
        flag = name in flight.booleans
        known = {"name": f"o{i}", "valueReference": str(i), "causality": "output", "initial": "calculated"}
        known["variability"] = "discrete" if flag else "continuous"
        ET.SubElement(ET.SubElement(variables, "ScalarVariable", known), "Boolean" if flag else "Real")
        ET.SubElement(outputs, "Unknown", index=str(i + 1))
        ET.SubElement(initial, "Unknown", index=str(i + 1))
    text: bytes = ET.tostring(root, encoding="UTF-8", xml_declaration=True)
    return text
