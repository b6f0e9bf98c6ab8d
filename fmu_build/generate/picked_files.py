"""The files of the C layer that only some scenes need: which there are, and which a scene's FMU has."""

from supervessel.equations import Equations
from supervessel.rotation.propagators import PROPAGATORS, WHEN_FREE
from supervessel.scene.schema import keeps_momentum

LOOP = frozenset({"vessel_loop", "lanes"})
BOOLEANS = frozenset({"docks", "booleans"})
CHANGES = frozenset(
    {
        "changes",
        "no_changes",
        "docking",
        "momentum_state",
        "rate_state",
        "kept_momentum",
        "kept_rate",
        "kept_derivatives",
        "exchange_state",
        "kept_in_changes",
    }
)
STEPS = frozenset(WHEN_FREE.values()).union(*(method.c_files for method in PROPAGATORS.values()))

PICKED = LOOP | BOOLEANS | CHANGES | STEPS
"""Names, without .c and .h, of the files that not every FMU has, but for HEADERS."""

HEADERS = frozenset({"changes.h", "docks.h", "booleans.h"})
"""Headers of such files that are in every FMU: others include them."""


def is_picked(file: str) -> bool:
    """Whether a file of the C layer is one that not every FMU has."""
    return file.partition(".")[0] in PICKED and file not in HEADERS


def picked_files(model: Equations, has_loop: bool) -> frozenset[str]:
    """Returns the names, without .c and .h, of the files of PICKED that a scene's FMU has.

    has_loop : whether a loop puts the composite together
    """
    docks = BOOLEANS if model.resolved.scene.inputs.docked else frozenset()
    return model.plan.c_files | _for_changes(model) | docks | (LOOP if has_loop else frozenset())


def _for_changes(model: Equations) -> frozenset[str]:
    """Returns the files of CHANGES that a scene needs, see changes.h."""
    scene = model.resolved.scene
    if model.change is None:
        return frozenset({"no_changes"})
    found = {"changes", "exchange_state", "kept_in_changes"}
    if scene.inputs.docked:
        found.add("docking")
    if keeps_momentum(scene):
        found |= {"momentum_state", "kept_momentum"}
    elif "momentum" in scene.keeps.values():
        found |= {"rate_state", "kept_momentum", "kept_derivatives"}
    else:
        found |= {"rate_state", "kept_rate"}
    return frozenset(found)
