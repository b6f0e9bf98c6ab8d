"""Directional derivatives of CasADi expressions, forward and reverse, as functions.

Forward derivatives take a small change (seed) of each argument to the change of each result, J dv; reverse
derivatives take a weight of each result to the weight of each argument, J^T w; J is the Jacobian matrix.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

from supervessel.layout import split


@dataclass(frozen=True)
class GivenDerivative:
    """A quantity whose derivative is given in closed form, so that CasADi need not differentiate it.

    value    : symbols of the quantity, (n,); it depends on the last argument of the results alone
    small    : symbols of a small change of that argument, (m,)
    response : the change of the quantity, (n,), by that small change; an expression linear in `small`
    """

    value: ca.SX
    small: ca.SX
    response: ca.SX


def derivatives(
    name: str, arguments: Sequence[ca.SX], results: Sequence[ca.SX], given: GivenDerivative | None = None
) -> tuple[ca.Function, ca.Function]:
    """Returns the functions NAME_forward and NAME_reverse.

    NAME_forward : arguments, then a small change of each -> the change of each result
    NAME_reverse : arguments, then a weight of each result -> the weight of each argument
    given        : a quantity in the results whose derivative is given; its value is one more argument of both
                   functions, after the others, and has no change or weight of its own
    """
    together, changed = ca.vertcat(*arguments), ca.vertcat(*results)
    seeds = [ca.SX.sym(f"d{i}", argument.numel()) for i, argument in enumerate(arguments)]
    weights = [ca.SX.sym(f"w{i}", result.numel()) for i, result in enumerate(results)]
    forward = ca.jtimes(changed, together, ca.vertcat(*seeds))
    reverse = ca.jtimes(changed, together, ca.vertcat(*weights), True)
    known = list(arguments)
    if given is not None:
        known.append(given.value)
        forward += _forward_through(given, changed, seeds[-1])
        others = together.numel() - arguments[-1].numel()
        reverse += ca.vertcat(ca.SX.zeros(others), _reverse_through(given, changed, ca.vertcat(*weights)))
    forward, reverse = ca.densify(forward), ca.densify(reverse)
    return (
        ca.Function(f"{name}_forward", known + seeds, split(forward, results)),
        ca.Function(f"{name}_reverse", known + weights, split(reverse, arguments)),
    )


def named_function(name: str, arguments: Mapping[str, ca.SX], result: ca.SX) -> ca.Function:
    """Returns a function of arguments with names, and of one result, dense."""
    return ca.Function(name, list(arguments.values()), [ca.densify(result)], list(arguments), ["result"])


def derivatives_of(function: ca.Function) -> tuple[ca.Function, ca.Function]:
    """Returns the derivatives of a function of one result, see `derivatives`."""
    arguments = [ca.SX.sym(f"v{i}", function.numel_in(i)) for i in range(function.n_in())]
    return derivatives(function.name(), arguments, [function(*arguments)])


def _forward_through(given: GivenDerivative, changed: ca.SX, seed: ca.SX) -> ca.SX:
    """Returns the change of the results that reaches them through the given quantity."""
    return ca.jtimes(changed, given.value, ca.substitute(given.response, given.small, seed))


def _reverse_through(given: GivenDerivative, changed: ca.SX, weights: ca.SX) -> ca.SX:
    """Returns the weight of the last argument that comes from the results through the given quantity."""
    weight_of_value = ca.jtimes(changed, given.value, weights, True)
    return ca.jtimes(given.response, given.small, weight_of_value, True)
