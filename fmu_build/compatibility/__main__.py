"""Command line: python -m fmu_build.compatibility SCENE.toml ... -o FOLDER; what it does is in `command`.

Nothing is imported here that takes time: a signal must find its handler.
"""

import sys
from collections.abc import Sequence

from supervessel.shell.ending import run_as_process


def main(arguments: Sequence[str] | None = None) -> int:
    """Writes a folder of FMUs with reference results; returns 0 when done, 1 when it failed."""
    from fmu_build.compatibility import command  # noqa: PLC0415

    return command.main(arguments)


if __name__ == "__main__":
    sys.exit(run_as_process(main))
