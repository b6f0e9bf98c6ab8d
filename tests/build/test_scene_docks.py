"""Docks that make no tree, and inputs that cannot be."""

import pytest

from support import ISS_DG, variant
from support.refusals import CUBE, DOCK, NO_POSE, ONE_PORT, PORT, UNREACHED, case, problems

TUG = {"mass": 10.0, "pmi": [1.0, 1.0, 1.0], "ports": {"fore": PORT, "aft": PORT}}
WITH_TUG = variant(ISS_DG, {"vessels.TUG": TUG, "vessels.ISS.ports.P3": PORT, "vessels.DG.ports.tail": PORT})

TWO_PORTS = 'must be two ports, written "vessel.port"'

DOCKS = [
    case(
        "loop",
        {"docks": [DOCK, {"ports": ["ISS.P3", "TUG.fore"]}, {"ports": ["TUG.aft", "DG.tail"]}]},
        "docks[3].ports: TUG.aft - DG.tail closes a loop; TUG and DG are joined already",
        base=WITH_TUG,
    ),
    case(
        "port docked twice",
        {"docks": [DOCK, {"ports": ["ISS.P2", "TUG.fore"]}]},
        "docks[2].ports: port ISS.P2 is docked already, in docks[1]",
        base=WITH_TUG,
    ),
    case(
        "vessel docked to itself",
        {"docks": [DOCK, {"ports": ["ISS.P3", "DG.tail"]}, {"ports": ["TUG.fore", "TUG.aft"]}]},
        "docks[2].ports: ISS.P3 - DG.tail closes a loop; ISS and DG are joined already",
        "docks[3].ports: both ports belong to TUG; a dock joins two vessels",
        f"vessels.TUG: {UNREACHED}",
        base=WITH_TUG,
    ),
    case(
        "port docked to itself",
        {"docks": [{"ports": ["DG.nose", "DG.nose"]}]},
        "docks[1].ports: both ports belong to DG; a dock joins two vessels",
        f"vessels.DG: {UNREACHED}",
        base=NO_POSE,
    ),
    case("no docks", {"docks": []}, f"vessels.DG: {UNREACHED}", base=NO_POSE),
    case(
        "vessels docked away from the root",
        {"docks": [{"ports": ["TUG.fore", "DG.nose"]}]},
        f"vessels.DG: {UNREACHED}",
        f"vessels.TUG: {UNREACHED}",
        base=WITH_TUG,
    ),
    case("dock of a vessel", {"docks": [{"ports": ["ISS", "DG.nose"]}]}, f'docks[1].ports: "ISS" {ONE_PORT}'),
    case(
        "dock of a dotted name too many",
        {"docks": [{"ports": ["ISS.P2.x", "DG.nose"]}]},
        f'docks[1].ports: "ISS.P2.x" {ONE_PORT}',
    ),
    case("dock of one", {"docks": [{"ports": ["DG.nose"]}]}, f'docks[1].ports = ["DG.nose"]: {TWO_PORTS}'),
    case(
        "dock of three",
        {"docks": [{"ports": ["ISS.P2", "DG.nose", "DG.tail"]}]},
        f'docks[1].ports = ["ISS.P2", "DG.nose", "DG.tail"]: {TWO_PORTS}',
    ),
    case(
        "[docks] for [[docks]]",
        {"docks": DOCK},
        'docks = {ports = ["ISS.P2", "DG.nose"]}: must be an array of tables, written [[docks]]',
        base=variant(NO_POSE, {"vessels.DG": None, "inputs": {}}),
    ),
]

INPUTS = [
    case(
        "pose of an undocked port",
        {"inputs.pose": ["DG.tail"], "docks": [DOCK, {"ports": ["ISS.P3", "TUG.fore"]}]},
        "inputs.pose: DG.tail is not docked; its pose would change nothing",
        base=WITH_TUG,
    ),
    case(
        "pmi of a vessel given by inertia",
        {"vessels.DG.pmi": None, "vessels.DG.inertia": CUBE},
        "inputs.pmi: DG is given by inertia; only a vessel given by pmi has this input",
    ),
    case("mass twice", {"inputs.mass": ["DG", "DG"]}, "inputs.mass: DG is listed 2 times"),
    case("pmi twice", {"inputs.pmi": ["DG", "ISS", "DG"]}, "inputs.pmi: DG is listed 2 times"),
    case("pose three times", {"inputs.pose": ["DG.nose"] * 3}, "inputs.pose: DG.nose is listed 3 times"),
    case("output twice", {"outputs.names": ["pmi", "mass", "pmi"]}, "outputs.names: pmi is listed 2 times"),
]


@pytest.mark.parametrize(("base", "changes", "expected"), DOCKS)
def test_docks_that_make_no_tree_are_named(base, changes, expected):
    assert problems(variant(base, changes)) == expected


@pytest.mark.parametrize(("base", "changes", "expected"), INPUTS)
def test_an_input_that_cannot_be_is_named(base, changes, expected):
    assert problems(variant(base, changes)) == expected
