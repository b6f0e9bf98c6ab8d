"""Changes of inputs in the twin where a stage on the way has no mass."""

from typing import Any

import casadi as ca
import numpy as np
import pytest

from changes.histories import ByFmu, ByTwin, Values
from changes.scenes import MIR
from supervessel import Twin
from support import DISCARD, EPS, Instance, scene, variant
from twin.scenes import numbers

# A hub without mass: as one ship leaves and another arrives, at one instant, nothing is there in between.
HUB: dict[str, Any] = variant(
    MIR,
    {
        "name": "hub",
        "vessels.Mir.mass": 0.0,
        "vessels.other": MIR["vessels"]["DG"] | {"mass": 12000.0},
        "docks": [
            {"ports": ["Mir.side", "DG.nose"], "name": "berth", "docked": True},
            {"ports": ["Mir.fore", "other.nose"], "name": "front", "docked": False},
        ],
        "inputs": {"docked": ["berth", "front"], "mass": ["Mir", "DG"], "pose": ["Mir.side"]},
        "rotation.mass_change": "momentum",
        "rotation.pose_change": "momentum",
    },
)
SWAP: Values = {"berth.docked": 0.0, "front.docked": 1.0}
MOVE: Values = {"Mir.side.position[1]": 15.0}
# Both add a momentum of rounding, some ten u of the largest, and divide by a tensor: its moments are 5 apart.
RATE_ERROR = 100 * EPS


def test_ships_may_swap_at_a_hub_without_mass() -> None:
    fmu, twin = ByFmu(HUB), ByTwin(HUB)
    for flown in (fmu, twin):
        flown.set(SWAP)
    assert (
        np.abs(twin.angular_velocity - fmu.angular_velocity).max()
        <= RATE_ERROR * np.abs(twin.angular_velocity).max()
    )


def test_a_change_that_the_fmu_refuses_at_a_hub_without_mass_is_nan() -> None:
    twin, instance = ByTwin(HUB), Instance(HUB)
    assert instance.initialise() == 0
    assert instance.set(SWAP | MOVE) == 0
    assert instance.get_status("angular_velocity") == DISCARD
    assert "between the changes of docks, masses and poses mass = 0 kg" in instance.messages()[-1]
    twin.set(SWAP | MOVE)
    assert np.isnan(twin.angular_velocity).all()


@pytest.mark.parametrize("mode", ["forward", "reverse"])
@pytest.mark.parametrize("inputs", [SWAP, {}], ids=["swap", "nothing"])
def test_derivatives_by_the_rate_at_a_hub_without_mass_are_those_of_differences(
    inputs: Values, mode: str
) -> None:
    twin = Twin(scene(HUB))
    p_next = twin.p_with(inputs)
    x, direction = ca.SX.sym("x", 7), np.arange(1.0, 8.0)
    end = twin.change(x, twin.p_start, p_next)
    product = ca.jtimes(end, x, direction, mode == "reverse")
    found = numbers(ca.Function("d", [x], [product])(twin.x_start))

    def moved(size: float) -> np.ndarray:
        changed = [twin.x_start + size * row for row in np.vstack([np.eye(7), -np.eye(7)])]
        ends = np.array([numbers(twin.change.call([at, twin.p_start, p_next])[0]) for at in changed])
        return (ends[:7] - ends[7:]).T / (2.0 * size)

    jacobian = moved(1e-3)  # the change is linear in x: differences are off by rounding alone
    expected = jacobian @ direction if mode == "forward" else jacobian.T @ direction
    assert np.abs(found - expected).max() <= 1e3 * RATE_ERROR * np.abs(expected).max()


def test_derivatives_by_masses_are_those_of_differences_where_nothing_changes() -> None:
    twin = Twin(scene(HUB))
    p_next, i = ca.SX.sym("p_next", len(twin.p_names)), twin.p_names.index("DG.mass")
    end = twin.change(twin.x_start, twin.p_start, p_next)
    found = numbers(ca.Function("d", [p_next], [ca.jacobian(end, p_next[i])])(twin.p_start))
    more, less = (
        numbers(twin.change(twin.x_start, twin.p_start, twin.p_with({"DG.mass": 24500.0 + s})))
        for s in (1.0, -1.0)
    )
    assert np.abs(found).max() > 0.0
    # the rate goes with a power of the mass between 0 and -2: its third derivative times 1 kg squared over 6
    error = 4.0 / 24500.0**2 + EPS * 24500.0
    assert np.abs(found - (more - less) / 2.0).max() <= error * np.abs(found).max()
