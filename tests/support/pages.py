"""The README and the pages that it leads to: their text, their blocks of code, their headings and links."""

import re
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[2]

PAGES = {
    str(path.relative_to(ROOT)): path
    for path in sorted(
        [
            ROOT / "README.md",
            ROOT / "CHANGELOG.md",
            ROOT / "model" / "REFERENCES.md",
            ROOT / "examples" / "README.md",
            ROOT / "tests" / "MEASURED.md",
            *(ROOT / "model" / "docs").glob("*.md"),
            *(ROOT / "fmu_build" / "docs").glob("*.md"),
        ]
    )
}
"""Paths by their names from the project's folder."""


def text(page: str) -> str:
    """Returns the text of a page, by its name in PAGES."""
    return PAGES[page].read_text(encoding="utf-8")


def section(page: str, heading: str) -> str:
    """Returns what stands below a heading, given with its #, up to the next one of the same rank."""
    _, found, rest = text(page).partition(f"\n{heading}\n")
    assert found, f"{page} has no heading {heading!r}"
    return re.split(rf"^{heading.split(maxsplit=1)[0]} ", rest, maxsplit=1, flags=re.MULTILINE)[0]


def blocks(page: str, language: str) -> list[str]:
    """Returns the blocks of code of a language in a page."""
    return re.findall(rf"^```{language}\n(.*?)^```", text(page), re.DOTALL | re.MULTILINE)


def prose(page: str) -> str:
    """Returns a page's text without blocks of code."""
    return re.sub(r"^```.*?^```", "", text(page), flags=re.DOTALL | re.MULTILINE)


def links(page: str) -> list[str]:
    """Returns the targets of a page's links and pictures."""
    return re.findall(r"\]\(([^)\s]+)\)", re.sub(r"`[^`]*`", "", prose(page)))


def anchors(page: str) -> set[str]:
    """Returns the names that headings of a page have as targets of links, as GitHub makes them."""
    names, seen = set(), Counter[str]()
    for title in re.findall(r"^#+ (.*)$", prose(page), re.MULTILINE):
        words = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", title).strip().lower()
        name = re.sub(r"[^\w\- ]", "", words).replace(" ", "-")
        names.add(f"{name}-{seen[name]}" if seen[name] else name)
        seen[name] += 1
    return names
