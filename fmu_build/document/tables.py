"""Tables in HTML, and numbers as text."""

from collections.abc import Iterable, Sequence
from html import escape
from math import floor, log10

import numpy as np
from numpy.typing import ArrayLike

Cell = str | float | Sequence[float]
"""Content of a cell: text, which is escaped, a number, or several."""


def table(caption: str, head: Sequence[str], rows: Iterable[Sequence[Cell]]) -> str:
    """Returns a table; texts are escaped. Without `head` the first cell of each row is its heading."""
    lines = ['<div class="wide"><table>']
    if caption:
        lines.append(f"<caption>{escape(caption)}</caption>")
    if head:
        cells = "".join(f'<th scope="col">{escape(cell)}</th>' for cell in head)
        lines.append(f"<thead><tr>{cells}</tr></thead>")
    lines.append("<tbody>")
    for row in rows:
        first = "" if head else f'<th scope="row">{_cell(row[0])}</th>'
        lines.append(
            "<tr>" + first + "".join(_data(cell, bool(head)) for cell in row[0 if head else 1 :]) + "</tr>"
        )
    return "\n".join([*lines, "</tbody>", "</table></div>\n"])


def _data(cell: Cell, in_column: bool) -> str:
    kind = ' class="number"' if in_column and isinstance(cell, int | float) else ""
    return f"<td{kind}>{_cell(cell)}</td>"


def _cell(cell: Cell) -> str:
    if isinstance(cell, str):
        return escape(cell)
    if isinstance(cell, int | float):
        return number_text(cell)
    return ", ".join(number_text(number) for number in cell)


def number_text(value: float) -> str:
    """Returns a number with all the digits that tell it from its neighbours, 1.0 as 1."""
    return repr(float(value)).removesuffix(".0")


def rounded(vector: ArrayLike) -> list[float]:
    """Returns calculated numbers to nine digits of the largest one, so that a zero shows no rounding."""
    numbers = np.asarray(vector, dtype=float)
    largest = float(np.abs(numbers).max())
    if largest == 0.0 or not np.isfinite(largest):
        return [float(number) for number in numbers]
    digits = 8 - floor(log10(largest))
    return [round(float(number), digits) + 0.0 for number in numbers]
