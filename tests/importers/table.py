"""The rows of the table of importers: which of them flies what."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """An importer with a version of the standard and an interface.

    name     : of the importer
    package  : that it comes in, by its name in pins.toml
    module   : of this folder, that makes it fly
    fmi      : version of the standard
    exchange : model exchange, else co-simulation
    after    : whether it shows outputs after the inputs of the same communication point are set
    euler    : whether Euler's method is all that it has
    flies    : whether it flies; else it checks the archive
    """

    name: str
    package: str
    module: str
    fmi: int
    exchange: bool = False
    after: bool = False
    euler: bool = False
    flies: bool = True


def _rows() -> dict[str, Row]:
    rows: dict[str, Row] = {}
    for fmi in (2, 3):
        rows |= {
            f"fmpy-cs{fmi}": Row("FMPy", "FMPy", "by_fmpy", fmi),
            f"fmpy-me{fmi}": Row("FMPy", "FMPy", "by_fmpy", fmi, exchange=True, after=True),
            f"casadi-me{fmi}": Row("CasADi", "casadi", "by_casadi", fmi, exchange=True),
            f"fmuloader-cs{fmi}": Row("fmuloader", "fmuloader", "by_fmuloader", fmi),
            f"fmuloader-me{fmi}": Row("fmuloader", "fmuloader", "by_fmuloader", fmi, exchange=True),
            f"fmi_sim-cs{fmi}": Row("fmi-sim", "fmi-sim", "by_fmi_sim", fmi),
            f"fmi_sim-me{fmi}": Row(
                "fmi-sim", "fmi-sim", "by_fmi_sim", fmi, exchange=True, after=True, euler=True
            ),
            f"ecos-cs{fmi}": Row("ecospy", "ecospy", "by_ecos", fmi),
        }
    rows["libcosim-cs2"] = Row("libcosimpy", "libcosimpy", "by_libcosim", 2)
    rows["maestro-cs2"] = Row("Maestro", "org.into-cps.maestro:maestro", "by_maestro", 2)
    rows["vdmcheck2"] = Row(
        "VDMCheck2", "org.into-cps.vdmcheck.fmi2:vdmcheck2", "by_vdmcheck", 2, flies=False
    )
    return rows


ROWS = _rows()
