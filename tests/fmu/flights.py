"""Bodies that an FMU carries over steps by a propagator, and how far their state is off a Taylor series."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from typing import Any

import numpy as np
import pytest

from support import ISS_DG, OK, PROPAGATORS, TURNING, Array, Instance, random_rotation, variant
from support.series import Number, Vector, flight, mp, norm

FREE = ("exact", "auto")  # what free motion is exact for
EVERY = pytest.mark.parametrize("propagator", PROPAGATORS)

OUTPUTS = [*ISS_DG["outputs"]["names"], "principal_moments", "principal_axes", "error_estimate"]
RATES, ATTITUDE = TURNING["angular_velocity"], TURNING["attitude"]
MOMENTS = (1000.0, 2000.0, 2500.0)
TILT = random_rotation(3)
TILTED = TILT @ np.diag(MOMENTS) @ TILT.T
TORQUE = [2e6, -1e6, 3e6]  # on the assembly, which has some 2.5e8 kg m2: triples its rate within 40 s
WEAK_TORQUE = [20.0, -10.0, 30.0]  # changes it by 1e-5 in that time


@cache
def assembly(propagator: str, tolerance: float = 1e-9) -> dict[str, Any]:
    """Returns ISS and ship, all of the ship an input, every output there is."""
    rotation = {
        "propagator": propagator,
        "angular_velocity": RATES,
        "attitude": ATTITUDE,
        "max_angle_step": 0.01,
        "tolerance": tolerance,
    }
    changes = {"name": f"assembly_{propagator}", "rotation": rotation, "outputs.names": OUTPUTS}
    return variant(ISS_DG, changes)


@cache
def slender(thin: float, propagator: str) -> dict[str, Any]:
    """Returns a slender vessel, its least moment `thin` of the others, docked askew to a light root."""
    port = {"position": [0.0, 0.0, 0.0], "direction": [1.0, 2.0, 3.0], "alignment": [3.0, 0.0, -1.0]}
    other = {"position": [0.0, 0.0, 0.0], "direction": [1.0, -1.0, 2.0], "alignment": [1.0, 1.0, 0.0]}
    return {
        "name": f"slender_{propagator}",
        "root": "A",
        "vessels": {
            "A": {"mass": 1e-3 * thin, "pmi": [1e-6] * 3, "ports": {"p": port}},
            "B": {"mass": 1000.0, "pmi": [thin, 1.0, 1.0], "ports": {"p": other}},
        },
        "docks": [{"ports": ["A.p", "B.p"]}],
        "rotation": {
            "propagator": propagator,
            "tolerance": 1e-12,
            "max_angle_step": 0.01,
            "angular_velocity": [0.3, -0.2, 0.5],
        },
        "inputs": {"mass": ["B"]},
        "outputs": {"names": ["inertia", "angular_velocity", "attitude", "error_estimate"]},
    }


def slender_tensor(thin: float) -> list[list[Number]]:
    """Returns the tensor of `slender`, whose vessels' centres of mass are one point, to all digits."""

    def axes(direction: Sequence[int], alignment: Sequence[int]) -> list[Vector]:
        """Of a port whose alignment is perpendicular to its direction: rows d, a, d x a."""
        d, a = ([mp.mpf(x) / norm([mp.mpf(y) for y in v]) for x in v] for v in (direction, alignment))
        return [d, a, [d[i - 2] * a[i - 1] - d[i - 1] * a[i - 2] for i in range(3)]]

    parent, child = axes((1, 2, 3), (3, 0, -1)), axes((1, -1, 2), (1, 1, 0))
    R = [
        [sum(s * p[i] * c[j] for s, p, c in zip((-1, 1, -1), parent, child, strict=True)) for j in range(3)]
        for i in range(3)
    ]
    root = mp.mpf(1e-3 * thin) * mp.mpf(1e-6)
    own = [1000 * mp.mpf(x) for x in (thin, 1.0, 1.0)]
    return [
        [sum(R[i][k] * own[k] * R[j][k] for k in range(3)) + root * (i == j) for j in range(3)]
        for i in range(3)
    ]


@cache
def tilted(propagator: str, law: str = "tensor", steer: bool = True) -> dict[str, Any]:
    """Returns a single body whose axes are not its principal ones."""
    rotation = {
        "law": law,
        "propagator": propagator,
        "angular_velocity": RATES,
        "attitude": ATTITUDE,
        "max_angle_step": 0.01,
    }
    vessel = {"mass": 1000.0, "inertia": ((TILTED + TILTED.T) / 2).tolist()}
    return {
        "name": f"tilted_{propagator}",
        "root": "B",
        "vessels": {"B": vessel},
        "inputs": {"torque": steer},
        "rotation": rotation,
        "outputs": {"names": ["inertia", "angular_velocity", "attitude", "error_estimate"]},
    }


def state(instance: Instance) -> Array:
    """Returns attitude and angular velocity, (7,)."""
    return np.concatenate([instance.get("state.attitude"), instance.get("state.angular_velocity")])


@contextmanager
def tolerant(raw: Mapping[str, Any], tolerance: float, fmi: int = 3) -> Iterator[Instance]:
    """Yields an initialised instance whose importer asked for a tolerance; frees it."""
    instance = Instance(raw, fmi)
    try:
        assert enter(instance, tolerance) == OK, instance.log
        assert instance.exit() == OK
        yield instance
    finally:
        instance.free()


def enter(instance: Instance, tolerance: float | None) -> int:
    """Enters initialisation with the importer's own tolerance, if any; returns the last status."""
    if instance.fmi == 3:
        return instance._status(instance.fmu.enterInitializationMode, tolerance=tolerance)
    status = instance._status(instance.fmu.setupExperiment, tolerance=tolerance)
    return status or instance._status(instance.fmu.enterInitializationMode)


def fly(instance: Instance, h: float, count: int = 1) -> None:
    for _ in range(count):
        assert instance.step(h) == OK, instance.log


@cache
def by_series(
    law: str, inertia: tuple[float, ...], x: tuple[float, ...], torque: tuple[float, ...], span: float
) -> Vector:
    """Returns attitude and angular velocity, (7,), by a Taylor series in integers; inputs are taken as exact.

    x       : at the start
    inertia : (9,) [kg m2]
    """
    return flight(law, [inertia[i : i + 3] for i in (0, 3, 6)], x, torque, span)


def error(found: Array, of: tuple[str, Array], x: Array, torque: Sequence[float], span: float) -> Array:
    """Returns how far a state is off: attitude [rad], angular velocity relative to its size.

    of      : law and inertia, (9,) [kg m2]
    x, span : start and time
    """
    law, inertia = of
    end = by_series(law, tuple(map(float, inertia)), tuple(map(float, x)), tuple(map(float, torque)), span)
    off = [float(a) - b for a, b in zip(found, end, strict=True)]
    return np.array([float(2 * norm(off[:4])), float(norm(off[4:]) / norm(end[4:]))])


def angle(x: Array, span: float) -> float:
    """Returns the angle [rad] that a body turns by in free motion, nearly."""
    return float(np.linalg.norm(x[4:]) * span)


SPAN, SHORT = 40.0, 400  # s; steps it is divided into
NO_TORQUE, LITTLE, MUCH = 0.0, 1.0, 1e5  # times WEAK_TORQUE
TOLERANCE = 1e-9  # of `assembly` and, by default, of every scene
ASSEMBLY_2 = variant(
    ISS_DG, {"name": "assembly_2", "outputs.names": OUTPUTS, "rotation": {"propagator": "auto"}}
)
