"""The command python -m fmu_build.compatibility SCENE.toml ... -o FOLDER."""

import argparse
import os
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path

from fmu_build.errors import BuildError
from fmu_build.options import add_build_options, platforms_of
from fmu_build.platforms import Platform, host_platform
from supervessel.problems import printable
from supervessel.shell.console import Parser, print_problem, print_results, show_progress
from supervessel.shell.ending import say

PART = ".supervessel-"
"""Beginning of the names of folders on their way into place."""

# What takes time to import is imported where it is needed: help and wrong usage need none of it.


def main(arguments: Sequence[str] | None = None) -> int:
    """Writes the folder; returns 0 when done, 1 when it failed, each problem on stderr."""
    parser = Parser(
        prog="python -m fmu_build.compatibility",
        description="Build the FMUs of scenes for both versions of FMI, each with inputs, reference results, "
        "options and a readme, laid out as the FMI project asks of tools that export FMUs.",
    )
    parser.add_argument("--version", action="version", version=version("supervessel"))
    parser.add_argument("scenes", nargs="+", type=Path, metavar="SCENE.toml", help="the scene files")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="FOLDER", help="the folder to make, a new one"
    )
    add_build_options(parser)
    options = parser.parse_args(arguments)
    return _offer(options, platforms_of(parser, options))


def _offer(options: argparse.Namespace, platforms: Sequence[Platform]) -> int:
    """Makes what the options ask for; returns the exit status."""
    from fmu_build.compatibility.offer import offer, overview
    from fmu_build.trade import TradeError
    from supervessel import SceneError, load_scene

    say("; nothing is written")
    folder: Path = options.output
    try:
        _check(folder)
        scenes = [load_scene(path) for path in options.scenes]
        named: dict[str, Path] = {}
        for scene, path in zip(scenes, options.scenes, strict=True):
            other = named.setdefault(scene.name, path)
            if other is not path:
                raise BuildError(
                    f"{printable(str(path))}: name = {scene.name} is that of {printable(str(other))}"
                )
        files: dict[str, bytes] = {}
        for scene in scenes:
            files |= offer(scene, platforms or (host_platform(),), options.names, show_progress)
        show_progress("")
        _write(folder, files | overview(scenes))
    except (SceneError, BuildError, TradeError) as error:
        print_problem(error)
        return 1
    return print_results(str(folder), "the folder is written, its path")


def _check(folder: Path) -> None:
    """Raises BuildError where the folder cannot be made: where it is there already and is not empty."""
    name, place = printable(str(folder)), _place(folder)
    try:
        if place.exists() and not (place.is_dir() and not any(place.iterdir())):
            raise BuildError(f"{name}: is there already; remove it or take another name")
        if place == _place(Path()):
            raise BuildError(f"{name}: is the working folder, which cannot be replaced; name a folder in it")
        if not place.parent.is_dir():
            raise BuildError(f"{name}: there is no folder {printable(str(place.parent))}")
        Path(tempfile.mkdtemp(prefix=PART, dir=place.parent)).rmdir()
    except OSError as error:
        raise BuildError(f"{name}: {error.strerror}") from None


def _place(folder: Path) -> Path:
    """Returns where a folder is or will be, links followed."""
    return Path(os.path.realpath(folder))


def _write(folder: Path, files: Mapping[str, bytes]) -> None:
    """Writes files into a folder that appears when it is whole. Raises BuildError if it cannot."""
    part, place = None, _place(folder)
    try:
        part = Path(tempfile.mkdtemp(prefix=PART, dir=place.parent))
        whole = part / "whole"
        for name, content in files.items():
            file = whole / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(content)
        _check(folder)  # something else may have come there in the meantime
        if place.exists():
            place.rmdir()
        whole.rename(place)
    except OSError as error:
        raise BuildError(f"{printable(str(folder))}: {error.strerror}") from None
    finally:
        if part is not None:
            shutil.rmtree(part, ignore_errors=True)
