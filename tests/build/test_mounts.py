"""Mounts: vessels that are fixed to others by a pose, without ports."""

import tomllib
from itertools import product
from typing import Any

import numpy as np
import pytest

from fmu_build.document.documentation import documentation
from fmu_build.generate.model import generate
from fmu_build.interface.variable_table import variable_table
from supervessel import Twin, parse_scene, reference
from supervessel.composite.constants import mount_rotation
from supervessel.composite.start import poses_at_start
from supervessel.equations import equations
from supervessel.scene.schema import Mount, Scene
from supervessel.scene.writing import scene_text
from support import COMPOSITE_TOLERANCE, ERROR, OK, Array, flying, hamilton, scene, variant
from support.costs import station
from support.refusals import ONE_PORT, case, problems

ROOT = {"position": [0.0, 0.0, 0.0], "direction": [-1.0, 0.0, 0.0], "alignment": [0.0, 1.0, 0.0]}
"""A port at the origin of a child: its axes are direction, alignment and third axis of the other one."""


def quarter_turns() -> list[list[float]]:
    """Returns the unit quaternions of the 24 turns that take axes to axes."""
    half = np.sqrt(0.5)
    found = [list(np.eye(4)[i]) for i in range(4)]
    for i in range(4):
        for j in range(i):
            for sign in (1.0, -1.0):
                found.append([sign * half if k == i else half if k == j else 0.0 for k in range(4)])
    return found + [[0.5, *signs] for signs in product((0.5, -0.5), repeat=3)]


def turned(attitude: list[float]) -> Array:
    """Returns the matrix of a quaternion, (3, 3); its columns are axes as q e q* turns them."""
    conjugate = np.array(attitude) * [1.0, -1.0, -1.0, -1.0]
    axes = [hamilton(hamilton(attitude, [0.0, *axis]), conjugate)[1:] for axis in np.eye(3)]
    return np.column_stack(axes)


def hub(by: str) -> dict[str, Any]:
    """Returns the raw scene of a vessel and 24 others, one for each quarter turn, by "mounts" or "docks"."""
    rng, names = np.random.default_rng(3), [f"v{i}" for i in range(24)]
    places = {name: rng.normal(size=3).tolist() for name in names}
    turns = dict(zip(names, quarter_turns(), strict=True))
    vessels = {
        name: {
            "mass": rng.uniform(1.0, 9.0),
            "inertia": [[9.0, 0.3, 0.2], [0.3, 8.0, 0.1], [0.2, 0.1, 7.0]],
            "centre_of_mass": rng.normal(size=3).tolist(),
            "ports": {"root": ROOT},
        }
        for name in names
    }
    ports = {name: _port(places[name], np.round(turned(turns[name]))) for name in names}
    vessels["hub"] = {"mass": 5.0, "pmi": [1.0, 1.5, 2.0], "centre_of_mass": [0.1, 0.2, 0.7], "ports": ports}
    raw = {
        "name": "hub",
        "root": "hub",
        "vessels": vessels,
        "inputs": {"mass": ["v3", "v11"], "torque": True},
        "outputs": {"names": ["inertia", "barycentre", "angular_velocity", "v5.origin", "v5.attitude"]},
    }
    if by == "docks":
        return raw | {"docks": [{"ports": [f"hub.{name}", f"{name}.root"]} for name in names]}
    mounts = [_mount("hub", name, places[name], turns[name]) for name in names]
    return raw | {"mounts": mounts}


def _port(position: list[float], R: Array) -> dict[str, Any]:
    return {"position": position, "direction": R[:, 0].tolist(), "alignment": R[:, 1].tolist()}


def _mount(parent: str, child: str, position: list[float], attitude: list[float]) -> dict[str, Any]:
    return {"parent": parent, "child": child, "position": position, "attitude": attitude}


def model_c(raw: dict[str, Any]) -> str:
    """Returns the generated C of a scene."""
    given = scene(raw)
    return generate(given, 3, equations(given))[0]["model.c"]


def test_quarter_turns_are_exact() -> None:
    for attitude in quarter_turns():
        R = mount_rotation(Mount(parent="A", child="B", position=(0.0, 0.0, 0.0), attitude=attitude))
        assert np.array_equal(R, np.round(turned(attitude)))


@pytest.mark.parametrize("root", ["hub", "v7"])
def test_mounts_and_ports_of_the_same_pose_are_the_same_to_the_last_bit(root: str) -> None:
    mounts, docks = ({**hub(by), "root": root} for by in ("mounts", "docks"))
    assert model_c(mounts) == model_c(docks)


def test_the_loop_over_many_vessels_takes_mounts_as_it_takes_docks() -> None:
    """Sixty vessels whose ports move, every fourth with another one mounted, or docked, to it."""
    raw = station(60, [f"v{i}" for i in range(60)])
    raw["inputs"]["pose"] = [port for dock in raw["docks"] for port in dock["ports"]]
    mounts, place = [], [0.3, -0.7, 0.2]
    for i in range(0, 60, 4):
        attitude = quarter_turns()[i % 24]
        raw["vessels"][f"v{i}"]["ports"]["side"] = _port(place, np.round(turned(attitude)))
        raw["vessels"][f"w{i}"] = {"mass": 20.0, "pmi": [0.1, 0.2, 0.15], "ports": {"root": ROOT}}
        mounts.append(_mount(f"v{i}", f"w{i}", place, attitude))
    docks = [{"ports": [f"{m['parent']}.side", f"{m['child']}.root"]} for m in mounts]
    mounted = model_c(raw | {"mounts": mounts})
    assert "LOOP" in mounted.upper()
    assert mounted == model_c(raw | {"docks": raw["docks"] + docks})


def mixed() -> Scene:
    """Returns a chain of seven vessels: mounts either way, docks, one of them with a pose that moves."""
    rng = np.random.default_rng(5)
    vessels = {
        name: {
            "mass": rng.uniform(1.0, 9.0),
            "pmi": (rng.uniform(1.0, 2.0, 3) + 1.0).tolist(),
            "centre_of_mass": rng.normal(size=3).tolist(),
            "ports": {
                end: {
                    "position": rng.normal(size=3).tolist(),
                    "direction": (axis := rng.normal(size=3)).tolist(),
                    "alignment": np.cross(axis, rng.normal(size=3)).tolist(),
                }
                for end in ("fore", "aft")
            },
        }
        for name in "ABCDEFG"
    }

    def mount(parent: str, child: str) -> dict[str, Any]:
        return _mount(parent, child, rng.normal(size=3).tolist(), rng.normal(size=4).tolist())

    return scene(
        {
            "name": "chain",
            "root": "C",
            "vessels": vessels,
            "docks": [{"ports": ["C.aft", "D.fore"]}, {"ports": ["F.fore", "E.aft"]}],
            "mounts": [mount("A", "B"), mount("B", "C"), mount("D", "E"), mount("G", "F")],
            "inputs": {"mass": ["A", "G"], "pose": ["D.fore"], "torque": True},
        }
    )


def test_twin_and_reference_agree_where_mounts_and_docks_are_mixed() -> None:
    given, rng = mixed(), np.random.default_rng(6)
    twin = Twin(given)
    for _ in range(5):
        values = dict(zip(twin.p_names, twin.p_start, strict=True))
        values = {name: x * rng.uniform(0.8, 1.2) for name, x in values.items()}
        found = reference.composite(given, values)
        mass, barycentre, inertia = (np.array(x) for x in twin.composite(list(values.values()))[:3])
        assert abs(mass.item() - found.mass) <= COMPOSITE_TOLERANCE * found.mass
        size = np.abs(found.inertia).max()
        assert np.abs(barycentre.ravel() - found.barycentre).max() <= 20.0 * COMPOSITE_TOLERANCE
        assert np.abs(inertia - found.inertia).max() <= 20.0 * COMPOSITE_TOLERANCE * size


def test_vessels_that_are_mounted_stand_where_the_mount_says() -> None:
    given = mixed()
    placed = poses_at_start(given)
    assert set(placed) == set(given.vessels)
    for mount in given.mounts:
        (R_root_parent, origin), (R_root_child, child) = placed[mount.parent], placed[mount.child]
        assert np.abs(R_root_parent @ turned(list(mount.attitude)) - R_root_child).max() <= 1e-15 * 8
        assert np.abs(origin + R_root_parent @ np.array(mount.position) - child).max() <= 1e-15 * 16


def test_a_scene_with_mounts_is_written_and_read_as_the_same() -> None:
    given = mixed()
    text = scene_text(given)
    assert text.count("[[mounts]]") == 4
    assert parse_scene(tomllib.loads(text)) == given


def test_the_page_lists_mounts() -> None:
    given = mixed()
    pages = documentation(given, variable_table(equations(given)), 3, None)
    page = next(content.decode() for name, content in pages.items() if name.endswith(".html"))
    assert "Mounts: poses of vessels" in page
    assert "mounted to B" in page
    assert "an assembly of 7 joined vessels" in page


# Docks that open, where mounts are


def test_docks_know_that_mounted_vessels_are_joined() -> None:
    """A and B are mounted; C is docked to A and may be docked to B: both at once would be a loop."""
    port = {"position": [1.0, 0.0, 0.0], "direction": [1.0, 0.0, 0.0], "alignment": [0.0, 1.0, 0.0]}
    vessels = {
        name: {"mass": 3.0, "pmi": [1.0, 1.5, 2.0], "ports": {"one": port, "two": ROOT}} for name in "ABC"
    }
    raw = {
        "name": "pair",
        "root": "A",
        "vessels": vessels,
        "mounts": [_mount("B", "A", [0.0, 4.0, 0.0], [1.0, 0.0, 0.0, 0.0])],
        "docks": [
            {"name": "left", "ports": ["A.one", "C.two"]},
            {"name": "right", "ports": ["B.one", "C.one"], "docked": False},
        ],
        "inputs": {"docked": ["left", "right"]},
        "outputs": {"names": ["mass", "barycentre"]},
    }
    with flying(raw) as fmu:
        assert fmu.get("mass") == 9.0
        assert fmu.set({"right.docked": True}) == OK
        assert fmu.step(0.1) != OK
        assert "B.one - C.one closes a loop; B and C are joined already" in fmu.messages()[-1]
        assert fmu.set({"left.docked": False}) == OK
        assert fmu.step(0.1) != ERROR
        values = {"left.docked": 0.0, "right.docked": 1.0}
        expected = reference.composite(scene(raw), values)
        assert np.abs(fmu.get("barycentre") - expected.barycentre).max() <= 1e-15


# Bad input

PAIR: dict[str, Any] = {
    "name": "pair",
    "root": "A",
    "vessels": {
        "A": {"mass": 1.0, "pmi": [1.0, 1.0, 1.0], "ports": {"p": ROOT}},
        "B": {"mass": 1.0, "pmi": [1.0, 1.0, 1.0], "ports": {"q": ROOT}},
    },
}
ON_A = {"parent": "A", "child": "B", "position": [1.0, 0.0, 0.0]}
UNREACHED = "is not reached from the root A by docks or mounts"

BAD = [
    case(
        "loop of mounts",
        {"mounts": [ON_A, {**ON_A, "parent": "B", "child": "A"}]},
        "mounts[2]: closes a loop; B and A are joined already",
        base=PAIR,
    ),
    case(
        "loop of a dock and a mount",
        {"mounts": [ON_A], "docks": [{"ports": ["A.p", "B.q"]}]},
        "mounts[1]: closes a loop; A and B are joined already",
        base=PAIR,
    ),
    case(
        "port",
        {"mounts": [{**ON_A, "parent": "A.p"}]},
        'mounts[1].parent = "A.p": must be a vessel, and is a port; ports are mated under [[docks]]',
        base=PAIR,
    ),
    case(
        "both ports",
        {"mounts": [{**ON_A, "parent": "A.p", "child": "B.q"}]},
        'mounts[1].parent = "A.p": must be a vessel, and is a port; ports are mated under [[docks]]',
        'mounts[1].child = "B.q": must be a vessel, and is a port; ports are mated under [[docks]]',
        base=PAIR,
    ),
    case(
        "unknown vessel",
        {"mounts": [{**ON_A, "child": "BB"}]},
        'mounts[1].child: unknown vessel "BB" (did you mean "B"?)',
        base=PAIR,
    ),
    case(
        "to itself",
        {"mounts": [{**ON_A, "child": "A"}]},
        "mounts[1]: parent and child are both A; a mount joins two vessels",
        f"vessels.B: {UNREACHED}",
        base=PAIR,
    ),
    case(
        "unreached",
        {"mounts": [ON_A], "vessels.C": PAIR["vessels"]["A"]},
        f"vessels.C: {UNREACHED}",
        base=PAIR,
    ),
    case(
        "a dock of a vessel that is mounted",
        {"mounts": [ON_A], "docks": [{"ports": ["A", "B.q"]}]},
        f'docks[1].ports: "A" {ONE_PORT}',
        "mounts[1]: closes a loop; A and B are joined already",
        base=PAIR,
    ),
    case(
        "no position",
        {"mounts": [{"parent": "A", "child": "B"}]},
        "mounts[1].position: missing",
        base=PAIR,
    ),
    case(
        "no rotation",
        {"mounts": [{**ON_A, "attitude": [0.0, 0.0, 0.0, 0.0]}]},
        "mounts[1].attitude = [0.0, 0.0, 0.0, 0.0]: must have a length greater than 0",
        base=PAIR,
    ),
    case(
        "unknown key",
        {"mounts": [{**ON_A, "ports": ["A.p", "B.q"]}]},
        'mounts[1]: unknown key "ports" (did you mean "parent"?)',
        'mounts[1].ports = ["A.p", "B.q"]: a mount has none; ports are mated under [[docks]]',
        base=PAIR,
    ),
    case(
        "one table",
        {"mounts": ON_A},
        'mounts = {parent = "A", child = "B", position = [1.0, 0.0, 0.0]}: must be an array of tables, '
        "written [[mounts]]",
        f"vessels.B: {UNREACHED.replace(' or mounts', '')}",
        base=PAIR,
    ),
    case("number", {"mounts": [3]}, "mounts[1] = 3: must be a table", base=PAIR),
]


@pytest.mark.parametrize(("base", "changes", "expected"), BAD)
def test_a_mount_that_cannot_be_is_refused_by_name_and_value(
    base: dict[str, Any], changes: dict[str, Any], expected: list[str]
) -> None:
    assert problems(variant(base, changes)) == expected
