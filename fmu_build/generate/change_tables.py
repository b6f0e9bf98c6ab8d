"""C tables of what may change while a scene runs: the kinds of its inputs, and its docks."""

from supervessel.equations import Equations
from supervessel.scene.inputs import vessel_of
from supervessel.scene.schema import keeps_momentum


def change_constants(model: Equations) -> dict[str, int]:
    """Returns what the C layer must know of a scene's changes, by name of the macro."""
    scene = model.resolved.scene
    keeps = scene.keeps
    return {
        "CHANGES": int(model.change is not None),
        "STATE_IS_MOMENTUM": int(model.change is not None and keeps_momentum(scene)),
        "MASSES_KEEP_MOMENTUM": int(keeps.get("mass") == "momentum"),
        "POSES_KEEP_MOMENTUM": int(keeps.get("pose") == "momentum"),
        "SPINS": int("momentum" in model.slices.composite),
        "COMPOSITE_SPIN": model.slices.composite["momentum"].start
        if "momentum" in model.slices.composite
        else 0,
        "DOCK_COUNT": len(scene.docks) if scene.inputs.docked else 0,
        "VESSEL_COUNT": len(scene.vessels),
    }


def change_tables(model: Equations) -> str:
    """Returns the tables that go with `change_constants`, C; empty where nothing changes the rate."""
    text, resolved = "", model.resolved
    if model.change is not None:
        kinds = ", ".join(f"KIND_{variable.kind.change.upper()}" for variable in resolved.shaping)
        text += f"\nconst unsigned char INPUT_KINDS[INPUT_P_COUNT] = {{{kinds}}};\n"
    if resolved.contact:
        rows = "\n".join(f"    {row}," for row in _dock_rows(model))
        text += f"\nconst Dock DOCKS[DOCK_COUNT] = {{\n{rows}\n}};\n"
    return text


def _dock_rows(model: Equations) -> list[str]:
    """Returns a row for each dock: its ports, their vessels, where its input and its motion stand."""
    scene = model.resolved.scene
    vessels = {name: number for number, name in enumerate(scene.vessels)}
    rows = []
    for dock in scene.docks:
        one, other = dock.ports
        flag, motion = -1, -1
        if dock.name is not None and dock.name in scene.inputs.docked:
            flag = model.names.p.index(f"{dock.name}.docked")
            motion = model.names.k.index(f"{dock.name}.velocity[1]")
        names = [vessel_of(name) for name in (one, other)]
        numbers = f"{{{vessels[names[0]]}, {vessels[names[1]]}}}, {flag}, {motion}"
        rows.append(f'{{{{"{one}", "{other}"}}, {{"{names[0]}", "{names[1]}"}}, {numbers}}}')
    return rows
