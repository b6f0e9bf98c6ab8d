"""What commands print: results on standard output, on a terminal how far they have come on standard error."""

import argparse
import os
import shutil
import sys
from contextlib import suppress
from typing import NoReturn, Protocol

from supervessel.problems import LONGEST_PROBLEM, printable


class _Writable(Protocol):
    """What argparse prints to."""

    def write(self, text: str, /) -> object: ...


class Parser(argparse.ArgumentParser):
    """A parser whose errors show arguments as they can be printed; help that cannot be is an error."""

    def error(self, message: str) -> NoReturn:
        super().error(printable(message, LONGEST_PROBLEM))

    def _print_message(self, message: str, file: "_Writable | None" = None) -> None:
        if file is not sys.stdout:
            super()._print_message(message, file)
        elif print_results(message.rstrip("\n"), "the help"):
            self.exit(1)


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
        print_problem(f"{printable(what)} cannot be printed: {printable(str(error))}")
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # what is left is flushed at the end
        return 1
    return 0


def print_problem(text: object) -> None:
    """Prints lines on standard error; where it takes none, only the exit status tells what has happened."""
    if sys.stderr is not None:
        with suppress(OSError, ValueError):
            print(text, file=sys.stderr, flush=True)


def show_progress(text: str, end: str = "") -> None:
    """Shows a line in place of the one before, on a terminal only."""
    if sys.stderr.isatty():
        width = shutil.get_terminal_size().columns - 1
        print(f"\r{text[:width]:<{width}}", end=end, file=sys.stderr, flush=True)
