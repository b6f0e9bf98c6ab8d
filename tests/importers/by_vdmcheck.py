"""VDMCheck2: a formal model of FMI 2's static semantics, to which the model description is held."""

import subprocess
from pathlib import Path

from importers.flight import InsteadError
from importers.tools import FOLDER

CLEAN = "No errors found."


def check(fmu: Path) -> None:
    """Raises InsteadError with the first rule that an archive's model description breaks."""
    words = ["java", "-jar", str(FOLDER / "jars" / "vdmcheck2" / "vdmcheck2.jar"), str(fmu)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=300.0, check=False)
    said = [line.strip() for line in (done.stdout + done.stderr).splitlines() if line.strip()]
    if CLEAN not in said:
        raise InsteadError(next((line for line in said), "said nothing"))
