"""`error_bound` through the life of an instance: saved, refused, reset, read within a step."""

from math import isfinite, pi
from typing import Any

import pytest

from changes.histories import Values, elements
from changes.scenes import drawn_in
from fmu.bounds import CONTACT, showing, tug
from fmu.listeners import Listener
from fmu.saved_states import bytes_of, restore, save
from support import DISCARD, ERROR, OK, Instance, body, refusal
from support.marks import FMI, KIND

RAW = tug("principal", mass="momentum")
NONE = tug("none")
FLIGHT: list[Values] = [
    {},
    drawn_in(2.0),
    {"held.docked": 0.0, "stowed.docked": 1.0} | CONTACT,
    {"tank.mass": 150.0},
    {},
]
STEP = 0.1


def fly(instance: Instance, flight: list[Values] = FLIGHT) -> list[str]:
    """Returns the bound after each step, in hexadecimal."""
    found = []
    for inputs in flight:
        assert instance.set(inputs) == OK
        assert instance.step(STEP) == OK, instance.log
        found.append(instance.get("error_bound").hex())
    return found


def started(raw: dict[str, Any] = RAW, fmi: int = 3, **named: Any) -> Instance:
    instance = Instance(raw, fmi, optimised=False, **named)
    assert instance.initialise() == OK, instance.log
    return instance


@FMI
@pytest.mark.parametrize("pending", [False, True])
def test_a_restored_flight_goes_on_to_the_same_bits(fmi, pending):
    """Also with a change of inputs that no step has taken yet."""
    instance = started(fmi=fmi)
    fly(instance, FLIGHT[:2])
    if pending:
        assert instance.set({"tank.mass": 222.0}) == OK
        assert instance.get("error_bound") > 0.0
    state, content, time = save(instance), bytes_of(instance), instance.time
    first = fly(instance)
    assert instance._status(instance.fmu.setFMUState, state) == OK
    instance.time = time
    assert fly(instance) == first
    instance.fmu.freeFMUState(state)
    other = started(fmi=fmi)
    assert restore(other, content) == OK
    other.time = time
    assert fly(other) == first
    instance.free()
    other.free()


@FMI
@pytest.mark.parametrize("raw", [RAW, NONE], ids=["principal", "none"])
@pytest.mark.parametrize(
    "refused",
    [{"torque[1]": 1.7e308}, {"tank.mass": -1.0}, {"tug.arm.position[1]": 1e200}, {"tank.pmi[1]": 50.0}, "h"],
    ids=["torque", "mass", "composite", "moments", "sub-steps"],
)
def test_a_refused_step_leaves_it(fmi, raw, refused):
    if fmi == 2 and raw is NONE:
        pytest.skip("FMI 3 has it")
    instance, other = started(raw, fmi), started(raw, fmi)
    flights = [fly(each, FLIGHT[:2]) for each in (instance, other)]
    assert flights[0] == flights[1]
    if refused == "h":
        statuses = [instance.step(1e12)]
    else:
        kept = {name: instance.get(name) for name in refused}
        assert instance.set(refused) == OK
        statuses = [instance.step(STEP), instance.step(STEP)]
        assert instance.set(kept) == OK
    if refused == {"torque[1]": 1.7e308} and raw is NONE:
        assert statuses == [OK, OK]  # torque does nothing there
        instance.free()
        other.free()
        return
    too_long = refused in ("h", {"torque[1]": 1.7e308})
    assert set(statuses) == {DISCARD if too_long else refusal(fmi)}
    assert instance.get("error_bound").hex() == flights[0][-1]
    assert fly(instance, FLIGHT[3:]) == fly(other, FLIGHT[3:])
    instance.free()
    other.free()


@FMI
def test_a_reset_begins_again(fmi):
    instance = started(fmi=fmi)
    first = fly(instance)
    assert instance.reset() == OK
    assert instance.enter() == OK
    assert instance.get("error_bound") == 0.0
    assert instance.exit() == OK
    assert instance.get("error_bound") == 0.0
    assert fly(instance) == first
    instance.free()


@FMI
@KIND
def test_it_can_be_read_in_every_state(fmi, exchange):
    instance = Instance(RAW, fmi, exchange=exchange, optimised=False)
    expected = pi if exchange else 0.0
    if fmi == 3:  # before initialisation FMI 2 lets nothing be read
        assert instance.get("error_bound") == expected
    assert instance.enter() == OK
    assert instance.get("error_bound") == expected
    assert instance.exit() == OK
    assert instance.get("error_bound") == expected
    if exchange:
        assert instance.set(drawn_in(1.0)) == OK
        assert instance.run() == OK
        assert instance.set(elements("torque", (1.0, 2.0, 3.0))) == OK
        assert instance.get("error_bound") == pi
    else:
        assert 0.0 < float.fromhex(fly(instance)[-1]) < pi
    last = instance.get("error_bound")
    assert instance._status(instance.fmu.terminate) == OK
    assert instance.get("error_bound") == last
    assert instance.set({"error_bound": 0.0}) == ERROR
    instance.free()


def test_within_a_step_it_is_that_of_each_sub_step():
    listener = Listener(RAW)
    where = listener_outputs(listener).index("error_bound") + 1
    listener.set(elements("torque", (300.0, -200.0, 100.0)))
    assert listener.fly(2.0) == (OK, False, 2.0)
    found = [row[where] for row in listener.read]
    assert len(found) > 3
    assert found == sorted(found)
    assert found[0] > 0.0
    assert found[-1] == listener.get("error_bound")
    listener.free()


def listener_outputs(instance: Instance) -> list[str]:
    return [v.name for v in instance.description.modelVariables if v.causality == "output"]


def test_a_step_that_returns_early_leaves_it_there():
    """And the flight goes on from there as if the step had been so long."""

    def end(listener: Listener, time: float, flags: Any, wanted: Any, return_time: Any) -> None:
        if len(listener.times) == 2:
            wanted[0], return_time[0] = True, time

    listener = Listener(RAW, end)
    where = listener_outputs(listener).index("error_bound") + 1
    status, early, time = listener.fly(2.0)
    assert (status, early) == (OK, True)
    assert listener.get("error_bound") == listener.read[-1][where] > 0.0
    other = Instance(RAW)
    assert other.initialise() == OK
    assert other.step(time) == OK
    # Sub-steps of another length: nearly the same bound, not the same bits.
    assert other.get("error_bound") == pytest.approx(listener.get("error_bound"), rel=1e-2)
    listener.update = None
    before = listener.get("error_bound")
    assert listener.set({"tank.mass": 200.0}) == OK
    assert listener.fly(0.1)[0] == OK
    assert before < listener.get("error_bound") < pi
    listener.free()
    other.free()


@FMI
def test_under_model_exchange_it_says_nothing(fmi):
    instance = Instance(RAW, fmi, exchange=True, optimised=False)
    for _ in range(2):
        assert instance.reset() == OK
        assert instance.enter() == OK
        assert instance.get("error_bound") == pi
    assert instance.exit() == OK
    assert instance.set(drawn_in(2.0) | {"held.docked": 0.0}) == OK
    assert instance.run() == OK
    assert instance.get("error_bound") == pi
    instance.free()


# Where numbers are far from 1. Every call is watched for floating-point exceptions, see support.traps.

RATES = (0.0, 5e-324, 1e-310, 1e-300, 1e-160, 0.01, 1e8, 1e20, 1e160)
STEPS = (1e-300, 1e-20, 0.1, 1e9)
MOMENTS = (
    (1.0, 1.5, 2.0),
    (1.0, 1.0, 1.0),
    (1.0, 1.0 + 1e-12, 1.0),
    (1e-200, 1e-200, 1.5e-200),
    (1e200, 1.5e200, 2e200),
    (1e-200, 1e200, 1e200),
    (1e-12, 1.0, 1.0),
)


def extreme(law: str, propagator: str = "rk4") -> dict[str, Any]:
    raw = showing(body(1.0, (1.0, 1.5, 2.0)), law=law, propagator=propagator, max_angle_step=0.2)
    raw["inputs"] |= {"mass": ["B"], "pmi": ["B"]}
    return raw


@pytest.mark.parametrize(
    ("law", "propagator"),
    [(law, "rk4") for law in ("none", "decoupled", "principal", "tensor")]
    + [("principal", "taylor"), ("tensor", "dop853"), ("principal", "split")],
)
def test_no_extreme_makes_it_more_than_pi_or_raises_an_exception(law, propagator):
    instance = Instance(extreme(law, propagator), logging=False, optimised=False)
    stepped = 0
    for pmi in MOMENTS:
        # split itself overflows at the fastest, whatever is shown
        for rate in RATES[:-1] if propagator == "split" else RATES:
            for h in STEPS:
                assert instance.reset() == OK
                values = {"B.pmi": pmi, "angular_velocity_start": (rate, -0.3 * rate, 0.7 * rate)}
                if instance.initialise(**values) != OK:
                    instance.reset()
                    continue
                if rate * h > 1e3:  # sub-steps without end, for nothing
                    continue
                instance.set(
                    {"torque": (1e-3 * max(pmi) * rate / h if 0.0 < rate < 1.0 < h else 0.0, 0.0, 0.0)}
                )
                if instance.step(h) != OK:
                    continue
                stepped += 1
                assert 0.0 <= instance.get("error_bound") <= pi
    instance.free()
    assert stepped > 60


@pytest.mark.parametrize("law", ["none", "principal"])
def test_extreme_changes_raise_no_exception_either(law):
    instance = Instance(extreme(law), logging=False, optimised=False)
    for first in MOMENTS:
        for then in MOMENTS:
            assert instance.reset() == OK
            if instance.initialise(**{"B.pmi": first, "angular_velocity_start": (0.01, 0.02, 0.03)}) != OK:
                continue
            instance.step(0.1)
            assert instance.set({"B.pmi": then}) == OK
            for _ in range(2):
                instance.step(0.1)
            bound = instance.get("error_bound")
            assert isfinite(bound)
            assert 0.0 <= bound <= pi
    instance.free()


def test_composites_between_the_stages_of_a_change_raise_none():
    """Under none nobody else asks for them: a light tank far away becomes a heavy one nearby, mass first."""
    instance = started(NONE)
    far, near = (
        {"tug.arm.position[1]": 1e150, "tank.mass": 1e-150},
        {"tug.arm.position[1]": 1.0, "tank.mass": 1e100},
    )
    for inputs in (far, near):
        assert instance.set(inputs) == OK
        assert instance.step(STEP) == OK
    assert 0.0 < instance.get("error_bound") <= pi
    instance.free()


@FMI
def test_of_a_mass_point_it_says_nothing(fmi):
    """The law none takes one; the law tensor could not tell how it turns."""
    instance = Instance(extreme("none"), fmi, optimised=False)
    assert instance.initialise(**{"B.pmi": (0.0, 0.0, 0.0), "angular_velocity_start": (0.1, 0.2, 0.3)}) == OK
    assert instance.get("error_bound") == 0.0
    for pmi in ((0.0, 0.0, 0.0), (1.0, 1.5, 2.0)):
        assert instance.set({"B.pmi": pmi}) == OK
        assert instance.step(STEP) == OK
        assert instance.get("error_bound") == pi
    assert instance.reset() == OK
    assert instance.initialise(angular_velocity_start=(0.1, 0.2, 0.3)) == OK
    assert instance.step(STEP) == OK
    assert instance.get("error_bound") < pi
    assert instance.set({"B.pmi": (0.0, 0.0, 0.0)}) == OK
    assert instance.step(STEP) == OK
    assert instance.get("error_bound") == pi
    instance.free()
