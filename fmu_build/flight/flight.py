"""Choices built, flown in processes of their own, and kept by content."""

import hashlib
import json
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from fmu_build.flight.choices import SHOWN, Choice, variant_of
from fmu_build.flight.experiment import Course, TradeError, course_of
from supervessel.equations import Equations, equations
from supervessel.problems import printable
from supervessel.scene.schema import Scene
from supervessel.shell.files import OutputError, write_file
from supervessel.shell.processes import Workers, run

Array = NDArray[np.float64]

HERE = Path(__file__).parent

TIMING = 0.25
"""Seconds that the clock may take of a flight; a flight that takes longer is timed once."""

TIME_LIMIT = 300.0
"""Seconds after which a flight is given up."""

OUT_OF_TIME = f"did not end within {TIME_LIMIT:g} s"

BUILT_WITH = ("casadi", "fmpy", "ziglang")
"""Packages that results depend on."""

LIBRARIES = ("LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH")
"""Variables without which some Pythons do not start. Libraries of C could come from there, and results depend
on them: they are part of what a result is kept under."""

AT_ONCE = 2
"""Builds at the same time."""


@dataclass(frozen=True)
class Flown:
    """What came of a choice.

    refused     : why it could not be flown, or None; then the others are 0 and empty
    nanoseconds : of a communication step: moving inputs set, step, attitude and rate got
    ratio       : of that to a plain RK4 step, timed in turn with it
    sub_steps   : of the whole flight
    size        : of the library [bytes]
    samples     : attitude and angular velocity, (n, 7), at the course's samples
    """

    refused: str | None
    nanoseconds: float
    ratio: float
    sub_steps: int
    size: int
    samples: Array


@dataclass(frozen=True)
class Built:
    """A choice's library, what must be known to call it, and what it was made from."""

    model: Equations
    library: Path
    token: str
    references: dict[str, int]


@dataclass(frozen=True)
class Workshop:
    """Where a trade works: a folder for as long as it lasts, and what has been built there.

    trial : whether libraries are compiled without optimisation: the same numbers, slower, much sooner there
    """

    folder: Path
    built: dict[Choice, Built]
    trial: bool = False


@contextmanager
def workshop(*, trial: bool = False) -> Iterator[Workshop]:
    """Yields a workshop, removed afterwards. Raises TradeError where it cannot be made or written."""
    # Package fmu_build is built on this one: looked up only here.
    from fmu_build.storage.cache import reason  # noqa: PLC0415
    from fmu_build.storage.temporary import temporary_folder  # noqa: PLC0415

    try:
        with temporary_folder() as folder:
            yield Workshop(folder, {}, trial)
    except OSError as error:
        place = error.filename or tempfile.gettempdir()
        raise TradeError(f"{printable(str(place))}: {reason(error, 'to work in')}") from None


def fly_all(
    scene: Scene, choices: Sequence[Choice], shop: Workshop, done: Callable[[str], None] = lambda _: None
) -> dict[Choice, Flown]:
    """Returns what came of choices; those not flown before are built, two at a time, then flown one by one.

    done : told of each that is finished
    Each result is kept as soon as it is there. Raises TradeError if one cannot be kept, BuildError if the
    compiler fails.
    """
    course = course_of(scene)
    places = {choice: place_of("trade", scene, asdict(choice)) for choice in choices}
    found: dict[Choice, Flown] = {}
    for choice, place in places.items():
        kept = _read(place, len(course.sampled))
        if kept is not None:
            found[choice] = kept
            done(str(choice))
    missing = [choice for choice in choices if choice not in found]
    build_all(scene, missing, shop, done)
    for choice in missing:
        found[choice] = _fly(shop.built[source_of(choice)], choice, course, shop)
        if found[choice].refused != OUT_OF_TIME:  # another time there may be more of it
            _keep(places[choice], found[choice])
        done(str(choice))
    return found


def build_all(scene: Scene, choices: Sequence[Choice], shop: Workshop, done: Callable[[str], None]) -> None:
    """Builds the libraries of choices, and the host's, as far as they are not there."""
    wanted = [choice for choice in dict.fromkeys(map(source_of, choices)) if choice not in shop.built]
    if not wanted:
        return
    _build_host(shop.folder)
    with Workers(AT_ONCE) as pool:
        begun = {}
        # CasADi's expressions are made in one thread: only compilers run beside it.
        for i, choice in enumerate(wanted):
            scene_built, folder = variant_of(scene, choice), shop.folder / f"b{len(shop.built) + i}"
            model = equations(scene_built)
            packed, names, description = _sources(scene_built, model)
            compiling = pool.submit(_compile, packed, names, scene_built.name, folder, trial=shop.trial)
            begun[choice] = model, description, compiling
        for choice, (model, description, compiling) in begun.items():
            shop.built[choice] = _built(model, description, compiling.result())
            done(f"build {choice}")


def source_of(choice: Choice) -> Choice:
    """Returns the choice whose library this one is flown with."""
    return Choice(choice.model, choice.propagator, choice.angle)


def builds(choices: Sequence[Choice], shop: Workshop) -> int:
    """Returns how many libraries choices need that are not there."""
    return len({source_of(choice) for choice in choices} - shop.built.keys())


def _sources(scene: Scene, model: Equations) -> tuple[dict[str, bytes], list[str], bytes]:
    """Returns the files of a scene's sources/, the names of those to compile, and the model description."""
    # Package fmu_build is built on this one: looked up only here.
    from fmu_build.build import generate  # noqa: PLC0415
    from fmu_build.generate.sources import source_file_names, source_files  # noqa: PLC0415

    sources, description = generate(scene, 3, model)
    return source_files(sources, 3, scene.name), source_file_names(sources, 3), description


def _compile(
    packed: Mapping[str, bytes], names: Sequence[str], identifier: str, folder: Path, *, trial: bool
) -> Path:
    """Returns the library that sources make."""
    from fmu_build.build import compile_sources  # noqa: PLC0415
    from fmu_build.compile.compiler import FLAGS, TRIAL_FLAGS  # noqa: PLC0415
    from fmu_build.platforms import host_platform  # noqa: PLC0415

    flags = TRIAL_FLAGS if trial else FLAGS
    [(path, library)] = compile_sources(packed, names, 3, (host_platform(),), identifier, flags).items()
    folder.mkdir()
    file = folder / Path(path).name
    file.write_bytes(library)
    return file


def _built(model: Equations, description: bytes, library: Path) -> Built:
    root = ET.fromstring(description)
    variables = root.find("ModelVariables")
    assert variables is not None
    references = {v.attrib["name"]: int(v.attrib["valueReference"]) for v in variables}
    return Built(model, library, root.attrib["instantiationToken"], references)


def _host(folder: Path) -> Path:
    """Returns the place of host.c as a library."""
    from fmu_build.platforms import host_platform  # noqa: PLC0415

    return folder / f"host{host_platform().suffix}"


def _build_host(folder: Path) -> None:
    """Compiles host.c, unless that is done."""
    from fmu_build.compile.compiler import compile_library  # noqa: PLC0415
    from fmu_build.platforms import host_platform  # noqa: PLC0415

    if not _host(folder).exists():
        compile_library([HERE / "host.c"], host_platform(), _host(folder))


def _fly(built: Built, choice: Choice, course: Course, shop: Workshop) -> Flown:
    """Returns what came of a flight in a process of its own."""
    moving = {name: v for name, v in course.numbers.items() if _is_input(built, choice, name)}
    inputs = Inputs(
        np.arange(course.steps),
        np.column_stack([np.zeros((course.steps, 0)), *moving.values()]),
        np.column_stack([np.zeros((course.steps, 0)), *course.booleans.values()]),
    )
    job = job_of(choice, course, TIMING)
    names = list(moving), list(course.booleans)
    ended = run_host(built, shop.folder, job, names, [inputs.written(shop.folder / "inputs")])
    if ended is None:
        return _refused(OUT_OF_TIME)
    if isinstance(ended, str):
        raise TradeError(f"{choice}: {ended}")
    (answer,), raw = ended
    if answer["refused"] is not None:
        return _refused(answer["refused"])
    return Flown(
        None,
        answer["nanoseconds"],
        answer["ratio"],
        answer["sub_steps"],
        built.library.stat().st_size,
        np.frombuffer(raw).reshape(-1, 7),
    )


@dataclass(frozen=True)
class Inputs:
    """What inputs do in a flight.

    rows     : numbers of the communication steps before which they are set, ascending, from 0
    numbers  : values of inputs that are numbers, (rows, n)
    booleans : of docks, (rows, m), 0 and 1
    """

    rows: NDArray[np.int64]
    numbers: Array
    booleans: Array

    def written(self, file: Path, *, once: bool = False) -> dict[str, Any]:
        """Writes them into files that begin with that name and returns how host.py finds them.

        once : whether files that are there already are these
        """
        kinds = {"rows": np.int64, "numbers": np.float64, "booleans": np.bool_}
        places = {key: file.with_suffix(f".{key}") for key in kinds}
        for key, kind in () if once and places["booleans"].exists() else kinds.items():
            places[key].write_bytes(np.ascontiguousarray(getattr(self, key), dtype=kind).tobytes() or b"\0")
        return {key: str(place) for key, place in places.items()} | {"row_count": len(self.rows)}


def job_of(choice: Choice, course: Course, seconds: float) -> dict[str, Any]:
    """Returns what host.py is told of flights through an experiment; seconds for timing, 0: none."""
    return {
        "tolerance": choice.tolerance or 0.0,
        "size": course.size,
        "last_size": course.last_size,
        "steps": course.steps,
        "sampled": course.sampled.tolist(),
        "seconds": seconds,
    }


def run_host(
    built: Built,
    folder: Path,
    job: Mapping[str, Any],
    names: tuple[Sequence[str], Sequence[str]],
    courses: Sequence[Mapping[str, Any]],
) -> tuple[list[dict[str, Any]], bytes] | str | None:
    """Returns what came of a job in a process of its own, see host.py, and the samples that it has left.

    folder  : of the workshop
    job     : tolerance, sizes, steps, samples, timing, as host.py wants them
    names   : of the inputs that move, numbers and docks
    courses : what they do in each flight, as `Inputs.written` returns it
    Returns None if the process does not end in time, a text if it breaks down.
    """
    shown = [f"{name}[{i}]" for name, n in zip(SHOWN, (4, 3), strict=True) for i in range(1, n + 1)]
    with tempfile.TemporaryDirectory(dir=folder, prefix="job-") as place:
        file, samples = Path(place, "job.json"), Path(place, "samples")
        whole = {
            "judge": False,
            **job,
            "host": str(_host(folder)),
            "library": str(built.library),
            "token": built.token,
            "number_references": [built.references[name] for name in names[0]],
            "boolean_references": [built.references[name] for name in names[1]],
            "shown": [built.references[name] for name in shown],
            "courses": list(courses),
            "samples": str(samples),
        }
        file.write_text(json.dumps(whole))
        command = [sys.executable, "-I", str(HERE / "host.py"), str(file)]
        try:
            ended = run(command, TIME_LIMIT, environment=_surroundings())
        except subprocess.TimeoutExpired:
            return None
        if ended.returncode != 0:
            last = (ended.stderr.strip().splitlines() or ["nothing was said"])[-1]
            return f"its flight ended with status {ended.returncode}: {last}"
        return json.loads(ended.stdout), samples.read_bytes()


def _surroundings() -> dict[str, str]:
    """Returns all the variables that a host's process gets: where this Python's own libraries are."""
    from fmu_build.compile.compiler import NEEDED  # noqa: PLC0415

    return {name: os.environ[name] for name in (*NEEDED, *LIBRARIES) if name in os.environ}


def _is_input(built: Built, choice: Choice, name: str) -> bool:
    """Whether an input is left; only those of what is frozen are not."""
    return name in built.references or not choice.model.frozen


def _refused(reason: str) -> Flown:
    return Flown(reason, 0.0, 0.0, 0, 0, np.zeros((0, 7)))


# What has been flown is kept under a name that says everything that it depends on.


def place_of(kind: str, scene: Scene, what: Any) -> Path:
    """Returns where something is kept that was found about a scene.

    kind : folder in the cache
    what : it was, as JSON takes it
    """
    from fmu_build.storage.cache import place_of_result  # noqa: PLC0415

    said = json.dumps([scene.model_dump(mode="json"), what, _maker()], sort_keys=True)
    return place_of_result(kind, said.encode())


@cache
def _maker() -> list[str]:
    """Returns what turns a choice into a result: this machine, versions, our own files."""
    import fmu_build  # noqa: PLC0415
    from fmu_build.compile.compiler import compiler  # noqa: PLC0415

    files = hashlib.sha256()
    for package in (HERE.parent, Path(fmu_build.__path__[0])):
        for file in sorted(package.rglob("*")):
            if file.suffix in (".py", ".c", ".h"):
                files.update(f"{file.relative_to(package)}\n".encode() + file.read_bytes())
    versions = [version(name) for name in BUILT_WITH]
    surroundings = [os.environ.get(name, "") for name in LIBRARIES]
    compiled_by = [*versions, str(compiler().stat().st_size)]
    return [
        platform.node(),
        platform.machine(),
        platform.system(),
        *surroundings,
        *compiled_by,
        files.hexdigest(),
    ]


def read(place: Path, is_whole: Callable[[Any], bool] = lambda _: True) -> Any:
    """Returns what `keep` has kept in a place, None where there is anything else.

    is_whole : whether what has been read is what is expected; an error for want of a part says no
    """
    from fmu_build.storage.cache import read_file  # noqa: PLC0415

    try:
        whole = json.loads((read_file(place) or b"").decode())
        found = whole["kept"]
        if whole["sha256"] == _digest(place, found) and is_whole(found):
            return found
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        pass
    return None


def keep(place: Path, found: Any) -> None:
    """Keeps something, as JSON takes it, beside a digest of it and of its place's name.

    Whatever else is in that place is removed. Raises TradeError if it cannot be written.
    """
    from fmu_build.storage.cache import remove  # noqa: PLC0415

    if place.is_dir() and not place.is_symlink():
        remove(place)
    write_whole(place, json.dumps({"sha256": _digest(place, found), "kept": found}).encode())


def _digest(place: Path, found: Any) -> str:
    return hashlib.sha256(json.dumps([place.name, found]).encode()).hexdigest()


def _read(place: Path, samples: int) -> Flown | None:
    """Returns the flight that is kept in a place, None where there is none with so many samples."""

    def is_flight(kept: Any) -> bool:
        refused, shape = kept["refused"], np.array(kept["samples"], dtype=np.float64).reshape(-1, 7).shape
        numbers = [kept[name] for name in ("nanoseconds", "ratio", "sub_steps", "size")]
        return (
            kept.keys() == {field.name for field in fields(Flown)}
            and isinstance(refused, str | None)
            and shape[0] == (samples if refused is None else 0)
            and all(type(row) is list and len(row) == 7 for row in kept["samples"])
            and are_numbers([*numbers, *(value for row in kept["samples"] for value in row)])
        )

    kept = read(place, is_flight)
    if kept is None:
        return None
    return Flown(**(kept | {"samples": np.array(kept["samples"], dtype=np.float64).reshape(-1, 7)}))


def are_numbers(values: Iterable[Any]) -> bool:
    """Whether values that JSON has given are numbers, all of them."""
    return all(type(value) in (int, float) for value in values)


def _keep(place: Path, flown: Flown) -> None:
    keep(place, asdict(flown) | {"samples": flown.samples.tolist()})


def write_whole(file: Path, content: bytes) -> None:
    """Writes a file, which appears when it is whole. Raises TradeError if it cannot be written."""
    try:
        file.parent.mkdir(exist_ok=True)
        write_file(file, content)
    except OutputError as error:
        raise TradeError(str(error)) from None
    except OSError as error:
        raise TradeError(f"{printable(str(file.parent))}: cannot be written: {error.strerror}") from None
