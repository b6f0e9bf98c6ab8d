"""C that is particular to a scene: the generated equations, the variable table and the scene's numbers."""

import errno
import hashlib
import os
import re
import warnings
from collections.abc import Iterable, Mapping, Sequence

import casadi as ca

from fmu_build.errors import BuildError
from fmu_build.generate.change_tables import change_constants
from fmu_build.generate.vessel_loop import Tables, loop_constants
from fmu_build.interface.variable_table import TableEntry
from fmu_build.storage.cache import reason
from fmu_build.storage.temporary import place_for_temporary, temporary_folder
from supervessel.equations import Equations
from supervessel.problems import printable
from supervessel.rotation.propagators.free_motion import FIRST_ANGLE, LARGEST_TURN
from supervessel.rotation.propagators.theta import CONSTANTS
from supervessel.scene.variables import InputVariable, OutputVariable, Variable

CHOICES = {
    "STEPS_NONE": 0,
    "STEPS_BY_ANGLE": 1,
    "STEPS_BY_ERROR": 2,
    "STEPS_BY_SERIES": 3,
    "FREE_NEVER": 0,
    "FREE_ALWAYS": 1,
    "FREE_BETWEEN_KICKS": 2,
    "FREE_WHILE_FREE": 3,
}
"""What the C layer compiles for a plan (`supervessel.rotation.propagators`), as the preprocessor sees it."""


def model_source(functions: Iterable[ca.Function]) -> str:
    """Returns model.c: the scene's equations as C functions without external symbols of their own."""
    generator = ca.CodeGenerator("model.c", {"with_export": False, "casadi_int": "int", "verbose": False})
    for function in functions:
        generator.add(function)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        source = generated(generator, "model.c")
    if "#error" in source:
        raise BuildError("the equations hold something that cannot be generated as C")
    return '#include "model.h"\n\n' + DEFINITION.sub(_dividing_as_written, _without_null_checks(source))


DEFINITION = re.compile(r"^(static int casadi_f\d+\(.*\) \{\n)((?:(?!^\}).*\n)*)", re.MULTILINE)
"""The beginning and the body of a function in generated C."""


def _dividing_as_written(function: re.Match[str]) -> str:
    """Returns a function of generated C; one that divides more than once begins with the prelude's macro."""
    beginning, body = function.groups()
    mark = "  DIVIDES_ONLY_AS_WRITTEN\n" if body.count("/") > 1 else ""
    return beginning + mark + body


def generated(generator: ca.CodeGenerator, file: str) -> str:
    """Returns the C that a generator writes into a file of that name, by way of a temporary folder.

    Raises BuildError where that folder cannot be used.
    """
    try:
        with temporary_folder() as folder:
            os.fsencode(folder).decode()  # CasADi drops what is no UTF-8, and writes elsewhere
            generator.generate(f"{folder}/")
            text = (folder / file).read_text()
            if generator.dump() not in text:  # CasADi does not notice that a disk is full
                raise OSError(errno.ENOSPC, "it has not been written whole")
            return text
    except UnicodeDecodeError:
        raise BuildError(f"{place_for_temporary()!a}: must be UTF-8, to be worked in") from None
    except (OSError, RuntimeError) as error:
        where = f"{printable(place_for_temporary())}: C cannot be written there"
        why = reason(error, "for it") if isinstance(error, OSError) else str(error)
        raise BuildError(f"{where}: {why}") from None


def _without_null_checks(source: str) -> str:
    """Returns generated C that takes every argument and result for given, as the C layer always does.

    CasADi lets a caller leave out an argument (then zero) or a result, and asks at each element: an eighth
    of the time of a step.
    """
    source = re.sub(r"=arg\[(\d+)\]\? arg\[\1\]\[(\d+)\] : 0;", r"=arg[\1][\2];", source)
    return re.sub(r"if \(res\[(\d+)\]!=0\) res\[\1\]", r"res[\1]", source)


def scene_header(
    model: Equations,
    entries: Sequence[TableEntry],
    functions: Iterable[ca.Function],
    loop: Tables | None,
) -> str:
    """Returns scene.h: counts, places and limits of the scene.

    functions : those of model.c
    loop      : tables of the composite's loop
    """
    scene, where = model.resolved.scene, model.slices.composite
    references = {entry.variable.name: entry.reference for entry in entries}
    p_count, k_count, u_count = len(model.names.p), len(model.names.k), len(model.names.u)
    sizes = [(f.sz_arg(), f.sz_res(), f.sz_iw(), f.sz_w()) for f in functions]
    arg, res, iw, w = (max(1, *column) for column in zip(*sizes, strict=True))
    begun = [f for f in model.steps.propagation if f.name() == "free_start"]
    constants = {
        "VARIABLE_COUNT": len(entries),
        "INPUT_P_COUNT": p_count,
        "INPUT_K_COUNT": k_count,
        "INPUT_U_COUNT": u_count,
        "REFERENCE_TIME": 0,
        "REFERENCE_P": 1,
        "REFERENCE_CONTACT": 1 + p_count,
        "REFERENCE_TORQUE": 1 + p_count + k_count,
        "REFERENCE_RATE_START": references["angular_velocity_start[1]"],
        "REFERENCE_ATTITUDE_START": references["attitude_start[1]"],
        "REFERENCE_OUTPUTS": 1 + p_count + k_count + u_count + 7,
        "OUTPUT_COUNT": len(model.names.y),
        "REFERENCE_STATES": references["state.attitude[1]"],
        "REFERENCE_DERIVATIVES": references["der(state.attitude[1])"],
        "STATE_COUNT": len(model.names.z),
        "COMPOSITE_COUNT": model.composite.numel_out(0),
        "AXES_FREE": model.slices.axes.get("free", slice(0)).start or 0,
        "AXES_SERIES": model.slices.axes.get("series", slice(0)).start or 0,
        "FREE_VARYING": begun[0].numel_out(0) if begun else 0,
        "FREE_CONSTANT": begun[0].numel_out(1) if begun else 0,
        "FREE_START": CONSTANTS,
        "COMPOSITE_MASS": where["mass"].start,
        "COMPOSITE_INERTIA": where["inertia"].start,
        "COMPOSITE_MARGINS": where["margins"].start,
        "COMPOSITE_LAW": where["law"].start,
        "LAW_TURNS": int(scene.rotation.law != "none"),
        "TRIANGLE_JUDGED": int(scene.convention == "rigid_body"),
        "WORK_ARG": arg,
        "WORK_RES": res,
        "WORK_INT": iw,
        "WORK_REAL": w + (loop.work if loop else 0),
    }
    plan = model.plan
    macros = {
        "AXES_COUNT": model.axes.numel_out(0),
        **change_constants(model),
        **loop_constants(loop),
        "STEPS": f"STEPS_BY_{plan.method.control.upper()}" if plan.method else "STEPS_NONE",
        "FREE": f"FREE_{plan.free.upper().replace(' ', '_')}",
        "ERROR_EXPONENT": model.steps.error_exponent,
        "SAFETY": repr(plan.method.safety if plan.method else 1.0),
        "PRODUCT_COUNT": model.product_count,
        "TOLERANCE": repr(scene.rotation.tolerance),
        "MAX_ANGLE_STEP": f"{scene.rotation.max_angle_step!r} /* largest angle of a sub-step [rad] */",
        "FIRST_ANGLE": f"{FIRST_ANGLE!r} /* up to which free motion is a series [rad] */",
        "LARGEST_TURN": f"{LARGEST_TURN!r} /* up to which free motion is followed [rad] */",
    }
    return (
        "/* Generated: what the C layer must know of the scene. */\n"
        "#ifndef SCENE_H\n#define SCENE_H\n\n"
        f"enum {{\n{_lines('    {} = {},', constants)}\n}};\n\n"
        "/* What bounds a step, and when free motion is used. */\n"
        f"{_lines('#define {} {}', CHOICES)}\n\n"
        f"{_lines('#define {} {}', macros)}\n\n"
        "#endif\n"
    )


def _lines(form: str, values: Mapping[str, object]) -> str:
    return "\n".join(form.format(name, value) for name, value in values.items())


def scene_source(entries: Sequence[TableEntry], token: str, changing: bool) -> str:
    """Returns scene.c: the variable table with start values, and the token.

    changing : whether a change of inputs makes the states other ones
    """
    needs = {entry.reference: _needs(entry, changing) for entry in entries}
    typed = any(entry.variable.boolean for entry in entries)
    rows = "\n".join(f"    {_row(entry, needs, typed)}," for entry in entries)
    checks = [(entry.reference, check) for entry in entries if (check := _check(entry)) != "CHECK_NONE"]
    judged = "\n".join(f"    {{{reference}, {check}}}," for reference, check in [*checks, (0, "CHECK_NONE")])
    return (
        "/* Generated: the scene's variables, by value reference. */\n"
        '#include "changes.h"\n\n'
        f"const Variable VARIABLES[VARIABLE_COUNT] = {{\n{rows}\n}};\n\n"
        f"const Judged JUDGED[] = {{\n{judged}\n}};\n\n"
        f'const char MODEL_TOKEN[] = "{token}";\n'
    )


def _needs(entry: TableEntry, changing: bool) -> frozenset[str]:
    """Returns what must be current before that which follows from a variable can be read."""
    if entry.role == "state" and "attitude" in entry.variable.name:
        return frozenset({"STATES", "ATTITUDE"})
    if entry.role == "state":
        return frozenset({"STATES", "COMPOSITE"} if changing else {"STATES"})
    if isinstance(entry.variable, InputVariable) and entry.variable.part == "shape":
        return frozenset({"COMPOSITE"})
    return frozenset()


def _shows_axes(variable: Variable) -> bool:
    """Whether a variable shows principal moments or axes."""
    return isinstance(variable, OutputVariable) and variable.kind.axes


def _row(entry: TableEntry, needs: Mapping[int, frozenset[str]], typed: bool) -> str:
    """Returns a row of the table.

    needs : those of all variables by reference
    typed : whether there are variables of more than one type
    """
    variable = entry.variable
    own = {
        "output": frozenset({"OUTPUTS", "AXES"} if _shows_axes(variable) else {"OUTPUTS"}),
        "derivative": frozenset({"RATES"}),
        "state": needs[entry.reference],
    }
    flags = sorted(own.get(entry.role, frozenset()).union(*(needs[d.reference] for d in entry.dependencies)))
    fields = [
        f'"{variable.name}"',
        f'"{variable.unit}"',
        repr(variable.start or 0.0),
        repr(variable.nominal),
        f"ROLE_{entry.role.upper()}",
        " | ".join(f"FOLLOWS_{flag}" for flag in flags) or "0",
    ]
    if typed:
        fields.append("TYPE_BOOLEAN" if variable.boolean else "TYPE_NUMBER")
    return "{" + ", ".join(fields) + "}"


def _check(entry: TableEntry) -> str:
    """Returns which check stands at a variable: at the first of those that are judged together."""
    variable = entry.variable
    if isinstance(variable, InputVariable) and variable.element == 0 and variable.kind.judge:
        return f"CHECK_{variable.kind.judge}"
    return "CHECK_NONE"


def digest(*texts: str | bytes) -> str:
    """Returns a token for these texts: it changes exactly when one of them does."""
    together = hashlib.sha256()
    for text in texts:
        raw = text.encode() if isinstance(text, str) else text
        together.update(len(raw).to_bytes(8, "little") + raw)
    return "{" + together.hexdigest() + "}"
