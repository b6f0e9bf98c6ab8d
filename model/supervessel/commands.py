"""The subcommands of supervessel.

supervessel import FILE.scn [...] -o SCENE.toml [--force]
supervessel trade SCENE.toml [-o FOLDER] [--quick] [--duration S]
supervessel cache [--clear]
"""

import argparse
from collections.abc import Iterable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import get_args

from supervessel import fmu
from supervessel.orbiter import ScenarioError, import_scenario
from supervessel.problems import first
from supervessel.scene.schema import Convention
from supervessel.shell.console import Parser, print_problem, print_results
from supervessel.shell.files import OutputError, check_output, write_file


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
        "--table",
        type=Path,
        metavar="FILE.toml",
        help="vessel classes that exist only in code, and single vessels, by name",
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
        _check_scene_output(output, [options.scenario, *filter(None, [options.table])], options.force)
        made = import_scenario(
            options.scenario, options.vessel, options.config, options.table, options.convention
        )
        _check_scene_output(output, made.sources, options.force)  # it may have come there in the meantime
        for note in first(made.notes, "notes, all of them at the head of the scene"):
            print_problem(f"note: {note}")
        write_file(output, made.text.encode())
    except (ScenarioError, OutputError) as error:
        print_problem(error)
        return 1
    return print_results(str(output), "the scene is written, its path")


def _check_scene_output(output: Path, inputs: Iterable[Path], force: bool) -> None:
    """Raises OutputError where a scene file cannot be written, or would replace something unasked."""
    if check_output(output, inputs) and not force:
        raise OutputError(output, "is there already; --force replaces it")


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
    parser.set_defaults(run=fmu.trade)


def _add_cache(parser: argparse.ArgumentParser) -> None:
    parser.description = "Show where compiled code and results are kept, how much, and whether that is used."
    parser.add_argument("--clear", action="store_true", help="remove it, nothing but supervessel-N")
    parser.set_defaults(run=fmu.cache)
