"""CasADi: its importer of model exchange, integrated by CVODES with the FMU's own derivatives."""

import casadi as ca
import numpy as np
from fmpy import extract

from importers.flight import SOLVER, Flight, InsteadError, Series, series


def fly(flight: Flight) -> Series:
    """Flies, inputs held over each step; inputs that change at events stay at the start.

    The function for CVODES is made of rates alone, without reverse mode: see the page of importers.
    """
    folder = str(extract(str(flight.fmu), str(flight.folder / "unpacked")))
    builder = ca.DaeBuilder("imported", folder)
    rate = builder.create("rate", ["x", "u"], ["ode"], {"enable_reverse": False})
    outputs = builder.create("outputs", ["x", "u"], ["y"])
    x, u = ca.MX.sym("x", builder.nx()), ca.MX.sym("u", builder.nu())
    free = moved(flight)
    still = np.zeros_like(flight.times)
    courses = np.array(
        [flight.inputs[name] if name in free else flight.inputs[name][0] + still for name in builder.u()]
    )
    tight = {"reltol": SOLVER, "abstol": SOLVER / 100.0}
    dae = {"x": x, "u": u, "ode": rate(x, u)}
    step = ca.integrator("step", "cvodes", dae, 0.0, flight.step, tight)  # begins anew at each jump
    start = np.array(builder.start(builder.x()))
    if not start.any():
        raise InsteadError("reads no start values of the states: every one is 0, the quaternion too")
    whole = step.mapaccum("flight", len(flight.times) - 1)
    states = np.array(whole(x0=start, u=courses[:, :-1])["xf"])
    states = np.column_stack([start, states])
    held = np.column_stack([courses[:, 0], courses[:, :-1]])
    values = [np.array(outputs(states[:, k], held[:, k])).ravel() for k in range(len(flight.times))]
    found = series(builder.y(), values)
    return {name: found[name] for name in flight.outputs}


def moved(flight: Flight) -> set[str]:
    """Returns the inputs that this importer moves."""
    return {name for name in flight.inputs if name not in flight.discrete}
