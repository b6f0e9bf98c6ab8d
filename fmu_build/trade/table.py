"""A trade as tables, in Markdown."""

from collections.abc import Mapping, Sequence
from typing import Any

from fmu_build.flight.choices import label
from fmu_build.trade.ranking import ranks

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
        "A model is known to what two ways to its motion are apart: smaller errors of its integration are "
        f"not told, nor whole errors below {_brief(trade['doubt']['attitude'][-1])} rad and "
        f"{_brief(trade['doubt']['rate'][-1])} rad/s, which the best model is known to.",
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

    Known to: how far two ways to its own motion are apart; what two models are known to adds up in how far
    they are off each other. The cost is that of `_cheapest`.
    """
    horizons = [f"{horizon:g} s" for horizon in trade["horizons"]]
    lines = _heading(
        [
            "model",
            *(f"off by [rad] after {h}" for h in horizons),
            "known to [rad]",
            "cheapest",
            "us per s",
            "plain RK4 steps",
        ],
        1,
    )
    best = trade["models"][-1]
    for model in trade["models"]:
        cheapest = _cheapest(model, trade["choices"])
        off = [
            "-" if model is best else _brief(x, doubt + own)
            for x, doubt, own in zip(
                model["attitude"], trade["doubt"]["attitude"], model["doubt"]["attitude"], strict=True
            )
        ]
        cost = ["-", "-", "-"]
        if cheapest is not None:
            cost = [
                _name(cheapest),
                f"{cheapest['us_per_second']:.3g}",
                f"{cheapest['rk4_steps_per_step']:.2g}",
            ]
        known = _brief(model["doubt"]["attitude"][-1])
        lines.append(_line([label(model), *off, known, *cost]))
    return "\n".join(lines)


def _cheapest(model: Mapping[str, Any], choices: Sequence[Mapping[str, Any]]) -> Mapping[str, Any] | None:
    """Returns the cheapest choice of a model whose integration error is at most ENOUGH.

    Where there is none, the cheapest of those whose error is below the model's doubt, which cannot be told
    apart; and where there is none either the most exact. None where nothing was flown.
    """
    own = [
        (rank, row) for rank, row in zip(ranks(choices), choices, strict=True) if label(row) == label(model)
    ]
    for limit in (ENOUGH, model["doubt"]["attitude"][-1]):
        enough = [one for one in own if one[1]["integration_attitude"] <= limit]
        if enough:
            return min(enough, key=lambda one: one[0])[1]
    return min((row for _, row in own), key=lambda row: float(row["integration_attitude"]), default=None)


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
    own = {label(model): model["doubt"] for model in trade["models"]}
    for row in trade["choices"]:
        lines.append(
            _line(
                [
                    label(row),
                    _name(row),
                    *(
                        _brief(row[f"{part}{key}"], doubt[key][-1])
                        for key in ("attitude", "rate")
                        for part, doubt in (("", trade["doubt"]), ("integration_", own[label(row)]))
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
    return " ".join([f"`{row['propagator']}`", *settings_of(row)])


def settings_of(row: Mapping[str, Any]) -> list[str]:
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
