"""FMUs of scenes with wheels: flown by FMPy as the twin flies, their states, derivatives, refusals."""

import re
from collections.abc import Sequence
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest

from fmu.jacobians import columns, transposed_rows
from fmu_build.document.documentation import documentation
from fmu_build.interface.variable_table import variable_table
from supervessel import Twin
from supervessel.equations import equations
from support import DISCARD, OK, Array, Instance, U, refusal, scene, store, variant
from support.marks import FMI
from wheels.scenes import CARRIER, GYROSTAT, MOTION, RATES

H, STEPS = 0.25, 12
"""s, and how many communication steps."""

MOTORS = {"A.x.torque": 0.4, "B.y.torque": -0.3}
DERIVED = pytest.mark.parametrize("raw", [CARRIER, RATES], ids=["momentum is the state", "rate is the state"])


@cache
def twin(name: str) -> Twin:
    return Twin(scene({"gyrostat": GYROSTAT, "carrier": CARRIER, "carrier_rates": RATES}[name]))


def state(instance: Instance) -> Array:
    """Returns attitude, angular velocity and momenta of wheels, in the twin's order."""
    states = [name for name in instance.references if name.startswith("state.")]
    groups = "state.attitude", "angular_velocity", *(name for name in states if name.endswith(".momentum"))
    return np.concatenate([np.ravel(instance.get(group)) for group in groups])


@pytest.mark.parametrize("raw", [GYROSTAT, CARRIER], ids=["dop853", "rk4"])
def test_a_flight_is_the_twins_to_the_last_bit(raw):
    of = twin(raw["name"])
    fly = of.communication_step(store())
    instance = Instance(raw)
    assert instance.initialise() == OK, instance.log
    x, p, u = of.x_start, of.p_start, np.linspace(-0.4, 0.5, len(of.u_names))
    assert instance.set(dict(zip(of.u_names, u, strict=True))) == OK
    for _ in range(STEPS):
        assert instance.step(H) == OK, instance.log
        x = np.array(fly(x, u, p, H)).ravel()
        assert state(instance).tolist() == x.tolist()
    instance.free()


@FMI
def test_the_step_of_the_twin_is_a_sub_step(fmi):
    # rk4 in communication steps so short that each is one sub-step
    of, instance = twin("carrier"), Instance(CARRIER, fmi)
    assert instance.initialise() == OK
    x, p = of.x_start, of.p_with(MOTION)
    u = [0.1, 0.0, 0.2, *MOTORS.values()]
    assert instance.set(dict(zip(of.u_names, u, strict=True)) | MOTION) == OK
    x = np.array(of.change(x, of.p_start, p)).ravel()
    for _ in range(5):
        assert instance.step(0.01) == OK, instance.log
        x = np.array(of.step(x, u, p, 0.01)).ravel()
    assert state(instance).tolist() == x.tolist()
    shown = dict(zip(of.y_names, np.array(of.outputs(x, u, p)).ravel().tolist(), strict=True))
    assert {name: instance.get(name) for name in shown} == shown
    instance.free()


def test_the_taylor_step_of_the_twin_is_a_sub_step_within_rounding():
    raw = variant(GYROSTAT, {"rotation.propagator": "taylor"})
    of, instance = Twin(scene(raw)), Instance(raw)
    u, h = np.linspace(-0.4, 0.5, 5), 0.2
    assert instance.initialise(**dict(zip(of.u_names, u, strict=True))) == OK
    x = of.x_start
    for _ in range(5):
        assert instance.step(h) == OK, instance.log
        x = np.array(of.step(x, u, of.p_start, h)).ravel()
    size = np.maximum(np.abs(x), 0.1)
    assert (np.abs(state(instance) - x) / size).max() <= 64 * U
    instance.free()


@pytest.mark.parametrize("propagator", ["dop853", "taylor"])
def test_the_first_sub_step_of_a_body_all_but_at_rest_is_as_short_as_its_nutation_asks_for(propagator):
    # 1e4 N m s turn the rate by 100 rad/s, 1e3 rad in the step; `Instance` sees what leaves the doubles.
    raw = variant(
        GYROSTAT,
        {
            "vessels.B.wheels": {"z": {"axis": [0, 0, 1], "momentum": 1e4}},
            "inputs": {"torque": True},
            "rotation": {"propagator": propagator, "angular_velocity": [1e-6, 2e-6, 0.0]},
            "outputs.names": ["angular_velocity", "angular_momentum"],
        },
    )
    instance = Instance(raw)
    assert instance.initialise() == OK
    assert instance.step(10.0) == OK, instance.log
    assert np.linalg.norm(instance.get("angular_velocity")) <= 4e-6
    instance.free()


@FMI
def test_start_parameters_set_the_momenta(fmi):
    instance = Instance(CARRIER, fmi)
    assert instance.enter() == OK
    assert instance.set({"A.x.momentum_start": -3.5, "B.store.momentum_start": 0.25}) == OK
    assert instance.get("state.A.x.momentum") == -3.5
    assert instance.exit() == OK
    assert [instance.get(f"{w}.momentum") for w in ("A.x", "B.y", "B.store")] == [-3.5, 3.0, 0.25]
    assert instance.step(H) == OK
    assert instance.reset() == OK
    assert instance.initialise() == OK
    assert instance.get("A.x.momentum") == 20.0
    instance.free()


@FMI
def test_a_saved_state_holds_the_momenta(fmi):
    instance = Instance(CARRIER, fmi)
    assert instance.initialise(**MOTORS) == OK
    assert instance.step(H) == OK
    get, set_, release = (
        getattr(instance.fmu, name if fmi == 3 else name.replace("State", "state"))
        for name in ("getFMUState", "setFMUState", "freeFMUState")
    )
    saved, there = get(), state(instance).tolist()
    assert instance.step(H) == OK
    end = state(instance).tolist()
    set_(saved)
    instance.time -= H
    assert state(instance).tolist() == there
    assert instance.step(H) == OK
    assert state(instance).tolist() == end
    release(saved)
    instance.free()


@FMI
def test_a_motor_of_a_vessel_that_has_left_is_refused_and_its_wheel_keeps_its_momentum(fmi):
    instance = Instance(CARRIER, fmi)
    assert instance.initialise(**MOTORS) == OK
    assert instance.step(H) == OK
    kept, speed = instance.get("B.y.momentum"), instance.get("B.y.speed")
    assert instance.set({"dock.docked": False}) == OK
    assert instance.step(H) == refusal(fmi)
    (message,) = instance.messages()
    assert message.endswith("B.y.torque = -0.3 N.m: must be 0 while docks do not hold the vessel to the root")
    assert instance.set({"B.y.torque": 0.0}) == OK
    assert instance.step(H) == OK, instance.log
    assert instance.get("B.y.momentum") == kept
    assert instance.get("B.y.speed") == 0.0 != speed
    assert instance.set({"dock.docked": True, "B.y.torque": -0.3}) == OK
    assert instance.step(H) == OK
    assert abs(instance.get("B.y.momentum") - (kept - 0.3 * H)) <= 64 * U * kept
    instance.free()


def test_in_event_mode_and_for_rates_it_is_refused_too():
    instance = Instance(CARRIER, exchange=True)
    assert instance.initialise() == OK
    assert instance.set({"dock.docked": False, "B.y.torque": 1.0}) == OK
    assert instance.update_discrete_states() == DISCARD
    assert instance.get_status("der(state.B.y.momentum)") == DISCARD
    assert instance.get_status("B.y.momentum") == OK
    assert instance.set({"B.y.torque": 0.0}) == OK
    assert instance.run() == OK
    assert instance.get("der(state.B.y.momentum)") == 0.0
    instance.free()


@FMI
def test_a_vessel_with_wheels_must_have_mass_and_more_about_their_axes(fmi):
    instance = Instance(CARRIER, fmi)
    assert instance.initialise() == OK
    for mass, problem in (
        (0.0, "B.mass = 0 kg: must be > 0, since the vessel has wheels"),
        (-1.0, "B.mass = -1 kg: must be >= 0"),
    ):
        assert instance.set({"B.mass": mass}) == OK
        assert instance.step(H) == refusal(fmi)
        assert instance.messages()[-1].endswith(problem)
    assert instance.set({"B.mass": 1.0}) == OK
    assert instance.step(H) == OK
    instance.free()


@FMI
def test_a_momentum_beyond_numbers_is_refused_at_the_start_by_name(fmi):
    instance = Instance(CARRIER, fmi)
    assert instance.enter() == OK
    assert instance.set({"B.store.momentum_start": -1e101}) == OK
    assert instance.exit() == refusal(fmi)
    assert "B.store.momentum_start = -1e+101 N.m.s: must be at most 1e+100" in instance.messages()[-1]
    assert instance.set({"B.store.momentum_start": -2.0}) == OK
    assert instance.exit() == OK
    instance.free()


def test_a_tensor_that_its_wheels_use_up_is_refused():
    raw = variant(
        CARRIER,
        {
            "vessels.A.mass": 1.0,
            "vessels.A.wheels.x.inertia": 0.5,
            "inputs.mass": ["A"],
            "inputs.motion": [],
            "inputs.wheel": [],
        },
    )
    instance = Instance(raw)
    assert instance.initialise() == OK, instance.log
    assert instance.set({"dock.docked": False, "A.mass": 0.4}) == OK
    assert instance.step(H) == DISCARD
    assert (
        "less what wheels have about their axes: must be finite and positive definite"
        in instance.messages()[-1]
    )
    instance.free()


# Model exchange


def exchanging(raw: dict[str, Any], **values: float) -> Instance:
    instance = Instance(raw, exchange=True)
    assert instance.initialise(**values) == OK, instance.log
    assert instance.run() == OK
    return instance


@DERIVED
def test_rates_in_model_exchange_are_the_twins(raw):
    of = twin(raw["name"])
    u = [0.1, 0.0, 0.2, *MOTORS.values()]
    instance = exchanging(raw, **dict(zip(of.u_names, u, strict=True)), **MOTION)
    p, x = of.p_with(MOTION), state(instance)
    rates = np.array(of.ode(x, u, p)).ravel()
    shared = [name for name in of.x_names if name in instance.references]
    found = np.array([instance.get(f"der({name})") for name in shared])
    expected = rates[[of.x_names.index(name) for name in shared]]
    assert np.abs(found - expected).max() <= 64 * U * np.abs(rates).max()
    if raw is CARRIER:  # H' = M - w x H
        H_body = np.array([instance.get(f"state.angular_momentum[{i}]") for i in (1, 2, 3)])
        found = np.array([instance.get(f"der(state.angular_momentum[{i}])") for i in (1, 2, 3)])
        turning = np.cross(x[4:7], H_body)
        assert np.abs(found - (np.array(u[:3]) - turning)).max() <= 64 * U * np.abs(turning).max()
    instance.free()


def derived(instance: Instance) -> tuple[list[str], list[str]]:
    """Returns unknowns, and knowns that are numbers."""
    names = list(instance.references)
    states = [n for n in names if n.startswith("state.")]
    outputs = [str(v.name) for v in instance.description.modelVariables if v.causality == "output"]
    inputs = [str(v.name) for v in instance.description.modelVariables if v.causality == "input"]
    knowns = [n for n in inputs if n not in instance.booleans and not n.startswith("dock.")]
    return [*outputs, *(f"der({s})" for s in states)], [*states, *knowns]


def by_differences(instance: Instance, unknowns: Sequence[str], knowns: Sequence[str]) -> Array:
    """Returns the Jacobian by central differences of the FMU's own values."""
    found = []
    for name in knowns:
        at = instance.get(name)
        h = 1e-5 * max(abs(at), 1.0)
        sides = []
        for value in (at + h, at - h):
            assert instance.set({name: value}) == OK
            sides.append(np.array([instance.get(unknown) for unknown in unknowns]))
        assert instance.set({name: at}) == OK
        found.append((sides[0] - sides[1]) / (2.0 * h))
    return np.array(found).T


DIFFERENCES = 1e-7
"""Of the largest element of a row: h = 1e-5 leaves h^2 of a third derivative, and rounding over h."""


@DERIVED
def test_derivatives_are_those_of_differences(raw):
    instance = exchanging(variant(raw, {"inputs.wheel": ["A.x", "B.y"]}), **MOTORS, **MOTION)
    unknowns, knowns = derived(instance)
    if raw is RATES:  # poses are discrete beside masses that keep the rate
        knowns = [name for name in knowns if not name.startswith("B.end.")]
    forward = columns(instance, unknowns, knowns)
    reverse = transposed_rows(instance, unknowns, knowns)
    size = np.maximum(np.abs(forward).max(axis=1, keepdims=True), 1e-3)
    assert (np.abs(forward - reverse) / size).max() <= 1e-12
    assert (np.abs(forward - by_differences(instance, unknowns, knowns)) / size).max() <= DIFFERENCES
    instance.free()


@DERIVED
def test_derivatives_by_start_parameters_are_those_of_differences(raw):
    instance = Instance(raw, exchange=True)
    assert instance.enter() == OK
    assert instance.set(MOTION) == OK
    parameters = [str(v.name) for v in instance.description.modelVariables if v.causality == "parameter"]
    assert parameters[-3:] == ["A.x.momentum_start", "B.y.momentum_start", "B.store.momentum_start"]
    states = [name for name in instance.references if name.startswith("state.")]
    unknowns = [*states, *(f"der({name})" for name in states), "angular_momentum[1]", "B.y.speed"]
    forward, reverse = (
        columns(instance, unknowns, parameters),
        transposed_rows(instance, unknowns, parameters),
    )
    size = np.maximum(np.abs(forward).max(axis=1, keepdims=True), 1e-3)
    assert (np.abs(forward - reverse) / size).max() <= 1e-12
    assert (np.abs(forward - by_differences(instance, unknowns, parameters)) / size).max() <= DIFFERENCES
    instance.free()


@DERIVED
def test_derivatives_through_a_dock_that_closes_are_those_of_differences(raw):
    # In event mode the states follow from what was committed before, by masses and by motion at contact.
    open_ = variant(raw, {"docks": [{"name": "dock", "ports": ["A.arm", "B.end"], "docked": False}]})
    instance = Instance(open_, exchange=True)
    contact = {f"dock.rate[{i}]": 0.1 * i for i in (1, 2, 3)} | {
        f"dock.velocity[{i}]": -0.2 * i for i in (1, 2, 3)
    }
    assert instance.initialise() == OK, instance.log
    assert instance.run() == OK
    assert instance._status(instance.fmu.enterEventMode) == OK
    assert instance.set({"dock.docked": True} | contact) == OK
    states = [name for name in instance.references if name.startswith("state.")]
    unknowns = [
        "angular_velocity[1]",
        "angular_velocity[3]",
        "angular_momentum[2]",
        "B.y.speed",
        *(f"der({s})" for s in states),
    ]
    knowns = [*contact, "B.mass"]
    forward, reverse = columns(instance, unknowns, knowns), transposed_rows(instance, unknowns, knowns)
    size = np.maximum(np.abs(forward).max(axis=1, keepdims=True), 1e-3)
    assert (np.abs(forward - reverse) / size).max() <= 1e-12
    assert (np.abs(forward - by_differences(instance, unknowns, knowns)) / size).max() <= DIFFERENCES
    instance.free()


# Names, units, dependencies


@FMI
def test_the_model_description_has_the_wheels(fmi):
    instance = Instance(CARRIER, fmi)
    by_name = {v.name: v for v in instance.description.modelVariables}
    units = {
        "A.x.torque": ("input", "N.m"),
        "A.x.momentum": ("output", "N.m.s"),
        "A.x.speed": ("output", "rad/s"),
        "A.x.momentum_start": ("parameter", "N.m.s"),
        "state.B.store.momentum": ("local", "N.m.s"),
        "der(state.B.store.momentum)": ("local", "N.m"),
    }
    for name, (causality, unit) in units.items():
        found = by_name[name]
        assert (found.causality, found.declaredType.unit) == (causality, unit), name
    assert "B.store.torque" not in by_name
    assert len(instance.description.derivatives) == 10
    assert float(by_name["A.x.momentum"].nominal) == 20.0
    instance.free()


def test_the_page_lists_wheels():
    model = equations(scene(CARRIER))
    page = documentation(model.resolved.scene, variable_table(model), 3)["documentation/index.html"].decode()
    table = page[page.index("Wheels, part of") :].split("</table>")[0]
    rows = [re.findall(r"<td[^>]*>(.*?)</td>", row) for row in table.split("</tr>")]
    assert ["B.y", "0, 1, 1", "1", "3", "yes"] in rows
    assert "<i>k</i>′ = <i>u</i>" in page
    assert "the torque of its motor must be 0" in " ".join(page.split())


def test_what_changes_with_a_motor_is_its_wheels_momentum_and_the_bodys_rate():
    instance = Instance(RATES)
    depends = {
        unknown.variable.name: {known.name for known in unknown.dependencies}
        for unknown in instance.description.derivatives
    }
    assert depends["der(state.A.x.momentum)"] == {"A.x.torque"}
    assert depends["der(state.B.y.momentum)"] == {"B.y.torque", "dock.docked"}
    assert depends["der(state.B.store.momentum)"] == set()
    assert {"A.x.torque", "B.y.torque", "state.B.store.momentum"} <= depends["der(state.angular_velocity[2])"]
    instance.free()


@pytest.mark.parametrize("raw", [CARRIER], ids=["carrier"])
def test_the_twins_derivatives_are_those_of_differences(raw):
    of = twin(raw["name"])
    p, x, u = of.p_with(MOTION), of.x_start, np.array([0.1, 0.0, 0.2, 0.4, -0.3])
    A, B, _ = (np.array(part) for part in of.linearise(x, u, p))
    zero, h = np.zeros(9), 1e-6

    def rate(e: Array, du: Array) -> Array:
        reference = np.array(of.ode(x, u, p)).ravel()[4:]
        return np.array(
            of.error_ode(e=e, u=u + du, p=p, x_ref=x, acceleration_ref=reference)["e_dot"]
        ).ravel()

    for columns_, count, at in ((A, 9, lambda d: (d, np.zeros(5))), (B, 5, lambda d: (zero, d))):
        found = np.array([(rate(*at(h * d)) - rate(*at(-h * d))) / (2 * h) for d in np.eye(count)]).T
        assert np.abs(found - columns_).max() <= 1e-8 * max(1.0, np.abs(columns_).max())
    A, B, E = (np.array(part) for part in of.discretise(x, u, p, 0.1))
    assert (A.shape, B.shape, E.shape) == ((9, 9), (9, 5), (9, len(of.p_names)))
    assert A[6:, 6:].tolist() == np.eye(3).tolist()
    assert np.abs(B[6:] - 0.1 * np.array([[0, 0, 0, 1, 0], [0, 0, 0, 0, 1], [0] * 5])).max() <= U

    def ahead(e: Array) -> Array:
        return np.array(of.error(of.step(of.retract(x, e), u, p, 0.1), of.step(x, u, p, 0.1))).ravel()

    found = np.array([(ahead(h * d) - ahead(-h * d)) / (2 * h) for d in np.eye(9)]).T
    assert np.abs(found - A).max() <= 1e-7


def test_the_twin_for_control_has_the_wheels_behind_the_seven():
    of = twin("carrier")
    assert of.x_names[7:] == ("state.A.x.momentum", "state.B.y.momentum", "state.B.store.momentum")
    u = np.array(of.trim(of.x_start, of.p_start)).ravel()
    assert u[3:].tolist() == [0.0, 0.0]
    x_dot = np.array(of.ode(of.x_start, u, of.p_start)).ravel()
    assert np.abs(x_dot[4:7]).max() <= 64 * U * np.abs(x_dot).max()
    scales = of.scales(60.0)
    assert (scales.x.size, scales.u.size, scales.e.size) == (10, 5, 9)
    before = [np.array(part).ravel() for part in of.invariants(of.x_start, of.p_start)]
    states = of.rollout(200)(x=of.x_start, h=0.01)["x_next"]
    after = [np.array(part).ravel() for part in of.invariants(states[:, -1], of.p_start)]
    for one, other in zip(before, after, strict=True):
        assert np.abs(one - other).max() <= 1e-11 * np.abs(one).max()
    with pytest.raises(ValueError, match=r"error_bound: .* has wheels"):
        _ = of.error_bound
    assert ca.SX(of.to_dae()["ode"]).numel() == 10
