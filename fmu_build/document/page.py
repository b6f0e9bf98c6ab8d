"""The page that documents an FMU: what the scene holds, frames, variables, equations, what is refused.

One file of HTML without scripts or links to elsewhere, written so that an XML parser reads it too.
"""

from collections.abc import Mapping, Sequence
from html import escape
from importlib.metadata import version
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmu_build.document.accuracy_text import accuracy_text
from fmu_build.document.rotation_text import (
    energy_and_momentum,
    gradient_text,
    jets_text,
    law_equation,
    law_text,
    what_changes_keep,
    wheels_text,
)
from fmu_build.document.tables import Cell, number_text, rounded, table
from fmu_build.interface.model_description import role_attributes
from fmu_build.interface.names import Naming
from fmu_build.interface.variable_table import Role, TableEntry
from fmu_build.versions import VERSIONS
from supervessel.composite.docks import Joint, joints, switchable
from supervessel.composite.start import principal_moments
from supervessel.drawing.geometry import Assembly
from supervessel.rotation.propagators import description
from supervessel.scene.schema import SAID, Scene, Vessel

WORDS = {"license": "licence"}
"""Words of the page for keys of a scene that are spelled otherwise."""

TEMPLATE = Path(__file__).with_name("page.html")
"""The page's fixed text; $names stand where the scene's own go."""

NAMINGS_SAID: dict[Naming, str] = {
    "structured": "Scalars with structured names, the same in FMI 2.0 and FMI 3.0.",
    "flat": "Scalars with flat names, the same in FMI 2.0 and FMI 3.0; in the last column the names that "
    "scene file and twin have for them.",
}
"""What the page says of the names of variables."""

NEAREST = (
    "<li>the attracting centre must be farther from the barycentre than twice the assembly's size, the root "
    "of the trace of its inertia tensor over its mass; its inputs must be at most 1e100 long.</li>\n"
)
"""What is refused of the place in a field of gravity, HTML."""

OF_WHEELS = (
    "<li>a vessel with wheels must have a mass &gt; 0; without what wheels have about their axes the tensor "
    "of the whole must be positive definite too; while docks do not hold a wheel's vessel to the root, the "
    "torque of its motor must be 0;</li>\n"
)
"""What is refused where there are wheels, HTML."""

OF_FLOWS = "<li>a flow must not be negative;</li>\n"
"""What is refused where propellant leaves, HTML."""

ROLE_TITLES: dict[Role, tuple[str, str]] = {
    "time": ("Independent variable", ""),
    "input": (
        "Inputs",
        "In co-simulation they hold over a communication step. In model exchange those that are continuous "
        "may change at any time, those that are discrete in event mode alone.",
    ),
    "parameter": ("Parameters", "Fixed once initialisation ends."),
    "output": (
        "Outputs",
        "Those of the end of a communication step; after a set they follow from the new inputs.",
    ),
    "state": ("States", "Model exchange: the importer's solver integrates them."),
    "derivative": ("Derivatives", "Rates of the states."),
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
    fmi      : version of the FMI standard, of `versions.VERSIONS`
    picture  : the drawing, an svg element
    evidence : of the choice of law and propagator, where the scene has `[accuracy]`
    """
    scene = parts.scene
    rotation = scene.rotation
    return Template(TEMPLATE.read_text(encoding="utf-8")).substitute(
        name=escape(scene.name),
        whole=_whole(scene),
        root=escape(scene.root),
        facts=_facts(scene, fmi),
        picture=picture,
        vessels=_vessels(parts),
        ports=_mounts(scene) + _ports(scene) + _points(scene) + _wheels(scene),
        composite=_composite(parts.whole),
        naming=NAMINGS_SAID[entries[0].naming],
        variables=_variables(entries),
        law=escape(rotation.law),
        law_equation=law_equation(scene),
        gravity=wheels_text(scene) + jets_text(scene) + gradient_text(scene),
        moments=energy_and_momentum(scene),
        changes=what_changes_keep(scene),
        law_text=law_text(scene),
        propagator=escape(rotation.propagator),
        propagator_text=description(scene),
        accuracy="" if evidence is None else accuracy_text(evidence),
        definite="" if rotation.law == "none" else " and positive definite",
        nearest="".join(text for text, holds in _more_refused(scene) if holds),
        status=VERSIONS[fmi].refusal,
    )


def _more_refused(scene: Scene) -> tuple[tuple[str, bool], ...]:
    """Returns what is refused in some scenes, HTML, and whether it is in this one."""
    return (
        (OF_WHEELS, bool(scene.wheels)),
        (OF_FLOWS, bool(scene.inputs.flow)),
        (NEAREST, bool(gradient_text(scene))),
    )


def _whole(scene: Scene) -> str:
    """Returns what the FMU describes, in words."""
    count = len(scene.vessels)
    docked = " that dock and undock" if scene.inputs.docked else ""
    together = "joined" if scene.mounts else "docked"
    kind = "vessels" if docked else f"{together} vessels"
    return f"an assembly of {count} {kind}{docked}" if count > 1 else f"the vessel {escape(scene.root)}"


def _facts(scene: Scene, fmi: int) -> str:
    """Returns the table of what the scene and the build have set."""
    rotation, experiment = scene.rotation, scene.experiment
    said = ((WORDS.get(key, key), getattr(scene, key)) for key in SAID)
    rows: list[tuple[Cell, ...]] = [
        *((word, text) for word, text in said if text is not None),
        ("FMI version", VERSIONS[fmi].name),
        ("made by", f"supervessel {version('supervessel')}"),
        ("root vessel", scene.root),
        ("rotation law", rotation.law),
        ("propagator", rotation.propagator),
        ("tolerance", rotation.tolerance),
        ("max_angle_step [rad]", rotation.max_angle_step),
    ]
    if scene.convention == "orbiter":
        rows.append(("convention", "orbiter: of the composite's tensor only the diagonal is kept"))
    if scene.gravity is not None:
        rows.append(("attracting centre, mu [m3/s2]", scene.gravity.mu))
    if experiment is not None:
        rows += [("default duration [s]", experiment.duration), ("default step [s]", experiment.step)]
    rows += [("mended", note) for note in scene.notes]
    return table("", (), rows)


def _vessels(parts: Assembly) -> str:
    """Returns the table of vessels: placed ones by their number in the drawing, then the others."""
    scene = parts.scene
    hung = {joint.child: joint for joint in joints(scene)}
    rows: list[tuple[Cell, ...]] = []
    for number, (name, (R_root_vessel, origin)) in enumerate(parts.poses.items(), start=1):
        vessel = scene.vessels[name]
        on = _joined_by(hung[name]) if name in hung else "root"
        with np.errstate(all="ignore"):
            centre = origin + R_root_vessel @ np.array(vessel.centre_of_mass)
        moments = _moments(vessel)
        rows.append((number, name, vessel.mass, *moments, vessel.centre_of_mass, on, rounded(centre)))
    for name in parts.detached:
        vessel = scene.vessels[name]
        rows.append(("", name, vessel.mass, *_moments(vessel), vessel.centre_of_mass, "not at the start", ""))
    head = ("", "vessel", "mass [kg]", "given as", "moments", "centre of mass [m]", "docked")
    caption = "Vessels, in vessel axes; last column: centre of mass in the root vessel's axes"
    return table(caption, (*head, "in root axes [m]"), rows)


def _joined_by(joint: Joint) -> str:
    """Returns how a vessel is joined to the one before it."""
    return " to ".join(joint.ports) if joint.mount is None else f"mounted to {joint.parent}"


def _mounts(scene: Scene) -> str:
    """Returns the table of mounts; nothing where there are none."""
    rows = [(mount.child, mount.parent, mount.position, mount.attitude) for mount in scene.mounts]
    head = ("vessel", "mounted to", "position [m]", "attitude (w, x, y, z)")
    caption = "Mounts: poses of vessels in the axes of those that they are mounted to"
    return table(caption, head, rows) if rows else ""


def _moments(vessel: Vessel) -> tuple[str, Cell]:
    """Returns how a vessel's moments are given, with their unit, and the numbers."""
    if vessel.pmi is not None:
        return "pmi [m2]", vessel.pmi
    if vessel.moments is not None:
        about = "about the origin" if vessel.inertia_about == "origin" else "about the centre of mass"
        numbers = (*vessel.moments, *(vessel.products or (0.0, 0.0, 0.0)))
        return f"moments, products P_xy, P_yz, P_zx [kg.m2] {about}", numbers
    assert vessel.inertia is not None
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = vessel.inertia
    if vessel.inertia_about == "origin":
        return "inertia about the origin xx, yy, zz, xy, xz, yz [kg.m2]", (xx, yy, zz, xy, xz, yz)
    return "inertia xx, yy, zz, xy, xz, yz [kg.m2]", (xx, yy, zz, xy, xz, yz)


def _ports(scene: Scene) -> str:
    """Returns the table of docking ports, with what each is docked to; nothing where there are none."""
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
    return table("Docking ports, in the axes of their vessels", head, rows) if rows else ""


def _points(scene: Scene) -> str:
    """Returns the table of points where forces act or propellant leaves; nothing where there are none."""
    forces, flows = scene.inputs.force, scene.inputs.flow
    rows = [(name, scene.point(name).position) for name in dict.fromkeys((*forces, *flows))]
    means = [text for text, names in (("forces act", forces), ("propellant leaves", flows)) if names]
    caption = f"Points where {' or '.join(means)}, in the axes of their vessels"
    return table(caption, ("point", "position [m]"), rows) if rows else ""


def _wheels(scene: Scene) -> str:
    """Returns the table of wheels; nothing where there are none."""
    wheels = [(name, scene.wheel(name)) for name in scene.wheels]
    rows: list[tuple[Cell, ...]] = [
        (name, wheel.axis, wheel.inertia, wheel.momentum, "yes" if name in scene.inputs.wheel else "no")
        for name, wheel in wheels
    ]
    head = ("wheel", "axis", "inertia [kg.m2]", "momentum at the start [N.m.s]", "motor")
    caption = "Wheels, part of their vessels' mass and moments, in the axes of their vessels"
    return table(caption, head, rows) if rows else ""


def _composite(whole: Mapping[str, NDArray[np.float64]]) -> str:
    """Returns the table of mass, barycentre and moments of the composite at the start.

    whole : parts of c by name, see `composite.parts.COMPOSITE_SIZES`
    """
    rows: list[tuple[Cell, ...]] = [
        ("mass [kg]", rounded(whole["mass"])),
        ("barycentre [m]", rounded(whole["barycentre"])),
        ("pmi [m2]", rounded(whole["pmi"])),
        ("inertia xx, yy, zz, xy, xz, yz [kg.m2]", rounded(whole["inertia"])),
    ]
    if np.all(np.isfinite(whole["inertia"])):
        rows.append(("principal moments [kg.m2]", rounded(principal_moments(whole["inertia"]))))
    return table("The whole at start values", (), rows)


def _variables(entries: Sequence[TableEntry]) -> str:
    """Returns a table of variables for each role."""
    text, traced = "", ("scene and twin",) if entries[0].naming == "flat" else ()
    head = ("reference", "name", "variability", "unit", "start", "range", "description", *traced)
    for role, (title, remark) in ROLE_TITLES.items():
        rows: list[tuple[Cell, ...]] = [_variable(entry) for entry in entries if entry.role == role]
        if rows:
            text += f"<h3>{title}</h3>\n" + (f"<p>{remark}</p>\n" if remark else "") + table("", head, rows)
    return text


def _variable(entry: TableEntry) -> tuple[Cell, ...]:
    variable = entry.variable
    start: Cell = "" if variable.start is None else variable.start
    if variable.boolean:
        start = "true" if variable.start else "false"
    bounds = ((variable.low, "≥"), (variable.high, "≤"))
    span = ", ".join(f"{sign} {number_text(bound)}" for bound, sign in bounds if bound is not None)
    traced = (variable.name,) if entry.naming == "flat" else ()
    variability = role_attributes(entry)["variability"]
    words = (variable.unit, start, span, variable.description, *traced)
    return entry.reference, entry.name, variability, *words
