"""Builds of the libraries of choices, and of the host that flies them, in a folder that is removed later."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

from fmu_build.compile.compiler import FLAGS, TRIAL_FLAGS, compile_library
from fmu_build.compile.library import compile_sources
from fmu_build.flight.choices import Choice, variant_of
from fmu_build.flight.host import MESSAGE_SIZE, SHOWN
from fmu_build.generate.model import generate
from fmu_build.generate.sources import source_file_names, source_files
from fmu_build.platforms import host_platform
from fmu_build.storage.cache import reason
from fmu_build.storage.temporary import place_for_temporary, temporary_folder
from supervessel.equations import Equations, equations
from supervessel.problems import TradeError, printable
from supervessel.scene.schema import Scene
from supervessel.shell.processes import Workers

HERE = Path(__file__).parent

HOST_FLAGS = (*FLAGS, f"-DSHOWN={SHOWN}", f"-DMESSAGE_SIZE={MESSAGE_SIZE}")
"""Compiler flags of host.c."""

AT_ONCE = 2
"""Builds at the same time."""


@dataclass(frozen=True)
class Built:
    """The library of a choice.

    model      : the equations that it was made from
    library    : path of the shared library
    token      : instantiation token
    references : value references by the names of the variables
    """

    model: Equations
    library: Path
    token: str
    references: dict[str, int]


@dataclass(frozen=True)
class Workshop:
    """The folder of a trade or a search, and the libraries that have been built in it.

    trial : whether libraries are compiled without optimisation: the same numbers, slower, much sooner there
    """

    folder: Path
    built: dict[Choice, Built]
    trial: bool = False


@contextmanager
def workshop(*, trial: bool = False) -> Iterator[Workshop]:
    """Yields a workshop, removed afterwards. Raises TradeError where it cannot be made or written."""
    try:
        with temporary_folder() as folder:
            yield Workshop(folder, {}, trial)
    except OSError as error:
        place = error.filename or place_for_temporary()
        raise TradeError(f"{printable(str(place))}: {reason(error, 'to work in')}") from None


def build_all(scene: Scene, choices: Sequence[Choice], shop: Workshop, done: Callable[[str], None]) -> None:
    """Builds the missing libraries of choices, and that of the host if it is missing.

    done : called with a text for each library that is built
    """
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
    """Returns the number of libraries that have to be built for choices."""
    return len({source_of(choice) for choice in choices} - shop.built.keys())


def _sources(scene: Scene, model: Equations) -> tuple[dict[str, bytes], list[str], bytes]:
    """Returns the files of a scene's sources/, the names of those to compile, and the model description."""
    sources, description = generate(scene, 3, model)
    return source_files(sources, 3, scene.name), source_file_names(sources, 3), description


def _compile(
    packed: Mapping[str, bytes], names: Sequence[str], identifier: str, folder: Path, *, trial: bool
) -> Path:
    """Returns the path of the library compiled from C sources.

    packed, names : files of sources/ by archive path, and names of those to compile
    trial         : whether without optimisation
    """
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


def host_library(folder: Path) -> Path:
    """Returns the place of host.c as a library."""
    return folder / f"host{host_platform().suffix}"


def _build_host(folder: Path) -> None:
    """Compiles host.c, unless that is done."""
    if not host_library(folder).exists():
        compile_library([HERE / "host.c"], host_platform(), host_library(folder), HOST_FLAGS)
