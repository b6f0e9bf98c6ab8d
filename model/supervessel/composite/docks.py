"""Docks and mounts as a graph: rigid groups of vessels, and the ways by which they hang on the root."""

from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from supervessel.scene.inputs import part_of, vessel_of
from supervessel.scene.numbers import triangle_problem
from supervessel.scene.schema import Dock, Mount, Scene

MOST_WAYS = 64
"""Most ways by which a vessel may hang on the root. Each way has a pose of its own in the equations."""


MOST_WAYS_IN_ALL = 2000
MOST_PASSED = 50_000
"""Most ways of all vessels together, each a pose in the equations; most docks with an input on all these ways
together, each a factor in the equations."""


class TooManyWaysError(ValueError):
    """A vessel may hang on the root in more than MOST_WAYS ways, or all of them in too many."""


@dataclass(frozen=True)
class Joint:
    """A mated pair of ports, or a mount, seen from the root: the parent is placed before the child.

    parent_port, child_port : names of the ports in their vessels, "" for a mount
    dock                    : name of the input that closes it; None: always closed
    mount                   : the scene's mount; its parent may be the child here. None for a pair of ports
    """

    parent: str
    parent_port: str
    child: str
    child_port: str
    dock: str | None = None
    mount: Mount | None = None

    @property
    def ports(self) -> tuple[str, str]:
        """Names of the two ports, "vessel.port", the parent's first; not of a mount."""
        return f"{self.parent}.{self.parent_port}", f"{self.child}.{self.child_port}"


@dataclass(frozen=True)
class VesselGroup:
    """Vessels that mounts hold together, and docks that are always closed and whose ports have no pose input.

    reference : the vessel whose axes are those of the group
    joints    : the joints to its other vessels, parents first
    """

    reference: str
    joints: tuple[Joint, ...]

    @property
    def vessels(self) -> tuple[str, ...]:
        """Names of its vessels, the reference first."""
        return (self.reference, *(joint.child for joint in self.joints))


@dataclass(frozen=True, eq=False)
class Way:
    """A path of joints from the root to a group, which holds the group while every dock on it is closed.

    group  : number of the group at its end
    joint  : last joint of the path; None for the root's own group
    before : the way to the group of that joint's parent; None for the root's own group
    """

    group: int
    joint: Joint | None = None
    before: "Way | None" = None

    @property
    def docks(self) -> tuple[str, ...]:
        """Names of the docks on the way that inputs close, from the root on."""
        names = [way.joint.dock for way in self._backwards() if way.joint and way.joint.dock]
        return tuple(reversed(names))

    def passes(self, group: int) -> bool:
        """Whether the way leads over or to a group, given by its number."""
        return any(way.group == group for way in self._backwards())

    @property
    def legs(self) -> list[tuple[int, str, str | None]]:
        """The groups on the way, from the root's on: number, vessel where the way comes in, and where it
        leaves.

        The way comes into the root's own group nowhere, "", and leaves its last group nowhere, None.
        """
        leaves: str | None = None
        legs = []
        for way in self._backwards():
            legs.append((way.group, way.joint.child if way.joint else "", leaves))
            leaves = way.joint.parent if way.joint else None
        return legs[::-1]

    @property
    def joints(self) -> list[Joint]:
        """The joints between the groups on the way, from the root on."""
        return [way.joint for way in self._backwards() if way.joint is not None][::-1]

    def _backwards(self) -> "Iterator[Way]":
        """Yields this way, then those before it."""
        way: Way | None = self
        while way is not None:
            yield way
            way = way.before


def joints(scene: Scene) -> Iterator[Joint]:
    """Yields mounts and docks closed at the start: every parent is the root or an earlier one's child."""
    return _spread(scene.root, _neighbours(scene, [dock for dock in scene.docks if dock.docked]))


def groups(scene: Scene) -> tuple[VesselGroup, ...]:
    """Returns the rigid groups, the root's own first, in the order in which they hang on it."""
    moving = set(scene.inputs.pose)
    rigid = [d for d in scene.docks if not switchable(scene, d) and not moving.intersection(d.ports)]
    rigidly, somehow = _neighbours(scene, rigid), _neighbours(scene, scene.docks)
    found: list[VesselGroup] = []
    taken: set[str] = set()
    for vessel in (scene.root, *(joint.child for joint in _spread(scene.root, somehow))):
        if vessel not in taken:
            found.append(VesselGroup(vessel, tuple(_spread(vessel, rigidly))))
            taken.update(found[-1].vessels)
    return tuple(found)


def ways(scene: Scene, parts: Sequence[VesselGroup]) -> list[list[Way]]:
    """Returns of each group the ways by which it may hang on the root, shortest first.

    parts : the groups, as `groups` returns them
    Raises TooManyWaysError beyond MOST_WAYS, MOST_WAYS_IN_ALL or MOST_PASSED.
    """
    home = {vessel: number for number, part in enumerate(parts) for vessel in part.vessels}
    neighbours = _neighbours(scene, scene.docks)
    found: list[list[Way]] = [[] for _ in parts]
    waiting = deque([Way(0)])
    count = passed = 0
    while waiting:
        way = waiting.popleft()
        found[way.group].append(way)
        count, passed = count + 1, passed + len(way.docks)
        if count > MOST_WAYS_IN_ALL or passed > MOST_PASSED:
            raise TooManyWaysError(
                f"docks: the vessels may hang on the root in more than {MOST_WAYS_IN_ALL} ways in all, or in "
                f"ways over more than {MOST_PASSED} docks; at most that many are possible"
            )
        if len(found[way.group]) > MOST_WAYS:
            raise TooManyWaysError(
                f"docks: {parts[way.group].reference} may hang on the root in more than {MOST_WAYS} ways; "
                "at most that many are possible"
            )
        for vessel in parts[way.group].vessels:
            for joint in neighbours.get(vessel, []):
                group = home[joint.child]
                if not way.passes(group):
                    waiting.append(Way(group, joint, way))
    return found


@dataclass(frozen=True, eq=False)
class Crossing:
    """A way that leads over a dock.

    way      : the way
    vessels  : of the group at its end, those beyond the dock
    forwards : whether it leads from the dock's first port to its second one
    """

    way: Way
    vessels: frozenset[str]
    forwards: bool


def crossings(scene: Scene, dock: Dock, hanging: Iterable[Sequence[Way]]) -> list[Crossing]:
    """Returns the ways that lead over a dock, with the vessels beyond it.

    hanging : of each group, the ways by which it may hang on the root
    """
    parts, first = groups(scene), part_of(dock.ports[0])[0]
    cut, every_way = _cut(parts, dock), [way for own in hanging for way in own]
    if cut is None:
        return [
            Crossing(way, frozenset(parts[way.group].vessels), joint.parent == first)
            for way in every_way
            for joint in way.joints
            if set(joint.ports) == set(dock.ports)
        ]
    found = (_over_cut(scene, parts, cut, way, first in cut.beyond) for way in every_way)
    return [crossing for crossing in found if crossing is not None]


def _over_cut(
    scene: Scene, parts: Sequence[VesselGroup], cut: "_Cut", way: Way, first_is_beyond: bool
) -> Crossing | None:
    """Returns how a way leads over a dock inside a rigid group, None where it does not.

    first_is_beyond : whether the vessel of the dock's first port is in `cut.beyond`
    """
    everyone = frozenset(parts[way.group].vessels)
    for group, comes_in, leaves in way.legs:
        if group != cut.group:
            continue
        begins_beyond = (comes_in or scene.root) in cut.beyond
        forwards = begins_beyond is first_is_beyond
        if leaves is None:
            far = everyone - cut.beyond if begins_beyond else everyone & cut.beyond
            return Crossing(way, far, forwards)
        if (leaves in cut.beyond) is not begins_beyond:
            return Crossing(way, everyone, forwards)
    return None


@dataclass(frozen=True)
class _Cut:
    """A dock inside a rigid group: the group's number, and its vessels on one side of the dock."""

    group: int
    beyond: frozenset[str]


def _cut(parts: Sequence[VesselGroup], dock: Dock) -> _Cut | None:
    """Returns where a dock cuts a rigid group in two; None: it joins two groups."""
    for number, part in enumerate(parts):
        beyond: set[str] = set()
        for joint in part.joints:  # parents first
            if set(joint.ports) == set(dock.ports) or joint.parent in beyond:
                beyond.add(joint.child)
        if beyond:
            return _Cut(number, frozenset(beyond))
    return None


def switchable(scene: Scene, dock: Dock) -> bool:
    """Whether an input opens and closes a dock."""
    return dock.name is not None and dock.name in scene.inputs.docked


def alone_as_given(scene: Scene) -> bool:
    """Whether the root's moments differ, by Orbiter's convention, while nothing is docked to it.

    Alone it has its moments as they stand, docked those of its six points: the same where a rigid body can
    have them.
    Source: [EQ] Orbiter.
    """
    pmi = scene.vessels[scene.root].pmi
    if scene.convention != "orbiter" or pmi is None:
        return False
    same = scene.root not in scene.inputs.pmi and not triangle_problem(pmi)
    return not same and may_be_alone(scene)


def may_be_alone(scene: Scene) -> bool:
    """Whether nothing is joined to the root, or nothing but by docks that inputs open."""
    mounted = any(scene.root in (mount.parent, mount.child) for mount in scene.mounts)
    return not mounted and all(switchable(scene, dock) for dock in docks_of_root(scene))


def docks_of_root(scene: Scene) -> list[Dock]:
    """Returns the docks that have a port of the root."""
    return [dock for dock in scene.docks if scene.root in map(vessel_of, dock.ports)]


def _neighbours(scene: Scene, docks: Sequence[Dock]) -> dict[str, list[Joint]]:
    """Returns by vessel the joints that start from it, one for each of its docks, then of its mounts.

    docks : those that count; all mounts do
    """
    neighbours: dict[str, list[Joint]] = {}
    for dock in docks:
        name = dock.name if switchable(scene, dock) else None
        for here, there in (dock.ports, dock.ports[::-1]):
            (parent, parent_port), (child, child_port) = part_of(here), part_of(there)
            joint = Joint(parent, parent_port, child, child_port, name)
            neighbours.setdefault(parent, []).append(joint)
    for mount in scene.mounts:
        for parent, child in ((mount.parent, mount.child), (mount.child, mount.parent)):
            neighbours.setdefault(parent, []).append(Joint(parent, "", child, "", mount=mount))
    return neighbours


def _spread(start: str, neighbours: Mapping[str, Sequence[Joint]]) -> Iterator[Joint]:
    """Yields joints from a vessel outwards, parents first: one joint to each vessel that is reached.

    neighbours : by vessel, the joints that start from it
    """
    placed, waiting = {start}, deque([start])
    while waiting:
        for joint in neighbours.get(waiting.popleft(), ()):
            if joint.child not in placed:
                placed.add(joint.child)
                waiting.append(joint.child)
                yield joint
