"""The subcommands of supervessel.

supervessel import FILE.scn [...] -o SCENE.toml [--force]
supervessel trade SCENE.toml [-o FOLDER] [--quick] [--duration S]
supervessel cache [--clear]
"""

import argparse
import json
import sys
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import get_args

from fmu_build.trade import TradeError, course_of, is_trade, plot, study, table
from supervessel.loading import load_scene, parse_scene
from supervessel.orbiter import ScenarioError, import_scenario
from supervessel.problems import SceneError, first, printable
from supervessel.scene.schema import Convention, Scene, without_accuracy
from supervessel.shell.console import Parser, print_results, show_progress
from supervessel.shell.ending import say
from supervessel.shell.files import OutputError, check_output, made_folder, write_file, write_files

TRADE_FILES = ("json", "md", "png", "svg")
"""Kinds of the files that a trade leaves, trade.KIND each; the first tells that they are a trade's."""


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
    parser.add_argument(
        "--force", action="store_true", help="replace a file that is there already (default: refused)"
    )
    parser.set_defaults(run=_import)


def _import(options: argparse.Namespace) -> int:
    output: Path = options.output
    try:
        if check_output(output, [options.scenario, *filter(None, [options.table])]) and not options.force:
            raise OutputError(output, "is there already; --force replaces it")
        made = import_scenario(
            options.scenario, options.vessel, options.config, options.table, options.convention
        )
        check_output(output, made.sources)
        for note in first(made.notes, "notes, all of them at the head of the scene"):
            print(f"note: {note}", file=sys.stderr)
        write_file(output, made.text.encode())
    except (ScenarioError, OutputError) as error:
        print(error, file=sys.stderr)
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
        with made_folder(folder):
            _check_trade_files(folder, options.scene)
            found = study(scene, quick=options.quick, progress=_progress)
            tables = table(found)
            files = {"json": json.dumps(found, indent=1).encode(), "md": f"{tables}\n".encode()}
            try:
                files |= plot(found)
            except ImportError:
                print(
                    "no plot: matplotlib is not installed, pip install 'supervessel[plot]'", file=sys.stderr
                )
            write_files({folder / f"trade.{kind}": content for kind, content in files.items()})
    except (SceneError, BuildError, OutputError) as error:
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
    from fmu_build.errors import BuildError  # noqa: PLC0415
    from fmu_build.storage.report import clear, report  # noqa: PLC0415

    try:
        said = clear() if options.clear else report()
    except BuildError as error:
        print(error, file=sys.stderr)
        return 1
    return print_results(said, "the cache's content")


def _check_trade_files(folder: Path, scene: Path) -> None:
    """Raises OutputError, before any work is done, where a trade's files cannot be written.

    Nor may they replace what is of no trade: files of their names without trade.json, or another's.
    """
    files = [folder / f"trade.{kind}" for kind in TRADE_FILES]
    there = [file for file in files if check_output(file, [scene])]
    if there and not is_trade(folder / "trade.json"):
        raise OutputError(there[0], "is there already and is of no trade; remove it or take another folder")


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
