"""NASA's composites put together by mounts, tensors about other points included, against exact fractions."""

from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from nasa.facts import exact, table
from supervessel import Twin, reference
from support import Array, U, scene

RAW = {raw["name"]: raw for raw in table("composites")["composites"]}
DOCKED = [name for name, raw in RAW.items() if "ports" in raw]
MOST = 4 * U
"""Error of mass, of each coordinate of the barycentre and of each element of the tensor, over the largest."""


def sheet(part: dict[str, Any]) -> dict[str, Any]:
    """Returns a vessel by a part's own numbers; the origin of its axes is the point its tensor is about."""
    about = -exact(part["about"]) if "about" in part else np.zeros(3)
    keys = {"mass": exact(part["mass"]), "inertia": exact(part["inertia"]).tolist()}
    return keys | {"centre_of_mass": (0.0 + about).tolist(), "inertia_about": "origin"}


def quarter_turn(rotation: Array) -> list[float]:
    """Returns the quaternion, of any length, of a turn by less than a half: (1 + tr R, twist)."""
    twist = [rotation[k, j] - rotation[j, k] for j, k in ((1, 2), (2, 0), (0, 1))]
    return [1.0 + float(np.trace(rotation)), *map(float, twist)]


def mounted(name: str, root: str) -> dict[str, Any]:
    """Returns a composite as a raw scene: parts mounted to a frame without mass, or to the first part."""
    parts = RAW[name]["parts"]
    vessels = {f"P{i}": sheet(part) for i, part in enumerate(parts)}
    mounts = []
    base = np.zeros(3)
    if root == "P0":
        base = exact(parts[0]["centre"]) - vessels["P0"]["centre_of_mass"]
        assert "rotation" not in parts[0]
    for i, part in enumerate(parts):
        R = exact(part["rotation"]) if "rotation" in part else np.eye(3)
        origin = exact(part["centre"]) - R @ vessels[f"P{i}"]["centre_of_mass"] - base
        if f"P{i}" != root:
            mounts.append(
                {"parent": root, "child": f"P{i}", "position": origin.tolist(), "attitude": quarter_turn(R)}
            )
    if root == "frame":
        vessels["frame"] = {"mass": 0.0, "pmi": [0.0, 0.0, 0.0]}
    return {"name": name, "root": root, "vessels": vessels, "mounts": mounts}


def composite(raw: dict[str, Any]) -> tuple[float, Array, Array]:
    """Returns mass [kg], barycentre (3,) [m] and inertia (3, 3) [kg m2] by the twin."""
    mass, barycentre, inertia = (np.array(x) for x in Twin(scene(raw)).composite([])[:3])
    return float(mass.item()), barycentre.ravel(), inertia


def off(found: Array, fractions: Any) -> float:
    """Returns the largest difference from exact fractions, over the largest; absolute if all are 0."""
    exactly = [Fraction(text) for text in np.ravel(fractions).tolist()]
    size = max(map(abs, exactly)) or Fraction(1)
    numbers = np.ravel(found).tolist()
    return float(max(abs(Fraction(x) - y) for x, y in zip(numbers, exactly, strict=True)) / size)


@pytest.mark.parametrize("root", ["frame", "P0"])
@pytest.mark.parametrize("name", RAW)
def test_composites_by_mounts_are_nasas_fractions_to_four_roundings(name: str, root: str) -> None:
    raw = RAW[name]
    mass, barycentre, inertia = composite(mounted(name, root))
    base = (
        exact(raw["parts"][0]["centre"]) - sheet(raw["parts"][0])["centre_of_mass"] if root == "P0" else 0.0
    )
    assert off(np.array([mass]), [raw["mass"]]) <= MOST
    assert off(barycentre + base, raw["centre_of_mass"]) <= MOST
    assert off(inertia, raw["inertia"]) <= MOST


@pytest.mark.parametrize("name", RAW)
def test_the_reference_has_the_same_composites_by_mounts(name: str) -> None:
    given = scene(mounted(name, "frame"))
    found = reference.composite(given)
    assert off(found.barycentre, RAW[name]["centre_of_mass"]) <= 16 * U
    assert off(found.inertia, RAW[name]["inertia"]) <= 16 * U


def docked(name: str) -> dict[str, Any]:
    """Returns a composite as a raw scene, put together by NASA's points."""
    raw = RAW[name]
    names = list(dict.fromkeys(port["name"].split(".")[0] for port in raw["ports"]))
    vessels: dict[str, Any] = {
        vessel: sheet(part) | {"ports": {}} for vessel, part in zip(names, raw["parts"], strict=True)
    }
    for port in raw["ports"]:
        vessel, own = port["name"].split(".")
        vectors = ("position", "direction", "alignment")
        vessels[vessel]["ports"][own] = {key: exact(port[key]).tolist() for key in vectors}
    return {
        "name": name,
        "root": names[0],
        "vessels": vessels,
        "docks": [{"ports": pair} for pair in raw["docks"]],
    }


@pytest.mark.parametrize("name", DOCKED)
def test_nasas_points_and_mounts_of_the_same_poses_give_the_same_bits(name: str) -> None:
    by_ports, by_mounts = composite(docked(name)), composite(mounted(name, "P0"))
    assert by_ports[0] == by_mounts[0]
    assert np.array_equal(by_ports[1], by_mounts[1])
    assert np.array_equal(by_ports[2], by_mounts[2])
    assert off(by_ports[2], RAW[name]["inertia"]) <= MOST
