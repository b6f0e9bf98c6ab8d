"""Composites worked out by hand: numpy reference, twin and both FMUs give the same mass distribution."""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any

import mpmath as mp
import numpy as np
import pytest

from supervessel import Twin, reference
from support import ISS_DG, Array, flying, relative_error, scene, variant

Rows = Sequence[Sequence[Any]]

ENGINES = ("reference", "twin", "fmi2", "fmi3")

# Five vessels at most: 30 points or 4 joins of some 50 operations each, every one good to 1.1e-16 of the
# largest element, and decimals in the scenes that are as far from the fractions here. 1e-13 is 900 roundings.
AGREEMENT = 1e-13

F = Fraction
ONE = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
PRINTED = 5e-4  # half a unit of the third decimal, m2
PRINTED_PRODUCT = 5e-5  # half a unit of the fourth decimal, m2


@dataclass(frozen=True)
class Mass:
    """mass [kg], barycentre (3,) [m] and inertia (3, 3) [kg m2] of a whole."""

    mass: float
    barycentre: Array
    inertia: Array


@dataclass(frozen=True)
class Part:
    """A vessel placed by hand.

    rotation : R_root_vessel, by rows
    origin   : of the vessel, root axes [m]
    pmi      : the vessel's three moments over mass, or its tensor over mass by rows [m2]
    centre   : its centre of mass, vessel axes [m]
    """

    mass: Any
    pmi: Sequence[Any]
    origin: Sequence[Any] = (0, 0, 0)
    rotation: Rows = ONE
    centre: Sequence[Any] = (0, 0, 0)


def times(A: Rows, B: Rows) -> list[list[Any]]:
    return [[sum(a * B[k][j] for k, a in enumerate(row)) for j in range(len(B[0]))] for row in A]


@mp.workdps(50)
def worked_out(parts: Sequence[Part], number: Any = Fraction) -> Mass:
    """Returns the whole by the parallel-axis theorem, in rational (or 50-digit) arithmetic."""

    def exact(rows: Rows) -> list[list[Any]]:
        return [[number(x) for x in row] for row in rows]

    placed = []
    for part in parts:
        R = exact(part.rotation)
        pmi = part.pmi if isinstance(part.pmi[0], Sequence) else np.diag(part.pmi).tolist()
        turned = times(times(R, exact(pmi)), [list(column) for column in zip(*R, strict=True)])
        offset = [row[0] for row in times(R, [[number(x)] for x in part.centre])]
        placed.append(
            (number(part.mass), [number(o) + d for o, d in zip(part.origin, offset, strict=True)], turned)
        )
    mass = sum(m for m, _, _ in placed)
    barycentre = [sum(m * r[i] for m, r, _ in placed) / mass for i in range(3)]
    inertia = [[number(0)] * 3 for _ in range(3)]
    for m, r, k in placed:
        rho = [a - b for a, b in zip(r, barycentre, strict=True)]
        square = sum(x * x for x in rho)
        for i in range(3):
            for j in range(3):
                inertia[i][j] += m * (k[i][j] + (square if i == j else 0) - rho[i] * rho[j])
    return Mass(float(mass), np.array(barycentre, dtype=float), np.array(inertia, dtype=float))


def port(position: Sequence[float], direction: Sequence[float], alignment: Sequence[float]) -> dict[str, Any]:
    return {"position": list(position), "direction": list(direction), "alignment": list(alignment)}


def assembly(vessels: dict[str, Any], docks: Sequence[tuple[str, str]], **more: Any) -> dict[str, Any]:
    """Returns a raw scene whose root is the first vessel."""
    return {
        "name": "assembly",
        "root": next(iter(vessels)),
        "vessels": vessels,
        "docks": [{"ports": list(pair)} for pair in docks],
        "outputs": {"names": ["mass", "barycentre", "pmi", "inertia"]},
        **more,
    }


@cache
def _answer(engine: str, case: str) -> tuple[Mass, Array]:
    raw = CASES[case][0]
    if engine == "reference":
        whole = reference.composite(scene(raw))
        return Mass(whole.mass, whole.barycentre, whole.inertia), whole.pmi
    if engine == "twin":
        twin = Twin(scene(raw))
        mass, barycentre, inertia, pmi = (np.array(value) for value in twin.composite(twin.p_start))
        return Mass(float(mass[0, 0]), barycentre.ravel(), inertia), pmi.ravel()
    with flying(raw, int(engine[-1])) as fmu:
        inertia = fmu.get("inertia").reshape(3, 3)
        return Mass(fmu.get("mass"), fmu.get("barycentre"), inertia), fmu.get("pmi")


# Two DeltaGliders, the second turned by 180 degrees about the y axis: R (0,0,-1) = (0,0,1), R (0,1,0) =
# (0,1,0). Its origin lies at nose - R nose = (0, 0, 2 * -10.076); the barycentre is half way.
NOSE = port((0.0, -0.49, -10.076), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0))
SHIP = {"mass": 24500.0, "pmi": [15.5, 22.1, 7.7], "ports": {"nose": NOSE}}
SHIPS = assembly({"One": SHIP, "Two": SHIP}, [("One.nose", "Two.nose")])
LEVER = F("10.076") ** 2  # of either ship's centre about the barycentre, m2

# Ship B's nose (+z) on A's side port (+x), its alignment (3/5, 4/5, 0) along A's y: R e_z = -e_x,
# R (3/5, 4/5, 0) = e_y, and R (-4/5, 3/5, 0) = R (d x a) = -d_A x a_A = -e_z.
OFF_AXIS = assembly(
    {
        "A": {
            "mass": 8000.0,
            "pmi": [4.0, 9.0, 11.0],
            "centre_of_mass": [0.5, 0.0, -0.25],
            "ports": {"side": port((3.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))},
        },
        "B": {
            "mass": 2000.0,
            "pmi": [2.0, 3.0, 4.0],
            "centre_of_mass": [0.1, 0.2, 0.3],
            "ports": {"nose": port((0.0, 0.0, 5.0), (0.0, 0.0, 1.0), (0.6, 0.8, 0.0))},
        },
    },
    [("B.nose", "A.side")],
)
OFF_AXIS_PARTS = [
    Part(8000, (4, 9, 11), centre=(F("0.5"), 0, F("-0.25"))),
    Part(
        2000,
        (2, 3, 4),
        (8, 1, 0),
        ((0, 0, -1), (F(3, 5), F(4, 5), 0), (F(4, 5), F(-3, 5), 0)),
        (F("0.1"), F("0.2"), F("0.3")),
    ),
]

# A hub with six ports at 2 m. A laboratory ahead (+x), turned by 90 degrees about its own axis; a ship at the
# laboratory's far end; a tank above (+z); an arm with a tensor of its own on the left (+y).
HUB_PORTS = {
    "px": port((2.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    "nx": port((-2.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    "py": port((0.0, 2.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    "ny": port((0.0, -2.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)),
    "pz": port((0.0, 0.0, 2.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)),
    "nz": port((0.0, 0.0, -2.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)),
}
STATION = assembly(
    {
        "Hub": {"mass": 12000.0, "pmi": [2.5, 2.5, 2.0], "ports": HUB_PORTS},
        "Lab": {
            "mass": 15000.0,
            "pmi": [3.0, 8.0, 7.0],
            "ports": {
                "aft": port((-4.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
                "fore": port((4.0, 0.0, 0.5), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
            },
        },
        "Ship": {
            "mass": 7000.0,
            "pmi": [5.0, 6.0, 2.0],
            "centre_of_mass": [0.0, 0.25, 0.5],
            "ports": {"nose": port((0.0, 0.0, 3.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0))},
        },
        "Tank": {
            "mass": 900.0,
            "pmi": [1.0, 1.0, 1.5],
            "ports": {"end": port((0.0, 1.5, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))},
        },
        "Arm": {
            "mass": 400.0,
            "inertia": [[2000.0, 100.0, -200.0], [100.0, 1600.0, 50.0], [-200.0, 50.0, 1200.0]],
            "centre_of_mass": [1.0, 0.0, -0.5],
            "ports": {"base": port((0.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0))},
        },
    },
    [("Hub.px", "Lab.aft"), ("Ship.nose", "Lab.fore"), ("Hub.pz", "Tank.end"), ("Arm.base", "Hub.py")],
)
# Lab:  R (-1,0,0) = (-1,0,0), R e_z = e_y, so R e_y = -e_z; origin (2,0,0) + (4,0,0).
# Ship: in the laboratory R e_z = -e_x, R e_y = e_y, R e_x = e_z, origin (4, 0, 1/2) + (3, 0, 0); in the hub's
#       axes e_y becomes -e_z, e_z becomes e_y: R e_z = -e_x, R e_y = -e_z, R e_x = e_y, origin (13, 1/2, 0).
# Tank: R e_y = -e_z, R e_z = e_x, R e_x = -e_y; origin (0,0,2) - R (0, 3/2, 0) = (0, 0, 7/2).
# Arm:  R (0,-1,0) = (0,-1,0), R e_z = e_z: its axes are the hub's; origin (0, 2, 0).
STATION_PARTS = [
    Part(12000, (F(5, 2), F(5, 2), 2)),
    Part(15000, (3, 8, 7), (6, 0, 0), ((1, 0, 0), (0, 0, 1), (0, -1, 0))),
    Part(7000, (5, 6, 2), (13, F(1, 2), 0), ((0, 0, -1), (1, 0, 0), (0, -1, 0)), (0, F(1, 4), F(1, 2))),
    Part(900, (1, 1, F(3, 2)), (0, 0, F(7, 2)), ((0, 0, 1), (-1, 0, 0), (0, -1, 0))),
    Part(
        400,
        [[5, F(1, 4), F(-1, 2)], [F(1, 4), 4, F(1, 8)], [F(-1, 2), F(1, 8), 3]],
        (0, 2, 0),
        centre=(1, 0, F(-1, 2)),
    ),
]

# A beam given by its tensor, tilted by 0.4 rad about x, then 0.7 rad about z, its centre of mass off centre.
with mp.workdps(50):
    TILT = mp.matrix(
        [[mp.cos("0.7"), -mp.sin("0.7"), 0], [mp.sin("0.7"), mp.cos("0.7"), 0], [0, 0, 1]]
    ) * mp.matrix([[1, 0, 0], [0, mp.cos("0.4"), -mp.sin("0.4")], [0, mp.sin("0.4"), mp.cos("0.4")]])
    BEAM_TENSOR = (3000 * TILT * mp.diag([2, 30, 31]) * TILT.T).tolist()
BEAM_INERTIA = [[float(BEAM_TENSOR[min(i, j)][max(i, j)]) for j in range(3)] for i in range(3)]
BEAM_CENTRE = (4.0, -1.0, 2.5)
BEAM_END = (0.0, 0.0, -2.0)
TUG = {
    "mass": 1100.0,
    "pmi": [1.0, 2.0, 2.5],
    "ports": {"fore": port((0.0, 0.0, 1.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))},
}
BEAM = assembly(
    {
        "Tug": TUG,
        "Beam": {
            "mass": 3000.0,
            "inertia": BEAM_INERTIA,
            "centre_of_mass": list(BEAM_CENTRE),
            "ports": {"end": port(BEAM_END, (0.0, 0.0, -1.0), (1.0, 0.0, 0.0))},
        },
    },
    [("Tug.fore", "Beam.end")],
)
BEAM_PARTS = [
    Part(1100, (1, 2, mp.mpf("2.5"))),
    Part(3000, [[x / 3000 for x in row] for row in BEAM_TENSOR], (0, 0, 3), centre=BEAM_CENTRE),
]
# The same beam with moments along its own principal axes, its origin in its centre of mass: its port then
# lies at R^T (end - centre) and looks along R^T of the old directions.
LOCAL = np.array(TILT.tolist(), dtype=float).T
BEAM_BY_PMI = variant(
    BEAM,
    {
        "vessels.Beam": {
            "mass": 3000.0,
            "pmi": [2.0, 30.0, 31.0],
            "ports": {
                "end": port(
                    (LOCAL @ (np.array(BEAM_END) - BEAM_CENTRE)).tolist(),
                    (-LOCAL[:, 2]).tolist(),
                    LOCAL[:, 0].tolist(),
                )
            },
        }
    },
)
# Two tugs in one vessel's place: their tensor about their common centre of mass, 4 m apart along x.
PAIR = worked_out([Part(1100, (1, 2, F(5, 2)), (-1, 2, 3)), Part(1100, (1, 2, F(5, 2)), (3, 2, 3))])
BEAM_OF_TUGS = variant(
    BEAM,
    {
        "vessels.Beam": {
            "mass": PAIR.mass,
            "inertia": PAIR.inertia.tolist(),
            "centre_of_mass": PAIR.barycentre.tolist(),
            "ports": {"end": port(BEAM_END, (0.0, 0.0, -1.0), (1.0, 0.0, 0.0))},
        }
    },
)
BEAM_OF_TUGS_PARTS = [Part(1100, (1, 2, F(5, 2)), origin) for origin in ((0, 0, 0), (-1, 2, 6), (3, 2, 6))]

# DeltaGlider on the ISS: R (0,0,-1) = (0,1,0), R (0,1,0) = alignment of ISS's port, R e_x = R e_y x R e_z.
GLIDER = F("0.49"), F("10.076")  # its nose lies at (0, -0.49, -10.076)
PORT = F("0.09"), F("-17.9"), F("3.8")


def glider(alignment: Sequence[int]) -> list[Part]:
    """Returns the parts of ISS_DG with the ISS's port aligned along +-x or +-z."""
    ax, _, az = alignment
    R = (
        (az, ax, 0),
        (0, 0, -1),
        (-ax, az, 0),
    )  # columns: (ax,0,az) x (0,-1,0) = (az, 0, -ax), (ax,0,az), (0,-1,0)
    low, ahead = GLIDER
    origin = (PORT[0] + ax * low, PORT[1] - ahead, PORT[2] + az * low)  # port - R (0, -low, -ahead)
    return [Part(455000, (385, 719, 508)), Part(24500, (F("15.5"), F("22.1"), F("7.7")), origin, R)]


def turned(alignment: Sequence[int]) -> dict[str, Any]:
    return variant(ISS_DG, {"vessels.ISS.ports.P2.alignment": [float(x) for x in alignment]})


CASES: dict[str, tuple[dict[str, Any], Mass]] = {
    "ISS and DeltaGlider": (ISS_DG, worked_out(glider((0, 0, -1)))),
    "nose to nose": (
        SHIPS,
        Mass(
            49000.0,
            np.array([0.0, 0.0, -10.076]),
            np.diag(
                [
                    float(49000 * (k + lever))
                    for k, lever in ((F("15.5"), LEVER), (F("22.1"), LEVER), (F("7.7"), 0))
                ]
            ),
        ),
    ),
    "off axis": (OFF_AXIS, worked_out(OFF_AXIS_PARTS)),
    "station of five": (STATION, worked_out(STATION_PARTS)),
    "tilted beam": (BEAM, worked_out(BEAM_PARTS, mp.mpf)),
    "tilted beam by pmi": (BEAM_BY_PMI, worked_out(BEAM_PARTS, mp.mpf)),
    "beam of two tugs": (BEAM_OF_TUGS, worked_out(BEAM_OF_TUGS_PARTS)),
    "port turned by 90 degrees": (turned((1, 0, 0)), worked_out(glider((1, 0, 0)))),
    "port turned by -90 degrees": (turned((-1, 0, 0)), worked_out(glider((-1, 0, 0)))),
}


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("case", CASES)
def test_mass_is_the_sum(case: str, engine: str) -> None:
    assert relative_error(_answer(engine, case)[0].mass, CASES[case][1].mass) <= AGREEMENT


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("case", CASES)
def test_barycentre_is_that_worked_out_by_hand(case: str, engine: str) -> None:
    assert relative_error(_answer(engine, case)[0].barycentre, CASES[case][1].barycentre) <= AGREEMENT


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("case", CASES)
def test_inertia_is_that_worked_out_by_hand(case: str, engine: str) -> None:
    assert relative_error(_answer(engine, case)[0].inertia, CASES[case][1].inertia) <= AGREEMENT


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("case", CASES)
def test_pmi_is_the_diagonal_over_mass(case: str, engine: str) -> None:
    truth = CASES[case][1]
    assert relative_error(_answer(engine, case)[1], np.diag(truth.inertia) / truth.mass) <= AGREEMENT


@pytest.mark.parametrize("engine", [engine for engine in ENGINES if engine != "reference"])
@pytest.mark.parametrize("case", CASES)
def test_inertia_is_exactly_symmetric(case: str, engine: str) -> None:
    inertia = _answer(engine, case)[0].inertia
    assert inertia.tolist() == inertia.T.tolist()


@pytest.mark.parametrize("engine", ENGINES)
def test_iss_with_deltaglider_has_the_published_pmi(engine: str) -> None:
    pmi = _answer(engine, "ISS and DeltaGlider")[1]
    assert np.abs(pmi - [404.598, 683.188, 521.120]).max() <= PRINTED


@pytest.mark.parametrize("engine", ENGINES)
def test_iss_with_deltaglider_has_the_published_products_of_inertia(engine: str) -> None:
    whole = _answer(engine, "ISS and DeltaGlider")[0]
    products = whole.inertia[[0, 0, 1], [1, 2, 2]] / whole.mass
    assert np.abs(products - [0.1221, -0.0144, 4.4897]).max() <= PRINTED_PRODUCT


@pytest.mark.parametrize("engine", ENGINES)
def test_iss_with_deltaglider_has_the_published_principal_moments(engine: str) -> None:
    whole = _answer(engine, "ISS and DeltaGlider")[0]
    principal = np.linalg.eigvalsh(whole.inertia) / whole.mass
    assert np.abs(principal - [404.598, 520.996, 683.312]).max() <= PRINTED


def test_rotation_of_a_port_moves_the_ship() -> None:
    straight, turned = (
        CASES[case][1].inertia for case in ("ISS and DeltaGlider", "port turned by 90 degrees")
    )
    assert relative_error(turned, straight) > 1e-4
