"""Where the attracting centre of a field of gravity may be during a step, in CasADi symbols.

The centre moves by two-body motion from its place at the start. Derivation: [EB] section 8.
"""

from dataclasses import dataclass

import casadi as ca

from supervessel.rotation.attitude import to_body, unit
from supervessel.rotation.gravity import Field, strength


@dataclass(frozen=True)
class CentreMotion:
    """How an attracting centre moves during a step, seen from the body; everything holds all through it.

    known     : whether the step is short enough for the others to hold
    direction : r^ at the start, (3,), body axes
    strength  : 3 mu/|r|^3 at the start [1/s2]
    strongest : it is at most that [1/s2]
    change    : it is off that at the start by at most that [1/s2]
    turn      : r^ turns by at most that in inertial axes [rad]
    pace      : the larger of |v|/|r| and sqrt(mu/|r|^3) at the start [rad/s]
    fall_rate : sqrt(mu/|r|^3) at the start [rad/s], or SLOWEST, if that is more: it is divided by
    gone      : the step times pace [rad]
    nearest   : least |r| over that at the start
    scaled    : the larger of one over `nearest` and the largest |r| over that at the start
    """

    known: ca.SX
    direction: ca.SX
    strength: ca.SX
    strongest: ca.SX
    change: ca.SX
    turn: ca.SX
    pace: ca.SX
    fall_rate: ca.SX
    gone: ca.SX
    nearest: ca.SX
    scaled: ca.SX


def centre_motion(field: Field, attitude: ca.SX, step: ca.SX) -> CentreMotion:
    """Returns how the centre moves during a step. [EB] eqs. (51) to (53).

    attitude : q_inertial_body at the start, (4,)
    step     : [s], of any length; beyond what is known the others are finite
    """
    position, velocity = field.start[:3], field.start[3:]
    square = ca.sumsqr(position)
    at_start = strength(field.mu, position)
    fall_rate = ca.fmax(ca.sqrt(at_start / 3.0), SLOWEST)
    speed, radial = ca.sqrt(ca.sumsqr(velocity) / square), ca.dot(position, velocity) / square
    inward, outward = step * ca.fmax(-radial, 0.0), step * ca.fmax(radial, 0.0)
    fall, sway = (step * fall_rate) ** 2, step * speed
    first = 1.0 - (inward + 2.0 * fall)
    known = first >= 0.5
    first = ca.fmax(first, 0.5)
    nearer = ca.fmin((inward + 0.5 * fall / (first * first)) * SLACK, 0.5)
    nearest = 1.0 - nearer
    cube = nearest * nearest * nearest
    farther = (outward + 0.5 * sway * sway / cube) * SLACK
    increase = nearer * (1.0 + nearest + nearest * nearest) / cube
    pace = ca.fmax(speed, fall_rate)
    return CentreMotion(
        known=known,
        direction=unit(to_body(attitude, position)),
        strength=at_start,
        strongest=SLACK * at_start / cube,
        change=SLACK * at_start * ca.fmax(increase, 3.0 * farther),
        turn=SLACK * sway / (nearest * nearest),
        pace=pace,
        fall_rate=fall_rate,
        gone=step * pace,
        nearest=nearest,
        scaled=SLACK * ca.fmax(1.0 / nearest, 1.0 + farther),
    )


SLOWEST = 2.0**-100
"""A rate [rad/s] of no account, far above the least double."""

SLACK = 1.0 + 2.0**-44
"""For the rounding of some dozen operations on positive numbers."""

FARTHEST_OFF = 2.0**-6
"""Largest error of the centre's place, over its distance, with which the bound is finite."""

STEADY = 2.2
"""Bound of the gradient of gravity's acceleration, over mu/|r|^3, at most 2 FARTHEST_OFF away from r."""


LONGEST = 64.0
"""Exponent that steps do not reach whose motion of the centre is known."""


def place_during(centre: CentreMotion, place: ca.SX, step: ca.SX) -> ca.SX:
    """Returns the error of the place at most during a step, from that at its start. [EB] eq. (54).

    place : the larger of the position's error over |r| and the velocity's over |r| fall_rate, at the start;
            so is the result, in the units of the start; it holds up to FARTHEST_OFF
    """
    exponent = STEADY * step * centre.fall_rate / centre.nearest**3
    return place * ca.exp(ca.fmin(exponent, LONGEST)) * SLACK


def place_after(centre: CentreMotion, during: ca.SX, added: ca.SX) -> ca.SX:
    """Returns the error of the place after a step, in the units of its end. [EB] eq. (54).

    during : from `place_during`
    added  : by the step itself, in the units of the start
    """
    return centre.scaled * (during + added)
