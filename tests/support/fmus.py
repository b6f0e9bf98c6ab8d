"""FMUs built from raw scenes once in a session, and instances of them driven through FMPy."""

import hashlib
import json
import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy import read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model, FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.fmi3 import FMU3Model, FMU3Slave

from fmu_build import build_fmu
from fmu_build.compile.compiler import FLAGS, TRIAL_FLAGS
from fmu_build.compile.library import compile_sources
from fmu_build.generate.model import generated
from fmu_build.generate.sources import source_file_names, source_files
from fmu_build.interface.names import Naming
from fmu_build.interface.variable_table import variable_table
from fmu_build.platforms import host_platform
from supervessel.equations import equations
from support.scenes import scene
from support.traps import watch

OK, WARNING, DISCARD, ERROR = range(4)

THOROUGH = "SUPERVESSEL_TESTS_THOROUGH"
"""Variable that is set where all cases of a test count (`make thorough`, `stability`, `accuracy`): there are
more random examples (see `support.examples`), and libraries are compiled as users get them. Else they are
those of trials, compiled in a fifth of the time: the same numbers to the last bit, as
test_libraries_for_trials_fly_the_same_to_the_last_bit has it."""


def refusal(fmi: int) -> int:
    """Returns the status of a refused value where only FMI 3.0 knows Discard, and of a step that it prevents:
    to FMI 2.0's masters Discard means that a shorter one may do (4.2.2)."""
    return DISCARD if fmi == 3 else ERROR


STATES = [
    *(f"state.attitude[{i}]" for i in (1, 2, 3, 4)),
    *(f"state.angular_velocity[{i}]" for i in (1, 2, 3)),
]
PARAMETERS = [
    *(f"angular_velocity_start[{i}]" for i in (1, 2, 3)),
    *(f"attitude_start[{i}]" for i in (1, 2, 3, 4)),
]


@cache
def store() -> Path:
    """Returns a folder for what tests build: that of the session, which all of its processes share (see
    tests/conftest.py), or outside of one a folder of this process."""
    return Path(os.environ.get("SUPERVESSEL_TESTS") or tempfile.mkdtemp(prefix="supervessel-test-"))


def built(
    raw: Mapping[str, Any],
    fmi: int = 3,
    naming: Naming = "structured",
    *,
    optimised: bool | None = None,
) -> Path:
    """Returns the path of the FMU of a raw scene, built once in a session.

    optimised : whether it is to the last byte the one that users get; None: as the session has it
    """
    flags = session_flags() if optimised is None else FLAGS if optimised else TRIAL_FLAGS
    path = store() / f"{_digest([raw, flags], fmi, naming)}.fmu"
    if path.exists():
        return path
    compiled = partial(compile_sources, flags=flags)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("fmu_build.build.compile_sources", compiled)
        return build_fmu(scene(raw), path, fmi, names=naming)


def session_flags() -> tuple[str, ...]:
    """Returns the compiler's flags for libraries of which a test says nothing."""
    return FLAGS if THOROUGH in os.environ else TRIAL_FLAGS


def _is_optimised(fmi: int, asked: bool | None) -> bool:
    """Whether a library is optimised. That of FMI 2 never is: what both versions share is seen both ways."""
    return fmi == 3 and (THOROUGH in os.environ if asked is None else asked)


def unpacked(
    raw: Mapping[str, Any],
    fmi: int = 3,
    naming: Naming = "structured",
    *,
    optimised: bool | None = None,
) -> Path:
    """Returns a folder with all of a raw scene's FMU that is loaded, made once in a session.

    optimised : whether the library of FMI 3 is compiled as users get it; None: as the session has it (see
                `THOROUGH`). For long flights, and where the optimiser is what is tested.
    Pictures and pages are left out.
    """
    optimised = _is_optimised(fmi, optimised)
    folder = store() / _digest([raw, optimised], fmi, naming)
    if folder.is_dir():
        return folder
    made, parsed = Path(tempfile.mkdtemp(dir=store())), scene(raw)
    model = equations(parsed)
    sources, description = generated(model, variable_table(model, naming), fmi)
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


def _digest(what: Any, fmi: int, naming: Naming) -> str:
    return hashlib.sha256(json.dumps([what, fmi, naming], sort_keys=True).encode()).hexdigest()


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
        optimised: bool | None = None,
        naming: Naming = "structured",
        **instantiation: Any,
    ) -> None:
        folder = unpacked(raw, fmi, naming, optimised=optimised)
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
        return self.update_discrete_states() or self._status(self.fmu.enterContinuousTimeMode)

    def update_discrete_states(self) -> int:
        """Updates discrete states in event mode."""
        return self._status(self.fmu.updateDiscreteStates if self.fmi == 3 else self.fmu.newDiscreteStates)

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

    def everything(self) -> list[float]:
        """Returns every variable of an FMU that has no Booleans, by one call."""
        getter = self.fmu.getFloat64 if self.fmi == 3 else self.fmu.getReal
        return list(getter(list(self.references.values())))

    def bits(self) -> list[str]:
        """Returns the same in hexadecimal."""
        return [number.hex() for number in self.everything()]

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
