"""The exact step of free rotation, by doublings and by theta functions: values, sign, derivatives, cost.

Truth is Euler's equations and the attitude's, integrated by Taylor series to 45 digits; over spans too long
for that, closed forms of steady spins and of symmetric bodies at 50 digits.
"""

from collections.abc import Callable
from functools import cache
from math import ceil, log2, nextafter, sqrt
from typing import Any

import casadi as ca
import mpmath as mp
import numpy as np
import pytest

from supervessel.rotation.propagators import free_motion, theta
from support import Array, U, hamilton, series
from support.marks import some_at_once

Case = tuple[tuple[float, ...], tuple[float, ...], float]  # moments, rates, time
Truth = Callable[[list[mp.mpf]], list[mp.mpf]]  # of the seven inputs: turn, rates

BOUND = 8.0  # u (1 + cond)
ROOM = 36  # doublings; 1e9 rad take 32
RK4_INSTRUCTIONS = 350

GENERAL = (0.3, 0.6, 0.7)
SEPARATRIX = sqrt(0.3 * (0.6 - 0.3) / (0.7 * (0.7 - 0.6)))  # w2/w0 on it for GENERAL
J, W, T = ca.SX.sym("J", 3), ca.SX.sym("w", 3), ca.SX.sym("t")
INPUTS = ca.vertcat(J, W, T)


# Truth


def taylor(inputs: list[mp.mpf], digits: int = 45) -> list[mp.mpf]:
    """Returns turn and rates at the end."""
    J, w, time = ([series.mp.mpf(x) for x in part] for part in (inputs[:3], inputs[3:6], inputs[6:]))
    inertia = [[J[i] if i == j else series.mp.zero for j in range(3)] for i in range(3)]
    turn, end = series.taylor(inertia, w, [series.mp.zero] * 3, time[0], digits)
    return [mp.mpf(x) for x in turn + end]


def about(vector: list[mp.mpf]) -> list[mp.mpf]:
    """Returns the quaternion of a rotation by |vector| about it."""
    angle = mp.sqrt(sum(x * x for x in vector))
    return [mp.cos(angle / 2), *(mp.sin(angle / 2) * x / angle for x in vector)]


def symmetric(axis: int) -> Truth:
    """Returns the truth for bodies symmetric about an axis: precession about the momentum after a spin."""

    def truth(inputs: list[mp.mpf]) -> list[mp.mpf]:
        moments, w, time = inputs[:3], inputs[3:6], inputs[6]
        i, k = (axis + 1) % 3, (axis + 2) % 3
        across = moments[1]
        rate = (1 - moments[axis] / across) * w[axis]
        spin = [mp.mpf(0)] * 3
        spin[axis] = mp.mpf(1)
        half = rate * time / 2
        turn = hamilton(
            about([(moments[axis] if n == axis else across) * w[n] / across * time for n in range(3)]),
            [mp.cos(half), *(mp.sin(half) * x for x in spin)],
        )
        end = list(w)
        end[i] = mp.cos(2 * half) * w[i] + mp.sin(2 * half) * w[k]
        end[k] = mp.cos(2 * half) * w[k] - mp.sin(2 * half) * w[i]
        return turn + end

    return truth


def spinning(inputs: list[mp.mpf]) -> list[mp.mpf]:
    w, time = inputs[3:6], inputs[6]
    return about([x * time for x in w]) + list(w)


def conditions(truth: Truth, case: Case, varied: tuple[int, ...]) -> tuple[mp.mpf, mp.mpf]:
    """Returns the relative condition numbers of attitude and rate to the inputs that are varied."""
    inputs = [mp.mpf(x) for x in (*case[0], *case[1], case[2])]
    value = truth(inputs)
    step = mp.ldexp(1, -50)
    total = [mp.mpf(0), mp.mpf(0)]
    for i in varied:
        changed = list(inputs)
        changed[i] *= 1 + step
        slopes = [abs(a - b) / step for a, b in zip(truth(changed), value, strict=True)]
        total[0] += max(slopes[:4])
        total[1] += max(slopes[4:]) / max(map(abs, value[4:]))
    return total[0], total[1]


def units(truth: Truth, case: Case, varied: tuple[int, ...] = tuple(range(7))) -> float:
    """Returns the greatest of the errors of attitude and rate, by either way, over u (1 + cond)."""
    with mp.workdps(55):
        right = truth([mp.mpf(x) for x in (*case[0], *case[1], case[2])])
        attitude, rate = conditions(truth, case, varied)
        worst = mp.mpf(0)
        for found in (value(case), from_start(case)):
            if found is not None:
                errors = [abs(mp.mpf(float(a)) - b) for a, b in zip(found, right, strict=True)]
                relative = max(errors[4:]) / max(map(abs, right[4:]))
                worst = max(worst, max(errors[:4]) / (1 + attitude), relative / (1 + rate))
        return float(worst / U)


# What is tested


@cache
def step(room: int = ROOM) -> ca.Function:
    return ca.Function("step", [J, W, T], [ca.vertcat(*free_motion.free_turn(J, W, T, room))])


def value(case: Case) -> Array:
    return np.array(step()(*case)).ravel()


@cache
def thetas() -> tuple[ca.Function, ca.Function]:
    """Returns what is found of a start, and what follows at a time."""
    state, k = ca.vertcat(1.0, 0.0, 0.0, 0.0, W), ca.SX.sym("k", theta.CONSTANTS)
    found = theta.constants(state, J, ca.SX.eye(3), ca.SX(1.0))
    return ca.Function("found", [J, W], [found]), ca.Function("at", [k, T], [theta.at(k, T)])


def from_start(case: Case) -> Array | None:
    """Returns turn and rates at the end by theta functions, if they serve."""
    found, at = thetas()
    k = np.array(found(*case[:2])).ravel()
    return np.array(at(k, case[2])).ravel() if np.all(np.isfinite(k)) else None


@cache
def jacobian() -> ca.Function:
    """Returns the derivatives, (7, 7), by forward and by reverse differentiation."""
    out = ca.vertcat(*free_motion.free_turn(J, W, T, 10))
    forward = ca.horzcat(*(ca.jtimes(out, INPUTS, column) for column in ca.horzsplit(ca.SX.eye(7))))
    reverse = ca.horzcat(*(ca.jtimes(out, INPUTS, column, True) for column in ca.horzsplit(ca.SX.eye(7))))
    return ca.Function("jacobian", [J, W, T], [ca.jacobian(out, INPUTS), forward, reverse.T])


def ulp(x: float, count: int = 1) -> float:
    for _ in range(abs(count)):
        x = nextafter(x, 2.0 if count > 0 else 0.0)
    return x


BODIES = {
    "general": GENERAL,
    "prolate": (0.3, 0.6, 0.6),
    "oblate": (0.4, 0.4, 0.7),
    "prolate but for one ulp": (0.3, 0.6, ulp(0.6)),
    "oblate but for one ulp": (ulp(0.4, -1), 0.4, 0.7),
    "spherical": (0.6, 0.6, 0.6),
    "spherical but for one ulp": (ulp(0.6, -1), 0.6, ulp(0.6)),
    "flat": (0.25, 0.5, 0.75),
    "slender": (1e-12, 0.7, 0.7 + 5e-13),
}
RATES = {
    "general": (0.3, 0.7, 0.5),
    "about 0": (0.9, -0.2, -0.1),
    "about 1": (-0.01, 0.9, 0.01),
    "about 2": (0.1, 0.2, -0.8),
    "tiny": (-1e-9, 1e-5, 0.8),
    "tiny beside 1": (1e-40, 0.9, -1e-80),
}
SPANS = (1e-9, -2.0)
FURTHER: dict[str, Case] = {
    "separatrix": (GENERAL, (0.3, 0.7, 0.3 * SEPARATRIX), 6.0),
    "1e-15 above the separatrix": (GENERAL, (0.3, 0.7, 0.3 * SEPARATRIX * (1 + 1e-15)), 12.0),
    "1e-15 below the separatrix": (GENERAL, (0.3, 0.7, 0.3 * SEPARATRIX * (1 - 1e-15)), -12.0),
    "separatrix, slender": ((1e-12, 0.7, 0.7 + 5e-13), (5e-7, 0.7, 5e-7), 6.0),
    "near axis 1, over the saddle": (GENERAL, (1e-6, 0.9, 1e-6), 20.0),
}


@pytest.mark.parametrize("span", some_at_once(SPANS, -2.0))
@pytest.mark.parametrize("rates", RATES)
@pytest.mark.parametrize("name", BODIES)
def test_error_of_a_step(name: str, rates: str, span: float) -> None:
    assert units(taylor, (BODIES[name], RATES[rates], span)) <= BOUND


@pytest.mark.parametrize(
    ("name", "rates", "span"),
    some_at_once(
        [("general", "general", 20.0), ("flat", "about 0", -17.0), ("slender", "about 2", 20.0)],
        ("general", "general", 20.0),
    ),
)
def test_error_of_a_longer_step(name: str, rates: str, span: float) -> None:
    assert units(taylor, (BODIES[name], RATES[rates], span)) <= BOUND


def test_truth_does_not_depend_on_its_digits() -> None:
    with mp.workdps(55):
        for moments, rates, span in (*FURTHER.values(), (BODIES["slender"], RATES["about 2"], 20.0)):
            inputs = [mp.mpf(x) for x in (*moments, *rates, span)]
            both = zip(taylor(inputs), taylor(inputs, 53), strict=True)
            assert max(abs(a - b) for a, b in both) <= 1e-42


@pytest.mark.parametrize("case", FURTHER)
def test_error_at_the_separatrix(case: str) -> None:
    assert units(taylor, FURTHER[case]) <= BOUND


@pytest.mark.parametrize("span", [1e3, -1e5, 1e7, 1e9])
@pytest.mark.parametrize(
    ("axis", "moments", "rates"),
    [
        (2, (0.4, 0.4, 0.7), (0.3, -0.7, 0.5)),
        (2, (0.4, 0.4, 0.7), (0.3, -0.7, 0.0)),
        (0, (0.3, 0.6, 0.6), (0.3, 0.7, -0.5)),
        (0, (0.3, 0.6, 0.6), (0.0, 0.7, 0.5)),
        (0, (1e-12, 0.6, 0.6), (0.9, 0.7, 0.5)),
        (2, (0.6, 0.6, 0.6), (0.3, 0.7, -0.5)),
    ],
)
def test_error_of_symmetric_bodies_over_any_span(
    axis: int, moments: tuple[float, ...], rates: tuple[float, ...], span: float
) -> None:
    # Taking only what the closed form depends on for the condition number makes the bound narrower.
    assert units(symmetric(axis), (moments, rates, span), (3, 4, 5, 6)) <= BOUND


@pytest.mark.parametrize("span", [1e-9, 1.0, -1e3, 1e6, 1e9])
@pytest.mark.parametrize("rate", [0.9, -0.5])
@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("name", BODIES)
def test_error_of_steady_spins(name: str, axis: int, rate: float, span: float) -> None:
    rates = [0.0] * 3
    rates[axis] = rate
    case = (BODIES[name], tuple(rates), span)
    # nothing but rate and time counts
    assert units(spinning, case, (3 + axis, 6)) <= BOUND


def test_theta_functions_serve_all_but_what_is_near_the_separatrix() -> None:
    for name, moments in BODIES.items():
        assert from_start((moments, (0.1, 0.2, -0.8), 1.0)) is not None, name
        assert from_start((moments, (0.0, 0.0, -0.8), 1.0)) is not None, name
        assert from_start((moments, (0.6, 0.0, 0.0), 1.0)) is not None, name
    for name, case in FURTHER.items():
        assert from_start(case) is None, name


def nearest_to_the_separatrix(below: float, above: float) -> tuple[float, float]:
    """Returns neighbouring rates about axis 2 of GENERAL of which theta functions serve the first alone."""
    while nextafter(below, above) != above:
        middle = 0.5 * (below + above)
        served = from_start((GENERAL, (0.3, 0.5, middle), 1.0)) is not None
        below, above = (middle, above) if served else (below, middle)
    return below, above


@pytest.mark.parametrize("far", [0.0, 0.9])
def test_error_where_theta_functions_just_serve(far: float) -> None:
    rate, _ = nearest_to_the_separatrix(far, 0.3 * SEPARATRIX)
    case = (GENERAL, (0.3, 0.5, rate), 9.0)
    m = parameter(case)
    k = mp.qfrom(m=m)
    assert 0.9 * theta.LARGEST_NOME < k <= theta.LARGEST_NOME * (1 + 64 * U)
    assert units(taylor, case) <= BOUND


def parameter(case: Case) -> mp.mpf:
    """Returns the parameter m of the Jacobi functions of a motion."""
    J0, J1, J2 = map(mp.mpf, case[0])
    a, b, c = (mp.mpf(x) ** 2 for x in case[1])
    G, H = J0 * (J2 - J0) * a + J1 * (J2 - J1) * b, J1 * (J1 - J0) * b + J2 * (J2 - J0) * c
    m = G * (J1 - J0) / (H * (J2 - J1))
    return m if m <= 1 else 1 / m


@pytest.mark.parametrize("name", ["general", "flat", "slender", "oblate but for one ulp"])
def test_rates_that_stay_small_are_right_in_themselves(name: str) -> None:
    """Against their own greatest values; the quotient of a rate has no sum with others' roundings."""
    moments = BODIES[name]
    rates = (1e-9, 2e-6, 0.8)
    J0, J1, J2 = moments
    ratio = (J2 - J1) / (J2 - J0) * (J1 / J0)  # of the squares of the two small rates' amplitudes
    with mp.workdps(55):
        case = (moments, rates, 7.0)
        right = taylor([mp.mpf(x) for x in (*moments, *rates, 7.0)])[4:]
        found = from_start(case)
        assert found is not None
        greatest = sqrt(rates[0] ** 2 + ratio * rates[1] ** 2)
        for i, most in enumerate((greatest, greatest / sqrt(ratio), 0.8)):
            # the phase goes with 2 sqrt(A) at the most in what is flown here: it is u of that, twice
            assert abs(found[4 + i] - right[i]) <= BOUND * U * (1 + 2 * phase_of(case)) * most


def phase_of(case: Case) -> float:
    return float(ca.Function("f", [], [free_motion.phase(*(ca.SX(x) for x in case))])()["o0"])


@pytest.mark.parametrize("seed", range(4))
def test_both_ways_agree_for_random_bodies_at_many_times(seed: int) -> None:
    random = np.random.default_rng(seed)
    served = 0
    for _ in range(25):
        moments = np.sort(random.uniform(0.05, 1.0, 3))
        moments[2] = min(moments[2], moments[0] + moments[1])
        moments *= 0.75 / moments[2]
        rates = random.normal(size=3) * 10.0 ** random.uniform(-6.0 * (seed % 2), 0.0, 3)
        rates *= 0.75 / np.abs(rates).max()
        for span in 10.0 ** random.uniform(-3.0, 1.5, 8) * random.choice([-1.0, 1.0], 8):
            case = tuple(moments), tuple(rates), float(span)
            found = from_start(case)
            if found is None:
                continue
            served += 1
            slack = 2 * BOUND * U * (1 + growth(case))

            assert np.abs(found - value(case)).max() <= slack
    assert served > 150


def test_rest_stays() -> None:
    for moments in BODIES.values():
        assert value((moments, (0.0, 0.0, 0.0), 1e9)).tolist() == [1.0, 0, 0, 0, 0, 0, 0]


# Properties

TRAVELLED = [
    (GENERAL, (0.3, 0.7, 0.5)),
    (GENERAL, (0.9, -0.2, -0.1)),
    (GENERAL, (-0.01, 0.9, 0.01)),
    (GENERAL, (0.3, -0.7, -0.3 * SEPARATRIX)),
    ((0.25, 0.5, 0.75), (-0.5, 0.9, 0.1)),
    ((ulp(0.4, -1), 0.4, 0.7), (0.6, 0.9, 0.0)),
]


def length(x: Array) -> float:
    return float(np.sqrt(x @ x))


@pytest.mark.parametrize("span", [0.3, 7.0, 1e3, -1e6, 1e9])
@pytest.mark.parametrize(("moments", "rates"), TRAVELLED)
def test_length_energy_and_momentum_are_kept(
    moments: tuple[float, ...], rates: tuple[float, ...], span: float
) -> None:
    # What is left of C^2 + A S^2 = 1 and of D's is a few roundings of each doubling, not amplified by those
    # that follow; energy and squared momentum then go with them, twice.
    end = value((moments, rates, span))
    inertia, w, v = np.array(moments), np.array(rates), end[4:]
    doublings = max(0.0, log2(abs(span)) + 2.0)
    slack = 2.0 * 4.0 * U * (doublings + 2.0)
    assert abs(length(end[:4]) - 1.0) <= 4 * U
    assert abs(v @ (inertia * v) / (w @ (inertia * w)) - 1.0) <= slack
    assert abs(length(inertia * v) / length(inertia * w) - 1.0) <= slack


def growth(case: Case) -> float:
    """Returns the greatest relative change of the results with the inputs, by the step's own derivatives."""
    slopes = np.array(jacobian()(*case)[0])
    inputs = np.array([*case[0], *case[1], case[2]])
    return float(np.abs(slopes * inputs).sum(axis=1).max()) / min(1.0, np.abs(value(case)[4:]).max())


@pytest.mark.parametrize(("moments", "rates"), TRAVELLED)
def test_two_steps_are_one(moments: tuple[float, ...], rates: tuple[float, ...]) -> None:
    for first, second in ((0.5, 2.0), (8.0, 5.0), (-3.0, 11.0), (64.0, -32.0)):
        middle = value((moments, rates, first))
        second_case = (moments, tuple(middle[4:]), second)
        end, whole = value(second_case), value((moments, rates, first + second))
        # errors of the first step grow on by as much as errors of the second step's inputs
        slack = (1 + growth(second_case)) * (2 + growth((moments, rates, first)))
        slack += 1 + growth((moments, rates, first + second))
        assert np.abs(hamilton(middle[:4], end[:4]) - whole[:4]).max() <= BOUND * U * slack
        assert np.abs(end[4:] - whole[4:]).max() <= BOUND * U * slack


@pytest.mark.parametrize(("moments", "rates"), TRAVELLED)
def test_forward_and_back_is_where_it_began(moments: tuple[float, ...], rates: tuple[float, ...]) -> None:
    for span in (0.5, 13.0, 60.0):
        there = value((moments, rates, span))
        back_case = (moments, tuple(there[4:]), -span)
        back = value(back_case)
        slack = BOUND * U * (1 + growth(back_case)) * (2 + growth((moments, rates, span)))
        assert np.abs(np.subtract(hamilton(there[:4], back[:4]), [1, 0, 0, 0])).max() <= slack
        assert np.abs(back[4:] - rates).max() <= slack


@pytest.mark.parametrize("rates", RATES)
@pytest.mark.parametrize("name", BODIES)
def test_sign_is_continuous_in_time(name: str, rates: str) -> None:
    # The attitude moves by |omega| dt/2 at the most, here 1.5 * 0.1/2; a jump would be by 2.
    times = np.arange(-400, 401) * 0.1
    turns = np.array(step().map(times.size)(BODIES[name], RATES[rates], times[None, :]))[:4]
    assert np.abs(np.diff(turns)).max() <= 0.08
    assert turns[:, 400].tolist() == [1.0, 0.0, 0.0, 0.0]
    found, at = thetas()
    k = found(BODIES[name], RATES[rates])
    if np.all(np.isfinite(np.array(k))):
        others = np.array(at.map(times.size)(k, times[None, :]))[:4]
        assert np.abs(others - turns).max() <= 1e-12


# Parts


def test_phase_is_the_argument_of_the_jacobi_functions() -> None:
    for moments, w, t in ((GENERAL, (0.3, 0.7, 0.5), -3.0), (GENERAL, (0.9, 0.2, 0.1), 5.0)):
        inertia = np.array(moments)
        double_energy, square = inertia @ np.array(w) ** 2, (inertia * w) @ (inertia * w)
        inner, outer = (0, 2) if square >= double_energy * inertia[1] else (2, 0)
        rate = (square - double_energy * inertia[inner]) * (inertia[outer] - inertia[1]) / inertia.prod()
        phase = float(ca.Function("f", [], [free_motion.phase(*(ca.SX(x) for x in (moments, w, t)))])()["o0"])
        assert phase == pytest.approx(abs(t) * sqrt(rate), rel=1e-14)


@pytest.mark.parametrize(
    "case",
    [
        ((0.6, 0.6, 0.6), (0.3, 0.7, 0.5), 1e9),
        (GENERAL, (0.0, 0.0, 0.0), 1e9),
        ((0.3, 0.6, 0.6), (0.0, 0.7, 0.5), 1e9),
    ],
)
def test_phase_is_zero_where_the_rates_do_not_change(case: Case) -> None:
    assert float(ca.Function("f", [J, W, T], [free_motion.phase(J, W, T)])(*case)) == 0.0


def test_a_loop_over_the_parts_agrees_with_the_composition() -> None:
    share = ca.SX.sym("share")
    state = free_motion.start(J, W, T, share)
    s = ca.SX.sym("s", state.numel())
    phase = ca.Function("phase", [J, W, T], [free_motion.phase(J, W, T)])
    start = ca.Function("start", [J, W, T, share], [state])
    double = ca.Function("double", [s], [free_motion.double(s)])
    finish = ca.Function("finish", [J, W, T, s], [ca.vertcat(*free_motion.finish(J, W, T, s))])
    for moments, rates in TRAVELLED:
        for span in (0.1, -3.0, 100.0):
            angle = float(phase(moments, rates, span)) / free_motion.FIRST_ANGLE
            doublings = max(0, ceil(log2(angle)))
            x = start(moments, rates, span, 2.0**-doublings)
            for _ in range(doublings):
                x = double(x)
            looped = np.array(finish(moments, rates, span, x)).ravel()
            # CasADi may order products otherwise within the one and the other
            slack = BOUND * U * (1 + growth((moments, rates, span)))
            assert np.abs(looped - value((moments, rates, span))).max() <= slack


def test_too_few_doublings_give_no_number() -> None:
    few = step(2)
    phase = ca.Function("phase", [J, W, T], [free_motion.phase(J, W, T)])
    most = 4.0 * free_motion.FIRST_ANGLE / float(phase(GENERAL, RATES["general"], 1.0))
    assert np.isfinite(np.array(few(GENERAL, RATES["general"], 0.999 * most))).all()
    assert np.isnan(np.array(few(GENERAL, RATES["general"], 1.001 * most))).all()


# Derivatives

STEADY = {
    f"{name}, steady about {axis}": (BODIES[name], tuple(0.9 * (i == axis) for i in range(3)), 2.0)
    for name in BODIES
    for axis in range(3)
}
POINTS: dict[str, Case] = STEADY | {
    **{f"{name}, general": (moments, RATES["general"], -2.0) for name, moments in BODIES.items()},
    "rest": (GENERAL, (0.0, 0.0, 0.0), 2.0),
    "no time": (GENERAL, RATES["general"], 0.0),
    "separatrix": (GENERAL, (0.3, 0.7, 0.3 * SEPARATRIX), 2.0),
    "1e-15 above the separatrix": (GENERAL, (0.3, 0.7, 0.3 * SEPARATRIX * (1 + 1e-15)), 2.0),
    "1e-15 below the separatrix": (GENERAL, (0.3, 0.7, 0.3 * SEPARATRIX * (1 - 1e-15)), 2.0),
    "oblate, across its axis": ((0.4, 0.4, 0.7), (0.5, 0.9, 0.0), 2.0),
    "prolate, across its axis": ((0.3, 0.6, 0.6), (0.0, 0.9, 0.5), 2.0),
    **{f"{x} off steady about 2": (GENERAL, (x, 2 * x, 0.9), 2.0) for x in (1e-12, 1e-8, 1e-5, 1e-4, 1e-3)},
    **{f"{x} off steady about 0": (GENERAL, (0.9, x, 2 * x), 2.0) for x in (1e-12, 1e-8, 1e-5, 1e-4, 1e-3)},
    **{f"{x} off steady about 1": (GENERAL, (x, 0.9, 2 * x), 2.0) for x in (1e-12, 1e-8, 1e-5, 1e-3)},
}


def derivative_bound(case: Case) -> float:
    """Returns the bound of a derivative's error over the greatest derivative by the same input, or over 1.

    Close to a spin about axis 2 the rounding of the last arctangent goes by the inverse of the other rates,
    down to where it is left out. About a light axis the momentum's direction is sensitive, not the turn.
    """
    return 1e-11 + 8 * U * case[0][2] / case[0][0]


@cache
def slopes(point: str) -> tuple[Array, Array]:
    """Returns the derivatives, (7, 7), by differences of the truth, off by 2^-50 or so, and their scale."""
    case = POINTS[point]
    with mp.workdps(55):
        inputs = [mp.mpf(x) for x in (*case[0], *case[1], case[2])]
        h, here = mp.ldexp(min(case[0]), -55), taylor(inputs)
        columns = []
        for i in range(7):
            ahead = list(inputs)
            ahead[i] += h
            columns.append([float((a - b) / h) for a, b in zip(taylor(ahead), here, strict=True)])
    right = np.array(columns).T
    return right, np.maximum(1.0, np.abs(right).max(axis=0))


@pytest.mark.parametrize("point", POINTS)
def test_derivatives_by_rates_and_time(point: str) -> None:
    right, scale = slopes(point)
    for found in jacobian()(*POINTS[point]):
        error = np.abs(np.array(found) - right) / scale
        assert error[:, 3:].max() <= derivative_bound(POINTS[point])
        assert np.isfinite(np.array(found)).all()


@pytest.mark.parametrize(
    "point",
    [name for name, case in POINTS.items() if case[0] in (GENERAL, BODIES["flat"], BODIES["slender"])],
)
def test_derivatives_by_distinct_moments(point: str) -> None:
    right, scale = slopes(point)
    for found in jacobian()(*POINTS[point]):
        assert (np.abs(np.array(found) - right) / scale)[:, :3].max() <= derivative_bound(POINTS[point])


# Cost, in instructions of the generated function


def instructions(inputs: list[ca.SX], *results: ca.SX) -> Any:
    return ca.Function("counted", inputs, list(results)).n_instructions()


def test_cost_of_the_parts() -> None:
    share = ca.SX.sym("share")
    state = free_motion.start(J, W, T, share)
    s = ca.SX.sym("s", state.numel())
    ends = instructions([J, W, T, share], state) + instructions([J, W, T, s], *free_motion.finish(J, W, T, s))
    assert ends <= 6 * RK4_INSTRUCTIONS
    assert instructions([s], free_motion.double(s)) <= 0.4 * RK4_INSTRUCTIONS


@pytest.mark.parametrize("room", [0, 4, 8, 20])
def test_jacobian_costs_eight_values_at_the_most(room: int) -> None:
    out = ca.vertcat(*free_motion.free_turn(J, W, T, room))
    together = instructions([J, W, T], out, ca.jacobian(out, ca.vertcat(W, T)))
    assert together <= 8 * instructions([J, W, T], out)
