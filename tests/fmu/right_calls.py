"""FMI's functions, each called with arguments that are right, so that only the state can be wrong."""

from collections.abc import Callable
from ctypes import byref, c_bool, c_char_p, c_double, c_int, c_size_t, c_ubyte, c_void_p, create_string_buffer
from typing import Any

from fmpy.fmi2 import fmi2DoStepStatus, fmi2LastSuccessfulTime, fmi2Terminated

from fmu.calls import Raw, discrete_states, enter, get, reals, reference, set_, states, step
from support import OK

Call = Callable[[Raw], int]

VALUES = {
    "an input": ("DG.mass", 2e4),
    "a parameter": ("angular_velocity_start[1]", 0.1),
    "an output": ("mass", 1.0),
    "a state": ("state.attitude[2]", 0.1),
    "a rate": ("der(state.angular_velocity[1])", 0.1),
    "time": ("time", 0.5),
}
"""A variable of each role, and a value to be set."""
DISCRETE_INPUT = "berth.docked"


def getter(name: str) -> Call:
    return lambda raw: get(raw, reference(raw, name), 1, reals(0.0))


def setter(name: str, value: float) -> Call:
    return lambda raw: set_(raw, reference(raw, name), 1, reals(value))


def boolean(verb: str) -> Call:
    """Returns a call that gets or sets the dock, as it stands."""

    def call(raw: Raw) -> int:
        if raw.fmi == 2:
            return raw(f"fmi2{verb}Boolean", reference(raw, DISCRETE_INPUT), 1, (c_int * 1)(1))
        return raw(f"fmi3{verb}Boolean", reference(raw, DISCRETE_INPUT), 1, (c_bool * 1)(True), 1)

    return call


def derivative(function: str) -> Call:
    """Returns a call for the derivative of an output by an input."""

    def call(raw: Raw) -> int:
        unknown, known, seed, result = (
            reference(raw, "mass"),
            reference(raw, "DG.mass"),
            reals(1.0),
            reals(0.0),
        )
        if raw.fmi == 2:
            return raw(function, unknown, 1, known, 1, seed, result)
        return raw(function, unknown, 1, known, 1, seed, 1, result, 1)

    return call


def output_derivatives(raw: Raw) -> int:
    arguments = reference(raw, "attitude[1]"), 1, (c_int * 1)(1), reals(0.0)
    if raw.fmi == 2:
        return raw("fmi2GetRealOutputDerivatives", *arguments)
    return raw("fmi3GetOutputDerivatives", *arguments, 1)


class Saved:
    """What an instance was saved in right after it was made: as a pointer and as bytes."""

    def __init__(self, raw: Raw) -> None:
        names = {
            2: ("GetFMUstate", "FreeFMUstate", "SerializedFMUstateSize", "SerializeFMUstate"),
            3: ("GetFMUState", "FreeFMUState", "SerializedFMUStateSize", "SerializeFMUState"),
        }[raw.fmi]
        get_, self.free_, size_, serialize = (f"fmi{raw.fmi}{name}" for name in names)
        self.pointer, size = c_void_p(), c_size_t()
        assert raw(get_, byref(self.pointer)) == OK
        assert raw(size_, self.pointer, byref(size)) == OK
        self.bytes = create_string_buffer(size.value) if raw.fmi == 2 else (c_ubyte * size.value)()
        assert raw(serialize, self.pointer, self.bytes, size.value) == OK

    def free(self, raw: Raw) -> None:
        assert raw(self.free_, byref(self.pointer)) == OK


def with_new(raw: Raw, function: str, *arguments: Any) -> int:
    """Returns the status of a call that makes a saved state, and frees what was made."""
    made = c_void_p()
    status = raw(function, *arguments, byref(made))
    if status == OK:
        assert raw(raw.saved.free_, byref(made)) == OK
    return status


def completed_step(raw: Raw) -> int:
    results = [c_int(), c_int()] if raw.fmi == 2 else [c_bool(), c_bool()]
    return raw(f"fmi{raw.fmi}CompletedIntegratorStep", True, *map(byref, results))


def plain(function: str, *arguments: Any) -> Call:
    return lambda raw: raw(function, *arguments)


def of_saved_states(fmi: int) -> dict[str, Call]:
    state, back = ("state", "DeSerialize") if fmi == 2 else ("State", "Deserialize")
    names = {verb: f"fmi{fmi}{verb}FMU{state}" for verb in ("Get", "Set", "Free", "Serialize", back)}
    size = f"fmi{fmi}SerializedFMU{state}Size"
    return {
        names["Get"]: lambda raw: with_new(raw, names["Get"]),
        names["Set"]: lambda raw: raw(names["Set"], raw.saved.pointer),
        names["Free"]: lambda raw: raw(names["Free"], byref(c_void_p())),
        size: lambda raw: raw(size, raw.saved.pointer, byref(c_size_t())),
        names["Serialize"]: lambda raw: raw(
            names["Serialize"], raw.saved.pointer, raw.saved.bytes, len(raw.saved.bytes)
        ),
        names[back]: lambda raw: with_new(raw, names[back], raw.saved.bytes, len(raw.saved.bytes)),
    }


def of_variables(fmi: int) -> dict[str, Call]:
    """Returns the calls that get and set a variable of each role, by function and role."""
    number = "Real" if fmi == 2 else "Float64"
    calls: dict[str, Call] = {}
    for role, (name, value) in VALUES.items():
        calls[f"fmi{fmi}Get{number} of {role}"] = getter(name)
        calls[f"fmi{fmi}Set{number} of {role}"] = setter(name, value)
    for verb in ("Get", "Set"):
        calls[f"fmi{fmi}{verb}Boolean of a discrete input"] = boolean(verb)
    return calls


def of_model_exchange(fmi: int) -> dict[str, Call]:
    rates = "fmi2GetDerivatives" if fmi == 2 else "fmi3GetContinuousStateDerivatives"
    update = "fmi2NewDiscreteStates" if fmi == 2 else "fmi3UpdateDiscreteStates"
    arrays = {f"fmi{fmi}{name}": name for name in ("GetContinuousStates", "GetNominalsOfContinuousStates")}
    return {
        f"fmi{fmi}EnterEventMode": plain(f"fmi{fmi}EnterEventMode"),
        update: discrete_states,
        f"fmi{fmi}EnterContinuousTimeMode": plain(f"fmi{fmi}EnterContinuousTimeMode"),
        f"fmi{fmi}CompletedIntegratorStep": completed_step,
        f"fmi{fmi}SetTime": plain(f"fmi{fmi}SetTime", 1.5),
        f"fmi{fmi}SetContinuousStates": plain(f"fmi{fmi}SetContinuousStates", states(), 7),
        rates: plain(rates, states(), 7),
        f"fmi{fmi}GetEventIndicators": plain(f"fmi{fmi}GetEventIndicators", None, 0),
        **{function: plain(function, states(), 7) for function in arrays},
    }


def of_both_versions(fmi: int) -> dict[str, Call]:
    directional = f"fmi{fmi}GetDirectionalDerivative"
    return {
        f"fmi{fmi}SetDebugLogging": plain(f"fmi{fmi}SetDebugLogging", True, 0, None),
        f"fmi{fmi}ExitInitializationMode": plain(f"fmi{fmi}ExitInitializationMode"),
        f"fmi{fmi}Terminate": plain(f"fmi{fmi}Terminate"),
        f"fmi{fmi}Reset": plain(f"fmi{fmi}Reset"),
        f"fmi{fmi}DoStep": lambda raw: step(raw, 0.0, 0.1),
        directional: derivative(directional),
        **of_variables(fmi),
        **of_saved_states(fmi),
        **of_model_exchange(fmi),
    }


RIGHT: dict[int, dict[str, Call]] = {
    2: {
        **of_both_versions(2),
        "fmi2SetupExperiment": lambda raw: enter(raw, 0.0),
        "fmi2EnterInitializationMode": plain("fmi2EnterInitializationMode"),
        "fmi2GetRealOutputDerivatives": output_derivatives,
        "fmi2GetRealStatus": lambda raw: raw("fmi2GetRealStatus", fmi2LastSuccessfulTime, c_double()),
        "fmi2GetBooleanStatus": lambda raw: raw("fmi2GetBooleanStatus", fmi2Terminated, c_int()),
        "fmi2GetStatus": lambda raw: raw("fmi2GetStatus", fmi2DoStepStatus, c_int()),
        "fmi2GetIntegerStatus": lambda raw: raw("fmi2GetIntegerStatus", fmi2DoStepStatus, c_int()),
        "fmi2GetStringStatus": lambda raw: raw("fmi2GetStringStatus", 1, c_char_p()),
    },
    3: {
        **of_both_versions(3),
        "fmi3EnterInitializationMode": lambda raw: enter(raw, 0.0),
        "fmi3EnterStepMode": plain("fmi3EnterStepMode"),
        "fmi3GetOutputDerivatives": output_derivatives,
        "fmi3GetAdjointDerivative": derivative("fmi3GetAdjointDerivative"),
        "fmi3GetNumberOfContinuousStates": lambda raw: raw("fmi3GetNumberOfContinuousStates", c_size_t()),
        "fmi3GetNumberOfEventIndicators": lambda raw: raw("fmi3GetNumberOfEventIndicators", c_size_t()),
    },
}
"""By version, the functions that the FMU supports; those that get and set variables, for each role."""
