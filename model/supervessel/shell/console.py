"""What commands print: results on standard output, on a terminal how far they have come on standard error."""

import argparse
import os
import shutil
import sys
from typing import NoReturn

from supervessel.problems import LONGEST_PROBLEM, printable


class Parser(argparse.ArgumentParser):
    """A parser whose errors show arguments as they can be printed."""

    def error(self, message: str) -> NoReturn:
        super().error(printable(message, LONGEST_PROBLEM))


def print_results(text: str, what: str) -> int:
    """Prints results; returns 0, or 1 where standard output does not take them; `what` names them then.

    The name of a file among them goes to a script as it is, byte by byte, for the script shall find the file;
    a terminal, which would obey what stands in it, gets it as `printable` shows it.
    """
    if sys.stdout.isatty():
        text = "\n".join(printable(line, len(line) + LONGEST_PROBLEM) for line in text.split("\n"))
    elif hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(errors="surrogateescape")  # of names that are not UTF-8
    try:
        print(text, flush=True)
    except (OSError, UnicodeError) as error:
        print(f"{printable(what)} cannot be printed: {printable(str(error))}", file=sys.stderr)
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # what is left is flushed at the end
        return 1
    return 0


def show_progress(text: str, end: str = "") -> None:
    """Shows a line in place of the one before, on a terminal only."""
    if sys.stderr.isatty():
        width = shutil.get_terminal_size().columns - 1
        print(f"\r{text[:width]:<{width}}", end=end, file=sys.stderr, flush=True)
