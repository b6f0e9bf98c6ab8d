"""scene.h: counts, places and limits of a scene, as enumerators and macros for the C layer."""

from collections.abc import Iterable, Mapping, Sequence

import casadi as ca

from fmu_build.generate.change_tables import change_constants
from fmu_build.generate.flow_tables import flow_constants
from fmu_build.generate.vessel_loop import LoopTables, loop_constants
from fmu_build.generate.wheel_tables import wheel_constants
from fmu_build.interface.model_description import LOG_CATEGORIES, tells_accuracy
from fmu_build.interface.names import INDEX_MARKS
from fmu_build.interface.variable_table import TableEntry
from supervessel.equations import Equations
from supervessel.rotation.error_bound.functions import keeps_in_truth
from supervessel.rotation.propagators.free_motion import FIRST_ANGLE, LARGEST_TURN
from supervessel.rotation.propagators.taylor import (
    HALF_ORDER_AT_1,
    HALF_ORDER_SLOPE,
    LEAST_ORDER,
    MOST_ORDER,
)
from supervessel.rotation.propagators.theta import CONSTANTS
from supervessel.scene.numbers import (
    LARGEST_MOMENTUM,
    LARGEST_PLACE,
    LARGEST_TOLERANCE,
    LEAST_TOLERANCE,
    TRIANGLE_SLACK,
)
from supervessel.scene.schema import PARALLEL_LIMIT, Scene


def scene_header(
    model: Equations,
    entries: Sequence[TableEntry],
    functions: Iterable[ca.Function],
    loop: LoopTables | None,
) -> str:
    """Returns scene.h.

    entries   : the variable table
    functions : the functions of model.c
    loop      : tables of a composite that a loop puts together; None for straight code
    """
    constants = {
        **_variables(model, entries),
        "COMPOSITE_COUNT": model.composite.numel_out(0),
        **_axes_and_free_motion(model),
        **_parts_of_composite(model),
        **_rules(model.resolved.scene),
        **_work_arrays(functions, loop),
    }
    macros = {
        "AXES_COUNT": model.axes.numel_out(0),
        **change_constants(model),
        **_rate_bound(model),
        **wheel_constants(model),
        **flow_constants(model),
        **loop_constants(loop),
        **_bound(model),
        **_field(model),
        **_plan(model),
        **_limits(model.resolved.scene),
        "INDEX_MARK": f"'{INDEX_MARKS[entries[0].naming]}'",
    }
    return (
        "/* Generated: what the C layer must know of the scene. */\n"
        "#ifndef SCENE_H\n#define SCENE_H\n\n"
        f"enum {{\n{_lines('    {} = {},', constants)}\n}};\n\n"
        f"{_lines('#define {} {}', macros)}\n\n"
        "/* The same for every scene. */\n"
        f"{_lines('#define {} {}', COMMON)}\n\n"
        "#endif\n"
    )


def _variables(model: Equations, entries: Sequence[TableEntry]) -> dict[str, int]:
    """Returns the number of variables of each kind, and the value reference of the first one of each kind."""
    references = {entry.variable.name: entry.reference for entry in entries}
    p, k, u = len(model.names.p), len(model.names.k), len(model.names.u)
    return {
        "VARIABLE_COUNT": len(entries),
        "INPUT_P_COUNT": p,
        "INPUT_K_COUNT": k,
        "INPUT_U_COUNT": u,
        "REFERENCE_TIME": 0,
        "REFERENCE_P": 1,
        "REFERENCE_CONTACT": 1 + p,
        "REFERENCE_TORQUE": 1 + p + k,
        "REFERENCE_RATE_START": references["angular_velocity_start[1]"],
        "REFERENCE_ATTITUDE_START": references["attitude_start[1]"],
        "REFERENCE_OUTPUTS": 1 + p + k + u + len(model.resolved.parameters),
        "OUTPUT_COUNT": len(model.names.y),
        "REFERENCE_STATES": references["state.attitude[1]"],
        "REFERENCE_DERIVATIVES": references["der(state.attitude[1])"],
        "STATE_COUNT": len(model.names.z),
        "PORT_COUNT": len(model.resolved.scene.inputs.pose),
    }


def _axes_and_free_motion(model: Equations) -> dict[str, int]:
    """Returns the places of parts of a, and the counts of the arrays between the functions of free motion."""
    axes = model.slices.axes
    begun = [function for function in model.steps.propagation if function.name() == "free_start"]
    return {
        "AXES_FREE": axes["free"].start if "free" in axes else 0,
        "AXES_SERIES": axes["series"].start if "series" in axes else 0,
        "FREE_VARYING": begun[0].numel_out(0) if begun else 0,
        "FREE_CONSTANT": begun[0].numel_out(1) if begun else 0,
        "FREE_START": CONSTANTS if model.plan.free in ("always", "while free") else 1,
    }


def _parts_of_composite(model: Equations) -> dict[str, int]:
    """Returns the places in c of the parts that the C layer reads."""
    read = ("mass", "inertia", "margins", "law")
    return {f"COMPOSITE_{name.upper()}": model.slices.composite[name].start for name in read}


def _rules(scene: Scene) -> dict[str, int]:
    """Returns the rules by which the C layer judges moments and tensors.

    LAW_TURNS       : whether the law needs a positive definite tensor
    TRIANGLE_JUDGED : whether moments must satisfy the triangle inequality
    """
    return {
        "LAW_TURNS": int(scene.rotation.law != "none"),
        "TRIANGLE_JUDGED": int(scene.convention == "rigid_body"),
    }


def _work_arrays(functions: Iterable[ca.Function], loop: LoopTables | None) -> dict[str, int]:
    """Returns sizes of the work arrays, each enough for any of the functions; no array of C is empty."""
    sizes = [(f.sz_arg(), f.sz_res(), f.sz_iw(), f.sz_w()) for f in functions]
    arguments, results, integers, reals = (max(1, *column) for column in zip(*sizes, strict=True))
    return {
        "WORK_ARG": arguments,
        "WORK_RES": results,
        "WORK_INT": integers,
        "WORK_REAL": reals + (loop.work if loop else 0),
    }


def _plan(model: Equations) -> dict[str, object]:
    """Returns the numbers of the method of co-simulation.

    ERROR_CONTROLLED : 1 if a tolerance controls its sub-steps, 0 if an angle does
    ERROR_EXPONENT   : power of the size of a sub-step with which its estimated error grows
    SAFETY           : factor by which the sum of error estimates may exceed the tolerance
    PRODUCT_COUNT    : number of products of two rates in the law's gyroscopic term
    """
    method = model.plan.method
    return {
        "ERROR_CONTROLLED": int(method is not None and method.control != "angle"),
        "ERROR_EXPONENT": model.steps.error_exponent,
        "SAFETY": repr(method.safety if method else 1.0),
        "PRODUCT_COUNT": model.product_count,
        "ROUNDING": int(any(f.name() == "rounding" for f in model.steps.propagation)),
    }


def _bound(model: Equations) -> dict[str, object]:
    """Returns macros about the bound of the error.

    ERROR_BOUND                : 1 if it is an output
    BOUND_MASSES_KEEP_MOMENTUM : 1 if a change of masses or moments keeps the angular momentum under the law
                                 tensor, which the bound is about
    BOUND_POSES_KEEP_MOMENTUM  : 1 if a change of poses keeps it
    ACCURACY_ASKED             : 1 if passing what the scene asks for is logged: ASKED_ATTITUDE [rad] or
                                 ASKED_RATE [rad/s]
    """
    scene = model.resolved.scene
    keeps, asked = keeps_in_truth(scene) if model.bound else {}, scene.accuracy
    return {
        "ERROR_BOUND": int(bool(model.bound)),
        "BOUND_MASSES_KEEP_MOMENTUM": int(keeps.get("mass") == "momentum"),
        "BOUND_POSES_KEEP_MOMENTUM": int(keeps.get("pose") == "momentum"),
        "ACCURACY_ASKED": int(tells_accuracy(scene)),
        "ASKED_ATTITUDE": "HUGE_VAL" if asked is None else repr(asked.attitude),
        "ASKED_RATE": "HUGE_VAL" if asked is None or asked.rate is None else repr(asked.rate),
    }


def _field(model: Equations) -> dict[str, object]:
    """Returns macros about a field of gravity.

    FIELD          : 1 if its gradient turns the body; only then there are the others
    FIELD_PLACE    : place of position and velocity among the inputs u
    GRAVITY_MU     : [m3/s2]
    GRADIENT_COUNT : number of products that the acceleration follows from, 3 or 6, for Taylor steps
    AXES_GRADIENT  : place in a of the map from them to the acceleration
    """
    gravity, axes = model.resolved.scene.gravity, model.slices.axes
    if gravity is None or not model.has_field:
        return {"FIELD": 0}
    found: dict[str, object] = {
        "FIELD": 1,
        "FIELD_PLACE": len(model.resolved.acting),
        "GRAVITY_MU": repr(gravity.mu),
    }
    if "gradient" in axes:
        place = axes["gradient"]
        found["GRADIENT_COUNT"] = 3 if place.stop - place.start == 3 else 6
        found["AXES_GRADIENT"] = place.start
    return found


def _rate_bound(model: Equations) -> dict[str, int]:
    """Returns BOUNDS_FIRST_SIZE, 1, where wheels or jet damping change a rate faster than the body turns."""
    scene = model.resolved.scene
    return {"BOUNDS_FIRST_SIZE": 1} if scene.wheels or scene.inputs.flow else {}


def _limits(scene: Scene) -> dict[str, str]:
    """Returns the scene's tolerance and its largest angle of a sub-step [rad]."""
    rotation = scene.rotation
    return {
        "TOLERANCE": repr(rotation.tolerance),
        "MAX_ANGLE_STEP": f"{rotation.max_angle_step!r} /* largest angle of a sub-step [rad] */",
    }


COMMON = {
    "FIRST_ANGLE": f"{FIRST_ANGLE!r} /* up to which free motion is a series [rad] */",
    "LARGEST_TURN": f"{LARGEST_TURN!r} /* up to which free motion is followed [rad] */",
    "TRIANGLE_SLACK": f"{TRIANGLE_SLACK!r} /* of a sum of two moments beside the third, relative */",
    "PARALLEL_LIMIT": f"{PARALLEL_LIMIT!r} /* least angle of alignment and direction [rad] */",
    "LARGEST_PLACE": f"{LARGEST_PLACE!r} /* in a field of gravity [m, m/s] */",
    "LARGEST_MOMENTUM": f"{LARGEST_MOMENTUM!r} /* of a wheel, either way [N.m.s] */",
    "LEAST_TOLERANCE": repr(LEAST_TOLERANCE),
    "LARGEST_TOLERANCE": repr(LARGEST_TOLERANCE),
    "TAYLOR_LEAST_ORDER": LEAST_ORDER,
    "TAYLOR_MOST_ORDER": MOST_ORDER,
    "TAYLOR_HALF_ORDER_AT_1": repr(HALF_ORDER_AT_1),
    "TAYLOR_HALF_ORDER_SLOPE": repr(HALF_ORDER_SLOPE),
    **{
        f"LOG_NAME_{name.removeprefix('log').removeprefix('Status').upper()}": f'"{name}"'
        for name in LOG_CATEGORIES
    },
}
"""Macros of constants that Python and the C layer share; each is defined once, in Python."""


def _lines(form: str, values: Mapping[str, object]) -> str:
    return "\n".join(form.format(name, value) for name, value in values.items())
