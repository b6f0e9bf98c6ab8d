"""Values that cannot be used: stored as set, refused at first use, and without a trace once corrected."""

from collections.abc import Callable, Mapping
from ctypes import c_double
from itertools import permutations
from typing import Any

import numpy as np
import pytest

from fmu.refusals import SINGLE, last_successful_time, outputs
from support import DISCARD, EPS, ERROR, INF, ISS_DG, NAN, OK, STEADY, Instance, flying, refusal, variant
from support.marks import FMI

TUMBLING = variant(
    ISS_DG,
    {
        "name": "tumbling",
        "rotation": {"angular_velocity": [0.02, -0.03, 0.01], "attitude": [1.0, 2.0, 3.0, 4.0]} | STEADY,
    },
)

# scene, unusable values, what the log must say of them
REFUSALS: dict[str, tuple[Mapping[str, Any], dict[str, Any], str]] = {
    "negative mass": (TUMBLING, {"DG.mass": -1.5}, "DG.mass = -1.5 kg: must be >= 0"),
    "negative moment": (
        TUMBLING,
        {"DG.pmi[3]": -7.0},
        "DG.pmi = (15.5, 22.1, -7) m2: must be >= 0",
    ),
    "broken triangle": (
        TUMBLING,
        {"DG.pmi": [1.0, 5.0, 1.0]},
        "DG.pmi = (1, 5, 1) m2: 5 exceeds 1 + 1 by 3; no rigid body has these moments",
    ),
    "triangle broken in the last digits": (
        TUMBLING,
        {"DG.pmi": [1.0, 2.0, 3.0 + 16 * EPS]},
        "DG.pmi = (1, 2, 3) m2: 3.0000000000000036 exceeds 1 + 2 by 3.55271e-15",
    ),
    "no direction": (
        TUMBLING,
        {"DG.nose.direction[3]": 0.0},
        "DG.nose.direction = (0, 0, 0): must have a length greater than 0",
    ),
    "no alignment": (
        TUMBLING,
        {"DG.nose.alignment[2]": 0.0},
        "DG.nose.alignment = (0, 0, 0): must have a length greater than 0",
    ),
    "alignment along direction": (
        TUMBLING,
        {"DG.nose.alignment": [0.0, 0.0, -2.0]},
        "DG.nose.alignment = (0, 0, -2): must not be parallel to DG.nose.direction = (0, 0, -1) within 1e-06",
    ),
    "alignment against direction": (
        TUMBLING,
        {"DG.nose.direction": [0.0, -3.0, 0.0]},
        "DG.nose.alignment = (0, 1, 0): must not be parallel to DG.nose.direction = (0, -3, 0) within 1e-06",
    ),
    "alignment nearly along direction": (
        TUMBLING,
        {"DG.nose.alignment": [0.0, 9e-7, -1.0]},
        "DG.nose.alignment = (0, 9e-07, -1): must not be parallel to",
    ),
    "no mass at all": (
        SINGLE,
        {"B.mass": 0.0},
        "mass = 0 kg: the total of all vessels must be finite and > 0",
    ),
    "total mass beyond all numbers": (
        variant(
            TUMBLING, {"name": "huge", "vessels.ISS.mass": 1e308, "vessels.ISS.pmi": [1e-300, 1e-300, 1e-300]}
        ),
        {"DG.mass": 1.5e308},
        "mass = inf kg: the total of all vessels must be finite and > 0",
    ),
    "a point": (
        SINGLE,
        {"B.pmi": [0.0, 0.0, 0.0]},
        "inertia (xx, yy, zz, xy, xz, yz) = (0, 0, 0, 0, 0, 0) kg.m2: must be finite and positive definite",
    ),
    "a rod": (
        SINGLE,
        {"B.pmi": [0.0, 2.0, 2.0]},
        "inertia (xx, yy, zz, xy, xz, yz) = (0, 2000, 2000, 0, 0, 0) kg.m2: must be finite and positive",
    ),
    "a position beyond all numbers": (
        TUMBLING,
        {"DG.nose.position": [1e200, 0.0, 0.0]},
        "must be finite and positive definite",
    ),
}
REFUSAL = pytest.mark.parametrize(("raw", "bad", "text"), REFUSALS.values(), ids=REFUSALS.keys())
INDEPENDENT = ("attitude", "angular_velocity", "state.attitude", "state.angular_velocity")


# Not finite: refused by set.

BAD_NUMBERS = pytest.mark.parametrize("number", [NAN, INF, -INF], ids=["nan", "inf", "-inf"])
EACH_KIND = [
    "DG.mass",
    "DG.pmi[2]",
    "DG.nose.position[3]",
    "DG.nose.direction[1]",
    "DG.nose.alignment[1]",
    "torque[2]",
    "angular_velocity_start[1]",
    "attitude_start[4]",
]


@BAD_NUMBERS
@pytest.mark.parametrize("name", EACH_KIND)
@FMI
def test_a_number_that_is_not_finite_is_discarded_by_set_and_named_in_the_log(fmi, name, number):
    instance = Instance(ISS_DG, fmi)
    instance.enter()
    assert instance.set({name: number}) == DISCARD
    [message] = instance.messages()
    function = "fmi3SetFloat64" if fmi == 3 else "fmi2SetReal"
    assert message.startswith(f"{function}: {name} = {number}")
    assert message.endswith(": must be finite")
    instance.free()


@pytest.mark.parametrize(("name", "value"), [("DG.mass", "inf kg"), ("DG.nose.direction[1]", "inf")])
def test_a_value_stands_with_its_unit_right_before_the_colon(name, value):
    with flying(ISS_DG) as instance:
        instance.set({name: INF})
        assert instance.messages() == [f"fmi3SetFloat64: {name} = {value}: must be finite"]


@pytest.mark.parametrize(
    ("name", "value"), [("state.attitude[1]", "-inf"), ("state.angular_velocity[2]", "-inf rad/s")]
)
@pytest.mark.parametrize("by", ["reference", "array"])
@FMI
def test_a_states_value_stands_with_its_unit_right_before_the_colon(fmi, by, name, value):
    instance = Instance(ISS_DG, fmi, exchange=True)
    assert [instance.initialise(), instance.run()] == [OK, OK]
    names = [*instance.names("state.attitude"), *instance.names("state.angular_velocity")]
    array = (c_double * 7)(*(-INF if other == name else 1.0 for other in names))
    if by == "reference":
        function = "fmi3SetFloat64" if fmi == 3 else "fmi2SetReal"
        assert instance.set({name: -INF}) == DISCARD
    else:
        function = f"fmi{fmi}SetContinuousStates"
        assert instance._status(instance.fmu.setContinuousStates, array, 7) == DISCARD
    assert instance.messages() == [f"{function}: {name} = {value}: must be finite"]
    instance.free()


@pytest.mark.parametrize("state", ["instantiated", "initialising", "stepping"])
@pytest.mark.parametrize("place", [0, 1, 2])
@FMI
def test_nothing_is_stored_of_a_call_that_holds_a_number_that_is_not_finite(fmi, place, state):
    instance = Instance(TUMBLING, fmi)
    if state != "instantiated":
        instance.enter()
    if state == "stepping":
        instance.exit()
    values = {"DG.mass": 15e3, "DG.pmi[1]": 16.0, "torque[1]": 30.0}
    values[list(values)[place]] = NAN
    assert instance.set(values) == DISCARD
    if state == "instantiated":
        instance.enter()
    starts = {v.name: float(v.start) for v in instance.description.modelVariables if v.start is not None}
    assert {name: instance.get(name) for name in starts} == starts
    instance.free()


@FMI
def test_a_refused_set_changes_nothing_of_the_simulation(fmi):
    with flying(TUMBLING, fmi) as calm, flying(TUMBLING, fmi) as disturbed:
        for instance in (calm, disturbed):
            instance.set({"torque": [1e4, 0.0, 0.0]})
            instance.step(0.5)
        assert disturbed.set({"DG.mass": 12e3, "torque[1]": NAN}) == DISCARD
        for instance in (calm, disturbed):
            assert instance.step(0.5) == OK
        assert outputs(disturbed) == outputs(calm)


# Unusable together: stored by set, refused at first use.


@REFUSAL
@FMI
def test_unusable_values_are_stored_as_set(fmi, raw, bad, text):
    with flying(raw, fmi) as instance:
        assert instance.set(bad) == OK
        assert {name: list(np.ravel(instance.get(name))) for name in bad} == {
            name: list(np.ravel(value)) for name, value in bad.items()
        }
        assert instance.messages() == []


@REFUSAL
@FMI
def test_unusable_values_are_refused_at_the_end_of_initialisation(fmi, raw, bad, text):
    instance = Instance(raw, fmi)
    instance.enter()
    instance.set(bad)
    assert instance.exit() == refusal(fmi)
    [message] = instance.messages()
    assert message.startswith(f"fmi{fmi}ExitInitializationMode: ")
    assert text in message
    instance.free()


@REFUSAL
@FMI
def test_unusable_values_are_refused_by_a_step(fmi, raw, bad, text):
    with flying(raw, fmi) as instance:
        instance.step(0.5)
        instance.set(bad)
        assert instance.step(0.5) == refusal(fmi)
        [message] = instance.messages()
        assert message.startswith(f"fmi{fmi}DoStep: ")
        assert text in message


@REFUSAL
@FMI
def test_unusable_values_are_refused_by_a_get_of_an_output_that_depends_on_them(fmi, raw, bad, text):
    with flying(raw, fmi) as instance:
        instance.step(0.5)
        instance.set(bad)
        assert instance.get_status("inertia[1,1]") == refusal(fmi)
        [message] = instance.messages()
        assert message.startswith("fmi3GetFloat64: " if fmi == 3 else "fmi2GetReal: ")
        assert text in message


def output_derivative(instance: Instance) -> Any:
    references = [instance.references["angular_velocity[1]"]]
    getter = instance.fmu.getOutputDerivatives if instance.fmi == 3 else instance.fmu.getRealOutputDerivatives
    return getter(references, [1])


USES: dict[str, Callable[[Instance], Any]] = {
    "rate": lambda i: i.get("der(state.angular_velocity[1])"),
    "output derivative": output_derivative,
    "directional derivative": lambda i: i.directional(["inertia[1,1]"], ["torque[1]"], [1.0]),
    "adjoint derivative": lambda i: i.adjoint(["inertia[1,1]"], ["torque[1]"], [1.0]),
}


@REFUSAL
@pytest.mark.parametrize(
    ("fmi", "use"), [(fmi, use) for fmi in (2, 3) for use in USES if (fmi, use) != (2, "adjoint derivative")]
)
def test_unusable_values_are_refused_by_whatever_asks_for_a_derivative(fmi, use, raw, bad, text):
    with flying(raw, fmi) as instance:
        instance.step(0.5)
        instance.set(bad)
        assert instance._status(USES[use], instance) == refusal(fmi)
        [message] = instance.messages()
        assert text in message


@REFUSAL
@pytest.mark.parametrize("state", ["initialising", "stepping"])
@FMI
def test_outputs_that_do_not_depend_on_unusable_values_are_read(fmi, state, raw, bad, text):
    instance = Instance(raw, fmi)
    instance.enter()
    if state == "stepping":
        instance.exit()
        instance.step(0.5)
    before = {name: list(instance.get(name)) for name in INDEPENDENT}
    instance.set(bad)
    assert {name: list(instance.get(name)) for name in INDEPENDENT} == before
    instance.free()


@FMI
def test_a_call_that_asks_for_one_dependent_output_among_others_is_refused(fmi):
    with flying(TUMBLING, fmi) as instance:
        instance.set({"DG.mass": -1.0})
        references = [instance.references[name] for name in ("attitude[1]", "mass", "attitude[2]")]
        getter = instance.fmu.getFloat64 if fmi == 3 else instance.fmu.getReal
        assert instance._status(getter, references) == refusal(fmi)


@FMI
def test_outputs_that_do_not_depend_on_an_unusable_attitude_are_read(fmi):
    instance = Instance(TUMBLING, fmi)
    instance.enter()
    instance.set({"attitude_start": [0.0, 0.0, 0.0, 0.0]})
    statuses = {n: instance.get_status(n) for n in ("mass", "inertia", "angular_velocity", "kinetic_energy")}
    assert statuses == dict.fromkeys(statuses, OK)
    instance.free()


@pytest.mark.parametrize("name", ["attitude[2]", "angular_momentum[1]"])
@FMI
def test_an_output_that_depends_on_an_unusable_attitude_is_refused(fmi, name):
    instance = Instance(TUMBLING, fmi)
    instance.enter()
    instance.set({"attitude_start": [0.0, 0.0, 0.0, 0.0]})
    assert instance.get_status(name) == refusal(fmi)
    assert "attitude_start = (0, 0, 0, 0): must have a length greater than 0" in instance.messages()[-1]
    instance.free()


@REFUSAL
@FMI
def test_a_refused_step_says_that_it_has_not_moved(fmi, raw, bad, text):
    with flying(raw, fmi, start=3.0) as instance:
        instance.step(0.5)
        instance.set(bad)
        assert last_successful_time(instance, 0.25, refusal(fmi)) == 3.5
        assert instance.get("time") == 3.5


@pytest.mark.parametrize("factor", [1.0, 2.0], ids=["to what it was", "to something else"])
@REFUSAL
@FMI
def test_a_refused_episode_leaves_no_trace_once_corrected(fmi, raw, bad, text, factor):
    with flying(raw, fmi) as calm, flying(raw, fmi) as disturbed:
        good = {name: disturbed.get(name) for name in bad}
        moments = next(name for name in ("DG.pmi", "B.pmi") if name + "[1]" in disturbed.references)
        good[moments] = factor * disturbed.get(moments)
        runs = []
        for instance in (calm, disturbed):
            assert instance.step(0.5) == OK
            if instance is disturbed:
                assert instance.set(bad) == OK
                assert [instance.step(0.1), instance.step(0.7)] == [refusal(fmi)] * 2
                assert instance.get_status("mass") in (OK, refusal(fmi))
                assert instance.get_status("inertia") == refusal(fmi)
                instance.get("attitude")
                assert instance.step(0.1) == refusal(fmi)
            assert instance.set(good) == OK
            run = [outputs(instance)]
            for _ in range(3):
                assert instance.step(0.5) == OK
                run.append(outputs(instance))
            runs.append(run)
    assert runs[0] == runs[1]


@REFUSAL
@FMI
def test_initialisation_ends_once_the_values_are_corrected(fmi, raw, bad, text):
    with flying(raw, fmi) as fresh:
        instance = Instance(raw, fmi)
        instance.enter()
        good = {name: instance.get(name) for name in bad}
        instance.set(bad)
        assert [instance.exit(), instance.exit()] == [refusal(fmi)] * 2
        instance.set(good)
        assert instance.exit() == OK
        assert [instance.step(0.5), fresh.step(0.5)] == [OK, OK]
        assert outputs(instance) == outputs(fresh)
        instance.free()


@pytest.mark.parametrize("use", ["exit", "get"])
@REFUSAL
def test_an_instance_of_fmi_2_that_answered_error_flies_again_after_reset(raw, bad, text, use):
    with flying(raw, 2) as fresh:
        instance = Instance(raw, 2)
        instance.enter()
        instance.set(bad)
        assert (instance.exit() if use == "exit" else instance.get_status("inertia")) == ERROR
        assert instance.exit() == ERROR
        assert instance.reset() == OK
        assert instance.initialise() == OK
        assert [instance.step(0.5), fresh.step(0.5)] == [OK, OK]
        assert outputs(instance) == outputs(fresh)
        instance.free()


# One scalar at a time, in every order.

TURNED: dict[str, float] = {
    "DG.nose.direction[2]": 1.0,  # from (0, 0, -1) to (0, 1, 0)
    "DG.nose.direction[3]": 0.0,
    "DG.nose.alignment[2]": 0.0,  # from (0, 1, 0) to (0, 0, 1)
    "DG.nose.alignment[3]": 1.0,
    "DG.pmi[1]": 3.0,
    "DG.pmi[2]": 4.0,
    "DG.pmi[3]": 30.0 / 5.0,
}


@pytest.mark.parametrize(("fmi", "state"), [(2, "stepping"), (3, "stepping"), (3, "initialising")])
def test_a_port_is_turned_and_moments_are_set_one_scalar_at_a_time_in_every_order(fmi, state):
    with flying(ISS_DG, fmi, **TURNED) as fresh:
        truth = outputs(fresh)
    instance = Instance(ISS_DG, fmi, logging=False)
    refused, results = 0, set()
    for order in permutations(TURNED.items()):
        instance.reset()
        instance.enter()
        if state == "stepping":
            instance.exit()
        for name, value in order:
            assert instance.set({name: value}) == OK
            # At rest without torque a step that is taken leaves the state as it is.
            statuses = [instance.step(0.5)] if state == "stepping" else []
            statuses.append(instance.get_status("pmi[1]"))
            assert set(statuses) <= {OK, refusal(fmi)}, (order, name)
            refused += refusal(fmi) in statuses
        if state == "initialising":
            assert instance.exit() == OK
        results.add(tuple(outputs(instance)[1:]))
    instance.free()
    assert results == {tuple(truth[1:])}
    assert refused > 0
