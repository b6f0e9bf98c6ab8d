"""The bound over ranges where changes keep the momentum and where ports move, against DOP853 and numpy."""

from collections.abc import Mapping
from typing import Any

import casadi as ca
import mpmath
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from fmu_build.accuracy.grades import PROVEN, grade_of
from fmu_build.accuracy.proven import CHANGE_DEPTH, ProvenBound, proven_bound, to_narrow
from fmu_build.flight.choices import Choice, Model
from supervessel import Scene, Twin, parse_scene, reference
from supervessel.equations import equations
from supervessel.scene.schema import Accuracy
from support.marks import some_at_once

Array = NDArray[np.float64]

CHEAP = ("none", "decoupled", "principal")
DURATION, STEP, FLIGHTS = 60.0, 1.5, 4  # s, s
COUNT = round(DURATION / STEP)
TRUTH = 1e-8
"""What DOP853 at rtol 1e-11 leaves of attitudes [rad] after 40 pieces, with room; bounds met are above 1e-5
but for the law "tensor", whose own bound is below 1e-8 [rad]."""


def arm(seed: int, law: str, kept: str, *, moves: bool) -> Scene:
    """Returns a slow body with a tank at the end of an arm; all changes keep "rate" or "momentum".

    moves : the arm has velocity and rate, as inputs
    """
    random = np.random.default_rng(seed)
    across = np.cross(random.normal(size=3), [1.0, 0.0, 0.0]).tolist()
    end = {"position": [2.0, *random.normal(size=2).tolist()], "direction": [1, 0, 0], "alignment": across}
    own = {"position": [-1.0, 0.0, 0.2], "direction": [-1, 0.2, 0], "alignment": [0, 0, 1]}
    at = end["position"]
    lengths = 0.3 * random.random(3)
    ranges: dict[str, Any] = {f"A.end.position[{i + 1}]": [at[i], at[i] + lengths[i]] for i in range(3)}
    for key in ("direction", "alignment"):
        ranges |= {f"A.end.{key}[{i + 1}]": [float(x), float(x)] for i, x in enumerate(end[key])}
    ranges["A.end.direction[2]"] = [-0.05, 0.05]
    ranges |= {"B.mass": [80.0, 100.0], "torque": [-0.05, 0.05]}
    inputs: dict[str, Any] = {"mass": ["B"], "pose": ["A.end"], "torque": True, "range": ranges}
    if moves:
        inputs["motion"] = ["A.end"]
        ranges |= {"A.end.velocity": [-0.01, 0.01], "A.end.rate": [-0.005, 0.005]}
    rotation: dict[str, Any] = {
        "law": law,
        "propagator": "rk4",
        "angular_velocity": (0.005 * random.normal(size=3)).tolist(),
    }
    if law != "none":
        rotation |= {"mass_change": kept, "pose_change": kept}
    return parse_scene(
        {
            "name": "arm",
            "root": "A",
            "vessels": {
                "A": {"mass": 1000.0, "pmi": [3.0, 4.0, 5.0], "ports": {"end": end}},
                "B": {"mass": 100.0, "pmi": [1.0, 1.2, 0.7], "ports": {"own": own}},
            },
            "docks": [{"ports": ["A.end", "B.own"]}],
            "inputs": inputs,
            "rotation": rotation,
        }
    )


def with_law(scene: Scene, law: str) -> Scene:
    return scene.model_copy(update={"rotation": scene.rotation.model_copy(update={"law": law})})


def drawn(scene: Scene, random: np.random.Generator, every: int, *, ends: bool) -> list[dict[str, float]]:
    """Returns inputs in their ranges, which jump so often, step by step."""
    twin, rows = Twin(scene), []
    ranges = scene.inputs.range
    for k in range(COUNT):
        if k % every == 0:
            now = {}
            for name in (*twin.p_names, *twin.u_names):
                low, high = ranges[name] if name in ranges else ranges[name.partition("[")[0]]
                share = random.random()
                now[name] = low + (round(share) if ends else share) * (high - low)
        rows.append(now)
    return rows


def flown_by_numpy(scene: Scene, rows: list[dict[str, float]], before: Mapping[str, float]) -> Array:
    """Returns states, (steps, 7), by DOP853 and numpy. before : inputs before the first step."""
    law, x, states = scene.rotation.law, start_of(scene), []
    for row in rows:
        x[4:] = reference.change(scene, x[4:], before, row)
        J, M = reference.composite(scene, row).inertia, reference.external_torque(scene, row)
        h, before = reference.internal_momentum(scene, row), row

        def rate(_: float, y: Array, J: Array = J, M: Array = M, h: Array = h) -> Array:
            acceleration = reference.angular_acceleration(law, J, y[4:], M, h)
            return np.concatenate([reference.attitude_dot(y[:4], y[4:]), acceleration])

        x = solve_ivp(rate, (0.0, STEP), x, method="DOP853", rtol=1e-11, atol=1e-14).y[:, -1]
        states.append(x.copy())  # the next change writes into x
    return np.array(states)


def flown_by_rk4(scene: Scene, rows: list[dict[str, float]], before: Mapping[str, float]) -> Array:
    """Returns states, (steps, 7), by the twin's steps, one a communication step."""
    twin = Twin(scene)
    x, states = start_of(scene), []
    p = np.array([before.get(name, value) for name, value in zip(twin.p_names, twin.p_start, strict=True)])
    for row in rows:
        following = np.array([row[name] for name in twin.p_names])
        x = np.array(twin.change(x, p, following)).ravel()
        x = np.array(twin.step(x, [row[name] for name in twin.u_names], following, STEP)).ravel()
        p = following
        states.append(x)
    return np.array(states)


def start_of(scene: Scene) -> Array:
    return np.array([1.0, 0.0, 0.0, 0.0, *scene.rotation.angular_velocity])


def angles(x: Array, y: Array) -> Array:
    chord = np.minimum(
        np.linalg.norm(x[:, :4] - y[:, :4], axis=1), np.linalg.norm(x[:, :4] + y[:, :4], axis=1)
    )
    return np.asarray(4.0 * np.arcsin(np.minimum(chord / 2.0, 1.0)))


def examined(scene: Scene, kept: str, seed: int) -> tuple[ProvenBound, float]:
    """Returns the bound, and the largest share of it that a flight uses; asserts that none passes it."""
    bound, random, largest = proven_bound(scene, DURATION, STEP), np.random.default_rng(seed), 0.0
    assert bound.why == ""
    assert np.isfinite(bound.whole).all()
    exact = with_law(scene, "tensor")
    rotation = exact.rotation.model_copy(update={"mass_change": kept, "pose_change": kept})
    exact = exact.model_copy(update={"rotation": rotation})
    for flight in range(FLIGHTS):
        rows = drawn(scene, random, (1, 7, COUNT, 2)[flight % 4], ends=flight % 2 == 0)
        before = {} if flight % 2 else rows[-1]  # the start with the scene's values, or with others
        truth = flown_by_numpy(exact, rows, before)
        for way, law_only in ((flown_by_numpy, True), (flown_by_rk4, False)):
            flown = way(scene, rows, before)
            angle, rate = angles(flown, truth), np.linalg.norm(flown[:, 4:] - truth[:, 4:], axis=1)
            assert np.all(angle <= (bound.law if law_only else bound.whole) + TRUTH)
            assert np.all(rate <= (bound.law_rate if law_only else bound.rate) + TRUTH)
            largest = max(largest, float(np.max(angle / bound.whole)))
    return bound, largest


CASES = [
    ("none", "momentum", False),
    *((law, "momentum", moves) for law in ("decoupled", "principal", "tensor") for moves in (False, True)),
    ("tensor", "rate", False),
]


@pytest.mark.parametrize(
    ("law", "kept", "moves"),
    some_at_once(CASES, ("decoupled", "momentum", False)),
)
def test_no_flight_passes_the_bound(law: str, kept: str, moves: bool) -> None:
    """[EB] eqs. (35) to (42): masses, poses, motion of ports and torque jump at every step, or are held."""
    seed = len(law) + moves
    scene = arm(seed, law, kept, moves=moves)
    if law == "none":  # masses keep the rate under this law
        scene = narrowed(scene, "B.mass")
    bound, largest = examined(scene, kept, seed)
    print(f"{law}, {kept}, moves {moves}: {bound.law[-1]:.2g} {bound.whole[-1]:.2g} rad, used {largest:.2f}")
    if law == "tensor":
        assert bound.law[-1] == 0.0
        assert bound.whole[-1] < 1e-5
    else:
        assert bound.law[-1] < 3.0
        assert largest > 0.02  # a bound that says nothing holds too


def narrowed(scene: Scene, name: str) -> Scene:
    """Returns the scene with an input held at its value."""
    value = scene.vessels[name.partition(".")[0]].mass
    inputs = scene.inputs.model_copy(update={"range": {**scene.inputs.range, name: (value, value)}})
    return scene.model_copy(update={"inputs": inputs})


def test_changes_some_of_which_keep_the_rate_and_some_the_momentum_are_refused() -> None:
    """Masses by default keep the rate, poses the momentum; where one of the two is held there is a bound."""
    scene = arm(0, "tensor", "momentum", moves=False)
    rotation = scene.rotation.model_copy(update={"mass_change": "rate"})
    mixed = scene.model_copy(update={"rotation": rotation})
    assert proven_bound(mixed, DURATION, STEP).why == (
        "growth: changes of pose keep the momentum, changes of mass the rate: "
        "in turns they may speed the body up at every step"
    )
    assert to_narrow(mixed, DURATION, STEP) in {"B.mass", "A.end.position", "A.end.direction"}
    assert proven_bound(narrowed(mixed, "B.mass"), DURATION, STEP).why == ""


def test_grade_without_a_bound_of_steps_says_why() -> None:
    """Steps of 400 s are too long for the remainder: no bound of "inf rad" is named."""
    accuracy = Accuracy(attitude=1e-3, horizon=800.0, step=400.0)
    scene = arm(0, "tensor", "momentum", moves=False)
    why = grade_of(scene, accuracy, Choice(Model("tensor"), "rk4", 0.05)).why
    assert why.startswith(("method: steps of 400 s", "growth"))


def test_pose_that_moves_by_default_is_proven() -> None:
    """It was flown alone before: poses keep the momentum by default."""
    scene = narrowed(arm(1, "tensor", "momentum", moves=True), "B.mass")
    rotation = scene.rotation.model_copy(update={"mass_change": "rate", "pose_change": None})
    scene = scene.model_copy(update={"rotation": rotation})
    accuracy = Accuracy(attitude=1e-3, horizon=DURATION, step=STEP)
    grade = grade_of(scene, accuracy, Choice(Model("tensor"), "rk4", 0.05))
    assert grade.name == PROVEN
    assert grade.attitude is not None
    assert 0.0 < grade.attitude < 1e-4


def test_roundings_of_a_change_are_fewer_than_allowed() -> None:
    """[EB] eq. (42): the longest path through the operations of a change that keeps the momentum."""
    change = equations(arm(0, "tensor", "momentum", moves=True)).change
    assert change is not None
    function, depth, deepest = change.keep_momentum, dict[int, int](), 0
    for k in range(function.n_instructions()):
        code, out, into = (getattr(function, f"instruction_{what}")(k) for what in ("id", "output", "input"))
        if code in (ca.OP_INPUT, ca.OP_CONST):
            depth[out[0]] = 0
        elif code == ca.OP_OUTPUT:
            deepest = max(deepest, depth[into[0]])
        else:
            depth[out[0]] = 1 + max(depth[i] for i in into)
    print(deepest)
    assert 10 < deepest <= CHANGE_DEPTH


mp = mpmath.mp.clone()
mp.dps = 30
CLOSE = mp.mpf(10) ** -24  # of sums of some hundreds of products of numbers about 1


def cross(a: Any, b: Any) -> Any:
    return mp.matrix([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


@pytest.mark.parametrize("seed", range(4))
def test_error_of_the_momentum_obeys_the_page(seed: int) -> None:
    """[EB] eqs. (35) to (41) with mpmath: rates of both motions as (1) has them, at one instant."""
    random = np.random.default_rng(seed)

    def vector() -> Any:
        return mp.matrix([mp.mpf(float(x)) for x in random.normal(size=3)])

    def tensor() -> Any:
        A = mp.matrix(3, 3)
        for i in range(3):
            A[:, i] = vector()
        return A.T * A + mp.eye(3) / 5

    J, K = tensor(), tensor()
    D = mp.diag([J[i, i] for i in range(3)])
    w, omega, M, h, c = (vector() for _ in range(5))
    P, H = D * w + h, J * omega + h
    N, b = P + c, P + c - H
    P_dot, H_dot = M - cross(w, P), M - cross(omega, H)

    def Q(tensor: Any, a: Any, d: Any) -> Any:
        return -(cross(tensor**-1 * a, d) + cross(tensor**-1 * d, a)) / 2

    spin = J**-1 * h
    left = P_dot - (M + Q(J, N, N) + cross(spin, N))
    right = 2 * Q(J, N, b) - Q(J, b, b) + cross(spin, b) + left
    assert mp.norm(P_dot - H_dot - right) < CLOSE
    assert mp.norm(P_dot - (M + Q(D, P, P) + cross(D**-1 * h, P))) < CLOSE
    rest = cross(D**-1 * h - spin, P) - 2 * Q(J, c, P) - Q(J, c, c) - cross(spin, c)
    assert mp.norm(left - (Q(D, P, P) - Q(J, P, P) + rest)) < CLOSE
    off = (D**-1 - J**-1) * (P - h) - J**-1 * c
    assert mp.norm(w - omega - J**-1 * b - off) < CLOSE
    L = mp.cholesky(K)
    v = L**-1 * b
    F = L.T * J**-1 * L - mp.eye(3)
    cubic = (v.T * L**-1 * Q(J, b, b))[0]
    assert abs(cubic - (v.T * F * L**-1 * cross(J**-1 * b, b))[0]) < CLOSE
