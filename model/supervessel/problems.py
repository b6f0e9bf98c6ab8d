"""What is wrong with a scene, in the user's words: every problem at once, each with its place."""

import json
from collections.abc import Iterable
from difflib import get_close_matches

LONGEST_INTEGER = 10**400
"""Integers from here on are described, not printed; no double holds them anyway."""


class SceneError(ValueError):
    """A scene that cannot be used; `problems` holds one line for each thing that is wrong with it."""

    def __init__(self, source: str, problems: Iterable[str]) -> None:
        self.source = source
        self.problems = tuple(problems)
        super().__init__("\n".join(f"{source}: {problem}" for problem in self.problems))


def unknown(kind: str, name: str, known: Iterable[str]) -> str:
    """Returns 'unknown KIND "NAME"' with the nearest known name, or all of them where none is near."""
    names = list(known)
    near = get_close_matches(name, names, n=1, cutoff=0.5)
    if near:
        return f'unknown {kind} "{name}" (did you mean "{near[0]}"?)'
    if names:
        return f'unknown {kind} "{name}"; known: {", ".join(names)}'
    return f'unknown {kind} "{name}"; there is none to name here'


def quantity(value: object, unit: str = "") -> str:
    """Returns a value as a TOML author wrote it, with its unit."""
    if isinstance(value, bool):
        text = str(value).lower()
    elif isinstance(value, list | tuple):
        text = "[" + ", ".join(quantity(element) for element in value) + "]"
    elif isinstance(value, dict):
        text = "{" + ", ".join(f"{key} = {quantity(element)}" for key, element in value.items()) + "}"
    elif isinstance(value, str):
        text = json.dumps(value, ensure_ascii=False)
    elif isinstance(value, int) and abs(value) >= LONGEST_INTEGER:
        text = f"an integer of {len(hex(abs(value))) - 2} hexadecimal digits"
    else:
        text = str(value)
    return f"{text} {unit}" if unit else text
