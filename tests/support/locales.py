"""Locales that tests need and machines may lack."""

import subprocess
from pathlib import Path

import pytest


def german(folder: Path) -> dict[str, str]:
    """Returns the variables of a locale with a decimal comma, made in a folder; skips where it cannot be."""
    made = folder / "de_DE.UTF-8"
    try:
        done = subprocess.run(
            ["localedef", "-i", "de_DE", "-f", "UTF-8", str(made)], capture_output=True, check=False
        )
    except FileNotFoundError:
        pytest.skip("localedef is not installed")
    if not made.is_dir():
        pytest.skip(f"no locale de_DE can be made: {done.stderr.decode()[:200]}")
    return {"LOCPATH": str(folder), "LC_ALL": "de_DE.UTF-8", "LANG": "de_DE.UTF-8"}
