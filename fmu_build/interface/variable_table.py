"""The FMU's variable table: the model's variables in order, with value references and dependencies.

The modelDescription.xml and the C layer are both written from it.
"""

from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import casadi as ca

from fmu_build.generate.vessel_loop import LONGEST_CODE
from fmu_build.interface import names as fmu_names
from fmu_build.interface.names import Naming, check_names, flat
from fmu_build.interface.nominals import magnitudes_at_start, nominal_of
from supervessel.composite.start import p_start
from supervessel.equations import Equations
from supervessel.scene.schema import keeps_momentum
from supervessel.scene.variables import Variable

Role = Literal["time", "input", "parameter", "output", "state", "derivative"]
Kind = Literal["constant", "dependent"]


@dataclass(frozen=True)
class Dependency:
    """A dependency of a variable on another one.

    reference : value reference of the other variable
    kind      : "constant" if the variable is linear in it with a fixed factor, else "dependent"
    """

    reference: int
    kind: Kind


@dataclass(frozen=True)
class TableEntry:
    """A variable of the FMU.

    variable     : unit, start value and the like, and the name that scene and twin have for it
    reference    : value reference, the variable's place in the table
    role         : time, input, parameter, output, state or derivative
    nominal      : its magnitude, for an importer's solver
    dependencies : inputs and states that an output or a derivative depends on
    initial      : inputs and start parameters that an output, a state or a derivative depends on at the start
    naming       : of the whole table
    """

    variable: Variable
    reference: int
    role: Role
    nominal: float = 1.0
    dependencies: tuple[Dependency, ...] = ()
    initial: tuple[Dependency, ...] = ()
    naming: Naming = "structured"

    @property
    def name(self) -> str:
        """The variable's name in the FMU: what stands in its files and its messages."""
        return flat(self.variable.name) if self.naming == "flat" else self.variable.name


Rows = dict[Role, list[tuple[Dependency, ...]]]
"""By role, the dependencies of each variable of that role."""

TIME = Variable(fmu_names.TIME, "s", "simulation time")


def variable_table(model: Equations, naming: Naming = "structured") -> tuple[TableEntry, ...]:
    """Returns the variables: time, inputs (p, then torque), start parameters, outputs, states, rates.

    naming : of the FMU's names
    Raises BuildError where two variables would have one name.
    """
    resolved = model.resolved
    check_names(resolved, naming)
    groups: dict[Role, Sequence[Variable]] = {
        "time": (TIME,),
        "input": resolved.inputs,
        "parameter": resolved.parameters,
        "output": resolved.outputs,
        "state": _with_starts(model),
        "derivative": resolved.derivatives,
    }
    first = _first_references(groups)
    inputs = list(enumerate(resolved.inputs, start=first["input"]))
    states = range(first["state"], first["state"] + len(resolved.states))
    knowns = [*states, *(reference for reference, _ in inputs)]
    booleans = frozenset(reference for reference, variable in inputs if variable.boolean)
    by_role, at_start = _dependencies(model, knowns, booleans)
    whole = magnitudes_at_start(resolved.scene)
    entries = []
    for role, variables in groups.items():
        for i, variable in enumerate(variables):
            now = by_role[role][i] if role in by_role else ()
            start = at_start[role][i] if role in at_start else ()
            initial = _at_start(start, states, first["parameter"])
            nominal = nominal_of(variable, whole)
            entries.append(TableEntry(variable, first[role] + i, role, nominal, now, initial, naming))
    return tuple(entries)


def _with_starts(model: Equations) -> list[Variable]:
    """Returns the states with the values that the scene's own start makes of them.

    The FMU computes them at initialisation. Importers that set up a problem of their own, as CasADi's does,
    begin from them: without them from a quaternion of zeros.
    """
    scene = model.resolved.scene
    rotation, momenta = scene.rotation, [scene.wheel(name).momentum for name in scene.wheels]
    kept = ca.DM(rotation.angular_velocity)
    if keeps_momentum(scene):
        assert model.change is not None
        kept = model.change.momentum_of(ca.vertcat(kept, *momenta), model.composite(p_start(scene)))
    starts = (*rotation.attitude, *kept.elements(), *momenta)
    return [replace(state, start=value) for state, value in zip(model.resolved.states, starts, strict=True)]


def _first_references(groups: Mapping[Role, Sequence[Variable]]) -> dict[Role, int]:
    """Returns the value reference of each role's first variable; references count from 0, role by role."""
    first: dict[Role, int] = {}
    count = 0
    for role, variables in groups.items():
        first[role] = count
        count += len(variables)
    return first


def _dependencies(model: Equations, knowns: Sequence[int], booleans: Set[int]) -> tuple[Rows, Rows]:
    """Returns what outputs and derivatives depend on in flight, and what they and the states do at the start.

    In flight they depend on states and inputs; events count too, with the motion of parts that dock. At the
    start attitude and angular velocity are given in place of the states, and the states depend on these and
    on inputs.

    knowns   : value references of states and inputs (p, k, u)
    booleans : the value references among them that are Booleans
    """
    names = model.names
    sizes = (("p", len(names.p)), ("k", len(names.k)), ("u", len(names.u)), ("z", len(names.z)))
    p, k, u, z = (ca.SX.sym(*size) for size in sizes)
    c = model.composite(p)
    # principal moments and axes follow from every element of the inertia, and not linearly
    a = ca.repmat(ca.sumsqr(c[model.slices.composite["inertia"]]), model.axes.numel_out(0))
    known = ca.vertcat(z, p, k, u)
    rows_of = _rows if model.composite.n_instructions() <= LONGEST_CODE else _rows_by_structure

    def rows(unknowns: Mapping[Role, ca.SX]) -> Rows:
        return {role: rows_of(unknown, known, knowns, booleans) for role, unknown in unknowns.items()}

    follows = _after_change(model, z, (p, k), c)
    now = rows(
        {
            "output": model.exchange.outputs(follows, u, c, a, 0.0) + _handed_over(model, z, (p, k), c),
            "derivative": model.exchange.ode(follows, u, c),
        }
    )
    if model.change is None:
        return now, now | rows({"state": z})
    by_momentum = keeps_momentum(model.resolved.scene)
    begun = ca.vertcat(z[:4], model.change.momentum_of(z[4:], c), z[7:]) if by_momentum else z
    rate = ca.vertcat(model.ode(z, u, c)[:4], model.exchange.ode(begun, u, c)[4:])
    return now, rows({"output": model.outputs(z, u, c, a, 0.0), "derivative": rate, "state": begun})


def _after_change(model: Equations, z: ca.SX, inputs: tuple[ca.SX, ca.SX], c: ca.SX) -> ca.SX:
    """Returns an expression whose structure shows what the states depend on after a change of inputs, as z.

    inputs : p and k
    Only its structure has a meaning. An angular momentum is kept when a mass or a pose changes. An angular
    velocity jumps then by an amount that depends on the inputs before and after. When a dock opens or
    closes, both jump, by what all inputs of the composite and the motion at contact make of them. The jump is
    scaled by a symbol of its own: CasADi would see what it has in common with what it is added to, and take
    that off.
    """
    change, scene, (p, k) = model.change, model.resolved.scene, inputs
    if change is None:
        return z
    by_momentum = keeps_momentum(scene)
    kept, jump = ca.SX.sym("kept", z.numel() - 4), ca.SX.zeros(3)
    if "momentum" in scene.keeps.values() and not by_momentum:
        jump += change.keep_momentum(kept, ca.SX.sym("before", c.numel()), c)
    if scene.inputs.docked:
        docked = change.docked_rate(kept, change.contact_momentum(p, k), c)
        jump += change.momentum_of(ca.vertcat(docked, kept[3:]), c) if by_momentum else docked
        shaping = zip(model.resolved.shaping, ca.vertsplit(p), strict=True)
        jump += sum((flag for variable, flag in shaping if variable.boolean), ca.SX(0))
    return ca.vertcat(z[:4], z[4:7] + ca.SX.sym("scale") * jump, z[7:])


def _handed_over(model: Equations, z: ca.SX, inputs: tuple[ca.SX, ca.SX], c: ca.SX) -> ca.SX:
    """Returns an expression, as y, whose structure shows what a change of inputs hands over depends on.

    inputs : p and k
    """
    handed, added, (p, k) = model.hand_over, ca.SX(len(model.names.y), 1), inputs
    if handed is None:
        return added
    before, scale = ca.SX.sym("before", c.numel()), ca.SX.sym("scale", len(model.names.z))
    x = scale * z
    velocity = ca.SX.zeros(3) if handed.contact_velocity is None else handed.contact_velocity(p, k)
    found = handed.handed_over(x, x[4:], before, c, c, c, velocity)
    for group, place in handed.slices.items():
        if group in model.resolved.scene.outputs.names:
            first = model.names.y.index(f"{group}[1]")
            added[first : first + place.stop - place.start] = scale[0] * found[place]
    return added


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


def _rows_by_structure(
    unknown: ca.SX, known: ca.SX, knowns: Sequence[int], booleans: Set[int]
) -> list[tuple[Dependency, ...]]:
    """Returns dependencies, row by row, none of which is said to be constant.

    For composites so long that their Jacobian would take more than all the rest of a build.
    """
    sparsity = ca.jacobian_sparsity(unknown, known).T  # of a sparsity all of a column stands together
    dependent = [Dependency(reference, "dependent") for reference in knowns]
    order = sorted(range(len(knowns)), key=knowns.__getitem__)
    columns, ends = sparsity.row(), sparsity.colind()
    rows = []
    for begin, end in pairwise(ends):
        held = set(columns[begin:end])
        rows.append(tuple(dependent[column] for column in order if column in held))
    return rows


def _at_start(now: Iterable[Dependency], states: range, first_parameter: int) -> tuple[Dependency, ...]:
    """Returns dependencies with the states replaced by the start parameters that they follow from.

    states : their value references
    The attitude follows from all four of attitude_start, which are normalised, each other one from its own.
    """
    attitude = range(first_parameter + 3, first_parameter + 7)
    own = (
        *range(first_parameter, first_parameter + 3),
        *range(attitude.stop, attitude.stop + len(states) - 7),
    )
    parameters: dict[int, Dependency] = {}
    others = []
    for dependency in now:
        if dependency.reference not in states:
            others.append(dependency)
        elif dependency.reference < states[4]:
            parameters |= {reference: Dependency(reference, "dependent") for reference in attitude}
        else:
            parameter = own[dependency.reference - states[4]]
            parameters[parameter] = Dependency(parameter, dependency.kind)
    return tuple(sorted([*others, *parameters.values()], key=lambda dependency: dependency.reference))
