"""The explicit Runge-Kutta method of Dormand and Prince of order 8 with error estimates of orders 5 and 3."""

from collections.abc import Callable, Mapping, Sequence

import casadi as ca

from supervessel.rotation.attitude import unit
from supervessel.rotation.propagators.method import Propagator, Step, StepSymbols

ORDER = 8
"""Exponent of the step in the estimated error of a step; the true one goes with a power more."""

STAGES: tuple[Mapping[int, float], ...] = (
    {},
    {0: 0.05260015195876773},
    {0: 0.0197250569845379, 1: 0.0591751709536137},
    {0: 0.02958758547680685, 2: 0.08876275643042054},
    {0: 0.2413651341592667, 2: -0.8845494793282861, 3: 0.924834003261792},
    {0: 0.037037037037037035, 3: 0.17082860872947386, 4: 0.12546768756682242},
    {0: 0.037109375, 3: 0.17025221101954405, 4: 0.06021653898045596, 5: -0.017578125},
    {
        0: 0.03709200011850479,
        3: 0.17038392571223998,
        4: 0.10726203044637328,
        5: -0.015319437748624402,
        6: 0.008273789163814023,
    },
    {
        0: 0.6241109587160757,
        3: -3.3608926294469414,
        4: -0.868219346841726,
        5: 27.59209969944671,
        6: 20.154067550477894,
        7: -43.48988418106996,
    },
    {
        0: 0.47766253643826434,
        3: -2.4881146199716677,
        4: -0.590290826836843,
        5: 21.230051448181193,
        6: 15.279233632882423,
        7: -33.28821096898486,
        8: -0.020331201708508627,
    },
    {
        0: -0.9371424300859873,
        3: 5.186372428844064,
        4: 1.0914373489967295,
        5: -8.149787010746927,
        6: -18.52006565999696,
        7: 22.739487099350505,
        8: 2.4936055526796523,
        9: -3.0467644718982196,
    },
    {
        0: 2.273310147516538,
        3: -10.53449546673725,
        4: -2.0008720582248625,
        5: -17.9589318631188,
        6: 27.94888452941996,
        7: -2.8589982771350235,
        8: -8.87285693353063,
        9: 12.360567175794303,
        10: 0.6433927460157636,
    },
)
"""For each stage the weights of the rates before it, by their number. Source: [HNW], code DOP853."""

WEIGHTS: Mapping[int, float] = {
    0: 0.054293734116568765,
    5: 4.450312892752409,
    6: 1.8915178993145003,
    7: -5.801203960010585,
    8: 0.3111643669578199,
    9: -0.1521609496625161,
    10: 0.20136540080403034,
    11: 0.04471061572777259,
}
"""Of the rates in the step. Source: [HNW], code DOP853."""

FIFTH_ORDER: Mapping[int, float] = {
    0: 0.01312004499419488,
    5: -1.2251564463762044,
    6: -0.4957589496572502,
    7: 1.6643771824549864,
    8: -0.35032884874997366,
    9: 0.3341791187130175,
    10: 0.08192320648511571,
    11: -0.022355307863886294,
}
"""WEIGHTS less those of the embedded method of order 5. Source: [HNW], code DOP853."""

THIRD_ORDER: Mapping[int, float] = {0: 0.2440944881889764, 8: 0.7338466882816118, 11: 0.022058823529411766}
"""Weights of the embedded method of order 3. Source: [HNW], code DOP853."""


def dop853_step(ode: Callable[[ca.SX], ca.SX], state: ca.SX, step: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Returns the state (attitude, angular velocity, and what goes along), (n,), one step later.

    The second result is the estimated error, (2,).
    ode   : state -> its rate
    state : (n,), attitude of any length near 1; it is at unit length afterwards
    step  : [s]
    error : of the attitude [rad] and of the angular velocity [rad/s], in this step
    """
    rates = _stage_rates(ode, state, step)
    mean = _weighted(rates, WEIGHTS)
    end = state + step * mean
    fifth = step * _weighted(rates, FIFTH_ORDER)
    third = step * (mean - _weighted(rates, THIRD_ORDER))
    error = ca.vertcat(2.0 * _combined(fifth[:4], third[:4]), _combined(fifth[4:7], third[4:7]))
    return ca.vertcat(unit(end[:4]), end[4:]), error


def runge_kutta_end(ode: Callable[[ca.SX], ca.SX], state: ca.SX, step: ca.SX) -> ca.SX:
    """Returns any state, (n,), one step later, by the method of order 8; ode : state -> its rate."""
    return state + step * _weighted(_stage_rates(ode, state, step), WEIGHTS)


def _stage_rates(ode: Callable[[ca.SX], ca.SX], state: ca.SX, step: ca.SX) -> list[ca.SX]:
    """Returns the rates at all stages of a step."""
    rates: list[ca.SX] = []
    for stage in STAGES:
        rates.append(ode(state + step * _weighted(rates, stage) if stage else state))
    return rates


def _weighted(rates: Sequence[ca.SX], weights: Mapping[int, float]) -> ca.SX:
    return sum((weight * rates[j] for j, weight in weights.items()), ca.SX.zeros(rates[0].numel()))


def _combined(fifth: ca.SX, third: ca.SX) -> ca.SX:
    """Returns |e5|^2 / sqrt(|e5|^2 + 0.01 |e3|^2), zero where both vanish. Source: [HNW], code DOP853."""
    square = ca.sumsqr(fifth)
    total = square + 0.01 * ca.sumsqr(third)
    return square / ca.sqrt(ca.if_else(total > 0.0, total, 1.0))


def build(motion: StepSymbols) -> Step:
    """Returns one step with its estimate."""
    return Step(*dop853_step(motion.rate, motion.state, motion.step), ORDER)


PROPAGATOR = Propagator(
    build,
    "error",
    "never",
    "The Runge-Kutta method DOP853 of order 8 ([HNW], code DOP853). A communication step is divided so that "
    "the estimated error of the attitude at its end stays below <code>tolerance</code>.",
    c_files=("dop853", "tried_steps", "estimated_steps"),
    marker="s",
    safety=5.0,
)
