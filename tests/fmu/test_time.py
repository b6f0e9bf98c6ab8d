"""Time of an instance: any start, steps of any size, the stop time, sums and products of the step."""

import math

import numpy as np
import pytest
from fmpy.fmi2 import fmi2LastSuccessfulTime, fmi2Terminated

from fmu.programmes import SEED, SPINNING, outputs
from support import EPS, ERROR, ISS_DG, OK, Instance, body, flying
from support.marks import FMI


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
    for shift, status in ((0.9e-9 * h, OK), (1.1e-9 * h + slack, ERROR)):
        instance = Instance(SPINNING, fmi)
        assert instance.initialise(start, stop=start + h) == OK
        assert instance.step(h + shift) == status
        instance.free()


@pytest.mark.parametrize(("start", "h", "steps"), [(0.0, 0.1, 6000), (0.0, 1e-3, 20_000)])
@FMI
def test_an_importer_that_adds_step_sizes_up_reaches_the_stop_time_that_is_their_product(
    fmi, start, h, steps
):
    instance = Instance(body(law="none"), fmi)
    assert instance.initialise(start, stop=start + steps * h) == OK
    time = start
    for i in range(steps):
        instance.time = time
        if instance.step(h) != OK:
            pytest.fail(f"step {i}: {instance.messages()}")
        time += h
    assert time > start + steps * h  # else nothing is asked of the last step
    assert instance.step(h) == ERROR
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
