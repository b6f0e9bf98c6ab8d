"""The error state: its three forms against other definitions, derivatives to 50 digits, linear models."""

from functools import cache
from typing import Any

import casadi as ca
import mpmath as mp
import numpy as np
import pytest
from scipy.linalg import expm, solve_continuous_are
from scipy.spatial.transform import Rotation

from supervessel import Twin
from support import ISS_DG, Array, U, body, scene, variant
from twin.scenes import numbers

FORMS = ("vec", "rotvec", "mrp")
FORM = pytest.mark.parametrize("form", FORMS)
DIGITS = 60
STEP = mp.mpf(10) ** -15  # of differences at 60 digits: exact to 1e-30

# Two quaternion products of 4 terms, two to four square roots and quotients, a series: 40 roundings, none
# amplified, beside those of the arguments.
ERROR_ULPS = 40
# A derivative of that is three such factors, the second one six; a further factor of 4 as derivatives of
# quotients and roots of 1 + w grow up to 2 and 4 times.
GRADIENT_ULPS = 3 * 4 * ERROR_ULPS
HESSIAN_ULPS = 6 * 16 * ERROR_ULPS

SMALL = variant(ISS_DG, {"inputs": {"mass": ["DG"], "torque": True}})
ASYMMETRIC = {"inertia": [[900.0, 60.0, -40.0], [60.0, 1500.0, 50.0], [-40.0, 50.0, 2000.0]], "pmi": None}


@cache
def twin(form: Any = "rotvec") -> Twin:
    return Twin(scene(SMALL), error_form=form)


def turn(axis: Any, angle: float) -> Array:
    axis = np.asarray(axis, dtype=float)
    return np.array([np.cos(angle / 2), *(np.sin(angle / 2) * axis / np.linalg.norm(axis))])


def drawn(rng: np.random.Generator) -> Array:
    q = rng.normal(size=4)
    return np.array([*(q / np.linalg.norm(q)), *rng.normal(size=3)])


def by_scipy(form: str, x: Array, x_ref: Array) -> Array:
    """Returns the attitude's error by SciPy's rotations."""
    turned = Rotation.from_quat(x_ref[:4], scalar_first=True).inv() * Rotation.from_quat(
        x[:4], scalar_first=True
    )
    if form == "rotvec":
        return turned.as_rotvec()
    if form == "mrp":
        return 4.0 * turned.as_mrp()
    return 2.0 * turned.as_quat(canonical=True, scalar_first=True)[1:]


@FORM
@pytest.mark.parametrize("seed", range(5))
def test_error_is_that_of_scipys_rotations(form: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(20):
        x, x_ref = drawn(rng), drawn(rng)
        e = numbers(twin(form).error(x, x_ref))
        # SciPy normalises both quaternions once more and takes an arctangent: as many roundings again.
        assert np.abs(e[:3] - by_scipy(form, x, x_ref)).max() <= 2 * ERROR_ULPS * U * np.linalg.norm(e[:3])
        assert e[3:].tolist() == (x[4:] - x_ref[4:]).tolist()


@FORM
def test_both_signs_of_a_quaternion_have_the_same_error(form: str) -> None:
    rng = np.random.default_rng(1)
    for _ in range(50):
        x, x_ref = drawn(rng), drawn(rng)
        for s, t in ((-1, 1), (1, -1), (-1, -1)):
            other, other_ref = (np.array([*(k * v[:4]), *v[4:]]) for k, v in ((s, x), (t, x_ref)))
            e = twin(form).error(x, x_ref)
            assert numbers(twin(form).error(other, other_ref)).tolist() == numbers(e).tolist()


@FORM
@pytest.mark.parametrize("angle", [0.0, 1e-300, 1e-160, 1e-9, 0.3, 1.0, 2.0, 3.0])
def test_retract_inverts_error(form: str, angle: float) -> None:
    rng = np.random.default_rng(7)
    x_ref, axis = drawn(rng), rng.normal(size=3)
    e = np.array([*(angle * axis / np.linalg.norm(axis)), *rng.normal(size=3)])
    if form == "vec":
        e[:3] *= 0.65  # its length stays below 2
    back = numbers(twin(form).error(twin(form).retract(x_ref, e), x_ref))
    # The product's terms are as large as 1, whatever the angle. What they leave in the vector part grows by
    # 2/cos(angle/2), and more where "vec" is flat: at most tenfold here.
    assert np.abs(back[:3] - e[:3]).max() <= 10 * ERROR_ULPS * U
    assert np.abs(back[3:] - e[3:]).max() <= 4 * U * (np.abs(e[3:]) + np.abs(x_ref[4:])).max()


@FORM
def test_no_error_is_the_reference_itself(form: str) -> None:
    x_ref = drawn(np.random.default_rng(3))
    assert numbers(twin(form).retract(x_ref, np.zeros(6))).tolist() == x_ref.tolist()


@FORM
def test_retract_of_angles_beyond_a_turn_is_unit_and_the_rotation(form: str) -> None:
    for length in (0.49, 0.51, 1.9, 5.0, 40.0):
        if form == "vec" and length > 2.0:
            assert np.isnan(numbers(twin(form).retract([1, 0, 0, 0, 0, 0, 0], [length, 0, 0, 0, 0, 0]))[0])
            continue
        q = numbers(twin(form).retract([1, 0, 0, 0, 0, 0, 0], [0.6 * length, 0, 0.8 * length, 0, 0, 0]))[:4]
        angle = {"vec": 2 * np.arcsin(min(length, 2.0) / 2), "mrp": 4 * np.arctan(length / 4)}.get(
            form, length
        )
        # the angle's own rounding, turned by half of it
        assert np.abs(q - turn([0.6, 0, 0.8], angle)).max() <= (8 + length) * U


# Derivatives, to 60 digits


def exact_product(a: Any, b: Any) -> list[Any]:
    return [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] + a[2] * b[0] + a[3] * b[1] - a[1] * b[3],
        a[0] * b[3] + a[3] * b[0] + a[1] * b[2] - a[2] * b[1],
    ]


def exact_error(form: str, q: Any) -> list[Any]:
    """Returns the error of a quaternion of 60 digits, by tangents and arctangents."""
    sign = -1 if q[0] < 0 else 1
    w, v = sign * q[0], [sign * c for c in q[1:]]
    n = mp.sqrt(sum(c * c for c in v))
    if form == "vec" or n == 0:
        return [2 * c for c in v]
    angle = 2 * mp.atan2(n, w)
    return [(angle if form == "rotvec" else 4 * mp.tan(angle / 4)) / n * c for c in v]


def exact_derivatives(form: str, x: Array, x_ref: Array) -> tuple[Array, Array, Array]:
    """Returns value (3,), gradient (3, 3), Hessian (3, 3, 3) of the error as x turns by a rotation vector."""
    q_ref = [mp.mpf(x_ref[0]), *(-mp.mpf(c) for c in x_ref[1:4])]
    lengths = [mp.sqrt(sum(mp.mpf(c) ** 2 for c in v[:4])) for v in (x, x_ref)]

    def f(turned: list[Any]) -> list[Any]:
        angle = mp.sqrt(sum(c * c for c in turned))
        by = [mp.cos(angle / 2), *(mp.sin(angle / 2) / angle * c if angle else mp.mpf(0) for c in turned)]
        q = exact_product(q_ref, exact_product([mp.mpf(c) for c in x[:4]], by))
        return exact_error(form, [c / lengths[0] / lengths[1] for c in q])

    def at(*steps: tuple[int, int]) -> Any:
        turned = [mp.mpf(0)] * 3
        for axis, count in steps:
            turned[axis] += count * STEP
        return mp.matrix(f(turned))

    gradient = [(at((i, 1)) - at((i, -1))) / (2 * STEP) for i in range(3)]
    hessian = [
        [
            (at((i, 1), (j, 1)) - at((i, 1), (j, -1)) - at((i, -1), (j, 1)) + at((i, -1), (j, -1)))
            / (4 * STEP**2)
            for j in range(3)
        ]
        for i in range(3)
    ]
    return (
        np.array(at().tolist(), dtype=float).ravel(),
        np.array([[float(c[k]) for c in gradient] for k in range(3)]),
        np.array([[[float(c[k]) for c in row] for row in hessian] for k in range(3)]),
    )


UP, SPIN = [1.0, 0, 0, 0, 0, 0, 0], [0.5, -0.5, 0.5, 0.5, 0.1, -0.2, 0.3]
PLACES = {
    "identity": (UP, UP),
    "other sign": ([-1.0, 0, 0, 0, 0, 0, 0], UP),
    "reference of other sign": (SPIN, [-0.5, 0.5, -0.5, -0.5, 0, 0, 0]),
    "both spinning": (SPIN, SPIN),
    "a tiny turn": ([*turn([1, 2, -1], 1e-9), 0, 0, 0], UP),
    "a small turn": ([*turn([1, 2, -1], 0.01), 0, 0, 0], UP),
    "a quarter": ([*turn([0, 0, 1], np.pi / 2), 0, 0, 0], UP),
    "drawn": (drawn(np.random.default_rng(5)), drawn(np.random.default_rng(6))),
    "almost a half turn": ([*turn([1, 2, -1], 3.14), 0, 0, 0], UP),
    "almost a half turn, other sign": ([*-turn([1, 2, -1], 3.14), 0, 0, 0], UP),
}


@FORM
@pytest.mark.parametrize("place", PLACES)
def test_value_gradient_and_hessian_of_the_error_are_those_to_60_digits(form: str, place: str) -> None:
    x, x_ref = (np.array(v, dtype=float) for v in PLACES[place])
    t, turned = twin(form), ca.SX.sym("turned", 3)
    # moved along the sphere by the retraction of another form, itself checked above
    moved = twin("rotvec").retract(t.x, ca.vertcat(turned, ca.SX.zeros(3)))
    x_ref_symbol = ca.SX.sym("x_ref", 7)
    e = t.error(moved, x_ref_symbol)[:3]
    hessians = [ca.hessian(e[k], turned)[0] for k in range(3)]
    f = ca.Function("f", [turned, t.x, x_ref_symbol], [e, ca.jacobian(e, turned), *hessians])
    value, gradient, *hessian = (np.array(v) for v in f(np.zeros(3), x, x_ref))
    with mp.workdps(DIGITS):
        truth = exact_derivatives(form, x, x_ref)
    assert np.abs(value.ravel() - truth[0]).max() <= ERROR_ULPS * U * max(1.0, np.abs(truth[0]).max())
    assert np.abs(gradient - truth[1]).max() <= GRADIENT_ULPS * U
    assert np.abs(np.array(hessian) - truth[2]).max() <= HESSIAN_ULPS * U


@FORM
@pytest.mark.parametrize("w", [1.0, -1.0])
@pytest.mark.parametrize("rest", [True, False])
def test_everything_is_finite_at_identity_by_all_arguments(form: str, w: float, rest: bool) -> None:
    t = twin(form)
    x_ref, e = ca.SX.sym("x_ref", 7), ca.SX.sym("e", 6)
    rates = [0.0, 0.0, 0.0] if rest else [0.1, -0.2, 0.3]
    x = [w, 0.0, 0.0, 0.0, *rates]
    for expression, knowns, at in (
        (t.error(t.x, x_ref), (t.x, x_ref), [*x, 1.0, 0, 0, 0, *rates]),
        (t.retract(x_ref, e), (x_ref, e), [*x, *np.zeros(6)]),
        (
            t.error_ode(e=e, u=t.u, x_ref=x_ref)["e_dot"],
            (e, t.u, x_ref),
            [*np.zeros(6), *np.zeros(3), *x],
        ),
    ):
        z = ca.vertcat(*knowns)
        parts = [expression, ca.jacobian(expression, z)]
        parts += [ca.hessian(expression[i], z)[0] for i in range(expression.numel())]
        assert all(np.isfinite(np.array(v)).all() for v in ca.Function("f", [z], parts)(at))


@FORM
def test_error_at_a_half_turn_is_finite_with_its_derivatives(form: str) -> None:
    t, x_ref = twin(form), ca.SX.sym("x_ref", 7)
    e = t.error(t.x, x_ref)
    z = ca.vertcat(t.x, x_ref)
    f = ca.Function("f", [z], [e, ca.jacobian(e, z), *(ca.hessian(e[i], z)[0] for i in range(3))])
    values = f([0.0, 0.6, 0.0, 0.8, 0, 0, 0, *UP])
    assert all(np.isfinite(np.array(v)).all() for v in values)
    length = {"vec": 2.0, "rotvec": np.pi, "mrp": 4.0}[form]
    assert np.linalg.norm(numbers(values[0])) == pytest.approx(length, rel=ERROR_ULPS * U)


# The error's motion and its linear models


@FORM
@pytest.mark.parametrize("seed", range(3))
def test_error_ode_is_how_the_error_of_two_flights_changes(form: str, seed: int) -> None:
    t, rng = twin(form), np.random.default_rng(seed)
    x, x_ref, u = drawn(rng), drawn(rng), rng.normal(size=3) * 1e7
    a_ref = numbers(t.ode(x_ref, np.zeros(3), t.p_start))[4:]
    e = t.error(x, x_ref)
    got = numbers(t.error_ode(e, u, t.p_start, x_ref, a_ref))
    # A central difference along both flows: exact to h^2, and to u/h; third derivatives of some hundred.
    h = 1e-5
    ahead, behind = (
        t.error(
            t.step(x, u, t.p_start, s * h),
            t.step(x_ref, np.zeros(3), t.p_start, s * h),
        )
        for s in (1, -1)
    )
    assert np.abs(got - numbers(ahead - behind) / (2 * h)).max() <= 1e3 * h**2 + 16 * U / h


@FORM
def test_linear_models_are_the_derivatives_of_error_ode_and_of_steps(form: str) -> None:
    t, e = twin(form), ca.SX.sym("e", 6)
    x = np.array(SPIN)
    u = numbers(t.trim(x, t.p_start)) + 1e6
    e_dot = t.error_ode(e=e, u=t.u, p=t.p, x_ref=t.x)["e_dot"]
    end = t.error(t.step(t.retract(t.x, e), t.u, t.p, t.h), t.step(t.x, t.u, t.p, t.h))
    knowns = [e, t.x, t.u, t.p, t.h]
    f = ca.Function("f", knowns, [ca.jacobian(e_dot, v) for v in (e, t.u, t.p)] + [ca.jacobian(end, e)])
    *continuous, A_step = (np.array(v) for v in f(np.zeros(6), x, u, t.p_start, 0.5))
    for got, truth in zip(t.linearise(x, u, t.p_start), continuous, strict=True):
        # the same partials in another order, 3 products of 3 terms
        assert np.abs(np.array(got) - truth).max() <= 32 * U * np.abs(truth).max()
    A = np.array(t.discretise(x, u, t.p_start, 0.5)[0])
    assert np.abs(A - A_step).max() <= GRADIENT_ULPS * U * np.abs(A_step).max()


def test_linear_model_about_a_spin_is_the_textbooks() -> None:
    raw = variant(body(), {"vessels.B.pmi": None, "vessels.B.inertia": ASYMMETRIC["inertia"]})
    t = Twin(scene(raw))
    omega = np.array([0.1, -0.2, 0.3])
    x = np.array([*turn([1, 1, 0], 1.0), *omega])
    u = numbers(t.trim(x, []))
    A, B, _ = (np.array(m) for m in t.linearise(x, u, []))
    J = np.array(ASYMMETRIC["inertia"])

    def skew(v: Array) -> Array:
        return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])

    expected = np.block(
        [
            [-skew(omega), np.eye(3)],
            [np.zeros((3, 3)), np.linalg.solve(J, skew(J @ omega) - skew(omega) @ J)],
        ]
    )
    # Three products and a solve with a tensor of condition 3.
    assert np.abs(A - expected).max() <= 32 * 3 * U
    assert np.abs(B - np.vstack([np.zeros((3, 3)), np.linalg.inv(J)])).max() <= 32 * 3 * U / 900.0


@pytest.mark.parametrize("h", [0.5, 0.1])
def test_discrete_model_at_a_trim_is_the_exponential_to_the_order_of_the_step(h: float) -> None:
    raw = variant(body(), {"vessels.B.pmi": None, "vessels.B.inertia": ASYMMETRIC["inertia"]})
    t = Twin(scene(raw))
    x = np.array([*turn([1, 1, 0], 1.0), 0.1, -0.2, 0.3])
    u = numbers(t.trim(x, []))
    A, B, _ = (np.array(m) for m in t.linearise(x, u, []))
    Ad, Bd, _ = (np.array(m) for m in t.discretise(x, u, [], h))
    whole = expm(h * np.block([[A, B], [np.zeros((3, 9))]]))
    # The step leaves terms of order 5 in h times the rates of A (its norm, about 1) and of the frame.
    bound = (np.linalg.norm(A, 2) * h) ** 5 / 20 + GRADIENT_ULPS * U
    assert np.abs(Ad - whole[:6, :6]).max() <= bound
    assert np.abs(Bd - whole[:6, 6:]).max() <= bound * np.abs(B).max()


def test_an_lqr_of_the_error_state_turns_both_signs_home_the_short_way() -> None:
    t = twin()
    J = np.array(t.composite(t.p_start)[2])
    x_ref = np.array([*turn([0, 0, 1], 0.3), 0.0, 0.0, 0.0])
    A, B, _ = (np.array(m) for m in t.linearise(x_ref, np.zeros(3), t.p_start))
    R = np.diag(1.0 / np.diag(J) ** 2)
    P = solve_continuous_are(A, B, np.eye(6), R)
    K = np.linalg.solve(R, B.T @ P)
    for sign in (1.0, -1.0):
        x = np.array([*(sign * turn([1, 2, 3], 2.5)), 0.0, 0.0, 0.0])
        turned = 0.0
        for _ in range(400):
            u = -K @ numbers(t.error(x, x_ref))
            x = numbers(t.step(x, u, t.p_start, 0.05))
            turned += 0.05 * float(np.linalg.norm(x[4:]))
        assert np.linalg.norm(numbers(t.error(x, x_ref))) <= 1e-3
        assert turned <= np.pi  # no unwinding
