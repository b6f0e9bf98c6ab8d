"""Derivatives of the twin's free motion where the body hardly turns, against differences of many digits."""

from collections.abc import Sequence
from functools import cache
from typing import Any

import casadi as ca
import mpmath
import numpy as np
import pytest

from supervessel import Twin
from supervessel.rotation.propagators.exact import SHORT
from support import body, scene, variant
from support.marks import some_at_once

mp = mpmath.MPContext()

MOMENTS = {
    "asymmetric": (1.0, 1.2, 1.5),
    "prolate": (1.0, 1.5, 1.5),
    "oblate": (1.0, 1.0, 1.5),
    "spherical": (1.2, 1.2, 1.2),
    "slender": (0.02, 1.0, 1.01),
}
DIRECTION = np.array([0.3, -0.7, 0.5])  # of the rates
REACH = SHORT / np.linalg.norm(DIRECTION)
ANGLES = [0.0, 5e-324, 1e-310, 1e-160, 1e-30, 1e-16, 1e-12, 1e-8, 1e-4, 0.999 * REACH, 1.001 * REACH]
TERMS = 30
STATED = 1e-12
BY_MOMENTS = 32 * 2.0**-53 / SHORT**2
"""What the closed form's u of a turn leaves of a derivative as small as the square of the angle: 4e-12."""


def product(p: Sequence[Any], q: Sequence[Any]) -> list[Any]:
    return [
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] + p[2] * q[0] + p[3] * q[1] - p[1] * q[3],
        p[0] * q[3] + p[3] * q[0] + p[1] * q[2] - p[2] * q[1],
    ]


def moved(moments: Sequence[Any], x: Sequence[Any], h: Any) -> list[Any]:
    """The state after h by Euler's equations in Taylor series; the angle is below 0.1."""
    a, b, c = moments
    factors = (b - c) / a, (c - a) / b, (a - b) / c
    w, q = [list(x[4:])], [list(x[:4])]
    for k in range(TERMS):
        pairs = [(w[i], w[k - i]) for i in range(k + 1)]
        w.append(
            [
                factor * sum(u[i - 2] * v[i - 1] for u, v in pairs) / (k + 1)
                for i, factor in enumerate(factors)
            ]
        )
        turned = [product(q[i], [0, *w[k - i]]) for i in range(k + 1)]
        q.append([sum(column) / (2 * (k + 1)) for column in zip(*turned, strict=True)])
    whole = [sum(term[i] * h**k for k, term in enumerate(s)) for s in (q, w) for i in range(len(s[0]))]
    length = mp.sqrt(sum(v * v for v in whole[:4]))
    return [*(v / length for v in whole[:4]), *whole[4:]]


def slopes(moments: Sequence[float], x: Sequence[float], h: float) -> list[np.ndarray]:
    """Derivatives by x, by the moments and by h, each by central differences."""
    size = max(abs(v) for v in x[4:]) * h or 1.0
    mp.dps = 90 - 2 * int(np.floor(np.log10(size)))
    at = [mp.mpf(float(v)) for v in (*x, *moments, h)]
    columns = []
    for i, value in enumerate(at):
        change = mp.mpf(10) ** -25 * (value if i >= 7 else max(size if i >= 4 else 1, abs(value)))
        ends = []
        for sign in (1, -1):
            shifted = [v + sign * change * (j == i) for j, v in enumerate(at)]
            ends.append(moved(shifted[7:10], shifted[:7], shifted[10]))
        columns.append([float((a - b) / (2 * change)) for a, b in zip(*ends, strict=True)])
    whole = np.array(columns).T
    return [whole[:, :7], whole[:, 7:10], whole[:, 10:]]


@cache
def jacobians(name: str, propagator: str) -> ca.Function:
    """x, p, h -> derivatives by x, p, h as SX, as MX in forward and as MX in reverse mode."""
    raw = variant(
        body(1000.0, MOMENTS[name], propagator=propagator),
        {"inputs": {"mass": ["B"], "pmi": ["B"], "torque": propagator == "split"}},
    )
    twin = Twin(scene(raw))
    u = np.zeros(len(twin.u_names))
    one = ca.SX.sym("x", 7), ca.SX.sym("p", 4), ca.SX.sym("h")
    other = ca.MX.sym("x", 7), ca.MX.sym("p", 4), ca.MX.sym("h")
    found = []
    end = twin.step(one[0], u, one[1], one[2])
    by_sx = ca.Function("by_sx", [*one], [ca.jacobian(end, known) for known in one])
    found += by_sx(*other)
    end = twin.step(other[0], u, other[1], other[2])
    found += [ca.jtimes(end, known, ca.MX.eye(known.numel())) for known in other]
    found += [ca.jtimes(end, known, ca.MX.eye(7), True).T for known in other]
    return ca.Function("jacobians", [*other], found)


def blocks(jacobian: np.ndarray) -> list[np.ndarray]:
    """Rows of the attitude and of the rate, and their columns by attitude and rate where there are seven."""
    columns = [slice(0, 4), slice(4, 7)] if jacobian.shape[1] == 7 else [slice(None)]
    return [jacobian[rows, part] for rows in (slice(0, 4), slice(4, 7)) for part in columns]


@pytest.mark.parametrize("propagator", ["exact", pytest.param("split", marks=pytest.mark.stability)])
@pytest.mark.parametrize("name", MOMENTS)
@pytest.mark.parametrize(
    ("rate", "h"),
    some_at_once(
        [*((angle / 0.8, 0.8) for angle in ANGLES), (0.9, 1e-9)],
        *((angle / 0.8, 0.8) for angle in (0.0, 1e-310, ANGLES[-1])),
    ),
)
def test_derivatives_are_right_however_little_the_body_turns(propagator, name, rate, h):
    """By state and time, and by moments that tell axes apart, in every mode: 1e-12 of each block.

    Products of rates may underflow: of what is left below the least normal number nothing is asked.
    """
    x = np.array([0.5, 0.1, -0.7, 0.5, *(rate * DIRECTION)])
    x[:4] /= np.linalg.norm(x[:4])
    truth = slopes(MOMENTS[name], x, h)
    found = [np.array(j) for j in jacobians(name, propagator)(x, [1000.0, *MOMENTS[name]], h)]
    least = 2.0**-1022
    for by_x, by_p, by_h in zip(*(found[i::3] for i in range(3)), strict=True):
        pairs = [(by_x, truth[0], STATED), (by_h, truth[2], STATED)]
        if len(set(MOMENTS[name])) == 3:
            pairs.append((by_p[:, 1:], truth[1], STATED if rate * h < REACH else BY_MOMENTS))
        for one, other, stated in pairs:
            for mine, right in zip(blocks(one), blocks(other), strict=True):
                assert np.abs(mine - right).max() <= stated * np.abs(right).max() + least


@pytest.mark.parametrize("propagator", ["exact", "split"])
@pytest.mark.parametrize("name", ["prolate", "oblate", "spherical"])
@pytest.mark.parametrize("rate", [0.0, 1e-9, 1.0])
def test_what_is_not_known_by_inputs_leaves_the_derivatives_by_the_state_alone(propagator, name, rate):
    x = [1.0, 0.0, 0.0, 0.0, *(rate * DIRECTION)]
    found = [np.array(j) for j in jacobians(name, propagator)(x, [1000.0, *MOMENTS[name]], 0.8)]
    for by_x, by_p, by_h in zip(*(found[i::3] for i in range(3)), strict=True):
        assert np.isnan(by_p).any()
        assert np.isfinite(by_x).all()
        assert np.isfinite(by_h).all()
        assert np.abs(by_x - found[0]).max() <= 1e-14


@pytest.mark.parametrize("law", ["decoupled", "principal", "tensor"])
def test_the_longest_step_has_derivatives_at_rest_and_without_torque(law):
    """At rest with torque a, angle/sqrt(2 f a); turning, angle/(sqrt(e) w); at rest without, infinite."""
    raw = variant(body(1000.0, (1.0, 1.2, 1.5), propagator="rk4"), {"rotation.law": law})
    raw = variant(raw, {"inputs": {"mass": ["B"], "torque": True}})
    twin = Twin(scene(raw))
    jacobian = twin.longest_step.jacobian()

    def at(rate: Any, torque: Any) -> tuple[float, list[np.ndarray]]:
        given = {"x": [1.0, 0.0, 0.0, 0.0, *rate], "u": torque, "p": twin.p_start}
        found = jacobian(**given)
        return float(twin.longest_step(**given)["h_max"]), [
            np.array(found[f"jac_h_max_{k}"])[0] for k in "xup"
        ]

    h, by = at((0, 0, 0), (0, 0, 0))
    assert h == np.inf
    assert not any(column.any() for column in by)
    h, (by_x, by_u, by_p) = at((0, 0, 0), (0, 0, 4.0))
    assert by_u == pytest.approx([0.0, 0.0, -0.5 * h / 4.0], rel=1e-14)
    assert by_p == pytest.approx([0.5 * h / 1000.0], rel=1e-14)
    assert not by_x.any()
    h, (by_x, by_u, by_p) = at((0.3, 0.0, 0.4), (0, 0, 0))
    assert by_x[4:] == pytest.approx(-h / 0.25 * np.array([0.3, 0.0, 0.4]), rel=1e-14)
    assert not by_u.any()
    assert not by_p.any()
