"""Problems of names in a scene: unknown or ill-formed names, docks and mounts that make no tree of vessels.

The raw tables of a file are checked, so that a wrong name is reported beside a wrong number.
"""

import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import combinations
from typing import Any

from supervessel.problems import listed, printable, quantity, toml_key, unknown
from supervessel.scene.inputs import InputKind, by_group, kinds, part_of, rows_by_key, vessel_of
from supervessel.scene.outputs import DOCK_OUTPUTS, OUTPUTS, POINT_OUTPUTS, VESSEL_OUTPUTS, WHEEL_OUTPUTS
from supervessel.scene.sheets import MOMENT_KEYS

IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
MODEL_NAME = re.compile(r"[A-Za-z](_?[A-Za-z0-9])*_?")
LONGEST_NAME = 100
"""Most letters of a name: file systems, linkers and archives take it with a prefix and a suffix."""
DEVICE = re.compile(r"(con|prn|aux|nul|(com|lpt)[0-9])", re.IGNORECASE)
"""Names that Windows keeps for devices, with any extension: no file can be called so."""

MOST_VESSELS = 2000
MOST_MOVING = 1000
MOST_LISTED = 2000
MOST_WHEELS = 1000
"""Most vessels of a scene, most inputs that move or close docks, most names in any other list of inputs, most
wheels: a scene within these limits is read in seconds."""

Ports = Mapping[str, Collection[str]]
"""By vessel, the names of its ports, of its points, or of its wheels."""

PARTS = {"ports": "port", "points": "point", "wheels": "wheel"}
"""Keys of a vessel's table that hold named parts, and what one of them is called. A name is that of one
part."""

RESERVED = frozenset(
    (
        *OUTPUTS,
        *(kind.quantity for kind in kinds() if kind.part != "shape"),
        "docked",
        "gravity",
        "time",
        "state",
        "der",
        "angular_velocity_start",
        "attitude_start",
    )
)
"""Names of the FMU's own variables, present and planned: no vessel, port, point or wheel can be called so."""


def size_problems(raw: Mapping[str, Any]) -> Iterator[str]:
    """Yields why a scene is too large to be looked at any further."""
    inputs = _table(raw, "inputs")
    lists = {f"inputs.{key}": len(_list(inputs, key)) for key in inputs}
    moving = "inputs.pose and inputs.docked"
    counts = {"vessels": len(_table(raw, "vessels")), **lists}
    counts[moving] = lists.get("inputs.pose", 0) + lists.get("inputs.docked", 0)
    wheels = "wheels of all vessels"
    counts[wheels] = sum(map(len, _parts(raw, "wheels").values()))
    limits = {"vessels": MOST_VESSELS, moving: MOST_MOVING, wheels: MOST_WHEELS}
    for place, count in counts.items():
        most = limits.get(place, MOST_LISTED)
        if count > most:
            yield f"{printable(place)}: {count} of them; at most {most} are possible"


def naming_problems(raw: Mapping[str, Any]) -> list[str]:
    """Returns what is wrong with the names of a scene, given as the raw tables of its file."""
    ports = _parts(raw, "ports")
    return [
        *_model_name(raw),
        *_identifiers(raw, ports),
        *_docks(raw, ports),
        *_inputs(raw, ports),
        *_ranges(raw),
        *misnamed_courses(raw).values(),
        *_outputs(raw, ports),
    ]


def _table(raw: Any, key: str) -> Mapping[str, Any]:
    """Returns a table, or an empty one where the file has something else there (reported elsewhere)."""
    value = raw.get(key) if isinstance(raw, Mapping) else None
    return value if isinstance(value, Mapping) else {}


def _list(raw: Any, key: str) -> list[Any]:
    value = raw.get(key) if isinstance(raw, Mapping) else None
    return list(value) if isinstance(value, list | tuple) else []


def _named(raw: Any, key: str) -> dict[str, None]:
    """Returns the names in the list under a key, each once, in their order."""
    return dict.fromkeys(name for name in _list(raw, key) if isinstance(name, str))


def _repeated(names: Iterable[str]) -> Iterator[str]:
    """Yields which names stand in a list more than once."""
    for name, count in sorted(Counter(names).items()):
        if count > 1:
            yield f"{printable(name)} is listed {count} times"


def _parts(raw: Mapping[str, Any], key: str) -> Ports:
    """Returns the names of the "ports", the "points" or the "wheels" of each vessel."""
    return {vessel: _table(table, key).keys() for vessel, table in _table(raw, "vessels").items()}


def _dock_names(raw: Mapping[str, Any]) -> dict[int, str]:
    """Returns, by number from 1, the names of the docks that have a name."""
    docks = enumerate(_list(raw, "docks"), start=1)
    names = {i: dock.get("name") for i, dock in docks if isinstance(dock, Mapping)}
    return {i: name for i, name in names.items() if isinstance(name, str)}


def _model_name(raw: Mapping[str, Any]) -> Iterator[str]:
    name = raw.get("name")
    if not isinstance(name, str):
        return
    if len(name) > LONGEST_NAME:
        yield f"name = {quantity(name)}: {_too_long(name)}"
    elif not MODEL_NAME.fullmatch(name):
        yield f"name = {quantity(name)}: must be a letter, then letters, digits and single underscores"
    elif DEVICE.fullmatch(name):
        yield f"name = {quantity(name)}: must be another: files have it, and Windows keeps it for a device"


def _too_long(name: str) -> str:
    return f"has {len(name)} characters; a name has at most {LONGEST_NAME}"


def _identifiers(raw: Mapping[str, Any], ports: Ports) -> Iterator[str]:
    if not ports and isinstance(raw.get("vessels"), Mapping):
        yield "vessels: at least one vessel is needed"
    places = [("vessels", vessel) for vessel in ports]
    for key in PARTS:
        places += [
            (f"vessels.{toml_key(vessel)}.{key}", part)
            for vessel, names in _parts(raw, key).items()
            for part in names
        ]
    places += [(f"docks[{i}].name", name) for i, name in _dock_names(raw).items()]
    for place, name in places:
        if len(name) > LONGEST_NAME:
            yield f"{place}: name {quantity(name)} {_too_long(name)}"
        elif not IDENTIFIER.fullmatch(name):
            rule = "must be a letter or underscore, then letters, digits, underscores"
            yield f"{place}: name {quantity(name)} {rule}"
        elif name in RESERVED:
            yield f'{place}: name "{name}" is reserved for a variable of the FMU'
    yield from _shared_names(raw)
    first: dict[str, int] = {}
    for i, name in _dock_names(raw).items():
        if name in ports:
            yield f'docks[{i}].name: name "{printable(name)}" is that of a vessel'
        elif first.setdefault(name, i) != i:
            yield f'docks[{i}].name: name "{printable(name)}" is that of docks[{first[name]}]'


def _shared_names(raw: Mapping[str, Any]) -> Iterator[str]:
    """Yields which names of a vessel's parts are those of two of its parts."""
    of_vessels = {key: _parts(raw, key) for key in PARTS}
    for (key, owners), (other, others) in combinations(reversed(of_vessels.items()), 2):
        for vessel, names in owners.items():
            for name in sorted(set(names).intersection(others[vessel])):
                here = printable(vessel)
                said = f'name "{printable(name)}" is that of a {PARTS[other]} of {here}'
                yield f"vessels.{here}.{key}: {said}"


def _is_port(name: str, ports: Ports) -> bool:
    vessel, _, port = name.partition(".")
    return port in ports.get(vessel, ())


def _port_problem(name: object, ports: Ports, kind: str = "port") -> str:
    """Returns why `name` is no port (or point, or wheel) of the scene, or "" if it is one."""
    if not isinstance(name, str) or name.count(".") != 1:
        return f'{quantity(name)} must be a {kind}, written "vessel.{kind}"'
    vessel, port = part_of(name)
    if vessel not in ports:
        return unknown("vessel", vessel, ports)
    if port not in ports[vessel]:
        return unknown(f"{kind} of {vessel}", port, ports[vessel])
    return ""


def _docks(raw: Mapping[str, Any], ports: Ports) -> Iterator[str]:
    """Yields problems of docks and mounts: those closed at the start must make no loop, and all of them
    together must connect every vessel with the root."""
    switched = _named(_table(raw, "inputs"), "docked")
    closed, reached = ({vessel: {vessel} for vessel in ports} for _ in range(2))
    taken: dict[str, str] = {}
    always: dict[str, str] = {}
    complete = True
    for number, dock in enumerate(_list(raw, "docks"), start=1):
        place = f"docks[{number}].ports"
        names = _list(dock, "ports")
        if not all(isinstance(name, str) for name in names) or len(names) != 2:
            complete = False
            if names and all(isinstance(name, str) for name in names):
                yield f'{place} = {quantity(dock["ports"])}: must be two ports, written "vessel.port"'
            continue
        switchable = isinstance(dock.get("name"), str) and dock["name"] in switched
        open_at_start = dock.get("docked", True) is False
        if open_at_start and not switchable:
            yield f"docks[{number}].docked = false: must be true for a dock that inputs.docked does not list"
        problems = [problem for name in names if (problem := _port_problem(name, ports))]
        yield from (f"{place}: {problem}" for problem in problems)
        occupied = always if open_at_start and switchable else taken
        yield from (
            f"{place}: port {printable(name)} is docked already, in {occupied[name]}"
            for name in names
            if name in occupied
        )
        vessels = [vessel_of(name) for name in names]
        if not all(vessel in ports for vessel in vessels):
            complete = False
        elif vessels[0] == vessels[1]:
            yield f"{place}: both ports belong to {printable(vessels[0])}; a dock joins two vessels"
        else:
            if not open_at_start and closed[vessels[0]] is closed[vessels[1]]:
                loop, joined = " - ".join(map(printable, names)), " and ".join(map(printable, vessels))
                yield f"{place}: {loop} closes a loop; {joined} are joined already"
            for component in (reached,) if open_at_start else (closed, reached):
                _join(component, vessels)
        if not open_at_start:
            taken |= dict.fromkeys(names, f"docks[{number}]")
        if not switchable:
            always |= dict.fromkeys(names, f"docks[{number}]")
    yield from _mounts(raw, ports, closed, reached)
    complete = complete and all(_joined_vessels(mount, ports) for mount in _list(raw, "mounts"))
    yield from _root(raw, reached if complete else {}, ports)


def _mounts(
    raw: Mapping[str, Any], ports: Ports, closed: dict[str, set[str]], reached: dict[str, set[str]]
) -> Iterator[str]:
    """Yields problems of the mounts; joins their vessels, in `closed` and in `reached`."""
    for number, mount in enumerate(_list(raw, "mounts"), start=1):
        place, vessels = f"mounts[{number}]", _joined_vessels(mount, ports)
        if isinstance(mount, Mapping) and "ports" in mount:
            rule = "a mount has none; ports are mated under [[docks]]"
            yield f"{place}.ports = {quantity(mount['ports'])}: {rule}"
        if not vessels:
            yield from _misnamed_vessels(place, mount, ports)
        elif vessels[0] == vessels[1]:
            yield f"{place}: parent and child are both {printable(vessels[0])}; a mount joins two vessels"
        else:
            if closed[vessels[0]] is closed[vessels[1]]:
                yield f"{place}: closes a loop; {' and '.join(map(printable, vessels))} are joined already"
            for component in (closed, reached):
                _join(component, vessels)


def _joined_vessels(mount: Any, ports: Ports) -> list[str]:
    """Returns parent and child of a mount, [] where it does not name two vessels."""
    names = [mount.get(key) for key in ("parent", "child")] if isinstance(mount, Mapping) else [None]
    return [name for name in names if isinstance(name, str)] if all(name in ports for name in names) else []


def _misnamed_vessels(place: str, mount: Any, ports: Ports) -> Iterator[str]:
    """Yields why parent and child of a mount are no vessels, where they are names."""
    for key in ("parent", "child"):
        name = mount.get(key) if isinstance(mount, Mapping) else None
        if not isinstance(name, str) or name in ports:
            continue
        if _is_port(name, ports):
            rule = "must be a vessel, and is a port; ports are mated under [[docks]]"
            yield f"{place}.{key} = {quantity(name)}: {rule}"
        else:
            yield f"{place}.{key}: {unknown('vessel', name, ports)}"


def _join(component: dict[str, set[str]], vessels: Sequence[str]) -> None:
    """Makes one of the sets of vessels, by vessel, that two vessels are in."""
    small, large = sorted((component[vessel] for vessel in vessels), key=len)
    large |= small
    component.update(dict.fromkeys(small, large))


def _root(raw: Mapping[str, Any], component: Mapping[str, set[str]], ports: Ports) -> Iterator[str]:
    root = raw.get("root")
    if not isinstance(root, str):
        return
    if root not in ports:
        yield f"root: {unknown('vessel', root, ports)}"
        return
    means = "docks or mounts" if _list(raw, "mounts") else "docks"
    for vessel, part in component.items():
        if part is not component[root]:
            yield f"vessels.{toml_key(vessel)}: is not reached from the root {printable(root)} by {means}"


def _inputs(raw: Mapping[str, Any], ports: Ports) -> Iterator[str]:
    inputs, owned = _table(raw, "inputs"), {PARTS[key]: _parts(raw, key) for key in PARTS}
    docked = {name for dock in _list(raw, "docks") for name in _named(dock, "ports")}
    all_resolved = all(_is_port(name, ports) for name in docked)
    lists = {kind.within: _named(inputs, kind.within) for kind in kinds() if kind.within}
    docks = dict.fromkeys(_dock_names(raw).values())

    def port_problem(kind: InputKind, name: str) -> str | None:
        problem = _port_problem(name, ports)
        if not problem and kind.within and name not in lists[kind.within]:
            rule = f"is not listed in inputs.{kind.within}; only a pose that is an input moves"
            return f"{printable(name)} {rule}"
        if not problem and name not in docked and all_resolved:
            return f"{printable(name)} is not docked; its pose would change nothing"
        return problem

    def vessel_problem(kind: InputKind, name: str) -> str | None:
        if name not in ports:
            return unknown("vessel", name, ports)
        table = _table(_table(raw, "vessels"), name)
        others = [key for key in MOMENT_KEYS if key in table and key != kind.given_by]
        if kind.given_by and others:
            given = f"{printable(name)} is given by {others[0]}"
            return f"{given}; only a vessel given by {kind.given_by} has this input"
        return None

    def problem_of(kind: InputKind, name: str) -> str | None:
        if kind.owner == "port":
            return port_problem(kind, name)
        if kind.owner == "dock":
            return None if name in docks else unknown("dock", name, docks)
        if kind.owner in ("point", "wheel"):
            return _port_problem(name, owned[kind.owner], kind.owner)
        return vessel_problem(kind, name)

    for key, kind in rows_by_key().items():
        names = [name for name in _list(inputs, key) if isinstance(name, str)]
        place = f"inputs.{key}"
        yield from (f"{place}: {problem}" for problem in _repeated(names))
        for name in dict.fromkeys(names):
            problem = problem_of(kind, name)
            if problem:
                yield f"{place}: {problem}"


def misnamed_courses(raw: Mapping[str, Any]) -> dict[str, str]:
    """Returns, by name, what is wrong with a name in experiment.inputs; the values are not checked here."""
    groups = by_group(_table(raw, "inputs"))
    known = dict.fromkeys(one for _, names in groups.values() for one in names)
    problems = {}
    for name, rows in _table(_table(raw, "experiment"), "inputs").items():
        if name in groups and name not in known:
            quoted = ", ".join(f'"{one}"' for one in groups[name][1])
            rule = "the elements of a vector are given one by one"
            problems[name] = f'experiment.inputs."{printable(name)}": {rule}: {quoted}'
        elif isinstance(rows, Mapping):
            rule = "the name of an input stands in quotes here"
            quoted = _quoted(name, rows)
            problems[name] = f"experiment.inputs.{printable(name)}: {rule}: {quoted} = [[time, value]]"
        elif name not in known:
            problems[name] = f"experiment.inputs: {unknown('input', name, known)}"
    return problems


def _quoted(name: str, table: Mapping[str, Any]) -> str:
    """Returns, for a message, the names in quotes that the keys of a table were meant to be part of."""
    return listed((f'"{name}.{key}"' for key in table), len(table))


def _ranges(raw: Mapping[str, Any]) -> Iterator[str]:
    inputs = _table(raw, "inputs")
    groups = {group: names for group, (kind, names) in by_group(inputs).items() if not kind.boolean}
    known = dict.fromkeys(groups)
    known |= dict.fromkeys(one for names in groups.values() for one in names)
    for name, bounds in _table(inputs, "range").items():
        if isinstance(bounds, Mapping):
            rule = "the name of an input stands in quotes here"
            yield f"inputs.range.{printable(name)}: {rule}: {_quoted(name, bounds)} = [low, high]"
        elif name not in known:
            yield f"inputs.range: {unknown('input', name, known)}"


def _outputs(raw: Mapping[str, Any], ports: Ports) -> Iterator[str]:
    names = [name for name in _list(_table(raw, "outputs"), "names") if isinstance(name, str)]
    yield from (f"outputs.names: {problem}" for problem in _repeated(names))
    docks = dict.fromkeys(_dock_names(raw).values())
    for name in dict.fromkeys(names):
        problem = (
            _part_output_problem(raw, name) if name.count(".") == 2 else _output_problem(name, ports, docks)
        )
        if problem:
            yield f"outputs.names: {problem}"


def _output_problem(name: str, ports: Ports, docks: Collection[str]) -> str:
    """Returns why "output" or one of a vessel or dock is no output of the scene, or "" if it is one."""
    owner, dot, output = name.rpartition(".")
    if not dot:
        return "" if name in OUTPUTS else unknown("output", name, OUTPUTS)
    if owner in ports:
        return "" if output in VESSEL_OUTPUTS else unknown(f"output of {owner}", output, VESSEL_OUTPUTS)
    if owner in docks:
        return "" if output in DOCK_OUTPUTS else unknown(f"output of {owner}", output, DOCK_OUTPUTS)
    if output in DOCK_OUTPUTS:
        return unknown("dock", owner, docks) + "; a dock shows its load by its name"
    return unknown("vessel", owner, ports) if output in VESSEL_OUTPUTS else unknown("output", name, OUTPUTS)


def _part_output_problem(raw: Mapping[str, Any], name: str) -> str:
    """Returns why "vessel.part.output" is no output of the scene, or "" if it is one."""
    part, _, output = name.rpartition(".")
    vessel, own = part_of(part)
    points, wheels = (_parts(raw, key) for key in ("points", "wheels"))
    is_point, is_wheel = own in points.get(vessel, ()), own in wheels.get(vessel, ())
    if is_point and not (is_wheel and output in WHEEL_OUTPUTS):
        return "" if output in POINT_OUTPUTS else unknown(f"output of {part}", output, POINT_OUTPUTS)
    if not is_wheel:
        return _port_problem(part, *((points, "point") if output in POINT_OUTPUTS else (wheels, "wheel")))
    if output not in WHEEL_OUTPUTS:
        return unknown(f"output of {part}", output, WHEEL_OUTPUTS)
    table = _table(_table(_table(_table(raw, "vessels"), vessel), "wheels"), own)
    if output == "speed" and table.get("inertia", 0.0) == 0.0:
        return f"{name}: {printable(part)} has inertia 0, a momentum without a speed; take {part}.momentum"
    return ""
