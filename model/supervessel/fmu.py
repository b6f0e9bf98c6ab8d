"""The one door from this package to `fmu_build`, which is built on it and looked up when it is needed."""

from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import casadi as ca

from supervessel.scene.schema import Scene


def choose(scene: Scene, progress: Callable[[str], None] = lambda _: None) -> tuple[Scene, dict[str, Any]]:
    """Returns the scene with law, propagator and setting that `[accuracy]` asks for, and the evidence.

    The cheapest candidate, by counted operations, whose flights through histories of inputs keep the
    accuracy with a margin: a dictionary says what was asked, flown and found. What has been found is kept
    in the user's cache, and the same again is read from there. `build_fmu` and `Twin` choose by themselves.

    scene    : with `[accuracy]`
    progress : told what is being done
    Raises ValueError for a scene without it, AccuracyError where nothing meets it, BuildError if the
    compiler fails.

    Example:
        >>> from supervessel import choose, parse_scene
        >>> ball = {"name": "ball", "root": "B", "vessels": {"B": {"mass": 1.0, "pmi": [1.0, 2.0, 2.0]}}}
        >>> asked = {"accuracy": {"attitude": 1e-6, "horizon": 10.0, "step": 0.1}}
        >>> spin = {"rotation": {"angular_velocity": [0.1, 0.0, 0.0]}}
        >>> chosen, evidence = choose(parse_scene(ball | asked | spin))
        >>> chosen.rotation.law, chosen.rotation.propagator
        ('none', 'rk4')
    """
    from fmu_build.accuracy import choose as choose_by_flights  # noqa: PLC0415

    return choose_by_flights(scene, progress)


def generate(
    functions: Sequence[ca.Function], folder: Path, name: str, derivatives: int
) -> list[ca.Function]:
    """Returns functions compiled to machine code, see `fmu_build.compile.native.generate`."""
    from fmu_build.compile import native  # noqa: PLC0415

    return native.generate(functions, folder, name, derivatives)


def communication_step(scene: Scene, folder: Path) -> ca.Function:
    """Returns the FMU's doStep as a function, see `fmu_build.compile.native.communication_step`."""
    from fmu_build.compile import native  # noqa: PLC0415

    return native.communication_step(scene, folder)


def add_build(parser: ArgumentParser) -> None:
    """Adds what `supervessel build` takes, and has the parser's options run it."""
    from fmu_build import command  # noqa: PLC0415

    command.add_build(parser, named_after_file=True)


def info(options: Namespace) -> int:
    """Runs `supervessel info`; returns its exit status."""
    from fmu_build import contents  # noqa: PLC0415

    return contents.info(options)


def trade(options: Namespace) -> int:
    """Runs `supervessel trade`; returns its exit status."""
    from fmu_build.trade import command  # noqa: PLC0415

    return command.trade(options)


def cache(options: Namespace) -> int:
    """Runs `supervessel cache`; returns its exit status."""
    from fmu_build.storage import report  # noqa: PLC0415

    return report.cache(options)
