"""What is wrong with a scene, in the user's words: every problem at once, each with its place.

Whatever comes from a file or a command line passes `printable` before it is shown.
"""

import json
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from difflib import SequenceMatcher, get_close_matches
from heapq import nlargest
from itertools import islice
from typing import Any

LONGEST_WORD = 200
"""Characters that are shown of a name, of a value, of the name of a file."""
LONGEST_LIST = 400
"""Characters that are shown of a list of names."""
LONGEST_PROBLEM = 2000
"""Characters that are shown of a problem."""
MOST_PROBLEMS = 100
"""Problems that are printed; the others are counted."""
MOST_SUGGESTIONS = 20
"""Unknown names for which a known one is suggested."""
MOST_LEVELS = 8
"""Lists and tables within each other that are shown of a value."""
LONGEST_INTEGER = 10**400
"""Integers from here on are described, not printed; no double holds them anyway."""

LONGEST_COMPARED = 60
MOST_COMPARED = 2000
MOST_LIKELY = 8
"""Letters of an unknown name, known names that are looked at, and those that are compared letter by letter:
more is not worth the time."""
LEAST_LIKENESS = 0.5

UNSEEN = re.compile(
    "[\u034f\u115f\u1160\u17b4\u17b5\u180b-\u180f\u2800\u3164\ufe00-\ufe0f\uffa0\U000e0100-\U000e01ef]"
)
"""Characters that nobody sees although Python calls them printable: fillers, joiners, selectors."""
BARE = re.compile(r"[A-Za-z0-9_-]+")
"""A key that TOML takes without quotes."""

_suggestions: ContextVar[Iterator[int] | None] = ContextVar("suggestions", default=None)


class SceneError(ValueError):
    """A scene that cannot be used; `problems` holds one line for each thing that is wrong with it.

    Its text is the first MOST_PROBLEMS of them, each after the name of the file, and how many more there are.
    """

    def __init__(self, source: str, problems: Iterable[str]) -> None:
        self.source = source
        self.problems = lines(problems)
        super().__init__("\n".join(f"{printable(source)}: {problem}" for problem in first(self.problems)))


class TradeError(RuntimeError):
    """A trade that cannot be made; the message says why, in lines that can be shown."""

    def __init__(self, message: str) -> None:
        super().__init__(shown_message(message))


class AccuracyError(TradeError):
    """An accuracy that cannot be had; the message says what can."""


def printable(text: str, longest: int = LONGEST_WORD) -> str:
    r"""Returns a text as it can be shown in a line, of at most `longest` characters.

    Escapes stand for what moves the cursor, turns the direction of writing or cannot be seen: controls, line
    ends, bidirectional marks, characters of no width, halves of surrogate pairs (of file names that are not
    UTF-8). Of a longer text the middle is left out; how long it is stands there.

    Example:
        >>> from supervessel.problems import printable
        >>> print(printable("\x1b[31mred"))
        \x1b[31mred
    """
    if len(text) <= longest and text.isascii() and text.isprintable():
        return text
    shown = text if len(text) <= longest else text[:longest] + text[-longest:]
    shown = "".join(map(_escaped, shown))
    if len(text) <= longest and len(shown) <= longest:
        return shown
    mark = f" ... ({len(text)} characters) ... "
    end = (longest - len(mark)) // 4
    return shown[: longest - len(mark) - end] + mark + shown[len(shown) - end :]


def _escaped(character: str) -> str:
    if character.isprintable() and not UNSEEN.match(character):
        return character
    return character.encode("unicode_escape").decode()


def lines(problems: Iterable[str]) -> tuple[str, ...]:
    """Returns problems, each as one line that can be shown."""
    return tuple(printable(problem, LONGEST_PROBLEM) for problem in problems)


def first(texts: Collection[str], kind: str = "problems") -> Iterator[str]:
    """Yields as many texts as are printed, then how many more there are."""
    yield from islice(texts, MOST_PROBLEMS)
    if len(texts) > MOST_PROBLEMS:
        yield f"... and {len(texts) - MOST_PROBLEMS} more {kind}"


def listed(names: Iterable[str], count: int, between: str = ", ") -> str:
    """Returns the first of `count` names, commas between them, and how many more there are."""
    shown: list[str] = []
    length = 0
    for name in names:
        text = printable(name)
        length += len(text) + len(between)
        if shown and length > LONGEST_LIST:
            return f"{between.join(shown)} and {count - len(shown)} more"
        shown.append(text)
    return between.join(shown)


def key_path(place: Iterable[Any]) -> str:
    """Returns a place in a scene file as its author would write it: vessels.DG.ports.nose, docks[1]."""
    path = ""
    for part in place:
        if isinstance(part, int):
            path += f"[{part + 1}]"
        else:
            path += ("." if path else "") + toml_key(str(part))
    return path


def toml_key(name: str) -> str:
    """Returns a key as TOML has it: in quotes where it needs them."""
    if name.isascii() and name.isidentifier() and len(name) <= LONGEST_WORD:  # as nearly all are
        return name
    return printable(name if BARE.fullmatch(name) else json.dumps(name, ensure_ascii=False))


def shown_message(message: str) -> str:
    """Returns the text of an exception, each of its lines as it can be shown."""
    return "\n".join(lines(message.split("\n")))


@contextmanager
def few_suggestions() -> Iterator[None]:
    """Within it known names are suggested for the first MOST_SUGGESTIONS unknown ones: each takes time."""
    token = _suggestions.set(iter(range(MOST_SUGGESTIONS)))
    try:
        yield
    finally:
        _suggestions.reset(token)


def unknown(kind: str, name: str, known: Collection[str]) -> str:
    """Returns 'unknown KIND "NAME"' with the nearest known name, or all of them where none is near.

    Within `few_suggestions` the later ones come without.
    """
    told = f'unknown {printable(kind)} "{printable(name)}"'
    left = _suggestions.get()
    if left is not None and next(left, None) is None:
        return told
    near = _nearest(name, known)
    if near:
        return f'{told} (did you mean "{printable(near)}"?)'
    if known:
        return f"{told}; known: {listed(known, len(known))}"
    return f"{told}; there is none to name here"


def _nearest(name: str, known: Iterable[str]) -> str:
    """Returns the known name that is most like another, "" where none is like it."""
    size = len(name)
    if size > LONGEST_COMPARED:
        return ""
    fitting = (one for one in known if size <= 3 * len(one) and len(one) <= 3 * size)
    matcher = SequenceMatcher(b=name)

    def likeness(one: str) -> float:
        """Returns what the ratio of `SequenceMatcher` is at most."""
        matcher.set_seq1(one)
        return matcher.quick_ratio()

    likely = nlargest(MOST_LIKELY, islice(fitting, MOST_COMPARED), key=likeness)
    return next(iter(get_close_matches(name, likely, n=1, cutoff=LEAST_LIKENESS)), "")


def quantity(value: object, unit: str = "") -> str:
    """Returns a value as a TOML author wrote it, with its unit."""
    text = printable(_quantity(value, MOST_LEVELS))
    return f"{text} {unit}" if unit else text


def _quantity(value: object, levels: int) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple):
        return f"[{_elements((_quantity(x, levels - 1) for x in value), len(value), levels)}]"
    if isinstance(value, Mapping):
        pairs = (f"{toml_key(str(key))} = {_quantity(x, levels - 1)}" for key, x in value.items())
        return f"{{{_elements(pairs, len(value), levels)}}}"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, int) and abs(value) >= LONGEST_INTEGER:
        return f"an integer of {len(hex(abs(value))) - 2} hexadecimal digits"
    return str(value)


def _elements(texts: Iterator[str], count: int, levels: int) -> str:
    """Returns elements of a list or table, without those that have no room in a word."""
    if levels <= 0 and count:
        return "..."
    shown, length = [], 0
    for text in texts:
        shown.append(text)
        length += len(text) + 2
        if length > 2 * LONGEST_WORD and len(shown) < count:
            return f"{', '.join(shown)}, ... ({count} elements)"
    return ", ".join(shown)
