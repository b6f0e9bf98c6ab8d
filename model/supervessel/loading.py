"""Reading scene files: every problem of a scene is found and named before anything is built from it."""

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from supervessel import reference
from supervessel.naming import naming_problems
from supervessel.problems import SceneError, quantity, unknown
from supervessel.quantities import definite_problem
from supervessel.scene import Scene, known_keys
from supervessel.variables import input_variables

EXPECTED = {
    "dict_type": "a table",
    "model_type": "a table",
    "model_attributes_type": "a table",
    "tuple_type": "an array of tables, written [[docks]]",
}


def load_scene(path: str | Path) -> Scene:
    """Returns the scene that a TOML file describes.

    path : the file; its name stands before each problem
    Raises SceneError with every problem of the file: what cannot be read, TOML that is none, unknown
    or missing keys, impossible numbers, names that do not exist, docks that make no tree.
    """
    path = Path(path)
    try:
        raw = tomllib.loads(path.read_bytes().decode("utf-8"))
    except OSError as error:
        raise SceneError(str(path), [f"cannot be read: {error.strerror}"]) from None
    except UnicodeDecodeError as error:
        raise SceneError(str(path), [f"is not UTF-8 text (byte {error.start})"]) from None
    except tomllib.TOMLDecodeError as error:
        raise SceneError(str(path), [f"is not TOML: {error}"]) from None
    return parse_scene(raw, path.name)


def parse_scene(raw: Mapping[str, Any], source: str = "scene") -> Scene:
    """Returns the scene that nested dictionaries describe, laid out as a scene file is.

    raw    : what `tomllib` makes of a scene file
    source : stands before each problem
    Raises SceneError with every problem found.
    """
    problems: list[str] = []
    scene = None
    try:
        scene = Scene.model_validate(raw)
    except ValidationError as error:
        problems += [text for one in error.errors() for text in _explain(one)]
    problems += naming_problems(raw)
    if scene is None or problems:
        raise SceneError(source, problems)
    problems += _range_problems(scene) + _composite_problems(scene)
    if problems:
        raise SceneError(source, problems)
    return scene


def key_path(place: tuple[Any, ...]) -> str:
    """Returns a place in a scene file as its author would write it: vessels.DG.ports.nose, docks[1]."""
    path = ""
    for part in place:
        if isinstance(part, int):
            path += f"[{part + 1}]"
        else:
            path += ("." if path else "") + (part if re.fullmatch(r"[\w-]+", part) else f'"{part}"')
    return path


def _explain(error: Any) -> list[str]:
    """Returns what one finding of pydantic means for the author of the scene."""
    place, kind = tuple(error["loc"]), error["type"]
    path = key_path(place)
    if kind == "value_error":
        return [f"{path}{error['ctx']['error']}"]
    if kind == "table":
        return [f"{key_path((*place, key))}{text}" for key, text in error["ctx"]["problems"]]
    if kind == "missing":
        return [f"{path}: missing"]
    if kind == "extra_forbidden":
        table = key_path(place[:-1])
        return [(f"{table}: " if table else "") + unknown("key", str(place[-1]), known_keys(place[:-1]))]
    expected = EXPECTED.get(kind)
    return [f"{path} = {quantity(error['input'])}: must be {expected or error['msg']}"]


def _range_problems(scene: Scene) -> list[str]:
    """Returns what is wrong with inputs.range: bounds out of order, or a start value outside them."""
    problems = []
    for name, (low, high) in scene.inputs.range.items():
        path = f'inputs.range."{name}" = {quantity((low, high))}'
        if low > high:
            problems.append(f"{path}: low must not exceed high")
            continue
        if name.endswith(".mass") and low < 0.0:
            problems.append(f"{path}: a mass must be >= 0 kg")
        for variable in input_variables(scene):
            if name in (variable.name, variable.name.partition("[")[0]) and not low <= variable.start <= high:
                problems.append(f"{path}: the start value {variable.name} = {variable.start} lies outside")
    return problems


def _composite_problems(scene: Scene) -> list[str]:
    """Returns why the whole cannot turn: no mass, or a tensor that the law cannot be solved with."""
    total = sum(vessel.mass for vessel in scene.vessels.values())
    if not 0.0 < total < float("inf"):
        return [f"vessels: total mass = {total} kg: must be a finite number > 0"]
    problem = definite_problem(reference.composite(scene).inertia)
    if problem and scene.rotation.law != "none":
        return [f'vessels: the composite has {problem} for rotation.law = "{scene.rotation.law}"']
    return []
