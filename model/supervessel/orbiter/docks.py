"""What DOCKINFO says: which ships hang together, and whether their docks make a tree."""

import re
from collections import deque
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from supervessel.orbiter.scenario import Scenario
from supervessel.orbiter.text import Place, foreign
from supervessel.problems import listed, printable, quantity, unknown

MENTION = re.compile(r"(\d{1,4}):(\d{1,4}),(\S+)", re.ASCII)
MOST_PATHS = 20
"""Loops that are told with all the ships on their way round."""


@dataclass(frozen=True)
class Mention:
    """DOCKINFO port:mate_port,mate of a ship; ports are numbered from 0."""

    ship: str
    port: int
    mate: str
    mate_port: int
    place: Place

    def __str__(self) -> str:
        return f"{self.port}:{self.mate_port},{printable(self.mate)}"

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
                where = f"{entry.place}: {quantity(ship.name)}: DOCKINFO {quantity(word)}"
                problems += foreign(entry.place, word) or [f"{where}: must be PORT:PORT,NAME"]
    return found


def assemblies(scenario: Scenario, said: Iterable[Mention]) -> list[list[str]]:
    """Returns the names of ships that hang together, in the order of the file; a free ship is alone."""
    part = {name: [name] for name in scenario.ships}
    for mention in said:
        if mention.mate in part:
            _join(part, mention.ship, mention.mate)
    order = {name: number for number, name in enumerate(scenario.ships)}
    distinct = {id(names): names for names in part.values()}
    return [sorted(names, key=order.__getitem__) for names in distinct.values()]


def _join(part: dict[str, list[str]], one: str, other: str) -> bool:
    """Makes two ships share a list of what hangs together; returns whether they did already."""
    small, large = sorted((part[one], part[other]), key=len)
    if small is large:
        return True
    large += small
    part.update(dict.fromkeys(small, large))
    return False


def docks(scenario: Scenario, members: Collection[str], said: Iterable[Mention]) -> Iterator[Mention | str]:
    """Yields the docks of an assembly, each once, and (as texts) what keeps them from making a tree."""
    part = {name: [name] for name in members}
    own = [mention for mention in said if mention.ship in part]
    confirmed = {mention.said for mention in own}
    by_ship: dict[str, list[Mention]] = {}
    for mention in own:
        by_ship.setdefault(mention.ship, []).append(mention)
    taken: dict[tuple[str, int], Mention] = {}
    joined: list[Mention] = []
    seen: set[tuple[str, int, str, int]] = set()
    loops = 0
    for mention in own:
        where = f"{mention.place}: {quantity(mention.ship)}: DOCKINFO {mention}"
        problem = _one_sided(scenario, mention, by_ship, confirmed)
        end = (mention.ship, mention.port)
        if end in taken:
            yield f"{where}: port {mention.port} is docked already, by {taken[end]}"
        elif problem:
            yield f"{where}: {problem}"
        elif mention.mirrored not in seen:
            seen.add(mention.said)
            if _join(part, mention.ship, mention.mate):
                loops += 1
                ends = [mention.ship, mention.mate]
                between = _path(joined, *ends) if loops <= MOST_PATHS else ends
                shown = listed(between, len(between), " - ")
                yield f"{where}: closes a loop; {shown} are joined already"
            else:
                joined.append(mention)
                yield mention
        taken.setdefault(end, mention)


def _one_sided(
    scenario: Scenario,
    mention: Mention,
    by_ship: Mapping[str, Sequence[Mention]],
    confirmed: set[tuple[str, int, str, int]],
) -> str:
    """Returns why the mate does not agree, or "" if it does."""
    if mention.mate not in scenario.ships:
        return unknown("vessel", mention.mate, scenario.ships)
    if mention.mate == mention.ship:
        return "a vessel cannot be docked to itself"
    if mention.mirrored in confirmed:
        return ""
    theirs = by_ship.get(mention.mate, ())
    says = f"says {listed(map(str, theirs), len(theirs))}" if theirs else "has no DOCKINFO"
    line = f" (line {theirs[0].place.line})" if theirs else ""
    return f"{quantity(mention.mate)} does not agree: it {says}{line}"


def _path(joined: Sequence[Mention], start: str, end: str) -> list[str]:
    """Returns the ships from start to end along docks, which lead there."""
    mates: dict[str, list[str]] = {}
    for dock in joined:
        mates.setdefault(dock.ship, []).append(dock.mate)
        mates.setdefault(dock.mate, []).append(dock.ship)
    before = {start: start}
    waiting = deque([start])
    while end not in before:
        here = waiting.popleft()
        for other in mates[here]:
            if other not in before:
                before[other] = here
                waiting.append(other)
    path = [end]
    while path[-1] != start:
        path.append(before[path[-1]])
    return path[::-1]
