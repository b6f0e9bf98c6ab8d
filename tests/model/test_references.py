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


def test_every_section_of_the_equations_that_is_cited_is_on_the_page() -> None:
    page = (FOLDER / "docs" / "equations.md").read_text(encoding="utf-8")
    titles = re.findall(r"^#{2,3} (.+)$", page, re.MULTILINE)
    cited = re.findall(r"\[EQ\] (?!with the title)(.{60})", docstrings())
    assert len(cited) > 5
    for text in cited:
        assert text.startswith(tuple(titles)), text
