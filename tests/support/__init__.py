"""Shared by the tests: small scenes as dictionaries, FMUs built from them, instances driven through FMPy."""

import copy
import hashlib
import json
import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model, FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.fmi3 import FMU3Model, FMU3Slave

from fmu_build import build_fmu
from fmu_build.compile.compiler import FLAGS, TRIAL_FLAGS
from fmu_build.compile.library import compile_sources
from fmu_build.generate.model import generate
from fmu_build.generate.sources import source_file_names, source_files
from fmu_build.platforms import host_platform
from supervessel import Scene, parse_scene
from support.traps import watch

EPS = 2.0**-52
OK, WARNING, DISCARD, ERROR = range(4)

ISS_DG: dict[str, Any] = {
    "name": "iss_dg",
    "root": "ISS",
    "vessels": {
        "ISS": {
            "mass": 455000.0,
            "pmi": [385.0, 719.0, 508.0],
            "ports": {
                "P2": {
                    "position": [0.09, -17.9, 3.8],
                    "direction": [0.0, -1.0, 0.0],
                    "alignment": [0.0, 0.0, -1.0],
                }
            },
        },
        "DG": {
            "mass": 24500.0,
            "pmi": [15.5, 22.1, 7.7],
            "ports": {
                "nose": {
                    "position": [0.0, -0.49, -10.076],
                    "direction": [0.0, 0.0, -1.0],
                    "alignment": [0.0, 1.0, 0.0],
                }
            },
        },
    },
    "docks": [{"ports": ["ISS.P2", "DG.nose"]}],
    "inputs": {"mass": ["DG"], "pmi": ["DG"], "pose": ["DG.nose"], "torque": True},
    "outputs": {
        "names": [
            "mass",
            "barycentre",
            "pmi",
            "inertia",
            "angular_velocity",
            "attitude",
            "kinetic_energy",
            "angular_momentum",
        ]
    },
}
"""The ISS with a DeltaGlider, everything of the ship an input, every output."""


def variant(raw: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Returns a deep copy of a raw scene with values put at dotted paths; a value of None removes the key."""
    new: dict[str, Any] = copy.deepcopy(dict(raw))
    for path, value in changes.items():
        table = new
        *tables, key = path.split(".")
        for name in tables:
            table = table.setdefault(name, {})
        if value is None:
            del table[key]
        else:
            table[key] = value
    return new


def draw_inputs(generator: np.random.Generator) -> dict[str, Any]:
    """Returns usable values for all inputs of ISS_DG."""
    return {
        "DG.mass": generator.uniform(11e3, 24.5e3),
        "DG.pmi": np.array([15.5, 22.1, 20.0]) * generator.uniform(0.8, 1.2),
        "DG.nose.position": generator.normal([0.0, -0.49, -10.0], 0.5),
        "DG.nose.direction": generator.normal([0.0, 0.0, -1.0], 0.2),
        "DG.nose.alignment": generator.normal([0.0, 2.0, 0.0], 0.2),
        "torque": generator.normal(size=3) * 1e4,
    }


def body(mass: float = 1000.0, pmi: Sequence[float] = (1.0, 2.0, 2.5), **rotation: Any) -> dict[str, Any]:
    """Returns the raw scene of a single body with torque inputs and every output."""
    return {
        "name": "body",
        "root": "B",
        "vessels": {"B": {"mass": mass, "pmi": list(pmi)}},
        "inputs": {"torque": True},
        "rotation": rotation,
        "outputs": copy.deepcopy(ISS_DG["outputs"]),
    }


@cache
def store() -> Path:
    """Returns a folder for what tests build: that of the session, which all of its processes share (see
    tests/conftest.py), or outside of one a folder of this process."""
    return Path(os.environ.get("SUPERVESSEL_TESTS") or tempfile.mkdtemp(prefix="supervessel-test-"))


def built(raw: Mapping[str, Any], fmi: int = 3) -> Path:
    """Returns the path of the FMU of a raw scene, built once in a session."""
    path = store() / f"{_digest(raw, fmi)}.fmu"
    return path if path.exists() else build_fmu(scene(raw), path, fmi)


def unpacked(raw: Mapping[str, Any], fmi: int = 3, *, optimised: bool = True) -> Path:
    """Returns a folder with all of a raw scene's FMU that is loaded, made once in a session.

    optimised : whether the library is that of `built`; else it is compiled in a fifth of the time. That of
                FMI 2 never is: what both versions share is seen both ways.
    Pictures and pages are left out.
    """
    optimised = optimised and fmi == 3
    folder = store() / _digest([raw, optimised], fmi)
    if folder.is_dir():
        return folder
    made, parsed = Path(tempfile.mkdtemp(dir=store())), scene(raw)
    sources, description = generate(parsed, fmi)
    packed, names = source_files(sources, fmi, parsed.name), source_file_names(sources, fmi)
    flags = FLAGS if optimised else TRIAL_FLAGS
    binaries = compile_sources(packed, names, fmi, [host_platform()], parsed.name, flags)
    for path, content in {"modelDescription.xml": description, **packed, **binaries}.items():
        file = made / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content)
    try:
        made.rename(folder)
    except OSError:
        if not folder.is_dir():  # else another process was faster
            raise
    return folder


def _digest(what: Any, fmi: int) -> str:
    return hashlib.sha256(json.dumps([what, fmi], sort_keys=True).encode()).hexdigest()


@cache
def _description(folder: Path) -> Any:
    return read_model_description(str(folder))


class Instance:
    """An instance of a built FMU, of either version and interface, addressed by variable names.

    A call that succeeds and raises a floating-point exception other than underflow or inexact fails the test.

    optimised : see `unpacked`
    Each call returns the FMI status; `log` holds (status, category, message) of each line logged.
    """

    def __init__(
        self,
        raw: Mapping[str, Any],
        fmi: int = 3,
        logging: bool = True,
        name: str = "it",
        exchange: bool = False,
        *,
        optimised: bool = True,
        **instantiation: Any,
    ) -> None:
        folder = unpacked(raw, fmi, optimised=optimised)
        self.fmi, self.description = fmi, _description(folder)
        description = self.description
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        self.booleans = {v.name for v in description.modelVariables if v.type == "Boolean"}
        self.log: list[tuple[int, str, str]] = []
        arguments = {
            "guid": description.guid,
            "unzipDirectory": str(folder),
            "modelIdentifier": description.coSimulation.modelIdentifier,
            "instanceName": name,
        }
        if fmi == 3:
            self.fmu = (FMU3Model if exchange else FMU3Slave)(**arguments)
            watch(self.fmu)
            self.fmu.instantiate(loggingOn=logging, logMessage=self._log3, **instantiation)
        else:
            self.fmu = (FMU2Model if exchange else FMU2Slave)(**arguments)
            watch(self.fmu)
            callbacks = fmi2CallbackFunctions()
            callbacks.logger = fmi2CallbackLoggerTYPE(self._log2)
            self.fmu.instantiate(loggingOn=logging, callbacks=callbacks)
        self.time = 0.0

    def _log3(self, environment: Any, status: int, category: bytes, message: bytes) -> None:
        self.log.append((status, category.decode(), message.decode()))

    def _log2(self, environment: Any, name: bytes, status: int, category: bytes, message: bytes) -> None:
        self.log.append((status, category.decode(), message.decode()))

    def _status(self, function: Any, *arguments: Any, **named: Any) -> int:
        try:
            function(*arguments, **named)
        except FMICallException as exception:
            return int(exception.status)
        return OK

    def initialise(self, start: float = 0.0, stop: float | None = None, **values: Any) -> int:
        """Enters initialisation, sets values by group or name, exits; returns the last status."""
        self.enter(start, stop)
        for name, value in values.items():
            self.set({name: value})
        return self.exit()

    def enter(self, start: float = 0.0, stop: float | None = None) -> int:
        self.time = start
        if self.fmi == 3:
            return self._status(self.fmu.enterInitializationMode, startTime=start, stopTime=stop)
        status = self._status(self.fmu.setupExperiment, startTime=start, stopTime=stop)
        return status or self._status(self.fmu.enterInitializationMode)

    def exit(self) -> int:
        return self._status(self.fmu.exitInitializationMode)

    def run(self) -> int:
        """Takes an initialised instance of model exchange on to continuous-time mode."""
        update = self.fmu.updateDiscreteStates if self.fmi == 3 else self.fmu.newDiscreteStates
        return self._status(update) or self._status(self.fmu.enterContinuousTimeMode)

    def directional(self, unknowns: Sequence[str], knowns: Sequence[str], seed: Any) -> np.ndarray:
        """Returns the directional derivative of unknowns by knowns along a seed."""
        u, k = ([self.references[name] for name in names] for names in (unknowns, knowns))
        return np.array(self.fmu.getDirectionalDerivative(u, k, list(seed)))

    def adjoint(self, unknowns: Sequence[str], knowns: Sequence[str], seed: Any) -> np.ndarray:
        """Returns the adjoint derivative of unknowns, weighted by a seed, by knowns."""
        u, k = ([self.references[name] for name in names] for names in (unknowns, knowns))
        return np.array(self.fmu.getAdjointDerivative(u, k, list(seed), nSensitivity=len(k)))

    def step(self, h: float) -> int:
        """Steps by h from the instance's time, which advances if the step succeeds."""
        status = self._status(self.fmu.doStep, currentCommunicationPoint=self.time, communicationStepSize=h)
        if status == OK:
            self.time += h
        return status

    def set(self, values: Mapping[str, Any]) -> int:
        """Sets scalars by name, or whole vectors by the name without index, in one call.

        Booleans go before them, in a call of their own.
        """
        booleans = {name: value for name, value in values.items() if name in self.booleans}
        if booleans:
            references = [self.references[name] for name in booleans]
            status = self._status(self.fmu.setBoolean, references, list(map(bool, booleans.values())))
            if status or len(booleans) == len(values):
                return status
            values = {name: value for name, value in values.items() if name not in booleans}
        names, numbers = [], []
        for name, value in values.items():
            group = self.names(name)
            names += group
            numbers += [float(x) for x in np.ravel(value)]
            assert len(names) == len(numbers), name
        setter = self.fmu.setFloat64 if self.fmi == 3 else self.fmu.setReal
        return self._status(setter, [self.references[name] for name in names], numbers)

    def get(self, name: str) -> Any:
        """Returns a scalar, or a vector or tensor (flat, as a numpy array) by the name without index.

        Raises FMICallException where the FMU does not answer.
        """
        if name in self.booleans:
            return bool(self.fmu.getBoolean([self.references[name]])[0])
        getter = self.fmu.getFloat64 if self.fmi == 3 else self.fmu.getReal
        numbers = np.array(getter([self.references[element] for element in self.names(name)]))
        return float(numbers[0]) if name in self.references else numbers

    def get_status(self, name: str) -> int:
        return self._status(self.get, name)

    def names(self, name: str) -> list[str]:
        """Returns the scalars that a name stands for, in order."""
        if name in self.references:
            return [name]
        elements = [full for full in self.references if full.startswith(f"{name}[")]
        if not elements:
            raise KeyError(name)
        return elements

    def messages(self) -> list[str]:
        """Returns the messages logged so far that are no information."""
        return [message for status, _, message in self.log if status != OK]

    def reset(self) -> int:
        self.time = 0.0
        return self._status(self.fmu.reset)

    def free(self) -> None:
        self.fmu.freeInstance()


@contextmanager
def flying(raw: Mapping[str, Any], fmi: int = 3, **values: Any) -> Iterator[Instance]:
    """Yields an initialised instance of a raw scene; frees it."""
    instance = Instance(raw, fmi)
    try:
        assert instance.initialise(**values) == OK, instance.log
        yield instance
    finally:
        instance.free()


def scene(raw: Mapping[str, Any]) -> Scene:
    """Returns the scene of a raw one; where it does not say otherwise propagated by RK4, whose steps can be
    foretold, and keeping the angular velocity when poses change."""
    given = raw.get("rotation", {})
    unless = {"rotation.propagator": "rk4"}
    if raw.get("inputs", {}).get("pose") and not raw["inputs"].get("motion"):
        unless["rotation.pose_change"] = "rate"
    changes = {k: given.get(k.removeprefix("rotation."), v) for k, v in unless.items()}
    return parse_scene(variant(raw, changes))


def relative_error(value: Any, truth: Any) -> float:
    """Returns the largest difference over the largest magnitude of the truth."""
    value, truth = np.asarray(value, dtype=float), np.asarray(truth, dtype=float)
    return float(np.abs(value - truth).max() / np.abs(truth).max())


def random_rotation(seed: int) -> np.ndarray:
    """Returns a rotation matrix, (3, 3), drawn with a seed."""
    q = np.random.default_rng(seed).normal(size=4)
    w, x, y, z = q / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


__all__ = [
    "DISCARD",
    "EPS",
    "ERROR",
    "ISS_DG",
    "OK",
    "WARNING",
    "Instance",
    "body",
    "built",
    "draw_inputs",
    "flying",
    "random_rotation",
    "relative_error",
    "scene",
    "store",
    "unpacked",
    "variant",
]
