"""Small scenarios and vessel classes in Orbiter's form, written to a folder."""

import tomllib
from pathlib import Path
from typing import Any

from supervessel.orbiter import Imported, ScenarioError, import_scenario

HUB = """\
; a station with two ports, one of them at its side
Mass = 20e3 ; kg
Size = 6
Inertia = 40 30 20
MaxFuel = 500
BEGIN_DOCKLIST
0 1 5   0 0 1   0 1 0   588
3 0 -1  1 0 0   0 1 0
END_DOCKLIST
BEGIN_ATTACHMENT
P 0 0 0  0 -1 0  0 0 1  XS
END_ATTACHMENT
"""

TABLE = """\
[Glider]
source = ["glider.cpp"]
empty_mass = 11000.0
passenger_mass = 85.0
propellant = [12000.0, 600.0]
pmi = [15.5, 22.1, 7.7]
dock = [[0, -0.5, 10, 0, 0, 1, 0, 1, 0]]
"""

SCENARIO = """\
BEGIN_DESC
A glider at the side of a station; a satellite that is free.
END_DESC

BEGIN_ENVIRONMENT
  System Sol
END_ENVIRONMENT

BEGIN_FOCUS
  Ship GL-01
END_FOCUS

BEGIN_SHIPS
Station:Hub
  STATUS Orbiting Earth
  AROT 30.00 -20.00 70.00
  VROT 0.10 0.20 -0.30
  PRPLEVEL 0:0.25
  DOCKINFO 1:0,GL-01
END
GL-01:Glider
  STATUS Orbiting Earth
  PRPLEVEL 0:0.5 1:1.0
  DOCKINFO 0:1,Station
  NAVFREQ 0 0
END
Satellite
  STATUS Orbiting Earth
  AROT 0 0 0
END
END_SHIPS
"""


def line_of(text: str, beginning: str, after: str = "") -> int:
    """Returns the number of the line that begins with these words, the first after another one's."""
    lines = [line.strip() for line in text.split("\n")]
    start = next(i for i, line in enumerate(lines) if line.startswith(after))
    return next(i + 1 for i in range(start, len(lines)) if lines[i].startswith(beginning))


class Files:
    """A folder with a scenario, a folder of classes and a table."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.scenario, self.table = folder / "side.scn", folder / "code.toml"
        self.config = folder / "Config" / "Vessels"
        self.config.mkdir(parents=True)
        self.hub = self.config / "Hub.cfg"
        self.scenario.write_text(SCENARIO)
        self.table.write_text(TABLE)
        self.hub.write_text(HUB)

    def replace(self, file: Path, *changes: tuple[str, str]) -> str:
        """Puts one text for another in a file and returns what the file then holds."""
        text = file.read_text()
        for old, new in changes:
            assert text.count(old) >= 1, old
            text = text.replace(old, new, 1)
        file.write_text(text)
        return text

    def made(self, **options: Any) -> Imported:
        return import_scenario(self.scenario, config=[self.config], table=self.table, **options)

    def raw(self, **options: Any) -> dict[str, Any]:
        """Returns the scene that is made, as raw tables."""
        return tomllib.loads(self.made(**options).text)

    def problems(self, **options: Any) -> list[str]:
        """Returns the problems, without the folder's name; fails if there are none."""
        try:
            self.made(**options)
        except ScenarioError as error:
            return [problem.replace(f"{self.folder}/", "") for problem in error.problems]
        raise AssertionError("the scenario was imported")

    def notes(self, **options: Any) -> list[str]:
        return [note.replace(f"{self.folder}/", "") for note in self.made(**options).notes]
