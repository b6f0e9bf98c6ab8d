"""How attitude and angular velocity are carried on in time: the table of methods, one file each.

A method that takes steps builds them in CasADi symbols; the C layer and the twin drive what was built. A new
one is its file and its line in PROPAGATORS.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from supervessel.rotation.propagators import dop853, exact, rk4, split, taylor
from supervessel.rotation.propagators.method import Propagator
from supervessel.scene.inputs import listed

if TYPE_CHECKING:
    from supervessel.scene.schema import Scene

PROPAGATORS: dict[str, Propagator] = {
    "rk4": rk4.PROPAGATOR,
    "dop853": dop853.PROPAGATOR,
    "taylor": taylor.PROPAGATOR,
    "exact": exact.PROPAGATOR,
    "split": split.PROPAGATOR,
}
"""The methods; "auto" is a plan made of them."""


def name_of(method: Propagator) -> str:
    """Returns the name of a method of PROPAGATORS."""
    return next(name for name, row in PROPAGATORS.items() if row is method)


WHEN_FREE: dict[str, str] = {
    "never": "every_step",
    "always": "exact",
    "between kicks": "every_step",
    "while free": "while_free",
}
"""The file of fmu_build/c that asks whether a step is free motion, by `Plan.free`, without .c."""


@dataclass(frozen=True)
class Plan:
    """What a scene's co-simulation uses.

    method : whose steps it takes where free motion does not serve; None: it never does not
    free   : "never", "always", "between kicks", or "while free": for each step without torque over which the
             composite stays as it was
    """

    method: Propagator | None
    free: str

    @property
    def c_files(self) -> frozenset[str]:
        """Names, without .c and .h, of the files of fmu_build/c that this plan needs and others may not."""
        own = self.method.c_files if self.method else ()
        exact = PROPAGATORS["exact"].c_files if self.free in ("always", "while free") else ()
        return frozenset({*own, *exact, WHEN_FREE[self.free]})


def plan_of(scene: "Scene") -> Plan:
    """Returns what a scene asks for: its own method, or what "auto" stands for in it.

    Raises ValueError for a scene whose law is still to be chosen.
    """
    if not scene.is_chosen:
        raise ValueError(f'scene "{scene.name}" leaves its law to [accuracy]; supervessel.choose finds it')
    name = scene.rotation.propagator
    if name != "auto":
        chosen = PROPAGATORS[name]
        return Plan(chosen if chosen.build else None, chosen.free)
    if scene.wheels or scene.inputs.gravity:
        return Plan(PROPAGATORS[stepping(scene)], "never")
    if not any(listed(dict(scene.inputs))):
        return Plan(None, "always")
    return Plan(PROPAGATORS[stepping(scene)], "while free")


def stepping(scene: "Scene") -> str:
    """Returns the name of the method that "auto" takes where the motion is not free."""
    reason = PROPAGATORS["taylor"].reason_against(scene.rotation.law, dict(scene.inputs), bool(scene.wheels))
    return "dop853" if reason else "taylor"


def description(scene: "Scene") -> str:
    """Returns what a scene's propagator does, HTML."""
    chosen = plan_of(scene)
    if chosen.free != "while free":
        return (chosen.method or PROPAGATORS["exact"]).text
    assert chosen.method is not None
    return (
        "A step without torque, before which the composite has not changed, is exact free motion: "
        f"{PROPAGATORS['exact'].text} Any other step: {chosen.method.text}"
    )
