"""A trade as a work-precision plot: what is drawn, and the process that draws it."""

import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Any

from fmu_build.compile.compiler import package_places
from fmu_build.flight.choices import label
from fmu_build.flight.flying import surroundings_of_python
from fmu_build.storage.cache import folder_for, keep_bytes, read_bytes, reason
from fmu_build.storage.temporary import place_for_temporary, temporary_folder
from fmu_build.trade.draw import KINDS
from fmu_build.trade.table import settings_of
from supervessel.problems import TradeError, printable
from supervessel.rotation.propagators import PROPAGATORS
from supervessel.shell.processes import run

TIME_LIMIT = 600.0  # s; matplotlib looks at every font of the system when it is new there: seconds

MARKERS = {name: row.marker for name, row in PROPAGATORS.items()} | {"auto": "^"}

ERROR = "largest error of the attitude in {:g} s [rad]"

FONTS = "fontlist-*.json"
"""What matplotlib has found out about the system's fonts, in the folder of its settings."""

Point = tuple[float, float, str]
"""Cost [plain RK4 steps], error [rad], the choice's name."""


def plot(trade: Mapping[str, Any]) -> dict[str, bytes]:
    """Returns the work-precision plot as "svg" and "png".

    Left the whole error of every choice, right that of integration alone under the best model; the settings
    of choices that nothing beats stand beside them. Raises ImportError without matplotlib, TradeError where
    it cannot draw.
    """
    path = package_places()
    if PathFinder.find_spec("matplotlib", path) is None:
        raise ImportError("matplotlib")
    job = {"path": path, "figure": figure(trade)}
    try:
        with temporary_folder() as folder:
            (folder / "figure.json").write_text(json.dumps(job), encoding="utf-8")
            _run(folder)
            return {kind: (folder / f"plot.{kind}").read_bytes() for kind in KINDS}
    except OSError as error:
        place = error.filename or place_for_temporary()
        raise TradeError(f"{printable(str(place))}: {reason(error, 'to draw in')}") from None


def _run(folder: Path) -> None:
    """Runs draw.py in a folder. What matplotlib finds out about fonts is kept from one run to the next."""
    kept, settings = folder_for("fonts"), folder / "settings"
    settings.mkdir()
    for place in kept.glob(FONTS):
        if (content := read_bytes(place)) is not None:
            (settings / place.name).write_bytes(content)
    command = [sys.executable, "-I", str(Path(__file__).with_name("draw.py")), str(folder)]
    environment = surroundings_of_python() | {"MPLCONFIGDIR": str(settings)}
    try:
        done = run(command, TIME_LIMIT, folder, environment)
    except subprocess.TimeoutExpired:
        raise TradeError(f"matplotlib did not end within {TIME_LIMIT:g} s") from None
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or ["nothing was said"])[-1]
        raise TradeError(f"matplotlib ended with status {done.returncode}: {last}")
    for file in settings.glob(FONTS):
        if read_bytes(kept / file.name) != file.read_bytes():
            keep_bytes(kept / file.name, file.read_bytes())


def figure(trade: Mapping[str, Any]) -> dict[str, Any]:
    """Returns what `draw.draw` draws of a trade."""
    return {
        "name": trade["scene"],
        "xlabel": f"cost of a step of {trade['experiment']['step']:g} s [plain RK4 steps]",
        "halves": [_whole(trade), _integration(trade)],
    }


def _whole(trade: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the plot of every choice's whole error."""
    lines = []
    for i, model in enumerate(label(model) for model in trade["models"]):
        rows = [row for row in trade["choices"] if label(row) == model]
        for name, marker in MARKERS.items():
            points = _points(trade, "attitude", [row for row in rows if row["propagator"] == name])
            lines.append(_line(points, f"C{i}{marker}"))
        lines.append(_line([], f"C{i}o", label=model))
    front = _points(trade, "attitude", [row for row in trade["choices"] if row["pareto"]])
    lines.append(_line(front, "k--", lw=0.8, label="Pareto front"))
    ylabel = ERROR.format(trade["horizons"][-1])
    return _half(trade, f"{trade['scene']}: model and integration", lines, front, ylabel)


def _integration(trade: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the plot of the errors of integration alone, under the best model."""
    best = label(trade["models"][-1])
    rows = [row for row in trade["choices"] if label(row) == best]
    lines = []
    for name, marker in MARKERS.items():
        points = _points(trade, "integration_attitude", [row for row in rows if row["propagator"] == name])
        if points:
            lines.append(_line(points, f"C{len(trade['models']) - 1}{marker}-", label=name, lw=0.6))
    front = _unbeaten(_points(trade, "integration_attitude", rows))
    return _half(trade, f"{best}: integration alone", lines, front)


def _half(
    trade: Mapping[str, Any],
    title: str,
    lines: Sequence[Mapping[str, Any]],
    names: Sequence[Point],
    ylabel: str = "",
) -> dict[str, Any]:
    """Returns one of the two plots; `names` are the points that have their choice's name beside them."""
    doubt = trade["doubt"]["attitude"][-1]
    return {"title": title, "ylabel": ylabel, "lines": lines, "names": names, "doubt": doubt}


def _line(points: Sequence[Point], style: str, **options: Any) -> dict[str, Any]:
    """Returns points as a line in matplotlib's style."""
    costs, errors = [cost for cost, _, _ in points], [error for _, error, _ in points]
    return {"costs": costs, "errors": errors, "style": style, "options": {"alpha": 0.7} | options}


def _points(trade: Mapping[str, Any], key: str, rows: Sequence[Mapping[str, Any]]) -> list[Point]:
    """Returns choices by cost, errors below the references' doubt as that."""
    floor = float(trade["doubt"]["attitude"][-1])
    named = [(row, " ".join([row["propagator"], *settings_of(row)])) for row in rows]
    return sorted(
        (float(row["rk4_steps_per_step"]), max(float(row[key]), floor), name) for row, name in named
    )


def _unbeaten(points: Sequence[Point]) -> list[Point]:
    """Returns those of points, in the order of cost, that are more exact than all before them."""
    return [p for i, p in enumerate(points) if all(p[1] < other[1] for other in points[:i])]
