"""Orbiter's scenario files: the ships, their lines, and which of them has the focus.

A ship's lines are read by the code of its class, if it has some, which leaves to Orbiter what it does not
know itself. Blocks of lines in them, a line that opens and a line that closes, are that code's alone.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from supervessel.orbiter.text import Place, ScenarioError, read_lines
from supervessel.problems import printable, quantity

KEYS = frozenset({"STATUS", "RPOS", "AROT", "VROT", "PRPLEVEL", "FUEL", "DOCKINFO", "ATTACHED"})
"""Keys of a ship that are read; a ship has each at most once."""

LEVELS = frozenset({"PRPLEVEL", "FUEL"})
"""Keys that say how full tanks are."""

OPENING = (
    (re.compile(r"BEGIN_(.+)"), r"END_\1"),
    (re.compile(r"(.+)_BEGIN"), r"\1_END"),
    (re.compile(r"@(?!END)(.+)"), r"@END\1"),
    (re.compile(r"<(?!/)([^>]+)>?"), r"</\1>"),
)
"""Keys in capitals that open a block, and the key that closes it. So do KEY or KEY: and a line END KEY."""

LEVELS_OF_CODE = LEVELS | {"TANK"}
"""Keys in blocks that say how full tanks are, of Orbiter's own Dragonfly the last one."""


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
    """A vessel of a scenario; its class is its name where the scenario gives none.

    entries  : its own lines
    code     : lines in blocks of its class's code, each with the line that opens the block
    unclosed : a line that begins like a block but has no end, after which there are lines with KEYS; None
               where there is none
    """

    name: str
    class_name: str
    place: Place
    entries: tuple[Entry, ...]
    code: tuple[tuple[Entry, Entry], ...] = ()
    unclosed: Entry | None = None

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
    own, code, unclosed = _blocks(entries)
    first: dict[str, Entry] = {}
    for entry in own:
        if entry.key in first and entry.key in KEYS:
            before = first[entry.key].place.line
            problems.append(
                f"{entry.place}: {entry.key} of {quantity(name)} is there already, in line {before}; "
                "is an END missing?"
            )
        first.setdefault(entry.key, entry)
    yield Ship(name, class_name or name, place, tuple(own), tuple(code), unclosed)


def _blocks(entries: Sequence[Entry]) -> tuple[list[Entry], list[tuple[Entry, Entry]], Entry | None]:
    """Returns a ship's own lines, those in blocks, and the line that leaves open which are which: see `Ship`.

    A line with words after its key that no line closes is one of its own: it gives a value.
    """
    last = {_closed_by(entry): place for place, entry in enumerate(entries)}
    own: list[Entry] = []
    code: list[tuple[Entry, Entry]] = []
    opened: Entry | None = None
    unclosed: Entry | None = None
    place = 0
    while place < len(entries):
        entry = entries[place]
        closing, end = _closing(entry.key), _end_of_block(entries, place, last)
        if end > place:
            code += [(entry, inner) for inner in entries[place + 1 : end]]
            place = end + 1
            continue
        if closing and not entry.words:
            opened = opened or entry
        elif entry.key in KEYS:
            unclosed = unclosed or opened
        own.append(entry)
        place += 1
    return own, code, unclosed


def _end_of_block(entries: Sequence[Entry], begin: int, last: Mapping[str, int]) -> int:
    """Returns the place of the line that closes the block which a line opens; `begin` where it opens none.

    last : where each line that closes a block stands last
    A block that begins within it and ends behind its end belongs to it.
    """
    end = _own_end(entries, begin, last)
    place = begin + 1
    while place < end:
        end = max(end, _own_end(entries, place, last))
        place += 1
    return end


def _own_end(entries: Sequence[Entry], begin: int, last: Mapping[str, int]) -> int:
    """Returns the same, whatever begins in the block."""
    key = entries[begin].key
    lines = (_closing(key), "" if key in KEYS else f"END {key.rstrip(':')}")
    found = next((line for line in lines if line and last.get(line, -1) > begin), "")
    return _end(entries, begin, found) if found else begin


def _closed_by(entry: Entry) -> str:
    """Returns what a line is called where it closes a block: its key, or END and the first word after it."""
    return f"END {entry.words[0].upper()}" if entry.key == "END" and entry.words else entry.key


def _closing(key: str) -> str:
    """Returns the key of the line that closes a block, "" for a key that opens none."""
    for opening, closing in OPENING:
        match = opening.fullmatch(key)
        if match:
            return match.expand(closing)
    return ""


def _end(entries: Sequence[Entry], begin: int, closing: str) -> int:
    """Returns the place of the line that closes a block; blocks of the same name may be within it.

    Where one of those has no end, that is the last line that closes one.
    """
    depth = end = 0
    for place in range(begin, len(entries)):
        closes = _closed_by(entries[place]) == closing
        depth += (entries[place].key == entries[begin].key) - closes
        end = place if closes else end
        if depth == 0:
            break
    return end
