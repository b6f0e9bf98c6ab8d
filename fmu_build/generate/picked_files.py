"""The choice of files of the C layer: some are in every FMU, the others only where the scene needs them."""

from fmu_build.generate.wheel_tables import wheel_constants
from supervessel.equations import Equations
from supervessel.rotation.error_bound.functions import keeps_in_truth
from supervessel.rotation.propagators import PROPAGATORS, WHEN_FREE
from supervessel.scene.schema import keeps_momentum

LOOP = frozenset({"vessel_loop", "lanes"})
BOOLEANS = frozenset({"docks", "booleans"})
CHANGES = frozenset(
    {
        "changes",
        "change_derivatives",
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
BOUND = frozenset({"error_bound"})
STAGES = frozenset({"stages"})
HAND_OVER = frozenset({"hand_over"})
MOTORS = frozenset({"motors"})
FLOWS = frozenset({"flows"})
FIELD = frozenset({"field"})
FIELD_SERIES = frozenset({"gradient_series"})
STEPS = frozenset(WHEN_FREE.values()).union(*(method.c_files for method in PROPAGATORS.values()))

PICKED = (
    LOOP | BOOLEANS | CHANGES | BOUND | STAGES | HAND_OVER | MOTORS | FLOWS | FIELD | FIELD_SERIES | STEPS
)
"""Names, without .c and .h, of the files that are not in every FMU, HEADERS excepted."""

HEADERS = frozenset(
    {"changes.h", "error_bound.h", "docks.h", "booleans.h", "motors.h", "flows.h", "field.h", "hand_over.h"}
)
"""Headers with such names that are in every FMU, because other files include them."""


def is_picked(file: str) -> bool:
    """Whether a file of the C layer is in an FMU only where its scene needs it."""
    return file.partition(".")[0] in PICKED and file not in HEADERS


def picked_files(model: Equations, has_loop: bool) -> frozenset[str]:
    """Returns the names, without .c and .h, of the files of PICKED that a scene's FMU has.

    has_loop : whether a loop puts the composite together
    """
    docks = BOOLEANS if model.resolved.scene.inputs.docked else frozenset()
    bound = BOUND if model.bound else frozenset()
    stages = STAGES if has_stages(model) else frozenset()
    return (
        model.plan.c_files
        | _for_changes(model)
        | docks
        | bound
        | stages
        | _for_field(model)
        | (HAND_OVER if model.hand_over is not None else frozenset())
        | (MOTORS if "MOTOR_COUNT" in wheel_constants(model) else frozenset())
        | (FLOWS if model.resolved.scene.inputs.flow else frozenset())
        | (LOOP if has_loop else frozenset())
    )


def goes_by_changes(model: Equations) -> bool:
    """Whether the FMU has changes.c: a change can change the angular velocity, or hands something over."""
    return model.change is not None or model.hand_over is not None


def has_stages(model: Equations) -> bool:
    """Whether a change of inputs goes stage by stage, since something keeps the momentum over one or the
    barycentre jumps at some of them."""
    scene = model.resolved.scene
    if model.hand_over is not None:
        return True
    keeps = keeps_in_truth(scene) if model.bound else {} if model.change is None else scene.keeps
    return "momentum" in keeps.values()


def _for_field(model: Equations) -> frozenset[str]:
    """Returns the files that a field of gravity needs, see field.h."""
    if not model.has_field:
        return frozenset()
    return FIELD | (FIELD_SERIES if "taylor_series" in model.plan.c_files else frozenset())


def _for_changes(model: Equations) -> frozenset[str]:
    """Returns the files of CHANGES that a scene needs, see changes.h."""
    scene = model.resolved.scene
    if not goes_by_changes(model):
        return frozenset({"no_changes"})
    found = {"changes", "exchange_state", "kept_in_changes"}
    keeps_some, by_momentum = "momentum" in scene.keeps.values(), keeps_momentum(scene)
    found.add("momentum_state" if by_momentum else "rate_state")
    found.add("kept_momentum" if keeps_some else "kept_rate")
    if scene.inputs.docked:
        found.add("docking")
    if scene.inputs.docked or not by_momentum:
        found |= {"change_derivatives"} | ({"kept_derivatives"} if keeps_some else set())
    return frozenset(found)
