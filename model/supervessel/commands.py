"""The subcommands of supervessel: a row of COMMANDS each."""

import argparse
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import get_args

from supervessel import fmu
from supervessel.orbiter import ScenarioError, import_scenario
from supervessel.problems import first
from supervessel.scene.schema import Convention
from supervessel.shell.console import Parser, print_problem, print_results
from supervessel.shell.files import OutputError, check_output, write_file
from supervessel.show.command import show


@dataclass(frozen=True)
class Command:
    """A subcommand.

    line    : what it does
    example : of its use, without the program's name; examples that are in the repository exist
    add     : adds its arguments, and has the parser's options run it
    """

    line: str
    example: str
    add: Callable[[argparse.ArgumentParser], None]


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a subcommand; returns 0 when done, 1 when it failed, each problem on stderr."""
    options = parser().parse_args(arguments)
    return int(options.run(options))


def parser() -> Parser:
    """Returns the parser of all subcommands; the options that it returns have what to run as `run`."""
    whole = Parser(
        prog="supervessel",
        description="Rotation of docked spacecraft: FMUs from scene files.",
        epilog="supervessel COMMAND --help tells more of each; python -m fmu_build is build.",
    )
    whole.add_argument("--version", action="version", version=version("supervessel"))
    commands = whole.add_subparsers(required=True, metavar="COMMAND")
    for name, command in COMMANDS.items():
        own = commands.add_parser(
            name,
            help=command.line,
            description=f"{command.line[0].upper()}{command.line[1:]}.",
            epilog=f"example: supervessel {name} {command.example}",
        )
        command.add(own)
    return whole


def _add_import(parser: argparse.ArgumentParser) -> None:
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
    parser.add_argument("scene", type=Path, metavar="SCENE.toml", help="the scene file")
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="FOLDER",
        help="for tables, plot and all figures (default: NAME_trade here)",
    )
    parser.add_argument("--quick", action="store_true", help="fewer laws, steps and tolerances")
    parser.add_argument(
        "--duration", type=float, metavar="S", help="of the experiment [s] (default: the scene's)"
    )
    parser.set_defaults(run=fmu.trade)


def _add_cache(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--clear", action="store_true", help="remove it, nothing but supervessel-N")
    parser.set_defaults(run=fmu.cache)


def _add_show(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", type=Path, metavar="SCENE.toml", help="the scene file")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="a drawing too, FILE.svg or FILE.png"
    )
    parser.set_defaults(run=lambda options: show(parser, options))


def _add_info(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("fmu", type=Path, metavar="X.fmu", help="an FMU that supervessel has built")
    parser.add_argument(
        "--scene", action="store_true", help="print the scene file that it was built from, nothing else"
    )
    parser.set_defaults(run=fmu.info)


COMMANDS = {
    "show": Command(
        "look at a scene: composite and vessels on stdout, a drawing",
        "examples/iss_dg.toml -o iss_dg.svg",
        _add_show,
    ),
    "build": Command("build the FMU of a scene; its path on stdout", "examples/iss_dg.toml", fmu.add_build),
    "info": Command("tell what an FMU is, and what scene it was built from", "iss_dg.fmu", _add_info),
    "trade": Command(
        "measure what accuracy costs in a scene; tables on stdout",
        "examples/iss_dg.toml --quick",
        _add_trade,
    ),
    "import": Command(
        "make a scene file from Orbiter's files; notes on stderr",
        "examples/docked.scn --config examples -o my.toml",
        _add_import,
    ),
    "cache": Command("show what is kept from run to run, or clear it", "--clear", _add_cache),
}
"""By name, in the order of their listing."""
