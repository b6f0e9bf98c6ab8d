"""Propagators in the twin: the FMU's steps, room for free motion, outputs."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from supervessel import Twin
from supervessel.rotation.propagators.free_motion import FIRST_ANGLE, LARGEST_TURN
from support import (
    ISS_DG,
    OK,
    PROPAGATORS,
    STEADY,
    Array,
    U,
    body,
    flying,
    random_rotation,
    scene,
    series,
    variant,
)
from support.marks import some_at_once
from twin.scenes import numbers

RATES = [0.05, -0.08, 0.11]
OUTPUTS = [*ISS_DG["outputs"]["names"], "principal_moments", "principal_axes", "error_estimate"]
TORQUE, WEAK_TORQUE = [2e5, -1e5, 3e5], [2e-3, -1e-3, 3e-3]


def assembly(propagator: str, law: str = "tensor") -> dict[str, Any]:
    rotation = STEADY | {
        "law": law,
        "propagator": propagator,
        "angular_velocity": RATES,
        "attitude": [0.5, -0.5, 0.7, 0.1],
        "max_angle_step": 1.0,
        "tolerance": 1e-6,
    }
    changes = {"name": f"twin_{propagator}", "rotation": rotation, "outputs.names": OUTPUTS}
    return variant(ISS_DG, changes)


def flight(
    raw: dict[str, Any], twin: Twin, torque: list[float], sizes: list[float]
) -> Iterator[tuple[Array, ...]]:
    """Yields x, u, p, h and the FMU's x after each of a few steps under other inputs, then its outputs."""
    rng = np.random.default_rng(5)
    shown = [name for name in raw["outputs"]["names"] if name != "error_estimate"]
    with flying(raw) as fmu:
        for h in sizes:
            x = np.concatenate([fmu.get("state.attitude"), fmu.get("state.angular_velocity")])
            # one factor for each vector: moments keep to the triangle's inequality
            factors = {
                group: rng.uniform(0.9, 1.1) for group in (name.partition("[")[0] for name in twin.p_names)
            }
            p = twin.p_start * [factors[name.partition("[")[0]] for name in twin.p_names]
            u = np.array(torque) * rng.uniform(0.5, 1.5, 3)
            assert fmu.set(dict(zip((*twin.p_names, *twin.u_names), (*p, *u), strict=True))) == OK
            assert fmu.step(h) == OK, fmu.log
            end = np.concatenate([fmu.get("state.attitude"), fmu.get("state.angular_velocity")])
            y = np.concatenate([np.atleast_1d(fmu.get(name)) for name in shown])
            yield x, u, p, np.array([h]), end, y


def torque_of(propagator: str) -> list[float]:
    return {"exact": [0.0] * 3, "split": WEAK_TORQUE}.get(propagator, TORQUE)


def steps_of(propagator: str) -> list[float]:
    """Returns steps [s] that the FMU takes as one: a tenth of a radian; free motion takes any."""
    return [3.0, 200.0, 0.01, 40.0, 1e-9, 17.0] if propagator == "exact" else [0.5, 0.3, 0.7, 0.6, 0.01, 0.4]


# The FMU loops over as many doublings as it needs and scales rates and moments by powers of two; the twin
# chooses among expressions for each number of doublings, and CasADi may join theirs in other ways. Each may
# be 8 u (1 + angle) off the truth; half of that is what they keep to each other.
FREE_ULPS = 4.0


def assert_same(found: Array, end: Array, h: float) -> None:
    """Compares states after free motion over h: attitude, and angular velocity relative to its size."""
    rate = float(np.abs(end[4:]).max())
    limit = FREE_ULPS * U * (1.0 + np.linalg.norm(end[4:]) * h)
    assert np.abs(found[:4] - end[:4]).max() <= limit
    assert np.abs(found[4:] - end[4:]).max() <= limit * rate


@pytest.mark.parametrize(
    ("propagator", "law"),
    some_at_once(
        [
            *((propagator, "tensor") for propagator in PROPAGATORS),
            ("exact", "principal"),
            ("taylor", "principal"),
        ],
        ("rk4", "tensor"),
        ("dop853", "tensor"),
        ("exact", "principal"),
        ("taylor", "principal"),
    ),
)
def test_step_is_the_fmus(propagator, law):
    raw = assembly(propagator, law)
    twin = Twin(scene(raw))
    for x, u, p, h, end, y in flight(raw, twin, torque_of(propagator), steps_of(propagator)):
        found = numbers(twin.step(x, u, p, h))
        if propagator in ("exact", "split") or (propagator in ("taylor", "auto") and law == "tensor"):
            assert_same(found, end, float(h[0]))
        else:
            assert found.tolist() == end.tolist()
        assert numbers(twin.outputs(end, u, p)).tolist() == y.tolist()


@pytest.mark.parametrize("propagator", PROPAGATORS)
def test_generated_c_of_a_step_is_the_fmus(propagator, tmp_path):
    raw = assembly(propagator)
    twin = Twin(scene(raw))
    step = twin.generate(tmp_path, ["step"], derivatives=0)["step"]
    assert step.class_name() == "External"
    for x, u, p, h, end, _ in flight(raw, twin, torque_of(propagator), steps_of(propagator)):
        found = numbers(step(x, u, p, h))
        if propagator in ("rk4", "dop853"):
            assert found.tolist() == end.tolist()
        else:
            assert_same(found, end, float(h[0]))


def test_outputs_show_principal_axes_and_leave_the_estimate_out():
    twin = Twin(scene(assembly("exact")))
    assert "error_estimate" not in twin.y_names
    with flying(assembly("exact")) as fmu:
        outputs = [v.name for v in fmu.description.modelVariables if v.causality == "output"]
    assert twin.y_names == tuple(name for name in outputs if name != "error_estimate")
    y = dict(zip(twin.y_names, numbers(twin.outputs(twin.x_start, [0.0] * 3, twin.p_start)), strict=True))
    J = np.array(twin.composite(twin.p_start)[2])
    moments = [y[f"principal_moments[{i}]"] for i in (1, 2, 3)]
    # a few roundings of the largest, on either side
    assert np.abs(np.array(moments) - np.linalg.eigvalsh(J)).max() <= 16 * U * moments[2]
    assert sum(y[f"principal_axes[{i}]"] ** 2 for i in (1, 2, 3, 4)) == pytest.approx(1.0, abs=8 * U)


SINGLE = body(1000.0, (1.0, 2.0, 2.5), propagator="exact", angular_velocity=RATES)


def phase_rate(J: Array, w: Array) -> float:
    """Returns the rate [1/s] of the argument of Jacobi's functions: sqrt(H (J2 - J1)/(J0 J1 J2)).

    Where the motion circles the first axis, the moments change places.
    """
    a, b, c = J
    if c * (c - b) * w[2] ** 2 < a * (b - a) * w[0] ** 2:
        return math.sqrt((b * (c - b) * w[1] ** 2 + a * (c - a) * w[0] ** 2) * (b - a) / (a * b * c))
    return math.sqrt((b * (b - a) * w[1] ** 2 + c * (c - a) * w[2] ** 2) * (c - b) / (a * b * c))


@pytest.mark.parametrize("doublings", [0, 3, 8])
def test_free_motion_beyond_the_twins_room_is_nan_and_within_it_the_fmus(doublings):
    twin = Twin(scene(SINGLE), doublings=doublings)
    room = FIRST_ANGLE * 2.0**doublings / phase_rate(np.array([1.0, 2.0, 2.5]), np.array(RATES))
    for factor in (1e-3, 0.5, 1.0 - 1e-12):
        x_next = numbers(twin.step(twin.x_start, [0.0] * 3, twin.p_start, factor * room))
        with flying(SINGLE) as fmu:
            assert fmu.step(factor * room) == OK
            end = np.concatenate([fmu.get("state.attitude"), fmu.get("state.angular_velocity")])
        assert_same(x_next, end, factor * room)
    for factor in (1.0 + 1e-12, 2.0, 1e6):
        assert np.isnan(numbers(twin.step(twin.x_start, [0.0] * 3, twin.p_start, factor * room))).all()


@pytest.mark.parametrize("propagator", ["exact", "split"])
@pytest.mark.parametrize(("pmi", "doublings"), [((2.0, 2.0, 2.0), 0), ((1.0, 2.0, 2.5), 40)])
def test_free_motion_of_too_many_turns_is_nan(pmi, doublings, propagator):
    twin = Twin(scene(body(1000.0, pmi, propagator=propagator, angular_velocity=RATES)), doublings=doublings)
    reach = LARGEST_TURN / np.linalg.norm(RATES)
    for h, followed in ((0.999, True), (-0.999, True), (1.001, False), (-1.001, False), (1e200, False)):
        x_next = numbers(twin.step(twin.x_start, [0.0] * 3, twin.p_start, h * reach))
        assert np.isfinite(x_next).all() if followed else np.isnan(x_next).all()


@pytest.mark.parametrize(
    ("way", "count", "h"),
    some_at_once(
        [("rollout", 5000, 0.04), ("fold", 20000, 0.01), ("FMU", 5000, 0.04)],
        ("rollout", 5000, 0.04),
        ("FMU", 5000, 0.04),
    ),
)
def test_many_steps_of_free_motion_end_where_one_does(way, count, h):
    """Over 180 rad. From one start 8 u (1 + angle); each rate u off, 0.6 u count^1.5 angle of a step.

    The latter for steps below 1/32 rad, which find the change of the rate by itself; else it is some 8 u off.
    """
    raw = body(1000.0, (1.0, 1.2, 1.5), propagator="exact", angular_velocity=[0.3, 0.7, 0.5])
    raw = variant(raw, {"inputs": {"mass": ["B"], "torque": False}})
    twin = Twin(scene(raw))
    if way == "rollout":
        end = numbers(twin.rollout(count)(x=twin.x_start, h=h)["x_next"][:, -1])
    elif way == "fold":
        end = numbers(twin.step.fold(count)(x=twin.x_start, h=h)["x_next"])
    else:
        with flying(raw) as fmu:
            for _ in range(count):
                assert fmu.step(h) == OK
            end = np.concatenate([fmu.get("state.attitude"), fmu.get("state.angular_velocity")])
    truth = series.flight("tensor", np.diag([1000.0, 1200.0, 1500.0]), twin.x_start, np.zeros(3), count * h)
    rate = float(np.linalg.norm(twin.x_start[4:]))
    off = [abs(float(series.mp.mpf(float(a)) - b)) for a, b in zip(end, truth, strict=True)]
    limit = 0.6 * U * count**1.5 * rate * h if way == "fold" else 8 * U * (1.0 + rate * count * h)
    assert max(off) <= limit


def test_backwards_is_back_at_the_start():
    twin = Twin(scene(SINGLE))
    for h in (0.3, 25.0, 140.0):
        end = twin.step(twin.x_start, [0.0] * 3, twin.p_start, h)
        back = numbers(twin.step(end, [0.0] * 3, twin.p_start, -h))
        # there and back 8 u (1 + angle) each; the first one's error of the rate acts on the second
        turned = float(np.linalg.norm(RATES)) * h
        assert np.abs(back - twin.x_start).max() <= 2 * 8 * U * (1 + turned)


def test_steps_with_and_without_doublings_agree():
    few, many = (Twin(scene(SINGLE), doublings=n) for n in (4, 12))
    for h in (0.1, 5.0, 40.0):
        at = few.x_start, [0.0] * 3, few.p_start, h
        assert numbers(few.step(*at)).tolist() == numbers(many.step(*at)).tolist()


def test_auto_of_a_scene_without_inputs_is_free_motion_in_any_axes():
    tilt = random_rotation(3)
    J = tilt @ np.diag([1000.0, 2000.0, 2500.0]) @ tilt.T
    raw = variant(
        body(propagator="auto", angular_velocity=RATES),
        {"vessels.B.pmi": None, "vessels.B.inertia": ((J + J.T) / 2).tolist(), "inputs": {}},
    )
    twin = Twin(scene(raw))
    x = numbers(twin.step(twin.x_start, [], [], 100.0))
    momentum = [np.linalg.norm(J @ w) for w in (twin.x_start[4:], x[4:])]
    # J's own error of a few u, and 8 u (1 + angle) of the rate, angle 15 rad
    assert abs(momentum[1] / momentum[0] - 1.0) <= 8 * U * 16
    with flying(raw) as fmu:
        assert fmu.step(100.0) == OK
        end = np.concatenate([fmu.get("state.attitude"), fmu.get("state.angular_velocity")])
    assert_same(x, end, 100.0)
