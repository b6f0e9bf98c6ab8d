"""The cache on disk: compiled files, results and choices that are kept from one run to the next.

The cache is the folder supervessel-N, N the version of its layout, below the user's cache folder or below the
folder that SUPERVESSEL_CACHE names. It holds generations, folders of which the newest is in use. When that
one has grown large, a new one begins; an older one is removed whole when nobody has used it for an hour.
Nothing outside supervessel-N is ever removed, and no link is followed to remove anything.

Whoever can write into a cache decides what is compiled and which results are believed. So a cache is left
unused if others can write into its folder or it belongs to another user. This is judged by POSIX owners and
permissions; on Windows, where the user's cache folder is closed to others by inheritance, it is not judged.
"""

import errno
import functools
import os
import re
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path

from fmu_build.errors import BuildError
from fmu_build.storage.temporary import (
    folder_of_program,
    is_locked,
    is_own,
    is_own_folder,
    lock,
    place_for_temporary,
)
from supervessel.problems import printable
from supervessel.shell.console import print_problem

LAYOUT = 2
"""Version of the layout of the cache; counted up whenever that changes."""

OURS = f"supervessel-{LAYOUT}"

TAG = "CACHEDIR.TAG"

TAG_TEXT = b"""\
Signature: 8a477f597d28d172789f06886806bc55
# This folder is a cache made by supervessel; see https://bford.info/cachedir/
# `supervessel cache --clear` removes it.
"""

LARGEST = 2 << 30
"""Size of a generation [bytes] beyond which a new one begins."""

MEASURED_EVERY = 256
"""Compilations after which a generation's size is measured: that takes half a second for 100000 files."""

UNUSED = 3600.0
"""Time without use [s] after which an older generation is removed; no compiler runs for half as long."""

ASKED_FOR = 1.0
"""Time [s] within which a program that asks whether a generation is in use has long had its answer."""

LARGEST_FILE = 64 << 20
"""Size [bytes] that no kept result or library reaches; larger files are not read."""

USED, FULL, LOCK = "used", "full", "lock"
"""Files in a generation. `used` has a byte for each compilation and the time of the last use; `full` exists
once the generation is too large; `lock` has a shared lock while a compiler works in it."""

FULL_DISK = (
    errno.ENOSPC,
    errno.EFBIG,
    *(getattr(errno, name) for name in ("EDQUOT",) if hasattr(errno, name)),
)


class UntrustedError(Exception):
    """A cache that is left unused; the message says why."""


def cache_folder() -> Path:
    """Returns the generation of the cache that is in use.

    SUPERVESSEL_CACHE names where the cache is; else it is in the user's cache folder, or where that cannot be
    written a temporary one until the program ends. A cache that others can write is left unused, which is
    said once on stderr, and a temporary one takes its place. Raises BuildError where the named folder cannot
    be used.
    """
    named, base = base_folder()
    try:
        if base is not None:
            _refuse_for_compilers(base)
            return _generation(_opened(base))
    except UntrustedError as why:
        _say(f"the cache is left unused, nothing is kept: {why}")
    except OSError as error:
        if named:
            raise BuildError(f"{_source()}: is no folder that can be written: {error.strerror}") from None
    except ValueError as why:
        if named:
            raise BuildError(f"{_source()}: {why}") from None
        _say(f"{printable(str(base or ''))}: cannot be the cache, nothing is kept: {why}")
    return _temporary()


def base_folder() -> tuple[bool, Path | None]:
    """Returns whether the user has named the folder that the cache is in, and that folder, links followed.

    There is none for a user without a home.
    """
    if named := os.environ.get("SUPERVESSEL_CACHE"):
        return True, Path(os.path.realpath(named))
    system = os.environ.get("XDG_CACHE_HOME" if os.name != "nt" else "LOCALAPPDATA", "")
    try:
        folder = Path(system) if Path(system).is_absolute() else Path.home() / ".cache"
    except RuntimeError:  # a user without a home
        return False, None
    return False, Path(os.path.realpath(folder / "supervessel")) if folder.is_absolute() else None


def _source() -> str:
    return f"SUPERVESSEL_CACHE = {printable(str(os.environ['SUPERVESSEL_CACHE']))}"


def _temporary() -> Path:
    """Returns a cache for as long as the program runs."""
    try:
        folder = folder_of_program()
        _refuse_for_compilers(folder)
    except OSError as error:
        raise BuildError(f"{printable(place_for_temporary())}: {reason(error, 'to compile in')}") from None
    except ValueError as why:
        raise BuildError(f"{printable(str(folder))}: {why}") from None
    return folder


def _refuse_for_compilers(folder: Path) -> None:
    """Raises ValueError for a path that the compiler or its linker cannot work in."""
    wrong = sorted({c for c in str(folder) if c == "%" or c in "\n\r\0"})
    if wrong:
        raise ValueError(f"the compiler works in no folder whose path holds {' or '.join(map(ascii, wrong))}")


def _opened(base: Path) -> Path:
    """Returns the folder of our own below a base, made if need be.

    Raises UntrustedError where others can write it or what it is in, or where it is not of our making;
    OSError where it cannot be made or written.
    """
    for folder in (*reversed(base.parents), base):
        if not folder.exists():
            with suppress(FileExistsError):
                folder.mkdir(0o700)
    if not base.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(base))
    trust_around(base)
    ours = base / OURS
    if not os.path.lexists(ours):
        _make(ours)
    trust(ours)
    if not os.access(ours, os.W_OK | os.X_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(ours))
    return ours


def _make(ours: Path) -> None:
    """Makes our own folder, which appears with its tag."""
    part = Path(tempfile.mkdtemp(dir=ours.parent, prefix=".supervessel-"))  # for the user alone
    try:
        (part / TAG).write_bytes(TAG_TEXT)
        part.rename(ours)
    except OSError:
        shutil.rmtree(part, ignore_errors=True)
        if not os.path.lexists(ours):  # else another run was faster
            raise


def trust(ours: Path) -> None:
    """Raises UntrustedError unless a folder is a real one, of our making and the user's alone to write."""
    status = ours.lstat()
    if not stat.S_ISDIR(status.st_mode):
        raise UntrustedError(f"{printable(str(ours))} is no folder, or a link to one")
    if not is_own(status):
        raise UntrustedError(f"{printable(str(ours))} belongs to another user")
    if os.name == "posix" and status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        changed = "and may have changed what is in it; remove it, and another is made"
        raise UntrustedError(f"others may write {printable(str(ours))} {changed}")
    if read_file(ours / TAG) != TAG_TEXT:
        raise UntrustedError(
            f"{printable(str(ours))} has not been made by supervessel, its {TAG} is another or missing"
        )


def trust_around(base: Path) -> None:
    """Raises UntrustedError where others can put something else in the place of what is in a folder.

    That is where they may write it, or one that it is in, unless that is sticky, as /tmp is; or where the
    folder itself is another user's.
    """
    if os.name != "posix":
        return
    for folder in (base, *base.parents):
        status = folder.stat()
        if status.st_uid not in (0, os.geteuid(), _unknown_user()):
            raise UntrustedError(f"{printable(str(folder))} belongs to another user")
        others = status.st_mode & stat.S_IWOTH or (
            status.st_mode & stat.S_IWGRP and not _is_own_group(status.st_gid)
        )
        if others and not status.st_mode & stat.S_ISVTX:
            raise UntrustedError(f"others may write {printable(str(folder))}, and so replace what is in it")


@functools.cache
def _unknown_user() -> int:
    """Returns the number of all users from outside of a container, who may own the folders above it."""
    try:
        return int(Path("/proc/sys/kernel/overflowuid").read_text())
    except (OSError, ValueError):
        return 0


def _is_own_group(group: int) -> bool:
    """Whether a group is the user's own, with nobody else in it, as many systems give everyone."""
    if sys.platform == "win32":
        return True
    import grp  # noqa: PLC0415
    import pwd  # noqa: PLC0415

    try:
        name = pwd.getpwuid(os.geteuid()).pw_name
        found = grp.getgrgid(group)
    except KeyError:
        return False
    return found.gr_name == name and set(found.gr_mem) <= {name}


def _generation(ours: Path) -> Path:
    """Returns the newest generation of a cache, made if need be; others that nobody uses are removed."""
    numbers = generation_numbers(ours)
    newest = max(numbers, default=0)
    folder = ours / f"generation-{newest}"
    if not _is_private(folder) or os.path.lexists(folder / FULL):
        folder = ours / f"generation-{newest + 1}"
        folder.mkdir(0o700, exist_ok=True)
    _touch(folder / USED)
    for number in numbers:
        other = ours / f"generation-{number}"
        if other != folder and _is_unused(other):
            remove(other)
    return folder


def _is_private(folder: Path) -> bool:
    """Whether a folder is the user's own, and nobody else can reach what is in it."""
    return is_own_folder(folder) and (os.name != "posix" or not folder.lstat().st_mode & 0o077)


@contextmanager
def in_use(generation: Path) -> Iterator[None]:
    """Marks a generation as in use while a compiler works in it: `cache --clear` then leaves it.

    Who asks `is_in_use` has the lock for a moment, which is waited for.
    """
    file = open_lock(generation / LOCK)
    if file is None:  # it goes on without
        yield
        return
    try:
        lock(file, shared=True, wait=ASKED_FOR)
        yield
    finally:
        os.close(file)


def is_in_use(generation: Path) -> bool:
    """Whether a compiler works in a generation."""
    file = open_lock(generation / LOCK)
    if file is None:
        return False
    try:
        return is_locked(file)
    finally:
        os.close(file)


def open_lock(file: Path) -> int | None:
    """Returns the descriptor of a lock file, made if need be; None where it cannot be opened."""
    try:
        return os.open(file, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o600)
    except OSError:
        return None


def generation_numbers(ours: Path) -> list[int]:
    """Returns the numbers of all generations of a cache, by the names of its entries."""
    found = (re.fullmatch(r"generation-(\d{1,18})", name) for name in os.listdir(ours))  # noqa: PTH208
    return [int(match[1]) for match in found if match]


def retire(generation: Path) -> None:
    """Marks a generation as full, so that a new one begins."""
    _touch(generation / FULL)


def _touch(file: Path, more: bytes = b"") -> int:
    """Appends bytes to a file, sets its time to now and returns its size; 0 where that fails."""
    flags = (
        os.O_WRONLY | os.O_APPEND | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    )
    try:
        number = os.open(file, flags, 0o600)
    except OSError:
        return 0
    try:
        if not stat.S_ISREG(os.fstat(number).st_mode):
            return 0
        os.write(number, more)
        os.utime(file)
        return os.fstat(number).st_size
    except OSError:
        return 0
    finally:
        os.close(number)


def _is_unused(generation: Path) -> bool:
    """Whether a generation has not been used for so long that nobody can be using it."""
    for file in (generation / USED, generation):
        with suppress(OSError):
            return abs(time.time() - file.lstat().st_mtime) > UNUSED
    return False


def count_compilation(generation: Path) -> None:
    """Counts a compilation in a generation; every MEASURED_EVERY of them marks it full if it is large."""
    count = _touch(generation / USED, b".")
    if count and count % MEASURED_EVERY == 0 and size_of(generation) > LARGEST:
        retire(generation)


def size_of(folder: Path) -> int:
    """Returns the bytes that a folder's files take on the disk; links are not followed."""
    total = 0
    for place, _, names in os.walk(folder):
        for name in names:
            with suppress(OSError):
                status = os.lstat(os.path.join(place, name))  # noqa: PTH118 (100000 times)
                total += 512 * status.st_blocks if hasattr(status, "st_blocks") else status.st_size
    return total


def remove(path: Path) -> None:
    """Removes a path: a folder of the user's own with all its content, else a file or the link itself."""
    if is_own_folder(path):
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink()


def folder_for(kind: str) -> Path:
    """Returns the folder of a kind in the generation in use; anything else at its path is removed."""
    folder = cache_folder() / kind
    if not is_own_folder(folder):
        remove(folder)
        folder.mkdir(0o700, exist_ok=True)
    return folder


def place_of_result(kind: str, question: bytes) -> Path:
    """Returns the file in which the answer to a question is kept.

    kind     : folder in the cache
    question : all that the answer depends on
    """
    return folder_for(kind) / f"{sha256(question).hexdigest()}.json"


def place_of_library(question: bytes) -> Path:
    """Returns the file in which the library is kept that was compiled from all that `question` holds."""
    return folder_for("libraries") / sha256(question).hexdigest()


def keep_bytes(place: Path, content: bytes) -> None:
    """Writes a file of a digest and the bytes; the digest is of bytes and file name. Ignores a failure."""
    with suppress(OSError), tempfile.NamedTemporaryFile(dir=place.parent, delete=False) as part:
        try:
            part.write(_digest(place, content) + content)
            part.close()
            _replace(place, Path(part.name))
        except OSError:
            Path(part.name).unlink()
            raise


def _replace(place: Path, part: Path) -> None:
    """Puts a file in the place of another, which is there until then, or of a folder."""
    try:
        part.replace(place)
    except OSError:
        remove(place)
        part.replace(place)


def read_bytes(place: Path) -> bytes | None:
    """Returns the bytes that `keep_bytes` wrote; None where there is no such file or its digest is wrong."""
    whole = read_file(place) or b""
    digest, content = whole[:32], whole[32:]
    return content if content and digest == _digest(place, content) else None


def _digest(place: Path, content: bytes) -> bytes:
    return sha256(place.name.encode() + b"\0" + content).digest()


def read_file(file: Path) -> bytes | None:
    """Returns the content of a regular file of up to LARGEST_FILE bytes, None for anything else.

    A link is not followed, and a pipe or device is not waited for.
    """
    flags = os.O_RDONLY
    for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_BINARY"):
        flags |= getattr(os, name, 0)
    try:
        number = os.open(file, flags)
    except OSError:
        return None
    try:
        status = os.fstat(number)
        if not stat.S_ISREG(status.st_mode) or status.st_size > LARGEST_FILE:
            return None
        with open(number, "rb", closefd=False) as stream:
            return stream.read(status.st_size)
    except OSError:
        return None
    finally:
        os.close(number)


def reason(error: OSError, purpose: str) -> str:
    """Returns an error's reason for a message: that the disk is full, or the system's own words."""
    words = error.strerror or str(error)
    return f"no room {purpose}: {words}" if error.errno in FULL_DISK else words


@functools.cache
def _say(message: str) -> None:
    """Prints a line on stderr, once."""
    print_problem(message)
