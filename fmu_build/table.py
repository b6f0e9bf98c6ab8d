"""The FMU's variable table: the model's variables in order, with value references and dependencies.

The modelDescription.xml and the C layer are both written from it.
"""

from dataclasses import dataclass
from typing import Literal

import casadi as ca
import numpy as np

from supervessel.equations import Equations
from supervessel.scene import Scene
from supervessel.variables import Variable, input_variables, output_variables, parameter_variables

Causality = Literal["independent", "input", "parameter", "output"]


@dataclass(frozen=True)
class Entry:
    """A variable of the FMU.

    reference            : value reference, the variable's place in the table
    dependencies         : references of the inputs that the output depends on, at a communication point
    initial_dependencies : those of the inputs and start parameters that it depends on at the start
    """

    variable: Variable
    reference: int
    causality: Causality
    dependencies: tuple[int, ...] = ()
    initial_dependencies: tuple[int, ...] = ()


TIME = Variable("time", "s", "simulation time")


def variable_table(scene: Scene, model: Equations) -> tuple[Entry, ...]:
    """Returns the FMU's variables: time, inputs (p, then torque), start parameters, outputs."""
    inputs, parameters = input_variables(scene), parameter_variables(scene)
    first_parameter = 1 + len(inputs)
    first_output = first_parameter + len(parameters)
    entries = [Entry(TIME, 0, "independent")]
    entries += [Entry(v, i, "input") for i, v in enumerate(inputs, start=1)]
    entries += [Entry(v, i, "parameter") for i, v in enumerate(parameters, start=first_parameter)]
    by_state, by_input = _sparsity(model)
    rates, attitude = range(first_parameter, first_parameter + 3), range(first_parameter + 3, first_output)
    for row, variable in enumerate(output_variables(scene)):
        now = tuple(int(column) + 1 for column in np.flatnonzero(by_input[row]))
        start = set(now)
        if by_state[row, :4].any():
            start |= set(attitude)
        start |= {rates[i] for i in range(3) if by_state[row, 4 + i]}
        entries.append(Entry(variable, first_output + row, "output", now, tuple(sorted(start))))
    return tuple(entries)


def _sparsity(model: Equations) -> tuple[np.ndarray, np.ndarray]:
    """Returns which outputs depend on which states, (ny, 7), and on which inputs (p, u), (ny, np + nu)."""
    p, u, x = (ca.SX.sym(*s) for s in (("p", len(model.p_names)), ("u", len(model.u_names)), ("x", 7)))
    y = model.outputs(x, u, model.composite(p))
    by_state = np.array(ca.DM(ca.jacobian_sparsity(y, x), 1.0)) != 0.0
    by_input = np.array(ca.DM(ca.jacobian_sparsity(y, ca.vertcat(p, u)), 1.0)) != 0.0
    return by_state.reshape(y.numel(), 7), by_input.reshape(y.numel(), p.numel() + u.numel())
