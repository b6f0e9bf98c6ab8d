"""Lines and numbers of Orbiter's text files, where they stand, and what is wrong with them."""

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)


class ScenarioError(ValueError):
    """Files that make no scene; `problems` holds a line for each thing that is wrong with them."""

    def __init__(self, problems: Iterable[str]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(self.problems))


@dataclass(frozen=True)
class Place:
    """Where something stands: a line of a file, counted from 1, or (line 0) what `key` says."""

    path: Path
    line: int = 0
    key: str = ""

    def __str__(self) -> str:
        """As it stands before a problem."""
        return f"{self.path}:{self.line}" if self.line else f"{self.path}: {self.key}"

    @property
    def short(self) -> str:
        """As a comment in a scene has it."""
        return f"{self.path.name} line {self.line}" if self.line else f"{self.path.name} {self.key}"


@dataclass(frozen=True)
class Note:
    """Something that was missing, guessed or left out, and where."""

    place: Place
    text: str

    def __str__(self) -> str:
        return f"{self.place}: {self.text}"

    @property
    def short(self) -> str:
        """As a comment in a scene has it."""
        return f"{self.place.short}: {self.text}"


def read_text(path: Path) -> str:
    """Returns the text of a file. Raises ScenarioError where it cannot be read or is no UTF-8."""
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise ScenarioError([f"{path}: cannot be read: {error.strerror}"]) from None
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        byte = raw[error.start]
        raise ScenarioError([f"{path}:{line}: is not UTF-8 text (byte 0x{byte:02x})"]) from None
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise ScenarioError([f"{path}:{line}: is not UTF-8 text (byte 0x00)"])
    return text


def read_lines(path: Path) -> list[str]:
    """Returns the lines of a file without comments (from a semicolon on) and outer blanks."""
    return [line.partition(";")[0].strip() for line in read_text(path).split("\n")]


def numbers(words: Sequence[str], count: int) -> tuple[float, ...] | None:
    """Returns `count` finite numbers, None where the words are something else."""
    if len(words) != count or not all(NUMBER.fullmatch(word) for word in words):
        return None
    values = tuple(float(word) for word in words)
    return values if all(map(math.isfinite, values)) else None


def printable(text: str) -> str:
    """Returns a text as a comment may hold it: what cannot be printed becomes a question mark."""
    return "".join(character if character.isprintable() else "?" for character in text)
