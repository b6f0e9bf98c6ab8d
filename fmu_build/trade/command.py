"""What `supervessel trade` does."""

import argparse
import json
from pathlib import Path

from fmu_build.errors import BuildError
from fmu_build.flight.experiment import course_of
from fmu_build.trade.plotting import plot
from fmu_build.trade.study import is_trade, study
from fmu_build.trade.table import table
from supervessel.loading import load_scene, parse_scene
from supervessel.problems import SceneError, TradeError, first, printable
from supervessel.scene.schema import Scene, without_accuracy
from supervessel.shell.console import print_problem, print_results, show_progress
from supervessel.shell.ending import say
from supervessel.shell.files import OutputError, check_output, made_folder, write_files

TRADE_FILES = ("json", "md", "png", "svg")
"""Kinds of the files that a trade leaves, trade.KIND each; the first tells that they are a trade's."""


def trade(options: argparse.Namespace) -> int:
    """Runs the command: scene, output, quick and duration; returns its exit status."""
    say("; what has been flown is kept, the same command goes on from there")
    try:
        scene = load_scene(options.scene)
        for note in first(scene.notes, "notes"):
            print_problem(f"note: {printable(options.scene.name)}: {note}")
        scene = _lasting(without_accuracy(scene), options.duration)
        folder: Path = options.output or Path(f"{scene.name}_trade")
        course_of(scene)
        with made_folder(folder):
            _check_trade_files(folder, options.scene)
            found = study(scene, quick=options.quick, progress=_progress)
            tables = table(found)
            files = {"json": json.dumps(found, indent=1).encode(), "md": f"{tables}\n".encode()}
            try:
                files |= plot(found)
            except (ImportError, TradeError) as error:
                _say_no_plot(folder, error)
            _check_trade_files(folder, options.scene)  # something else may have come there in the meantime
            write_files({folder / f"trade.{kind}": content for kind, content in files.items()})
    except (SceneError, BuildError, OutputError) as error:
        print_problem(error)
        return 1
    except TradeError as error:
        print_problem(f"{printable(options.scene.name)}: {error}")
        return 1
    return print_results(f"{tables}\n\n{folder}", f"the trade is written to {folder}, its tables")


def _say_no_plot(folder: Path, error: Exception) -> None:
    """Says why a trade is without a plot, and that one in its folder is of an earlier trade."""
    missing = isinstance(error, ImportError)
    why = "matplotlib is not installed (pip install matplotlib)" if missing else str(error)
    left = [name for name in ("trade.png", "trade.svg") if (folder / name).exists()]
    earlier = f"; {' and '.join(left)} there are of an earlier trade" if left else ""
    print_problem(f"no plot: {why}{earlier}")


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
