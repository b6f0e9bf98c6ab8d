"""Propagators in the FMU: how right each is in one step and in many, and what `auto` chooses."""

import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fmu.flights import (
    EVERY,
    LITTLE,
    MUCH,
    NO_TORQUE,
    RATES,
    SHORT,
    SPAN,
    TILTED,
    TOLERANCE,
    TORQUE,
    WEAK_TORQUE,
    angle,
    assembly,
    error,
    fly,
    state,
    tilted,
    tolerant,
)
from supervessel import reference
from support import LAWS, OK, PROPAGATORS, Array, U, flying

SIZES = {"assembly": 1.0, "tilted": 5e-6}  # of the torques, as the bodies are lighter

CASES = [
    *(("assembly", propagator, "tensor") for propagator in PROPAGATORS),
    *(("tilted", p, law) for p in ("dop853", "exact") for law in LAWS),
    *(("tilted", p, law) for p in ("taylor", "split") for law in LAWS if law != "none"),
    ("tilted", "auto", "principal"),
]


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


@EVERY
def test_the_attitude_keeps_its_length_over_thousands_of_steps(propagator):
    with flying(assembly(propagator)) as instance:
        fly(instance, 0.05, 5000)
        for name in ("attitude", "state.attitude"):
            length = math.sqrt(sum(Fraction(float(x)) ** 2 for x in instance.get(name)))
            assert abs(length - 1.0) <= 4 * U, name


# "auto".


def test_auto_is_exact_to_the_bit_while_the_motion_is_free():
    with flying(assembly("auto")) as auto, flying(assembly("exact")) as exact:
        for h in (0.1, 3.0, 1e-9, 500.0):
            for instance in (auto, exact):
                fly(instance, h, 3)
            assert auto.bits() == exact.bits()


@pytest.mark.parametrize(("of_scene", "in_force"), [(1e-3, 1e-3), (1e-9, 1e-9), (1e-3, 1e-9), (1e-9, 1e-3)])
def test_auto_takes_taylor_steps_for_the_tolerance_in_force_under_torque(of_scene, in_force):
    auto_raw, raw = assembly("auto", of_scene), assembly("taylor", in_force)
    with tolerant(auto_raw, in_force) as auto, flying(raw) as other:
        for h in (0.1, 3.0, 20.0):
            for instance in (auto, other):
                assert instance.set({"torque": TORQUE}) == OK
                fly(instance, h, 3)
            assert auto.bits() == other.bits()


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
