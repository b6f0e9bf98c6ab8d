"""The command `supervessel cache`: a report on the cache, and its removal."""

import argparse
import re
import secrets
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path

from fmu_build.errors import BuildError
from fmu_build.storage.cache import (
    LARGEST,
    OURS,
    TAG,
    UNUSED,
    USED,
    UntrustedError,
    base_folder,
    generation_numbers,
    is_in_use,
    remove,
    size_of,
    trust,
    trust_around,
)
from fmu_build.storage.temporary import is_own_folder
from supervessel.problems import printable
from supervessel.shell.console import print_problem, print_results

NAME = re.compile(r"supervessel-\d+")
"""Of a cache, of whatever layout."""

GOING = ".supervessel-going-"
"""Beginning of the name of a cache while it is being removed."""


def cache(options: argparse.Namespace) -> int:
    """Runs the command: shows the cache or clears it; returns its exit status."""
    try:
        said = clear() if options.clear else report()
    except BuildError as error:
        print_problem(error)
        return 1
    return print_results(said, "the cache's content")


def report() -> str:
    """Returns the path of the cache, why it is left unused if so, and its generations; creates nothing."""
    _, base = base_folder()
    if base is None:
        return "no cache is kept: the user has no home, and SUPERVESSEL_CACHE is not set"
    ours = base / OURS
    lines = [printable(str(ours))]
    try:
        if base.exists():
            trust_around(base)
            trust(ours)
    except UntrustedError as why:
        lines.append(f"left unused: {why}")
    except FileNotFoundError:
        pass
    except OSError as error:
        raise BuildError(f"{printable(str(error.filename))}: cannot be read: {error.strerror}") from None
    numbers = sorted(generation_numbers(ours)) if is_own_folder(ours) else []
    lines += [_line(ours / f"generation-{number}") for number in numbers]
    if not numbers:
        return "\n".join([*lines, "nothing is kept there"])
    bound = f"when the newest passes {_size(LARGEST)} another begins"
    gone = f"an older one goes {UNUSED / 3600.0:g} h after its last use"
    return "\n".join([*lines, f"{bound}; {gone}"])


def clear() -> str:
    """Removes the caches of all layouts; returns what was removed and what was left, and why.

    Raises BuildError if a part could not be removed.
    """
    _, base = base_folder()
    if base is None or not base.is_dir():
        return f"nothing to remove: {printable(str(base or 'no cache'))}"
    try:
        trust_around(base)
    except UntrustedError as why:
        return f"left: {why}"
    found = [folder for folder in sorted(base.glob("supervessel-*")) if NAME.fullmatch(folder.name)]
    lines = [_cleared(folder) for folder in found]
    for left in base.glob(f"{GOING}*"):  # of a clear that was killed
        with suppress(UntrustedError):
            trust(left)
            _remove(left)
    return "\n".join(lines) or f"nothing to remove: {printable(str(base / OURS))}"


def _cleared(folder: Path) -> str:
    """Removes a cache; returns a line that says so, or why it was left.

    The cache is renamed first: it is out of use at once even if the removal is interrupted, and nothing can
    take the place of the folder that was judged.
    """
    try:
        trust(folder)
        for number in generation_numbers(folder):
            if is_in_use(folder / f"generation-{number}"):
                return f"left: {printable(str(folder))} is in use by a build"
        going = folder.with_name(f"{GOING}{secrets.token_hex(8)}")
        folder.rename(going)
        try:
            trust(going)
        except UntrustedError:
            going.rename(folder)
            raise
    except UntrustedError as why:
        return f"left: {why}"
    size = size_of(going)
    _remove(going)
    return f"removed: {printable(str(folder))}, {_size(size)}"


def _remove(folder: Path) -> None:
    """Removes a renamed cache, its tag last."""
    for path in folder.iterdir():
        if path.name != TAG:
            remove(path)
    remove(folder)
    if folder.exists():
        raise BuildError(f"{printable(str(folder))}: could not be removed whole")


def _line(generation: Path) -> str:
    """Returns a line about a generation: its size and its last use."""
    if not is_own_folder(generation):
        return f"{generation.name}: no folder of the user's own, left alone"
    used = generation / USED
    last = (used if used.exists() else generation).lstat().st_mtime
    return f"{generation.name}: {_size(size_of(generation))}, last used {_date(last)}"


def _date(seconds: float) -> str:
    """Returns a date for reading, from seconds since 1970.

    It is in the local time zone, or in UTC if Python cannot use that; a date that Python cannot represent is
    given in seconds.
    """
    for zone in (None, UTC):
        with suppress(ValueError, OverflowError, OSError):
            return datetime.fromtimestamp(seconds, UTC).astimezone(zone).isoformat(" ", "minutes")
    return f"{seconds:.0f} s after 1970"


def _size(count: float) -> str:
    """Returns a number of bytes for reading."""
    for unit in ("B", "KiB", "MiB"):
        if count < 1024.0:
            return f"{count:.4g} {unit}"
        count /= 1024.0
    return f"{count:.4g} GiB"
