"""The page that documents an FMU: what the scene holds, frames, variables, equations, what is refused.

One file of HTML without scripts or links to elsewhere, written so that an XML parser reads it too.
"""

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib.metadata import version
from math import floor, log10
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fmu_build.interface.variable_table import Role, TableEntry
from supervessel.composite.docks import joints, switchable
from supervessel.drawing.geometry import Assembly
from supervessel.reference import Composite
from supervessel.rotation.propagators import description
from supervessel.scene.schema import Law, Scene, Vessel

Cell = str | float | Sequence[float]

TEMPLATE = Path(__file__).with_name("page.html")
"""The page's fixed text; $names stand where the scene's own go."""

PRIME, MINUS, TIMES = "\N{PRIME}", "\N{MINUS SIGN}", "\N{MULTIPLICATION SIGN}"

ROLE_TITLES: dict[Role, tuple[str, str]] = {
    "time": ("Independent variable", ""),
    "input": (
        "Inputs",
        "In co-simulation they hold over a communication step; in model exchange they are continuous.",
    ),
    "parameter": ("Parameters", "Fixed once initialisation ends."),
    "output": (
        "Outputs",
        "Those of the end of a communication step; after a set they follow from the new inputs.",
    ),
    "state": ("States", "Model exchange: the importer's solver integrates them."),
    "derivative": ("Derivatives", "Rates of the states."),
}

LAWS: dict[Law, tuple[str, str]] = {
    "none": (
        f"<i>ω</i>{PRIME} = 0",
        "The angular velocity is given and kept; the inertia tensor has no effect on it.",
    ),
    "decoupled": (
        f"<i>J</i><sub>ii</sub> <i>ω</i><sub>i</sub>{PRIME} = <i>M</i><sub>i</sub>, i = x, y, z",
        "Each axis for itself: no gyroscopic term, no products of inertia. For slow rates and short spans.",
    ),
    "principal": (
        f"<i>J</i><sub>xx</sub> <i>ω</i><sub>x</sub>{PRIME} = <i>M</i><sub>x</sub> {MINUS} "
        f"(<i>J</i><sub>zz</sub> {MINUS} <i>J</i><sub>yy</sub>) <i>ω</i><sub>y</sub> <i>ω</i><sub>z</sub>, "
        "and so on cyclically",
        "Euler's equations with the diagonal of the tensor, without products of inertia ([CV] eq. (2)).",
    ),
    "tensor": (
        f"<i>J ω</i>{PRIME} = <i>M</i> {MINUS} <i>ω</i> {TIMES} <i>J ω</i>",
        "Euler's equations with the full inertia tensor ([CV] eq. (1)).",
    ),
}
"""Equation and description of each rotation law, HTML."""

H = "<i>h</i>"
RHO = "<i>\N{GREEK SMALL LETTER RHO}</i><sub>j</sub>"

SPINNING_LAWS: dict[Law, str] = {
    "principal": f"{LAWS['principal'][0]}, with <i>J ω</i> + {H} in place of <i>J ω</i>",
    "tensor": f"<i>J ω</i>{PRIME} = <i>M</i> {MINUS} <i>ω</i> {TIMES} (<i>J ω</i> + {H})",
}
"""Equations of the laws that the momentum h of moving ports enters, HTML; in the others it does nothing."""

KEPT_BY = {
    ("mass", "rate"): "When a mass or a moment changes, the <b>angular velocity is kept</b>: mass leaves or "
    "arrives moving with the body.",
    ("mass", "momentum"): "When a mass or a moment changes, the <b>angular momentum is kept</b>: mass moves "
    "inside the assembly.",
    ("pose", "rate"): "When a port's pose changes, the <b>angular velocity is kept</b>. For parts that are "
    "moved inside the assembly that is a modelling error: the angular momentum is then not conserved.",
    ("pose", "momentum"): "When a port's pose changes, the <b>angular momentum is kept</b>: the parts are "
    "moved inside the assembly, and the angular velocity follows.",
}
"""What changes keep, HTML."""

DOCKING = (
    "Docks open and close between the steps of co-simulation, or in event mode. What undocks leaves with its "
    "share of the momentum: the angular velocity of the rest is kept. What docks brings its own along: the "
    "momentum of both parts is conserved, by the full inertia tensor under every law but none. The part of "
    "the second port comes with the velocity and the rate, relative to the first port, that are inputs; zero "
    "is a matched approach. A vessel that is not docked to the root's part, even through others, has no "
    "effect on anything; its own outputs are zero."
)

STATUS = {
    2: "The answer is Discard where FMI 2.0 allows it (a step; in model exchange a get and the derivatives "
    "too), else Error.",
    3: "The answer is Discard.",
}


def page(
    parts: Assembly,
    entries: Sequence[TableEntry],
    fmi: int,
    picture: str,
    evidence: Mapping[str, Any] | None = None,
) -> str:
    """Returns the HTML text that documents an FMU.

    parts    : the scene, placed
    entries  : the variable table
    fmi      : version of the FMI standard, 2 or 3
    picture  : the drawing, an svg element
    evidence : of the choice of law and propagator, where the scene has `[accuracy]`
    """
    scene = parts.scene
    rotation = scene.rotation
    law_equation, law_text = LAWS[rotation.law]
    return Template(TEMPLATE.read_text(encoding="utf-8")).substitute(
        name=escape(scene.name),
        whole=_whole(scene),
        root=escape(scene.root),
        facts=_facts(scene, fmi),
        picture=picture,
        vessels=_vessels(parts),
        ports=_ports(scene) + _points(scene),
        composite=_composite(parts.whole),
        variables=_variables(entries),
        law=escape(rotation.law),
        law_equation=SPINNING_LAWS.get(rotation.law, law_equation) if scene.inputs.motion else law_equation,
        moments=_momentum(scene),
        changes=_changes(scene),
        law_text=law_text,
        propagator=escape(rotation.propagator),
        propagator_text=description(scene),
        accuracy="" if evidence is None else _accuracy(evidence),
        definite="" if rotation.law == "none" else " and positive definite",
        status=STATUS[fmi],
    )


def _accuracy(evidence: Mapping[str, Any]) -> str:
    """Returns what was asked of the accuracy, what was flown, and what came of each candidate, HTML."""
    asked = evidence["asked"]
    rows: list[tuple[Cell, ...]] = [
        ("largest error of the attitude asked [rad]", asked["attitude"]),
        ("of the rate [rad/s]", "any" if asked["rate"] is None else asked["rate"]),
        ("up to [s]", asked["horizon"]),
        ("in communication steps of [s]", asked["step"]),
        ("margin that flights keep", evidence["margin"]),
        ("chosen", _settings(evidence["choice"])),
        ("its largest error in flight [rad], [rad/s]", (evidence["attitude"], evidence["rate"])),
        ("the exact motion is known to [rad], [rad/s]", tuple(evidence["doubt"].values())),
        ("by two ways", "; ".join(evidence["truth"])),
        ("flights", f"{len(evidence['histories'])}: {'; '.join(evidence['histories'])}"),
        ("steps of each, of which looked at", (evidence["steps"], evidence["looked_at"])),
        ("inputs drawn, of which senseless", (evidence["rows_drawn"], evidence["rows_senseless"])),
    ]
    found: list[tuple[Cell, ...]] = [
        (
            _settings(one),
            one["operations"],
            *(("", "") if one["refused"] else (one["attitude"], one["rate"])),
            f"refused: {one['refused']}" if one["refused"] else one["worst"],
            one["flights"],
            "yes" if one["enough"] else "no",
        )
        for one in evidence["candidates"]
    ]
    found += [
        (
            _settings(one),
            f"{one['operations']:g} at least",
            "",
            "",
            "not flown: dearer, finer settings too",
            0,
            "",
        )
        for one in evidence["dearer"]
    ]
    head = (
        "candidate",
        "operations per step, most in a flight",
        "attitude [rad]",
        "rate [rad/s]",
        "worst in",
        "flights",
        "enough",
    )
    excluded = "".join(f"<li>{escape(what)};</li>\n" for what in evidence["not_covered"])
    return (
        f"<h3>Accuracy</h3>\n<p>{escape(evidence['claim'])} Law and propagator are the cheapest, by counted "
        "operations, whose flights keep the accuracy with the margin. A candidate that is not enough is "
        "broken off.</p>\n"
        f"{_table('', (), rows)}<p>Not covered:</p>\n<ul>\n{excluded}</ul>\n"
        + _table("Candidates: largest errors in flight", head, found)
    )


def _settings(choice: Mapping[str, Any]) -> str:
    """Returns the keys of [rotation] of a choice as text."""
    values = [choice["law"], choice["propagator"]]
    return ", ".join(
        [*values, *(f"{key} {choice[key]:g}" for key in ("tolerance", "max_angle_step") if key in choice)]
    )


def _whole(scene: Scene) -> str:
    count = len(scene.vessels)
    docked = " that dock and undock" if scene.inputs.docked else ""
    kind = "vessels" if docked else "docked vessels"
    return f"an assembly of {count} {kind}{docked}" if count > 1 else f"the vessel {escape(scene.root)}"


def _facts(scene: Scene, fmi: int) -> str:
    rotation, experiment = scene.rotation, scene.experiment
    rows: list[tuple[Cell, ...]] = [
        ("FMI version", f"{fmi}.0"),
        ("made by", f"supervessel {version('supervessel')}"),
        ("root vessel", scene.root),
        ("rotation law", rotation.law),
        ("propagator", rotation.propagator),
        ("tolerance", rotation.tolerance),
        ("max_angle_step [rad]", rotation.max_angle_step),
    ]
    if scene.convention == "orbiter":
        rows.append(("convention", "orbiter: of the composite's tensor only the diagonal is kept"))
    if experiment is not None:
        rows += [("default duration [s]", experiment.duration), ("default step [s]", experiment.step)]
    return _table("", (), rows)


def _vessels(parts: Assembly) -> str:
    scene = parts.scene
    hung = {joint.child: joint for joint in joints(scene)}
    rows: list[tuple[Cell, ...]] = []
    for number, (name, (rotation, origin)) in enumerate(parts.poses.items(), start=1):
        vessel = scene.vessels[name]
        on = " to ".join(hung[name].ports) if name in hung else "root"
        with np.errstate(all="ignore"):
            centre = origin + rotation @ np.array(vessel.centre_of_mass)
        moments = _moments(vessel)
        rows.append((number, name, vessel.mass, *moments, vessel.centre_of_mass, on, _rounded(centre)))
    for name in parts.detached:
        vessel = scene.vessels[name]
        rows.append(("", name, vessel.mass, *_moments(vessel), vessel.centre_of_mass, "not at the start", ""))
    head = ("", "vessel", "mass [kg]", "given as", "moments", "centre of mass [m]", "docked")
    caption = "Vessels, in vessel axes; last column: centre of mass in the root vessel's axes"
    return _table(caption, (*head, "in root axes [m]"), rows)


def _moments(vessel: Vessel) -> tuple[str, Cell]:
    """Returns how a vessel's moments are given, with their unit, and the numbers."""
    if vessel.pmi is not None:
        return "pmi [m2]", vessel.pmi
    assert vessel.inertia is not None
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = vessel.inertia
    return "inertia xx, yy, zz, xy, xz, yz [kg.m2]", (xx, yy, zz, xy, xz, yz)


def _ports(scene: Scene) -> str:
    mates: dict[str, list[str]] = {}
    for dock in scene.docks:
        state = f" ({dock.name}, {'closed' if dock.docked else 'open'} at the start)"
        for one, other in (dock.ports, dock.ports[::-1]):
            mates.setdefault(one, []).append(other + (state if switchable(scene, dock) else ""))
    rows: list[tuple[Cell, ...]] = []
    for vessel_name, vessel in scene.vessels.items():
        for port_name, port in vessel.ports.items():
            name = f"{vessel_name}.{port_name}"
            rows.append(
                (name, port.position, port.direction, port.alignment, ", ".join(mates.get(name, ["free"])))
            )
    head = ("port", "position [m]", "direction", "alignment", "docked to")
    return _table("Docking ports, in the axes of their vessels", head, rows) if rows else ""


def _points(scene: Scene) -> str:
    rows = [(name, scene.point(name).position) for name in scene.inputs.force]
    caption = "Points where forces act, in the axes of their vessels"
    return _table(caption, ("point", "position [m]"), rows) if rows else ""


def _momentum(scene: Scene) -> str:
    """Returns the equations of energy and momentum, HTML."""
    own = f"<i>J ω</i> + {H}" if scene.inputs.motion else "<i>J ω</i>"
    closed = f"({own})" if scene.inputs.motion else own
    text = (
        '<p class="equation">kinetic energy ½ <i>ω</i> · <i>J ω</i>, &#160;\n'
        f"angular momentum <i>R</i>(<i>q</i>) {closed}</p>"
    )
    if scene.inputs.motion:
        text += (
            f"\n<p>{H} is the angular momentum of the parts that moving ports carry, relative to body axes: "
            f"Σ <i>m</i><sub>j</sub> {RHO} {TIMES} {RHO}{PRIME} + <i>R</i><sub>j</sub> "
            "<i>J</i><sub>j</sub> <i>R</i><sub>j</sub><sup>T</sup> <i>ω</i><sub>j</sub>, with the rate "
            "<i>ω</i><sub>j</sub> of each relative to body axes.</p>"
        )
    return text


def _changes(scene: Scene) -> str:
    """Returns what changes of inputs do to the rotation, HTML."""
    texts = [KEPT_BY[kind, kept] for kind, kept in scene.keeps.items()]
    if len(texts) == 2:
        texts.append("Where both change at one instant, masses come first.")
    if scene.inputs.docked:
        texts.append(DOCKING)
    return "\n".join(f"<p>{text}</p>" for text in texts) or "<p>No input of this scene changes them.</p>"


def _composite(whole: Composite) -> str:
    J = whole.inertia
    rows: list[tuple[Cell, ...]] = [
        ("mass [kg]", _rounded([whole.mass])),
        ("barycentre [m]", _rounded(whole.barycentre)),
        ("pmi [m2]", _rounded(whole.pmi)),
        ("inertia xx, yy, zz, xy, xz, yz [kg.m2]", _rounded(J[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])),
    ]
    if np.all(np.isfinite(J)):
        rows.append(("principal moments [kg.m2]", _rounded(np.linalg.eigvalsh(J))))
    return _table("The whole at start values", (), rows)


def _variables(entries: Sequence[TableEntry]) -> str:
    text = ""
    head = ("reference", "name", "unit", "start", "range", "description")
    for role, (title, remark) in ROLE_TITLES.items():
        rows: list[tuple[Cell, ...]] = [_variable(entry) for entry in entries if entry.role == role]
        if rows:
            text += f"<h3>{title}</h3>\n" + (f"<p>{remark}</p>\n" if remark else "") + _table("", head, rows)
    return text


def _variable(entry: TableEntry) -> tuple[Cell, ...]:
    variable = entry.variable
    start = "" if variable.start is None else variable.start
    bounds = ((variable.low, "≥"), (variable.high, "≤"))
    span = ", ".join(f"{sign} {_number(bound)}" for bound, sign in bounds if bound is not None)
    return entry.reference, variable.name, variable.unit, start, span, variable.description


def _table(caption: str, head: Sequence[str], rows: Iterable[Sequence[Cell]]) -> str:
    """Returns a table; texts are escaped. Without `head` the first cell of each row is its heading."""
    lines = ['<div class="wide"><table>']
    if caption:
        lines.append(f"<caption>{escape(caption)}</caption>")
    if head:
        cells = "".join(f'<th scope="col">{escape(cell)}</th>' for cell in head)
        lines.append(f"<thead><tr>{cells}</tr></thead>")
    lines.append("<tbody>")
    for row in rows:
        first = "" if head else f'<th scope="row">{_cell(row[0])}</th>'
        lines.append(
            "<tr>" + first + "".join(_data(cell, bool(head)) for cell in row[0 if head else 1 :]) + "</tr>"
        )
    return "\n".join([*lines, "</tbody>", "</table></div>\n"])


def _data(cell: Cell, in_column: bool) -> str:
    kind = ' class="number"' if in_column and isinstance(cell, int | float) else ""
    return f"<td{kind}>{_cell(cell)}</td>"


def _cell(cell: Cell) -> str:
    if isinstance(cell, str):
        return escape(cell)
    if isinstance(cell, int | float):
        return _number(cell)
    return ", ".join(_number(number) for number in cell)


def _number(value: float) -> str:
    """Returns a number with all the digits that tell it from its neighbours, 1.0 as 1."""
    return repr(float(value)).removesuffix(".0")


def _rounded(vector: ArrayLike) -> list[float]:
    """Returns calculated numbers to nine digits of the largest one, so that a zero shows no rounding."""
    numbers = np.asarray(vector, dtype=float)
    largest = float(np.abs(numbers).max())
    if largest == 0.0 or not np.isfinite(largest):
        return [float(number) for number in numbers]
    digits = 8 - floor(log10(largest))
    return [round(float(number), digits) + 0.0 for number in numbers]
