"""What an instance refuses: scenes, outputs to compare, the time that a discarded step has reached."""

from fmpy.fmi2 import fmi2LastSuccessfulTime
from fmpy.fmi3 import fmi3Boolean, fmi3Float64

from support import DISCARD, NAN, Instance, body, variant

SINGLE = variant(
    body(1000.0, (1.0, 2.0, 2.5), angular_velocity=[0.02, -0.03, 0.01]),
    {"name": "single", "inputs": {"mass": ["B"], "pmi": ["B"], "torque": True}},
)


def outputs(instance: Instance) -> list[float]:
    """Returns time, all outputs and states, read in one call."""
    names = [
        v.name
        for v in instance.description.modelVariables
        if v.causality in ("output", "independent") or v.name.startswith("state.")
    ]
    getter = instance.fmu.getFloat64 if instance.fmi == 3 else instance.fmu.getReal
    return list(getter([instance.references[name] for name in names]))


def last_successful_time(instance: Instance, h: float, status: int = DISCARD) -> float:
    """Takes a step that is refused with a status; returns the time that the instance says it has reached."""
    if instance.fmi == 2:
        assert instance.step(h) == status
        return instance.fmu.getRealStatus(fmi2LastSuccessfulTime)
    flags, time = [fmi3Boolean(True) for _ in range(3)], fmi3Float64(NAN)
    step = instance.fmu._functions["fmi3DoStep"]
    assert step(instance.fmu.component, instance.time, h, True, *flags, time) == status
    assert [flag.value for flag in flags] == [False, False, False]
    return time.value
