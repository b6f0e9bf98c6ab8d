"""Values that cannot be, at run time: refused by name wherever they are judged, the state kept."""

from collections.abc import Callable
from ctypes import c_double

import numpy as np
import pytest

from changes.histories import Values, elements
from changes.scenes import TUG, brought, lead
from fmu.saved_states import bytes_of, restore
from support import DISCARD, EPS, INF, NAN, OK, Instance, refusal, variant
from support.marks import FMI

# With a second vessel on the tank, and places at which docks cannot be closed.
YARD = variant(
    TUG,
    {
        "name": "yard",
        "vessels.pod": {
            "mass": 50.0,
            "pmi": [0.2, 0.3, 0.4],
            "ports": {
                "one": {"position": [0.5, 0, 0], "direction": [1, 0, 0], "alignment": [0, 1, 0]},
                "two": {"position": [-0.5, 0, 0], "direction": [-1, 0, 0], "alignment": [0, 1, 0]},
            },
        },
        "vessels.tank.ports.side": {"position": [0, 1, 0], "direction": [0, 1, 0], "alignment": [0, 0, 1]},
        "vessels.tank.ports.back": {"position": [0, -1, 0], "direction": [0, -1, 0], "alignment": [0, 0, 1]},
        "docks": [
            *TUG["docks"],
            {"ports": ["tank.side", "pod.one"], "name": "pair"},
            {"ports": ["tank.back", "pod.two"], "name": "again", "docked": False},
            {"ports": ["tug.top", "pod.two"], "name": "grip", "docked": False},
        ],
        "inputs.docked": ["held", "stowed", "pair", "again", "grip"],
        "inputs.mass": ["tank", "tug"],
        "inputs.pose": ["tug.arm", "pod.one"],
        "inputs.motion": ["tug.arm"],
        "rotation.mass_change": "rate",
    },
)
LOOSE = {"held.docked": 0.0}
TOO_FAST = elements("tug.arm.velocity", (1e300, 0.0, 1e300))
BAD: dict[str, tuple[Values, str]] = {
    "occupied": (LOOSE | {"grip.docked": 1.0, "stowed.docked": 1.0}, "port tug.top is docked already"),
    "loop": ({"stowed.docked": 1.0}, "stowed.docked = true: tug.top - tank.far closes a loop"),
    "loop through another": ({"grip.docked": 1.0}, "grip.docked = true: tug.top - pod.two closes a loop"),
    "both sides in the part": (
        {"again.docked": 1.0},
        "again.docked = true: tank.back - pod.two closes a loop",
    ),
    "loop in what is detached": (LOOSE | {"again.docked": 1.0}, "again.docked = true: tank.back - pod.two"),
    "negative mass": ({"tug.mass": -1.0}, "tug.mass = -1 kg: must be >= 0"),
    "negative mass detached": (LOOSE | {"tank.mass": -1.0}, "tank.mass = -1 kg: must be >= 0"),
    "no mass": (LOOSE | {"tug.mass": 0.0}, "mass = 0 kg: the total of all vessels must be finite and > 0"),
    "zero direction": (elements("pod.one.direction", (0, 0, 0)), "pod.one.direction = (0, 0, 0): must have"),
    "zero direction detached": (
        LOOSE | elements("pod.one.direction", (0, 0, 0)),
        "pod.one.direction = (0, 0, 0): must have a length greater than 0",
    ),
    "too fast": (TOO_FAST, "the ports that move give the vessels ("),
}
AT_CONTACT = {"stowed.docked": 1.0, "held.docked": 0.0} | elements("stowed.velocity", (1e308, 1e308, 0.0))


def exit_initialisation(instance: Instance) -> int:
    return instance.exit()


def step(instance: Instance) -> int:
    return instance.step(0.25)


def update(instance: Instance) -> int:
    return instance.update_discrete_states()


def leave_event_mode(instance: Instance) -> int:
    return instance._status(instance.fmu.enterContinuousTimeMode)


def read(instance: Instance) -> int:
    return instance.get_status("angular_velocity")


def rates(instance: Instance) -> int:
    fmu = instance.fmu
    return instance._status(
        fmu.getContinuousStateDerivatives if instance.fmi == 3 else fmu.getDerivatives, (c_double * 7)(), 7
    )


def directional(instance: Instance) -> int:
    return instance._status(instance.directional, ["mass"], ["tank.mass"], [1.0])


JUDGES = [
    ("cs initialising", exit_initialisation, (2, 3)),
    ("cs initialising", read, (2, 3)),
    ("cs stepping", step, (2, 3)),
    ("cs stepping", read, (2, 3)),
    ("cs stepping", directional, (2, 3)),
    ("events event", update, (3,)),
    ("me event", update, (2, 3)),
    ("me event", leave_event_mode, (2, 3)),
    ("me event", read, (2, 3)),
    ("me event", rates, (2, 3)),
    ("me continuous", rates, (2, 3)),
]
CASES = pytest.mark.parametrize(
    ("place", "judge", "fmi"),
    [(place, judge, fmi) for place, judge, versions in JUDGES for fmi in versions],
    ids=lambda value: getattr(value, "__name__", str(value)),
)


def status_of(place: str, judge: Callable[[Instance], int], fmi: int) -> int:
    """Returns the status of a refused value; FMI 2.0 has Discard where an importer's solver reads."""
    return DISCARD if place.startswith("me") and judge in (read, rates) else refusal(fmi)


def held(instance: Instance) -> list[float]:
    """Returns what an instance holds that no input sets."""
    return [*instance.get("attitude"), *instance.get("angular_velocity"), instance.get("time")]


def refused(
    instance: Instance, judge: Callable[[Instance], int], wrong: Values, words: str, status: int
) -> None:
    """Asserts that a call refuses values by name, keeps the state and works once they are set back."""
    kept, back = held(instance), {name: instance.get(name) for name in wrong}
    assert instance.set(wrong) == OK
    assert judge(instance) == status
    assert words in instance.messages()[-1]
    assert instance.set(back) == OK
    assert held(instance) == kept
    assert judge(instance) == OK


@CASES
def test_what_cannot_be_is_discarded_by_name_and_the_same_call_works_after(place, judge, fmi):
    moving = judge is rates and place == "me continuous"
    for wrong, words in BAD.values():
        if moving and any(
            name in wrong for name in ("held.docked", "again.docked", "stowed.docked", "grip.docked")
        ):
            continue
        instance = brought(place, fmi, YARD)
        refused(instance, judge, wrong, words if not moving else words[:3], status_of(place, judge, fmi))
        instance.free()


@pytest.mark.parametrize("kind", BAD)
def test_a_refusal_stays_one_after_reset_and_in_a_restored_state(kind):
    wrong, words = BAD[kind]
    first = brought("cs stepping", 3, YARD)
    assert first.set(wrong) == OK
    content = bytes_of(first)
    other = Instance(YARD)
    assert restore(other, content) == OK
    for instance in (first, other):
        instance.time = 0.5
        assert step(instance) == DISCARD
        assert words in instance.messages()[-1]
    assert first.reset() == OK
    lead(first, "cs", "stepping")
    refused(first, step, wrong, words, DISCARD)
    for instance in (first, other):
        instance.free()


def test_a_pending_change_goes_with_a_serialised_state():
    coming = (
        AT_CONTACT | elements("stowed.velocity", (0.1, -0.2, 0.3)) | elements("stowed.rate", (0.1, 0.2, 0))
    )
    first, other = brought("cs stepping", 3, YARD), Instance(YARD)
    assert first.set(coming) == OK
    assert restore(other, bytes_of(first)) == OK
    other.time = first.time
    assert first.get("angular_velocity").tolist() == other.get("angular_velocity").tolist()
    for instance in (first, other):
        assert step(instance) == OK
    assert held(first) == held(other)
    for instance in (first, other):
        instance.free()


@CASES
def test_a_docking_that_leaves_no_finite_rate_names_the_dock(place, judge, fmi):
    if "initialising" in place or "continuous" in place:
        return  # docks are closed at the start, and stay as they are in continuous time
    instance = brought(place, fmi, YARD)
    words = "stowed.docked = true with this motion leaves angular_velocity = ("
    refused(instance, judge, AT_CONTACT, words, status_of(place, judge, fmi))
    instance.free()


@FMI
def test_a_docking_at_a_rate_that_no_step_can_follow_is_discarded(fmi):
    instance = brought("cs stepping", fmi, YARD)
    too_fast = AT_CONTACT | elements("stowed.velocity", (1e300, 0.0, 0.0))
    refused(instance, step, too_fast, "sub-steps", DISCARD)
    instance.free()


@FMI
@pytest.mark.parametrize("value", [NAN, INF, -INF])
@pytest.mark.parametrize(
    "name", ["stowed.velocity[1]", "stowed.rate[3]", "tug.arm.velocity[2]", "tug.arm.rate[1]"]
)
def test_a_motion_that_is_no_number_is_not_stored(name, value, fmi):
    instance = brought("cs stepping", fmi, YARD)
    assert instance.set({"tank.mass": 1.0, name: value}) == DISCARD
    assert f"{name} = " in instance.messages()[-1]
    assert "must be finite" in instance.messages()[-1]
    assert (instance.get(name), instance.get("tank.mass")) == (0.0, 400.0)
    assert instance.set({name: 0.25}) == OK
    assert step(instance) == OK
    instance.free()


# A hub without mass whose ship leaves as another comes.
HUB = variant(
    TUG,
    {
        "name": "hub",
        "vessels.tug.mass": 0.0,
        "vessels.pod": {
            "mass": 50.0,
            "pmi": [0.2, 0.3, 0.4],
            "ports": {"one": {"position": [0.5, 0, 0], "direction": [1, 0, 0], "alignment": [0, 1, 0]}},
        },
        "docks": [
            {"ports": ["tug.arm", "tank.end"], "name": "held"},
            {"ports": ["tug.top", "pod.one"], "name": "other", "docked": False},
        ],
        "inputs.docked": ["held", "other"],
    },
)
EXCHANGED = {"held.docked": 0.0, "other.docked": 1.0}


@FMI
def test_ships_change_places_at_a_hub_without_mass(fmi):
    instance = brought("cs stepping", fmi, HUB)
    omega = instance.get("angular_velocity")
    contact = elements("other.rate", (0.1, -0.2, 0.3))
    assert instance.set(EXCHANGED | contact) == OK
    # What comes is all there is: it keeps its own rate, given relative to a hub that turns with omega.
    expected = omega + np.array([0.1, -0.2, 0.3])
    assert np.abs(instance.get("angular_velocity") - expected).max() <= 64 * EPS
    assert step(instance) == OK
    instance.free()


@FMI
def test_momentum_cannot_be_kept_across_a_hub_without_mass(fmi):
    instance = brought("cs stepping", fmi, HUB)
    moved = elements("tug.arm.position", (2.0, 0.0, 0.0))
    kept = held(instance)
    assert instance.set(EXCHANGED | moved) == OK
    assert step(instance) == refusal(fmi)
    assert "between the changes of docks, masses and poses mass = 0 kg" in instance.messages()[-1]
    assert instance.set(elements("tug.arm.position", (3.0, 0.5, 0.0))) == OK
    assert held(instance)[:4] == kept[:4]
    assert step(instance) == OK
    instance.free()
