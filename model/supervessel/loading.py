"""Reading scene files: every problem of a scene is found and named before anything is built from it."""

from collections.abc import Mapping
from math import hypot, sqrt
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from supervessel.composite.docks import TooManyWaysError, alone_as_given
from supervessel.composite.resolved import resolve
from supervessel.composite.start import composite_at_start, principal_moments, turning_at_start
from supervessel.orbit import orbit_problem
from supervessel.problems import SceneError, few_suggestions, key_path, printable, quantity, unknown
from supervessel.scene.consistency import consistency_problems
from supervessel.scene.names import misnamed_courses, naming_problems, size_problems
from supervessel.scene.numbers import LARGEST_PLACE, WrittenNumber
from supervessel.scene.schema import Scene, known_keys
from supervessel.scene.variables import InputVariable
from supervessel.shell.reading import ReadingError, read_toml, tables_of

EXPECTED = {
    "dict_type": "a table",
    "model_type": "a table",
    "model_attributes_type": "a table",
    "tuple_type": "an array of tables, written [[{key}]]",
}


def load_scene(path: str | Path) -> Scene:
    """Returns the scene that a TOML file describes.

    path : the file; its name stands before each problem
    Raises SceneError with every problem of the file: what cannot be read, TOML that is none, unknown
    or missing keys, impossible numbers, names that do not exist, docks that make no tree.

    Example:
        >>> from supervessel import load_scene
        >>> load_scene("examples/iss_dg.toml").root
        'ISS'
    """
    path = Path(path)
    try:
        raw = read_toml(path, WrittenNumber)
    except ReadingError as error:
        raise _unread(str(path), error) from None
    return parse_scene(raw, path.name)


def scene_from_text(text: str, source: str) -> Scene:
    """Returns the scene that a TOML text describes, as `load_scene` does of a file.

    source : stands before each problem
    Raises SceneError with every problem found.
    """
    try:
        raw = tables_of(text, WrittenNumber)
    except ReadingError as error:
        raise _unread(source, error) from None
    return parse_scene(raw, source)


def _unread(source: str, error: ReadingError) -> SceneError:
    """Returns what a text that cannot be read means for the user."""
    place = f"line {error.line}: " if error.line else ""
    return SceneError(source, [f"{place}{error}"])


@few_suggestions()
def parse_scene(raw: Mapping[str, Any], source: str = "scene") -> Scene:
    """Returns the scene that nested dictionaries describe, laid out as a scene file is.

    raw    : what `tomllib` makes of a scene file
    source : stands before each problem
    Raises SceneError with every problem found.

    Example:
        >>> from supervessel import parse_scene
        >>> ball = {"mass": 1000.0, "pmi": [1.0, 1.0, 1.0]}
        >>> parse_scene({"name": "ball", "root": "B", "vessels": {"B": ball}}).rotation.law
        'tensor'
    """
    problems = list(size_problems(raw))
    if problems:
        raise SceneError(source, problems)
    scene = None
    try:
        scene = Scene.model_validate(raw)
    except ValidationError as error:
        misnamed = {("experiment", "inputs", name) for name in misnamed_courses(raw)}
        problems += [
            text
            for one in error.errors(include_url=False)
            if one["loc"][:3] not in misnamed
            for text in _explain(one)
        ]
    problems += naming_problems(raw) + consistency_problems(raw)
    if scene is None or problems:
        raise SceneError(source, problems)
    problems += _range_problems(scene) + _course_problems(scene) + _orbit_problems(scene)
    problems += _bound_problems(scene)
    problems += _composite_problems(scene)
    if problems:
        raise SceneError(source, problems)
    return scene


def _explain(error: Any) -> list[str]:
    """Returns what one finding of pydantic means for the author of the scene."""
    place, kind = tuple(error["loc"]), error["type"]
    path = key_path(place)
    if kind == "value_error":
        return [f"{path}{error['ctx']['error']}"]
    if kind == "missing":
        return [f"{path}: missing"]
    if kind == "extra_forbidden":
        table = key_path(place[:-1])
        return [(f"{table}: " if table else "") + unknown("key", str(place[-1]), known_keys(place[:-1]))]
    expected = EXPECTED[kind].format(key=place[-1]) if kind in EXPECTED else error["msg"]
    return [f"{path} = {quantity(error['input'])}: must be {expected}"]


def _range_problems(scene: Scene) -> list[str]:
    """Returns which start values lie outside inputs.range."""
    problems = []
    groups: dict[str, list[InputVariable]] = {}
    for variable in resolve(scene).inputs:
        for name in {variable.name, variable.group}:
            groups.setdefault(name, []).append(variable)
    for name, (low, high) in scene.inputs.range.items():
        for variable in groups.get(name, ()):
            if not low <= variable.start <= high:
                start = quantity(variable.start, variable.unit)
                path = f'inputs.range."{name}" = {quantity((low, high), variable.unit)}'
                problems.append(f"{path}: the start value {variable.name} = {start} lies outside")
    return problems


def _course_problems(scene: Scene) -> list[str]:
    """Returns which values of experiment.inputs an input cannot have."""
    problems = []
    variables = {variable.name: variable for variable in resolve(scene).inputs}
    for name, rows in scene.experiment.inputs.items() if scene.experiment else ():
        variable = variables[name]
        low, high, boolean = variable.low, variable.high, variable.boolean
        allowed = f"outside inputs.range = {quantity((low, high), variable.unit)}"
        if low is None or high is None:
            allowed = f"{variable.kind.noun} must be >= {variable.low or 0.0:g} {variable.unit}"
        for time, value in rows:
            outside = (low is not None and value < low) or (high is not None and value > high)
            if boolean is not isinstance(value, bool):
                must = "must be true or false" if boolean else "must be a finite number"
                problems.append(f'experiment.inputs."{name}": {quantity(value)} at {time} s: {must}')
            elif outside:
                found = quantity(value, variable.unit)
                problems.append(f'experiment.inputs."{name}": {found} at {time} s: {allowed}')
    return problems


def _orbit_problems(scene: Scene) -> list[str]:
    """Returns why [experiment.orbit] is no orbit about the centre."""
    orbit = scene.experiment.orbit if scene.experiment else None
    if orbit is None or scene.gravity is None:
        return []
    reason = orbit_problem(orbit.position, orbit.velocity, scene.gravity.mu)
    return [f"experiment.orbit.{reason}"] if reason else []


def _bound_problems(scene: Scene) -> list[str]:
    """Returns why no error is bounded: the bounds are for moments that a rigid body can have."""
    if not alone_as_given(scene):
        return []
    root = f"{printable(scene.root)} alone turns with its moments as given"
    why = f'by convention = "orbiter" {root}, which may be those of no rigid body: no error is bounded'
    asked = {"accuracy": scene.accuracy, "outputs.names: error_bound": "error_bound" in scene.outputs.names}
    return [f"{place}: {why}" for place, given in asked.items() if given]


def _composite_problems(scene: Scene) -> list[str]:
    """Returns why the whole cannot turn: numbers that overflow, or a tensor that the law cannot use."""
    try:
        c = composite_at_start(scene)
    except TooManyWaysError as error:
        return [str(error)]
    if not all(np.all(np.isfinite(c[part])) for part in ("barycentre", "inertia", "pmi")):
        return ["vessels: masses, positions or moments are too large: the composite's inertia is not finite"]
    law = scene.rotation.law
    if law == "none" or (np.all(c["margins"] > 0.0) and np.all(np.isfinite(c["law"]))):
        return _place_problems(scene, c)
    three = ", ".join(f"{moment:.10g}" for moment in principal_moments(turning_at_start(scene, c)))
    allowed = f'must be positive beyond rounding for rotation.law = "{law}"'
    without = " without what its wheels have about their axes" if scene.wheels else ""
    included = "; a vessel's moments include those of its wheels" if scene.wheels else ""
    return [f"vessels: the composite{without} has principal moments {three} kg m2: {allowed}{included}"]


def _place_problems(scene: Scene, c: Mapping[str, NDArray[np.float64]]) -> list[str]:
    """Returns why the barycentre cannot start where it does in the field of gravity; the FMU judges likewise.

    c : from `composite_at_start`
    """
    if scene.gravity is None or _orbit_problems(scene):
        return []
    table = "experiment.orbit" if scene.experiment and scene.experiment.orbit else "gravity"
    starts = zip(("position", "velocity"), scene.gravity_start, ("m", "m/s"), strict=True)
    problems = [
        f"{table}.{key} = {quantity(start, unit)}: must be at most {LARGEST_PLACE:g} {unit} long"
        for key, start, unit in starts
        if max(map(abs, start)) > LARGEST_PLACE
    ]
    nearest, position = 2.0 * sqrt(float(c["pmi"].sum())), scene.gravity_start[0]
    if not problems and not hypot(*position) > nearest:
        allowed = f"must be longer than {nearest:.6g} m, twice the assembly's size"
        problems.append(f"{table}.position = {quantity(position, 'm')}: {allowed}")
    return problems
