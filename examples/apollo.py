"""Apollo 11's docked spacecraft from its published sheet, and how far published composites are apart.

python examples/apollo.py     prints two tables.
"""

from pathlib import Path

import numpy as np

from supervessel import Twin, load_scene

POUND, INCH = 0.45359237, 0.0254  # kg, m
SLUG_FT2 = POUND * 9.80665 * 0.3048  # kg m2

# Apollo 11 Mission Report, MSC-00171, appendix A, "Transposition and docking": weight [lb], centre of
# mass [in], moments xx, yy, zz and products xy, xz, yz [slug ft2].
SHEET = {
    "CSM": (63473.0, (934.0, 4.0, 6.5), (34445, 76781, 79530), (-1789, -126, 3148)),
    "LM": (33294.5, (1236.2, 0.2, 0.1), (22299, 24826, 24966), (-508, 27, 37)),
    "total docked": (96767.5, (1038.0, 2.7, 4.3), (57006, 532219, 534981), (-7672, -9240, 3300)),
}

# Routine MASSPROP of Comanche 055, the flight computer's programme on Apollo 11; its numbers come from the
# CSM/LM Spacecraft Operational Data Book, vol. 3, SNA-8-D-027 (March 1968). With both stages of the lunar
# module docked:
BREAKPOINT = 15402.17  # kg, of the command and service modules
ROLL = (26850.0, 1.96307, 1.5398)  # kg m2, and per kg of the lunar module; per kg of the other
LATERAL = (127518.0, 27.5774)
LATERAL_SLOPE = (-0.742923, 1.044e-3)  # per kg of the command and service modules above the breakpoint


def flight_computer(csm: float, lm: float) -> tuple[float, float]:
    """Returns the moments about the roll axis and across it [kg m2] that the computer had, of masses [kg]."""
    over = csm - BREAKPOINT
    across = LATERAL[0] + LATERAL[1] * lm + over * (LATERAL_SLOPE[0] + LATERAL_SLOPE[1] * lm)
    return ROLL[0] + ROLL[1] * lm + over * ROLL[2], across


def told_by_orbiter(pmi: np.ndarray, barycentre: np.ndarray, origin: np.ndarray) -> np.ndarray:
    """Returns the moments over mass, (3,) [m2], that Orbiter's GetPMI tells a docked vessel of the whole.

    pmi         : those about the barycentre; barycentre, origin : (3,) [m], of the whole, of the vessel
    They are about that vessel's origin, its centre of mass. Six points stand for the whole, and the distance
    of each is added without the sixth part that its mass is: the parallel-axis part counts six times.
    Source: Orbiter, Src/Orbiter/SuperVessel.cpp, MIT licence.
    """
    x, y, z = (barycentre - origin) ** 2
    return pmi + 6.0 * np.array([y + z, z + x, x + y])


def published(name: str) -> tuple[float, np.ndarray, np.ndarray]:
    """Returns mass [kg], centre of mass, (3,) [m], and tensor, (3, 3) [kg m2], of a row of the sheet."""
    weight, stations, (xx, yy, zz), (xy, xz, yz) = SHEET[name]
    tensor = np.array([[xx, -xy, -xz], [-xy, yy, -yz], [-xz, -yz, zz]]) * SLUG_FT2
    return weight * POUND, np.array(stations) * INCH, tensor


def composite() -> tuple[float, np.ndarray, np.ndarray]:
    """Returns the same of the two vessels of the scene together."""
    twin = Twin(load_scene(Path(__file__).with_name("apollo.toml")))
    mass, barycentre, inertia = (np.array(part) for part in twin.composite(twin.p_start)[:3])
    return float(mass.item()), barycentre.ravel(), inertia


def comparison() -> str:
    """Returns the table of the published composite and the one made of its parts, in the sheet's units."""
    names = ("weight [lb]", "x [in]", "y", "z", "xx [slug ft2]", "yy", "zz", "product xy", "xz", "yz")
    columns = []
    for mass, centre, J in (published("total docked"), composite()):
        elements = np.array([J[0, 0], J[1, 1], J[2, 2], -J[0, 1], -J[0, 2], -J[1, 2]])
        columns.append([mass / POUND, *(centre / INCH), *(elements / SLUG_FT2)])
    lines = ["| | in the report | of its parts, here | off |", "|---|---:|---:|---:|"]
    for number, (name, theirs, ours) in enumerate(zip(names, *columns, strict=True)):
        digits = 1 if number < 4 else 0
        off = round(ours - theirs, digits) + 0.0
        lines.append(f"| {name} | {theirs:.{digits}f} | {ours:.{digits}f} | {off:.{digits}f} |")
    return "\n".join(lines)


def spread() -> str:
    """Returns the table of the moments over mass by source, and the rate after a minute of 1000 N m."""
    mass, barycentre, J = composite()
    ours, (_, csm, _) = np.diag(J) / mass, published("CSM")
    total, _, theirs = published("total docked")
    roll, across = flight_computer(published("CSM")[0], published("LM")[0])
    by_source = {
        "parts of the sheet, here": ours,
        "the sheet's own sum": np.diag(theirs) / total,
        "the flight computer's fit to the data book": np.array([roll, across, across]) / mass,
        "without the parallel-axis part": np.diag(published("CSM")[2] + published("LM")[2]) / mass,
        "what Orbiter tells the docked CSM": told_by_orbiter(ours, barycentre, csm),
    }
    head = "| moments over mass [m2] | x | y | z | 1000 N m about y for 60 s [deg/s] |"
    lines = [head, "|---|---:|---:|---:|---:|"]
    for name, pmi in by_source.items():
        rate = np.degrees(1000.0 * 60.0 / (pmi[1] * mass))
        lines.append(f"| {name} | {pmi[0]:.2f} | {pmi[1]:.2f} | {pmi[2]:.2f} | {rate:.2f} |")
    return "\n".join(lines)


if __name__ == "__main__":
    print(f"{comparison()}\n\n{spread()}")
