"""Command line, also as python -m supervessel; what it does is in `commands`.

Nothing is imported here that takes time: a signal must find its handler.
"""

import sys
from collections.abc import Sequence

from supervessel.shell.ending import run_as_process


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a subcommand; returns 0 when done, 1 when it failed, each problem on stderr."""
    from supervessel import commands  # noqa: PLC0415

    return commands.main(arguments)


def process() -> int:
    """Runs what this process was started for; a signal ends it at once, with 128 and its number."""
    return run_as_process(main)


if __name__ == "__main__":
    sys.exit(process())
