"""Rotation: closed forms, conservation, order of the step, DOP853, and how far a sub-step may turn."""

from collections.abc import Callable
from fractions import Fraction
from functools import cache
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given
from scipy.integrate import solve_ivp

from supervessel import Twin, reference
from support import ISS_DG, LAWS, Array, U, body, hamilton, random_rotation, scene, variant
from support.examples import examples

Flight = tuple[dict[str, Any], Any, Array]  # raw scene, torque, state after DURATION

RATES = (0.3, 0.7, 0.5)  # rad/s
ATTITUDE = (0.5, -0.1, 0.7, 0.3)
TORQUE = (150.0, -300.0, 200.0)  # N m
TILTED = np.array([[1000.0, 60.0, -40.0], [60.0, 2000.0, 50.0], [-40.0, 50.0, 2500.0]])

# The error is C h^4 (1 + c h + ...) with c h about the angle turned in a step, 0.12 rad at most here: over
# four halvings the fitted slope is off by no more than 0.12 / ln 16. Steps below these show rounding.
SLOPE_SLACK = 0.04
DURATION = 16.0  # s
STEPS = (128, 256, 512, 1024, 2048)
# DOP853 with rtol = 1e-13 over some ten radians, where its local errors add up.
DOP853_ERROR = 4e-12


def tilted(**rotation: Any) -> dict[str, Any]:
    """Returns the raw scene of a single body with a tilted tensor."""
    raw = variant(body(**rotation), {"vessels.B.pmi": None})
    return variant(raw, {"vessels.B.inertia": TILTED.tolist()})


def flown(twin: Twin, torque: Any, h: float, count: int) -> Array:
    """Returns the states after each of `count` steps, (7, count)."""
    u, p = (np.tile(np.array(v, dtype=float)[:, None], count) for v in (torque, twin.p_start))
    return np.array(twin.step.mapaccum(count)(twin.x_start, u, p, np.full((1, count), h)))


def dop853(twin: Twin, torque: Any, duration: float) -> Array:
    """Returns the state after `duration` by SciPy's integrator on the numpy reference."""
    inertia = reference.composite(twin.scene).inertia

    def ode(_: float, x: Array) -> Array:
        acceleration = reference.angular_acceleration(twin.scene.rotation.law, inertia, x[4:], torque)
        return np.concatenate([reference.attitude_dot(x[:4], x[4:]), acceleration])

    assert ode(0.0, twin.x_start).tolist() == reference.ode(twin.scene, twin.x_start, torque).tolist()
    done = solve_ivp(ode, (0.0, duration), twin.x_start, method="DOP853", rtol=1e-13, atol=1e-16)
    return done.y[:, -1]


def turn(vector: Any) -> Array:
    """Returns the quaternion of a rotation by |vector| about it."""
    vector = np.asarray(vector, dtype=float)
    angle = np.linalg.norm(vector)
    return np.array([np.cos(angle / 2), *(np.sin(angle / 2) * vector / angle)])


def constant_rate() -> Flight:
    raw = tilted(law="none", angular_velocity=list(RATES), attitude=list(ATTITUDE))
    start = scene(raw).rotation.attitude
    return raw, TORQUE, np.array([*hamilton(start, turn(DURATION * np.array(RATES))), *RATES])


def constant_torque() -> Flight:
    raw = tilted(law="decoupled", attitude=list(ATTITUDE))
    acceleration = 150.0 / TILTED[1, 1]
    turned = turn([0.0, acceleration * DURATION**2 / 2, 0.0])
    state = [*hamilton(scene(raw).rotation.attitude, turned), 0.0, acceleration * DURATION, 0.0]
    return raw, (0.0, 150.0, 0.0), np.array(state)


def symmetric_top(law: str) -> Flight:
    """A top of moments (a, a, c): precession about its momentum after a spin about its own axis."""
    a, c, mass = 2.0, 1.2, 1000.0
    raw = body(mass, (a, a, c), law=law, angular_velocity=list(RATES), attitude=list(ATTITUDE))
    start, omega = scene(raw).rotation.attitude, np.array(RATES)
    momentum = reference.rotation_matrix(start) @ (np.array([a, a, c]) * omega)
    spin = np.array([0.0, 0.0, (1 - c / a) * omega[2] * DURATION])
    attitude = hamilton(hamilton(turn(momentum / a * DURATION), start), turn(spin))
    phase = (1 - c / a) * omega[2] * DURATION
    x, y = (
        np.cos(phase) * omega[0] + np.sin(phase) * omega[1],
        np.cos(phase) * omega[1] - np.sin(phase) * omega[0],
    )
    return raw, (0.0, 0.0, 0.0), np.array([*attitude, x, y, omega[2]])


def against_dop853(law: str, torque: Any) -> Flight:
    raw = tilted(law=law, angular_velocity=list(RATES), attitude=list(ATTITUDE))
    return raw, torque, dop853(Twin(scene(raw)), torque, DURATION)


FLIGHTS: dict[str, Callable[[], Flight]] = {
    "none, constant rate": constant_rate,
    "decoupled, constant torque from rest": constant_torque,
    "decoupled, torque": lambda: against_dop853("decoupled", TORQUE),
    "principal, symmetric top": lambda: symmetric_top("principal"),
    "principal, torque": lambda: against_dop853("principal", TORQUE),
    "tensor, symmetric top": lambda: symmetric_top("tensor"),
    "tensor, free": lambda: against_dop853("tensor", (0.0, 0.0, 0.0)),
    "tensor, torque": lambda: against_dop853("tensor", TORQUE),
}


@cache
def errors(flight: str) -> tuple[Array, Array]:
    """Returns the errors of attitude and rate after DURATION, for each number of STEPS."""
    raw, torque, truth = FLIGHTS[flight]()
    twin = Twin(scene(raw))
    ends = [flown(twin, torque, DURATION / count, count)[:, -1] - truth for count in STEPS]
    attitude, rates = (
        np.array([np.abs(end[part]).max() for end in ends]) for part in (slice(4), slice(4, 7))
    )
    return attitude, rates


def slope(error: Array) -> float:
    return float(np.polyfit(np.log([DURATION / count for count in STEPS]), np.log(error), 1)[0])


# Closed forms and order


@pytest.mark.parametrize("flight", FLIGHTS)
def test_attitude_converges_with_order_four(flight: str) -> None:
    assert abs(slope(errors(flight)[0]) - 4.0) <= SLOPE_SLACK


@pytest.mark.parametrize("flight", [name for name in FLIGHTS if name.startswith(("principal", "tensor"))])
def test_rates_converge_with_order_four(flight: str) -> None:
    assert abs(slope(errors(flight)[1]) - 4.0) <= SLOPE_SLACK


def test_law_none_keeps_the_rates_under_torque() -> None:
    raw, torque, _ = constant_rate()
    assert (flown(Twin(scene(raw)), torque, 0.1, 100)[4:].T == RATES).all()


def test_constant_torque_gives_rates_in_proportion_to_time_under_decoupled() -> None:
    raw, torque, truth = constant_torque()
    rates = flown(Twin(scene(raw)), torque, DURATION / 128, 128)[4:, -1]
    assert (
        np.abs(rates - truth[4:]).max() <= 128 * 2 * U * truth[5]
    )  # each step adds one product, both rounded


def test_constant_rate_turns_by_the_angle_of_the_runge_kutta_polynomial() -> None:
    # On q' = A q with A^2 = -(w/2)^2 a step multiplies q by a polynomial in A whose argument is that of
    # 1 - t^2/2 + t^4/24 + i (t - t^3/6), t = w h/2; its magnitude is removed. Each step rounds a dozen times.
    raw, torque, _ = constant_rate()
    h, count = 0.5, 1000
    t = np.linalg.norm(RATES) * h / 2
    half_angle = count * np.arctan2(t - t**3 / 6, 1 - t**2 / 2 + t**4 / 24)
    expected = hamilton(
        scene(raw).rotation.attitude, turn(2 * half_angle * np.array(RATES) / np.linalg.norm(RATES))
    )
    end = flown(Twin(scene(raw)), torque, h, count)[:4, -1]
    assert np.abs(end - expected).max() <= count * 12 * U


# Conservation


@cache
def drifts(law: str) -> tuple[Array, Array]:
    """Returns the relative change of angular momentum, inertial axes, and energy in free motion."""
    twin = Twin(scene(tilted(law=law, angular_velocity=list(RATES), attitude=list(ATTITUDE))))

    def invariants(x: Array) -> tuple[Array, float]:
        return reference.rotation_matrix(x[:4]) @ TILTED @ x[4:], float(x[4:] @ TILTED @ x[4:])

    momentum, energy = invariants(twin.x_start)
    ends = [invariants(flown(twin, np.zeros(3), DURATION / count, count)[:, -1]) for count in STEPS]
    by_momentum = [np.linalg.norm(h - momentum) / np.linalg.norm(momentum) for h, _ in ends]
    return np.array(by_momentum), np.array([abs(e - energy) / energy for _, e in ends])


def test_torque_free_spin_conserves_angular_momentum_to_order_four() -> None:
    assert abs(slope(drifts("tensor")[0]) - 4.0) <= SLOPE_SLACK


def test_torque_free_spin_conserves_energy_to_order_four() -> None:
    assert slope(drifts("tensor")[1]) >= 4.0 - SLOPE_SLACK


def test_diagonal_law_does_not_conserve_the_momentum_of_a_tilted_body() -> None:
    assert drifts("principal")[0].min() > 1e-2


# The intermediate axis. ISS_DG's intermediate diagonal moment is zz; its principal axis is 1.6 degrees off.

INTERMEDIATE_SPIN = {"angular_velocity": [0.0, 0.0, 0.02]}


def intermediate_spin(law: str) -> Array:
    twin = Twin(scene(variant(ISS_DG, {"rotation": INTERMEDIATE_SPIN | {"law": law}})))
    return flown(twin, np.zeros(3), 1.0, 2000)[4:]


def test_spin_about_the_intermediate_body_axis_departs_under_tensor() -> None:
    x, y, z = intermediate_spin("tensor")
    assert np.arctan2(np.hypot(x, y), z).max() > np.pi / 2


def test_spin_about_the_intermediate_body_axis_never_departs_under_principal() -> None:
    assert (INTERMEDIATE_SPIN["angular_velocity"] == intermediate_spin("principal").T).all()


# Angular acceleration against rational arithmetic


def solved(J: Array, right: list[Fraction]) -> Array:
    """Returns J^-1 right by Cramer's rule in fractions."""
    rows = [[Fraction(x) for x in row] for row in J.tolist()]

    def determinant(m: list[list[Fraction]]) -> Fraction:
        (a, b, c), (d, e, f), (g, h, i) = m
        return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)

    def replaced(column: int) -> list[list[Fraction]]:
        return [[right[i] if j == column else row[j] for j in range(3)] for i, row in enumerate(rows)]

    return np.array([float(determinant(replaced(k)) / determinant(rows)) for k in range(3)])


def exact_acceleration(law: str, J: Array, omega: Array, torque: Array) -> Array:
    if law == "none":
        return np.zeros(3)
    if law != "tensor":
        J = np.diag(np.diag(J))
    w, M = [Fraction(x) for x in omega.tolist()], [Fraction(x) for x in torque.tolist()]
    H = [sum(Fraction(a) * b for a, b in zip(row, w, strict=True)) for row in J.tolist()]
    gyroscopic = [w[1] * H[2] - w[2] * H[1], w[2] * H[0] - w[0] * H[2], w[0] * H[1] - w[1] * H[0]]
    if law == "decoupled":
        gyroscopic = [Fraction(0)] * 3
    return solved(J, [m - g for m, g in zip(M, gyroscopic, strict=True)])


def random_body(rng: np.random.Generator) -> Array:
    """Returns the tensor of six points at distances that differ by up to a hundred times, tilted."""
    squares = 10.0 ** rng.uniform(-4.0, 0.0, size=3)
    R = random_rotation(int(rng.integers(10**6)))
    J = 1000.0 * R @ np.diag(squares.sum() - squares) @ R.T
    return 0.5 * (J + J.T)


@pytest.mark.parametrize("law", LAWS)
def test_angular_acceleration_of_the_reference_is_that_of_rational_arithmetic(law: str) -> None:
    rng = np.random.default_rng(4)
    for _ in range(50):
        J, omega, torque = random_body(rng), rng.normal(size=3), 100.0 * rng.normal(size=3)
        value = reference.angular_acceleration(law, J, omega, torque)
        # A backward stable solve of order 3, a dozen roundings; the right side has seven.
        moments = np.linalg.eigvalsh(J)
        right = np.linalg.norm(torque) + moments[2] * (omega @ omega)
        bound = 20 * U * moments[2] / moments[0] * right / moments[0]
        assert np.abs(value - exact_acceleration(law, J, omega, torque)).max() <= bound


def test_unknown_law_is_refused_by_the_reference() -> None:
    with pytest.raises(ValueError, match='law = "euler": must be one of none, decoupled, principal, tensor'):
        reference.angular_acceleration("euler", np.eye(3), RATES, TORQUE)


# SciPy's DOP853, on whole scenes


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("seed", range(3))
def test_steps_agree_with_dop853(seed: int, law: str) -> None:
    rng = np.random.default_rng(seed)
    rotation = {
        "law": law,
        "angular_velocity": (0.05 * rng.normal(size=3)).tolist(),
        "attitude": rng.normal(size=4),
    }
    raw = variant(ISS_DG, {"rotation": rotation | {"attitude": rotation["attitude"].tolist()}})
    twin, torque = Twin(scene(raw)), 1e5 * rng.normal(size=3)
    truth = dop853(twin, torque, 50.0)
    fine, coarse = (flown(twin, torque, 50.0 / count, count)[:, -1] for count in (1000, 500))
    for part in (slice(4), slice(4, 7)):
        # Richardson: the error of order four is a fifteenth of what halving the step changes, but for a share
        # of about the angle of a coarse step, at most 0.1 rad here.
        bound = 1.1 / 15.0 * np.linalg.norm(fine[part] - coarse[part])
        rounding = DOP853_ERROR * np.linalg.norm(truth[part])
        assert np.linalg.norm(fine[part] - truth[part]) <= bound + rounding


# Length of the attitude


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("h", [0.01, 0.9])
def test_attitude_stays_at_length_one_within_four_u(h: float, law: str) -> None:
    # Four squares added in turn are good to 4 u, their root to 2 u + u, the quotient to u more: 4 u in all.
    raw = tilted(law=law, angular_velocity=list(RATES), attitude=list(ATTITUDE))
    states = flown(Twin(scene(raw)), np.zeros(3), h, 20000)
    for q in states[:4, ::7].T.tolist():
        assert abs(sum(Fraction(x) ** 2 for x in q) - 1) <= 8 * U


# The longest sub-step

# DOP853 with rtol = 1e-12 over a fraction of a turn, and h_max by way of a J^-1 of condition 1e4 at most.
ANGLE_SLACK = 1e-10
GROWTH = 1.0 / (3.0 * np.sqrt(3.0))  # of |omega| by the gyroscopic term, at most, over |omega|^2


def single(J: Array, law: str, limit: float) -> Twin:
    raw = variant(body(mass=1000.0, law=law, max_angle_step=limit), {"vessels.B.pmi": None})
    return Twin(scene(variant(raw, {"vessels.B.inertia": J.tolist()})))


def longest_step(twin: Twin, omega: Any, torque: Any) -> float:
    return float(twin.longest_step([1.0, 0.0, 0.0, 0.0, *omega], torque, []))


def angle_turned(law: str, J: Array, omega: Array, torque: Array, duration: float) -> float:
    """Returns the integral of |omega| over the duration, rad."""

    def ode(_: float, x: Array) -> Array:
        return np.array([*reference.angular_acceleration(law, J, x[:3], torque), np.linalg.norm(x[:3])])

    by_torque = reference.angular_acceleration(law, J, np.zeros(3), torque)
    size = np.linalg.norm(omega) + duration * np.linalg.norm(by_torque)
    done = solve_ivp(ode, (0.0, duration), [*omega, 0.0], method="DOP853", rtol=1e-12, atol=1e-14 * size)
    return float(done.y[3, -1])


@st.composite
def spins(draw: st.DrawFn, slow: bool) -> tuple[Array, Array, Array]:
    """Draws a tensor, a rate (none if `slow`) and a torque weak to strong beside it."""
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    J, omega = random_body(rng), np.zeros(3) if slow else 10.0 ** rng.uniform(-4.0, 1.0) * rng.normal(size=3)
    strength = 10.0 ** draw(st.floats(-6.0, 6.0)) * (1e-3 if slow else omega @ omega)
    return J, omega, strength * np.trace(J) * rng.normal(size=3)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("slow", [False, True], ids=["spinning", "from rest"])
@examples(8, 25)
@given(data=st.data())
def test_body_never_turns_further_than_the_angle_step(law: str, slow: bool, data: st.DataObject) -> None:
    J, omega, torque = data.draw(spins(slow))
    limit = data.draw(st.sampled_from([0.001, 0.05, 0.5, 1.0]))
    h = longest_step(single(J, law, limit), omega, torque)
    if np.isinf(h):
        assert slow
        assert law == "none"
    else:
        assert angle_turned(law, J, omega, torque, h) <= limit * (1.0 + ANGLE_SLACK)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("limit", [0.001, 0.05, 0.5, 1.0])
def test_bound_holds_where_the_gyroscopic_term_is_strongest(limit: float, sign: float) -> None:
    # Nearly a rod: (J_j - J_k)/J_i are -1, 1, -1 within 1e-4, |omega|' = GROWTH |omega|^2 or its opposite.
    J, omega = np.diag([1e-4, 1.0, 1.0 + 1e-4]) * 1000.0, sign * np.array([1.0, 1.0, -1.0])
    h = longest_step(single(J, "tensor", limit), omega, np.zeros(3))
    assert angle_turned("tensor", J, omega, np.zeros(3), h) <= limit * (1.0 + ANGLE_SLACK)


@pytest.mark.parametrize("law", ["principal", "tensor"])
def test_angle_step_is_used_well_where_torque_is_weak(law: str) -> None:
    # The step is limit / (|omega| e^(GROWTH limit)), over which |omega| falls at most like
    # 1/(1 + GROWTH |omega| t): 98.6 % of the default 0.05 rad. A torque that gives a thousandth of |omega|^2
    # takes less than a thousandth off.
    limit, rng = 0.05, np.random.default_rng(7)
    least = np.log1p(GROWTH * limit * np.exp(-GROWTH * limit)) / (GROWTH * limit) - 1e-3
    for _ in range(20):
        J, omega = random_body(rng), rng.normal(size=3)
        torque = (
            1e-3 * np.linalg.eigvalsh(J)[0] * (omega @ omega) * random_rotation(int(rng.integers(10**6)))[0]
        )
        h = longest_step(single(J, law, limit), omega, torque)
        assert least <= angle_turned(law, J, omega, torque, h) / limit


@pytest.mark.parametrize("law", LAWS)
def test_spin_up_from_rest_uses_a_quarter_of_the_angle_step(law: str) -> None:
    # With a rate a t the body turns a h^2 / 2; h = limit / sqrt(2 a f), f = limit (1 + GROWTH limit + ...).
    J, limit = TILTED, 0.05
    h = longest_step(single(J, law, limit), np.zeros(3), np.array(TORQUE))
    if law == "none":
        assert h == np.inf
    else:
        assert (
            0.247
            <= angle_turned(law, J, np.zeros(3), np.array(TORQUE), h) / limit
            <= 0.25 * (1.0 + ANGLE_SLACK)
        )


@pytest.mark.parametrize("law", LAWS)
def test_longest_step_at_rest_without_torque_is_endless(law: str) -> None:
    assert longest_step(single(TILTED, law, 0.05), np.zeros(3), np.zeros(3)) == np.inf


@pytest.mark.parametrize("law", ["none", "decoupled"])
def test_longest_step_without_gyroscopic_term_is_the_limit_over_the_rate(law: str) -> None:
    h = longest_step(single(TILTED, law, 0.05), RATES, np.zeros(3))
    assert abs(h * np.linalg.norm(RATES) / 0.05 - 1.0) <= 6 * U  # three squares, a root and a quotient
