"""Orbiter's scenario files: the ships, their lines, and which of them has the focus."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from supervessel.orbiter.text import Place, ScenarioError, read_lines
from supervessel.problems import printable, quantity

KEYS = frozenset({"STATUS", "RPOS", "AROT", "VROT", "PRPLEVEL", "FUEL", "DOCKINFO", "ATTACHED"})
"""Keys of a ship that are read; a ship has each at most once."""


@dataclass(frozen=True)
class Entry:
    """A line of a ship: its place, its key in capitals and the words after it."""

    place: Place
    key: str
    words: tuple[str, ...]

    def __str__(self) -> str:
        return printable(" ".join((self.key, *self.words)))


@dataclass(frozen=True)
class Ship:
    """A vessel of a scenario; its class is its name where the scenario gives none."""

    name: str
    class_name: str
    place: Place
    entries: tuple[Entry, ...]

    def entry(self, key: str) -> Entry | None:
        """Returns the line with a key, None if there is none."""
        return next((entry for entry in self.entries if entry.key == key), None)

    @property
    def landed(self) -> bool:
        status = self.entry("STATUS")
        return status is not None and status.words[:1] != () and status.words[0].upper() == "LANDED"


@dataclass(frozen=True)
class Scenario:
    """Ships by name, in the order of the file, and the name of the one that has the focus, or ""."""

    path: Path
    focus: str
    ships: dict[str, Ship]


def read_scenario(path: Path) -> Scenario:
    """Returns what a scenario file says of its ships. Raises ScenarioError with every problem of its form."""
    lines = read_lines(path)
    problems: list[str] = []
    focus = next((text.split(maxsplit=1) for _, text in _block(path, lines, "FOCUS", [])), [])
    ships: dict[str, Ship] = {}
    for ship in _ships(path, _block(path, lines, "SHIPS", problems), problems):
        if ship.name in ships:
            before = ships[ship.name].place.line
            problems.append(f"{ship.place}: {quantity(ship.name)} is there already, in line {before}")
        ships.setdefault(ship.name, ship)
    if problems:
        raise ScenarioError(problems)
    name = focus[1] if len(focus) == 2 and focus[0].upper() == "SHIP" else ""
    return Scenario(path, name, ships)


def _block(path: Path, lines: Sequence[str], name: str, problems: list[str]) -> list[tuple[int, str]]:
    """Returns the lines, numbered, between BEGIN_name and END_name that are not empty."""
    shown = printable(str(path))
    capitals = [line.upper() for line in lines]
    if f"BEGIN_{name}" not in capitals:
        problems.append(f"{shown}: has no BEGIN_{name}")
        return []
    begin = capitals.index(f"BEGIN_{name}")
    if f"END_{name}" not in capitals[begin:]:
        problems.append(f"{shown}:{begin + 1}: BEGIN_{name} without END_{name}")
        return []
    end = capitals.index(f"END_{name}", begin)
    return [(i + 1, lines[i]) for i in range(begin + 1, end) if lines[i]]


def _ships(path: Path, block: list[tuple[int, str]], problems: list[str]) -> Iterator[Ship]:
    """Yields the ships of a block NAME:CLASS, lines, END, NAME:CLASS ..."""
    head: tuple[int, str] | None = None
    entries: list[Entry] = []
    for number, text in block:
        place = Place(path, number)
        if head is None:
            head, entries = (number, text), []
        elif text.upper() == "END":
            yield from _ship(Place(path, head[0]), head[1], entries, problems)
            head = None
        else:
            key, *words = text.split()
            entries.append(Entry(place, key.upper(), tuple(words)))
    if head is not None:
        problems.append(f"{Place(path, head[0])}: {quantity(head[1])} without END")


def _ship(place: Place, head: str, entries: list[Entry], problems: list[str]) -> Iterator[Ship]:
    name, _, class_name = (part.strip() for part in head.partition(":"))
    if not name or head.split(maxsplit=1)[0].upper() in KEYS:
        problems.append(f"{place}: {quantity(head)}: must be NAME or NAME:CLASS of a vessel")
        return
    first: dict[str, Entry] = {}
    for entry in entries:
        if entry.key in first and entry.key in KEYS:
            before = first[entry.key].place.line
            problems.append(
                f"{entry.place}: {entry.key} of {quantity(name)} is there already, in line {before}; "
                "is an END missing?"
            )
        first.setdefault(entry.key, entry)
    yield Ship(name, class_name or name, place, tuple(entries))
