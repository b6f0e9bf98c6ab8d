"""Propagators in the FMU: accuracy, the epoch of free motion, error control, their outputs, refusals."""

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from ctypes import byref, c_bool, c_double
from fractions import Fraction
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from supervessel import SceneError, parse_scene, reference
from supervessel.equations import equations, p_start
from supervessel.rotation.propagators import plan_of
from support import (
    DISCARD,
    ERROR,
    ISS_DG,
    LAWS,
    OK,
    PROPAGATORS,
    Array,
    Instance,
    U,
    body,
    flying,
    random_rotation,
    scene,
    variant,
)
from support.marks import FMI
from support.series import Vector, flight, norm

NAN, INF = math.nan, math.inf
FREE = ("exact", "auto")  # what free motion is exact for
EVERY = pytest.mark.parametrize("propagator", PROPAGATORS)

OUTPUTS = [*ISS_DG["outputs"]["names"], "principal_moments", "principal_axes", "error_estimate"]
RATES = [0.05, -0.08, 0.11]
ATTITUDE = [0.5, -0.5, 0.7, 0.1]
MOMENTS = (1000.0, 2000.0, 2500.0)
TILT = random_rotation(3)
TILTED = TILT @ np.diag(MOMENTS) @ TILT.T
TORQUE = [2e6, -1e6, 3e6]  # on the assembly, which has some 2.5e8 kg m2: triples its rate within 40 s
WEAK_TORQUE = [20.0, -10.0, 30.0]  # changes it by 1e-5 in that time


@cache
def assembly(propagator: str, tolerance: float = 1e-9) -> dict[str, Any]:
    """Returns ISS and ship, all of the ship an input, every output there is."""
    rotation = {
        "propagator": propagator,
        "angular_velocity": RATES,
        "attitude": ATTITUDE,
        "max_angle_step": 0.01,
        "tolerance": tolerance,
    }
    changes = {"name": f"assembly_{propagator}", "rotation": rotation, "outputs.names": OUTPUTS}
    return variant(ISS_DG, changes)


@cache
def tilted(propagator: str, law: str = "tensor", steer: bool = True) -> dict[str, Any]:
    """Returns a single body whose axes are not its principal ones."""
    rotation = {
        "law": law,
        "propagator": propagator,
        "angular_velocity": RATES,
        "attitude": ATTITUDE,
        "max_angle_step": 0.01,
    }
    vessel = {"mass": 1000.0, "inertia": ((TILTED + TILTED.T) / 2).tolist()}
    return {
        "name": f"tilted_{propagator}",
        "root": "B",
        "vessels": {"B": vessel},
        "inputs": {"torque": steer},
        "rotation": rotation,
        "outputs": {"names": ["inertia", "angular_velocity", "attitude", "error_estimate"]},
    }


def state(instance: Instance) -> Array:
    """Returns attitude and angular velocity, (7,)."""
    return np.concatenate([instance.get("state.attitude"), instance.get("state.angular_velocity")])


def bits(instance: Instance) -> list[str]:
    """Returns every variable, in hexadecimal."""
    getter = instance.fmu.getFloat64 if instance.fmi == 3 else instance.fmu.getReal
    return [value.hex() for value in getter(list(instance.references.values()))]


@contextmanager
def tolerant(raw: Mapping[str, Any], tolerance: float, fmi: int = 3) -> Iterator[Instance]:
    """Yields an initialised instance whose importer asked for a tolerance; frees it."""
    instance = Instance(raw, fmi)
    try:
        assert enter(instance, tolerance) == OK, instance.log
        assert instance.exit() == OK
        yield instance
    finally:
        instance.free()


def enter(instance: Instance, tolerance: float | None) -> int:
    """Enters initialisation with the importer's own tolerance, if any; returns the last status."""
    if instance.fmi == 3:
        return instance._status(instance.fmu.enterInitializationMode, tolerance=tolerance)
    status = instance._status(instance.fmu.setupExperiment, tolerance=tolerance)
    return status or instance._status(instance.fmu.enterInitializationMode)


def fly(instance: Instance, h: float, count: int = 1) -> None:
    for _ in range(count):
        assert instance.step(h) == OK, instance.log


# The truth: a Taylor series in integers.


@cache
def truth(
    law: str, inertia: tuple[float, ...], x: tuple[float, ...], torque: tuple[float, ...], span: float
) -> Vector:
    """Returns attitude and angular velocity, (7,), of a start x, inputs taken as exact.

    inertia : (9,) [kg m2]
    """
    return flight(law, [inertia[i : i + 3] for i in (0, 3, 6)], x, torque, span)


def error(found: Array, of: tuple[str, Array], x: Array, torque: Sequence[float], span: float) -> Array:
    """Returns how far a state is off: attitude [rad], angular velocity relative to its size.

    of      : law and inertia, (9,) [kg m2]
    x, span : start and time
    """
    law, inertia = of
    end = truth(law, tuple(map(float, inertia)), tuple(map(float, x)), tuple(map(float, torque)), span)
    off = [float(a) - b for a, b in zip(found, end, strict=True)]
    return np.array([float(2 * norm(off[:4])), float(norm(off[4:]) / norm(end[4:]))])


def angle(x: Array, span: float) -> float:
    """Returns the angle [rad] that a body turns by in free motion, nearly."""
    return float(np.linalg.norm(x[4:]) * span)


# Accuracy, against the truth.

SPAN, SHORT = 40.0, 400  # s; steps it is divided into
SIZES = {"assembly": 1.0, "tilted": 5e-6}  # of the torques, as the bodies are lighter

CASES = [
    *(("assembly", propagator, "tensor") for propagator in PROPAGATORS),
    *(("tilted", p, law) for p in ("dop853", "exact") for law in LAWS),
    *(("tilted", p, law) for p in ("taylor", "split") for law in LAWS if law != "none"),
    ("tilted", "auto", "principal"),
]
NO_TORQUE, LITTLE, MUCH = 0.0, 1.0, 1e5  # times WEAK_TORQUE


def raw_of(kind: str, propagator: str, law: str) -> dict[str, Any]:
    return assembly(propagator) if kind == "assembly" else tilted(propagator, law)


def torques(propagator: str) -> list[float]:
    """Returns what a propagator takes of WEAK_TORQUE."""
    return {"exact": [NO_TORQUE], "split": [NO_TORQUE, LITTLE]}.get(propagator, [NO_TORQUE, LITTLE, MUCH])


def bound(propagator: str, turned: float, count: int, push: float, rate: float) -> float:
    """Returns how far a flight of SPAN in `count` steps may be off: attitude [rad], rate relative.

    turned : the angle [rad]; push : acceleration by torque [rad/s2]; rate : [rad/s]
    exact: 8 u (1 + angle), the step being taken from the start whatever it was divided into.
    rk4: twice the term of order 5 that a turn's series lacks, in half the angle of 0.01 rad or less:
    angle^5/1920 each, times 4 for what the rate adds.
    split: the trapezoidal rule's rate W push h^2/12, carried on as an angle for up to SPAN; or the tolerance.
    Others: the tolerance; in steps of a tenth of a second, a hundredth of a radian, far less than rounding,
    some 8 u each.
    """
    rounding = 8.0 * U * (1.0 + turned)
    if propagator == "rk4":
        return 4.0 * turned * min(0.01, turned / count) ** 4 / 1920.0 + 8.0 * U * count
    if propagator == "exact" or (propagator == "auto" and push == 0.0):
        return rounding
    if count == 1:
        return TOLERANCE if push or propagator != "split" else rounding
    if propagator == "split":
        h = SPAN / count
        return push * rate * h * h * SPAN * (1.0 + turned) / 12.0 + 8.0 * U * count
    return 8.0 * U * count


TOLERANCE = 1e-9


@pytest.mark.parametrize(("kind", "propagator", "law"), CASES)
def test_flights_in_one_step_and_in_many_are_right(kind, propagator, law):
    with flying(raw_of(kind, propagator, law)) as instance:
        start = instance.fmu.getFMUState()
        for strength in torques(propagator):
            torque = strength * SIZES[kind] * np.array(WEAK_TORQUE)
            for count in (1, SHORT):
                instance.fmu.setFMUState(start)
                instance.time = 0.0
                assert instance.set({"torque": torque}) == OK
                x, J = state(instance), instance.get("inertia")
                fly(instance, SPAN / count, count)
                end = state(instance)
                push = np.linalg.norm(np.linalg.solve(J.reshape(3, 3), torque))
                rate = max(np.linalg.norm(x[4:]), np.linalg.norm(end[4:]))
                # SHORT steps of a tenth make SPAN but for a rounding of each: the truth is that of the sum
                span = float(count * Fraction(SPAN / count))
                off = error(end, (law, J), x, torque, span)
                limit = bound(propagator, rate * SPAN, count, push, rate)
                assert off.max() <= limit, (strength, count, off, limit)
        instance.fmu.freeFMUState(start)


def test_the_truth_is_that_of_another_integrator():
    J, x, torque = TILTED, np.array([0.5, -0.5, 0.5, 0.5, *RATES]), [10.0, -5.0, 15.0]
    for law in LAWS:

        def rate(t: float, y: Array, law: str = law) -> Array:
            return np.concatenate(
                [
                    reference.attitude_dot(y[:4], y[4:]),
                    reference.angular_acceleration(law, J, y[4:], torque),
                ]
            )

        end = solve_ivp(rate, (0.0, SPAN), x, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
        # SciPy's 1e-13 holds for each of some 60 steps and grows by the angle, 10 rad.
        assert error(end, (law, J.ravel()), x, torque, SPAN).max() <= 60 * 10 * 1e-13


@pytest.mark.parametrize(
    ("propagator", "tolerance"),
    [(p, t) for p in ("dop853", "taylor", "auto", "split") for t in (1e-3, 1e-6, 1e-12)],
)
def test_the_tolerance_asked_for_is_met_and_the_estimate_is_honest(propagator, tolerance):
    torque = (MUCH if propagator != "split" else 1.0) * np.array(WEAK_TORQUE)
    span = SPAN if propagator != "split" or tolerance > 1e-9 else 1.0
    with tolerant(assembly(propagator), tolerance) as instance:
        assert instance.set({"torque": torque}) == OK
        x, J = state(instance), instance.get("inertia")
        fly(instance, span)
        off = error(state(instance), ("tensor", J), x, torque, span)
        # what rounding adds, in the hundred sub-steps that 1e-12 takes at most
        rounding = 100 * 8 * U
        assert off.max() <= tolerance + rounding
        estimate = instance.get("error_estimate")
        assert off[0] <= 3.0 * estimate + rounding
        # estimates are too large, by a factor that the method states: their sum may exceed the tolerance
        method = plan_of(scene(assembly(propagator))).method
        assert method is not None
        assert 0.0 < estimate <= method.safety * tolerance + rounding


@EVERY
def test_the_attitude_keeps_its_length_over_thousands_of_steps(propagator):
    with flying(assembly(propagator)) as instance:
        fly(instance, 0.05, 5000)
        for name in ("attitude", "state.attitude"):
            length = math.sqrt(sum(Fraction(float(x)) ** 2 for x in instance.get(name)))
            assert abs(length - 1.0) <= 4 * U, name


# Free motion, counted from its epoch.


@pytest.mark.parametrize("propagator", FREE)
def test_a_thousand_steps_are_as_right_as_one(propagator):
    with flying(assembly(propagator)) as many, flying(assembly(propagator)) as one:
        x, J = state(many), many.get("inertia")
        fly(many, 0.1, 1000)
        fly(one, 100.0)
        ends = state(many), state(one)
        # a thousand times the double next to 0.1 is half an ulp off 100
        spans = float(1000 * Fraction(0.1)), 100.0
        for end, span in zip(ends, spans, strict=True):
            assert error(end, ("tensor", J), x, (0.0, 0.0, 0.0), span).max() <= 8 * U * (1 + angle(x, 100.0))
        assert np.abs(ends[0] - ends[1]).max() <= 4 * U * (1 + angle(x, 100.0))


def test_steps_that_add_up_exactly_give_the_bits_of_two():
    """The first one goes by doublings, all others by theta functions, from the epoch each."""
    with flying(assembly("exact")) as many, flying(assembly("exact")) as two:
        fly(many, 0.125, 800)
        fly(two, 50.0, 2)
        assert state(many).tolist() == state(two).tolist()


TINY_STEP = 1e-9  # 69 ulps of 1e5: rounded, each would be 0.4 % off


def test_tiny_steps_late_in_a_flight_are_not_lost():
    with flying(tilted("exact", "none"), angular_velocity_start=[0.0, 0.0, 1.0]) as instance:
        x = state(instance)
        fly(instance, 1e5)
        before = state(instance)
        fly(instance, TINY_STEP, 1000)
        end = state(instance)
    # of the elapsed time as a double, and of the angle of 1e5 rad: before and after
    rounding = 2 * (np.spacing(1e5) + 2 * U * 1e5)
    advanced = 2.0 * np.linalg.norm(end[:4] - before[:4])
    assert rounding < 1e-4 * 1000 * TINY_STEP
    assert abs(advanced - 1000 * TINY_STEP) <= rounding
    span = float(100000 + 1000 * Fraction(TINY_STEP))
    half = 0.5 * span  # about the third axis: the truth needs no series
    q = [x[0] * math.cos(half) - x[3] * math.sin(half), x[3] * math.cos(half) + x[0] * math.sin(half)]
    assert abs(end[0] - q[0]) + abs(end[3] - q[1]) <= rounding


def saved_bytes(instance: Instance) -> bytes:
    saved = instance.fmu.getFMUState()
    content = bytes(instance.fmu.serializeFMUState(saved))
    instance.fmu.freeFMUState(saved)
    return content


@pytest.mark.parametrize("count", [1, 2, 77])
@pytest.mark.parametrize("propagator", FREE)
@FMI
def test_the_epoch_is_part_of_a_saved_state(fmi, propagator, count):
    raw = assembly(propagator) if fmi == 3 else tilted("exact")
    with flying(raw, fmi) as instance:
        fly(instance, 0.1, count)
        saved = instance.fmu.getFMUState()
        content, time = saved_bytes(instance), instance.time
        fly(instance, 0.1, 50)
        end = bits(instance)
        instance.fmu.setFMUState(saved)
        instance.fmu.freeFMUState(saved)
        instance.time = time
        fly(instance, 0.1, 50)
        assert bits(instance) == end
    other = Instance(raw, fmi)
    restored = other.fmu.deserializeFMUState(content)
    other.fmu.setFMUState(restored)
    other.fmu.freeFMUState(restored)
    other.time = time
    fly(other, 0.1, 50)
    assert bits(other) == end
    other.free()


def constants_of(instance: Instance, raw: dict[str, Any]) -> bytes:
    """Returns what theta functions need of a state as the epoch, by the functions that C is made of."""
    model, x = equations(scene(raw)), state(instance)
    [function] = [f for f in model.steps.propagation if f.name() == "free_constants"]
    a = np.array(model.axes(model.composite(p_start(scene(raw))))).ravel()
    where = model.slices.axes["free"].start
    a[where : where + 3] /= 2.0 ** math.frexp(a[where + 2])[1]
    unit = 2.0 ** math.frexp(np.abs(x[4:]).max())[1]
    return np.array(function(np.r_[x[:4], x[4:] / unit], a, unit)).tobytes()


def test_constants_of_an_epoch_are_found_by_the_second_step_from_it_alone():
    """A torque that changes at every step or every other pays for none."""
    raw = tilted("auto")
    with flying(raw) as instance:
        for torque in (0.0, 1e-5, 0.0, 2e-5, 3e-5, 0.0):
            assert instance.set({"torque": [torque, 0.0, 0.0]}) == OK
            found = constants_of(instance, raw)
            fly(instance, 0.1)
            assert found not in saved_bytes(instance)
        fly(instance, 0.1)
        assert found in saved_bytes(instance)


def test_a_flight_from_the_same_state_without_its_epoch_has_other_bits():
    """The control for what these tests compare: they can tell an epoch from none."""
    with flying(tilted("exact")) as instance:
        fly(instance, 0.1, 77)
        x = state(instance)
        fly(instance, 0.1, 50)
        end = state(instance)
    with flying(tilted("exact"), attitude_start=x[:4], angular_velocity_start=x[4:]) as other:
        fly(other, 0.1, 50)
        assert 0.0 < np.abs(state(other) - end).max() < 1e-13


@pytest.mark.parametrize("propagator", FREE)
def test_reset_forgets_the_epoch(propagator):
    turned = {"attitude_start": [0.0, 0.0, 1.0, 0.0], "angular_velocity_start": [0.2, 0.1, -0.1]}
    with flying(assembly(propagator)) as instance, flying(assembly(propagator), **turned) as new:
        fly(instance, 0.1, 30)
        assert instance.reset() == OK
        assert instance.initialise(**turned) == OK
        for it in (instance, new):
            fly(it, 0.1, 30)
        assert bits(instance) == bits(new)


def change_nothing(instance: Instance) -> None:
    """Sets values and takes them back, as an importer does that tries what it does not use."""
    torque, mass = instance.get("torque"), instance.get("DG.mass")
    assert instance.set({"torque": [5.0, 5.0, 5.0], "DG.mass": 0.5 * mass}) == OK
    assert instance.set({"torque": torque, "DG.mass": mass}) == OK
    assert instance.set({"torque[1]": -0.0}) == OK


@pytest.mark.parametrize("propagator", FREE)
def test_values_set_there_and_back_between_steps_leave_the_flight_as_it_was(propagator):
    with flying(assembly(propagator)) as straight, flying(assembly(propagator)) as restless:
        for _ in range(60):
            change_nothing(restless)
            for instance in (straight, restless):
                fly(instance, 0.1)
        restless.set({"torque[1]": 0.0})
        assert bits(restless) == bits(straight)


@pytest.mark.parametrize("propagator", FREE)
def test_values_read_while_they_were_other_leave_the_flight_as_it_was(propagator):
    with flying(assembly(propagator)) as straight, flying(assembly(propagator)) as read:
        mass = read.get("DG.mass")
        for _ in range(60):
            assert read.set({"DG.mass": 0.5 * mass}) == OK
            read.get("principal_moments")
            assert read.set({"DG.mass": mass}) == OK
            for instance in (straight, read):
                fly(instance, 0.1)
        assert bits(read) == bits(straight)


@pytest.mark.parametrize(
    ("propagator", "what"), [("exact", "DG.mass"), ("auto", "DG.mass"), ("auto", "torque")]
)
def test_free_motion_after_a_change_begins_a_new_epoch(propagator, what):
    """After a step under torque or with another mass, and back, further steps count from there."""
    with flying(assembly(propagator)) as instance:
        fly(instance, 0.25, 10)
        before = state(instance)
        assert instance.set({"torque": TORQUE} if what == "torque" else {"DG.mass": 11000.0}) == OK
        fly(instance, 0.25)
        if what == "torque":
            assert instance.set({"torque": [0.0, 0.0, 0.0]}) == OK
            assert np.linalg.norm(state(instance)[4:] - before[4:]) > 1e-4
        x, J = state(instance), instance.get("inertia")
        saved, time = instance.fmu.getFMUState(), instance.time
        ends = []
        for h, count in ((0.25, 64), (8.0, 2)):
            instance.fmu.setFMUState(saved)
            instance.time = time
            fly(instance, h, count)
            ends.append(state(instance))
        instance.fmu.freeFMUState(saved)
    for end in ends:
        assert error(end, ("tensor", J), x, (0.0, 0.0, 0.0), 16.0).max() <= 8 * U * (1 + angle(x, 16.0))
    # under another mass the epoch is one step older than x
    if what == "torque":
        assert ends[0].tolist() == ends[1].tolist()


@FMI
def test_exact_discards_torque_with_its_value_and_goes_on_without(fmi):
    raw = assembly("exact") if fmi == 3 else tilted("exact")
    with flying(raw, fmi) as instance, flying(raw, fmi) as straight:
        for it in (instance, straight):
            fly(it, 0.1, 5)
        assert instance.set({"torque": [0.0, -2.5, 1e-300]}) == OK
        before = bits(instance)
        assert instance.step(0.1) == DISCARD
        [message] = instance.messages()
        assert "torque = (0, -2.5, 1e-300) N.m: must be 0 for the propagator exact" in message
        assert bits(instance) == before
        assert instance.set({"torque": [0.0, 0.0, 0.0]}) == OK
        for it in (instance, straight):
            fly(it, 0.1, 5)
        assert bits(instance) == bits(straight)


def test_a_step_under_torque_that_is_discarded_leaves_the_epoch():
    with flying(assembly("auto")) as instance, flying(assembly("auto")) as straight:
        for it in (instance, straight):
            fly(it, 0.1, 30)
        assert instance.set({"torque": [1e200, 0.0, 0.0]}) == OK
        assert instance.step(1.0) == DISCARD
        assert instance.set({"torque": [0.0, 0.0, 0.0]}) == OK
        for it in (instance, straight):
            fly(it, 0.1, 30)
        assert bits(instance) == bits(straight)


# "auto".


def test_auto_is_exact_to_the_bit_while_the_motion_is_free():
    with flying(assembly("auto")) as auto, flying(assembly("exact")) as exact:
        for h in (0.1, 3.0, 1e-9, 500.0):
            for instance in (auto, exact):
                fly(instance, h, 3)
            assert bits(auto) == bits(exact)


@pytest.mark.parametrize(("of_scene", "in_force"), [(1e-3, 1e-3), (1e-9, 1e-9), (1e-3, 1e-9), (1e-9, 1e-3)])
def test_auto_takes_taylor_steps_for_the_tolerance_in_force_under_torque(of_scene, in_force):
    auto_raw, raw = assembly("auto", of_scene), assembly("taylor", in_force)
    with tolerant(auto_raw, in_force) as auto, flying(raw) as other:
        for h in (0.1, 3.0, 20.0):
            for instance in (auto, other):
                assert instance.set({"torque": TORQUE}) == OK
                fly(instance, h, 3)
            assert bits(auto) == bits(other)


def test_auto_steps_where_the_composite_has_just_changed_and_flies_free_again_after_that():
    with (
        flying(assembly("auto")) as auto,
        flying(assembly("exact")) as exact,
        flying(assembly("taylor")) as stepping,
    ):
        three = (auto, exact, stepping)
        for instance in three:
            assert instance.set({"DG.mass": 11000.0}) == OK
            fly(instance, 10.0)
        assert state(auto).tolist() == state(stepping).tolist() != state(exact).tolist()
        x, J = state(auto), auto.get("inertia")
        fly(auto, 100.0)
        # no method that takes steps would be, at its tolerance
        assert error(state(auto), ("tensor", J), x, (0.0, 0.0, 0.0), 100.0).max() <= 8 * U * (
            1 + angle(x, 100.0)
        )


# A tolerance of the importer's.


@FMI
def test_the_importers_tolerance_overrides_the_scenes(fmi):
    raw = tilted("dop853")
    errors = []
    for tolerance in (None, 1e-3, 1e-13):
        with flying(raw, fmi) if tolerance is None else tolerant(raw, tolerance, fmi) as instance:
            x, J = state(instance), instance.get("inertia")
            fly(instance, SPAN)
            errors.append(error(state(instance), ("tensor", J), x, (0.0, 0.0, 0.0), SPAN)[0])
    of_scene, loose, tight = errors
    assert tight < of_scene < loose
    assert loose > 1e-9  # the scene's, so that it was not in force
    assert tight <= 1e-13 + 100 * 8 * U


@pytest.mark.parametrize("tolerance", [0.0, -1e-6, NAN, INF, 1e-16, 1.0])
@FMI
def test_a_tolerance_that_cannot_be_met_is_an_error(fmi, tolerance):
    instance = Instance(tilted("dop853"), fmi)
    assert enter(instance, tolerance) == ERROR
    [message] = instance.messages()
    assert f"tolerance = {tolerance:.10g}: must be from 1e-15 to 0.1" in message
    assert instance.reset() == OK
    assert enter(instance, 1e-15) == OK
    instance.free()


@FMI
def test_reset_forgets_the_importers_tolerance(fmi):
    ends = []
    instance = Instance(tilted("dop853"), fmi)
    for tolerance in (None, 1e-3, None):
        assert (instance.enter() if tolerance is None else enter(instance, tolerance)) == OK
        assert instance.exit() == OK
        instance.time = 0.0
        fly(instance, SPAN)
        ends.append(bits(instance))
        assert instance.reset() == OK
    instance.free()
    assert ends[0] == ends[2] != ends[1]


# Principal moments and axes as outputs.


SHAPES = {
    "as docked": {},
    "ship turned": {"DG.nose.direction": [0.3, -0.2, -1.0], "DG.nose.alignment": [0.4, 1.0, 0.1]},
    "light ship": {"DG.mass": 1.0},
    "heavy ship": {"DG.mass": 4e6},
    "no ship": {"DG.mass": 0.0},
    "far ship": {"DG.nose.position": [30.0, 40.0, -500.0]},
}


def matrix(q: Array) -> Array:
    return reference.rotation_matrix(q)


@pytest.mark.parametrize("shape", SHAPES)
@FMI
def test_principal_outputs_follow_the_inputs_at_once_and_rebuild_the_inertia(fmi, shape):
    raw = assembly("exact") if fmi == 3 else ASSEMBLY_2
    with flying(raw, fmi) as instance:
        instance.get("principal_moments")  # so that those of the start are known
        assert instance.set(SHAPES[shape]) == OK
        moments, q = instance.get("principal_moments"), instance.get("principal_axes")
        J = instance.get("inertia").reshape(3, 3)
    assert (np.diff(moments) >= 0.0).all()
    assert abs(np.linalg.norm(q) - 1.0) <= 4 * U
    # the largest scalar part of four frames: see supervessel.rotation.principal
    assert q[0] >= 0.5 - 4 * U
    R = matrix(q)
    assert np.linalg.norm(R @ np.diag(moments) @ R.T - J) <= 16 * U * np.linalg.norm(J)
    # eigh's own error: a few u of the largest
    assert np.abs(moments - np.linalg.eigh(J)[0]).max() <= 16 * U * moments[2]


ASSEMBLY_2 = variant(
    ISS_DG, {"name": "assembly_2", "outputs.names": OUTPUTS, "rotation": {"propagator": "auto"}}
)

KNOWNS = [
    "DG.mass",
    *(f"DG.nose.position[{i}]" for i in (1, 2, 3)),
    *(f"DG.nose.direction[{i}]" for i in (1, 2, 3)),
]


def names(group: str, *sizes: int) -> list[str]:
    return [f"{group}[{','.join(str(i + 1) for i in index)}]" for index in np.ndindex(*sizes)]


def test_derivatives_of_the_moments_are_those_of_the_inertia_along_the_axes():
    moments, inertia = names("principal_moments", 3), names("inertia", 3, 3)
    with flying(assembly("exact"), **SHAPES["ship turned"]) as instance:
        R, eigenvalues = matrix(instance.get("principal_axes")), instance.get("principal_moments")
        jacobian = []
        for known in KNOWNS:
            dJ = instance.directional(inertia, [known], [1.0]).reshape(3, 3)
            found = instance.directional(moments, [known], [1.0])
            # dJ is symmetric to rounding; the axes are off by u over the relative gap of the moments
            gap = np.diff(eigenvalues).min() / eigenvalues[2]
            assert np.abs(found - np.diag(R.T @ dJ @ R)).max() <= 64 * U / gap * np.abs(dJ).max()
            jacobian.append(found)
        for weights in np.eye(3):
            gradient = instance.adjoint(moments, KNOWNS, weights)
            expected = np.array(jacobian) @ weights
            assert np.abs(gradient - expected).max() <= 64 * U / gap * np.abs(jacobian).max()


@pytest.mark.parametrize("known", KNOWNS)
def test_derivatives_of_principal_outputs_are_finite_differences(known):
    unknowns = [*names("principal_moments", 3), *names("principal_axes", 4)]
    with flying(assembly("exact"), **SHAPES["ship turned"]) as instance:
        found, at = instance.directional(unknowns, [known], [1.0]), instance.get(known)
        h = 1e-4 * max(1.0, abs(at))
        rows = []
        for step in (-2 * h, -h, h, 2 * h):
            assert instance.set({known: at + step}) == OK
            rows.append(np.concatenate([instance.get("principal_moments"), instance.get("principal_axes")]))
    expected = (rows[0] - 8 * rows[1] + 8 * rows[2] - rows[3]) / (12 * h)
    for part in (slice(0, 3), slice(3, 7)):
        # some dozens of u of the values, over h; the series' next term, of h^4, is less
        rounding = 64 * U * np.abs(rows[0][part]).max() / h * (1.0 if part.start == 0 else 10.0)
        size = np.abs(expected[part]).max()
        assert np.abs(found[part] - expected[part]).max() <= rounding + 1e-9 * size


def test_derivatives_at_equal_moments_are_finite_and_right_where_unique():
    raw = variant(
        body(pmi=(1.0, 2.0, 2.5)), {"inputs": {"mass": ["B"], "pmi": ["B"]}, "outputs.names": OUTPUTS}
    )
    with flying(raw, **{"B.mass": 500.0}) as instance:
        moments, axes, knowns = (
            names("principal_moments", 3),
            names("principal_axes", 4),
            ["B.mass", *names("B.pmi", 3)],
        )
        for pmi in ([2.0, 2.0, 2.0], [2.0, 2.0, 3.0], [3.0, 2.0, 2.0], [2.0, 3.0, 2.0]):
            assert instance.set({"B.pmi": pmi}) == OK
            assert instance.get("principal_moments").tolist() == sorted(500.0 * k for k in map(float, pmi))
            assert instance.directional(moments, ["B.mass"], [1.0]).tolist() == sorted(pmi)
            for known in knowns:
                assert np.isfinite(instance.directional(moments + axes, [known], [1.0])).all()
            for weights in np.eye(7):
                assert np.isfinite(instance.adjoint(moments + axes, knowns, weights)).all()
            # the sum of the moments is smooth: each of the three adds its own
            assert instance.adjoint(moments, names("B.pmi", 3), [1.0, 1.0, 1.0]).tolist() == [500.0] * 3


@FMI
def test_dependencies_of_the_new_outputs_are_declared(fmi):
    instance = Instance(assembly("exact") if fmi == 3 else ASSEMBLY_2, fmi)
    inputs = {name for name in instance.references if name.startswith("DG.")}
    found = {output.variable.name: output for output in instance.description.outputs}
    for name in names("principal_moments", 3) + names("principal_axes", 4):
        assert {v.name for v in found[name].dependencies} == inputs
        assert set(found[name].dependenciesKind or ["dependent"]) == {"dependent"}
    assert found["error_estimate"].dependencies == []
    instance.free()


# The error estimate as an output.


@EVERY
def test_the_estimate_is_zero_at_first_positive_after_a_step_and_part_of_a_state(propagator):
    with flying(assembly(propagator)) as instance:
        assert instance.get("error_estimate") == 0.0
        if propagator not in FREE:
            assert instance.set({"torque": WEAK_TORQUE}) == OK
        fly(instance, 10.0)
        estimate = instance.get("error_estimate")
        assert 0.0 < estimate < 1e-9
        saved = instance.fmu.getFMUState()
        fly(instance, 0.3)
        assert instance.get("error_estimate") != estimate
        instance.fmu.setFMUState(saved)
        instance.fmu.freeFMUState(saved)
        assert instance.get("error_estimate") == estimate
        assert instance.reset() == OK
        assert instance.initialise() == OK
        assert instance.get("error_estimate") == 0.0


@FMI
def test_the_estimate_is_zero_in_model_exchange(fmi):
    instance = Instance(assembly("exact") if fmi == 3 else ASSEMBLY_2, fmi, exchange=True)
    assert instance.initialise() == OK
    assert instance.run() == OK
    states = (c_double * 7)(1.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0)
    assert instance._status(instance.fmu.setContinuousStates, states, 7) == OK
    assert instance.get("error_estimate") == 0.0
    instance.free()


@pytest.mark.parametrize("h", [0.5, 0.25, 0.125, 0.0625])
def test_the_estimate_of_a_runge_kutta_step_is_its_error(h):
    """One sub-step: the half step being the small number, further terms are some tenths of the first."""
    raw = variant(assembly("rk4"), {"rotation.max_angle_step": 1.0})
    with flying(raw) as instance:
        assert instance.set({"torque": TORQUE}) == OK
        x, J = state(instance), instance.get("inertia")
        fly(instance, h)
        off = error(state(instance), ("tensor", J), x, TORQUE, h)[0]
        assert off > 20 * U
        assert 0.8 * off - 8 * U <= instance.get("error_estimate") <= 1.25 * off + 8 * U


# Intermediate update.


class Listener(Instance):
    """An instance that records time and state at each intermediate update, and may end the step at `at`."""

    def __init__(self, raw: Mapping[str, Any], at: float | None = None) -> None:
        self.times: list[float] = []
        self.states: list[Array] = []
        self.at = at
        super().__init__(
            raw, earlyReturnAllowed=True, intermediateUpdate=self._updated, requiredIntermediateVariables=None
        )
        assert self.initialise() == OK

    def _updated(self, environment: Any, time: float, *rest: Any) -> None:
        *_, wanted, return_time = rest
        self.times.append(time)
        self.states.append(np.concatenate([self.get("attitude"), self.get("angular_velocity")]))
        if self.at is not None:
            wanted[0], return_time[0] = True, self.at

    def go(self, h: float) -> tuple[int, bool, float]:
        """Steps from the instance's time; returns status, early return and last successful time."""
        early, time, flags = c_bool(True), c_double(NAN), (byref(c_bool()), byref(c_bool()))
        call = self.fmu._functions["fmi3DoStep"]
        status = call(self.fmu.component, self.time, h, True, *flags, byref(early), byref(time))
        self.time = time.value
        return int(status), early.value, time.value


@pytest.mark.parametrize("propagator", FREE)
def test_free_motion_calls_once_a_step_however_long(propagator):
    listener = Listener(assembly(propagator))
    for end in (1.0, 1000.0):
        assert listener.go(end - listener.time) == (OK, False, end)
        assert listener.times[-1] == end
    assert len(listener.times) == 2
    listener.free()


@pytest.mark.parametrize("propagator", ["dop853", "taylor", "split"])
def test_controlled_steps_call_at_each_sub_step_with_the_states_there(propagator):
    torque = WEAK_TORQUE if propagator == "split" else TORQUE
    listener = Listener(assembly(propagator))
    x, J = state(listener), listener.get("inertia")
    assert listener.set({"torque": torque}) == OK
    assert listener.go(20.0) == (OK, False, 20.0)
    assert len(listener.times) > 2
    assert all(a < b for a, b in pairwise([0.0, *listener.times]))
    assert listener.times[-1] == 20.0
    some = np.linspace(0, len(listener.times) - 1, 3).astype(int)
    for i in some:
        off = error(listener.states[i], ("tensor", J), x, torque, listener.times[i])
        assert off.max() <= TOLERANCE
    listener.free()


@pytest.mark.parametrize("propagator", ["dop853", "taylor", "split"])
@pytest.mark.parametrize("at", [0.0, 7.3])
def test_controlled_steps_return_early_when_asked(propagator, at):
    torque = WEAK_TORQUE if propagator == "split" else TORQUE
    listener = Listener(assembly(propagator), at)
    x, J = state(listener), listener.get("inertia")
    assert listener.set({"torque": torque}) == OK
    status, early, time = listener.go(20.0)
    assert (status, early) == (OK, True)
    assert time == at or (at == 0.0 and time == listener.times[0] < 20.0)
    end = state(listener)
    assert error(end, ("tensor", J), x, torque, time).max() <= TOLERANCE
    listener.at = None
    assert listener.go(20.0 - time) == (OK, False, 20.0)
    assert error(state(listener), ("tensor", J), x, torque, 20.0).max() <= 2 * TOLERANCE
    listener.free()


@pytest.mark.parametrize("propagator", ["taylor", "auto"])
@pytest.mark.parametrize(
    ("tolerance", "reached", "most"), [(1e-5, 1e-6, 49), (1e-9, 1e-9, 63), (1e-12, 1e-12, 66)]
)
def test_constant_torque_takes_few_sub_steps(propagator, tolerance, reached, most):
    """36 rad in 40 s. The numbers are those measured, and a few more; `make bench` tells the time."""
    torque, span = (0.01, -0.02, 0.015), 40.0
    rates = [0.3, 0.7, 0.5]
    raw = body(1.0, (1.0, 2.0, 3.0), propagator=propagator, tolerance=tolerance, angular_velocity=rates)
    listener = Listener(raw)
    x, J = state(listener), listener.get("inertia")
    assert listener.set({"torque": torque}) == OK
    assert listener.go(span) == (OK, False, span)
    assert error(state(listener), ("tensor", J), x, torque, span).max() <= reached
    assert len(listener.times) <= most
    listener.free()


# Steps that a method cannot take.


def refused(instance: Instance, h: float, *texts: str) -> None:
    """Checks that a step is discarded with one line that holds some texts, everything being kept."""
    instance.log.clear()
    before = instance.get("time"), *state(instance)
    assert instance.step(h) == DISCARD
    [message] = instance.messages()
    for text in texts:
        assert text in message, message
    assert (instance.get("time"), *state(instance)) == before


def test_split_discards_a_step_that_needs_too_many_and_takes_a_shorter_one():
    with flying(assembly("split")) as instance, flying(assembly("split")) as straight:
        for it in (instance, straight):
            assert it.set({"torque": [1e9, 0.0, 0.0]}) == OK
        refused(
            instance,
            1e4,
            "communicationStepSize = 10000 s needs",
            "sub-steps",
            "angular_velocity = (0.05, -0.08, 0.11)",
        )
        for it in (instance, straight):
            fly(it, 1e-4)
        assert bits(instance) == bits(straight)


REFUSED = "turns the body by {} rad; it is followed for 2e+09 rad in a step"


@pytest.mark.parametrize("propagator", [*FREE, "split"])
def test_free_motion_beyond_its_reach_is_discarded_with_the_numbers(propagator):
    rates = {"angular_velocity_start": [1e6, 2e5, -3e5]}
    with flying(assembly(propagator), **rates) as instance, flying(assembly(propagator), **rates) as straight:
        refused(
            instance,
            1e5,
            "free motion over 100000 s with angular_velocity = (1000000, 200000, -300000) rad/s",
            REFUSED.format("1.06e+11"),
        )
        for it in (instance, straight):
            fly(it, 1e-3, 7)
        refused(instance, 1e5, "rad/s")
        for it in (instance, straight):  # from the same epoch
            fly(it, 1e-3, 7)
        assert bits(instance) == bits(straight)


@FMI
@pytest.mark.parametrize("propagator", [*FREE, "split"])
def test_a_steady_spin_has_the_same_reach(propagator, fmi):
    """It needs no doublings: digits are all that is lost."""
    raw = body(pmi=(2.0, 2.0, 2.0), propagator=propagator, angular_velocity=[0.0, 0.0, 1e6])
    reach, turned = 2000.0, 0.0
    with flying(raw, fmi) as instance:
        for h in (1500.0, 1500.0, reach):  # each begins a new epoch
            refused(instance, math.nextafter(reach, INF), "2000 s", REFUSED.format("2e+09"))
            fly(instance, h)
            turned += 1e6 * h
            # of q and -q the one with the sign of the truth: half the angle is a double
            end = math.cos(turned / 2), 0.0, 0.0, math.sin(turned / 2)
            assert np.abs(instance.get("attitude") - end).max() <= 8 * U * turned
        refused(instance, 1e300, REFUSED.format("1e+306"))


@pytest.mark.parametrize("propagator", ["rk4", "dop853", "taylor"])
@pytest.mark.parametrize("rate", [1e150, 1e300])
def test_stepping_methods_discard_absurd_rates(propagator, rate):
    with flying(assembly(propagator), angular_velocity_start=[rate, -rate, rate]) as instance:
        refused(instance, 1.0, f"{rate:g}")


@pytest.mark.parametrize("propagator", FREE)
def test_free_motion_scales_to_the_ends_of_doubles(propagator):
    with flying(assembly(propagator), angular_velocity_start=[1e150, -2e150, 5e149]) as instance:
        x, J = state(instance), instance.get("inertia")
        fly(instance, 1e-150)
        off = error(state(instance), ("tensor", J), x, (0.0, 0.0, 0.0), 1e-150)
        assert off.max() <= 8 * U * (1 + angle(x, 1e-150))


@EVERY
@pytest.mark.parametrize("rate", [0.0, 5e-324, 1e-310, 1e-160])
def test_rest_and_denormal_rates_fly(propagator, rate):
    rates = [rate, -2 * rate, 3 * rate]
    with flying(assembly(propagator), angular_velocity_start=rates) as instance:
        attitude = instance.get("attitude")
        fly(instance, 0.1, 3)
        fly(instance, 1e3)
        x = state(instance)
        # steady but for half an ulp and half a denormal each; no turn that shows
        assert np.abs(x[4:] - rates).max() <= 16 * U * 3 * rate + 8 * 5e-324
        assert np.abs(x[:4] - attitude).max() <= 8 * U
        if propagator != "exact":
            assert instance.set({"torque": [1e-300, 0.0, 0.0]}) == OK
            fly(instance, 1.0)
        assert np.isfinite(state(instance)).all()


# Scenes.


ALLOWED = "must be a number from 1e-15 to 0.1"


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        (
            {"rotation": {"propagator": "split", "law": "none"}},
            'rotation.propagator = "split": makes no sense with rotation.law = "none", where torque does '
            "nothing; take any other",
        ),
        (
            {"rotation": {"propagator": "split"}, "inputs.torque": False},
            'rotation.propagator = "split": must be "exact" or "auto" without inputs.torque',
        ),
        (
            {"rotation": {"propagator": "dop85"}},
            'rotation.propagator = "dop85": must be one of auto, rk4, dop853, taylor, exact, split',
        ),
        *(
            ({"rotation": {"tolerance": value}}, f"rotation.tolerance = {shown}: {ALLOWED}")
            for value, shown in (
                (0, "0"),
                (-1e-9, "-1e-09"),
                (1e-16, "1e-16"),
                (1.0, "1.0"),
                (0.11, "0.11"),
                (NAN, "nan"),
                (INF, "inf"),
                ("1e-9", '"1e-9"'),
                (True, "true"),
                ([1e-9], "[1e-09]"),
            )
        ),
    ],
    ids=str,
)
def test_a_scene_that_cannot_be_propagated_is_refused_with_place_value_and_what_is_allowed(changes, expected):
    with pytest.raises(SceneError) as caught:
        parse_scene(variant(ISS_DG, changes))
    assert list(caught.value.problems) == [expected]


@pytest.mark.parametrize("tolerance", [1e-15, 1e-9, 0.1])
def test_tolerances_from_end_to_end_are_read(tolerance):
    assert scene(variant(ISS_DG, {"rotation": {"tolerance": tolerance}})).rotation.tolerance == tolerance
