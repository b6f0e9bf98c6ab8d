"""Composites whose mass properties NASA worked out: reference, twin and FMU give the same."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from nasa.facts import Whole, composites, exact, table
from supervessel import Twin, reference
from support import COMPOSITE_TOLERANCE, OK, Array, Instance, scene

WHOLES = {whole.name: whole for whole in composites()}
DOCKED = {raw["name"]: raw for raw in table("composites")["composites"] if "ports" in raw}
MOST = 4  # parts

Properties = tuple[float, Array, Array]  # mass, barycentre, inertia


@cache
def frame() -> dict[str, Any]:
    """Returns the raw scene of a frame without mass with four bodies, everything of which is an input."""
    places = range(1, MOST + 1)
    at_origin = {"position": [0.0] * 3, "direction": [1.0, 0.0, 0.0], "alignment": [0.0, 1.0, 0.0]}
    facing = at_origin | {"direction": [-1.0, 0.0, 0.0]}
    bodies = {f"P{i}": {"mass": 1.0, "pmi": [1.0] * 3, "ports": {"own": facing}} for i in places}
    return {
        "name": "frame",
        "root": "frame",
        "vessels": {
            "frame": {"mass": 0.0, "pmi": [1.0] * 3, "ports": {f"to{i}": at_origin for i in places}},
            **bodies,
        },
        "docks": [{"ports": [f"frame.to{i}", f"P{i}.own"]} for i in places],
        "inputs": {
            "mass": list(bodies),
            "pmi": list(bodies),
            "pose": [f"frame.to{i}" for i in places],
        },
        "outputs": {"names": ["mass", "barycentre", "inertia"]},
    }


def values(whole: Whole) -> dict[str, float]:
    """Returns inputs of the frame's scene; a port's direction and alignment are two axes of its body."""
    found: dict[str, float] = {}
    for i in range(MOST):
        part = whole.parts[i] if i < len(whole.parts) else None
        found[f"P{i + 1}.mass"] = part.mass if part else 0.0
        if part is None:
            continue
        assert np.abs(part.inertia - np.diag(np.diag(part.inertia))).max() <= 4e-16
        groups = {
            f"P{i + 1}.pmi": np.diag(part.inertia) / part.mass,
            f"frame.to{i + 1}.position": part.centre,
            f"frame.to{i + 1}.direction": part.rotation[:, 0],
            f"frame.to{i + 1}.alignment": part.rotation[:, 1],
        }
        found |= {f"{name}[{k + 1}]": float(x) for name, group in groups.items() for k, x in enumerate(group)}
    return found


@cache
def twin() -> Twin:
    return Twin(scene(frame()))


@cache
def instance() -> Instance:
    return Instance(frame(), optimised=False)


def by_reference(whole: Whole) -> Properties:
    found = reference.composite(scene(frame()), values(whole))
    return found.mass, found.barycentre, found.inertia


def by_twin(whole: Whole) -> Properties:
    p = dict(zip(twin().p_names, twin().p_start, strict=True)) | values(whole)
    mass, barycentre, inertia = (np.array(x) for x in twin().composite(list(p.values()))[:3])
    return float(mass.item()), barycentre.ravel(), inertia


def by_fmu(whole: Whole) -> Properties:
    it = instance()
    it.reset()
    assert it.enter() == OK
    assert it.set(values(whole)) == OK
    assert it.exit() == OK, it.log
    return it.get("mass"), it.get("barycentre"), it.get("inertia").reshape(3, 3)


ENGINES = {"reference": by_reference, "twin": by_twin, "fmu": by_fmu}


def agree(found: Properties, whole: Whole) -> None:
    mass, barycentre, inertia = found
    assert abs(mass - whole.mass) <= COMPOSITE_TOLERANCE * whole.mass
    assert np.abs(barycentre - whole.barycentre).max() <= COMPOSITE_TOLERANCE
    assert np.abs(inertia - whole.inertia).max() <= COMPOSITE_TOLERANCE * np.abs(whole.inertia).max()


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", WHOLES)
def test_composites_are_those_that_nasa_worked_out(name: str, engine: str) -> None:
    agree(ENGINES[engine](WHOLES[name]), WHOLES[name])


@pytest.mark.parametrize("engine", ["reference", "twin"])
@pytest.mark.parametrize("name", DOCKED)
def test_vessels_docked_by_nasas_points_are_where_nasa_has_them(name: str, engine: str) -> None:
    raw, whole = DOCKED[name], WHOLES[name]
    names = list(dict.fromkeys(port["name"].split(".")[0] for port in raw["ports"]))
    vessels: dict[str, Any] = {
        vessel: {"mass": part.mass, "inertia": part.inertia.tolist(), "ports": {}}
        for vessel, part in zip(names, whole.parts, strict=True)
    }
    for port in raw["ports"]:
        vessel, own = port["name"].split(".")
        vectors = ("position", "direction", "alignment")
        vessels[vessel]["ports"][own] = {key: exact(port[key]).tolist() for key in vectors}
    docks = [{"ports": pair} for pair in raw["docks"]]
    docked = scene({"name": name, "root": names[0], "vessels": vessels, "docks": docks})
    if engine == "reference":
        found = reference.composite(docked)
        agree((found.mass, found.barycentre, found.inertia), whole)
    else:
        mass, barycentre, inertia = (np.array(x) for x in Twin(docked).composite([])[:3])
        agree((float(mass.item()), barycentre.ravel(), inertia), whole)
