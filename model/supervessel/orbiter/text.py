"""Lines and numbers of Orbiter's text files, where they stand, and what is wrong with them."""

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from supervessel.problems import LONGEST_PROBLEM, first, lines, printable
from supervessel.shell.reading import LARGEST_TEXT, ReadingError, not_utf8, read_text

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)


class ScenarioError(ValueError):
    """Files that make no scene; `problems` holds a line for each thing that is wrong with them.

    Its text is the first of them, as `SceneError` has it.
    """

    def __init__(self, problems: Iterable[str]) -> None:
        self.problems = lines(problems)
        super().__init__("\n".join(first(self.problems)))


@dataclass(frozen=True)
class Place:
    """Where something stands: a line of a file, counted from 1, or (line 0) what `key` says."""

    path: Path
    line: int = 0
    key: str = ""

    def __str__(self) -> str:
        """As it stands before a problem."""
        path = printable(str(self.path))
        return f"{path}:{self.line}" if self.line else f"{path}: {self.key}"

    @property
    def short(self) -> str:
        """As a comment in a scene has it."""
        name = printable(self.path.name)
        return f"{name} line {self.line}" if self.line else f"{name} {self.key}"


@dataclass(frozen=True)
class Note:
    """Something that was missing, guessed or left out, and where."""

    place: Place
    text: str

    def __str__(self) -> str:
        return printable(f"{self.place}: {self.text}", LONGEST_PROBLEM)

    @property
    def short(self) -> str:
        """As a comment in a scene has it."""
        return printable(f"{self.place.short}: {self.text}", LONGEST_PROBLEM)


def unread(path: Path, error: ReadingError) -> ScenarioError:
    """Returns what `read_text` or `read_toml` says, with its place."""
    shown = printable(str(path))
    return ScenarioError([f"{shown}:{error.line}: {error}" if error.line else f"{shown}: {error}"])


def read_lines(path: Path) -> list[str]:
    """Returns the lines of a file without comments (from a semicolon on) and outer blanks.

    Bytes that are not UTF-8 are kept, see `read_text`; what is used of a line passes `foreign` first.
    Raises ScenarioError where the file cannot be read.
    """
    try:
        text = read_text(path, LARGEST_TEXT, foreign=True)
    except ReadingError as error:
        raise unread(path, error) from None
    return [line.partition(";")[0].strip() for line in text.split("\n")]


def foreign(place: Place, text: str) -> list[str]:
    """Returns the problem of a text from `read_lines` that has bytes which are not UTF-8, if it has some."""
    problem, _ = not_utf8(text)
    return [f"{place}: {problem}"] if problem else []


def numbers(words: Sequence[str], count: int) -> tuple[float, ...] | None:
    """Returns `count` finite numbers, None where the words are something else."""
    if len(words) != count or not all(NUMBER.fullmatch(word) for word in words):
        return None
    values = tuple(float(word) for word in words)
    return values if all(map(math.isfinite, values)) else None
