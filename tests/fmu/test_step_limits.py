"""Steps that need too many sub-steps or leave the range of numbers: discarded without a trace."""

import pytest

from fmu.refusals import last_successful_time, outputs
from support import DISCARD, ERROR, OK, Instance, body, flying
from support.marks import FMI

LIMIT = 1e7
ANGLE = 0.5
FAST = 100.0  # rad/s
HOPELESS = (
    8.6e153  # rad/s: times itself and 2500/1024, the largest moment as the law scales it, beyond all numbers
)

TOO_MUCH = pytest.mark.parametrize(
    ("rates", "torque", "h", "numbers"),
    [
        pytest.param(
            [0.0, 0.0, 1e9],
            [0.0, 0.0, 0.0],
            2.0,
            ["communicationStepSize = 2 s", "max_angle_step = 0.5 rad", "(0, 0, 1000000000) rad/s", "1e+07"],
            id="too fast",
        ),
        pytest.param(
            [0.0, 0.0, 0.0],
            [0.0, 0.0, 2.5e6],  # 1000 rad/s2: pi/2 * 1e10 sub-steps, most of them not foreseen at rest
            4e3,
            ["communicationStepSize = 4000 s", "max_angle_step = 0.5 rad", "1e+07"],
            id="too fast on the way",
        ),
        pytest.param(
            [0.0, HOPELESS, HOPELESS],
            [0.0, 0.0, 0.0],
            1e-156,
            ["range of finite numbers", "(0, 8.6e+153, 8.6e+153) rad/s"],
            id="overflow",
        ),
        pytest.param([0.0, 0.0, 1e200], [0.0, 0.0, 0.0], 1.0, ["(0, 0, 1e+200) rad/s"], id="beyond squares"),
        pytest.param([0.0, 0.0, 0.1], [1e300, 0.0, 0.0], 1.0, ["communicationStepSize = 1 s"], id="torque"),
    ],
)


@TOO_MUCH
@FMI
def test_a_step_that_cannot_be_taken_is_discarded_with_its_numbers(fmi, rates, torque, h, numbers):
    raw = body(max_angle_step=ANGLE)
    with flying(raw, fmi, angular_velocity_start=rates, torque=torque) as instance:
        assert last_successful_time(instance, h) == 0.0
        [message] = instance.messages()
        assert [number for number in numbers if number not in message] == []


def sub_steps(count: float) -> float:
    """Returns the step size that takes `count` sub-steps at the rate FAST."""
    return count * ANGLE / FAST


@pytest.mark.parametrize(("count", "status"), [(LIMIT - 0.5, OK), (LIMIT + 0.5, DISCARD)])
def test_ten_million_sub_steps_are_taken_and_not_one_more(count, status):
    with flying(body(law="none", max_angle_step=ANGLE), angular_velocity_start=[0.0, FAST, 0.0]) as instance:
        assert instance.step(sub_steps(count)) == status


def states(instance: Instance) -> list[float]:
    """Returns the states; energies of such rates are beyond all numbers."""
    return [*instance.get("state.attitude"), *instance.get("state.angular_velocity")]


@TOO_MUCH
@FMI
def test_a_step_that_cannot_be_taken_leaves_no_trace(fmi, rates, torque, h, numbers):
    raw = body(max_angle_step=ANGLE)
    start = {"angular_velocity_start": rates, "torque": torque}
    with flying(raw, fmi, **start) as calm, flying(raw, fmi, **start) as disturbed:
        assert disturbed.step(h) == DISCARD
        assert states(disturbed) == states(calm)
        for instance in (calm, disturbed):
            assert instance.set({"torque": [0.0, 0.0, 1.0]}) == OK  # outputs are computed anew
            # No step is short enough for a rate of which the acceleration is beyond all numbers.
            assert instance.step(h * 1e-8) == (OK if max(rates) < HOPELESS else DISCARD)
        assert states(disturbed) == states(calm)


@FMI
def test_an_energy_beyond_all_numbers_is_refused_and_the_attitude_still_read(fmi):
    with flying(body(), fmi, angular_velocity_start=[1e200, 0.0, 0.0]) as instance:
        assert instance.get("attitude").tolist() == [1.0, 0.0, 0.0, 0.0]
        assert instance.get_status("kinetic_energy") == (DISCARD if fmi == 3 else ERROR)
        assert "kinetic_energy leaves the range of finite numbers" in instance.messages()[-1]


@FMI
def test_flight_goes_on_with_a_shorter_step_after_one_that_was_too_long(fmi):
    raw = body(max_angle_step=ANGLE)
    rates = {"angular_velocity_start": [0.3 * FAST, FAST, 0.2 * FAST]}
    with flying(raw, fmi, **rates) as calm, flying(raw, fmi, **rates) as disturbed:
        assert [calm.step(0.1), disturbed.step(0.1)] == [OK, OK]
        assert disturbed.step(sub_steps(2 * LIMIT)) == DISCARD
        assert [calm.step(0.1), disturbed.step(0.1)] == [OK, OK]
        assert outputs(disturbed) == outputs(calm)
