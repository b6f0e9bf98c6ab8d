"""Names of variables as an FMU has them: structured, as scene and twin have them, or flat.

Structured names are hierarchical, "DG.nose.position[1]": some importers make buses of them, and their commas
break others' tables. Flat names are one word each, "DG_nose_position_1".
"""

import re
from typing import TYPE_CHECKING, Literal, get_args

from fmu_build.errors import BuildError

if TYPE_CHECKING:  # the command line needs the names alone, at once
    from supervessel.composite.resolved import ResolvedScene

Naming = Literal["structured", "flat"]
NAMINGS: tuple[Naming, ...] = get_args(Naming)
"""The values of FMI's attribute variableNamingConvention; scene and twin have the first."""

TIME = "time"
"""The name of the independent variable."""

INDEX_MARKS: dict[Naming, str] = {"structured": "[", "flat": "_"}
"""The character before an element's index, the last of its kind in a name."""


def check_naming(naming: str) -> None:
    """Raises ValueError for a text that is none of NAMINGS."""
    if naming not in NAMINGS:
        raise ValueError(f"names = {naming!r}: must be {' or '.join(map(repr, NAMINGS))}")


def flat(name: str) -> str:
    """Returns the flat name of a variable: letters, digits and underscores.

    Example:
        >>> flat("DG.nose.position[1]"), flat("inertia[1,2]"), flat("der(state.attitude[4])")
        ('DG_nose_position_1', 'inertia_12', 'der_state_attitude_4')
    """
    return re.sub(r"[.\[(]", "_", re.sub(r"[\]),]", "", name))


def check_names(resolved: "ResolvedScene", naming: Naming) -> None:
    """Raises BuildError where an FMU's name would stand for two variables, both told."""
    variables = (
        *resolved.inputs,
        *resolved.parameters,
        *resolved.outputs,
        *resolved.states,
        *resolved.derivatives,
    )
    first = {TIME: TIME}
    problems = []
    for name in (variable.name for variable in variables) if naming == "flat" else ():
        other = first.setdefault(flat(name), name)
        if other != name:
            problems.append(f"{other} and {name} would both be {flat(name)}; rename a part of one of them")
    if problems:
        scene = resolved.scene.name
        raise BuildError("\n".join(f"{scene}: flat names: {problem}" for problem in problems))
