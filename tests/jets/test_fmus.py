"""FMUs out of which propellant flows: flown as the twin flies, derivatives, refusals, descriptions."""

import re
from functools import cache

import numpy as np
import pytest

from fmu.jacobians import columns, transposed_rows
from fmu_build.document.documentation import documentation
from fmu_build.generate.model import generate
from fmu_build.interface.variable_table import variable_table
from jets.scenes import FLOWS, MASS, STACK
from supervessel import Twin
from supervessel.equations import equations
from support import DISCARD, OK, Array, Instance, U, refusal, scene, store, variant
from support.marks import FMI

H, STEPS = 0.25, 8
"""s, and how many communication steps."""

ACTING = {"torque[2]": 2.0, "T.main.force[3]": -1.0, FLOWS[0]: 15.0, FLOWS[1]: 4.0}
TAYLOR = variant(STACK, {"rotation.propagator": "taylor"})


@cache
def twin(propagator: str) -> Twin:
    return Twin(scene(variant(STACK, {"rotation.propagator": propagator})))


def state(instance: Instance) -> Array:
    return np.concatenate(
        [np.ravel(instance.get(f"state.{group}")) for group in ("attitude", "angular_velocity")]
    )


def test_a_flight_that_burns_is_the_twins_to_the_last_bit():
    of, instance = twin("dop853"), Instance(STACK)
    fly = of.communication_step(store())
    assert instance.initialise(**ACTING) == OK, instance.log
    x, u = of.x_start, [ACTING.get(name, 0.0) for name in of.u_names]
    for number in range(STEPS):
        mass = 1000.0 - 19.0 * H * number
        assert instance.set({MASS: mass}) == OK
        assert instance.step(H) == OK, instance.log
        x = np.array(fly(x, u, of.p_with({MASS: mass}), H)).ravel()
        assert state(instance).tolist() == x.tolist()
    instance.free()


def test_the_taylor_step_of_the_twin_is_a_sub_step_within_rounding():
    of, instance = twin("taylor"), Instance(TAYLOR)
    u, h = [ACTING.get(name, 0.0) for name in of.u_names], 0.2
    assert instance.initialise(**ACTING) == OK
    x = of.x_start
    for _ in range(5):
        assert instance.step(h) == OK, instance.log
        x = np.array(of.step(x, u, of.p_start, h)).ravel()
    assert np.abs(state(instance) - x).max() <= 64 * U
    instance.free()


@FMI
def test_a_negative_flow_is_refused_until_it_is_set_again(fmi):
    instance = Instance(STACK, fmi)
    assert instance.initialise() == OK
    before = state(instance).tolist()
    assert instance.set({FLOWS[1]: -0.5}) == OK
    assert instance.step(H) == refusal(fmi)
    assert instance.messages()[-1].endswith("T.side.flow = -0.5 kg/s: must be >= 0")
    assert state(instance).tolist() == before
    assert instance.set({FLOWS[1]: 0.5}) == OK
    assert instance.step(H) == OK, instance.log
    instance.free()


def test_in_model_exchange_it_is_refused_too():
    instance = Instance(STACK, exchange=True)
    assert instance.initialise() == OK
    assert instance.set({FLOWS[0]: -1.0}) == OK
    assert instance.update_discrete_states() == DISCARD
    assert instance.get_status("der(state.angular_velocity[1])") == DISCARD
    assert instance.set({FLOWS[0]: 1.0}) == OK
    assert instance.run() == OK
    instance.free()


@pytest.mark.parametrize("raw", [STACK, TAYLOR], ids=["dop853", "taylor"])
def test_a_flow_beyond_all_rockets_is_refused_before_a_stage_leaves_the_doubles(raw):
    # All but at rest the body could take a long step by its rate and acceleration; its stages would overflow
    # and it is known without a try to be too long.
    start = {f"angular_velocity_start[{i}]": 1e-50 for i in (1, 2, 3)}
    instance = Instance(raw)
    assert instance.initialise(**{FLOWS[0]: 1e40} | start) == OK
    assert instance.step(H) == DISCARD
    (count,) = re.findall(r"needs (\S+) sub-steps for tolerance", instance.messages()[-1])
    assert float(count) > 1e35
    assert instance.set({FLOWS[0]: 1.0}) == OK
    assert instance.step(H) == OK, instance.log
    instance.free()


def test_derivatives_by_flows_and_masses_are_those_of_differences():
    instance = Instance(STACK, exchange=True)
    assert instance.initialise(**ACTING) == OK
    assert instance.run() == OK
    unknowns = [f"der(state.angular_velocity[{i}])" for i in (1, 2, 3)]
    knowns = [*FLOWS, MASS, *(f"state.angular_velocity[{i}]" for i in (1, 2, 3))]
    forward, reverse = columns(instance, unknowns, knowns), transposed_rows(instance, unknowns, knowns)
    assert np.abs(forward - reverse).max() <= 64 * U * np.abs(forward).max()
    for i, (name, h) in enumerate(zip(knowns, [1.0, 1.0, 1.0, 1e-3, 1e-3, 1e-3], strict=True)):
        at = float(np.ravel(instance.get(name))[0])
        ends = []
        for sign in (1, -1):
            assert instance.set({name: at + sign * h}) == OK
            ends.append(np.array([instance.get(unknown) for unknown in unknowns]))
        assert instance.set({name: at}) == OK
        found = (ends[0] - ends[1]) / (2 * h)
        assert np.abs(found - forward[:, i]).max() <= 1e-5 * np.abs(forward[:, i]).max(), name
    instance.free()


def test_the_twins_linear_models_have_the_flows():
    of, h = twin("dop853"), 1e-4
    u = np.array([ACTING.get(name, 0.0) for name in of.u_names])
    _, B, _ = (np.array(part) for part in of.discretise(of.x_start, u, of.p_start, H))
    place = of.u_names.index(FLOWS[0])
    du = h * np.eye(len(u))[place]
    ends = [np.array(of.step(of.x_start, v, of.p_start, H)).ravel()[4:7] for v in (u + du, u - du)]
    found = (ends[0] - ends[1]) / (2 * h)
    assert np.abs(B[3:, place] - found).max() <= 1e-7 * np.abs(found).max()
    assert of.scales(10.0).u[place] == 140.0
    trimmed = np.array(of.trim(of.x_start, of.p_start)).ravel()
    assert trimmed[place] == 0.0


@FMI
def test_the_model_description_has_the_flows(fmi):
    instance = Instance(STACK, fmi)
    by_name = {v.name: v for v in instance.description.modelVariables}
    for name in FLOWS:
        found = by_name[name]
        assert (found.causality, found.declaredType.unit, float(found.min)) == ("input", "kg/s", 0.0)
        assert float(found.start) == 0.0
    depends = {
        unknown.variable.name: {known.name for known in unknown.dependencies}
        for unknown in instance.description.derivatives
    }
    assert {*FLOWS, MASS} <= depends["der(state.angular_velocity[2])"]
    instance.free()


def test_the_page_tells_of_the_flows():
    model = equations(scene(STACK))
    page = documentation(model.resolved.scene, variable_table(model), 3)["documentation/index.html"].decode()
    table = page[page.index("Points where forces act or propellant leaves") :].split("</table>")[0]
    rows = [re.findall(r"<td[^>]*>(.*?)</td>", row) for row in table.split("</tr>")]
    assert ["T.side", "0, 1.5, -0.5"] in rows
    assert "a flow must not be negative" in page
    assert "jet damping" in page


def test_without_flows_no_c_is_about_them():
    sources, _ = generate(scene(variant(STACK, {"inputs.flow": []})), 3)
    assert "flows.c" not in sources
    assert "FLOW" not in sources["scene.h"]
    assert "flows.c" in generate(scene(STACK), 3)[0]
