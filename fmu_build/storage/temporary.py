"""Temporary folders, removed when their work is done. A later run removes those that killed processes left.

Each folder holds a file that its process keeps locked: if the lock is free, the process has ended.
"""

import atexit
import errno
import functools
import os
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

PREFIX = "supervessel-"

LOCK = ".supervessel-lock"

SIGNATURE = b"supervessel: this folder is removed when the process that has locked this file has ended\n"
"""Content of the lock file, written once the file is locked; a folder whose file lacks it is being made."""

LOCKED_BY_ANOTHER = (errno.EWOULDBLOCK, errno.EAGAIN, errno.EACCES, errno.EDEADLK)

LOCKED_BYTE = 1024
"""Offset of the locked byte, behind the content: on Windows others cannot read locked bytes."""


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """Yields a folder in the system's folder for temporary files, removed afterwards.

    Folders that killed processes have left there are removed first, once in a program. Raises OSError if no
    folder can be made.
    """
    clear_left(tempfile.gettempdir())
    folder = Path(tempfile.mkdtemp(prefix=PREFIX))
    held = None
    try:
        held = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
        # without locks, as on some network drives, the folder is never taken for that of a killed run
        if lock(held):
            os.lseek(held, 0, os.SEEK_SET)
            os.write(held, SIGNATURE)
        yield folder
    finally:
        if held is not None:
            os.close(held)  # Windows removes no open file
        shutil.rmtree(folder, ignore_errors=True)


def place_for_temporary() -> str:
    """Returns, for a message, the folder for temporary files; where none can be used, the name TMPDIR."""
    with suppress(OSError):
        return tempfile.gettempdir()
    return "TMPDIR"


@functools.cache
def folder_of_program() -> Path:
    """Returns a temporary folder that is removed when the program ends."""
    until_the_end = ExitStack()
    atexit.register(until_the_end.close)
    return until_the_end.enter_context(temporary_folder())


@functools.cache
def clear_left(place: str) -> None:
    """Removes the folders in `place` that killed processes of this user have left.

    A folder is removed only if it is no link and its lock file is as `temporary_folder` writes it and not
    locked.
    """
    with suppress(OSError), os.scandir(place) as entries:
        for entry in entries:
            if entry.name.startswith(PREFIX):
                with suppress(OSError):
                    _clear(Path(entry.path))


def _clear(folder: Path) -> None:
    """Removes a folder if a killed process has left it. Raises OSError if that cannot be found out."""
    if not is_own_folder(folder):
        return
    held = os.open(folder / LOCK, os.O_RDWR | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))
    try:
        status = os.fstat(held)
        if not stat.S_ISREG(status.st_mode) or not is_own(status) or not lock(held):
            return
        os.lseek(held, 0, os.SEEK_SET)
        if os.read(held, len(SIGNATURE) + 1) != SIGNATURE:
            return
    finally:
        os.close(held)
    shutil.rmtree(folder, ignore_errors=True)


def is_own_folder(path: Path) -> bool:
    """Whether a path is a real folder, no link, that belongs to the user."""
    try:
        status = path.lstat()
    except OSError:
        return False
    return stat.S_ISDIR(status.st_mode) and is_own(status)


def is_own(status: os.stat_result) -> bool:
    """Whether a file with this status belongs to the user; on Windows always true, as it does not tell."""
    return os.name != "posix" or status.st_uid == os.geteuid()


def lock(file: int, *, shared: bool = False, wait: float = 0.0) -> bool:
    """Locks a file until it is closed, or its process ends; returns whether it is then locked so.

    shared : others may lock it so at the same time (on Windows nobody else may)
    wait   : for how long others that have locked it are waited for [s] (on Windows they are not)
    It is not where another has locked it, or where the file system has no locks, as some network drives.
    """
    until = time.monotonic() + (0.0 if sys.platform == "win32" else wait)
    while True:
        try:
            _lock(file, shared=shared)
        except OSError as error:
            if error.errno not in LOCKED_BY_ANOTHER or time.monotonic() >= until:
                return False
        else:
            return True
        time.sleep(0.001)


def is_locked(file: int) -> bool:
    """Whether another has locked a file, which is locked if not; no, where the file system has no locks."""
    try:
        _lock(file, shared=False)
    except OSError as error:
        return error.errno in LOCKED_BY_ANOTHER
    return False


def _lock(file: int, *, shared: bool) -> None:
    """Locks a file, or raises OSError at once."""
    if sys.platform == "win32":
        os.lseek(file, LOCKED_BYTE, os.SEEK_SET)
        msvcrt.locking(file, msvcrt.LK_NBLCK, 1)
    else:
        fcntl.flock(file, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
