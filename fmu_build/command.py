"""The commands `supervessel build` and `python -m fmu_build`, which take the same and do the same."""

import argparse
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from fmu_build.options import add_build_options, platforms_of
from fmu_build.platforms import Platform
from fmu_build.versions import NEWEST, VERSIONS
from supervessel.problems import first, printable
from supervessel.shell.console import Parser, print_problem, print_results, show_progress
from supervessel.shell.ending import say
from supervessel.shell.reading import is_handed_over

if TYPE_CHECKING:
    from supervessel import Scene

# What takes time to import is imported where it is needed: help and wrong usage need none of it.


def main(arguments: Sequence[str] | None = None) -> int:
    """Builds the FMU of a scene file; returns 0 when done, 1 when it failed, each problem on stderr."""
    parser = Parser(
        prog="python -m fmu_build",
        description="Build the FMU of a scene, as `supervessel build` does.",
        epilog="example: python -m fmu_build examples/iss_dg.toml --fmi 2",
    )
    parser.add_argument("--version", action="version", version=version("supervessel"))
    add_build(parser, named_after_file=False)
    options = parser.parse_args(arguments)
    return int(options.run(options))


def add_build(parser: argparse.ArgumentParser, named_after_file: bool) -> None:
    """Adds what a build takes, and has the parser's options run it.

    named_after_file : whether an FMU whose name is not given is called as the scene file, not as the scene
    """
    default = "SCENE.fmu here, as the file" if named_after_file else "NAME.fmu here, as the scene"
    parser.add_argument("scene", type=Path, metavar="SCENE.toml", help="the scene file")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="OUT.fmu", help=f"the FMU to write (default: {default})"
    )
    parser.add_argument(
        "--fmi", type=int, choices=tuple(VERSIONS), default=NEWEST, help="FMI version (default: %(default)s)"
    )
    add_build_options(parser)
    parser.set_defaults(run=lambda options: _build(options, platforms_of(parser, options), named_after_file))


def _build(options: argparse.Namespace, platforms: Sequence[Platform], named_after_file: bool) -> int:
    """Builds what the options ask for; returns the exit status."""
    from fmu_build.build import build_fmu, check_fmu_output
    from fmu_build.errors import BuildError
    from fmu_build.trade import TradeError
    from supervessel import SceneError, load_scene

    try:
        scene = load_scene(options.scene)
        for note in first(scene.notes, "notes"):
            print_problem(f"note: {printable(options.scene.name)}: {note}")
        name = options.scene.stem if named_after_file and not is_handed_over(options.scene) else scene.name
        output = options.output or Path(f"{name}.fmu")
        check_fmu_output(output, [options.scene])
        chosen = _choose(scene) if scene.accuracy else []
        build_fmu(scene, output, options.fmi, platforms, options.names)
    except (SceneError, BuildError) as error:
        print_problem(error)
        return 1
    except TradeError as error:
        print_problem(f"{printable(options.scene.name)}: {error}")
        return 1
    return print_results("\n".join([*chosen, str(output)]), "the FMU is built, its path")


def _choose(scene: "Scene") -> list[str]:
    """Returns what `[accuracy]` chooses, in a line; shows how far that is."""
    from fmu_build.accuracy import choose, said

    say("; what has been flown is kept, the same command goes on from there")
    _, evidence = choose(scene, lambda what: show_progress(f"accuracy: {what}"))
    show_progress("accuracy: ")
    return [said(evidence)]
