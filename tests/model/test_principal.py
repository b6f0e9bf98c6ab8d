"""Principal moments and axes against 60-digit eigenvalues, the choice of frame, and derivatives."""

from itertools import permutations, product

import casadi as ca
import hypothesis.strategies as st
import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, given

from supervessel import reference
from supervessel.composite.inertia import from_upper_triangle, upper_triangle
from supervessel.rotation import principal as module
from supervessel.rotation.principal import TIE, principal, principal_forward, quaternion_of_axes
from support import EPS, Array, U, random_rotation
from support.examples import examples

DENORMAL = 2.0**-1074
DIGITS = 60
RUN = examples(20, 60)

# Twelve rotations; each rounds the elements it changes once, to u of the largest moment at most. Rounded
# angles cost nothing more, for a rotation by a wrong angle is still one.
MOMENT_ULPS = 12
# The last step removes the rotations' errors and has its own: for a unit vector, three roundings of V^T V and
# one of each element of the sum, which counts twice in a square.
AXES_ULPS = 5
# J v - lambda v: half the rotations' error, as it is shared with the axes, and that of the axes.
RESIDUAL_ULPS = MOMENT_ULPS / 2 + AXES_ULPS


def function(sweeps: int | None = None) -> ca.Function:
    """Returns upper triangle -> moments, rotation, quaternion."""
    x, before = ca.SX.sym("x", 6), module.SWEEPS
    module.SWEEPS = sweeps or before
    try:
        moments, rotation = principal(from_upper_triangle(x))
    finally:
        module.SWEEPS = before
    return ca.Function("principal", [x], [moments, rotation, quaternion_of_axes(rotation)])


PRINCIPAL = function()


def elements(J: Array) -> Array:
    return np.array([J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]])


def evaluated(J: Array, of: ca.Function = PRINCIPAL) -> tuple[Array, Array, Array]:
    """Returns moments (3,), rotation (3, 3), quaternion (4,)."""
    moments, rotation, q = (np.array(value) for value in of(elements(J)))
    return moments.ravel(), rotation, q.ravel()


def exact(J: Array) -> tuple[list[mp.mpf], mp.matrix]:
    """Returns the eigenvalues, ascending, and eigenvectors in columns, by QR in many digits."""
    with mp.workdps(DIGITS + 40):
        values, vectors = mp.eigsy(mp.matrix(J.tolist()))
        return list(values), vectors


def frames(rotation: mp.matrix) -> list[mp.matrix]:
    """Returns the four proper frames of the axes, the one with the largest trace first."""
    signs = (mp.diag(s) for s in product((1, -1), repeat=3))
    proper = [rotation * s for s in signs if mp.det(rotation * s) > 0]
    return sorted(proper, key=lambda R: -(R[0, 0] + R[1, 1] + R[2, 2]))


def exact_quaternion(R: mp.matrix) -> mp.matrix:
    w = mp.sqrt(1 + R[0, 0] + R[1, 1] + R[2, 2]) / 2
    axis = [(R[k, j] - R[j, k]) / (4 * w) for j, k in ((1, 2), (2, 0), (0, 1))]
    return mp.matrix([w, *axis])


def scalar_part(R: mp.matrix) -> mp.mpf:
    return mp.sqrt(max(mp.mpf(0), 1 + R[0, 0] + R[1, 1] + R[2, 2])) / 2


def tilted(moments: Array, seed: int) -> Array:
    R = random_rotation(seed)
    J = R @ np.diag(moments) @ R.T
    return 0.5 * (J + J.T)


def _spread(rng: np.random.Generator, decades: float) -> Array:
    return 10.0 ** rng.uniform(-decades, 0.0, 3)


def _near(rng: np.random.Generator) -> Array:
    return 1.0 + 10.0 ** rng.uniform(-16.0, -3.0) * rng.normal(size=3)


def _pair(rng: np.random.Generator) -> Array:
    return np.array([1.0, 1.0 + 10.0 ** rng.uniform(-17.0, -1.0), 10.0 ** rng.uniform(-3.0, 0.3)])


MOMENTS = {
    "any": lambda rng: rng.uniform(0.1, 1.0, 3),
    "ratios to 1e12": lambda rng: _spread(rng, 12.0),
    "nearly spherical": _near,
    "two nearly equal": _pair,
    "flat": lambda rng: np.array([*(side := rng.uniform(0.0, 1.0, 2)), side.sum()]),
    "a rod": lambda rng: np.array([0.0, 1.0, 1.0]),
    "tiny": lambda rng: 1e-300 * _spread(rng, 2.0),
    "huge": lambda rng: 1e300 * _spread(rng, 2.0),
}


@st.composite
def tensors(draw: st.DrawFn, kind: str) -> Array:
    seed = draw(st.integers(0, 10**6))
    return tilted(MOMENTS[kind](np.random.default_rng(seed)), seed)


def assert_principal(J: Array) -> None:
    """Compares moments and axes with what they must be, in exact arithmetic."""
    moments, rotation, q = evaluated(J)
    assert all(np.isfinite(part).all() for part in (moments, rotation, q))
    assert (np.diff(moments) >= 0.0).all()
    with mp.workdps(DIGITS):
        truth, _ = exact(J)
        largest = max(abs(value) for value in truth)
        slack = MOMENT_ULPS / 2 * DENORMAL  # where u of the largest moment is no double
        for moment, value in zip(moments.tolist(), truth, strict=True):
            assert abs(moment - value) <= MOMENT_ULPS * U * largest + slack
        A, R, L = mp.matrix(J.tolist()), mp.matrix(rotation.tolist()), mp.diag(moments.tolist())
        residual = A * R - R * L
        for j in range(3):
            assert mp.norm(residual[:, j]) <= RESIDUAL_ULPS * U * largest + slack
        apart = R.T * R - mp.eye(3)
        assert max(abs(x) for x in apart) <= AXES_ULPS * U
        assert abs(mp.det(R) - 1) <= 1.5 * AXES_ULPS * U
        # Four squares, a root and a quotient: 2 u of the length
        assert abs(sum(mp.mpf(x) ** 2 for x in q.tolist()) - 1) <= 8 * U
    # Twelve roundings of the reference's matrix, and twice the error of the quaternion
    assert np.abs(reference.rotation_matrix(q) - rotation).max() <= 16 * U
    # 4 w^2 = 1 + trace: a tie is given away by up to 14 TIE of the trace, TIE 14/8/w of the scalar part
    assert q[0] >= max(np.abs(q).max(), 0.5) - 4.0 * TIE
    assert np.trace(rotation) >= max(np.trace(rotation * s) for s in FLIPS) - 28.0 * TIE


FLIPS = [np.array(s) for s in product((1.0, -1.0), repeat=3) if np.prod(s) > 0]


@pytest.mark.parametrize("kind", MOMENTS)
@RUN
@given(data=st.data())
def test_moments_and_axes_are_those_of_many_digits(kind: str, data: st.DataObject) -> None:
    assert_principal(data.draw(tensors(kind)))


@RUN
@given(
    offs=st.lists(st.sampled_from([0.0, 5e-324, 1e-320, 1e-170, 1e-17, 0.3, -0.5]), min_size=3, max_size=3),
    diagonal=st.lists(st.sampled_from([0.5, 1.0, 1.0 + EPS, 2.0]), min_size=3, max_size=3),
)
def test_elements_off_the_diagonal_may_vanish_or_almost(offs: list[float], diagonal: list[float]) -> None:
    J = np.diag(diagonal)
    for (i, j), off in zip(((0, 1), (0, 2), (1, 2)), offs, strict=True):
        J[i, j] = J[j, i] = off
    assert_principal(J)


ODD_TENSORS = {
    "zero": np.zeros((3, 3)),
    "rank one": np.ones((3, 3)),
    "rank one, huge": np.full((3, 3), 4e307),
    "rank one, tiny": np.full((3, 3), 1e-307),
    "denormal": np.full((3, 3), 5e-324),
    "denormal, diagonal": np.diag([5e-324, 0.0, 5e-324]),
    "two by two": np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 1.0], [0.0, 1.0, 1.0]]),
    "a quotient too large to be squared": np.array([[1.0, 0, 1e-160], [0, 0.0, 0], [1e-160, 0, 2.0]]),
    "a quotient too large": np.array([[1e10, 0, 5e-324], [0, 1.0, 0], [5e-324, 0, 2e10]]),
}


@pytest.mark.parametrize("J", ODD_TENSORS.values(), ids=ODD_TENSORS)
def test_odd_tensors_give_numbers(J: Array) -> None:
    assert_principal(J)


OPERATIONS = {
    getattr(ca, f"OP_{name}"): of
    for name, of in {
        "ASSIGN": lambda a, _: a,
        "ADD": np.add,
        "SUB": np.subtract,
        "MUL": np.multiply,
        "DIV": np.divide,
        "TWICE": lambda a, _: 2.0 * a,
        "SQ": lambda a, _: a * a,
        "SQRT": lambda a, _: np.sqrt(a),
        "FABS": lambda a, _: np.abs(a),
        "NEG": lambda a, _: -a,
        "INV": lambda a, _: np.divide(1.0, a),
        "COPYSIGN": np.copysign,
        "FMIN": np.fmin,
        "FMAX": np.fmax,
        "LT": np.less,
        "LE": np.less_equal,
        "EQ": np.equal,
        "NE": np.not_equal,
        "NOT": lambda a, _: a == 0.0,
        "AND": lambda a, b: a != 0.0 and b != 0.0,
        "OR": lambda a, b: a != 0.0 or b != 0.0,
        "IF_ELSE_ZERO": lambda a, b: b if a != 0.0 else 0.0,
    }.items()
}


@pytest.mark.parametrize("diagonal", [(0, 0, 0), (1, 1, 1), (3, 1, 2), (0, 1, 1)], ids=str)
def test_zeros_off_the_diagonal_are_never_divided_by(diagonal: tuple[int, ...]) -> None:
    values, work = elements(np.diag(np.array(diagonal, dtype=float))), {}
    with np.errstate(all="raise"):
        for k in range(PRINCIPAL.n_instructions()):
            what, into, of = (
                read(k)
                for read in (
                    PRINCIPAL.instruction_id,
                    PRINCIPAL.instruction_output,
                    PRINCIPAL.instruction_input,
                )
            )
            if what == ca.OP_INPUT:
                work[into[0]] = values[of[1]]
            elif what == ca.OP_CONST:
                work[into[0]] = np.float64(PRINCIPAL.instruction_constant(k))
            elif what != ca.OP_OUTPUT:
                work[into[0]] = np.float64(OPERATIONS[what](work[of[0]], work[of[-1]]))


# Exactness


SOME_MOMENTS = st.one_of(
    st.sampled_from([0.0, 1.0, 1.0 + EPS, 3.0]), st.floats(0.0, 1e307), st.floats(0.0, 5e-310)
)


@RUN
@given(diagonal=st.lists(SOME_MOMENTS, min_size=3, max_size=3))
def test_diagonal_tensors_are_sorted_to_the_bit(diagonal: list[float]) -> None:
    moments, rotation, q = evaluated(np.diag(diagonal))
    assert moments.tolist() == sorted(diagonal)
    assert sorted(np.abs(rotation).ravel().tolist()) == [0.0] * 6 + [1.0] * 3
    assert np.linalg.det(rotation) == 1.0
    assert (np.abs(rotation).T @ diagonal == moments).all()
    assert abs(q @ q - 1.0) <= 8 * U


@pytest.mark.parametrize("exponent", [-400, 400])
@RUN
@given(data=st.data())
def test_scale_by_a_power_of_two_changes_no_bit(exponent: int, data: st.DataObject) -> None:
    J, scale = data.draw(tensors("any")), 2.0**exponent
    (moments, *axes), (scaled, *others) = evaluated(J), evaluated(scale * J)
    assert (scaled == scale * moments).all()
    for one, other in zip(axes, others, strict=True):
        assert (one == other).all()


# Tensors whose rows differ by orders of magnitude


@st.composite
def graded(draw: st.DrawFn) -> tuple[Array, float]:
    """Draws J = D A D with A_ii = 1, and the condition number of A."""
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    B = rng.normal(size=(3, 3))
    A = B @ B.T
    A /= np.sqrt(np.outer(np.diag(A), np.diag(A)))
    condition = float(np.linalg.cond(A))
    assume(condition < 1e6)
    D = 10.0 ** rng.uniform(-8.0, 0.0, 3)
    J = np.outer(D, D) * A
    return 0.5 * (J + J.T), condition


@RUN
@given(drawn=graded())
def test_small_moments_of_graded_tensors_keep_their_digits(drawn: tuple[Array, float]) -> None:
    J, condition = drawn
    moments, _, _ = evaluated(J)
    with mp.workdps(DIGITS):
        for moment, value in zip(moments.tolist(), exact(J)[0], strict=True):
            assert abs(moment - value) <= MOMENT_ULPS * U * condition * value


def test_small_tilts_of_a_slender_body_keep_their_digits() -> None:
    # A_ij = 0.3 or less: condition 2. Tilts of 1e-3 to 1e-9, each off by a few u of itself.
    A, D = np.array([[1.0, 0.3, -0.2], [0.3, 1.0, 0.1], [-0.2, 0.1, 1.0]]), np.array([1e-6, 1e-3, 1.0])
    J = np.outer(D, D) * A
    _, rotation, _ = evaluated(J)
    truth = frames(exact(J)[1])[0]
    for i, j in product(range(3), repeat=2):
        assert abs(rotation[i, j] - truth[i, j]) <= 2 * MOMENT_ULPS * U * abs(truth[i, j])


# Number of sweeps. These were found by climbing towards the largest element left after three and four.

STUBBORN = {
    3: [
        [0.87610869, -0.11281316, 0.67014968],
        [-0.11281316, 1.0, -0.62706372],
        [0.67014968, -0.62706372, 0.8093531],
    ],
    4: [
        [0.99526251, 0.03340979, 0.35622656],
        [0.03340979, 0.764387, -0.80022665],
        [0.35622656, -0.80022665, 1.0],
    ],
}


def left_over(J: Array, sweeps: int) -> float:
    """Returns the largest element off the diagonal of R^T J R over the largest moment."""
    moments, rotation, _ = evaluated(J, function(sweeps))
    with mp.workdps(DIGITS):
        R = mp.matrix(rotation.tolist())
        rest = R.T * mp.matrix(J.tolist()) * R
        return float(max(abs(rest[i, j]) for i, j in ((0, 1), (0, 2), (1, 2))) / moments[2])


@pytest.mark.parametrize("sweeps", STUBBORN)
def test_stubborn_tensors_need_no_more_sweeps(sweeps: int) -> None:
    assert_principal(np.array(STUBBORN[sweeps]))


def test_one_sweep_less_would_not_do() -> None:
    J = np.array(STUBBORN[3])
    assert left_over(J, module.SWEEPS - 1) > 1e9 * U
    assert left_over(J, module.SWEEPS) <= RESIDUAL_ULPS * U


def test_straight_line_code_stays_short() -> None:
    assert PRINCIPAL.n_instructions() <= 1300


# Which of the four frames


@RUN
@given(seed=st.integers(0, 10**6))
def test_frame_is_the_least_turned_one(seed: int) -> None:
    J = tilted(np.random.default_rng(seed).uniform(0.1, 1.0, 3), seed)
    truth, vectors = exact(J)
    best, second, *_ = frames(vectors)
    assume(scalar_part(best) - scalar_part(second) > 1e-6)
    gap = min(truth[1] - truth[0], truth[2] - truth[1]) / truth[2]
    # An axis turns by its residual over the gap, and half of that is a quaternion's change.
    bound = RESIDUAL_ULPS * U / gap + AXES_ULPS * U
    q = evaluated(J)[2]
    assert mp.norm(mp.matrix(q.tolist()) - exact_quaternion(best)) <= bound


@pytest.mark.parametrize("order", list(permutations([1.0, 2.0, 3.0])))
def test_rounding_does_not_flip_the_frame_of_a_diagonal_tensor(order: tuple[float, ...]) -> None:
    rng, frame = np.random.default_rng(1), evaluated(np.diag(order))[2]
    assert frame[0] >= 0.5
    for _ in range(50):
        noise = 4.0 * U * rng.normal(size=(3, 3))
        q = evaluated(np.diag(order) + noise + noise.T)[2]
        assert np.abs(q - frame).max() <= 64 * U


@pytest.mark.parametrize("order", [(2.0, 3.0, 1.0), (3.0, 1.0, 2.0)])
def test_cyclic_order_gives_the_plain_permutation(order: tuple[float, ...]) -> None:
    rotation = evaluated(np.diag(order))[1]
    assert (rotation == np.eye(3)[:, np.argsort(order)]).all()


def about_z(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    J = R @ np.diag([1.0, 2.0, 3.0]) @ R.T
    return 0.5 * (J + J.T)


def test_frame_jumps_half_a_turn_at_a_quarter_turn() -> None:
    below, above = (evaluated(about_z(np.pi / 2 + d))[2] for d in (-1e-9, 1e-9))
    assert np.abs(below - [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]).max() <= 1e-9
    assert np.abs(above - [np.sqrt(0.5), 0.0, 0.0, -np.sqrt(0.5)]).max() <= 1e-9


def test_frame_follows_a_turn_below_the_jump() -> None:
    for angle in np.linspace(-1.57, 1.57, 41):
        q = evaluated(about_z(angle))[2]
        assert np.abs(q - [np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)]).max() <= 16 * U


# Derivatives


def derivatives() -> tuple[ca.Function, ca.Function]:
    """Returns (moments, rotation, dx) -> changes, (7,), and (moments, rotation, weights) -> weights of dx."""
    moments, rotation, dx = ca.SX.sym("m", 3), ca.SX.sym("R", 3, 3), ca.SX.sym("dx", 6)
    changes = ca.vertcat(*principal_forward(moments, rotation, from_upper_triangle(dx)))
    weights = ca.SX.sym("w", 7)
    reverse = ca.jtimes(changes, dx, weights, True)
    return (
        ca.Function("forward", [moments, rotation, dx], [changes]),
        ca.Function("reverse", [moments, rotation, weights], [reverse]),
    )


FORWARD, REVERSE = derivatives()


def forward(J: Array, dJ: Array) -> Array:
    moments, rotation, _ = evaluated(J)
    return np.array(FORWARD(moments, rotation, elements(dJ))).ravel()


@pytest.mark.parametrize("kind", ["any", "ratios to 1e12", "two nearly equal"])
@RUN
@given(data=st.data())
def test_forward_derivatives_are_differences_of_many_digits(kind: str, data: st.DataObject) -> None:
    J = data.draw(tensors(kind))
    dJ = np.random.default_rng(data.draw(st.integers(0, 100))).normal(size=(3, 3))
    dJ = dJ + dJ.T
    with mp.workdps(DIGITS):
        values, vectors = exact(J)
        gap = float(min(values[1] - values[0], values[2] - values[1]) / values[2])
        best, second, *_ = frames(vectors)
        assume(gap > 1e-6)
        assume(scalar_part(best) - scalar_part(second) > 1e-6)
        step = mp.mpf(10) ** -25
        ends = []
        for sign in (1, -1):
            moved = mp.matrix(J.tolist()) + sign * step * mp.matrix(dJ.tolist())
            end_values, end_vectors = mp.eigsy(moved)
            ends.append([*end_values, *exact_quaternion(frames(end_vectors)[0])])
        truth = np.array([float((a - b) / (2 * step)) for a, b in zip(*ends, strict=True)])
    size, moment = np.linalg.norm(dJ), float(values[2])
    error = np.abs(forward(J, dJ) - truth)
    # Axes are off by the residual over the gap, twice in v . dJ v, with a dozen roundings; the quotient by
    # the gap has the error of the moments over the gap more.
    axes = (RESIDUAL_ULPS / gap + 12) * U
    assert error[:3].max() <= 2 * axes * size
    assert error[3:].max() <= (4 * axes + 2 * MOMENT_ULPS * U / gap) * size / (gap * moment)


@pytest.mark.parametrize("kind", ["any", "ratios to 1e12"])
@RUN
@given(data=st.data())
def test_reverse_derivatives_are_the_transpose_of_forward_ones(kind: str, data: st.DataObject) -> None:
    J = data.draw(tensors(kind))
    moments, rotation, _ = evaluated(J)
    rng = np.random.default_rng(data.draw(st.integers(0, 100)))
    weights = rng.normal(size=7)
    columns = np.array([np.array(FORWARD(moments, rotation, e)).ravel() for e in np.eye(6)])
    reverse = np.array(REVERSE(moments, rotation, weights)).ravel()
    # Some thirty roundings on the longest path, the same on both sides
    assert (
        np.abs(reverse - columns @ weights) <= 60 * U * np.abs(columns).max(axis=0) @ np.abs(weights)
    ).all()


def test_upper_triangle_and_its_tensor_are_inverses() -> None:
    x = ca.SX.sym("x", 6)
    assert ca.is_equal(upper_triangle(from_upper_triangle(x)), x)


@pytest.mark.parametrize("diagonal", [(1.0, 1.0, 2.0), (2.0, 1.0, 2.0), (3.0, 3.0, 3.0)])
def test_changes_of_equal_moments_are_moderate_and_of_the_axes_beyond_all_use(
    diagonal: tuple[float, ...],
) -> None:
    dJ = np.array([[0.1, 0.2, 0.3], [0.2, -0.4, 0.5], [0.3, 0.5, 0.7]])
    J = np.diag(diagonal)
    changes = forward(J, dJ)
    rotation = evaluated(J)[1]
    assert np.abs(changes[:3] - np.diag(rotation.T @ dJ @ rotation)).max() <= 8 * U
    assert changes[:3].sum() == pytest.approx(np.trace(dJ), abs=8 * U)
    assert np.abs(changes[3:]).max() > 1e260


def test_axes_of_a_diagonal_tensor_turn_towards_the_larger_moment() -> None:
    # J = diag(1, 2, 4), dJ_xy = 1: tan(2 angle) = 2 e / (J_xx - J_yy), angle = -e about z.
    dJ = np.zeros((3, 3))
    dJ[0, 1] = dJ[1, 0] = 1.0
    assert forward(np.diag([1.0, 2.0, 4.0]), dJ).tolist() == [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.5]
