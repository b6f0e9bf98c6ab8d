"""C macros and tables about changes of inputs: the kind of change of each input, and the docks."""

from fmu_build.generate.picked_files import goes_by_changes, has_stages
from supervessel.equations import Equations
from supervessel.scene.inputs import vessel_of
from supervessel.scene.schema import keeps_momentum


def change_constants(model: Equations) -> dict[str, int]:
    """Returns by name the macros that describe a scene's changes of inputs; see fmu_build/c/changes.h.

    CHANGES              : 1 if a change of inputs can change the angular velocity, or hands something over
    STATE_IS_MOMENTUM    : 1 if the angular momentum is a state of model exchange
    MASSES_KEEP_MOMENTUM : 1 if a change of masses or moments keeps the angular momentum
    POSES_KEEP_MOMENTUM  : 1 if a change of poses keeps it
    SPINS                : 1 if ports move, so that c has the part momentum
    COMPOSITE_SPIN       : place of that part in c
    HANDED_COUNT         : how many numbers a change hands over, see fmu_build/c/hand_over.h
    DOCK_COUNT           : number of docks if any can open, else 0
    VESSEL_COUNT         : number of vessels
    """
    scene = model.resolved.scene
    keeps = scene.keeps
    return {
        "CHANGES": int(goes_by_changes(model)),
        "STATE_IS_MOMENTUM": int(model.change is not None and keeps_momentum(scene)),
        "MASSES_KEEP_MOMENTUM": int(keeps.get("mass") == "momentum"),
        "POSES_KEEP_MOMENTUM": int(keeps.get("pose") == "momentum"),
        "SPINS": int("momentum" in model.slices.composite),
        "COMPOSITE_SPIN": model.slices.composite["momentum"].start
        if "momentum" in model.slices.composite
        else 0,
        "HANDED_COUNT": len(_handed_rows(model)),
        "DOCK_COUNT": len(scene.docks) if scene.inputs.docked else 0,
        "VESSEL_COUNT": len(scene.vessels),
    }


def change_tables(model: Equations) -> str:
    """Returns C of the tables INPUT_KINDS, HANDED_OUTPUTS and DOCKS, each where the scene needs it."""
    text, resolved = "", model.resolved
    if goes_by_changes(model) or has_stages(model):
        kinds = ", ".join(f"KIND_{variable.kind.change.upper()}" for variable in resolved.shaping)
        text += f"\nconst unsigned char INPUT_KINDS[INPUT_P_COUNT] = {{{kinds}}};\n"
    if model.hand_over is not None:
        places = ", ".join(map(str, _handed_rows(model)))
        text += f'\n#include "hand_over.h"\n\nconst int HANDED_OUTPUTS[HANDED_COUNT] = {{{places}}};\n'
    if resolved.contact:
        rows = "\n".join(f"    {row}," for row in _dock_rows(model))
        text += f"\nconst Dock DOCKS[DOCK_COUNT] = {{\n{rows}\n}};\n"
    return text


def _handed_rows(model: Equations) -> list[int]:
    """Returns by place in what a change hands over the place among the outputs, -1 of one not shown."""
    if model.hand_over is None:
        return []
    kinds, names = model.resolved.output_kinds, model.resolved.scene.outputs.names
    first, count = {}, 0
    for group, (kind, _) in zip(names, kinds, strict=True):
        first[group] = count
        count += len(kind.elements(group))
    return [
        first[group] + i if group in first else -1
        for group, place in model.hand_over.slices.items()
        for i in range(place.stop - place.start)
    ]


def _dock_rows(model: Equations) -> list[str]:
    """Returns the rows of DOCKS: names of ports and vessels, numbers of vessels, places in p and k or -1.

    Vessels that mounts join have one number: C judges by it which vessels are joined.
    """
    scene = model.resolved.scene
    vessels = {name: number for number, name in enumerate(scene.vessels)}
    for mount in scene.mounts:
        kept, replaced = vessels[mount.parent], vessels[mount.child]
        vessels = {name: kept if number == replaced else number for name, number in vessels.items()}
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
