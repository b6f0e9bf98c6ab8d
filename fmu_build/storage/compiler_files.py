"""A check that the compiler's own files in the cache, its C library and its runtime, are as it made them.

The compiler uses whatever it finds in its folder. So the digests of all files there are recorded after it has
ended and compared before it starts again. Its manifests are not recorded: it rewrites them again and again,
and treats one that it cannot read as missing.
"""

import functools
import os
from hashlib import sha256
from pathlib import Path

from fmu_build.storage.cache import folder_for, is_in_use, keep_bytes, read_bytes, read_file, retire

FOLDER = "compiler"
"""Folder in a generation for all that the compiler keeps from one run to the next."""

RECORD = "compiler.sha256"

MANIFESTS, UNFINISHED = "h", "tmp"
"""Folders of the compiler's that are not recorded."""


def compiler_folder() -> Path:
    """Returns the folder of the compiler's own files, in the generation of the cache that is in use.

    If a file has changed since it was recorded, a new generation with an empty folder begins. This is checked
    once in a program.
    """
    folder = folder_for(FOLDER)
    if _was_changed(folder):
        folder = renewed(folder)
    return folder


def renewed(folder: Path) -> Path:
    """Returns an empty folder for the compiler's own files, in a new generation."""
    retire(folder.parent)
    return folder_for(FOLDER)


@functools.cache
def _was_changed(folder: Path) -> bool:
    return is_changed(folder)


def is_changed(folder: Path) -> bool:
    """Whether a file that has been recorded in the compiler's folder is gone or is another.

    So it is where there are files and no record, unless a compiler is at work: it is recorded when it ends.
    """
    if not os.path.lexists(folder.with_name(RECORD)):
        return any(folder.iterdir()) and not is_in_use(folder.parent)
    recorded = _recorded(folder)
    return recorded is None or any(_digest(folder / name) != digest for name, digest in recorded.items())


def record(folder: Path) -> None:
    """Records what the compiler has made in its folder, unless one is at work there at this moment."""
    if is_in_use(folder.parent):
        return
    recorded = _recorded(folder) or {}
    found = {name: recorded.get(name) or _digest(folder / name) for name in _names(folder)}
    if found != recorded:
        lines = (f"{digest} {name}\n" for name, digest in found.items())
        keep_bytes(folder.with_name(RECORD), "".join(lines).encode())


def _recorded(folder: Path) -> dict[str, str] | None:
    """Returns digests by path below the compiler's folder; None where no record can be read."""
    said = read_bytes(folder.with_name(RECORD))
    if said is None:
        return None
    return {name: digest for digest, _, name in (line.partition(" ") for line in said.decode().splitlines())}


def _names(folder: Path) -> list[str]:
    """Returns the paths, below the compiler's folder, of the files that are recorded."""
    found = []
    for place, folders, names in os.walk(folder):
        if Path(place) == folder:
            folders[:] = [name for name in folders if name not in {MANIFESTS, UNFINISHED}]
        found += [Path(place, name).relative_to(folder).as_posix() for name in names]
    return sorted(found)


def _digest(file: Path) -> str:
    """Returns the digest of a file's content; empty where there is no file."""
    content = read_file(file)
    return "" if content is None else sha256(content).hexdigest()
