"""What commands print: results on standard output, on a terminal how far they have come on standard error."""

import os
import shutil
import sys


def print_results(text: str, what: str) -> int:
    """Prints results; returns 0, or 1 where standard output does not take them; `what` names them then."""
    try:
        print(text, flush=True)
    except (OSError, UnicodeError) as error:
        print(f"{what} cannot be printed: {error}", file=sys.stderr)
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # what is left is flushed at the end
        return 1
    return 0


def show_progress(text: str, end: str = "") -> None:
    """Shows a line in place of the one before, on a terminal only."""
    if sys.stderr.isatty():
        width = shutil.get_terminal_size().columns - 1
        print(f"\r{text[:width]:<{width}}", end=end, file=sys.stderr, flush=True)
