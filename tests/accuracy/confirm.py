"""Random scenes with `[accuracy]`, and how exact the FMU built from one is.

It is flown by FMPy through other histories than the choice's, against the numpy reference and SciPy's DOP853.
"""

import json
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi3 import FMU3Slave
from fmpy.model_description import ModelDescription

from accuracy.truth import after_a_step
from fmu_build import BuildError, build_fmu
from fmu_build.flight.distance import attitude_apart
from supervessel import Scene, parse_scene, reference
from supervessel.composite.resolved import resolve

HELD = 25
"""Pieces of a history in which inputs are held, at most."""

KINDS = ("sines", "walk", "telegraph", "spin up")


@dataclass(frozen=True)
class Confirmed:
    """What came of a scene.

    refused  : why nothing was built, or None; then the evidence is empty
    used     : largest error over what is asked, 1 and less where the claim holds, by kind of history
    attitude : largest error of the attitude [rad], by kind of history
    cheaper  : whether a cheaper candidate keeps what is asked, in the search's histories and in these
    """

    refused: str | None
    evidence: Mapping[str, Any]
    used: Mapping[str, float]
    attitude: Mapping[str, float]
    cheaper: bool = False

    @property
    def holds(self) -> bool:
        return all(share <= 1.0 for share in self.used.values())


def random_scene(seed: int) -> dict[str, Any]:
    """Returns a raw scene of 1 to 4 vessels in a chain: what varies, spin, horizon and accuracy are drawn."""
    draw = np.random.default_rng([seed, 7])
    names = [f"V{i}" for i in range(int(draw.integers(1, 5)))]
    vessels = {name: _vessel(draw) for name in names}
    docks = [
        {"ports": [f"{one}.aft", f"{other}.fore"], "name": f"berth{i}"}
        for i, (one, other) in enumerate(pairwise(names))
    ]
    raw: dict[str, Any] = {"name": f"random{seed}", "root": "V0", "vessels": vessels, "docks": docks}
    horizon = float(10.0 ** draw.uniform(0.5, 3.0))
    steps = int(10.0 ** draw.uniform(0.8, 2.3))
    turn = 10.0 ** draw.uniform(-1.0, 1.3)  # rad, in all
    rate = draw.normal(size=3)
    rate *= turn / horizon / np.linalg.norm(rate)
    raw["rotation"] = {"angular_velocity": rate.tolist(), "attitude": draw.normal(size=4).tolist()}
    raw["rotation"]["mass_change"] = str(draw.choice(["rate", "momentum"]))
    raw["rotation"]["pose_change"] = str(draw.choice(["rate", "momentum"]))
    moment = float(np.trace(reference.composite(parse_scene(raw)).inertia)) / 3.0
    torque = moment * turn / horizon**2 * 10.0 ** draw.uniform(-2.0, 0.3)
    raw["inputs"] = _inputs(draw, raw, torque)
    raw["accuracy"] = {
        "attitude": float(10.0 ** draw.uniform(-10.0, -2.0)),
        "horizon": horizon,
        "step": horizon / steps,
    }
    if draw.random() < 0.3:
        raw["accuracy"]["rate"] = raw["accuracy"]["attitude"] * turn / horizon
    return raw


def _vessel(draw: np.random.Generator) -> dict[str, Any]:
    squares = 10.0 ** draw.uniform(-1.0, 1.5, size=3)
    pmi = [float(squares[i - 2] + squares[i - 1]) for i in range(3)]
    size = float(np.sqrt(squares.max()))
    return {
        "mass": float(10.0 ** draw.uniform(2.0, 5.0)),
        "pmi": pmi,
        "ports": {
            "fore": _port(draw, size),
            "aft": _port(draw, size),
        },
        "points": {"jet": {"position": (2.0 * size * draw.normal(size=3)).tolist()}},
    }


def _port(draw: np.random.Generator, size: float) -> dict[str, list[float]]:
    direction, other = draw.normal(size=3), draw.normal(size=3)
    return {
        "position": (2.0 * size * draw.normal(size=3)).tolist(),
        "direction": direction.tolist(),
        "alignment": np.cross(direction, other).tolist(),
    }


def _inputs(draw: np.random.Generator, raw: Mapping[str, Any], torque: float) -> dict[str, Any]:
    """Returns some inputs with ranges; torque is the size [N m] of what acts."""
    names = list(raw["vessels"])
    some = [name for name in names if draw.random() < 0.5]
    inputs: dict[str, Any] = {"mass": some, "range": {}}
    for name in some:
        mass = raw["vessels"][name]["mass"]
        inputs["range"][f"{name}.mass"] = [float(mass * draw.uniform(0.3, 1.0)), mass]
    inputs["pmi"] = [name for name in names if draw.random() < 0.2]
    for name in inputs["pmi"]:
        for i, k in enumerate(raw["vessels"][name]["pmi"], start=1):
            inputs["range"][f"{name}.pmi[{i}]"] = [0.9 * k, 1.1 * k]
    posed = [port for dock in raw["docks"] for port in dock["ports"] if draw.random() < 0.2]
    inputs["pose"] = posed
    for name in posed:
        vessel, port = name.split(".")
        for part, values in raw["vessels"][vessel]["ports"][port].items():
            for i, x in enumerate(values, start=1):
                wide = (0.05 if part == "position" else 0.02) * float(np.linalg.norm(values))
                inputs["range"][f"{name}.{part}[{i}]"] = [x - wide, x + wide]
    if draw.random() < 0.6:
        inputs["torque"] = True
        inputs["range"]["torque"] = [-torque, torque]
    inputs["force"] = [f"{name}.jet" for name in names if draw.random() < 0.2]
    for name in inputs["force"]:
        arm = np.linalg.norm(raw["vessels"][name.partition(".")[0]]["points"]["jet"]["position"])
        inputs["range"][f"{name}.force"] = [0.0, float(0.3 * torque / arm)]
    inputs["docked"] = [dock["name"] for dock in raw["docks"] if draw.random() < 0.15]
    for name in inputs["docked"]:
        inputs["range"] |= {f"{name}.velocity": [0.0, 0.0], f"{name}.rate": [0.0, 0.0]}
    return inputs


class _Wanderer:
    """Inputs step by step, by a rule of their own, within their ranges."""

    def __init__(self, scene: Scene, kind: str, draw: np.random.Generator, steps: int) -> None:
        variables = resolve(scene).inputs
        self.kind, self.draw, self.steps = kind, draw, steps
        self.start = {v.name: v.start for v in variables}
        self.names = [v.name for v in variables]
        self.low = np.array([v.low if v.low is not None else 0.0 for v in variables])
        self.high = np.array([v.high if v.high is not None else 1.0 for v in variables])
        self.boolean = np.array([v.boolean for v in variables], dtype=bool)
        self.torque = [i for i, name in enumerate(self.names) if name.startswith("torque")]
        self.share = draw.random(len(variables))
        self.turns, self.phase = draw.uniform(0.2, 20.0, len(variables)), draw.uniform(0, 6.3, len(variables))
        self.often = 10.0 ** draw.uniform(-1.5, 0.0, len(variables))

    def at(self, step: int, omega: np.ndarray) -> dict[str, float]:
        """Returns the inputs of a step that begins with a rate [rad/s]."""
        n = len(self.names)
        if self.kind == "sines":
            self.share = 0.5 + 0.5 * np.sin(6.283 * self.turns * step / self.steps + self.phase)
        elif self.kind == "walk":
            self.share = np.abs((self.share + 0.1 * self.draw.normal(size=n) + 1.0) % 2.0 - 1.0)
        elif step == 0 or self.kind == "telegraph":
            flips = self.draw.random(n) < (1.0 if step == 0 else self.often)
            self.share = np.where(flips, self.draw.random(n) < 0.5, self.share).astype(float)
        if self.kind == "spin up" and self.torque:
            self.share[self.torque] = omega > 0.0
        share = np.where(self.boolean, np.round(self.share), self.share)
        values = np.clip(self.low + share * (self.high - self.low), self.low, self.high)
        return dict(zip(self.names, values.tolist(), strict=True))


def usable(scene: Scene, values: Mapping[str, float]) -> bool:
    """Whether inputs make sense in themselves: moments that a body has."""
    for name in scene.inputs.pmi:
        k = sorted(values[f"{name}.pmi[{i}]"] for i in (1, 2, 3))
        if k[2] > k[0] + k[1]:
            return False
    return True


def flight(scene: Scene, kind: str, seed: int) -> Iterator[tuple[dict[str, float], np.ndarray]]:
    """Yields the inputs of each step and the true state at its end."""
    accuracy = scene.accuracy
    assert accuracy is not None
    steps = round(accuracy.horizon / accuracy.step)
    wanderer = _Wanderer(scene, kind, np.random.default_rng([seed, KINDS.index(kind)]), steps)
    attitude = np.array(scene.rotation.attitude)
    omega, before = np.array(scene.rotation.angular_velocity), None
    prepared: dict[str, Any] = {}
    for step in range(steps):
        values = before or {}
        if step % max(1, steps // HELD) == 0:
            values = wanderer.at(step, omega)
        if not usable(scene, values):
            values = before or wanderer.start
        if values != before:
            if before is not None:
                omega = reference.change(scene, omega, before, values)
            prepared = {
                "J": reference.composite(scene, values).inertia[None],
                "M": reference.external_torque(scene, values)[None],
            }
        before = values
        state = after_a_step(np.append(attitude, omega)[None], accuracy.step, **prepared)[0]
        attitude, omega = state[:4], state[4:]
        yield values, state


def flown(fmu: Path, scene: Scene, rows: list[dict[str, float]]) -> np.ndarray:
    """Returns attitude and rate at the end of each step, (steps, 7), of an FMU whose inputs are rows."""
    return flown_each(fmu, scene, [rows])[0]


def flown_each(
    fmu: Path, scene: Scene, courses: Iterable[list[dict[str, float]]], scalars: Iterable[str] = ()
) -> list[np.ndarray]:
    """Returns attitude, rate and scalar outputs after each step, (steps, 7 + m) each, of an FMU's flights.

    courses : inputs of each flight, step by step
    scalars : names of outputs; those that the FMU does not have are NaN
    """
    folder = fmu.with_suffix(".dir")
    extract(str(fmu), unzipdir=str(folder))
    description = read_model_description(str(folder), validate=False)
    references = {v.name: v.valueReference for v in description.modelVariables}
    return [_flight(scene, rows, folder, description, references, tuple(scalars)) for rows in courses]


def _flight(  # noqa: PLR0917
    scene: Scene,
    rows: list[dict[str, float]],
    folder: Path,
    description: ModelDescription,
    references: Mapping[str, int],
    scalars: tuple[str, ...],
) -> np.ndarray:
    assert scene.accuracy is not None
    names = [f"{n}[{i}]" for n, m in (("attitude", 4), ("angular_velocity", 3)) for i in range(1, m + 1)]
    names += [name for name in scalars if name in references]
    known = [*range(7), *(7 + i for i, name in enumerate(scalars) if name in references)]
    shown = [references[name] for name in names]
    instance = FMU3Slave(
        guid=description.guid,
        unzipDirectory=str(folder),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="confirmed",
    )
    instance.instantiate()
    states, before = np.full((len(rows), 7 + len(scalars)), np.nan), None
    try:
        instance.enterInitializationMode()
        for i, row in enumerate(rows):
            if row != before:
                _set(instance, references, row)
            before = row
            if i == 0:
                instance.exitInitializationMode()
            instance.doStep(i * scene.accuracy.step, scene.accuracy.step)
            states[i, known] = instance.getFloat64(shown)
        instance.terminate()
    finally:
        instance.freeInstance()
    return states


def _set(instance: FMU3Slave, references: Mapping[str, int], row: Mapping[str, float]) -> None:
    docks = [name for name in row if name.endswith(".docked")]
    numbers = [name for name in row if name not in docks]
    if docks:
        instance.setBoolean([references[name] for name in docks], [bool(row[name]) for name in docks])
    if numbers:
        instance.setFloat64([references[name] for name in numbers], [row[name] for name in numbers])


def confirmed(raw: Mapping[str, Any], folder: Path, seed: int) -> Confirmed:
    """Returns how exact the FMU of a scene with `[accuracy]` is, built in a folder."""
    scene = parse_scene(raw)
    try:
        fmu = build_fmu(scene, folder / f"{scene.name}.fmu")
    except BuildError as error:
        return Confirmed(str(error), {}, {}, {})
    with zipfile.ZipFile(fmu) as archive:
        evidence = json.loads(archive.read("resources/accuracy.json"))
    truths = {kind: list(flight(scene, kind, seed)) for kind in KINDS}
    errors = {kind: _errors(fmu, scene, steps) for kind, steps in truths.items()}
    cheaper = _cheaper_kept(raw, evidence, folder, truths)
    used = {kind: _share(scene, *found) for kind, found in errors.items()}
    return Confirmed(None, evidence, used, {kind: found[0] for kind, found in errors.items()}, cheaper)


def _cheaper_kept(
    raw: Mapping[str, Any],
    evidence: Mapping[str, Any],
    folder: Path,
    truths: Mapping[str, list[tuple[dict[str, float], np.ndarray]]],
) -> bool:
    """Whether the dearest cheaper candidate that kept what is asked, without a margin, keeps it here too."""
    cheaper = [
        one
        for one in evidence["candidates"]
        if one["operations"] < evidence["operations"] and _keeps(one, evidence["asked"])
    ]
    if not cheaper:
        return False
    one = max(cheaper, key=lambda candidate: float(candidate["operations"]))
    keys = "law", "propagator", "max_angle_step", "tolerance"
    plain = {key: value for key, value in raw.items() if key != "accuracy"}
    plain["rotation"] = raw["rotation"] | {key: one[key] for key in keys if key in one}
    if one["law"] == "none":
        plain["rotation"] = {k: v for k, v in plain["rotation"].items() if not k.endswith("_change")}
    other, scene = build_fmu(parse_scene(plain), folder / "cheaper.fmu"), parse_scene(raw)
    return all(_share(scene, *_errors(other, scene, steps)) <= 1.0 for steps in truths.values())


def _keeps(candidate: Mapping[str, Any], asked: Mapping[str, Any]) -> bool:
    """Whether a candidate kept, in the search's flights, what is asked, without a margin."""
    if candidate["refused"] or candidate["attitude"] > asked["attitude"]:
        return False
    return asked["rate"] is None or candidate["rate"] <= asked["rate"]


def _errors(fmu: Path, scene: Scene, steps: list[tuple[dict[str, float], np.ndarray]]) -> tuple[float, float]:
    """Returns an FMU's largest errors of attitude [rad] and rate [rad/s]."""
    truth = np.array([state for _, state in steps])
    states = flown(fmu, scene, [row for row, _ in steps])
    turned = float(attitude_apart(states[:, :4], truth[:, :4]).max())
    return turned, float(np.linalg.norm(states[:, 4:] - truth[:, 4:], axis=1).max())


def _share(scene: Scene, attitude: float, rate: float) -> float:
    """Returns errors over what is asked, the larger one."""
    accuracy = scene.accuracy
    assert accuracy is not None
    return max(attitude / accuracy.attitude, rate / accuracy.rate if accuracy.rate else 0.0)
