"""Command line: supervessel import FILE.scn [...] -o SCENE.toml, also as python -m supervessel."""

import argparse
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import get_args

from supervessel.orbiter import ScenarioError, import_scenario
from supervessel.scene import Convention


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a subcommand; returns 0 when done, 1 when it failed, each problem on stderr."""
    parser = argparse.ArgumentParser(prog="supervessel", description="Rotation of docked spacecraft.")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    _add_import(commands.add_parser("import", help="make a scene file from Orbiter's files"))
    options = parser.parse_args(arguments)
    try:
        return int(options.run(options))
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 1


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
        print(f"{output}: is one of the files read; the scene needs a file of its own", file=sys.stderr)
        return 1
    for note in made.notes:
        print(f"note: {note}", file=sys.stderr)
    try:
        _write(made.text, output)
    except OSError as error:
        print(f"{output}: cannot be written: {error.strerror}", file=sys.stderr)
        return 1
    return _print_path(output)


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


def _print_path(output: Path) -> int:
    """Prints the path of what was written; returns 0, or 1 where standard output does not take it."""
    try:
        print(output, flush=True)
    except (OSError, UnicodeError) as error:
        print(f"the scene is written, its path cannot be printed: {error}", file=sys.stderr)
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # what is left is flushed at the end
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
