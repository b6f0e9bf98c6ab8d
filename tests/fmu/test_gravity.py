"""FMUs in a field of gravity: beside a motion of 30 digits and beside the twin; places that are refused."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from supervessel import Twin
from support import DISCARD, EPS, ERROR, OK, Instance, flying, refusal, scene
from support.gyrostat import Course, Gyrostat, GyrostatState
from support.marks import FMI_3_AT_ONCE, some_at_once
from support.orbits import EARTH, ORBIT

TENSOR = [[1.28e8, -2.1e6, 5.3e6], [-2.1e6, 1.07e8, 1.4e6], [5.3e6, 1.4e6, 2.01e8]]
RATE, ATTITUDE = [1.1e-4, -1.2e-3, 2.3e-4], [0.5, -0.5, 0.5, 0.5]
DURATION, STEP = 3600.0, 600.0
GROWTH = 20.0
"""More than errors grow by to the end, from the end of the step at which they are estimated: an attitude's at
most by 8.3; a rate's turns the body by 6600 s of it, of which its step's estimate counts 600 s."""
SMALL = GROWTH * 6 * 1e-15
"""[rad] of six steps, whose errors are controlled to 1e-15 each."""
LAWS = ("tensor", "principal", "decoupled")
WHEEL = ("axis", "inertia", "momentum")


def orbiting(propagator: str, law: str = "tensor", **rotation: Any) -> dict[str, Any]:
    """Returns the raw scene of a station in its orbit, turned by gravity's gradient alone."""
    start = {"angular_velocity": RATE, "attitude": ATTITUDE}
    return {
        "name": "orbiting",
        "root": "S",
        "vessels": {"S": {"mass": 4.5e5, "inertia": TENSOR}},
        "inputs": {"gravity": True, "torque": True},
        "gravity": {"mu": EARTH, **ORBIT},
        "rotation": start | {"law": law, "propagator": propagator, "tolerance": 1e-15} | rotation,
        "outputs": {"names": ["attitude", "angular_velocity", "error_estimate"]},
    }


@cache
def truth(law: str) -> Course:
    start = GyrostatState(ATTITUDE, RATE, ORBIT["position"], ORBIT["velocity"])
    return Course(Gyrostat(TENSOR, law, mu=EARTH), start, DURATION)


def place(instance: Instance, time: float, law: str) -> dict[str, Any]:
    """Returns the inputs that say where the body is at a time."""
    orbit = truth(law).orbit(np.array([time]))[0]
    return {"gravity.position": orbit[:3], "gravity.velocity": orbit[3:]}


def off(x: np.ndarray, law: str, time: float) -> float:
    """Returns the angle [rad] between an attitude, (4,), and the true one."""
    true = np.array(truth(law).at(time).attitude, dtype=float)
    return 2.0 * min(float(np.linalg.norm(x[:4] - true)), float(np.linalg.norm(x[:4] + true)))


def flown(raw: dict[str, Any], law: str, step: float, fmi: int = 3) -> tuple[np.ndarray, float]:
    """Returns attitude and rate, (7,), at the end, places set every `step` [s]; and the sum of estimates."""
    estimates = 0.0
    with flying(raw, fmi) as instance:
        for k in range(round(DURATION / step)):
            assert instance.set(place(instance, k * step, law)) == OK
            assert instance.step(step) == OK, instance.log
            estimates += instance.get("error_estimate")
        return np.append(instance.get("attitude"), instance.get("angular_velocity")), estimates


@pytest.mark.parametrize(
    ("propagator", "rotation", "allowed"),
    [
        ("taylor", {}, SMALL),
        ("dop853", {}, SMALL),
        ("auto", {}, SMALL),
        ("rk4", {"max_angle_step": 0.002}, 1e-9),
    ],
)
@pytest.mark.parametrize("law", some_at_once(LAWS, "tensor", "decoupled"))
def test_the_motion_along_an_orbit_is_the_true_one(propagator, rotation, allowed, law):
    x, estimate = flown(orbiting(propagator, law, **rotation), law, STEP)
    assert off(x, law, DURATION) < allowed
    assert off(x, law, DURATION) < GROWTH * estimate


@pytest.mark.parametrize(
    ("propagator", "rotation", "allowed"),
    [("dop853", {}, SMALL), ("rk4", {"max_angle_step": 0.002}, 1e-9)],
)
@pytest.mark.parametrize("law", some_at_once(["tensor", "principal"], "tensor"))
def test_wheels_in_an_orbit_move_as_they_truly_do(propagator, rotation, allowed, law):
    axes, inertias, momenta = [[0.0, 0.6, 0.8], [1.0, 0.0, 0.0]], [2e4, 0.0], [3e4, -2e4]
    raw = orbiting(propagator, law, **rotation)
    wheels = zip("ab", axes, inertias, momenta, strict=True)
    raw["vessels"]["S"]["wheels"] = {name: dict(zip(WHEEL, row, strict=True)) for name, *row in wheels}
    start = GyrostatState(ATTITUDE, RATE, ORBIT["position"], ORBIT["velocity"], momenta)
    body = Gyrostat(TENSOR, law, mu=EARTH, axes=axes, inertias=inertias, motors=[0, 0])
    true = np.array(Course(body, start, DURATION).at(DURATION).attitude, dtype=float)
    x, _ = flown(raw, law, STEP)
    assert 2.0 * min(np.linalg.norm(x[:4] - true), np.linalg.norm(x[:4] + true)) < allowed
    assert off(x, law, DURATION) > 1e-3  # without wheels it would be elsewhere


def test_split_is_of_order_two():
    found = [flown(orbiting("split", tolerance=0.1), "tensor", step)[0] for step in (10.0, 5.0)]
    coarse, fine = (off(x, "tensor", DURATION) for x in found)
    assert 3.8 < coarse / fine < 4.2
    assert fine < 1e-4


@pytest.mark.parametrize("propagator", ["taylor", "dop853", "rk4", "split"])
@FMI_3_AT_ONCE
def test_the_twin_steps_as_the_fmu_does(propagator, fmi, tmp_path):
    raw = orbiting(propagator, max_angle_step=1.0, tolerance=0.1 if propagator == "split" else 1e-6)
    twin, u = Twin(scene(raw)), [3.0, -2.0, 5.0]
    with flying(raw, fmi, torque=u) as instance:
        assert instance.step(20.0) == OK
        x = np.append(instance.get("attitude"), instance.get("angular_velocity"))
    step = np.array(twin.step(twin.x_start, u, twin.p_start, 20.0)).ravel()
    np.testing.assert_allclose(step, x, rtol=0, atol=1e-15)
    if fmi == 3:
        whole = twin.communication_step(tmp_path)
        assert np.array(whole(twin.x_start, u, twin.p_start, 20.0)).ravel().tolist() == x.tolist()


def test_a_rollout_carries_the_place_on():
    twin = Twin(scene(orbiting("taylor")))
    states = np.array(twin.rollout(30)(x=twin.x_start, h=60.0)["x_next"])
    for k in (0, 9, 29):
        assert off(states[:, k], "tensor", (k + 1) * 60.0) < SMALL


def test_exact_discards_what_gravity_does():
    with flying(orbiting("exact")) as instance:
        before = instance.bits()
        assert instance.step(1.0) == refusal(3)
        assert "gravity.position = (" in instance.messages()[-1]
        assert "free motion alone" in instance.messages()[-1]
        assert instance.bits() == before


REFUSED: list[tuple[str, Any, str]] = [
    ("gravity.position", [1e101, 0, 0], "gravity.position = (1e+101, 0, 0) m: must be at most 1e+100 m long"),
    (
        "gravity.velocity",
        [0, -1e101, 0],
        "gravity.velocity = (0, -1e+101, 0) m/s: must be at most 1e+100 m/s",
    ),
    ("gravity.position", [0, 0, 0], "gravity.position = (0, 0, 0) m: must be longer than"),
    ("gravity.position", [60.0, 0, 0], "longer than 62.2"),
    ("gravity.position", [0, 60.0, 0], " m, twice the assembly's size"),
    ("gravity.position[2]", np.nan, "gravity.position[2] = nan m: must be finite"),
]


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize(("name", "value", "message"), REFUSED)
@pytest.mark.parametrize("exchange", [False, True])
def test_places_without_a_meaning_are_refused_and_the_state_is_kept(fmi, name, value, message, exchange):
    instance = Instance(orbiting("taylor"), fmi, exchange=exchange)
    assert instance.initialise() == OK
    before = {each: instance.get(each) for each in ("attitude", "angular_velocity")}
    good = {each: instance.get(each) for each in instance.names(name)}
    status = instance.set({name: value})
    if status == OK:
        status = instance.get_status("der(state.angular_velocity[1])") if exchange else instance.step(1.0)
    unanswered = fmi == 2 and not exchange and np.all(np.isfinite(value))
    assert status == (ERROR if unanswered else DISCARD)
    assert message in instance.messages()[-1]
    assert instance.set(good) == OK
    for each, numbers in before.items():
        assert instance.get(each).tolist() == numbers.tolist()
    if not exchange:
        assert instance.step(1.0) == OK
    instance.free()


@pytest.mark.parametrize("law", LAWS)
def test_rates_and_their_derivatives_in_model_exchange_are_the_twins(law):
    raw = orbiting("taylor", law)
    twin, u = Twin(scene(raw)), np.array([3.0, -2.0, 5.0])
    instance = Instance(raw, exchange=True)
    assert instance.initialise(torque=u) == OK
    rates = [f"der({name})" for name in twin.x_names]
    x_dot = twin.ode(twin.x_start, u, twin.p_start).full().ravel()
    assert [instance.get(name) for name in rates] == x_dot.tolist()
    blocks = twin.ode.jacobian()(twin.x_start, u, twin.p_start, x_dot)
    knowns = [*twin.x_names, *twin.u_names, *twin.p_names]
    jacobian = np.hstack([np.array(block) for block in blocks])
    forward = np.array([instance.directional(rates, knowns, unit) for unit in np.eye(len(knowns))]).T
    adjoint = np.array([instance.adjoint(rates, knowns, row) for row in np.eye(7)])
    size = np.linalg.norm(jacobian, axis=0) + 1e-300
    np.testing.assert_allclose(forward / size, jacobian / size, rtol=0, atol=16 * EPS)
    np.testing.assert_allclose(adjoint / size, jacobian / size, rtol=0, atol=16 * EPS)
    assert np.all(forward[:, knowns.index("gravity.velocity[1]") :][:, :3] == 0.0)
    instance.free()


def test_derivatives_of_a_step_by_the_place_are_those_of_differences():
    twin = Twin(scene(orbiting("dop853")))
    x, p = twin.x_start, twin.p_start
    jacobian = np.array(twin.step.jacobian()(x, np.zeros(3), p, 60.0, np.zeros(7))[2])
    for i in range(6):
        small = np.zeros(6)
        small[i] = 1e-4 * np.linalg.norm(p[3 * (i // 3) : 3 * (i // 3) + 3])
        ends = [np.array(twin.step(x, np.zeros(3), p + side * small, 60.0)).ravel() for side in (1.0, -1.0)]
        difference = (ends[0] - ends[1]) / (2.0 * small[i])
        scale = np.abs(jacobian[:, 3 * (i // 3) : 3 * (i // 3) + 3]).max()
        np.testing.assert_allclose(difference / scale, jacobian[:, i] / scale, rtol=0, atol=1e-6)
