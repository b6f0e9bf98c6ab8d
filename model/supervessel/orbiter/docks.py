"""What DOCKINFO says: which ships hang together, and whether their docks make a tree."""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from supervessel.orbiter.scenario import Scenario
from supervessel.orbiter.text import Place
from supervessel.problems import quantity, unknown

MENTION = re.compile(r"(\d{1,4}):(\d{1,4}),(\S+)", re.ASCII)


@dataclass(frozen=True)
class Mention:
    """DOCKINFO port:mate_port,mate of a ship; ports are numbered from 0."""

    ship: str
    port: int
    mate: str
    mate_port: int
    place: Place

    def __str__(self) -> str:
        return f"{self.port}:{self.mate_port},{self.mate}"

    @property
    def mirrored(self) -> tuple[str, int, str, int]:
        """What the mate has to say."""
        return self.mate, self.mate_port, self.ship, self.port

    @property
    def said(self) -> tuple[str, int, str, int]:
        return self.ship, self.port, self.mate, self.mate_port


def mentions(scenario: Scenario, problems: list[str]) -> list[Mention]:
    """Returns what every ship says of its docks; what cannot be read goes to `problems`."""
    found = []
    for ship in scenario.ships.values():
        entry = ship.entry("DOCKINFO")
        for word in entry.words if entry else ():
            match = MENTION.fullmatch(word)
            assert entry is not None
            if match:
                port, mate_port, mate = int(match[1]), int(match[2]), match[3]
                found.append(Mention(ship.name, port, mate, mate_port, entry.place))
            else:
                problems.append(
                    f"{entry.place}: {quantity(ship.name)}: DOCKINFO {quantity(word)}: must be PORT:PORT,NAME"
                )
    return found


def assemblies(scenario: Scenario, said: Iterable[Mention]) -> list[list[str]]:
    """Returns the names of ships that hang together, in the order of the file; a free ship is alone."""
    part = {name: [name] for name in scenario.ships}
    for mention in said:
        if mention.mate in part and part[mention.mate] is not part[mention.ship]:
            joined = part[mention.ship] + part[mention.mate]
            for name in joined:
                part[name] = joined
    order = list(scenario.ships)
    distinct = {id(names): sorted(names, key=order.index) for names in part.values()}
    return list(distinct.values())


def docks(scenario: Scenario, members: Sequence[str], said: Iterable[Mention]) -> Iterator[Mention | str]:
    """Yields the docks of an assembly, each once, and (as texts) what keeps them from making a tree."""
    own = [mention for mention in said if mention.ship in members]
    confirmed = {mention.said for mention in own}
    taken: dict[tuple[str, int], Mention] = {}
    joined: list[Mention] = []
    closing: list[Mention] = []
    for mention in own:
        where = f"{mention.place}: {quantity(mention.ship)}: DOCKINFO {mention}"
        problem = _one_sided(scenario, mention, own, confirmed)
        end = (mention.ship, mention.port)
        if end in taken:
            yield f"{where}: port {mention.port} is docked already, by {taken[end]}"
        elif problem:
            yield f"{where}: {problem}"
        elif mention.mirrored not in (dock.said for dock in joined + closing):
            between = _path(joined, mention.ship, mention.mate)
            if between:
                closing.append(mention)
                yield f"{where}: closes a loop; {' - '.join(between)} are joined already"
            else:
                joined.append(mention)
                yield mention
        taken.setdefault(end, mention)


def _one_sided(
    scenario: Scenario,
    mention: Mention,
    own: Sequence[Mention],
    confirmed: set[tuple[str, int, str, int]],
) -> str:
    """Returns why the mate does not agree, or "" if it does."""
    if mention.mate not in scenario.ships:
        return unknown("vessel", mention.mate, scenario.ships)
    if mention.mate == mention.ship:
        return "a vessel cannot be docked to itself"
    if mention.mirrored in confirmed:
        return ""
    theirs = [other for other in own if other.ship == mention.mate]
    says = f"says {', '.join(map(str, theirs))}" if theirs else "has no DOCKINFO"
    line = f" (line {theirs[0].place.line})" if theirs else ""
    return f"{quantity(mention.mate)} does not agree: it {says}{line}"


def _path(joined: Sequence[Mention], start: str, end: str) -> list[str]:
    """Returns the ships from start to end along docks, [] where none leads there."""
    paths = {start: [start]}
    waiting = [start]
    while waiting:
        here = waiting.pop(0)
        for dock in joined:
            for one, other in ((dock.ship, dock.mate), (dock.mate, dock.ship)):
                if one == here and other not in paths:
                    paths[other] = [*paths[here], other]
                    waiting.append(other)
    return paths.get(end, [])
