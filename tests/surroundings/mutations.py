"""Files that somebody spoilt: bytes, words, lines, numbers and structure changed at random, by a seed."""

import random
import re
from collections.abc import Callable

NUMBERS = (
    *("0", "-0.0", "1e308", "-1e308", "1e-308", "5e-324", "1e999", "inf", "-inf", "nan", "1e160", "1e-160"),
    *("9" * 400, "9" * 5000, "0x" + "f" * 2000, "1_000", "0b1", "1e22", "0.1", "3", "true", "1979-05-27"),
)
WORDS = (
    *(
        '""',
        '"\\u0000"',
        '"\u202e"',
        "'\x1b[31m'",
        "\ufeff",
        "\x00",
        "é",
        "\U0001f680",
        '"""',
        "'''",
        "#",
        ";",
    ),
    *("[", "]", "{", "}", "[[", "]]", "=", ",", ".", ":", '"', "'", "\\", "\r", "\n", "\t", "\u2028", " "),
    *(
        "[" * 300,
        "{" * 300,
        "a." * 300,
        "x" * 3000,
        "[rotation]",
        "[[docks]]",
        "END",
        "BEGIN_SHIPS",
        "END_SHIPS",
    ),
    *("con", "NUL", "time", "state", "mass", "DOCKINFO 0:0,X", "PRPLEVEL 0:1", "BaseClass = X", "Size = 1"),
)
NUMBER = re.compile(r"-?\d+\.?\d*(?:[eE][+-]?\d+)?")
TOKEN = re.compile(r"[\w.-]+|[^\w\s]|\n")


def mutated(text: str, rng: random.Random) -> bytes:
    """Returns a text with one to four changes, now and then with bytes that are no text."""
    for _ in range(rng.choice((1, 1, 1, 2, 3, 4))):
        text = rng.choice(CHANGES)(text, rng) or "\n"
    raw = text.encode("utf-8", "surrogatepass")
    return _bytes(raw, rng) if rng.random() < 0.08 else raw


def _bytes(raw: bytes, rng: random.Random) -> bytes:
    place = rng.randrange(len(raw))
    kind = rng.randrange(4)
    if kind == 0:
        return raw[:place] + bytes(rng.randrange(256) for _ in range(rng.randint(1, 5))) + raw[place:]
    if kind == 1:
        return raw[:place] + bytes((raw[place] ^ 1 << rng.randrange(8),)) + raw[place + 1 :]
    if kind == 2:
        return raw.decode("utf-8", "replace").encode("utf-16")
    return raw[:place]


def _spot(pattern: re.Pattern[str], text: str, rng: random.Random) -> tuple[int, int]:
    spots = [match.span() for match in pattern.finditer(text)]
    return rng.choice(spots) if spots else (0, 0)


def _number(text: str, rng: random.Random) -> str:
    begin, end = _spot(NUMBER, text, rng)
    new = (
        rng.choice(NUMBERS) if rng.random() < 0.7 else f"{rng.uniform(-1, 1) * 10 ** rng.uniform(-320, 308)}"
    )
    return text[:begin] + new + text[end:]


def _word(text: str, rng: random.Random) -> str:
    begin, end = _spot(TOKEN, text, rng)
    return text[:begin] + rng.choice(WORDS) + text[end if rng.random() < 0.7 else begin :]


def _swapped(text: str, rng: random.Random) -> str:
    (a, b), (c, d) = sorted((_spot(TOKEN, text, rng), _spot(TOKEN, text, rng)))
    return text[:a] + text[c:d] + text[b:c] + text[a:b] + text[d:] if b <= c else text


def _without_token(text: str, rng: random.Random) -> str:
    begin, end = _spot(TOKEN, text, rng)
    return text[:begin] + text[end:]


def _without_line(text: str, rng: random.Random) -> str:
    lines = text.split("\n")
    del lines[rng.randrange(len(lines))]
    return "\n".join(lines)


def _lines_again(text: str, rng: random.Random) -> str:
    """Repeats some lines elsewhere: keys, tables, ships and docks are there twice."""
    lines = text.split("\n")
    begin = rng.randrange(len(lines))
    some = lines[begin : begin + rng.randint(1, 8)] * rng.choice((1, 1, 2, 50))
    place = rng.randrange(len(lines))
    return "\n".join(lines[:place] + some + lines[place:])


def _character(text: str, rng: random.Random) -> str:
    place = rng.randrange(len(text))
    odd = chr(rng.choice((rng.randrange(32), rng.randrange(128, 0x3000), rng.randrange(0xD800, 0x110000))))
    return text[:place] + odd + text[place + rng.randint(0, 1) :]


def _truncated(text: str, rng: random.Random) -> str:
    return text[: rng.randrange(len(text))]


def _nested(text: str, rng: random.Random) -> str:
    begin, end = _spot(NUMBER, text, rng)
    depth = rng.choice((1, 2, 10, 20, 600))
    opening, closing = rng.choice((("[", "]"), ("{a = ", "}"), ("[[", "]]")))
    return text[:begin] + opening * depth + text[begin:end] + closing * depth + text[end:]


def _renamed(text: str, rng: random.Random) -> str:
    """Gives one name another's place wherever it stands."""
    (a, b), (c, d) = _spot(TOKEN, text, rng), _spot(TOKEN, text, rng)
    return text.replace(text[a:b], text[c:d]) if len(text[a:b]) > 1 else text


CHANGES: tuple[Callable[[str, random.Random], str], ...] = (
    *(_number, _number, _number, _word, _word, _swapped, _without_token, _without_line, _lines_again),
    *(_character, _truncated, _nested, _renamed),
)
