"""Vessel classes: Orbiter's .cfg files, and tables of the vessels that exist only in its code."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from supervessel.orbiter.text import Place, ScenarioError, foreign, numbers, read_lines, unread
from supervessel.problems import listed, printable, quantity, unknown
from supervessel.scene.numbers import is_number
from supervessel.shell.reading import ReadingError, read_toml

TABLE_KEYS = (
    "empty_mass",
    "propellant",
    "pmi",
    "size",
    "dock",
    "source",
    "passenger_mass",
    "gravity_gradient_damping",
)
"""Keys of a class in a table; the last three are not used."""

COMPLETE = ("empty_mass", "propellant", "pmi", "dock")
"""Keys of a single ship beside which nothing of its class is needed."""

MOST_PORTS = 100
MOST_TANKS = 100
"""Docking ports and tanks that a class may have: every ship of the class has each of them."""

LONG_AGO = ("DockRef", "DockDir", "DockRot")
"""Keys of the one docking port of old .cfg files; it comes before those of the list."""

USED = re.compile("mass|inertia|size|maxfuel|module|baseclass|dockref|dockdir|dockrot|propellantresource.*")
"""Keys of .cfg files that are read, in small letters."""


@dataclass(frozen=True)
class ClassPort:
    """A docking port: position [m], outward direction and alignment, Orbiter's left-handed vessel axes."""

    position: tuple[float, float, float]
    direction: tuple[float, float, float]
    alignment: tuple[float, float, float]
    place: Place


@dataclass(frozen=True)
class VesselClass:
    """What a class says of a vessel.

    empty_mass : [kg]
    pmi        : mass-normalised moments, (3,) [m2]
    tanks      : what each holds when full [kg], in the order of PRPLEVEL
    fallback   : why the moments are a guess, "" where they are given
    module     : the code that may change all this, "" where there is none or the numbers are the code's
    sections   : the table's sections that it is from, as keys of `section_place`
    """

    empty_mass: float
    mass_place: Place
    pmi: tuple[float, float, float]
    pmi_place: Place
    fallback: str
    tanks: tuple[float, ...]
    ports: tuple[ClassPort, ...]
    module: str = ""
    sections: tuple[str, ...] = ()


@dataclass(frozen=True)
class Library:
    """Where classes are looked for, by their names in small letters: a table, which goes first, and files.

    table : name -> key and table of each section of that name: of a single ship or of a class
    files : folder -> last part of a name -> the parts of the whole name and the .cfg file
    """

    table_path: Path | None
    table: Mapping[str, Sequence[tuple[str, Any]]]
    files: Mapping[Path, Mapping[str, Sequence[tuple[tuple[str, ...], Path]]]]


def read_library(folders: Sequence[Path], table: Path | None) -> Library:
    """Returns what folders and a table offer. Raises ScenarioError where one of them cannot be read."""
    problems: list[str] = []
    classes: dict[str, list[tuple[str, Any]]] = {}
    if table is not None:
        try:
            for key, value in read_toml(table).items():
                classes.setdefault(key.casefold(), []).append((key, value))
        except ReadingError as error:
            problems += unread(table, error).problems
    files = {}
    for folder in folders:
        if folder.is_dir():
            files[folder] = _class_files(folder)
        else:
            problems.append(f"{printable(str(folder))}: is no folder that can be read")
    if problems:
        raise ScenarioError(problems)
    return Library(table, classes, files)


def _class_files(folder: Path) -> dict[str, list[tuple[tuple[str, ...], Path]]]:
    """Returns the .cfg files below a folder as `Library` has them."""
    found: dict[str, list[tuple[tuple[str, ...], Path]]] = {}
    for file in sorted(path for path in folder.rglob("*") if path.suffix.lower() == ".cfg"):
        own = tuple(part.casefold() for part in file.relative_to(folder).with_suffix("").parts)
        found.setdefault(own[-1], []).append((own, file))
    return found


def section_key(library: Library, name: str) -> str:
    """Returns the key of the table's section of a name, in any case; "" where it has none."""
    keys = [key for key, _ in library.table.get(name.casefold(), ())]
    return name if name in keys else next(iter(keys), "")


def find_class(library: Library, ship: str, name: str, asked: str) -> VesselClass:
    """Returns the class of a ship, by the names of both, in any case; `asked` says who needs it.

    The table's section of the ship goes first; what it does not give is that of the class, if there is one.
    Raises ScenarioError with what is missing or wrong.
    """
    key = section_key(library, ship)
    if not key or key == section_key(library, name):
        found = _class(library, name, asked)
        if found is None:
            raise ScenarioError([_nowhere(library, name, asked)])
        return found
    table = dict(library.table[key.casefold()])[key]
    known = isinstance(table, dict) and all(one in table for one in COMPLETE)
    of_class = None if known else _class(library, name, asked)
    try:
        return _from_table(section_place(library, key), table, of_class)
    except ScenarioError as error:
        lost = [] if known or of_class else [_nowhere(library, name, asked)]
        raise ScenarioError([*error.problems, *lost]) from None


def section_place(library: Library, key: str) -> Place:
    """Returns where a section of the table stands, by its key."""
    assert library.table_path is not None
    return Place(library.table_path, key=f"[{printable(key)}]")


def _class(library: Library, name: str, asked: str) -> VesselClass | None:
    """Returns the class of a name, in any case, None where it is nowhere.

    Below a folder the file is, first of all, Vessels/NAME.cfg, then NAME.cfg, then any other.
    Raises ScenarioError with what is missing or wrong.
    """
    key = section_key(library, name)
    if key:
        return _from_table(section_place(library, key), dict(library.table[key.casefold()])[key])
    parts = tuple(re.split(r"[\\/]", name.casefold()))
    for files in library.files.values():
        ranked: dict[int, list[Path]] = {}
        for own, file in files.get(parts[-1], ()):
            if own[-len(parts) :] == parts:
                rank = {("vessels", *parts): 0, parts: 1}.get(own, 2)
                ranked.setdefault(rank, []).append(file)
        found = ranked[min(ranked)] if ranked else []
        if len(found) > 1:
            several = listed(map(str, found), len(found), " and in ")
            raise ScenarioError([f"{asked}: class {quantity(name)} is in {several}"])
        if found:
            return _from_cfg(found[0])
    return None


def _nowhere(library: Library, name: str, asked: str) -> str:
    searched = [printable(str(library.table_path))] if library.table_path else []
    searched += [f"the .cfg files below {printable(str(folder))}" for folder in library.files]
    where = " or ".join(searched) or "any file: neither --config FOLDER nor --table FILE.toml is given"
    return f"{asked}: class {quantity(name)} is not in {where}"


def _from_cfg(path: Path) -> VesselClass:
    """Returns the class of a .cfg file. The first line with a key counts, as in Orbiter."""
    values: dict[str, tuple[Place, str]] = {}
    ports: list[tuple[Place, str]] = []
    inside = ""
    for number, line in enumerate(read_lines(path), start=1):
        word = line.upper()
        if inside:
            if word == f"END_{inside}":
                inside = ""
            elif inside == "DOCKLIST" and line:
                ports.append((Place(path, number), line))
        elif word.startswith("BEGIN_"):
            inside = word.removeprefix("BEGIN_")
        elif "=" in line:
            key, _, value = line.partition("=")
            key = key.strip().casefold()
            if USED.fullmatch(key):
                values.setdefault(key, (Place(path, number), value.strip()))
    strange = [problem for line in (*values.values(), *ports) for problem in foreign(*line)]
    if strange:
        raise ScenarioError(strange)
    shown = printable(str(path))
    problems = [f"{shown}: BEGIN_{printable(inside)} without END_{printable(inside)}"] if inside else []
    ports = [] if inside else ports
    made = _class_of_values(path, values, ports, problems)
    if made is None or problems:
        raise ScenarioError(problems)
    return made


def _class_of_values(
    path: Path,
    values: Mapping[str, tuple[Place, str]],
    lines: Sequence[tuple[Place, str]],
    problems: list[str],
) -> VesselClass | None:
    def read(key: str, count: int, allowed: str) -> tuple[float, ...] | None:
        """Returns the numbers of a key, none of them negative, None where there are none."""
        if key.casefold() not in values:
            return None
        place, text = values[key.casefold()]
        found = numbers(text.split(), count)
        if found is None or min(found) < 0.0:
            problems.append(f"{place}: {key} = {quantity(text)}: must be {allowed}")
            return None
        return found

    shown = printable(str(path))
    if "baseclass" in values:
        place, text = values["baseclass"]
        problems.append(f"{place}: BaseClass = {quantity(text)} is not followed; give the class by --table")
    mass = read("Mass", 1, "a number >= 0 (kg)")
    pmi, size = read("Inertia", 3, "three numbers >= 0 (m2)"), read("Size", 1, "a number >= 0 (m)")
    if "mass" not in values:
        module = f", its module {quantity(values['module'][1])} has it" if "module" in values else ""
        problems.append(f"{shown}: no Mass{module}; give the class by --table")
    elif "inertia" not in values and "size" not in values:
        problems.append(f"{shown}: neither Inertia nor Size, from which Orbiter would guess it")
    tanks = _tanks(values, problems)
    problems += _too_many(shown, len(lines), len(tanks))
    ports = _old_port(values, problems) + [p for p in (_port(*line, problems) for line in lines) if p]
    if mass is None or (pmi is None and size is None):
        return None
    moments = _moments(pmi, size, values["inertia" if pmi is not None else "size"][0])
    module = values["module"][1] if "module" in values else ""
    return VesselClass(mass[0], values["mass"][0], *moments, tuple(tanks), tuple(ports), module)


def _too_many(place: str, ports: int, tanks: int) -> Iterator[str]:
    for kind, count, most in (("docking ports", ports, MOST_PORTS), ("tanks", tanks, MOST_TANKS)):
        if count > most:
            yield f"{place}: {count} {kind}; a class has at most {most}"


def _moments(
    pmi: Sequence[float] | None, size: Sequence[float] | None, place: Place
) -> tuple[tuple[float, float, float], Place, str]:
    """Returns moments, their place, and why they are a guess: (2 s, 2 s, s) of the size s [m]."""
    if pmi is not None:
        x, y, z = pmi
        return (x, y, z), place, ""
    assert size is not None
    s = float(size[0])
    return (2.0 * s, 2.0 * s, s), place, f"no Inertia: Orbiter's guess (2 s, 2 s, s) from the size s = {s} m"


def _tanks(values: Mapping[str, tuple[Place, str]], problems: list[str]) -> list[float]:
    """Returns what the tanks hold: PropellantResource1, 2 ... (an efficiency may follow), or MaxFuel."""
    tanks: list[float] = []
    keys: list[str] = []
    while f"propellantresource{len(keys) + 1}" in values:
        keys.append(f"PropellantResource{len(keys) + 1}")
    for key in keys or [key for key in ("MaxFuel",) if key.casefold() in values]:
        place, text = values[key.casefold()]
        words = text.split()
        found = numbers(words, len(words)) if len(words) in (1, 2) else None
        if found is None or found[0] < 0.0:
            problems.append(f"{place}: {key} = {quantity(text)}: must be a number >= 0 (kg)")
        else:
            tanks.append(found[0])
    return tanks


def _old_port(values: Mapping[str, tuple[Place, str]], problems: list[str]) -> list[ClassPort]:
    """Returns the port of DockRef, DockDir and DockRot, if all of them are there."""
    if not all(key.casefold() in values for key in LONG_AGO):
        return []
    place = values[LONG_AGO[0].casefold()][0]
    port = _port(place, " ".join(values[key.casefold()][1] for key in LONG_AGO), problems)
    return [port] if port else []


def _port(place: Place, line: str, problems: list[str]) -> ClassPort | None:
    """Returns the port of a line: position, direction, alignment; what follows is not used."""
    found = numbers(line.split()[:9], 9)
    if found is None:
        problems.append(
            f"{place}: {quantity(line)}: must begin with nine numbers: position, direction, rotation"
        )
        return None
    return _port_of(found, place)


def _port_of(nine: Sequence[float], place: Place) -> ClassPort:
    px, py, pz, dx, dy, dz, ax, ay, az = nine
    return ClassPort((px, py, pz), (dx, dy, dz), (ax, ay, az), place)


def _from_table(place: Place, table: Any, of_class: VesselClass | None = None) -> VesselClass:
    """Returns the class that a section of a table describes. Raises ScenarioError with every problem.

    of_class : what the section does not give; None: nothing
    """
    if not isinstance(table, dict):
        raise ScenarioError([f"{place}: must be a table"])
    problems = [f"{place}: {unknown('key', key, TABLE_KEYS)}" for key in table if key not in TABLE_KEYS]

    def read(key: str, count: int | None, allowed: str) -> tuple[float, ...] | None:
        """Returns the numbers >= 0 of a key, None where there are none; a count of 0 is a single number."""
        if key not in table:
            return None
        value = [table[key]] if count == 0 else table[key]
        fits = isinstance(value, list) and (not count or len(value) == count)
        if not (fits and all(is_number(x) and x >= 0 for x in value)):
            problems.append(f"{place} {key} = {quantity(table[key])}: must be {allowed}")
            return None
        return tuple(map(float, value))

    mass = read("empty_mass", 0, "a number >= 0 (kg)")
    tanks = read("propellant", None, "a list of numbers >= 0 (kg)") or ()
    pmi, size = read("pmi", 3, "three numbers >= 0 (m2)"), read("size", 0, "a number >= 0 (m)")
    ports = _table_ports(place, table.get("dock", []), problems)
    problems += _too_many(str(place), len(ports), len(tanks))
    sized = "pmi" in table or "size" in table
    if of_class is None:
        problems += [] if "empty_mass" in table else [f"{place}: empty_mass is missing"]
        problems += [] if sized else [f"{place}: neither pmi nor size"]
    if problems:
        raise ScenarioError(problems)
    given: dict[str, Any] = {}
    if mass is not None:
        given |= {"empty_mass": mass[0], "mass_place": _at(place, "empty_mass")}
    if sized:
        moments = _moments(pmi, size, _at(place, "size" if pmi is None else "pmi"))
        given |= dict(zip(("pmi", "pmi_place", "fallback"), moments, strict=True))
    given |= {"tanks": tanks} if "propellant" in table or of_class is None else {}
    given |= {"ports": tuple(ports)} if "dock" in table or of_class is None else {}
    own = (place.key,) if given else ()  # a section that gives nothing is not used
    given["sections"] = (*own, *(of_class.sections if of_class else ()))
    return replace(of_class, **given) if of_class else VesselClass(**given)


def _at(place: Place, key: str) -> Place:
    return Place(place.path, key=f"{place.key} {key}")


def _table_ports(place: Place, rows: Any, problems: list[str]) -> list[ClassPort]:
    if not isinstance(rows, list):
        problems.append(f"{place} dock = {quantity(rows)}: must be a list of ports, nine numbers each")
        return []
    ports = []
    for number, row in enumerate(rows):
        here = _at(place, f"dock, port {number}")
        if isinstance(row, list) and len(row) == 9 and all(map(is_number, row)):
            ports.append(_port_of([float(x) for x in row], here))
        else:
            problems.append(f"{here} = {quantity(row)}: must be nine numbers: position, direction, rotation")
    return ports
