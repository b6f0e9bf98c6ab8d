"""Scenes whose FMUs give partial derivatives, their Jacobians by the FMU, and by the twin."""

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
import pytest

from supervessel import Twin
from support import EPS, ISS_DG, OK, STEADY, TURNING, Instance, body, scene, variant

SEED = 20240609

RAW = variant(ISS_DG, {"name": "derived", "rotation": TURNING | STEADY})
CHAIN: dict[str, Any] = {
    "name": "chain",
    "root": "A",
    "vessels": {
        "A": {
            "mass": 9000.0,
            "inertia": [[2e4, 1e3, -5e2], [1e3, 3e4, 2e3], [-5e2, 2e3, 2.5e4]],
            "centre_of_mass": [0.1, -0.2, 0.3],
            "ports": {
                "one": {"position": [1.0, 0.5, -0.2], "direction": [1.0, 0, 0], "alignment": [0, 1.0, 0]},
                "two": {"position": [-2.0, 0.1, 0.2], "direction": [0, 0, -1.0], "alignment": [1.0, 0, 0]},
            },
        },
        "B": {
            "mass": 3000.0,
            "pmi": [1.0, 1.5, 2.0],
            "ports": {
                "aft": {"position": [0, 0, 1.5], "direction": [0, 0, 1.0], "alignment": [0, 1.0, 0]},
                "fore": {"position": [0, 0.2, -1.5], "direction": [0, 0, -1.0], "alignment": [0, 1.0, 0]},
            },
        },
        "C": {
            "mass": 500.0,
            "pmi": [0.3, 0.4, 0.5],
            "ports": {"aft": {"position": [0, 0, 0.5], "direction": [0, 0, 1.0], "alignment": [0, 1.0, 0]}},
        },
        "D": {
            "mass": 0.0,
            "pmi": [0.3, 0.4, 0.5],
            "ports": {"aft": {"position": [0, 0.3, 0.5], "direction": [0, 0, 1.0], "alignment": [0, 1.0, 0]}},
        },
    },
    "docks": [{"ports": ["A.one", "B.aft"]}, {"ports": ["C.aft", "B.fore"]}, {"ports": ["A.two", "D.aft"]}],
    "inputs": {"mass": ["A", "C", "D"], "pmi": ["B"], "pose": ["A.one", "B.fore", "C.aft"], "torque": True},
    "rotation": TURNING | STEADY,
    "outputs": ISS_DG["outputs"],
}
SCENES: dict[str, dict[str, Any]] = {
    "tensor": RAW,
    "chain": CHAIN,
    "principal": variant(RAW, {"name": "principal", "rotation.law": "principal"}),
    "decoupled": variant(RAW, {"name": "decoupled", "rotation.law": "decoupled"}),
    "none": variant(RAW, {"name": "held", "rotation.law": "none"}),
    "without inputs": {**body(**TURNING), "name": "constant", "inputs": {}},
}
NAME = pytest.mark.parametrize("name", SCENES)


@cache
def twin(name: str) -> Twin:
    return Twin(scene(SCENES[name]))


def knowns(name: str) -> list[str]:
    """Returns the inputs and states of a scene in the order of their value references."""
    return [*twin(name).p_names, *twin(name).u_names, *twin(name).x_names]


def unknowns(name: str) -> list[str]:
    """Returns the outputs and rates of a scene."""
    return [*twin(name).y_names, *(f"der({state})" for state in twin(name).x_names)]


def values(name: str, point: str, seed: int = SEED) -> np.ndarray:
    """Returns values of the knowns: those of the scene, or where something is zero, or drawn ones."""
    generator, sizes = np.random.default_rng(seed), [len(twin(name).p_names), len(twin(name).u_names)]
    p, u, x = np.array(twin(name).p_start), np.zeros(sizes[1]), np.array(twin(name).x_start)
    if point == "at rest":
        x = np.array([1.0, 0, 0, 0, 0, 0, 0])
    if point == "empty":
        p[[k.endswith(".mass") and k != "A.mass" for k in twin(name).p_names]] = 0.0
        u[:1] = 1e3
    if point == "on an axis":
        x = np.array([0, 0, 1.0, 0, 0, 0.1, 0])
        u[1:2] = 1e3
    if point == "drawn":
        p *= generator.uniform(0.9, 1.1, len(p))
        p += np.where(p == 0, generator.normal(0, 0.1, len(p)), 0)
        p[[k.endswith(".mass") for k in twin(name).p_names]] += 1e3
        p[["pmi" in k for k in twin(name).p_names]] += 10.0
        u, x = generator.normal(0, 1e3, len(u)), generator.normal(0, 0.3, 7)
    return np.concatenate([p, u, x])


def standing(name: str, at: np.ndarray, fmi: int = 3, exchange: bool = True) -> Instance:
    """Returns an instance that stands at values of the knowns; in co-simulation it starts there."""
    instance = Instance(SCENES[name], fmi, exchange=exchange)
    numbers = dict(zip(knowns(name), at, strict=True))
    start = {"attitude_start": at[-7:-3], "angular_velocity_start": at[-3:]}
    assert instance.enter() == OK
    assert instance.set(start | {k: v for k, v in numbers.items() if not k.startswith("state.")}) == OK
    assert instance.exit() == OK, instance.log
    if exchange:
        assert instance.run() == OK
        assert instance.set(numbers) == OK
    instance.log.clear()
    return instance


def columns(instance: Instance, rows: Sequence[str], by: Sequence[str]) -> np.ndarray:
    """Returns a Jacobian by directional derivatives, one column each."""
    if not by:
        return np.zeros((len(rows), 0))
    return np.column_stack([instance.directional(rows, by, seed) for seed in np.eye(len(by))])


def transposed_rows(instance: Instance, rows: Sequence[str], by: Sequence[str]) -> np.ndarray:
    """Returns the same Jacobian by adjoint derivatives, one row each."""
    return np.array([instance.adjoint(rows, by, seed) for seed in np.eye(len(rows))])


def normalised(at: np.ndarray) -> np.ndarray:
    """Returns the values with the attitude at length 1, as co-simulation holds it."""
    at = at.copy()
    at[-7:-3] /= np.linalg.norm(at[-7:-3])
    return at


# A known of magnitude k is moved by h = DIFFERENCE k to both sides. A value of the row's magnitude s changes
# over k as a function of directions and distances does: its third derivative is below 192 s/k^3, a sixth of
# which times h^2 is left out; 64 EPS of rounding in each value come out over h.
DIFFERENCE = EPS ** (1 / 3)
DIFFERENCE_TOLERANCE = (32 + 64) * DIFFERENCE**2


def start_names(name: str) -> tuple[list[str], list[str]]:
    """Returns unknowns and knowns of initialisation mode."""
    parameters = [f"angular_velocity_start[{i}]" for i in (1, 2, 3)]
    parameters += [f"attitude_start[{i}]" for i in (1, 2, 3, 4)]
    return [*unknowns(name), *twin(name).x_names], [*knowns(name)[:-7], *parameters]


def initialising(
    name: str, length: float, fmi: int = 3, exchange: bool = True
) -> tuple[Instance, np.ndarray]:
    """Returns an instance in initialisation mode and the values of its knowns; the attitude has a length."""
    drawn = values(name, "drawn")
    at = np.concatenate([drawn[:-7], drawn[-3:], length * drawn[-7:-3] / np.linalg.norm(drawn[-7:-3])])
    instance = Instance(SCENES[name], fmi, exchange=exchange)
    assert instance.enter() == OK
    assert instance.set(dict(zip(start_names(name)[1], at, strict=True))) == OK
    return instance, at


def time_derivatives(instance: Instance, names: Sequence[str]) -> np.ndarray:
    fmu = instance.fmu
    getter = fmu.getOutputDerivatives if instance.fmi == 3 else fmu.getRealOutputDerivatives
    return np.array(getter([instance.references[name] for name in names], [1] * len(names)))
