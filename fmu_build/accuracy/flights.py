"""Flights through histories of inputs, two processes at a time."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmu_build.accuracy.histories import Body, Histories
from fmu_build.flight.choices import Choice
from fmu_build.flight.distance import attitude_apart
from fmu_build.flight.flying import OUT_OF_TIME, InputCourses, job_of, run_host
from fmu_build.flight.workshop import AT_ONCE, Workshop, build_all, source_of
from supervessel.composite.resolved import resolve
from supervessel.equations import Equations
from supervessel.problems import AccuracyError
from supervessel.scene.schema import Scene
from supervessel.shell.processes import Workers

Array = NDArray[np.float64]

LONG = 20_000
"""Steps beyond which libraries are optimised, and a process flies one history alone."""


def followed(scene: Scene, shop: Workshop, every: Histories, choice: Choice) -> tuple[Array, list[int]]:
    """Returns what `fly` does of all histories. Raises AccuracyError where one is refused."""
    found = fly(scene, shop, every, choice, range(len(every.flown)))
    if isinstance(found, str):
        raise AccuracyError(f"accuracy: the motion itself cannot be followed: {choice}: {found}")
    return found


def body_of(scene: Scene, model: Equations) -> Body:
    """Returns the function that tells of a row of inputs how the body answers what acts."""
    numbers, docks = names_of(scene)
    acting, here = len(model.resolved.acting), [v.start for v in model.resolved.field]

    def body(row: Array, booleans: Array) -> tuple[Array, Array]:
        values = dict(zip((*numbers, *docks), (*row, *booleans), strict=True))
        c = model.composite([values[name] for name in model.names.p])
        xx, yy, zz, xy, xz, yz = np.array(c).ravel()[model.slices.composite["inertia"]]
        at_rest = [1.0, *6 * [0.0]]
        rates = [np.array(model.ode(at_rest, [*u, *here], c)).ravel()[4:] for u in np.eye(acting + 1, acting)]
        gains = np.array(rates[:-1]).reshape(acting, 3) - rates[-1]  # without what acts where nothing does
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), gains.T

    return body


def judged(scene: Scene, shop: Workshop, choice: Choice, inputs: InputCourses) -> NDArray[np.bool_]:
    """Returns for rows of inputs whether the FMU of a choice starts with them."""
    job = {"tolerance": 0.0, "size": 1.0, "last_size": 1.0, "steps": 1, "sampled": [], "seconds": 0.0}
    ended = run_host(
        shop.built[source_of(choice)],
        shop.folder,
        job | {"judge": True},
        names_of(scene),
        [inputs.written(shop.folder / "judged")],
    )
    return np.frombuffer(_ended(choice, ended)[1], dtype=np.bool_)


def fly(
    scene: Scene, shop: Workshop, every: Histories, choice: Choice, which: range
) -> tuple[Array, list[int]] | str:
    """Returns samples, (n, samples, 7), and sub-steps of a choice in histories; or why one was refused."""
    build_all(scene, [choice], shop, lambda _: None)
    course, count = every.course, len(which)
    job = job_of(choice, course, 0.0)
    courses = [every.flown[i].inputs.written(shop.folder / f"history{i}", once=True) for i in which]
    size = 1 if course.steps > LONG else max(1, (count + 1) // AT_ONCE)
    parts = [range(i, min(i + size, count)) for i in range(0, count, size)]

    def flown(part: range) -> Any:
        built = shop.built[source_of(choice)]
        return run_host(built, shop.folder, job, names_of(scene), [courses[i] for i in part])

    samples, sub_steps = [], []
    with Workers(AT_ONCE) as pool:
        for part, result in zip(parts, pool.map(flown, parts), strict=True):
            answers, raw = _ended(choice, result)
            if answers[-1]["refused"] is not None:
                return f'history "{every.flown[which[part[len(answers) - 1]]].name}" {answers[-1]["refused"]}'
            samples.append(np.frombuffer(raw).reshape(len(part), -1, 7))
            sub_steps += [int(answer["sub_steps"]) for answer in answers]
    return np.concatenate(samples), sub_steps


def _ended(choice: Choice, ended: tuple[list[dict[str, Any]], bytes] | str | None) -> Any:
    """Returns answers and samples of a process. Raises AccuracyError where there are none."""
    if ended is None:
        raise AccuracyError(f"accuracy: {choice}: {OUT_OF_TIME}; a shorter horizon or a longer step may do")
    if isinstance(ended, str):
        raise AccuracyError(f"accuracy: {choice}: {ended}")
    return ended


def names_of(scene: Scene) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Returns the names of inputs that are numbers, and of those of docks, in the order of columns.

    Without those of gravity, which follow from the orbit.
    """
    variables = [variable for variable in resolve(scene).inputs if variable.part != "field"]
    return tuple(v.name for v in variables if not v.boolean), tuple(v.name for v in variables if v.boolean)


def apart(samples: Array, truth: Array) -> tuple[Array, Array]:
    """Returns the largest distances of samples, (n, samples, 7), by flight: attitude [rad], rate [rad/s]."""
    turned = attitude_apart(samples[..., :4].reshape(-1, 4), truth[..., :4].reshape(-1, 4))
    off = np.linalg.norm(samples[..., 4:] - truth[..., 4:], axis=2)
    return turned.reshape(off.shape).max(1), off.max(1)
