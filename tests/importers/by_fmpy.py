"""FMPy: its `simulate_fmu`, both versions and both interfaces."""

import numpy as np
from fmpy import simulate_fmu

from importers.flight import SOLVER, Flight, Series


def fly(flight: Flight) -> Series:
    """Flies; in model exchange every communication point is an event, given as two rows at one time."""
    times, values = flight.times, flight.inputs
    if flight.exchange:  # held over each step, and the solver told of every jump
        times = np.repeat(times, 2)[1:]
        values = {name: np.repeat(course, 2)[:-1] for name, course in values.items()}
    dtype = [("time", float), *((name, bool if name in flight.booleans else float) for name in values)]
    signals = np.zeros(len(times), dtype)
    signals["time"] = times
    for name, course in values.items():
        signals[name] = course
    found = simulate_fmu(
        str(flight.fmu),
        fmi_type="ModelExchange" if flight.exchange else "CoSimulation",
        stop_time=float(flight.times[-1]),
        output_interval=flight.step,
        relative_tolerance=SOLVER if flight.exchange else None,
        input=signals,
        output=list(flight.outputs),
    )
    last = np.searchsorted(found["time"], flight.times + flight.step / 4) - 1  # at an event there are two
    return {name: np.array(found[name][last], dtype=float) for name in flight.outputs}
