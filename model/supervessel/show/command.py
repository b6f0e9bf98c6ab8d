"""What `supervessel show` does."""

import argparse
from pathlib import Path

from supervessel.drawing.geometry import assembly
from supervessel.loading import load_scene
from supervessel.problems import SceneError, first, printable
from supervessel.shell.console import print_problem, print_results
from supervessel.shell.files import OutputError, check_output, write_file
from supervessel.show.overview import PICTURES, overview, picture


def show(parser: argparse.ArgumentParser, options: argparse.Namespace) -> int:
    """Runs the command: scene and output; returns its exit status. Wrong usage is told by the parser."""
    output: Path | None = options.output
    if output is not None and output.suffix.lower() not in PICTURES:
        endings = " or ".join(PICTURES)
        parser.error(f"-o {output}: a drawing is a file with the ending {endings}, not {output.suffix!r}")
    try:
        scene = load_scene(options.scene)
        for note in first(scene.notes, "notes"):
            print_problem(f"note: {printable(options.scene.name)}: {note}")
        parts = assembly(scene)
        if output is not None:
            _check_picture_output(output, options.scene)
            write_file(output, picture(parts, output.suffix.lower()))
    except (SceneError, OutputError) as error:
        print_problem(error)
        return 1
    return print_results(overview(parts), "the scene")


def _check_picture_output(output: Path, scene: Path) -> None:
    """Raises OutputError where a picture cannot be written, or would replace something else."""
    kind = output.suffix.lower()
    if check_output(output, [scene]) and not _begins_with(output, PICTURES[kind]):
        raise OutputError(output, f"is there already and is no {kind} file; remove it or take another name")


def _begins_with(file: Path, beginning: bytes) -> bool:
    try:
        with file.open("rb") as stream:
            return stream.read(len(beginning)) == beginning
    except OSError:  # it may be written, but not read
        return False
