"""ecospy: the co-simulation engine Ecos, FMI 2 and 3."""

import ctypes
import sys
from importlib import import_module
from pathlib import Path

from importers.flight import Flight, InsteadError, Series, series


def fly(flight: Flight) -> Series:
    """Flies; inputs are set between steps."""
    # Its wheel lacks a library that it needs; where that is loaded already, no other is looked for.
    ctypes.CDLL(str(Path(sys.prefix) / "lib" / "libtbb.so.12"), ctypes.RTLD_GLOBAL)
    ecos = import_module("ecospy")
    structure = ecos.EcosSimulationStructure()
    structure.add_model("it", str(flight.fmu))
    with ecos.EcosSimulation(structure=structure, step_size=flight.step) as simulation:
        if not simulation.init():
            raise InsteadError(ecos.EcosLib.get_last_error())
        points = [[simulation.get_real(f"it::{name}") for name in flight.outputs]]
        for k in range(len(flight.times) - 1):
            for name in flight.inputs:
                value = float(flight.inputs[name][k])
                if name in flight.booleans:
                    simulation.set_bool(f"it::{name}", bool(value))
                else:
                    simulation.set_real(f"it::{name}", value)
            simulation.step()
            points.append([simulation.get_real(f"it::{name}") for name in flight.outputs])
        simulation.terminate()
    return series(flight.outputs, points)
