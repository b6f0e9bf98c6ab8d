"""C macro and table about motors of wheels whose vessels docks can take off the root: there they must
rest."""

from supervessel.composite.wheels import may_leave
from supervessel.equations import Equations
from supervessel.scene.inputs import vessel_of


def wheel_constants(model: Equations) -> dict[str, int]:
    """Returns MOTOR_COUNT, the number of rows of MOTORS, in a scene that has any; see
    fmu_build/c/motors.h."""
    rows = _rows(model)
    return {"MOTOR_COUNT": len(rows)} if rows else {}


def wheel_tables(model: Equations) -> str:
    """Returns C of the table MOTORS; "" where it has no row."""
    rows = "\n".join(f"    {row}," for row in _rows(model))
    return f'\n#include "motors.h"\n\nconst Motor MOTORS[MOTOR_COUNT] = {{\n{rows}\n}};\n' if rows else ""


def _rows(model: Equations) -> list[str]:
    """Returns the rows of MOTORS: place in u of the torque, and in c of the wheel's axis."""
    resolved = model.resolved
    rows = []
    for number, name in enumerate(resolved.scene.wheels):
        if name in resolved.scene.inputs.wheel and may_leave(resolved, vessel_of(name)):
            axis = model.slices.composite["wheels"].start + 3 * number
            rows.append(f"{{{model.names.u.index(f'{name}.torque')}, {axis}}}")
    return rows
