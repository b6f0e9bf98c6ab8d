"""The FMU's variable table: the model's variables in order, with value references and dependencies.

The modelDescription.xml and the C layer are both written from it.
"""

from collections.abc import Iterable, Sequence, Set
from dataclasses import dataclass
from typing import Literal

import casadi as ca

from supervessel.equations import Equations, composite_slices
from supervessel.scene import Scene
from supervessel.variables import (
    Variable,
    derivative_variables,
    input_variables,
    output_variables,
    parameter_variables,
    state_variables,
)

Role = Literal["time", "input", "parameter", "output", "state", "derivative"]
Kind = Literal["constant", "dependent"]


@dataclass(frozen=True)
class Dependency:
    """What a variable depends on: a value reference, and how; "constant" is linear with a fixed factor."""

    reference: int
    kind: Kind


@dataclass(frozen=True)
class Entry:
    """A variable of the FMU.

    reference    : value reference, the variable's place in the table
    dependencies : inputs and states that an output or a derivative depends on
    initial      : inputs and start parameters that an output, a state or a derivative depends on at the start
    """

    variable: Variable
    reference: int
    role: Role
    dependencies: tuple[Dependency, ...] = ()
    initial: tuple[Dependency, ...] = ()


TIME = Variable("time", "s", "simulation time")


def variable_table(scene: Scene, model: Equations) -> tuple[Entry, ...]:
    """Returns the variables: time, inputs (p, then torque), start parameters, outputs, states, rates."""
    groups: dict[Role, Sequence[Variable]] = {
        "time": (TIME,),
        "input": input_variables(scene),
        "parameter": parameter_variables(scene),
        "output": output_variables(scene),
        "state": state_variables(scene),
        "derivative": derivative_variables(scene),
    }
    first: dict[Role, int] = {}
    count = 0
    for role, variables in groups.items():
        first[role] = count
        count += len(variables)
    knowns = [*range(first["state"], first["state"] + 7)]
    inputs = list(enumerate(input_variables(scene), start=first["input"]))
    knowns += [reference for reference, variable in inputs if variable.part != "contact"]
    booleans = frozenset(reference for reference, variable in inputs if variable.boolean)
    by_role = _dependencies(model, knowns, booleans)
    entries = []
    for role, variables in groups.items():
        for i, variable in enumerate(variables):
            now = by_role[role][i] if role in ("output", "derivative") else ()
            start = now
            if role == "state":
                start = (Dependency(first["state"] + i, "constant"),)
            initial = _at_start(start, first["state"], first["parameter"])
            entries.append(Entry(variable, first[role] + i, role, now, initial))
    return tuple(entries)


def _dependencies(
    model: Equations, knowns: Sequence[int], booleans: Set[int]
) -> dict[Role, list[tuple[Dependency, ...]]]:
    """Returns the dependencies of each output and each derivative on states and inputs.

    knowns   : value references of states and inputs (p, u); what a part docks with acts at that instant alone
    booleans : those of Booleans among them
    """
    p, u, x = (ca.SX.sym(*s) for s in (("p", len(model.p_names)), ("u", len(model.u_names)), ("x", 7)))
    c = model.composite(p)
    # principal moments and axes follow from every element of the inertia, and not linearly
    a = ca.repmat(ca.sumsqr(c[composite_slices()["inertia"]]), model.axes.numel_out(0))
    known = ca.vertcat(x, p, u)
    y = model.outputs(x, u, c, a, 0.0)
    unknowns: dict[Role, ca.SX] = {"output": y, "derivative": model.ode(x, u, c)}
    return {role: _rows(unknown, known, knowns, booleans) for role, unknown in unknowns.items()}


def _rows(
    unknown: ca.SX, known: ca.SX, knowns: Sequence[int], booleans: Set[int]
) -> list[tuple[Dependency, ...]]:
    """Returns the dependencies that the structure of a Jacobian shows, row by row.

    A choice by a Boolean has no derivative: there it is the structure of the expression that counts.
    """
    jacobian = ca.jacobian(unknown, known)
    rows: list[list[Dependency]] = [[] for _ in range(jacobian.size1())]
    for row, column in zip(*ca.jacobian_sparsity(unknown, known).get_triplet(), strict=True):
        element = jacobian[row, column]
        if knowns[column] in booleans:
            rows[row].append(Dependency(knowns[column], "dependent"))
        elif not element.is_zero():
            rows[row].append(Dependency(knowns[column], "constant" if element.is_constant() else "dependent"))
    return [tuple(sorted(row, key=lambda d: d.reference)) for row in rows]


def _at_start(now: Iterable[Dependency], first_state: int, first_parameter: int) -> tuple[Dependency, ...]:
    """Returns dependencies with the states replaced by the start parameters that they follow from.

    The attitude follows from all four of attitude_start, which are normalised, the rate from its own element.
    """
    rates, attitude = (
        range(first_parameter, first_parameter + 3),
        range(first_parameter + 3, first_parameter + 7),
    )
    found: dict[int, Kind] = {}
    for dependency in now:
        state = dependency.reference - first_state
        if not 0 <= state < 7:
            found[dependency.reference] = dependency.kind
        elif state < 4:
            found |= dict.fromkeys(attitude, "dependent")
        else:
            found[rates[state - 4]] = dependency.kind
    return tuple(Dependency(reference, found[reference]) for reference in sorted(found))
