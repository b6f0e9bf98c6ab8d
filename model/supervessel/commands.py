"""The subcommands of supervessel.

supervessel import FILE.scn [...] -o SCENE.toml
supervessel trade SCENE.toml [-o FOLDER] [--quick] [--duration S]
supervessel cache [--clear]
"""

import argparse
import json
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib.metadata import version
from pathlib import Path
from typing import get_args

from supervessel.console import Parser, print_results, show_progress
from supervessel.ending import say
from supervessel.interrupts import finally_done
from supervessel.loading import load_scene, parse_scene
from supervessel.orbiter import ScenarioError, import_scenario
from supervessel.problems import SceneError, first, printable
from supervessel.scene import Convention, Scene, without_accuracy
from supervessel.trade import TradeError, course_of, plot, study, table, write_all


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a subcommand; returns 0 when done, 1 when it failed, each problem on stderr."""
    parser = Parser(prog="supervessel", description="Rotation of docked spacecraft.")
    parser.add_argument("--version", action="version", version=version("supervessel"))
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    _add_import(commands.add_parser("import", help="make a scene file from Orbiter's files"))
    _add_trade(commands.add_parser("trade", help="measure what accuracy costs in a scene"))
    _add_cache(commands.add_parser("cache", help="show what is kept from run to run, or clear it"))
    options = parser.parse_args(arguments)
    return int(options.run(options))


def _add_import(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Make a scene file of vessels that are docked in a scenario of Orbiter: one line on stdout, its "
        "path; what was missing, guessed or left out on stderr."
    )
    parser.add_argument("scenario", type=Path, metavar="FILE.scn", help="the scenario")
    parser.add_argument(
        "--vessel", default="", metavar="NAME", help="a vessel, which becomes the root (default: the focus)"
    )
    parser.add_argument(
        "--config",
        type=Path,
        nargs="+",
        action="extend",
        default=[],
        metavar="FOLDER",
        help="folders with vessel classes (.cfg), at any depth",
    )
    parser.add_argument(
        "--table", type=Path, metavar="FILE.toml", help="vessel classes that exist only in code"
    )
    parser.add_argument(
        "--convention",
        choices=get_args(Convention),
        help="of the scene (default: rigid_body; orbiter where no rigid body has a vessel's moments)",
    )
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="SCENE.toml", help="the scene file to write"
    )
    parser.set_defaults(run=_import)


def _import(options: argparse.Namespace) -> int:
    output: Path = options.output
    try:
        made = import_scenario(
            options.scenario, options.vessel, options.config, options.table, options.convention
        )
    except ScenarioError as error:
        print(error, file=sys.stderr)
        return 1
    if output.resolve() in [path.resolve() for path in made.sources]:
        print(
            f"{printable(str(output))}: is one of the files read; the scene needs a file of its own",
            file=sys.stderr,
        )
        return 1
    for note in first(made.notes, "notes, all of them at the head of the scene"):
        print(f"note: {note}", file=sys.stderr)
    try:
        _write(made.text, output)
    except OSError as error:
        print(f"{printable(str(output))}: cannot be written: {error.strerror}", file=sys.stderr)
        return 1
    return print_results(str(output), "the scene is written, its path")


def _add_trade(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Build the FMUs of a scene under every sensible law, propagator and step, fly its [experiment] with "
        "each, compare with references, time: tables on stdout; these, a work-precision plot and all figures "
        "in a folder. What has been flown is kept in the user's cache: the same again takes seconds."
    )
    parser.add_argument("scene", type=Path, metavar="SCENE.toml", help="the scene file")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="FOLDER", help="where files go (default: NAME_trade here)"
    )
    parser.add_argument("--quick", action="store_true", help="fewer laws, steps and tolerances")
    parser.add_argument(
        "--duration", type=float, metavar="S", help="of the experiment [s] (default: the scene's)"
    )
    parser.set_defaults(run=_trade)


def _trade(options: argparse.Namespace) -> int:
    # Package fmu_build is built on this one: looked up only here.
    from fmu_build.errors import BuildError  # noqa: PLC0415

    say("; what has been flown is kept, the same command goes on from there")
    try:
        scene = _lasting(without_accuracy(load_scene(options.scene)), options.duration)
        folder: Path = options.output or Path(f"{scene.name}_trade")
        course_of(scene)
        with _made(folder):
            found = study(scene, quick=options.quick, progress=_progress)
            tables = table(found)
            files = {"trade.json": json.dumps(found, indent=1).encode(), "trade.md": f"{tables}\n".encode()}
            try:
                files |= {f"trade.{kind}": drawn for kind, drawn in plot(found).items()}
            except ImportError:
                print(
                    "no plot: matplotlib is not installed, pip install 'supervessel[plot]'", file=sys.stderr
                )
            write_all(folder, files)
    except (SceneError, BuildError) as error:
        print(error, file=sys.stderr)
        return 1
    except TradeError as error:
        print(f"{printable(options.scene.name)}: {error}", file=sys.stderr)
        return 1
    return print_results(f"{tables}\n\n{folder}", f"the trade is written to {folder}, its tables")


def _add_cache(parser: argparse.ArgumentParser) -> None:
    parser.description = "Show where compiled code and results are kept, how much, and whether that is used."
    parser.add_argument("--clear", action="store_true", help="remove it, nothing but supervessel-N")
    parser.set_defaults(run=_cache)


def _cache(options: argparse.Namespace) -> int:
    from fmu_build.cache_report import clear, report  # noqa: PLC0415
    from fmu_build.errors import BuildError  # noqa: PLC0415

    try:
        said = clear() if options.clear else report()
    except BuildError as error:
        print(error, file=sys.stderr)
        return 1
    return print_results(said, "the cache's content")


@contextmanager
def _made(folder: Path) -> Iterator[None]:
    """Makes a folder, unless it is there; takes it away again if nothing comes into it."""
    there = folder.exists()

    def clear() -> None:
        if not there:
            with suppress(OSError):  # there is something in it
                folder.rmdir()

    with finally_done(clear):
        write_all(folder, {})
        yield


def _lasting(scene: Scene, duration: float | None) -> Scene:
    """Returns the scene with an experiment of that duration [s]; None: the scene's own."""
    if duration is None or scene.experiment is None:
        return scene
    raw = scene.model_dump(exclude_none=True)
    raw["experiment"]["duration"] = duration
    return parse_scene(raw, "--duration")


def _progress(done: int, total: int, what: str) -> None:
    """Shows how far a trade has come."""
    bar = "#" * (24 * done // total)
    show_progress(f"[{bar:.<24}] {done}/{total} {what}", "\n" if done == total else "")


def _write(text: str, output: Path) -> None:
    """Writes a file, which appears when it is whole."""
    if output.is_dir():
        raise IsADirectoryError(0, "is a folder")
    with tempfile.NamedTemporaryFile(dir=output.parent, prefix=".scene-", delete=False) as stream:
        part = Path(stream.name)
        try:
            stream.write(text.encode())
            stream.close()
            part.chmod(0o644)
            part.replace(output)
        except BaseException:
            part.unlink(missing_ok=True)
            raise
