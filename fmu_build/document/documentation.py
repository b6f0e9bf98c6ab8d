"""What an FMU holds beside its library and descriptions: documentation, licences, icons."""

from collections.abc import Mapping, Sequence
from typing import Any

from fmu_build.document.licences import licence_files
from fmu_build.document.page import page
from fmu_build.interface.terminals import terminal_icons
from fmu_build.interface.variable_table import TableEntry
from fmu_build.versions import VERSIONS
from supervessel.drawing.drawing import drawing, icon
from supervessel.drawing.figure import svg
from supervessel.drawing.geometry import assembly
from supervessel.drawing.raster import png
from supervessel.scene.schema import Scene


def documentation(
    scene: Scene, entries: Sequence[TableEntry], fmi: int, evidence: Mapping[str, Any] | None = None
) -> dict[str, bytes]:
    """Returns the files by their place in the archive; the same scene gives the same bytes.

    entries  : the variable table
    evidence : of the choice of law and propagator, where the scene has `[accuracy]`
    fmi      : version of the FMI standard, of `versions.VERSIONS`. FMI 2.0 has its icon in
              model.png; from 2.0.4 on it knows the folder terminalsAndIcons too.
    The icons that terminalsAndIcons.xml names are among the files, the XML file itself is not.
    Raises BuildError if an installed package does not have its licence text where it should be.
    """
    parts = assembly(scene)
    diagram, symbol = drawing(parts), icon(parts)
    symbol_png = png(symbol)
    files = {
        "documentation/index.html": page(
            parts, entries, fmi, svg(diagram, standalone=False), evidence
        ).encode(),
        "documentation/diagram.svg": svg(diagram).encode(),
        "documentation/diagram.png": png(diagram),
        "terminalsAndIcons/icon.svg": svg(symbol).encode(),
        "terminalsAndIcons/icon.png": symbol_png,
    }
    if VERSIONS[fmi].icon:
        files[VERSIONS[fmi].icon] = symbol_png
    return files | licence_files(fmi) | terminal_icons(scene, entries)
