"""The bound over ranges, of random scenes: how often it says something, how near it is; none breaks it."""

from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from fmu_build.accuracy.proven import proven_bound
from supervessel import Twin, parse_scene
from twin.scenes import random_pmi, random_port

Array = NDArray[np.float64]
LAWS = ("none", "decoupled", "principal", "tensor")
DURATION, STEP, FLIGHTS = 600.0, 2.0, 6  # s, s
USEFUL = 3.0  # rad: a bound beyond that says nothing of an attitude


def slow_scene(seed: int) -> tuple[dict[str, Any], dict[str, Any]]:
    """Returns a scene of 2 to 4 vessels, slow, with masses, docks and torque that move; and their ranges."""
    random = np.random.default_rng(seed)
    names = [f"V{i}" for i in range(2 + seed % 3)]
    vessels: dict[str, Any] = {
        name: {"mass": float(10.0 ** random.uniform(2.0, 4.0)), "pmi": random_pmi(random), "ports": {}}
        for name in names
    }
    docks = []
    for i in range(1, len(names)):
        parent = names[random.integers(i)]
        for vessel, name in ((parent, f"to{i}"), (names[i], "own")):
            port = random_port(random)
            across = np.cross(np.array(port["direction"]), random.normal(size=3))
            vessels[vessel]["ports"][name] = port | {"alignment": across.tolist()}
        docks.append({"ports": [f"{parent}.to{i}", f"{names[i]}.own"], "name": f"d{i}"})
    masses = [name for name in names if random.random() < 0.5]
    opening = [dock["name"] for dock in docks if random.random() < 0.3]
    ranges: dict[str, Any] = {
        f"{n}.mass": [vessels[n]["mass"] * random.uniform(0.3, 1.0), vessels[n]["mass"]] for n in masses
    }
    ranges |= {f"{dock}.{key}": [0.0, 0.0] for dock in opening for key in ("velocity", "rate")}
    raw = {
        "name": "slow",
        "root": names[0],
        "vessels": vessels,
        "docks": docks,
        "inputs": {"mass": masses, "docked": opening, "torque": True},
        "rotation": {
            "propagator": "rk4",
            "angular_velocity": (10.0 ** random.uniform(-5.0, -2.5) * random.normal(size=3) / 1.7).tolist(),
        },
    }
    twin = Twin(parse_scene(raw))
    least = float(np.linalg.eigvalsh(np.array(twin.composite(twin.p_start)[2]))[0])
    torque = least * 10.0 ** random.uniform(-8.0, -5.0)
    ranges["torque"] = [-torque, torque]
    raw["inputs"] = {**raw["inputs"], "range": ranges}
    return raw, ranges


def drawn(random: np.random.Generator, names: tuple[str, ...], ranges: Any, every: int, ends: bool) -> Array:
    """Returns inputs, (n, steps), in their ranges, that jump so often."""
    count, rows = round(DURATION / STEP), []
    for name in names:
        group = name.partition("[")[0]
        low, high = ranges.get(group, (0.0, 1.0) if name.endswith("docked") else (0.0, 0.0))
        share = random.random(-(-count // every))
        share = np.round(share) if ends or name.endswith("docked") else share
        rows.append(np.repeat(low + share * (high - low), every)[:count])
    return np.array(rows)


def largest_errors(raw: dict[str, Any], ranges: Any, law: str, seed: int) -> tuple[Array, Array]:
    """Returns the largest angle [rad] and difference of rates [rad/s] over all flights, at each step."""
    count, random = round(DURATION / STEP), np.random.default_rng(seed)
    cheap, truth = (
        Twin(parse_scene(raw | {"rotation": raw["rotation"] | {"law": one}})) for one in (law, "tensor")
    )
    fly: list[ca.Function] = [twin.step.mapaccum(count) for twin in (cheap, truth)]
    angle, rate = np.zeros(count), np.zeros(count)
    for flight in range(FLIGHTS):
        every, ends = (1, 5, count)[flight % 3], flight % 2 == 1
        u, p = (drawn(random, names, ranges, every, ends) for names in (cheap.u_names, cheap.p_names))
        x, y = (np.array(one(x=cheap.x_start, u=u, p=p, h=STEP)["x_next"]) for one in fly)
        chord = np.minimum(np.linalg.norm(x[:4] - y[:4], axis=0), np.linalg.norm(x[:4] + y[:4], axis=0))
        angle = np.maximum(angle, 4.0 * np.arcsin(np.minimum(chord / 2.0, 1.0)))
        rate = np.maximum(rate, np.linalg.norm(x[4:] - y[4:], axis=0))
    return angle, rate


def examined(seeds: range) -> str:
    """Returns what came of scenes; asserts that no flight passes a bound."""
    lines = []
    for law in LAWS:
        useful, ratios = 0, []
        for seed in seeds:
            raw, ranges = slow_scene(seed)
            scene = parse_scene(raw | {"rotation": raw["rotation"] | {"law": law}})
            bound = proven_bound(scene, DURATION, STEP)
            if not bound.whole[-1] <= USEFUL:
                continue
            useful += 1
            angle, rate = largest_errors(raw, ranges, law, seed)
            # what is flown as truth is rk4 as well, off by less than 1e-9 at these rates
            assert np.all(angle <= bound.whole + 1e-9), (law, seed)
            assert np.all(rate <= bound.rate + 1e-11), (law, seed)
            if angle[-1] > 1e-7:
                ratios.append(bound.whole[-1] / angle[-1])
        near = f"{np.median(ratios):.1f} median, {np.quantile(ratios, 0.9):.1f} at 90 %" if ratios else "-"
        lines.append(f"{law}: useful in {useful} of {len(seeds)}; over the worst flight {near}")
    return "\n".join(lines)


@pytest.mark.accuracy
def test_bounds_of_some_random_scenes_hold() -> None:
    print(examined(range(6)))


@pytest.mark.accuracy
def test_bounds_of_many_random_scenes_hold(scene_count: int, capsys: pytest.CaptureFixture[str]) -> None:
    """`make accuracy` prints how often the bound says something, and how near it is."""
    with capsys.disabled():
        print("\n" + examined(range(scene_count)))
