"""lane_kernels.h: C functions that take the steps of a composite's loop for several vessels at once.

A lane is the part of a vector register that holds the number of one vessel; see fmu_build/c/lanes.h.
"""

import casadi as ca

from supervessel.composite.chain import lane_kernels
from supervessel.scene.schema import Scene

OPERATIONS = {
    ca.OP_ADD: "{} + {}",
    ca.OP_SUB: "{} - {}",
    ca.OP_MUL: "{} * {}",
    ca.OP_DIV: "{} / {}",
    ca.OP_NEG: "-{}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "{0} + {0}",
    ca.OP_SQRT: "lanes_sqrt({})",
    ca.OP_FABS: "lanes_fabs({})",
}
"""By CasADi's code of an operation, its C on numbers of type Lanes: all operations that the steps contain."""


def loop_steps(scene: Scene) -> str:
    """Returns lane_kernels.h of a scene whose composite is a loop."""
    return (
        "/* Generated: steps for several vessels at once; see supervessel/composite/chain.py. */\n"
        '#include "lanes.h"\n\n' + "\n".join(map(_lane_code, lane_kernels(scene)))
    )


def _lane_code(function: ca.Function) -> str:
    """Returns C of a function without branches or loops: its operations in CasADi's order."""
    lines = []
    for number in range(function.n_instructions()):
        kind, to = function.instruction_id(number), function.instruction_output(number)
        of = function.instruction_input(number)
        if kind == ca.OP_OUTPUT:
            lines.append(f"res[{to[1]}] = w{of[0]};")
        elif kind == ca.OP_INPUT:
            lines.append(f"w{to[0]} = arg[{of[0]}][{of[1]}];")
        elif kind == ca.OP_CONST:
            lines.append(f"w{to[0]} = lanes_all({function.instruction_constant(number)!r});")
        else:
            lines.append(f"w{to[0]} = {OPERATIONS[kind].format(*(f'w{i}' for i in of))};")
    work = ", ".join(f"w{i}" for i in range(function.sz_w()))
    body = "\n".join(f"    {line}" for line in [f"Lanes {work};", *lines])
    return (
        f"LANES_INLINE void lanes_{function.name()}(const Lanes *const arg[], Lanes res[]) {{\n{body}\n}}\n"
    )
