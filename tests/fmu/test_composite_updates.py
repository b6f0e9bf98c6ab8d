"""The composite is computed when inputs it depends on have changed, once, and at no other time."""

import pytest

from fmu.programmes import outputs
from support import ISS_DG, STEADY, Instance, flying, variant
from support.marks import FMI


def computed(instance: Instance) -> int:
    """Returns how often the composite has been computed."""
    return sum(category == "logComposite" for _, category, _ in instance.log)


@FMI
def test_a_value_set_again_does_not_compute_the_composite_again(fmi):
    with flying(ISS_DG, fmi) as instance:
        before = computed(instance)
        for _ in range(3):
            instance.set({"DG.mass": 24500.0, "DG.pmi": [15.5, 22.1, 7.7], "DG.nose.direction": [0, 0, -1]})
            outputs(instance)
            instance.step(0.1)
        assert computed(instance) == before


@pytest.mark.parametrize("use", ["step", "get", "both"])
@FMI
def test_changed_values_compute_the_composite_once(fmi, use):
    with flying(ISS_DG, fmi) as instance:
        before = computed(instance)
        instance.set({"DG.mass": 20000.0})
        instance.set({"DG.pmi[1]": 16.0})
        instance.set({"DG.nose.position[2]": -0.5, "DG.mass": 19000.0})
        if use != "step":
            instance.get("inertia")
            outputs(instance)
        if use != "get":
            instance.step(0.1)
            instance.step(0.1)
        assert computed(instance) == before + 1


@FMI
def test_torque_and_start_parameters_do_not_compute_the_composite(fmi):
    instance = Instance(ISS_DG, fmi)
    instance.enter()
    outputs(instance)
    before = computed(instance)
    instance.set({"torque": [1.0, 2.0, 3.0], "angular_velocity_start": [0.1, 0.2, 0.3]})
    outputs(instance)
    instance.exit()
    instance.set({"torque": [3.0, 2.0, 1.0]})
    instance.step(0.1)
    outputs(instance)
    assert computed(instance) == before
    instance.free()


@FMI
def test_outputs_that_do_not_depend_on_changed_inputs_compute_nothing(fmi):
    with flying(variant(ISS_DG, {"rotation": STEADY}), fmi) as instance:
        before = computed(instance)
        instance.set({"DG.mass": 20000.0})
        instance.get("attitude")
        instance.get("angular_velocity")
        instance.get("state.attitude")
        instance.get("state.angular_velocity")
        instance.get("der(state.attitude")
        instance.get("time")
        assert computed(instance) == before
