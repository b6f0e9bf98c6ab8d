"""The text of a scene file that is read back as the same scene."""

import json
from collections.abc import Iterator, Mapping
from typing import Any

from supervessel.problems import BARE
from supervessel.scene.numbers import WrittenNumber
from supervessel.scene.schema import CHOSEN, Scene


def scene_text(scene: Scene) -> str:
    """Returns the text of a file, TOML, that `load_scene` reads as the same scene.

    It has the keys that the scene gives, defaults are left out, and each number to the last bit; numbers that
    `mend` has moved are as they were published, to the last digit. Comments and the order of keys are not
    those of the file that the scene was read from. What `[accuracy]` has chosen is
    left to be chosen again.

    Example:
        >>> scene_text(scene).splitlines()[0]
        'name = "iss_dg"'
    """
    raw = scene.model_dump(mode="json", exclude_unset=True, exclude_none=True)
    for name, vessel in scene.vessels.items():
        raw["vessels"][name] |= vessel.published
    if scene.accuracy is not None and "rotation" in raw:
        raw["rotation"] = {key: value for key, value in raw["rotation"].items() if key not in CHOSEN}
    return "\n".join(_table(raw, ())) + "\n"


def _table(table: Mapping[str, Any], place: tuple[str, ...]) -> Iterator[str]:
    """Yields the lines of a table: its own keys first, then the tables in it, which end those."""
    inner = {key: value for key, value in table.items() if _is_table(value) or _is_tables(value)}
    yield from (f"{_key(key)} = {_value(value)}" for key, value in table.items() if key not in inner)
    for key, value in inner.items():
        path = (*place, key)
        name = ".".join(map(_key, path))
        header = f"[[{name}]]" if _is_tables(value) else f"[{name}]"
        for one in value if _is_tables(value) else (value,):
            if _is_tables(value) or not one or not all(map(_is_table, one.values())):
                yield ""
                yield header  # of a table of nothing but tables theirs are enough
            yield from _table(one, path)


def _is_table(value: object) -> bool:
    return isinstance(value, Mapping)


def _is_tables(value: object) -> bool:
    return isinstance(value, list) and bool(value) and all(map(_is_table, value))


def _key(name: str) -> str:
    return name if BARE.fullmatch(name) else json.dumps(name, ensure_ascii=False)


def _value(value: Any) -> str:
    """Returns a value as TOML has it; texts, without controls, as in JSON."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, list):
        return f"[{', '.join(map(_value, value))}]"
    return value.text if isinstance(value, WrittenNumber) else repr(value)
