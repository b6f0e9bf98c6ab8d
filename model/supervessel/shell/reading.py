"""Reading text files that somebody else wrote: their size, lines and depth are bounded."""

import os
import re
import stat
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

LARGEST_TOML = 2_000_000
LARGEST_TEXT = 4_000_000
"""Bytes of a TOML file, of a file of Orbiter's."""
LONGEST_LINE = 100_000
"""Characters of a line."""
DEEPEST = 16
"""Brackets and braces within each other in a TOML file."""
MOST_PARTS = 8
"""Parts of a key: vessels.DG.ports.nose has four."""

HANDED_OVER = re.compile(r"/dev/stdin|(/dev|/proc/self)/fd/\d+")
"""Names of files that were open before the command began."""

STRING = (
    r'"""(?:[^"\\]|\\.?|"(?!""))*+(?:"{3,5})?'
    r"|'''(?:[^']|'(?!''))*+(?:'{3,5})?"
    r'|"(?:[^"\\\n]|\\[^\n]?)*+"?'
    r"|'[^'\n]*+'?"
)
"""A string of TOML, or what begins as one."""
COMMENT = r"#[^\n]*+"
BRACKETS = re.compile(rf"{STRING}|{COMMENT}|([\[\]{{}}])", re.DOTALL)
"""What tells how deep brackets stand: those in strings and comments do not."""
NOTHING = bytes(set(range(256)) - set(b"[]{}\"'#\n=,."))
"""What brackets, strings and comments do without, and what stands between two strings."""
SQUARE = str.maketrans("{}", "[]")
NOT_TEXT = re.compile("[\0\udc80-\udcff]")
"""A null, and what stands for a byte that is not UTF-8."""
PARTS = re.compile(
    rf"(?P<part>{STRING}|[^\s\"'#.,=\[\]{{}}]++)|(?P<dot>\.)|{COMMENT}|[,=\[\]{{}}\n]", re.DOTALL
)


class ReadingError(ValueError):
    """A file that cannot be used, and why; `line` is where, from 1, or 0 for the whole of it."""

    def __init__(self, problem: str, line: int = 0) -> None:
        self.line = line
        super().__init__(problem)


def read_toml(path: Path, number: Callable[[str], Any] = float) -> dict[str, Any]:
    """Returns the tables of a TOML file. Raises ReadingError.

    number : makes a number of the text of each one that is no integer
    """
    return tables_of(read_text(path, LARGEST_TOML), number)


def tables_of(text: str, number: Callable[[str], Any] = float) -> dict[str, Any]:
    """Returns the tables of a TOML text as `read_toml` does. Raises ReadingError."""
    _check_depth(text)
    _check_keys(text)
    try:
        return tomllib.loads(text, parse_float=number)
    except ValueError as error:  # of integers too long as well
        raise ReadingError(f"is not TOML: {error}") from None


def read_text(path: Path, most: int, foreign: bool = False) -> str:
    """Returns the text of a file of at most so many bytes, without a byte order mark. Raises ReadingError.

    foreign : whether bytes that are not UTF-8 are accepted; "\\udc80" to "\\udcff" then stand for them
    A file is what is on a disk; pipes are read only where they were handed over, as /dev/stdin or /dev/fd/N:
    any other may keep us waiting for ever.
    """
    try:
        raw = _read(path, most + 1)
    except OSError as error:
        raise ReadingError(f"cannot be read: {error.strerror}") from None
    except ReadingError:
        raise
    except ValueError:  # of a null in the name
        raise ReadingError("cannot be read: no file has such a name") from None
    return text_of(raw, most, foreign)


def text_of(raw: bytes, most: int, foreign: bool = False) -> str:
    """Returns the text in what was read of a file, see `read_text`. Raises ReadingError."""
    if len(raw) > most:
        raise ReadingError(f"is longer than {most} bytes; at most that many are read")
    text = raw.decode("utf-8-sig", "surrogateescape")
    if "\0" in text or not foreign:
        problem, place = not_utf8(text)
        if problem:
            raise ReadingError(problem, _line(text, place))
    if len(text) > LONGEST_LINE:
        for number, line in enumerate(text.split("\n"), start=1):
            if len(line) > LONGEST_LINE:
                raise ReadingError(f"{len(line)} characters; a line has at most {LONGEST_LINE}", number)
    return text


def not_utf8(text: str) -> tuple[str, int]:
    """Returns the first byte of a text, as `read_text` returns it, that is not UTF-8, in words, and where.

    "" and 0 where there is none. A null counts as one.
    """
    found = NOT_TEXT.search(text)
    if found is None:
        return "", 0
    return f"is not UTF-8 text (byte 0x{ord(found[0]) & 0xFF:02x})", found.start()


def _read(path: Path, most: int) -> bytes:
    """Returns so many bytes of a file at most. Raises OSError, ReadingError for what is no file."""
    check_kind(path, path.stat().st_mode)
    with path.open("rb") as stream:
        check_kind(path, os.fstat(stream.fileno()).st_mode)
        return stream.read(most)


def check_kind(path: Path, mode: int) -> None:
    """Raises ReadingError for what is neither a file on a disk nor a pipe that was handed over."""
    if stat.S_ISREG(mode) or stat.S_ISDIR(mode):  # opening a folder fails by itself
        return
    if not (stat.S_ISFIFO(mode) and is_handed_over(path)):
        raise ReadingError("is no regular file; only those are read, and pipes as /dev/stdin or /dev/fd/N")


def is_handed_over(path: Path) -> bool:
    """Whether a name is that of something that was open before the command began: it names no file."""
    return HANDED_OVER.fullmatch(str(path)) is not None


def _check_depth(text: str) -> None:
    """Raises ReadingError where brackets stand too deep within each other for the parser, which recurses."""
    some = text
    if not any(mark in text for mark in ("\\", '"""', "'''")):  # strings keep their ends without the rest
        some = text.encode().translate(None, NOTHING).decode()
    brackets = "".join(BRACKETS.findall(some)).translate(SQUARE)
    for _ in range(DEEPEST):  # each time the innermost ones go
        brackets = brackets.replace("[]", "")
    if not brackets:
        return
    depth = deepest = place = 0
    for match in BRACKETS.finditer(text):
        bracket = match[1]
        if bracket is None:
            continue
        depth = depth + 1 if bracket in "[{" else max(depth - 1, 0)
        if depth > deepest:
            place = match.start() if deepest <= DEEPEST else place
            deepest = depth
    if deepest > DEEPEST:
        raise ReadingError(f"brackets {deepest} deep; at most {DEEPEST} are possible", _line(text, place))


def _check_keys(text: str) -> None:
    """Raises ReadingError where a key has too many parts: the parser's work grows with their square."""
    if all(line.count(".") < MOST_PARTS for line in text.split("\n")):
        return
    dots, most, place = 0, 0, 0
    after_dot = False
    for match in PARTS.finditer(text):
        kind = match.lastgroup
        if kind == "dot":
            dots += 1
            if dots > most:
                most, place = dots, place if most >= MOST_PARTS else match.start()
            after_dot = True
        elif kind == "part":
            dots = dots if after_dot else 0
            after_dot = False
        else:
            dots, after_dot = 0, False
    if most >= MOST_PARTS:
        problem = f"a key of {most + 1} parts; at most {MOST_PARTS} are possible"
        raise ReadingError(problem, _line(text, place))


def _line(text: str, position: int) -> int:
    return text.count("\n", 0, position) + 1
