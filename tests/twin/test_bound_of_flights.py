"""`twin.error_bound` and `error_bound_change`: flights whose inputs jump, against the numpy reference."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from supervessel import Scene, Twin, parse_scene, reference
from support.marks import some_at_once
from twin.scenes import numbers, random_scene

Array = NDArray[np.float64]

CHEAP = ("none", "decoupled", "principal", "tensor")
HELD, STEP, CHANGES = 2.0, 0.05, 5  # s, s: inputs are held so long, in steps so long, and change so often
TRUTH = 1e-8  # SciPy's DOP853 at rtol 1e-12, and errors that grow by exp(5) at most


def docked_scene(moving: bool = True) -> dict[str, Any]:
    """Returns a station with a tug on a port that moves, and a tank whose dock opens and closes."""
    vessels = {
        "A": {
            "mass": 1000.0,
            "pmi": [3.0, 4.0, 5.0],
            "ports": {"a": port([2, 0.5, 0]), "b": port([-2, 0, 1])},
        },
        "B": {"mass": 300.0, "pmi": [1.0, 1.5, 1.2], "ports": {"own": port([0, 1, 1])}},
        "C": {"mass": 200.0, "pmi": [1.0, 1.0, 0.5], "ports": {"own": port([0.5, 0, 1])}},
    }
    docks = [{"ports": ["A.a", "B.own"]}, {"ports": ["A.b", "C.own"], "name": "tank"}]
    inputs = {"mass": ["B"], "pose": ["A.a"], "docked": ["tank"], "torque": True}
    inputs |= {"motion": ["A.a"]} if moving else {}
    rotation = {"angular_velocity": [0.02, 0.1, -0.05], "attitude": [1.0, 0.2, 0.0, 0.0]}
    return {
        "name": "docked",
        "root": "A",
        "vessels": vessels,
        "docks": docks,
        "inputs": inputs,
        "rotation": rotation,
    }


def port(position: list[float]) -> dict[str, list[float]]:
    return {"position": position, "direction": [1.0, 0.3, 0.0], "alignment": [0.0, 0.0, 1.0]}


def under(raw: dict[str, Any], **rotation: Any) -> Scene:
    return parse_scene(raw | {"rotation": raw["rotation"] | rotation})


def moved(twin: Twin, random: np.random.Generator) -> Array:
    """Returns other values of p, near the scene's; docks either way, motions small."""
    p = twin.p_start.copy()
    for i, name in enumerate(twin.p_names):
        if name.endswith((".mass", "]")) and ".pmi[" not in name and not name.startswith("tank"):
            p[i] = p[i] * random.uniform(0.8, 1.2) + (0.0 if name.endswith("mass") else 0.1 * random.normal())
        elif ".pmi[" in name:
            p[i] *= 1.0 + 0.001 * random.random()
        elif name == "tank.docked":
            p[i] = float(random.random() < 0.5)
    return p


def true_change(scene: Scene, omega: Array, before: dict[str, float], after: dict[str, float]) -> Array:
    return np.asarray(reference.change(scene, omega, before, after))


def flown(scene: Scene, x: Array, values: dict[str, float]) -> Array:
    found = solve_ivp(
        lambda t, state: reference.ode(scene, state, values=values),
        (0.0, HELD),
        x,
        "DOP853",
        rtol=1e-11,
        atol=1e-12,
    )
    return np.asarray(found.y[:, -1])


def apart(x: Array, y: Array) -> float:
    """Returns the angle [rad] between two attitudes."""
    chord = min(np.linalg.norm(x[:4] - y[:4]), np.linalg.norm(x[:4] + y[:4]))
    return float(4.0 * np.arcsin(min(1.0, chord / 2.0)))


KEPT = (("rate", "rate"), ("rate", "momentum"), ("momentum", "momentum"))
CASES = [
    (law, seed, kept)
    for law in CHEAP
    for seed in ("docked", 0, 1, 2)
    for kept in KEPT
    if not (law == "none" and kept != ("rate", "momentum"))  # it takes neither key: truth is by the defaults
    and not (seed == "docked" and kept[1] == "rate")  # moving ports keep momentum
]


QUICK = [case for case in CASES if case[1] in ("docked", 0)]


@pytest.mark.parametrize(("law", "seed", "kept"), some_at_once(CASES, *QUICK))
def test_bound_holds_through_jumps_of_mass_pose_and_docks(law: str, seed: Any, kept: tuple[str, str]) -> None:
    """[EB] eqs. (21), (22), in the order in which a change is made."""
    raw = docked_scene(moving=law != "none") if seed == "docked" else random_scene(seed)
    rules = {"mass_change": kept[0], "pose_change": kept[1]}
    truth = under(raw, law="tensor", **rules)
    twin = Twin(under(raw, law=law, propagator="rk4", **({} if law == "none" else rules)))
    random = np.random.default_rng(4)
    x, y, bound, p = twin.x_start, twin.x_start, np.zeros(2), twin.p_start
    x[:4] /= np.linalg.norm(x[:4])
    y = x.copy()
    for _ in range(CHANGES):
        following = moved(twin, random)
        bound = numbers(twin.error_bound_change(x, bound, p, following))
        before, after = (dict(zip(twin.p_names, at, strict=True)) for at in (p, following))
        y[4:] = true_change(truth, y[4:], before, after)
        x = numbers(twin.change(x, p, following))
        p = following
        J = np.array(twin.composite(p)[2])
        u = 0.01 * J.diagonal().mean() * random.normal(size=len(twin.u_names))
        for _ in range(round(HELD / STEP)):
            bound = numbers(twin.error_bound(x, bound, u, p, STEP))
            x = numbers(twin.step(x, u, p, STEP))
        y = flown(truth, y, after | dict(zip(twin.u_names, u, strict=True)))
        e = x[4:] - y[4:]
        assert apart(x, y) <= bound[0] + TRUTH
        assert np.sqrt(e @ J @ e) <= bound[1] + TRUTH * np.sqrt(np.linalg.eigvalsh(J)[-1])


def test_tensor_is_off_by_its_method_and_rounding_alone() -> None:
    twin = Twin(under(docked_scene(), law="tensor", propagator="rk4"))
    bound = np.zeros(2)
    x = twin.x_start / np.r_[4 * [np.linalg.norm(twin.x_start[:4])], 1, 1, 1]
    for _ in range(100):
        bound = numbers(twin.error_bound(x, bound, [0.1, 0, 0], twin.p_start, 0.005))
        x = numbers(twin.step(x, [0.1, 0, 0], twin.p_start, 0.005))
    assert bound[0] < 1e-10


def test_split_and_steps_without_a_remainder_are_refused_or_infinite() -> None:
    with pytest.raises(ValueError, match=r'"split" has no proven bound'):
        _ = Twin(under(docked_scene(), law="tensor", propagator="rk4"), propagator="split").error_bound
    twin = Twin(under(docked_scene(), law="tensor", propagator="rk4"))
    x = twin.x_start / np.r_[4 * [np.linalg.norm(twin.x_start[:4])], 1, 1, 1]
    assert np.isinf(numbers(twin.error_bound(x, [0, 0], [0, 0, 0], twin.p_start, 1e4))[0])
