"""Results of flights and searches in the cache, each under a digest of everything that it depends on."""

import hashlib
import json
import os
import platform
from collections.abc import Callable, Iterable
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import fmu_build
import supervessel
from fmu_build.compile.compiler import compiler
from fmu_build.storage.cache import place_of_result, read_file, remove
from supervessel.problems import TradeError, printable
from supervessel.scene.schema import SAID, Scene
from supervessel.shell.files import OutputError, write_file

BUILT_WITH = ("casadi", "fmpy", "ziglang")
"""Packages that results depend on."""

LIBRARIES = ("LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH")
"""Variables without which some Pythons do not start. Libraries of C could come from there, and results depend
on them: they are part of what a result is kept under."""


def place_of(kind: str, scene: Scene, what: Any) -> Path:
    """Returns the file of a result about a scene.

    kind : folder in the cache
    what : the question that the result answers, as JSON
    The name is a digest of scene, question, this machine, versions, and the files of both packages. What a
    scene says of itself, as its author and version, is no part of it.
    """
    asked = scene.model_dump(mode="json", exclude=set(SAID))
    said = json.dumps([asked, what, _maker()], sort_keys=True)
    return place_of_result(kind, said.encode())


@cache
def _maker() -> list[str]:
    """Returns all else that results depend on: machine, versions, digest of the files of both packages."""
    files = hashlib.sha256()
    for package in (Path(supervessel.__path__[0]), Path(fmu_build.__path__[0])):
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
    """Returns the result that `keep` has written into a file, None where there is no valid one.

    is_whole : whether a result read from the file is complete; KeyError, TypeError and the like count as no
    """
    try:
        whole = json.loads((read_file(place) or b"").decode())
        found = whole["kept"]
        if whole["sha256"] == _digest(place, found) and is_whole(found):
            return found
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        pass
    return None


def keep(place: Path, found: Any) -> None:
    """Writes a result, as JSON, beside a digest of it and of the file's name.

    Anything else at that path is removed first. Raises TradeError if the file cannot be written.
    """
    if os.path.lexists(place) and (place.is_symlink() or not place.is_file()):
        remove(place)  # a link is not followed, a pipe not waited for
    write_whole(place, json.dumps({"sha256": _digest(place, found), "kept": found}).encode())


def _digest(place: Path, found: Any) -> str:
    return hashlib.sha256(json.dumps([place.name, found]).encode()).hexdigest()


def are_numbers(values: Iterable[Any]) -> bool:
    """Whether values that JSON has given are numbers, all of them."""
    return all(type(value) in (int, float) for value in values)


def write_whole(file: Path, content: bytes) -> None:
    """Writes a file, which appears when it is whole. Raises TradeError if it cannot be written."""
    try:
        file.parent.mkdir(exist_ok=True)
        write_file(file, content)
    except OutputError as error:
        raise TradeError(str(error)) from None
    except OSError as error:
        raise TradeError(f"{printable(str(file.parent))}: cannot be written: {error.strerror}") from None
