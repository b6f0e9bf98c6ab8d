"""The composite for a scene's own values of the inputs: what the FMU starts with."""

from math import frexp, ldexp

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from supervessel.composite.parts import composite_graph
from supervessel.composite.resolved import resolve
from supervessel.scene.schema import Scene
from supervessel.shell.interrupts import interrupt_afterwards
from supervessel.simplification import simplification

LONGEST_EXPONENT = 200
"""Largest size of the binary exponent of a direction that p_start leaves as it is: the fourth power of its
length neither under- nor overflows."""


def p_start(scene: Scene) -> NDArray[np.float64]:
    """Returns the scene's values of p, (n,), each in the unit of its input.

    A direction beyond LONGEST_EXPONENT is scaled by a power of two, as the FMU does: its length has no
    meaning.
    """
    values = []
    for variable in resolve(scene).shaping:
        start = variable.start
        if variable.kind.directed:
            _, exponent = frexp(max(map(abs, variable.kind.start(scene, variable.owner))))
            start = ldexp(start, -exponent) if abs(exponent) > LONGEST_EXPONENT else start
        values.append(start)
    return np.array(values)


@interrupt_afterwards()
@simplification(True)
def composite_at_start(scene: Scene) -> dict[str, NDArray[np.float64]]:
    """Returns the parts of c by name, (n,) each, for the scene's own values of the inputs.

    Units and axes are those of `parts.composite_parts`.
    """
    graph = composite_graph(resolve(scene))
    values = np.array(ca.Function("composite", [graph.p], [graph.c])(p_start(scene))).ravel()
    return {name: values[place] for name, place in graph.slices.items()}
