"""Problems between the keys of a scene: moments, port directions, ranges, steps, the total mass.

The raw tables of a file are checked, and values that are no numbers are skipped, so that these problems are
reported beside those of single values.
"""

import math
from collections.abc import Iterator, Mapping
from typing import Any

from supervessel.problems import listed, printable, quantity, toml_key
from supervessel.rotation.propagators import PROPAGATORS
from supervessel.scene.inputs import by_group, by_name, vessel_of
from supervessel.scene.mending import mend
from supervessel.scene.numbers import Vector, is_number, vector_length
from supervessel.scene.outputs import is_accelerated
from supervessel.scene.schema import (
    CHOSEN,
    MOST_STEPS,
    PARALLEL_LIMIT,
    PERPENDICULAR_LIMIT,
    tables,
)
from supervessel.scene.sheets import CENTRE, MOMENT_KEYS, sheet_of, sheet_problem, sheet_text

HALF_ULP = 2.0**-53


def consistency_problems(raw: Mapping[str, Any]) -> list[str]:
    """Returns what is wrong between the values of a scene, given as the raw tables of its file."""
    problems: list[str] = []
    rigid = raw.get("convention") != "orbiter"
    for name, vessel in tables(raw, "vessels"):
        place = f"vessels.{toml_key(name)}"
        problems += _moments(place, vessel)
        problems += _rigid_moments(place, vessel) if rigid else _no_tensor(place, vessel)
        for port, table in tables(vessel, "ports"):
            problems += direction_problems(f"{place}.ports.{toml_key(port)}", table)
    problems += [*_experiment(raw), *_accuracy(raw), *_ranges(raw), *_total_mass(raw), *_wheels(raw)]
    problems += [*_accelerated(raw), *_flow(raw)]
    return [*problems, *_gravity(raw), *_propagator(raw), *_changes(raw)]


def _moments(place: str, vessel: Mapping[str, Any]) -> Iterator[str]:
    """Yields why a vessel's keys do not give its moments, or more than them."""
    given = [key for key in MOMENT_KEYS if key in vessel]
    if not given:
        yield f"{place}.pmi: missing; a vessel needs pmi [m2] or inertia [kg m2]"
    if len(given) > 1:
        yield from (
            f"{place}.{key}: given beside {given[0]}; a vessel takes one of the two" for key in given[1:]
        )
    elif given not in ([], ["pmi"]) and _number(vessel, "mass") == 0.0:
        yield f"{place}.mass = 0.0 kg: must be > 0 for a vessel given by {given[0]}; inertia/mass is kept"
    if "products" in vessel and "moments" not in vessel:
        products = quantity(vessel["products"], "kg m2")
        yield f"{place}.products = {products}: without effect; they go with moments [kg m2]"
    if "pmi" in vessel and vessel.get("inertia_about", CENTRE) != CENTRE:
        about = f"{place}.inertia_about = {quantity(vessel['inertia_about'])}"
        yield f"{about}: given beside pmi, which is about the centre of mass; give inertia or moments [kg m2]"


def _rigid_moments(place: str, vessel: Mapping[str, Any]) -> Iterator[str]:
    """Yields why no rigid body has a vessel's moments, nor any that `mend` may take in their place."""
    sheet = sheet_of(vessel)
    problem = sheet_problem(sheet) if sheet is not None else ""
    if sheet is None or not problem:
        return
    found, asked = mend(sheet), vessel.get("mend") is True
    if asked and found.sheet is not None:
        return
    if asked:
        problem += f"; mend = true moves each number by half a unit of its last digit, and {found.reason}"
    elif found.sheet is not None:
        problem += "; mend = true would move numbers by no more than the rounding of their last digit"
    yield f"{place}{sheet_text(vessel, sheet)}: {problem}"


def _no_tensor(place: str, vessel: Mapping[str, Any]) -> Iterator[str]:
    """Yields why a vessel cannot be as it is under Orbiter's convention."""
    for key in ("inertia", "moments"):
        if key in vessel:
            yield f'{place}.{key}: convention = "orbiter" knows no products of inertia; give pmi [m2]'
    if vessel.get("mend") is True:
        yield f'{place}.mend = true: convention = "orbiter" takes moments that no body has; leave it out'


def direction_problems(place: str, port: Mapping[str, Any]) -> Iterator[str]:
    """Yields why a port's alignment cannot be used with its direction.

    place : path of the port in the scene
    port  : its raw table, direction and alignment in vessel axes
    """
    direction, alignment = _vector(port, "direction"), _vector(port, "alignment")
    if direction is None or alignment is None:
        return
    sine, cosine = _sine_cosine(direction, alignment)
    off = abs(math.atan2(cosine, sine))
    against = f"must be perpendicular to direction = {quantity(direction)}"
    where = f"{place}.alignment = {quantity(alignment)}: {against}"
    if sine < PARALLEL_LIMIT:
        yield f"{where}, but is parallel to it within {PARALLEL_LIMIT:g} rad"
    elif off > PERPENDICULAR_LIMIT:
        yield f"{where}, but is {off:.9g} rad off; at most {PERPENDICULAR_LIMIT:g} rad"


def _vector(table: Mapping[str, Any], key: str) -> Vector | None:
    """Returns a key's three finite numbers, not all zero; None where the key has something else."""
    value = table.get(key)
    if isinstance(value, list | tuple) and len(value) == 3 and all(map(is_number, value)) and any(value):
        x, y, z = map(float, value)
        return x, y, z
    return None


def _sine_cosine(a: Vector, b: Vector) -> tuple[float, float]:
    """Returns sine and cosine of the angle between two vectors of any length > 0."""
    (a1, a2, a3), (b1, b2, b3) = (tuple(x / vector_length(v) for x in v) for v in (a, b))
    cross = (a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1)
    return math.hypot(*cross), a1 * b1 + a2 * b2 + a3 * b3


def _experiment(raw: Mapping[str, Any]) -> Iterator[str]:
    experiment = raw.get("experiment")
    if isinstance(experiment, Mapping):
        duration, step = _number(experiment, "duration"), _number(experiment, "step")
        if step > duration > 0.0:
            yield f"experiment.step = {step} s: must not exceed duration = {duration} s"


def _accuracy(raw: Mapping[str, Any]) -> Iterator[str]:
    """Yields why [accuracy] cannot be met, or contradicts other keys."""
    accuracy, rotation, inputs = (raw.get(key, {}) for key in ("accuracy", "rotation", "inputs"))
    if "accuracy" not in raw or not isinstance(accuracy, Mapping):
        return
    horizon, step, rate = (_number(accuracy, key) for key in ("horizon", "step", "rate"))
    if step > horizon > 0.0:
        yield f"accuracy.step = {step} s: must not exceed horizon = {horizon} s"
    elif step > 0.0 and horizon > MOST_STEPS * step:
        count = f"accuracy.horizon = {horizon} s: in steps of {step} s that are {horizon / step:.6g} steps"
        yield f"{count}; at most {MOST_STEPS}"
    if isinstance(rotation, Mapping):
        for key in CHOSEN:
            if key in rotation:
                yield f"rotation.{key}: given beside [accuracy], which chooses it; leave it out"
        spin = _vector(rotation, "angular_velocity")
        if spin is not None and 0.0 < rate < HALF_ULP * vector_length(spin):
            least = f"{HALF_ULP * vector_length(spin):.3g} rad/s, what doubles tell of this angular_velocity"
            yield f"accuracy.rate = {rate} rad/s: must be at least {least}"
    without = list(_without_range(inputs)) if isinstance(inputs, Mapping) else []
    if without:
        names = listed((f'"{name}"' for name in without), len(without))
        yield f"inputs.range: missing for {names}: [accuracy] needs one for every input that is a number"


def _without_range(inputs: Mapping[str, Any]) -> Iterator[str]:
    """Yields the inputs without a range, docks excepted; a vector by one name if no element has a range."""
    ranges = inputs.get("range")
    known = ranges if isinstance(ranges, Mapping) else {}
    for group, (kind, elements) in by_group(inputs).items():
        if group in known or kind.boolean or kind.part == "field":
            continue
        missing = [name for name in elements if name not in known]
        yield from missing if len(missing) < len(elements) else [group]


def _ranges(raw: Mapping[str, Any]) -> Iterator[str]:
    inputs = raw.get("inputs")
    ranges = inputs.get("range") if isinstance(inputs, Mapping) else None
    groups = by_group(inputs) if isinstance(inputs, Mapping) else {}
    known = {name: kind for kind, names in groups.values() for name in names}
    known |= {group: kind for group, (kind, _) in groups.items()}
    for name, bounds in ranges.items() if isinstance(ranges, Mapping) else ():
        if not (isinstance(bounds, list | tuple) and len(bounds) == 2 and all(map(is_number, bounds))):
            continue
        low, high = map(float, bounds)
        kind = known.get(name)
        unit = kind.unit if kind else ""
        path = f'inputs.range."{printable(name)}" = {quantity((low, high), unit)}'
        if low > high:
            yield f"{path}: low must not exceed high"
        elif kind and kind.lowest is not None and low < kind.lowest:
            yield f"{path}: {kind.noun} must be >= {kind.lowest:g} {kind.unit}"


def _gravity(raw: Mapping[str, Any]) -> Iterator[str]:
    """Yields why [gravity] and inputs.gravity do not go together, or from where the flight starts."""
    inputs, gravity, experiment = (raw.get(key, {}) for key in ("inputs", "gravity", "experiment"))
    asked = isinstance(inputs, Mapping) and inputs.get("gravity") is True
    orbit = experiment.get("orbit") if isinstance(experiment, Mapping) else None
    if asked and "gravity" not in raw:
        yield "gravity.mu: missing; inputs.gravity = true needs the centre's gravitational parameter [m3/s2]"
    for place, given in (("gravity", raw.get("gravity")), ("experiment.orbit", orbit)):
        if given is not None and not asked:
            yield f"{place}: without effect; put gravity = true under [inputs]"
    for key in ("position", "velocity") if isinstance(gravity, Mapping) and "gravity" in raw else ():
        if orbit is not None and key in gravity:
            yield f"gravity.{key}: given beside [experiment.orbit], where the flight starts; leave it out"
        elif orbit is None and key not in gravity:
            needs = "the inputs gravity.position and gravity.velocity start from it"
            yield f"gravity.{key}: missing, and no [experiment.orbit]; {needs}"
    if asked and "accuracy" in raw and orbit is None:
        yield "experiment.orbit: missing; [accuracy] flies along it where inputs.gravity is true"
    rotation = raw.get("rotation")
    still = isinstance(rotation, Mapping) and rotation.get("law") == "none"
    if asked and still and _shows_bound(raw):
        yield f"outputs.names: error_bound: {NO_BOUND_IN_ORBIT}"
    courses = experiment.get("inputs") if isinstance(experiment, Mapping) else None
    if orbit is None or not isinstance(courses, Mapping):
        return
    for name, kind in by_name(inputs).items() if isinstance(inputs, Mapping) else ():
        if kind.part == "field" and name in courses:
            yield f'experiment.inputs."{name}": given beside [experiment.orbit], which moves it; leave it out'


def _total_mass(raw: Mapping[str, Any]) -> Iterator[str]:
    masses = [
        _number(vessel, "mass") or (0.0 if {"inertia", "moments"}.isdisjoint(vessel) else math.nan)
        for _, vessel in tables(raw, "vessels")
    ]
    if masses and all(mass >= 0.0 for mass in masses) and not 0.0 < sum(masses) < math.inf:
        yield f"vessels: total mass = {sum(masses)} kg: must be a finite number > 0"


def has_wheels(raw: Mapping[str, Any]) -> bool:
    """Whether a vessel of a scene, given as its raw tables, has wheels."""
    return any(tables(vessel, "wheels") for _, vessel in tables(raw, "vessels"))


def _wheels(raw: Mapping[str, Any]) -> Iterator[str]:
    """Yields why the scene cannot have the wheels that it has."""
    for name, vessel in tables(raw, "vessels"):
        if tables(vessel, "wheels") and _number(vessel, "mass") == 0.0:
            yield f"vessels.{toml_key(name)}.mass = 0.0 kg: must be > 0 for a vessel with wheels"
    if not has_wheels(raw):
        return
    rotation = raw.get("rotation", {})
    if isinstance(rotation, Mapping) and rotation.get("law") == "none":
        yield 'rotation.law = "none": knows no momentum; a scene with wheels needs any other law'
    if raw.get("convention") == "orbiter":
        yield 'convention = "orbiter": knows no wheels; take them away, or the convention'
    if "accuracy" in raw:
        yield "accuracy: the bounds by which it chooses know no wheels; give law and propagator yourself"
    if _shows_bound(raw):
        yield "outputs.names: error_bound knows no wheels; leave it out of a scene that has them"


def _accelerated(raw: Mapping[str, Any]) -> Iterator[str]:
    """Yields why the scene cannot have the outputs that follow from accelerations."""
    outputs, inputs, rotation = (raw.get(key, {}) for key in ("outputs", "inputs", "rotation"))
    if not all(isinstance(table, Mapping) for table in (outputs, inputs, rotation)):
        return
    moves = inputs.get("motion")
    still = inputs.get("gravity") is True and rotation.get("law") == "none"
    names = outputs.get("names", ())
    for name in names if isinstance(names, list | tuple) else ():
        if not (isinstance(name, str) and is_accelerated(name)):
            continue
        if moves:
            reason = "accelerations are not known where inputs.motion lists ports"
            yield f"outputs.names: {printable(name)}: {reason}; leave one of the two out"
        if inputs.get("flow"):
            reason = "where inputs.flow lists points, the momentum of the flow inside is not known"
            yield f"outputs.names: {printable(name)}: {reason}; leave one of the two out"
        if still:
            yield f'outputs.names: {printable(name)}: rotation.law = "none" with inputs.gravity {NO_PLACE}'


def _flow(raw: Mapping[str, Any]) -> Iterator[str]:
    """Yields why the scene cannot have the flows of propellant that it lists."""
    inputs, rotation = (raw.get(key, {}) for key in ("inputs", "rotation"))
    if not (isinstance(inputs, Mapping) and isinstance(rotation, Mapping) and inputs.get("flow")):
        return
    flows, masses = (inputs.get(key) for key in ("flow", "mass"))
    known = masses if isinstance(masses, list | tuple) else ()
    for name in flows if isinstance(flows, list | tuple) else ():
        if isinstance(name, str) and name.count(".") == 1 and vessel_of(name) not in known:
            vessel = printable(vessel_of(name))
            rule = f"{vessel} is not listed in inputs.mass; what flows out is to make its mass fall"
            yield f"inputs.flow: {printable(name)}: {rule}"
    if rotation.get("mass_change") == "momentum":
        reason = "propellant that leaves takes momentum along, which the flow reckons with a kept rate"
        yield f'rotation.mass_change = "momentum": must be "rate" where inputs.flow lists points: {reason}'
    if rotation.get("law") == "none":
        yield 'rotation.law = "none": knows no torque; a scene with inputs.flow needs any other law'
    if inputs.get("motion"):
        yield "inputs.motion: what a port's motion gives the flow is not known; leave it or inputs.flow out"
    if raw.get("convention") == "orbiter":
        yield 'convention = "orbiter": knows no jet damping; leave it or inputs.flow out'
    if "accuracy" in raw:
        yield "accuracy: the bounds by which it chooses know no flow; give law and propagator yourself"
    if _shows_bound(raw):
        yield "outputs.names: error_bound knows no flow; leave it out of a scene with inputs.flow"


NO_PLACE = 'does not follow the place in the field; take another law, "decoupled" costs hardly more'
"""Why the law none shows no acceleration in a field of gravity."""


def _number(table: Mapping[str, Any], key: str) -> float:
    """Returns a key's finite number, NaN where the key is missing or has something else."""
    value = table.get(key)
    return float(value) if is_number(value) else math.nan  # type: ignore[arg-type]


def _propagator(raw: Mapping[str, Any]) -> Iterator[str]:
    """Yields why the propagator does not suit the scene's law and inputs."""
    rotation, inputs = (raw.get(key, {}) for key in ("rotation", "inputs"))
    if not (isinstance(rotation, Mapping) and isinstance(inputs, Mapping)):
        return
    name = rotation.get("propagator")
    method = PROPAGATORS.get(name) if isinstance(name, str) else None
    reason = method.reason_against(str(rotation.get("law", "")), inputs, has_wheels(raw)) if method else ""
    if reason:
        yield f'rotation.propagator = "{name}": {reason}'


NO_BOUND_IN_ORBIT = (
    'rotation.law = "none" with inputs.gravity has no bound, which follows the place that this law does not; '
    'take another law, "decoupled" costs hardly more'
)
"""Why no bound is carried under the law none in a field of gravity."""


def _shows_bound(raw: Mapping[str, Any]) -> bool:
    """Whether `error_bound` is an output: what the true motion keeps then counts under every law."""
    outputs = raw.get("outputs", {})
    names = outputs.get("names", ()) if isinstance(outputs, Mapping) else ()
    return isinstance(names, list | tuple) and "error_bound" in names


def _changes(raw: Mapping[str, Any]) -> Iterator[str]:
    """Yields why mass_change or pose_change does not suit the scene's law and inputs."""
    rotation, inputs = (raw.get(key, {}) for key in ("rotation", "inputs"))
    if not (isinstance(rotation, Mapping) and isinstance(inputs, Mapping)):
        return
    if rotation.get("law") == "none":
        for key in ("mass_change", "pose_change"):
            if rotation.get(key) == "momentum" and not _shows_bound(raw):
                reason = 'must be "rate" for rotation.law = "none": the rate never changes'
                yield f'rotation.{key} = "momentum": {reason}'
        if inputs.get("motion"):
            yield 'inputs.motion: makes no sense with rotation.law = "none": the rate never changes'
    if rotation.get("pose_change") == "rate" and inputs.get("motion"):
        yield 'rotation.pose_change = "rate": must be "momentum" where inputs.motion lists ports'
