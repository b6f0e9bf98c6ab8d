"""C tables of what may change while a scene runs: the kinds of its inputs, and its docks."""

from supervessel.equations import Equations
from supervessel.rotation.changes import kind_of_change
from supervessel.scene.schema import Scene, keeps_momentum
from supervessel.scene.variables import input_variables


def change_constants(scene: Scene, model: Equations) -> dict[str, int]:
    """Returns what the C layer must know of a scene's changes, by name of the macro."""
    keeps = scene.keeps
    return {
        "CHANGES": int(model.change is not None),
        "STATE_IS_MOMENTUM": int(model.change is not None and keeps_momentum(scene)),
        "MASSES_KEEP_MOMENTUM": int(keeps.get("mass") == "momentum"),
        "POSES_KEEP_MOMENTUM": int(keeps.get("pose") == "momentum"),
        "SPINS": int("momentum" in model.slices),
        "COMPOSITE_SPIN": model.slices["momentum"].start if "momentum" in model.slices else 0,
        "DOCK_COUNT": len(scene.docks) if scene.inputs.docked else 0,
        "VESSEL_COUNT": len(scene.vessels),
    }


def change_tables(scene: Scene, model: Equations) -> str:
    """Returns the tables that go with `change_constants`, C; empty where nothing changes the rate."""
    text = ""
    if model.change is not None:
        shaping = (variable for variable in input_variables(scene) if variable.part == "shape")
        kinds = ", ".join(f"KIND_{kind_of_change(variable.group).upper()}" for variable in shaping)
        text += f"\nconst unsigned char INPUT_KINDS[INPUT_P_COUNT] = {{{kinds}}};\n"
    if scene.inputs.docked:
        rows = "\n".join(f"    {row}," for row in _dock_rows(scene, model))
        text += f"\nconst Dock DOCKS[DOCK_COUNT] = {{\n{rows}\n}};\n"
    return text


def _dock_rows(scene: Scene, model: Equations) -> list[str]:
    """Returns a row for each dock: its ports, their vessels, where its input and its motion stand."""
    vessels = {name: number for number, name in enumerate(scene.vessels)}
    rows = []
    for dock in scene.docks:
        one, other = dock.ports
        flag, motion = -1, -1
        if dock.name is not None and dock.name in scene.inputs.docked:
            flag = model.p_names.index(f"{dock.name}.docked")
            motion = model.k_names.index(f"{dock.name}.velocity[1]")
        names = [name.partition(".")[0] for name in (one, other)]
        numbers = f"{vessels[names[0]]}, {vessels[names[1]]}, {flag}, {motion}"
        rows.append(f'{{"{one}", "{other}", "{names[0]}", "{names[1]}", {numbers}}}')
    return rows
