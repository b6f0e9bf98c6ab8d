"""fmi-sim: a simulator in Rust, run as its command; in model exchange it has Euler's method alone."""

import csv
import subprocess
from pathlib import Path

import numpy as np

from importers.flight import Flight, InsteadError, Series, written
from importers.tools import crate

SECONDS = 300.0


def fly(flight: Flight) -> Series:
    """Flies by the command, inputs from a CSV file."""
    given, made = flight.folder / "inputs.csv", flight.folder / "outputs.csv"
    _write(flight, given)
    interface = "model-exchange" if flight.exchange else "co-simulation"
    words = [str(crate("fmi-sim")), "--model", str(flight.fmu), "-i", str(given), "-o", str(made), interface]
    words += ["-s", "0", "-f", repr(float(flight.times[-1])), "--output-interval", repr(flight.step)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=SECONDS, check=False)
    if done.returncode:
        raise InsteadError(_said(done.stderr + done.stdout))
    found = written(made, ["time", *flight.outputs])
    last = [int(np.flatnonzero(np.isclose(found["time"], t, atol=1e-9))[-1]) for t in flight.times]
    return {name: found[name][last] for name in flight.outputs}


def _write(flight: Flight, path: Path) -> None:
    """Writes the inputs; each row has to be where this importer looks for it.

    FMI 2's co-simulation takes discrete inputs of the last row before a communication point: rows stand half
    a step before. Model exchange holds inputs over a step where each point is an event: two rows at one time.
    FMI 3's co-simulation takes the row of the communication point.
    """
    times, courses = flight.times, flight.inputs
    if flight.exchange:
        times = np.repeat(times, 2)[1:]
        times = np.append(times, times[-1] + flight.step)  # between two rows at one time it finds no value
        courses = {name: np.repeat(course, 2) for name, course in courses.items()}
    elif flight.fmi == 2:
        times = np.sort(np.concatenate([times, times[1:] - flight.step / 2]))
        courses = {name: np.repeat(course, 2)[1:] for name, course in courses.items()}
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["time", *courses])
        for k, time in enumerate(times):
            cells = [
                str(bool(course[k])).lower() if name in flight.booleans else repr(float(course[k]))
                for name, course in courses.items()
            ]
            rows.writerow([repr(float(time)), *cells])


def _said(text: str) -> str:
    """Returns the line that tells why the command failed."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    telling = [line for line in lines if "panicked" in line or "rror" in line]
    place = lines.index(telling[0]) if telling else 0
    return " ".join(lines[place : place + 2])
