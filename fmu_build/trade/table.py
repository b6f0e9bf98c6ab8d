"""A trade as tables, in Markdown, and as a plot."""

import io
from collections.abc import Mapping, Sequence
from typing import Any

from fmu_build.flight.choices import label
from supervessel.rotation.propagators import PROPAGATORS

ENOUGH = 1e-9
"""Integration error [rad] from which on a model's cheapest choice is quoted."""


def table(trade: Mapping[str, Any]) -> str:
    """Returns both tables of a trade: what each model leaves out, and what each choice costs."""
    same = [
        f"{label(model)}: the same as {', '.join(model['same'])}"
        for model in trade["models"]
        if model["same"]
    ]
    refused = [f"{one['choice']}: refused {one['reason']}" for one in trade["refused"]]
    notes = [
        f"Two references of the best model are {_brief(trade['doubt']['attitude'][-1])} rad and "
        f"{_brief(trade['doubt']['rate'][-1])} rad/s apart: less than that is not told.",
        *same,
        *refused,
    ]
    parts = [
        f"{trade['scene']}: {trade['experiment']['duration']:g} s in {trade['steps']} steps",
        drift_table(trade),
        choices_table(trade),
        "\n".join(notes),
    ]
    return "\n\n".join(parts)


def drift_table(trade: Mapping[str, Any]) -> str:
    """Returns how far each model has turned away from the best one by each horizon, and what it costs.

    The cost is that of the cheapest choice whose integration error is at most ENOUGH, or of the most exact.
    """
    horizons = [f"{horizon:g} s" for horizon in trade["horizons"]]
    lines = _heading(
        ["model", *(f"off by [rad] after {h}" for h in horizons), "cheapest", "us per s", "plain RK4 steps"],
        1,
    )
    best = trade["models"][-1]
    for model in trade["models"]:
        cheapest = _cheapest(model, trade["choices"])
        off = [
            "-" if model is best else _brief(x, doubt)
            for x, doubt in zip(model["attitude"], trade["doubt"]["attitude"], strict=True)
        ]
        cost = ["-", "-", "-"]
        if cheapest is not None:
            cost = [
                _name(cheapest),
                f"{cheapest['us_per_second']:.3g}",
                f"{cheapest['rk4_steps_per_step']:.2g}",
            ]
        lines.append(_line([label(model), *off, *cost]))
    return "\n".join(lines)


def _cheapest(model: Mapping[str, Any], choices: Sequence[Mapping[str, Any]]) -> Mapping[str, Any] | None:
    own = [row for row in choices if label(row) == label(model)]
    enough = [row for row in own if row["integration_attitude"] <= ENOUGH]
    if enough:
        return min(enough, key=lambda row: float(row["rk4_steps_per_step"]))
    return min(own, key=lambda row: float(row["integration_attitude"]), default=None)


def choices_table(trade: Mapping[str, Any]) -> str:
    """Returns what each choice errs by and costs; the Pareto front is marked."""
    lines = _heading(
        [
            "model",
            "propagator",
            "error [rad]",
            "of integration [rad]",
            "of rate [rad/s]",
            "of integration [rad/s]",
            "sub-steps per step",
            "ns per step",
            "us per s",
            "plain RK4 steps",
            "bytes",
            "Pareto",
        ],
        2,
    )
    for row in trade["choices"]:
        lines.append(
            _line(
                [
                    label(row),
                    _name(row),
                    *(
                        _brief(row[f"{part}{key}"], trade["doubt"][key][-1])
                        for key in ("attitude", "rate")
                        for part in ("", "integration_")
                    ),
                    f"{row['sub_steps'] / trade['steps']:.3g}",
                    f"{row['ns_per_step']:.0f}",
                    f"{row['us_per_second']:.3g}",
                    f"{row['rk4_steps_per_step']:.2g}",
                    str(row["bytes"]),
                    "*" if row["pareto"] else "",
                ]
            )
        )
    return "\n".join(lines)


def _name(row: Mapping[str, Any]) -> str:
    """Returns a choice's propagator with its settings: the ends, where several are the same."""
    return " ".join([f"`{row['propagator']}`", *_settings(row)])


def _settings(row: Mapping[str, Any]) -> list[str]:
    """Returns a choice's settings as text, in a list with one element or none."""
    ends = [f"{x:g}" for x in sorted(row["settings"])]
    return ends if len(ends) < 2 else [f"{ends[0]} to {ends[-1]}"]


def _heading(names: Sequence[str], words: int) -> list[str]:
    return [_line(names), "|" + "---|" * words + "---:|" * (len(names) - words)]


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _brief(error: float, doubt: float = 0.0) -> str:
    """Returns an error in two digits, one below the doubt as that."""
    if error < doubt:
        return f"< {doubt:.0e}"
    return f"{error:.1e}" if error else "0"


MARKERS = {name: row.marker for name, row in PROPAGATORS.items()} | {"auto": "^"}


ERROR = "largest error of the attitude in {:g} s [rad]"


def plot(trade: Mapping[str, Any]) -> dict[str, bytes]:
    """Returns the work-precision plot as "svg" and "png". Raises ImportError without matplotlib.

    Left the whole error of every choice, right that of integration alone under the best model; the settings
    of choices that nothing beats stand beside them.
    """
    from matplotlib import rc_context  # noqa: PLC0415
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415
    from matplotlib.backends.backend_svg import FigureCanvasSVG  # noqa: PLC0415
    from matplotlib.figure import Figure  # noqa: PLC0415

    figure = Figure(figsize=(12.0, 6.0), layout="constrained")
    whole, own = figure.subplots(1, 2)
    for i, model in enumerate(label(model) for model in trade["models"]):
        rows = [row for row in trade["choices"] if label(row) == model]
        for name, marker in MARKERS.items():
            _draw(whole, trade, "attitude", [r for r in rows if r["propagator"] == name], f"C{i}{marker}")
        whole.plot([], [], f"C{i}o", label=model)
    front = _draw(
        whole,
        trade,
        "attitude",
        [row for row in trade["choices"] if row["pareto"]],
        "k--",
        lw=0.8,
        label="Pareto front",
    )
    _name_points(whole, front)
    best = [row for row in trade["choices"] if label(row) == label(trade["models"][-1])]
    for name, marker in MARKERS.items():
        rows = [row for row in best if row["propagator"] == name]
        if rows:
            _draw(
                own,
                trade,
                "integration_attitude",
                rows,
                f"C{len(trade['models']) - 1}{marker}-",
                label=name,
                lw=0.6,
            )
    _name_points(own, _unbeaten(_points(trade, "integration_attitude", best)))
    whole.set(title=f"{trade['scene']}: model and integration", ylabel=ERROR.format(trade["horizons"][-1]))
    own.set(title=f"{label(trade['models'][-1])}: integration alone")
    for axes in (whole, own):
        axes.axhline(trade["doubt"]["attitude"][-1], color="grey", ls=":", label="references' doubt")
        axes.set(
            xscale="log",
            yscale="log",
            xlabel=f"cost of a step of {trade['experiment']['step']:g} s [plain RK4 steps]",
        )
        axes.grid(alpha=0.3)
        axes.legend(fontsize="small")
    drawn = {}
    with rc_context({"svg.hashsalt": trade["scene"]}):
        for kind, canvas in (("svg", FigureCanvasSVG(figure)), ("png", FigureCanvasAgg(figure))):
            stream = io.BytesIO()
            canvas.print_figure(
                stream, format=kind, dpi=120, metadata={"Date": None} if kind == "svg" else None
            )
            drawn[kind] = stream.getvalue()
    return drawn


Point = tuple[float, float, str]
"""Cost [plain RK4 steps], error [rad], the choice's name."""


def _points(trade: Mapping[str, Any], key: str, rows: Sequence[Mapping[str, Any]]) -> list[Point]:
    """Returns choices by cost, errors below the references' doubt as that."""
    floor = float(trade["doubt"]["attitude"][-1])
    named = [(row, " ".join([row["propagator"], *_settings(row)])) for row in rows]
    return sorted(
        (float(row["rk4_steps_per_step"]), max(float(row[key]), floor), name) for row, name in named
    )


def _unbeaten(points: Sequence[Point]) -> list[Point]:
    """Returns those of points, in the order of cost, that are more exact than all before them."""
    return [p for i, p in enumerate(points) if all(p[1] < other[1] for other in points[:i])]


def _draw(
    axes: Any,
    trade: Mapping[str, Any],
    key: str,
    rows: Sequence[Mapping[str, Any]],
    style: str,
    **options: Any,
) -> list[Point]:
    """Draws choices by cost and returns them."""
    points = _points(trade, key, rows)
    axes.plot([cost for cost, _, _ in points], [error for _, error, _ in points], style, alpha=0.7, **options)
    return points


def _name_points(axes: Any, points: Sequence[Point]) -> None:
    for cost, error, name in points:
        axes.annotate(name, (cost, error), (5.0, 5.0), textcoords="offset points", fontsize="x-small")
