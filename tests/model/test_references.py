"""What docstrings of the model cite is there: keys in REFERENCES.md, sections of docs/equations.md."""

import ast
import re
from pathlib import Path

import supervessel

MODEL = Path(supervessel.__path__[0])
FOLDER = MODEL.parent


def docstrings() -> str:
    """Returns all docstrings of the model, also those of constants, with single spaces."""
    texts = [
        node.value.value
        for path in sorted(MODEL.rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        if isinstance(node.value.value, str)
    ]
    return " ".join("\n".join(texts).split())


def test_every_key_that_is_cited_is_in_the_references() -> None:
    table = (FOLDER / "REFERENCES.md").read_text(encoding="utf-8")
    known = set(re.findall(r"^\| (\w+) \|", table, re.MULTILINE)) - {"key"}
    cited = set(re.findall(r"\[([A-Z][A-Z0-9]+)\]", docstrings()))
    assert len(cited) > 5
    assert cited <= known


def test_numbers_of_equations_that_are_cited_are_in_the_sections_that_are_named() -> None:
    page, cited = (FOLDER / "docs" / "equations.md").read_text(encoding="utf-8"), docstrings()
    sections = re.split(r"^#{2,3} (.+)$", page, flags=re.MULTILINE)
    numbers = [numbers_in(body) for body in sections]
    assert [n for found in numbers for n in found] == list(range(1, 29))
    count = 0
    for title, body in zip(sections[1::2], sections[2::2], strict=True):
        for found in re.findall(rf"{re.escape(title)}, eqs?\. (\(\d+\)(?:(?:, | to )\(\d+\))*)", cited):
            count += 1
            assert set(map(int, re.findall(r"\d+", found))) <= set(numbers_in(body)), (title, found)
    assert count > 5


def numbers_in(body: str) -> list[int]:
    """Returns the numbers of the equations in a part of the page: tags, or what follows an equation."""
    return [int(tag or number) for tag, number in re.findall(r"\\tag\{(\d+)\}|\$ \((\d+)\)", body)]


def test_every_section_of_the_equations_that_is_cited_is_on_the_page() -> None:
    page = (FOLDER / "docs" / "equations.md").read_text(encoding="utf-8")
    titles = re.findall(r"^#{2,3} (.+)$", page, re.MULTILINE)
    cited = re.findall(r"\[EQ\] (?!with the title)(.{60})", docstrings())
    assert len(cited) > 5
    for text in cited:
        assert text.startswith(tuple(titles)), text
