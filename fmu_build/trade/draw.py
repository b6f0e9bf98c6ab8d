"""Draws a work-precision plot in a process of its own: python draw.py FOLDER.

Started by `plotting.py`, with nothing of this package, in an empty folder and without the user's environment
variables, since matplotlib reads its settings wherever it finds them. FOLDER/figure.json is what is drawn;
plot.svg and plot.png appear beside it.
"""

import json
import sys
from pathlib import Path
from typing import Any

KINDS = ("svg", "png")


def draw(folder: Path, drawn: dict[str, Any]) -> None:
    """Draws a figure into a folder, as plot.KIND."""
    from matplotlib import rc_context, rcdefaults  # noqa: PLC0415
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415
    from matplotlib.backends.backend_svg import FigureCanvasSVG  # noqa: PLC0415
    from matplotlib.figure import Figure  # noqa: PLC0415

    rcdefaults()
    figure = Figure(figsize=(12.0, 6.0), layout="constrained")
    for axes, half in zip(figure.subplots(1, 2), drawn["halves"], strict=True):
        _draw_half(axes, half, drawn["xlabel"])
    with rc_context({"svg.hashsalt": drawn["name"]}):
        canvases = {"svg": FigureCanvasSVG(figure), "png": FigureCanvasAgg(figure)}
        for kind in KINDS:
            metadata = {"Date": None} if kind == "svg" else None
            canvases[kind].print_figure(folder / f"plot.{kind}", format=kind, dpi=120, metadata=metadata)


def _draw_half(axes: Any, half: dict[str, Any], xlabel: str) -> None:
    """Draws one of the two plots."""
    for line in half["lines"]:
        axes.plot(line["costs"], line["errors"], line["style"], **line["options"])
    for cost, error, name in half["names"]:
        axes.annotate(name, (cost, error), (5.0, 5.0), textcoords="offset points", fontsize="x-small")
    axes.axhline(half["doubt"], color="grey", ls=":", label="references' doubt")
    axes.set(title=half["title"], ylabel=half["ylabel"], xlabel=xlabel, xscale="log", yscale="log")
    axes.grid(alpha=0.3)
    axes.legend(fontsize="small")


def main() -> None:
    """Reads what is drawn, and where Python's packages are, and draws."""
    folder = Path(sys.argv[1])
    job = json.loads((folder / "figure.json").read_text(encoding="utf-8"))
    sys.path[:] = job["path"]
    draw(folder, job["figure"])


if __name__ == "__main__":
    main()
