"""From a scenario of Orbiter and its vessels' data to the text of a scene file, or every reason why not."""

import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from supervessel.loading import parse_scene
from supervessel.orbiter.classes import (
    ClassPort,
    Library,
    VesselClass,
    find_class,
    read_library,
    section_key,
    section_place,
)
from supervessel.orbiter.docks import Mention, assemblies, docks, mentions
from supervessel.orbiter.scenario import KEYS, LEVELS, LEVELS_OF_CODE, Entry, Scenario, Ship, read_scenario
from supervessel.orbiter.start import saved_motion, start_of
from supervessel.orbiter.text import Note, Place, ScenarioError, foreign, numbers
from supervessel.orbiter.writing import Assembled, Member, Start, scene_text
from supervessel.problems import SceneError, few_suggestions, listed, printable, quantity, unknown
from supervessel.scene.consistency import direction_problems
from supervessel.scene.names import MOST_VESSELS
from supervessel.scene.numbers import triangle_problem
from supervessel.scene.schema import Convention, Scene

LEVEL = re.compile(r"(\d{1,4}):(\S+)", re.ASCII)
MOST_UNUSED = 100
"""Sections of a table that are named as not used; of the others the number is told."""

ATTACHED = re.compile(r"\d+:\d+,(\S+)", re.ASCII)


@dataclass(frozen=True)
class Imported:
    """The text of a scene file, what was missing, guessed or left out, and the files that it is from."""

    text: str
    notes: tuple[str, ...]
    sources: tuple[Path, ...]


@few_suggestions()
def import_scenario(
    scenario: str | Path,
    vessel: str = "",
    config: Sequence[str | Path] = (),
    table: str | Path | None = None,
    convention: Convention | None = None,
) -> Imported:
    """Returns the scene file of an assembly in a scenario.

    vessel     : a ship of the assembly, which becomes the root; "": the one that has the focus
    config     : folders with the .cfg files of vessel classes, at any depth
    table      : TOML file of single ships, which go before their classes, and of classes that exist only in
                 Orbiter's code, which go before the .cfg files
    convention : of the scene; None: "orbiter" where a vessel's moments ask for it, else "rigid_body"
    Raises ScenarioError with every problem found, each with file and line.
    """
    found, library = _read(Path(scenario), [Path(c) for c in config], Path(table) if table else None)
    problems: list[str] = []
    notes: list[Note] = []
    said = mentions(found, problems)
    parts = assemblies(found, said)
    try:
        root = _root(found, vessel, parts)
    except ScenarioError as error:
        raise ScenarioError([*problems, *error.problems]) from None
    names = next(part for part in parts if root in part)
    names = [root, *(name for name in names if name != root)]
    if len(names) > MOST_VESSELS:
        where = printable(str(found.path))
        raise ScenarioError(
            [f"{where}: {len(names)} vessels are docked; at most {MOST_VESSELS} are possible"]
        )
    strange = _foreign(found, names)
    if strange:
        raise ScenarioError(dict.fromkeys([*problems, *strange]))
    mated: list[Mention] = []
    for dock in docks(found, names, said):
        problems.append(dock) if isinstance(dock, str) else mated.append(dock)
    classes = _classes(found, names, library, problems)
    for name in (name for name in names if name not in classes):
        _levels(found.ships[name], problems)  # what is wrong with them is told all the same
    members = _members(found, mated, classes, problems, notes)
    key = _convention(members, convention, problems, notes)
    notes += _doubts(found, members)
    saved = {name: saved_motion(found.ships[name], problems) for name in names}
    if problems:
        raise ScenarioError(dict.fromkeys(problems))
    draft = Assembled(found, root, members, mated, key, [])
    start, more = start_of(_checked(draft, Start()), draft, saved)
    notes += [*more, *_unused(library, members)]  # those that say least come last
    final = Assembled(found, root, members, mated, key, notes)
    _checked(final, start)
    sources = dict.fromkeys([found.path, *(member.of.mass_place.path for member in members.values())])
    return Imported(scene_text(final, start), tuple(map(str, final.notes)), tuple(sources))


def _foreign(found: Scenario, names: Sequence[str]) -> list[str]:
    """Returns what is not UTF-8 in the lines that are used of ships, or why they cannot be told."""
    problems = []
    for ship in (found.ships[name] for name in names):
        problems += foreign(ship.place, f"{ship.name}:{ship.class_name}")
        for entry in (entry for entry in ship.entries if entry.key in KEYS):
            problems += foreign(entry.place, " ".join(entry.words))
        if ship.unclosed:
            begins = f"{ship.unclosed.place}: {ship.unclosed} in {quantity(ship.name)} begins a block"
            problems.append(f"{begins} without end; which lines after it are the vessel's own cannot be told")
    return problems


def _members(
    found: Scenario,
    mated: Sequence[Mention],
    classes: Mapping[str, VesselClass],
    problems: list[str],
    notes: list[Note],
) -> dict[str, Member]:
    """Returns the ships of the assembly whose classes are known, by name."""
    used = _used_ports(found, mated, classes, problems)
    members = {}
    for name, made in classes.items():
        mass, full, origin = _masses(
            found.ships[name], made, _levels(found.ships[name], problems), problems, notes
        )
        ports = _usable_ports(found.ships[name], made, used[name], problems, notes)
        members[name] = Member(found.ships[name], made, mass, full, origin, ports)
    return members


def _read(path: Path, folders: Sequence[Path], table: Path | None) -> tuple[Scenario, Library]:
    """Returns scenario and library. Raises ScenarioError with the problems of both."""
    problems: list[str] = []
    scenario = library = None
    try:
        scenario = read_scenario(path)
    except ScenarioError as error:
        problems += error.problems
    try:
        library = read_library(folders, table)
    except ScenarioError as error:
        problems += error.problems
    if scenario is None or library is None:
        raise ScenarioError(problems)
    return scenario, library


def _root(scenario: Scenario, vessel: str, parts: Sequence[Sequence[str]]) -> str:
    """Returns the name of the root. Raises ScenarioError where it cannot be told."""
    name = vessel or scenario.focus
    where = printable(str(scenario.path))
    docked = [listed(part, len(part), " + ") for part in parts if len(part) > 1]
    offer = f"; docked are {listed(docked, len(docked), '; ')}" if docked else "; no vessels are docked"
    if not name:
        raise ScenarioError([f"{where}: names no focus vessel; give one by --vessel{offer}"])
    if name not in scenario.ships:
        which = "" if vessel else "focus "
        raise ScenarioError([f"{where}: {unknown(which + 'vessel', name, scenario.ships)}{offer}"])
    if not vessel and not any(name in part and len(part) > 1 for part in parts):
        focus = f"the focus vessel {quantity(name)} is not docked"
        raise ScenarioError([f"{where}: {focus}; give one by --vessel{offer}"])
    return name


def _classes(
    scenario: Scenario, names: Sequence[str], library: Library, problems: list[str]
) -> dict[str, VesselClass]:
    """Returns the classes of ships by their names, without those that cannot be had: each is told once."""
    found: dict[tuple[str, str], VesselClass | None] = {}
    classes: dict[str, VesselClass] = {}
    for name in names:
        ship = scenario.ships[name]
        which = (section_key(library, name), ship.class_name)
        if which not in found:
            try:
                found[which] = find_class(library, name, ship.class_name, f"{ship.place}: {quantity(name)}")
            except ScenarioError as error:
                found[which] = None
                problems += error.problems
        made = found[which]
        if made is not None:
            classes[name] = made
    return classes


def _used_ports(
    scenario: Scenario, mated: Sequence[Mention], classes: Mapping[str, VesselClass], problems: list[str]
) -> dict[str, set[int]]:
    """Returns the numbers of the docked ports of each ship that its class has."""
    used: dict[str, set[int]] = {name: set() for name in classes}
    for dock in mated:
        for name, port in ((dock.ship, dock.port), (dock.mate, dock.mate_port)):
            count = len(classes[name].ports) if name in classes else port + 1
            if port >= count:
                has = f"ports 0 to {count - 1}" if count > 1 else "port 0 only" if count else "no ports"
                class_name = quantity(scenario.ships[name].class_name)
                problems.append(
                    f"{dock.place}: {quantity(dock.ship)}: DOCKINFO {dock}: {quantity(name)} has no port "
                    f"{port}; class {class_name} has {has}"
                )
            elif name in used:
                used[name].add(port)
    return used


def _usable_ports(
    ship: Ship, made: VesselClass, docked: set[int], problems: list[str], notes: list[Note]
) -> dict[int, ClassPort]:
    """Returns the ports by number; what no scene can have is a problem where it is docked, else left out."""
    usable = {}
    for number, port in enumerate(made.ports):
        directions = {"direction": port.direction, "alignment": port.alignment}
        wrong = [
            f"port {number}.{key} = {quantity(value)}: must have a length greater than 0"
            for key, value in directions.items()
            if not any(value)
        ]
        wrong = wrong or list(direction_problems(f"port {number}", directions))
        if not wrong:
            usable[number] = port
        elif number in docked:
            problems += [f"{port.place}: {problem}" for problem in wrong]
        else:
            notes.append(Note(port.place, f"{wrong[0]}; free on {quantity(ship.name)}, left out"))
    return usable


@dataclass(frozen=True)
class Levels:
    """How full the tanks are, from 0 to 1: `given` by number, `others` for the rest; what says so."""

    entry: Entry | None
    given: Mapping[int, float]
    others: float


def _levels(ship: Ship, problems: list[str]) -> Levels:
    """Returns what PRPLEVEL or FUEL says, the later of the two; without either tanks are full."""
    known = [entry for entry in ship.entries if entry.key in LEVELS]
    if not known:
        return Levels(None, {}, 1.0)
    entry = known[-1]
    if entry.key == "FUEL":
        return Levels(entry, {}, _fraction(entry, entry.words, problems))
    given: dict[int, float] = {}
    for word in entry.words:
        match = LEVEL.fullmatch(word)
        if match is None:
            problems.append(f"{entry.place}: PRPLEVEL {quantity(word)}: must be TANK:LEVEL")
        elif int(match[1]) in given:
            problems.append(f"{entry.place}: PRPLEVEL {printable(word)}: tank {match[1]} has a level already")
        else:
            given[int(match[1])] = _fraction(entry, [match[2]], problems)
    return Levels(entry, given, 0.0)


def _masses(
    ship: Ship, made: VesselClass, levels: Levels, problems: list[str], notes: list[Note]
) -> tuple[float, float, str]:
    """Returns the mass of a ship, that with full tanks [kg], and where its propellant is from."""
    entry, count = levels.entry, len(made.tanks)
    if entry is None and count:
        notes.append(Note(ship.place, f"{quantity(ship.name)} has neither PRPLEVEL nor FUEL: taken as full"))
    elif entry is not None and entry.key == "PRPLEVEL":
        gone = sorted(set(levels.given) - set(range(count)))
        if gone:
            has = f"tanks 0 to {count - 1}" if count > 1 else "tank 0 only" if count else "no tanks"
            whose = f"class {quantity(ship.class_name)} of {quantity(ship.name)} has {has}"
            which = f"tank{'s' if len(gone) > 1 else ''} {listed(map(str, gone), len(gone))}"
            notes.append(Note(entry.place, f"PRPLEVEL of {which}: {whose}; not used"))
        for tank in sorted(set(range(count)) - set(levels.given)):
            text = f"{quantity(ship.name)} has no level of tank {tank}: taken as empty"
            notes.append(Note(entry.place, text))
    elif entry is not None and not count:
        whose = f"class {quantity(ship.class_name)} of {quantity(ship.name)} has no tanks"
        notes.append(Note(entry.place, f"FUEL: {whose}; not used"))
    loaded = sum(tank * levels.given.get(i, levels.others) for i, tank in enumerate(made.tanks))
    full = sum(made.tanks)
    said = f"{entry.place.short}: {entry}" if entry else "neither PRPLEVEL nor FUEL: full"
    of = f"propellant {loaded:.10g} of {full:.10g} kg ({said})" if made.tanks else "no propellant"
    return made.empty_mass + loaded, made.empty_mass + full, of


def _fraction(entry: Entry, words: Sequence[str], problems: list[str]) -> float:
    level = numbers(words, 1)
    if level is None or not 0.0 <= level[0] <= 1.0:
        problems.append(
            f"{entry.place}: {entry.key} {printable(' '.join(words))}: a level must be a number from 0 to 1"
        )
        return 0.0
    return level[0]


def _convention(
    members: Mapping[str, Member], asked: Convention | None, problems: list[str], notes: list[Note]
) -> str:
    """Returns why the scene has the key `convention = "orbiter"`, "" where it has not."""
    broken = []
    for name, member in members.items():
        problem = triangle_problem(member.of.pmi)
        if problem:
            broken.append(Note(member.of.pmi_place, f"moments of {quantity(name)}: {problem}"))
    if asked == "rigid_body":
        problems += map(str, broken)
    elif asked is None and broken:
        hence = 'hence convention = "orbiter", which keeps no products of inertia'
        notes += [Note(note.place, f"{note.text}; {hence}") for note in broken]
        return "Some moments are those of no rigid body, see above. To fly a rigid one, mend them."
    return "Asked for: Orbiter's own numbers, without products of inertia." if asked == "orbiter" else ""


def _doubts(scenario: Scenario, members: Mapping[str, Member]) -> Iterator[Note]:
    """Yields which moments are guessed, and what may belong to the masses and is not read."""
    for ship in scenario.ships.values():
        entry = ship.entry("ATTACHED")
        match = ATTACHED.fullmatch(entry.words[0]) if entry and entry.words else None
        if entry and match and match[1] in members and ship.name not in members:
            attached = f"{quantity(ship.name)} is attached to {quantity(match[1])}"
            yield Note(entry.place, f"{attached}: attachments are not read, its mass is in no vessel")
    for name, member in members.items():
        if member.of.fallback:
            yield Note(member.of.pmi_place, f"moments of {quantity(name)}: {member.of.fallback}")
        if member.of.module:
            yield Note(
                member.of.mass_place,
                f"class {quantity(member.ship.class_name)} has code of its own, module "
                f"{quantity(member.of.module)}, which may change what its file says",
            )
        yield from _levels_of_code(member.ship)
        for entry in (*member.ship.entries, *(inner for _, inner in member.ship.code)):
            if "MASS" in (entry.key, *(word.upper() for word in entry.words)):
                yield Note(entry.place, f"{entry}: a line for the code of {quantity(name)}, not read")


def _levels_of_code(ship: Ship) -> Iterator[Note]:
    """Yields where blocks of a ship's code hold levels too: the first one of each block."""
    own = next((entry for entry in reversed(ship.entries) if entry.key in LEVELS), None)
    counts = f"the vessel's own is in line {own.place.line}" if own else "the vessel has none of its own"
    seen: set[Place] = set()
    for opening, entry in ship.code:
        if entry.key in LEVELS_OF_CODE and opening.place not in seen:
            seen.add(opening.place)
            whose = f"a level in the block {opening} of the code of {quantity(ship.name)}"
            yield Note(entry.place, f"{entry}: {whose}, not read; {counts}")


def _unused(library: Library, members: Mapping[str, Member]) -> Iterator[Note]:
    """Yields which sections of the table give no number, and what may be meant otherwise than it is taken."""
    used = {section for member in members.values() for section in member.of.sections}
    by_class = {member.ship.class_name.casefold() for member in members.values()}
    unused = []
    for key, _ in (section for sections in library.table.values() for section in sections):
        place = section_place(library, key)
        if place.key not in used:
            unused.append(place)
    for name, member in members.items():
        key = section_key(library, name)
        if key and name.casefold() in by_class - {member.ship.class_name.casefold()}:
            text = f"taken for the vessel {quantity(name)}, and for the class of this name as well"
            yield Note(section_place(library, key), text)
    yield from (
        Note(place, "not used: no vessel of the assembly takes a number from it")
        for place in unused[:MOST_UNUSED]
    )
    if len(unused) > MOST_UNUSED:
        yield Note(
            unused[MOST_UNUSED], f"not used, and {len(unused) - MOST_UNUSED - 1} more sections after it"
        )


def _checked(parts: Assembled, start: Start) -> Scene:
    """Returns the scene that a text makes. Raises ScenarioError where it makes none."""
    try:
        return parse_scene(tomllib.loads(scene_text(parts, start)))
    except SceneError as error:
        made = f"{printable(str(parts.scenario.path))}: the scene made of it"
        raise ScenarioError(f"{made}: {problem}" for problem in error.problems) from None
