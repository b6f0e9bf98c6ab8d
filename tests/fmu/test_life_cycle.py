"""From instantiation to reset: what an importer that obeys the standard sees of a built FMU."""

import math
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from fmpy.fmi2 import fmi2LastSuccessfulTime, fmi2Terminated

from supervessel import reference
from support import (
    DISCARD,
    EPS,
    ERROR,
    ISS_DG,
    OK,
    Instance,
    body,
    draw_inputs,
    flying,
    relative_error,
    scene,
    variant,
)
from support.marks import FMI

SEED = 20240612

# A quotient by the root of a sum of four squares is off by at most 2 EPS relative in each component; taking
# the norm again rounds by up to EPS more.
UNIT_TOLERANCE = 4 * EPS

# Sums of 12 points with about 5 roundings each, no term larger than the largest element compared.
COMPOSITE_TOLERANCE = 64 * EPS

SPINNING = variant(
    ISS_DG,
    {
        "name": "spinning",
        "rotation": {"angular_velocity": [0.01, -0.02, 0.03], "attitude": [1.0, 2.0, 3.0, 4.0]},
    },
)


def outputs(instance: Instance) -> list[float]:
    """Returns all outputs, states and rates, read in one call."""
    names = [v.name for v in instance.description.modelVariables if v.causality in ("output", "local")]
    getter = instance.fmu.getFloat64 if instance.fmi == 3 else instance.fmu.getReal
    return list(getter([instance.references[name] for name in names]))


def programme(instance: Instance, seed: int, steps: int = 25) -> Iterator[list[float]]:
    """Initialises an instance and flies it with inputs and step sizes drawn; yields the outputs each time."""
    generator = np.random.default_rng(seed)
    assert instance.enter() == OK
    assert (
        instance.set(draw_inputs(generator) | {"angular_velocity_start": generator.normal(size=3) * 0.1})
        == OK
    )
    yield outputs(instance)
    assert instance.exit() == OK
    for _ in range(steps):
        assert instance.set(draw_inputs(generator)) == OK
        yield outputs(instance)
        assert instance.step(generator.uniform(0.01, 5.0)) == OK
        yield outputs(instance)


def exchange(instance: Instance, seed: int, moves: int = 25) -> Iterator[list[float]]:
    """Takes an instance of model exchange through its modes, inputs and states drawn; yields the outputs."""
    generator = np.random.default_rng(seed)
    assert instance.enter() == OK
    assert (
        instance.set(draw_inputs(generator) | {"angular_velocity_start": generator.normal(size=3) * 0.1})
        == OK
    )
    yield outputs(instance)
    assert instance.exit() == OK
    yield outputs(instance)
    assert instance.run() == OK
    for _ in range(moves):
        states = {
            "state.attitude": generator.normal(size=4),
            "state.angular_velocity": generator.normal(size=3) * 0.1,
        }
        assert instance.set(draw_inputs(generator) | states) == OK
        assert instance._status(instance.fmu.setTime, generator.uniform(0.0, 10.0)) == OK
        yield [*outputs(instance), instance.get("time")]


def alone(fmi: int, seed: int, steps: int = 25) -> list[list[float]]:
    """Returns what a programme gives when nothing else runs."""
    instance = Instance(ISS_DG, fmi, logging=False)
    result = list(programme(instance, seed, steps))
    instance.free()
    return result


def expected(raw: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the outputs at the start by the numpy reference, from values by group or name."""
    scalars: dict[str, float] = {}
    for name, value in values.items():
        numbers = np.ravel(value)
        names = [name] if np.ndim(value) == 0 else [f"{name}[{i + 1}]" for i in range(len(numbers))]
        scalars |= {n: float(x) for n, x in zip(names, numbers, strict=True)}
    whole = reference.composite(scene(raw), scalars)
    omega = np.array([scalars[f"angular_velocity_start[{i}]"] for i in (1, 2, 3)])
    attitude = np.array([scalars[f"attitude_start[{i}]"] for i in (1, 2, 3, 4)])
    attitude /= np.linalg.norm(attitude)
    momentum = whole.inertia @ omega
    return {
        "mass": whole.mass,
        "barycentre": whole.barycentre,
        "pmi": whole.pmi,
        "inertia": whole.inertia.ravel(),
        "angular_velocity": omega,
        "attitude": attitude,
        "kinetic_energy": omega @ momentum / 2.0,
        "angular_momentum": reference.rotation_matrix(attitude) @ momentum,
    }


@FMI
def test_interleaved_instances_give_bit_for_bit_what_they_give_alone(fmi):
    seeds = (SEED, SEED + 1, SEED + 2)
    instances = [Instance(ISS_DG, fmi, name=f"number {seed}") for seed in seeds]
    together = zip(*(programme(i, seed) for i, seed in zip(instances, seeds, strict=True)), strict=True)
    runs = [list(run) for run in zip(*together, strict=True)]
    for instance in instances:
        instance.free()
    assert runs == [alone(fmi, seed) for seed in seeds]


@FMI
def test_instances_on_threads_give_bit_for_bit_what_they_give_alone(fmi):
    seeds = (SEED, SEED + 1)
    with ThreadPoolExecutor(len(seeds)) as pool:
        runs = list(pool.map(lambda seed: alone(fmi, seed, 500), seeds))
    assert runs == [alone(fmi, seed, 500) for seed in seeds]


@FMI
def test_instances_of_both_interfaces_run_side_by_side(fmi):
    stepping, exchanged = Instance(ISS_DG, fmi), Instance(ISS_DG, fmi, exchange=True)
    runs = zip(*zip(programme(stepping, SEED, 13), exchange(exchanged, SEED), strict=True), strict=True)
    steps, moves = map(list, runs)
    stepping.free()
    exchanged.free()
    other = Instance(ISS_DG, fmi, exchange=True, logging=False)
    assert moves == list(exchange(other, SEED))
    assert steps == alone(fmi, SEED, 13)
    other.free()


@FMI
def test_freeing_an_instance_leaves_the_others_alone(fmi):
    kept, freed = Instance(ISS_DG, fmi), Instance(ISS_DG, fmi)
    run, other = programme(kept, SEED), programme(freed, SEED + 1)
    result = [next(run) for _ in range(7)]
    assert next(other)
    freed.free()
    result += list(run)
    kept.free()
    assert result == alone(fmi, SEED)


def spoil(instance: Instance, moment: str) -> None:
    """Brings a fresh instance, inputs and parameters changed, to a moment of its life."""
    rates = {"angular_velocity_start": [1.0, 2.0, 3.0], "attitude_start": [0.0, 0.0, 5.0, 0.0]}
    instance.set(draw_inputs(np.random.default_rng(SEED)) | rates)
    if moment != "instantiated":
        assert instance.enter(start=17.0, stop=18.0) == OK
    if moment not in ("instantiated", "initialising"):
        assert instance.exit() == OK
        assert instance.step(0.5) == OK
    if moment == "with unusable inputs":
        assert instance.set({"DG.mass": -1.0}) == OK
        assert instance.step(0.1) == DISCARD
    if moment == "terminated":
        assert instance._status(instance.fmu.terminate) == OK
    if moment == "after an error":
        assert instance.step(-1.0) == ERROR


MOMENT = pytest.mark.parametrize(
    "moment",
    ["instantiated", "initialising", "stepping", "with unusable inputs", "terminated", "after an error"],
)


@MOMENT
@FMI
def test_reset_gives_the_first_run_again_bit_for_bit(fmi, moment):
    instance = Instance(ISS_DG, fmi)
    spoil(instance, moment)
    assert instance.reset() == OK
    again = list(programme(instance, SEED))
    instance.free()
    assert again == alone(fmi, SEED)


@MOMENT
@FMI
def test_reset_restores_every_start_value_and_time(fmi, moment):
    instance = Instance(SPINNING, fmi)
    spoil(instance, moment)
    assert instance.reset() == OK
    instance.enter()
    starts = {v.name: float(v.start) for v in instance.description.modelVariables if v.start is not None}
    assert {name: instance.get(name) for name in starts} == starts
    assert instance.get("time") == 0.0
    instance.free()


@MOMENT
@FMI
def test_reset_gives_the_outputs_of_a_new_instance(fmi, moment):
    instance = Instance(SPINNING, fmi)
    spoil(instance, moment)
    assert instance.reset() == OK
    assert instance.initialise() == OK
    with flying(SPINNING, fmi) as fresh:
        assert outputs(instance) == outputs(fresh)
    instance.free()


def spoil_exchange(instance: Instance, moment: str) -> None:
    """Brings a fresh instance of model exchange, everything changed that can be, to a moment of its life."""
    rates = {"angular_velocity_start": [1.0, 2.0, 3.0], "attitude_start": [0.0, 0.0, 5.0, 0.0]}
    instance.set(draw_inputs(np.random.default_rng(SEED)) | rates)
    if moment != "instantiated":
        assert instance.enter(start=17.0, stop=18.0) == OK
    if moment not in ("instantiated", "initialising"):
        assert instance.exit() == OK
    if moment not in ("instantiated", "initialising", "event"):
        assert instance.run() == OK
        assert instance._status(instance.fmu.setTime, 17.5) == OK
        assert instance.set({"state.attitude[2]": 0.25, "state.angular_velocity[3]": -7.0}) == OK
    if moment == "with unusable inputs":
        assert instance.set({"DG.mass": -1.0}) == OK
        assert instance.get_status("mass") == DISCARD
    if moment == "with an unusable attitude":
        assert instance.set({"state.attitude": [0.0, 0.0, 0.0, 0.0]}) == OK
        assert instance.get_status("attitude") == DISCARD
    if moment == "terminated":
        assert instance._status(instance.fmu.terminate) == OK
    if moment == "after an error":
        assert instance.set({"mass": 1.0}) == ERROR


@pytest.mark.parametrize(
    "moment",
    [
        "instantiated",
        "initialising",
        "event",
        "continuous",
        "with unusable inputs",
        "with an unusable attitude",
        "terminated",
        "after an error",
    ],
)
@FMI
def test_reset_of_model_exchange_gives_the_first_run_again_bit_for_bit(fmi, moment):
    instance, fresh = (Instance(SPINNING, fmi, exchange=True) for _ in range(2))
    spoil_exchange(instance, moment)
    assert instance.reset() == OK
    assert list(exchange(instance, SEED)) == list(exchange(fresh, SEED))
    assert [instance.reset(), fresh.reset()] == [OK, OK]
    assert [instance.enter(), fresh.enter()] == [OK, OK]
    everything = list(instance.references)
    assert [instance.get(name) for name in everything] == [fresh.get(name) for name in everything]
    instance.free()
    fresh.free()


def trajectory(fmi: int, start: float, clock: str, stop: float | None = None) -> list[list[float]]:
    """Returns the outputs over 60 steps of 0.1 s, the importer's times being sums or products."""
    h, result = 0.1, []
    instance = Instance(SPINNING, fmi)
    assert instance.initialise(start, stop) == OK
    for i in range(60):
        if clock == "product":
            instance.time = start + i * h
        assert instance.step(h) == OK, instance.messages()
        result.append(outputs(instance))
    instance.free()
    return result


@pytest.mark.parametrize("clock", ["sum", "product"])
@pytest.mark.parametrize("start", [1e5, 1e-3, -3.0, -0.7, -1e5])
@FMI
def test_start_time_does_not_change_the_trajectory(fmi, start, clock):
    assert trajectory(fmi, start, clock) == trajectory(fmi, 0.0, "sum")


@pytest.mark.parametrize("clock", ["sum", "product"])
@pytest.mark.parametrize("start", [0.0, 1e5, -6.0, -3.0, -1e5, 1e9])
@FMI
def test_an_importer_reaches_its_stop_time_by_multiples_of_the_step(fmi, start, clock):
    if clock == "product":
        stop = start + 60 * 0.1
    else:
        stop = start
        for _ in range(60):
            stop += 0.1
    assert len(trajectory(fmi, start, clock, stop)) == 60


@pytest.mark.parametrize("start", [0.0, -3.0, 1e5])
@FMI
def test_times_beyond_rounding_are_not_taken_for_it(fmi, start):
    h, slack = 0.1, 32 * EPS * max(abs(start), 0.1)
    for shift in (-slack, slack):
        instance = Instance(SPINNING, fmi)
        assert instance.initialise(start, stop=start + 60.0) == OK
        assert instance.step(h) == OK
        instance.time += shift
        assert instance.step(h) == ERROR
        instance.free()
    instance = Instance(SPINNING, fmi)
    assert instance.initialise(start, stop=start + h) == OK
    assert instance.step(h + slack) == ERROR
    instance.free()


@pytest.mark.parametrize("clock", ["sum", "product"])
@FMI
def test_a_hundred_thousand_steps_are_taken_whichever_way_the_importer_counts_time(fmi, clock):
    h, time = 0.1, 0.0
    with flying(body(law="none"), fmi) as instance:
        for i in range(100_000):
            instance.time = time
            if instance.step(h) != OK:
                pytest.fail(f"step {i}: {instance.messages()}")
            time = time + h if clock == "sum" else (i + 1) * h
        # The instance adds the last step to the importer's own time: one rounding.
        assert abs(instance.get("time") - time) <= EPS * time


@pytest.mark.parametrize("start", [0.0, 1e5, -3.0])
@FMI
def test_time_can_be_read_and_advances_by_the_step_sizes(fmi, start):
    instance = Instance(ISS_DG, fmi)
    instance.enter(start)
    times = [instance.get("time")]
    instance.exit()
    for h in (0.5, 0.125, 3.0):
        instance.step(h)
        times.append(instance.get("time"))
    instance.free()
    assert times == [start, start + 0.5, start + 0.625, start + 3.625]


@FMI
def test_a_step_reports_its_end_as_the_last_successful_time(fmi):
    with flying(ISS_DG, fmi) as instance:
        if fmi == 3:
            assert instance.fmu.doStep(0.0, 0.75) == (False, False, False, 0.75)
        else:
            instance.fmu.doStep(0.0, 0.75)
            assert instance.fmu.getRealStatus(fmi2LastSuccessfulTime) == 0.75
            assert instance.fmu.getBooleanStatus(fmi2Terminated) is False


@pytest.mark.parametrize("read", ["initialising", "stepping"])
@pytest.mark.parametrize("set_", ["instantiated", "initialising"])
@pytest.mark.parametrize("seed", range(SEED, SEED + 3))
@FMI
def test_outputs_at_the_start_follow_from_what_was_set(fmi, seed, set_, read):
    generator = np.random.default_rng(seed)
    values = draw_inputs(generator) | {
        "angular_velocity_start": generator.normal(size=3),
        "attitude_start": generator.normal(size=4) * 10.0,
    }
    instance = Instance(ISS_DG, fmi)
    if set_ == "instantiated":
        assert instance.set(values) == OK
    instance.enter()
    if set_ == "initialising":
        outputs(instance)  # what has been computed by now must not stay
        assert instance.set(values) == OK
    if read == "stepping":
        assert instance.exit() == OK
    errors = {
        name: relative_error(instance.get(name), truth) for name, truth in expected(ISS_DG, values).items()
    }
    instance.free()
    assert max(errors.values()) <= COMPOSITE_TOLERANCE, errors


@FMI
def test_outputs_between_steps_follow_from_inputs_and_state(fmi):
    values = draw_inputs(np.random.default_rng(SEED))
    with flying(SPINNING, fmi) as instance:
        assert instance.step(10.0) == OK
        assert instance.set(values) == OK
        state = {f"{name}_start": instance.get(name) for name in ("angular_velocity", "attitude")}
        errors = {
            name: relative_error(instance.get(name), truth)
            for name, truth in expected(SPINNING, values | state).items()
        }
    assert max(errors.values()) <= COMPOSITE_TOLERANCE, errors


@pytest.mark.parametrize("first", ["attitude", "kinetic_energy", "mass"])
@FMI
def test_outputs_follow_from_inputs_whichever_is_read_first(fmi, first):
    with flying(SPINNING, fmi) as instance, flying(SPINNING, fmi) as other:
        for change in (20000.0, 15000.0):
            instance.set({"DG.mass": change})
            instance.get(first)
            other.set({"DG.mass": change})
            assert outputs(instance) == outputs(other)
        assert instance.get("mass") == 470000.0


@FMI
def test_a_change_of_mass_or_pose_keeps_angular_velocity_and_attitude(fmi):
    with flying(SPINNING, fmi) as instance:
        instance.step(10.0)
        names = "angular_velocity", "attitude", "state.angular_velocity", "state.attitude"
        before = [x for name in names for x in instance.get(name)]
        instance.set(draw_inputs(np.random.default_rng(SEED)))
        assert [x for name in names for x in instance.get(name)] == before


@FMI
def test_the_rate_is_the_state_and_the_attitude_is_the_state_at_unit_length(fmi):
    with flying(SPINNING, fmi) as instance:
        for _ in range(100):
            instance.step(0.5)
            assert list(instance.get("angular_velocity")) == list(instance.get("state.angular_velocity"))
            # The state is at unit length within rounding: once more changes it by no more than that.
            assert np.abs(instance.get("attitude") - instance.get("state.attitude")).max() <= UNIT_TOLERANCE


@pytest.mark.parametrize(
    "attitude",
    [
        [1.0, 2.0, 3.0, 4.0],
        [-1e-3, 2e-3, 0.0, 5e-4],
        [1e300, -1e300, 1.7e308, 1e290],
        [3e-300, 1e-300, 0.0, -2e-300],
        [0.0, 5e-324, 0.0, 0.0],
        [1e-320, 3e-320, -2e-320, 7e-321],
        [1.0, 1e-300, 0.0, 0.0],
    ],
    ids=str,
)
@FMI
def test_an_attitude_at_the_start_of_any_length_is_normalised(fmi, attitude):
    exact = [Fraction(x) for x in attitude]
    scale = max(map(abs, exact))
    scaled = [x / scale for x in exact]
    square = sum(x * x for x in scaled)
    with flying(body(), fmi, attitude_start=attitude) as instance:
        found = instance.get("attitude")
    for q, x in zip(found, scaled, strict=True):
        # Compared by squares, whose relative error is twice as large.
        assert abs(Fraction(float(q)) ** 2 - x * x / square) <= Fraction(2 * UNIT_TOLERANCE) * x * x / square
        assert q * x >= 0


def test_an_attitude_of_length_zero_is_refused_at_the_end_of_initialisation_and_can_be_corrected():
    instance = Instance(body(), 3)
    instance.enter()
    assert instance.set({"attitude_start": [0.0, 0.0, 0.0, 0.0]}) == OK
    assert instance.exit() == DISCARD
    assert "attitude_start = (0, 0, 0, 0): must have a length greater than 0" in instance.messages()[-1]
    assert instance.set({"attitude_start[3]": -2.0}) == OK
    assert instance.exit() == OK
    assert list(instance.get("attitude")) == [0.0, 0.0, -1.0, 0.0]
    instance.free()


def test_an_attitude_of_length_zero_ends_an_instance_of_fmi_2_until_it_is_reset():
    instance = Instance(body(), 2)
    instance.enter()
    assert instance.set({"attitude_start": [0.0, 0.0, 0.0, 0.0]}) == OK
    assert instance.exit() == ERROR
    assert "attitude_start = (0, 0, 0, 0): must have a length greater than 0" in instance.messages()[-1]
    assert instance.reset() == OK
    assert instance.initialise() == OK
    instance.free()


@FMI
def test_the_attitude_stays_at_unit_length_over_a_hundred_thousand_steps(fmi):
    worst = 0.0
    with flying(body(), fmi, angular_velocity_start=[0.3, 0.2, -0.25]) as instance:
        for i in range(100_000):
            instance.step(0.1)
            if i % 10 == 0:
                for name in ("attitude", "state.attitude"):
                    worst = max(worst, abs(math.sqrt(math.fsum(q * q for q in instance.get(name))) - 1.0))
    assert worst <= UNIT_TOLERANCE


def computed(instance: Instance) -> int:
    """Returns how often the composite has been computed."""
    return sum(category == "logComposite" for _, category, _ in instance.log)


@FMI
def test_a_value_set_again_does_not_compute_the_composite_again(fmi):
    with flying(ISS_DG, fmi) as instance:
        before = computed(instance)
        for _ in range(3):
            instance.set({"DG.mass": 24500.0, "DG.pmi": [15.5, 22.1, 7.7], "DG.nose.direction": [0, 0, -1]})
            outputs(instance)
            instance.step(0.1)
        assert computed(instance) == before


@pytest.mark.parametrize("use", ["step", "get", "both"])
@FMI
def test_changed_values_compute_the_composite_once(fmi, use):
    with flying(ISS_DG, fmi) as instance:
        before = computed(instance)
        instance.set({"DG.mass": 20000.0})
        instance.set({"DG.pmi[1]": 16.0})
        instance.set({"DG.nose.position[2]": -0.5, "DG.mass": 19000.0})
        if use != "step":
            instance.get("inertia")
            outputs(instance)
        if use != "get":
            instance.step(0.1)
            instance.step(0.1)
        assert computed(instance) == before + 1


@FMI
def test_torque_and_start_parameters_do_not_compute_the_composite(fmi):
    instance = Instance(ISS_DG, fmi)
    instance.enter()
    outputs(instance)
    before = computed(instance)
    instance.set({"torque": [1.0, 2.0, 3.0], "angular_velocity_start": [0.1, 0.2, 0.3]})
    outputs(instance)
    instance.exit()
    instance.set({"torque": [3.0, 2.0, 1.0]})
    instance.step(0.1)
    outputs(instance)
    assert computed(instance) == before
    instance.free()


@FMI
def test_outputs_that_do_not_depend_on_changed_inputs_compute_nothing(fmi):
    with flying(ISS_DG, fmi) as instance:
        before = computed(instance)
        instance.set({"DG.mass": 20000.0})
        instance.get("attitude")
        instance.get("angular_velocity")
        instance.get("state.attitude")
        instance.get("state.angular_velocity")
        instance.get("der(state.attitude")
        instance.get("time")
        assert computed(instance) == before


@FMI
def test_inputs_are_read_back_as_set(fmi):
    values = draw_inputs(np.random.default_rng(SEED))
    with flying(ISS_DG, fmi) as instance:
        instance.set(values)
        for _ in range(2):
            assert all(np.array_equal(instance.get(name), value) for name, value in values.items())
            instance.step(0.1)


@FMI
def test_reading_in_one_call_gives_what_single_calls_give_in_any_order(fmi):
    with flying(SPINNING, fmi) as instance:
        instance.step(1.0)
        references = list(instance.references.values())
        getter = instance.fmu.getFloat64 if fmi == 3 else instance.fmu.getReal
        single = {r: getter([r])[0] for r in references}
        shuffled = [int(r) for r in np.random.default_rng(SEED).permutation(references * 2)]
        assert getter(shuffled) == [single[r] for r in shuffled]


@FMI
def test_outputs_can_be_read_after_termination(fmi):
    with flying(SPINNING, fmi) as instance:
        instance.step(1.0)
        before = outputs(instance)
        assert instance._status(instance.fmu.terminate) == OK
        assert outputs(instance) == before


def provoke(instance: Instance) -> None:
    """Gives an initialised instance a reason for a line of each category."""
    instance.set({"DG.mass": instance.get("DG.mass") / 2.0})
    instance.step(0.1)
    instance.set({"DG.mass": -1.0})
    instance.step(0.1)
    instance.set({"mass": 1.0})


@pytest.mark.parametrize(
    ("categories", "logged"),
    [
        ([], {"logComposite", "logStatusDiscard", "logStatusError"}),
        (["logAll"], {"logComposite", "logStatusDiscard", "logStatusError"}),
        (["logComposite"], {"logComposite"}),
        (["logStatusDiscard"], {"logStatusDiscard"}),
        (["logStatusError", "logComposite"], {"logComposite", "logStatusError"}),
    ],
)
@FMI
def test_only_the_categories_turned_on_are_logged(fmi, categories, logged):
    instance = Instance(ISS_DG, fmi, logging=False)
    assert instance._status(instance.fmu.setDebugLogging, True, categories) == OK
    instance.initialise()
    provoke(instance)
    assert {category for _, category, _ in instance.log} == logged
    instance.free()


@FMI
def test_the_categories_are_those_of_the_model_description(fmi):
    instance = Instance(ISS_DG, fmi)
    declared = [category.name for category in instance.description.logCategories]
    assert declared == ["logStatusDiscard", "logStatusError", "logComposite", "logAll"]
    for category in declared:
        assert instance._status(instance.fmu.setDebugLogging, True, [category]) == OK
    instance.free()


@FMI
def test_each_category_has_its_status(fmi):
    with flying(ISS_DG, fmi) as instance:
        provoke(instance)
        assert {(category, status) for status, category, _ in instance.log} == {
            ("logComposite", OK),
            ("logStatusDiscard", DISCARD),
            ("logStatusError", ERROR),
        }


@FMI
def test_nothing_is_logged_while_logging_is_off(fmi):
    instance = Instance(ISS_DG, fmi, logging=False)
    instance.initialise()
    provoke(instance)
    assert instance.log == []
    instance.free()


@FMI
def test_logging_can_be_turned_off(fmi):
    with flying(ISS_DG, fmi) as instance:
        instance._status(instance.fmu.setDebugLogging, False, [])
        lines = len(instance.log)
        provoke(instance)
        assert len(instance.log) == lines


@FMI
def test_log_settings_outlive_a_reset(fmi):
    instance = Instance(ISS_DG, fmi, logging=False)
    instance._status(instance.fmu.setDebugLogging, True, ["logStatusDiscard"])
    instance.reset()
    instance.initialise()
    provoke(instance)
    assert {category for _, category, _ in instance.log} == {"logStatusDiscard"}
    instance.free()


@FMI
def test_steps_of_any_size_follow_a_steady_spin(fmi):
    rate, angle = 0.4, 0.05
    generator = np.random.default_rng(SEED)
    sizes = [*10.0 ** generator.uniform(-4, 2, 60), 1e-9, 300.0]
    with flying(body(max_angle_step=angle), fmi, angular_velocity_start=[0.0, 0.0, rate]) as instance:
        for h in sizes:
            assert instance.step(h) == OK
        w, _, _, z = instance.get("attitude")
    # RK4 turns a quaternion by x = rate h/2 with a phase error of x^5/120, half that of the attitude.
    # Sub-steps turn by `angle` at most: they are as many as it goes into the whole, and one more a step.
    # Doubled for the terms beyond.
    turned = rate * sum(sizes)
    tolerance = 2 * (turned / angle + len(sizes)) * 2 * (angle / 2) ** 5 / 120
    assert abs(math.remainder(2 * math.atan2(z, w) - turned, 2 * math.pi)) <= tolerance
