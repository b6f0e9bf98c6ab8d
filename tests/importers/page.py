"""Writes the table of importers into its page from what the cells have left: the end of `make importers`.

PYTHONPATH=tests python -m importers.page
"""

import datetime
import json
import platform
import sys

from importers.cells import Cell, place
from importers.known import KNOWN, Fault, explains
from importers.scenes import COURSES
from importers.table import ROWS, Row
from importers.tools import HERE, version

PAGE = HERE.parents[1] / "fmu_build" / "docs" / "importers.md"
START, END = "<!-- table: make importers -->", "<!-- end of table -->"


def main() -> None:
    """Replaces the table of the page."""
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(START)
    after = rest.partition(END)[2]
    notes: list[str] = []
    rows = [_line(key, row, notes) for key, row in ROWS.items()]
    text = "\n".join([_heading(), "", *_head(), *rows, "", *(f"{i}. {n}" for i, n in enumerate(notes, 1))])
    PAGE.write_text(f"{before}{START}\n\n{text.rstrip()}\n\n{END}{after}", encoding="utf-8")
    print(f"{PAGE}: written", file=sys.stderr)


def _heading() -> str:
    when = datetime.datetime.now(datetime.UTC).date().isoformat()
    return f"{when}, {platform.machine()} {platform.system()}:"


def _head() -> list[str]:
    titles = ["importer", "version", "interface", *COURSES]
    return [f"| {' | '.join(titles)} |", "|---|---|---|" + "---:|" * len(COURSES)]


def _line(key: str, row: Row, notes: list[str]) -> str:
    way = f"FMI {row.fmi}, " + ("model exchange" if row.exchange else "co-simulation")
    if not row.flies:
        way = f"FMI {row.fmi}, checked"
    cells = [_text(key, row, name, notes) for name in COURSES]
    return f"| {row.name} | {version(row.package)} | {way} | {' | '.join(cells)} |"


def _text(key: str, row: Row, name: str, notes: list[str]) -> str:
    """Returns a cell; what it has to say stands once in `notes`, which is added to."""
    file = place(key, name)
    if not file.exists():
        return "not run"
    cell = Cell(**json.loads(file.read_text(encoding="utf-8")))
    if cell.lacking:
        return f"not run [{_note(f'Not run: {cell.lacking}.', notes)}]"
    if cell.passed:
        return "valid" if not row.flies else f"{cell.deviation:.0e}"
    fault = KNOWN.get((key, name))
    reason = _explained(cell, fault) if fault and explains(fault, cell) else _unexplained(cell)
    return f"**red** [{_note(reason, notes)}]"


def _explained(cell: Cell, fault: Fault) -> str:
    return f"{fault.reason} {fault.shown}".strip()


def _unexplained(cell: Cell) -> str:
    if cell.instead:
        return f"By no known fault of the importer's: `{cell.instead.replace('`', chr(39))}`"
    return f"By no known fault of the importer's: off by {cell.deviation:.1e}, allowed {cell.tolerance:.1e}."


def _note(text: str, notes: list[str]) -> int:
    if text not in notes:
        notes.append(text)
    return notes.index(text) + 1


if __name__ == "__main__":
    main()
