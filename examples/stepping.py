"""FMUs stepped one communication step at a time through FMPy, for loops that feed something back."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from shutil import rmtree

import numpy as np
from fmpy import extract, read_model_description
from fmpy.simulation import instantiate_fmu

Step = Callable[[float, dict[str, float], list[str]], np.ndarray]
"""Time, inputs by name, names of outputs -> the outputs at the end of the step."""


@contextmanager
def stepped(path: Path, h: float, start: Mapping[str, float] | None = None) -> Iterator[Step]:
    """Yields what sets inputs of an FMU at a time, steps it by h [s] and gets outputs; FMI 2 or 3.

    start : inputs and parameters that start otherwise than the FMU says
    """
    description = read_model_description(str(path))
    folder = extract(str(path))
    instance = instantiate_fmu(folder, description, "CoSimulation")
    references = {variable.name: variable.valueReference for variable in description.modelVariables}
    if description.fmiVersion == "2.0":
        instance.setupExperiment()
        write, read = instance.setReal, instance.getReal
    else:
        write, read = instance.setFloat64, instance.getFloat64
    instance.enterInitializationMode()
    write([references[name] for name in start or {}], [*(start or {}).values()])
    instance.exitInitializationMode()

    def step(time: float, inputs: dict[str, float], outputs: list[str]) -> np.ndarray:
        write([references[name] for name in inputs], list(inputs.values()))
        instance.doStep(time, h)
        return np.array(read([references[name] for name in outputs]))

    try:
        yield step
    finally:
        instance.freeInstance()
        rmtree(folder, ignore_errors=True)


def elements(name: str, size: int) -> list[str]:
    """Returns the names of a vector's elements."""
    return [f"{name}[{i}]" for i in range(1, size + 1)]
