"""Scenes from the files of the Orbiter simulator: scenarios, vessel classes, its left-handed axes."""

from supervessel.orbiter.importing import Imported, import_scenario
from supervessel.orbiter.text import ScenarioError

__all__ = ["Imported", "ScenarioError", "import_scenario"]
