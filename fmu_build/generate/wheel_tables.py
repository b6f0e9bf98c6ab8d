"""C macros about wheels, and a table of motors that must rest while docks let go of the wheels' vessels."""

from supervessel.equations import Equations
from supervessel.scene.inputs import vessel_of


def wheel_constants(model: Equations) -> dict[str, int]:
    """Returns macros about wheels, each only where a scene needs it.

    MOTOR_COUNT   : number of rows of MOTORS, see fmu_build/c/motors.h
    AXES_RESPONSE : with Taylor steps: place in a of the response to a torque, see taylor_series.h there; 0
                    under a law without products, which does not ask for it
    """
    rows, found = _rows(model), dict[str, int]()
    if rows:
        found["MOTOR_COUNT"] = len(rows)
    if any(function.name() == "held" for function in model.steps.propagation):
        place = model.slices.axes.get("response")
        found["AXES_RESPONSE"] = 0 if place is None else place.start
    return found


def wheel_tables(model: Equations) -> str:
    """Returns C of the table MOTORS; "" where it has no row."""
    rows = "\n".join(f"    {row}," for row in _rows(model))
    return f'\n#include "motors.h"\n\nconst Motor MOTORS[MOTOR_COUNT] = {{\n{rows}\n}};\n' if rows else ""


def _rows(model: Equations) -> list[str]:
    """Returns the rows of MOTORS: place in u of the torque, and in c of the wheel's axis."""
    resolved = model.resolved
    rows = []
    for number, name in enumerate(resolved.scene.wheels):
        if name in resolved.scene.inputs.wheel and resolved.may_leave(vessel_of(name)):
            axis = model.slices.composite["wheels"].start + 3 * number
            rows.append(f"{{{model.names.u.index(f'{name}.torque')}, {axis}}}")
    return rows
