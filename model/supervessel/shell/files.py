"""Files that a user has named as output: each appears whole, and nothing else of the user's is touched.

A symbolic link is followed: the link stays, its target gets the content and is made where it is missing.
An old file keeps its permissions, and its owner where the system allows that; a new file has the permissions
that the umask leaves of 0o666. Other hard links of an old file keep the old content. Refused is whatever is
no regular file, a file that is read-only, and a file in a folder where none can be made. On Windows the
read-only attribute is all there is of permissions, and owners are left to the system.
"""

import os
import secrets
import shutil
import stat
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from supervessel.problems import printable
from supervessel.shell.interrupts import finally_done, uninterrupted

KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFCHR: "a character device",
    stat.S_IFBLK: "a block device",
    stat.S_IFIFO: "a named pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFREG: "a regular file",
}


class OutputError(RuntimeError):
    """An output that cannot be written; the message says which, and why."""

    def __init__(self, path: Path, reason: str) -> None:
        super().__init__(f"{printable(str(path))}: cannot be written: {reason}")


@dataclass(frozen=True)
class _Change:
    """A file on its way into place.

    path  : as the user has named it
    place : the same, links followed
    old   : status of the file that is there, None where there is none
    part  : what is to come into place, beside it
    kept  : a second name of the old file for as long as the change may have to be taken back
    """

    path: Path
    place: Path
    old: os.stat_result | None
    part: Path
    kept: Path


def check_output(path: Path, inputs: Iterable[Path] = ()) -> bool:
    """Returns whether an output is there already and is not empty; for use before any work is done.

    inputs : files that the same command reads
    Raises OutputError where the output could not be written, or is one of the inputs by whatever name.
    """
    change = _change(path)
    if change.old is not None:
        for file in inputs:
            with suppress(OSError):  # an input that is not there is another's problem
                if os.path.samestat(file.stat(), change.old):
                    raise OutputError(path, f"is a file that is read for it: {printable(str(file))}")
    try:
        with _said_of(path, f": {printable(str(change.place.parent))}"), uninterrupted():
            change.part.touch(exist_ok=False)
            change.part.unlink()
    except BaseException:
        _clear([change])
        raise
    return change.old is not None and change.old.st_size > 0


def write_file(path: Path, content: bytes) -> None:
    """Writes a file as `write_files` does."""
    write_files({path: content})


@uninterrupted()
def write_files(contents: Mapping[Path, bytes]) -> None:
    """Writes files into place, none before all are whole.

    Raises OutputError where one cannot be written. Then, and after an interrupt, all is as it was before.
    """
    changes = [_change(path) for path in contents]
    places: dict[str, Path] = {}
    for change in changes:
        other = places.setdefault(os.path.realpath(change.place), change.path)
        if other is not change.path:
            raise OutputError(change.path, f"is the same file as {printable(str(other))}")
    try:
        for change in changes:
            _write_part(change, contents[change.path])
        _put_in_place(changes)
        _clear(changes)
    except BaseException:  # an interrupt of that clearing too
        _clear(changes)
        raise


@contextmanager
def made_folder(folder: Path) -> Iterator[None]:
    """Makes a folder for outputs, unless it is there; takes it away again if nothing comes into it.

    Raises OutputError where there is something else, or it cannot be made.
    """
    there = _status(folder)
    if there is not None and not stat.S_ISDIR(there.st_mode):
        raise OutputError(folder, f"is {_kind(there)}, not a folder")

    def clear() -> None:
        if there is None:
            with suppress(OSError):  # there is something in it
                _followed(folder).rmdir()

    with finally_done(clear):
        if there is None:
            with _said_of(folder):
                _followed(folder).mkdir(exist_ok=True)
        yield


def _change(path: Path) -> _Change:
    """Returns what writing a file takes. Raises OutputError where what is there must not be replaced."""
    old, place = _status(path), _followed(path)
    if old is not None:
        if not stat.S_ISREG(old.st_mode):
            raise OutputError(path, f"is {_kind(old)}, not a regular file")
        named = _status(place)
        if named is None or not os.path.samestat(named, old):
            raise OutputError(path, "is a link to a file that has no name any more")
        if not old.st_mode & 0o222 or not os.access(place, os.W_OK):
            raise OutputError(path, "is read-only")
        if _belongs_to_others(old, place.parent):
            folder = printable(str(place.parent))
            raise OutputError(
                path, f"is another user's, in a folder where only they can replace it: {folder}"
            )
    token = secrets.token_hex(8)
    part, kept = (place.with_name(f".supervessel-{token}.{kind}") for kind in ("part", "kept"))
    return _Change(path, place, old, part, kept)


def _status(path: Path) -> os.stat_result | None:
    """Returns the status of what a path leads to, None where nothing is. Raises OutputError."""
    with _said_of(path):
        try:
            return path.stat()
        except (FileNotFoundError, NotADirectoryError):
            return None


def _followed(path: Path) -> Path:
    """Returns a path, or what it leads to where it is a link; that need not exist."""
    return Path(os.path.realpath(path)) if path.is_symlink() else path


def _kind(status: os.stat_result) -> str:
    return KINDS.get(stat.S_IFMT(status.st_mode), "something of another kind")


def _belongs_to_others(old: os.stat_result, folder: Path) -> bool:
    """Whether a file cannot be replaced, though it can be written: its folder is sticky."""
    if os.name != "posix":
        return False
    holder = folder.stat()
    return bool(holder.st_mode & stat.S_ISVTX) and os.geteuid() not in (0, old.st_uid, holder.st_uid)


@contextmanager
def _said_of(path: Path, where: str = "") -> Iterator[None]:
    """Has an OSError of a block told as what it means for an output."""
    try:
        yield
    except OSError as error:
        raise OutputError(path, f"{error.strerror}{where}") from None


def _write_part(change: _Change, content: bytes) -> None:
    """Writes a file that is to come into place, with the permissions that it will have there."""
    old = change.old
    mode = 0o666 if old is None else 0o600  # what others may not read they cannot read in the meantime
    with _said_of(change.path):
        with open(change.part, "xb", opener=lambda name, flags: os.open(name, flags, mode)) as stream:
            stream.write(content)
        if old is not None:
            if hasattr(os, "chown"):
                for owner in (old.st_uid, -1):
                    with suppress(OSError):  # only root gives files away
                        os.chown(change.part, owner, old.st_gid)
                        break
            change.part.chmod(old.st_mode & 0o777)


def _put_in_place(changes: Sequence[_Change]) -> None:
    """Puts files that are whole into place, all of them or none."""
    try:
        for change in changes:
            if change.old is not None:
                with _said_of(change.path):
                    _name_again(change.place, change.kept)
        for change in changes:
            with _said_of(change.path):
                change.part.replace(change.place)
    except BaseException:
        for change in changes:
            if change.part.exists():  # it has not been put into place
                continue
            if change.old is None:
                change.place.unlink()
            else:
                change.kept.replace(change.place)
        raise


def _name_again(file: Path, name: Path) -> None:
    """Gives a file a second name, or copies it where the file system has no such thing."""
    try:
        name.hardlink_to(file)
    except OSError:
        shutil.copy2(file, name)


def _clear(changes: Iterable[_Change]) -> None:
    """Removes what changes have left beside the files."""
    for change in changes:
        for file in (change.part, change.kept):
            with suppress(OSError):
                file.unlink()
